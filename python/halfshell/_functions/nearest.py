# SPDX-License-Identifier: BSD-3-Clause
"""`nearest`: signature, defaults and documentation; the work is done in C."""

from __future__ import annotations

from typing import Any, Literal, Never, TypedDict, Unpack, overload

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.batch import as_systems, check_no_batch
from halfshell._convert.given import Given
from halfshell._convert.nearest import as_k, as_max_distance, check_max_distances, in_rows
from halfshell._convert.options import as_index_bytes
from halfshell._convert.scene import as_sets
from halfshell._convert.types import Arrays, BoxLike, Number, PeriodicLike, PointsLike
from halfshell._unknown import refuse_unknown


class _NearestOptions(TypedDict, total=False):
    """For overloads: the keywords of `nearest`, without `quantities`."""

    queries: PointsLike | None
    max_distance: Number
    box: BoxLike | None
    periodic: PeriodicLike | None
    index_dtype: npt.DTypeLike
    kernel: str | None
    threads: int | None
    memory_limit: float | None
    batch: npt.ArrayLike | None
    query_batch: npt.ArrayLike | None


@overload
def nearest(
    points: PointsLike,
    k: int,
    *,
    quantities: Literal["jd"] = "jd",
    **options: Unpack[_NearestOptions],
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]: ...
@overload
def nearest(
    points: PointsLike,
    k: int,
    *,
    quantities: Literal["j", "d", "D", "S"],
    **options: Unpack[_NearestOptions],
) -> npt.NDArray[Any]: ...
@overload
def nearest(
    points: PointsLike, k: int, *, quantities: str, **options: Unpack[_NearestOptions]
) -> Arrays: ...
def nearest(
    points: PointsLike,
    k: int,
    *,
    queries: PointsLike | None = None,
    max_distance: Number = np.inf,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    quantities: str = "jd",
    index_dtype: npt.DTypeLike = np.int64,
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    batch: npt.ArrayLike | None = None,
    query_batch: npt.ArrayLike | None = None,
    **unknown: Never,
) -> Arrays:
    """Find the k nearest points of each point or query, in an order that is always exact.

    Parameters
    ----------
    points, box, periodic, index_dtype, kernel, threads
        As in `pairs`.
    k : int
        Number of neighbours, 1 or more. In a periodic box each image of a point counts separately,
        so k may be larger than n.
    queries : array_like of float, shape (q, d), optional
        Coordinates of queries, in the unit of `points`; they may lie anywhere, even outside the
        box. A query that coincides with a point has it as a neighbour at distance 0. Default: the
        points themselves; a point is left out of its own row, but its images are not.
    max_distance : float, default infinity
        Largest distance of a neighbour, inclusive; not negative.
    quantities : str, default "jd"
        Any of the letters ``j d D S``, each at most once: index of the point, distance, vector,
        shift. Only these are computed.
    memory_limit : float, optional
        Bytes that search and result may take. Default: what the machine and its control group
        have available.
    batch : array_like of int, shape (n,), optional
        Many systems in one call, as in `pairs`: the system of each point, ascending. Neighbours
        are in the same system; j numbers the points of all. `max_distance` may have shape (s,).
    query_batch : array_like of int, shape (q,), optional
        The system of each query, ascending; with `batch` and `queries`, and only then.

    Returns
    -------
    ndarray or tuple of ndarray
        One array per letter of `quantities`, in that order; a bare array for one letter. With q
        rows, one for each query or point: ``j`` of `index_dtype`, shape (q, k); ``d`` float64
        (q, k); ``D`` float64 (q, k, d); ``S`` int32 (q, k, d). In real arithmetic
        ``D = points[j] - queries[i] + S @ box``.

        Rows ascend by exact distance, and at equal distances by (j, S). If there are fewer than k
        points, or fewer within `max_distance`, the
        rest of the row is j = -1, d = infinity, D = NaN and S = 0. d is within 1 ulp, ascends along
        the row and is never above `max_distance`; each component of D is within 1 ulp of d.

    Raises
    ------
    TypeError
        If `k` is not an integer, or another argument is of the wrong kind, as for `pairs`.
    ValueError
        If `k` is less than 1, `max_distance` is negative or NaN, `queries` do not have the
        dimension of the points, or a letter is not one of ``j d D S``; otherwise as for `pairs`.
    OverflowError
        As for `pairs`.
    MemoryError
        If the result would not fit `memory_limit`; or if a query is so far from periodic points,
        well beyond 10**8 periods, that the images at nearly equal distances do not fit in memory.

    See Also
    --------
    pairs : all pairs within a cutoff.

    Notes
    -----
    Points are sorted into cells that each hold a few of them, whatever their density. A group of
    neighbouring queries looks at the cells within a radius guessed from the local density.
    float32 with a proven error bound discards distant points, float64 sorts the rest, and
    distances too close to tell apart are compared in double-word arithmetic, then in integers. A
    query that found too few is searched again with a radius that surely suffices. So the time
    depends on n and k, even for strongly clustered points.

    If you come from SciPy: missing neighbours have j = -1 here, not n, and the row of a point
    does not begin with the point itself.

    Examples
    --------
    >>> import numpy as np
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]
    >>> j, d = hs.nearest(points, 2)
    >>> j.tolist(), d.tolist()
    ([[1, 2], [0, 2], [1, 0]], [[1.0, 3.0], [1.0, 2.0], [2.0, 3.0]])

    Rows with missing neighbours, masked:

    >>> j, d = hs.nearest(points, 2, max_distance=1.5)
    >>> j.tolist()
    [[1, -1], [0, -1], [-1, -1]]
    >>> np.ma.masked_equal(j, -1).tolist(), d[j >= 0].tolist()
    ([[1, None], [0, None], [None, None]], [1.0, 1.0])

    In a periodic box, and for queries:

    >>> j, d, S = hs.nearest(points, 2, queries=[[3.5, 0.0]], box=[4.0, 4.0], quantities="jdS")
    >>> j.tolist(), d.tolist(), S.tolist()
    ([[0, 2]], [[0.5, 0.5]], [[[1, 0], [0, 0]]])
    """
    if unknown:
        refuse_unknown(nearest, unknown)
    k, own = as_k(k), None
    if batch is None:
        check_no_batch(query_batch)
        reach = as_max_distance(max_distance)
        asking, array, vectors, bits = as_sets(queries, points, box, periodic)
    else:
        scene, own, _, asking = as_systems(
            points, check_max_distances(max_distance), box, periodic, batch, Given(),
            queries=queries, query_batch=query_batch,
        )  # fmt: skip
        array, reach, vectors, bits = scene
    result = _core.nearest(
        array, reach, vectors, bits, True, "exact", kernel, memory_limit, None, threads,
        quantities, as_index_bytes(index_dtype), asking, k, own,
    )
    return in_rows(result, len(array if asking is None else asking), k)
