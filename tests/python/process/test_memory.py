# SPDX-License-Identifier: BSD-3-Clause
"""Memory does not grow over thousands of calls, failing ones included, and stays modest."""

import os
import sys

import pytest

from subprocesses import RESIDENT, run

pytestmark = pytest.mark.slow

CALLS = {
    "pairs": 'hs.pairs(points, 0.3, box=box, quantities="ijdDSP")',
    "sorted pairs": 'hs.pairs(points, 0.3, box=box, quantities="PS", sort=True)',
    "float32 pairs": "hs.pairs(single, 0.3, box=box)",
    "converted input": "hs.pairs(listed, 0.3, box=[1, 1, 1])",
    "count": "hs.count_pairs(points, [0.1, 0.2], box=box)",
    "nan": "fails(lambda: hs.pairs(broken, 0.3, box=box))",
    "bad cutoff": "fails(lambda: hs.pairs(points, -1.0, box=box))",
    "bad shape": "fails(lambda: hs.pairs(points[0], 0.3))",
    "memory limit": "fails(lambda: little(1, hs.pairs, points, 0.9, box=box))",
    "shift overflow": 'fails(lambda: hs.pairs(far, 0.3, box=box, quantities="S"))',
    "blocks": 'list(hs.iter_pairs(points, 0.3, box=box, quantities="ijdDS", max_pairs=7))',
    "abandoned blocks": "next(hs.iter_pairs(points, 0.3, box=box, max_pairs=7))",
    "visits": "hs.for_each_pair(points, 0.2, lambda *pair: None, box=box)",
    "failing visits": "fails(lambda: hs.for_each_pair(points, 0.3, lambda: None, box=box))",
    "clusters": "hs.clusters(points, 0.2, box=box, min_points=2)",
    "box": "hs.Box.from_matrix(box).wrap(points)",
    "verify": "hs.verify(points, 0.1, *hs.pairs(points, 0.1))",
    "explain": "str(hs.explain(points, 0.3, box=box))",
}


@pytest.fixture(scope="module")
def growth():
    """Bytes by which the process grew in 10^4 calls of each sort, after a warm-up.

    The calls are made in three rounds and the smallest growth counts: a leak shows in each
    round, an arena that the allocator takes now and then does not.
    """
    calls = "\n".join(f"    {name!r}: lambda: {call}," for name, call in CALLS.items())
    return run(
        RESIDENT
        + f"""
import gc, json
import numpy as np
import halfshell as hs

rng = np.random.default_rng(1)
points = rng.random((40, 3))
single = points.astype(np.float32)
listed = points.tolist()
broken = points.copy()
broken[30, 1] = np.nan
far = points + np.array([1e10, 0, 0]) * (np.arange(40) % 2)[:, None]
box = np.eye(3)

def little(limit, search, *arguments, **options):
    with hs.settings(memory_limit=limit):
        search(*arguments, **options)

def fails(call):
    try:
        call()
    except (ValueError, TypeError, MemoryError, OverflowError):
        return
    raise AssertionError("accepted")

calls = {{
{calls}
}}
grown = {{}}
for name, call in calls.items():
    for _ in range(400):
        call()
    rounds = []
    for _ in range(3):
        gc.collect()
        before = resident()
        for _ in range(3200):
            call()
        gc.collect()
        rounds.append(resident() - before)
    grown[name] = min(rounds)
print(json.dumps(grown))
"""
    )


@pytest.mark.parametrize("name", CALLS)
def test_memory_does_not_grow(growth, name):
    # A leak of only 32 bytes per call would show as 100 kB.
    assert growth[name] < 100_000


# Calls under a limit of the address space, as `ulimit -v` sets it: room(bytes, call) gives the call
# so many bytes more than the process has. Lattice points have a third of the pairs that their
# density lets expect, so that most of what is reserved is not needed.
LIMITED = """
import json, resource
import numpy as np
import halfshell as hs

def mapped():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[0]) * resource.getpagesize()

def room(bytes, call):
    hs.clear_cache()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (mapped() + bytes, hard))
    try:
        return call()
    except MemoryError:
        return None
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))

MB = 1 << 20
axis = np.arange(90.0)
lattice = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
uniform = np.random.default_rng(1).random((50_000, 3))
"""

limited_address_space = pytest.mark.skipif(
    sys.platform != "linux" or "LD_PRELOAD" in os.environ,
    reason="needs Linux, and no sanitizer, which maps terabytes",
)


@limited_address_space
@pytest.mark.parametrize("threads", [1, 3])
def test_a_large_result_fits_a_limited_address_space(threads):
    same, size = run(
        LIMITED
        + f"""
expected = hs.pairs(uniform, 0.12)
found = room(600 * MB, lambda: hs.pairs(uniform, 0.12, threads={threads}))
same = all(np.array_equal(a, b) for a, b in zip(expected, found))
print(json.dumps([same, sum(a.nbytes for a in found)]))
"""
    )
    assert same
    assert size > 100_000_000


@limited_address_space
@pytest.mark.parametrize("threads", [1, 3])
def test_too_little_address_space_is_a_memory_error(threads):
    # From next to nothing to nearly enough: an answer or MemoryError, and no harm done.
    outcomes = run(
        LIMITED
        + f"""
outcomes = []
for quantities, most in (("ij", 60), ("ijdDS", 150)):
    search = lambda: hs.pairs(lattice, 1.41, quantities=quantities, threads={threads})
    expected = search()
    for megabytes in (0, 1, 3, 8, 15, 20, 25, *range(30, most, 4)):
        found = room(megabytes * MB, search)
        same = found and all(np.array_equal(a, b) for a, b in zip(expected, found))
        outcomes.append(None if found is None else bool(same))
        del found
    found = search()
    outcomes.append(all(np.array_equal(a, b) for a, b in zip(expected, found)))
print(json.dumps(outcomes))
"""
    )
    assert outcomes.count(None) >= 20
    assert False not in outcomes
    assert outcomes[-1] is True
