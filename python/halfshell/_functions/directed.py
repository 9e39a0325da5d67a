# SPDX-License-Identifier: BSD-3-Clause
"""Lists for other packages of arrays: full or half, of one system or many, in ascending order."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._errors import CapacityError
from halfshell._functions.between import pairs_between
from halfshell._functions.neighbors import neighbors
from halfshell._functions.pairs import pairs

__all__ = ["Entries", "check_rows", "entries_between", "entries_of"]

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
    if half or batch is not None:
        i, j, S = pairs(
            points, cutoff, box=box, periodic=periodic, quantities="ijS", sort=True,
            inclusive=inclusive, batch=batch,
        )  # fmt: skip
        return (i, j, S) if half else _both_ways(i, j, S)
    table = neighbors(
        points, cutoff, box=box, periodic=periodic, quantities="jS", inclusive=inclusive
    )
    i, j, S = table.to_pairs(quantities="ijS")
    return i, j, S


def _both_ways(i: npt.NDArray[Any], j: npt.NDArray[Any], S: npt.NDArray[Any]) -> Entries:
    if S.min(initial=0) == np.iinfo(S.dtype).min:
        raise OverflowError("a shift of -2**31 has no opposite in int32")
    i, j, S = np.concatenate((i, j)), np.concatenate((j, i)), np.concatenate((S, -S))
    order = np.lexsort((*S.T[::-1], j, i))
    return i[order], j[order], S[order]


def entries_between(
    queries: npt.NDArray[Any],
    points: npt.NDArray[Any],
    cutoff: float,
    query_batch: npt.NDArray[Any] | None,
    batch: npt.NDArray[Any] | None,
    inclusive: bool,
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return queries i and points j of the same system, ascending by (i, j), in open space."""
    if query_batch is None and batch is None:
        found = [_between(queries, points, cutoff, inclusive)]
    else:
        ends = [_ends(query_batch, len(queries)), _ends(batch, len(points))]
        found = []
        for k in sorted({*ends[0], *ends[1]}):
            (a, b), (c, e) = (of.get(k, (0, 0)) for of in ends)
            i, j = _between(queries[a:b], points[c:e], cutoff, inclusive)
            found.append((i + a, j + c))
    empty = np.empty(0, np.int64)
    i, j = (np.concatenate([empty, *(pair[k] for pair in found)]) for k in range(2))
    return i, j


def _between(queries: Any, points: Any, cutoff: float, inclusive: bool) -> tuple[Any, Any]:
    i, j = pairs_between(queries, points, cutoff, inclusive=inclusive)
    order = np.lexsort((j, i))
    return i[order], j[order]


def _ends(batch: npt.NDArray[Any] | None, n: int) -> dict[int, tuple[int, int]]:
    """Where each system begins and ends; a set without `batch` is all of system 0."""
    if batch is None:
        return {0: (0, n)}
    if batch.shape != (n,):
        raise ValueError(f"batch must have shape ({n},), one number a point, got {batch.shape}")
    if n and (batch[0] < 0 or (np.diff(batch) < 0).any()):
        raise ValueError("batch must be ascending from 0 or above")
    names, starts, counts = np.unique(batch, return_index=True, return_counts=True)
    rows = zip(names.tolist(), starts.tolist(), counts.tolist())
    return {name: (start, start + count) for name, start, count in rows}


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
