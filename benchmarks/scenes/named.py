# SPDX-License-Identifier: BSD-3-Clause
"""All scenes, in the order in which they are run and listed.

Coordinates are the same bits on every machine. They come from the frozen stream of ``RandomState``
by additions, multiplications, divisions and square roots alone, in a fixed order; those are rounded
the same everywhere. What can be made so from any stream is shared with `halfshell_report.scenes`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell_report.scenes import _make
from halfshell_report.scenes._make import FCC, cell_order, exponential, wrapped
from scenes.scene import (
    COUNT_PEERS,
    FAST_PEERS,
    HISTOGRAM_PEERS,
    LIST_PEERS,
    NEAREST_PEERS,
    REACH_PEERS,
    SCENES,
    Floats,
    Limit,
    Scene,
    add,
)

DIAMOND = np.concatenate([FCC, FCC + 1])


def uniform(seed: int, n: int, dim: int) -> Floats:
    """Make points uniform in the unit cube."""
    return np.random.RandomState(seed).random_sample((n, dim))


def normal(seed: int, n: int, dim: int) -> Floats:
    """Make nearly normal numbers: sums of twelve uniform ones, within six deviations."""
    return _make.normal(np.random.RandomState(seed).random_sample, n, dim)


def directions(seed: int, n: int, dim: int = 3) -> Floats:
    """Make vectors of length one, uniform in direction."""
    return _make.directions(np.random.RandomState(seed).random_sample, n, dim)


def crystal(basis: NDArray[np.int64], repeats: int, constant: float) -> tuple[Floats, Floats]:
    """Make a cubic crystal and its box; `basis` is in quarters of the lattice constant."""
    sites, _ = _make.sites(4 * np.eye(3, dtype=np.int64), basis, (repeats,) * 3)
    lengths: Floats = np.full(3, repeats * constant)
    points: Floats = sites.astype(np.float64) * (constant / 4.0)
    return points, lengths


def cube_root(value: Floats) -> Floats:
    """Return cube roots of numbers from 1 to 1e6, by a fixed number of steps of Newton's."""
    root = 1.0 + value / 3.0
    for _ in range(60):
        root = (2.0 * root + value / (root * root)) / 3.0
    return root


# ---- large and medium scenes with a wanted ratio: uniform points of density 0.1, and the like ----

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


# ---- short calls: molecules, unit cells, boxes with several images, and batches of them ------

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


# ---- crystals whose cutoff lies on a shell of neighbours, or a hair beside it ----------------

_CRYSTAL_COST = Limit("variant", 2.0, {"precision": "single"})

# Many roundings away from the shell, yet far within what float32 can tell apart.
_BESIDE = 1e-12

_Kind = tuple[str, NDArray[np.int64], int, float, float]
_KINDS: dict[str, _Kind] = {
    "fcc-shell": ("a shell within rounding of the cutoff: the later stages decide",
                  FCC, 14, 4.05, 8.1),
    "fcc-tie": ("a shell at exactly the cutoff: the last stage, and the tie rule",
                FCC, 14, 4.0, 8.0),
    "diamond-shell": ("a shell within rounding of the cutoff, more neighbours",
                      DIAMOND, 12, 5.431, 10.862),
}  # fmt: skip


def _crystal(kind: str, beside: float, name: str) -> Scene:
    stresses, basis, repeats, constant, cutoff = _KINDS[kind]
    if beside:
        stresses = f"a shell {abs(beside):g} {'within' if beside > 0.0 else 'beyond'} the cutoff"
    points, box = crystal(basis, repeats, constant)
    return Scene(
        name, stresses, points, cutoff + beside, box, (True,) * 3, limits=(_CRYSTAL_COST,),
        peers=FAST_PEERS,
    )  # fmt: skip


for _kind in _KINDS:
    _exactly = partial(_crystal, _kind, 0.0)
    add("main", _kind)(_exactly)
    add("S3", _kind)(_exactly)
    add("S3", f"{_kind}-below")(partial(_crystal, _kind, -_BESIDE))
    add("S3", f"{_kind}-above")(partial(_crystal, _kind, _BESIDE))


# ---- families of even density: uniform cubes over size and neighbours, growth, water, planes ----

# Cubes of density 0.1 with this number of points have this edge.
_EDGES = {"1e3": 21.5443, "1e4": 46.4159, "1e5": 100.0, "1e6": 215.443, "1e7": 464.159}
# With this mean number of neighbours a point the cutoff is this.
_CUTOFFS = {6: 2.4286, 12: 3.0598, 25: 3.9079, 50: 4.9237, 100: 6.2035, 200: 7.8159, 400: 9.8475}

_LARGEST_OUTPUT = 8e9  # bytes
# Beyond this many pairs a call of a peer takes seconds, and so does comparing the answers.
_MOST_FOR_PEERS = 3e7

_WRITING = (Limit("floor", None), Limit("rewrite", None))


def _uniform(size: str, neighbours: int, name: str) -> Scene:
    n, edge = int(float(size)), _EDGES[size]
    pairs = n * neighbours / 2.0
    return Scene(
        name, f"{size} points with {neighbours} neighbours each", uniform(20260110, n, 3) * edge,
        _CUTOFFS[neighbours], np.full(3, edge), (True,) * 3, index_dtype="int32",
        about_pairs=pairs, limits=_WRITING,
        peers=FAST_PEERS[:3] if pairs <= _MOST_FOR_PEERS else (),
    )  # fmt: skip


def _growth(size: str, ordered: bool, name: str) -> Scene:
    """Make the main figure at another size."""
    n, edge = int(float(size)), _EDGES[size]
    points = uniform(20260109, n, 3) * edge
    if ordered:
        points = points[cell_order(points, edge / int(edge / 4.6))]
    wanted = {"1e7": 1.2 if ordered else 1.5}.get(size)
    limits = () if name == "growth-1e5" else (Limit("growth", wanted, other="growth-1e5"),)
    return Scene(
        name, f"{size} points in {'the order of a coarse grid' if ordered else 'random order'}",
        points, 5.0, np.full(3, edge), (True,) * 3, index_dtype="int32", about_pairs=26.18 * n,
        limits=limits, peers=(),
    )  # fmt: skip


for _size in _EDGES:
    for _neighbours in _CUTOFFS:
        if int(float(_size)) * _neighbours / 2.0 * 8.0 <= _LARGEST_OUTPUT:
            add("S1", f"uniform-{_size}-k{_neighbours}")(partial(_uniform, _size, _neighbours))
for _size in ("1e4", "1e5", "1e6", "1e7"):
    add("growth", f"growth-{_size}")(partial(_growth, _size, False))
    add("growth", f"growth-{_size}-sorted")(partial(_growth, _size, True))


def _water_points() -> tuple[Floats, float]:
    """Make 32 768 molecules, each near a site of a cubic grid, 0.1 atoms a cubic angstrom."""
    pitch, sites = 3.1072, 32
    grid = np.stack(np.meshgrid(*[np.arange(sites)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    oxygen = (grid + 0.25 + 0.5 * uniform(20260111, len(grid), 3)) * pitch
    first = oxygen + 0.9572 * directions(20260112, len(grid))
    second = oxygen + 0.9572 * directions(20260113, len(grid))
    molecules = np.stack([oxygen, first, second], axis=1).reshape(-1, 3)
    return wrapped(molecules, sites * pitch), sites * pitch


def _water(cutoff: float, name: str) -> Scene:
    points, edge = _water_points()
    return Scene(
        name, f"molecules in input order, cutoff {cutoff:g} angstrom", points, cutoff,
        np.full(3, edge), (True,) * 3, peers=FAST_PEERS[:3],
    )  # fmt: skip


for _cutoff in (6, 10, 12):
    add("S2", f"water-{_cutoff}")(partial(_water, float(_cutoff)))


def _plane(neighbours: int, cutoff: float, name: str) -> Scene:
    return Scene(
        name, f"two dimensions, {neighbours} neighbours", uniform(20260114, 100_000, 2) * 1000.0,
        cutoff, np.full(2, 1000.0), (True,) * 2, peers=FAST_PEERS[:3],
    )  # fmt: skip


add("S7", "plane-1e5-k8")(partial(_plane, 8, 5.0463))
add("S7", "plane-1e5-k30")(partial(_plane, 30, 9.772))


# ---- uneven density: much empty space, and clusters with a dense core ------------------------

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


# ---- points that touch: close packing, and grains of many sizes ------------------------------

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


# ---- all neighbours of each point, row after row, and two sets of points ---------------------

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


# ---- histograms of the distances of all pairs, without a list --------------------------------

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


# ---- the order of the input, and positions that spoil a grid ---------------------------------

_TWO_PEERS = FAST_PEERS[:2]


def _ordered(name: str, stresses: str, points: Floats, limits: tuple[Limit, ...] = ()) -> Scene:
    return Scene(
        name, stresses, points, 5.0, np.full(3, 215.443), (True,) * 3, index_dtype="int32",
        limits=limits, peers=_TWO_PEERS,
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
    return Scene(name, "2000 equal points", np.full((2000, 3), 0.1), 1.0, peers=_TWO_PEERS)


@add("S13")
def one_cell_2000(name: str) -> Scene:
    """Make points that no grid can part: the cutoff is half their extent."""
    return Scene(
        name, "all points in a few cells", uniform(20260126, 2000, 3) * 10.0, 5.0, peers=_TWO_PEERS
    )


@add("S13")
def outlier_1e5(name: str) -> Scene:
    """Make an open cloud with one point far away."""
    points = uniform(20260127, 100_000, 3) * 100.0
    points[50_000] = 1e8
    return Scene(name, "one point far away: bounds say nothing", points, 5.0,
                 peers=("cKDTree",))  # fmt: skip


# ---- the k nearest points of each point: even and uneven densities, few and many wanted ------

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


# ---- balls and types: a reach for each pair of points ----------------------------------------

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
