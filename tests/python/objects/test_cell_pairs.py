# SPDX-License-Identifier: BSD-3-Clause
"""Pairs that a `CellList` hands out in blocks and one by one: from its own cells, in one order."""

import gc
import itertools

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import halfshell as hs
from cell_scenes import SCENES, scene_of
from subprocesses import RESIDENT, run


def cells_of(name, factor=1.0):
    points, cutoff, scene = scene_of(name)
    return hs.CellList(points, cutoff * factor, **scene), cutoff


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("factor", [1.0, 1.5, 0.5])
def test_blocks_joined_are_the_pairs_in_their_order(name, factor):
    cells, cutoff = cells_of(name, factor)
    expected = cells.pairs(cutoff, quantities="ijdDS")
    m = len(expected[0])
    for most in {1, 7, max(m, 1), m + 1} if m < 300 else {m // 3, m + 1}:
        blocks = list(cells.iter_pairs(cutoff, quantities="ijdDS", max_pairs=most))
        assert len(blocks) == -(-m // most)
        for k, whole in enumerate(expected):
            joined = [block[k] for block in blocks]
            assert_array_equal(np.concatenate([whole[:0], *joined]), whole)


@pytest.mark.parametrize("name", SCENES)
def test_a_function_is_called_in_the_same_order(name):
    cells, _ = cells_of(name)
    seen = []
    n = cells.for_each_pair(lambda i, j, S, D, d2: seen.append((i, j, S, D)))
    i, j, S, D = cells.pairs(quantities="ijSD")
    assert n == len(i) == len(seen)
    rows = zip(i.tolist(), j.tolist(), map(tuple, S.tolist()), map(tuple, D.tolist()), strict=True)
    assert seen == list(rows)


def test_an_iterator_outlives_its_list():
    cells, _ = cells_of("triclinic")
    expected = cells.pairs()
    blocks = cells.iter_pairs(max_pairs=50)
    first = next(blocks)
    del cells
    gc.collect()
    np.random.default_rng(0).random(100_000)
    columns = zip(*itertools.chain([first], blocks), strict=True)
    for column, whole in zip(columns, expected, strict=True):
        assert_array_equal(np.concatenate(column), whole)


def test_lists_and_iterators_give_their_memory_back():
    grown = run(RESIDENT + """
import json
import numpy as np, halfshell as hs
points = np.random.default_rng(1).random((200_000, 3))
held = []
for turn in range(30):
    cells = hs.CellList(points, 0.02, box=[1.0] * 3)
    blocks = cells.iter_pairs(max_pairs=100_000)
    next(blocks)
    if turn % 3 == 0:
        blocks.close()
        assert list(blocks) == []
    elif turn % 3 == 1:
        del cells
    del blocks
    held.append(resident())
print(json.dumps(held[-1] - held[9]))
""")
    assert grown < 30e6  # a list has 10 MB


def test_progress_is_told_and_may_stop_a_block():
    points = np.random.default_rng(2).random((60_000, 3))
    cells = hs.CellList(points, 0.03, box=[1.0] * 3, threads=1)
    told = []
    n = sum(len(i) for i, _ in cells.iter_pairs(max_pairs=200_000, progress=told.append))
    assert n == cells.count_pairs()
    assert told == sorted(told) and told[-1] == 1.0 and len(told) >= 2

    fails = [True]

    def stop(fraction):
        if fails[0]:
            raise KeyError(fraction)

    fails[0] = False
    blocks = cells.iter_pairs(max_pairs=200_000, progress=stop)
    m = len(next(blocks)[0])
    fails[0] = True
    with pytest.raises(KeyError):
        next(blocks)
    fails[0] = False
    assert m + sum(len(i) for i, _ in blocks) == n  # it goes on where it was


def test_what_cannot_be_called_is_refused():
    cells, _ = cells_of("plane")
    with pytest.raises(TypeError, match="progress must be callable or a bool, got int"):
        cells.iter_pairs(progress=3)
    with pytest.raises(ValueError, match="max_pairs must be 1 or more"):
        cells.iter_pairs(max_pairs=0)
    with pytest.raises(TypeError, match="callback must be"):
        cells.for_each_pair(3)
    with pytest.raises(TypeError, match="sort"):
        cells.iter_pairs(sort=True)
