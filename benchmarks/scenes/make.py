# SPDX-License-Identifier: BSD-3-Clause
"""Coordinates that are the same bits on every machine.

They come from the frozen stream of ``RandomState`` by additions, multiplications, divisions
and square roots alone, in a fixed order; those are rounded the same everywhere. `exp` is made
from them too, because the one of NumPy differs between processors in the last bit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.scene import Floats

__all__ = [
    "DIAMOND", "FCC", "cell_order", "crystal", "cube_root", "directions", "exponential", "normal",
    "uniform", "wrapped",
]  # fmt: skip

FCC = np.array([[0, 0, 0], [0, 2, 2], [2, 0, 2], [2, 2, 0]])
DIAMOND = np.concatenate([FCC, FCC + 1])


def uniform(seed: int, n: int, dim: int) -> Floats:
    """Make points uniform in the unit cube."""
    return np.random.RandomState(seed).random_sample((n, dim))


def normal(seed: int, n: int, dim: int) -> Floats:
    """Make nearly normal numbers: sums of twelve uniform ones, within six deviations."""
    stream = np.random.RandomState(seed)
    total = np.full((n, dim), -6.0)
    for _ in range(12):
        total = total + stream.random_sample((n, dim))
    return total


def exponential(exponent: Floats) -> Floats:
    """Return e to the power of `exponent` to some ten digits, by squaring."""
    part = exponent / 65536.0
    value = 1.0 + part + 0.5 * part * part
    for _ in range(16):
        value = value * value
    return value


def cube_root(value: Floats) -> Floats:
    """Return cube roots of numbers from 1 to 1e6, by a fixed number of steps of Newton's."""
    root = 1.0 + value / 3.0
    for _ in range(60):
        root = (2.0 * root + value / (root * root)) / 3.0
    return root


def directions(seed: int, n: int, dim: int = 3) -> Floats:
    """Make vectors of length one, uniform in direction: points of a ball, drawn outwards."""
    stream = np.random.RandomState(seed)
    found = np.empty((0, dim))
    while len(found) < n:
        drawn = 2.0 * stream.random_sample((2 * n, dim)) - 1.0
        square = _square(drawn)
        inside = (square <= 1.0) & (square > 1e-4)
        found = np.concatenate([found, drawn[inside] / np.sqrt(square[inside])[:, None]])
    return found[:n]


def _square(vectors: Floats) -> Floats:
    """Return squared lengths, summed in the order of the axes."""
    total: Floats = np.zeros(len(vectors))
    for axis in range(vectors.shape[1]):
        total = total + vectors[:, axis] * vectors[:, axis]
    return total


def crystal(basis: NDArray[np.int64], repeats: int, constant: float) -> tuple[Floats, Floats]:
    """Make a cubic crystal and its box; `basis` is in quarters of the lattice constant."""
    cells = np.stack(np.meshgrid(*[np.arange(repeats)] * 3, indexing="ij"), axis=-1)
    sites = (4 * cells.reshape(-1, 1, 3) + basis).reshape(-1, 3)
    lengths: Floats = np.full(3, repeats * constant)
    points: Floats = sites.astype(np.float64) * (constant / 4.0)
    return points, lengths


def wrapped(points: Floats, length: float) -> Floats:
    """Move points that stick out of a cube by less than its length back into it."""
    points = np.where(points < 0.0, points + length, points)
    return np.where(points >= length, points - length, points)


def cell_order(points: Floats, cell: float) -> NDArray[np.int64]:
    """Return the order of a grid of cells, along x first, then y, then z."""
    x, y, z = (points // cell).astype(np.int64).T
    return np.lexsort((x, y, z))
