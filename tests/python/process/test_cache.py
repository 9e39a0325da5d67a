# SPDX-License-Identifier: BSD-3-Clause
"""The memory of deleted results: kept up to a limit, given back on request, never seen again."""

import gc

import numpy as np
import pytest

import halfshell as hs

POINTS = np.random.RandomState(3).rand(20000, 3) * 20.0


@pytest.fixture(autouse=True)
def fresh_cache():
    before = hs.set_cache_limit(256 << 20)
    hs.clear_cache()
    yield
    hs.set_cache_limit(before)
    hs.clear_cache()


def search():
    return hs.pairs(POINTS, 1.5, quantities="ijd", threads=1)


def test_deleted_results_are_kept_and_cleared():
    found = search()
    size = sum(array.nbytes for array in found)
    assert size > 4_000_000
    del found
    gc.collect()
    assert hs.cache_info().held >= size // 2
    assert hs.cache_info() == (hs.cache_info().held, 256 << 20)
    hs.clear_cache()
    assert hs.cache_info().held == 0


@pytest.mark.parametrize("n", [300, 1000, 3000, 10_000])
def test_the_next_call_finds_the_memory_of_the_last_one(n):
    """Nothing is taken from the system again: no page is met for the first time."""
    resource = pytest.importorskip("resource")  # of Unix
    side = (10.0 * n) ** (1 / 3)
    points = np.random.RandomState(n).rand(n, 3) * side
    for call in range(30):
        if call == 10:
            before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        hs.pairs(points, 5.0, box=[side] * 3, quantities="ijdDS", threads=1)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before < 500


def test_results_that_live_are_not_touched_by_later_ones():
    first = search()
    copies = [array.copy() for array in first]
    for _ in range(3):
        other = search()
        for array in other:
            array[...] = 0
        del other
    assert all(np.array_equal(a, b) for a, b in zip(first, copies, strict=True))


def test_a_limit_of_zero_keeps_nothing():
    hs.set_cache_limit(0)
    search()
    gc.collect()
    assert hs.cache_info().held == 0


def test_lowering_the_limit_gives_back_at_once():
    search()
    gc.collect()
    assert hs.cache_info().held > 1_000_000
    hs.set_cache_limit(1_000_000)
    assert hs.cache_info().held <= 1_000_000
    assert hs.set_cache_limit(256 << 20) == 1_000_000


@pytest.mark.parametrize("n", [1000, 40_000])
def test_only_small_arrays_are_copies_of_what_the_search_wrote(n):
    """256 KB and more stay where they are; the memory behind less is free for the next search."""
    points = np.arange(float(n))[:, None]
    table = hs.neighbors(points, 1.0, quantities="j", index_dtype=np.int64)
    for array in (*hs.pairs(points, 1.0), table.offsets, table.indices):
        while array.base is not None and isinstance(array.base, np.ndarray):
            array = array.base
        assert array.flags.owndata == (array.nbytes < 256 << 10)


def test_bad_limits():
    for limit in (-1, -0.5, np.nan, "1", True, np.True_):
        kind = ValueError if isinstance(limit, (int, float)) and limit is not True else TypeError
        with pytest.raises(kind, match="limit must"):
            hs.set_cache_limit(limit)
