# SPDX-License-Identifier: BSD-3-Clause
"""`NeighborTable`: rows of neighbours, and the other tables and forms that they turn into."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from halfshell._convert.options import as_choice, as_flag, check_letters
from halfshell._convert.starts import starts_of
from halfshell._objects import table_forms
from halfshell._objects.graph import Graph, check_complete, turned
from halfshell._objects.table_plot import TablePictures
from halfshell._objects.table_rows import Array, Row


class NeighborTable(TablePictures):
    """All neighbours of each point, or of each query, row after row.

    Made by `neighbors`. A table is immutable, and all its arrays are read-only.

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
    quantities : str
        What the table holds: some of the letters ``j d D S``, in the order of `quantities`.
    n_rows, n_points, n_entries : int
        Points or queries with a row; points to find; neighbours in all rows, m.
    shape : tuple of int
        (n_rows, n_points).

    Raises
    ------
    AttributeError
        If the table was made without that quantity.

    See Also
    --------
    neighbors : makes tables, and says what is in a row.

    Notes
    -----
    ``table[i]`` is row i, without a copy: one array, or a tuple of them, one for each letter of
    `quantities`. ``table[a:b]``, ``table[[5, 0, 5]]`` and ``table[mask]`` are tables of these rows,
    numbered from 0. Their indices still number all points, so they count as tables of
    queries. ``len(table)`` is the number of rows, and iteration goes over them.

    A table with indices and distances also keeps points, queries and box, for `sort`: as copies
    or, from a `CellList`, as references to those of the list. Tables of some rows keep them all. A
    pickle has only the points that its rows name and, in a periodic box, the shifts of its entries,
    for which the points are searched once more if the table has no 'S'.

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
    this table has no shifts: request them with an 'S' in quantities, got 'jd'
    """

    __slots__ = ()

    # ---- other tables ----------------------------------------------------------------------

    def filter(self, mask: npt.ArrayLike) -> NeighborTable:
        """Keep only some of the entries.

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
        keep = table_forms.as_mask(mask, self.n_entries)
        complete = self._is_complete and bool(keep.all())
        return self._with(starts_of(keep)[self.offsets], keep, complete, self._is_in_order)

    def sort(self, by: Literal["distance"] = "distance") -> NeighborTable:
        """Sort the entries of each row.

        Parameters
        ----------
        by : {"distance"}
            Ascending by exact distance, as in `nearest`: distances that are equal after rounding
            are compared exactly. Entries at the same distance ascend by (j, S).

        Returns
        -------
        NeighborTable
            A new one with the same offsets.

        Raises
        ------
        AttributeError
            If the table has no distances or no indices, or was not made by a search.
        ValueError
            If `by` is not "distance".
        MemoryError
            If the exact comparison does not fit.

        Notes
        -----
        For this the table keeps points, queries and box. In a periodic box, a table without shifts
        searches once more to find them. Entries with equal rounded distances are compared about
        16 MB at a time, those at one distance in one row always together.

        Examples
        --------
        >>> import halfshell as hs
        >>> table = hs.neighbors([[0.0], [2.0], [3.0]], 3.0, quantities="jd")
        >>> table[2][0].tolist(), table.sort(by="distance")[2][0].tolist()
        ([0, 1], [1, 0])
        """
        as_choice(by, "by", ("distance",))
        return self._with(self.offsets, self._by_distance(), self._is_complete, False)

    # ---- other forms -----------------------------------------------------------------------

    def to_pairs(self, *, quantities: str = "ij", half: bool = False) -> Row:
        """The entries as arrays of pairs, as `pairs` and `pairs_between` return them.

        Parameters
        ----------
        quantities : str, default "ij"
            Any of the letters ``i j d D S P``, each at most once, that the table has.
        half : bool, default False
            Each pair once, as in `pairs`: i < j, or i == j and the first nonzero component of S is
            positive. Only for a table of one set of points; it needs shifts if a point has its own
            images in its row.

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
            If `quantities` has other letters, or `half` is set for a table of queries or of a rule
            with a direction.

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
        check_letters(quantities)
        half = as_flag(half, "half")
        rows = self._row_numbers()
        columns = {"i": rows}
        if "P" in quantities:
            columns["P"] = np.stack((rows, self.indices), axis=1)
        columns |= {letter: self._column(letter) for letter in quantities if letter not in "iP"}
        if half:
            self._refuse_queries("half=True")
            keep = table_forms.first_halves(rows, self.indices, lambda: self.shifts)
            columns = {letter: column[keep] for letter, column in columns.items()}
        arrays = tuple(columns[letter] for letter in quantities)
        return arrays if len(arrays) > 1 else arrays[0]

    def to_scipy(self, duplicates: Literal["raise", "min"] = "raise") -> Any:
        """The distances as a sparse array of SciPy.

        Parameters
        ----------
        duplicates : {"raise", "min"}, default "raise"
            What to do if a row has several images of one point, for which the array has only one
            entry: raise an error, or keep the nearest.

        Returns
        -------
        scipy.sparse.csr_array of float64, shape (n_rows, n_points)
            Neighbours at distance 0 are stored explicitly. Its arrays are copies.

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
        as_choice(duplicates, "duplicates", ("raise", "min"))
        indices, distances = self.indices, self.distances
        if not self._is_in_order:
            order = table_forms.order_by_neighbor(self.offsets, indices)
            indices, distances = indices[order], distances[order]
        return table_forms.sparse_array(
            self.offsets, indices, distances, self._n_points, duplicates == "min"
        )

    def to_padded(
        self, capacity: int | None = None, fill: Any = -1, *, quantity: str = "j"
    ) -> Array:
        """One quantity as a rectangular array, with rows padded to the same length.

        Parameters
        ----------
        capacity : int, optional
            Length of the rows. Default: that of the longest one.
        fill : number, default -1
            Padding value: for `quantity` "j" and "S" a whole number that fits their type,
            otherwise any number, such as ``math.inf``.
        quantity : {"j", "d", "D", "S"}, default "j"
            The quantity, which the table must have.

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
            If `quantity` is not one of these, or `fill` is not a number of its type.

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
        as_choice(quantity, "quantity", ("j", "d", "D", "S"))
        return table_forms.padded(self.offsets, self._column(quantity), capacity, fill)

    def edge_index(self) -> Array:
        """The entries as edges of a graph, from neighbour to point.

        Returns
        -------
        ndarray of the type of `indices`, shape (2, m)
            Row 0 is j, the source; row 1 is i, the target, as in PyTorch Geometric. A new array.

        Raises
        ------
        AttributeError
            If the table has no indices.

        See Also
        --------
        graph : with the vectors from source to target, and their shifts.

        Notes
        -----
        D and S point against the edges, from i to j:
        ``points[edge_index[0]] - points[edge_index[1]] + S @ box == D``.

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
            A named tuple ``(edge_index, shifts, vectors, distances)``: `edge_index` as from the
            method of that name, shifts and vectors from source to target, with
            ``points[edge_index[1]] - points[edge_index[0]] + shifts @ box == vectors`` up to
            rounding. They are -S and -D of the table. `distances` are None if it has none.

        Raises
        ------
        AttributeError
            If the table lacks indices, vectors or shifts: it needs ``quantities="jDS"``.
        OverflowError
            If a shift is -2**31, which has no opposite in int32.

        Notes
        -----
        In a table of queries the targets are queries: ``queries[edge_index[1]]``.

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
        check_complete(self._quantities)
        distances = self.distances if "d" in self._quantities else None
        return turned(self.edge_index(), self.shifts, self.vectors, distances)

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
            If the table has no indices, or was filtered or sorted and has no shifts.
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
            return table_forms.reverse_in_order(self.offsets, self.indices)
        return table_forms.reverse_by_shift(self.offsets, self.indices, self.shifts)

    def _row_numbers(self) -> Array:
        """The row of each entry, of the type of the indices, if there are any."""
        dtype = self.indices.dtype if "j" in self._quantities else np.dtype(np.int64)
        return table_forms.rows_of(self.offsets, dtype)
