# SPDX-License-Identifier: BSD-3-Clause
"""What searches share: the arguments that each begins with, and counts within several cutoffs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell import _core
from halfshell._convert.foreign import is_a
from halfshell._convert.given import Given, Sets
from halfshell._convert.lengths import as_cutoff
from halfshell._convert.options import as_flag
from halfshell._convert.scene import as_sets

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import FloatArray, PointArray, Precision, Reach, Rest, Search


def as_search(
    points: Any,
    cutoff: Any,
    box: Any,
    periodic: Any,
    inclusive: Any,
    precision: Precision,
    kernel: str | None,
    memory_limit: float | None,
    progress: Any,
    threads: int | None,
    queries: Any = None,
) -> tuple[Search, PointArray | None]:
    """The first ten arguments of the core, and the queries or None."""
    asking, array, vectors, bits = as_sets(queries, points, box, periodic)
    rest = as_rest(inclusive, precision, kernel, memory_limit, progress, threads)
    return (array, as_cutoff(cutoff), vectors, bits, *rest), asking


def as_search_of_each(
    points: Any,
    cutoff: Any,
    box: Any,
    periodic: Any,
    rest: Rest,
    given: Given,
    queries: Any = None,
    directed: bool = False,
) -> tuple[Search, PointArray | None, Reach | None]:
    """As `as_search`, and the reach of each pair, or None where all have the cutoff.

    directed: the result has a direction, so that the rule may have one.
    """
    asking, array, vectors, bits = as_sets(queries, points, box, periodic)
    reach = None
    if given.is_nothing and not is_a(cutoff, Mapping):
        largest = as_cutoff(cutoff)
    else:
        from halfshell._convert.reach import as_reach  # here: plain searches do without

        sets = Sets(points, queries, len(array), None if asking is None else len(asking))
        largest, reach = as_reach(cutoff, given, sets, directed)
    return (array, largest, vectors, bits, *rest), asking, reach


def as_rest(
    inclusive: Any,
    precision: Precision,
    kernel: str | None,
    memory_limit: float | None,
    progress: Any,
    threads: int | None,
) -> Rest:
    """Those that say how to search. What is not converted here the core checks."""
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be callable, got {type(progress).__name__}")
    return as_flag(inclusive, "inclusive"), precision, kernel, memory_limit, progress, threads


def count_within(
    cutoffs: float | FloatArray,
    points: Any,
    box: FloatArray | None,
    bits: int,
    rest: Rest,
    queries: PointArray | None = None,
    reach: Reach | None = None,
) -> int | npt.NDArray[np.int64]:
    """How many pairs are within a cutoff, or within each of some, which ascend and are at least 0.

    points: an array, or cells of the core in place of points and box.
    """

    def count(one: float) -> int:
        if queries is None:
            return _core.count_pairs(points, one, box, bits, *rest, reach)
        return _core.count_between(points, one, box, bits, *rest, queries, reach)

    if isinstance(cutoffs, float):
        return count(cutoffs)
    is_exact = isinstance(rest[1], str) and rest[1] == "exact"
    if is_exact and len(cutoffs) > 1 and reach is None:
        edges = np.ascontiguousarray(cutoffs)
        between: npt.NDArray[np.int64] = _core.histogram(
            points, 0.0, box, bits, *rest, edges, rest[0], queries, 1, None, None, None, None
        )
        return np.cumsum(between[0, 0])
    # Without any, all else is checked as ever.
    counts = [count(one) for one in cutoffs.tolist() or [0.0]]
    return np.array(counts[: len(cutoffs)], dtype=np.int64)
