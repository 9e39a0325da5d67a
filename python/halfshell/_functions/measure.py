# SPDX-License-Identifier: BSD-3-Clause
"""`measure`: the vectors and lengths of given pairs."""

from __future__ import annotations

import re
from contextlib import closing, nullcontext
from typing import TYPE_CHECKING, Any, Literal, cast, overload

import numpy as np

from halfshell import _core
from halfshell._convert.arrays import as_listed
from halfshell._convert.call import Call, part_of, take
from halfshell._convert.options import check_letters
from halfshell._convert.points import refuse_infinite
from halfshell._functions.pairs import pairs
from halfshell._search import search

if TYPE_CHECKING:
    from typing import TypedDict, Unpack

    import numpy.typing as npt

    from halfshell._convert.types import (
        ArrayLike,
        Arrays,
        BoxLike,
        PeriodicLike,
        PointsLike,
        ProgressLike,
    )

    class _MeasureOptions(TypedDict, total=False):
        """For overloads: the keywords of `measure`, without `quantities`."""

        queries: PointsLike | None
        box: BoxLike | None
        periodic: PeriodicLike | None
        threads: int | None
        progress: ProgressLike


_LETTERS = "dDS"


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
@search(like=pairs, lacks="rule exclude min_distance indices inclusive")
def measure(
    points: PointsLike,
    i: ArrayLike,
    j: ArrayLike,
    S: ArrayLike | None = None,
    *,
    queries: PointsLike | None = None,
    quantities: str = "dDS",
    **search: Any,
) -> Arrays:
    """Measure given pairs, in the nearest image or in given images; always exact.

    Parameters
    ----------
    {points}
    i, j : array_like of int, shape (m,)
        Point numbers of each pair, in any order; pairs may repeat, and i may equal j. Of a batch
        both are points of one system.
    S : array_like of int, shape (m, d), optional
        The image of j, 0 along axes that are not periodic. Default: the image nearest to
        i; of several equally near, the one with the lexicographically least S. This is decided
        exactly for the real values of the inputs. The nearest image of a point to itself is the
        point, S = 0.
    queries : array_like of float, shape (q, d), or Points, optional
        Where `i` numbers points of another set: their coordinates.
    {box, periodic}
    quantities : str, default "dDS"
        Any of the letters ``d D S``, each at most once: distance, vector, shift. Only these are
        computed.
    {threads, progress}

    Returns
    -------
    ndarray or tuple of ndarray
        One array per letter of `quantities`, in that order; a bare array for one letter. One entry
        per pair, in their order: ``d`` float64 (m,), ``D`` float64 (m, d), both in the unit of
        `points`; ``S`` int32 (m, d). In real arithmetic ``D = points[j] - points[i] + S @ box``.
        d is within 1 ulp, each component of D within 1 ulp of d.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pairs`. ValueError also if `i`, `j` and `S` do not fit each other or the points, or
        the box is so skewed, or so long and thin without being aligned with the coordinate axes,
        that float64 cannot tell which images are near. OverflowError also if a point is more than
        2**51 box vectors away and `S` is not given.

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
    check_letters(quantities, _LETTERS)
    call = take(points, 0.0, queries, by_reach=False, **search)
    call.settings, call.cells = call.settings._replace(precision="exact"), None
    n, ndim = call.array.shape
    n_queries = None if call.queries is None else len(call.queries)
    listed = as_listed(i, j, S, ndim, n, n_queries)
    if call.points.batch is None:
        return _measured(call, quantities, *listed)
    return _measured_in_systems(call, quantities, *listed)


def _measured(call: Call, quantities: str, first: Any, second: Any, shifts: Any) -> Arrays:
    if call.asking is not None:  # one set, the queries behind the points
        refuse_infinite(call.array, "points")
        refuse_infinite(call.asking, "queries")
        first = first + len(call.points)
        call.points = call.points.replace(
            **dict.fromkeys(("radii", "types", "supports", "groups", "labels", "weights")),
            positions=np.concatenate([call.array, call.asking]),
        )
    return cast("Arrays", call.run(_core.measure, quantities, first, second, shifts))


def _measured_in_systems(
    call: Call, quantities: str, first: Any, second: Any, shifts: Any
) -> Arrays:
    """Each pair in the box of the one system that it is of."""
    from halfshell._convert.systems import each_system  # few calls need it

    own = call.points.batch
    asking = own if call.queries is None else call.queries.batch
    assert own is not None and asking is not None
    if not len(call.points):
        call.points = call.points.replace(box=None, batch=None)
        return _measured(call, quantities, first, second, shifts)
    for n in np.flatnonzero(asking[first] != own[second]):
        raise ValueError(
            f"pair {n} is of two systems: i[{n}] of system {asking[first[n]]}, j[{n}] of system "
            f"{own[second[n]]}"
        )
    bar, told, call.bar = call.bar, call.progress, None
    order = np.argsort(own[second], kind="stable")
    sorted_systems = own[second][order]
    n_systems = 1 + int(np.count_nonzero(np.diff(own)))  # that have points
    columns: list[list[Any]] = [[] for _ in quantities]
    with nullcontext() if bar is None else closing(bar):
        for k, (one, begin) in enumerate(each_system(call)):
            s = own[begin]
            some = order[slice(*np.searchsorted(sorted_systems, [s, s + 1]))]
            if not len(some) and k:  # but the first, for the shapes
                continue
            one.progress = told and part_of(told, k, n_systems)
            try:
                found = _measured(
                    one, quantities, first[some] - np.searchsorted(asking, s), second[some] - begin,
                    None if shifts is None else shifts[some],
                )  # fmt: skip
            except (OverflowError, ValueError) as error:
                if named := re.match(r"pair (\d+)", str(error)):  # of those of this system
                    rest = str(error)[named.end() :]
                    raise type(error)(f"pair {some[int(named[1])]}{rest}") from None
                raise
            parts = found if len(quantities) > 1 else [found]
            for column, part in zip(columns, parts, strict=True):
                column.append(part)
    back = np.argsort(order)
    arrays = tuple(np.concatenate(column)[back] for column in columns)
    return arrays if len(arrays) > 1 else arrays[0]
