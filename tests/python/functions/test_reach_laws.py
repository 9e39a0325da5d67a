# SPDX-License-Identifier: BSD-3-Clause
"""What must not change, or change in a known way, where pairs have a reach each: exactly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import halfshell as hs
from reach_scenes import RULES, SYMMETRIC, Reaching, check, entries, triples
from scene_strategies import scenes

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


def rows(scene, **how):
    return entries(hs.neighbors(**scene.arguments, quantities="jS", **how))


@given(reaching(), st.integers(0, 10))
@settings(max_examples=100)
def test_small_scenes_equal_the_definition(scene, q):
    check(scene)
    check(scene.but(n_queries=min(q, len(scene.points))))


@given(reaching(), st.permutations(range(10)))
def test_points_may_be_in_any_order(scene, order):
    order = np.array([k for k in order if k < len(scene.points)])
    place = np.argsort(order)
    there = scene.but(points=scene.points[order], radii=scene.marks["radii"][order])
    found = sorted((int(order[i]), int(order[j]), S) for i, j, S in rows(there))
    assert found == rows(scene)
    assert place[order].tolist() == list(range(len(order)))


@given(reaching(), st.sampled_from([-300, -40, 1, 60, 300]))
def test_powers_of_two_scale_everything(scene, power):
    unit = 2.0**power
    radii = scene.marks["radii"] * unit
    moved = scene.points * unit
    if (radii / unit != scene.marks["radii"]).any() or (moved / unit != scene.points).any():
        return  # digits were lost
    if scene.rule == "mean" and ((radii > 0.0) & (radii < 2.0**-1021)).any():
        return
    box = None if scene.scene["box"] is None else scene.scene["box"] * unit
    bound = None if scene.cutoff is None else scene.cutoff * unit
    if bound is not None and bound / unit != scene.cutoff:
        return
    assert rows(scene.but(points=moved, radii=radii, box=box, cutoff=bound)) == rows(scene)


@given(reaching(rules=("gather", "scatter")))
def test_gather_is_scatter_seen_from_the_other_side(scene):
    other = {"gather": "scatter", "scatter": "gather"}[scene.rule]
    turned = sorted((j, i, tuple(-s for s in S)) for i, j, S in rows(scene.but(rule=other)))
    assert turned == rows(scene)


@given(reaching(rules=("max", "min")))
def test_max_is_gather_or_scatter_and_min_both(scene):
    one, other = (set(rows(scene.but(rule=rule))) for rule in ("gather", "scatter"))
    expected = one | other if scene.rule == "max" else one & other
    assert set(rows(scene)) == expected


@given(reaching(rules=("mean",)))
def test_means_are_sums_of_halves(scene):
    halves = scene.but(rule="sum", radii=scene.marks["radii"] / 2.0)
    assert rows(scene) == rows(halves)


@given(reaching(), st.floats(0.0, 2.0))
def test_an_upper_bound_takes_away_what_is_farther(scene, bound):
    free = scene.but(cutoff=None)
    within = {**scene.scene}
    plain = entries(hs.neighbors(scene.points, bound, quantities="jS", **within))
    assert set(rows(free.but(cutoff=bound))) == set(rows(free)) & set(plain)


@given(reaching(rules=SYMMETRIC))
def test_larger_radii_only_add_pairs(scene):
    larger = scene.but(radii=np.nextafter(scene.marks["radii"], 9.0) * (1.0 + 2.0**-20))
    if scene.rule == "mean":
        larger = larger.but(radii=np.maximum(larger.marks["radii"], 2.0**-1000))
    assert set(rows(scene)) <= set(rows(larger))


@given(reaching(rules=SYMMETRIC))
def test_pairs_are_the_halves_of_rows(scene):
    half = triples(*hs.pairs(**scene.arguments, quantities="ijS", sort=True))
    zero = (0,) * scene.points.shape[1]
    assert half == [(i, j, S) for i, j, S in rows(scene) if i < j or (i == j and S > zero)]
    assert hs.count_pairs(**scene.arguments) == len(half)
    assert hs.coordination(**scene.arguments).sum() == 2 * len(half)


@given(reaching())
def test_further_points_take_no_pair_away(scene):
    n = len(scene.points)
    fewer = scene.but(points=scene.points[:-1], radii=scene.marks["radii"][:-1])
    kept = [(i, j, S) for i, j, S in rows(scene) if max(i, j) < n - 1]
    assert rows(fewer) == kept


@given(reaching(), st.data())
def test_types_say_what_their_radii_say(scene, data):
    """Points of few sizes: a table of exact sums is the rule of these."""
    if scene.rule not in SYMMETRIC:
        scene = scene.but(rule="max")
    sizes = np.array([0.0, 0.125, 0.5])
    n = len(scene.points)
    types = np.array(data.draw(st.lists(st.integers(0, 2), min_size=n, max_size=n)))
    combine = {"sum": np.add.outer, "max": np.maximum.outer, "min": np.minimum.outer,
               "mean": lambda a, b: np.add.outer(a, b) / 2}[scene.rule]  # fmt: skip
    by_radii = scene.but(radii=sizes[types], cutoff=None)
    found = entries(hs.neighbors(
        scene.points, combine(sizes, sizes), types=types, quantities="jS", **scene.scene
    ))  # fmt: skip
    assert found == rows(by_radii)


@pytest.mark.parametrize("rule", RULES)
def test_whole_box_vectors_change_shifts_alone(rule, rng):
    box = np.array([[4.0, 0.0], [1.0, 3.0]])
    points, radii = rng.integers(0, 32, (40, 2)) / 8.0, rng.integers(0, 9, 40) / 8.0
    moves = rng.integers(-1000, 1001, (40, 2))
    home = Reaching(points, radii=radii, rule=rule, box=box)
    away = home.but(points=points + moves @ box)
    expected = sorted(
        (i, j, tuple(int(s) for s in np.array(S) + moves[i] - moves[j])) for i, j, S in rows(home)
    )
    assert rows(away) == expected


@pytest.mark.parametrize("rule", RULES)
def test_a_huge_box_is_open_space(rule, rng):
    points, radii = rng.random((60, 3)), rng.random(60) * 0.3
    home = Reaching(points, radii=radii, rule=rule)
    assert rows(home.but(box=[1e6] * 3)) == rows(home)
