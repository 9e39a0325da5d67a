# SPDX-License-Identifier: BSD-3-Clause
"""Every public function, called again and again while one allocation after the other is refused.

Usage: calls_without_memory.py SHARED_OBJECT|python SIZE NAME ... prints one line of JSON:
{name: [calls that failed, faults]}. `python`: CPython's own allocations are refused, by _testcapi;
else those of the whole process, by failing_malloc.c, which was preloaded. SIZE: scenes have so many
times 40 points. No NAME: all calls.
"""

import ctypes
import functools
import json
import os
import subprocess
import sys
import traceback
import types
from pathlib import Path

import numpy as np

import halfshell as hs
from calls import call
from halfshell import _core

SIZE = int(sys.argv[2])
N = 40 * SIZE

rng = np.random.default_rng(7)
BOX = (np.diag([4.0, 5.0, 6.0]) + np.tri(3, k=-1)) * SIZE ** (1 / 3)
POINTS = rng.uniform(0.0, 5.0 * SIZE ** (1 / 3), (N, 3))
OTHER = rng.uniform(0.0, 5.0 * SIZE ** (1 / 3), (12, 3))
CROWD = rng.uniform(0.0, 1.0, (300, 3))  # pairs of more than 256 kB, which are not copied
TYPES = np.arange(N) % 3
RADII = 0.9 * 4.0 ** -(np.arange(N) % 5)
CUTOFFS = {(0, 1): 1.5, (2, 2): 0.8}
WEIGHTS = rng.uniform(-1.0, 1.0, N)
EDGES = np.linspace(0.0, 2.0, 9)
BATCH = np.arange(N) // (N // 5)
FAR = np.concatenate([POINTS, POINTS + 1e9])  # only occupied cells are stored
PERIODIC = {"box": BOX, "periodic": True}
LETTERS = "ijdDSP"

CELLS = hs.CellList(POINTS, 1.5, box=BOX, periodic=True)
SPARSE = hs.CellList(FAR, 1.5)
LIST = call(hs.pairs, POINTS, 1.5, **PERIODIC)


def into(letters):
    """pairs into arrays of the caller."""
    found = call(hs.pairs, POINTS, 1.5, quantities=letters, sort=True, **PERIODIC)
    out = tuple(np.empty_like(array) for array in found)
    return call(hs.pairs, POINTS, 1.5, quantities=letters, sort=True, out=out, **PERIODIC)


def visited(**options):
    """Number and a sum of all pairs, which is the same in any order."""
    seen = [0]

    def add(i, j, S, D, d2):
        seen[0] ^= hash((i, j, S, D, d2))

    return call(hs.for_each_pair, POINTS, 1.5, add, **options), seen


def visited_balls(**options):
    """The same of balls, and their blocks."""
    seen = [0]

    def add(i, j, S, D, d2):
        seen[0] ^= hash((i, j, S, D, d2))

    n = call(hs.for_each_pair, POINTS, None, add, radii=RADII, **options)
    return n, seen, list(call(hs.iter_pairs, POINTS, None, radii=RADII, max_pairs=9, **options))


# Steps of a list. NumPy crashes where it adds so many numbers without memory.
MOVED = [POINTS + shift * (1.0 + 0.001 * TYPES[:, None]) for shift in (0.0, 0.01, BOX[1], 1.0)]


def verlet():
    """A list, built, kept, and built again where the box is another."""
    found = []
    steps = hs.VerletList(1.5, 0.3, **PERIODIC)
    for points in MOVED:
        found.append((steps.update(points), *steps.pairs(quantities="ijdDS", sort=True)))
    return found, steps.n_points, steps.cutoff


FEW = np.empty(3, np.int64)


def capacity_error():
    try:
        hs.pairs(POINTS, 1.5, quantities="i", out=FEW)
    except hs.CapacityError as error:
        return error.needed
    raise AssertionError("too little room is an error")


def message(function, *arguments, **options):
    """What a refused argument says."""
    try:
        function(*arguments, **options)
    except (ValueError, TypeError, OverflowError) as error:
        return type(error).__name__, str(error)
    raise AssertionError("an error was expected")


def fields(value, names):
    return [getattr(value, name) for name in names.split()]


def node_lists(first=0):
    """Two lists with ghosts, of which the first node is that one."""
    parts = np.array_split(np.arange(first, N), 2)
    return [
        hs.NodeList(name, POINTS[part], 0.4 + 0.3 * RADII[part], n_ghost=ghosts)
        for name, part, ghosts in zip("ab", parts, (0, 7), strict=True)
    ]


LISTS, FEWER = node_lists(), node_lists(5)
WITH_ALL = {"overlap": True, "intersection": True}


def links(connectivity):
    """All arrays of it."""
    names = ["offsets", "indices"]
    if connectivity._links.overlap is not None:
        names += ["overlap_offsets", "overlap_indices"]
        names += ["intersection_offsets", "intersection_indices"]
        if connectivity._links.rows.shifts is not None:
            names += ["overlap_shifts", "intersection_shifts"]
    columns = fields(connectivity.pairs, "i_node i_list j_node j_list")
    return fields(connectivity, " ".join(names)) + columns


def connected(change=None, **options):
    """A connectivity after a change: where this fails, nothing may have changed."""
    c = hs.Connectivity(LISTS, **options)
    before = links(c)
    if change is not None:
        try:
            change(c)
        except MemoryError:
            for one, other in zip(before, links(c), strict=True):
                assert np.array_equal(one, other)
            raise
    return links(c)


def culled():
    return [np.arange(one.n_nodes) % 5 != 1 for one in LISTS]


def turned():
    """New numbers in another order, ghosts last."""
    found = []
    for one, mask in zip(LISTS, culled(), strict=True):
        numbers = np.cumsum(mask) - 1
        m = one.n_nodes - one.n_ghost
        numbers[:m] = mask[:m].sum() - 1 - numbers[:m]
        found.append(numbers)
    return found


BAD = POINTS.copy()
BAD[3, 1] = np.nan
FLAT_BOX = np.ones((3, 3))

CALLS = {
    "pairs": lambda: hs.pairs(POINTS, 1.5, sort=True),
    "pairs, all quantities": lambda: call(hs.pairs,
        POINTS, 1.5, quantities=LETTERS, sort=True, **PERIODIC),
    "pairs, large": lambda: hs.pairs(CROWD, 2.0, quantities=LETTERS),
    "pairs, shells": lambda: call(hs.pairs,
        POINTS, [0.5, 1.0, 1.5], quantities=LETTERS + "k", sort=True, **PERIODIC),
    "pairs, touching": lambda: call(hs.pairs,
        POINTS, 1.5, quantities=LETTERS, indices=[3, 0], sort=True, **PERIODIC),
    "pairs, lists": lambda: hs.pairs(POINTS.tolist(), 1, sort=True, box=BOX.tolist(),
                                     periodic=[1, 0, 1]),
    "pairs, far": lambda: hs.pairs(FAR, 1.5, quantities="dDS", sort=True),
    "pairs, double": lambda: call(hs.pairs, POINTS, 1.5, precision="double", sort=True, **PERIODIC),
    "pairs into": lambda: into("ijdDS"),
    "capacity": capacity_error,
    "pairs, batch": lambda: call(hs.pairs, POINTS, 1.5, batch=BATCH, sort=True, **PERIODIC),
    "pairs, batch of boxes": lambda: call(hs.pairs,
        POINTS, np.full(5, 1.5), batch=BATCH, sort=True, box=np.stack([BOX] * 5), periodic=True),
    "count_pairs, batch": lambda: call(hs.count_pairs, POINTS, 1.5, batch=BATCH),
    "count_pairs": lambda: call(hs.count_pairs, POINTS, 1.5, **PERIODIC),
    "count_pairs, queries": lambda: hs.count_pairs(POINTS, 1.5, queries=OTHER),
    "pairs_between": lambda: call(
        hs.pairs_between, OTHER, POINTS, 1.5, quantities="ijdDS", **PERIODIC
    ),
    "neighbors": lambda: list(call(hs.neighbors, POINTS, 1.5, **PERIODIC)),
    "neighbors, queries": lambda: call(hs.neighbors,
        POINTS, 1.5, queries=OTHER, quantities="jdDS", **PERIODIC)._arrays,
    "neighbors, indices": lambda: call(hs.neighbors,
        POINTS, 1.5, indices=[3, 0, 3], quantities="jdS", **PERIODIC
    )._arrays,
    "neighbors, large": lambda: hs.neighbors(CROWD, 2.0, quantities="jdD")._arrays,
    "coordination": lambda: call(hs.coordination, POINTS, 1.5, **PERIODIC),
    "pairs of balls": lambda: call(hs.pairs,
        POINTS, None, radii=RADII, quantities=LETTERS, sort=True, **PERIODIC),
    "pairs by type": lambda: call(hs.pairs, POINTS, CUTOFFS, types=TYPES, sort=True, **PERIODIC),
    "pairs_between, balls": lambda: call(hs.pairs_between,
        OTHER, POINTS, None, query_radii=RADII[:12], radii=RADII, quantities="ijdDS", **PERIODIC),
    "neighbors, gather": lambda: call(hs.neighbors,
        POINTS, None, radii=RADII, rule="gather", quantities="jdS", **PERIODIC)._arrays,
    "coordination, types": lambda: call(hs.coordination, POINTS, np.ones((3, 3)), types=TYPES),
    "visited and blocks, balls": lambda: visited_balls(**PERIODIC),
    "bad radii": lambda: message(hs.Points, POINTS, radii=-RADII),
    "histogram": lambda: call(hs.pair_histogram, POINTS, EDGES, **PERIODIC),
    "histogram, types": lambda: call(hs.pair_histogram, POINTS, EDGES, types=TYPES, threads=2),
    "histogram, weights": lambda: call(hs.pair_histogram,
        POINTS, EDGES, weights=WEIGHTS, queries=OTHER, query_weights=WEIGHTS[:12]),
    "rdf": lambda: fields(call(hs.rdf, POINTS, 1.5, 10, **PERIODIC), "r g counts edges"),
    "measure": lambda: call(hs.measure, POINTS, [0, 1], [2, 3], **PERIODIC),
    "nearest": lambda: call(hs.nearest, POINTS, 4, **PERIODIC),
    "nearest, queries": lambda: hs.nearest(
        POINTS, 50, queries=OTHER, quantities="jdDS", max_distance=2.0),
    "iter_pairs": lambda: list(call(hs.iter_pairs, POINTS, 1.5, max_pairs=50, **PERIODIC)),
    "iter_pairs, progress": lambda: len(list(hs.iter_pairs(
        POINTS, 1.5, max_pairs=5, progress=lambda done: None))),
    "for_each_pair": lambda: visited(**PERIODIC),
    "clusters": lambda: call(hs.clusters, POINTS, 0.8, **PERIODIC).spans,
    "clusters, core": lambda: fields(
        hs.clusters(POINTS, 1.0, min_points=3), "labels sizes core"),
    "CellList": lambda: hs.CellList(POINTS, 1.5, **PERIODIC).pairs(sort=True),
    "CellList, layout": lambda: fields(
        hs.CellList(POINTS, 1.5), "shape cell_sizes cell_start order cell_ids cutoff"),
    "CellList, few cells": lambda: fields(
        hs.CellList(FAR, 1.5), "shape cell_sizes cell_start order cell_ids cutoff"),
    "cells.pairs": lambda: CELLS.pairs(1.0, quantities="ijdDS", sort=True),
    "cells.query": lambda: CELLS.query(OTHER, quantities="jd")._arrays,
    "cells.neighbors": lambda: CELLS.neighbors(1.2)._arrays,
    "cells.count_pairs": lambda: CELLS.count_pairs(queries=OTHER),
    "cells.pair_histogram": lambda: CELLS.pair_histogram(EDGES[:5]),
    "cells.iter_pairs": lambda: list(CELLS.iter_pairs(max_pairs=64)),
    "cells.candidates": lambda: fields(CELLS.candidates(OTHER), "offsets start stop"),
    "cells.cell_of": lambda: SPARSE.cell_of(FAR[:9]),
    "VerletList": verlet,
    "Connectivity": lambda: connected(),
    "Connectivity, all": lambda: connected(**WITH_ALL),
    "Connectivity, box": lambda: connected(box=BOX, **WITH_ALL),
    "Connectivity, extents": lambda: connected(extent=[1.0, 1.5], rule="scatter", box=BOX),
    "Connectivity, Z curve": lambda: connected(order="morton", exclude=[(0, 0, 1, 0)]),
    "rebuild": lambda: connected(lambda c: c.rebuild(FEWER), **WITH_ALL),
    "patch": lambda: connected(lambda c: c.patch(culled())),
    "patch, all": lambda: connected(lambda c: c.patch(c.used()), **WITH_ALL),
    "patch, turned": lambda: connected(lambda c: c.patch(culled(), turned()), ghosts=True),
    "remove": lambda: connected(lambda c: c.remove(np.arange(len(c.pairs)) % 3 == 0), **WITH_ALL),
    "remove, function": lambda: connected(lambda c: c.remove(lambda i, a, j, b: i == 3)),
    "between_planes": lambda: LISTS[0].between_planes(
        ([0.0] * 3, [1.0, 0.0, 0.0]), ([5.0, 0.0, 0.0], [1.0, 0.0, 0.0])),
    "Box": lambda: fields(hs.Box(BOX), "perpendicular_heights volume vectors"),
    "Box.wrap": lambda: hs.Box(BOX).wrap(POINTS),
    "explain": lambda: fields(call(hs.explain, POINTS, 1.5, **PERIODIC, measure=True),
                              "algorithm reason shape images expected_pairs kernel"),
    "verify": lambda: fields(call(hs.verify, POINTS, 1.5, *LIST, **PERIODIC),
                             "n_expected n_given missed spurious duplicate"),
    "set_cache_limit": lambda: hs.set_cache_limit(hs.set_cache_limit(1 << 20)),
    "not finite": lambda: message(hs.pairs, BAD, 1.5),
    "not independent": lambda: message(hs.pairs, POINTS, 1.5, box=FLAT_BOX, periodic=True),
    "no kernel": lambda: message(hs.settings, kernel="abacus"),
    "no cutoff": lambda: message(hs.pairs, POINTS, -1.0),
    "no number": lambda: message(hs.pairs, POINTS, "far"),
    "no quantity": lambda: message(hs.pairs, POINTS, 1.5, quantities="xyz"),
    "no array to write to": lambda: message(hs.pairs, POINTS, 1.5, out=(LIST[0], LIST[1][:, None])),
    "no batch": lambda: message(hs.Points, POINTS, batch=BATCH[::-1]),
}  # fmt: skip


# With these, CPython or NumPy crash or say that arguments are wrong, where CPython has no memory:
# NumPy's errstate, np.unique, arrays that are indexed by arrays, and variables of contexts. Our own
# functions are refused memory all the same.
NOT_NUMPY = {
    "rdf", "verify", "Connectivity", "rebuild", "neighbors, indices",
    "Connectivity, all", "Connectivity, box", "Connectivity, extents",
    "Connectivity, Z curve", "patch", "patch, all", "patch, turned", "remove", "remove, function",
    "between_planes", "pairs, double", "pairs, touching", "no kernel",
}  # fmt: skip


def plain(value):
    """Something that == compares, bit by bit."""
    if isinstance(value, np.ndarray):
        return value.shape, value.dtype.char, value.tobytes()
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


class Python:
    """Refuses the nth of CPython's own allocations."""

    def __init__(self):
        import _testcapi

        self.set, self.end = _testcapi.set_nomemory, _testcapi.remove_mem_hooks

    def begin(self, nth, last):
        self.set(nth - 1, last)

    def n_blocks(self):
        return sys.getallocatedblocks()


class Process:
    """Refuses the nth allocation of the process."""

    def __init__(self, path):
        self.library = ctypes.CDLL(path)
        self.begin = self.library.refuse_from
        self.begin.argtypes = [ctypes.c_long, ctypes.c_long]
        self.n_blocks = self.library.live_blocks
        self.n_blocks.restype = ctypes.c_long

    def end(self):
        """This takes some memory itself: after one refusal there is."""
        try:
            self.begin(0, 0)
        except (MemoryError, ctypes.ArgumentError):
            self.begin(0, 0)


def fault_of(error):
    """What is wrong with an exception, and where; None where it is right, or not ours:
    threading has an error of its own, and functions of NumPy may fail without one."""
    frames = traceback.extract_tb(error.__traceback__)[1:]
    if isinstance(error, MemoryError) or str(error) == "can't allocate lock":
        return None
    if isinstance(error, SystemError) and "_core." not in frames[-1].line:
        return None
    places = ", ".join(f"{Path(frame.filename).name}:{frame.lineno}" for frame in frames)
    return f"{error!r} at {places}"


class Inside:
    """Refuses memory to each function of _core while it runs, and not to what calls it."""

    def __init__(self, allocator):
        self.allocator = allocator
        self.functions = {
            name: value
            for name, value in vars(_core).items()
            if isinstance(value, types.BuiltinFunctionType)
        }
        self.own = {}  # by what stands in their place
        self.leaks = None  # found so far; None: not looked for

    def begin(self, nth, last):
        self.own = {}
        for name, function in self.functions.items():
            refused = self.refused(function, nth, last)
            self.own[refused] = function
            setattr(_core, name, refused)

    def end(self):
        vars(_core).update(self.functions)

    def refused(self, function, nth, last):
        def called(*arguments):
            # `plain` takes a function of _core: that itself, for memory is refused already.
            given = [
                self.own.get(argument, argument) if callable(argument) else argument
                for argument in arguments
            ]
            try:
                self.allocator.begin(nth, last)
                return function(*given)
            finally:
                self.allocator.end()

        def watched(*arguments):
            again = functools.partial(called, *arguments)
            if all(leaks(self.allocator, again, n) for n in (4, 40, 400)):
                self.leaks.append(f"blocks remain: {function.__name__}, allocation {nth}")
            return called(*arguments)

        return called if self.leaks is None else watched


def leaks(allocator, call, n):
    """Whether a call that fails leaves a block behind, each of n times."""
    before = allocator.n_blocks()
    for _ in range(n):
        try:
            call()
            return False
        except MemoryError:
            pass
        except Exception:
            return False
    return allocator.n_blocks() - before >= n


# Further refusals behind the first: more than a call asks for until it ends. CPython 3.11 may go on
# asking until the refusals are used up, where it unwinds to a handler. None where the interpreter's
# objects are from malloc as well, for then it has no memory to end them.
FROM_MALLOC = os.environ.get("PYTHONMALLOC") == "malloc"
REFUSALS = (0,) if FROM_MALLOC else (0, 10**4)
MOST = 100_000  # allocations that a call may have
SUCCESSES = 12  # in a row, of calls that may do without some memory: the last allocation is behind


def refuse_each(allocator, call, more):
    """Calls while allocation 1, 2, 3 ... is refused, and `more` behind it. Returns how many calls
    failed, and what was wrong."""
    expected, faults, nth, failed, successes = plain(call()), [], 1, 0, 0
    while successes < SUCCESSES and nth < MOST:
        result = error = None
        try:
            allocator.begin(nth, nth + more)
            result = call()
        except BaseException as caught:
            error = caught
        finally:
            allocator.end()
        if error is None:
            successes += 1
            if plain(result) != expected:
                faults.append(f"allocation {nth}: another answer")
        else:
            failed, successes = failed + 1, 0
            if fault_of(error):
                faults.append(f"allocation {nth}: {fault_of(error)}")
        del result, error
        nth += 1
    if successes < SUCCESSES:
        faults.append(f"allocation {nth}: still another one to refuse")
    if plain(call()) != expected:
        faults.append("another answer afterwards")
    return failed, faults


def find_leaks(inside, call):
    inside.leaks = []
    refuse_each(inside, call, 0)
    found, inside.leaks = inside.leaks, None
    return found


def interpreter_crashes():
    """Whether this Python does not live through what closure_without_memory.py does to it."""
    script = Path(__file__).with_name("closure_without_memory.py")
    environment = {name: os.environ[name] for name in os.environ if name != "LD_PRELOAD"}
    done = subprocess.run([sys.executable, script], capture_output=True, env=environment)
    return done.returncode < 0


def main(path, *names):
    allocator = Python() if path == "python" else Process(path)
    inside, results = Inside(allocator), {}
    places = [inside, allocator]
    if (path == "python" or FROM_MALLOC) and interpreter_crashes():
        places.remove(allocator)
    for _ in range(3000):  # CPython 3.11 keeps 2000 tuples of 20, as histogram takes, and uses none
        (lambda *arguments: None)(*range(20))
    sys.unraisablehook = lambda what: None  # what destructors could not say
    for name in names or CALLS:
        failed, faults = 0, []
        for where in places:
            for more in REFUSALS:
                if where is inside or name not in NOT_NUMPY:
                    n, found = refuse_each(where, CALLS[name], more)
                    failed, faults = failed + n, faults + found
        results[name] = failed, faults + find_leaks(inside, CALLS[name])
        print(name, *results[name], file=sys.stderr, flush=True)
    print(json.dumps(results))


if __name__ == "__main__":
    main(sys.argv[1], *sys.argv[3:])
