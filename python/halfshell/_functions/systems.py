# SPDX-License-Identifier: BSD-3-Clause
"""Rows of many systems: one search for all, what their table needs to be sorted, counts by type."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell import _core
from halfshell._convert.batch import as_systems
from halfshell._convert.given import Given
from halfshell._convert.options import AUTO, as_index_bytes
from halfshell._convert.scene import flags_of
from halfshell._functions.by_type import (
    counted,
    is_one_cutoff,
    refuse_other_reaches,
    types_for_counts,
)
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._objects.origin import Origin, copied
from halfshell._objects.origin_of_systems import OriginOfSystems

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.batch import Scene
    from halfshell._convert.given import Chosen
    from halfshell._convert.types import Algorithm, PointArray, Reach, Rest, Systems


def rows_of_systems(
    given: tuple[Scene, Systems, Reach | None, PointArray | None],
    rest: Rest,
    quantities: str,
    index_dtype: npt.DTypeLike,
    algorithm: Algorithm,
    is_full: bool,
) -> NeighborTable:
    """The table of all points, or queries, of what `as_systems` returns."""
    (points, _, vectors, bits), own, reach, asking = given
    wanted = (quantities, as_index_bytes(index_dtype))
    arrays = _core.neighbors(*(*given[0], *rest, *wanted, asking, reach, algorithm, own))
    origin = None
    if "d" in quantities and "j" in quantities:  # else it cannot be sorted
        kept: Any = copied((reach, own))  # the caller's arrays may change

        def find(origin: Origin) -> npt.NDArray[Any]:
            return _core.neighbors(
                *(origin.points, *given[0][1:], *rest[:3], None, None, rest[5], "S", 8),
                *(origin.queries, kept[0], AUTO, kept[1]),
            )[1]

        numbers, _, boxes, of_queries, axes = kept[1]
        if axes is not None and vectors is not None:
            rows = np.broadcast_to(vectors, (len(axes), *vectors.shape)) if boxes is None else boxes
            boxes = rows * flags_of(axes, vectors.shape[0])[:, :, None]
        if boxes is None:
            origin = Origin(points, asking, vectors, bits, find)
        else:
            asked_in = numbers if of_queries is None else of_queries
            origin = OriginOfSystems.of(points, asking, boxes, bits, find, asked_in)
    return NeighborTable(arrays, quantities, len(points), is_full, origin=origin)


def count_by_type_in_systems(
    points: Any, cutoff: Any, box: Any, periodic: Any, rest: Rest, given: Given, chosen: Chosen,
    queries: Any, algorithm: Any, batch: Any, query_batch: Any,
) -> npt.NDArray[np.int64]:  # fmt: skip
    """`coordination` of many systems with a column for each type: neighbours are listed."""
    reaches = given
    if is_one_cutoff(cutoff, batch):
        refuse_other_reaches(given)
        reaches = Given()
    scene, own, reach, asking = as_systems(
        points, cutoff, box, periodic, batch, reaches, chosen, rest[1], queries, query_batch,
        directed=True,
    )  # fmt: skip
    n = len(scene[0])
    types, n_types = types_for_counts(given.types, n, n if asking is None else len(asking))
    offsets, j = _core.neighbors(*(*scene, *rest, "j", 4, asking, reach, algorithm, own))
    return counted(offsets, j, types, n_types)
