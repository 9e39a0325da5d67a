# SPDX-License-Identifier: BSD-3-Clause
"""Extreme scenes asked for full lists, by queries, and in cells that are kept."""

import numpy as np
import pytest

import halfshell as hs
from full_lists import entries, full_list, large_full_rows, list_between
from oracles import exact_pairs

SKEWED = "box is too skewed, or its vectors differ"


def turned_box(rng, aspect):
    """A box with one vector so many times as long as the others, along no coordinate axis."""
    return np.diag([aspect, 1.0, 1.0]) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]


def long_boxes(aspect):
    """Skewed boxes with one vector, or two, so many times as long as the others."""
    yield np.array([[aspect, 0, 0], [0, 1, 0.3], [0, 0, 1]])
    yield np.array([[1, 0, 0], [0.3, aspect, 0], [0, 0, aspect]])


def scene_in(rng, box, n=20):
    """Points about the box, half of them beside others."""
    points = rng.uniform(-1, 2, (n, 3)) @ box
    points[n // 2 :] = points[: n - n // 2] + rng.uniform(-0.6, 0.6, (n - n // 2, 3))
    return points


# ---- long skewed boxes ---------------------------------------------------------------------


@pytest.mark.parametrize("aspect", [1e6, 1e12, 1e19])
def test_full_lists_in_long_skewed_boxes(rng, aspect):
    for kernel in hs.kernels():
        for box in long_boxes(aspect):
            points = scene_in(rng, box)
            queries = np.concatenate([scene_in(rng, box, 4), points[:4] + 0.1])
            for cutoff in (0.3, 0.9):
                found = hs.neighbors(points, cutoff, box=box, quantities="jS", kernel=kernel)
                assert entries(found) == full_list(points, cutoff, box)
                expected = list_between(queries, points, cutoff, box)
                found = hs.neighbors(
                    points, cutoff, queries=queries, box=box, quantities="jS", kernel=kernel
                )
                assert entries(found) == expected
                assert hs.count_pairs(points, cutoff, queries=queries, box=box) == len(expected)


@pytest.mark.parametrize("aspect", [1e6, 1e12, 1e19])
def test_kept_cells_in_long_skewed_boxes(rng, aspect):
    for box in long_boxes(aspect):
        points = scene_in(rng, box)
        queries = np.concatenate([scene_in(rng, box, 4), points[:4] + 0.1])
        cells = hs.CellList(points, 0.9, box=box)
        for radius in (0.9, 0.3, 1e-3):
            found = cells.query(queries, radius, quantities="jS")
            assert entries(found) == list_between(queries, points, radius, box)
            found = cells.neighbors(radius, quantities="jS")
            assert entries(found) == full_list(points, radius, box)


# ---- boxes that are refused ----------------------------------------------------------------


def searches(points, cutoff, box):
    """Every function that takes a box, as (name, call)."""
    edges = [0.0, cutoff]
    yield "pairs", lambda: hs.pairs(points, cutoff, box=box)
    yield "neighbors", lambda: hs.neighbors(points, cutoff, box=box)
    yield "queries", lambda: hs.neighbors(points, cutoff, queries=points[:5], box=box)
    yield "pairs_between", lambda: hs.pairs_between(points, points[:5], cutoff, box=box)
    yield "coordination", lambda: hs.coordination(points, cutoff, box=box)
    yield "pair_histogram", lambda: hs.pair_histogram(points, edges, box=box)
    yield "iter_pairs", lambda: list(hs.iter_pairs(points, cutoff, box=box))
    yield "CellList", lambda: hs.CellList(points, cutoff, box=box)
    yield "VerletList", lambda: hs.VerletList(cutoff, skin=0.1 * cutoff, box=box).update(points)


def test_every_search_refuses_boxes_that_float64_does_not_place_points_in(rng):
    sheared = np.array([[1.0, 0, 0], [1e12, 1, 0], [-3e11, 7e11, 1]])
    for box in (turned_box(rng, 1e17), sheared):
        for name, search in searches(rng.random((50, 3)), 0.1, box):
            with pytest.raises(ValueError, match=SKEWED):
                search()
                raise AssertionError(name)


def test_a_refused_box_of_many_is_named(rng):
    boxes = np.stack([np.eye(3), np.eye(3), turned_box(rng, 1e17)])
    points = rng.random((60, 3))
    with pytest.raises(ValueError, match=r"box\[2\] is too skewed"):
        hs.pairs(points, 0.1, box=boxes, batch=np.arange(60) // 20)


def test_cells_for_a_large_cutoff_refuse_what_is_smaller_than_rounding(rng):
    # Along the short vectors points are known to some units: the cutoff has to be larger.
    box = turned_box(rng, 2.0**50)
    points = (rng.random((12, 3)) - 0.5) * 4.0
    cells = hs.CellList(points, 10.0, box=box)
    assert cells.count_pairs() == hs.count_pairs(points, 10.0, box=box)
    for search in (cells.pairs, cells.neighbors, cells.coordination):
        with pytest.raises(ValueError, match=SKEWED):
            search(1e-3)
    with pytest.raises(ValueError, match=SKEWED):
        cells.query(points[:3], 1e-3)
    assert cells.count_pairs() == hs.count_pairs(points, 10.0, box=box)


# ---- few points far from the box, among many in it -----------------------------------------


@pytest.mark.parametrize("far", [1e5, 1e8])
def test_some_points_and_queries_many_boxes_away(rng, far):
    for kernel in hs.kernels():
        box = np.array([[3.0, 0, 0], [1.0, 2.5, 0], [-1.0, 0.7, 3.0]])
        points, queries = rng.random((300, 3)) @ box, rng.random((300, 3)) @ box
        for some in (points[7:290:71], queries[130:140]):
            some += np.round(rng.uniform(-far, far, some.shape)) @ box
        everyone = np.concatenate([queries, points])
        half = exact_pairs(everyone, 0.4, box)
        between = half[(half[:, 0] < 300) & (half[:, 1] >= 300)]
        found = hs.neighbors(points, 0.4, queries=queries, box=box, quantities="jS", kernel=kernel)
        assert entries(found) == [(i, j - 300, tuple(S)) for i, j, *S in between.tolist()]
        kept = hs.CellList(points, 0.4, box=box).query(queries, quantities="jS")
        assert entries(kept) == entries(found)
        full = hs.neighbors(points, 0.4, box=box, quantities="jS", kernel=kernel)
        assert entries(full) == [
            (i, j, tuple(S)) for i, j, *S in large_full_rows(points, 0.4, box).tolist()
        ]


# ---- groups that meet nobody ---------------------------------------------------------------


def test_queries_that_meet_nobody(rng):
    points = rng.random((4000, 3)) * 200.0  # hardly a neighbour each
    queries = rng.random((3000, 3)) * 200.0
    for box in (None, [200.0] * 3):
        full = large_full_rows(points, 1.5, box)
        table = hs.neighbors(points, 1.5, box=box, quantities="jS")
        assert entries(table) == [(i, j, tuple(S)) for i, j, *S in full.tolist()]
        assert np.array_equal(hs.coordination(points, 1.5, box=box), table.counts)
        half = exact_pairs(np.concatenate([queries, points]), 1.5, box)
        between = half[(half[:, 0] < 3000) & (half[:, 1] >= 3000)]
        i, j, S = hs.pairs_between(queries, points, 1.5, box=box, quantities="ijS")
        assert np.array_equal(np.column_stack([i, j - 0, S]), between - [0, 3000, 0, 0, 0])
    nobody = hs.neighbors(points, 1.5, queries=queries + 1e4)
    assert nobody.n_entries == 0 and len(nobody.offsets) == 3001


# ---- plates --------------------------------------------------------------------------------


def test_full_lists_in_plates(rng):
    for kernel in hs.kernels():
        box = [2000.0, 2000.0, 0.05]
        points, queries = rng.random((1500, 3)) * box, rng.random((200, 3)) * box
        queries[:100] = points[:100] + 0.01
        for cutoff in (1.0, 0.3):
            table = hs.neighbors(points, cutoff, box=box, quantities="jS", kernel=kernel)
            assert entries(table) == [
                (i, j, tuple(S)) for i, j, *S in large_full_rows(points, cutoff, box).tolist()
            ]
            half = exact_pairs(np.concatenate([queries, points]), cutoff, box)
            between = half[(half[:, 0] < 200) & (half[:, 1] >= 200)]
            found = hs.neighbors(
                points, cutoff, queries=queries, box=box, quantities="jS", kernel=kernel
            )
            assert entries(found) == [(i, j - 200, tuple(S)) for i, j, *S in between.tolist()]
