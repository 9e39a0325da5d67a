# SPDX-License-Identifier: BSD-3-Clause
"""Rows of neighbours: all within a cutoff `neighbors`, their number `coordination`, k `nearest`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, cast, overload

import numpy as np

from halfshell import _core
from halfshell._convert.arrays import rows_of
from halfshell._convert.call import DIRECTED, Call, check_shells, each_cutoff, shells_of, take
from halfshell._convert.lengths import as_k, check_max_distances, in_rows
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.options import AUTO, as_flag, as_index_bytes, check_letters
from halfshell._convert.points import Points
from halfshell._functions.indices import rows_of_some
from halfshell._functions.pairs import pairs
from halfshell._objects.exact import LateOrigin, Origin, copied
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._search import search

if TYPE_CHECKING:
    from typing import Unpack

    import numpy.typing as npt

    from halfshell._convert.types import (
        ArrayLike,
        Arrays,
        CutoffLike,
        NearestOptions,
        OptionsOfPoints,
        PointsLike,
    )


# ---- a table -------------------------------------------------------------------------------

def _as_table(arrays: Any, points: Any, cutoff: Any = None, **options: Any) -> NeighborTable:
    """The table of a call with plain arguments, which C has answered."""
    quantities = options.get("quantities", "j")
    queries = options.get("queries")
    if "d" not in quantities or "j" not in quantities:  # it cannot be sorted
        return NeighborTable(arrays, quantities, len(points), queries is None)
    own = copied((points, cutoff, queries))  # the caller's arrays may change until it is sorted
    given = {
        name: copied(options[name]) for name in ("box", "periodic", "inclusive", "threads")
        if name in options
    }  # fmt: skip

    def find_origin() -> Origin | None:
        call = take(*own, directed=True, **given)
        return _origin_of(call, call.asking, call.query_set, call.pairing, quantities)

    can_wait = type(points) is np.ndarray and (queries is None or type(queries) is np.ndarray)
    origin: Any = LateOrigin(find_origin) if can_wait else find_origin()
    return NeighborTable(arrays, quantities, len(points), queries is None, origin=origin)


@search("neighbors", finish=_as_table)
def neighbors(
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    queries: PointsLike | None = None,
    quantities: str = "j",
    index_dtype: npt.DTypeLike = np.int64,
    **search: Unpack[OptionsOfPoints],
) -> NeighborTable:
    """Find the neighbours of each point, or of each query, within a cutoff, as a table.

    Parameters
    ----------
    {points, shells, queries, box, periodic, rule, exclude, min_distance, indices, inclusive}
    quantities : str, default "j"
        Any of the letters ``j d D S``, each at most once: numbers of the neighbours, distances,
        vectors, shifts. Only these are computed, and the table has no others. With several cutoffs
        also ``k``, as in `pairs`: the `shells` of the table.
    {index_dtype, threads, progress}

    Returns
    -------
    NeighborTable
        Row i holds the neighbours j of point i, ascending by (j, S), with
        ``D = points[j] - points[i] + S @ box`` in real arithmetic. This is a full list: it has
        both (i, j, S) and (j, i, -S), with the same d and the opposite D. Without `queries` a
        point is not a neighbour of itself, but its images within the cutoff are. With queries
        nothing is left out. With the rules "gather" and "scatter" (i, j, S) may occur without
        (j, i, -S), and ``reverse()`` and ``to_pairs(half=True)`` of the table raise an error.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pairs_between`.

    Notes
    -----
    The points are searched twice, once to count and once to write each row in place, so that
    nothing is stored besides the result. The table is the same for any number of threads.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]
    >>> table = hs.neighbors(points, 2.0, quantities="jd")
    >>> j, d = table[1]
    >>> j.tolist(), d.tolist()
    ([0, 2], [1.0, 2.0])
    >>> table.offsets.tolist(), table.indices.tolist()
    ([0, 1, 3, 4], [1, 0, 2, 1])

    Rows of queries:

    >>> [row.tolist() for row in hs.neighbors(points, 1.5, queries=[[2.0, 0.0], [9.0, 9.0]])]
    [[1, 2], []]

    Rows of some of the points, which are not neighbours of themselves:

    >>> [row.tolist() for row in hs.neighbors(points, 2.0, indices=[2, 1])]
    [[1], [0, 2]]

    The neighbours of each point within its own radius:

    >>> balls = hs.Points(points, radii=[0.5, 1.5, 3.0])
    >>> [row.tolist() for row in hs.neighbors(balls, None, rule="gather")]
    [[], [0], [0, 1]]

    The first and the second shell:

    >>> table = hs.neighbors(points, [1.0, 3.0], quantities="jk")
    >>> [list(zip(j.tolist(), k.tolist())) for j, k in table]
    [[(1, 0), (2, 1)], [(0, 0), (2, 1)], [(0, 1), (1, 1)]]
    """
    call = take(
        points, cutoff, queries, directed=True, several=shells_of(quantities, "jdDS"), **search
    )
    check_shells(call, quantities)
    index_bytes = as_index_bytes(index_dtype)
    if call.indices is not None:
        return _table_of_some(call, quantities, index_bytes)
    return _table_of(call, listed(call, quantities, index_bytes), quantities)


def listed(call: Call, quantities: str, index_bytes: int) -> Any:
    """Offsets and columns of the rows of a call."""
    return call.run(
        _core.neighbors, quantities, index_bytes, call.query_set, call.pairing,
        call.settings.algorithm, call.shells,
    )  # fmt: skip


_rows = search("neighbors")(cast("Any", neighbors).__wrapped__)


def arrays_of_rows(*arguments: Any, **options: Any) -> Any:
    """Offsets and columns of `neighbors`: where C answers, without a table of them."""
    found = _rows(*arguments, **options)
    return found if type(found) is tuple else found._arrays


@search("pairs_of_rows")
def pairs_of_rows(
    points: Any,
    cutoff: Any,
    *,
    queries: Any = None,
    quantities: str = "ij",
    index_dtype: npt.DTypeLike = np.int64,
    **search: Any,
) -> Any:
    """Columns of `neighbors`, i being the number of the row; the arrays are the caller's."""
    call = take(points, cutoff, queries, directed=True, **search)
    return call.run(
        _core.pairs_of_rows, quantities, as_index_bytes(index_dtype), call.query_set,
        call.pairing, call.settings.algorithm,
    )  # fmt: skip


def _table_of(call: Call, arrays: Any, quantities: str) -> NeighborTable:
    is_full = call.queries is None and call.rule not in DIRECTED
    origin = _origin_of(call, call.asking, call.query_set, call.pairing, quantities)
    return NeighborTable(arrays, quantities, len(call.points), is_full, origin=origin)


def _table_of_some(call: Call, quantities: str, index_bytes: int) -> NeighborTable:
    """The rows of some points; sorting them exactly needs what the search found."""
    rows = rows_of_some(call, quantities, index_bytes)
    numbers, order = rows.numbers, None
    if call.points.batch is not None:  # a search has systems one after the other
        order = np.argsort(call.points.batch[numbers], kind="stable")
        numbers = numbers[order]
    origin = _origin_of(
        call, call.array[rows.numbers], *call.as_queries(numbers), quantities, order
    )
    return NeighborTable(
        (rows.offsets, *rows.columns), quantities, len(call.points), False, origin=origin,
        entries=rows.entries,
    )  # fmt: skip


def _origin_of(
    call: Call, asking: Any, queries: Any, pairing: Any, quantities: str, order: Any = None
) -> Origin | None:
    """What sorting a table by exact distance needs, where it can be sorted.

    queries, pairing: as the core takes them, with the queries in this order.
    """
    if "d" not in quantities or "j" not in quantities:
        return None
    points, is_own = call.points, call.cells is not None  # cells own their points
    # The caller's arrays may change; the table keeps positions itself.
    known, known_of_queries, scene, pairing = copied(
        ((*call.known, call.firsts(points.batch)), queries and queries[1:], call.scene,
         pairing and tuple(pairing))
    )  # fmt: skip
    rest: Any = list(call.rest)
    rest[2:5] = None, None, None  # kernel, memory_limit, progress

    def find_shifts(origin: Origin) -> npt.NDArray[Any]:
        places: Any = origin.queries
        places = places if order is None else places[order]
        asked = None if places is None else (places, *known_of_queries)
        search = (origin.points, *known), *scene, *rest
        _, shifts = _core.neighbors(*search, "S", 8, asked, pairing, AUTO)
        return cast("npt.NDArray[Any]", shifts)

    if points.box is None or (points.box.ndim == 2 and not np.ndim(points._axes)):
        asking = asking.copy() if is_own and asking is not None else asking
        bits = 0 if points.box is None else call.bits
        return Origin(points.positions, asking, points.box, bits, find_shifts, is_own=is_own)
    flags = points.periodic  # what does not repeat is multiplied by no shift
    assert flags is not None
    boxes = np.broadcast_to(points.box, (points.n_systems, *points.box.shape[-2:]))
    boxes = boxes * np.broadcast_to(flags, boxes.shape[:2])[:, :, None]
    asked_in = rows_of(known[-1] if known_of_queries is None else known_of_queries[-1])
    if order is not None:
        asked_in = asked_in[np.argsort(order)]
    bits = (1 << boxes.shape[1]) - 1
    return Origin(points.positions, asking, boxes, bits, find_shifts, asked_in)


def entries_of(
    points: npt.NDArray[Any], cutoff: Any, box: Any, periodic: Any,
    batch: npt.NDArray[Any] | None, half: bool, inclusive: bool,
) -> tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any]]:  # fmt: skip
    """i, j and S of a full or half list, ascending by (i, j, S), for lists of tensors."""
    given = Points._of(points, "points", box, periodic, batch)
    if as_flag(half, "half"):
        i, j, S = pairs(given, cutoff, quantities="ijS", sort=True, inclusive=inclusive)
    else:
        table = neighbors(given, cutoff, quantities="jS", inclusive=inclusive)
        i, j, S = table.to_pairs(quantities="ijS")
    return i, j, S


# ---- the lengths of its rows ---------------------------------------------------------------

@search("coordination")
def coordination(
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    queries: PointsLike | None = None,
    by_type: bool = False,
    **search: Unpack[OptionsOfPoints],
) -> npt.NDArray[np.int64]:
    """Count the neighbours of each point, or of each query.

    Parameters
    ----------
    {points}
    cutoff : float, array_like of float, shape (k,), (s,) or (t, t), dict or None
        As in `pairs`; with several, ascending, there are counts for each.
    {queries, box, periodic, rule, exclude, min_distance, indices, inclusive}
    by_type : bool, default False
        Count the neighbours of each type separately, by the `types` of the points. They are listed
        for this, and so they are for `indices`.
    {threads, progress}

    Returns
    -------
    ndarray of int64, shape (n,), (q,) or (r,)
        Length of each row of the full list; each image counts. The sum is twice `count_pairs`, or
        equal to it with `queries`, except for rules with a direction.

        By type the shape is (n, t), (q, t) or (r, t): column k counts the neighbours of type k, or
        those with name k of ``np.unique(types)``. The sum of a row is the count without types.
        ValueError if the points have no types.

        With several cutoffs, ascending, each has such an array: they come first, as one more axis.
        Each of them is searched for.

    Examples
    --------
    >>> import halfshell as hs
    >>> hs.coordination([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]], 2.0).tolist()
    [1, 2, 1]
    >>> balls = hs.Points([[0.0], [1.0], [3.0]], radii=[1.0, 0.5, 1.0])
    >>> hs.coordination(balls, None, rule="max").tolist()
    [1, 1, 0]
    >>> hs.coordination([[0.0], [1.0], [3.0]], [1.0, 2.0, 3.0]).tolist()
    [[1, 1, 0], [1, 2, 1], [2, 2, 2]]

    The number of neighbours of each element:

    >>> atoms = hs.Points([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]], types=["Si", "O", "O"])
    >>> hs.coordination(atoms, 2.0, by_type=True).tolist()  # columns: O, Si
    [[1, 0], [1, 1], [1, 0]]
    """
    call = take(points, cutoff, queries, directed=True, several="counts", **search)
    is_by_type = as_flag(by_type, "by_type")
    if call.shells is None:
        return _lengths(call, is_by_type)
    return np.stack([_lengths(one, is_by_type) for one in each_cutoff(call)])


def _lengths(call: Call, by_type: bool) -> npt.NDArray[np.int64]:
    """How many neighbours each row has, or how many of each type."""
    if by_type:
        return _count_by_type(call)
    if call.indices is not None:
        return np.diff(rows_of_some(call, "j", 4).offsets)
    found = call.run(
        _core.coordination, call.query_set, call.pairing, call.settings.algorithm
    )
    return cast("npt.NDArray[np.int64]", found)


def _count_by_type(call: Call) -> npt.NDArray[np.int64]:
    if call.points._kinds is None:
        raise ValueError("by_type needs types, and points have none: Points(types=...)")
    numbers, names = call.points._kinds
    n_types = 1 + int(numbers.max(initial=0)) if names is None else len(names)
    n_rows = len(call.points if call.queries is None else call.queries)
    if call.indices is not None:
        n_rows = len(call.indices)
    refuse_unavailable(8 * n_types * n_rows, f"counts for {n_types} types")
    if call.indices is not None:
        offsets, (j,), *_ = rows_of_some(call, "j", 4)
    else:
        offsets, j = listed(call, "j", 4)
    places = np.repeat(np.arange(n_rows) * n_types, np.diff(offsets)) + numbers[j]
    return np.bincount(places, minlength=n_rows * n_types).reshape(n_rows, n_types)


# ---- k of them -----------------------------------------------------------------------------

def _as_ranks(arrays: Any, points: Any, k: Any, **options: Any) -> Arrays:
    """The rows of a call that C has answered."""
    return in_rows(arrays, -1, k)


@overload
def nearest(
    points: PointsLike,
    k: int,
    *,
    quantities: Literal["jd"] = "jd",
    **options: Unpack[NearestOptions],
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]: ...
@overload
def nearest(
    points: PointsLike,
    k: int,
    *,
    quantities: Literal["j", "d", "D", "S"],
    **options: Unpack[NearestOptions],
) -> npt.NDArray[Any]: ...
@overload
def nearest(
    points: PointsLike, k: int, *, quantities: str, **options: Unpack[NearestOptions]
) -> Arrays: ...
@search("nearest", finish=_as_ranks, lacks="rule")
def nearest(
    points: PointsLike,
    k: int,
    *,
    max_distance: ArrayLike = np.inf,
    queries: PointsLike | None = None,
    quantities: str = "jd",
    index_dtype: npt.DTypeLike = np.int64,
    **search: Any,
) -> Arrays:
    """Find the k nearest points of each point or query, in an order that is always exact.

    Parameters
    ----------
    {points}
    k : int
        Number of neighbours, 1 or more. In a periodic box each image of a point counts separately,
        so k may be larger than n.
    max_distance : float or array_like of float, shape (s,), default infinity
        Largest distance of a neighbour; not negative. One for each system of a batch.
    {queries, box, periodic, exclude, min_distance}
    indices : array_like of int, shape (r,), optional
        Only the rows of these points, in this order.
    inclusive : bool, default True
        Whether a point at exactly `max_distance` counts.
    quantities : str, default "jd"
        Any of the letters ``j d D S``, each at most once: number of the point, distance, vector,
        shift. Only these are computed.
    {index_dtype, threads, progress}

    Returns
    -------
    ndarray or tuple of ndarray
        One array per letter of `quantities`, in that order; a bare array for one letter. With q
        rows, one for each query or point: ``j`` of `index_dtype`, shape (q, k); ``d`` float64
        (q, k); ``D`` float64 (q, k, d); ``S`` int32 (q, k, d). In real arithmetic
        ``D = points[j] - queries[i] + S @ box``.

        Rows ascend by exact distance, and at equal distances by (j, S). Without queries a point is
        left out of its own row, but its images are not. Those that count are of the same group, if
        points have groups, not excluded, and not nearer than `min_distance`. If they are fewer
        than k, or fewer within `max_distance`, the rest of the row is j = -1, d = infinity, D = NaN
        and S = 0. d is within 1 ulp, ascends along the row and is never above `max_distance`; each
        component of D is within 1 ulp of d.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pairs_between`. MemoryError also if a query is so far from periodic points, well
        beyond 10**8 periods, that the images at nearly equal distances do not fit in memory.

    Notes
    -----
    Points are sorted into cells that each hold a few of them, whatever their density. A group of
    neighbouring queries looks at the cells within a radius guessed from the local density.
    float32 with a proven error bound discards distant points, float64 sorts the rest, and
    distances too close to tell apart are compared in double-word arithmetic, then in integers. A
    query that found too few is searched again with a radius that surely suffices. So the time
    depends on n and k, even for strongly clustered points. With points that do not count it also
    depends on how many of these are nearer. Radii, types and supports of points do not matter.

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
    >>> np.ma.masked_equal(j, -1).tolist(), d[j >= 0].tolist()
    ([[1, None], [0, None], [None, None]], [1.0, 1.0])

    The nearest atom of another molecule:

    >>> atoms = hs.Points([[0.0], [1.0], [1.5], [4.0]], labels=["a", "a", "a", "b"])
    >>> hs.nearest(atoms, 1, exclude=0, quantities="j").ravel().tolist()
    [3, 3, 3, 2]

    In a periodic box, and for queries:

    >>> j, d, S = hs.nearest(points, 2, queries=[[3.5, 0.0]], box=4.0, quantities="jdS")
    >>> j.tolist(), d.tolist(), S.tolist()
    ([[0, 2]], [[0.5, 0.5]], [[[1, 0], [0, 0]]])
    """
    k = as_k(k)
    check_letters(quantities, "jdDS")
    call = take(points, 0.0, queries, by_reach=False, **search)
    distances = check_max_distances(max_distance)
    if isinstance(distances, float):
        call.cutoff = distances
    elif call.points.batch is None:
        raise ValueError(f"max_distance must be a number, got shape {distances.shape}")
    else:
        call.system_cutoffs = np.ascontiguousarray(distances, np.float64)
    call.settings = call.settings._replace(precision="exact")
    index_bytes = as_index_bytes(index_dtype)
    if call.indices is not None:
        return _nearest_of_some(call, k, quantities, index_bytes)
    result = call.run(
        _core.nearest, quantities, index_bytes, call.query_set, k, call.pairing
    )
    return in_rows(result, len(call.points if call.queries is None else call.queries), k)


#: Columns of `nearest`, whose rows may stand one behind another: the caller reshapes them.
columns_of_nearest = search("nearest", lacks="rule")(cast("Any", nearest).__wrapped__)


def _nearest_of_some(call: Call, k: int, quantities: str, index_bytes: int) -> Arrays:
    """Rows of some points, found as those of queries, of which each finds itself too."""
    numbers = call.indices
    assert numbers is not None
    order = np.arange(len(numbers))
    if call.points.batch is not None:  # systems come one after the other
        order = np.argsort(call.points.batch[numbers], kind="stable")
    asked = numbers[order]
    letters = quantities + "".join(letter for letter in "jS" if letter not in quantities)
    queries, pairing = call.as_queries(asked)
    result = call.run(_core.nearest, letters, index_bytes, queries, k + 1, pairing)
    columns = dict(zip(letters, in_rows(result, len(asked), k + 1), strict=True))
    itself = (columns["j"] == asked[:, None]) & ~columns["S"].any(axis=2)
    place = np.where(itself.any(axis=1), itself.argmax(axis=1), k)  # or the last one is too many
    kept = np.arange(k) + (np.arange(k) >= place[:, None])
    back = np.argsort(order)
    found = tuple(columns[letter][back[:, None], kept[back]] for letter in quantities)
    return found[0] if len(found) == 1 else found
