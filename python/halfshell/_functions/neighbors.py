# SPDX-License-Identifier: BSD-3-Clause
"""`neighbors`: full lists; the work is done in C."""

from __future__ import annotations

from typing import Any, Never

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.batch import as_systems, check_no_batch, refuse_indices
from halfshell._convert.given import Chosen, Given
from halfshell._convert.options import AUTO, as_index_bytes
from halfshell._convert.rules import DIRECTED
from halfshell._convert.search import as_rest, as_search_of_each
from halfshell._convert.types import (
    Algorithm,
    ArrayLike,
    BoxLike,
    PairCutoff,
    PeriodicLike,
    PointsLike,
    Precision,
    Reach,
    Rule,
    Search,
)
from halfshell._objects.box import Box
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._objects.origin import Origin, shifts_of_search
from halfshell._unknown import refuse_unknown


def neighbors(
    points: PointsLike,
    cutoff: PairCutoff,
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
    quantities: str = "j",
    inclusive: bool = True,
    index_dtype: npt.DTypeLike = np.int64,
    precision: Precision = "exact",
    algorithm: Algorithm = "auto",
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    indices: npt.ArrayLike | None = None,
    groups: npt.ArrayLike | None = None,
    query_groups: npt.ArrayLike | None = None,
    exclude: npt.ArrayLike | None = None,
    query_exclude: npt.ArrayLike | None = None,
    exclude_within: int | None = None,
    min_distance: float | None = None,
    batch: npt.ArrayLike | None = None,
    query_batch: npt.ArrayLike | None = None,
    **unknown: Never,
) -> NeighborTable:
    """Find all neighbours of each point, or of each query, as a table of rows.

    Parameters
    ----------
    points : array_like of float, shape (n, d)
        Coordinates, as in `pairs`; an object such as ``ase.Atoms`` brings its own box.
    cutoff : float, array_like of float, shape (t, t), dict or None
        Largest distance of a neighbour, in the unit of `points`; finite, not negative. With `radii`
        or `supports`, a further limit, or None; with `types`, one for each pair of types, as in
        `pairs`.
    queries : array_like of float, shape (q, d), optional
        Coordinates of queries, in the unit of `points`; they may lie anywhere. The table then has
        a row for each query, with the neighbours that `pairs_between` finds. Default: a row for
        each point.
    radii : array_like of float, shape (n,), optional
        A radius for each point, as in `pairs`.
    query_radii : array_like of float, shape (q,), optional
        A radius for each query, in addition to `radii`; for "gather", without `radii`.
    rule : {"sum", "mean", "max", "min", "gather", "scatter"}, optional
        As in `pairs`, or with a direction: with "gather", row i holds the points within the radius
        of i; with "scatter", the points whose radius reaches i.
    types, query_types : array_like of int or str, shape (n,) and (q,), optional
        As in `pairs_between`.
    supports, query_supports : array_like of float, shape (n, d, d) and (q, d, d), optional
        As in `pairs_between`; "gather": row i holds all within the support of i.
    extent : float, optional
        How far supports reach, as in `pairs`.
    quantities : str, default "j"
        Any of the letters ``j d D S``, each at most once: numbers of the neighbours, distances,
        vectors, shifts. Only these are computed, and the table has no others.
    box, periodic, inclusive, index_dtype, precision, algorithm, kernel, threads, memory_limit
        As in `pairs`.
    indices : array_like of int, shape (r,), optional
        Return only the rows of these points, in this order: row k belongs to point ``indices[k]``
        and is the same as in the whole table. The cost depends on their number. Not with `queries`
        or precision "single".
    groups, exclude, exclude_within, min_distance
        As in `pairs`.
    query_groups, query_exclude : array_like of int or str, shape (q,), optional
        Labels of the queries, in addition to those of the points. With queries, each pair of
        numbers in `exclude` is a query and a point.
    batch : array_like of int, shape (n,), optional
        Many systems in one call, as in `pairs`: the system of each point, ascending. Neighbours are
        in the same system. The result is that of one call for each system, in ascending order, but
        indices number the points of all systems. Not with `indices`.
    query_batch : array_like of int, shape (q,), optional
        The system of each query, ascending; with `batch` and `queries`, and only then.

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
        As for `pairs`. ValueError also if `queries` and `points` differ in their number of columns
        or in their box, or if the queries lack the radii or types that they need.

    See Also
    --------
    pairs : each pair once, found in less time.
    coordination : the lengths of the rows alone.
    pairs_between : two sets, as arrays of pairs.

    Notes
    -----
    The points are searched twice, once to count and once to write each row in place, so that
    nothing is stored besides the result. The table is the same for any number of threads.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]
    >>> table = hs.neighbors(points, 2.0, quantities="jd")
    >>> table
    NeighborTable(3 rows, 4 entries, quantities 'jd')
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

    >>> [row.tolist() for row in hs.neighbors(points, None, radii=[0.5, 1.5, 3.0], rule="gather")]
    [[], [0], [0, 1]]
    """
    if unknown:
        refuse_unknown(neighbors, unknown)
    if type(box) is Box:
        box = box.vectors
    found: Any = points  # these five as the core has them
    largest: Any = cutoff
    vectors: Any = box
    periods: Any = periodic
    asking: Any = queries
    arrays: Any = NotImplemented
    reach = None
    if (
        radii is None and query_radii is None and rule is None
        and types is None and query_types is None and algorithm is AUTO
        and supports is None and query_supports is None and extent is None and indices is None
        and groups is None and exclude is None and exclude_within is None and min_distance is None
        and query_groups is None and query_exclude is None
        and batch is None and query_batch is None
    ):  # fmt: skip
        arrays = _core.plain(
            _core.neighbors, points, cutoff, box, periodic, inclusive, precision, kernel,
            memory_limit, None, threads, quantities, index_dtype, queries,
        )
    if arrays is NotImplemented:
        rest = as_rest(inclusive, precision, kernel, memory_limit, None, threads)
        given = Given(
            radii, query_radii, rule, types, query_types, supports, query_supports, extent
        )
        chosen = Chosen(
            groups, exclude, exclude_within, min_distance, query_groups, query_exclude
        )
        if batch is not None:
            from halfshell._functions.systems import rows_of_systems  # here: others do without

            refuse_indices(indices)
            return rows_of_systems(
                as_systems(
                    points, cutoff, box, periodic, batch, given, chosen, precision, queries,
                    query_batch, directed=True,
                ),
                rest, quantities, index_dtype, algorithm, queries is None and rule not in DIRECTED,
            )  # fmt: skip
        check_no_batch(query_batch)
        search, asking, reach = as_search_of_each(
            points, cutoff, box, periodic, rest, given, queries, directed=True, chosen=chosen
        )
        if indices is not None:
            return rows_alone(
                search, indices, queries, quantities, as_index_bytes(index_dtype), reach, algorithm
            )
        arrays = _core.neighbors(
            *search, quantities, as_index_bytes(index_dtype), asking, reach, algorithm
        )
        found, largest, vectors, periods = search[:4]
    origin = None
    if "d" in quantities and "j" in quantities:  # else it cannot be sorted
        find_shifts = shifts_of_search(largest, inclusive, precision, threads, reach)
        origin = Origin(found, asking, vectors, periods, find_shifts)
    is_full = queries is None and rule not in DIRECTED
    return NeighborTable(arrays, quantities, len(found), is_full, origin=origin)


def rows_alone(
    search: Search,
    indices: Any,
    queries: Any,
    quantities: str,
    index_bytes: int,
    reach: Reach | None,
    algorithm: str,
) -> NeighborTable:
    """The table of some points; sorting it exactly needs what the search found."""
    from halfshell._convert.own_rows import check_alone, rows_of_points  # here: others do without
    from halfshell._convert.touching import asked_by

    check_alone(queries)
    points, largest, vectors, bits, inclusive, precision = search[:6]
    arrays, numbers, entries = rows_of_points(
        search, points, indices, quantities, index_bytes, reach, algorithm
    )
    origin = None
    if "d" in quantities and "j" in quantities:  # else it cannot be sorted
        by = asked_by(reach, numbers)
        find_shifts = shifts_of_search(largest, inclusive, precision, search[9], by)
        origin = Origin(points, points[numbers], vectors, bits, find_shifts)
    return NeighborTable(
        arrays, quantities, len(points), False, origin=origin, entries=entries
    )
