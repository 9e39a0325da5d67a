# SPDX-License-Identifier: BSD-3-Clause
"""Small scenes of every kind for tests of `CellList`, and queries for each of them."""

import numpy as np


def _random(n, ndim, seed, spread):
    return np.random.default_rng(seed).random((n, ndim)) * spread


def _lattice(n, ndim):
    return np.stack(np.meshgrid(*[np.arange(float(n))] * ndim), -1).reshape(-1, ndim)


def _clusters(distance):
    return np.concatenate([_random(900, 3, k, 1.0) + k * distance for k in range(2)])


SHEARED = [[9.0, 0.0, 0.0], [9000.0, 8.0, 0.0], [1.0, 8000.0, 7.0]]
TRICLINIC = [[9.0, 0.0, 0.0], [4.0, 8.0, 0.0], [-3.0, 2.0, 7.0]]

# points, cutoff, box, periodic
SCENES = {
    "line": (_random(150, 1, 1, 50.0), 1.5, None, None),
    "plane": (_random(300, 2, 2, 10.0), 1.0, None, None),
    "periodic plane": (_random(300, 2, 3, 10.0), 1.0, [10.0, 10.0], None),
    "lattice": (_lattice(6, 3), 1.0, [6.0, 6.0, 6.0], None),
    "triclinic": (_random(300, 3, 4, 9.0), 1.5, TRICLINIC, None),
    "slab": (_random(300, 3, 5, 9.0), 1.5, TRICLINIC, [True, False, True]),
    "sheared": (_random(300, 3, 5, 9.0), 2.0, SHEARED, None),
    "images": (_random(20, 3, 6, 1.0), 2.0, [1.5, 1.25, 1.0], None),
    "images of one point": ([[0.25, 0.5]], 2.5, [1.0, 0.75], None),
    "one point": ([[1.0, 2.0, 3.0]], 1.0, None, None),
    "no points": (np.empty((0, 2)), 1.0, [4.0, 4.0], None),
    "eight dimensions": (_random(60, 8, 7, 1.0), 0.9, None, None),
    "a periodic box of eight": (_random(12, 8, 8, 2.5), 1.6, [2.5] * 8, None),
    "float32": (_random(200, 3, 9, 9.0).astype(np.float32), 1.5, [9.0, 9.0, 9.0], None),
    "far outside the box": (_random(200, 2, 10, 1e6) - 5e5, 2.0, [16.0, 16.0], None),
    "huge": (_random(100, 3, 11, 1e300), 2e299, [1e300, 1e300, 1e300], None),
    "tiny": (_random(100, 2, 12, 1e-300), 1e-301, None, None),
    "digits that scaling loses": (
        np.concatenate([_random(60, 2, 13, 1e-290), _random(60, 2, 14, 1e300)]), 1e-290, None, None,
    ),
    "clusters": (_clusters(3.0), 0.1, None, None),
    "clusters far apart": (_clusters(1e9), 0.1, None, None),
    "coincident": (np.zeros((40, 2)), 0.0, None, None),
}  # fmt: skip

# Widths of cells in cutoffs; the smallest and the largest are no size that any cell can have.
WIDTHS = [1e-15, 0.07, 0.5, 1.0, 2.5, 1e6]


def scene_of(name):
    """Points, cutoff, and box and periodic as keywords."""
    points, cutoff, box, periodic = SCENES[name]
    return np.asarray(points), cutoff, {"box": box, "periodic": periodic}


def queries_of(name, n=30):
    """Some of the points, others between them and around them."""
    points, cutoff, _ = scene_of(name)
    n = min(n, 4) if name == "a periodic box of eight" else n  # each has thousands of images
    rng = np.random.default_rng(99)
    if len(points) == 0:
        return rng.random((n, points.shape[1]))
    chosen = points[rng.integers(0, len(points), n)].astype(np.float64)
    return chosen + cutoff * rng.choice([-0.7, 0.0, 0.4], chosen.shape)
