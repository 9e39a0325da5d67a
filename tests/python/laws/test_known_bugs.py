# SPDX-License-Identifier: BSD-3-Clause
"""Scenes that have crashed, hung or fooled other neighbour searches, each by its report.

The comment names the project and issue where the scene was first seen to fail.
"""

import itertools
import time

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import as_rows, as_set, check, check_large, random_box

# ---- sizes of grids ------------------------------------------------------------------------


def test_wide_thin_box():
    # vesin: integer division by zero
    points = np.array([[0.0, 0, 0], [1500, 1500, 1]])
    found = check(points, 4.0, np.diag([1500.0, 1500, 5]))
    assert found == {(0, 1, (-1, -1, 0)), (0, 1, (-1, -1, -1))}


def test_two_points_in_an_enormous_empty_box():
    for kernel in hs.kernels():
        # MDAnalysis #3183, matscipy #5, MACE #1501, mdtraj #1165, freud: index beyond 2**32
        for size in (3e4, 1e7, 1e12, 1e15):
            points = np.array([[0.0, 0, 0], [size, size, size / 2], [size, size, size / 2 + 0.5]])
            assert as_set(*call(hs.pairs, points, 1.0, kernel=kernel)) == {(1, 2, ())}
            found = call(hs.pairs, points, 1.0, box=[2 * size] * 3, kernel=kernel)
            assert as_set(*found) == {(1, 2, ())}


def test_one_far_outlier(rng):
    # SciPy #7883, MDAnalysis: heap corruption by one coordinate of 1e12 in a 10 A box
    points = rng.random((200, 3)) * 10
    expected = check_large(points, 2.0)
    for far in (1e7, 1e12, 1e100):
        more = np.concatenate([points, [[far, 0, 0]]])
        for kernel in hs.kernels():
            found = call(hs.pairs, more, 2.0, quantities="ijS", kernel=kernel)
            assert np.array_equal(as_rows(*found), expected)
    boxed = np.concatenate([points, [[1e10, 1.0, 1.0]]])
    check_large(boxed[150:], 2.0, [10.0, 10.0, 10.0])


def test_many_equal_coordinates():
    for kernel in hs.kernels():
        # SciPy #14799, #6108, #11595: recursion and quadratic trees on duplicates
        points = np.zeros((50_000, 3))
        points[:, 0] = np.arange(50_000) // 5
        assert call(hs.count_pairs, points, 0.5, kernel=kernel) == 10_000 * 10
        start = time.process_time()
        call(hs.pairs, points, 0.5, box=[10_000.0, 1.0, 1.0], kernel=kernel)
        assert time.process_time() - start < 2.0


# ---- faces and wrapping --------------------------------------------------------------------


def test_tilted_slab(rng):
    # MACE #1727, vesin 0.5.8: the open direction is not a Cartesian axis
    box = random_box(rng, "rotated", length=5.0)
    points = rng.uniform(-4, 4, (60, 3)) @ box
    for flags in itertools.product([False, True], repeat=3):
        check_large(points, 2.5, box, flags)


@pytest.mark.parametrize("cells", [1, 2, 3, 4])
def test_few_cells_per_axis(cells, rng):
    # MDAnalysis #2345, nvalchemi #3, featomic #260, jax-md #399: double counting
    for lengths in itertools.product([0.9 * cells, cells, 1.1 * cells], repeat=2):
        points = rng.random((25, 2)) * lengths
        check(points, 1.0, lengths)


# ---- skewed boxes --------------------------------------------------------------------------


def test_sharp_angles(rng):
    # mdtraj #1019, cpptraj #223, MDAnalysis #1475: 27 images are not enough
    for tilt in (0.9, 3.7, 11.3):
        box = np.array([[1.0, 0, 0], [tilt, 0.2, 0], [-tilt, tilt, 0.25]])
        check(rng.random((4, 3)) @ box, 0.5, box)


# ---- arguments -----------------------------------------------------------------------------


def test_no_points_in_any_box():
    # freud #591: segmentation fault on shape (0, 3); MDAnalysis #2665
    for ndim in range(1, 9):
        for box in (None, np.ones(ndim), np.ones(ndim) * 1e-3):
            assert hs.count_pairs(np.empty((0, ndim)), 1.0, box=box) == 0
