# SPDX-License-Identifier: BSD-3-Clause
"""`CellList.candidates` of queries that lie far from the points."""

import numpy as np
import pytest

import halfshell as hs


@pytest.mark.parametrize("where", [0.0, 1.0, -100.0, 1e6])
@pytest.mark.parametrize("box", [None, [1.0, 1.0], [[1.0, 0.0], [0.3, 1.0]]], ids=str)
def test_candidates_of_queries_far_outside(where, box):
    rng = np.random.default_rng(7)
    points = rng.random((50, 2)) + where
    for periodic in (None,) if box is None else ([True, True], [True, False]):
        cells = hs.CellList(points, 0.1, box=box, periodic=periodic)
        for away in (0.0, 0.3, 1.5, -3.0, 50.0, -900.0):
            queries = points[:20] + np.array([0.0, away])
            block = cells.candidates(queries)
            table = cells.query(queries)
            for row in range(20):
                found = table.indices[table.offsets[row] : table.offsets[row + 1]]
                ranges = slice(block.offsets[row], block.offsets[row + 1])
                held = [cells.order[a:b] for a, b in zip(block.start[ranges], block.stop[ranges])]
                assert set(found.tolist()) <= set(np.concatenate([[], *held]).tolist())
            if abs(away) > 1.2 and (box is None or not periodic[1]):
                assert len(block.start) == 0


def test_candidates_take_queries_at_any_distance_along_the_axes():
    for shift in (0.0, 1.0, -1e9):
        cells = hs.CellList([[shift], [shift + 0.125]], 0.125)
        block = cells.candidates([[shift + 0.375], [shift + 0.125], [1e200], [-1e200]])
        assert np.diff(block.offsets).tolist()[0] == 0
        assert np.diff(block.offsets).tolist()[1] > 0
        assert np.diff(block.offsets).tolist()[2:] == [0, 0]
    periodic = hs.CellList([[0.25, 0.0]], 0.5, box=[4.0, 4.0])
    for query in ([4e200, 0.0], [-(2.0**60), 2.0**100], [5e-324, -5e-324]):
        block = periodic.candidates([query])
        assert 0 in [k for a, b in zip(block.start, block.stop) for k in periodic.order[a:b]]
    assert len(hs.CellList([[1e30]], 1e25).candidates([[5e-324]]).start) == 0


def test_candidates_that_are_refused_name_the_query():
    skewed = hs.CellList([[0.1, 0.1]], 0.3, box=[[1.0, 0.0], [0.3, 1.0]])
    with pytest.raises(ValueError, match=r"queries\[2, 1\] = 9000000.0 lies too far"):
        skewed.candidates([[0.0, 0.0], [1000.0, 0.0], [0.0, 9e6], [9e9, 0.0]])
    box = [[1.0, 0.0, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 1.0]]
    far = hs.CellList([[0.1, 0.1, 1e200]], 0.3, box=box, periodic=[True, True, False])
    with pytest.raises(ValueError, match="one cell holds everything"):
        far.candidates([[0.1, 0.1, 0.0]])
    assert len(far.query([[0.1, 0.1, 1e200]]).indices) == 1
