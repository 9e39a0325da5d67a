# SPDX-License-Identifier: BSD-3-Clause
"""What bricks and Dask cost: all bricks one after another, and workers, against one search.

python benchmarks/bricks.py [--points 1000000] [--repeats 3] [--counts]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import halfshell as hs

EDGE, CUTOFF = 1.0, 2.1  # 1 point in a unit of volume: 39 neighbours for each
BRICKS = 8


def best(repeats: int, call: Callable[[], Any]) -> tuple[float, Any]:
    """Least time in seconds, and what was returned."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        found = call()
        times.append(time.perf_counter() - start)
    return min(times), found


def report(name: str, seconds: float, one: float) -> None:
    """A line with the time, and its ratio to one search."""
    print(f"{name:48s} {seconds:8.2f} s {seconds / one:6.2f} of one search", flush=True)


def by_bricks(points: Any, box: Any, repeats: int) -> None:
    """All bricks in turn, one thread, against one search with one thread."""
    one, expected = best(
        repeats, lambda: hs.pairs(points, CUTOFF, box=box, sort=True, threads=1)[0].size
    )
    print(f"{len(points)} points, {expected} pairs")
    report("pairs, sorted, one search, one thread", one, one)
    dividing, parts = best(repeats, lambda: hs.bricks(points, CUTOFF, BRICKS, box=box))
    report(f"dividing into {BRICKS}, overhead {parts.overhead:.3f}", dividing, one)
    held = [points[part.members] for part in parts]
    searching, found = best(
        repeats,
        lambda: sum(
            part.pairs(own, threads=1)[0].size for part, own in zip(parts, held, strict=True)
        ),
    )
    assert found == expected
    report("pairs of all bricks, one after another", searching, one)


def by_dask(points: Any, box: Any, repeats: int) -> None:
    """Counts by workers that are processes, against one search with one and all threads."""
    import dask.array as da
    import distributed

    import halfshell.dask as hd

    one, expected = best(repeats, lambda: hs.count_pairs(points, CUTOFF, box=box, threads=1))
    report("count, one search, one thread", one, one)
    all_threads, _ = best(repeats, lambda: hs.count_pairs(points, CUTOFF, box=box))
    report("count, one search, all threads", all_threads, one)
    rows = -(-len(points) // BRICKS)
    given = da.from_array(points, chunks=(rows, -1))
    asked = hd.count_pairs(given, CUTOFF, box=box)
    for workers in (1, 2):
        at_once = partial(asked.compute, scheduler="threads", num_workers=workers)
        seconds, found = best(repeats, at_once)
        assert int(found) == expected
        report(f"count, Dask, threads, {workers} at once", seconds, one)
    rng = da.random.default_rng(0)
    made = rng.random((len(points), 3), chunks=(rows, -1)) * box[0]
    for workers in (1, 2):
        with (
            distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address=None
            ) as cluster,
            distributed.Client(cluster),
        ):
            kept = made.persist()
            distributed.wait(kept)
            count = hd.count_pairs(kept, CUTOFF, box=box)
            seconds, _ = best(repeats, count.compute)
            report(f"count, Dask, workers that are processes: {workers}", seconds, one)


def main() -> None:
    """Measure what the arguments say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--counts", action="store_true", help="no pairs, which take memory")
    arguments = parser.parse_args()
    edge = arguments.points ** (1.0 / 3.0) * EDGE
    points = np.random.default_rng(0).random((arguments.points, 3)) * edge
    box = [edge] * 3
    if not arguments.counts:
        by_bricks(points, box, arguments.repeats)
    by_dask(points, box, arguments.repeats)


if __name__ == "__main__":
    main()
