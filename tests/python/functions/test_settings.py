# SPDX-License-Identifier: BSD-3-Clause
"""`settings`: what they set, for whom, and how long."""

import asyncio

import numpy as np
import pytest

import halfshell as hs
from halfshell._settings import USUAL, current
from oracles import same_arrays

X = np.random.default_rng(3).random((3000, 3))
# A lattice of 0.1 and a cutoff on one of its shells: a comparison of doubles is wrong twice.
LATTICE = 0.1 * np.stack(np.meshgrid(*[np.arange(4.0)] * 2), -1).reshape(-1, 2)
SHELL, EXACT, DOUBLE = 0.1 * np.sqrt(8.0), 88, 90


def algorithm():
    """That which a search of this thread or task would be made by."""
    return hs.explain(X, 0.1).algorithm


# ---- what they set -------------------------------------------------------------------------


def test_each_one_reaches_the_searches():
    for name in ("all-pairs", "grid", "hash"):
        with hs.settings(algorithm=name):
            assert algorithm() == name
            assert hs.count_pairs(X, 0.05) == hs.count_pairs(hs.CellList(X, 0.05), 0.05)
    with hs.settings(memory_limit=1e4):
        for search in (hs.pairs, hs.neighbors, hs.clusters):
            with pytest.raises(MemoryError):
                search(X, 0.3)
        with pytest.raises(MemoryError):
            hs.nearest(X, 5)
    expected = hs.pairs(X, 0.1, quantities="ijd")
    for kernel in hs.kernels():
        for threads in (1, 2):
            with hs.settings(kernel=kernel, threads=threads):
                assert hs.explain(X, 0.1).kernel == kernel
                assert same_arrays(hs.pairs(X, 0.1, quantities="ijd"), expected)
    assert hs.count_pairs(LATTICE, SHELL) == EXACT
    with hs.settings(precision="double"):
        assert hs.count_pairs(LATTICE, SHELL) == DOUBLE
        assert hs.CellList(LATTICE, SHELL).count_pairs() == DOUBLE
        assert sum(len(i) for i, _ in hs.iter_pairs(LATTICE, SHELL)) == DOUBLE
        assert hs.pair_histogram(LATTICE, [0.0, SHELL]).tolist() == [EXACT]  # always exact


# ---- for whom ------------------------------------------------------------------------------


def test_tasks_keep_those_they_began_with():
    async def work(name, begun, go):
        before = algorithm()
        with hs.settings(algorithm=name):
            begun.set()
            await go.wait()
            return before, algorithm()

    async def main():
        go, found = asyncio.Event(), []
        with hs.settings(algorithm="all-pairs"):
            for name in ("grid", "hash"):
                begun = asyncio.Event()
                found.append(asyncio.create_task(work(name, begun, go)))
                await begun.wait()
                assert algorithm() == "all-pairs"
        assert current() is USUAL
        go.set()
        return [await task for task in found] + [await asyncio.to_thread(algorithm)]

    *tasks, last = asyncio.run(main())
    assert tasks == [("all-pairs", "grid"), ("all-pairs", "hash")]
    assert last not in ("all-pairs",)


def test_iterators_keep_those_of_their_call():
    large = [np.concatenate([LATTICE, 9.0 + np.arange(2000.0).reshape(-1, 2)])] * 3
    with hs.settings(precision="double"):
        blocks = hs.iter_pairs(LATTICE, SHELL, max_pairs=1)
        frames = hs.trajectory_pairs([LATTICE] * 3, SHELL, skin=None)
        ahead = hs.trajectory_pairs(large, SHELL, skin=None, threads=2)
    with hs.settings(precision="exact"):
        assert sum(len(i) for i, _ in blocks) == DOUBLE
        for found in (frames, ahead):
            for i, _ in found:
                assert len(i) == DOUBLE and current().precision == "exact"  # nothing leaks from it
    with hs.settings(memory_limit=1.0):
        assert len(list(hs.trajectory_pairs(iter([]), 0.2))) == 0


# ---- what is refused -----------------------------------------------------------------------


@pytest.mark.parametrize(("how", "error", "message"), [
    ({"kernel": "abacus"}, ValueError, "kernel must be"),
    ({"algorithm": "tree"}, ValueError, "one of auto all-pairs grid hash hierarchy"),
    ({"algorithm": "gird"}, ValueError, "did you mean 'grid'"),
    ({"precision": "half"}, ValueError, "precision must be one of exact double single"),
    ({"memory_limit": -1}, ValueError, "memory_limit must be a number of bytes, got -1"),
    ({"memory_limit": "1 GB"}, TypeError, "memory_limit must be a number of bytes"),
    ({"threads": 0}, ValueError, "threads must be a whole number from 1 to 1024 or None, got 0"),
    ({"cutoff": 1.0}, TypeError, "cutoff"),
])  # fmt: skip
def test_wrong_ones_are_refused_when_they_are_made(how, error, message):
    with pytest.raises(error, match=message):
        hs.settings(**how)
    assert current() is USUAL
    assert repr(hs.settings(kernel=None, threads=3)) == "settings(kernel=None, threads=3)"
