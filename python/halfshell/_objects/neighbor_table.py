# SPDX-License-Identifier: BSD-3-Clause
"""`NeighborTable`: rows of neighbours, and what they turn into."""

from __future__ import annotations

import importlib
import io
import itertools
import math
import operator
import os
import zipfile
from collections.abc import Iterator
from html import escape
from typing import IO, TYPE_CHECKING, Any, Literal, NamedTuple, Self, SupportsIndex, overload

import numpy as np
import numpy.typing as npt

from halfshell import _show
from halfshell._convert.arrays import (
    are_backward,
    as_array,
    as_listed,
    as_real_array,
    entries_of,
    one_each,
    rows_of,
    starts_of,
    whole_rows,
)
from halfshell._convert.foreign import is_a, kind_of, shown, told
from halfshell._convert.lengths import as_number
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.options import as_choice, as_count, as_flag, as_whole, check_letters
from halfshell._errors import CapacityError, needs
from halfshell._objects.exact import Array, Origin, order_by_index, order_in_rows, part_of
from halfshell._search import document

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from halfshell._convert.types import ArrayLike

Positions = npt.NDArray[np.int64]
Row = Array | tuple[Array, ...]
Chosen = Array | list[int] | list[bool]

_NAMES = {"j": "indices", "d": "distances", "D": "vectors", "S": "shifts", "k": "shells"}
_FORMAT = 1  # of files and pickles
_LEAST_SHIFT = -(2**31)
_COPIES = 5  # arrays of int64 that triplets have at one time, of the length of the result

#: What is summed in which type, by the kind of the dtype.
_SUMMED_IN = {"b": np.int64, "i": np.int64, "u": np.uint64, "f": np.float64}
_ROWS_SHOWN, _ENTRIES_SHOWN = 5, 8


@_show.shown
class Graph(NamedTuple):
    """A graph, as `NeighborTable.graph` returns it.

    Attributes
    ----------
    edge_index : ndarray of the type of `indices`, shape (2, m)
        Row 0 is the source of each edge, the neighbour j; row 1 is the target, the point i in whose
        row it is.
    shifts : ndarray of int32, shape (m, d)
        Box vectors to add, with ``vectors = points[edge_index[1]] - points[edge_index[0]] +
        shifts @ box``. They are -S of the table.
    vectors : ndarray of float64, shape (m, d)
        The vector from source to target, which is -D of the table.
    distances : ndarray of float64, shape (m,), or None
        Its length, if the table has distances.

    Examples
    --------
    >>> import halfshell as hs
    >>> hs.neighbors([[0.5], [3.5]], 1.0, box=[4.0], quantities="jDS").graph()._fields
    ('edge_index', 'shifts', 'vectors', 'distances')
    """

    edge_index: Array
    shifts: npt.NDArray[np.int32]
    vectors: npt.NDArray[np.float64]
    distances: npt.NDArray[np.float64] | None


def _held(letter: str) -> Any:
    """The attribute of a quantity."""
    return property(lambda table: table._column(letter))


class NeighborTable:
    """All neighbours of each point, or of each query, row after row.

    Made by `neighbors`, `from_pairs` and `load`. A table is immutable, and all its arrays are
    read-only.

    Attributes
    ----------
    offsets : ndarray of int64, shape (n_rows + 1,)
        Row i consists of the entries from ``offsets[i]`` up to, but not including,
        ``offsets[i + 1]``.
    counts : ndarray of int64, shape (n_rows,)
        Length of each row.
    indices : ndarray of int64 or int32, shape (m,)
        The neighbour j of each entry; with 'j' in `quantities`, as by default.
    distances : ndarray of float64, shape (m,)
        Its distance, in the unit of the points; with 'd' in `quantities`.
    vectors : ndarray of float64, shape (m, d)
        The vector D from i to it; with 'D' in `quantities`.
    shifts : ndarray of int32, shape (m, d)
        Its shift S; with 'S' in `quantities`.
    shells : ndarray of int32, shape (m,)
        The smallest of several cutoffs that it is within, from 0 on; with 'k' in `quantities`.
    quantities : str
        What the table holds: some of the letters ``j d D S k``, in the order of `quantities`.
    n_rows, n_points, n_entries : int
        Points or queries with a row; points to find; neighbours in all rows, m.
    shape : tuple of int
        (n_rows, n_points).

    Raises
    ------
    AttributeError
        From attributes and methods, if the table was made without a quantity that they need.

    See Also
    --------
    neighbors : makes tables, and says what is in a row.

    Notes
    -----
    ``table[i]`` is row i, without a copy: one array, or a tuple of them, one for each letter of
    `quantities`. ``table[a:b]``, ``table[[5, 0, 5]]`` and ``table[mask]`` are tables of these rows,
    numbered from 0. Their indices still number all points, so they count as tables of
    queries. ``len(table)`` is the number of rows, and iteration goes over them.

    A table from a search with indices and distances also keeps points, queries and box, for `sort`:
    as copies or, from a `CellList`, as references to those of the list. Tables of some rows keep
    them all. A pickle or a file has only the points that its rows name and, in a periodic box, the
    shifts of its entries, for which the points are searched once more if the table has no 'S'.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [9.0, 9.0]]
    >>> table = hs.neighbors(points, 2.0, quantities="jd")
    >>> table
    NeighborTable(4 rows, 4 entries, quantities 'jd')
    0: 1 (1)
    1: 0 (1), 2 (2)
    2: 1 (2)
    3:
    >>> for j, d in table[:2]:
    ...     print(j.tolist(), d.tolist())
    [1] [1.0]
    [0, 2] [1.0, 2.0]
    >>> table[[True, False, False, True]].counts.tolist()
    [1, 0]
    >>> try:
    ...     table.shifts
    ... except AttributeError as error:
    ...     print(error)
    this table has no shifts: request them with an 'S' in quantities, got 'jd'
    """

    _arrays: tuple[Array, ...]  # offsets, then one for each quantity
    _quantities: str
    _n_points: int
    _is_of_one_set: bool  # rows are those of the points themselves, with both directions
    _is_complete: bool  # no entry was left out
    _is_in_order: bool  # each row ascends by (j, S)
    _origin: Origin | None  # None: exact comparisons are not possible
    _rows: slice | Array  # which of all rows of the search they are
    _entries: slice | Array  # which of all entries of the search

    __slots__ = tuple(__annotations__)

    def __init__(
        self, arrays: tuple[Array, ...] = (), quantities: str = "", n_points: int = 0,
        is_of_one_set: bool = False, is_complete: bool = True, is_in_order: bool = True,
        origin: Origin | None = None, rows: slice | Array | None = None,
        entries: slice | Array | None = None,
    ) -> None:  # fmt: skip
        if type(arrays) is not tuple or type(quantities) is not str or not arrays:
            raise TypeError(
                "a NeighborTable is what neighbors() returns, or NeighborTable.from_pairs()"
            )
        self._arrays = arrays
        self._quantities = quantities
        self._n_points = n_points
        self._is_of_one_set = is_of_one_set
        self._is_complete = is_complete
        self._is_in_order = is_in_order
        self._origin = origin
        self._rows = slice(0, len(self)) if rows is None else rows
        self._entries = slice(0, self.n_entries) if entries is None else entries

    # ---- how they are made -----------------------------------------------------------------

    @classmethod
    def from_pairs(
        cls,
        i: npt.ArrayLike,
        j: npt.ArrayLike,
        S: npt.ArrayLike | None = None,
        *,
        n_points: int,
        n_queries: int | None = None,
        distances: ArrayLike | None = None,
        vectors: ArrayLike | None = None,
        half: bool = False,
    ) -> NeighborTable:
        """Make a table of pairs that are there already, of any library: the opposite of `to_pairs`.

        Parameters
        ----------
        i, j, S, distances, vectors : array_like, shape (m,), for S and vectors (m, d)
            The pairs, in any order, with what the table shall have of them.
        n_points : int
            Points to find: each j is below it.
        n_queries : int, optional
            Rows, if i are numbers of queries. Default: they are points too.
        half : bool, default False
            Whether each pair is there once, as in `pairs`. Its other direction is added.

        Returns
        -------
        NeighborTable
            Its rows ascend by (j, S); without S, images of one point stay in the order in which
            they were given. It has no points, so `sort` is not possible.

        Raises
        ------
        TypeError, ValueError, OverflowError
            If arrays do not fit each other, numbers are out of range, or with S a pair is there
            twice or is a point and itself.

        Examples
        --------
        >>> import halfshell as hs
        >>> i, j, d = hs.pairs([[0.0], [1.0], [3.0]], 2.0, quantities="ijd")
        >>> hs.NeighborTable.from_pairs(i, j, n_points=3, distances=d, half=True)
        NeighborTable(3 rows, 4 entries, quantities 'jd')
        0: 1 (1)
        1: 0 (1), 2 (2)
        2: 1 (2)
        """
        n, is_half = _as_size(n_points, "n_points"), as_flag(half, "half")
        q = None if n_queries is None else _as_size(n_queries, "n_queries")
        if is_half and q is not None:
            raise ValueError("half=True is for pairs of one set of points: do not give n_queries")
        ndim = 0 if S is None else sum(as_array(S, "S").shape[-1:])
        first, second, shifts = as_listed(i, j, S, ndim, n, q)
        columns: dict[str, Array] = {"i": first, "j": second}
        for letter, values in (("d", distances), ("D", vectors)):
            if values is not None:
                column = as_real_array(values, _NAMES[letter]).astype(np.float64)
                if column.ndim != 1 + (letter == "D") or len(column) != len(first):
                    raise ValueError(
                        f"{_NAMES[letter]} must be one for each of {len(first)} pairs, got shape "
                        f"{column.shape}"
                    )
                columns[letter] = column
        if shifts is not None:
            columns["S"] = shifts.astype(np.int32)
            if not np.array_equal(columns["S"], shifts):
                raise OverflowError("S must fit int32")
            own = (first == second) & ~shifts.any(axis=1)
            for k in np.flatnonzero(own if q is None else []):
                raise ValueError(f"pair {k} is point {first[k]} and itself, with S = 0")
        letters = "".join(letter for letter in "jdDS" if letter in columns)
        return cls._of_columns(columns, letters, (n if q is None else q, n), q is None, is_half)

    @classmethod
    def _of_columns(
        cls, columns: dict[str, Array], quantities: str, shape: tuple[int, int],
        is_of_one_set: bool, is_half: bool, is_in_order: bool = False,
    ) -> NeighborTable:  # fmt: skip
        """A table of columns i, j and more. `is_in_order`: pairs ascend by (i, j, S), though S may
        not be there."""
        if is_half:
            columns = _both_directions(columns)
        i, j, shifts = columns["i"], columns["j"], columns.get("S")
        key = i.astype(np.int64) * max(shape[1], 1) + j
        order = np.argsort(key, kind="stable")
        if not is_in_order:
            again = np.diff(key[order]) == 0  # images of one point, or an entry twice
            is_in_order = shifts is not None or not again.any()
            if shifts is not None and again.any():
                order = np.lexsort((*shifts.T[::-1], key))
                twice = again & (shifts[order[1:]] == shifts[order[:-1]]).all(axis=1)
                for k in order[1:][twice]:
                    raise ValueError(f"pair ({i[k]}, {j[k]}) is there twice with S = {shifts[k]}")
        offsets = starts_of(np.bincount(i, minlength=shape[0]))
        arrays = (offsets, *(columns[letter][order] for letter in quantities))
        has_both = is_of_one_set
        if is_of_one_set and not is_half:
            other = np.empty((len(j), 0)) if shifts is None else shifts[order]
            has_both = _reverse_by_shift(offsets, j[order], other) is not None
        return cls(
            tuple(map(_read_only, arrays)), quantities, shape[1], has_both, is_in_order=is_in_order
        )

    def save(self, file: str | os.PathLike[str] | IO[bytes]) -> None:
        """Write the table to a file, from which `load` makes the same one.

        Parameters
        ----------
        file : path or binary file
            Its name stays as it is. The file is a .npz of NumPy, not compressed, with the arrays
            under their letters and ``offsets``.

        Examples
        --------
        >>> import io
        >>> import halfshell as hs
        >>> file, table = io.BytesIO(), hs.neighbors([[0.0], [1.0]], 1.5, quantities="jd")
        >>> table.save(file)
        >>> file.seek(0)
        0
        >>> hs.NeighborTable.load(file)
        NeighborTable(2 rows, 2 entries, quantities 'jd')
        0: 1 (1)
        1: 0 (1)
        """
        state = {name: value for name, value in self._state().items() if value is not None}
        file = _as_file(file, "write")
        if not isinstance(file, str | bytes):
            np.savez(file, **state)
            return
        with open(file, "wb") as stream:
            np.savez(stream, **state)

    @classmethod
    def load(cls, file: str | os.PathLike[str] | IO[bytes]) -> NeighborTable:
        """Read a table that `save` has written.

        Parameters
        ----------
        file : path or binary file

        Raises
        ------
        OSError
            If the file cannot be read.
        ValueError
            If it was not written by `save`, or by another version that writes another format, or is
            broken.
        """
        file = _as_file(file, "read")
        if isinstance(file, str | bytes):
            with open(file, "rb") as stream:
                return cls.load(stream)
        try:
            with np.load(file, allow_pickle=False) as stored:
                state = {name: stored[name] for name in stored.files}
            version = state.pop("format").item()
            if version == _FORMAT:
                state = {name: a.item() if a.ndim == 0 else a for name, a in state.items()}
                _check_state(state)
        except MemoryError:
            raise
        except (Exception, zipfile.BadZipFile) as error:
            if isinstance(error, OSError) and error.errno is not None:
                raise
            why = told(error) if type(error) is ValueError else type(error).__name__
            raise ValueError(f"this is no file of a NeighborTable, or is broken: {why}") from error
        if version != _FORMAT:
            raise ValueError(
                f"this file has a NeighborTable in format {shown(version)}, and this version of "
                f"halfshell reads format {_FORMAT}"
            )
        return cls._of_state(state)

    def _state(self) -> dict[str, Any]:
        """What files and pickles hold: of the origin no more than the rows need."""
        state: dict[str, Any] = {
            "format": _FORMAT, "quantities": self._quantities, "n_points": self._n_points,
            "is_of_one_set": self._is_of_one_set, "is_complete": self._is_complete,
            "is_in_order": self._is_in_order, "offsets": self._arrays[0],
            **dict(zip(self._quantities, self._arrays[1:], strict=True)),
        }  # fmt: skip
        if self._origin is not None:
            shifts = self._origin.shifts()[self._entries] if self._lacks_shifts() else None
            part = self._origin.part(self._rows, self.indices, shifts)
            state |= {f"origin_{name}": value for name, value in part.items()}
        return state

    @classmethod
    def _of_state(cls, state: dict[str, Any]) -> NeighborTable:
        letters = state["quantities"]
        arrays = (state["offsets"], *(state[letter] for letter in letters))
        origin = None
        if "origin_points" in state:
            names = ("points", "queries", "box", "periodic", "systems", "shifts", "numbers")
            parts: dict[str, Any] = {name: state.get(f"origin_{name}") for name in names}
            origin = Origin(**parts, is_own=True)
        # Arrays that are unpickled or deep-copied can be written to.
        return cls(
            tuple(map(_read_only, arrays)), letters, state["n_points"], state["is_of_one_set"],
            state["is_complete"], state["is_in_order"], origin,
        )  # fmt: skip

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self)._of_state, (self._state(),)

    def __copy__(self) -> Self:
        return self  # it does not change

    # ---- what is there ---------------------------------------------------------------------

    @property
    def offsets(self) -> npt.NDArray[np.int64]:
        return self._arrays[0]

    @property
    def counts(self) -> npt.NDArray[np.int64]:
        return _read_only(np.diff(self._arrays[0]))

    indices: Array = _held("j")
    distances: npt.NDArray[np.float64] = _held("d")
    vectors: npt.NDArray[np.float64] = _held("D")
    shifts: npt.NDArray[np.int32] = _held("S")
    shells: npt.NDArray[np.int32] = _held("k")

    quantities: str = _show.attribute("_quantities")

    @property
    def n_rows(self) -> int:
        return len(self._arrays[0]) - 1

    n_points: int = _show.attribute("_n_points")

    @property
    def n_entries(self) -> int:
        return int(self._arrays[0][-1])

    @property
    def shape(self) -> tuple[int, int]:
        return self.n_rows, self._n_points

    def _column(self, letter: str) -> Array:
        at = self._quantities.find(letter)
        if at < 0:
            raise AttributeError(
                f"this table has no {_NAMES[letter]}: request them with "
                f"{'an' if letter == 'S' else 'a'} {letter!r} in quantities, got "
                f"{self._quantities!r}"
            )
        return self._arrays[at + 1]

    def _row_numbers(self) -> Array:
        """The row of each entry, of the type of the indices, if there are any."""
        dtype = self.indices.dtype if "j" in self._quantities else np.dtype(np.int64)
        return rows_of(self.offsets, dtype)

    def __repr__(self) -> str:
        rows = [f"{k}: {row}".rstrip() for k, row in self._first()]
        return "\n".join([self._heading(), *rows, *(["..."] if len(self) > len(rows) else [])])

    def _repr_html_(self) -> str:
        rows = "".join(
            f'<tr><th>{k}</th><td style="text-align: left">{escape(row)}</td></tr>'
            for k, row in self._first()
        )
        return (
            '<table><thead><tr><th colspan="2" style="text-align: left">'
            f"{escape(self._heading())}</th></tr></thead><tbody>{rows}</tbody></table>"
        )

    def _heading(self) -> str:
        return (
            f"NeighborTable({len(self)} rows, {self.n_entries} entries, "
            f"quantities {self._quantities!r})"
        )

    def _first(self) -> Iterator[tuple[int, str]]:
        """The first rows, by number, as text: j, or j (d), or what there is of other quantities."""
        letters = [letter for letter in "jd" if letter in self._quantities]
        columns = [self._column(letter) for letter in letters or self._quantities[:1]]
        for k, (first, end) in enumerate(itertools.pairwise(self.offsets[: _ROWS_SHOWN + 1])):
            some = slice(first, min(end, first + _ENTRIES_SHOWN))
            entries = [
                " ".join([_brief(entry[0]), *(f"({_brief(value)})" for value in entry[1:])])
                for entry in zip(*(column[some].tolist() for column in columns), strict=True)
            ]
            yield k, ", ".join([*entries, *(["..."] if end > some.stop else [])])

    # ---- rows ------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self._arrays[0]) - 1

    @overload
    def __getitem__(self, row: slice | Chosen) -> Self: ...  # type: ignore[overload-overlap]
    @overload
    def __getitem__(self, row: SupportsIndex) -> Row: ...
    def __getitem__(self, row: SupportsIndex | slice | Chosen) -> Row | Self:
        if isinstance(row, slice):
            first, end, step = row.indices(len(self))
            if step != 1:
                raise ValueError(
                    f"rows of a slice must follow each other, got a step of {shown(step)}"
                )
            end = max(first, end)
            offsets = self._arrays[0][first : end + 1]
            some = slice(int(offsets[0]), int(offsets[-1]))
            return self._with(offsets - offsets[0], some, slice(first, end))
        try:
            i = operator.index(row)  # type: ignore[arg-type]
        except TypeError:
            rows = _as_rows(row, len(self))
            return self._with(*entries_of(self._arrays[0], rows), rows)
        n = len(self)
        if not -n <= i < n:
            raise IndexError(f"row {shown(i)} of a table of {n} rows")
        return self._row(*self._arrays[0][i % n : i % n + 2])

    def __iter__(self) -> Iterator[Row]:
        return itertools.starmap(self._row, itertools.pairwise(self._arrays[0].tolist()))

    def _row(self, first: int, end: int) -> Row:
        if len(self._arrays) == 2:
            return self._arrays[1][first:end]
        return tuple(column[first:end] for column in self._arrays[1:])

    def _with(
        self, offsets: Array, entries: slice | Array, rows: slice | Array | None = None,
        is_complete: bool = True, is_in_order: bool = True,
    ) -> Self:  # fmt: skip
        """A table of some entries, in rows that begin there: those of all rows, or of these."""
        columns = (_read_only(column[entries]) for column in self._arrays[1:])
        return type(self)(
            (_read_only(offsets), *columns), self._quantities, self._n_points,
            self._is_of_one_set and rows is None, self._is_complete and is_complete,
            self._is_in_order and is_in_order, self._origin,
            self._rows if rows is None else part_of(self._rows, rows),
            part_of(self._entries, entries) if self._lacks_shifts() else None,
        )  # fmt: skip

    def _lacks_shifts(self) -> bool:
        """Whether shifts are not here, and may be other than zero."""
        return self._origin is not None and "S" not in self._quantities and self._origin.has_images

    def filter(self, mask: npt.ArrayLike) -> NeighborTable:
        """Keep only some of the entries.

        Parameters
        ----------
        mask : array_like of bool, shape (m,)
            Which entries stay; the rows do.

        Examples
        --------
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0], [1.0], [3.0]], 2.0, quantities="jd")
        >>> [j.tolist() for j, d in table.filter(table.distances > 1.5)]
        [[], [2], [1]]
        """
        keep = as_array(mask, "mask", "hold bools")
        one_each("mask", self.n_entries, "one bool for each entry")(keep.shape)
        if keep.dtype != np.bool_ and self.n_entries > 0:
            raise TypeError(f"mask must hold bools, got dtype {keep.dtype}")
        keep = keep.astype(np.bool_)  # a copy, as another thread may change the caller's
        starts, all_stay = starts_of(keep)[self.offsets], bool(keep.all())
        return self._with(starts, np.flatnonzero(keep), is_complete=all_stay)

    def sort(self, by: Literal["distance"] = "distance") -> NeighborTable:
        """Sort the entries of each row.

        Parameters
        ----------
        by : {"distance"}
            Ascending by exact distance, as in `nearest`: distances that are equal after rounding
            are compared exactly. Entries at the same distance ascend by (j, S).

        Raises
        ------
        AttributeError
            If the table was not made by a search.
        MemoryError
            If the exact comparison does not fit.

        Notes
        -----
        In a periodic box, a table without shifts searches once more to find them. Entries with
        equal rounded distances are compared about 16 MB at a time, those at one distance in one row
        always together.

        Examples
        --------
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0], [2.0], [3.0]], 3.0, quantities="jd")
        >>> table[2][0].tolist(), table.sort(by="distance")[2][0].tolist()
        ([0, 1], [1, 0])
        """
        as_choice(by, "by", ("distance",))
        distances, indices, origin, shifts = self.distances, self.indices, self._origin, None
        if origin is None:
            raise AttributeError(
                "this table has no points: only tables from neighbors or CellList can be sorted"
            )
        if origin.has_images:
            shifts = origin.shifts()[self._entries] if self._lacks_shifts() else self.shifts
        order = origin.order(self._rows, self.offsets, indices, distances, shifts)
        return self._with(self.offsets, order, is_in_order=False)

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

        """
        array, offsets = as_array(values, "values"), self.offsets
        if array.ndim == 0 or len(array) != self.n_entries:
            raise ValueError(
                f"values must have shape ({self.n_entries}, ...), one for each entry, got "
                f"{array.shape}"
            )
        dtype = _SUMMED_IN.get(array.dtype.kind)
        if dtype is None or array.dtype.itemsize > 8:
            raise TypeError(f"values must hold real numbers, got dtype {array.dtype}")
        sums = np.zeros((len(self), *array.shape[1:]), dtype)
        filled = np.flatnonzero(np.diff(offsets))
        if len(filled):  # rows without entries are passed over: between two of these are none
            sums[filled] = np.add.reduceat(array, offsets[filled], axis=0, dtype=dtype)
        return sums

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
        both = as_flag(ordered, "ordered")
        if block is None:
            return triplets_of(self.offsets, both)
        return _blocks_of_triplets(self.offsets, both, as_count(block, "block"))

    # ---- other forms -----------------------------------------------------------------------

    def to_pairs(self, *, quantities: str = "ij", half: bool = False) -> Row:
        """The entries as arrays of pairs, as `pairs` and `pairs_between` return them.

        Parameters
        ----------
        quantities : str, default "ij"
            Any of the letters ``i j d D S P k``, each at most once, that the table has.
        half : bool, default False
            Each pair once, as in `pairs`: i < j, or i == j and the first nonzero component of S is
            positive. Only for a table of one set of points; it needs shifts if a point has its own
            images in its row.

        Returns
        -------
        ndarray or tuple of ndarray
            One array per letter, in that order; a bare array for one letter. i is the number of the
            row. What needs no change is the table's own array, read-only.

        Examples
        --------
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0], [1.0], [3.0]], 2.0)
        >>> i, j = table.to_pairs()
        >>> i.tolist(), j.tolist()
        ([0, 1, 1, 2], [1, 0, 2, 1])
        >>> i, j = table.to_pairs(half=True)
        >>> i.tolist(), j.tolist()
        ([0, 1], [1, 2])
        """
        check_letters(quantities, "ijdDSPk")
        half = as_flag(half, "half")
        rows = self._row_numbers()
        columns = {"i": rows}
        if "P" in quantities:
            columns["P"] = np.stack((rows, self.indices), axis=1)
        columns |= {letter: self._column(letter) for letter in quantities if letter not in "iP"}
        if half:
            self._refuse_queries("half=True")
            keep = rows < self.indices
            own = np.flatnonzero(rows == self.indices)
            if len(own) > 0:
                keep[own] = ~are_backward(own, own, self.shifts[own])
            columns = {letter: column[keep] for letter, column in columns.items()}
        arrays = tuple(columns[letter] for letter in quantities)
        return arrays if len(arrays) > 1 else arrays[0]

    def to_scipy(self, duplicates: Literal["raise", "min"] = "raise") -> Any:
        """The distances as a sparse array of SciPy.

        Parameters
        ----------
        duplicates : {"raise", "min"}, default "raise"
            What to do if a row has several images of one point, for which the array has only one
            entry: raise a ValueError, or keep the nearest.

        Returns
        -------
        scipy.sparse.csr_array of float64, shape (n_rows, n_points)
            Neighbours at distance 0 are stored explicitly. Its arrays are copies.

        Examples
        --------
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0], [1.0], [3.0]], 2.0, quantities="jd")
        >>> table.to_scipy().toarray().tolist()
        [[0.0, 1.0, 0.0], [1.0, 0.0, 2.0], [0.0, 2.0, 0.0]]
        """
        as_choice(duplicates, "duplicates", ("raise", "min"))
        indices, distances = self.indices, self.distances
        if not self._is_in_order:
            order = order_in_rows(rows_of(self.offsets), indices)
            indices, distances = indices[order], distances[order]
        try:
            sparse = importlib.import_module("scipy.sparse")
        except ImportError as error:
            raise ImportError(needs("to_scipy", "scipy")) from error
        offsets = self.offsets
        is_first = np.ones(len(indices), np.bool_)
        is_first[1:] = indices[1:] != indices[:-1]
        is_first[offsets[:-1][np.diff(offsets) > 0]] = True
        if is_first.all():
            parts = distances, indices, offsets
            return sparse.csr_array(parts, shape=self.shape, copy=True)
        if duplicates != "min":
            k = int(np.flatnonzero(~is_first)[0])
            row = int(np.searchsorted(offsets, k, side="right")) - 1
            raise ValueError(
                f"row {row} has several images of point {indices[k]}, and a matrix has one entry "
                "for them: duplicates='min' keeps the nearest"
            )
        nearest = np.minimum.reduceat(distances, np.flatnonzero(is_first))
        parts = nearest, indices[is_first], starts_of(is_first)[offsets]
        return sparse.csr_array(parts, shape=self.shape)

    def to_padded(
        self, capacity: int | None = None, fill: Any = -1, *, quantity: str = "j"
    ) -> Array:
        """One quantity as a rectangular array, with rows padded to the same length.

        Parameters
        ----------
        capacity : int, optional
            Length of the rows. Default: that of the longest one.
        fill : number, default -1
            Padding value: for `quantity` "j", "S" and "k" a whole number that fits their type,
            otherwise any number, such as ``math.inf``.
        quantity : {"j", "d", "D", "S", "k"}, default "j"
            The quantity, which the table must have.

        Returns
        -------
        ndarray, shape (n_rows, capacity), or (n_rows, capacity, d) for D and S
            A new array of the type of the quantity.

        Raises
        ------
        CapacityError
            If a row is longer than `capacity`; ``needed`` is the length of the longest one.

        Examples
        --------
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0], [1.0], [3.0]], 2.0)
        >>> table.to_padded(3).tolist()
        [[1, -1, -1], [0, 2, -1], [1, -1, -1]]
        >>> try:
        ...     table.to_padded(1)
        ... except hs.CapacityError as error:
        ...     print(error.needed)
        2
        """
        as_choice(quantity, "quantity", tuple(_NAMES))
        column, counts = self._column(quantity), np.diff(self.offsets)
        needed = int(counts.max(initial=0))
        length = needed if capacity is None else as_whole(capacity, "capacity")
        if length < 0:
            raise ValueError(f"capacity must not be negative, got {shown(length)}")
        if length < needed:
            raise CapacityError(
                f"capacity is too small: row {int(counts.argmax())} has {needed} entries, got "
                f"{length}",
                needed,
            )
        shape = (len(counts), length, *column.shape[1:])
        # And a bool for each entry.
        n_rows = max(len(counts), 1)
        needed_bytes = n_rows * math.prod(shape[1:]) * column.dtype.itemsize + n_rows * length
        refuse_unavailable(needed_bytes, f"rows padded to a capacity of {shown(length)}")
        array = np.full(shape, _as_fill(fill, column.dtype), column.dtype)
        array[np.arange(length) < counts[:, None]] = column
        return array

    def edge_index(self) -> Array:
        """The entries as edges of a graph, from neighbour to point.

        Returns
        -------
        ndarray of the type of `indices`, shape (2, m)
            Row 0 is j, the source; row 1 is i, the target, as in PyTorch Geometric. A new array.

        Notes
        -----
        D and S point against the edges, from i to j:
        ``points[edge_index[0]] - points[edge_index[1]] + S @ box == D``; those of `graph` do not.

        Examples
        --------
        >>> import halfshell as hs
        >>> hs.neighbors([[0.0], [1.0], [3.0]], 2.0).edge_index().tolist()
        [[1, 0, 2, 1], [0, 1, 1, 2]]
        """
        return np.stack((self.indices, self._row_numbers()))

    def graph(self) -> Graph:
        """The entries as edges of a graph with their vectors, as graph neural networks take them.

        Returns
        -------
        Graph
            A named tuple ``(edge_index, shifts, vectors, distances)``. It needs
            ``quantities="jDS"``. In a table of queries the targets are ``queries[edge_index[1]]``.

        Examples
        --------
        >>> import numpy as np
        >>> import halfshell as hs
        >>> points, box = np.array([[0.5], [3.0]]), np.array([[4.0]])
        >>> edge_index, shifts, vectors, _ = hs.neighbors(
        ...     points, 2.0, box=box, quantities="jDS"
        ... ).graph()
        >>> edge_index.tolist(), shifts.tolist(), vectors.tolist()
        ([[1, 0], [0, 1]], [[1], [-1]], [[1.5], [-1.5]])
        >>> np.array_equal(points[edge_index[1]] - points[edge_index[0]] + shifts @ box, vectors)
        True
        """
        if lacking := "".join(letter for letter in "jDS" if letter not in self._quantities):
            raise AttributeError(
                "a graph needs indices, vectors and shifts: request them with quantities='jDS', "
                f"got {self._quantities!r} without {lacking!r}"
            )
        shifts, vectors = _opposite(self.shifts), 0.0 - self.vectors
        distances = self.distances if "d" in self._quantities else None
        return Graph(self.edge_index(), shifts, vectors, distances)

    def reverse(self) -> npt.NDArray[np.int64]:
        """For each entry (i, j, S), the position of its reverse (j, i, -S).

        Returns
        -------
        ndarray of int64, shape (m,)
            Positions of entries: ``table.distances[reverse]`` equals ``table.distances``, and
            ``reverse[reverse]`` counts up from 0.

        Raises
        ------
        AttributeError
            If the table was filtered or sorted and has no shifts.
        ValueError
            If it is a table of queries or of a rule with a direction, or a filter has removed the
            reverse of an entry.

        Examples
        --------
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0], [1.0], [3.0]], 2.0)
        >>> table.reverse().tolist()
        [1, 0, 3, 2]
        """
        self._refuse_queries("reverse()")
        if self._is_complete and self._is_in_order:
            return _reverse_in_order(self.offsets, self.indices)
        reverse = _reverse_by_shift(self.offsets, self.indices, self.shifts)
        if reverse is None:
            raise ValueError(
                "an entry has no reverse in this table: filter both directions of a pair alike"
            )
        return reverse

    def _refuse_queries(self, what: str) -> None:
        if not self._is_of_one_set:
            raise ValueError(
                f"{what} needs a table of one set of points, with both directions of each pair: "
                "rows of this one are of queries, or of a rule with a direction, or some of the "
                "rows of another table"
            )

    @document
    def plot(
        self,
        row: SupportsIndex = 0,
        *,
        types: npt.ArrayLike | None = None,
        ax: Axes | None = None,
        unit: str | None = None,
    ) -> Axes:
        """Draw the neighbours of one point, or of one query, which is put at the origin.

        Parameters
        ----------
        row : int, default 0
            Whose neighbours.
        types : array_like of int or str, shape (n_points,), optional
            A colour for each type of a neighbour, and an entry of the legend. The table must have
            'j' for it.
        {ax, unit}

        {drawn}

        Notes
        -----
        It needs 'D' in `quantities`, at most three dimensions, and matplotlib. Neighbours are drawn
        in the images in which they are near. With 'j' in the table up to 40 of them have their
        numbers beside them.
        """
        from halfshell._convert.points import as_types
        from halfshell._objects.pictures import draw_neighbors

        k = as_whole(row, "row")
        if not -self.n_rows <= k < self.n_rows:
            raise IndexError(f"row {shown(k)} of a table of {self.n_rows} rows")
        k %= self.n_rows
        some = slice(*self.offsets[k : k + 2])
        vectors = self.vectors[some]
        near = self.indices[some] if "j" in self.quantities or types is not None else None
        kinds = None if types is None else as_types(types, self.n_points)
        return draw_neighbors(f"row {k}", vectors, near, kinds, ax, unit)


def _read_only(array: Array) -> Array:
    array.flags.writeable = False
    return array


def _brief(value: Any) -> str:
    if isinstance(value, list):
        return f"[{' '.join(map(_brief, value))}]"
    return str(value) if isinstance(value, int) else f"{value:.4g}"


def _as_size(value: Any, name: str) -> int:
    number = as_whole(value, name)
    if not 0 <= number < 2**31:
        raise ValueError(f"{name} must be from 0 to 2**31 - 1, got {shown(number)}")
    return number


def _as_file(file: Any, method: str) -> Any:
    """A path, or a binary file that has the method."""
    if hasattr(file, method) and not isinstance(file, io.TextIOBase):
        return file
    try:
        return os.fspath(file)
    except TypeError:
        raise TypeError(
            f"file must be a path or a binary file, got {kind_of(file)}"
        ) from None


def _check_state(state: dict[str, Any]) -> None:
    """Raise where a file does not hold what `save` writes: its arrays fit each other."""
    offsets, letters, n = state["offsets"], state["quantities"], _as_size(state["n_points"], "n")
    n_rows, m = len(offsets) - 1, int(offsets[-1])
    points = state.get("origin_points", np.empty((n, 1)))
    d = points.shape[1]
    expected = {
        "offsets": ("i8", (n_rows + 1,)), "j": ("i4 i8", (m,)), "d": ("f8", (m,)),
        "D": ("f8", (m, ...)), "S": ("i4", (m, ...)), "k": ("i4", (m,)),
        "origin_points": ("f4 f8", (len(points), d)),
        "origin_queries": ("f4 f8", (n_rows, d)), "origin_box": ("f8", (..., d)),
        "origin_systems": ("i8", (n_rows,)), "origin_shifts": ("i4", (m, d)),
        "origin_numbers": ("i4 i8", (len(points),)),
    }  # fmt: skip
    for name in {"offsets", *letters} | (state.keys() & expected.keys()):
        kinds, shape = expected[name]
        fits = state[name].dtype.str[1:] in kinds.split() and state[name].dtype.isnative
        ends = zip(state[name].shape, shape, strict=name != "origin_box")
        if not fits or any(b not in (a, ...) for a, b in ends):
            raise ValueError(f"{name} does not fit the rest")
    numbers = state.get("origin_numbers", np.arange(n))
    if not (
        offsets[0] == 0 and (np.diff(offsets) >= 0).all()
        and ("j" not in letters or np.isin(state["j"], numbers).all())
        and len(numbers) == len(points) and (np.diff(numbers) > 0).all()
        and (n_rows == n or not state["is_of_one_set"])
    ):  # fmt: skip
        raise ValueError("its numbers do not fit each other")


# ---- rows, and both directions of entries ----------------------------------------------------

def _opposite(shifts: Array) -> Array:
    if shifts.min(initial=0) == _LEAST_SHIFT:
        raise OverflowError("a shift S of -2**31 has no opposite that fits int32")
    return -shifts


def _as_rows(chosen: Any, n_rows: int) -> Positions:
    """Numbers of rows from 0 on, of an array of whole numbers or a mask."""
    if not (is_a(chosen, (list, np.ndarray, memoryview)) or hasattr(type(chosen), "__array__")):
        raise _refused(type(chosen).__name__)
    array = as_array(chosen, "rows", "hold whole numbers or bools")
    if array.ndim == 0:
        raise _refused(type(chosen).__name__)
    if array.ndim != 1:
        raise ValueError(f"rows must be chosen by an array of one axis, got shape {array.shape}")
    if array.dtype.kind == "b":
        one_each("a mask of rows", n_rows, "one bool for each row")(array.shape)
        return np.flatnonzero(array.copy())  # another thread may change the caller's
    if len(array) == 0 and is_a(chosen, list):
        return np.empty(0, np.int64)
    if array.dtype.kind not in "iu":
        raise _refused(f"an array of {array.dtype}")
    array = array.copy()
    for k in np.flatnonzero((array >= n_rows) | (array < -n_rows)):
        raise IndexError(f"row {array[k]} (at [{k}]) of a table of {n_rows} rows")
    rows: Positions = array.astype(np.int64)
    rows[rows < 0] += n_rows
    return rows


def _refused(kind: str) -> TypeError:
    return TypeError(
        "a row is chosen by a whole number, rows by a slice, an array of whole numbers or a mask, "
        f"got {kind}"
    )


def _as_fill(value: Any, dtype: np.dtype[Any]) -> Any:
    """A number that this type holds as it is."""
    number = as_number(value, "fill")
    if dtype.kind == "f":
        return number
    limits = np.iinfo(dtype)
    if not number.is_integer() or not limits.min <= int(number) <= limits.max:
        raise ValueError(f"fill must be a whole number that {dtype} holds, got {shown(value)}")
    return int(number)


def _both_directions(columns: dict[str, Array]) -> dict[str, Array]:
    """Entries of both points of each pair, whose columns are i, j and any of d, D and S.

    Backwards first, in reverse: where pairs ascend by (i, j, S), so do all entries of one (i, j),
    for -S of pairs backwards ascend as well, and those of a point and its images come before S.
    """
    found = {
        "i": np.concatenate((columns["j"][::-1], columns["i"])),
        "j": np.concatenate((columns["i"][::-1], columns["j"])),
    }
    for letter in columns.keys() - {"i", "j"}:
        back = column = columns[letter][::-1]
        if letter != "d":
            back = _opposite(column) if letter == "S" else 0.0 - column  # of 0.0 it is 0.0
        found[letter] = np.concatenate((back, columns[letter]))
    return found


def _reverse_in_order(offsets: Array, indices: Array) -> Positions:
    """Where (j, i, -S) of each (i, j, S) is, in all of a full list that ascends by (i, j, S).

    A stable sort by j orders entries by (j, i, S), and so puts in place k the one whose other
    direction is entry k; but where several images of j are in one row these come out by S and
    not by -S: they are turned round.
    """
    order = order_by_index(indices)
    rows = rows_of(offsets, indices.dtype)
    m = len(indices)
    is_first = np.ones(m, np.bool_)
    is_first[1:] = (indices[1:] != indices[:-1]) | (rows[1:] != rows[:-1])
    if is_first.all():
        return order
    starts = np.flatnonzero(is_first)
    ends = np.append(starts[1:], m)
    image = np.cumsum(is_first) - 1  # which run of images each entry is in
    turned: Positions = order[starts[image] + ends[image] - 1 - np.arange(m)]
    return turned


def _reverse_by_shift(offsets: Array, indices: Array, shifts: Array) -> Positions | None:
    """Where (j, i, -S) of each (i, j, S) is, for entries in any order; None if one has none."""
    rows = rows_of(offsets, indices.dtype)
    columns = tuple(shifts.T[::-1])
    order = np.lexsort((*columns, indices, rows))
    other = np.lexsort((*(-column for column in columns), rows, indices))
    if not (
        np.array_equal(rows[order], indices[other])
        and np.array_equal(indices[order], rows[other])
        and np.array_equal(shifts[order], -shifts[other])
    ):
        return None
    reverse = np.empty(len(order), np.int64)
    reverse[order] = other
    return reverse


# ---- two entries of a row ------------------------------------------------------------------

def triplets_of(offsets: Positions, ordered: bool) -> tuple[Positions, Positions]:
    counts = np.diff(offsets)
    # As Python numbers: a product of the counts of a huge row may pass int64 when it is summed.
    total = int(np.dot(counts.astype(object), counts - 1)) if len(counts) else 0
    total = total if ordered else total // 2
    refuse_unavailable(8 * _COPIES * total, f"{total} triplets")
    return _triplets_of(offsets[:-1], counts, ordered)


def _blocks_of_triplets(
    offsets: Positions, ordered: bool, most: int
) -> Iterator[tuple[Positions, Positions]]:
    """Whole rows at a time, together of at most so many triplets, or one row that has more."""
    counts = np.diff(offsets)
    several = counts * (counts - 1)
    sums = starts_of(several if ordered else several // 2)
    for first, end in whole_rows(sums, most):
        n = int(sums[end] - sums[first])
        refuse_unavailable(8 * _COPIES * n, "the triplets of one row")
        if n > 0:
            yield _triplets_of(offsets[first:end], counts[first:end], ordered)


def _triplets_of(starts: Positions, counts: Array, ordered: bool) -> tuple[Positions, Positions]:
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
