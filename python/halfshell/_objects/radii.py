# SPDX-License-Identifier: BSD-3-Clause
"""Rows of queries that have a radius each, from searches with one radius for many queries.

Queries whose radii are within a factor of two are searched at once, with the largest radius among
them, and longer neighbours are left out. Distances are within 1 ulp, so that only those next to a
radius leave a doubt: such a query is searched again, with its own radius, which is decided exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import PointArray

Columns = tuple[npt.NDArray[Any], ...]
# Of (queries, radius, quantities): offsets, then an array for each quantity.
Search = Callable[[PointArray, float, str], Columns]

_DOUBT = 4  # ulps of a radius: more than the 1 ulp of a distance and the rounding of this product


def search_each(
    search: Search,
    queries: PointArray,
    radii: npt.NDArray[np.float64],
    quantities: str,
    inclusive: bool,
    is_exact: bool = True,
) -> Columns:
    """Offsets and arrays of all rows, in the order of the queries.

    is_exact: the search decides exactly. Otherwise distances do not tell what it would decide, and
    only queries with the same radius are searched at once.
    """
    letters = quantities if "d" in quantities else quantities + "d"
    groups = _octaves(radii) if is_exact else np.unique(radii, return_inverse=True)[1]
    parts = []
    for group in np.unique(groups):
        members = np.flatnonzero(groups == group)
        largest = float(radii[members].max())
        arrays = search(queries[members], largest, letters)
        parts += _split(search, queries, radii, members, largest, arrays, letters, inclusive)
    if not parts:
        parts = [(np.empty(0, np.intp), search(queries, 0.0, letters))]
    return _join(parts, len(queries), len(quantities))


def _octaves(radii: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
    """The same number for radii within a factor of two, and one of its own for 0."""
    octaves = np.frexp(radii)[1]
    octaves[radii == 0.0] = np.iinfo(octaves.dtype).min
    return octaves


def _split(
    search: Search,
    queries: PointArray,
    radii: npt.NDArray[np.float64],
    members: npt.NDArray[np.intp],
    largest: float,
    arrays: Columns,
    letters: str,
    inclusive: bool,
) -> list[tuple[npt.NDArray[np.intp], Columns]]:
    """These rows without what is beyond each radius, and those of which that could not be said."""
    offsets = arrays[0]
    row = np.repeat(np.arange(len(members)), np.diff(offsets))
    reach = radii[members][row]
    distance = arrays[1 + letters.index("d")]
    near = (np.abs(distance - reach) <= _DOUBT * np.spacing(reach)) & (reach != largest)
    doubtful = np.zeros(len(members), bool)
    doubtful[row[near]] = True
    inside = (distance <= reach) if inclusive else (distance < reach)
    kept = (inside | (reach == largest)) & ~doubtful[row]
    counts = np.bincount(row[kept], minlength=len(members))
    sure = np.flatnonzero(~doubtful)
    rows = np.concatenate(([0], np.cumsum(counts[sure])))
    parts = [(members[sure], (rows, *(array[kept] for array in arrays[1:])))]
    for i in members[doubtful]:
        parts.append((np.array([i]), search(queries[i : i + 1], float(radii[i]), letters)))
    return parts


def _join(
    parts: list[tuple[npt.NDArray[np.intp], Columns]], n_rows: int, n_quantities: int
) -> Columns:
    """One table: row k of a part is that of query ``members[k]``."""
    counts = np.zeros(n_rows, np.int64)
    for members, arrays in parts:
        counts[members] = np.diff(arrays[0])
    offsets = np.concatenate(([0], np.cumsum(counts)))
    joined = [
        np.empty((offsets[-1], *column.shape[1:]), column.dtype)
        for column in parts[0][1][1 : n_quantities + 1]
    ]
    for members, arrays in parts:
        lengths = np.diff(arrays[0])
        to = np.arange(arrays[0][-1]) + np.repeat(offsets[members] - arrays[0][:-1], lengths)
        for column, part in zip(joined, arrays[1:], strict=False):
            column[to] = part
    for array in (offsets, *joined):
        array.flags.writeable = False
    return offsets, *joined
