# SPDX-License-Identifier: BSD-3-Clause
"""Drop-ins against the functions that they stand in for, by the same calls.

    python benchmarks/drop_ins.py [--points 1 10 100 10000] [--turns 7] [--neighbours 50] [--open]
        [--queries 1 100] [--only KDTree]

Points are uniform in a periodic cube, at least so large that no other image of a pair is within the
cutoff; or in open space. Calls take turns, short ones are repeated in each, results are dropped at
once, and the shortest turn counts. Trees, atoms and estimators are made beforehand. Owners that are
not installed are left out. With --queries they have so many of them, in place of the points.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import sys
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

__all__ = ["CALLS", "Scene", "main"]

#: A turn of calls takes about so many seconds at least.
_TURN = 1e-3


class Scene(NamedTuple):
    """Points in a cube, which may be periodic, as each owner takes them."""

    points: Any
    queries: Any
    edge: float
    cutoff: float
    is_open: bool

    @property
    def atoms(self) -> Any:
        from ase import Atoms

        numbers = np.full(len(self.points), 6)
        return Atoms(numbers, self.points, cell=[self.edge] * 3, pbc=not self.is_open)

    @property
    def dimensions(self) -> Any:
        return None if self.is_open else np.array([self.edge] * 3 + [90.0] * 3, np.float32)

    def tree(self, module: Any, points: Any = None) -> Any:
        boxsize = None if self.is_open else self.edge
        return module.KDTree(self.points if points is None else points, boxsize=boxsize)


Call = Callable[[], Any]


def _ase(letters: str) -> Callable[[Any, Scene], Call]:
    def make(module: Any, scene: Scene) -> Call:
        atoms = scene.atoms
        return lambda: module.neighbor_list(letters, atoms, scene.cutoff)

    return make


def _object(module: Any, scene: Scene) -> Call:
    atoms = scene.atoms
    radii = [scene.cutoff / 2] * len(atoms)

    def call() -> Any:
        nl = module.NeighborList(radii, skin=0.0, self_interaction=False)
        nl.update(atoms)
        return [nl.get_neighbors(k)[0] for k in range(len(atoms))]

    return call


def _matscipy(module: Any, scene: Scene) -> Call:
    atoms = scene.atoms
    return lambda: module.neighbour_list("ijdDS", atoms, scene.cutoff)


def _triplets(module: Any, scene: Scene) -> Call:
    i = module.neighbour_list("i", scene.atoms, 0.5 * scene.cutoff)
    first = module.first_neighbours(len(scene.points), i)
    return lambda: module.triplet_list(first)


def _tree(method: str, *arguments: Any, **options: Any) -> Callable[[Any, Scene], Call]:
    """A method of a tree: of the cutoff, of queries, or of another tree of these."""

    def make(module: Any, scene: Scene) -> Call:
        call = getattr(scene.tree(module), method)
        tree = scene.tree(module, scene.queries)
        known = {"queries": scene.queries, "cutoff": scene.cutoff, "tree": tree}
        known |= {"one": scene.queries[0], "cutoffs": np.linspace(0.1, 1.0, 10) * scene.cutoff}
        given = [known.get(one, one) if isinstance(one, str) else one for one in arguments]
        return lambda: call(*given, **options)

    return make


def _capped(of_two: bool) -> Callable[[Any, Scene], Call]:
    def make(module: Any, scene: Scene) -> Call:
        sets = [scene.points.astype(np.float32)]
        sets += [scene.queries.astype(np.float32)] if of_two else []
        call = module.capped_distance if of_two else module.self_capped_distance
        return lambda: call(*sets, scene.cutoff, box=scene.dimensions)

    return make


def _radius_graph(module: Any, scene: Scene) -> Call:
    made = module.RadiusNeighborsTransformer(radius=scene.cutoff)
    return lambda: made.fit_transform(scene.points)


def _nearest_graph(module: Any, scene: Scene) -> Call:
    made = module.KNeighborsTransformer(n_neighbors=min(8, max(len(scene.points) - 2, 0)))
    return lambda: made.fit_transform(scene.points)


def _radius_neighbors(module: Any, scene: Scene) -> Call:
    made = module.RadiusNeighborsTransformer(radius=scene.cutoff).fit(scene.points)
    return lambda: made.radius_neighbors(scene.queries)[1]


def _spheres(module: Any, scene: Scene) -> Call:
    pbc, lattice = np.full(3, not scene.is_open, np.int64), np.eye(3) * scene.edge
    return lambda: module.find_points_in_spheres(
        scene.points, scene.queries, scene.cutoff, pbc, lattice
    )


_SCIPY = "scipy", "scipy.spatial"
_SKLEARN = "sklearn", "sklearn.neighbors"
_MDANALYSIS = "mdanalysis", "MDAnalysis.lib.distances"

#: Name of a call -> drop-in, owner, and what makes the call from a module and a scene.
CALLS: dict[str, tuple[str, str, Callable[[Any, Scene], Call]]] = {
    'ase.neighbor_list("ij")': ("ase", "ase.neighborlist", _ase("ij")),
    'ase.neighbor_list("ijdDS")': ("ase", "ase.neighborlist", _ase("ijdDS")),
    "ase.NeighborList": ("ase", "ase.neighborlist", _object),
    'matscipy.neighbour_list("ijdDS")': ("matscipy", "matscipy.neighbours", _matscipy),
    "matscipy.triplet_list": ("matscipy", "matscipy.neighbours", _triplets),
    "KDTree.query_pairs": (*_SCIPY, _tree("query_pairs", "cutoff")),
    "KDTree.query_pairs, ndarray": (
        *_SCIPY, _tree("query_pairs", "cutoff", output_type="ndarray"),
    ),
    "KDTree.query_ball_point": (*_SCIPY, _tree("query_ball_point", "queries", "cutoff")),
    "KDTree.query_ball_point of one": (*_SCIPY, _tree("query_ball_point", "one", "cutoff")),
    "KDTree.query_ball_point, lengths": (
        *_SCIPY, _tree("query_ball_point", "queries", "cutoff", return_length=True),
    ),
    "KDTree.query_ball_tree": (*_SCIPY, _tree("query_ball_tree", "tree", "cutoff")),
    "KDTree.count_neighbors": (*_SCIPY, _tree("count_neighbors", "tree", "cutoff")),
    "KDTree.count_neighbors, 10 radii": (*_SCIPY, _tree("count_neighbors", "tree", "cutoffs")),
    **{
        f"KDTree.sparse_..., {kind}": (
            *_SCIPY, _tree("sparse_distance_matrix", "tree", "cutoff", output_type=kind),
        ) for kind in ("dict", "ndarray", "coo_matrix", "dok_matrix")
    },
    "KDTree.query, k=1": (*_SCIPY, _tree("query", "queries")),
    "KDTree.query, k=8": (*_SCIPY, _tree("query", "queries", 8)),
    "KDTree.query of one, k=1": (*_SCIPY, _tree("query", "one")),
    "MDAnalysis.self_capped_distance": (*_MDANALYSIS, _capped(False)),
    "MDAnalysis.capped_distance": (*_MDANALYSIS, _capped(True)),
    "sklearn.RadiusNeighborsTransformer": (*_SKLEARN, _radius_graph),
    "sklearn.KNeighborsTransformer": (*_SKLEARN, _nearest_graph),
    "sklearn...radius_neighbors": (*_SKLEARN, _radius_neighbors),
    "pymatgen.find_points_in_spheres": (
        "pymatgen", "pymatgen.optimization.neighbors", _spheres,
    ),
}  # fmt: skip


def _count(result: Any) -> int:
    """The number of entries of a result: of all lists that it has, or of its first array."""
    if isinstance(result, tuple):
        return _count(result[0])
    if isinstance(result, list) or getattr(result, "dtype", None) == np.dtype(object):
        return sum(len(one) if np.ndim(one) else 1 for one in result)
    if hasattr(result, "nnz"):
        return int(result.nnz)
    return int(result) if np.isscalar(result) else len(result)


def _seconds(call: Call, n: int) -> float:
    start = perf_counter()
    for _ in range(n):
        call()
    return (perf_counter() - start) / n


def _times(calls: Sequence[Call], turns: int) -> list[float]:
    """Seconds of the shortest turn of each."""
    numbers = [max(1, int(_TURN / max(_seconds(call, 1) for _ in range(2)))) for call in calls]
    turn = [[_seconds(call, n) for call, n in zip(calls, numbers)] for _ in range(turns)]
    return [min(one) for one in zip(*turn)]


def _compare(name: str, scene: Scene, turns: int) -> bool:
    """Print a row for a call; whether the two have different numbers of entries."""
    drop_in, owner, make = CALLS[name]
    if importlib.util.find_spec(owner.partition(".")[0]) is None:
        print(f"{name:34} {owner} is not installed")
        return False
    ours = make(importlib.import_module(f"halfshell.compat.{drop_in}"), scene)
    theirs = make(importlib.import_module(owner), scene)
    try:
        count = _count(theirs())
    except Exception as error:  # of few points, in matscipy and scikit-learn
        print(f"{name:34} {owner} raises {type(error).__name__}")
        return False
    difference = abs(_count(ours()) - count)
    mine, others = (1e6 * one for one in _times((ours, theirs), turns))
    print(f"{name:34} {mine:11.1f} us, owner {others:11.1f} us: {others / mine:5.2f} times")
    # MDAnalysis rounds the box to float32, and differs by a pair of many.
    return difference > (count // 10**5 if drop_in == "mdanalysis" else 0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for each call; 1 if the two have different numbers of entries."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[10_000])
    parser.add_argument("--neighbours", type=float, default=50.0, help="of a point, on average")
    parser.add_argument("--turns", type=int, default=7)
    parser.add_argument("--open", action="store_true", help="in open space")
    parser.add_argument("--queries", type=int, nargs="+", help="in place of as many as points")
    parser.add_argument("--only", default="", help="calls with this in their names")
    options = parser.parse_args(arguments)
    cutoff, rng, different = 5.0, np.random.default_rng(0), False
    for n in options.points:
        edge = cutoff * (n * 4.0 / 3.0 * np.pi / options.neighbours) ** (1.0 / 3.0)
        edge = max(edge, 2.01 * cutoff)
        points = rng.random((n, 3)) * edge
        for n_queries in options.queries or [n]:
            queries = rng.random((n_queries, 3)) * edge
            scene = Scene(points, queries, edge, cutoff, options.open)
            print(f"{n} points, {n_queries} queries, {options.turns} turns")
            for name in CALLS:
                if options.only in name:
                    different |= _compare(name, scene, options.turns)
    return int(different)


if __name__ == "__main__":
    sys.exit(main())
