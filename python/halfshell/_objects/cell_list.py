# SPDX-License-Identifier: BSD-3-Clause
"""`CellList`: points that are sorted into cells once and asked many times; the work is in C.

Every search takes one in place of points: the methods of the same names are these calls.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar, cast

import numpy as np
import numpy.typing as npt

from halfshell import _core, _show
from halfshell._convert.arrays import as_real_array, entries_of, rows_of, starts_of
from halfshell._convert.call import same_boxes, take
from halfshell._convert.foreign import is_a, shown
from halfshell._convert.lengths import as_number, as_positive, as_radii
from halfshell._convert.memory import gigabytes
from halfshell._convert.options import as_index_bytes, most_pairs
from halfshell._convert.points import Points, refuse_infinite
from halfshell._functions import clusters as _clusters
from halfshell._functions import counts as _counts
from halfshell._functions import neighbors as _rows
from halfshell._functions import pairs as _pairs
from halfshell._functions import rdf as _rdf
from halfshell._functions.neighbors import listed
from halfshell._objects.exact import Origin, copied
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._search import document, search
from halfshell._settings import current, settings

if TYPE_CHECKING:
    from typing import Unpack

    from matplotlib.axes import Axes

    from halfshell._convert.types import (
        ArrayLike,
        BoxLike,
        CutoffLike,
        MethodOptions,
        Number,
        PeriodicLike,
        PointsLike,
    )

_ASKED_AT_A_TIME = 4096  # points whose candidates are looked up together

Method = TypeVar("Method", bound="Callable[..., Any]")


@_show.shown
class Candidates(NamedTuple):
    """Ranges of `CellList.order` for each query: what the cells around it hold."""

    offsets: npt.NDArray[np.int64]
    """Where the ranges of each query begin; shape (q + 1,)."""
    start: npt.NDArray[np.int64]
    """Where each range begins in `CellList.order`; shape (m,)."""
    stop: npt.NDArray[np.int64]
    """Where it ends, not included; shape (m,)."""


def _like(function: Callable[..., Any], *without: str) -> Callable[[Method], Method]:
    """Give a method the options of a search of these cells, and its description if it has none.

    without: other arguments of the search that the method does not have.
    """

    def decorate(method: Method) -> Method:
        signature, mine = inspect.signature(function), inspect.signature(method).parameters
        known = {**mine, **signature.parameters, **mine}
        for name in ("points", "box", "periodic", "arguments", "options", *without):
            known.pop(name, None)
        parameters = sorted(known.values(), key=lambda one: one.kind)
        made = cast("Any", method)
        made.__signature__ = signature.replace(parameters=parameters)
        if made.__doc__ is None:
            made.__doc__ = re.sub(
                r"(?m)^    (points|box|periodic) :.*\n(?:     .*\n)*", "", function.__doc__ or ""
            )
        return method

    return decorate


def _of_cells(function: Method) -> Method:
    """A search as a method: its points are the cells, which have their box."""

    def method(self: Any, *arguments: Any, **options: Any) -> Any:
        return function(self, *arguments, **options)

    method.__name__, method.__qualname__ = function.__name__, f"CellList.{function.__name__}"
    return cast("Method", _like(function)(method))


class CellList:
    """Points sorted into cells once, for many searches.

    Parameters
    ----------
    {points}
    cutoff : float
        The largest cutoff that the cells are made for. They serve smaller ones too; a call with a
        larger cutoff, or with radii, supports or cutoffs by type, makes cells of its own.
    {box, periodic}
    cell_size : float, optional
        The minimum width of a cell, in the unit of the points; finite, greater than 0. Each axis
        is cut into as many equal cells as that allows. It changes the layout and the run time, but
        no answer (except with the precision "single", which depends on the cells); a cell may be
        narrower than the cutoff. Cells are wider if there would be more than 2 n + 64 of them,
        or more than a few thousand rows of cells within the cutoff, and a few millionths wider if
        `cell_size` is the cutoff divided by a whole number. Default: a width that is fast for this
        cutoff and this number of points.
    domain : tuple (low, high), optional
        The lowest and the highest coordinates that the cells reach over along open axes, each a
        number or shape (d,): with a `cell_size` the cells are the same for any points within, as
        far as their number allows. Points beyond make it larger. In open space, and in boxes along
        the coordinate axes.
    threads : int, optional
        Threads that sort the points; also the default of later calls.

    Attributes
    ----------
    points : Points
        What is known of the points; a copy.
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
        As for `pairs`; ValueError for a batch.

    See Also
    --------
    pairs, neighbors, pairs_between, count_pairs : take a CellList in place of points.

    Notes
    -----
    A cell list is immutable, and any number of threads may search it at once. A pickle has the
    points, and the cells are made again from it. It holds the points once as given and once in
    cell order.

    Cells are found by a counting sort in O(n + cells), and there are at most 2 n + 64 of them,
    however large the volume (Hockney and Eastwood, Computer Simulation Using Particles, 1981,
    section 8-4). Answers are those of the functions of the same names, decided exactly. Only the
    order of pairs from `pairs` without ``sort=True``, `iter_pairs` and `for_each_pair` (the same
    for all three) may differ from that of the functions, since kept cells have other boundaries.

    Examples
    --------
    >>> import halfshell as hs
    >>> cells = hs.CellList([[0.5, 0.5], [1.5, 0.5], [3.5, 0.5]], 1.0, box=4.0)
    >>> i, j = cells.pairs(sort=True)
    >>> i.tolist(), j.tolist()
    ([0, 0], [1, 2])
    >>> cells.query([[2.0, 0.5]], 0.5)[0].tolist()
    [1]
    >>> cells.count_pairs(0.5)
    0
    """

    __slots__ = (
        "_cell_size", "_cells", "_cutoff", "_domain", "_layout", "_plain", "_threads", "points"
    )  # fmt: skip

    #: Told by `take` from other points.
    _is_cell_list = True

    points: Points

    @search()
    def __init__(
        self,
        points: PointsLike,
        cutoff: Number,
        *,
        box: BoxLike | None = None,
        periodic: PeriodicLike | None = None,
        cell_size: Number | None = None,
        domain: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
        threads: int | None = None,
    ) -> None:
        width = 0.0 if cell_size is None else as_positive(cell_size, "cell_size")
        self._cutoff, self._cell_size, self._threads = as_number(cutoff, "cutoff"), width, threads
        found = Points._of(points, "points", box, periodic)
        self._domain = None if domain is None else _as_domain(domain, found)
        self._build(found)

    def _build(self, points: Points) -> None:
        call = take(points, self._cutoff, threads=self._threads, by_reach=False)
        call.refuse_batch("CellList", "cells are those of one system")
        self._cells = call.run(_core.cells_build, self._cell_size, self._domain)
        self._layout = SimpleNamespace(**_core.cells_layout(self._cells))
        self._take_points(points._over(self._layout.points))

    def _take_points(self, points: Points) -> None:
        self.points = points
        known = points.radii, points.supports, points._groups
        is_plain = all(one is None for one in known)
        #: What C takes in place of the list (csrc/binding/functions.c).
        self._plain = (self._cells, self._cutoff, self._threads) if is_plain else None

    def __len__(self) -> int:
        return len(self.points)

    _repr_html_ = _show.html

    def __repr__(self) -> str:
        cells = len(self.cell_start) - 1
        kind = "cells" if self.cell_ids is None else "occupied cells"
        return f"CellList({len(self)} points, {cells} {kind}, cutoff {self.cutoff!r})"

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self  # it does not change

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.points, *self._given)

    @property
    def _given(self) -> tuple[Any, ...]:
        return self._cutoff, self._cell_size, self._domain, self._threads

    cutoff: float = _show.attribute("_cutoff")
    shape: tuple[int, ...] = _show.attribute("_layout.shape")
    cell_sizes: tuple[float, ...] = _show.attribute("_layout.cell_sizes")
    cell_start: npt.NDArray[np.int32] = _show.attribute("_layout.cell_start")
    order: npt.NDArray[np.int32] = _show.attribute("_layout.order")
    cell_ids: npt.NDArray[np.int64] | None = _show.attribute("_layout.cell_ids")

    # ---- searches --------------------------------------------------------------------------

    pairs = _of_cells(_pairs.pairs)
    iter_pairs = _of_cells(_pairs.iter_pairs)
    neighbors = _of_cells(_rows.neighbors)
    nearest = _of_cells(_rows.nearest)
    count_pairs = _of_cells(_counts.count_pairs)
    coordination = _of_cells(_rows.coordination)
    pair_histogram = _of_cells(_counts.pair_histogram)
    rdf = _of_cells(_rdf.rdf)
    clusters = _of_cells(_clusters.clusters)

    @_like(_pairs.for_each_pair)
    def for_each_pair(
        self, callback: Any, cutoff: CutoffLike = None, **options: Unpack[MethodOptions]
    ) -> int:
        return _pairs.for_each_pair(self, cutoff, callback, **cast("Any", options))

    @_like(_rows.neighbors, "cutoff", "indices", "rule")
    def query(
        self, queries: PointsLike, radius: ArrayLike | None = None, **options: Unpack[MethodOptions]
    ) -> NeighborTable:
        """All points within a radius of each query.

        Parameters
        ----------
        queries : array_like of float, shape (q, d), or Points
            Coordinates of queries, in the unit of the points; they may lie anywhere.
        radius : float or array_like of float, shape (q,), optional
            One for all queries, or one for each. Default: the cutoff of the list, up to which the
            kept cells are used; larger radii take a separate search.
        exclude, min_distance, inclusive, quantities, index_dtype, threads, progress
            As in `halfshell.neighbors`.

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
        radii: Any = self._cutoff if radius is None else radius
        asking: Any = queries
        if type(radii) is not float or not 0.0 <= radii < np.inf:
            asking = self._asking(queries)
            radii = as_radii(radius, len(asking))
        cells = self if self._plain is not None else self._without_reach()
        try:
            if isinstance(radii, float):
                return _rows.neighbors(cells, radii, queries=asking, **cast("Any", options))
            return query_each(cells, asking, radii, cast("Any", options))
        except MemoryError as error:
            if radius is None:
                raise
            raise MemoryError(str(error).replace("cutoff", "radius")) from None

    def _without_reach(self) -> CellList:
        """The same cells, of points whose own radii or supports do not matter."""
        if self.points.radii is None and self.points.supports is None:
            return self
        other = CellList.__new__(CellList)
        for name in CellList.__slots__:
            setattr(other, name, getattr(self, name))
        other._take_points(self.points.replace(radii=None, supports=None))
        return other

    # ---- cells -----------------------------------------------------------------------------

    @property
    def _ndim(self) -> int:
        return int(self.points.positions.shape[1])

    def _asking(self, queries: Any, name: str = "queries") -> Points:
        """Points of as many dimensions, that bring no other box."""
        found = Points._of(queries, name, ndim=self._ndim)
        ndim = found.positions.shape[1]
        if ndim != self._ndim:
            raise ValueError(f"{name} must have {self._ndim} columns, as the cells, got {ndim}")
        if found.box is not None and not same_boxes(found, self.points):
            raise ValueError(f"{name} bring a box that is not that of points: give arrays")
        return found

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
        asking = self._asking(points, "points").positions
        found: npt.NDArray[np.int64] = take(self, self._cutoff, by_reach=False).run(
            _core.cells_find, asking
        )
        return found

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
        asking = None if queries is None else self._asking(queries).positions
        call = take(self, self._cutoff, by_reach=False)
        return Candidates(*call.run(_core.cells_candidates, asking))

    def candidate_pairs(
        self, *, max_pairs: int = 1 << 20
    ) -> Iterator[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]]:
        """All pairs of points in neighbouring cells, without a distance test, in blocks.

        Parameters
        ----------
        max_pairs : int, default 2**20
            The most pairs in a block.

        Returns
        -------
        iterator of (i, j), each ndarray of int64
            i < j. Together they have at least all pairs within the cutoff of two different points,
            once for each image in which their cells are neighbours.

        Raises
        ------
        ValueError
            If a single cell holds everything.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.5], [1.5], [9.5]], 1.0)
        >>> any(((i == 0) & (j == 1)).any() for i, j in cells.candidate_pairs())
        True
        """
        return self._candidate_pairs(most_pairs(max_pairs))

    def _candidate_pairs(self, most: int) -> Iterator[Any]:
        points, order = self.points.positions, self.order
        for first in range(0, len(self), _ASKED_AT_A_TIME):
            asking = order[first : first + _ASKED_AT_A_TIME]
            block = self.candidates(points[asking])
            row = rows_of(block.offsets)
            ends = starts_of(block.stop - block.start)
            for begin in range(0, int(ends[-1]), most):
                entries = np.arange(begin, min(begin + most, int(ends[-1])))
                which = np.searchsorted(ends, entries, side="right") - 1
                i = asking[row[which]].astype(np.int64)
                j = order[block.start[which] + entries - ends[which]].astype(np.int64)
                if len(i := i[keep := i < j]):
                    yield i, j[keep]

    def rebuild(self, points: PointsLike) -> CellList:
        """A list of other points with the same box, cutoff and width of cells.

        Parameters
        ----------
        points : array_like of float, shape (n, d), or Points
            As in the constructor; any box that they bring is that of this list.

        Returns
        -------
        CellList

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0]], 1.0, box=5.0)
        >>> cells.rebuild([[0.0], [4.5], [2.0]]).count_pairs()
        1
        """
        found = self._asking(points, "points")
        if found.box is None and self.points.box is not None:
            refuse_infinite(found.positions, "points")
            found = found.replace(box=self.points.box, periodic=self.points.periodic)
        return _restored(found, *self._given)

    @document
    def plot(self, ax: Axes | None = None, *, unit: str | None = None) -> Axes:
        """Draw the points in the colours of their cells, and the cells.

        Parameters
        ----------
        {ax, unit}

        {drawn}
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
        from halfshell._objects.pictures import draw_cells

        return draw_cells(self, ax, unit)


document(CellList)
_core.know("CellList", CellList)


def _restored(
    points: Points, cutoff: float, cell_size: float, domain: Any, threads: int | None
) -> CellList:
    cells = CellList.__new__(CellList)
    cells._cutoff, cells._cell_size, cells._threads = cutoff, cell_size, threads
    cells._domain = domain
    cells._build(points)
    return cells


def _as_domain(domain: Any, points: Points) -> npt.NDArray[np.float64]:
    """Both ends along each axis; an empty range along those that repeat."""
    positions, vectors, bits = points._scene
    ndim = positions.shape[1]
    ends_given = is_a(domain, (tuple, list)) or (is_a(domain, np.ndarray) and domain.ndim > 0)
    if not ends_given or len(domain) != 2:
        raise TypeError(f"domain must be a pair (low, high), got {shown(domain)}")
    ends = np.empty((2, ndim))
    for row, name, given in zip(ends, ("low", "high"), domain, strict=True):
        end = as_real_array(given, f"{name} end of domain", "be a number or numbers")
        if end.shape not in ((), (ndim,)):
            raise ValueError(f"{name} end of domain must have shape ({ndim},), got {end.shape}")
        row[:] = end
    for k in np.flatnonzero(~(ends[0] <= ends[1]) | ~np.isfinite(ends).all(axis=0)):
        low, high = ends[:, k].tolist()
        raise ValueError(f"domain must be finite and not descend, got {low} to {high} in axis {k}")
    for row in vectors if vectors is not None else ():
        if bits and np.count_nonzero(row) > 1:
            raise ValueError("domain is for open space and boxes along the coordinate axes")
    for axis in range(ndim):
        if vectors is not None and bits >> axis & 1:
            ends[:, np.flatnonzero(vectors[axis])] = [[np.inf], [-np.inf]]
    return ends


# ---- a radius for each query -----------------------------------------------------------------

Columns = tuple[npt.NDArray[Any], ...]
Radii = npt.NDArray[np.float64]

#: Points that are sorted in the time of one search of cells.
_SORTED_MEANWHILE = 2048
_LARGEST_GATHERED = 2.0**1022  # the core has no larger radii in one search


def query_each(cells: Any, queries: Points, radii: Radii, options: dict[str, Any]) -> NeighborTable:
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
    offsets, entries = entries_of(starts_of(counts), np.argsort(order))
    joined = (offsets, *(np.concatenate(some)[entries] for some in list(zip(*parts))[1:]))
    for array in joined:
        array.flags.writeable = False
    return joined
