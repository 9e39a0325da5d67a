# SPDX-License-Identifier: BSD-3-Clause
"""The order of the input, and positions that spoil a grid."""

from __future__ import annotations

import numpy as np

from scenes.make import cell_order, uniform
from scenes.registry import add
from scenes.scene import FAST_PEERS, Floats, Limit, Scene

_PEERS = FAST_PEERS[:2]


def _ordered(name: str, stresses: str, points: Floats, limits: tuple[Limit, ...] = ()) -> Scene:
    return Scene(
        name, stresses, points, 5.0, np.full(3, 215.443), (True,) * 3, index_dtype="int32",
        limits=limits, peers=_PEERS,
    )  # fmt: skip


def _million() -> Floats:
    return uniform(20260125, 1_000_000, 3) * 215.443


@add("S13")
def order_random(name: str) -> Scene:
    """Make a million points as they are drawn."""
    return _ordered(name, "a million points in random order", _million())


@add("S13")
def order_sorted(name: str) -> Scene:
    """Make the same points along the rows of a grid."""
    points = _million()
    return _ordered(
        name, "the same along the rows of a grid", points[cell_order(points, 215.443 / 46)],
        (Limit("scene", None, other="order-random"),),
    )  # fmt: skip


@add("S13")
def order_strided(name: str) -> Scene:
    """Make the same points so that neighbours in the list are always far apart in space."""
    points = _million()
    ordered = points[cell_order(points, 215.443 / 46)]
    return _ordered(
        name, "the same dealt out: each step in memory is a long one in space",
        np.ascontiguousarray(ordered.reshape(1000, 1000, 3).transpose(1, 0, 2)).reshape(-1, 3),
        (Limit("scene", None, other="order-random"),),
    )  # fmt: skip


@add("S13")
def equal_2000(name: str) -> Scene:
    """Make points that are all the same."""
    return Scene(name, "2000 equal points", np.full((2000, 3), 0.1), 1.0, peers=_PEERS)


@add("S13")
def one_cell_2000(name: str) -> Scene:
    """Make points that no grid can part: the cutoff is half their extent."""
    return Scene(
        name, "all points in a few cells", uniform(20260126, 2000, 3) * 10.0, 5.0, peers=_PEERS
    )


@add("S13")
def outlier_1e5(name: str) -> Scene:
    """Make an open cloud with one point far away."""
    points = uniform(20260127, 100_000, 3) * 100.0
    points[50_000] = 1e8
    return Scene(name, "one point far away: bounds say nothing", points, 5.0,
                 peers=("cKDTree",))  # fmt: skip
