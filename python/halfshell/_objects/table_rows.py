# SPDX-License-Identifier: BSD-3-Clause
"""Rows of neighbours in compressed form: their arrays, and one row after the other."""

from __future__ import annotations

import itertools
import operator
from collections.abc import Iterator
from typing import Any, Self, SupportsIndex, overload

import numpy as np
import numpy.typing as npt

from halfshell import _show
from halfshell._convert.foreign import shown
from halfshell._convert.options import as_count, as_flag
from halfshell._objects.exact_order import settle
from halfshell._objects.origin import Origin
from halfshell._objects.table_choice import as_rows, entries_of, row_sums
from halfshell._objects.table_forms import order_by_distance, rows_of

Array = npt.NDArray[Any]
Row = Array | tuple[Array, ...]
Chosen = Array | list[int] | list[bool]

_SORTED_AT_A_TIME = 1 << 17  # entries: some milliseconds


class TableRows:
    """What a `NeighborTable` holds, which has the documentation."""

    __slots__ = (
        "_arrays", "_entries", "_first_row", "_is_complete", "_is_in_order", "_is_of_one_set",
        "_n_points", "_origin", "_quantities",
    )

    _arrays: tuple[Array, ...]  # offsets, then one for each quantity
    _quantities: str
    _n_points: int
    _is_of_one_set: bool  # rows are those of the points themselves, with both directions
    _is_complete: bool  # no entry was left out
    _is_in_order: bool  # each row ascends by (j, S)
    _origin: Origin | None  # None: exact comparisons are not possible
    _first_row: int | Array  # number of row 0 among those that asked, or that of each row
    _entries: slice | Array  # which of all entries of the search, if their shifts are not here

    def __init__(
        self,
        arrays: tuple[Array, ...] = (),
        quantities: str = "",
        n_points: int = 0,
        is_of_one_set: bool = False,
        is_complete: bool = True,
        is_in_order: bool = True,
        origin: Origin | None = None,
        first_row: int | Array = 0,
        entries: slice | Array = slice(None),
    ) -> None:
        if type(arrays) is not tuple or type(quantities) is not str or not arrays:
            raise TypeError("a NeighborTable is what neighbors() returns: none is made of arrays")
        self._arrays = arrays
        self._quantities = quantities
        self._n_points = n_points
        self._is_of_one_set = is_of_one_set
        self._is_complete = is_complete
        self._is_in_order = is_in_order
        self._origin = origin
        self._first_row = first_row
        self._entries = entries

    # ---- what is there ---------------------------------------------------------------------

    @property
    def offsets(self) -> npt.NDArray[np.int64]:
        """Where each row begins, and the end of the last one; int64 (n_rows + 1,)."""
        return self._arrays[0]

    @property
    def counts(self) -> npt.NDArray[np.int64]:
        """Length of each row; int64 (n_rows,)."""
        return read_only(np.diff(self._arrays[0]))

    @property
    def indices(self) -> Array:
        """The neighbour j of each entry; (m,)."""
        return self._column("j")

    @property
    def distances(self) -> npt.NDArray[np.float64]:
        """The distance of each entry; float64 (m,)."""
        return self._column("d")

    @property
    def vectors(self) -> npt.NDArray[np.float64]:
        """The vector D of each entry; float64 (m, d)."""
        return self._column("D")

    @property
    def shifts(self) -> npt.NDArray[np.int32]:
        """The shift S of each entry; int32 (m, d)."""
        return self._column("S")

    @property
    def quantities(self) -> str:
        """Letters of what the table holds."""
        return self._quantities

    @property
    def n_rows(self) -> int:
        """Points or queries with a row."""
        return len(self._arrays[0]) - 1

    @property
    def n_points(self) -> int:
        """Points to find."""
        return self._n_points

    @property
    def n_entries(self) -> int:
        """Neighbours in all rows."""
        return int(self._arrays[0][-1] - self._arrays[0][0])

    @property
    def shape(self) -> tuple[int, int]:
        """(n_rows, n_points)."""
        return self.n_rows, self._n_points

    def _column(self, letter: str) -> Array:
        at = self._quantities.find(letter)
        if at < 0:
            name = {"j": "indices", "d": "distances", "D": "vectors", "S": "shifts"}[letter]
            raise AttributeError(
                f"this table has no {name}: request them with "
                f"{'an' if letter == 'S' else 'a'} {letter!r} in quantities, got "
                f"{self._quantities!r}"
            )
        return self._arrays[at + 1]

    # ---- rows ------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self._arrays[0]) - 1

    @overload
    def __getitem__(self, row: slice | Chosen) -> Self: ...  # type: ignore[overload-overlap]
    @overload
    def __getitem__(self, row: SupportsIndex) -> Row: ...
    def __getitem__(self, row: SupportsIndex | slice | Chosen) -> Row | Self:
        if isinstance(row, slice):
            return self._rows(row)
        try:
            i = operator.index(row)  # type: ignore[arg-type]
        except TypeError:
            i = None
        if i is None:
            return self._chosen(as_rows(row, len(self)))
        n = len(self)
        if not -n <= i < n:
            raise IndexError(f"row {shown(i)} of a table of {n} rows")
        first, end = self._arrays[0][i % n : i % n + 2]
        if len(self._arrays) == 2:
            return self._arrays[1][first:end]
        return tuple(column[first:end] for column in self._arrays[1:])

    def __iter__(self) -> Iterator[Row]:
        ends = self._arrays[0].tolist()
        for first, end in itertools.pairwise(ends):
            if len(self._arrays) == 2:
                yield self._arrays[1][first:end]
            else:
                yield tuple(column[first:end] for column in self._arrays[1:])

    def _rows(self, rows: slice) -> Self:
        first, end, step = rows.indices(len(self))
        if step != 1:
            raise ValueError(f"rows of a slice must follow each other, got a step of {shown(step)}")
        offsets = self._arrays[0][first : max(first, end) + 1]
        parts = tuple(column[offsets[0] : offsets[-1]] for column in self._arrays[1:])
        return type(self)(
            (read_only(offsets - offsets[0]), *parts), self._quantities, self._n_points, False,
            self._is_complete, self._is_in_order, self._origin, self._numbers_from(first, end),
            self._entries_between(int(offsets[0]), int(offsets[-1])),
        )

    def _chosen(self, rows: npt.NDArray[np.int64]) -> Self:
        offsets, entries = entries_of(self._arrays[0], rows)
        columns = (read_only(column[entries]) for column in self._arrays[1:])
        first = self._first_row
        return type(self)(
            (read_only(offsets), *columns), self._quantities, self._n_points, False,
            self._is_complete, self._is_in_order, self._origin,
            rows + first if isinstance(first, int) else first[rows], self._entries_at(entries),
        )

    def _numbers_from(self, first: int, end: int) -> int | Array:
        """What `_first_row` is for these rows."""
        before = self._first_row
        return before + first if isinstance(before, int) else before[first : max(first, end)]

    def sum(self, values: npt.ArrayLike) -> Array:
        """Sum the values of the entries in each row.

        Parameters
        ----------
        values : array_like of real numbers, shape (m,) or (m, ...)
            One for each entry, in the order of `indices`.

        Returns
        -------
        ndarray, shape (n_rows,) or (n_rows, ...)
            0 for rows without entries. Bools and integers are added in int64, unsigned integers in
            uint64, which both wrap as in NumPy; floats in float64.

        Raises
        ------
        TypeError, ValueError
            If `values` are not real numbers of up to 64 bits, or not one for each entry.

        Examples
        --------
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0], [1.0], [3.0], [9.0]], 2.0, quantities="jd")
        >>> table.sum(table.distances).tolist()
        [1.0, 3.0, 2.0, 0.0]
        """
        return row_sums(self._arrays[0], values)

    @overload
    def triplets(
        self, *, ordered: bool = False, block: None = None
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]: ...
    @overload
    def triplets(self, *, ordered: bool = False, block: int) -> Iterator[Any]: ...
    def triplets(self, *, ordered: bool = False, block: int | None = None) -> Any:
        """Pairs of entries that share a row: two neighbours of one point, for angles.

        Parameters
        ----------
        ordered : bool, default False
            Whether to return both orders of two entries, instead of only the earlier one first.
        block : int, optional
            Return an iterator over blocks of whole rows. A block has at most this many triplets,
            unless a single row has more.

        Returns
        -------
        first, second : ndarray of int64, shape (t,)
            Positions among the entries, in the order of `indices`: ``indices[first]`` and
            ``indices[second]`` are neighbours of one point. Ascending by (first, second). With
            `block` an iterator of such pairs.

        Raises
        ------
        TypeError, ValueError
            If `ordered` is not a bool, or `block` is not a whole number above 0.
        MemoryError
            If they would not fit.

        Examples
        --------
        The angle at the corner of a right triangle:

        >>> import numpy as np
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 1.0, quantities="jdD")
        >>> first, second = table.triplets()
        >>> table.indices[first].tolist(), table.indices[second].tolist()
        ([1], [2])
        >>> d, D = table.distances, table.vectors
        >>> cosine = (D[first] * D[second]).sum(axis=1) / (d[first] * d[second])
        >>> np.degrees(np.arccos(cosine)).tolist()
        [90.0]
        """
        from halfshell._objects.table_triplets import blocks_of_triplets, triplets

        offsets, in_order = self._arrays[0], as_flag(ordered, "ordered")
        if block is None:
            return triplets(offsets, in_order)
        return blocks_of_triplets(offsets, in_order, as_count(block, "block"))

    _shown = ("n_rows", "n_points", "n_entries", "quantities")
    _repr_html_ = _show.html

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}({len(self)} rows, {self.n_entries} entries, "
            f"quantities {self._quantities!r})"
        )

    def __copy__(self) -> Self:
        return self  # it does not change

    def __reduce__(self) -> tuple[Any, ...]:
        origin, first_row, entries = self._origin, self._first_row, self._entries
        if origin is not None:  # of which pickles hold no more than their rows need
            rows: slice | Array = (
                slice(first_row, first_row + len(self))
                if isinstance(first_row, int) else first_row
            )  # fmt: skip
            origin = origin.of_rows(rows, self.indices, entries, self._lacks_shifts())
            first_row, entries = 0, slice(None)
        return _restored, (
            type(self), self._arrays, self._quantities, self._n_points, self._is_of_one_set,
            self._is_complete, self._is_in_order, origin, first_row, entries,
        )  # fmt: skip

    def _with(self, offsets: Array, entries: Array, complete: bool, order: bool) -> Self:
        """These entries, by mask or position, in rows that begin there."""
        columns = (read_only(column[entries]) for column in self._arrays[1:])
        return type(self)(
            (read_only(offsets), *columns), self._quantities, self._n_points,
            self._is_of_one_set, complete, order, self._origin, self._first_row,
            self._entries_at(entries),
        )

    # ---- which entries of the search they are ----------------------------------------------

    def _lacks_shifts(self) -> bool:
        """Whether shifts are not here, and may be other than zero."""
        return self._origin is not None and "S" not in self._quantities and self._origin.has_images

    def _entries_between(self, first: int, end: int) -> slice | Array:
        if isinstance(self._entries, slice):
            before = self._entries.start or 0
            return slice(before + first, before + end)
        return self._entries[first:end]

    def _entries_at(self, entries: Array) -> slice | Array:
        if not self._lacks_shifts():
            return self._entries
        if isinstance(self._entries, slice):
            before = self._entries.start or 0
            return np.arange(before, before + self.n_entries)[entries]
        return self._entries[entries]

    def _by_distance(self) -> Array:
        """The entries by row and true distance; some rows at a time, between which Ctrl-C works."""
        distances, indices, origin, shifts = self.distances, self.indices, self._origin, None
        if origin is None:
            raise AttributeError(
                "this table has no points: only tables from neighbors or CellList can be sorted"
            )
        if origin.has_images:
            shifts = origin.shifts()[self._entries] if self._lacks_shifts() else self.shifts
        order = np.empty(len(distances), np.int64)
        points, asking, vectors = origin.points, origin.asking, origin.rows
        places = origin.places_of(indices)
        for first, end in _parts_of(self._arrays[0], _SORTED_AT_A_TIME):
            offsets = self._arrays[0][first : end + 1]
            a, b = int(offsets[0]), int(offsets[-1])
            order[a:b] = order_by_distance(offsets - a, distances[a:b])
            order[a:b] += a
            numbers = self._numbers_from(first, end)
            these = slice(numbers, None) if isinstance(numbers, int) else numbers
            asked = asking[these]
            of_rows = vectors if vectors.ndim == 2 else vectors[:, these]
            rows = rows_of(offsets)  # from 0 on: two rows of one point are two
            settle(order[a:b], rows, places, distances, shifts, points, asked, of_rows)
        return order

    def _refuse_queries(self, what: str) -> None:
        if not self._is_of_one_set:
            raise ValueError(
                f"{what} needs a table of one set of points, with both directions of each pair: "
                "rows of this one are of queries, or of a rule with a direction, or some of the "
                "rows of another table"
            )


def _parts_of(offsets: Array, n_entries: int) -> Iterator[tuple[int, int]]:
    """Whole rows, first and end, of so many entries at most, or one row that has more."""
    first, n_rows = 0, len(offsets) - 1
    while first < n_rows:
        end = int(np.searchsorted(offsets, offsets[first] + n_entries, side="right")) - 1
        end = max(first + 1, end)
        yield first, end
        first = end


def read_only(array: Array) -> Array:
    array.flags.writeable = False
    return array


def _restored(kind: type[TableRows], arrays: tuple[Array, ...], *rest: Any) -> TableRows:
    """A table from its pickle: arrays that are unpickled or deep-copied can be written to."""
    return kind(tuple(read_only(array) for array in arrays), *rest)
