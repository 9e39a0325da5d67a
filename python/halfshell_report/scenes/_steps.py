# SPDX-License-Identifier: BSD-3-Clause
"""Stiff time steps: scenes that move so fast that a list of pairs is needed to its last step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from halfshell_report.scenes._catalogue import add
from halfshell_report.scenes._make import CUBE, Draw, normal, sites, stream
from halfshell_report.scenes._scene import Floats, Motion, Scene, Size, pick

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
