# SPDX-License-Identifier: BSD-3-Clause
"""One to eight dimensions, open, periodic and mixed."""

import itertools
import math

import numpy as np
import pytest

import halfshell as hs
from oracles import as_set, check, check_large, random_box, random_scene, rotation

DIMENSIONS = range(1, 9)


@pytest.mark.parametrize("ndim", DIMENSIONS)
def test_open_space(ndim, rng):
    points = rng.random((25, ndim))
    for cutoff in (0.0, 0.1, 0.4 * math.sqrt(ndim), 10.0):
        check(points, cutoff)


@pytest.mark.parametrize("ndim", DIMENSIONS)
def test_all_axes_periodic(ndim, rng):
    for kind in ("orthorhombic", "triclinic", "left-handed"):
        points, cutoff, box, _ = random_scene(rng, 6, ndim, kind, neighbours=6, spread=2)
        check(points, cutoff, box)


@pytest.mark.parametrize("ndim", DIMENSIONS)
def test_some_axes_periodic(ndim, rng):
    for _ in range(3):
        flags = rng.random(ndim) < 0.5
        points, cutoff, box, flags = random_scene(
            rng, 8, ndim, "triclinic", neighbours=3, spread=2, periodic=flags
        )
        check(points, cutoff, box, flags)


def test_integer_lattice_ties():
    for ndim in DIMENSIONS:
        for kernel in hs.kernels():
            # Integer points of a small torus: each has two neighbours per axis, exactly at 1.
            size = {1: 16, 2: 8, 3: 5}.get(ndim, 3)
            steps = list(itertools.product(range(size), repeat=min(ndim, 6)))
            points = np.zeros((len(steps), ndim))
            points[:, : min(ndim, 6)] = steps
            box = np.full(ndim, float(size))
            count = hs.count_pairs(points, 1.0, box=box, kernel=kernel)
            assert count == len(points) * min(ndim, 6)
            below = hs.count_pairs(points, 1.0, box=box, inclusive=False, kernel=kernel)
            assert below == 0


@pytest.mark.parametrize("ndim", DIMENSIONS)
def test_a_single_point_sees_the_integer_vectors(ndim):
    found = check(np.full((1, ndim), 0.3), math.sqrt(2.0), np.ones(ndim))
    assert len(found) == ndim + ndim * (ndim - 1)  # +-e_k and +-e_k +-e_l, one of each pair


def test_padding_with_a_constant_axis_changes_nothing(rng):
    for ndim in (2, 3, 4, 6):
        for kernel in hs.kernels():
            points = rng.random((60, ndim - 1))
            i, j, d = hs.pairs(points, 0.3, quantities="ijd", kernel=kernel)
            for constant in (0.0, 7.5, -1e300):
                padded = np.column_stack([points, np.full(60, constant)])
                more = hs.pairs(padded, 0.3, quantities="ijd", kernel=kernel)
                assert as_set(more[0], more[1]) == as_set(i, j)
                assert sorted(more[2].tolist()) == sorted(d.tolist())


@pytest.mark.parametrize("ndim", [1, 2, 4, 5])
def test_larger_scenes(ndim, rng):
    for kind in ("orthorhombic", "triclinic"):
        points, cutoff, box, _ = random_scene(rng, 700, ndim, kind, neighbours=10)
        check_large(points, cutoff, box)
    check_large(points, cutoff)


def test_points_on_a_line_in_any_direction(rng):
    for ndim in (2, 4, 5, 8):
        points = np.outer(np.arange(30), rng.normal(size=ndim))
        for cutoff in (np.linalg.norm(points[1]), 3.5):
            check(points, float(cutoff))
        axis = np.zeros((30, ndim))
        axis[:, ndim - 1] = np.arange(30)
        assert len(check(axis, 1.0)) == 29


@pytest.mark.parametrize("ndim", [2, 3, 4, 6])
def test_rotated_integer_grids(ndim, rng):
    size = {2: 7, 3: 4, 4: 3}.get(ndim, 2)
    grid = np.array(list(itertools.product(range(size), repeat=ndim)), float)
    points = grid @ rotation(rng, ndim)
    for square in (1, 2, 3, 4):
        check_large(points, math.sqrt(square))


def test_wide_box_in_one_dimension(rng):
    # Far more cells than points may exist along one axis; the time must not depend on it.
    points = np.sort(rng.uniform(0, 1e9, 400))[:, None]
    check_large(points, 1e6, [1e9])
    check_large(points, 1.0, [1e9])
    check_large(points, 1e-6)


def test_eight_dimensional_skewed_box(rng):
    box = random_box(rng, "triclinic", 8)
    points = rng.random((2, 8)) @ box
    check(points, 0.9, box)
