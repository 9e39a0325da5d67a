# SPDX-License-Identifier: BSD-3-Clause
"""Points that come, go and move one at a time, where that is hard."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from halfshell_report.scenes._catalogue import add
from halfshell_report.scenes._make import CUBE, Draw, combine, integers, stream
from halfshell_report.scenes._scene import Floats, Scene, Size, Updates, pick

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
