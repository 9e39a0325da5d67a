# SPDX-License-Identifier: BSD-3-Clause
"""The contract of numerics' `CellList2D`, one test for each of its invariants.

docs/systems/numerics.md has the table that these belong to.
"""


import numpy as np
import pytest
from numpy.testing import assert_array_equal

import halfshell as hs


def plane(n, seed=1):
    return np.random.default_rng(seed).random((n, 2)) * 10.0


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
