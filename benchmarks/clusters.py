# SPDX-License-Identifier: BSD-3-Clause
"""Time clusters of points: `halfshell.clusters` beside scikit-learn and SciPy.

    python benchmarks/clusters.py [--points N ...] [--neighbours K] [--min-points M] [--rounds R]

Points at random in a cube. Connected components: our clusters, and SciPy's
`connected_components` of our table of neighbours and of cKDTree's pairs; DBSCAN: ours and
scikit-learn's, if that is installed. Each call is made in a process of its own, in turns, and
must give the same labels; the least wall-clock time of all rounds counts. Memory is what the
process grew by at most, with the labels. One thread.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec

__all__ = ["main"]

_CHILD = """
import hashlib, json, resource, sys, time
import numpy as np
import halfshell as hs
{imports}
n, k, least = map(int, sys.argv[1:])
points = np.random.default_rng(0).random((n, 3))
cutoff = float((k / (n * 4.0 / 3.0 * np.pi)) ** (1.0 / 3.0))
few = points[:200]

def run(points, cutoff):
    {call}

run(few, 0.1)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
start = time.perf_counter()
labels = np.asarray(run(points, cutoff))
seconds = time.perf_counter() - start
grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
if {by_lowest}:
    _, first, which = np.unique(labels, return_index=True, return_inverse=True)
    labels = np.argsort(np.argsort(first))[which]
print(json.dumps([seconds, grown, hashlib.sha256(labels.astype(np.int64)).hexdigest()]))
"""

_SPARSE = (
    "from scipy.sparse import coo_matrix\nfrom scipy.sparse.csgraph import connected_components"
)

#: Name -> imports, body of a function, whether labels are in an order of their own.
_COMPONENTS = {
    "halfshell": ("", "return hs.clusters(points, cutoff, threads=1).labels", False),
    "halfshell, neighbors": (
        _SPARSE,
        "return connected_components(hs.neighbors(points, cutoff, quantities='jd', threads=1)"
        ".to_scipy(), directed=False)[1]",
        True,
    ),
    "cKDTree, SciPy": (
        _SPARSE + "\nfrom scipy.spatial import cKDTree",
        "pairs = cKDTree(points).query_pairs(cutoff, output_type='ndarray')\n"
        "    ones = np.ones(len(pairs), np.int8)\n"
        "    graph = coo_matrix((ones, (pairs[:, 0], pairs[:, 1])), (len(points), len(points)))\n"
        "    return connected_components(graph, directed=False)[1]",
        True,
    ),
}
_DBSCAN = {
    "halfshell": (
        "",
        "return hs.clusters(points, cutoff, min_points=least, threads=1).labels",
        False,
    ),
    "scikit-learn": (
        "from sklearn.cluster import DBSCAN",
        "return DBSCAN(eps=cutoff, min_samples=least, n_jobs=1).fit(points).labels_",
        False,
    ),
}


def _measure(way: tuple[str, str, bool], numbers: Sequence[int]) -> tuple[float, float, str]:
    code = _CHILD.format(imports=way[0], call=way[1], by_lowest=way[2])
    command = [sys.executable, "-c", code, *map(str, numbers)]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    seconds, megabytes, labels = json.loads(done.stdout)
    return seconds, megabytes, labels


def _compare(
    title: str, ways: dict[str, tuple[str, str, bool]], numbers: Sequence[int], rounds: int
) -> bool:
    measured: dict[str, list[tuple[float, float, str]]] = {name: [] for name in ways}
    for _ in range(rounds):
        for name, way in ways.items():
            measured[name].append(_measure(way, numbers))
    ours = min(seconds for seconds, _, _ in measured["halfshell"])
    print(f"{title}, {numbers[0]:,} points, about {numbers[1]} neighbours each")
    for name, runs in measured.items():
        seconds, megabytes = min(run[0] for run in runs), min(run[1] for run in runs)
        print(f"  {name:22s} {seconds:9.3f} s {megabytes:9.1f} MB  {seconds / ours:6.2f}")
    return len({run[2] for runs in measured.values() for run in runs}) == 1


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--neighbours", type=int, default=10)
    parser.add_argument("--min-points", type=int, default=8)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args(argv)
    same = True
    for n in options.points:
        numbers = (n, options.neighbours, options.min_points)
        same &= _compare("components", _COMPONENTS, numbers, options.rounds)
        if find_spec("sklearn") is not None:
            same &= _compare("DBSCAN", _DBSCAN, numbers, options.rounds)
    if not same:
        print("the labels differ", file=sys.stderr)
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
