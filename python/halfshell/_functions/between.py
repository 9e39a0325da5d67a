# SPDX-License-Identifier: BSD-3-Clause
"""`pairs_between`: signature, defaults, documentation; the work is done in C."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast, overload

import numpy as np

from halfshell import _core
from halfshell._convert.batch import as_systems, check_no_batch
from halfshell._convert.given import Chosen, Given
from halfshell._convert.options import AUTO, RAISE, as_index_bytes, as_room
from halfshell._convert.scene import check_apart
from halfshell._convert.search import as_rest, as_search_of_each
from halfshell._objects.box import Box
from halfshell._unknown import refuse_unknown

if TYPE_CHECKING:
    from typing import Literal, Never, Unpack

    import numpy.typing as npt

    from halfshell._convert.types import (
        Algorithm,
        ArrayLike,
        Arrays,
        BetweenOptions,
        BoxLike,
        Letter,
        Out,
        PairCutoff,
        PeriodicLike,
        PointsLike,
        Precision,
        Rule,
    )


@overload
def pairs_between(
    queries: PointsLike,
    points: PointsLike,
    cutoff: PairCutoff,
    *,
    quantities: Literal["ij"] = "ij",
    on_overflow: Literal["raise"] = "raise",
    **options: Unpack[BetweenOptions],
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]: ...
@overload
def pairs_between(
    queries: PointsLike,
    points: PointsLike,
    cutoff: PairCutoff,
    *,
    quantities: Letter,
    on_overflow: Literal["raise"] = "raise",
    **options: Unpack[BetweenOptions],
) -> npt.NDArray[Any]: ...
@overload
def pairs_between(
    queries: PointsLike,
    points: PointsLike,
    cutoff: PairCutoff,
    *,
    quantities: str,
    on_overflow: Literal["raise"] = "raise",
    **options: Unpack[BetweenOptions],
) -> Arrays: ...
@overload
def pairs_between(
    queries: PointsLike,
    points: PointsLike,
    cutoff: PairCutoff,
    *,
    quantities: str = "ij",
    on_overflow: Literal["flag"],
    **options: Unpack[BetweenOptions],
) -> tuple[Any, ...]: ...
def pairs_between(
    queries: PointsLike,
    points: PointsLike,
    cutoff: PairCutoff,
    *,
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
    quantities: str = "ij",
    inclusive: bool = True,
    index_dtype: npt.DTypeLike = np.int64,
    out: Out | None = None,
    capacity: int | None = None,
    on_overflow: Literal["raise", "flag"] = "raise",
    precision: Precision = "exact",
    algorithm: Algorithm = "auto",
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    groups: npt.ArrayLike | None = None,
    query_groups: npt.ArrayLike | None = None,
    exclude: npt.ArrayLike | None = None,
    query_exclude: npt.ArrayLike | None = None,
    exclude_within: int | None = None,
    min_distance: float | None = None,
    batch: npt.ArrayLike | None = None,
    query_batch: npt.ArrayLike | None = None,
    **unknown: Never,
) -> Arrays | tuple[Any, ...]:
    """Find every pair of a query and a point within a cutoff.

    Parameters
    ----------
    queries : array_like of float, shape (q, d)
        Coordinates of queries, in the unit of `points` and with as many columns. They may lie
        anywhere, even far from all points or outside the box. You may mix float32 and float64:
        each number is used as it is.
    points : array_like of float, shape (n, d)
        Coordinates of the points to find, as in `pairs`. An object such as ``ase.Atoms`` brings
        its box; `queries` may be another one with the same box.
    cutoff, box, periodic, inclusive, index_dtype, out, precision, algorithm, kernel
        As in `pairs`.
    capacity, on_overflow, threads, memory_limit
        As in `pairs`; in the padding, i is the number of queries and j the number of points.
    radii, query_radii : array_like of float, shape (n,) and (q,), optional
        A radius for each point and for each query, as in `pairs`. Give both, unless `rule` uses
        only one of them.
    rule : {"sum", "mean", "max", "min", "gather", "scatter"}, optional
        As in `pairs`; or "gather", within the radius of the query, for which only `query_radii`
        are given; or "scatter", within the radius of the point, with only `radii`.
    types, query_types : array_like of int or str, shape (n,) and (q,), optional
        Types of points and queries, as in `pairs`; both are numbers, or both are names.
    supports, query_supports : array_like of float, shape (n, d, d) and (q, d, d), optional
        A support for each point and for each query, as in `pairs`; one or both, like `radii`, with
        the rules "max", "min", "gather" and "scatter".
    extent : float, optional
        How far supports reach, as in `pairs`.
    quantities : str, default "ij"
        Any of the letters ``i j d D S P``, each at most once, as in `pairs`.
    groups, exclude, exclude_within, min_distance
        As in `pairs`.
    query_groups, query_exclude : array_like of int or str, shape (q,), optional
        Labels of the queries, in addition to those of the points. Each pair of numbers in
        `exclude` is a query and a point.
    batch : array_like of int, shape (n,), optional
        Many systems in one call, as in `pairs`: the system of each point, ascending. Neighbours are
        in the same system. The result is that of one call for each system, in ascending order, but
        indices number the queries and points of all systems.
    query_batch : array_like of int, shape (q,), optional
        The system of each query, ascending; with `batch` and `queries`, and only then.

    Returns
    -------
    ndarray or tuple of ndarray
        One array per letter of `quantities`, in that order; a bare array for one letter. Types and
        shapes are those of `pairs`: i is the number of a query, j that of a point, and in real
        arithmetic ``D = points[j] - queries[i] + S @ box``. Ascending (i, j, S).

        Nothing is left out: a query that coincides with a point is its neighbour at distance 0,
        even if you pass one array as both, and each image of a point within the cutoff is a pair.

    Raises
    ------
    TypeError, ValueError, CapacityError, OverflowError, MemoryError
        As for `pairs`. ValueError also if `queries` and `points` differ in their number of columns
        or in their box.

    See Also
    --------
    neighbors : the same pairs as a table, with a row for each query.
    count_pairs : the number of these pairs.

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

    A radius for each query:

    >>> i, j = hs.pairs_between(points[:2], points, None, query_radii=[1.0, 2.0], rule="gather")
    >>> i.tolist(), j.tolist()
    ([0, 0, 1, 1, 1], [0, 1, 0, 1, 2])
    """
    if unknown:
        refuse_unknown(pairs_between, unknown)
    if type(box) is Box:
        box = box.vectors
    room = None
    if capacity is not None or on_overflow is not RAISE:
        room = as_room(capacity, on_overflow, out)
    if (
        radii is None and query_radii is None and rule is None
        and types is None and query_types is None and algorithm is AUTO
        and supports is None and query_supports is None and extent is None
        and groups is None and exclude is None and exclude_within is None and min_distance is None
        and query_groups is None and query_exclude is None
        and batch is None and query_batch is None
    ):  # fmt: skip
        result: Any = _core.plain(
            _core.pairs_between, points, cutoff, box, periodic, inclusive, precision, kernel,
            memory_limit, None, threads, quantities, True, index_dtype, out, queries,
            None, AUTO, room,
        )
        if result is not NotImplemented:
            return cast("Arrays", result)
    given = Given(
        radii, query_radii, rule, types, query_types, supports, query_supports, extent
    )
    chosen = Chosen(
        groups, exclude, exclude_within, min_distance, query_groups, query_exclude
    )
    check_apart(
        out, queries=queries, points=points, box=box, cutoff=cutoff, **given._asdict(),
        **chosen._asdict(), batch=batch, query_batch=query_batch,
    )  # fmt: skip
    rest = as_rest(inclusive, precision, kernel, memory_limit, None, threads)
    if batch is not None:
        scene, own, reach, asking = as_systems(
            points, cutoff, box, periodic, batch, given, chosen, precision, queries, query_batch,
            directed=True,
        )  # fmt: skip
        wanted = (quantities, True, as_index_bytes(index_dtype), out)
        return _core.pairs_between(
            *(*scene, *rest, *wanted, asking, reach, algorithm, room, own)
        )
    check_no_batch(query_batch)
    search, asking, reach = as_search_of_each(
        points, cutoff, box, periodic, rest, given, queries, directed=True, chosen=chosen
    )
    return _core.pairs_between(
        *search, quantities, True, as_index_bytes(index_dtype), out, asking, reach, algorithm,
        room,
    )  # fmt: skip
