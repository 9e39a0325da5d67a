# SPDX-License-Identifier: BSD-3-Clause
"""Pairs that float32 cannot tell, in batches of every size: in one image, in several, and in
neighbourhoods of which only some have one."""

from itertools import product
from math import isqrt

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import same_arrays

RADIUS = 32045  # the square is a sum of two squares in 324 ways, with signs and order
UPPER = [(x, isqrt(RADIUS**2 - x * x)) for x in range(-RADIUS, RADIUS + 1)]
UPPER = [(x, y) for x, y in UPPER if x * x + y * y == RADIUS**2]
RING = np.array([*UPPER, *((x, -y) for x, y in UPPER if y > 0)], float)


def by_all(search):
    """What every kernel finds, with one thread and with two."""
    first, *others = [search(kernel=k, threads=t) for k, t in product(hs.kernels(), (1, 2))]
    assert all(same_arrays(first, other) for other in others)
    return first


@pytest.mark.parametrize("box", [None, [2.0**18, 2.0**18]], ids=["open", "across faces"])
@pytest.mark.parametrize("m", [1, 7, 8, 9, 16, 127, 128, 129])
def test_points_on_a_circle_about_one(m, box):
    """Every third one an ulp outside."""
    points = np.zeros((m + 1, 2))
    points[1:] = np.random.default_rng(m).permutation(RING)[:m]
    outside = np.arange(1, m + 1, 3)
    points[outside] = np.nextafter(points[outside], 2.0 * points[outside])
    i, j = by_all(lambda **how: call(hs.pairs, points, float(RADIUS), box=box, sort=True, **how))
    assert set(j[i == 0].tolist()) == set(range(1, m + 1)) - set(outside.tolist())
    assert hs.explain(points, float(RADIUS), box=box, measure=True).measured["ambiguous"] == m


@pytest.mark.parametrize(("a", "b"), [(1, 129), (8, 9), (16, 16), (9, 127), (40, 40)])
def test_crowds_that_are_the_cutoff_apart_across_a_face(a, b):
    points = np.repeat([[0.5, 0.5, 0.5], [29.5, 28.5, 0.5]], [a, b], axis=0)
    points[::2] += [64.0, 0.0, -32.0]
    box, own = [32.0] * 3, a * (a - 1) // 2 + b * (b - 1) // 2
    found = by_all(lambda **how: call(hs.pairs, points, 5.0, box=box, quantities="ijS", **how))
    assert len(found[0]) == own + a * b
    assert hs.count_pairs(points, 5.0, box=box, inclusive=False) == own
    around = [np.nextafter(5.0, 0.0), 5.0, np.nextafter(5.0, 6.0)]
    counts = hs.count_pairs(points, around, box=box)
    assert counts.tolist() == [own, own + a * b, own + a * b]
    counts = hs.pair_histogram(points, [0.0, 4.0, 5.0, 6.0], box=box)
    assert counts.tolist() == [own, 0, a * b]


@pytest.mark.parametrize("periodic", [(True, False, False), (True, True, False), (True,) * 3])
def test_a_lattice_of_which_only_some_groups_have_images(periodic):
    """Every pair is a tie, and points are up to a million boxes away."""
    rng, shape = np.random.default_rng(0), (12, 3, 3)
    points = rng.permutation(np.array(list(np.ndindex(shape)), float))
    box = np.diag(np.array(shape, float))
    points += (rng.integers(-(2**20), 2**20, points.shape) * periodic) @ box
    how = {"box": box, "periodic": periodic}
    i, _, _, d = by_all(
        lambda **by: call(hs.pairs, points, 1.0, quantities="ijSd", sort=True, **how, **by)
    )
    n = len(points)
    expected = sum(n if p else n * (k - 1) // k for p, k in zip(periodic, shape, strict=True))
    assert len(i) == expected and (d == 1.0).all()
    assert call(hs.count_pairs, points, np.nextafter(1.0, 0.0), **how) == 0
    assert call(hs.coordination, points, 1.0, **how).sum() == 2 * expected
