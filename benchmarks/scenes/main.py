# SPDX-License-Identifier: BSD-3-Clause
"""Large and medium scenes with a wanted ratio: uniform points of density 0.1, and the like."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scenes.make import uniform
from scenes.registry import add
from scenes.scene import COUNT_PEERS, LIST_PEERS, Limit, Scene

# One precision above the others: how much the exact decision may cost.
_EXACT_COST = Limit("variant", 1.03, {"precision": "single"})


def _cube(name: str, stresses: str, n: int, length: float, cutoff: float, **rest: Any) -> Scene:
    """Points uniform in a periodic cube of density 0.1."""
    points = uniform(20260101, n, 3) * length
    return Scene(name, stresses, points, cutoff, np.full(3, length), (True,) * 3, **rest)


@add("main")
def pairs_1e5_k52(name: str) -> Scene:
    """Make the main figure: a large uniform periodic box, int64 indices."""
    return _cube(
        name, "everything at once: bins, search, output of int64", 100_000, 100.0, 5.0, want=24.0,
        limits=(_EXACT_COST, Limit("floor", 3.0), Limit("rewrite", None)),
    )  # fmt: skip


@add("main")
def pairs_1e5_k52_int32(name: str) -> Scene:
    """Make the main figure with indices half as wide."""
    return replace(
        pairs_1e5_k52(name), stresses="the same with half the output", index_dtype="int32",
        want=30.0,
    )  # fmt: skip


@add("main")
def pairs_1e5_k419(name: str) -> Scene:
    """Make a box with many neighbours a point: output and hit rate decide."""
    return _cube(
        name, "output: 21 million pairs, fresh pages", 100_000, 100.0, 10.0, want=30.0,
        limits=(_EXACT_COST, Limit("floor", 1.8), Limit("rewrite", None)),
        peers=tuple(peer for peer in LIST_PEERS if peer not in ("ase", "pymatgen", "freud")),
    )  # fmt: skip


@add("main")
def pairs_1e5_k419_int32(name: str) -> Scene:
    """Make the box of many neighbours with indices half as wide."""
    return replace(
        pairs_1e5_k419(name), stresses="the same with half the output", index_dtype="int32",
        want=42.0,
    )  # fmt: skip


@add("main")
def pairs_1e4_k52(name: str) -> Scene:
    """Make the main figure at a size that fits the cache."""
    return _cube(
        name, "a medium box: cache-resident points", 10_000, 46.4159, 5.0, want=25.0,
        limits=(_EXACT_COST,),
    )  # fmt: skip


@add("main")
def vectors_1e5_k52(name: str) -> Scene:
    """Make the main figure with all five quantities."""
    return replace(
        pairs_1e5_k52(name), stresses="distances, vectors and shifts", quantities="ijdDS",
        want=14.0, limits=(Limit("floor", None), Limit("rewrite", None)),
    )  # fmt: skip


@add("main")
def triclinic_1e4_k52(name: str) -> Scene:
    """Make a tilted box of the same volume as the cube of 10 000 points."""
    rows = np.array([[50.0, 0.0, 0.0], [-12.0, 47.0, 0.0], [9.0, -14.0, 42.5532]])
    parts = uniform(20260102, 10_000, 3)
    points = sum(parts[:, [axis]] * rows[axis] for axis in range(3))
    return Scene(
        name, "a tilted box: fractions, compensated wrap, tilted stencil", points, 5.0, rows,
        (True,) * 3, limits=(Limit("scene", 1.15, other="pairs-1e4-k52"),),
    )  # fmt: skip


@add("main")
def open_1e4(name: str) -> Scene:
    """Make a scene without a box."""
    return Scene(
        name, "open space: bounds instead of a box, no shifts",
        uniform(20260103, 10_000, 3) * 46.4159, 5.0, want=18.0,
    )  # fmt: skip


@add("main")
def plane_1e5_k20(name: str) -> Scene:
    """Make a scene in two dimensions."""
    return Scene(
        name, "two dimensions, few neighbours: work per point",
        uniform(20260104, 100_000, 2) * 1000.0, 7.9788, np.full(2, 1000.0), (True,) * 2, want=20.0,
    )  # fmt: skip


@add("main")
def clusters_1e5(name: str) -> Scene:
    """Make dense clusters in much empty space."""
    centres = uniform(20260105, 300, 3) * 1000.0
    drawn = uniform(20260106, 100_000, 5)
    size = 4.0 + 36.0 * drawn[:, [4]] * drawn[:, [4]]
    offset = 2.0 * drawn[:, :3] - 1.0
    points = centres[(drawn[:, 3] * 300.0).astype(np.int64)] + size * offset * offset * offset
    return Scene(
        name, "uneven density: 300 peaked clusters, most space empty", points, 0.405, want=9.0
    )


@add("main")
def count_1e5_k52(name: str) -> Scene:
    """Make the main figure, counted without a list."""
    return replace(
        pairs_1e5_k52(name), stresses="distance tests alone, no output", task="count", want=35.0,
        limits=(), peers=COUNT_PEERS,
    )  # fmt: skip


@add("main")
def count_1e5_k419(name: str) -> Scene:
    """Make the box of many neighbours, counted without a list."""
    return replace(
        pairs_1e5_k419(name), stresses="distance tests at a high hit rate", task="count",
        want=14.0, limits=(), peers=COUNT_PEERS,
    )  # fmt: skip


def _on_two(single: Scene, at_most: float) -> Scene:
    """Turn a scene into the same on two threads, held against one."""
    return replace(
        single, threads=2, want=None, limits=(Limit("variant", at_most, {"threads": 1}),), peers=()
    )


@add("S14")
def threads_pairs_1e6(name: str) -> Scene:
    """Make a million points, listed by two threads."""
    stresses = "a long list from two threads: memory, and the joining of their parts"
    return _on_two(
        _cube(name, stresses, 1_000_000, 215.443, 5.0, index_dtype="int32"), 1.0 / 1.6
    )  # fmt: skip


@add("S14")
def threads_count_1e6(name: str) -> Scene:
    """Make a million points, counted by two threads."""
    stresses = "two threads without output"
    return _on_two(_cube(name, stresses, 1_000_000, 215.443, 5.0, task="count"), 1.0 / 1.8)


@add("S14")
def threads_pairs_1e5_k52(name: str) -> Scene:
    """Make the main figure on two threads."""
    return replace(_on_two(pairs_1e5_k52(name), 1.0 / 1.3), stresses="two threads, a short list")


@add("S14")
def threads_pairs_1e5_k419(name: str) -> Scene:
    """Make the box of many neighbours on two threads."""
    return replace(
        _on_two(pairs_1e5_k419(name), 1.0 / 1.5), stresses="two threads that mostly write"
    )


@add("S14")
def threads_count_1e5_k419(name: str) -> Scene:
    """Make the box of many neighbours, counted by two threads."""
    return replace(_on_two(count_1e5_k419(name), 1.0 / 1.8), stresses="two threads that only test")
