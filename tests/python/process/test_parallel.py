# SPDX-License-Identifier: BSD-3-Clause
"""Several threads give the arrays of one, leave nothing running, and survive fork and pools."""

import itertools
import os
import subprocess
import sys
import textwrap
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


KNOWN = hs.Points(CLOUD, box=TRICLINIC, types=np.arange(10500) % 3, weights=CLOUD[:, 0])
SOME = RNG.permutation(10500)[:2000]


def kept_for_some_steps():
    pair_list, found = hs.VerletList(1.5, 0.3, box=30.0), ()
    for step in range(3):
        pair_list.update((CLOUD + 0.02 * step * CLOUD[::-1] / 30.0) % 30.0)
        found += pair_list.pairs(quantities="ijdDSP")
    assert pair_list.n_builds == 1
    return found


FUNCTIONS = {
    "rows": lambda: tuple(hs.neighbors(KNOWN, 2.0, quantities="jdDS")._arrays),
    "open rows": lambda: tuple(hs.neighbors(CLOUD, 2.0, quantities="jdDS")._arrays),
    "coordination": lambda: hs.coordination(KNOWN, 2.0, by_type=True),
    "histogram": lambda: hs.pair_histogram(KNOWN, np.linspace(0.0, 2.0, 81), by_type=True),
    "open histogram": lambda: hs.pair_histogram(CLOUD, np.linspace(0.0, 2.0, 81)),
    "nearest": lambda: hs.nearest(np.round(CLOUD[:6000], 1), 12, box=TRICLINIC, quantities="jdDS"),
    "blocks": lambda: tuple(map(np.concatenate, zip(*hs.iter_pairs(
        KNOWN, 3.0, quantities="jSd", max_pairs=65_536)))),
    "clusters": lambda: hs.clusters(KNOWN, 1.0).labels,
    "list": kept_for_some_steps,
    "some points": lambda: hs.pairs(KNOWN, 2.0, quantities="ijdDSP", indices=SOME),
    "systems": lambda: hs.pairs([CLOUD[:4000], CLOUD[4000:]], 2.0, quantities="ijd"),
}  # fmt: skip


@pytest.mark.parametrize("name", FUNCTIONS)
def test_each_function_gives_the_same_bytes_by_any_kernel_and_number_of_threads(name):
    ways = itertools.product(hs.kernels(), (1, 2, 3), ("auto",))
    if name == "some points":
        ways = [*ways, *((None, 2, algorithm) for algorithm in ("grid", "hash", "all-pairs"))]
    first = None
    for kernel, threads, algorithm in ways:
        with hs.settings(kernel=kernel, threads=threads, algorithm=algorithm):
            found = FUNCTIONS[name]()
        first = found if first is None else first
        assert same_arrays(found, first), (kernel, threads, algorithm)


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
