# SPDX-License-Identifier: BSD-3-Clause
"""`iter_pairs` gives the arrays of `pairs` in blocks, and holds and leaves behind little."""

import gc
import itertools
import weakref

import numpy as np
import pytest

import halfshell as hs
from calls import call
from stream_scenes import BOX, SCENES
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


@pytest.mark.parametrize("index_dtype", [np.int32, np.int64])
def test_any_kernel_and_any_number_of_threads(index_dtype, rng):
    points = rng.random((6000, 3))
    options = {"box": BOX, "index_dtype": index_dtype, "quantities": "jSd"}
    expected = call(hs.pairs, points, 0.14, **options)
    assert len(expected[0]) > 200_000
    for kernel, threads in zip([*hs.kernels(), None], (1, 2, 3, 2)):
        how = {"kernel": kernel, "threads": threads, **options}
        for max_pairs in (65_536, 99_991):
            blocks = list(call(hs.iter_pairs, points, 0.14, max_pairs=max_pairs, **how))
            assert_same(blocks, expected, "jSd", max_pairs)


def test_blocks_belong_to_the_caller(rng):
    points = rng.random((300, 3))
    blocks = []
    for i, j in hs.iter_pairs(points, 0.3, max_pairs=100):
        assert i.flags.writeable and j.flags.c_contiguous
        blocks.append((i.copy(), j.copy()))
        i[:] = j[:] = -1
    assert_same(blocks, hs.pairs(points, 0.3), "ij", 100)


def test_changed_points_change_nothing(rng):
    points = rng.random((300, 3))
    box = np.ones(3)
    expected = hs.pairs(points, 0.3, box=box, quantities="dD")
    blocks = []
    for block in hs.iter_pairs(points, 0.3, box=box, quantities="dD", max_pairs=100):
        blocks.append(block)
        points[:] = np.nan
        box[:] = 0.0
    assert_same(blocks, expected, "dD", 100)


def test_wrong_arguments_are_refused_by_the_call():
    for change, error in (
        ({"cutoff": -1.0}, ValueError), ({"quantities": "ix"}, ValueError),
        ({"max_pairs": 0}, ValueError), ({"progress": 1}, TypeError),
        ({"memory_limit": 10}, MemoryError),
    ):  # fmt: skip
        arguments = {"points": [[0.0, 0.0], [1.0, 0.0]], "cutoff": 1.0} | change
        with pytest.raises(error):
            call(hs.iter_pairs, **arguments)


def test_it_is_an_iterator_that_ends_for_good():
    blocks = hs.iter_pairs([[0.0], [1.0]], 1.0)
    assert iter(blocks) is blocks
    assert next(blocks)[0].tolist() == [0]
    for _ in range(2):
        with pytest.raises(StopIteration):
            next(blocks)


def test_close_ends_it(rng):
    blocks = hs.iter_pairs(rng.random((500, 3)), 0.3, max_pairs=10)
    next(blocks)
    blocks.close()
    blocks.close()
    assert list(blocks) == []


@pytest.mark.parametrize(
    ("threads", "max_pairs"), [(1, 70_000), (2, 1000), (3, 1 << 20), (8, 70_000)]
)
def test_progress_never_falls_and_ends_at_one(rng, threads, max_pairs):
    seen = []
    points = rng.random((20_000, 3))
    options = {"quantities": "d", "max_pairs": max_pairs, "threads": threads}
    n = sum(len(d) for d in call(hs.iter_pairs, points, 0.12, progress=seen.append, **options))
    assert n == hs.count_pairs(points, 0.12)
    assert seen == sorted(seen) and seen[0] >= 0.0 and seen[-1] == 1.0
    assert len(set(seen)) >= min(n // max_pairs, 5)


@pytest.mark.parametrize("threads", [1, 3])
def test_progress_of_what_is_repeated_never_falls(rng, threads):
    told = []

    def hook(fraction):
        told.append(fraction)
        if len(told) % 5 == 4:
            raise KeyError

    stream = hs.iter_pairs(
        rng.random((20_000, 3)), 0.12, max_pairs=300_000, progress=hook, threads=threads
    )
    while True:
        try:
            next(stream)
        except KeyError:
            pass
        except StopIteration:
            break
    assert told == sorted(told) and told[-1] == 1.0


@pytest.mark.parametrize(("threads", "sort"), [(1, False), (1, True), (2, True), (3, False)])
def test_progress_of_all_pairs_at_once_never_falls(rng, threads, sort):
    told = []
    hs.pairs(rng.random((60_000, 3)), 0.08, progress=told.append, threads=threads, sort=sort)
    assert told == sorted(told) and all(0.0 <= fraction <= 1.0 for fraction in told)
    # Of several threads the others, which tell nothing, may do the work.
    assert len(told) > 3 or threads != 1


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


def test_progress_of_batches_and_of_cells_never_falls(rng):
    points, batch = rng.random((60_000, 3)), np.arange(60_000) // 20_000
    cells = hs.CellList(points, 0.08)
    for search in (
        lambda **how: call(hs.pairs, points, 0.08, batch=batch, **how),
        lambda **how: call(hs.pairs, points.tolist(), 0.08, **how),
        cells.pairs,
    ):
        told = []
        found = search(progress=told.append)
        assert len(told) > 1 and told == sorted(told) and 0.0 <= told[0] and told[-1] <= 1.0
        assert all(map(np.array_equal, found, search()))


def test_exceptions_of_the_hook_end_the_search(rng):
    points = rng.random((60_000, 3))

    def hook(fraction):
        raise KeyError(fraction)

    for search in (
        lambda **how: call(hs.pairs, points, 0.08, **how),
        hs.CellList(points, 0.08).pairs,
    ):
        with pytest.raises(KeyError):
            search(progress=hook)
        with pytest.raises(TypeError, match="progress must be callable or a bool, got int"):
            search(progress=1)
    for few in (points[:4], points[:4].tolist()):
        with pytest.raises(TypeError, match="progress must be callable or a bool, got str"):
            hs.pairs(few, 0.1, progress="yes")


def test_an_exception_of_the_hook_arrives_and_the_iterator_goes_on(rng):
    points = rng.random((3000, 3))
    failing = itertools.count()

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
    assert errors > 2
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


def test_shifts_that_do_not_fit_are_refused():
    points = [[0.0], [1e10], [0.5]]
    with pytest.raises(OverflowError, match="points"):
        list(hs.iter_pairs(points, 0.6, box=[1.0], quantities="S"))


def test_a_block_that_does_not_fit_is_refused(rng):
    points = rng.random((4000, 2))
    blocks = call(hs.iter_pairs, points, 2.0, max_pairs=4_000_000, memory_limit=20e6)
    with pytest.raises(MemoryError, match="max_pairs"):
        next(blocks)
    fitting = call(hs.iter_pairs, points, 2.0, max_pairs=100_000, memory_limit=20e6, threads=1)
    assert sum(len(i) for i, _ in fitting) == 4000 * 3999 // 2


def test_refusals_of_pairs_point_here(rng):
    with pytest.raises(MemoryError, match="iter_pairs"):
        call(hs.pairs, rng.random((4000, 2)), 2.0, memory_limit=20e6)


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


@pytest.mark.slow
def test_ctrl_c_within_a_block_and_between_blocks():
    outcome, delay, total, expected = run(
        """
import json, signal, threading, time
import numpy as np
import halfshell as hs
points = np.random.default_rng(1).random((30_000, 3))
sent = []

def interrupt():
    sent.append(time.perf_counter())
    signal.raise_signal(signal.SIGINT)

with hs.settings(memory_limit=1e13):
    blocks = hs.iter_pairs(points, 2.0, max_pairs=10**9)
threading.Timer(0.3, interrupt).start()
try:
    next(blocks)
    outcome = "finished"
except KeyboardInterrupt:
    outcome = "interrupted"
delay = time.perf_counter() - sent[0]
blocks.close()
few = points[:2000]
inside = False
while not inside:  # again, if it was interrupted between two iterators
    threading.Timer(0.2, interrupt).start()
    try:
        while True:
            blocks, total, inside = hs.iter_pairs(few, 0.1, max_pairs=100), 0, True
            for i, j in blocks:
                total += len(i)
            inside = False
    except KeyboardInterrupt:
        total += sum(len(i) for i, j in blocks) if inside else 0
print(json.dumps([outcome, delay, total, hs.count_pairs(few, 0.1)]))
"""
    )
    assert outcome == "interrupted"
    assert delay < 1.0
    assert total in (expected, expected - 100)
