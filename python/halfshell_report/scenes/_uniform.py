# SPDX-License-Identifier: BSD-3-Clause
"""Uniform points: the scene that is not hard, orders of it, and other dimensions."""

from __future__ import annotations

import math

import numpy as np

from halfshell_report.scenes._catalogue import add
from halfshell_report.scenes._make import CUBE, cell_order, cube, stream
from halfshell_report.scenes._scene import Scene, Size, pick


@add({"uniform": ("points uniform in a periodic cube",)})
def uniform(size: Size) -> Scene:
    """Nothing: the reference with which the others are compared. About 52 neighbours a point."""
    points, edge = cube(size, 1)
    return Scene(points, 5.0, np.full(3, edge), CUBE)


@add(
    {
        "order-random": ("uniform points in random order", "random"),
        "order-sorted": ("the same points along the rows of a grid", "sorted"),
        "order-reversed": ("the same points along the rows of a grid, backwards", "reversed"),
        "order-dealt": ("the same points, each far from the one before", "dealt"),
    }
)
def order(size: Size, kind: str) -> Scene:
    """Where points lie in memory: each one that is read brings a line of the cache with it.

    The answer is the same but for the numbers; the time should nearly be.
    """
    points, edge = cube(size, 40, quick=4, full=20)
    box = np.full(3, edge)
    if kind == "random":
        return Scene(points, 2.5, box, CUBE)
    n = len(points)
    along = cell_order(points, 2.5)
    # About the golden ratio, without a common factor: no two of n steps end at one place.
    step = next(k for k in range(int(0.618 * n), n) if math.gcd(k, n) == 1)
    orders = {"sorted": along, "reversed": along[::-1], "dealt": along[np.arange(n) * step % n]}
    return Scene(points[orders[kind]], 2.5, box, CUBE)


@add({"line-1d": ("uniform points on a periodic line",)})
def line(size: Size) -> Scene:
    """One dimension: little work a point, so that everything else shows."""
    n = pick(size, 100, 4000, 100_000)
    return Scene(stream(41)((n, 1)) * n, 10.0, np.array([float(n)]), (True,))


@add({"line-1d-ties": ("tenths on a line, cutoff 1",)})
def line_ties(size: Size) -> Scene:
    """Two neighbours of each point within rounding of the cutoff: 0.1 is rounded in binary."""
    n = pick(size, 100, 4000, 100_000)
    return Scene(np.arange(float(n)).reshape(n, 1) * 0.1, 1.0)


@add({"plane-2d": ("uniform points in a periodic oblique plane",)})
def plane(size: Size) -> Scene:
    """Two dimensions in an oblique box: cells in a plane, and no third axis to pay for."""
    n = pick(size, 100, 4000, 100_000)
    edge = float(np.sqrt(10.0 * n))
    u, v = stream(42)((n, 2)).T
    points = np.stack([edge * u + 0.4 * edge * v, edge * v], axis=1)
    return Scene(points, 8.0, edge * np.array([[1.0, 0.0], [0.4, 1.0]]), (True, True))


@add({"space-5d": ("uniform points in a periodic box of five dimensions",)})
def five(size: Size) -> Scene:
    """Five dimensions: 243 neighbouring cells, and a ball that fills little of them."""
    n, edge = pick(size, (60, 2.0), (2000, 3.5), (100_000, 7.65))
    return Scene(stream(43)((n, 5)) * edge, 1.0, np.full(5, edge), (True,) * 5)


@add({"space-8d": ("uniform points in open space of eight dimensions",)})
def eight(size: Size) -> Scene:
    """Eight dimensions, the most there are: cells hardly help, and their number explodes."""
    n, edge = pick(size, (100, 1.7), (2000, 2.5), (10_000, 3.0))
    return Scene(stream(44)((n, 8)) * edge, 1.0)
