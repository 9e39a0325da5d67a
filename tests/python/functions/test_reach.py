# SPDX-License-Identifier: BSD-3-Clause
"""A reach for each pair, by radii and types: decided at the last bit, in scenes too large for
rational arithmetic, and as `verify` sees it."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from calls import call
from definition import RULES, SYMMETRIC, check
from halfshell._check.right import Right
from oracles import random_box, same_arrays
from refused_calls import assert_refused

SHEARED = [[3.0, 0.0], [0.5, 2.5]]


@pytest.mark.parametrize("rule", RULES)
def test_ratios_of_sizes(rule, rng):
    """Clusters of every size, each in the middle of the next larger ball."""
    for ratio in (1e6, 1e300):
        sizes = np.geomspace(1.0, 1.0 / ratio, 6)
        points = np.concatenate([size * rng.random((5, 2)) for size in sizes])
        balls = hs.Points(points, radii=np.repeat(sizes, 5) * rng.uniform(0.2, 0.8, 30))
        assert check(balls, None, rule=rule)
        assert check(balls[13:], None, balls[:13], rule=rule)
        if ratio < 1e7:
            assert check(balls.replace(box=[[2.0, 0.0], [0.3, 2.0]]), None, rule=rule)


# ---- decided exactly ---------------------------------------------------------------------------


def touching(rng, n, ndim):
    """Balls on a dyadic grid, many of which touch exactly: their sums are distances."""
    return rng.integers(-8, 9, (n, ndim)) / 4.0, rng.integers(0, 7, n) / 8.0


@pytest.mark.parametrize("rule", RULES)
def test_radii_a_hair_beside_the_tie(rule, rng):
    for inclusive in (True, False):
        points, radii = touching(rng, 24, 2)
        moved = np.nextafter(radii, rng.choice([0.0, 9.0], 24))
        radii = np.where((rng.random(24) < 0.3) & (radii > 0.0), moved, radii)
        points = np.where(rng.random(points.shape) < 0.1, np.nextafter(points, 9.0), points)
        balls, how = hs.Points(points, radii=radii), {"rule": rule, "inclusive": inclusive}
        check(balls.replace(box=SHEARED), None, **how)
        check(balls[12:], None, balls[:12], **how)


def test_one_and_two_tenths_touch_three_tenths_by_their_real_sum():
    for kernel in hs.kernels():
        for distance, touches in ((0.3, True), (0.30000000000000004, False)):
            assert (Fraction(distance) <= Fraction(0.1) + Fraction(0.2)) == touches
            for inclusive in (True, False):
                how = {"radii": [0.1, 0.2], "inclusive": inclusive, "kernel": kernel}
                assert call(hs.count_pairs, [[0.0], [distance]], None, **how) == touches
        # Rounded, the sum is the larger distance: single and double precision say so.
        how = {"radii": [0.1, 0.2], "precision": "double"}
        assert call(hs.count_pairs, [[0.0], [0.30000000000000004]], None, **how) == 1


@pytest.mark.parametrize("rule", ["sum", "mean"])
def test_distances_at_rounded_sums(rule, rng):
    for kernel in hs.kernels():
        answers = set()
        for _ in range(60):
            a, b = rng.random(2) * 2.0 ** rng.integers(-3, 3, 2)
            points, real = [[0.0], [a + b]], Fraction(a) + Fraction(b)
            radii = np.array([a, b]) * (1 if rule == "sum" else 2)
            touches = Fraction(a + b) <= real
            for inclusive in (True, False):
                expected = touches and (inclusive or Fraction(a + b) != real)
                how = {"radii": radii, "rule": rule, "inclusive": inclusive, "kernel": kernel}
                d = call(hs.pairs, points, None, quantities="d", **how)
                # Not beyond the rounded sum, but on it, also if a tie does not count.
                assert d.tolist() == [a + b] * expected
            answers.add(touches)
        assert answers == {True, False}


def test_sums_that_float64_cannot_tell_from_the_larger_radius():
    """A point just outside a ball, and dwarfs whose radius is less than half an ulp of it."""
    outside = math.nextafter(1.0, 2.0)
    gap = outside - 1.0
    for dwarf in (0.0, gap / 4.0, math.nextafter(gap, 0.0), gap, math.nextafter(gap, 1.0)):
        balls = hs.Points([[0.0, 0.0], [outside, 0.0]], radii=[1.0, dwarf])
        assert bool(check(balls, None)) == (dwarf >= gap)
        assert bool(check(balls, None, inclusive=False)) == (dwarf > gap)


def test_sums_of_scales_that_no_double_word_holds():
    """Only whole numbers see a radius of 5e-324 beside one of 1."""
    points = np.array([[0.0, 0.0], [1.0, 5e-324], [-1.0, 0.0]])
    for radii in ([1.0, 0.0, 0.0], [1.0, 5e-324, 0.0], [1.0, 5e-324, 5e-324]):
        balls = hs.Points(points, radii=radii)
        for inclusive, rule in itertools.product((True, False), ("sum", "max")):
            check(balls, None, inclusive=inclusive, rule=rule)
            check(balls[1:], None, balls[:1], inclusive=inclusive, rule=rule)


@pytest.mark.parametrize("power", [-1070, -1060, 500, 1019])
def test_scales_of_the_whole_scene(power, rng):
    points, radii = touching(rng, 20, 2)
    unit = 2.0**power
    radii = np.where(radii * unit / unit == radii, radii * unit, 0.0)
    for rule in RULES:
        if rule == "mean":
            radii = np.where(radii < 2.0**-1021, 0.0, radii)  # whose halves may be no float64
        check(hs.Points(np.round(points) * unit, radii=radii), None, rule=rule)
        slab = {"box": [4.0 * unit, 3.0 * unit], "periodic": [True, False]}
        check(hs.Points(points[:10] * unit, radii=radii[:10], **slab), None, rule=rule)


def test_the_other_precisions_find_ties_that_they_can_tell(rng):
    for kernel in hs.kernels():
        points, radii = touching(rng, 24, 2)  # sums of eighths are exact in every precision
        how = {"radii": radii, "sort": True, "kernel": kernel}
        exact = call(hs.pairs, points, None, **how)
        for precision in ("double", "single"):
            assert same_arrays(call(hs.pairs, points, None, precision=precision, **how), exact)


# ---- large scenes --------------------------------------------------------------------------

LARGE = {
    "two octaves": lambda n, rng: rng.uniform(0.5, 2.0, n),
    "lognormal": lambda n, rng: np.exp(0.7 * rng.normal(size=n)),
    "six decades": lambda n, rng: 3.0 * 10.0 ** -rng.uniform(0, 6, n),
    "one giant": lambda n, rng: np.where(np.arange(n) == n // 3, 12.0, 0.7),
    "two sizes": lambda n, rng: rng.choice([0.01, 2.0], n),
    "zero and one": lambda n, rng: rng.choice([0.0, 1.0], n),
}


@pytest.mark.parametrize(
    ("name", "rule", "is_open"),
    [
        *zip(LARGE, RULES, itertools.cycle([True, False])),
        *zip(LARGE, (*RULES[3:], *RULES[:3]), itertools.cycle([False, True])),
    ],
)
def test_large_scenes_are_right(name, rule, is_open, rng):
    n = 1000
    box = random_box(rng, "triclinic")
    radii = LARGE[name](n, rng) * 0.04 * (1 if rule == "sum" else 2)
    balls = hs.Points(rng.uniform(-0.5, 1.5, (n, 3)) @ box, radii=radii)
    points = balls if is_open else balls.replace(box=box)
    table = hs.neighbors(points, None, rule=rule, quantities="jS")
    verdict = hs.verify(points, None, table, rule=rule)
    assert verdict, str(verdict)
    assert verdict.n_expected > 0
    how = {"rule": rule, "queries": balls[:300]}
    assert hs.verify(points[300:], None, hs.neighbors(points[300:], None, **how), **how)
    if rule not in SYMMETRIC:
        return
    expected = hs.pairs(points, None, rule=rule, quantities="ijSdD")
    assert hs.verify(points, None, *expected[:3], rule=rule)
    for most, threads in ((1000, 1), (37, 2)):
        how = {"rule": rule, "max_pairs": most, "threads": threads, "quantities": "ijSdD"}
        blocks = list(hs.iter_pairs(points, None, **how))
        assert [len(block[0]) for block in blocks[:-1]] == [most] * (len(blocks) - 1)
        assert same_arrays(tuple(map(np.concatenate, zip(*blocks))), expected)


def test_many_types_in_a_large_scene(rng):
    points = hs.Points(rng.random((4000, 3)), box=1.0, types=rng.integers(0, 12, 4000))
    table = rng.uniform(0.0, 0.12, (12, 12))
    table = np.minimum(table, table.T)
    assert hs.verify(points, table, *hs.pairs(points, table, quantities="ijS"))
    again = hs.neighbors(points, table, quantities="jS")
    assert hs.verify(points, table, again)
    assert again.n_entries < hs.neighbors(points, 0.12).n_entries


def test_dwarfs_in_a_giant_cost_what_they_find(rng):
    """One giant over all: its pairs are n, not n squared, and so is the work."""
    n = 200_000
    points = rng.random((n, 3))
    radii = np.full(n, 1e-3)
    radii[7] = 2.0
    assert call(hs.count_pairs, points, None, radii=radii, threads=1) < 3 * n
    assert len(call(hs.pairs, points, None, radii=radii, quantities="i", memory_limit=2e8)) < 3 * n
    for search in (hs.pairs, hs.neighbors):
        with pytest.raises(MemoryError, match="fit"):
            call(search, points, None, radii=np.ones(n), memory_limit=1e8)


# ---- verified ----------------------------------------------------------------------------------

POINTS = [[0.0], [1.0], [3.0], [6.0]]
BALLS = hs.Points(POINTS, radii=[0.5, 0.5, 1.5, 0.0])  # the first two touch, and the next two


def test_faults_are_named():
    assert str(hs.verify(BALLS, None, [0, 2], [1, 1])) == "correct: 2 pairs"
    for i, j, kind, row in (
        ([0], [1], "missed", [1, 2]),
        ([0, 1, 2], [1, 2, 3], "spurious", [2, 3]),
        ([0, 1, 1], [1, 2, 0], "duplicate", [0, 1]),
    ):
        verdict = hs.verify(BALLS, None, i, j)
        assert not verdict and getattr(verdict, kind).tolist() == [row]
    assert hs.verify(BALLS, None, [], [], inclusive=False)
    assert hs.verify(BALLS, 1.5, [0], [1])


def test_faults_in_lists_with_a_direction():
    points, rule = BALLS.replace(radii=[1.0, 0.0, 2.0, 0.0]), {"rule": "gather"}
    assert hs.verify(points, None, [0, 2], [1, 1], **rule)
    verdict = hs.verify(points, None, [0, 1], [1, 2], **rule)
    assert verdict.missed.tolist() == [[2, 1]] and verdict.spurious.tolist() == [[1, 2]]
    assert hs.verify(points, None, [1, 1], [0, 2], rule="scatter")
    assert_refused(
        lambda: hs.verify(points, None, [0, 2], [1, 1], full=True, **rule), ValueError, "full"
    )
    table = hs.neighbors(points, None, **rule)
    assert hs.verify(points, None, table, **rule)
    assert not hs.verify(points, None, table, rule="scatter")
    assert_refused(lambda: hs.verify(points, None, table[:2], **rule), ValueError, "2 rows")
    assert_refused(lambda: hs.verify(BALLS, None, table), ValueError, "one set of points")


def test_differences_are_decided_again(monkeypatch):
    """A right list that is wrong would not stand against rational arithmetic."""
    rows = Right.rows
    monkeypatch.setattr(Right, "rows", lambda *given, **how: rows(*given, **how)[1:])
    with pytest.raises(AssertionError, match="rational arithmetic disagree"):
        hs.verify(BALLS, None, [0, 1], [1, 2], [[0], [0]])
