# SPDX-License-Identifier: BSD-3-Clause
"""The methods of `CellList` that return rows: neighbours of points or queries, or the nearest."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.foreign import of_argument
from halfshell._convert.lengths import as_cutoff, as_radii
from halfshell._convert.nearest import as_k, as_max_distance, in_rows
from halfshell._convert.options import AUTO, as_index_bytes
from halfshell._convert.own_rows import check_alone, rows_of_points
from halfshell._convert.rules import reach_by_radii
from halfshell._convert.types import Arrays, Number, PointArray, PointsLike
from halfshell._objects.kept_cells import KeptCells, Options
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._objects.origin import Origin
from halfshell._objects.radii import Columns, search_apart, search_each


class CellRows(KeptCells):
    """Full lists among the points in cells."""

    __slots__ = ()

    def neighbors(
        self,
        cutoff: Number | None = None,
        *,
        queries: PointsLike | None = None,
        quantities: str = "j",
        inclusive: bool = True,
        index_dtype: npt.DTypeLike = np.int64,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
        indices: npt.ArrayLike | None = None,
    ) -> NeighborTable:
        """All neighbours of each point, or of each query, as `halfshell.neighbors` finds them.

        Parameters
        ----------
        cutoff : float, optional
            Default: that of the list.
        queries, quantities, inclusive, index_dtype, kernel, memory_limit, indices
            As in `halfshell.neighbors`.
        threads : int, optional
            As in `halfshell.neighbors`. Default: that of the list.

        Returns
        -------
        NeighborTable
            A row for each point or query, ascending by (j, S), or for each of `indices`.

        See Also
        --------
        query : a radius for each query.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0)
        >>> [row.tolist() for row in cells.neighbors()]
        [[1], [0, 2], [1]]
        """
        options = inclusive, kernel, threads, memory_limit
        if indices is not None:
            check_alone(queries)
            return self._rows_alone(indices, cutoff, quantities, index_dtype, options)
        asking = None if queries is None else self._queries(queries)
        return self._rows(asking, cutoff, quantities, index_dtype, options)

    def query(
        self,
        queries: PointsLike,
        radius: npt.ArrayLike | None = None,
        *,
        quantities: str = "j",
        inclusive: bool = True,
        index_dtype: npt.DTypeLike = np.int64,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
    ) -> NeighborTable:
        """All points within a radius of each query.

        Parameters
        ----------
        queries : array_like of float, shape (q, d)
            Coordinates of queries, in the unit of the points; they may lie anywhere.
        radius : float or array_like of float, shape (q,), optional
            One for all queries, or one for each. Default: the cutoff of the list, up to which the
            kept cells are used; larger radii take a separate search.
        quantities, inclusive, index_dtype, kernel, memory_limit
            As in `halfshell.neighbors`.
        threads : int, optional
            As in `halfshell.neighbors`. Default: that of the list.

        Returns
        -------
        NeighborTable
            A row for each query, ascending by (j, S). A point that coincides with a query is its
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
        options = inclusive, kernel, threads, memory_limit
        radii = as_radii(radius, len(asking))
        if radii is None:
            return self._rows(asking, radii, quantities, index_dtype, options)
        if isinstance(radii, float):
            with of_argument("radius"):
                return self._rows(asking, radii, quantities, index_dtype, options)

        search = _EachRadius(self, radii, index_dtype, options)
        arrays = search.rows(asking, quantities)
        origin = self._origin_of(asking, quantities, lambda queries: search.rows(queries, "S"))
        return NeighborTable(arrays, quantities, self._n_points, False, origin=origin)

    def nearest(
        self,
        k: int,
        *,
        queries: PointsLike | None = None,
        max_distance: Number = np.inf,
        quantities: str = "jd",
        index_dtype: npt.DTypeLike = np.int64,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
    ) -> Arrays:
        """Find the k nearest points, as `halfshell.nearest` does; always exact.

        The first call builds a tree of the points; later calls, with any `k` and any queries,
        reuse it. The cutoff and the precision of the list have no effect.

        Parameters
        ----------
        k : int
            Number of neighbours, 1 or more.
        queries : array_like of float, shape (q, d), optional
            Coordinates of queries. Default: the points of the list, each left out of its own row.
        max_distance, quantities, index_dtype, kernel, memory_limit
            As in `halfshell.nearest`. The tree must fit `memory_limit` by itself, but does not
            count towards it otherwise.
        threads : int, optional
            As in `halfshell.nearest`. Default: that of the list.

        Returns
        -------
        ndarray or tuple of ndarray
            As from `halfshell.nearest`: rows of k entries, in exact order, ties by (j, S).

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0, box=[8.0])
        >>> j, d = cells.nearest(2)
        >>> j.tolist(), d.tolist()
        ([[1, 2], [0, 2], [1, 0]], [[1.0, 3.0], [1.0, 2.0], [2.0, 3.0]])
        >>> cells.nearest(1, queries=[[7.0]], quantities="jS")
        (array([[0]]), array([[[1]]], dtype=int32))
        """
        asking = None if queries is None else self._queries(queries)
        number = as_k(k)
        search = self._arguments(
            as_max_distance(max_distance), (True, kernel, threads, memory_limit)
        )
        arrays = _core.nearest(*search, quantities, as_index_bytes(index_dtype), asking, number)
        return in_rows(arrays, self._n_points if asking is None else len(asking), number)

    def _arrays(
        self,
        asking: PointArray | None,
        cutoff: Any,
        quantities: str,
        index_dtype: npt.DTypeLike,
        options: Options,
    ) -> tuple[npt.NDArray[Any], ...]:
        """Offsets of the rows and an array for each quantity."""
        return _core.neighbors(
            *self._arguments(cutoff, options), quantities, as_index_bytes(index_dtype), asking,
            None, AUTO,
        )

    def _rows(
        self,
        asking: PointArray | None,
        cutoff: Any,
        quantities: str,
        index_dtype: npt.DTypeLike,
        options: Options,
    ) -> NeighborTable:
        cutoff = None if cutoff is None else as_cutoff(cutoff)
        arrays = self._arrays(asking, cutoff, quantities, index_dtype, options)
        origin = self._origin_of(asking, quantities, lambda queries: self._arrays(
            queries, cutoff, "S", index_dtype, options
        ))  # fmt: skip
        return NeighborTable(arrays, quantities, self._n_points, asking is None, origin=origin)

    def _rows_alone(
        self,
        indices: Any,
        cutoff: Any,
        quantities: str,
        index_dtype: npt.DTypeLike,
        options: Options,
    ) -> NeighborTable:
        """The rows of some of the points."""
        points = self._origin.scene()[0]
        arrays, numbers, entries = rows_of_points(
            self._arguments(cutoff, options), points, indices, quantities,
            as_index_bytes(index_dtype), None, AUTO,
        )  # fmt: skip
        origin = self._origin_of(points[numbers], quantities, lambda queries: self._arrays(
            queries, cutoff, "S", index_dtype, options
        ))  # fmt: skip
        return NeighborTable(
            arrays, quantities, self._n_points, False, origin=origin, entries=entries
        )

    def _origin_of(
        self,
        asking: PointArray | None,
        quantities: str,
        search: Callable[[Any], Columns],
    ) -> Origin | None:
        """What a table keeps to be sorted by; `search` returns offsets and S for queries."""
        if "d" not in quantities or "j" not in quantities:
            return None
        return self._origin.asked_by(asking, lambda origin: search(origin.queries)[1])


class _EachRadius:
    """The search for rows of queries with a radius each."""

    def __init__(
        self,
        cells: CellRows,
        radii: npt.NDArray[np.float64],
        index_dtype: npt.DTypeLike,
        options: Options,
    ) -> None:
        self._cells = cells
        self._radii = radii
        self._index_dtype = index_dtype
        self._options = options

    def rows(self, queries: PointArray, quantities: str) -> Columns:
        """Offsets and an array for each quantity."""
        cells, radii = self._cells, self._radii
        with of_argument("radius"):
            if len(radii) == 0 or (radii == radii[0]).all():
                radius = float(radii[0]) if len(radii) else 0.0
                return cells._arrays(queries, radius, quantities, self._index_dtype, self._options)
            if not search_apart(radii, cells._cutoff, cells._n_points):
                return self._gathered(queries, quantities)

            def search(
                members: npt.NDArray[np.intp], radius: float, room: float | None
            ) -> Columns:
                options = self._options if room is None else (*self._options[:-1], room)
                some = queries[members]
                return cells._arrays(some, radius, quantities, self._index_dtype, options)

            return search_each(search, radii, self._options[-1])

    def _gathered(self, queries: PointArray, quantities: str) -> Columns:
        """All at once, among the points as they were given."""
        points, vectors, bits = self._cells._origin.scene()
        rest = self._cells._arguments(None, self._options)[4:]
        reach = reach_by_radii("gather", None, self._radii)
        return _core.neighbors(
            points, np.inf, vectors, bits, *rest, quantities, as_index_bytes(self._index_dtype),
            queries, reach, AUTO,
        )
