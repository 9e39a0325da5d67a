# SPDX-License-Identifier: BSD-3-Clause
"""Balls of different sizes, and needles a million times as long as thick, turned every way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from halfshell_report.scenes._catalogue import Floats, Rule, Scene, Size, add, pick
from halfshell_report.scenes._make import (
    CUBE,
    FCC,
    directions,
    exponential,
    integers,
    sites,
    stream,
)


@add(
    {"balls-decades": ("balls of six decades of size, each touching a larger one",)},
    kind="radii",
)
def decades(size: Size) -> Scene:
    """Sizes from 1 to 1e-6 in one scene, and nearly as many contacts at exactly the sum as balls.

    Each ball but the first sits on a larger one, where rounding put it: just outside, just inside
    or on it. One grid for all, as wide as the largest reach, has all small ones in few cells.
    """
    n, draw = pick(size, 60, 4000, 100_000), stream(61)
    radii = exponential(-13.815510557964274 * np.arange(n) / n)  # 1 down to 1e-6
    radii = radii * pick(size, 0.2, 0.08, 0.03)
    points = draw((1, 3))
    while len(points) < n:  # twice as many each time: those that come sit on those that are there
        first = len(points)
        end = min(2 * first, n)
        on = integers(draw, 0, first - 1, (end - first,))
        reach = radii[on] + radii[first:end]
        points = np.concatenate(
            [points, points[on] + directions(draw, end - first) * reach[:, None]]
        )
    order = np.argsort(draw((n,)), kind="stable")
    return Scene(
        points[order], None, np.ones(3), CUBE, radii=np.ascontiguousarray(radii[order]), rule="sum"
    )


@add(
    {
        "balls-ties": ("whole radii at whole places: sums that are distances", True),
        "balls-ties-strict": ("the same, balls that only touch left out", False),
    },
    kind="radii",
)
def ties(size: Size, inclusive: bool) -> Scene:
    """Many of the pairs touch in exactly one point: 1 + 2 = 3 = |(1, 2, 2)|, 2 + 3 = |(0, 3, 4)|.

    Each is a tie between a sum and a square root, in numbers that binary holds.
    """
    edge = pick(size, 12, 40, 110)
    draw, n = stream(62), pick(size, 120, 4000, 80_000)
    points = integers(draw, 0, edge - 1, (n, 3)).astype(np.float64)
    radii = integers(draw, 0, 3, (n,)).astype(np.float64)
    return Scene(points, None, np.full(3, float(edge)), CUBE, inclusive, radii=radii, rule="sum")


@add(
    {"balls-rounded": ("pairs of balls at the distance that rounding makes of their sum",)},
    kind="radii",
)
def rounded(size: Size) -> Scene:
    """Sums that float64 cannot hold, and points as far apart as their rounded values.

    About half of the pairs really touch. Radii added in float64 say that all of them do.
    """
    n, draw = pick(size, 75, 2000, 50_000), stream(63)
    radii = draw((2, n)) * np.array([[1.0], [0.37]]) + 2.0**-20
    points = np.zeros((2, n, 3))
    points[:, :, 1] = 4.0 * (np.arange(n) % 64)
    points[:, :, 2] = 4.0 * (np.arange(n) // 64)
    points[1, :, 0] = radii[0] + radii[1]
    return Scene(points.reshape(-1, 3), None, radii=radii.reshape(-1), rule="sum")


@add({"balls-giant": ("one ball that holds a quarter of the box, among dwarfs",)}, kind="radii")
def giant(size: Size) -> Scene:
    """One large radius: with cells as wide as the largest reach, all pairs are tested.

    The giant has as many contacts as it holds dwarfs, the others a handful each.
    """
    n, draw = pick(size, 80, 4000, 100_000), stream(64)
    edge = pick(size, 4.0, 16.0, 46.0)
    radii = np.full(n, 0.6)
    radii[n // 3] = 0.39 * edge
    return Scene(draw((n, 3)) * edge, None, np.full(3, edge), CUBE, radii=radii, rule="sum")


@add({"balls-equal": ("fcc crystal of equal balls that reach the eighth shell",)}, kind="radii")
def equal(size: Size) -> Scene:
    """All sizes are equal: the answer of a single cutoff, down to the ties, and no slower."""
    repeats = (pick(size, 3, 8, 20),) * 3
    points, rows = sites(4 * np.eye(3, dtype=np.int64), FCC, repeats)
    return Scene(
        points.astype(np.float64), None, np.diag(rows).astype(np.float64), CUBE,
        radii=np.full(len(points), 4.0), rule="sum",
    )  # fmt: skip


@add({"balls-zero": ("points of radius 0 on, in and outside balls",)}, kind="radii")
def zero(size: Size) -> Scene:
    """A radius of 0 belongs to no octave; such points meet balls, and each other at distance 0.

    Half of the points have no extent; some of them are at one place, some exactly on a sphere.
    """
    n, draw = pick(size, 40, 1500, 40_000), stream(65)
    edge = pick(size, 16.0, 40.0, 120.0)
    centres = np.floor(draw((n, 3)) * edge)
    radii = integers(draw, 1, 3, (n,)).astype(np.float64)
    corners = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [2.0, 2.0, 1.0], [0.0, 0.0, 0.0]])
    lone = centres + corners[integers(draw, 0, 3, (n,))] * _steps(radii)
    points = np.concatenate([centres, lone])
    return Scene(
        points, None, np.full(3, edge), CUBE,
        radii=np.concatenate([radii, np.zeros(n)]), rule="sum",
    )  # fmt: skip


def _steps(radii: Floats) -> Floats:
    """What corners are multiplied by: (2, 2, 1) is on a sphere of radius 3, the axes on others."""
    return np.where(radii == 3.0, 1.0, radii)[:, None]


_NORM = 105  # of the quaternions: 1536 of them are whole and have it, none along an axis
_ASPECT = 1_000_000
_LENGTH = 15 * _ASPECT  # along a needle, in units of _NORM: its fifths and thirds are whole too

# Directions in the frame of a needle, over their last number; on its surface all are ties.
_DIRECTIONS = np.array([
    (1, 0, 0, 1), (-1, 0, 0, 1), (3, 4, 0, 5), (-3, 0, 4, 5), (2, 2, 1, 3), (-2, 1, -2, 3),
    (0, 3, -4, 5), (1, 0, 0, 1),
])  # fmt: skip


@add(
    {
        "needles": ("needles a million times as long as thick, each with one on its surface",
                    True, "max"),
        "needles-strict": ("the same, both of which must reach, surfaces left out", False, "min"),
    },
    kind="supports",
)  # fmt: skip
def needles(size: Size, inclusive: bool, rule: Rule) -> Scene:
    """An aspect of 1e6 turned every way, and a point on the surface of each ellipsoid.

    Turns, lengths and places are whole numbers, so that the points are exactly on the surfaces;
    in two thirds of the supports one entry is off by one unit in the last place. H @ D in float64
    is a sum of numbers up to a million times as large as it, and wrong as often as not.
    The ball around a needle holds 1e12 times what it does: almost no candidate is a pair.
    """
    half, draw = pick(size, 60, 800, 30_000), stream(66)
    rotations = _rotations()
    chosen = integers(draw, 0, len(rotations) - 1, (half,))
    turned = rotations[chosen]  # (half, 3, 3): rows are the axes of the needle, of length _NORM
    other = np.where(draw((half,)) < 0.5, chosen, integers(draw, 0, len(rotations) - 1, (half,)))
    supports = np.concatenate([_support(turned), _support(rotations[other])])
    supports = _hair_off(supports, integers(draw, 0, 8, (2 * half,)))
    # So many needles that the ball around one of them has some ten others, or in "small" three.
    edge = 2**31 * pick(size, 4, 6, 20)
    points = integers(draw, 0, edge - 1, (half, 3))
    direction = _DIRECTIONS[integers(draw, 0, len(_DIRECTIONS) - 1, (half,))]
    steps = direction[:, :3] * (_LENGTH // direction[:, 3:])
    steps[:, 1:] //= _ASPECT
    away = sum(steps[:, [k]] * turned[:, k] for k in range(3))
    partners = (points + away) % edge
    return Scene(
        np.concatenate([points, partners]) * 2.0**-31, None, np.full(3, edge * 2.0**-31), CUBE,
        inclusive, rule=rule, supports=supports, extent=_NORM**3 * _LENGTH * 2.0**-44,
    )  # fmt: skip


def _rotations() -> NDArray[np.int64]:
    """Turns of whole quaternions of one norm, times this norm: whole numbers, shape (t, 3, 3)."""
    numbers = np.arange(-10, 11)
    w, x, y, z = (column.ravel() for column in np.meshgrid(*(numbers,) * 4, indexing="ij"))
    kept = w * w + x * x + y * y + z * z == _NORM
    w, x, y, z = w[kept], x[kept], y[kept], z[kept]
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.array(rows).transpose(2, 0, 1)


def _support(turned: NDArray[np.int64]) -> Floats:
    """Needles along the first of these axes; whole numbers below 2**53, scaled."""
    long, thick = turned[:, 0], turned[:, 1:]
    whole = long[:, :, None] * long[:, None, :]
    for k in range(2):
        whole = whole + _ASPECT * thick[:, k, :, None] * thick[:, k, None, :]
    return np.asarray(whole, dtype=np.float64) * 2.0**-13


def _hair_off(supports: Floats, which: NDArray[np.int64]) -> Floats:
    """Move an entry, and its mirror image, to the next number away from 0, or towards it.

    which: 0 to 5 choose the entry, above them nothing is moved; odd ones move away from 0.
    """
    rows, columns = np.triu_indices(3)
    moved = np.flatnonzero(which < len(rows))
    a, b = rows[which[moved]], columns[which[moved]]
    entries: Floats = supports[moved, a, b]
    outwards = np.where(entries > 0.0, np.inf, -np.inf)
    supports[moved, a, b] = np.nextafter(entries, np.where(which[moved] % 2 == 1, outwards, 0.0))
    supports[moved, b, a] = supports[moved, a, b]
    return supports
