# SPDX-License-Identifier: BSD-3-Clause
"""Counting: the length of the list, for one cutoff or many, without the list."""

import itertools
import math

import numpy as np
import pytest

import halfshell as hs
from oracles import BOX_KINDS, lattice, random_scene, rotation


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_count_is_the_length_of_the_list(kind, rng):
    for n in (0, 1, 2, 30, 300):
        points, cutoff, box, _ = random_scene(rng, n, 3, kind, neighbours=20, spread=2)
        for flags, inclusive in itertools.product((True, [True, False, True]), (True, False)):
            how = {"box": box, "periodic": flags, "inclusive": inclusive}
            expected = len(hs.pairs(points, cutoff, quantities="i", **how))
            for kernel in hs.kernels():
                assert hs.count_pairs(points, cutoff, kernel=kernel, **how) == expected


def test_one_cutoff_gives_an_int(rng):
    points = rng.random((20, 3))
    for cutoff in (0.5, 1, np.float32(0.5), np.array(0.5)):
        assert type(hs.count_pairs(points, cutoff)) is int


def test_several_cutoffs_give_an_array(rng):
    points = rng.random((60, 3))
    cutoffs = [0.0, 0.1, 0.25, 0.5, 2.0]
    for form in (list, tuple, np.array):
        counts = hs.count_pairs(points, form(cutoffs))
        assert counts.dtype == np.int64 and counts.shape == (5,)
        assert counts.tolist() == [hs.count_pairs(points, c) for c in cutoffs]
        assert counts[0] == 0 and counts[-1] == 60 * 59 // 2
        assert hs.count_pairs(points, form([0.5])).shape == (1,)


def test_several_cutoffs_at_ties(rng):
    for inclusive in (True, False):
        for kernel in hs.kernels():
            points, box = lattice("fcc", (3, 3, 3))
            turn = rotation(rng)
            roots = [math.sqrt(k) for k in (2, 4, 6, 8)]
            cutoffs = sorted(
                x for r in roots for x in (math.nextafter(r, 0), r, math.nextafter(r, 9))
            )
            for crystal, frame in (
                (points, box),
                (points @ turn, box @ turn),
                (points @ turn, None),
            ):
                how = {"box": frame, "inclusive": inclusive, "kernel": kernel}
                counts = hs.count_pairs(crystal, cutoffs, **how)
                assert counts.tolist() == [
                    len(hs.pairs(crystal, c, quantities="j", **how)) for c in cutoffs
                ]


def test_counts_of_coincident_points():
    for kernel in hs.kernels():
        assert hs.count_pairs(np.full((2000, 2), 0.3), 0.0, kernel=kernel) == 2000 * 1999 // 2
        assert hs.count_pairs(np.full((200, 2), 0.3), 0.0, inclusive=False, kernel=kernel) == 0


def test_counting_needs_no_memory_for_the_list(rng):
    # 5e7 pairs would take 800 MB; counting them fits into far less.
    points = rng.random((10_000, 3))
    assert hs.count_pairs(points, 2.0, memory_limit=50_000_000) == 10_000 * 9_999 // 2


def test_precision_may_be_anything():
    for odd in (np.zeros(2), np.zeros(0), np.zeros(2, "V3"), 5, b"exact"):
        with pytest.raises(TypeError, match="precision"):
            hs.count_pairs([[0.0], [1.0]], [0.5, 1.0], precision=odd)


def test_without_cutoffs_all_else_is_checked():
    assert hs.count_pairs([[0.0], [1.0]], []).tolist() == []
    with pytest.raises(ValueError, match=r"points\[0, 0\]"):
        hs.count_pairs([[np.nan]], [])
    with pytest.raises(ValueError, match="kernel"):
        hs.count_pairs([[0.0]], [], kernel="none")
    with pytest.raises(ValueError, match="queries"):
        hs.count_pairs([[0.0]], [], queries=[[np.inf]])
