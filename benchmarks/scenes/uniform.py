# SPDX-License-Identifier: BSD-3-Clause
"""Families of even density: uniform cubes over size and neighbours, growth, water, planes."""

from __future__ import annotations

from functools import partial

import numpy as np

from scenes.make import cell_order, directions, uniform, wrapped
from scenes.registry import add
from scenes.scene import FAST_PEERS, Floats, Limit, Scene

# Cubes of density 0.1 with this number of points have this edge.
_EDGES = {"1e3": 21.5443, "1e4": 46.4159, "1e5": 100.0, "1e6": 215.443, "1e7": 464.159}
# With this mean number of neighbours a point the cutoff is this.
_CUTOFFS = {6: 2.4286, 12: 3.0598, 25: 3.9079, 50: 4.9237, 100: 6.2035, 200: 7.8159, 400: 9.8475}

_LARGEST_OUTPUT = 8e9  # bytes
# Beyond this many pairs a call of a peer takes seconds, and so does comparing the answers.
_MOST_FOR_PEERS = 3e7

_WRITING = (Limit("floor", None), Limit("rewrite", None))


def _uniform(size: str, neighbours: int, name: str) -> Scene:
    n, edge = int(float(size)), _EDGES[size]
    pairs = n * neighbours / 2.0
    return Scene(
        name, f"{size} points with {neighbours} neighbours each", uniform(20260110, n, 3) * edge,
        _CUTOFFS[neighbours], np.full(3, edge), (True,) * 3, index_dtype="int32",
        about_pairs=pairs, limits=_WRITING,
        peers=FAST_PEERS[:3] if pairs <= _MOST_FOR_PEERS else (),
    )  # fmt: skip


def _growth(size: str, ordered: bool, name: str) -> Scene:
    """Make the main figure at another size."""
    n, edge = int(float(size)), _EDGES[size]
    points = uniform(20260109, n, 3) * edge
    if ordered:
        points = points[cell_order(points, edge / int(edge / 4.6))]
    wanted = {"1e7": 1.2 if ordered else 1.5}.get(size)
    limits = () if name == "growth-1e5" else (Limit("growth", wanted, other="growth-1e5"),)
    return Scene(
        name, f"{size} points in {'the order of a coarse grid' if ordered else 'random order'}",
        points, 5.0, np.full(3, edge), (True,) * 3, index_dtype="int32", about_pairs=26.18 * n,
        limits=limits, peers=(),
    )  # fmt: skip


for _size in _EDGES:
    for _neighbours in _CUTOFFS:
        if int(float(_size)) * _neighbours / 2.0 * 8.0 <= _LARGEST_OUTPUT:
            add("S1", f"uniform-{_size}-k{_neighbours}")(partial(_uniform, _size, _neighbours))
for _size in ("1e4", "1e5", "1e6", "1e7"):
    add("growth", f"growth-{_size}")(partial(_growth, _size, False))
    add("growth", f"growth-{_size}-sorted")(partial(_growth, _size, True))


def _water_points() -> tuple[Floats, float]:
    """Make 32 768 molecules, each near a site of a cubic grid, 0.1 atoms a cubic angstrom."""
    pitch, sites = 3.1072, 32
    grid = np.stack(np.meshgrid(*[np.arange(sites)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    oxygen = (grid + 0.25 + 0.5 * uniform(20260111, len(grid), 3)) * pitch
    first = oxygen + 0.9572 * directions(20260112, len(grid))
    second = oxygen + 0.9572 * directions(20260113, len(grid))
    molecules = np.stack([oxygen, first, second], axis=1).reshape(-1, 3)
    return wrapped(molecules, sites * pitch), sites * pitch


def _water(cutoff: float, name: str) -> Scene:
    points, edge = _water_points()
    return Scene(
        name, f"molecules in input order, cutoff {cutoff:g} angstrom", points, cutoff,
        np.full(3, edge), (True,) * 3, peers=FAST_PEERS[:3],
    )  # fmt: skip


for _cutoff in (6, 10, 12):
    add("S2", f"water-{_cutoff}")(partial(_water, float(_cutoff)))


def _plane(neighbours: int, cutoff: float, name: str) -> Scene:
    return Scene(
        name, f"two dimensions, {neighbours} neighbours", uniform(20260114, 100_000, 2) * 1000.0,
        cutoff, np.full(2, 1000.0), (True,) * 2, peers=FAST_PEERS[:3],
    )  # fmt: skip


add("S7", "plane-1e5-k8")(partial(_plane, 8, 5.0463))
add("S7", "plane-1e5-k30")(partial(_plane, 30, 9.772))
