# SPDX-License-Identifier: BSD-3-Clause
"""Rows of queries that have a radius each, from searches with one radius for many queries.

Queries with the same radius are searched at once, and nothing is left out of what they find. Radii
that few queries have are taken together where they differ by a factor of 2**(1/4) at most: these
are searched with the largest radius among them, a block of queries at a time, and longer neighbours
are left out before the next block. Distances are within 1 ulp, so that only those next to a radius
leave a doubt: such a query is searched again, with its own radius, which is decided exactly.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from halfshell._convert.memory import gigabytes, refuse_unavailable
from halfshell._convert.types import PointArray

Columns = tuple[npt.NDArray[Any], ...]
Members = npt.NDArray[np.intp]  # queries, by number
Part = tuple[Members, list[npt.NDArray[Any]]]  # whose rows; offsets, then a column a quantity

_DOUBT = 4  # ulps of a radius: more than the 1 ulp of a distance and the rounding of this product
_COMMON = 16  # queries with one radius that are worth a search of their own
_BLOCK_BYTES = 1 << 24  # of neighbours that may be left out, and of what decides that
_FILTER_BYTES = 64  # for each of them: its row, its radius, how far they are apart, masks


class Searches(Protocol):
    """How points are searched for some queries, in so many bytes; None: what `limit` says."""

    limit: float | None

    def rows(
        self, queries: PointArray, radius: float, quantities: str, room: float | None
    ) -> Columns:
        """Offsets, then an array for each quantity."""

    def counts(self, queries: PointArray, radius: float) -> npt.NDArray[np.int64]:
        """Lengths of these rows."""


def search_each(
    searches: Searches,
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
    if len(radii) == 0 or (radii == radii[0]).all():
        radius = float(radii[0]) if len(radii) else 0.0
        return searches.rows(queries, radius, quantities, None)
    return _Each(searches, queries, radii, quantities, inclusive).all_of(_bands(radii, is_exact))


def _bands(radii: npt.NDArray[np.float64], is_exact: bool) -> list[Members]:
    """Queries that are searched together."""
    lengths, which, counts = np.unique(radii, return_inverse=True, return_counts=True)
    bands = np.arange(len(lengths))
    if is_exact:
        with np.errstate(divide="ignore"):
            quarter = np.floor(4.0 * np.log2(lengths))  # of an octave; of 0 it is -inf
        is_rare = counts < _COMMON
        bands[is_rare] = len(lengths) + np.unique(quarter[is_rare], return_inverse=True)[1]
    band = bands[which.reshape(-1)]
    order = np.argsort(band, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(band[order])) + 1)


class _Each:
    """The rows that were found so far, and what is left of the memory."""

    def __init__(
        self,
        searches: Searches,
        queries: PointArray,
        radii: npt.NDArray[np.float64],
        quantities: str,
        inclusive: bool,
    ) -> None:
        self.searches = searches
        self.queries = queries
        self.radii = radii
        self.quantities = quantities
        self.letters = quantities if "d" in quantities else quantities + "d"
        self.inclusive = inclusive
        self.parts: list[Part] = []
        self.held = 0  # bytes of parts

    def all_of(self, bands: list[Members]) -> Columns:
        for members in bands:
            largest = float(self.radii[members].max())
            if (self.radii[members] == largest).all():
                self._plain(members)
                continue
            for block in self._blocks(members, largest):
                if len(block) == 1:
                    self._plain(block)
                else:
                    self._filtered(block, largest)
        return self._joined()

    def _room(self) -> float | None:
        """Bytes that a search may take."""
        if self.searches.limit is None or self.held == 0:
            return None
        return max(0.0, float(self.searches.limit) - self.held)

    def _search(self, members: Members, radius: float, letters: str) -> Columns:
        return self.searches.rows(self.queries[members], radius, letters, self._room())

    def _keep(self, members: Members, columns: Columns) -> None:
        self.parts.append((members, list(columns)))
        self.held += sum(column.nbytes for column in columns)

    def _plain(self, members: Members) -> None:
        """Rows of queries with one radius."""
        self._keep(members, self._search(members, float(self.radii[members[0]]), self.quantities))

    def _blocks(self, members: Members, largest: float) -> Iterator[Members]:
        """These queries, as many at a time as their neighbours within `largest` leave memory."""
        counts = self.searches.counts(self.queries[members], largest)
        ndim = self.queries.shape[1]
        # The columns as they are found, and what is kept of them.
        entry = 2 * sum({"D": 8 * ndim, "S": 4 * ndim}.get(letter, 8) for letter in self.letters)
        ends = np.cumsum(counts) * (entry + _FILTER_BYTES)
        begin = 0
        while begin < len(members):
            most = float(_BLOCK_BYTES)
            if self.searches.limit is not None:
                most = min(most, (float(self.searches.limit) - self.held) / 2.0)
            done = float(ends[begin - 1]) if begin else 0.0
            end = max(begin + 1, int(np.searchsorted(ends, done + most, side="right")))
            yield members[begin:end]
            begin = end

    def _filtered(self, members: Members, largest: float) -> None:
        """Rows without what is beyond each radius; again those of which that cannot be said."""
        letters = self.letters
        offsets, *columns = self._search(members, largest, letters)
        row = np.repeat(np.arange(len(members)), np.diff(offsets))
        reach = self.radii[members][row]
        distance = columns[letters.index("d")]
        near = (np.abs(distance - reach) <= _DOUBT * np.spacing(reach)) & (reach != largest)
        doubtful = np.zeros(len(members), bool)
        doubtful[row[near]] = True
        inside = (distance <= reach) if self.inclusive else (distance < reach)
        kept = (inside | (reach == largest)) & ~doubtful[row]
        counts = np.bincount(row[kept], minlength=len(members))
        sure = np.flatnonzero(~doubtful)
        rows = np.concatenate(([0], np.cumsum(counts[sure])))
        columns = [column[kept] for column in columns[: len(self.quantities)]]
        del row, reach, distance, near, inside, kept
        self._keep(members[sure], (rows, *columns))
        for i in members[doubtful]:
            self._plain(np.array([i]))

    def _joined(self) -> Columns:
        """One table: row k of a part is that of query ``members[k]``. Columns of parts go."""
        lengths = np.zeros(len(self.queries), np.int64)
        for members, arrays in self.parts:
            lengths[members] = np.diff(arrays[0])
        offsets = np.concatenate(([0], np.cumsum(lengths)))
        joined = [offsets]
        for k in range(1, len(self.quantities) + 1):
            like = self.parts[0][1][k][:0].copy()
            column = self._empty((int(offsets[-1]), *like.shape[1:]), like.dtype)
            for members, arrays in self.parts:
                starts = offsets[members] - arrays[0][:-1]
                to = np.arange(arrays[0][-1]) + np.repeat(starts, np.diff(arrays[0]))
                column[to] = arrays[k]
                self.held -= arrays[k].nbytes
                arrays[k] = like
            self.held += column.nbytes
            joined.append(column)
        for array in joined:
            array.flags.writeable = False
        return tuple(joined)

    def _empty(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> npt.NDArray[Any]:
        """An array, if it fits beside what is held."""
        needed = int(np.prod(shape, dtype=object)) * dtype.itemsize
        limit = self.searches.limit
        if limit is not None and self.held + needed > float(limit):
            raise MemoryError(
                f"the result would not fit: {shape[0]} neighbours, joined from rows of different "
                f"radii, take {gigabytes(self.held + needed)} GB, {float(limit) / 1e9:.3g} GB are "
                "allowed"
            )
        refuse_unavailable(needed, f"{shape[0]} neighbours of queries with a radius each")
        return np.empty(shape, dtype)
