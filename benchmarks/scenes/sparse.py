# SPDX-License-Identifier: BSD-3-Clause
"""Uneven density: much empty space, and clusters with a dense core."""

from __future__ import annotations

import numpy as np

from scenes.make import directions, exponential, normal, uniform
from scenes.registry import add
from scenes.scene import FAST_PEERS, Floats, Scene

_PEERS = FAST_PEERS[:3]
# vesin has a fixed number of cells and takes minutes where most points fall into one of them;
# neighborlist-rs would make a cell for every cutoff of empty space.
_TREE = ("cKDTree",)


@add("S4")
def slab_1e5(name: str) -> Scene:
    """Make a layer of liquid that fills a tenth of its periodic box."""
    points = uniform(20260117, 100_000, 3) * 100.0 + np.array([0.0, 0.0, 450.0])
    return Scene(
        name, "a slab in vacuum: nine tenths of the box are empty", points, 5.0,
        np.array([100.0, 100.0, 1000.0]), (True,) * 3, peers=_PEERS,
    )  # fmt: skip


@add("S4")
def droplet_1e5(name: str) -> Scene:
    """Make a ball of liquid that fills a fiftieth of its periodic box."""
    # The largest of three uniform numbers is the cube root of one.
    radius = 62.0351 * uniform(20260118, 100_000, 3).max(axis=1)
    points = 184.2 + radius[:, None] * directions(20260119, 100_000)
    return Scene(
        name, "a droplet: 2 % of the box are filled", points, 5.0, np.full(3, 368.4), (True,) * 3,
        peers=_PEERS,
    )  # fmt: skip


def _two_clusters() -> Floats:
    """Make two cubes of liquid a million cutoffs apart along the diagonal."""
    points = uniform(20260120, 100_000, 3) * 79.3701
    return points + (5e6 * (np.arange(100_000) % 2))[:, None]


@add("S4")
def two_clusters_open(name: str) -> Scene:
    """Make two clusters so far apart that a grid over their bounds has no memory."""
    return Scene(name, "two clusters 1e6 cutoffs apart, open", _two_clusters(), 5.0, peers=_TREE)


@add("S4")
def two_clusters_periodic(name: str) -> Scene:
    """Make the same in a periodic box."""
    return Scene(
        name, "two clusters 1e6 cutoffs apart, periodic", _two_clusters(), 5.0, np.full(3, 1e7),
        (True,) * 3, peers=_TREE,
    )  # fmt: skip


@add("S5")
def lognormal_1e5(name: str) -> Scene:
    """Make points whose distance from the centre is lognormal."""
    radius = 20.0 * exponential(normal(20260121, 100_000, 1))
    return Scene(
        name, "a lognormal cloud: no edge, density falls by many decades",
        radius * directions(20260122, 100_000), 1.0, peers=_TREE,
    )  # fmt: skip


@add("S5")
def plummer_1e5(name: str) -> Scene:
    """Make a star cluster after Plummer, of scale radius 1."""
    # The enclosed mass is m where the radius is w / sqrt(1 - w^2), w the cube root of m.
    root = 0.9999 * uniform(20260123, 100_000, 3).max(axis=1)
    radius = root / np.sqrt(1.0 - root * root)
    return Scene(
        name, "a star cluster: dense core, far halo",
        radius[:, None] * directions(20260124, 100_000), 0.1, peers=_TREE,
    )  # fmt: skip
