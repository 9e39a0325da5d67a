# SPDX-License-Identifier: BSD-3-Clause
"""All neighbours of each point, row after row, and two sets of points."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from scenes.main import pairs_1e4_k52, pairs_1e5_k52
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
        task="rows", quantities="j", want=None, limits=(), peers=_ROW_PEERS,
    )  # fmt: skip


def _between(n_queries: int, what: str, name: str) -> Scene:
    return replace(
        pairs_1e5_k52(name), stresses=f"two sets, {what}", task="between", n_queries=n_queries,
        want=None, limits=(), peers=_BETWEEN_PEERS,
    )  # fmt: skip


add("S11", "between-few")(partial(_between, 1000, "1000 queries among 99 000 points"))
add("S11", "between-halves")(partial(_between, 50_000, "50 000 queries, as many points"))
