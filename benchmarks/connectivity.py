# SPDX-License-Identifier: BSD-3-Clause
"""Time what a `halfshell.Connectivity` is made of, one part beside the others.

    python benchmarks/connectivity.py [--nodes N ...] [--threads T]

Three lists of nodes, uniform in a cube, with some 57 neighbours each. Builds with and without each
part, the pairs as they are first looked at, and each change of 5 % beside a new build. CPU time,
the least of five runs in turns; with several threads wall-clock time beside that of one.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import halfshell as hs
from measure.machine import pin_to_cores, usable_cores

__all__ = ["main"]

_NEIGHBOURS = 57
_RUNS = 5

#: Made before it is timed, and what is timed of that.
Case = tuple[Callable[[], Any], Callable[[Any], Any]]


def _lists(n: int) -> list[hs.NodeList]:
    rng = np.random.default_rng(1)
    x = rng.random((n, 3))
    h = np.full(n, 0.5 * (3 * _NEIGHBOURS / (4 * np.pi * n)) ** (1 / 3))
    return [
        hs.NodeList(str(k), x[own], h[own]) for k, own in enumerate(np.array_split(np.arange(n), 3))
    ]


def _cases(lists: list[hs.NodeList], threads: int) -> dict[str, Case]:
    rng = np.random.default_rng(2)
    keep = [rng.random(one.n_nodes) < 0.95 for one in lists]

    def new(**options: Any) -> hs.Connectivity:
        return hs.Connectivity(lists, threads=threads, **options)

    def with_mask() -> tuple[hs.Connectivity, Any]:
        c = new()
        return c, np.arange(len(c.pairs)) % 20 == 0

    def nothing() -> None:
        return None

    return {
        "build": (nothing, lambda _: new()),
        "pairs": (new, lambda c: len(c.pairs)),
        "build with overlap": (nothing, lambda _: new(overlap=True)),
        "build with intersection": (nothing, lambda _: new(intersection=True)),
        "rebuild": (new, lambda c: c.rebuild(lists)),
        "patch": (new, lambda c: c.patch(keep)),
        "remove": (with_mask, lambda made: made[0].remove(made[1])),
    }


def _least(cases: dict[str, Case], clock: Callable[[], float]) -> dict[str, float]:
    """Milliseconds of each, the least of several runs in turns."""
    found = dict.fromkeys(cases, float("inf"))
    for _ in range(_RUNS):
        for name, (prepare, run) in cases.items():
            made = prepare()
            begun = clock()
            kept = run(made)
            found[name] = min(found[name], 1e3 * (clock() - begun))
            del made, kept
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nodes", type=int, nargs="+", default=[10_000, 100_000])
    parser.add_argument("--threads", type=int, default=1)
    given = parser.parse_args(arguments)
    pin_to_cores(usable_cores()[: given.threads])
    for n in given.nodes:
        lists = _lists(n)
        print(f"{n} nodes")
        if given.threads == 1:
            found = _least(_cases(lists, 1), time.process_time)
            for name, ms in found.items():
                print(f"  {name:26} {ms:9.1f} ms {ms / found['build']:7.2f} of a build")
        else:
            one = _least(_cases(lists, 1), time.perf_counter)
            some = _least(_cases(lists, given.threads), time.perf_counter)
            for name, ms in some.items():
                print(f"  {name:26} {ms:9.1f} ms {one[name] / ms:7.2f} times as fast as one")


if __name__ == "__main__":
    main()
