# SPDX-License-Identifier: BSD-3-Clause
"""A radius for each point: every rule, in every box, against rational arithmetic."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import halfshell as hs
from full_lists import entries, same_tables
from oracles import same_arrays
from reach_scenes import (
    BOXES,
    RULES,
    SYMMETRIC,
    Reaching,
    boxed,
    check,
    spread_radii,
)
from scene_strategies import scenes


@pytest.mark.parametrize("kind", BOXES)
@pytest.mark.parametrize("rule", RULES)
def test_one_set_equals_the_definition(kind, rule, rng):
    for ndim in (1, 2, 3, 4):
        points, scene = boxed(rng, kind, ndim, 16)
        largest = {1: 0.3, 2: 0.3, 3: 0.3, 4: 0.25}[ndim] * (1 if rule == "sum" else 2)
        for decades, inclusive in ((0.5, True), (6.0, False)):
            radii = spread_radii(rng, 16, largest, decades)
            scene |= {"inclusive": inclusive}
            check(Reaching(points, radii=radii, rule=rule, **scene))


@pytest.mark.parametrize("kind", BOXES)
@pytest.mark.parametrize("rule", RULES)
def test_two_sets_equal_the_definition(kind, rule, rng):
    for ndim in (1, 2, 3):
        for q, n, decades in ((1, 12, 0.5), (8, 8, 3.0), (14, 2, 6.0)):
            points, scene = boxed(rng, kind, ndim, q + n)
            radii = spread_radii(rng, q + n, 0.3 if rule == "sum" else 0.6, decades)
            check(Reaching(points, None, q, radii=radii, rule=rule, **scene))


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


def test_float32_points_are_what_they_are(rng):
    for rule in RULES:
        points, scene = boxed(rng, "triclinic", 3, 20)
        radii = spread_radii(rng, 20, 0.3, 2.0)
        for dtype in (np.float32, np.float64):
            one = Reaching(points.astype(np.float32), radii=radii.astype(dtype), rule=rule, **scene)
            check(one)
            check(one.but(n_queries=7))


@pytest.mark.parametrize("rule", RULES)
def test_an_upper_bound_holds_as_well(rule, rng):
    for kind in ("open", "periodic"):
        points, scene = boxed(rng, kind, 3, 20)
        radii = spread_radii(rng, 20, 0.6, 1.0)
        for cutoff in (0.0, 0.2, np.float32(0.5), 2.0):
            for n_queries in (None, 9):
                one = Reaching(points, cutoff, n_queries, radii=radii, rule=rule, **scene)
                check(one)


def test_many_dimensions(rng):
    for rule in RULES:
        for ndim in (5, 6, 8):
            points = rng.random((14, ndim))
            radii = spread_radii(rng, 14, 0.5 if rule == "sum" else 1.0, 1.0)
            assert check(Reaching(points, radii=radii, rule=rule))


@pytest.mark.parametrize("rule", RULES)
def test_equal_radii_are_one_cutoff(rule, rng):
    points, scene = boxed(rng, "triclinic", 3, 60)
    marks, cutoff = {"radii": np.full(60, 0.25), "rule": rule}, 0.5 if rule == "sum" else 0.25
    for kernel in hs.kernels():
        how = {"box": scene["box"], "kernel": kernel}
        table = hs.neighbors(points, None, quantities="jSdD", **marks, **how)
        assert same_tables(table, hs.neighbors(points, cutoff, quantities="jSdD", **how))
        if rule in SYMMETRIC:
            how |= {"quantities": "ijSdD", "sort": True}
            one, other = hs.pairs(points, None, **marks, **how), hs.pairs(points, cutoff, **how)
            assert same_arrays(one, other)


def test_no_points_and_one():
    for rule in RULES:
        for ndim in (1, 3):
            for n in (0, 1):
                one = Reaching(np.zeros((n, ndim)), radii=np.ones(n), rule=rule)
                assert check(one) == []
                boxes = one.but(box=np.full(ndim, 1.5))
                assert bool(check(boxes)) == (n == 1 and rule == "sum")
                for q in range(n + 1):
                    check(boxes.but(n_queries=q))
        empty = hs.pairs([], None, radii=[], quantities="ijdDS")
        assert [array.shape for array in empty] == [(0,), (0,), (0,), (0, 3), (0, 3)]
        assert len(hs.neighbors([], None, radii=[], rule="gather")) == 0


def test_one_giant_among_dwarfs(rng):
    for rule in RULES:
        points, scene = boxed(rng, "periodic", 2, 25, length=10.0)
        radii = np.full(25, 1e-3)
        radii[13] = 12.0
        points[20] = points[19] + [5e-4, 0.0]
        found = check(Reaching(points, radii=radii, rule=rule, **scene))
        assert any(19 in (i, j) and 20 in (i, j) for i, j, _ in found)


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

SMALL = scenes(ndims=(1, 2, 3))
RADIUS = st.one_of(
    st.integers(0, 8).map(lambda k: k / 8), st.floats(0.0, 1.0),
    st.sampled_from([0.0, 1e-300, 5e-324, 1e-9, 0.1, 0.2, 0.3]),
)  # fmt: skip


@st.composite
def reaching(draw, rules=RULES):
    """A small scene full of ties, with a radius for each point."""
    scene = draw(SMALL)
    n = len(scene.points)
    rule = draw(st.sampled_from(rules))
    radii = np.array(draw(st.lists(RADIUS, min_size=n, max_size=n)))
    if rule == "mean":
        radii = np.where(radii < 1e-300, 0.0, radii)
    if rule != "sum":
        radii = 2.0 * radii
    bound = draw(st.sampled_from([None, None, scene.cutoff]))
    return Reaching(
        scene.points, bound, None, scene.box, scene.periodic, scene.inclusive, radii=radii,
        rule=rule,
    )  # fmt: skip


@given(reaching(), st.integers(0, 10))
@settings(max_examples=100)
def test_small_scenes_equal_the_definition(scene, q):
    check(scene)
    check(scene.but(n_queries=min(q, len(scene.points))))


def entries_of(scene):
    return entries(hs.neighbors(**scene.arguments, quantities="jS"))


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
