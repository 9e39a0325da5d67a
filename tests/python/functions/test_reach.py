# SPDX-License-Identifier: BSD-3-Clause
"""A reach for each pair, by radii, types and supports, against rational arithmetic: in boxes of any
shape, at any scale, at the last bit."""

import math
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from calls import call
from full_lists import entries, same_tables
from oracles import same_arrays
from reach_scenes import (
    RULES,
    SYMMETRIC,
    Reaching,
    boxed,
    check,
    distance_is_the_rounded_sum,
    touching,
)


@pytest.mark.parametrize("rule", RULES)
def test_radii_larger_than_the_box(rule, rng):
    for kind in ("periodic", "mixed", "triclinic", "sheared"):
        points, scene = boxed(rng, kind, 2, 5, length=1.0)
        radii = np.array([1.7, 0.4, 0.0, 0.9, 1e-3])
        found = check(Reaching(points, radii=radii, rule=rule, **scene))
        # The first point sees its own images, except within the radius of another.
        assert any(i == j == 0 for i, j, _ in found)
        check(Reaching(points, None, 2, radii=radii, rule=rule, **scene))
    for ndim, n, large in ((1, 6, 20.0), (2, 4, 3.0), (3, 2, 1.5)):
        box = np.diag(rng.uniform(0.5, 1.0, ndim)) + 7.3 * np.eye(ndim, k=-1)
        one = Reaching(rng.random((n, ndim)) * 1000.0, radii=np.full(n, large), rule=rule, box=box)
        check(one)
        check(one.but(periodic=np.arange(ndim) == 0))
        check(one.but(cutoff=0.5, inclusive=False))


@pytest.mark.parametrize("rule", RULES)
def test_equal_radii_are_one_cutoff(rule, rng):
    points, scene = boxed(rng, "triclinic", 3, 60)
    marks, cutoff = {"radii": np.full(60, 0.25), "rule": rule}, 0.5 if rule == "sum" else 0.25
    for kernel in hs.kernels():
        how = {"box": scene["box"], "kernel": kernel}
        table = call(hs.neighbors, points, None, quantities="jSdD", **marks, **how)
        assert same_tables(table, call(hs.neighbors, points, cutoff, quantities="jSdD", **how))
        if rule in SYMMETRIC:
            how |= {"quantities": "ijSdD", "sort": True}
            one, other = (
                call(hs.pairs, points, None, **marks, **how),
                call(hs.pairs, points, cutoff, **how),
            )
            assert same_arrays(one, other)


@pytest.mark.parametrize("rule", RULES)
def test_ratios_of_sizes(rule, rng):
    """Clusters of every size, each in the middle of the next larger ball."""
    for ratio in (1e6, 1e300):
        sizes = np.geomspace(1.0, 1.0 / ratio, 6)
        points = np.concatenate([size * rng.random((5, 2)) for size in sizes])
        radii = np.repeat(sizes, 5) * rng.uniform(0.2, 0.8, 30)
        assert check(Reaching(points, radii=radii, rule=rule))
        assert check(Reaching(points, None, 13, radii=radii, rule=rule))
        if ratio < 1e7:
            box = np.array([[2.0, 0.0], [0.3, 2.0]])
            assert check(Reaching(points, radii=radii, rule=rule, box=box))


# ---- drawn scenes, and scenes moved by whole box vectors ---------------------------------------


def entries_of(scene):
    return entries(call(hs.neighbors, **scene.arguments, quantities="jS"))


def test_whole_box_vectors_change_shifts_alone(rng):
    for rule in RULES:
        box = np.array([[4.0, 0.0], [1.0, 3.0]])
        points, radii = rng.integers(0, 32, (40, 2)) / 8.0, rng.integers(0, 9, 40) / 8.0
        moves = rng.integers(-1000, 1001, (40, 2))
        home = Reaching(points, radii=radii, rule=rule, box=box)
        away = home.but(points=points + moves @ box)
        expected = sorted(
            (i, j, tuple(int(s) for s in np.array(S) + moves[i] - moves[j]))
            for i, j, S in entries_of(home)
        )
        assert entries_of(away) == expected


# ---- decided exactly ---------------------------------------------------------------------------


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
                assert call(hs.count_pairs, points, None, **how) == touches
        # Rounded, the sum is the larger distance: single and double precision say so.
        how = {"radii": [0.1, 0.2], "precision": "double"}
        assert call(hs.count_pairs, [[0.0], [0.30000000000000004]], None, **how) == 1


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
                i, d = call(hs.pairs, points, None, quantities="id", **how)
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


def test_the_other_precisions_find_ties_that_they_can_tell(rng):
    for kernel in hs.kernels():
        points, radii = touching(rng, 24, 2)  # sums of eighths are exact in every precision
        exact = call(hs.pairs, points, None, radii=radii, sort=True, kernel=kernel)
        for precision in ("double", "single"):
            found = call(
                hs.pairs, points, None, radii=radii, sort=True, kernel=kernel, precision=precision
            )
            assert all(np.array_equal(a, b) for a, b in zip(exact, found))
