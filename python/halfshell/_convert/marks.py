# SPDX-License-Identifier: BSD-3-Clause
"""Types and weights of points, by which a histogram tells pairs apart; the histogram itself."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.arrays import as_array, as_real_array, one_each
from halfshell._convert.foreign import of_argument
from halfshell._convert.labels import as_labels
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.types import Algorithm, FloatArray, PointArray, Reach, Search, Systems

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


def as_types(values: npt.ArrayLike, name: str, n: int) -> npt.NDArray[np.int32]:
    """The type of each of n points, from 0 on."""
    array = as_array(values, name, "hold integers")
    one_each(name, n)(array.shape)
    if array.dtype.kind not in "iu" and n > 0:
        raise TypeError(f"{name} must hold integers, got dtype {array.dtype}")
    array = array.copy()  # it may change meanwhile
    for k in np.flatnonzero((array < 0) | (array >= 2**31 - 1)):
        raise ValueError(
            f"{name} must be from 0 on and below 2**31 - 1, got {name}[{k}] = {array[k]}"
        )
    return np.ascontiguousarray(array, dtype=np.int32)


def _as_weights(values: npt.ArrayLike, name: str, n: int) -> FloatArray:
    array = as_real_array(values, name, check_shape=one_each(name, n))
    return np.ascontiguousarray(array, dtype=np.float64)


def as_marks(
    n: int,
    queries: PointArray | None,
    types: Any,
    query_types: Any,
    weights: Any = None,
    query_weights: Any = None,
) -> Marks:
    """Types and weights of n points and of the queries; names count in ascending order."""
    return as_named_marks(n, queries, types, query_types, weights, query_weights)[0]


def as_named_marks(
    n: int,
    queries: PointArray | None,
    types: Any,
    query_types: Any,
    weights: Any = None,
    query_weights: Any = None,
) -> tuple[Marks, tuple[str, ...] | None]:
    """The same, and what the types are called, if they are names."""
    if queries is None and (query_types is not None or query_weights is not None):
        name = "query_types" if query_types is not None else "query_weights"
        raise ValueError(f"{name} needs queries")
    if queries is not None and (types is None) != (query_types is None):
        raise ValueError("with queries, types and query_types must be given together")
    q = 0 if queries is None else len(queries)
    types, query_types, names = as_labels(types, query_types)
    own = None if types is None else as_types(types, "types", n)
    asking = None if query_types is None else as_types(query_types, "query_types", q)
    largest = max((int(t.max(initial=0)) for t in (own, asking) if t is not None), default=0)
    marks = Marks(
        1 + largest,
        own,
        None if weights is None else _as_weights(weights, "weights", n),
        asking,
        None if query_weights is None else _as_weights(query_weights, "query_weights", q),
    )
    return marks, names


def number_of(systems: Systems) -> int:
    """How many there are: those with a box or cutoff, or up to the largest number."""
    numbers, cutoffs, boxes, of_queries, axes = systems
    for own in (cutoffs, boxes, axes):
        if own is not None:
            return len(own)
    last = [int(one[-1]) for one in (numbers, of_queries) if one is not None and len(one)]
    return 1 + max(last, default=-1)


def binned(
    search: Search,
    edges: FloatArray,
    queries: PointArray | None,
    marks: Marks,
    name: str = "edges[-1]",
    algorithm: Algorithm = "auto",
    selection: Reach | None = None,
    systems: Systems | None = None,
) -> npt.NDArray[np.int64] | npt.NDArray[np.float64]:
    """The histogram of points or cells, given as the first arguments of every search.

    name: what a message calls the largest distance. selection: which pairs count, without a reach.
    systems: of a batch, which the histogram then has an axis for, the first one.
    """
    n_systems = 1 if systems is None else number_of(systems)
    refuse_unavailable(
        _COPIES * 8 * n_systems * marks.n_types**2 * len(edges),
        f"counts for {len(edges) - 1} bins between edges and {marks.n_types}**2 pairs of types"
        + ("" if systems is None else f" of {n_systems} systems"),
    )
    with of_argument(name):
        # CPython 3.11 keeps the tuple of 20 arguments, of which this would be one.
        end: Any = (algorithm,) if selection is None else (algorithm, selection)
        if systems is not None:
            end = (algorithm, selection, systems)
        found = _core.histogram(*(*search, edges, True, queries, *marks, *end))
    # What the core counts first are the pairs closer than the first edge.
    return np.ascontiguousarray(found[..., 0, 0, 1:] if marks.types is None else found[..., 1:])
