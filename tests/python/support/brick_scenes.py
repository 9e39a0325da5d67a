# SPDX-License-Identifier: BSD-3-Clause
"""Scenes that are searched in parts, and what one search says of them."""

import numpy as np

import halfshell as hs

LETTERS = "ijdDSP"


def scenes():
    """Name -> points, cutoff, box and periodicity."""
    rng = np.random.default_rng(3)
    points = rng.random((240, 3)) * 9.0 - 2.0
    skewed = np.array([[4.0, 0.0, 0.0], [1.5, 3.0, 0.0], [-0.5, 0.75, 5.0]])
    lattice = np.stack(np.meshgrid(*[np.arange(6.0)] * 2), -1).reshape(-1, 2)
    far = np.repeat([0.0, 1e9, -3e12], 80)[:, None]
    return {
        "open": (points, 0.9, {}),
        "mixed": (points, 0.9, {"box": skewed, "periodic": [True, False, True]}),
        "skewed": (points, 0.7, {"box": skewed}),
        "images": (points[:9], 3.3, {"box": np.eye(3)}),
        "single": (points.astype(np.float32), 0.9, {"box": [7.0, 8.0, 9.0]}),
        "whole numbers": (lattice.astype(np.int32), 1.0, {"box": [6.0, 6.0]}),
        "clusters": (points + far, 0.8, {}),
        "on the cuts": (lattice, 1.0, {"box": [6.0, 6.0]}),
        "eight axes": (rng.random((40, 8)), 0.9, {"box": 1.0}),
        "one axis": (points[:, :1], 0.05, {"box": 5.0}),
        "one point": (np.ones((1, 3)), 1.5, {"box": 1.0}),
        "none": (np.empty((0, 3)), 1.0, {"box": 1.0}),
    }


def same(found, expected):
    """Whether arrays are the same, byte for byte."""
    return len(found) == len(expected) and all(
        one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
        for one, other in zip(found, expected, strict=True)
    )


def in_order(columns):
    """Columns of `LETTERS`, ascending by (i, j, S)."""
    place = np.lexsort((*columns[4].T[::-1], columns[1], columns[0]))
    return [column[place] for column in columns]


def serial(points, cutoff, options):
    """All pairs by one search, ascending."""
    return hs.pairs(points, cutoff, quantities=LETTERS, sort=True, **options)
