# SPDX-License-Identifier: BSD-3-Clause
"""`algorithm=`: the pairs are the same for all, and the one asked for runs."""

import itertools

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
    yield "images", cube[:40], 7.5, {"box": [6.0, 5.0, 9.0]}
    yield "slab", cube, 1.1, {"box": [6.0, 5.0, 3.0], "periodic": [True, True, False]}
    for kind in ("triclinic", "sheared", "left-handed"):
        yield kind, cube, 1.0, {"box": random_box(rng, kind, length=6.0)}
    yield "outside the box", cube * 50.0 - 100.0, 1.0, {"box": [6.0] * 3}
    for ndim, size, cutoff in ((1, 300.0, 1.5), (2, 18.0, 1.0), (5, 2.5, 1.0), (8, 2.0, 1.2)):
        yield f"{ndim}-D", rng.uniform(0.0, size, (300, ndim)), cutoff, {}
        yield (
            f"{ndim}-D periodic",
            rng.uniform(0.0, size, (100, ndim)),
            cutoff,
            {"box": [size] * ndim},
        )
    yield "crystal", crystal, 1.0, {"box": box}
    yield "strict", crystal, 1.0, {"box": box, "inclusive": False}
    yield "empty", np.zeros((0, 3)), 1.0, {}
    yield "empty in a box", np.zeros((0, 3)), 1.0, {"box": [2.0, 3.0, 4.0]}
    yield "one point", np.zeros((1, 3)), 1.0, {}
    yield "one point and its images", np.zeros((1, 3)), 2.5, {"box": [1.0] * 3}
    yield "two points", np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), 1.0, {}
    yield "coincident", np.ones((30, 3)), 1.0, {}
    yield "cutoff 0", np.repeat(cube[:50], 2, axis=0), 0.0, {}
    yield "cutoff 0 in a box", np.repeat(cube[:50], 2, axis=0), 0.0, {"box": [6.0] * 3}
    yield "huge coordinates", cube * 2.0**900, 2.0**900, {}
    yield "tiny coordinates", cube * 2.0**-1000, 2.0**-1000, {}
    yield "every scale", cube * 10.0 ** rng.uniform(-300, 300, (400, 1)), 1.0, {}
    yield "far clumps", clumps, 1.0, {}
    yield "float32", cube.astype(np.float32), 1.0, {"box": [6.0] * 3}
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


def test_counters_tell_the_algorithms_apart():
    points = np.random.default_rng(1).uniform(0.0, 20.0, (5000, 3))

    def measured(algorithm):
        return call(hs.explain, points, 1.0, algorithm=algorithm, measure=True).measured

    assert measured("all-pairs")["candidates"] > 0.99 * (5000 * 4999 // 2)
    assert measured("grid")["candidates"] < 5000 * 500
    assert measured("hash")["candidates"] < 5000 * 500
    assert measured("grid")["bytes"]["cells"] != measured("hash")["bytes"]["cells"]
    # One level is searched as without levels.
    assert measured("hierarchy") == measured("auto")


def test_the_order_does_not_depend_on_kernel_or_threads():
    points = np.random.default_rng(2).uniform(0.0, 60.0, (30_000, 3))
    for algorithm in ("grid", "hash", "hierarchy"):
        first = call(hs.pairs, points, 2.0, algorithm=algorithm, threads=1)
        for kernel, threads in itertools.product(hs.kernels(), (1, 3)):
            again = call(hs.pairs, points, 2.0, algorithm=algorithm, kernel=kernel, threads=threads)
            assert all(np.array_equal(a, b) for a, b in zip(first, again))


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
    assert plan.reason.startswith("4 octaves of radii up to 5,")
    assert plan.reason.endswith(f"in {searches} searches")
    none = call(hs.explain, points, None, radii=np.zeros(600), algorithm="hierarchy")
    assert none.reason.startswith("1 octave of radii up to 0,")
    four[:9] = 0.0
    plan = call(hs.explain, points, None, radii=four, algorithm="hierarchy")
    assert plan.reason.startswith("5 octaves of radii up to 5,")


def test_clusters_that_are_far_apart_are_explained():
    rng = np.random.default_rng(5)
    for n_clusters, each in ((10, 100), (100, 1000)):
        centres = 1e9 * np.arange(n_clusters)[:, None, None]
        points = (centres + rng.uniform(0.0, 5.0, (n_clusters, each, 3))).reshape(-1, 3)
        plan = hs.explain(points, 1.0)
        found = hs.count_pairs(points, 1.0)
        assert plan.algorithm == "hash"
        assert n_clusters <= plan.n_cells <= len(points)
        assert 0.7 * found < plan.expected_pairs < 1.4 * found
        assert f"{plan.n_cells} that hold points" in str(plan)


@pytest.mark.parametrize("search", [
    lambda **how: call(hs.pairs, np.zeros((2, 3)), 1.0, **how),
    lambda **how: call(hs.neighbors, np.zeros((2, 3)), 1.0, **how),
    lambda **how: call(hs.count_pairs, np.zeros((2, 3)), [1.0, 2.0], **how),
    lambda **how: call(hs.explain, np.zeros((2, 3)), 1.0, **how),
    lambda **how: call(hs.pair_histogram, np.zeros((2, 3)), [0.0, 1.0], **how),
    lambda **how: call(hs.pairs, np.zeros((2, 3)), None, radii=[1.0, 1.0], **how),
])  # fmt: skip
def test_unknown_names_are_refused_with_those_that_there_are(search):
    must = "algorithm must be one of auto all-pairs grid hash hierarchy, got "
    for unknown in ("", "Grid", "sparse", "cells", "auto\0"):
        with pytest.raises(ValueError, match=must):
            search(algorithm=unknown)
    for unknown in (None, 3, b"grid", ["grid"], np.array(["grid"])):
        with pytest.raises(TypeError, match="algorithm must be a string, got"):
            search(algorithm=unknown)
