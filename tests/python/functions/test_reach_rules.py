# SPDX-License-Identifier: BSD-3-Clause
"""A radius for each point: every rule, in every box, against rational arithmetic."""

from typing import get_args

import numpy as np
import pytest

import halfshell as hs
from halfshell._convert import rules
from halfshell._convert.types import Rule
from reach_scenes import BOXES, RULES, SYMMETRIC, Reaching, boxed, check, spread_radii


def test_rules_of_types_and_messages_are_the_same():
    assert get_args(Rule) == rules.RULES
    assert set(rules.DIRECTED) < set(rules.RULES_OF_SUPPORTS) < set(rules.RULES)
    with pytest.raises(ValueError, match=f"rule must be one of {' '.join(rules.RULES)}, got 'add'"):
        hs.pairs([[0.0]], None, radii=[1.0], rule="add")


@pytest.mark.parametrize("kind", BOXES)
@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("ndim", [1, 2, 3, 4])
def test_one_set_equals_the_definition(kind, rule, ndim, rng, kernel):
    points, scene = boxed(rng, kind, ndim, 16)
    largest = {1: 0.3, 2: 0.3, 3: 0.3, 4: 0.25}[ndim] * (1 if rule == "sum" else 2)
    for decades, inclusive in ((0.5, True), (6.0, False)):
        radii = spread_radii(rng, 16, largest, decades)
        scene |= {"inclusive": inclusive}
        check(Reaching(points, radii=radii, rule=rule, **scene), kernel=kernel)


@pytest.mark.parametrize("kind", BOXES)
@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("ndim", [1, 2, 3])
def test_two_sets_equal_the_definition(kind, rule, ndim, rng, kernel):
    for q, n, decades in ((1, 12, 0.5), (8, 8, 3.0), (14, 2, 6.0)):
        points, scene = boxed(rng, kind, ndim, q + n)
        radii = spread_radii(rng, q + n, 0.3 if rule == "sum" else 0.6, decades)
        check(Reaching(points, None, q, radii=radii, rule=rule, **scene), kernel=kernel)


@pytest.mark.parametrize("kind", ["periodic", "mixed", "triclinic", "sheared"])
@pytest.mark.parametrize("rule", RULES)
def test_radii_larger_than_the_box(kind, rule, rng, kernel):
    points, scene = boxed(rng, kind, 2, 5, length=1.0)
    radii = np.array([1.7, 0.4, 0.0, 0.9, 1e-3])
    found = check(Reaching(points, radii=radii, rule=rule, **scene), kernel=kernel)
    # The first point sees its own images, except within the radius of another.
    assert any(i == j == 0 for i, j, _ in found)
    check(Reaching(points, None, 2, radii=radii, rule=rule, **scene), kernel=kernel)


@pytest.mark.parametrize("rule", RULES)
def test_float32_points_are_what_they_are(rule, rng, kernel):
    points, scene = boxed(rng, "triclinic", 3, 20)
    radii = spread_radii(rng, 20, 0.3, 2.0)
    for dtype in (np.float32, np.float64):
        one = Reaching(
            points.astype(np.float32), radii=radii.astype(dtype), rule=rule, **scene
        )
        check(one, kernel=kernel)
        check(one.but(n_queries=7), kernel=kernel)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("kind", ["open", "periodic"])
def test_an_upper_bound_holds_as_well(rule, kind, rng, kernel):
    points, scene = boxed(rng, kind, 3, 20)
    radii = spread_radii(rng, 20, 0.6, 1.0)
    for cutoff in (0.0, 0.2, np.float32(0.5), 2.0):
        for n_queries in (None, 9):
            one = Reaching(points, cutoff, n_queries, radii=radii, rule=rule, **scene)
            check(one, kernel=kernel)


@pytest.mark.parametrize("rule", RULES)
def test_many_dimensions(rule, rng, kernel):
    for ndim in (5, 6, 8):
        points = rng.random((14, ndim))
        radii = spread_radii(rng, 14, 0.5 if rule == "sum" else 1.0, 1.0)
        assert check(Reaching(points, radii=radii, rule=rule), kernel=kernel)


@pytest.mark.parametrize("rule", RULES)
def test_equal_radii_are_one_cutoff(rule, rng, kernel):
    points, scene = boxed(rng, "triclinic", 3, 60)
    radii = np.full(60, 0.25)
    how = {"box": scene["box"], "quantities": "ijSdD", "sort": True, "kernel": kernel}
    table = hs.neighbors(
        points, None, radii=radii, rule=rule, box=scene["box"], quantities="jSdD", kernel=kernel
    )
    cutoff = 0.5 if rule == "sum" else 0.25
    plain = hs.neighbors(points, cutoff, box=scene["box"], quantities="jSdD", kernel=kernel)
    assert all(np.array_equal(a, b) for a, b in zip(table._arrays, plain._arrays))
    if rule in SYMMETRIC:
        one, other = (
            hs.pairs(points, None, radii=radii, rule=rule, **how), hs.pairs(points, cutoff, **how)
        )  # fmt: skip
        assert all(np.array_equal(a, b) for a, b in zip(one, other))


@pytest.mark.parametrize("rule", RULES)
def test_no_points_and_one(rule, kernel):
    for ndim in (1, 3):
        for n in (0, 1):
            one = Reaching(np.zeros((n, ndim)), radii=np.ones(n), rule=rule)
            assert check(one, kernel=kernel) == []
            boxes = one.but(box=np.full(ndim, 1.5))
            assert bool(check(boxes, kernel=kernel)) == (n == 1 and rule == "sum")
            for q in range(n + 1):
                check(boxes.but(n_queries=q), kernel=kernel)
    empty = hs.pairs([], None, radii=[], quantities="ijdDS")
    assert [array.shape for array in empty] == [(0,), (0,), (0,), (0, 3), (0, 3)]
    assert len(hs.neighbors([], None, radii=[], rule="gather")) == 0


@pytest.mark.parametrize("rule", RULES)
def test_one_giant_among_dwarfs(rule, rng, kernel):
    points, scene = boxed(rng, "periodic", 2, 25, length=10.0)
    radii = np.full(25, 1e-3)
    radii[13] = 12.0
    points[20] = points[19] + [5e-4, 0.0]
    found = check(Reaching(points, radii=radii, rule=rule, **scene), kernel=kernel)
    assert any(19 in (i, j) and 20 in (i, j) for i, j, _ in found)


@pytest.mark.parametrize("ratio", [1e6, 1e300])
@pytest.mark.parametrize("rule", RULES)
def test_ratios_of_sizes(ratio, rule, rng, kernel):
    """Clusters of every size, each in the middle of the next larger ball."""
    sizes = np.geomspace(1.0, 1.0 / ratio, 6)
    points = np.concatenate([size * rng.random((5, 2)) for size in sizes])
    radii = np.repeat(sizes, 5) * rng.uniform(0.2, 0.8, 30)
    assert check(Reaching(points, radii=radii, rule=rule), kernel=kernel)
    assert check(Reaching(points, None, 13, radii=radii, rule=rule), kernel=kernel)
    if ratio < 1e7:
        box = np.array([[2.0, 0.0], [0.3, 2.0]])
        assert check(Reaching(points, radii=radii, rule=rule, box=box), kernel=kernel)
