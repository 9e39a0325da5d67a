# SPDX-License-Identifier: BSD-3-Clause
"""Many Python threads at once; inputs that change during a search."""

import sys
import threading
import time

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import random_scene, same_arrays
from subprocesses import run


def in_threads(count, work):
    """Call work(k) in `count` threads that start together; return results, or raise."""
    results, errors = [None] * count, []
    barrier = threading.Barrier(count)

    def body(k):
        barrier.wait()
        try:
            results[k] = work(k)
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=body, args=(k,)) for k in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if errors:
        raise errors[0]
    return results


def test_different_searches_in_many_threads(rng):
    scenes = [random_scene(rng, 20 + 60 * k, 1 + k % 4, neighbours=12) for k in range(12)]
    names = hs.kernels()

    def work(k):
        points, cutoff, box, flags = scenes[k]
        return [
            call(hs.pairs,
                points,
                cutoff,
                box=box,
                periodic=flags,
                quantities="ijSdDP",
                kernel=names[k % len(names)],
                sort=bool(k % 2),
            )
            for _ in range(5)
        ]

    alone = [work(k)[0] for k in range(len(scenes))]
    for expected, results in zip(alone, in_threads(len(scenes), work)):
        assert all(same_arrays(found, expected) for found in results)


def test_failures_in_one_thread_do_not_disturb_the_others(rng):
    points, cutoff, box, _ = random_scene(rng, 1000, neighbours=10)
    expected = hs.count_pairs(points, cutoff, box=box)
    broken = points.copy()
    broken[500] = np.nan

    def work(k):
        if k % 2:
            return [hs.count_pairs(points, cutoff, box=box) for _ in range(20)]
        for _ in range(20):
            try:
                hs.count_pairs(broken, cutoff, box=box)
            except ValueError as error:
                assert "500" in str(error)
            else:
                raise AssertionError("NaN was accepted")
        return [expected]

    for counts in in_threads(8, work):
        assert set(counts) == {expected}


def test_searches_in_threads_overlap(rng):
    # With the lock held, the ticking thread would stand still for the whole search.
    points = rng.random((50_000, 3))
    ticks, done = [], threading.Event()

    def tick():
        while not done.wait(0.002):
            ticks.append(1)

    ticking = threading.Thread(target=tick)
    ticking.start()
    before = len(ticks)
    hs.count_pairs(points, 2.0)
    during = len(ticks) - before
    done.set()
    ticking.join()
    assert during >= 5


@pytest.mark.skipif(
    not getattr(sys, "_is_gil_enabled", lambda: True)(), reason="callbacks run at the same time"
)
def test_threads_that_wait_for_their_turn_do_not_call_after_an_exception(rng):
    calls = []

    def callback(*pair):
        calls.append(pair)
        end = time.perf_counter() + 0.2  # others come as far as their first call
        while time.perf_counter() < end:
            pass
        raise LookupError

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000.0)  # no thread gives way to another in between
    try:
        with pytest.raises(LookupError):
            hs.for_each_pair(rng.random((8000, 3)), 0.1, callback, threads=4, thread_safe=True)
    finally:
        sys.setswitchinterval(interval)
    assert len(calls) == 1


@pytest.mark.slow
def test_points_that_change_during_the_search_never_crash():
    # Any answer is allowed, or an exception; the process must survive and work afterwards.
    survived, changed = run(
        """
import json, threading, time
import numpy as np
import pytest
import halfshell as hs

rng = np.random.default_rng(1)
start = rng.random((20_000, 3))
points, box = start.copy(), np.eye(3)
stop = False
writes = 0

def mutate():
    global writes
    junk = [np.nan, np.inf, -np.inf, 1e300, -1e300, 5e-324, 0.5, 1e17]
    k = 0
    while not stop:
        k += 1
        points[k * 7919 % 20_000] = junk[k % len(junk)]
        box[k % 3, (k // 3) % 3] = junk[k % len(junk)]
        if k % 50 == 0:
            points[:] = start
            box[:] = np.eye(3)
        writes = k

threads = [threading.Thread(target=mutate) for _ in range(2)]
for thread in threads:
    thread.start()
end = time.perf_counter() + 2.0
turn = 0
while time.perf_counter() < end:
    turn += 1
    try:
        with hs.settings(memory_limit=3e8):
            if turn % 3:
                hs.pairs(points, 0.02, box=box if turn % 2 else [1.0] * 3, quantities="ijdDS",
                         sort=turn % 5 == 0)
            else:
                hs.pairs(points, 0.02)
    except (ValueError, OverflowError, MemoryError):
        pass
stop = True
for thread in threads:
    thread.join()
expected = hs.count_pairs(start, 0.02)
assert expected == len(hs.pairs(start.copy(), 0.02)[0])
print(json.dumps([True, writes]))
"""
    )
    assert survived and changed > 1000


def test_points_that_are_freed_during_the_search_are_kept_alive():
    assert run(
        """
import gc, json, threading
import numpy as np
import pytest
import halfshell as hs

def work():
    for k in range(8):
        count = hs.count_pairs(np.random.default_rng(k).random((3000, 3)).astype(">f8")[::2], 0.1)
        assert count > 0
        gc.collect()

threads = [threading.Thread(target=work) for _ in range(4)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
print(json.dumps(True))
"""
    )


def changing(array, bad, call, seconds=0.1):
    """What `call` raises while another thread writes to the array, but what it may raise."""
    done, good, raised = threading.Event(), array.copy(), set()

    def write():
        while not done.is_set():
            array[...] = bad
            array[...] = good

    thread = threading.Thread(target=write)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    thread.start()
    try:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            try:
                call()
            except (ValueError, TypeError, OverflowError, KeyError):
                pass
            except IndexError as error:
                if "of a table of" not in str(error):
                    raised.add(str(error))
    finally:
        done.set()
        thread.join()
        sys.setswitchinterval(interval)
    return raised


_PLACES = np.random.default_rng(0).random((1500, 3)) * 8.0
_NUMBERS = np.arange(1500)
_RADII = np.full(1500, 0.3)
_TABLE = hs.neighbors(_PLACES, 0.8)
_FEW = hs.NodeList("a", _PLACES[:200], _RADII[:200] * 4)
_PAIRS = hs.Connectivity([_FEW]).pairs
_ROWS = np.array([tuple(pair) for pair in _PAIRS])
_NAMES = np.array(["H", "O", "C"])[_NUMBERS % 3]


class _Elements:
    """Points that know their elements."""

    def __init__(self, numbers):
        self.positions, self.numbers, self.cell, self.pbc = _PLACES, numbers, np.eye(3) * 8.0, True


CHANGING = {
    "touching": (_NUMBERS, 10**6, lambda x: hs.pairs(_PLACES, 0.5, indices=x)),
    "indices": (_NUMBERS, -7, lambda x: hs.neighbors(_PLACES, 0.5, indices=x)),
    "nodes": (_PLACES, np.nan, lambda x: hs.NodeList("a", x, _RADII)),
    "h": (_RADII, np.nan, lambda x: hs.NodeList("a", _PLACES, x)),
    "bricks": (_PLACES, np.inf, lambda x: hs.bricks(x, 0.5, 2)),
    "lists": (_NUMBERS, 10**6, lambda x: hs.measure(_PLACES, x, _NUMBERS)),
    "checked": (_NUMBERS, 10**6, lambda x: hs.verify(_PLACES, 0.1, x, _NUMBERS)),
    "rows": (_NUMBERS, 10**6, lambda x: _TABLE[x]),
    "mask of rows": (np.zeros(1500, bool), True, lambda x: _TABLE[x]),
    "mask of entries": (np.zeros(len(_TABLE.indices), bool), True, _TABLE.filter),
    "kept nodes": (np.ones(200, bool), False, lambda x: hs.Connectivity([_FEW]).patch([x])),
    "which pairs": (np.zeros(len(_PAIRS), bool), True, lambda x: hs.Connectivity([_FEW]).remove(x)),
    "pairs of nodes": (_ROWS, -1, _PAIRS.index),
    "excluded nodes": (_ROWS, 10**6, lambda x: hs.Connectivity([_FEW], exclude=x)),
    "types": (
        (_NUMBERS % 3).astype(np.int32), 50,
        lambda x: call(hs.rdf, _PLACES, 0.5, 9, box=[8.0] * 3, types=x),
    ),
    "types as they are": (
        _NUMBERS // 500, -1, lambda x: call(hs.pairs, _PLACES, [[0.3, 0.2, 0.1]] * 3, types=x),
    ),
    "systems": (
        (_NUMBERS // 500).astype(np.uint64), 2**63, lambda x: call(hs.pairs, _PLACES, 0.5, batch=x),
    ),
    "systems of a histogram": (
        _NUMBERS // 500, 10**4,
        lambda x: call(hs.rdf, _PLACES, 0.5, 9, box=np.tile(np.eye(3) * 8.0, (3, 1, 1)), batch=x),
    ),
    "names": (
        _NAMES,
        "Zz",
        lambda x: call(hs.rdf, _PLACES, 0.5, 9, box=[8.0] * 3, types=x)["H", "O"],
    ),
    "elements": (_NUMBERS % 90, 10**6, lambda x: hs.pairs(_Elements(x), {("H", "He"): 0.5})),
    "species": (_NAMES, "Zz", lambda x: call(hs.pairs, _PLACES, {("H", "O"): 0.5}, types=x)),
    "large integers": (
        np.full(1500, 2**53), 2**53 + 1, lambda x: hs.count_pairs(x[:, None], 0.5),
    ),
    "masked": (
        np.zeros(1500, bool),
        True,
        lambda x: hs.NodeList("a", _PLACES, np.ma.MaskedArray(_RADII, x, keep_mask=False)),
    ),
}


@pytest.mark.parametrize("name", CHANGING)
def test_arrays_that_change_meanwhile_give_clear_errors(name):
    """Never an IndexError of ours, nor a broken heap: what is checked is a copy."""
    array, bad, call = CHANGING[name]
    array = array.copy()
    assert not changing(array, bad, lambda: call(array))
