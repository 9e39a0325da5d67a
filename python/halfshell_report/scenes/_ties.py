# SPDX-License-Identifier: BSD-3-Clause
"""Pairs at the cutoff, or so near to it that rounding hides on which side."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from halfshell_report.scenes._catalogue import add
from halfshell_report.scenes._make import CUBE, Draw, integers, sites, stream, wrapped
from halfshell_report.scenes._scene import Scene, Size, pick

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
