# SPDX-License-Identifier: BSD-3-Clause
"""Small scenes of every sort against the definition, set equality on (i, j, S)."""

import itertools

import numpy as np
import pytest

import halfshell as hs
from halfshell._check.reference import reference_pairs
from oracles import BOX_KINDS, as_set, check, random_box, random_scene


def test_fewest_points_in_open_space():
    for n in (0, 1, 2):
        for ndim in (1, 2, 3, 5):
            points = np.arange(n * ndim, dtype=float).reshape(n, ndim)
            found = check(points, 100.0)
            assert len(found) == n * (n - 1) // 2
            assert check(points, 0.0) == set()


def test_fewest_points_in_a_box():
    for n in (0, 1, 2):
        points = np.array([[0.25, 0.5, 0.75], [0.5, 0.5, 0.5]])[:n]
        for cutoff in (0.0, 0.3, 1.0, 1.5):
            check(points, cutoff, box=[1.0, 1.0, 1.25])


def test_a_point_alone_pairs_with_its_own_images_once():
    found = check([[0.3, 0.4]], 1.0, box=[1.0, 1.0])
    assert found == {(0, 0, (1, 0)), (0, 0, (0, 1))}


def test_a_point_is_never_its_own_neighbour_without_a_shift():
    points = np.zeros((4, 3))
    for box in (None, [1.0, 2.0, 3.0]):
        assert all(i < j or any(S) for i, j, S in check(points, 1.5, box=box))


def test_coincident_points_are_pairs_at_any_cutoff():
    points = np.repeat([[0.1, 0.2, 0.3], [5.0, 5.0, 5.0]], [3, 2], axis=0)
    everyone = {(0, 1), (0, 2), (1, 2), (3, 4)}
    for cutoff in (0.0, 5e-324, 1e-300, 0.1):
        assert {p[:2] for p in check(points, cutoff)} == everyone
    assert check(points, 0.0, inclusive=False) == set()
    assert len(check(points, 0.0, box=[0.7, 0.7, 0.7])) == 4


def test_points_that_coincide_only_by_a_box_vector_are_pairs_at_zero():
    box = [[1.0, 0.25, 0.0], [0.0, 2.0, 0.5], [0.125, 0.0, 1.5]]
    points = np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0.5]])
    points[1] += np.array([3, -2, 1]) @ np.array(box)
    assert check(points, 0.0, box=box) == {(0, 1, (-3, 2, -1))}


def test_all_points_coincide():
    i, j = hs.pairs(np.full((700, 3), 0.7), 0.0)
    assert as_set(i, j) == {(a, b, ()) for a, b in itertools.combinations(range(700), 2)}


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_every_box_and_every_mixture_of_axes(kind, rng):
    for flags in itertools.product([False, True], repeat=3):
        for neighbours in (0.3, 3.0, 25.0):
            n = int(rng.integers(2, 9))
            points, cutoff, box, axes = random_scene(
                rng, n, 3, kind, neighbours, spread=2, periodic=flags
            )
            check(points, cutoff, box, axes)
            check(points, cutoff, box, axes, inclusive=False)


@pytest.mark.parametrize("ndim", [1, 2, 3])
def test_every_kernel_on_random_scenes(ndim, rng):
    for _ in range(20):
        kind = str(rng.choice(BOX_KINDS))
        flags = rng.random(ndim) < 0.7
        points, cutoff, box, flags = random_scene(
            rng, int(rng.integers(1, 24)), ndim, kind, 4, spread=2, periodic=flags
        )
        check(points, cutoff, box, flags)
        check(points, cutoff)


def test_cutoff_of_many_boxes(rng):
    for kind in BOX_KINDS:
        box = random_box(rng, kind)
        points = rng.random((2, 3)) @ box
        check(points, 3.2, box)
        check(points, 6.0, box, [False, True, False])


def test_one_short_edge_among_long_ones(rng):
    # One length below the cutoff, the others above.
    for axis in range(3):
        lengths = np.full(3, 4.0)
        lengths[axis] = 0.4
        check(rng.random((6, 3)) * lengths, 1.1, lengths)


def test_box_just_below_and_above_a_multiple_of_the_cutoff(rng):
    for multiple in (1, 2, 3, 4):
        for length in (np.nextafter(multiple, 0), multiple, np.nextafter(multiple, 9)):
            points = np.concatenate([rng.random((6, 2)) * length, [[0, 0], [length, length]]])
            check(points, 1.0, [length, length])
            check(points, 0.5, [length, length])


def test_extreme_shear_is_only_another_way_to_write_the_box(rng):
    plain = np.diag([1.0, 1.25, 0.75])
    points = rng.integers(0, 64, (6, 3)) / 64
    for s, t in ((10, 30), (1000, 3000), (1_000_000, 0), (20_000, 50_000)):
        change = np.array([[1, 0, 0], [s, 1, 0], [-s, t, 1]])
        found = check(points, 0.9, change @ plain)
        assert len(found) == len(reference_pairs(points, 0.9, plain))


def test_slab_and_wire_with_a_zero_row(rng):
    points = rng.uniform(-3, 3, (8, 3))
    check(points, 1.5, [[2.0, 0.3, 0.1], [0.2, 1.7, -0.4], [0, 0, 0]], [True, True, False])
    check(points, 1.5, [[0, 0, 0], [0.2, 1.7, -0.4], [0, 0, 0]], [False, True, False])
    check(points, 1.5, [0.0, 1.7, 0.0], [False, True, False])


def test_open_axes_of_a_box_are_open(rng):
    # Rows that do not repeat must not wrap anything, wherever the points are.
    points = rng.uniform(-3, 3, (10, 3)) + [0, 0, -1e4]
    box = random_box(rng, "triclinic")
    found = check(points, 1.3, box, [True, True, False])
    assert all(S[2] == 0 for _, _, S in found)
    found = check(points, 2.0, box, [False, False, False])
    assert found == check(points, 2.0)


def test_sizes_around_vector_lengths(rng):
    for kernel in hs.kernels():
        # Tails of vector loops: every n up to 40, and around 64 and 128.
        for n in [*range(41), 63, 64, 65, 127, 128, 129]:
            points = rng.random((n, 3))
            i, j = hs.pairs(points, 0.4, kernel=kernel)
            D = points[:, None] - points[None]
            near = np.triu((D * D).sum(-1) <= 0.16, 1)
            assert as_set(i, j) == {(a, b, ()) for a, b in np.argwhere(near).tolist()}


def test_coordinates_whose_difference_overflows():
    huge = 1.7e308
    points = np.array([[huge, 0.0], [-huge, 0.0], [-huge, 1.0], [0.0, huge]])
    check(points, 1.0)
    check(points, 1.7976931348623157e308)


def test_subnormal_distances():
    tiny = 5e-324
    points = np.array([[0.0, 0.0], [tiny, 0.0], [0.0, 3 * tiny], [4 * tiny, 3 * tiny]])
    for cutoff in (0.0, tiny, 2 * tiny, 3 * tiny, 4 * tiny, 5 * tiny):
        check(points, cutoff)
        check(points, cutoff, inclusive=False)
        check(points + 0.0, cutoff, [8 * tiny, 8 * tiny])


def test_mixed_magnitudes_on_the_axes(rng):
    points = rng.normal(size=(12, 3)) * [1e-12, 1.0, 1e12]
    for cutoff in (1e-12, 1.0, 1e12):
        check(points, cutoff)
        check(points, cutoff, [3e-12, 4.0, 5e12], [False, False, True])
