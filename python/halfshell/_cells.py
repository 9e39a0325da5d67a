# SPDX-License-Identifier: BSD-3-Clause
"""`CellList`: points that are sorted into cells once and asked many times; the work is in C."""

from __future__ import annotations

from typing import Any, NamedTuple, TypedDict, Unpack, cast

import numpy as np
import numpy.typing as npt

from halfshell import _callbacks, _core, _inputs, _radii
from halfshell._box import Box
from halfshell._options import Precision
from halfshell._pairs import Arrays
from halfshell._stream import PairBlocks, most_pairs
from halfshell._table import NeighborTable


class Candidates(NamedTuple):
    """Ranges of `CellList.order` for each query: what the cells around it hold."""

    offsets: npt.NDArray[np.int64]
    """Where the ranges of each query begin; shape (q + 1,)."""
    start: npt.NDArray[np.int64]
    """Where each range begins in `CellList.order`; shape (m,)."""
    stop: npt.NDArray[np.int64]
    """Where it ends, not included; shape (m,)."""


# The first arguments of every search in the core, where the cells stand for points and box.
_Arguments = tuple[
    Any, float, None, int, bool, Precision, str | None, float | None, None, int | None
]


class _Asking(TypedDict, total=False):
    """Keywords of all methods that search."""

    inclusive: bool
    kernel: str | None
    threads: int | None
    memory_limit: float | None


class CellList:
    """Points sorted into cells once, to be asked many times.

    Parameters
    ----------
    points : array_like of float, shape (n, d)
        Coordinates, as in `pairs`; they are copied. An object such as ``ase.Atoms`` brings its own
        box.
    cutoff : float
        The largest cutoff that the cells are made for. Smaller ones are served by the same cells;
        larger ones are answered as well, by cells that are made for that call.
    box, periodic, precision
        As in `pairs`.
    threads : int, optional
        Threads that sort the points; and those that later calls use unless they say otherwise.

    Attributes
    ----------
    cutoff : float
        As given.
    shape : tuple of int, length d
        Cells along each axis, occupied or not.
    cell_sizes : tuple of float, length d
        Extent of a cell, across its faces, in the unit of the points.
    cell_start : ndarray of int32, shape (cells + 1,)
        Cell c holds the points ``order[cell_start[c]:cell_start[c + 1]]``.
    order : ndarray of int32, shape (n,)
        The points in cell order: a permutation, ascending in each cell.
    cell_ids : ndarray of int64, shape (cells, d), or None
        None where each cell has an id: ids then run along the first axis fastest. For points in
        clusters far apart only occupied cells are stored, and these are their indices along the
        axes.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As `pairs`, which see.

    See Also
    --------
    pairs, neighbors, pairs_between, count_pairs : the same without keeping the cells.

    Notes
    -----
    A cell list does not change, and any number of threads may ask it at once. Cells are found by a
    counting sort in O(n + cells), and there are never many more cells than points, however large
    the volume (Hockney and Eastwood, Computer Simulation Using Particles, 1981, section 8-4).
    Answers are those of the functions of the same names, decided exactly; only the order of
    `pairs` without ``sort=True`` may differ from theirs, since cells that are kept are cut a little
    differently.

    Examples
    --------
    >>> import halfshell as hs
    >>> cells = hs.CellList([[0.5, 0.5], [1.5, 0.5], [3.5, 0.5]], 1.0, box=[4.0, 4.0])
    >>> i, j = cells.pairs(sort=True)
    >>> i.tolist(), j.tolist()
    ([0, 0], [1, 2])
    >>> cells.query([[2.0, 0.5]], 0.5)[0].tolist()
    [1]
    >>> cells.count_pairs(0.5)
    0
    """

    __slots__ = (
        "_cells", "_cutoff", "_layout", "_n_points", "_ndim", "_precision", "_threads",
    )

    def __init__(
        self,
        points: Any,
        cutoff: Any,
        *,
        box: Any = None,
        periodic: Any = None,
        precision: Precision = "exact",
        threads: int | None = None,
        memory_limit: float | None = None,
    ) -> None:
        if type(box) is Box:
            box = box.vectors
        array, vectors, bits = _inputs.scene(points, box, periodic)
        self._cutoff = _inputs.as_cutoff(cutoff)
        self._cells = _core.cells_build(
            array, self._cutoff, vectors, bits, True, precision, None, memory_limit, None, threads
        )
        self._layout = _core.cells_layout(self._cells)
        self._n_points: int = array.shape[0]
        self._ndim: int = array.shape[1]
        self._precision = precision
        self._threads = threads

    def __len__(self) -> int:
        """Number of points."""
        return self._n_points

    def __repr__(self) -> str:
        cells = len(self.cell_start) - 1
        kind = "cells" if self.cell_ids is None else "occupied cells"
        return f"CellList({self._n_points} points, {cells} {kind}, cutoff {self.cutoff!r})"

    def __copy__(self) -> CellList:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> CellList:
        return self  # it does not change

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError("a CellList cannot be pickled: pickle its points, and make it again")

    @property
    def cutoff(self) -> float:
        return self._cutoff

    @property
    def shape(self) -> tuple[int, ...]:
        return cast(tuple[int, ...], self._layout["shape"])

    @property
    def cell_sizes(self) -> tuple[float, ...]:
        return cast(tuple[float, ...], self._layout["cell_sizes"])

    @property
    def cell_start(self) -> npt.NDArray[np.int32]:
        return cast(npt.NDArray[np.int32], self._layout["cell_start"])

    @property
    def order(self) -> npt.NDArray[np.int32]:
        return cast(npt.NDArray[np.int32], self._layout["order"])

    @property
    def cell_ids(self) -> npt.NDArray[np.int64] | None:
        return cast("npt.NDArray[np.int64] | None", self._layout["cell_ids"])

    def cell_of(self, points: Any) -> npt.NDArray[np.int64]:
        """Find the cell that each of some points would be in.

        Parameters
        ----------
        points : array_like of float, shape (m, d)
            They need not be those of the list. They are wrapped into the box; those beyond an open
            face count as on it.

        Returns
        -------
        ndarray of int64, shape (m,)
            Cell ids; -1 where only occupied cells have one and this cell holds no point.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.5], [1.5], [9.5]], 1.0)
        >>> found = cells.cell_of([[0.5], [1.5], [9.5]])
        >>> all(i in cells.order[cells.cell_start[c]:cells.cell_start[c + 1]]
        ...     for i, c in enumerate(found))
        True
        """
        return _core.cells_find(self._cells, self._queries(points, "points"))

    def candidates(self, queries: Any = None) -> Candidates:
        """The raw block of cells around each query, without a distance test.

        Parameters
        ----------
        queries : array_like of float, shape (q, d), optional
            Default: the points of the list.

        Returns
        -------
        Candidates
            ``(offsets, start, stop)``: the ranges of query i are numbers ``offsets[i]`` to
            ``offsets[i + 1] - 1``, and range r means the points ``order[start[r]:stop[r]]``.
            Together they hold at least all points within the cutoff, the query itself included if
            it is one of them; in a periodic box a range occurs once for each image of its cells.

        Raises
        ------
        ValueError
            If a query is much further away than the points and the box reach.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.5], [1.5], [9.5]], 1.0)
        >>> block = cells.candidates([[9.0]])
        >>> found = [cells.order[a:b].tolist() for a, b in zip(block.start, block.stop)]
        >>> 2 in sum(found, [])
        True
        """
        asking = None if queries is None else self._queries(queries)
        return Candidates(*_core.cells_candidates(*self._arguments(None, {}), asking))

    def pairs(
        self,
        cutoff: Any = None,
        *,
        quantities: str = "ij",
        sort: bool = False,
        index_dtype: npt.DTypeLike = np.int64,
        out: Any = None,
        **options: Unpack[_Asking],
    ) -> Arrays:
        """Find every pair of points within a cutoff, as `halfshell.pairs` does.

        Parameters
        ----------
        cutoff : float, optional
            Default: that of the list.
        quantities, sort, index_dtype, out, inclusive, kernel, threads, memory_limit
            As in `halfshell.pairs`.

        Returns
        -------
        ndarray or tuple of ndarray
            As `halfshell.pairs`.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0)
        >>> cells.pairs(1.0, quantities="P").tolist()
        [[0, 1]]
        """
        return _core.pairs(
            *self._arguments(cutoff, options), quantities, _inputs.as_flag(sort, "sort"),
            _inputs.as_index_bytes(index_dtype), out,
        )

    def neighbors(
        self,
        cutoff: Any = None,
        *,
        quantities: str = "j",
        index_dtype: npt.DTypeLike = np.int64,
        **options: Unpack[_Asking],
    ) -> NeighborTable:
        """All neighbours of each point, as `halfshell.neighbors` finds them.

        Parameters
        ----------
        cutoff : float, optional
            Default: that of the list.
        quantities, index_dtype, inclusive, kernel, threads, memory_limit
            As in `halfshell.neighbors`.

        Returns
        -------
        NeighborTable
            A row for each point, ascending by (j, S).

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0)
        >>> [row.tolist() for row in cells.neighbors()]
        [[1], [0, 2], [1]]
        """
        return self._rows(None, cutoff, quantities, index_dtype, options)

    def query(
        self,
        queries: Any,
        radius: Any = None,
        *,
        quantities: str = "j",
        index_dtype: npt.DTypeLike = np.int64,
        **options: Unpack[_Asking],
    ) -> NeighborTable:
        """All points within a radius of each query.

        Parameters
        ----------
        queries : array_like of float, shape (q, d)
            Coordinates that ask; they may lie anywhere.
        radius : float or array_like of float, shape (q,), optional
            One for all queries, or one for each. Default: the cutoff of the list. Up to that the
            kept cells answer; larger radii cost a search of their own.
        quantities, index_dtype, inclusive, kernel, threads, memory_limit
            As in `halfshell.neighbors`.

        Returns
        -------
        NeighborTable
            A row for each query, ascending by (j, S). A point at the place of a query is its
            neighbour at distance 0.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0)
        >>> [row.tolist() for row in cells.query([[0.5], [9.0]])]
        [[0, 1], []]
        >>> [row.tolist() for row in cells.query([[0.0], [0.0]], [0.5, 3.0])]
        [[0], [0, 1, 2]]
        """
        asking = self._queries(queries)
        radii = _radii.as_radii(radius, len(asking))
        if radii is None or isinstance(radii, float):
            return self._rows(asking, radii, quantities, index_dtype, options)

        def search(part: _inputs.PointArray, one: float, letters: str) -> _radii.Arrays:
            return self._arrays(part, one, letters, index_dtype, options)

        inclusive = _inputs.as_flag(options.get("inclusive", True), "inclusive")
        arrays = _radii.search_each(search, asking, radii, quantities, inclusive)
        return NeighborTable(arrays, quantities, self._n_points, False)

    def count_pairs(
        self, cutoff: Any = None, *, queries: Any = None, **options: Unpack[_Asking]
    ) -> int:
        """Count the pairs within a cutoff, as `halfshell.count_pairs` does.

        Parameters
        ----------
        cutoff : float, optional
            Default: that of the list.
        queries : array_like of float, shape (q, d), optional
            Count pairs of a query and a point instead.
        inclusive, kernel, threads, memory_limit
            As in `halfshell.count_pairs`.

        Returns
        -------
        int

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0)
        >>> cells.count_pairs(), cells.count_pairs(1.0), cells.count_pairs(queries=[[2.0]])
        (2, 1, 3)
        """
        if queries is None:
            return _core.count_pairs(*self._arguments(cutoff, options))
        return _core.count_between(*self._arguments(cutoff, options), self._queries(queries))

    def coordination(
        self, cutoff: Any = None, *, queries: Any = None, **options: Unpack[_Asking]
    ) -> npt.NDArray[np.int64]:
        """Count the neighbours of each point, or of each query.

        Parameters
        ----------
        cutoff, queries, inclusive, kernel, threads, memory_limit
            As in `count_pairs`.

        Returns
        -------
        ndarray of int64, shape (n,) or (q,)

        Examples
        --------
        >>> import halfshell as hs
        >>> hs.CellList([[0.0], [1.0], [3.0]], 2.0).coordination().tolist()
        [1, 2, 1]
        """
        asking = None if queries is None else self._queries(queries)
        return _core.coordination(*self._arguments(cutoff, options), asking)

    def iter_pairs(
        self,
        cutoff: Any = None,
        *,
        max_pairs: int = 1 << 20,
        quantities: str = "ij",
        index_dtype: npt.DTypeLike = np.int64,
        **options: Unpack[_Asking],
    ) -> PairBlocks[Any]:
        """Iterate over the pairs in blocks of bounded size, as `halfshell.iter_pairs` does.

        Parameters
        ----------
        cutoff : float, optional
            Default: that of the list. Up to that the kept cells are searched, which the iterator
            keeps alive.
        max_pairs, quantities, index_dtype, inclusive, kernel, threads, memory_limit
            As in `halfshell.iter_pairs`.

        Returns
        -------
        iterator of ndarray or tuple of ndarray

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0)
        >>> sum(len(i) for i, j in cells.iter_pairs(max_pairs=1))
        2
        """
        return cast(
            PairBlocks[Any],
            _core.iter_pairs(
                *self._arguments(cutoff, options), quantities,
                _inputs.as_index_bytes(index_dtype), most_pairs(max_pairs),
            ),
        )

    def for_each_pair(
        self,
        callback: Any,
        cutoff: Any = None,
        *,
        user_data: Any = None,
        thread_safe: bool = False,
        **options: Unpack[_Asking],
    ) -> int:
        """Call a function for each pair, as `halfshell.for_each_pair` does.

        Parameters
        ----------
        callback, user_data, thread_safe
            As in `halfshell.for_each_pair`.
        cutoff : float, optional
            Default: that of the list.
        inclusive, kernel, threads, memory_limit
            As in `halfshell.for_each_pair`.

        Returns
        -------
        int
            Pairs that it was called for.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0)
        >>> cells.for_each_pair(lambda i, j, S, D, d2: print(i, j, d2))
        0 1 1.0
        1 2 4.0
        2
        """
        target = _callbacks.target_of(callback, user_data)
        return _core.for_each_pair(
            *self._arguments(cutoff, options), target.function, target.user,
            _inputs.as_flag(thread_safe, "thread_safe"),
        )

    def _queries(self, queries: Any, name: str = "queries") -> _inputs.PointArray:
        array = _inputs.as_points(queries, name, self._ndim)
        if array.shape[1] != self._ndim:
            raise ValueError(
                f"{name} must have {self._ndim} columns, as the points, got shape {array.shape}"
            )
        return array

    def _arguments(self, cutoff: Any, options: _Asking) -> _Arguments:
        for name in options.keys() - {"inclusive", "kernel", "threads", "memory_limit"}:
            raise TypeError(f"unexpected keyword argument {name!r}")
        return (
            self._cells,
            self._cutoff if cutoff is None else _inputs.as_cutoff(cutoff),
            None,
            0,
            _inputs.as_flag(options.get("inclusive", True), "inclusive"),
            self._precision,
            options.get("kernel"),
            options.get("memory_limit"),
            None,
            options.get("threads", self._threads),
        )

    def _arrays(
        self,
        asking: _inputs.PointArray | None,
        cutoff: Any,
        quantities: str,
        index_dtype: npt.DTypeLike,
        options: _Asking,
    ) -> tuple[npt.NDArray[Any], ...]:
        """Offsets of the rows and an array for each quantity."""
        return _core.neighbors(
            *self._arguments(cutoff, options), quantities, _inputs.as_index_bytes(index_dtype),
            asking,
        )

    def _rows(
        self,
        asking: _inputs.PointArray | None,
        cutoff: Any,
        quantities: str,
        index_dtype: npt.DTypeLike,
        options: _Asking,
    ) -> NeighborTable:
        arrays = self._arrays(asking, cutoff, quantities, index_dtype, options)
        return NeighborTable(arrays, quantities, self._n_points, asking is None)
