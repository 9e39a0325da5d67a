# SPDX-License-Identifier: BSD-3-Clause
"""Points that touch: close packing, and grains of many sizes."""

from __future__ import annotations

import numpy as np

from scenes.make import FCC, crystal, uniform
from scenes.registry import add
from scenes.scene import FAST_PEERS, Scene


@add("S6")
def packing_131k(name: str) -> Scene:
    """Make equal spheres packed as closely as possible, the cutoff just beyond contact."""
    points, box = crystal(FCC, 32, 4.0)
    # Neighbours touch at the square root of 8.
    return Scene(
        name, "close packing: 12 neighbours, all at one distance", points, 2.8312555, box,
        (True,) * 3, peers=FAST_PEERS[:3],
    )  # fmt: skip


@add("S6")
def grains_1to10(name: str) -> Scene:
    """Make centres of grains of sizes 1, 2 and 10 in patches of a box."""
    # A patch of edge 10 holds 1, 125 or 1000 grains, so density varies by a thousand.
    drawn = uniform(20260115, 512, 1)[:, 0]
    stream = np.random.RandomState(20260116)
    parts = []
    for patch in range(512):
        across = 10 if drawn[patch] < 0.1 else 5 if drawn[patch] < 0.4 else 1
        corner = np.array(np.unravel_index(patch, (8, 8, 8)), dtype=np.float64) * 10.0
        grid = np.stack(np.meshgrid(*[np.arange(across)] * 3, indexing="ij"), axis=-1)
        jitter = 0.3 + 0.4 * stream.random_sample((across**3, 3))
        parts.append(corner + (grid.reshape(-1, 3) + jitter) * (10.0 / across))
    return Scene(
        name, "grains of sizes 1 to 10: density varies a thousandfold from patch to patch",
        np.concatenate(parts), 5.0, np.full(3, 80.0), (True,) * 3, peers=FAST_PEERS[:3],
    )  # fmt: skip
