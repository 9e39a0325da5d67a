# SPDX-License-Identifier: BSD-3-Clause
"""Triplets: two entries of one row, as their positions among all entries."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.memory import refuse_unavailable

Positions = npt.NDArray[np.int64]
Pair = tuple[Positions, Positions]

# Arrays of int64 that are there at one time, of the length of the result.
_COPIES = 5


def triplets(offsets: Positions, ordered: bool) -> Pair:
    """All of them."""
    counts = np.diff(offsets)
    total = _number(counts, ordered)
    refuse_unavailable(8 * _COPIES * total, f"{total} triplets")
    return _of_rows(offsets[:-1], counts, ordered)


def blocks_of_triplets(offsets: Positions, ordered: bool, most: int) -> Iterator[Pair]:
    """Whole rows at a time, together of at most so many triplets, or one row that has more."""
    counts = np.diff(offsets)
    sums = np.cumsum(_in_row(counts, ordered))
    first = 0
    while first < len(counts):
        before = int(sums[first - 1]) if first else 0
        end = max(first + 1, int(np.searchsorted(sums, before + most, side="right")))
        refuse_unavailable(8 * _COPIES * (int(sums[end - 1]) - before), "the triplets of one row")
        if int(sums[end - 1]) > before:
            yield _of_rows(offsets[first:end], counts[first:end], ordered)
        first = end


def _in_row(counts: npt.NDArray[Any], ordered: bool) -> npt.NDArray[np.int64]:
    several: npt.NDArray[np.int64] = counts * (counts - 1)
    return several if ordered else several // 2


def _number(counts: npt.NDArray[Any], ordered: bool) -> int:
    # As Python numbers: a product of the counts of a huge row may pass int64 when it is summed.
    total = int(np.dot(counts.astype(object), counts - 1)) if len(counts) else 0
    return total if ordered else total // 2


def _of_rows(starts: Positions, counts: npt.NDArray[Any], ordered: bool) -> Pair:
    """Of these rows; each entry as the first one, with those behind it or all others."""
    n_entries = int(counts.sum())
    row_start = np.repeat(starts, counts)
    entry = np.arange(n_entries) + (int(starts[0]) if len(starts) else 0)
    place = entry - row_start
    others = np.repeat(counts, counts) - 1 - (0 if ordered else place)
    first = np.repeat(entry, others)
    step = np.arange(len(first)) - np.repeat(np.cumsum(others) - others, others)
    if not ordered:
        return first, first + 1 + step
    # Those before the entry, then those behind it.
    second = np.repeat(row_start, others) + step
    second += step >= np.repeat(place, others)
    return first, second
