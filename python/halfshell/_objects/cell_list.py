# SPDX-License-Identifier: BSD-3-Clause
"""`CellList`: points that are sorted into cells once and asked many times; the work is in C.

The class is made of files, for its documentation fills more than one: here it is made and shows its
cells; `cell_pairs`, `cell_rows` and `cell_counts` have the searches, by what they return.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Never, Self, cast

import numpy as np
import numpy.typing as npt

from halfshell import _core, _show
from halfshell._convert.lengths import as_cutoff, as_positive
from halfshell._convert.scene import as_scene
from halfshell._convert.types import BoxLike, Number, PeriodicLike, PointsLike, Precision
from halfshell._objects.cell_counts import CellCounts
from halfshell._objects.cell_pairs import CellPairs
from halfshell._objects.cell_rows import CellRows
from halfshell._objects.origin import Origin
from halfshell._unknown import refuse_unknown

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Candidates(NamedTuple):
    """Ranges of `CellList.order` for each query: what the cells around it hold."""

    offsets: npt.NDArray[np.int64]
    """Where the ranges of each query begin; shape (q + 1,)."""
    start: npt.NDArray[np.int64]
    """Where each range begins in `CellList.order`; shape (m,)."""
    stop: npt.NDArray[np.int64]
    """Where it ends, not included; shape (m,)."""

    def __repr__(self) -> str:
        return _show.line(self)

    def _repr_html_(self) -> str:
        return _show.html(self)


class CellList(CellPairs, CellRows, CellCounts):
    """Points sorted into cells once, for many searches.

    Parameters
    ----------
    points : array_like of float, shape (n, d)
        Coordinates, as in `pairs`; they are copied. An object such as ``ase.Atoms`` brings its own
        box.
    cutoff : float
        The largest cutoff that the cells are made for. They serve smaller ones too; a call with a
        larger cutoff makes cells of its own.
    box, periodic, precision
        As in `pairs`.
    cell_size : float, optional
        The minimum width of a cell, in the unit of the points; finite, greater than 0. Each axis
        is cut into as many equal cells as that allows. It changes the layout and the run time, but
        no answer (except with `precision` "single", which depends on the cells); a cell may be
        narrower than the cutoff. Cells are wider if there would be more than 2 n + 64 of them,
        or more than a few thousand rows of cells within the cutoff, and a few millionths wider if
        `cell_size` is the cutoff divided by a whole number. Default: a width that is fast for this
        cutoff and this number of points.
    threads : int, optional
        Threads that sort the points; also the default of later calls.
    memory_limit : float, optional
        Bytes that the cells may take; later calls have limits of their own. As in `pairs`.

    Attributes
    ----------
    cutoff : float
        As given.
    shape : tuple of int, length d
        Cells along each axis, occupied or not.
    cell_sizes : tuple of float, length d
        Distance between opposite faces of a cell, in the unit of the points. Infinity if points
        are so far apart, or the box is so small in comparison, that float64 cells cannot separate
        them: then one cell holds everything, and each call sorts the points anew. All answers
        except `candidates` stay the same.
    cell_start : ndarray of int32, shape (cells + 1,)
        Cell c holds the points ``order[cell_start[c]:cell_start[c + 1]]``.
    order : ndarray of int32, shape (n,)
        The points in cell order: a permutation, ascending in each cell.
    cell_ids : ndarray of int64, shape (cells, d), or None
        None if every cell has an id: ids then run fastest along the first axis. For clusters of
        points far apart only occupied cells are stored, and these are their indices along the
        axes.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pairs`.

    See Also
    --------
    pairs, neighbors, pairs_between, count_pairs : the same searches without keeping the cells.

    Notes
    -----
    A cell list is immutable, and any number of threads may search it at once. It holds the points
    once as given, as float64, and once in cell order; its tables with distances refer to the
    former and keep the list alive.

    Cells are found by a counting sort in O(n + cells), and there are at most 2 n + 64 of them,
    however large the volume (Hockney and Eastwood, Computer Simulation Using Particles, 1981,
    section 8-4). Answers are those of the functions of the same names, decided exactly. Only the
    order of pairs from `pairs` without ``sort=True``, `iter_pairs` and `for_each_pair` (the same
    for all three) may differ from that of the functions, since kept cells have other boundaries.

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

    __slots__ = ()

    def __init__(
        self,
        points: PointsLike,
        cutoff: Number,
        *,
        box: BoxLike | None = None,
        periodic: PeriodicLike | None = None,
        cell_size: Number | None = None,
        precision: Precision = "exact",
        threads: int | None = None,
        memory_limit: float | None = None,
        **unknown: Never,
    ) -> None:
        if unknown:
            refuse_unknown(CellList, unknown)
        array, vectors, bits = as_scene(points, box, periodic)
        self._cutoff = as_cutoff(cutoff)
        self._cells = _core.cells_build(
            array, self._cutoff, vectors, bits, True, precision, None, memory_limit, None, threads,
            0.0 if cell_size is None else as_positive(cell_size, "cell_size"),
        )
        self._layout = _core.cells_layout(self._cells)
        self._n_points: int = array.shape[0]
        self._ndim: int = array.shape[1]
        self._precision = precision
        own_vectors = None if vectors is None else vectors.copy()
        self._origin = Origin.of_own(self._layout["points"], None, own_vectors, bits)
        self._threads = threads

    def __len__(self) -> int:
        """Number of points."""
        return self._n_points

    _repr_html_ = _show.html

    def __repr__(self) -> str:
        cells = len(self.cell_start) - 1
        kind = "cells" if self.cell_ids is None else "occupied cells"
        return f"CellList({self._n_points} points, {cells} {kind}, cutoff {self.cutoff!r})"

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self  # it does not change

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError("a CellList cannot be pickled: pickle its points, and make it again")

    @property
    def cutoff(self) -> float:
        return self._cutoff

    @property
    def shape(self) -> tuple[int, ...]:
        return cast("tuple[int, ...]", self._layout["shape"])

    @property
    def cell_sizes(self) -> tuple[float, ...]:
        return cast("tuple[float, ...]", self._layout["cell_sizes"])

    @property
    def cell_start(self) -> npt.NDArray[np.int32]:
        return cast("npt.NDArray[np.int32]", self._layout["cell_start"])

    @property
    def order(self) -> npt.NDArray[np.int32]:
        return cast("npt.NDArray[np.int32]", self._layout["order"])

    @property
    def cell_ids(self) -> npt.NDArray[np.int64] | None:
        return cast("npt.NDArray[np.int64] | None", self._layout["cell_ids"])

    def cell_of(self, points: PointsLike) -> npt.NDArray[np.int64]:
        """Find the cell that each given point would be in.

        Parameters
        ----------
        points : array_like of float, shape (m, d)
            Any points, not just those of the list. They are wrapped into the box; points beyond an
            open face count as on it.

        Returns
        -------
        ndarray of int64, shape (m,)
            Cell ids; -1 if only occupied cells have an id and this cell is empty.

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

    def candidates(self, queries: PointsLike | None = None) -> Candidates:
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
            If a query is far outside the points and the box, or if a single cell holds everything
            (`cell_sizes` is infinite).

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
        search = self._arguments(None, (True, None, None, None))
        return Candidates(*_core.cells_candidates(*search, asking))

    def plot(self, ax: Axes | None = None, *, unit: str | None = None) -> Axes:
        """Draw the points in the colours of their cells, and the cells.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; for points in three dimensions with ``projection="3d"``. Default: axes
            of a new figure.
        unit : str, optional
            The unit of the points, for the labels of the axes: "Å".

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.

        Raises
        ------
        ImportError
            If matplotlib is not installed: ``pip install matplotlib``.
        ValueError
            If there are more than 500 000 points or three dimensions, or axes do not fit.

        Notes
        -----
        Points are drawn wrapped into the box, as the cells hold them. In up to two dimensions
        cells are areas, white where only occupied cells are stored; in three each cell has the
        bounds of its points, the first 2000 of them.

        Examples
        --------
        >>> import halfshell as hs
        >>> ax = hs.CellList([[0.5, 0.5], [1.5, 0.5]], 1.0).plot()  # doctest: +SKIP
        """
        from halfshell._objects.cell_plot import draw_cells

        return draw_cells(self, ax, unit)
