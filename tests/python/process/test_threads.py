# SPDX-License-Identifier: BSD-3-Clause
"""Many Python threads at once; inputs that change during a search."""

import sys
import threading
import time

import numpy as np
import pytest

import halfshell as hs
from calls import call
from subprocesses import run


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
    "bricks": (_PLACES, np.inf, lambda x: hs.bricks(x, 0.5, 2)),
    "nodes": (_PLACES, np.nan, lambda x: hs.NodeList("a", x, _RADII)),
    "rows": (_NUMBERS, 10**6, lambda x: _TABLE[x]),
    "mask of entries": (np.zeros(len(_TABLE.indices), bool), True, _TABLE.filter),
    "which pairs": (np.zeros(len(_PAIRS), bool), True, lambda x: hs.Connectivity([_FEW]).remove(x)),
    "excluded nodes": (_ROWS, 10**6, lambda x: hs.Connectivity([_FEW], exclude=x)),
    "types": (
        (_NUMBERS % 3).astype(np.int32), 50,
        lambda x: call(hs.rdf, _PLACES, 0.5, 9, box=[8.0] * 3, types=x),
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
