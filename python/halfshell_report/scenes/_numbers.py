# SPDX-License-Identifier: BSD-3-Clause
"""Pairs at the cutoff or a hair off it; coordinates far away, on faces, very small, very large."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from halfshell_report.scenes._catalogue import Floats, Scene, Size, add, pick
from halfshell_report.scenes._make import (
    CUBE,
    FCC,
    Draw,
    combine,
    cube,
    integers,
    sites,
    stream,
    wrapped,
)

# All integer vectors of length 3.
_VECTORS = np.array([v for v in itertools.product(range(-3, 4), repeat=3) if np.dot(v, v) == 9])


@add(
    {
        "near-ties": ("pairs within a few float64 units of the cutoff, or on it", True),
        "near-ties-strict": ("the same, a pair at exactly the cutoff left out", False),
    }
)
def near_ties(size: Size, inclusive: bool) -> Scene:
    """Half of the points have a partner at the cutoff, give or take two units of a coordinate.

    Some are at exactly the cutoff, some inside or outside by less than float64 arithmetic can
    tell, many of them across a face. Only the later stages of an exact decision know.
    """
    draw, edge = stream(2), pick(size, 16.0, 64.0, 128.0)
    # Multiples of the spacing of float64 below the edge: sums of them are exact.
    points = draw((pick(size, 50, 2000, 50_000), 3)) * edge
    hair = integers(draw, -2, 2, points.shape) * (edge * 2.0**-53)
    partners = points + (_some(draw, _VECTORS, len(points)) + hair)
    return Scene(
        np.concatenate([points, wrapped(partners, edge)]),
        3.0,
        np.full(3, edge),
        CUBE,
        inclusive,
    )


@add({"hair-ties": ("whole numbers in a plane, off it by a few 1e-300",)})
def hair(size: Size) -> Scene:
    """Ties that are broken by one part in 1e600: the squares differ in their 2000th bit.

    No floating-point arithmetic of a fixed number of words can tell; whole numbers can.
    """
    across, draw = pick(size, 10, 64, 316), stream(47)
    grid = np.stack(np.meshgrid(*[np.arange(across)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    height = 1e-300 * integers(draw, 0, 3, (len(grid), 1))
    return Scene(np.concatenate([grid.astype(np.float64), height], axis=1), 5.0)


@add({"float32-ulp": ("float32 points, pairs within a fraction of a float32 unit of the cutoff",)})
def float32(size: Size) -> Scene:
    """Differences from the cutoff that no float32 distance can show.

    Partners are 3 apart along one axis and off by a few units of float32 along the others, which
    makes them farther than 3 by 2e-10 or less. The cutoff lies among these distances.
    """
    draw, edge = stream(3), pick(size, 16.0, 64.0, 128.0)
    unit = edge * 2.0**-24
    shape = (pick(size, 50, 2000, 50_000), 3)
    points = integers(draw, 0, 2**24 - 1, shape)
    along = _some(draw, _VECTORS[np.abs(_VECTORS).max(axis=1) == 3], len(points))
    hair = np.where(along == 0, integers(draw, -3, 3, shape), 0)
    partners = (points + along * int(1.0 / unit) + hair) % 2**24
    return Scene(
        (np.concatenate([points, partners]) * unit).astype(np.float32),
        math.sqrt(9.0 + 8.0 * unit * unit),
        np.full(3, edge),
        CUBE,
    )


@add({"half-box": ("cubic crystal, cutoff exactly half the box",)})
def half_box(size: Size) -> Scene:
    """Pairs that are equally near on both sides, each image at exactly the cutoff.

    The rule of the nearest image alone does not say which of the two is meant, and counts one.
    """
    repeats = pick(size, 4, 8, 16)
    points, rows = sites(np.eye(3, dtype=np.int64), np.zeros((1, 3), np.int64), (repeats,) * 3)
    return Scene(points.astype(np.float64), repeats / 2.0, np.diag(rows).astype(np.float64), CUBE)


def _some(draw: Draw, vectors: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Draw n of these vectors."""
    return vectors[integers(draw, 0, len(vectors) - 1, (n,))]


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
