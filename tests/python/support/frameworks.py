# SPDX-License-Identifier: BSD-3-Clause
"""Packages of arrays that are optional: their tests are skipped without them, which CI forbids."""

import os

import numpy as np
import pytest

import halfshell as hs


def framework(name):
    """The module `name`; without it all tests of the caller's module are skipped."""
    if os.environ.get("HALFSHELL_FRAMEWORKS") == "1":
        return __import__(name)
    return pytest.importorskip(name, reason=f"{name} is not installed")


def full_list(points, cutoff, box=None, periodic=None, inclusive=True):
    """i, j, S, d and D of the full list, ascending by (i, j, S)."""
    table = hs.neighbors(
        points, cutoff, box=box, periodic=periodic, quantities="jSdD", inclusive=inclusive
    )
    return table.to_pairs(quantities="ijSdD")


def scenes(dtype):
    """Points, cutoff, box, periodic: open, mixed, triclinic, many images, none and one point."""
    rng = np.random.default_rng(7)
    skewed = np.array([[4.0, 0.0, 0.0], [1.5, 3.0, 0.0], [-0.5, 0.75, 5.0]])
    for n in (0, 1, 40):
        for d in (1, 2, 3, 8):
            yield (3.0 * rng.random((n, d))).astype(dtype), 1.25, None, None
        points = (20.0 * rng.random((n, 3)) - 10.0).astype(dtype)
        yield points, 1.5, [4.0, 5.0, 6.0], [True, False, True]
        yield points, 1.5, skewed, None
        yield points, 4.5, skewed, None
        yield (points + 1e6).astype(dtype), 1.5, skewed, [False, True, True]
