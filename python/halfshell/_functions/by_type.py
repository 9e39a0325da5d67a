# SPDX-License-Identifier: BSD-3-Clause
"""Neighbours counted by their type, without listing them: as many searches as there are types.

In search k, points of type a look for type k - a, modulo the number of types, and these look for
them: cutoffs of all other types are negative, which no pair is within. Each search counts for every
point the neighbours of one type, and all searches together those of every type.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.arrays import as_array
from halfshell._convert.foreign import is_a
from halfshell._convert.given import Chosen, Given, Sets
from halfshell._convert.labels import as_labels
from halfshell._convert.lengths import as_cutoff
from halfshell._convert.marks import as_types
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.own_rows import check_alone, rows_of_points
from halfshell._convert.reach import as_reach, check_alone_given
from halfshell._convert.rules import reach_by_types
from halfshell._convert.scene import as_sets
from halfshell._convert.selection import with_selection

if TYPE_CHECKING:
    from halfshell._convert.types import FloatArray, PointArray, Reach, Rest, Search

_Counts = npt.NDArray[np.int64]
_NONE = -1.0  # the cutoff of types that are no pairs


def is_one_cutoff(cutoff: Any, batch: Any = None) -> bool:
    """Whether it is a number, or with a batch one a system, and no table or dict."""
    if type(cutoff) in (float, int):
        return True
    if cutoff is None or is_a(cutoff, Mapping):
        return False
    return as_array(cutoff, "cutoff", "be a number").ndim <= (0 if batch is None else 1)


def types_for_counts(types: Any, n: int, n_rows: int) -> tuple[npt.NDArray[np.int32], int]:
    """The type of each point, and how many there are: columns that memory can hold."""
    if types is None:
        raise ValueError("by_type needs types")
    numbers, _, names = as_labels(types, None)
    found = as_types(numbers, "types", n)
    n_types = 1 + int(found.max(initial=0)) if names is None else len(names)
    refuse_unavailable(8 * n_types * (n_rows + 2 * n_types), f"counts for {n_types} types")
    return found, n_types


def refuse_other_reaches(given: Given) -> None:
    """ValueError beside types that only sort, with one cutoff for all."""
    check_alone_given(given)
    if given.query_types is not None:
        raise ValueError("query_types need a cutoff for each pair of types")


def counted(
    offsets: npt.NDArray[Any], j: npt.NDArray[Any], types: npt.NDArray[np.int32], n_types: int
) -> _Counts:
    """How many of each row are of each type."""
    n = len(offsets) - 1
    places = np.repeat(np.arange(n) * n_types, np.diff(offsets)) + types[j]
    return np.bincount(places, minlength=n * n_types).reshape(n, n_types)


def count_by_type(
    points: Any, cutoff: Any, box: Any, periodic: Any, rest: Rest, given: Given, chosen: Chosen,
    queries: Any, algorithm: Any, indices: Any,
) -> _Counts:  # fmt: skip
    """`coordination` with a column for each type of a neighbour."""
    asking, array, vectors, bits = as_sets(queries, points, box, periodic)
    n, q = len(array), None if asking is None else len(asking)
    n_rows = n if q is None else q
    types, n_types = types_for_counts(given.types, n, n_rows)
    reach = None
    if is_one_cutoff(cutoff):
        refuse_other_reaches(given)
        largest = as_cutoff(cutoff)
    else:
        largest, reach = as_reach(cutoff, given, Sets(points, queries, n, q, array.shape[1]), True)
    search = (array, largest, vectors, bits, *rest)
    selected = with_selection(None, chosen, n, q, rest[1])
    if indices is not None:
        check_alone(queries)
        both = with_selection(reach, chosen, n, q, rest[1])
        return _of_rows(search, array, indices, both, algorithm, types, n_types)
    if n == 0 or n_rows == 0:  # all else is checked as ever
        _core.coordination(*search, asking, None, algorithm)
        return np.zeros((n_rows, n_types), np.int64)
    if asking is None:
        return _of_points(search, reach, algorithm, types, n_types, selected)
    return _of_queries(search, asking, reach, algorithm, types, n_types, selected)


def _of_rows(
    search: Search, points: PointArray, indices: Any, reach: Reach | None, algorithm: Any,
    types: npt.NDArray[np.int32], n_types: int,
) -> _Counts:  # fmt: skip
    """Those of some points, which are listed for this."""
    (offsets, j), _, _ = rows_of_points(search, points, indices, "j", 4, reach, algorithm)
    return counted(offsets, j, types, n_types)


def _cutoffs(
    reach: Reach | None, largest: float, asked: npt.NDArray[Any], types: npt.NDArray[Any],
    shape: tuple[int, int],
) -> FloatArray:  # fmt: skip
    """The cutoff between those that ask, by their labels, and each type, which are labels too.

    A reach has types of its own, one for all points of a label.
    """
    table = np.full(shape, _NONE)
    ours, first = np.unique(types, return_index=True)
    theirs, first_asked = np.unique(asked, return_index=True)
    if reach is None:
        table[np.ix_(theirs, ours)] = largest
        return table
    _, _, _, own, asking, cutoffs, *_ = reach
    assert own is not None and cutoffs is not None
    asking = own if asking is None else asking
    table[np.ix_(theirs, ours)] = cutoffs[np.ix_(asking[first_asked], own[first])]
    return table


def _of_points(
    search: Search, reach: Reach | None, algorithm: Any, types: npt.NDArray[np.int32],
    n_types: int, selected: Reach | None,
) -> _Counts:  # fmt: skip
    labels = np.arange(n_types)
    cutoffs = _cutoffs(reach, search[1], types, types, (n_types, n_types))
    counts = np.zeros((len(types), n_types), np.int64)
    for k in range(n_types):
        other = (k - labels) % n_types
        table = np.full_like(cutoffs, _NONE)
        table[labels, other] = cutoffs[labels, other]
        found = _search(
            search, None, reach_by_types(types, None, table), algorithm, selected
        )
        counts[np.arange(len(types)), other[types]] = found
    return counts


def _of_queries(
    search: Search, asking: PointArray, reach: Reach | None, algorithm: Any,
    types: npt.NDArray[np.int32], n_types: int, selected: Reach | None,
) -> _Counts:  # fmt: skip
    """Types of queries come after those of points: each search is for one type of the points."""
    own = None if reach is None else reach[4]
    kinds, asked = np.unique(
        np.zeros(len(asking), np.int32) if own is None else own, return_inverse=True
    )
    refuse_unavailable(16 * (n_types + len(kinds)) ** 2, "cutoffs of all types")
    cutoffs = _cutoffs(reach, search[1], asked, types, (len(kinds), n_types))
    query_types = (n_types + asked).astype(np.int32)
    counts = np.zeros((len(asking), n_types), np.int64)
    for k in range(n_types):
        table = np.full((n_types + len(kinds),) * 2, _NONE)
        table[n_types:, k] = table[k, n_types:] = cutoffs[:, k]
        counts[:, k] = _search(
            search, asking, reach_by_types(types, query_types, table), algorithm, selected
        )
    return counts


def _search(
    search: Search, asking: PointArray | None, reach: Reach, algorithm: Any, selected: Any
) -> _Counts:
    table = reach[5]
    assert table is not None
    points, largest, *rest = search
    if largest >= 0.0:  # what is wrong with it the core says
        largest = max(float(table.max(initial=_NONE)), 0.0)
    both: Any = reach if selected is None else (reach, selected[1])
    return _core.coordination(points, largest, *rest, asking, both, algorithm)  # type: ignore
