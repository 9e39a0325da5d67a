# SPDX-License-Identifier: BSD-3-Clause
"""Short calls: molecules, unit cells, boxes with several images, and batches of them."""

from __future__ import annotations

from functools import partial

import numpy as np

from scenes.make import DIAMOND, crystal, cube_root, uniform
from scenes.registry import add
from scenes.scene import FAST_PEERS, LIST_PEERS, Floats, Limit, Scene

_PEERS = FAST_PEERS[:3]


@add("main")
def call_2(name: str) -> Scene:
    """Make a scene that shows what a call costs before it does anything."""
    return Scene(
        name, "the overhead of a call: arguments, binding, result",
        np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), 2.0, limits=(Limit("seconds", 3e-6),),
        peers=_PEERS,
    )  # fmt: skip


@add("main")
def molecule_30(name: str) -> Scene:
    """Make a molecule: one short call."""
    return Scene(
        name, "a short call: overhead and the all-pairs path", uniform(20260107, 30, 3) * 6.7, 5.0,
        want=2.0, latency=True,
    )  # fmt: skip


@add("main")
def images_64(name: str) -> Scene:
    """Make a box shorter than two cutoffs."""
    return Scene(
        name, "several images of one pair in a small box", uniform(20260108, 64, 3) * 8.62, 5.0,
        np.full(3, 8.62), (True,) * 3, quantities="ijS", want=5.0, latency=True,
    )  # fmt: skip


@add("main")
def silicon_8(name: str) -> Scene:
    """Make a unit cell, the cutoff more than twice its length."""
    points, box = crystal(DIAMOND, 1, 5.43)
    return Scene(
        name, "a unit cell: many images, each point paired with its own", points, 12.0, box,
        (True,) * 3, quantities="ijS", want=4.0, latency=True,
    )  # fmt: skip


@add("main")
@add("S9")
def batch_30(name: str) -> Scene:
    """Make 2000 molecules of 30 points in one call."""
    return Scene(
        name, "2000 systems of 30 points in one call, open", uniform(20260128, 60_000, 3) * 6.7,
        5.0, want=8.0, peers=_PEERS, batch=np.repeat(np.arange(2000), 30),
    )  # fmt: skip


def _batch(periodic: bool, name: str) -> Scene:
    """Make 10 000 systems of 20 to 100 points, density 0.1 each."""
    sizes = 20 + (uniform(20260129, 10_000, 1)[:, 0] * 81.0).astype(np.int64)
    edges = cube_root(10.0 * sizes.astype(np.float64))
    batch = np.repeat(np.arange(10_000), sizes)
    points = uniform(20260130, int(sizes.sum()), 3) * edges[batch][:, None]
    boxes = edges[:, None, None] * np.eye(3) if periodic else None
    how = "periodic with images" if periodic else "open"
    return Scene(
        name, f"10 000 systems of 20 to 100 points, {how}", points, 5.0, boxes,
        (True,) * 3 if periodic else (), quantities="ijS" if periodic else "ij", peers=_PEERS,
        batch=batch,
    )  # fmt: skip


add("S9", "batch-1e4-open")(partial(_batch, False))
add("S9", "batch-1e4-periodic")(partial(_batch, True))


def _single(n: int, edge: float, name: str) -> Scene:
    return Scene(
        name, f"one call on {n} points, open", uniform(20260131, n, 3) * edge, 5.0, peers=_PEERS,
        latency=True,
    )  # fmt: skip


for _n, _edge in {10: 4.6416, 30: 6.6943, 100: 10.0, 300: 14.4225, 500: 17.0998,
                  1000: 21.5443}.items():  # fmt: skip
    add("S10", f"single-{_n}")(partial(_single, _n, _edge))


def _narrow(edge: float) -> Floats:
    """Make a box whose three angles are 30 degrees."""
    cosine = np.sqrt(3.0) / 2.0
    y = cosine - cosine * cosine
    return edge * np.array(
        [[1.0, 0.0, 0.0], [cosine, 0.5, 0.0], [cosine, 2.0 * y, np.sqrt(0.25 - 4.0 * y * y)]]
    )


def _in_box(seed: int, n: int, rows: Floats) -> Floats:
    parts = uniform(seed, n, 3)
    points: Floats = sum(parts[:, [axis]] * rows[axis] for axis in range(3))
    return points


@add("S8")
def narrow_1e4(name: str) -> Scene:
    """Make a rhombohedral box of 30 degrees with the volume of the cube of 10 000 points."""
    rows = _narrow(76.7317)
    return Scene(
        name, "angles of 30 degrees: the box must be reduced", _in_box(20260132, 10_000, rows), 5.0,
        rows, (True,) * 3, peers=FAST_PEERS,
    )  # fmt: skip


def _short(edge: float, n: int, tilted: bool, name: str) -> Scene:
    rows = _narrow(edge) if tilted else np.diag(np.full(3, edge))
    return Scene(
        name, f"{'angles of 30 degrees, ' if tilted else ''}edge {edge / 5.0:g} cutoffs",
        _in_box(20260133, n, rows), 5.0, rows, (True,) * 3, quantities="ijS",
        peers=tuple(peer for peer in LIST_PEERS if peer != "ase"), latency=True,
    )  # fmt: skip


# Density 0.1 in the cubes; the tilted boxes have 0.22 of their volume and the same points.
for _edge, _n in {3.5: 4, 7.5: 42, 12.5: 195}.items():
    add("S8", f"short-{_edge / 5.0:g}")(partial(_short, _edge, _n, False))
    add("S8", f"short-{_edge / 5.0:g}-narrow")(partial(_short, _edge, _n, True))
