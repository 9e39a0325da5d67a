# SPDX-License-Identifier: BSD-3-Clause
"""Counts of pairs, within cutoffs and by distance."""


import numpy as np
import pytest

import halfshell as hs
from calls import call


def test_counting_needs_no_memory_for_the_list(rng):
    # 5e7 pairs would take 800 MB; counting them fits into far less.
    points = rng.random((10_000, 3))
    assert call(hs.count_pairs, points, 2.0, memory_limit=50_000_000) == 10_000 * 9_999 // 2


# ---- by distance -------------------------------------------------------------------------------


def test_scenes_without_pairs():
    for kernel in hs.kernels():
        for points in ([], [[0.5, 0.5]], np.empty((0, 2)), [[0.0], [9.0]]):
            assert call(hs.pair_histogram, points, [0.0, 1.0, 2.0], kernel=kernel).tolist() == [
                0,
                0,
            ]
        assert call(hs.pair_histogram, [], [0.0, 1.0], types=[]).tolist() == [[[0]]]
        assert call(hs.pair_histogram, [], [0.0, 1.0], weights=[]).tolist() == [0.0]
        assert hs.pair_histogram([[0.0]], [0.0, 1.0], queries=[]).tolist() == [0]
        same_place = np.full((100, 3), 0.7)
        assert call(hs.pair_histogram, same_place, [0.0, 0.0], kernel=kernel).tolist() == [4950]
        assert call(hs.pair_histogram, same_place, [0.0, 1e-300], kernel=kernel).tolist() == [4950]
        assert call(hs.pair_histogram, same_place, [5e-324, 1.0], kernel=kernel).tolist() == [0]


def test_memory_is_that_of_the_bins(rng):
    points = rng.random((10_000, 3))  # 5e7 pairs
    edges = np.linspace(0.0, 2.0, 101)
    found = call(hs.pair_histogram, points, edges, memory_limit=50_000_000)
    assert found.sum() == 10_000 * 9_999 // 2
    with pytest.raises(MemoryError):
        call(hs.pair_histogram, points, edges, types=np.arange(10_000), memory_limit=50_000_000)
