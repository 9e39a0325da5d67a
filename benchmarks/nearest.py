# SPDX-License-Identifier: BSD-3-Clause
"""Measure the k nearest points against the trees that are installed.

    python benchmarks/nearest.py                  uniform points, open and periodic
    python benchmarks/nearest.py --uneven         clusters, a lognormal cloud, an outlier, a crystal

One thread each, building included, calls taking turns; the median and the least of all turns are
shown. Distances are compared first: a library that is off by more than its number format explains
is reported. Every library returns k neighbours and distances of each point; those that list the
point itself are asked for one more.
"""

from __future__ import annotations

import argparse
import importlib
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import machine
from contestant import Floats, pin_threads

Call = Callable[[], Floats]


def ours(points: Floats, k: int, box: Floats | None) -> Call | None:
    """Return our own search, which gives distances (n, k)."""
    halfshell = importlib.import_module("halfshell")
    search = partial(halfshell.nearest, points, k, box=box, threads=1)
    return lambda: search()[1]


def ckdtree(points: Floats, k: int, box: Floats | None) -> Call | None:
    """Return SciPy's tree: the balanced one, which is the faster one to ask."""
    tree = importlib.import_module("scipy.spatial").cKDTree
    return lambda: tree(points, boxsize=box).query(points, k + 1)[0][:, 1:]


def pykdtree(points: Floats, k: int, box: Floats | None) -> Call | None:
    """Return pykdtree's tree; open space only."""
    if box is not None:
        return None
    tree = importlib.import_module("pykdtree.kdtree").KDTree
    return lambda: tree(points).query(points, k + 1)[0][:, 1:]


def freud(points: Floats, k: int, box: Floats | None) -> Call | None:
    """Return freud's tree of boxes, in float32; periodic boxes only, up to a third of the box."""
    if box is None:
        return None
    library = importlib.import_module("freud")
    library.parallel.set_num_threads(1)
    centred = (points - 0.5 * box).astype(np.float32)
    cell, query = library.box.Box(*box), {"num_neighbors": k, "exclude_ii": True}
    tree = library.locality.AABBQuery
    return lambda: tree(cell, centred).query(centred, query).toNeighborList().distances


CONTESTANTS = {"halfshell": ours, "cKDTree": ckdtree, "pykdtree": pykdtree, "freud": freud}


def scenes(n: int, uneven: bool) -> dict[str, tuple[Floats, Floats | None]]:
    """Points, and edge lengths or None."""
    rng = np.random.default_rng(20260101)
    even = rng.random((n, 3))
    if not uneven:
        return {"open": (even, None), "periodic": (even, np.ones(3))}
    clusters, outlier = even.copy(), even.copy()
    clusters[n // 2 :] += 1e9
    outlier[0] = 1e300
    side = round(n ** (1 / 3))
    steps = np.arange(float(side))
    crystal = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    return {
        "two clusters 1e9 apart": (clusters, None),
        "lognormal, sigma 3": (rng.lognormal(0.0, 3.0, (n, 3)), None),
        "one outlier at 1e300": (outlier, None),
        "simple cubic crystal": (crystal, np.full(3, float(side))),
        "all points equal": (np.ones((n, 3)), None),
    }


def calls_for(points: Floats, k: int, box: Floats | None) -> dict[str, Call]:
    """Return the call of each library that is installed and can do this."""
    calls = {}
    for name, prepare in CONTESTANTS.items():
        try:
            call = prepare(points, k, box)
        except ImportError:
            print(f"  {name}: not installed")
            continue
        if call is not None:
            calls[name] = call
    return calls


def difference(one: Floats, other: Any) -> float:
    """Return the largest relative difference of two sets of distances."""
    other = np.sort(np.asarray(other, dtype=np.float64).reshape(one.shape), axis=1)
    scale = np.maximum(one, np.finfo(float).tiny)
    return float(np.max(np.abs(other - one) / scale, initial=0.0))


def measure(calls: dict[str, Call], turns: int) -> dict[str, list[float]]:
    """Time all calls in turn."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(turns):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            times[name].append(time.perf_counter() - start)
    return times


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("-k", type=int, default=12)
    parser.add_argument("--turns", type=int, default=7)
    parser.add_argument("--uneven", action="store_true")
    options = parser.parse_args()
    pin_threads()
    machine.pin_to_cores(machine.usable_cores()[-1:])
    for title, (points, box) in scenes(options.points, options.uneven).items():
        print(f"{title}: {len(points)} points, {options.k} nearest")
        calls = calls_for(points, options.k, box)
        if "outlier" in title or "equal" in title:  # squares overflow; cKDTree takes n^2
            calls = {"halfshell": calls["halfshell"]}
        answers = {name: call() for name, call in calls.items()}
        times = measure(calls, options.turns)
        own = statistics.median(times["halfshell"])
        for name, taken in times.items():
            median = statistics.median(taken)
            print(
                f"  {name:12s} {1e3 * median:9.1f} ms  least {1e3 * min(taken):9.1f} ms  "
                f"ratio {median / own:5.2f}  "
                f"distances off by {difference(answers['halfshell'], answers[name]):.1e}"
            )


if __name__ == "__main__":
    main()
