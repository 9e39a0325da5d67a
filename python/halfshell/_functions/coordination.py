# SPDX-License-Identifier: BSD-3-Clause
"""`coordination`: the lengths of the rows of full lists; the work is done in C."""

from __future__ import annotations

from typing import Any, Never, cast

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.batch import as_systems, check_no_batch, refuse_indices
from halfshell._convert.given import Chosen, Given
from halfshell._convert.options import AUTO, as_flag
from halfshell._convert.search import as_rest, as_search_of_each
from halfshell._convert.types import (
    Algorithm,
    ArrayLike,
    BoxLike,
    PairCutoff,
    PeriodicLike,
    PointsLike,
    Precision,
    Rule,
)
from halfshell._functions.neighbors import rows_alone
from halfshell._objects.box import Box
from halfshell._unknown import refuse_unknown


def coordination(
    points: PointsLike,
    cutoff: PairCutoff,
    *,
    queries: PointsLike | None = None,
    radii: ArrayLike | None = None,
    query_radii: ArrayLike | None = None,
    rule: Rule | None = None,
    types: npt.ArrayLike | None = None,
    query_types: npt.ArrayLike | None = None,
    by_type: bool | None = None,
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
) -> npt.NDArray[np.int64]:
    """Count the neighbours of each point, or of each query, without listing them.

    Parameters
    ----------
    points, cutoff, queries, radii, query_radii, rule, query_types
        As in `neighbors`.
    types : array_like of int or str, shape (n,), optional
        The type of each point, a number from 0 on or a name, such as ``atoms.symbols`` of ASE.
    by_type : bool, optional
        Count the neighbours of each type separately. Default: True if `types` are given with one
        cutoff for all, False with a cutoff for each pair of types.
    supports, query_supports, extent
        As in `neighbors`.
    box, periodic, inclusive, precision, algorithm, kernel, threads
        As in `neighbors`.
    memory_limit : float, optional
        Bytes that the search may take.
    indices : array_like of int, shape (r,), optional
        Count only for these points, as in `neighbors`; internally their neighbours are listed.
    groups, exclude, exclude_within, min_distance
        As in `pairs`.
    query_groups, query_exclude : array_like of int or str, shape (q,), optional
        Labels of the queries, in addition to those of the points. With queries, each pair of
        numbers in `exclude` is a query and a point.
    batch, query_batch
        As in `neighbors`.

    Returns
    -------
    ndarray of int64, shape (n,), (q,) or (r,)
        Length of each row of the full list; each image counts. The sum is twice
        `count_pairs`, or equal to it with `queries`, except for rules with a direction.

        By type the shape is (n, t), (q, t) or (r, t): column k counts the neighbours of type k, or
        those with name k of ``np.unique(types)``. The sum of a row is the count without types.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `neighbors`; MemoryError only if the search itself or the counts would not fit.
        ValueError also if `by_type` is set without `types`, or `query_types` are given with one
        cutoff for all.

    See Also
    --------
    neighbors : the neighbours themselves.

    Examples
    --------
    >>> import halfshell as hs
    >>> hs.coordination([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]], 2.0).tolist()
    [1, 2, 1]
    >>> hs.coordination([[0.0], [1.0], [3.0]], None, radii=[1.0, 0.5, 1.0], rule="max").tolist()
    [1, 1, 0]

    The number of neighbours of each element:

    >>> names = ["Si", "O", "O"]  # columns: O, Si
    >>> hs.coordination([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]], 2.0, types=names).tolist()
    [[1, 0], [1, 1], [1, 0]]
    """
    if unknown:
        refuse_unknown(coordination, unknown)
    if type(box) is Box:
        box = box.vectors
    if types is not None or by_type is not None:
        from halfshell._functions.by_type import count_by_type, is_one_cutoff  # few need it

        given = Given(
            radii, query_radii, rule, types, query_types, supports, query_supports, extent
        )
        if is_one_cutoff(cutoff, batch) if by_type is None else as_flag(by_type, "by_type"):
            rest = as_rest(inclusive, precision, kernel, memory_limit, None, threads)
            chosen = Chosen(
                groups, exclude, exclude_within, min_distance, query_groups, query_exclude
            )
            if batch is not None:
                from halfshell._functions.systems import count_by_type_in_systems

                refuse_indices(indices)
                return count_by_type_in_systems(
                    points, cutoff, box, periodic, rest, given, chosen, queries, algorithm, batch,
                    query_batch,
                )  # fmt: skip
            check_no_batch(query_batch)
            return count_by_type(
                points, cutoff, box, periodic, rest, given, chosen, queries, algorithm, indices
            )
    if (
        radii is None and query_radii is None and rule is None
        and types is None and query_types is None and algorithm is AUTO
        and supports is None and query_supports is None and extent is None and indices is None
        and groups is None and exclude is None and exclude_within is None and min_distance is None
        and query_groups is None and query_exclude is None
        and batch is None and query_batch is None
    ):  # fmt: skip
        counts: Any = _core.plain(
            _core.coordination, points, cutoff, box, periodic, inclusive, precision, kernel,
            memory_limit, None, threads, queries,
        )
        if counts is not NotImplemented:
            return cast("npt.NDArray[np.int64]", counts)
    rest = as_rest(inclusive, precision, kernel, memory_limit, None, threads)
    given = Given(
        radii, query_radii, rule, types, query_types, supports, query_supports, extent
    )
    chosen = Chosen(groups, exclude, exclude_within, min_distance, query_groups, query_exclude)
    if batch is not None:
        refuse_indices(indices)
        scene, own, reach, asking = as_systems(
            points, cutoff, box, periodic, batch, given, chosen, precision, queries, query_batch,
            directed=True,
        )  # fmt: skip
        return _core.coordination(*(*scene, *rest, asking, reach, algorithm, own))
    check_no_batch(query_batch)
    search, asking, reach = as_search_of_each(
        points, cutoff, box, periodic, rest, given, queries, directed=True, chosen=chosen
    )
    if indices is not None:
        return rows_alone(search, indices, queries, "j", 4, reach, algorithm).counts.copy()
    return _core.coordination(*search, asking, reach, algorithm)
