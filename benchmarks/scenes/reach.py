# SPDX-License-Identifier: BSD-3-Clause
"""Balls and types: a reach for each pair of points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenes.main import pairs_1e5_k52
from scenes.make import cube_root, directions, uniform
from scenes.registry import add
from scenes.scene import REACH_PEERS, Limit, Scene


@add("S16")
def balls_equal_1e5(name: str) -> Scene:
    """Make the large box, of balls that touch where one cutoff would find them."""
    return replace(
        pairs_1e5_k52(name), stresses="equal radii: what one cutoff does", want=None,
        radii=np.full(100_000, 2.5), peers=REACH_PEERS,
        limits=(Limit("scene", 1.1, other="pairs-1e5-k52"),),
    )  # fmt: skip


@add("S16")
def balls_1to10_1e5(name: str) -> Scene:
    """Make balls of sizes from 1 to 10, evenly, some 25 contacts each."""
    radii = 0.45 + 4.05 * uniform(20260201, 100_000, 1)[:, 0]
    return Scene(
        name, "radii from 1 to 10, the sum", uniform(20260202, 100_000, 3) * 100.0, 9.0,
        np.full(3, 100.0), (True,) * 3, radii=radii, peers=REACH_PEERS,
    )  # fmt: skip


@add("S16")
def types_3_1e5(name: str) -> Scene:
    """Make three types, with a cutoff for each two of them."""
    table = np.array([[2.0, 3.0, 4.0], [3.0, 4.5, 5.0], [4.0, 5.0, 6.0]])
    types = (uniform(20260203, 100_000, 1)[:, 0] * 3.0).astype(np.int32)
    return Scene(
        name, "three types, cutoffs from 2 to 6", uniform(20260204, 100_000, 3) * 100.0, 6.0,
        np.full(3, 100.0), (True,) * 3, types=types, table=table, peers=REACH_PEERS,
    )  # fmt: skip


@add("S16")
def dwarfs_1e6(name: str) -> Scene:
    """Make a million balls of one size, for the scene with a giant."""
    return Scene(
        name, "a million balls of one size", uniform(20260205, 1_000_000, 3) * 100.0, 1.25,
        np.full(3, 100.0), (True,) * 3, radii=np.full(1_000_000, 0.625), peers=(),
    )  # fmt: skip


@add("S16")
def giant_1e6(name: str) -> Scene:
    """Make the same balls but one, which fills a thirtieth of the box."""
    dwarfs = dwarfs_1e6(name)
    assert dwarfs.radii is not None
    radii = dwarfs.radii.copy()
    radii[123_456] = 20.0
    return replace(
        dwarfs, stresses="one giant among a million dwarfs", cutoff=20.625, radii=radii,
        limits=(Limit("growth", 1.2, other="dwarfs-1e6"),),
    )  # fmt: skip


@add("S16")
def graded_1e5(name: str) -> Scene:
    """Make a cloud whose density falls by ten decades, with some 70 neighbours at any radius.

    At the distance x = u^2 from the centre the density is n / (8 pi x^2.5), and the reach 2 h that
    of a ball with 150 points in it, of which the larger of two counts.
    """
    n = 100_000
    u = uniform(20260206, n, 1)[:, 0]
    x = np.maximum(u * u, 1e-4)
    volume = x * x * np.sqrt(x) * (300.0 / n)  # 150 / (4 pi rho)
    h = 0.5 * cube_root(volume * 2.0**42) / 2.0**14
    radii = 2.0 * h
    points = directions(20260207, n) * (u * u)[:, None]
    return Scene(
        name, "density over ten decades, smoothing lengths that follow it", points,
        float(radii.max()), radii=radii, rule="max", peers=("PySPH",),
    )  # fmt: skip
