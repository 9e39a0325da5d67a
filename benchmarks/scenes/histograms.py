# SPDX-License-Identifier: BSD-3-Clause
"""Histograms of the distances of all pairs, without a list."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from scenes.main import pairs_1e5_k52, pairs_1e5_k419
from scenes.registry import add
from scenes.scene import HISTOGRAM_PEERS, Scene


def _many_neighbours(bins: int, name: str) -> Scene:
    """Make the box of many neighbours, counted in bins."""
    return replace(
        pairs_1e5_k419(name), stresses=f"21 million pairs in {bins} bins", task="count", bins=bins,
        want=14.0 if bins == 100 else None, limits=(), peers=HISTOGRAM_PEERS,
    )  # fmt: skip


@add("S12")
def histogram_1e5_k52(name: str) -> Scene:
    """Make the main figure, counted in bins."""
    return replace(
        pairs_1e5_k52(name), stresses="2.6 million pairs in 100 bins", task="count", bins=100,
        want=None, limits=(), peers=HISTOGRAM_PEERS,
    )  # fmt: skip


for _bins in (100, 500):
    add("S12", f"histogram-1e5-k419-{_bins}")(partial(_many_neighbours, _bins))
