# SPDX-License-Identifier: BSD-3-Clause
"""Radii that meet exactly: ties of sums, sums that rounding moves, distances to the last place."""

import math
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from reach_scenes import (
    RULES,
    SYMMETRIC,
    Reaching,
    assert_last_place,
    boxed,
    check,
    distance_is_the_rounded_sum,
    spread_radii,
    touching,
)


@pytest.mark.parametrize("rule", RULES)
def test_balls_that_touch_exactly(rule, rng):
    for inclusive in (True, False):
        for ndim in (1, 2, 3):
            points, radii = touching(rng, 24, ndim)
            one = Reaching(points, radii=radii, rule=rule, inclusive=inclusive)
            check(one)
            check(one.but(n_queries=10))
            check(one.but(box=np.full(ndim, 3.0)))
            check(one.but(points=points.astype(np.float32)))


@pytest.mark.parametrize("rule", RULES)
def test_radii_a_hair_beside_the_tie(rule, rng):
    for inclusive in (True, False):
        points, radii = touching(rng, 24, 2, hair=True)
        points = np.where(rng.random(points.shape) < 0.1, np.nextafter(points, 9.0), points)
        one = Reaching(points, radii=radii, rule=rule, inclusive=inclusive)
        check(one)
        check(one.but(box=[[3.0, 0.0], [0.5, 2.5]]))
        check(one.but(n_queries=12))


def test_one_and_two_tenths_touch_three_tenths_by_their_real_sum():
    for kernel in hs.kernels():
        for distance, touches in ((0.3, True), (0.30000000000000004, False)):
            assert (Fraction(distance) <= Fraction(0.1) + Fraction(0.2)) == touches
            points = [[0.0], [distance]]
            for inclusive in (True, False):
                how = {"radii": [0.1, 0.2], "inclusive": inclusive, "kernel": kernel}
                assert hs.count_pairs(points, None, **how) == touches
        # Rounded, the sum is the larger distance: single and double precision say so.
        how = {"radii": [0.1, 0.2], "precision": "double"}
        assert hs.count_pairs([[0.0], [0.30000000000000004]], None, **how) == 1


@pytest.mark.parametrize("rule", ["sum", "mean"])
def test_distances_at_rounded_sums(rule, rng):
    for kernel in hs.kernels():
        answers = set()
        for _ in range(60):
            a, b = rng.random(2) * 2.0 ** rng.integers(-3, 3, 2)
            points, touches = distance_is_the_rounded_sum(a, b)
            radii = np.array([a, b]) * (1 if rule == "sum" else 2)
            exact = Fraction(a) + Fraction(b) == Fraction(a + b)
            for inclusive in (True, False):
                expected = touches and (inclusive or not exact)
                how = {"radii": radii, "rule": rule, "inclusive": inclusive, "kernel": kernel}
                i, d = hs.pairs(points, None, quantities="id", **how)
                assert len(i) == expected
                # Not beyond the rounded sum, but on it, also if a tie does not count.
                assert d.tolist() == [a + b] * expected
            answers.add(touches)
        assert answers == {True, False}


def test_sums_that_float64_cannot_tell_from_the_larger_radius():
    """A point just outside a ball, and dwarfs whose radius is less than half an ulp of it."""
    outside = math.nextafter(1.0, 2.0)
    gap = outside - 1.0
    for dwarf in (0.0, gap / 4.0, math.nextafter(gap, 0.0), gap, math.nextafter(gap, 1.0)):
        points = np.array([[0.0, 0.0], [outside, 0.0]])
        for inclusive in (True, False):
            one = Reaching(points, radii=[1.0, dwarf], inclusive=inclusive)
            found = check(one)
            assert len(found) == (dwarf >= gap if inclusive else dwarf > gap)


def test_sums_of_scales_that_no_double_word_holds():
    """Only whole numbers see a radius of 5e-324 beside one of 1."""
    points = np.array([[0.0, 0.0], [1.0, 5e-324], [-1.0, 0.0]])
    for radii in ([1.0, 0.0, 0.0], [1.0, 5e-324, 0.0], [1.0, 5e-324, 5e-324]):
        for inclusive in (True, False):
            one = Reaching(points, radii=radii, inclusive=inclusive)
            check(one)
            check(one.but(rule="max"))
            check(one.but(n_queries=1))


@pytest.mark.parametrize("rule", RULES)
def test_zero_radii(rule, rng):
    points = rng.integers(0, 3, (20, 2)).astype(float)
    for inclusive in (True, False):
        nobody = Reaching(points, radii=np.zeros(20), rule=rule, inclusive=inclusive)
        found = check(nobody)
        assert bool(found) == inclusive
        some = nobody.but(radii=np.where(np.arange(20) % 3, 0.0, 1.0))
        check(some)
        check(some.but(n_queries=9))
        check(some.but(box=[3.0, 3.0]))


@pytest.mark.parametrize("power", [-1070, -1060, -700, -540, 500, 700, 1019])
def test_scales_of_the_whole_scene(power, rng):
    points, radii = touching(rng, 20, 2)
    points[:8] = np.round(points[:8])
    unit = 2.0**power
    points, radii = points * unit, np.where(radii * unit / unit == radii, radii * unit, 0.0)
    for rule in RULES:
        if rule == "mean":
            radii = np.where(radii < 2.0**-1021, 0.0, radii)  # whose halves may be no float64
        for inclusive in (True, False):
            check(Reaching(points, radii=radii, rule=rule, inclusive=inclusive))
        box, periodic = np.diag([4.0 * unit, 3.0 * unit]), [True, False]
        check(Reaching(points[:10], radii=radii[:10], rule=rule, box=box, periodic=periodic))


@pytest.mark.parametrize("kind", ["open", "triclinic"])
@pytest.mark.parametrize("rule", SYMMETRIC)
def test_distances_and_vectors_to_the_last_place(kind, rule, rng):
    for kernel in hs.kernels():
        points, scene = boxed(rng, kind, 3, 25)
        radii = spread_radii(rng, 25, 0.4 if rule == "sum" else 1.0, 1.0)
        one = Reaching(points, radii=radii, rule=rule, **scene)
        i, j, S, d, D = hs.pairs(**one.arguments, quantities="ijSdD", kernel=kernel)
        assert len(i) > 10
        assert_last_place(one, i, j, S, d)
        plain = hs.pairs(points, 1.0, **scene, quantities="ijSdD", kernel=kernel)
        known = {
            (a, b, tuple(s)): (x, v)
            for a, b, s, x, v in zip(*(column.tolist() for column in plain), strict=True)
        }
        for a, b, s, x, v in zip(*(column.tolist() for column in (i, j, S, d, D)), strict=True):
            assert known[a, b, tuple(s)] == (x, v)


def test_the_other_precisions_find_ties_that_they_can_tell(rng):
    for kernel in hs.kernels():
        points, radii = touching(rng, 24, 2)  # sums of eighths are exact in every precision
        exact = hs.pairs(points, None, radii=radii, sort=True, kernel=kernel)
        for precision in ("double", "single"):
            found = hs.pairs(
                points, None, radii=radii, sort=True, kernel=kernel, precision=precision
            )
            assert all(np.array_equal(a, b) for a, b in zip(exact, found))
