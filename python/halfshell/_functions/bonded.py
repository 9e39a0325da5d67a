# SPDX-License-Identifier: BSD-3-Clause
"""`bonded`: pairs of points that few bonds connect, for `exclude`."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import as_array, as_point_numbers
from halfshell._convert.options import as_count, as_whole


def bonded(bonds: npt.ArrayLike, n: int, within: int = 3) -> npt.NDArray[np.int64]:
    """Find the pairs of points that are at most so many bonds apart.

    Parameters
    ----------
    bonds : array_like of int, shape (m, 2)
        Numbers of two points for each bond, in any order; bonds may repeat.
    n : int
        The number of points.
    within : int, default 3
        The largest number of bonds between the two: 1 for bonds alone, 2 with angles, 3 with
        dihedrals.

    Returns
    -------
    ndarray of int64, shape (k, 2)
        Pairs (i, j) with i < j, each once, ascending: what `exclude` takes.

    Raises
    ------
    TypeError, ValueError
        If `bonds` does not hold pairs of numbers of the points, or `within` is less than 1.

    Examples
    --------
    A chain of four points:

    >>> import halfshell as hs
    >>> hs.bonded([[0, 1], [1, 2], [2, 3]], 4, within=2).tolist()
    [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    """
    n_points, most = as_whole(n, "n"), as_count(within, "within")
    if n_points < 0:
        raise ValueError(f"n must be from 0 on, got {n_points}")
    array = as_array(bonds, "bonds", "be pairs of numbers, (m, 2)")
    if array.shape == (0,):
        array = np.empty((0, 2), np.int64)
    if array.ndim != 2 or array.shape[1] != 2:
        raise ValueError(f"bonds must have shape (m, 2), got {array.shape}")
    first = as_point_numbers(array[:, 0], "bonds[:, 0]", n_points, "points")
    second = as_point_numbers(array[:, 1], "bonds[:, 1]", n_points, "points")
    steps = _unique(np.concatenate([first, second]), np.concatenate([second, first]), n_points)
    begins = np.searchsorted(steps[0], np.arange(n_points + 1))
    found = last = steps
    for _ in range(most - 1):
        lengths = np.diff(begins)[last[1]]
        own = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        ends = steps[1][np.repeat(begins[last[1]], lengths) + own]
        further = _unique(np.repeat(last[0], lengths), ends, n_points)
        keys = further[0] * n_points + further[1]
        new = ~np.isin(keys, found[0] * n_points + found[1])
        last = further[0][new], further[1][new]
        if not len(last[0]):
            break
        found = _unique(
            np.concatenate([found[0], last[0]]), np.concatenate([found[1], last[1]]), n_points
        )
    half = found[0] < found[1]
    return np.stack([found[0][half], found[1][half]], axis=1)


def _unique(i: npt.NDArray[Any], j: npt.NDArray[Any], n: int) -> tuple[Any, Any]:
    """Each pair of two different points once, ascending."""
    apart = i != j
    keys = np.unique(i[apart] * n + j[apart])
    return keys // max(n, 1), keys % max(n, 1)
