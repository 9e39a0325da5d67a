# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a list that is kept are those of `neighbors`, bit for bit."""

import pickle

import numpy as np
import pytest
from hypothesis import given

import halfshell as hs
from scene_strategies import scenes

NAMES = {"j": "indices", "d": "distances", "D": "vectors", "S": "shifts"}


def same(table, expected):
    assert table.quantities == expected.quantities and table.shape == expected.shape
    for name in ("offsets", *(NAMES[letter] for letter in table.quantities)):
        ours, theirs = getattr(table, name), getattr(expected, name)
        assert ours.dtype == theirs.dtype and not ours.flags.writeable
        assert ours.shape == theirs.shape and ours.tobytes() == theirs.tobytes(), name


@given(scenes())
def test_rows_are_those_of_a_search(scene):
    how = {"box": scene.box, "periodic": scene.periodic, "inclusive": scene.inclusive}
    for skin in (0.3 * scene.cutoff, "auto"):
        pair_list = hs.VerletList(scene.cutoff, skin, **how)
        pair_list.update(scene.points)
        for quantities in ("j", "jdDS", "S", "Dj"):
            same(
                pair_list.neighbors(quantities=quantities),
                hs.neighbors(scene.points, scene.cutoff, quantities=quantities, **how),
            )


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_steps_with_many_images_and_equal_points(threads, dtype, rng):
    points = np.repeat(rng.random((30, 3)), 2, axis=0).astype(dtype)
    how = {"box": [0.9, 1.1, 0.7], "threads": threads}
    pair_list = hs.VerletList(1.0, 0.2, **how)
    for _ in range(4):
        pair_list.update(points)
        expected = hs.neighbors(points, 1.0, quantities="jSdD", index_dtype=np.int32, **how)
        table = pair_list.neighbors(quantities="jSdD", index_dtype=np.int32)
        same(table, expected)
        assert np.array_equal(table.reverse(), expected.reverse())
        half = table.to_pairs(quantities="ijS", half=True)
        assert all(map(np.array_equal, half, pair_list.pairs(quantities="ijS", sort=True)))
        points = (points + rng.normal(0.0, 0.01, points.shape)).astype(dtype)
    assert pair_list.n_builds < 4


def test_no_points():
    for n in (0, 1):
        pair_list = hs.VerletList(1.0, 0.1)
        pair_list.update(np.zeros((n, 2)))
        same(pair_list.neighbors(quantities="jdDS"),
             hs.neighbors(np.zeros((n, 2)), 1.0, quantities="jdDS"))  # fmt: skip


def test_what_cannot_be_answered_is_refused():
    pair_list = hs.VerletList(1.0, 0.1, box=[1.0])
    with pytest.raises(RuntimeError, match="call update first"):
        pair_list.neighbors()
    pair_list.update([[0.0], [0.25]])
    for wrong in ("ij", "x", "jj", "P", "k"):
        with pytest.raises(ValueError, match="quantities must be some of the letters"):
            pair_list.neighbors(quantities=wrong)
    with pytest.raises(TypeError, match="quantities"):
        pair_list.neighbors(quantities=1)
    with pytest.raises(ValueError, match="index_dtype"):
        pair_list.neighbors(index_dtype=np.uint32)
    table = pair_list.neighbors(quantities="jd")
    with pytest.raises(AttributeError, match="this table has no points"):
        table.sort()
    assert pickle.loads(pickle.dumps(table)).indices.tolist() == table.indices.tolist()


def test_a_shift_without_an_opposite_is_refused():
    points = [[0.0], [2.0**31]]
    pair_list = hs.VerletList(0.25, 0.0, box=[1.0])
    pair_list.update(points)
    assert pair_list.pairs(quantities="S").tolist() == [[-(2**31)]]
    assert pair_list.neighbors().counts.tolist() == [1, 1]
    with pytest.raises(OverflowError, match="no opposite"):
        pair_list.neighbors(quantities="S")
