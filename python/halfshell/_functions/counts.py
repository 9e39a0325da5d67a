# SPDX-License-Identifier: BSD-3-Clause
"""Numbers of pairs, of which none is stored: within cutoffs `count_pairs`, by distance
`pair_histogram`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast, overload

import numpy as np

from halfshell import _core
from halfshell._convert.call import Call, each_cutoff, numbers_of_both, part_of, take
from halfshell._convert.foreign import of_argument
from halfshell._convert.lengths import as_edges
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.options import as_flag
from halfshell._functions.indices import named_once, pairs_of_some, within_and_beyond
from halfshell._search import search

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Unpack

    import numpy.typing as npt

    from halfshell._convert.types import (
        CountOptions,
        CutoffLike,
        FloatArray,
        Number,
        OptionsOfBins,
        PointsLike,
    )

# The counts of one thread, of two numbers for each bin; their sum; and the result.
_COPIES = 4
_MANY_SYSTEMS = 1 << 20  # counts of fewer always fit


@overload
def count_pairs(
    points: PointsLike,
    cutoff: Number | Mapping[Any, float] | None = None,
    **options: Unpack[CountOptions],
) -> int: ...
@overload
def count_pairs(
    points: PointsLike,
    cutoff: Sequence[float] | npt.NDArray[Any],
    **options: Unpack[CountOptions],
) -> npt.NDArray[np.int64]: ...
@overload
def count_pairs(
    points: PointsLike, cutoff: CutoffLike = None, **options: Unpack[CountOptions]
) -> int | npt.NDArray[np.int64]: ...
@search("count_pairs")
def count_pairs(
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    queries: PointsLike | None = None,
    **search: Any,
) -> int | npt.NDArray[np.int64]:
    """Count the pairs of points within one or several cutoffs.

    Parameters
    ----------
    {points}
    cutoff : float, array_like of float, shape (k,), (s,) or (t, t), dict or None
        As in `pairs`; several, ascending, are counted by one search up to the largest (by one
        each with radii, `indices`, or a precision other than "exact").
    queries : array_like of float, shape (q, d), or Points, optional
        Count pairs of a query and a point instead, as `pairs_between` finds them.
    {box, periodic, rule, exclude, min_distance}
    indices : array_like of int, shape (r,), optional
        Count only pairs that have at least one of these points; they are listed for this.
    {inclusive, threads, progress}

    Returns
    -------
    int or ndarray of int64, shape (k,) or (s,)
        The number of pairs in the half list, or of a query and a point, for each cutoff; of a
        batch, for each system.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pairs` and `pairs_between`. MemoryError only if the search itself would not fit: no
        pair is stored.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]
    >>> hs.count_pairs(points, 1.5)
    1
    >>> hs.count_pairs(points, [0.5, 1.0, 2.0]).tolist()
    [0, 1, 2]
    >>> hs.count_pairs(points, 1.5, queries=[[2.0, 0.0]])
    2
    >>> hs.count_pairs(hs.Points(points, batch=[0, 0, 2]), 1.5).tolist()
    [1, 0, 0]
    """
    return counted(take(points, cutoff, queries, several="counts", **search))


def counted(call: Call) -> int | npt.NDArray[np.int64]:
    """How many pairs are within the cutoff of a call, or within each of several."""
    cutoffs = call.shells
    if cutoffs is None:
        return _count(call)
    is_exact = call.settings.precision == "exact" and not call.has_reach and call.indices is None
    if is_exact and len(cutoffs) > 1:
        edges = np.ascontiguousarray(cutoffs)
        between = binned(call, edges, last=call.inclusive, name="cutoff")
        return np.cumsum(between[0, 0])
    counts = [_count(one) for one in each_cutoff(call)]
    return np.array(counts, dtype=np.int64)


def _count(call: Call) -> int | npt.NDArray[np.int64]:
    """Within one cutoff, or that of each system; of each system of a batch."""
    points, batch = call.points, call.points.batch
    if batch is not None and call.system_cutoffs is None and points.box is None and len(batch):
        last = int(batch[-1])
        if last > _MANY_SYSTEMS:
            refuse_unavailable(8 * (last + 1), f"counts of the systems up to {last} in batch")
    if call.indices is not None:
        i = cast("npt.NDArray[Any]", pairs_of_some(call, "i", False, 4, None))
        if batch is None:
            return len(i)
        own = call.system_cutoffs
        return np.bincount(batch[i], minlength=points.n_systems if own is None else len(own))
    found = call.run(_core.count_pairs, call.pairing, call.settings.algorithm, call.query_set)
    return cast("int", found) if batch is None else call.by_number(found)


# ---- by distance ---------------------------------------------------------------------------

@search(lacks="rule indices inclusive")
def pair_histogram(
    points: PointsLike,
    edges: npt.ArrayLike,
    *,
    queries: PointsLike | None = None,
    indices: npt.ArrayLike | None = None,
    by_type: bool = False,
    **search: Unpack[OptionsOfBins],
) -> npt.NDArray[np.int64] | npt.NDArray[np.float64]:
    """Count pairs in bins of distance, always exact, without storing them.

    Parameters
    ----------
    {points}
    edges : array_like of float, shape (bins + 1,)
        Limits of the bins in ascending order, in the unit of `points`; finite, not negative, any
        spacing: ``np.linspace(0, 10, 101)``, ``np.geomspace(0.1, 10, 51)``. The largest is the
        cutoff and may be larger than the box. Pairs closer than the first edge are not counted.
    queries : array_like of float, shape (q, d), or Points, optional
        Count pairs of a query and a point instead, as `pairs_between` finds them.
    {box, periodic, exclude, min_distance}
    indices : array_like of int, shape (r,), optional
        Count only pairs that have at least one of these points, each named once. Not with weights,
        whose sums are rounded once.
    by_type : bool, default False
        One histogram for each pair of `types` of the points.
    {threads, progress}

    Returns
    -------
    ndarray of int64, or float64 if points or queries have weights
        Shape (bins,), or (t, t, bins) by type, where t is one more than the largest type, or the
        number of names, in the ascending order of ``np.unique``. Of a batch, the first axis is the
        system.

        Bins are half-open except the last, which is closed, as in ``numpy.histogram``: bin k counts
        ``edges[k] <= d < edges[k + 1]``, with each pair decided exactly for the real values of all
        inputs. A bin between two equal edges is empty, unless it is the last one.

        Without queries each pair counts once (half list). Entry [a, b] then counts the pairs of a
        point of type a with one of type b, whichever comes first: [b, a] is the same, and the
        number of all pairs is the sum over ``a <= b``. With queries [a, b] counts queries of type
        a with points of type b.

        With weights each pair counts as the product of its two; a set without has ones. Sums are
        exact and rounded once: the float64 nearest to the real sum of the real products.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `count_pairs`; ValueError also for edges that are not as above, or for `by_type`
        without types.

    Notes
    -----
    Bins are found from float32 squares with a proven error bound; only pairs too close to an edge
    to tell are decided again, as in `pairs`. So neither the kernel nor the number of threads
    changes the result. The memory needed is that of the bins, once for each thread. Radii and
    supports of points do not matter.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = hs.Points([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]], types=[0, 1, 1])
    >>> hs.pair_histogram(points, [0.0, 1.0, 2.0, 3.0]).tolist()  # distances 1, 2 and 3
    [0, 1, 2]
    >>> hs.pair_histogram(points, [0.0, 1.5, 3.0], by_type=True).tolist()
    [[[0, 0], [1, 1]], [[1, 1], [0, 1]]]
    >>> hs.pair_histogram(points.replace(weights=[1.0, -1.0, 0.5]), [0.0, 1.5, 3.0]).tolist()
    [-1.0, 0.0]
    """
    call = take(
        points, 0.0, queries, indices=indices, inclusive=False, by_reach=False, **search
    )
    limits, by_type = as_edges(edges), as_flag(by_type, "by_type")
    n_types, _ = use_types(call) if by_type else (1, None)
    call.known = call.known._replace(weights=call.points.weights)
    if call.queries is not None:
        call.known_of_queries = call.known_of_queries._replace(weights=call.queries.weights)
    count = binned if call.indices is None else _of_some
    found = count(call, limits, n_types)
    # What the core counts first are the pairs closer than the first edge.
    return np.ascontiguousarray(found[..., 1:] if by_type else found[..., 0, 0, 1:])


def _of_some(call: Call, edges: FloatArray, n_types: int) -> npt.NDArray[Any]:
    """Counts of the pairs that have one of some points: those of two, and those with another."""
    if call.known.weights is not None:
        raise ValueError(
            "indices cannot be combined with weights: their sums are rounded once, and these are "
            "sums of two parts"
        )
    numbers = named_once(call)
    parts = within_and_beyond(call, numbers)
    sums = np.zeros((call.points.n_systems, n_types, n_types, len(edges)), np.int64)
    for k, one in enumerate(parts):
        one.progress, one.bar = part_of(call.progress, k, len(parts)), None
        found = binned(one, edges, n_types).reshape(-1, *sums.shape[1:])
        if one.queries is not None:  # either may come first
            found = found + found.swapaxes(1, 2)
            same = np.arange(n_types)
            found[:, same, same] //= 2
        sums[: len(found)] += found
    call.close()
    return sums if call.points.batch is not None else sums[0]


def use_types(call: Call) -> tuple[int, tuple[str, ...] | None]:
    """Let a histogram go by types: their number, and their names, if they have some."""
    if call.points._kinds is None:
        raise ValueError("by_type needs types, and points have none: Points(types=...)")
    types, of_queries, names = numbers_of_both(call, "_kinds", "types")
    call.known = call.known._replace(types=types)
    call.known_of_queries = call.known_of_queries._replace(types=of_queries)
    largest = max(int(t.max(initial=0)) for t in (types, of_queries) if t is not None)
    return 1 + largest if names is None else max(len(names), 1), names


def binned(
    call: Call, edges: FloatArray, n_types: int = 1, last: bool = True, name: str = "edges[-1]"
) -> npt.NDArray[Any]:
    """Counts or sums by system, if it is a batch, types and bin; the first bin is below all edges.

    last: whether a pair at exactly the last edge counts. name: what a message calls that edge.
    """
    call.settings = call.settings._replace(precision="exact")
    n_systems = call.points.n_systems
    refuse_unavailable(
        _COPIES * 8 * n_systems * n_types**2 * len(edges),
        f"counts for {len(edges) - 1} bins between edges and {n_types}**2 pairs of types"
        + ("" if call.points.batch is None else f" of {n_systems} systems"),
    )
    end = call.settings.algorithm, call.pairing
    with of_argument(name):
        found = call.run(_core.histogram, edges, last, call.query_set, n_types, *end)
    return cast("npt.NDArray[Any]", found) if call.points.batch is None else call.by_number(found)
