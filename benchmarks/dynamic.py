# SPDX-License-Identifier: BSD-3-Clause
"""Time hard-disk trial moves from Python: `halfshell.DynamicCellList` and what else there is.

    python benchmarks/dynamic.py [--points N ...] [--seconds S]

Hard disks of diameter 1 at density 0.8 in a periodic square, equilibrated from a lattice, largest
move 0.1 along an axis. A trial is one `any_within`, and one `move` if that is accepted. All take
the same trials, one after another for some time each, and must accept the same ones. One thread and
its CPU time, the least of five runs. Beside them: a dict of lists of cells in plain Python, `rtree`
(boxes with ghosts across the faces, filtered by distance; if it is installed), and SciPy's cKDTree,
which is built again after each accepted move.
"""

from __future__ import annotations

import argparse
import itertools
import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import halfshell as hs
from measure.machine import pin_to_cores, usable_cores

__all__ = ["main"]

_DENSITY = 0.8
_MOVE = 0.1
_RUNS = 5
_BLOCK = 64  # trials between two looks at the clock; the loop around them is timed too

Trial = Callable[[int, float, float], bool]


def _ours(x: Any, length: float, storage: str) -> tuple[Trial, Any]:
    cells = hs.DynamicCellList(2, 1.0, box=[length] * 2, inclusive=False, storage=storage)
    cells.insert_many(np.arange(len(x)), x)

    def trial(key: int, a: float, b: float) -> bool:
        position = (a, b)
        if cells.any_within(position, 1.0, key):
            return False
        cells.move(key, position)
        return True

    return trial, cells


def _dict_of_lists(x: Any, length: float) -> tuple[Trial, Any]:
    side = int(length)
    width = length / side
    cells: dict[tuple[int, int], list[tuple[int, float, float]]] = {}
    where: dict[int, tuple[tuple[int, int], tuple[int, float, float]]] = {}

    def put(key: int, a: float, b: float) -> None:
        a, b = a % length, b % length
        cell = (int(a / width) % side, int(b / width) % side)
        where[key] = cell, (key, a, b)
        cells.setdefault(cell, []).append((key, a, b))

    def trial(key: int, a: float, b: float) -> bool:
        column, row = int(a % length / width), int(b % length / width)
        for i, j in itertools.product((0, -1, 1), repeat=2):
            for other, p, q in cells.get(((column + i) % side, (row + j) % side), ()):
                if other != key:
                    dx, dy = abs(p - a) % length, abs(q - b) % length
                    dx, dy = min(dx, length - dx), min(dy, length - dy)
                    if dx * dx + dy * dy < 1.0:
                        return False
        cell, entry = where[key]
        cells[cell].remove(entry)
        put(key, a, b)
        return True

    for key, (a, b) in enumerate(x.tolist()):
        put(key, a, b)
    return trial, None


def _kd_tree(x: Any, length: float) -> tuple[Trial, Any]:
    points = x % length
    tree = [cKDTree(points, boxsize=length)]

    def trial(key: int, a: float, b: float) -> bool:
        position = (a % length, b % length)
        if set(tree[0].query_ball_point(position, np.nextafter(1.0, 0.0))) - {key}:
            return False
        points[key] = position
        tree[0] = cKDTree(points, boxsize=length)
        return True

    return trial, None


def _r_tree(x: Any, length: float) -> tuple[Trial, Any]:
    from rtree.index import Index

    points = (x % length).tolist()
    tree = Index()
    shifts = [(i * length, j * length) for i in (-1, 0, 1) for j in (-1, 0, 1)]

    def images(a: float, b: float) -> list[tuple[float, float]]:
        moved = [(a + p, b + q) for p, q in shifts]
        return [(p, q) for p, q in moved if -1.0 <= p <= length + 1 and -1.0 <= q <= length + 1]

    def trial(key: int, a: float, b: float) -> bool:
        a, b = a % length, b % length
        for item in tree.intersection((a - 1.0, b - 1.0, a + 1.0, b + 1.0), objects=True):
            p, q = item.bounds[0], item.bounds[2]
            if item.id != key and (p - a) ** 2 + (q - b) ** 2 < 1.0:
                return False
        for p, q in images(*points[key]):
            tree.delete(key, (p, q, p, q))
        points[key] = [a, b]
        for p, q in images(a, b):
            tree.insert(key, (p, q, p, q))
        return True

    for key, (a, b) in enumerate(points):
        for p, q in images(a, b):
            tree.insert(key, (p, q, p, q))
    return trial, None


def _contestants() -> dict[str, Callable[[Any, float], tuple[Trial, Any]]]:
    found: dict[str, Callable[[Any, float], tuple[Trial, Any]]] = {
        f"halfshell {storage}": lambda x, length, storage=storage: _ours(x, length, storage)
        for storage in ("dense", "hash", "all-pairs")
    }
    found["dict of lists"] = _dict_of_lists
    try:
        import rtree  # noqa: F401
    except ImportError:
        pass
    else:
        found["rtree"] = _r_tree
    found["cKDTree rebuilt"] = _kd_tree
    return found


def _equilibrated(n: int, rng: np.random.Generator) -> tuple[Any, float]:
    """Positions after some sweeps."""
    length = math.sqrt(n / _DENSITY)
    side = math.isqrt(n - 1) + 1
    x = np.array([(i % side + 0.5, i // side + 0.5) for i in range(n)]) * (length / side)
    trial, _ = _ours(x, length, "dense")
    for _ in range(10 * n):
        key = int(rng.integers(n))
        moved = x[key] + rng.uniform(-_MOVE, _MOVE, 2)
        if trial(key, *moved.tolist()):
            x[key] = moved
    return x, length


def _rate(make: Any, x: Any, length: float, seconds: float) -> tuple[float, list[bool]]:
    """Trials a second of CPU time, and which were accepted."""
    trial, _ = make(x, length)
    rng = np.random.default_rng(7)
    now, spent, accepted = x.tolist(), 0.0, []
    while spent < seconds:
        keys = rng.integers(len(x), size=_BLOCK).tolist()
        moves = rng.uniform(-_MOVE, _MOVE, (_BLOCK, 2)).tolist()
        begun = time.thread_time()
        for key, (dx, dy) in zip(keys, moves):
            a, b = now[key]
            done = trial(key, a + dx, b + dy)
            accepted.append(done)
            if done:
                now[key] = [a + dx, b + dy]
        spent += time.thread_time() - begun
    return len(accepted) / spent, accepted


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line for each contestant and number of points."""
    parser = argparse.ArgumentParser(description="Time hard-disk trial moves from Python.")
    parser.add_argument("--points", type=int, nargs="+", default=[4096])
    parser.add_argument("--seconds", type=float, default=0.5)
    options = parser.parse_args(arguments)
    pin_to_cores(usable_cores()[:1])
    for n in options.points:
        x, length = _equilibrated(n, np.random.default_rng(5))
        reference: list[bool] = []
        for name, make in _contestants().items():
            best = 0.0
            for _ in range(_RUNS):
                rate, accepted = _rate(make, x, length, options.seconds / _RUNS)
                best = max(best, rate)
                shared = min(len(reference), len(accepted))
                assert accepted[:shared] == reference[:shared], name
                reference = max(reference, accepted, key=len)
            print(f"{n:>8}  {name:<20} {best:12.0f} trial moves a second")
        print(f"{n:>8}  accepted {sum(reference) / len(reference):.3f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
