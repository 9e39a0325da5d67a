# SPDX-License-Identifier: BSD-3-Clause
"""`pair_histogram`: signature, arguments and documentation; the work is done in C."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.arrays import FloatArray, PointArray, as_array, as_real_array
from halfshell._convert.foreign import of_argument
from halfshell._convert.lengths import as_edges
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.search import as_search
from halfshell._convert.types import BoxLike, PeriodicLike, PointsLike, Search

# The counts of one thread, of two numbers for each bin; their sum; and the result.
_COPIES = 4

_Column = npt.NDArray[Any] | None


class Marks(NamedTuple):
    """Types and weights of the points and of the queries, as the core takes them."""

    n_types: int
    types: _Column
    weights: _Column
    query_types: _Column
    query_weights: _Column


def pair_histogram(
    points: PointsLike,
    edges: npt.ArrayLike,
    *,
    queries: PointsLike | None = None,
    types: npt.ArrayLike | None = None,
    query_types: npt.ArrayLike | None = None,
    weights: npt.ArrayLike | None = None,
    query_weights: npt.ArrayLike | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
) -> npt.NDArray[np.int64] | npt.NDArray[np.float64]:
    """Count pairs in bins of distance, always exact, without storing them.

    Parameters
    ----------
    points, box, periodic, kernel, threads
        As in `pairs`.
    edges : array_like of float, shape (bins + 1,)
        Limits of the bins in ascending order, in the unit of `points`; finite, not negative, any
        spacing: ``np.linspace(0, 10, 101)``, ``np.geomspace(0.1, 10, 51)``. The largest is the
        cutoff and may be larger than the box. Pairs closer than the first edge are not counted.
    queries : array_like of float, shape (q, d), optional
        Coordinates of queries: count pairs of a query and a point instead, as `pairs_between`
        finds them.
    types : array_like of int, shape (n,), optional
        The type of each point, from 0 on: one histogram for each pair of types.
    query_types : array_like of int, shape (q,), optional
        The types of the queries: given if both `types` and `queries` are.
    weights : array_like of float, shape (n,), optional
        Add up the product of the weights of both points instead of counting; finite.
    query_weights : array_like of float, shape (q,), optional
        The weights of the queries. Where only one set has weights, those of the other are 1.
    memory_limit : float, optional
        Bytes that the search and the counts of each thread may take.

    Returns
    -------
    ndarray of int64, or with weights float64
        Shape (bins,), or (t, t, bins) with types, t being one more than the largest of them.

        Bins are half-open and the last one is closed, as in ``numpy.histogram``: bin k counts
        ``edges[k] <= d < edges[k + 1]``, each pair decided exactly for the real numbers that all
        inputs are. A bin between two equal edges is empty, unless it is the last one.

        Without queries each pair counts once (half list). Entry [a, b] then counts the pairs of a
        point of type a with one of type b, whichever comes first: [b, a] is the same, so the
        pairs of all types are the sum over ``a <= b``. With queries [a, b] counts queries of type
        a with points of type b.

        Weighted sums are exact until they are rounded once: they are the float64 nearest to the
        real sum of the real products.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As `pairs` and `pairs_between`; ValueError also if edges are fewer than two, negative, not
        finite or not ascending, if a type is negative, a weight not finite, or their number is
        not that of the points, and for types of one set only or marks of queries without queries.

    See Also
    --------
    count_pairs : cumulative counts.
    rdf : the histogram over that of an ideal gas.

    Notes
    -----
    Bins are found from float32 squares with a proven error bound; only pairs too close to an edge
    to tell are decided again, by the stages of `pairs`. So neither the kernel nor the number of
    threads changes the result. Memory: the bins, for each thread.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]  # distances 1, 2 and 3
    >>> hs.pair_histogram(points, [0.0, 1.0, 2.0, 3.0]).tolist()
    [0, 1, 2]
    >>> hs.pair_histogram(points, [0.0, 1.5, 3.0], types=[0, 1, 1]).tolist()
    [[[0, 0], [1, 1]], [[1, 1], [0, 1]]]
    >>> hs.pair_histogram(points, [0.0, 1.5, 3.0], weights=[1.0, -1.0, 0.5]).tolist()
    [-1.0, 0.0]
    """
    search, asking = as_search(
        points, 0.0, box, periodic, False, "exact", kernel, memory_limit, None, threads, queries
    )
    marks = as_marks(len(search[0]), asking, types, query_types, weights, query_weights)
    return binned(search, as_edges(edges), asking, marks)


def binned(
    search: Search,
    edges: FloatArray,
    queries: PointArray | None,
    marks: Marks,
    name: str = "edges[-1]",
) -> npt.NDArray[np.int64] | npt.NDArray[np.float64]:
    """The histogram of points or cells, given as the first arguments of every search.

    name: what a message calls the largest distance.
    """
    refuse_unavailable(
        _COPIES * 8 * marks.n_types**2 * len(edges),
        f"counts for {len(edges) - 1} bins between edges and {marks.n_types}**2 pairs of types",
    )
    with of_argument(name):
        found = _core.histogram(*search, edges, True, queries, *marks)
    # What the core counts first are the pairs closer than the first edge.
    return np.ascontiguousarray(found[0, 0, 1:] if marks.types is None else found[:, :, 1:])


def as_types(values: npt.ArrayLike, name: str, n: int) -> npt.NDArray[np.int32]:
    """The type of each of n points, from 0 on."""
    array = as_array(values, name, "hold integers")
    if array.shape != (n,):
        raise ValueError(f"{name} must have shape ({n},), one a point, got {array.shape}")
    if array.dtype.kind not in "iu" and n > 0:
        raise TypeError(f"{name} must hold integers, got dtype {array.dtype}")
    for k in np.flatnonzero((array < 0) | (array >= 2**31 - 1)):
        raise ValueError(
            f"{name} must be from 0 on and below 2**31 - 1, got {name}[{k}] = {array[k]}"
        )
    return np.ascontiguousarray(array, dtype=np.int32)


def _as_weights(values: npt.ArrayLike, name: str, n: int) -> FloatArray:
    def check(shape: tuple[int, ...]) -> None:
        if shape != (n,):
            raise ValueError(f"{name} must have shape ({n},), one a point, got {shape}")

    array = as_real_array(values, name, check_shape=check)
    return np.ascontiguousarray(array, dtype=np.float64)


def as_marks(
    n: int,
    queries: PointArray | None,
    types: Any,
    query_types: Any,
    weights: Any = None,
    query_weights: Any = None,
) -> Marks:
    """Types and weights of n points and of the queries."""
    if queries is None and (query_types is not None or query_weights is not None):
        name = "query_types" if query_types is not None else "query_weights"
        raise ValueError(f"{name} needs queries")
    if queries is not None and (types is None) != (query_types is None):
        raise ValueError("with queries, types and query_types must be given together")
    q = 0 if queries is None else len(queries)
    own = None if types is None else as_types(types, "types", n)
    asking = None if query_types is None else as_types(query_types, "query_types", q)
    largest = max((int(t.max(initial=0)) for t in (own, asking) if t is not None), default=0)
    return Marks(
        1 + largest,
        own,
        None if weights is None else _as_weights(weights, "weights", n),
        asking,
        None if query_weights is None else _as_weights(query_weights, "query_weights", q),
    )
