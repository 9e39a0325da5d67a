# SPDX-License-Identifier: BSD-3-Clause
"""Lists for other packages of arrays: full or half, of one system or many, in ascending order."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.options import as_flag
from halfshell._convert.points import Points
from halfshell._errors import CapacityError
from halfshell._functions.neighbors import neighbors
from halfshell._functions.pairs import pairs, pairs_between

#: i, j: int64 (m,); S: int32 (m, d).
Entries = tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any]]


def entries_of(
    points: npt.NDArray[Any],
    cutoff: Any,
    box: Any,
    periodic: Any,
    batch: npt.NDArray[Any] | None,
    half: bool,
    inclusive: bool,
) -> Entries:
    """Return i, j and S of a list, ascending by (i, j, S)."""
    given = Points._of(points, "points", box, periodic, batch)
    if as_flag(half, "half"):
        i, j, S = pairs(given, cutoff, quantities="ijS", sort=True, inclusive=inclusive)
    else:
        table = neighbors(given, cutoff, quantities="jS", inclusive=inclusive)
        i, j, S = table.to_pairs(quantities="ijS")
    return i, j, S


def entries_between(
    queries: npt.NDArray[Any],
    points: npt.NDArray[Any],
    cutoff: float,
    query_batch: npt.NDArray[Any] | None,
    batch: npt.NDArray[Any] | None,
    inclusive: bool,
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return queries i and points j of the same system, ascending by (i, j), in open space."""
    if batch is not None or query_batch is not None:  # a set without numbers is all of system 0
        batch = np.zeros(len(points), np.int64) if batch is None else batch
        query_batch = np.zeros(len(queries), np.int64) if query_batch is None else query_batch
    asking = Points._of(queries, "queries", batch=query_batch)
    i, j = pairs_between(
        asking, Points._of(points, "points", batch=batch), cutoff, inclusive=inclusive
    )
    return i, j


def check_rows(i: npt.NDArray[Any], most: int | None) -> None:
    """Raise if a row has more entries than `most`; none is ever cut."""
    if most is not None and len(i):
        needed = int(np.bincount(i).max())
        if needed > most:
            raise CapacityError(
                f"max_num_neighbors is {most}, but a point has {needed} neighbours, and none is "
                "left out silently: give None for all of them",
                needed,
            )
