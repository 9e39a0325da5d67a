# SPDX-License-Identifier: BSD-3-Clause
"""Points at one place, or in one cell."""

from __future__ import annotations

import numpy as np

from halfshell.scenes._catalogue import add
from halfshell.scenes._make import CUBE, cube, stream
from halfshell.scenes._scene import Scene, Size, pick


@add({"coincident": ("all points at one place",)})
def coincident(size: Size) -> Scene:
    """Bounds of no extent, one cell, every pair at distance 0: the output is quadratic."""
    return Scene(np.tile([0.1, 0.2, 0.3], (pick(size, 60, 1000, 4000), 1)), 1.0)


@add({"twice": ("every point twice",)})
def twice(size: Size) -> Scene:
    """Coincident pairs among others: distance 0 is a pair, a point with itself is none."""
    points, edge = cube(size, 33)
    half = points[: len(points) // 2]
    return Scene(np.concatenate([half, half]), 5.0, np.full(3, edge), CUBE)


@add({"stacked": ("fifty points on each of a few places",)})
def stacked(size: Size) -> Scene:
    """Crowded cells among empty ones: no cell size parts points at one place."""
    points, edge = cube(size, 34)
    places = points[: len(points) // 50]
    return Scene(np.tile(places, (50, 1)), 1.0, np.full(3, edge), CUBE)


@add({"one-cell": ("all points within one cutoff",)})
def one_cell(size: Size) -> Scene:
    """A grid that has nothing to select: every pair is a pair, and cells only cost."""
    return Scene(stream(35)((pick(size, 100, 1000, 4000), 3)), 2.0)


@add({"few-cells": ("cutoff half the extent of the points",)})
def few_cells(size: Size) -> Scene:
    """A grid that selects hardly anything: a third of all pairs are pairs."""
    return Scene(stream(36)((pick(size, 100, 1000, 6000), 3)) * 10.0, 5.0)
