# SPDX-License-Identifier: BSD-3-Clause
"""What is done with bricks wherever they are searched: gather, divide, search, merge.

Plain functions of arrays, which can be pickled. What a brick finds is a tuple of groups; a group
is a tuple of arrays of one length, of which the first holds numbers of points, ascending.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import as_real_array
from halfshell._convert.points import Points
from halfshell._functions.bricks import (
    Division,
    Part,
    Piece,
    Summary,
    renumbered,
    split,
    summary,
)
from halfshell._objects.brick import Brick, Bricks
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._settings import settings

Array = npt.NDArray[Any]
Group = tuple[Array, ...]
Known = dict[str, Any]  # what else is known of the points of a chunk


def of_columns(frame: Any, dtype: np.dtype[Any]) -> Array:
    """Coordinates in the columns of a table; nothing is rounded."""
    array = np.empty((len(frame), len(frame.columns)), dtype)
    for place, name in enumerate(frame.columns):
        array[:, place] = as_real_array(frame[name].to_numpy(), f"column {name!r} of points")
    return array


def of_chunk(chunk: Any, ndim: int, dtype: np.dtype[Any], place: int, known: Known) -> Points:
    """The points of a chunk, if it is what the whole was said to be."""
    array = np.asanyarray(chunk)
    if array.ndim != 2 or array.shape[1] != ndim:
        raise ValueError(
            f"points must have {ndim} columns in every chunk; chunk {place} has shape {array.shape}"
        )
    if array.dtype != dtype:
        raise TypeError(
            f"points must be of {dtype} in every chunk, as the whole says; chunk {place} is of "
            f"{array.dtype}"
        )
    return Points(array, **known) if known else Points._of(array)


def summary_of(
    chunk: Any, ndim: int, dtype: np.dtype[Any], place: int, known: Known, n_chunks: int
) -> Summary:
    """What a division must know of a chunk; what is wrong with its points is a part of it."""
    try:
        return summary(of_chunk(chunk, ndim, dtype, place, known), n_chunks)
    except (ValueError, OverflowError) as error:
        n_points = len(chunk) if np.ndim(chunk) else 0
        return Summary(n_points, 0.0, np.empty((0, ndim)), 1.0, error=error)


def pieces_of(
    chunk: Any, ndim: int, dtype: np.dtype[Any], place: int, known: Known, division: Division
) -> list[Piece]:
    return split(of_chunk(chunk, ndim, dtype, place, known), division, place)


def brick_of(part: Part) -> Brick:
    return part.in_order()[0]


def bricks_of(division: Division, *made: Brick) -> Bricks:
    return Bricks(made)


def pairs_of(part: Part, how: dict[str, Any], options: dict[str, Any]) -> tuple[Group, ...]:
    """One group: i, and a column for each letter."""
    quantities = options["quantities"]
    letters = "i" + quantities.replace("i", "")
    brick, points = part.in_order()
    with settings(**how), _numbered(brick.members):
        found = brick.pairs(points, **{**options, "quantities": letters})
    arrays = list(found) if isinstance(found, tuple) else [found]
    columns = dict(zip(letters, arrays, strict=True))
    return ((arrays[0], *(columns[letter] for letter in quantities)),)


def neighbors_of(part: Part, how: dict[str, Any], options: dict[str, Any]) -> tuple[Group, ...]:
    """Two groups: points and how many neighbours they have; point and columns of each neighbour."""
    brick, points = part.in_order()
    with settings(**how), _numbered(brick.members):
        table = brick.neighbors(points, **options)
    owned, counts = brick.owned, np.asarray(table.counts, np.int64)
    columns = [table._column(letter) for letter in options["quantities"]]
    return (owned, counts), (np.repeat(owned, counts), *columns)


def coordination_of(part: Part, how: dict[str, Any], options: dict[str, Any]) -> tuple[Group, ...]:
    """One group: points, and how many neighbours they have."""
    import halfshell as hs

    brick, points = part.in_order()
    options = {**options, "exclude": brick._excluded(options.get("exclude"))}
    with settings(**how), _numbered(brick.members):
        of_all = hs.coordination(points, brick.cutoff, rule=part.scope.rule, **options)
    return ((brick.owned, of_all[brick.is_owned]),)


def counts_of(part: Part, how: dict[str, Any], cutoff: Any, options: dict[str, Any]) -> Any:
    """Pairs of owned points, and of these with points of later bricks."""
    import halfshell as hs

    rule = part.scope.rule
    return _own(
        part, how, options,
        lambda points, **more: hs.count_pairs(points, cutoff, rule=rule, **more),
    )  # fmt: skip


def histogram_of(part: Part, how: dict[str, Any], edges: Any, options: dict[str, Any]) -> Any:
    import halfshell as hs

    return _own(part, how, options, lambda points, **more: hs.pair_histogram(points, edges, **more))


def total(*counts: Any) -> Any:
    return sum(counts, start=np.int64(0))


def cut(groups: Sequence[Group], division: Division, n: int) -> list[list[Group]]:
    """What belongs to each of n ranges of points, of equal length but for one."""
    n_points = division.scope.n_points
    limits = np.array([n_points * k // n for k in range(n + 1)], np.int64)
    places = [np.searchsorted(group[0], limits) for group in groups]
    return [
        [
            tuple(array[place[k] : place[k + 1]] for array in group)
            for group, place in zip(groups, places, strict=True)
        ]
        for k in range(n)
    ]


def merged(*cuts: Sequence[Group]) -> list[Group]:
    """One range of points from all bricks, ascending by point.

    All entries of a point are of one brick, and in order there.
    """
    whole = []
    for groups in zip(*cuts, strict=True):
        columns = [np.concatenate(column) for column in zip(*groups, strict=True)]
        order = np.argsort(columns[0], kind="stable")
        whole.append(tuple(column[order] for column in columns))
    return whole


def table_of(
    quantities: str, is_full: bool, division: Division, *found: Sequence[Group]
) -> NeighborTable:
    """The rows of all points, ascending, from what `neighbors_of` returns for each brick."""
    (_, counts), (_, *columns) = merged(*found)
    offsets = np.concatenate((np.zeros(1, np.int64), np.cumsum(counts, dtype=np.int64)))
    return NeighborTable((offsets, *columns), quantities, division.scope.n_points, is_full)


def _own(
    part: Part, how: dict[str, Any], options: dict[str, Any], count: Callable[..., Any]
) -> Any:
    """Counts of pairs of two owned points, and of an owned point and one of a later brick.

    This is the count among all of these points less that among the later ones. If the later ones
    are many, both kinds of pairs are counted by a search each; but not with excluded pairs, whose
    image depends on the order of the points.
    """
    n_owned, n_later, _ = part.sizes
    both, later = slice(n_owned + n_later), slice(n_owned, n_owned + n_later)
    with settings(**how):
        if options.get("exclude") is not None:
            numbers = part.numbers()[both]
            order = np.argsort(numbers)
            found = []
            for rows in (order, order[order >= n_owned]):
                named = Brick(numbers[rows], np.ones(len(rows), bool), part.scope)
                exclude = named._excluded(options["exclude"])
                with _numbered(named.members):
                    found.append(count(part.points(rows), **{**options, "exclude": exclude}))
            return found[0] - found[1]
        if n_later <= n_owned:
            with _numbered(part.numbers):
                return count(part.points(both), **options) - count(part.points(later), **options)
        own = part.points(slice(n_owned))
        with _numbered(part.numbers):
            inner = count(own, **options)
        with _numbered(lambda: part.numbers()[n_owned:], part.numbers):
            return inner + count(part.points(later), queries=own, **options)


@contextmanager
def _numbered(
    points: Array | Callable[[], Array], queries: Callable[[], Array] | None = None
) -> Iterator[None]:
    """Errors name points by their numbers among all points."""
    try:
        yield
    except (ValueError, OverflowError) as error:
        numbers = points() if callable(points) else points
        raise renumbered(error, numbers, None if queries is None else queries()) from None
