# SPDX-License-Identifier: BSD-3-Clause
"""The contract of numerics' `CellList2D`, one test for each of its invariants.

docs/systems/numerics.md has the table that these belong to.
"""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import halfshell as hs


def plane(n, seed=1):
    return np.random.default_rng(seed).random((n, 2)) * 10.0


def neighbours_by_hand(points, cutoff):
    """Each unordered pair within the cutoff, by float64 distances away from ties."""
    return {
        (i, j)
        for i, j in itertools.combinations(range(len(points)), 2)
        if np.hypot(*(points[i] - points[j])) <= cutoff
    }


def held_by(cells, block, query):
    ranges = range(block.offsets[query], block.offsets[query + 1])
    return [j for r in ranges for j in cells.order[block.start[r] : block.stop[r]].tolist()]


def test_order_is_a_permutation():
    cells = hs.CellList(plane(300), 1.0)
    assert_array_equal(np.sort(cells.order), np.arange(300))


def test_start_ascends_to_n():
    cells = hs.CellList(plane(300), 1.0)
    assert cells.cell_start[0] == 0 and cells.cell_start[-1] == 300
    assert (np.diff(cells.cell_start) >= 0).all()


def test_every_point_is_in_the_cell_of_its_position():
    points = plane(300)
    cells = hs.CellList(points, 1.0)
    inside = np.repeat(np.arange(len(cells.cell_start) - 1), np.diff(cells.cell_start))
    assert_array_equal(cells.cell_of(points)[cells.order], inside)


def test_candidates_are_a_superset_of_the_neighbours_and_hold_the_point_itself():
    points = plane(200)
    cells = hs.CellList(points, 1.0)
    block = cells.candidates()
    for i, row in enumerate(cells.neighbors()):
        held = held_by(cells, block, i)
        assert set(row.tolist()) | {i} <= set(held)
        assert len(held) == len(set(held)), "in open space no range comes twice"


@pytest.mark.parametrize("cutoff", [0.5, 1.0])
def test_candidates_are_the_block_of_three_by_three_cells(cutoff):
    points = plane(600)
    cells = hs.CellList(points, cutoff, cell_size=1.0)
    assert cells.shape == tuple((np.ptp(points, axis=0) / (1.0 + 1e-5)).astype(int))
    home = cells.cell_of(points)
    x, y = home % cells.shape[0], home // cells.shape[0]
    block = cells.candidates()
    for i in range(0, 600, 7):
        expected = np.flatnonzero((abs(x - x[i]) <= 1) & (abs(y - y[i]) <= 1))
        held = set(held_by(cells, block, i))
        assert held <= set(expected.tolist())
        if cutoff == 1.0:
            assert held == set(expected.tolist())


def test_each_unordered_pair_comes_once_and_both_ends_agree():
    points = plane(200)
    cells = hs.CellList(points, 1.0)
    i, j = cells.pairs()
    found = list(zip(i.tolist(), j.tolist(), strict=True))
    assert len(found) == len(set(found)) and all(a < b for a, b in found)
    assert set(found) == neighbours_by_hand(points, 1.0)
    later = {(a, b) for a, row in enumerate(cells.neighbors()) for b in row.tolist() if b > a}
    assert later == set(found)


def test_the_sort_is_stable():
    cells = hs.CellList(plane(500), 2.0)
    for a, b in itertools.pairwise(cells.cell_start.tolist()):
        assert (np.diff(cells.order[a:b]) > 0).all()


def test_another_number_of_points():
    for n in (300, 10, 500):
        assert len(hs.CellList(plane(n), 1.0).order) == n


def test_no_points():
    cells = hs.CellList(np.empty((0, 2)), 1.0)
    assert cells.cell_start.tolist()[-1] == 0 and len(cells.pairs()[0]) == 0
    assert len(cells.candidates([[1.0, 1.0]]).start) == 0


def test_all_points_in_one_cell():
    points = plane(50) * 1e-3
    cells = hs.CellList(points, 1.0)
    assert cells.shape == (1, 1) and cells.count_pairs() == 50 * 49 // 2


def test_points_outside_the_domain():
    # The domain is the box: points far outside it are wrapped, in open space they have cells.
    points = plane(100)
    away = points + np.random.default_rng(2).integers(-50, 50, points.shape) * 16.0
    box = [16.0, 16.0]
    near, far = hs.CellList(points, 1.0, box=box), hs.CellList(away, 1.0, box=box)
    assert_array_equal(near.pairs(sort=True), far.pairs(sort=True))
    assert_array_equal(near.cell_of(away), near.cell_of(points))
    open_space = hs.CellList(away, 1.0)
    assert open_space.count_pairs() == hs.count_pairs(away, 1.0)


@pytest.mark.parametrize("periodic", [False, True])
def test_points_exactly_on_faces_and_on_the_far_end(periodic):
    points = np.stack(np.meshgrid(np.arange(11.0), np.arange(11.0)), -1).reshape(-1, 2)
    box = [11.0, 11.0] if periodic else None
    cells = hs.CellList(points, 1.0, box=box)
    assert cells.count_pairs() == (2 * 121 if periodic else 2 * 11 * 10)
    home = cells.cell_of(points)
    assert (home >= 0).all() and (home < len(cells.cell_start) - 1).all()
    assert cells.count_pairs(np.nextafter(1.0, 0.0)) == 0


@pytest.mark.parametrize("cell_size", [None, 1e-9])
def test_cells_follow_the_points_not_the_area(cell_size):
    points = np.array([[0.0, 0.0], [1e9, 1e9], [1e9, 1e9 - 1.0]])
    cells = hs.CellList(points, 1.0, cell_size=cell_size)
    assert len(cells.cell_start) <= 2 * 3 + 64 + 1
    assert_array_equal(cells.pairs(quantities="P"), [[1, 2]])


def test_a_skin_lasts_until_two_points_have_come_closer_by_all_of_it():
    # Head-on, each by half a skin: they begin just too far apart to be listed.
    cutoff, skin, apart = 1.0, 0.5, 1.5 + 2.0**-40
    pair_list = hs.VerletList(cutoff, skin)
    for step in range(129):
        moved = skin / 2.0 * step / 128.0
        points = np.array([[moved, 0.0], [apart - moved, 0.0], [50.0, 0.0]])
        pair_list.update(points)
        assert len(pair_list.pairs()[0]) == 0
        assert pair_list.n_builds == 1 or step == 128  # where all of it may be used up
    pair_list.update(points + [[2.0**-40, 0.0], [0.0, 0.0], [0.0, 0.0]])
    assert_array_equal(pair_list.pairs(quantities="P"), [[0, 1]])


def test_a_plane_has_no_third_coordinate():
    points = plane(4000)
    flat, deep = (
        hs.explain(np.concatenate([points, np.zeros((4000, more))], axis=1), 0.5, measure=True)
        for more in (0, 1)
    )
    flat_bytes, deep_bytes = flat.measured["bytes"], deep.measured["bytes"]
    column = 4000 * 8
    assert 2 * column <= flat_bytes["points"] < 2 * column + 4096
    assert deep_bytes["points"] - flat_bytes["points"] == column
    assert deep_bytes["candidates"] > flat_bytes["candidates"]  # of each neighbourhood
    assert "2 rows of cells" in flat.reason and len(flat.shape) == len(flat.images) == 2
    assert any("coordinates z" in text for text in flat.leaves_out)
    # The third coordinate that is always 0 adds nothing to what is tested, nor do cells along it.
    for name in ("groups", "candidates", "pairs"):
        assert flat.measured[name] == deep.measured[name]
