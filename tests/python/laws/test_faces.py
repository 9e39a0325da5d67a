# SPDX-License-Identifier: BSD-3-Clause
"""Points on faces of the box and of cells, and one ulp beside them, near and far from home.

A point at a face belongs to one side by a rounding decision; the pairs must not depend on
which. Lengths such as 0.1 make every multiple of the box length a rounded number.
"""

import itertools
import math

import numpy as np
import pytest

import halfshell as hs
from calls import call
from halfshell._check.reference import reference_pairs
from oracles import check, check_large, random_box

LENGTHS = [1.0, 0.1, 1 / 3, math.pi, 0.7, 3.0, 1e-3]


def beside(x, steps=(-2, -1, 0, 1, 2)):
    """x and its neighbours among the floats."""
    values = []
    for count in steps:
        y = x
        for _ in range(abs(count)):
            y = math.nextafter(y, math.copysign(math.inf, count))
        values.append(y)
    return values


@pytest.mark.parametrize("boxes", [0, 1, -1, 2, 1000, -1000, 10**9, -(10**9)])
def test_points_at_a_face_and_an_ulp_beside_it(boxes):
    for length in LENGTHS:
        on_face = boxes * length
        inside = [length / 2, length * 0.01, length * 0.99]
        points = np.array(beside(on_face) + inside)[:, None]
        spacing = abs(math.ulp(on_face)) if boxes else 5e-324
        for cutoff in (0.0, spacing, 2 * spacing, length / 100, length / 3, length, 1.5 * length):
            for inclusive in (True, False):
                check(points, cutoff, [length], inclusive=inclusive)


@pytest.mark.parametrize("length", LENGTHS)
def test_tiny_negative_coordinates(length):
    # x - floor(x / L) * L is exactly L for these in rounded arithmetic.
    tiny = [-5e-324, -4.4e-52, -1e-17, -1e-20, -(2.0**-54), -(2.0**-53), 5e-324, 0.0, -0.0]
    points = np.array([*tiny, length * 0.02, length * 0.98, length, -length])[:, None]
    for cutoff in (0.0, 1e-17, length * 0.02, length * 0.04, length * 0.5):
        check(points, cutoff, [length])
        check(np.repeat(points, 2, axis=1)[::2], cutoff, [length, length])


@pytest.mark.parametrize("boxes", [0, 1, -3, 10**6, 10**9])
def test_faces_of_skewed_boxes(boxes, rng):
    for kind in ("triclinic", "rotated", "left-handed", "sheared"):
        box = random_box(rng, kind)
        fractions = [0.0, 1.0, 0.5]
        points = np.array(list(itertools.product(fractions, repeat=3)))[::2] @ box
        points = points + boxes * box.sum(axis=0)
        points = np.concatenate([points, np.nextafter(points[:6], np.inf)])
        for cutoff in (0.0, 1e-15, 0.5, float(np.linalg.norm(box[0]))):
            check(points, cutoff, box)


@pytest.mark.parametrize("away", [0.0, 1e3, 1e6, 1e9, 1e12])
def test_walls_of_many_cells(away):
    # As above, with enough points that the search does use a grid, far from home, too.
    for cutoff, count in ((1.0, 200), (0.1, 150), (1 / 3, 100)):
        walls = np.arange(count) * cutoff + away * cutoff
        line = np.sort(
            np.concatenate([walls, np.nextafter(walls, -1e99), np.nextafter(walls, 1e99)])
        )
        for reach in (cutoff, 2 * cutoff, math.nextafter(3 * cutoff, 0)):
            check_large(line[:, None], reach)
            check_large(line[:, None], reach, [count * cutoff])
            plane = np.stack([line, line[::-1] * 0.7], axis=1)
            check_large(plane, reach, [count * cutoff, count * cutoff * 0.7])
            skewed = [[count * cutoff, 0.0], [0.3 * cutoff, count * cutoff * 0.7]]
            check_large(plane, reach, skewed)


@pytest.mark.parametrize("boxes", [1, 10**3, 10**6, 10**9, 10**12])
def test_far_points_meet_near_ones_across_faces(boxes, rng):
    # One half of the points is moved by whole boxes, rounded: what counts is where they are.
    length = 0.7
    points = rng.random((12, 3)) * length
    points[:4, 0] = [0.0, math.nextafter(length, 0), length, length / 2]
    points[6:] += boxes * length * rng.integers(-1, 2, (6, 3))
    expected = [[i, j] for i, j, _ in reference_pairs(points, 0.3, [length] * 3)]
    for kernel in hs.kernels():
        found = call(hs.pairs, points, 0.3, box=[length] * 3, quantities="P", kernel=kernel)
        assert sorted(found.tolist()) == expected
    if boxes <= 10**9:  # the shifts fit into int32
        check(points, 0.3, [length] * 3)


def test_points_billions_of_boxes_away_keep_all_their_pairs():
    for kernel in hs.kernels():
        # Beyond 2**31 boxes: a 64-point lattice, spacing exactly representable.
        steps = np.array(list(itertools.product(range(4), repeat=3)), float) * 0.75
        expected = call(hs.count_pairs, steps, 0.75, box=[3.0, 3.0, 3.0], kernel=kernel)
        assert expected == 64 * 3
        for away in (2.0**31, 2.0**33, -(2.0**40)):
            moved = steps + 3.0 * away
            d = call(hs.pairs, moved, 0.75, box=[3.0] * 3, quantities="d", kernel=kernel)
            assert len(d) == expected
            assert (d == 0.75).all()


def test_an_ulp_decides_across_a_face():
    # The gap across the face is exactly the cutoff, then one ulp wider.
    for length in LENGTHS:
        gap = length / 8
        points = np.array([[0.0], [length - gap]])
        exact = length - (length - gap)  # Sterbenz: no rounding
        assert len(check(points, exact, [length])) == 1
        assert check(points, math.nextafter(exact, 0), [length]) == set()
        assert check(points, exact, [length], inclusive=False) == set()
