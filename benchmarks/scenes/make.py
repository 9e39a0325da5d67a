# SPDX-License-Identifier: BSD-3-Clause
"""Coordinates that are the same bits on every machine.

They come from the frozen stream of ``RandomState`` by additions, multiplications, divisions
and square roots alone, in a fixed order; those are rounded the same everywhere. What can be
made so from any stream is shared with `halfshell_report.scenes`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from halfshell_report.scenes import _make
from halfshell_report.scenes._make import FCC, cell_order, exponential, wrapped
from scenes.scene import Floats

__all__ = [
    "DIAMOND", "FCC", "cell_order", "crystal", "cube_root", "directions", "exponential", "normal",
    "uniform", "wrapped",
]  # fmt: skip

DIAMOND = np.concatenate([FCC, FCC + 1])


def uniform(seed: int, n: int, dim: int) -> Floats:
    """Make points uniform in the unit cube."""
    return np.random.RandomState(seed).random_sample((n, dim))


def normal(seed: int, n: int, dim: int) -> Floats:
    """Make nearly normal numbers: sums of twelve uniform ones, within six deviations."""
    return _make.normal(np.random.RandomState(seed).random_sample, n, dim)


def directions(seed: int, n: int, dim: int = 3) -> Floats:
    """Make vectors of length one, uniform in direction."""
    return _make.directions(np.random.RandomState(seed).random_sample, n, dim)


def crystal(basis: NDArray[np.int64], repeats: int, constant: float) -> tuple[Floats, Floats]:
    """Make a cubic crystal and its box; `basis` is in quarters of the lattice constant."""
    sites, _ = _make.sites(4 * np.eye(3, dtype=np.int64), basis, (repeats,) * 3)
    lengths: Floats = np.full(3, repeats * constant)
    points: Floats = sites.astype(np.float64) * (constant / 4.0)
    return points, lengths


def cube_root(value: Floats) -> Floats:
    """Return cube roots of numbers from 1 to 1e6, by a fixed number of steps of Newton's."""
    root = 1.0 + value / 3.0
    for _ in range(60):
        root = (2.0 * root + value / (root * root)) / 3.0
    return root
