# SPDX-License-Identifier: BSD-3-Clause
"""`iter_pairs` gives the arrays of `pairs` in blocks, and holds and leaves behind little."""

import copy
import gc
import itertools
import pickle
import weakref

import numpy as np
import pytest

import halfshell as hs
from calls import call
from stream_scenes import SCENES
from subprocesses import RESIDENT, run


def joined(blocks, quantities):
    """One array for each quantity, from a list of blocks; None without any."""
    if not blocks:
        return None
    if len(quantities) == 1:
        return (np.concatenate(blocks),)
    return tuple(np.concatenate(column) for column in zip(*blocks))


def assert_same(blocks, expected, quantities, max_pairs):
    expected = expected if isinstance(expected, tuple) else (expected,)
    m = len(expected[0])
    first = [block[0] if len(quantities) > 1 else block for block in blocks]
    sizes = [len(array) for array in first]
    whole, rest = divmod(m, max_pairs)
    assert sizes == [max_pairs] * whole + [rest] * (rest > 0)
    if m > 0:
        for got, wanted in zip(joined(blocks, quantities), expected, strict=True):
            assert got.dtype == wanted.dtype
            assert got.tobytes() == wanted.tobytes()


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_blocks_are_the_pairs_in_their_order(scene):
    points, cutoff, options = scene
    for quantities in ("ij", "P", "ijdDS"):
        options = {**options, "quantities": quantities}
        expected = call(hs.pairs, points, cutoff, **options)
        for max_pairs in (7, 1009, 1 << 20, 10**30) if quantities != "P" else (1,):
            blocks = list(call(hs.iter_pairs, points, cutoff, max_pairs=max_pairs, **options))
            assert_same(blocks, expected, quantities, max_pairs)


@pytest.mark.parametrize(
    ("threads", "max_pairs"), [(1, 70_000), (2, 1000), (3, 1 << 20), (8, 70_000)]
)
def test_progress_never_falls_and_ends_at_one(rng, threads, max_pairs):
    seen = []
    points = rng.random((20_000, 3))
    options = {"quantities": "d", "max_pairs": max_pairs, "threads": threads}
    for of in (points, hs.CellList(points, 0.12)):
        seen.clear()
        n = sum(len(d) for d in call(hs.iter_pairs, of, 0.12, progress=seen.append, **options))
        assert n == hs.count_pairs(points, 0.12)
        assert seen == sorted(seen) and seen[0] >= 0.0 and seen[-1] == 1.0
        assert len(set(seen)) >= min(n // max_pairs, 5)


@pytest.mark.parametrize("threads", [1, 2])
def test_progress_of_searches_in_several_passes_is_one_run(rng, threads):
    points, radii = rng.random((120_000, 3)), rng.random(120_000) * 0.015
    cutoff, balls = 0.02, hs.Points(points, radii=radii)
    how = {"threads": threads}
    for search in (
        lambda p: hs.neighbors(points, cutoff, progress=p, **how),
        lambda p: hs.neighbors(points, cutoff, quantities="jd", progress=p, **how),
        lambda p: hs.pairs_between(points, points, cutoff, progress=p, **how),
        lambda p: hs.pairs_between(points[::3], points, cutoff, progress=p, **how),
        lambda p: hs.neighbors(points, cutoff, indices=np.arange(50_000), progress=p, **how),
        lambda p: hs.coordination(points, [0.01, 0.015, 0.02], progress=p, **how),
        lambda p: hs.pairs(balls, None, progress=p, **how),
        lambda p: hs.neighbors(balls, None, progress=p, **how),
        lambda p: hs.count_pairs(balls, None, progress=p, **how),
    ):
        told = []
        search(told.append)
        assert (
            told == sorted(told) and 0.0 <= min(told, default=0.0) <= max(told, default=0.0) <= 1.0
        )


def test_progress_of_a_batch_is_that_of_one_search(rng):
    points = hs.Points(rng.random((20_000, 3)), batch=np.repeat([0, 2], [15_000, 5000]))
    seen = []
    stream = hs.iter_pairs(points, 0.12, quantities="d", max_pairs=70_000, progress=seen.append)
    assert sum(map(len, stream)) == hs.count_pairs(points, 0.12).sum()
    assert seen == sorted(seen) and seen[-1] == 1.0
    assert sum(0.0 < fraction < 0.75 for fraction in seen) > 5


@pytest.mark.parametrize("of", ["points", "systems", "cells"])
def test_an_exception_of_the_hook_arrives_and_the_iterator_goes_on(rng, of):
    points, failing = rng.random((3000, 3)), itertools.count()
    if of == "systems":
        points = hs.Points(points, batch=np.repeat([0, 1, 5], 1000))
    elif of == "cells":
        points = hs.CellList(points, 0.4)

    def hook(fraction):
        if next(failing) % 3 == 1:
            raise KeyError(fraction)

    blocks, errors = [], 0
    stream = hs.iter_pairs(points, 0.4, max_pairs=90_000, progress=hook, threads=2)
    while True:
        try:
            blocks.append(next(stream))
        except KeyError:
            errors += 1
        except StopIteration:
            break
    assert errors > 1
    assert_same(blocks, hs.pairs(points, 0.4), "ij", 90_000)


def test_the_hook_cannot_ask_for_blocks(rng):
    outcomes = []

    def hook(fraction):
        try:
            next(stream)
        except ValueError as error:
            outcomes.append(str(error))
        with pytest.raises(ValueError, match="already"):
            stream.close()

    stream = hs.iter_pairs(rng.random((3000, 3)), 0.2, progress=hook)
    assert len(list(stream)) > 0
    assert outcomes and "already" in outcomes[0]


def test_a_cycle_through_the_hook_is_collected(rng):
    class Owner:
        def hook(self, fraction):
            pass

    owner = Owner()
    owner.blocks = hs.iter_pairs(rng.random((500, 3)), 0.3, max_pairs=5, progress=owner.hook)
    next(owner.blocks)
    gone = weakref.ref(owner)
    del owner
    gc.collect()
    assert gone() is None


def test_a_block_that_does_not_fit_is_refused(rng):
    points = rng.random((4000, 2))
    blocks = call(hs.iter_pairs, points, 2.0, max_pairs=4_000_000, memory_limit=20e6)
    with pytest.raises(MemoryError, match="max_pairs"):
        next(blocks)
    fitting = call(hs.iter_pairs, points, 2.0, max_pairs=100_000, memory_limit=20e6, threads=1)
    assert sum(len(i) for i, _ in fitting) == 4000 * 3999 // 2


@pytest.mark.slow
def test_abandoning_it_leaves_nothing_behind():
    grown = run(
        RESIDENT
        + """
import gc, json
import numpy as np
import halfshell as hs
points = np.random.default_rng(1).random((20_000, 3))

def close():
    blocks = hs.iter_pairs(points, 0.1, max_pairs=70_000, threads=2)
    next(blocks)
    blocks.close()

def forget():
    for block in hs.iter_pairs(points, 0.1, max_pairs=1000):
        break

def fail():
    try:
        for block in hs.iter_pairs(points, 0.1, quantities="ijdDS"):
            raise RuntimeError
    except RuntimeError:
        pass

def refuse():
    try:
        hs.iter_pairs(points * np.nan, 0.1)
    except ValueError:
        pass

def rounds(n):
    for _ in range(n):
        for call in (close, forget, fail, refuse):
            call()
    hs.clear_cache()
    gc.collect()
    return resident()

rounds(5)
before = rounds(5)
print(json.dumps(min(rounds(20), rounds(20)) - before))
"""
    )
    assert grown < 4_000_000


@pytest.mark.slow
def test_memory_does_not_grow_with_the_result():
    peak, n = run(
        RESIDENT
        + """
import json
import numpy as np
import halfshell as hs
points = np.random.default_rng(1).random((20_000, 2))
list(hs.iter_pairs(points[:100], 2.0))
before = peak = resident()
n = 0
with hs.settings(memory_limit=1e12):
    blocks = hs.iter_pairs(points, 2.0, max_pairs=1 << 18)
for i, j in blocks:
    n += len(i)
    peak = max(peak, resident())
print(json.dumps([peak - before, n]))
"""
    )
    assert n == 20_000 * 19_999 // 2  # 3.2 GB
    assert peak < 60_000_000


def test_close_ends_it(rng):
    blocks = hs.iter_pairs(rng.random((500, 3)), 0.3, max_pairs=10)
    next(blocks)
    blocks.close()
    blocks.close()
    assert list(blocks) == []


def test_a_search_that_goes_on_is_not_copied():
    blocks = hs.iter_pairs(np.arange(5.0)[:, None], 1.5, max_pairs=2)
    for copied in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="a search that goes on cannot be copied or pickled"):
            copied(blocks)
    assert sum(len(i) for i, _ in blocks) == 4
