# SPDX-License-Identifier: BSD-3-Clause
"""Drop-ins against the functions that they stand in for, by the same calls.

    python benchmarks/drop_ins.py [--points 10000] [--turns 7] [--neighbours 50]

Points are uniform in a periodic cube. The calls take turns, and results are dropped at once.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

__all__ = ["CALLS", "main"]


def _neighbor_list(module: Any, atoms: Any, cutoff: float) -> int:
    return len(module.neighbor_list("ijdDS", atoms, cutoff)[0])


def _indices(module: Any, atoms: Any, cutoff: float) -> int:
    return len(module.neighbor_list("ij", atoms, cutoff)[0])


def _object(module: Any, atoms: Any, cutoff: float) -> int:
    nl = module.NeighborList([cutoff / 2] * len(atoms), skin=0.0, self_interaction=False)
    nl.update(atoms)
    return sum(len(nl.get_neighbors(k)[0]) for k in range(len(atoms)))


#: Name of a call -> what it does with a module, and returns the number of entries.
CALLS: dict[str, Callable[[Any, Any, float], int]] = {
    'ase.neighbor_list("ij")': _indices,
    'ase.neighbor_list("ijdDS")': _neighbor_list,
    "ase.NeighborList": _object,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for each call; 1 if the two have different numbers of entries."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--neighbours", type=float, default=50.0, help="of a point, on average")
    parser.add_argument("--turns", type=int, default=7)
    options = parser.parse_args(arguments)

    from ase import Atoms, neighborlist

    from halfshell.compat import ase as ours

    n, cutoff = options.points, 5.0
    edge = cutoff * (n * 4.0 / 3.0 * np.pi / options.neighbours) ** (1.0 / 3.0)
    points = np.random.default_rng(0).random((n, 3)) * edge
    atoms = Atoms(np.full(n, 6), points, cell=[edge] * 3, pbc=True)
    different = False
    print(f"{n} points, about {options.neighbours:g} neighbours each, {options.turns} turns")
    for name, call in CALLS.items():
        seconds: dict[Any, list[float]] = {ours: [], neighborlist: []}
        counts = dict.fromkeys(seconds, 0)
        for _ in range(options.turns):
            for module in seconds:
                start = perf_counter()
                counts[module] = call(module, atoms, cutoff)
                seconds[module].append(perf_counter() - start)
        drop_in, owner = (1e3 * median(one) for one in seconds.values())
        print(f"{name:30} {drop_in:9.2f} ms, owner {owner:9.2f} ms: {owner / drop_in:.1f} times")
        different |= counts[ours] != counts[neighborlist]
    return int(different)


if __name__ == "__main__":
    sys.exit(main())
