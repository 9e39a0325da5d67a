# SPDX-License-Identifier: BSD-3-Clause
"""Count the pairs of the scenes without halfshell, and compare with `scenes/known.csv`.

    python benchmarks/check_scenes.py [NAME ...] [--most-points 100000]

Counts come from SciPy's tree, image by image, in float64: right but for pairs within rounding
of the cutoff. Crystals with a shell at the cutoff are left to integer arithmetic in the tests.
Digests of the coordinates are compared too. Exit status 1 means a difference.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from scenes import GROUPS, SCENES, Scene, known, load

__all__ = ["count_pairs", "main"]


def count_pairs(scene: Scene) -> int:
    """Count pairs in float64, a pair at the cutoff included, every image within reach."""
    return sum(_count_one(system) for system in scene.systems())


def _count_one(scene: Scene) -> int:
    from scipy.spatial import cKDTree

    if scene.task == "nearest":
        return scene.n * scene.nearest  # all rows are full
    if scene.task == "between":
        tree = cKDTree(scene.asking, boxsize=np.diag(scene.rows))
        other = cKDTree(scene.found, boxsize=np.diag(scene.rows))
        return int(tree.count_neighbors(other, scene.cutoff))
    if scene.has_reach:
        return _count_by_reach(scene)
    tree = cKDTree(scene.points)
    if scene.rows is None:
        return int(tree.count_neighbors(tree, scene.cutoff) - scene.n) // 2
    # Points lie within the box, so that a partner is at most this many boxes away.
    heights = 1.0 / np.linalg.norm(np.linalg.inv(scene.rows), axis=0)
    reach = np.where(scene.periodic, np.ceil(scene.cutoff / heights), 0).astype(np.int64)
    found = 0
    for shift in itertools.product(*(range(-most, most + 1) for most in reach)):
        moved = scene.points + np.array(shift, dtype=np.float64) @ scene.rows
        # Only images near the box have partners in it.
        near = np.all(
            (moved >= scene.points.min(axis=0) - scene.cutoff)
            & (moved <= scene.points.max(axis=0) + scene.cutoff), axis=1,
        )  # fmt: skip
        if near.any():
            found += int(tree.count_neighbors(cKDTree(moved[near]), scene.cutoff))
    return (found - scene.n) // 2


def _parts(scene: Scene) -> list[Any]:
    """Numbers of points of one type, or of about one radius."""
    if scene.radii is None:
        assert scene.types is not None
        labels = scene.types
    else:
        labels = np.frexp(scene.radii)[1]
    return [np.flatnonzero(labels == label) for label in np.unique(labels)]


def _reach(scene: Scene, i: Any, j: Any) -> Any:
    """The reach of each pair, rounded."""
    if scene.radii is None:
        assert scene.types is not None and scene.table is not None
        return scene.table[scene.types[i], scene.types[j]]
    a, b = scene.radii[i], scene.radii[j]
    return a + b if scene.rule == "sum" else np.maximum(a, b)


def _count_by_reach(scene: Scene) -> int:
    """Count pairs of each two parts, one image of each, in float64."""
    from scipy.spatial import cKDTree

    lengths = None if scene.rows is None else np.diag(scene.rows)
    parts = _parts(scene)
    trees = [cKDTree(scene.points[part], boxsize=lengths) for part in parts]
    found = 0
    for a, one in enumerate(parts):
        for b, other in enumerate(parts[: a + 1]):
            tops = [part if scene.radii is None else part[[scene.radii[part].argmax()]]
                    for part in (one, other)]  # fmt: skip
            largest = float(_reach(scene, tops[0][:1], tops[1][:1])[0])
            table = trees[a].sparse_distance_matrix(trees[b], largest, output_type="ndarray")
            i, j = one[table["i"]], other[table["j"]]
            within = (table["v"] <= _reach(scene, i, j)) & (i != j)
            found += int(within.sum()) // (2 if a == b else 1)
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenes; default: all in the file")
    parser.add_argument(
        "--most-points", type=int, default=100_000, help="leave out larger (100000)"
    )
    parser.add_argument("--most-pairs", type=int, default=6_000_000,
                        help="leave out scenes with more (6000000)")  # fmt: skip
    options = parser.parse_args(arguments)
    wrong = 0
    for name in options.names or [name for name in SCENES if name in known()]:
        pairs, digest = known()[name]
        scene = load(name)
        if scene.digest()[: len(digest)] != digest:
            print(f"{name}: the coordinates are not the ones that are known")
            wrong += 1
        if scene.n > options.most_points or pairs > options.most_pairs or name in GROUPS["S3"]:
            continue
        counted = count_pairs(scene)
        if counted != pairs:
            print(f"{name}: {counted} pairs counted, {pairs} known")
            wrong += 1
        else:
            print(f"{name}: {pairs}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
