# SPDX-License-Identifier: BSD-3-Clause
"""Pairs of small scenes and of large ones, in every number of dimensions, and their order."""

import itertools

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import (
    BOX_KINDS,
    as_set,
    check_large,
    random_scene,
    same_arrays,
)


def test_sizes_around_vector_lengths(rng):
    for kernel in hs.kernels():
        # Tails of vector loops: every n up to 40, and around 64 and 128.
        for n in [*range(41), 63, 64, 65, 127, 128, 129]:
            points = rng.random((n, 3))
            i, j = call(hs.pairs, points, 0.4, kernel=kernel)
            D = points[:, None] - points[None]
            near = np.triu((D * D).sum(-1) <= 0.16, 1)
            assert as_set(i, j) == {(a, b, ()) for a, b in np.argwhere(near).tolist()}


# ---- dimensions --------------------------------------------------------------------------------


DIMENSIONS = range(1, 9)


def test_integer_lattice_ties():
    for ndim in DIMENSIONS:
        for kernel in hs.kernels():
            # Integer points of a small torus: each has two neighbours per axis, exactly at 1.
            size = {1: 16, 2: 8, 3: 5}.get(ndim, 3)
            steps = list(itertools.product(range(size), repeat=min(ndim, 6)))
            points = np.zeros((len(steps), ndim))
            points[:, : min(ndim, 6)] = steps
            box = np.full(ndim, float(size))
            count = call(hs.count_pairs, points, 1.0, box=box, kernel=kernel)
            assert count == len(points) * min(ndim, 6)
            below = call(hs.count_pairs, points, 1.0, box=box, inclusive=False, kernel=kernel)
            assert below == 0


# ---- large scenes ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_thousands_of_points_in_every_kind_of_box(kind, rng):
    for n, ndim, neighbours in ((6000, 3, 12), (4000, 2, 20), (3000, 4, 6), (1000, 6, 4)):
        flags = rng.random(ndim) < 0.7
        points, cutoff, box, flags = random_scene(rng, n, ndim, kind, neighbours, 2, flags)
        check_large(points, cutoff, box, flags)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_a_hundred_thousand_points(dtype, rng):
    points, cutoff, box, _ = random_scene(rng, 100_000, 3, "triclinic", neighbours=10)
    rows = check_large(points.astype(dtype), cutoff, box)
    assert 450_000 < len(rows) < 550_000


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_crowded_cells(dtype, rng):
    # Hundreds of neighbours, in one spot and everywhere.
    points, cutoff, box, _ = random_scene(rng, 1500, 3, "triclinic", neighbours=500)
    check_large(points.astype(dtype), cutoff, box)
    spots = np.concatenate(
        [rng.random((700, 3)) * 0.01 + corner for corner in ([0, 0, 0], [1, 1, 1], [1, 0, 0.5])]
    )
    check_large(spots.astype(dtype), 0.008, [2.0, 2.0, 2.0])


def test_clustered_points(rng):
    # Densities that differ by a factor of 1e6, as in a galaxy catalogue.
    centres = rng.random((40, 3))
    widths = 10.0 ** rng.uniform(-4, -1, 40)
    points = np.concatenate(
        [c + w * rng.normal(size=(100, 3)) for c, w in zip(centres, widths, strict=True)]
    )
    for cutoff in (1e-4, 1e-3, 0.02):
        check_large(points, cutoff, [1.0, 1.0, 1.0])
        check_large(points, cutoff)


# ---- order -------------------------------------------------------------------------------------


@pytest.mark.parametrize("ndim", DIMENSIONS)
def test_every_kernel_returns_the_same_bytes_in_the_same_order(ndim, rng):
    for sort in (False, True):
        for n in (2, 33, 500):
            points, cutoff, box, _ = random_scene(rng, n, ndim, neighbours=15)
            for dtype in (np.float64, np.float32):
                for frame in (box, None):
                    results = [
                        call(
                            hs.pairs,
                            points.astype(dtype),
                            cutoff,
                            box=frame,
                            quantities="ijSdD",
                            sort=sort,
                            kernel=name,
                        )
                        for name in [*hs.kernels(), None]
                    ]
                    assert all(same_arrays(results[0], other) for other in results[1:])


# ---- an infinite cutoff ----------------------------------------------------------------------


def test_an_infinite_cutoff_takes_all_pairs(rng):
    points = rng.random((7, 3))
    for inf in (np.inf, np.float64(np.inf), np.array(np.inf)):
        for how in ({}, {"box": 1.0, "periodic": False}, {"inclusive": False}):
            assert hs.pairs(points, inf, sort=True, quantities="P", **how).tolist() == [
                [i, j] for i in range(7) for j in range(i + 1, 7)
            ]
            assert hs.count_pairs(points, inf, queries=points[:2], **how) == 14
            assert hs.coordination(points, inf, **how).tolist() == [6] * 7
            assert hs.neighbors(points, inf, quantities="jd", **how).sort().counts.sum() == 42
            assert sum(map(len, hs.iter_pairs(points, inf, quantities="P", **how))) == 21
            assert hs.clusters(points, inf, **how).n_clusters == 1
            assert hs.verify(points, inf, *hs.pairs(points, inf, **how), **how).ok
    assert hs.count_pairs([points, points[:2], points[:0]], np.inf).tolist() == [21, 1, 0]
    assert hs.count_pairs(np.zeros((3, 2)), np.inf, inclusive=False) == 3
    assert hs.count_pairs([[1e308], [0.0]], np.inf) == 1
    assert hs.count_pairs(np.empty((0, 3)), np.inf) == 0
    axes = [True, False, False]
    for call_, error, message in (
        (lambda: hs.pairs(points, np.inf, box=1.0), ValueError, "box vectors repeat, got inf"),
        (lambda: hs.pairs(points, np.inf, box=1.0, periodic=axes), ValueError, "no end of images"),
        (lambda: hs.pairs([[1e308], [-1e308]], np.inf), OverflowError, "do not fit float64"),
        (lambda: hs.pairs([[np.nan]], np.inf), ValueError, r"points\[0, 0\] = nan"),
        (lambda: hs.pairs(points, -np.inf), ValueError, "not negative, got -inf"),
    ):
        with pytest.raises(error, match=message):
            call_()
