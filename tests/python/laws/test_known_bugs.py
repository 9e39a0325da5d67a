# SPDX-License-Identifier: BSD-3-Clause
"""Scenes that have crashed, hung or fooled other neighbour searches, each by its report.

The comment names the project and issue where the scene was first seen to fail.
"""

import itertools
import math
import time

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import as_rows, as_set, check, check_large, lattice, random_box

# ---- sizes of grids ------------------------------------------------------------------------


def test_wide_thin_box():
    # vesin: integer division by zero
    points = np.array([[0.0, 0, 0], [1500, 1500, 1]])
    found = check(points, 4.0, np.diag([1500.0, 1500, 5]))
    assert found == {(0, 1, (-1, -1, 0)), (0, 1, (-1, -1, -1))}


def test_planar_cloud_in_three_dimensions(rng):
    # vesin; OpenKIM kliff #37; MDAnalysis "cutoff too large for box"
    points = rng.uniform(0, 1000, (500, 3)) * [1, 1, 0]
    check_large(points, 10.0)
    check_large(points, 0.1)
    check_large(points * [1, 0, 0], 1.0)


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


def test_tiny_cutoff_in_a_big_box(rng):
    for kernel in hs.kernels():
        # NeighbourLists.jl #2, pymatgen #2277, freud #194: explosion of the grid
        points = rng.random((1000, 3)) * 1e4
        points[7] = points[3] + [0, 0, 1e-9]
        for box in (None, [1e4] * 3):
            found = call(hs.pairs, points, 1e-8, box=box, quantities="P", kernel=kernel)
            assert found.tolist() == [[3, 7]]


def test_many_equal_coordinates():
    for kernel in hs.kernels():
        # SciPy #14799, #6108, #11595: recursion and quadratic trees on duplicates
        points = np.zeros((50_000, 3))
        points[:, 0] = np.arange(50_000) // 5
        assert call(hs.count_pairs, points, 0.5, kernel=kernel) == 10_000 * 10
        start = time.process_time()
        call(hs.pairs, points, 0.5, box=[10_000.0, 1.0, 1.0], kernel=kernel)
        assert time.process_time() - start < 2.0


def test_one_crowded_cell_among_empty_ones(rng):
    for kernel in hs.kernels():
        points = np.concatenate([rng.random((3000, 3)) * 1e-3, rng.random((100, 3)) * 1e6])
        found = call(hs.count_pairs, points, 1.0, kernel=kernel)
        assert found == 3000 * 2999 // 2


# ---- faces and wrapping --------------------------------------------------------------------


def test_tilted_slab(rng):
    # MACE #1727, vesin 0.5.8: the open direction is not a Cartesian axis
    box = random_box(rng, "rotated", length=5.0)
    points = rng.uniform(-4, 4, (60, 3)) @ box
    for flags in itertools.product([False, True], repeat=3):
        check_large(points, 2.5, box, flags)


def test_coordinates_on_cell_borders():
    # MDAnalysis #2229: exchanging the two sets changed the result
    values = np.arange(0, 61, 10.0)
    points = np.array(list(itertools.product(values, repeat=2)))
    points = np.concatenate([points, points + [0.0, 10.0]])
    assert len(check_large(points, 10.0)) == len(check_large(points[::-1], 10.0))
    check_large(points, 10.0, [60.0, 60.0])


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


def test_sheared_by_a_thousand_cells_in_no_time(rng):
    # ASE, pymatgen: more than 10 s
    points = rng.random((200, 3))
    start = time.process_time()
    box = np.array([[1.0, 0, 0], [1000, 1, 0], [-1000, 2000, 1]])
    count = hs.count_pairs(points, 0.3, box=box)
    assert count == hs.count_pairs(points, 0.3, box=[1.0, 1.0, 1.0])
    assert time.process_time() - start < 1.0


# ---- ties ----------------------------------------------------------------------------------


def test_diagonal_neighbours_of_a_square_grid():
    # SciPy #16600: 16 of 24 pairs
    for spacing in (1.0, 0.1, 0.2, 1 / 3):
        grid = np.array(list(itertools.product(range(4), repeat=2))) * spacing
        check(grid, math.sqrt(2.0) * spacing)
        check(grid, math.sqrt(2.0 * spacing**2))
    grid = np.array(list(itertools.product(range(4), repeat=2)))
    assert len(check(grid, math.sqrt(2.0))) == 24 + 18


def test_hcp_has_twelve_neighbours_everywhere():
    for kernel in hs.kernels():
        # atomman #12: 11.96 near the box edges
        points, box = lattice("hcp", (5, 5, 4))
        cutoff = math.nextafter(math.sqrt(18.0), 5)
        i, j = call(hs.pairs, points, cutoff, box=box, kernel=kernel)
        neighbours = np.bincount(np.concatenate([i, j]), minlength=len(points))
        assert (neighbours == 12).all()


def test_fcc_slab():
    for kernel in hs.kernels():
        # MDAnalysis #2345
        points, box = lattice("fcc", (4, 4, 2))
        box[2, 2] = 40
        cutoff = 1.45
        i, j = call(hs.pairs, points, cutoff, box=box, periodic=[True, True, False], kernel=kernel)
        neighbours = np.bincount(np.concatenate([i, j]), minlength=len(points))
        assert sorted(set(neighbours.tolist())) == [8, 12]
        assert np.array_equal(neighbours == 8, (points[:, 2] == 0) | (points[:, 2] == 3))


def test_no_site_is_its_own_neighbour():
    for kernel in hs.kernels():
        # pymatgen #2036
        points, box = lattice("diamond", (1, 1, 1))
        for cutoff in (0.0, 1e-8, 1.0, math.sqrt(3.0)):
            i, j = call(hs.pairs, points / 4, cutoff / 4, box=box / 4, kernel=kernel)
            assert (i < j).all()


# ---- arguments -----------------------------------------------------------------------------


def test_lists_of_bools_and_float32_boxes(rng):
    # pymatgen #2887, mdtraj #1142
    points = rng.random((20, 3))
    assert hs.count_pairs(points.tolist(), 0.3, box=[1, 1, 1], periodic=[True, True, True]) == (
        hs.count_pairs(points, 0.3, box=np.ones(3, np.float32))
    )


def test_no_points_in_any_box():
    # freud #591: segmentation fault on shape (0, 3); MDAnalysis #2665
    for ndim in range(1, 9):
        for box in (None, np.ones(ndim), np.ones(ndim) * 1e-3):
            assert hs.count_pairs(np.empty((0, ndim)), 1.0, box=box) == 0


def test_signed_arithmetic_on_indices():
    # vesin: unsigned indices turn a difference into float64
    i, j = hs.pairs([[0.0], [1.0]], 1.0)
    assert (i - j).tolist() == [-1] and (i - np.int64(1)).dtype == np.int64
