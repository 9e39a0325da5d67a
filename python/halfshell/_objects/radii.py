# SPDX-License-Identifier: BSD-3-Clause
"""Rows of queries that have a radius each, among the points of a cell list.

The core divides queries by octave of their radius and sorts the points anew for each octave. Few
queries among many points, within the cutoff that cells were made for, are sooner done by one search
of these cells for each radius that occurs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.call import take
from halfshell._convert.memory import gigabytes
from halfshell._convert.options import as_index_bytes
from halfshell._convert.points import Points
from halfshell._convert.starts import starts_of
from halfshell._functions.neighbors import listed
from halfshell._objects.exact_order import Origin, copied
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._settings import current, settings

Columns = tuple[npt.NDArray[Any], ...]
Radii = npt.NDArray[np.float64]

#: Points that are sorted in the time of one search of cells.
_SORTED_MEANWHILE = 2048
_LARGEST_GATHERED = 2.0**1022  # the core has no larger radii in one search


def query_each(
    cells: Any, queries: Points, radii: Radii, options: dict[str, Any]
) -> NeighborTable:
    """The table of all points within the radius of each query."""
    quantities = options.pop("quantities", "j")
    index_bytes = as_index_bytes(options.pop("index_dtype", np.int64))
    how = current()
    # What sorting by distance searches again is that of now; the caller's arrays may change.
    queries = queries._over(queries.positions.copy())
    options = {name: copied(value) for name, value in options.items()}

    def rows(asking: Points, letters: str) -> Columns:
        if not len(radii) or not _search_apart(radii, cells.cutoff, len(cells)):
            call = take(
                cells.points, None, asking.replace(radii=radii), rule="gather", directed=True,
                **options,
            )  # fmt: skip
            found: Columns = listed(call, letters, index_bytes)
            return found

        def search(members: npt.NDArray[np.intp], radius: float, room: float | None) -> Columns:
            with settings(memory_limit=how.memory_limit if room is None else room):
                call = take(cells, radius, asking[members], directed=True, **options)
                part: Columns = listed(call, letters, index_bytes)
            return part

        return _search_each(search, radii, how.memory_limit)

    def find_shifts(origin: Origin) -> npt.NDArray[Any]:
        options.pop("progress", None)
        with settings(precision=how.precision, algorithm=how.algorithm):
            return rows(queries, "S")[1]

    arrays = rows(queries, quantities)
    origin = None
    if "d" in quantities and "j" in quantities:
        points, box, bits = cells.points._scene
        origin = Origin(points, queries.positions, box, bits, find_shifts, is_own=True)
    return NeighborTable(arrays, quantities, len(cells), False, origin=origin)


def _search_apart(radii: Radii, cutoff: float, n_points: int) -> bool:
    """Whether one search for each radius takes less time than sorting the points, or must be."""
    largest = float(radii.max())
    if largest > _LARGEST_GATHERED:
        return True
    limit = n_points // _SORTED_MEANWHILE
    if largest > cutoff or limit == 0:
        return False
    return len(radii) <= limit or len(np.unique(radii)) <= limit


def _search_each(
    search: Callable[[npt.NDArray[np.intp], float, float | None], Columns],
    radii: Radii,
    limit: float | None,
) -> Columns:
    """Offsets and arrays of all rows, in the order of the queries.

    search: returns those of some queries, by number, within one radius, and takes so many bytes;
    None: the limit of all.
    """
    lengths, which = np.unique(radii, return_inverse=True)
    order = np.argsort(which.reshape(-1), kind="stable")
    parts: list[Columns] = []
    held = 0
    ends = np.searchsorted(which.reshape(-1)[order], np.arange(len(lengths)), side="right")
    for radius, members in zip(lengths.tolist(), np.split(order, ends[:-1])):
        room = None if limit is None or held == 0 else max(0.0, float(limit) - held)
        parts.append(search(members, radius, room))
        held += sum(column.nbytes for column in parts[-1])
    if limit is not None and len(parts) > 1 and 2 * held > limit:
        raise MemoryError(
            f"the result would not fit: joined from rows of different radii it takes "
            f"{gigabytes(2 * held)} GB, {float(limit) / 1e9:.3g} GB are allowed"
        )
    return parts[0] if len(parts) == 1 else _joined(parts, order)


def _joined(parts: list[Columns], order: npt.NDArray[np.intp]) -> Columns:
    """One table of parts whose rows are in this order."""
    counts = np.concatenate([np.diff(part[0]) for part in parts])
    lengths = np.empty(len(order), np.int64)
    lengths[order] = counts
    offsets = starts_of(lengths)
    starts = offsets[:-1][order] - starts_of(counts)[:-1]
    to = np.arange(int(offsets[-1])) + np.repeat(starts, counts)
    joined = [offsets]
    for columns in list(zip(*parts))[1:]:
        together = np.concatenate(columns)
        column = np.empty_like(together)
        column[to] = together
        joined.append(column)
    for array in joined:
        array.flags.writeable = False
    return tuple(joined)
