# SPDX-License-Identifier: BSD-3-Clause
"""`measure`: signature, defaults and documentation; the work is done in C."""

from __future__ import annotations

from typing import Any, Literal, Never, TypedDict, Unpack, overload

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.foreign import kind_of
from halfshell._convert.listed import as_listed
from halfshell._convert.scene import as_scene
from halfshell._convert.types import ArrayLike, Arrays, BoxLike, PeriodicLike, PointsLike
from halfshell._unknown import refuse_unknown

_LETTERS = "dDS"


class _MeasureOptions(TypedDict, total=False):
    """For overloads: the keywords of `measure`, without `quantities`."""

    box: BoxLike | None
    periodic: PeriodicLike | None
    kernel: str | None
    threads: int | None
    memory_limit: float | None


@overload
def measure(
    points: PointsLike,
    i: ArrayLike,
    j: ArrayLike,
    S: ArrayLike | None = None,
    *,
    quantities: Literal["dDS"] = "dDS",
    **options: Unpack[_MeasureOptions],
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.int32]]: ...
@overload
def measure(
    points: PointsLike,
    i: ArrayLike,
    j: ArrayLike,
    S: ArrayLike | None = None,
    *,
    quantities: Literal["d", "D", "S"],
    **options: Unpack[_MeasureOptions],
) -> npt.NDArray[Any]: ...
@overload
def measure(
    points: PointsLike,
    i: ArrayLike,
    j: ArrayLike,
    S: ArrayLike | None = None,
    *,
    quantities: str,
    **options: Unpack[_MeasureOptions],
) -> Arrays: ...
def measure(
    points: PointsLike,
    i: ArrayLike,
    j: ArrayLike,
    S: ArrayLike | None = None,
    *,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    quantities: str = "dDS",
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    **unknown: Never,
) -> Arrays:
    """Measure given pairs, in the nearest image or in given images; always exact.

    Parameters
    ----------
    points, box, periodic, kernel, threads
        As in `pairs`.
    i, j : array_like of int, shape (m,)
        Point numbers of each pair, in any order; pairs may repeat, and i may equal j.
    S : array_like of int, shape (m, d), optional
        The image of j, 0 along axes that are not periodic. Default: the image nearest to
        i; of several equally near, the one with the lexicographically least S. This is decided
        exactly for the real values of the inputs. The nearest image of a point to itself is the
        point, S = 0.
    quantities : str, default "dDS"
        Any of the letters ``d D S``, each at most once: distance, vector, shift. Only these are
        computed.
    memory_limit : float, optional
        Bytes that the result and a copy of the points may take. Default: what the machine and its
        control group have available.

    Returns
    -------
    ndarray or tuple of ndarray
        One array per letter of `quantities`, in that order; a bare array for one letter. One entry
        per pair, in their order: ``d`` float64 (m,), ``D`` float64 (m, d), both in the unit of
        `points`; ``S`` int32 (m, d). In real arithmetic ``D = points[j] - points[i] + S @ box``.
        d is within 1 ulp, each component of D within 1 ulp of d.

    Raises
    ------
    TypeError
        If `i`, `j` or `S` does not hold whole numbers, or another argument is of the wrong kind.
    ValueError
        If `i`, `j` and `S` do not fit each other or the points, `S` is not 0 along an axis that
        is not periodic, a letter is not one of ``d D S``, or `pairs` would refuse the points or
        box; or if the box is so skewed, or so long and thin without being aligned with the
        coordinate axes, that float64 cannot tell which images are near.
    OverflowError
        If a point is more than 2**51 box vectors away and `S` is not given, an S to return
        does not fit int32, or a vector does not fit float64.
    MemoryError
        If the result would not fit `memory_limit`.

    See Also
    --------
    pairs : find pairs, and measure them.
    nearest : the nearest points, or images.

    Notes
    -----
    Use it for fixed edges, such as bonds, and for lists from other programs. For pairs found by
    `pairs`, with their S, d and D are the same as there, but for a d that rounds to the cutoff of a
    search with ``inclusive=False``, which is the next smaller number there. The nearest image is
    found in a short basis of the box: axis by axis if it is aligned with the coordinate axes,
    otherwise among all images within the distance of a near one. Images that rounding cannot tell
    apart are compared exactly.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.1, 0.5], [0.9, 0.5], [0.6, 0.5]]
    >>> d, D, S = hs.measure(points, [0, 0], [1, 2], box=[1.0, 1.0])
    >>> d.round(12).tolist(), S.tolist()
    ([0.2, 0.5], [[-1, 0], [0, 0]])
    >>> hs.measure(points, [0], [1], [[0, 0]], box=[1.0, 1.0], quantities="d").tolist()
    [0.8]
    """
    if unknown:
        refuse_unknown(measure, unknown)
    if not isinstance(quantities, str):
        raise TypeError(f"quantities must be a string, got {kind_of(quantities)}")
    if not quantities or not set(quantities) <= set(_LETTERS) or (
        len(set(quantities)) < len(quantities)
    ):
        raise ValueError(
            f"quantities must be some of the letters {' '.join(_LETTERS)}, each at most once, got "
            f"{quantities!r}"
        )
    array, vectors, bits = as_scene(points, box, periodic)
    first, second, shifts = as_listed(i, j, S, array.shape[1], len(array))
    return _core.measure(
        array, 0.0, vectors, bits, True, "exact", kernel, memory_limit, None, threads,
        quantities, first, second, shifts,
    )  # fmt: skip
