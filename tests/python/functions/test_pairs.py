# SPDX-License-Identifier: BSD-3-Clause
"""Pairs of small scenes and of large ones, in every number of dimensions, and their order."""

import itertools
import subprocess
import sys

import numpy as np
import pytest

import halfshell as hs
from calls import call
from halfshell._check.reference import reference_pairs
from oracles import (
    BOX_KINDS,
    as_set,
    check,
    check_large,
    random_box,
    random_scene,
    same_arrays,
)


def test_a_point_alone_pairs_with_its_own_images_once():
    found = check([[0.3, 0.4]], 1.0, box=[1.0, 1.0])
    assert found == {(0, 0, (1, 0)), (0, 0, (0, 1))}


def test_a_point_is_never_its_own_neighbour_without_a_shift():
    points = np.zeros((4, 3))
    for box in (None, [1.0, 2.0, 3.0]):
        assert all(i < j or any(S) for i, j, S in check(points, 1.5, box=box))


def test_points_that_coincide_only_by_a_box_vector_are_pairs_at_zero():
    box = [[1.0, 0.25, 0.0], [0.0, 2.0, 0.5], [0.125, 0.0, 1.5]]
    points = np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0.5]])
    points[1] += np.array([3, -2, 1]) @ np.array(box)
    assert check(points, 0.0, box=box) == {(0, 1, (-3, 2, -1))}


def test_all_points_coincide():
    i, j = hs.pairs(np.full((700, 3), 0.7), 0.0)
    assert as_set(i, j) == {(a, b, ()) for a, b in itertools.combinations(range(700), 2)}


def test_cutoff_of_many_boxes(rng):
    for kind in BOX_KINDS:
        box = random_box(rng, kind)
        points = rng.random((2, 3)) @ box
        check(points, 3.2, box)
        check(points, 6.0, box, [False, True, False])


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
            i, j = call(hs.pairs, points, 0.4, kernel=kernel)
            D = points[:, None] - points[None]
            near = np.triu((D * D).sum(-1) <= 0.16, 1)
            assert as_set(i, j) == {(a, b, ()) for a, b in np.argwhere(near).tolist()}


def test_coordinates_whose_difference_overflows():
    huge = 1.7e308
    points = np.array([[huge, 0.0], [-huge, 0.0], [-huge, 1.0], [0.0, huge]])
    check(points, 1.0)
    check(points, 1.7976931348623157e308)


def test_mixed_magnitudes_on_the_axes(rng):
    points = rng.normal(size=(12, 3)) * [1e-12, 1.0, 1e12]
    for cutoff in (1e-12, 1.0, 1e12):
        check(points, cutoff)
        check(points, cutoff, [3e-12, 4.0, 5e12], [False, False, True])


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


def test_padding_with_a_constant_axis_changes_nothing(rng):
    for ndim in (2, 3, 4, 6):
        for kernel in hs.kernels():
            points = rng.random((60, ndim - 1))
            i, j, d = call(hs.pairs, points, 0.3, quantities="ijd", kernel=kernel)
            for constant in (0.0, 7.5, -1e300):
                padded = np.column_stack([points, np.full(60, constant)])
                more = call(hs.pairs, padded, 0.3, quantities="ijd", kernel=kernel)
                assert as_set(more[0], more[1]) == as_set(i, j)
                assert sorted(more[2].tolist()) == sorted(d.tolist())


def test_wide_box_in_one_dimension(rng):
    # Far more cells than points may exist along one axis; the time must not depend on it.
    points = np.sort(rng.uniform(0, 1e9, 400))[:, None]
    check_large(points, 1e6, [1e9])
    check_large(points, 1.0, [1e9])
    check_large(points, 1e-6)


# ---- large scenes ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_thousands_of_points_in_every_kind_of_box(kind, rng):
    for n, ndim, neighbours in ((6000, 3, 12), (4000, 2, 20), (3000, 4, 6)):
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


def test_points_in_any_order(rng):
    points, cutoff, box, _ = random_scene(rng, 4000, 3, "orthorhombic", neighbours=15)
    for order in (np.argsort(points[:, 0]), np.argsort(-points[:, 2]), rng.permutation(4000)):
        check_large(points[order], cutoff, box)


def test_far_from_home(rng):
    # Everything displaced by far more than its size; the coordinates keep few digits.
    points, cutoff, box, _ = random_scene(rng, 3000, 3, "triclinic", neighbours=10)
    for offset in (1e3, 1e6, 1e9):
        check_large(points + offset, cutoff, box)
        check_large(points + offset, cutoff)
    assert hs.count_pairs(points + 1e14, cutoff) > 0


# ---- order -------------------------------------------------------------------------------------


def assert_ascending(i, j, S):
    rows = np.concatenate([i[:, None], j[:, None], S], axis=1).tolist()
    assert rows == sorted(rows)


def test_sorted_when_one_pair_of_points_occurs_with_many_shifts():
    for kernel in hs.kernels():
        i, j, S = call(hs.pairs,
            [[0.1, 0.2], [0.6, 0.9], [0.3, 0.3]], 3.0, box=[1.0, 1.0], quantities="ijS",
            sort=True, kernel=kernel,
        )  # fmt: skip
        assert len(i) > 100
        assert (S < 0).any() and (S > 1).any()
        assert_ascending(i, j, S)


@pytest.mark.parametrize("ndim", [1, 2, 3, 6])
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


def test_the_order_is_the_same_in_each_run_of_the_interpreter(rng):
    script = """
import hashlib
import numpy as np
import halfshell as hs
points = np.random.default_rng(5).random((3000, 3))
found = hs.pairs(points, 0.08, box=[1.0, 1.0, 1.0], quantities="ijSdD")
print(hashlib.sha256(b"".join(a.tobytes() for a in found)).hexdigest())
"""
    runs = [
        subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    ]
    assert runs[0] == runs[1] and len(runs[0].strip()) == 64


def test_results_do_not_depend_on_earlier_searches(rng):
    # Recycled memory must not leak from one search into the next.
    points, cutoff, box, _ = random_scene(rng, 200, neighbours=20)
    first = hs.pairs(points, cutoff, box=box, quantities="ijSdD")
    for n in (1000, 3, 50):
        hs.pairs(rng.random((n, 2)), 0.3, quantities="ijdD")
    assert same_arrays(hs.pairs(points, cutoff, box=box, quantities="ijSdD"), first)


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
