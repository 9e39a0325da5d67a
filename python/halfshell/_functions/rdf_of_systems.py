# SPDX-License-Identifier: BSD-3-Clause
"""g(r) of many systems in one call, each of them a frame."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.batch import as_systems
from halfshell._convert.given import Chosen, Given
from halfshell._convert.marks import Marks, as_named_marks, binned
from halfshell._convert.types import FloatArray, Rest
from halfshell._functions.ideal_gas import (
    centers,
    in_shells,
    known_types,
    partners,
    refuse_types,
    shell_shares,
)
from halfshell._objects.radial_distribution import RadialDistribution


def rdf_of_systems(
    points: Any, edges: FloatArray, box: Any, periodic: Any, batch: Any, rest: Rest,
    chosen: Chosen, queries: Any, query_batch: Any, types: Any, query_types: Any,
) -> RadialDistribution:  # fmt: skip
    """`rdf` with a batch: counts of all systems, over what their ideal gases would have."""
    scene, own, selection, asking = as_systems(
        points, 0.0, box, periodic, batch, Given(), chosen, "exact", queries, query_batch
    )
    array, _, vectors, bits = scene
    numbers, _, boxes, of_queries, axes = own
    if axes is not None:  # one that does not repeat along all axes is refused
        bits = next((int(one) for one in axes if one != bits), bits)
    shell_shares(vectors, bits, edges)  # also where there are no systems
    marks, names = as_named_marks(len(array), asking, types, query_types)
    refuse_types(marks, len(edges) - 1)
    found = binned(
        (*scene, *rest), edges, asking, marks, "r_max", selection=selection, systems=own
    )
    counts = found.sum(axis=0, dtype=np.int64)
    expected = np.zeros(counts.shape)
    occupied = np.unique(numbers if of_queries is None else np.append(numbers, of_queries))
    ends = _ends(numbers, occupied)
    query_ends = ends if of_queries is None else _ends(of_queries, occupied)
    for k, s in enumerate(occupied.tolist()):
        a, b, c, e = ends[k], ends[k + 1], query_ends[k], query_ends[k + 1]
        shares = shell_shares(vectors if boxes is None else boxes[s], bits, edges)
        own_marks = Marks(
            marks.n_types, _part(marks.types, a, b), None, _part(marks.query_types, c, e), None
        )
        pairs = partners(b - a, None if asking is None else e - c, own_marks)
        expected += in_shells(pairs, shares)
    return RadialDistribution(
        counts, edges, known_types(marks, names), expected, centers(len(array), asking, marks),
        max(len(occupied), 1), asking is None,
    )  # fmt: skip


def _ends(numbers: npt.NDArray[np.int64], occupied: npt.NDArray[np.int64]) -> list[int]:
    """Where each of these systems begins, and the last one ends."""
    return [*np.searchsorted(numbers, occupied).tolist(), len(numbers)]


def _part(values: npt.NDArray[Any] | None, first: int, end: int) -> npt.NDArray[Any] | None:
    return None if values is None else values[first:end]
