# SPDX-License-Identifier: BSD-3-Clause
"""The same points in different orders."""

from __future__ import annotations

import math

import numpy as np

from halfshell.scenes._catalogue import add
from halfshell.scenes._make import CUBE, cell_order, cube
from halfshell.scenes._scene import Scene, Size


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
