# SPDX-License-Identifier: BSD-3-Clause
"""What each piece of divided points gives to every brick, and bricks of what all pieces give."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell._functions.brick_places import Axes, within
from halfshell._functions.brick_plan import Cut, Division
from halfshell._objects.brick import Brick

Array = npt.NDArray[Any]
Bits = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.int64]

_TILE = 1 << 16  # points whose places along the axes stay in a cache


class Piece:
    """What one piece of the points gives to one brick.

    Until it is sent it holds the whole piece, of which nothing is copied.
    """

    def __init__(
        self, first: int, places: tuple[Array, ...], points: Array, is_whole: bool = True
    ) -> None:
        self.first = first  # number of the first point of the piece
        # Where points are in the piece, ascending: those that the brick owns, and those it needs,
        # which later bricks own, or earlier ones.
        self.places = places
        self.points = points  # all of the piece, or those at these places
        self.is_whole = is_whole

    def __reduce__(self) -> tuple[Any, ...]:
        points = self.points
        if self.is_whole:
            points = points.take(np.concatenate(self.places), axis=0)
        return Piece, (self.first, self.places, points, False)

    def __sizeof__(self) -> int:
        row: int = self.points.itemsize * self.points.shape[1] + self.places[0].itemsize
        return row * sum(map(len, self.places))

    def put(self, which: int, target: Array) -> None:
        """The coordinates at places of one kind."""
        if self.is_whole:
            places = self.places[which]
            self.points.take(places, axis=0, out=target, mode="clip")  # without a buffer
        else:
            first = sum(map(len, self.places[:which]))
            target[:] = self.points[first : first + len(target)]


class Part(NamedTuple):
    """A brick with coordinates: owned points, then needed ones of later bricks, then of earlier."""

    points: Array
    sizes: tuple[int, ...]
    places: list[tuple[int, tuple[Array, ...]]]  # `first` and `places` of each piece
    division: tuple[int, float, tuple[Any, tuple[bool, ...]]]  # points, cutoff, box and periodicity

    def numbers(self) -> Numbers:
        """Numbers of the points among all of them."""
        return np.concatenate(
            [first + places[k].astype(np.int64) for k in range(3) for first, places in self.places]
        )

    def in_order(self) -> tuple[Brick, Array]:
        """The brick, and the coordinates of its members."""
        members = self.numbers()
        order = np.argsort(members)
        brick = Brick(members.take(order), order < self.sizes[0], *self.division)
        return brick, self.points.take(order, axis=0)


def split(points: Array, division: Division, place: int) -> list[Piece]:
    """What a piece gives to each brick: points of its region, and those within reach of it."""
    points = np.ascontiguousarray(points)
    kind = np.int32 if len(points) <= 1 << 31 else np.int64
    found: list[tuple[list[Array], ...]] = [([], [], []) for _ in range(division.n_bricks)]
    for first in range(0, max(1, len(points)), _TILE):
        places = division.axes.places(points[first : first + _TILE])
        every = np.arange(places.shape[1])
        owners = np.zeros(len(every), np.int64)
        needed = []
        for brick, (numbers, is_owned) in enumerate(
            _leaves(division.cuts, places, division.axes, every, np.ones(len(every), bool))
        ):
            owned = numbers.take(np.flatnonzero(is_owned))
            owners[owned] = brick
            found[brick][0].append((owned + first).astype(kind))
            needed.append(numbers.take(np.flatnonzero(~is_owned)))
        for brick, numbers in enumerate(needed):
            is_later = owners.take(numbers) > brick
            found[brick][1].append((numbers[is_later] + first).astype(kind))
            found[brick][2].append((numbers[~is_later] + first).astype(kind))
    return [
        Piece(division.firsts[place], tuple(map(np.concatenate, kinds)), points) for kinds in found
    ]


def _leaves(
    cut: Cut | int, places: Array, axes: Axes, numbers: Any, is_inside: Bits
) -> Iterator[tuple[Any, Bits]]:
    """Of each brick, points within reach of its region, and which of them are inside."""
    if isinstance(cut, int):
        yield numbers, is_inside
        return
    own = places[cut.axis].take(numbers)
    reach, repeats = axes.reach[cut.axis], axes.repeats[cut.axis]
    is_below = own < cut.at
    for part, low, high, is_mine in (
        (cut.below, cut.low, cut.at, is_below), (cut.above, cut.at, cut.high, ~is_below),
    ):  # fmt: skip
        near = np.flatnonzero(within(own, low - reach, high + reach, repeats))
        mine = (is_mine & is_inside).take(near)
        yield from _leaves(part, places, axes, numbers.take(near), mine)


def part_of(division: Division, *pieces: Piece) -> Part:
    """A brick of what all pieces give to it."""
    sizes = tuple(sum(len(piece.places[k]) for piece in pieces) for k in range(3))
    like = pieces[0].points
    points = np.empty((sum(sizes), like.shape[1]), like.dtype)
    end = 0
    for which in range(3):
        for piece in pieces:
            first, end = end, end + len(piece.places[which])
            piece.put(which, points[first:end])
    known = (division.n_points, division.cutoff, division.scene)
    return Part(points, sizes, [(piece.first, piece.places) for piece in pieces], known)
