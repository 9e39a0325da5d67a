# SPDX-License-Identifier: BSD-3-Clause
"""Numbers that are the same bits on every machine.

Only additions, multiplications, divisions and square roots of one number at a time are used,
in a fixed order: IEEE arithmetic rounds them in one way. Sums along an axis, matrix products
and functions such as `exp` are avoided, because their last bits depend on the processor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from halfshell_report.scenes._catalogue import Floats, Size, pick

__all__ = [
    "CUBE", "FCC", "ROTATION", "Draw", "cell_order", "combine", "cube", "directions",
    "exponential", "integers", "normal", "sites", "square", "stream", "wrapped",
]  # fmt: skip

Draw = Callable[[tuple[int, ...]], Floats]

CUBE = (True, True, True)

#: Sites of a face-centred cell in quarters of its edge.
FCC = np.array([[0, 0, 0], [0, 2, 2], [2, 0, 2], [2, 2, 0]])


def stream(seed: int) -> Draw:
    """Return a function that draws arrays uniform in [0, 1), multiples of 2**-53.

    It uses the raw numbers of PCG64, whose stream NumPy keeps; methods of ``Generator`` may
    change between versions.
    """
    bits = np.random.PCG64(seed)

    def draw(shape: tuple[int, ...]) -> Floats:
        raw = bits.random_raw(math.prod(shape)) >> np.uint64(11)
        numbers: Floats = raw.astype(np.float64).reshape(shape) * 2.0**-53
        return numbers

    return draw


def integers(draw: Draw, low: int, high: int, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Draw integers from `low` up to and including `high`; their span is below 2**53."""
    return low + (draw(shape) * float(high - low + 1)).astype(np.int64)


def normal(draw: Draw, n: int, dim: int) -> Floats:
    """Draw nearly normal numbers: sums of twelve uniform ones, within six deviations."""
    total = np.full((n, dim), -6.0)
    for _ in range(12):
        total = total + draw((n, dim))
    return total


def directions(draw: Draw, n: int, dim: int = 3) -> Floats:
    """Draw vectors of length one, uniform in direction: points of a ball, drawn outwards."""
    found = np.empty((0, dim))
    while len(found) < n:
        drawn = 2.0 * draw((2 * n, dim)) - 1.0
        squares = square(drawn)
        inside = (squares <= 1.0) & (squares > 1e-4)
        found = np.concatenate([found, drawn[inside] / np.sqrt(squares[inside])[:, None]])
    return found[:n]


def square(vectors: Floats) -> Floats:
    """Return squared lengths, summed in the order of the axes."""
    total: Floats = np.zeros(len(vectors))
    for axis in range(vectors.shape[1]):
        total = total + vectors[:, axis] * vectors[:, axis]
    return total


def exponential(exponent: Floats) -> Floats:
    """Return e to the power of `exponent` to some ten digits, by squaring."""
    part = exponent / 65536.0
    value = 1.0 + part + 0.5 * part * part
    for _ in range(16):
        value = value * value
    return value


def combine(factors: NDArray[np.float64] | NDArray[np.int64], rows: Floats) -> Floats:
    """Return ``factors @ rows``, rounded in the order of the axes."""
    total: Floats = np.zeros((len(factors), rows.shape[1]))
    for axis in range(len(rows)):
        total = total + factors[:, [axis]] * rows[axis]
    return total


def sites(
    rows: NDArray[np.int64], basis: NDArray[np.int64], repeats: Sequence[int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the sites of a crystal and its box rows, all in integers.

    `rows` are the vectors of the unit cell, `basis` the sites in it; the last axis runs
    fastest.
    """
    cells = np.stack(np.meshgrid(*[np.arange(k) for k in repeats], indexing="ij"), axis=-1)
    corners = cells.reshape(-1, 1, len(rows)) @ rows
    found = (corners + basis).reshape(-1, rows.shape[1])
    return found, rows * np.array(repeats)[:, None]


def cube(size: Size, seed: int, quick: int = 3, full: int = 10) -> tuple[Floats, float]:
    """Return points uniform in a cube of density 0.1, and its edge.

    `quick` and `full` are edges in units of 10: an edge of 10 q holds 100 q**3 points.
    """
    edge = pick(size, 1, quick, full)
    return stream(seed)((100 * edge**3, 3)) * (10.0 * edge), 10.0 * edge


def cell_order(points: Floats, cell: float) -> NDArray[np.intp]:
    """Return the order of a grid of cells, along the first axis first."""
    return np.lexsort((points // cell).T)


def wrapped(points: Floats, edge: float) -> Floats:
    """Move points that stick out of a cube by less than its edge back into it."""
    points = np.where(points < 0.0, points + edge, points)
    return np.where(points >= edge, points - edge, points)


def _rotation(w: float, x: float, y: float, z: float) -> Floats:
    """Return the rotation of a quaternion, which need not be of length one."""
    rows = [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.array(rows) / (w * w + x * x + y * y + z * z)


#: A rotation about no special axis; rows are of length one and at right angles but for rounding.
ROTATION = _rotation(0.83, 0.31, -0.17, 0.47)
