# SPDX-License-Identifier: BSD-3-Clause
"""What is done with bricks wherever they are searched: gather, divide, search, merge.

Plain functions of arrays, which can be pickled. What a brick finds is a tuple of groups; a group
is a tuple of arrays of one length, of which the first holds numbers of points, ascending.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import as_real_array
from halfshell._functions.bricks import bricks
from halfshell._objects.brick import Brick, Bricks
from halfshell._objects.neighbor_table import NeighborTable

Array = npt.NDArray[Any]
Numbers = npt.NDArray[np.int64]
Group = tuple[Array, ...]


class Part(NamedTuple):
    """A brick and the coordinates of its members."""

    brick: Brick
    points: Array


def of_columns(frame: Any, dtype: np.dtype[Any]) -> Array:
    """Coordinates in the columns of a table; nothing is rounded."""
    array = np.empty((len(frame), len(frame.columns)), dtype)
    for place, name in enumerate(frame.columns):
        array[:, place] = as_real_array(frame[name].to_numpy(), f"column {name!r} of points")
    return array


def gathered(chunks: Sequence[Any], ndim: int, dtype: np.dtype[Any]) -> Array:
    """All points in one array, if every chunk is what the whole was said to be."""
    arrays = [np.asanyarray(chunk) for chunk in chunks]
    for place, array in enumerate(arrays):
        if array.ndim != 2 or array.shape[1] != ndim:
            raise ValueError(
                f"points must have {ndim} columns in every chunk; chunk {place} has shape "
                f"{array.shape}"
            )
        if array.dtype != dtype:
            raise TypeError(
                f"points must be of {dtype} in every chunk, as the whole says; chunk {place} is of "
                f"{array.dtype}"
            )
    if any(isinstance(array, np.ma.MaskedArray) for array in arrays):
        join: Any = np.ma.concatenate
        return as_real_array(join(arrays), "points")  # which refuses what is masked
    return np.concatenate(arrays) if arrays else np.empty((0, ndim), dtype)


def divided(
    chunks: Sequence[Any], ndim: int, dtype: np.dtype[Any], cutoff: float, n: int, scene: Any
) -> list[Part]:
    """Bricks of all points, each with the coordinates of its members."""
    points = gathered(chunks, ndim, dtype)
    made = bricks(points, cutoff, n, **scene)
    return [Part(brick, points[brick.members]) for brick in made]


def bricks_of(parts: Sequence[Part]) -> Bricks:
    """The bricks alone."""
    return Bricks([part.brick for part in parts], parts[0].brick.n_points)


def pairs_of(part: Part, quantities: str, options: dict[str, Any]) -> tuple[Group, ...]:
    """One group: i, and a column for each letter."""
    found = part.brick.pairs(part.points, quantities="i" + quantities.replace("i", ""), **options)
    arrays = list(found) if isinstance(found, tuple) else [found]
    columns = dict(zip("i" + quantities.replace("i", ""), arrays, strict=True))
    return ((arrays[0], *(columns[letter] for letter in quantities)),)


def neighbors_of(part: Part, quantities: str, options: dict[str, Any]) -> tuple[Group, ...]:
    """Two groups: points and how many neighbours they have; point and columns of each neighbour."""
    table = part.brick.neighbors(part.points, quantities=quantities, **options)
    names = {"j": "indices", "d": "distances", "D": "vectors", "S": "shifts"}
    owned, counts = part.brick.owned, np.asarray(table.counts, np.int64)
    columns = [getattr(table, names[letter]) for letter in quantities]
    return (owned, counts), (np.repeat(owned, counts), *columns)


def coordination_of(part: Part, scene: Any, options: dict[str, Any]) -> tuple[Group, ...]:
    """One group: points, and how many neighbours they have."""
    import halfshell as hs

    of_all = hs.coordination(part.points, part.brick.cutoff, **scene, **options)
    return ((part.brick.owned, of_all[_owned(part)]),)


def counts_of(part: Part, cutoff: Any, scene: Any, options: dict[str, Any]) -> Any:
    """Twice the pairs of owned points, and once those with needed ones, which two bricks count."""
    import halfshell as hs

    owned = _owned(part)
    inner, outer = part.points[owned], part.points[~owned]
    own = hs.count_pairs(inner, cutoff, **scene, **options)
    return 2 * own + hs.count_pairs(outer, cutoff, queries=inner, **scene, **options)


def histogram_of(part: Part, edges: Any, scene: Any, options: dict[str, Any]) -> Any:
    """As `counts_of`, in each bin."""
    import halfshell as hs

    owned = _owned(part)
    inner, outer = part.points[owned], part.points[~owned]
    own = hs.pair_histogram(inner, edges, **scene, **options)
    return 2 * own + hs.pair_histogram(outer, edges, queries=inner, **scene, **options)


def half_sum(doubled: Sequence[Any]) -> Any:
    """Pairs of all bricks from what `counts_of` or `histogram_of` return, without a remainder."""
    return sum(doubled, start=np.int64(0)) // 2


def cut(groups: Sequence[Group], part: Part, n: int) -> list[list[Group]]:
    """What belongs to each of n ranges of points, of equal length but for one."""
    n_points = part.brick.n_points
    limits = np.array([n_points * k // n for k in range(n + 1)], np.int64)
    places = [np.searchsorted(group[0], limits) for group in groups]
    return [
        [
            tuple(array[place[k] : place[k + 1]] for array in group)
            for group, place in zip(groups, places, strict=True)
        ]
        for k in range(n)
    ]


def merged(cuts: Sequence[Sequence[Group]]) -> list[Group]:
    """One range of points from all bricks, ascending by point.

    All entries of a point are of one brick, and in order there.
    """
    whole = []
    for groups in zip(*cuts, strict=True):
        columns = [np.concatenate(column) for column in zip(*groups, strict=True)]
        order = np.argsort(columns[0], kind="stable")
        whole.append(tuple(column[order] for column in columns))
    return whole


def table_of(found: Sequence[Sequence[Group]], quantities: str, part: Part) -> NeighborTable:
    """The rows of all points, ascending, from what `neighbors_of` returns for each brick."""
    (_, counts), (_, *columns) = merged(found)
    offsets = np.concatenate((np.zeros(1, np.int64), np.cumsum(counts, dtype=np.int64)))
    return NeighborTable((offsets, *columns), quantities, part.brick.n_points, False)


def _owned(part: Part) -> npt.NDArray[np.bool_]:
    members = part.brick.members
    flags = np.zeros(len(members), bool)
    flags[np.searchsorted(members, part.brick.owned)] = True
    return flags
