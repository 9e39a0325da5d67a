# SPDX-License-Identifier: BSD-3-Clause
"""Searches of dask arrays and dataframes, in any number of processes, with one search's answer.

All is lazy: nothing is read or searched before ``compute``. Bricks are cut by a sample of each
chunk; each chunk gives its points to the bricks that own or need them; each brick is then a task.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell._convert.lengths import as_cutoff, as_cutoffs, as_edges
from halfshell._convert.options import as_flag, check_letters
from halfshell._convert.types import BoxLike, Number, PeriodicLike
from halfshell._functions import brick_tasks
from halfshell._functions.dask_scene import columns, da, dask, divided, joined, options_of

__all__ = ["Neighbors", "bricks", "coordination", "count_pairs", "neighbors", "pair_histogram",
           "pairs"]  # fmt: skip

Collection = Any  # a dask Array, DataFrame or Delayed, also for type checkers without dask


class Neighbors(NamedTuple):
    """What `neighbors` returns: rows of points, brick after brick, or ascending if sorted.

    Attributes
    ----------
    points : dask Array of int64, shape (n,)
        The point of each row.
    counts : dask Array of int64, shape (n,)
        Its number of neighbours.
    columns : dask Array, or tuple of them
        The `quantities` of each neighbour, row after row; m neighbours in all.
    table : Delayed
        All rows as the `NeighborTable` that `halfshell.neighbors` returns, in one process.
    """

    points: Collection
    counts: Collection
    columns: Collection
    table: Collection


def bricks(
    points: Collection,
    cutoff: Number,
    *,
    n: int | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
) -> Collection:
    """Divide points as the other functions of this module do, to find out what that costs.

    Bricks are as those of `halfshell.bricks`, but own about as many points each, not exactly: they
    are cut by a sample of the points.

    Parameters
    ----------
    points, cutoff, n, box, periodic
        As in `pairs`.

    Returns
    -------
    Delayed
        `halfshell.Bricks` of all points.

    Raises
    ------
    TypeError, ValueError, OverflowError
        As `pairs`.

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> hd.bricks(da.arange(8.0, chunks=4)[:, None], 1.0).compute()
    Bricks(2 of 8 points, overhead 1.25)
    """
    scene = divided(points, as_cutoff(cutoff), n, box, periodic)
    return dask.delayed(brick_tasks.bricks_of, pure=True)(
        scene.division, *scene.each(brick_tasks.brick_of)
    )


def pairs(
    points: Collection,
    cutoff: Number,
    *,
    n: int | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    quantities: str = "ij",
    inclusive: bool = True,
    sort: bool = False,
    kernel: str | None = None,
    threads: int = 1,
    memory_limit: float | None = None,
) -> Collection:
    """Find all pairs of points within a cutoff, always exactly, brick by brick.

    Parameters
    ----------
    points : dask Array or DataFrame of real numbers, shape (n_points, d)
        Coordinates, in chunks of any length, which need not be known; 1 <= d <= 8. Points are
        numbered across all chunks.
    cutoff : float
        As in `halfshell.bricks`; in the unit of `points`.
    n : int, optional
        Number of bricks, 1 to 2**20. Default: the number of chunks of `points`.
    box, periodic
        As in `halfshell.pairs`.
    quantities : str, default "ij"
        Any of the letters ``i j d D S P``, as in `halfshell.pairs`.
    inclusive : bool, default True
        Whether a pair at exactly `cutoff` counts.
    sort : bool, default False
        Sort all pairs by (i, j, S), ascending, byte for byte as `halfshell.pairs` with
        ``sort=True``. The pairs of every brick are then sent to as many tasks as there are bricks.
        Otherwise they have this order within each chunk, which is a brick.
    kernel, memory_limit
        As in `halfshell.pairs`, for each brick.
    threads : int, default 1
        Threads of each task; dask runs several tasks at once.

    Returns
    -------
    dask Array or tuple of them
        As `halfshell.pairs` returns them, with chunks of unknown length.

    Raises
    ------
    TypeError, ValueError, OverflowError
        At once, for arguments and the metadata of the collection; when the result is computed, for
        coordinates, named by their position among all points, and for chunks that do not match the
        metadata.

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> points = da.from_array([[0.0], [1.0], [3.0]], chunks=2)
    >>> hd.pairs(points, 1.5, box=[4.0], quantities="P", sort=True).compute().tolist()
    [[0, 1], [0, 2]]
    """
    check_letters(quantities)
    scene = divided(points, as_cutoff(cutoff), n, box, periodic, kernel=kernel)
    options = options_of(inclusive, kernel, threads, memory_limit)
    found = scene.each(brick_tasks.pairs_of, quantities, options)
    if as_flag(sort, "sort"):
        found = scene.in_ranges(found)
    return columns(found, 0, quantities, scene.ndim)


def neighbors(
    points: Collection,
    cutoff: Number,
    *,
    n: int | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    quantities: str = "j",
    inclusive: bool = True,
    sort: bool = False,
    kernel: str | None = None,
    threads: int = 1,
    memory_limit: float | None = None,
) -> Neighbors:
    """Find all neighbours of each point, always exactly, brick by brick.

    Parameters
    ----------
    points, cutoff, n, box, periodic, inclusive, kernel, threads, memory_limit
        As in `pairs`.
    quantities : str, default "j"
        Any of the letters ``j d D S``, as in `halfshell.neighbors`.
    sort : bool, default False
        Rows in the order of the points, byte for byte as in `halfshell.neighbors`; otherwise brick
        by brick.

    Returns
    -------
    Neighbors
        Rows as dask arrays, with indices among all points; `table` does not depend on `sort`.

    Raises
    ------
    TypeError, ValueError, OverflowError
        As `pairs`.

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> points = da.from_array([[0.0], [1.0], [3.0]], chunks=2)
    >>> found = hd.neighbors(points, 1.5, box=[4.0])
    >>> [row.tolist() for row in found.table.compute()]
    [[1, 2], [0], [0]]
    """
    check_letters(quantities)
    if not set(quantities) <= set("jdDS"):
        raise ValueError(f"quantities of neighbors are some of j d D S, got {quantities!r}")
    scene = divided(points, as_cutoff(cutoff), n, box, periodic, kernel=kernel)
    options = options_of(inclusive, kernel, threads, memory_limit)
    found = scene.each(brick_tasks.neighbors_of, quantities, options)
    table = dask.delayed(brick_tasks.table_of, pure=True)(quantities, scene.division, *found)
    if as_flag(sort, "sort"):
        found = scene.in_ranges(found)
    rows, counts = (joined(found, 0, place, (math.nan,), np.int64) for place in (0, 1))
    return Neighbors(rows, counts, columns(found, 1, quantities, scene.ndim), table)


def coordination(
    points: Collection,
    cutoff: Number,
    *,
    n: int | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    inclusive: bool = True,
    kernel: str | None = None,
    threads: int = 1,
    memory_limit: float | None = None,
) -> Collection:
    """Count the neighbours of each point, always exactly.

    Parameters
    ----------
    points, cutoff, n, box, periodic, inclusive, kernel, threads, memory_limit
        As in `pairs`.

    Returns
    -------
    dask Array of int64, shape (n_points,)
        As `halfshell.coordination` returns it, in the order of the points.

    Raises
    ------
    TypeError, ValueError, OverflowError
        As `pairs`.

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> points = da.from_array([[0.0], [1.0], [3.0]], chunks=2)
    >>> hd.coordination(points, 1.5, box=[4.0]).compute().tolist()
    [2, 1, 1]
    """
    scene = divided(points, as_cutoff(cutoff), n, box, periodic, kernel=kernel)
    options = options_of(inclusive, kernel, threads, memory_limit)
    found = scene.in_ranges(scene.each(brick_tasks.coordination_of, scene.box, options))
    n_ranges, lengths = len(found), [math.nan] * len(found)
    if not math.isnan(scene.n_points):
        limits = [int(scene.n_points) * k // n_ranges for k in range(n_ranges + 1)]
        lengths = [high - low for low, high in pairwise(limits)]
    return da.concatenate(
        [
            da.from_delayed(groups[0][1], (length,), np.int64)
            for groups, length in zip(found, lengths, strict=True)
        ],
        allow_unknown_chunksizes=True,
    )


def count_pairs(
    points: Collection,
    cutoff: npt.ArrayLike,
    *,
    n: int | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    inclusive: bool = True,
    kernel: str | None = None,
    threads: int = 1,
    memory_limit: float | None = None,
) -> Collection:
    """Count all pairs within a cutoff, or several, always exactly.

    Parameters
    ----------
    points, n, box, periodic, inclusive, kernel, threads, memory_limit
        As in `pairs`.
    cutoff : float or array_like of float, shape (k,)
        One cutoff, or several in ascending order.

    Returns
    -------
    dask Array of int64, shape () or (k,)
        The number of pairs, or one for each of several cutoffs.

    Raises
    ------
    TypeError, ValueError, OverflowError
        As `pairs`.

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> points = da.from_array([[0.0], [1.0], [3.0]], chunks=2)
    >>> int(hd.count_pairs(points, 1.5, box=[4.0]).compute())
    2
    """
    cutoffs = as_cutoffs(cutoff)
    largest = float(np.max(cutoffs, initial=0.0)) if np.ndim(cutoffs) else float(cutoffs)
    scene = divided(points, largest, n, box, periodic, kernel=kernel)
    options = options_of(inclusive, kernel, threads, memory_limit)
    counts = scene.each(brick_tasks.counts_of, cutoffs, scene.box, options)
    total = dask.delayed(brick_tasks.total, pure=True)(*counts)
    return da.from_delayed(total, np.shape(cutoffs), np.int64)


def pair_histogram(
    points: Collection,
    edges: npt.ArrayLike,
    *,
    n: int | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    kernel: str | None = None,
    threads: int = 1,
    memory_limit: float | None = None,
) -> Collection:
    """Count all pairs by distance, always exactly.

    Parameters
    ----------
    points, n, box, periodic, kernel, threads, memory_limit
        As in `pairs`.
    edges : array_like of float, shape (bins + 1,)
        Limits of the bins, as in `halfshell.pair_histogram`.

    Returns
    -------
    dask Array of int64, shape (bins,)
        As `halfshell.pair_histogram` returns it.

    Raises
    ------
    TypeError, ValueError, OverflowError
        As `pairs`.

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> points = da.from_array([[0.0], [1.0], [3.0]], chunks=2)
    >>> hd.pair_histogram(points, [0.0, 1.5, 2.0], box=[4.0]).compute().tolist()
    [2, 2]
    """
    limits = as_edges(edges)
    scene = divided(points, float(limits[-1]), n, box, periodic, kernel=kernel)
    options = options_of(True, kernel, threads, memory_limit)
    del options["inclusive"]
    counts = scene.each(brick_tasks.histogram_of, limits, scene.box, options)
    total = dask.delayed(brick_tasks.total, pure=True)(*counts)
    return da.from_delayed(total, (len(limits) - 1,), np.int64)
