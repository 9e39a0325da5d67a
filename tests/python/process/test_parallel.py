# SPDX-License-Identifier: BSD-3-Clause
"""Several threads give the arrays of one, leave nothing running, and survive fork and pools."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from functools import partial

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import same_arrays
from refused_calls import check_refusals

RNG = np.random.RandomState(7)
CLOUD = RNG.rand(10500, 3) * 30.0
CLUSTERS = np.concatenate([RNG.normal(0.0, 0.1, (600, 3)), RNG.normal(9.0, 2.0, (9900, 3))])
TRICLINIC = np.array([[30.0, 0.0, 0.0], [10.0, 27.0, 0.0], [-6.0, 5.0, 28.0]])
#: As much work as more than one thread is taken for.
SCENES = {
    "open": (CLOUD, 2.0, None),
    "periodic": (CLOUD, 2.0, np.array([30.0, 30.0, 30.0])),
    "triclinic": (CLOUD * 3.0, 2.0, TRICLINIC),
    "images": (CLOUD[:320], 12.0, np.array([8.0, 9.0, 10.0])),
    "clusters": (CLUSTERS, 0.3, None),
    "plane": (CLOUD[:, :2], 0.8, np.array([30.0, 30.0])),
    "one spot": (np.zeros((700, 3)), 1.0, None),
    "nobody": (np.zeros((0, 3)), 1.0, None),
}


def run(code):
    subprocess.run([sys.executable, "-c", textwrap.dedent(code)], check=True, timeout=120)


@pytest.mark.parametrize("name", SCENES)
def test_arrays_do_not_depend_on_the_number_of_threads(name):
    """Each kernel and scene with some of the quantities, each kernel with all of them."""
    points, cutoff, box = SCENES[name]
    assert hs.explain(points, cutoff, box=box, threads=2).threads == 1 + (name != "nobody")
    ways = [(quantities, sort) for quantities in ("ij", "ijdDS", "P") for sort in (False, True)]
    for number, kernel in enumerate(hs.kernels()):
        for quantities, sort in ways[(number + list(SCENES).index(name)) % 3 :: 3]:
            options = {"box": box, "quantities": quantities, "sort": sort, "kernel": kernel}
            alone = call(hs.pairs, points, cutoff, threads=1, **options)
            for threads in (2, 3, 8):
                together = call(hs.pairs, points, cutoff, threads=threads, **options)
                assert same_arrays(together, alone), (kernel, quantities, sort, threads)
            n = len(alone[0] if len(quantities) > 1 else alone)
            assert call(hs.count_pairs, points, cutoff, box=box, kernel=kernel, threads=4) == n


@pytest.mark.parametrize("threads", [2, 5])
def test_the_callers_arrays_are_filled_in_the_same_order(threads):
    alone = hs.pairs(CLOUD, 2.0, threads=1)
    n = len(alone[0])
    out = np.full(n + 5, -7), np.full(n + 5, -7)
    filled = hs.pairs(CLOUD, 2.0, threads=threads, out=out)
    for a, b, whole in zip(alone, filled, out, strict=True):
        assert np.array_equal(a, b)
        assert b.base is whole
        assert (whole[n:] == -7).all()
    with pytest.raises(hs.CapacityError) as caught:
        hs.pairs(CLOUD, 2.0, threads=threads, out=(out[0][: n - 1], out[1]))
    assert caught.value.needed == n
    assert (out[0][n:] == -7).all()


def test_small_scenes_use_one_thread_and_large_ones_what_is_allowed(monkeypatch):
    assert hs.explain(CLOUD[:3000], 2.0).threads == 1
    assert hs.explain(CLOUD[:3000], 2.0, threads=3).threads == 1
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    large = RNG.rand(30000, 3) * 40.0
    assert hs.explain(large, 1.0).threads == 3
    assert hs.explain(large, 1.0, threads=1).threads == 1
    assert hs.explain(large[:12000], 1.0, threads=2).threads == 2
    monkeypatch.setenv("OMP_NUM_THREADS", "nonsense")
    assert hs.explain(large, 1.0).threads >= 1


def test_bad_numbers_of_threads():
    cases = [(0, ValueError), (-1, ValueError), (10**9, ValueError), (1.5, TypeError),
             ("2", TypeError), (True, TypeError)]  # fmt: skip
    check_refusals([
        (partial(hs.pairs, CLOUD, 1.0, threads=n), kind, "threads must be a whole number")
        for n, kind in cases
    ])  # fmt: skip


@pytest.mark.skipif(not os.path.exists("/proc/self/task"), reason="needs /proc")
def test_no_thread_is_left_running():
    before = len(os.listdir("/proc/self/task"))
    for _ in range(20):
        hs.pairs(CLOUD, 2.0, threads=4)
    assert len(os.listdir("/proc/self/task")) == before


def test_from_several_python_threads_at_once():
    expected = hs.pairs(CLOUD, 2.0, threads=1)
    wrong = []

    def search():
        for _ in range(10):
            found = hs.pairs(CLOUD, 2.0, threads=2)
            wrong.extend(
                1 for a, b in zip(expected, found, strict=True) if not np.array_equal(a, b)
            )

    workers = [threading.Thread(target=search) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert not wrong


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_after_fork_and_in_process_pools():
    run(
        """
        import multiprocessing, os
        import numpy as np, halfshell as hs
        points = np.random.RandomState(0).rand(30000, 3) * 30.0
        expected = hs.count_pairs(points, 1.0, threads=2)
        keep = hs.pairs(points, 1.5, threads=2)
        del keep
        child = os.fork()
        if child == 0:
            i, j = hs.pairs(points, 1.0, threads=2)
            os._exit(0 if len(i) == expected else 1)
        assert os.waitpid(child, 0)[1] == 0
        for method in ("fork", "spawn"):
            with multiprocessing.get_context(method).Pool(2) as pool:
                counts = pool.starmap(hs.count_pairs, [(points, 1.0)] * 4)
            assert counts == [expected] * 4
        """
    )


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs POSIX timers")
@pytest.mark.parametrize("threads", [1, 4])
def test_interrupting_stops_all_threads_soon(threads):
    points = RNG.rand(250000, 3)
    started = []

    def stop(*_):
        started.append(time.perf_counter())
        raise KeyboardInterrupt

    old = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with pytest.raises(KeyboardInterrupt):
            hs.count_pairs(points, 0.9, threads=threads)
        assert time.perf_counter() - started[0] < 5.0  # 0.2 s on a quiet machine
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, old)


def test_failures_in_threads_are_the_same_as_alone():
    far = CLOUD.copy()
    far[2000] = 1e300
    box = np.array([20.0, 20.0, 20.0])
    for threads in (1, 3):
        with pytest.raises(OverflowError, match=r"points\[2000\]"):
            hs.pairs(far, 2.0, box=box, quantities="S", threads=threads)
        with pytest.raises(MemoryError):
            call(hs.pairs, RNG.rand(20000, 3), 0.9, threads=threads, memory_limit=3e7)


def test_long_rows_are_walked_once():
    # Stepping to the start of each range from the start of the row took seconds.
    points = np.random.RandomState(0).rand(300_000, 1) * 3e5
    started = time.perf_counter()
    n = hs.count_pairs(points, 1.0, threads=1)
    assert n == len(hs.pairs(points, 1.0, threads=2)[0])
    assert time.perf_counter() - started < 10.0
