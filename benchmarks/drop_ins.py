# SPDX-License-Identifier: BSD-3-Clause
"""Drop-ins against the functions that they stand in for, by the same calls.

    python benchmarks/drop_ins.py [--points 10000] [--turns 7] [--neighbours 50] [--queries 1 100]

Points are uniform in a periodic cube. The calls take turns, and results are dropped at once. Owners
that are not installed are left out. With --queries trees that are there already answer so many of
them, in many turns, of which the shortest counts.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import sys
from collections.abc import Callable, Sequence
from statistics import median
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

__all__ = ["CALLS", "Scene", "main"]


class Scene(NamedTuple):
    """Points in a periodic cube, as each owner takes them."""

    points: Any
    edge: float
    cutoff: float

    @property
    def atoms(self) -> Any:
        from ase import Atoms

        return Atoms(np.full(len(self.points), 6), self.points, cell=[self.edge] * 3, pbc=True)

    @property
    def dimensions(self) -> Any:
        return np.array([self.edge] * 3 + [90.0] * 3, np.float32)


def _ase(letters: str) -> Callable[[Any, Scene], int]:
    def call(module: Any, scene: Scene) -> int:
        return len(module.neighbor_list(letters, scene.atoms, scene.cutoff)[0])

    return call


def _object(module: Any, scene: Scene) -> int:
    atoms = scene.atoms
    nl = module.NeighborList([scene.cutoff / 2] * len(atoms), skin=0.0, self_interaction=False)
    nl.update(atoms)
    return sum(len(nl.get_neighbors(k)[0]) for k in range(len(atoms)))


def _matscipy(module: Any, scene: Scene) -> int:
    return len(module.neighbour_list("ijdDS", scene.atoms, scene.cutoff)[0])


def _triplets(module: Any, scene: Scene) -> int:
    i = module.neighbour_list("i", scene.atoms, 0.5 * scene.cutoff)
    return len(module.triplet_list(module.first_neighbours(len(scene.points), i))[0])


def _query_pairs(module: Any, scene: Scene) -> int:
    tree = module.KDTree(scene.points, boxsize=scene.edge)
    return len(tree.query_pairs(scene.cutoff, output_type="ndarray"))


def _query(module: Any, scene: Scene) -> int:
    return len(module.KDTree(scene.points, boxsize=scene.edge).query(scene.points, 8)[0])


def _capped(module: Any, scene: Scene) -> int:
    points = scene.points.astype(np.float32)
    return len(module.self_capped_distance(points, scene.cutoff, box=scene.dimensions)[0])


def _radius_graph(module: Any, scene: Scene) -> int:
    made = module.RadiusNeighborsTransformer(radius=scene.cutoff)
    return int(made.fit_transform(scene.points).nnz)


def _nearest_graph(module: Any, scene: Scene) -> int:
    return int(module.KNeighborsTransformer(n_neighbors=8).fit_transform(scene.points).nnz)


def _spheres(module: Any, scene: Scene) -> int:
    pbc, lattice = np.ones(3, np.int64), np.eye(3) * scene.edge
    found = module.find_points_in_spheres(scene.points, scene.points, scene.cutoff, pbc, lattice)
    return len(found[0])


#: Name of a call -> drop-in, owner, and what the call does with either, which returns the number
#: of entries.
CALLS: dict[str, tuple[str, str, Callable[[Any, Scene], int]]] = {
    'ase.neighbor_list("ij")': ("ase", "ase.neighborlist", _ase("ij")),
    'ase.neighbor_list("ijdDS")': ("ase", "ase.neighborlist", _ase("ijdDS")),
    "ase.NeighborList": ("ase", "ase.neighborlist", _object),
    'matscipy.neighbour_list("ijdDS")': ("matscipy", "matscipy.neighbours", _matscipy),
    "matscipy.triplet_list": ("matscipy", "matscipy.neighbours", _triplets),
    "scipy.KDTree.query_pairs": ("scipy", "scipy.spatial", _query_pairs),
    "scipy.KDTree.query, k=8": ("scipy", "scipy.spatial", _query),
    "MDAnalysis.self_capped_distance": ("mdanalysis", "MDAnalysis.lib.distances", _capped),
    "sklearn.RadiusNeighborsTransformer": ("sklearn", "sklearn.neighbors", _radius_graph),
    "sklearn.KNeighborsTransformer": ("sklearn", "sklearn.neighbors", _nearest_graph),
    "pymatgen.find_points_in_spheres": (
        "pymatgen", "pymatgen.optimization.neighbors", _spheres,
    ),
}  # fmt: skip


#: Searches of a tree that has been made, for the points of a scene and its cutoff.
KEPT: dict[str, Callable[[Any, Scene], int]] = {
    "KDTree.query, k=1": lambda tree, scene: len(tree.query(scene.points)[0]),
    "KDTree.query, k=8": lambda tree, scene: len(tree.query(scene.points, 8)[0]),
    "KDTree.query_ball_point": lambda tree, scene: sum(
        map(len, tree.query_ball_point(scene.points, scene.cutoff))
    ),
}  # fmt: skip


def _few_queries(scene: Scene, numbers: Sequence[int], turns: int) -> bool:
    """Print a row for each search of kept trees and each number of queries; whether any differ."""
    from scipy import spatial

    from halfshell.compat import scipy as ours

    trees = [module.KDTree(scene.points, boxsize=scene.edge) for module in (ours, spatial)]
    rng, different = np.random.default_rng(1), False
    for n in numbers:
        asking = scene._replace(points=rng.random((n, 3)) * scene.edge)
        for name, search in KEPT.items():
            seconds, counts = _times(search, trees, asking, turns * max(1, 1000 // n))
            mine, others = (1e6 * min(one) for one in seconds)
            ratio = f"{mine:9.1f} us, owner {others:9.1f} us: {others / mine:.1f} times"
            print(f"{n} queries of {name:24} {ratio}")
            different |= counts[0] != counts[1]
    return different


def _times(call: Any, modules: Sequence[Any], scene: Scene, turns: int) -> tuple[Any, Any]:
    """Seconds of each turn, and the number of entries, of each module."""
    seconds: list[list[float]] = [[] for _ in modules]
    counts = [0] * len(modules)
    for _ in range(turns):
        for k, module in enumerate(modules):
            start = perf_counter()
            counts[k] = call(module, scene)
            seconds[k].append(perf_counter() - start)
    return seconds, counts


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for each call; 1 if the two have different numbers of entries."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--neighbours", type=float, default=50.0, help="of a point, on average")
    parser.add_argument("--turns", type=int, default=7)
    parser.add_argument("--queries", type=int, nargs="+", help="of trees that are there already")
    options = parser.parse_args(arguments)
    n, cutoff = options.points, 5.0
    edge = cutoff * (n * 4.0 / 3.0 * np.pi / options.neighbours) ** (1.0 / 3.0)
    scene = Scene(np.random.default_rng(0).random((n, 3)) * edge, edge, cutoff)
    if options.queries:
        return int(_few_queries(scene, options.queries, options.turns))
    different = False
    print(f"{n} points, about {options.neighbours:g} neighbours each, {options.turns} turns")
    for name, (drop_in, owner, call) in CALLS.items():
        if importlib.util.find_spec(owner.partition(".")[0]) is None:
            print(f"{name:34} {owner} is not installed")
            continue
        ours = importlib.import_module(f"halfshell.compat.{drop_in}")
        theirs = importlib.import_module(owner)
        seconds, counts = _times(call, (ours, theirs), scene, options.turns)
        mine, others = (1e3 * median(one) for one in seconds)
        print(f"{name:34} {mine:9.2f} ms, owner {others:9.2f} ms: {others / mine:.1f} times")
        # MDAnalysis rounds the box to float32, and differs by a pair of many.
        different |= abs(counts[0] - counts[1]) > (counts[1] // 10**5 if owner[0] == "M" else 0)
    return int(different)


if __name__ == "__main__":
    sys.exit(main())
