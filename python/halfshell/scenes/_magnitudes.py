# SPDX-License-Identifier: BSD-3-Clause
"""Very small and very large numbers."""

from __future__ import annotations

import numpy as np

from halfshell.scenes._catalogue import add
from halfshell.scenes._make import CUBE, cube, integers, stream
from halfshell.scenes._scene import Scene, Size, pick


@add(
    {
        "tiny-1e-300": ("uniform points, unit of length 1e-300", 1e-300),
        "tiny-1e-150": ("uniform points, unit of length 1e-150", 1e-150),
        "huge-1e150": ("uniform points, unit of length 1e150", 1e150),
        "huge-1e300": ("uniform points, unit of length 1e300", 1e300),
    }
)
def scaled(size: Size, unit: float) -> Scene:
    """Squares that overflow or vanish in float64, and coordinates that do so in float32."""
    points, edge = cube(size, 37)
    return Scene(points * unit, 5.0 * unit, np.full(3, edge * unit), CUBE)


@add({"subnormal": ("coordinates that are small multiples of 2**-1074",)})
def subnormal(size: Size) -> Scene:
    """The smallest numbers there are: flushing them to zero puts all points at one place.

    Coordinates are whole multiples of the smallest number, so many pairs are at the cutoff.
    """
    edge, unit = pick(size, 160, 480, 1600), 2.0**-1074
    points = integers(stream(38), 0, edge - 1, (pick(size, 100, 2700, 100_000), 3))
    return Scene(points * unit, 80 * unit, np.full(3, edge * unit), CUBE)


@add({"mixed-scales": ("axes of 1e-12, 1 and 1e12",)})
def mixed_scales(size: Size) -> Scene:
    """Components of very different sizes: the small one decides nothing, until it decides a tie.

    Along the middle axis neighbours are whole steps apart; along the first they differ by 1e-12,
    which moves pairs at the cutoff out by less than rounding shows.
    """
    n, draw = pick(size, 100, 4000, 100_000), stream(39)
    points = np.stack(
        [1e-12 * integers(draw, 0, 3, (n,)), 1.0 * (np.arange(n) % 50),
         1e12 * (np.arange(n) // 50)], axis=1,
    )  # fmt: skip
    return Scene(points, 5.0)
