# SPDX-License-Identifier: BSD-3-Clause
"""Scenes with many cells, crowded cells or many images, against the second oracle."""

import numpy as np
import pytest

import halfshell as hs
from oracles import BOX_KINDS, check_large, lattice, random_box, random_scene, rotation


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


@pytest.mark.slow
def test_many_images(rng):
    for kind in BOX_KINDS:
        box = random_box(rng, kind)
        check_large(rng.random((4, 3)) @ box, 5.5, box)
    check_large(rng.random((40, 2)), 9.0, [1.0, 1.0])
    check_large(rng.random((30, 1)), 300.0, [1.0])
    check_large(rng.random((60, 3)), 40.0, [1.0, 90.0, 90.0])


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


def test_shells_and_sheets(rng):
    # Points on surfaces leave most cells empty.
    sphere = rng.normal(size=(3000, 3))
    sphere /= np.linalg.norm(sphere, axis=1)[:, None]
    check_large(sphere, 0.1)
    sheet = rng.random((3000, 3)) * [1, 1, 1e-9]
    check_large(sheet, 0.04)
    check_large(sheet, 0.04, [1.0, 1.0, 1e-9 * 4e8])


def test_a_large_rotated_crystal(rng):
    points, box = lattice("fcc", (12, 11, 13))
    turn = rotation(rng)
    for cutoff in (2.0**0.5, 2.0):
        check_large(points @ turn, cutoff, box @ turn)
        check_large(points @ turn, cutoff, inclusive=False)


def test_far_from_home(rng):
    # Everything displaced by far more than its size; the coordinates keep few digits.
    points, cutoff, box, _ = random_scene(rng, 3000, 3, "triclinic", neighbours=10)
    for offset in (1e3, 1e6, 1e9):
        check_large(points + offset, cutoff, box)
        check_large(points + offset, cutoff)
    assert hs.count_pairs(points + 1e14, cutoff) > 0


def test_points_in_many_boxes(rng):
    for spread in (10, 1e4, 1e8):
        points, cutoff, box, _ = random_scene(rng, 2000, 3, "rotated", 10, spread)
        check_large(points, cutoff, box)
