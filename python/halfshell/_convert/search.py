# SPDX-License-Identifier: BSD-3-Clause
"""What searches share: the arguments that each begins with, and counts within several cutoffs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell import _core
from halfshell._convert.foreign import is_a
from halfshell._convert.given import Chosen, Given, Sets
from halfshell._convert.lengths import as_cutoff, refuse_none
from halfshell._convert.options import as_flag
from halfshell._convert.scene import as_sets
from halfshell._errors import shorten

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import (
        Algorithm,
        FloatArray,
        PointArray,
        Precision,
        Reach,
        Rest,
        Search,
    )


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
    try:
        asking, array, vectors, bits = as_sets(queries, points, box, periodic)
        rest = as_rest(inclusive, precision, kernel, memory_limit, progress, threads)
        return (array, as_cutoff(cutoff), vectors, bits, *rest), asking
    except Exception as error:
        shorten(error)
        raise


def as_search_of_each(
    points: Any,
    cutoff: Any,
    box: Any,
    periodic: Any,
    rest: Rest,
    given: Given,
    queries: Any = None,
    directed: bool = False,
    chosen: Chosen | None = None,
) -> tuple[Search, PointArray | None, Reach | None]:
    """As `as_search`, and the reach of each pair, or None where all have the cutoff.

    directed: the result has a direction, so that the rule may have one. chosen: which pairs count;
    the selection then comes with the reach.
    """
    try:
        asking, array, vectors, bits = as_sets(queries, points, box, periodic)
        reach = None
        if given.is_nothing and not is_a(cutoff, Mapping):
            refuse_none(cutoff)
            largest = as_cutoff(cutoff)
        else:
            from halfshell._convert.reach import as_reach  # here: plain searches do without

            n_queries = None if asking is None else len(asking)
            sets = Sets(points, queries, len(array), n_queries, array.shape[1])
            largest, reach = as_reach(cutoff, given, sets, directed)
        if chosen is not None and not chosen.is_nothing:
            from halfshell._convert.selection import with_selection  # here, as above

            n_asking = None if asking is None else len(asking)
            reach = with_selection(reach, chosen, len(array), n_asking, rest[1])
        return (array, largest, vectors, bits, *rest), asking, reach
    except Exception as error:
        shorten(error)
        raise


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
        from halfshell._convert.progress import as_progress  # here: others do without

        progress = as_progress(progress)
    return as_flag(inclusive, "inclusive"), precision, kernel, memory_limit, progress, threads


def with_bar(search: Callable[..., Any], arguments: dict[str, Any]) -> Any:
    """Call a search, whose `progress` is a bool, with a bar that goes away at its end."""
    from halfshell._convert.progress import ProgressBar, as_progress  # here, as above

    unknown = arguments.pop("unknown", {})
    bar = as_progress(arguments["progress"])
    try:
        return search(**{**arguments, "progress": bar}, **unknown)
    finally:
        if isinstance(bar, ProgressBar):
            bar.close()


def refuse_indefinite(search: Search, reach: Reach) -> None:
    """What a search says of supports that are not positive definite or reach too far, without one.

    The core looks at them before it looks for pairs, of which no queries have none.
    """
    from halfshell._convert.rules import reach_by_supports  # here: plain searches do without

    supports, query_supports, extent = reach[6:]
    if extent is None:
        return
    ndim = search[0].shape[1]
    no_points, no_matrices = np.empty((0, ndim)), np.empty((0, ndim, ndim))
    if supports is not None:
        reach = reach_by_supports("max", supports, no_matrices, extent)  # looks at all
        _core.count_between(search[0], np.inf, *search[2:], no_points, reach, "auto")
    if query_supports is not None:
        reach = reach_by_supports("max", no_matrices, query_supports, extent)
        queries = np.zeros((len(query_supports), ndim))
        _core.count_between(no_points, np.inf, *search[2:], queries, reach, "auto")


def count_within(
    cutoffs: float | FloatArray,
    points: Any,
    box: FloatArray | None,
    bits: int,
    rest: Rest,
    queries: PointArray | None = None,
    reach: Reach | None = None,
    algorithm: Algorithm = "auto",
) -> int | npt.NDArray[np.int64]:
    """How many pairs are within a cutoff, or within each of some, which ascend and are at least 0.

    points: an array, or cells of the core in place of points and box.
    """

    def count(one: float) -> int:
        if queries is None:
            return _core.count_pairs(points, one, box, bits, *rest, reach, algorithm)
        return _core.count_between(points, one, box, bits, *rest, queries, reach, algorithm)

    if isinstance(cutoffs, float):
        return count(cutoffs)
    is_exact = isinstance(rest[1], str) and rest[1] == "exact"
    if is_exact and len(cutoffs) > 1 and (reach is None or reach[0] is None):
        edges = np.ascontiguousarray(cutoffs)
        end = (algorithm,) if reach is None else (algorithm, reach)  # as in `binned`
        between: npt.NDArray[np.int64] = _core.histogram(
            *(points, 0.0, box, bits, *rest, edges, rest[0], queries, 1, None, None, None, None),
            *end,
        )
        return np.cumsum(between[0, 0])
    # Without any, all else is checked as ever.
    counts = [count(one) for one in cutoffs.tolist() or [0.0]]
    return np.array(counts[: len(cutoffs)], dtype=np.int64)
