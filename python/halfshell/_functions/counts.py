# SPDX-License-Identifier: BSD-3-Clause
"""`count_pairs`: one cutoff in one search; several in one, each an edge of a histogram."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast, overload

from halfshell import _core
from halfshell._convert.batch import as_systems, refuse_many
from halfshell._convert.foreign import is_a
from halfshell._convert.given import Chosen, Given
from halfshell._convert.lengths import as_cutoffs
from halfshell._convert.options import AUTO
from halfshell._convert.quick import quick
from halfshell._convert.search import as_rest, as_search_of_each, count_within
from halfshell._objects.box import Box
from halfshell._unknown import refuse_unknown

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Never, Unpack

    import numpy as np
    import numpy.typing as npt

    from halfshell._convert.types import (
        Algorithm,
        ArrayLike,
        BoxLike,
        CountOptions,
        FloatArray,
        Number,
        PairCutoff,
        PeriodicLike,
        PointsLike,
        Precision,
        ReachOptions,
        Rule,
    )


@overload
def count_pairs(
    points: PointsLike,
    cutoff: Number | Mapping[tuple[int, int], float] | Mapping[tuple[str, str], float] | None,
    *,
    types: None = None,
    **options: Unpack[CountOptions],
) -> int: ...
@overload
def count_pairs(
    points: PointsLike,
    cutoff: PairCutoff,
    *,
    types: npt.ArrayLike,
    **options: Unpack[CountOptions],
) -> int: ...
@overload
def count_pairs(
    points: PointsLike,
    cutoff: Sequence[float] | npt.NDArray[Any],
    *,
    types: None = None,
    **options: Unpack[CountOptions],
) -> npt.NDArray[np.int64]: ...
@overload
def count_pairs(
    points: PointsLike,
    cutoff: npt.ArrayLike | PairCutoff,
    *,
    batch: npt.ArrayLike,
    **options: Unpack[ReachOptions],
) -> npt.NDArray[np.int64]: ...
@overload
def count_pairs(
    points: PointsLike,
    cutoff: npt.ArrayLike,
    *,
    types: None = None,
    **options: Unpack[CountOptions],
) -> int | npt.NDArray[np.int64]: ...
@quick(_core.count_pairs)
def count_pairs(
    points: PointsLike,
    cutoff: npt.ArrayLike | PairCutoff,
    *,
    queries: PointsLike | None = None,
    radii: ArrayLike | None = None,
    query_radii: ArrayLike | None = None,
    rule: Rule | None = None,
    types: npt.ArrayLike | None = None,
    query_types: npt.ArrayLike | None = None,
    supports: ArrayLike | None = None,
    query_supports: ArrayLike | None = None,
    extent: float | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    inclusive: bool = True,
    precision: Precision = "exact",
    algorithm: Algorithm = "auto",
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    batch: npt.ArrayLike | None = None,
    groups: npt.ArrayLike | None = None,
    query_groups: npt.ArrayLike | None = None,
    exclude: npt.ArrayLike | None = None,
    query_exclude: npt.ArrayLike | None = None,
    exclude_within: int | None = None,
    min_distance: float | None = None,
    **unknown: Never,
) -> int | npt.NDArray[np.int64]:
    """Count the pairs of points within one or several cutoffs.

    Parameters
    ----------
    points, box, periodic, inclusive, precision, algorithm, kernel, threads
        As in `pairs`.
    cutoff : float, array_like of float, shape (k,) or (t, t), dict or None
        One cutoff, or several in ascending order, all counted by one search up to the largest
        (k searches if `precision` is not "exact", or with `radii` or `supports`). With `batch`,
        one for all systems, or one for each. With `radii` or `supports`, a further limit, or None;
        with `types`, a table or a dict, as in `pairs`.
    queries : array_like of float, shape (q, d), optional
        Coordinates of queries: count pairs of a query and a point instead, as `pairs_between`
        finds them.
    radii, query_radii, rule, types, query_types, supports, query_supports, extent
        As in `pairs`, and with `queries` as in `pairs_between`.
    memory_limit : float, optional
        Bytes that the search may take.
    batch : array_like of int, shape (n,), optional
        Count many systems in one call, as in `pairs`; not with `queries`.
    groups, exclude, exclude_within, min_distance
        As in `pairs`.
    query_groups, query_exclude : array_like of int or str, shape (q,), optional
        Labels of the queries, in addition to those of the points. With queries, each pair of
        numbers in `exclude` is a query and a point.

    Returns
    -------
    int or ndarray of int64, shape (k,)
        The number of pairs in the half list, or of a query and a point, for each cutoff. With
        `batch`, for each system: those for which `box` or `cutoff` is given, or up to the largest
        number in `batch`.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pairs` and `pairs_between`; ValueError also if several cutoffs are not ascending,
        or if `queries` are given with `batch`. MemoryError only if the search itself would not
        fit: no pair is stored.

    See Also
    --------
    pairs : the pairs themselves.
    pair_histogram : the number of pairs between one distance and the next, by type or weighted.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]
    >>> hs.count_pairs(points, 1.5)
    1
    >>> hs.count_pairs(points, [0.5, 1.0, 2.0]).tolist()
    [0, 1, 2]
    >>> hs.count_pairs(points, 1.5, batch=[0, 0, 2]).tolist()
    [1, 0, 0]
    >>> hs.count_pairs(points, 1.5, queries=[[2.0, 0.0]])
    2
    >>> hs.count_pairs(points, None, radii=[0.5, 1.0, 1.0])
    2
    """
    if unknown:
        refuse_unknown(count_pairs, unknown)
    if type(box) is Box:
        box = box.vectors
    if batch is None and (
        radii is None and query_radii is None and rule is None
        and types is None and query_types is None and algorithm is AUTO
        and supports is None and query_supports is None and extent is None
        and groups is None and exclude is None and exclude_within is None and min_distance is None
        and query_groups is None and query_exclude is None
    ):  # fmt: skip
        result: Any = (
            _core.plain(
                _core.count_pairs, points, cutoff, box, periodic, inclusive, precision, kernel,
                memory_limit, None, threads,
            ) if queries is None else _core.plain(
                _core.count_between, points, cutoff, box, periodic, inclusive, precision, kernel,
                memory_limit, None, threads, queries,
            )
        )  # fmt: skip
        if result is not NotImplemented:
            return cast("int", result)
    rest = as_rest(inclusive, precision, kernel, memory_limit, None, threads)
    given = Given(
        radii, query_radii, rule, types, query_types, supports, query_supports, extent
    )
    chosen = Chosen(
        groups, exclude, exclude_within, min_distance, query_groups, query_exclude
    )
    if batch is not None:
        if queries is not None:
            raise ValueError("batch and queries cannot be given together")
        scene, own, reach, _ = as_systems(
            points, cutoff, box, periodic, batch, given, chosen, precision
        )
        refuse_many(own)
        return _core.batch_count(*(*scene, *rest, *own, reach, algorithm))
    several = _several(cutoff, given)
    one = cutoff if several is None else 0.0
    search, asking, reach = as_search_of_each(
        points, one, box, periodic, rest, given, queries, directed=queries is not None,
        chosen=chosen,
    )
    array, largest, vectors, bits = search[:4]
    within = largest if several is None else several
    return count_within(within, array, vectors, bits, rest, asking, reach, algorithm)


def _several(cutoff: Any, given: Given) -> FloatArray | None:
    """Ascending cutoffs, if they are several; None if it is one, or one for each pair of types."""
    by_types = given.types is not None or given.query_types is not None
    if cutoff is None or by_types or is_a(cutoff, Mapping):
        return None
    cutoffs = as_cutoffs(cutoff)
    return None if isinstance(cutoffs, float) else cutoffs
