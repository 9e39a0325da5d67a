# SPDX-License-Identifier: BSD-3-Clause
"""`NeighborTable`: rows of neighbours in compressed form. What it turns into: `_table_forms`."""

from __future__ import annotations

import itertools
import operator
from collections.abc import Iterator
from typing import Any, Literal, SupportsIndex, overload

import numpy as np
import numpy.typing as npt

from halfshell import _inputs, _table_forms

Array = npt.NDArray[Any]
Row = Array | tuple[Array, ...]


class NeighborTable:
    """All neighbours of each point, or of each query, row after row.

    Made by `neighbors`; it does not change, and all its arrays are read-only.

    Attributes
    ----------
    offsets : ndarray of int64, shape (n_rows + 1,)
        Row i is made of the entries ``offsets[i]`` to ``offsets[i + 1]``, the last one not
        included.
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
    quantities : str
        What the table holds: some of the letters ``j d D S``, in the order asked for.
    n_rows, n_points, n_entries : int
        Points or queries that ask; points that can be found; neighbours in all rows, m.
    shape : tuple of int
        (n_rows, n_points).

    Raises
    ------
    AttributeError
        If a quantity is asked for that the table was made without.

    See Also
    --------
    neighbors : makes tables, and says what is in a row.

    Notes
    -----
    ``table[i]`` is row i, without a copy: one array, or a tuple of them, one for each letter of
    `quantities`. ``table[a:b]`` is a table of these rows, numbered from 0: their indices still
    mean points of the whole, so that it counts as a table of queries. ``len(table)`` is the
    number of rows, and iteration goes over them.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [9.0, 9.0]]
    >>> table = hs.neighbors(points, 2.0, quantities="jd")
    >>> table.counts.tolist()
    [1, 2, 1, 0]
    >>> for j, d in table:
    ...     print(j.tolist(), d.tolist())
    [1] [1.0]
    [0, 2] [1.0, 2.0]
    [1] [2.0]
    [] []
    >>> table[1:3].indices.tolist()
    [0, 2, 1]
    >>> try:
    ...     table.shifts
    ... except AttributeError as error:
    ...     print(error)
    this table has no shifts: ask for them by an 'S' in quantities, got 'jd'
    """

    __slots__ = (
        "_arrays", "_is_complete", "_is_in_order", "_is_of_one_set", "_n_points", "_quantities",
    )

    _arrays: tuple[Array, ...]  # offsets, then one for each quantity
    _quantities: str
    _n_points: int
    _is_of_one_set: bool  # rows are those of the points themselves
    _is_complete: bool  # no entry was left out
    _is_in_order: bool  # each row ascends by (j, S)

    def __init__(
        self,
        arrays: tuple[Array, ...],
        quantities: str,
        n_points: int,
        is_of_one_set: bool,
        is_complete: bool = True,
        is_in_order: bool = True,
    ) -> None:
        self._arrays = arrays
        self._quantities = quantities
        self._n_points = n_points
        self._is_of_one_set = is_of_one_set
        self._is_complete = is_complete
        self._is_in_order = is_in_order

    # ---- what is there ---------------------------------------------------------------------

    @property
    def offsets(self) -> npt.NDArray[np.int64]:
        """Where each row begins, and the end of the last one; int64 (n_rows + 1,)."""
        return self._arrays[0]

    @property
    def counts(self) -> npt.NDArray[np.int64]:
        """Length of each row; int64 (n_rows,)."""
        return _read_only(np.diff(self._arrays[0]))

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
        """Points or queries that ask."""
        return len(self._arrays[0]) - 1

    @property
    def n_points(self) -> int:
        """Points that can be found."""
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
                f"this table has no {name}: ask for them by "
                f"{'an' if letter == 'S' else 'a'} {letter!r} in quantities, got "
                f"{self._quantities!r}"
            )
        return self._arrays[at + 1]

    # ---- rows ------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self._arrays[0]) - 1

    @overload
    def __getitem__(self, row: SupportsIndex) -> Row: ...
    @overload
    def __getitem__(self, row: slice) -> NeighborTable: ...
    def __getitem__(self, row: SupportsIndex | slice) -> Row | NeighborTable:
        if isinstance(row, slice):
            return self._rows(row)
        try:
            i = operator.index(row)
        except TypeError:
            raise TypeError(
                f"a row is chosen by a whole number, rows by a slice, got {type(row).__name__}"
            ) from None
        n = len(self)
        if not -n <= i < n:
            raise IndexError(f"row {i} of a table of {n} rows")
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

    def _rows(self, rows: slice) -> NeighborTable:
        first, end, step = rows.indices(len(self))
        if step != 1:
            raise ValueError(f"rows of a slice must follow each other, got a step of {step}")
        offsets = self._arrays[0][first : max(first, end) + 1]
        parts = tuple(column[offsets[0] : offsets[-1]] for column in self._arrays[1:])
        return NeighborTable(
            (_read_only(offsets - offsets[0]), *parts), self._quantities, self._n_points, False,
            self._is_complete, self._is_in_order,
        )

    def __repr__(self) -> str:
        return (
            f"NeighborTable({len(self)} rows, {self.n_entries} entries, "
            f"quantities {self._quantities!r})"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        state = tuple(getattr(self, name) for name in (
            "_arrays", "_quantities", "_n_points", "_is_of_one_set", "_is_complete",
            "_is_in_order",
        ))  # fmt: skip
        return _restored, state

    # ---- other tables ----------------------------------------------------------------------

    def _with(self, offsets: Array, entries: Array, complete: bool, order: bool) -> NeighborTable:
        """These entries, by mask or position, in rows that begin there."""
        columns = (_read_only(column[entries]) for column in self._arrays[1:])
        return NeighborTable(
            (_read_only(offsets), *columns), self._quantities, self._n_points,
            self._is_of_one_set, complete, order,
        )

    def filter(self, mask: npt.ArrayLike) -> NeighborTable:
        """Leave entries out.

        Parameters
        ----------
        mask : array_like of bool, shape (m,)
            Which entries stay.

        Returns
        -------
        NeighborTable
            A new one with as many rows, in the same order.

        Raises
        ------
        TypeError, ValueError
            If `mask` does not hold bools, or not one for each entry.

        Examples
        --------
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0], [1.0], [3.0]], 2.0, quantities="jd")
        >>> [j.tolist() for j, d in table.filter(table.distances > 1.5)]
        [[], [2], [1]]
        """
        keep = _table_forms.as_mask(mask, self.n_entries)
        before = np.concatenate(([0], np.cumsum(keep, dtype=np.int64)))
        return self._with(
            before[self.offsets], keep, self._is_complete and bool(keep.all()), self._is_in_order
        )

    def sort(self, by: Literal["distance"] = "distance") -> NeighborTable:
        """Put the entries of each row in another order.

        Parameters
        ----------
        by : {"distance"}
            Ascending by distance; entries at the same distance by (j, S).

        Returns
        -------
        NeighborTable
            A new one with the same offsets.

        Raises
        ------
        AttributeError
            If the table has no distances.
        ValueError
            If `by` is another word.

        Examples
        --------
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0], [2.0], [3.0]], 3.0, quantities="jd")
        >>> table[2][0].tolist(), table.sort(by="distance")[2][0].tolist()
        ([0, 1], [1, 0])
        """
        _inputs.as_choice(by, "by", ("distance",))
        # A stable sort keeps (j, S) ascending where distances are equal.
        order = _table_forms.order_by_distance(self.offsets, self.distances)
        return self._with(self.offsets, order, self._is_complete, False)

    # ---- other forms -----------------------------------------------------------------------

    def to_pairs(self, quantities: str = "ij", *, half: bool = False) -> Row:
        """The entries as arrays of pairs, as `pairs` and `pairs_between` return them.

        Parameters
        ----------
        quantities : str, default "ij"
            Any of the letters ``i j d D S P``, each at most once, as far as the table has them.
        half : bool, default False
            Each pair once: i < j, or i == j and the first nonzero component of S is positive,
            as `pairs` has them. Only for a table of one set of points; shifts are needed if it has
            images of a point in the row of the point itself.

        Returns
        -------
        ndarray or tuple of ndarray
            One array per letter, in that order; a bare array for one letter. i is the number of the
            row. What needs no change is the table's own array, read-only.

        Raises
        ------
        AttributeError
            If the table lacks a quantity that is needed.
        ValueError
            If `quantities` has other letters, or `half` is asked of a table of queries.

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
        _table_forms.check_letters(quantities)
        half = _inputs.as_flag(half, "half")
        rows = self._row_numbers()
        columns = {"i": rows}
        if "P" in quantities:
            columns["P"] = np.stack((rows, self.indices), axis=1)
        columns |= {letter: self._column(letter) for letter in quantities if letter not in "iP"}
        if half:
            self._refuse_queries("half=True")
            keep = _table_forms.first_halves(rows, self.indices, lambda: self.shifts)
            columns = {letter: column[keep] for letter, column in columns.items()}
        arrays = tuple(columns[letter] for letter in quantities)
        return arrays if len(arrays) > 1 else arrays[0]

    def to_scipy(self, duplicates: Literal["raise", "min"] = "raise") -> Any:
        """The distances as a sparse array of SciPy.

        Parameters
        ----------
        duplicates : {"raise", "min"}, default "raise"
            What to do where a row has several images of one point, and the array only one place
            for them: refuse, or keep the nearest.

        Returns
        -------
        scipy.sparse.csr_array of float64, shape (n_rows, n_points)
            Neighbours at distance 0 are stored entries like others. Its arrays are copies.

        Raises
        ------
        AttributeError
            If the table has no indices or no distances.
        ValueError
            If a row has several images of one point, unless `duplicates` is "min".
        ImportError
            If SciPy is not installed.

        Examples
        --------
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0], [1.0], [3.0]], 2.0, quantities="jd")
        >>> table.to_scipy().toarray().tolist()
        [[0.0, 1.0, 0.0], [1.0, 0.0, 2.0], [0.0, 2.0, 0.0]]
        """
        _inputs.as_choice(duplicates, "duplicates", ("raise", "min"))
        indices, distances = self.indices, self.distances
        if not self._is_in_order:
            order = _table_forms.order_by_neighbor(self.offsets, indices)
            indices, distances = indices[order], distances[order]
        return _table_forms.sparse_array(
            self.offsets, indices, distances, self._n_points, duplicates == "min"
        )

    def to_padded(
        self, capacity: int | None = None, fill: Any = -1, *, quantity: str = "j"
    ) -> Array:
        """One quantity as a rectangular array, rows filled up to the same length.

        Parameters
        ----------
        capacity : int, optional
            Length of the rows. Default: that of the longest one.
        fill : number, default -1
            What to fill them up with: for `quantity` "j" and "S" a whole number that their type
            holds, otherwise any, such as ``math.inf``.
        quantity : {"j", "d", "D", "S"}, default "j"
            Which one; the table must have it.

        Returns
        -------
        ndarray, shape (n_rows, capacity), or (n_rows, capacity, d) for D and S
            A new array of the type of the quantity.

        Raises
        ------
        CapacityError
            If a row is longer than `capacity`; ``needed`` is the length of the longest one.
        AttributeError
            If the table lacks the quantity.
        ValueError
            If `quantity` is none, or `fill` is no number of its type.

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
        _inputs.as_choice(quantity, "quantity", ("j", "d", "D", "S"))
        return _table_forms.padded(self.offsets, self._column(quantity), capacity, fill)

    def edge_index(self) -> Array:
        """The entries as edges of a graph, from neighbour to point.

        Returns
        -------
        ndarray of the type of `indices`, shape (2, m)
            Row 0 is j, the source, row 1 is i, the target, as PyTorch Geometric has them. A new
            array.

        Raises
        ------
        AttributeError
            If the table has no indices.

        Examples
        --------
        >>> import halfshell as hs
        >>> hs.neighbors([[0.0], [1.0], [3.0]], 2.0).edge_index().tolist()
        [[1, 0, 2, 1], [0, 1, 1, 2]]
        """
        return np.stack((self.indices, self._row_numbers()))

    def reverse(self) -> npt.NDArray[np.int64]:
        """Where the other direction of each entry is: (j, i, -S) of (i, j, S).

        Returns
        -------
        ndarray of int64, shape (m,)
            Positions of entries: ``table.distances[reverse]`` equals ``table.distances``, and
            ``reverse[reverse]`` counts up from 0.

        Raises
        ------
        AttributeError
            If the table has no indices, or was filtered or sorted and has no shifts.
        ValueError
            If it is a table of queries, or a filter has left an entry without its other direction.

        Examples
        --------
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0], [1.0], [3.0]], 2.0)
        >>> table.reverse().tolist()
        [1, 0, 3, 2]
        """
        self._refuse_queries("reverse()")
        if self._is_complete and self._is_in_order:
            return _table_forms.reverse_in_order(self.offsets, self.indices)
        return _table_forms.reverse_by_shift(self.offsets, self.indices, self.shifts)

    def _row_numbers(self) -> Array:
        """The row of each entry, of the type of the indices, if there are any."""
        dtype = self.indices.dtype if "j" in self._quantities else np.dtype(np.int64)
        return _table_forms.rows_of(self.offsets, dtype)

    def _refuse_queries(self, what: str) -> None:
        if not self._is_of_one_set:
            raise ValueError(
                f"{what} needs a table of one set of points: rows of this one are of queries, or "
                "some of the rows of another table"
            )


def _read_only(array: Array) -> Array:
    array.flags.writeable = False
    return array


def _restored(arrays: tuple[Array, ...], *rest: Any) -> NeighborTable:
    """A table from its pickle: arrays that are unpickled or deep-copied can be written to."""
    return NeighborTable(tuple(_read_only(array) for array in arrays), *rest)
