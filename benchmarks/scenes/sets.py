# SPDX-License-Identifier: BSD-3-Clause
"""All neighbours of each point, row after row, and two sets of points."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from scenes.main import pairs_1e4_k52, pairs_1e5_k52
from scenes.make import uniform
from scenes.registry import add
from scenes.scene import Scene

_ROW_PEERS = ("vesin", "cKDTree", "matscipy-neighbours", "freud", "ase")
_BETWEEN_PEERS = ("cKDTree", "MDAnalysis", "freud")


@add("S11")
def rows_1e4_k52(name: str) -> Scene:
    """Make the medium box, of which all rows are wanted."""
    return replace(
        pairs_1e4_k52(name), stresses="rows of all neighbours, sorted; points in cache",
        task="rows", quantities="j", want=None, limits=(), peers=_ROW_PEERS,
    )  # fmt: skip


@add("S11")
def rows_1e5_k52(name: str) -> Scene:
    """Make the large box, of which all rows are wanted."""
    return replace(
        pairs_1e5_k52(name), stresses="rows of all neighbours, sorted; a large box",
        task="rows", quantities="j", want=12.0, limits=(), peers=_ROW_PEERS,
    )  # fmt: skip


def _between(n_queries: int, what: str, name: str) -> Scene:
    return replace(
        pairs_1e5_k52(name), stresses=f"two sets, {what}", task="between", n_queries=n_queries,
        want=None, limits=(), peers=_BETWEEN_PEERS,
    )  # fmt: skip


@add("S11")
def between_1e5(name: str) -> Scene:
    """Make two large sets in one box."""
    return Scene(
        name, "two sets of 100 000 points", uniform(20260103, 200_000, 3) * 100.0, 5.0,
        np.full(3, 100.0), (True,) * 3, task="between", n_queries=100_000, want=20.0,
        peers=_BETWEEN_PEERS,
    )  # fmt: skip


add("S11", "between-few")(partial(_between, 1000, "1000 queries among 99 000 points"))
add("S11", "between-halves")(partial(_between, 50_000, "50 000 queries, as many points"))
