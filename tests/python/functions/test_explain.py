# SPDX-License-Identifier: BSD-3-Clause
"""What `explain` says is what the search does."""


import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import lattice, random_scene, rotation


@pytest.fixture
def scene(rng):
    points, cutoff, box, _ = random_scene(rng, 5000, neighbours=20)
    return points, cutoff, box


def test_it_names_the_kernel_and_the_algorithm(scene):
    for kernel in hs.kernels():
        points, cutoff, box = scene
        plan = call(hs.explain, points, cutoff, box=box, kernel=kernel)
        assert plan.kernel == kernel
        assert plan.algorithm in ("all-pairs", "grid", "hash", "hierarchy")
        assert plan.reason
        assert plan.n == 5000 and plan.ndim == 3
        for word in (kernel, plan.algorithm, "5,000"):
            assert word in str(plan)


def test_expected_pairs_are_near_the_truth_for_even_points(rng):
    for n, neighbours in ((500, 30), (5000, 20), (20_000, 5)):
        for ndim in (2, 3):
            points, cutoff, box, _ = random_scene(rng, n, ndim, neighbours=neighbours)
            plan = hs.explain(points, cutoff, box=box)
            found = hs.count_pairs(points, cutoff, box=box)
            assert 0.5 * found < plan.expected_pairs < 2.0 * found
            assert plan.expected_bytes == pytest.approx(16 * plan.expected_pairs)


def test_bytes_follow_the_quantities(scene):
    points, cutoff, box = scene
    sizes = {"i": 8, "P": 16, "d": 8, "D": 24, "S": 12, "ijdDS": 60}
    for quantities, size in sizes.items():
        plan = hs.explain(points, cutoff, box=box, quantities=quantities)
        assert plan.expected_bytes == pytest.approx(size * plan.expected_pairs)
    plan = hs.explain(points, cutoff, box=box, index_dtype=np.int32)
    assert plan.expected_bytes == pytest.approx(8 * plan.expected_pairs)


def test_measured_counters_add_up(scene):
    for kernel in hs.kernels():
        points, cutoff, box = scene
        measured = call(hs.explain, points, cutoff, box=box, kernel=kernel, measure=True).measured
        assert measured["pairs"] == hs.count_pairs(points, cutoff, box=box)
        assert measured["candidates"] >= measured["pairs"]
        stages = (measured[k] for k in ("by_float64", "by_double_word", "by_integers"))
        assert measured["ambiguous"] == sum(stages)
        assert measured["ambiguous"] < 1e-3 * measured["pairs"]
        assert measured["bytes_peak"] >= 16 * measured["pairs"] // 2
        assert measured["bytes_peak"] <= sum(measured["bytes"].values())
        assert "candidates" in str(hs.explain(points, cutoff, box=box, measure=True))


def test_pairs_that_do_not_count_change_no_plan_and_are_not_measured(scene):
    points, cutoff, box = scene
    halves = hs.Points(points, box=box, groups=np.arange(len(points)) % 2)
    plain = hs.explain(points, cutoff, box=box)
    for known, how in (
        (halves, {}),
        (halves.replace(groups=None, labels=halves.groups), {"exclude": 0}),
        (halves.replace(groups=None), {"exclude": [[0, 1]]}),
        (halves.replace(groups=None), {"min_distance": 0.5 * cutoff}),
    ):
        assert hs.explain(known, cutoff, **how).shape == plain.shape
        measured = hs.explain(known, cutoff, measure=True, **how).measured
        assert measured["pairs"] == hs.count_pairs(known, cutoff, **how)


def test_ties_reach_the_later_stages(rng):
    points, box = lattice("fcc", (8, 8, 8))
    shell = hs.count_pairs(points, 2.0, box=box) - hs.count_pairs(
        points, 2.0, box=box, inclusive=False
    )
    measured = hs.explain(points, 2.0, box=box, measure=True).measured
    assert measured["ambiguous"] >= shell > 0
    turn = rotation(rng)
    measured = hs.explain(points @ turn, 2.0, box=box @ turn, measure=True).measured
    assert measured["ambiguous"] >= shell


def test_the_choice_to_store_occupied_cells_only_is_named(rng):
    cloud = rng.random((4000, 3))
    crowded = np.concatenate([cloud, cloud + 1e9])
    plan = hs.explain(crowded, 0.1)
    assert plan.algorithm == "hash" and "only those are stored" in plan.reason
    assert np.prod(np.array(plan.shape, float)) > 1e20
    assert "empty cells: only occupied ones are stored" in plan.leaves_out
    assert hs.CellList(crowded, 0.1).cell_ids is not None
    even = hs.explain(cloud, 0.1)
    assert even.algorithm == "grid" and "stored" not in even.reason + "".join(even.leaves_out)


def test_what_is_not_asked_for_costs_no_byte(scene):
    points, cutoff, box = scene
    measured = hs.explain(points, cutoff, box=box, quantities="ij", measure=True).measured
    for purpose in ("distances", "vectors", "shifts", "sorting"):
        assert not measured["bytes"].get(purpose), purpose
    more = hs.explain(
        points, cutoff, box=box, quantities="ijdDS", sort=True, measure=True
    ).measured["bytes"]
    for purpose in ("distances", "vectors", "shifts", "sorting"):
        assert more[purpose] > 0, purpose
