# SPDX-License-Identifier: BSD-3-Clause
"""Stiff time steps, and points that come, go and move one at a time, where that is hard."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from halfshell_report.scenes._catalogue import Floats, Motion, Scene, Size, Updates, add, pick
from halfshell_report.scenes._make import CUBE, Draw, combine, integers, normal, sites, stream

# The minimum of the Lennard-Jones potential with diameter 1, the sixth root of 2: cut there,
# it only repels, and contact begins at the cutoff.
_CONTACT = 1.122462048309373


def _grid(size: Size, spacing: float) -> tuple[NDArray[np.int64], Floats, int]:
    """Return a cubic grid in integers, its box, and how many points it has along an edge."""
    across = pick(size, 5, 15, 46)
    cells, _ = sites(np.eye(3, dtype=np.int64), np.zeros((1, 3), np.int64), (across,) * 3)
    return cells, np.full(3, across * spacing), across


def _thermal(draw: Draw, n: int, speed: float) -> Floats:
    """Return nearly normal velocities."""
    return speed * normal(draw, n, 3)


@add({"head-on": ("two fast points head-on in a bath, one cutoff and one skin apart",)})
def head_on(size: Size) -> Scene:
    """A collision at the limit of the skin: the two points start a hair beyond cutoff + skin.

    Each moves skin / 2 in exactly ten steps, so that in the eleventh they touch. A list that is
    kept until a point has moved the whole skin lets them fly into each other before it finds
    the pair, and energy comes from nowhere.
    """
    spacing, dt, speed, steps = 1.3125, 2.0**-10, 15.0, 10
    skin = 2.0 * steps * speed * dt
    cells, box, across = _grid(size, spacing)
    middle = across // 2
    # A channel through the bath: one row of points is left out.
    bath = cells[~((cells[:, 1] == middle) & (cells[:, 2] == middle))] * spacing
    centre = np.full(3, middle * spacing)
    half = np.array([0.5 * (_CONTACT + skin + 2.0**-20), 0.0, 0.0])
    points = np.concatenate([np.stack([centre - half, centre + half]), bath])
    fast = np.array([[speed, 0.0, 0.0], [-speed, 0.0, 0.0]])
    velocities = np.concatenate([fast, _thermal(stream(45), len(bath), 0.5)])
    motion = Motion(velocities, 1.0, dt, 64, epsilon=1.0, sigma=1.0, skin=skin)
    return Scene(points, _CONTACT, box, CUBE, motion=motion)


@add({"stiff-chain": ("a chain of springs, one of them 10 000 times stiffer",)})
def stiff_chain(size: Size) -> Scene:
    """One stiff bond that sets the time step and moves its ends through the skin in a few steps.

    It starts compressed; as it springs apart its ends hit the next beads of the chain, which
    were beyond cutoff + skin. A list that is kept for a usual number of steps misses the hits,
    and energy drifts.
    """
    spacing, compressed = 1.15625, 0.1
    cells, box, across = _grid(size, spacing)
    # Back and forth through the grid, so that the next point is always a neighbour.
    y = np.where(cells[:, 0] % 2 == 1, across - 1 - cells[:, 1], cells[:, 1])
    z = np.where((across * cells[:, 0] + cells[:, 1]) % 2 == 1, across - 1 - cells[:, 2],
                 cells[:, 2])  # fmt: skip
    points = np.stack([cells[:, 0], y, z], axis=1) * spacing
    n = len(points)
    # The middle of the middle row: its neighbours along the chain are on one line with it.
    stiff = (across * across + across) * (across // 2) + across // 2
    step = points[stiff + 1] - points[stiff]
    points[stiff] += compressed / spacing * step
    points[stiff + 1] -= compressed / spacing * step
    stiffnesses = np.full(n - 1, 10.0)
    stiffnesses[stiff] *= 1e4
    motion = Motion(
        _thermal(stream(46), n, 0.25), 1.0, 2.0**-14, 512, epsilon=100.0, sigma=1.0, skin=2.0**-5,
        bonds=np.stack([np.arange(n - 1), np.arange(1, n)], axis=1),
        lengths=np.full(n - 1, spacing), stiffnesses=stiffnesses,
    )  # fmt: skip
    return Scene(points, _CONTACT, box, CUBE, motion=motion)


# All whole vectors of length 5 in the plane.
_VECTORS = np.array([v for v in np.ndindex(11, 11) if (v[0] - 5) ** 2 + (v[1] - 5) ** 2 == 25]) - 5


def _sizes(size: Size) -> tuple[int, int]:
    """Return the number of points, and of updates."""
    return pick(size, (100, 300), (2000, 6000), (50_000, 100_000))


def _history(draw: Draw, n: int, positions: Floats) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return keys in any order, some above those that are there, and which of them are removed."""
    m = len(positions)
    return integers(draw, 0, n + n // 8, (m,)), draw((m,)) < 0.125


@add(
    {
        "disks-touching": ("disks that are put side by side: touching, or off by 2**-40", False),
        "disks-touching-inclusive": ("the same, disks that touch overlap", True),
    },
    kind="updates",
)
def touching(size: Size, inclusive: bool) -> Scene:
    """Moves to exactly the diameter from another disk, give or take 2**-40, and across faces.

    Half of the disks stand on a grid, the others are put at their sides, by whole vectors of
    length 5, the diameter. Rounded decisions let some overlap and refuse others; positions a box
    away must count as the same place.
    """
    n, m = _sizes(size)
    draw, side = stream(71), int(np.ceil(np.sqrt(n / 2)))
    edge = 16.0 * side
    hosts = 16.0 * np.array(list(np.ndindex(side, side)), dtype=np.float64)[: n // 2]

    def beside(of: NDArray[np.int64]) -> Floats:
        vectors = _VECTORS[integers(draw, 0, len(_VECTORS) - 1, of.shape)]
        hair = integers(draw, -1, 1, (len(of), 2)) * 2.0**-40
        boxes = integers(draw, -1, 1, (len(of), 2)) * edge
        moved: Floats = hosts[of] + vectors + hair + boxes
        return moved

    points = np.concatenate([hosts, beside(np.arange(n - len(hosts)))])
    positions = beside(integers(draw, 0, len(hosts) - 1, (m,)))
    keys, removed = _history(draw, n, positions)
    updates = Updates(np.where(keys < len(hosts), keys + len(hosts), keys), positions, removed)
    return Scene(points, 5.0, np.full(2, edge), (True, True), inclusive, updates=updates)


@add(
    {"disks-outliers": ("points that go as far as 1e300, and come back",)},
    kind="updates",
)
def outliers(size: Size) -> Scene:
    """Half of the moves go far, by any power of two up to 2**996, half of these to another there.

    Cells that cover the extent do not fit any memory, and from 2**52 of them on neighbouring
    cells have one index. Differences of coordinates are larger than any box, and their squares
    overflow.
    """
    n, m = _sizes(size)
    draw, edge = stream(72), pick(size, 6.0, 16.0, 48.0)
    points, positions = draw((n, 3)) * edge, draw((m, 3)) * edge
    powers = integers(draw, 0, 996, (m, 1))
    far = np.where(draw((m, 1)) < 0.5, np.ldexp(2.0 * draw((m, 3)) - 1.0, powers), positions)
    beside = draw((m - 1,)) < 0.5  # of the position before: equal to it where that is far enough
    far[1:][beside] = far[:-1][beside] + 0.5 * draw((m - 1, 3))[beside]
    keys, removed = _history(draw, n, far)
    return Scene(points, 1.0, updates=Updates(keys, far, removed))


@add(
    {"disks-crowd": ("half of the points in one cell of a skewed box, coming and going",)},
    kind="updates",
)
def crowd(size: Size) -> Scene:
    """A cell that holds most points: what takes time in proportion to the crowd shows.

    The radius is so small that few of the crowd are within it. Coordinates are up to two boxes
    away, and the crowd lies across the corner of the box, in eight of its images.
    """
    n, m = _sizes(size)
    draw = stream(73)
    edge = pick(size, 4.0, 12.0, 36.0)
    rows = edge * np.array([[1.0, 0.0, 0.0], [0.375, 1.0, 0.0], [-0.25, 0.5, 1.0]])

    def places(count: int) -> Floats:
        inside = draw((count, 3))
        crowded = (draw((count, 3)) - 0.5) * (0.5 / edge)
        fractions = np.where(draw((count, 1)) < 0.5, crowded, inside)
        return combine(fractions + integers(draw, -1, 1, (count, 3)), rows)

    points, positions = places(n), places(m)
    keys, removed = _history(draw, n, positions)
    updates = Updates(keys, positions, removed)
    return Scene(points, pick(size, 0.25, 0.125, 0.03125), rows, CUBE, updates=updates)
