# SPDX-License-Identifier: BSD-3-Clause
"""The truth of the report against full rational brute force, where every trick could fail."""

import math

import numpy as np
import pytest

from halfshell._check.reference import reference_pairs
from halfshell_report.integers import (
    nearest_root,
)
from halfshell_report.truth import true_pairs
from oracles import BOX_KINDS, lattice, random_scene, rotation

pytestmark = pytest.mark.slow


def assert_true(points, cutoff, box=None, periodic=None):
    """Both rules give what rational arithmetic over all points gives; returns the truth."""
    truth = true_pairs(points, cutoff, box, periodic)
    for inclusive in (True, False):
        found = truth.by_rule(inclusive)
        rows = sorted(zip(found.i.tolist(), found.j.tolist(), map(tuple, found.S.tolist())))
        assert rows == reference_pairs(points, cutoff, box, periodic, inclusive)
    return truth


@pytest.mark.parametrize("ndim", [1, 2, 3, 4, 6, 8])
@pytest.mark.parametrize("kind", BOX_KINDS)
def test_random_scenes_in_boxes_of_every_kind(ndim, kind, rng):
    for _ in range(3):
        flags = rng.random(ndim) < 0.7
        n = 20 if ndim < 4 else 5
        assert_true(*random_scene(rng, n, ndim, kind, 4, spread=3, periodic=flags))


@pytest.mark.parametrize("name", ["sc", "fcc", "hcp"])
def test_ties_on_lattices_straight_and_rotated(name, rng):
    points, box = lattice(name, (3, 2, 2))
    shells = {"sc": 2.0, "fcc": 2.0, "hcp": 18.0}
    truth = assert_true(points, math.sqrt(shells[name]), box)
    if name == "fcc":
        assert assert_true(points, 2.0, box).tie.any()
    turn = rotation(rng)
    turned = assert_true(points @ turn, math.sqrt(shells[name]), box @ turn)
    assert turned.n_by_integers > 0 and truth.n_by_integers > 0


def test_ties_at_any_scale(rng):
    points, box = lattice("sc", (3, 3, 2))
    for scale in (2.0**-1074, 5e-324, 1e-310, 1e-150, 1e150, 2.0**1020):
        scaled = points * scale
        assert assert_true(scaled, 1.0 * scale, box * scale).tie.any()
        assert assert_true(scaled, 1.0 * scale).tie.any()


def test_mixed_scales():
    points = np.array([[1e300, 0.0], [1e300, 1e-300], [-1e300, 0.0], [5e-324, 0.0], [0.0, 0.0]])
    for cutoff in (0.0, 5e-324, 1e-300, 1.0, 1e300, 1.7e308):
        assert_true(points, cutoff)
    assert_true(np.array([[1e300, 0.25], [1e290, 0.5], [0.1, 0.125]]), 1.0, [3.0, 1.0])
    assert_true(np.array([[1e300, 0.25], [1e300, 0.5]]), 0.25, [0.0, 1.0], [False, True])
    assert_true(np.array([[0.0], [1e-200], [1.0]]), 1e-200, [1.0])


@pytest.mark.parametrize("offset", [1e6, 1e15, -(2.0**53)])
def test_far_from_the_origin_and_many_boxes_away(offset, rng):
    points = rng.random((25, 3)) * 3.0
    assert_true(points + offset, 1.0)
    assert_true(points + offset, 1.0, [3.0, 2.0, 3.0])
    assert_true(points + offset, 1.0, [3.0, 2.0, 0.0], [True, True, False])
    box = np.array([[3.0, 0.0, 0.0], [0.1, 2.0, 0.0], [0.5, -0.7, 3.0]])
    assert_true(points + offset, 1.0, box)
    assert_true(points + offset, 1.0, box, [True, False, True])
    assert_true(points + rng.integers(-3, 4, (25, 3)) * offset, 1.0, box)


def test_boxes_sheared_by_millions_of_widths(rng):
    box = np.array([[1.0, 0.0, 0.0], [1e6, 1.0, 0.0], [-3e6, 7e5, 1.1]])
    assert_true(rng.random((6, 3)), 0.6, box)
    assert_true(rng.random((6, 3)) @ box, 0.6, box)
    assert_true(rng.random((6, 2)), 0.6, [[1.0, 2.0**40], [0.0, 1.0]])


def test_near_ties_of_an_ulp():
    for steps in (-2, -1, 0, 1, 2):
        x = 0.3 + steps * math.ulp(0.3)
        assert_true(np.array([[0.0], [x], [0.1 + 0.2]]), 0.3, [1.0])
        assert_true(np.array([[0.1], [0.1 + x]]), 0.3)


def test_dependent_rows_are_refused():
    with pytest.raises(ValueError, match="linearly dependent"):
        true_pairs(np.zeros((1, 2)), 1.0, [[1.0, 2.0], [2.0, 4.0]])


def test_roots_are_rounded_once(rng):
    for square in [*rng.integers(1, 2**62, 200).tolist(), 3, 10**40, 2**400 + 1]:
        assert nearest_root(square * square, -3) == square / 8
        root = nearest_root(square, 0)
        below, above = math.nextafter(root, 0.0), math.nextafter(root, math.inf)
        # root is nearest if the middles to its neighbours lie on both sides of the true root
        assert (_int_sum(below, root)) ** 2 <= 4 * square * 4**60 <= (_int_sum(root, above)) ** 2


def _int_sum(a, b):
    (p, q), (r, s) = a.as_integer_ratio(), b.as_integer_ratio()
    return (p * s + r * q) * 2**60 // (q * s)
