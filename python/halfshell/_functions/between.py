# SPDX-License-Identifier: BSD-3-Clause
"""`pairs_between`, and what counts the pairs of two sets; the work is done in C."""

from __future__ import annotations

from typing import Any, Literal, Unpack, cast, overload

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert import inputs as _inputs
from halfshell._convert.options import ArrayOptions, Precision, Rest
from halfshell._functions.cutoffs import count_within
from halfshell._functions.pairs import Arrays, Letter
from halfshell._objects.box import Box


@overload
def pairs_between(
    queries: Any,
    points: Any,
    cutoff: Any,
    *,
    quantities: Literal["ij"] = "ij",
    **options: Unpack[ArrayOptions],
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]: ...
@overload
def pairs_between(
    queries: Any, points: Any, cutoff: Any, *, quantities: Letter, **options: Unpack[ArrayOptions]
) -> npt.NDArray[Any]: ...
@overload
def pairs_between(
    queries: Any, points: Any, cutoff: Any, *, quantities: str, **options: Unpack[ArrayOptions]
) -> Arrays: ...
def pairs_between(
    queries: Any,
    points: Any,
    cutoff: Any,
    *,
    box: Any = None,
    periodic: Any = None,
    quantities: str = "ij",
    inclusive: bool = True,
    sort: bool = True,
    index_dtype: npt.DTypeLike = np.int64,
    out: Any = None,
    precision: Precision = "exact",
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
) -> Arrays:
    """Find every pair of a query and a point within a cutoff.

    Parameters
    ----------
    queries : array_like of float, shape (q, d)
        Coordinates that ask, in the unit of `points`, as many columns as these. They may lie
        anywhere, also far from all points or outside the box. float32 beside float64 is fine:
        each number is used as it is.
    points : array_like of float, shape (n, d)
        Coordinates that are found, as in `pairs`. An object such as ``ase.Atoms`` brings its box;
        `queries` may be another one with the same box.
    cutoff, box, periodic, inclusive, index_dtype, out, precision, kernel, threads, memory_limit
        As in `pairs`.
    quantities : str, default "ij"
        Any of the letters ``i j d D S P``, each at most once, as in `pairs`.
    sort : bool, default True
        The order is ascending (i, j, S) in any case; False allows another one in later versions.

    Returns
    -------
    ndarray or tuple of ndarray
        One array per letter of `quantities`, in that order; a bare array for one letter. Types and
        shapes are those of `pairs`: i is the number of a query, j that of a point, and in real
        arithmetic ``D = points[j] - queries[i] + S @ box``.

        Nothing is left out: a query that lies on a point is its neighbour at distance 0, also
        where both arrays are the same one, and each image of a point within the cutoff is a pair.

    Raises
    ------
    TypeError, ValueError, CapacityError, OverflowError, MemoryError
        As `pairs`, which see; ValueError also if `queries` have another number of columns than
        `points`, or a box that is not theirs.

    See Also
    --------
    neighbors : the same as a table, a row for each query.
    count_pairs : how many there are.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]
    >>> i, j, d = hs.pairs_between([[0.5, 0.0], [9.0, 9.0]], points, 1.0, quantities="ijd")
    >>> i.tolist(), j.tolist(), d.tolist()
    ([0, 0], [0, 1], [0.5, 0.5])

    Each point is found by a query at the same place:

    >>> i, j = hs.pairs_between(points, points, 1.0)
    >>> i.tolist(), j.tolist()
    ([0, 0, 1, 1, 2], [0, 1, 0, 1, 2])
    """
    if type(box) is Box:
        box = box.vectors
    result: Any = _core.plain_between(
        points, cutoff, box, periodic, inclusive, precision, kernel, memory_limit, None, threads,
        quantities, sort, index_dtype, out, queries,
    )
    if result is not NotImplemented:
        return cast(Arrays, result)
    _inputs.check_apart(out, queries=queries, points=points, box=box)
    asking, array, vectors, bits = _inputs.two_sets(queries, points, box, periodic)
    return _core.pairs_between(
        array, _inputs.as_cutoff(cutoff), vectors, bits, _inputs.as_flag(inclusive, "inclusive"),
        precision, kernel, memory_limit, None, threads, quantities, _inputs.as_flag(sort, "sort"),
        _inputs.as_index_bytes(index_dtype), out, asking,
    )


def count_between(
    queries: Any, points: Any, cutoff: Any, box: Any, periodic: Any, rest: Rest
) -> int | npt.NDArray[np.int64]:
    """`count_pairs` of two sets."""
    asking, array, vectors, bits = _inputs.two_sets(queries, points, box, periodic)
    cutoffs = _inputs.as_cutoffs(cutoff)
    if isinstance(cutoffs, float):
        return _core.count_between(array, cutoffs, vectors, bits, *rest, asking)
    return count_within(cutoffs, array, vectors, bits, rest, asking)
