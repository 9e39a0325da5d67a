# SPDX-License-Identifier: BSD-3-Clause
"""Supports that are needles: a million times as long as thick, turned every way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from halfshell_report.scenes._catalogue import add
from halfshell_report.scenes._make import CUBE, integers, stream
from halfshell_report.scenes._scene import Floats, Rule, Scene, Size, pick

__all__: list[str] = []

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
