# SPDX-License-Identifier: BSD-3-Clause
"""`algorithm=`: the pairs are the same for all, and the one asked for runs."""


import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import as_rows, lattice, random_box

ALGORITHMS = ("auto", "all-pairs", "grid", "hash", "hierarchy")
FORCED = ALGORITHMS[1:]


def rows(points, cutoff, algorithm, **how):
    return as_rows(*call(hs.pairs, points, cutoff, quantities="ijS", algorithm=algorithm, **how))


def scenes():
    """Scenes that every algorithm answers alike, by name: points, cutoff, keywords."""
    rng = np.random.default_rng(20)
    cube = rng.uniform(0.0, 6.0, (400, 3))
    clumps = (rng.uniform(-1e9, 1e9, (8, 1, 3)) + rng.uniform(0.0, 3.0, (8, 40, 3))).reshape(-1, 3)
    crystal, box = lattice("fcc", (4, 4, 4))
    yield "open", cube, 1.0, {}
    yield "periodic", cube, 1.0, {"box": [6.0] * 3}
    yield "slab", cube, 1.1, {"box": [6.0, 5.0, 3.0], "periodic": [True, True, False]}
    yield "sheared", cube, 1.0, {"box": random_box(rng, "sheared", length=6.0)}
    for ndim, size, cutoff in ((1, 300.0, 1.5), (2, 18.0, 1.0), (5, 2.5, 1.0), (8, 2.0, 1.2)):
        yield f"{ndim}-D", rng.uniform(0.0, size, (300, ndim)), cutoff, {}
        yield (
            f"{ndim}-D periodic",
            rng.uniform(0.0, size, (100, ndim)),
            cutoff,
            {"box": [size] * ndim},
        )
    yield "crystal", crystal, 1.0, {"box": box}
    yield "one point and its images", np.zeros((1, 3)), 2.5, {"box": [1.0] * 3}
    yield "coincident", np.ones((30, 3)), 1.0, {}
    yield "cutoff 0", np.repeat(cube[:50], 2, axis=0), 0.0, {}
    yield "huge coordinates", cube * 2.0**900, 2.0**900, {}
    yield "tiny coordinates", cube * 2.0**-1000, 2.0**-1000, {}
    yield "every scale", cube * 10.0 ** rng.uniform(-300, 300, (400, 1)), 1.0, {}
    yield "far clumps", clumps, 1.0, {}
    yield "a line in 3-D", np.outer(np.arange(500.0), [1.0, 1.0, 0.0]), 3.0, {}


SCENES = {name: scene for name, *scene in scenes()}


@pytest.mark.parametrize("name", SCENES)
def test_every_algorithm_finds_the_same_pairs_and_says_that_it_ran(name):
    points, cutoff, how = SCENES[name]
    expected = rows(points, cutoff, "auto", **how)
    for algorithm in FORCED:
        assert np.array_equal(rows(points, cutoff, algorithm, **how), expected), algorithm
        plan = call(hs.explain, points, cutoff, algorithm=algorithm, measure=True, **how)
        assert plan.algorithm == algorithm and algorithm in str(plan)
        assert plan.measured["pairs"] == len(expected)
        if algorithm == "all-pairs":
            assert plan.shape == (1,) * plan.ndim and plan.n_cells == 1
        elif algorithm == "hash":
            assert plan.n_cells <= max(plan.n, 1)
        elif algorithm == "grid":
            assert plan.n_cells == np.prod(plan.shape) <= 2 * plan.n + 64
    assert call(hs.explain, points, cutoff, **how).algorithm in FORCED[:3]


def test_radii_are_explained():
    rng = np.random.default_rng(9)
    points, radii = rng.uniform(0.0, 20.0, (3000, 3)), 10.0 ** rng.uniform(-3, 0, 3000)
    plan = call(hs.explain, points, None, radii=radii)  # few are near any other
    assert plan.algorithm == "grid" and "one search" in plan.reason
    radii[0] = 30.0  # which one search would look for around all of them
    for algorithm in ALGORITHMS:
        plan = call(hs.explain, points, None, radii=radii, algorithm=algorithm)
        assert plan.algorithm == ("hierarchy" if algorithm == "auto" else algorithm)
        assert ("octaves" in plan.reason) == (algorithm in ("auto", "hierarchy"))
        assert ("one search" in plan.reason) == (algorithm not in ("auto", "hierarchy"))


@pytest.mark.parametrize(("rule", "searches"), [("sum", 10), ("max", 7), ("min", 7)])
def test_octaves_are_counted_from_the_largest_radius(rule, searches):
    points = np.random.default_rng(0).random((600, 3)) * 30.0
    four = np.array([5.0, 2.5, 2.4, 1.2, 0.6])[np.arange(600) % 5]  # 2.5 is with 5
    plan = call(hs.explain, points, None, radii=four, rule=rule, algorithm="hierarchy")
    assert plan.reason.endswith(f", in {searches} searches")
    none = call(hs.explain, points, None, radii=np.zeros(600), algorithm="hierarchy")
    assert none.reason.endswith(", in 1 search")
