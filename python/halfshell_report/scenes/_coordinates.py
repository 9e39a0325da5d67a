# SPDX-License-Identifier: BSD-3-Clause
"""Coordinates: far from the origin and the box, on its faces, very small and very large."""

from __future__ import annotations

import numpy as np

from halfshell_report.scenes._catalogue import add
from halfshell_report.scenes._make import CUBE, FCC, combine, cube, integers, sites, stream
from halfshell_report.scenes._scene import Floats, Scene, Size, pick


@add(
    {
        "offset-1e3": ("uniform points offset by 1e3", 1e3),
        "offset-1e6": ("uniform points offset by 1e6", 1e6),
        "offset-1e9": ("uniform points offset by 1e9", 1e9),
        "offset-1e12": ("uniform points offset by 1e12", 1e12),
        "offset-1e15": ("uniform points offset by 1e15", 1e15),
    }
)
def offset(size: Size, distance: float) -> Scene:
    """Coordinates far from the origin: most of their digits are spent on the offset.

    Software that bins or subtracts in float32 loses pairs. At 1e15 points lie on a grid of
    eighths, so that many pairs are at exactly the cutoff.
    """
    points, _ = cube(size, 4)
    return Scene(points + np.array([distance, -distance, distance]), 5.0)


_TILTED = np.array([[1.0, 0.0, 0.0], [0.37, 1.1, 0.0], [-0.29, 0.21, 0.95]])


@add(
    {
        "many-boxes": ("points up to a million boxes away from home", np.eye(3)),
        "many-boxes-tilted": ("the same in a triclinic box", _TILTED),
    }
)
def many_boxes(size: Size, shape: Floats) -> Scene:
    """Coordinates that were never wrapped, each in another copy of the box.

    Wrapping them in rounded arithmetic moves the points; shifts are in the millions.
    """
    points, edge = cube(size, 5)
    box = edge * shape
    far = integers(stream(6), -1_000_000, 1_000_000, points.shape)
    return Scene(combine(points / edge, box) + combine(far, box), 5.0, box, CUBE)


@add({"fcc-many-boxes": ("fcc crystal, sites up to a million boxes away, cutoff on a shell",)})
def crystal_far(size: Size) -> Scene:
    """Exact ties between points that are millions of boxes apart.

    Each needs its shift, and the vector without losing the last digit of either.
    """
    points, rows = sites(4 * np.eye(3, dtype=np.int64), FCC, (pick(size, 3, 10, 29),) * 3)
    far = integers(stream(48), -1_000_000, 1_000_000, points.shape)
    lengths = np.diag(rows)
    return Scene((points + far * lengths).astype(np.float64), 8.0, lengths.astype(np.float64), CUBE)


@add({"faces": ("points on the faces of the box, and a hair beside them",)})
def faces(size: Size) -> Scene:
    """Coordinates of 0, -0, the edge itself, minus the edge, and the smallest steps off them.

    A tiny negative number wraps to the edge when rounded, which is outside the last cell.
    """
    points, edge = cube(size, 7)
    special = np.array(
        [0.0, -0.0, edge, -edge, 2.0 * edge, np.nextafter(edge, 0.0), np.nextafter(edge, 2 * edge),
         -5e-324, 5e-324, -1e-17, 0.5 * edge]
    )  # fmt: skip
    rows = np.arange(len(points))
    points[rows, rows % 3] = special[integers(stream(8), 0, len(special) - 1, rows.shape)]
    return Scene(points, 5.0, np.full(3, edge), CUBE)


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
