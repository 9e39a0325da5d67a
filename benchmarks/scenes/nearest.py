# SPDX-License-Identifier: BSD-3-Clause
"""The k nearest points of each point: even and uneven densities, few and many wanted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenes.main import pairs_1e5_k52
from scenes.registry import SCENES, add
from scenes.scene import NEAREST_PEERS, Scene
from scenes.sparse import lognormal_1e5, two_clusters_open


def _nearest(scene: Scene, stresses: str, k: int = 12, want: float | None = None) -> Scene:
    """Ask for the nearest of the points of another scene."""
    return replace(
        scene, stresses=stresses, task="nearest", nearest=k, quantities="jd", cutoff=0.0,
        n_pairs=k * scene.n, want=want, limits=(), peers=NEAREST_PEERS,
    )  # fmt: skip


@add("S15")
def nearest_1e5_open(name: str) -> Scene:
    """Make the main figure of the trees: even points in open space."""
    scene = replace(pairs_1e5_k52(name), box=None, periodic=())
    return _nearest(scene, "the 12 nearest, open", want=6.0)


@add("S15")
def nearest_1e5_periodic(name: str) -> Scene:
    """Make the same in a periodic box."""
    return _nearest(pairs_1e5_k52(name), "the 12 nearest, periodic", want=10.0)


@add("S15")
def nearest_1e5_one(name: str) -> Scene:
    """Ask for one neighbour: the search costs more than the ranking."""
    return _nearest(nearest_1e5_open(name), "the nearest one, open", k=1)


@add("S15")
def nearest_1e5_many(name: str) -> Scene:
    """Ask for many neighbours: the ranking costs more than the search."""
    return _nearest(nearest_1e5_open(name), "the 100 nearest, open", k=100)


@add("S15")
def nearest_two_clusters(name: str) -> Scene:
    """Make two clusters: no cell size suits both them and their distance."""
    return _nearest(two_clusters_open(name), "the 12 nearest, two clusters far apart")


@add("S15")
def nearest_lognormal(name: str) -> Scene:
    """Make a cloud whose density falls by many decades."""
    return _nearest(lognormal_1e5(name), "the 12 nearest, density over many decades")


@add("S15")
def nearest_crystal(name: str) -> Scene:
    """Make a perfect crystal: all twelve are tied."""
    return _nearest(SCENES["fcc-tie"](name), "the 12 nearest of a perfect crystal: ties")


@add("S15")
def nearest_outlier(name: str) -> Scene:
    """Make one point that is far from all others."""
    points = nearest_1e5_open(name).points.copy()
    points[0] = np.full(3, 1e12)
    return replace(
        nearest_1e5_open(name), points=points, want=None, stresses="the 12 nearest, one outlier"
    )
