# SPDX-License-Identifier: BSD-3-Clause
"""Rows of some of the points are those of the whole table, bit for bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import halfshell as hs
from scene_strategies import scenes


def same(table, whole, numbers):
    assert table.n_rows == len(numbers) and table.n_points == whole.n_points
    for k, number in enumerate(numbers):
        for ours, theirs in zip(table[k], whole[number], strict=True):
            assert ours.dtype == theirs.dtype and ours.tobytes() == theirs.tobytes()


@given(scenes(), st.data())
def test_rows_are_those_of_the_whole_table(scene, data):
    n = len(scene.points)
    some = st.lists(st.integers(0, n - 1), max_size=8) if n else st.just([])
    numbers = data.draw(some)
    how = {"box": scene.box, "periodic": scene.periodic, "inclusive": scene.inclusive}
    whole = hs.neighbors(scene.points, scene.cutoff, quantities="jdDS", **how)
    table = hs.neighbors(scene.points, scene.cutoff, quantities="jdDS", indices=numbers, **how)
    same(table, whole, numbers)
    same(table.sort(), whole.sort(), numbers)
    cells = hs.CellList(scene.points, scene.cutoff, box=scene.box, periodic=scene.periodic)
    how_cells = {"inclusive": scene.inclusive, "indices": numbers}
    table = cells.neighbors(quantities="jdDS", **how_cells)
    same(table, whole, numbers)
    same(table.sort(), whole.sort(), numbers)
    assert cells.coordination(**how_cells).tolist() == whole.counts[numbers].tolist()
    counts = hs.coordination(scene.points, scene.cutoff, indices=numbers, **how)
    assert counts.dtype == np.int64 and counts.tolist() == whole.counts[numbers].tolist()


def test_many_images_and_equal_points(rng):
    points = np.repeat(rng.random((40, 3)), 3, axis=0).astype(np.float32)
    numbers, box = rng.integers(0, 120, 50), [0.9, 1.1, 0.7]
    for kernel, threads in zip(hs.kernels(), (1, 3, 1, 3)):
        how = {"box": box, "kernel": kernel, "threads": threads}
        whole = hs.neighbors(points, 1.3, quantities="jDSd", **how)
        how["indices"] = numbers
        same(hs.neighbors(points, 1.3, quantities="jDSd", **how), whole, numbers)
        bare = hs.neighbors(points, 1.3, quantities="S", index_dtype=np.int32, **how)
        assert np.array_equal(bare.shifts, np.concatenate([whole[k][2] for k in numbers]))
        lacking = hs.neighbors(points, 1.3, quantities="jd", **how)
        del how["indices"]
        same(lacking.sort(), hs.neighbors(points, 1.3, quantities="jd", **how).sort(), numbers)


def test_radii_of_their_own(rng):
    for rule in ("sum", "mean", "max", "min", "gather", "scatter"):
        for inclusive in (True, False):
            points, radii = rng.random((60, 2)), np.where(rng.random(60) < 0.3, 0.0, 0.4)
            how = {"radii": radii, "rule": rule, "box": [1.0, 1.0], "inclusive": inclusive}
            whole = hs.neighbors(points, None, quantities="jd", **how)
            numbers = rng.permutation(60)[:30]
            same(
                hs.neighbors(points, None, quantities="jd", indices=numbers, **how), whole, numbers
            )
            counts = hs.coordination(points, None, indices=numbers, **how)
            assert np.array_equal(counts, whole.counts[numbers])


def test_types_that_do_not_see_themselves(rng):
    points, types = rng.random((50, 3)), rng.integers(0, 2, 50)
    cutoffs = {(0, 1): 0.4, (1, 1): 0.9}  # none between two of type 0
    how = {"types": types, "box": 1.0}
    whole = hs.neighbors(points, cutoffs, quantities="jS", **how)
    numbers = np.arange(50)
    same(hs.neighbors(points, cutoffs, quantities="jS", indices=numbers, **how), whole, numbers)


def test_supports_of_their_own(rng):
    points = rng.random((40, 2))
    H = np.tile(np.diag([4.0, 2.0]), (40, 1, 1))
    how = {"supports": H, "extent": 1.0, "rule": "gather"}
    whole = hs.neighbors(points, None, quantities="jd", **how)
    same(hs.neighbors(points, None, quantities="jd", indices=[5, 3], **how), whole, [5, 3])


def test_nothing_is_within_an_open_cutoff_of_zero():
    points = np.zeros((3, 2))
    assert hs.coordination(points, 0.0, inclusive=False, indices=[1]).tolist() == [0]
    assert hs.coordination(points, 0.0, indices=[1, 1]).tolist() == [2, 2]
    empty = hs.neighbors(np.empty((0, 3)), 1.0, indices=[])
    assert empty.shape == (0, 0) and hs.neighbors(points, 1.0, indices=[]).shape == (0, 3)


@pytest.mark.parametrize(
    ("wrong", "error", "said"),
    [
        ([3], ValueError, "indices must be numbers of points, from 0 to 2"),
        ([-1], ValueError, "indices must be numbers of points"),
        ([0.5], TypeError, "indices must hold integers"),
        ([True], TypeError, "indices must hold integers"),
        ([[0]], ValueError, "indices must have shape"),
    ],
)
def test_wrong_indices(wrong, error, said):
    points = np.zeros((3, 2))
    cells = hs.CellList(points, 1.0)
    for search in (hs.neighbors, hs.coordination):
        with pytest.raises(error, match=said):
            search(points, 1.0, indices=wrong)
    for search in (cells.neighbors, cells.coordination):
        with pytest.raises(error, match=said):
            search(indices=wrong)
        with pytest.raises(ValueError, match="do not give queries as well"):
            search(indices=[0], queries=points)


def test_what_does_not_go_with_indices():
    points = np.zeros((3, 2))
    with pytest.raises(ValueError, match="do not give queries as well"):
        hs.neighbors(points, 1.0, indices=[0], queries=points)
    with pytest.raises(ValueError, match="cannot be combined with precision 'single'"):
        hs.coordination(points, 1.0, indices=[0], precision="single")
    with pytest.raises(ValueError, match="letters"):
        hs.neighbors(points, 1.0, indices=[0], quantities="jj")
    with pytest.raises(ValueError, match="letters"):
        hs.neighbors(points, 1.0, indices=[0], quantities="i")
    table = hs.neighbors(points, 1.0, indices=[0], quantities="jd")
    with pytest.raises(ValueError, match="one set of points"):
        table.reverse()
    with pytest.raises(ValueError, match="read-only"):
        table.indices[0] = 7
