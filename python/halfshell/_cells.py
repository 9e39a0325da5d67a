# SPDX-License-Identifier: BSD-3-Clause
"""`CellList`: points that are sorted into cells once and asked many times; the work is in C."""

from __future__ import annotations

from halfshell._cell_counts import CellCounts
from halfshell._cell_pairs import CellPairs
from halfshell._cell_rows import CellRows


class CellList(CellPairs, CellRows, CellCounts):
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
    cell_size : float, optional
        The least width of a cell, in the unit of the points; finite, greater than 0. Each axis is
        cut into as many equal cells as that allows. It changes the layout and how long calls take,
        but no answer (except with `precision` "single", which goes by cells); a cell may well be
        narrower than the cutoff. Cells are wider where there would be more than 2 n + 64 of them,
        or more than some thousand rows of cells within the cutoff, and a few millionths wider where
        `cell_size` is the cutoff or a whole part of it. Default: what is quick for this cutoff and
        this number of points.
    threads : int, optional
        Threads that sort the points; and those that later calls use unless they say otherwise.
    memory_limit : float, optional
        Bytes that the cells may take; later calls have limits of their own. As in `pairs`.

    Attributes
    ----------
    cutoff : float
        As given.
    shape : tuple of int, length d
        Cells along each axis, occupied or not.
    cell_sizes : tuple of float, length d
        Extent of a cell, across its faces, in the unit of the points. Infinity where points are so
        far from each other, or the box is so small beside that, that no float64 cells tell them
        apart: there is one cell with everything then. All answers but `candidates` are as ever;
        each call sorts the points anew.
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
    counting sort in O(n + cells), and there are at most 2 n + 64 of them, however large the volume
    (Hockney and Eastwood, Computer Simulation Using Particles, 1981, section 8-4). Answers are
    those of the functions of the same names, decided exactly; only the order of `pairs` without
    ``sort=True``, `iter_pairs` and `for_each_pair`, which is the same for the three, may differ
    from theirs, since cells that are kept are cut a little differently.

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
