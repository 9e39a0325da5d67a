# SPDX-License-Identifier: BSD-3-Clause
"""The scenes that every benchmark measures: named inputs with fixed seeds.

A scene is built when it is asked for, so listing names costs nothing:

    scene = load("pairs-1e5-k52")
    scene.points, scene.cutoff, scene.box, scene.periodic

Coordinates are made from the frozen stream of ``RandomState`` with additions,
multiplications and square roots alone, in a fixed order. They are therefore the same bits on
every machine, and ``Scene.digest`` may be compared between machines.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["QUICK", "SCENES", "Limit", "Scene", "load"]

Floats = NDArray[np.float64]

LIST_PEERS = (
    "vesin",
    "cKDTree",
    "neighborlist-rs",
    "matscipy-neighbours",
    "MDAnalysis",
    "pymatgen",
    "freud",
    "ase",
)
COUNT_PEERS = ("Corrfunc", "cKDTree", "vesin", "neighborlist-rs")


@dataclass(frozen=True)
class Limit:
    """Something of our own that a scene is held against.

    kind
        ``"variant"``: the same call with other `options`. ``"scene"``: our call on `other`,
        each per pair. ``"growth"``: our call on `other`, each per point. ``"floor"``: writing
        as many bytes once into new memory. ``"seconds"``: the time of one call itself.
    at_most
        Largest ratio of our time to the other's (``"seconds"``: largest time).
    """

    kind: Literal["variant", "scene", "growth", "floor", "seconds"]
    at_most: float
    options: Mapping[str, Any] = field(default_factory=dict)
    other: str = ""

    @property
    def label(self) -> str:
        """A name for tables, which also tells limits of one scene apart."""
        if self.kind == "variant":
            return ",".join(f"{key}={value}" for key, value in self.options.items())
        return {"floor": "writing the output", "seconds": "one call"}.get(self.kind, self.other)


@dataclass(frozen=True, eq=False)
class Scene:
    """One input, what is asked about it, and what the answer should cost."""

    name: str
    stresses: str
    points: Floats  # (n, d)
    cutoff: float
    box: Floats | None = None  # lengths (d,), row vectors (d, d), or None: open space
    periodic: tuple[bool, ...] = ()
    task: Literal["pairs", "count"] = "pairs"
    quantities: str = "ij"
    index_dtype: str = "int64"
    n_pairs: int | None = None  # the exact answer, a pair at the cutoff included
    want: float | None = None  # time of the fastest peer over ours
    limits: tuple[Limit, ...] = ()
    peers: tuple[str, ...] = LIST_PEERS

    @property
    def n(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def dim(self) -> int:
        """Number of coordinates of a point."""
        return int(self.points.shape[1])

    @property
    def rows(self) -> Floats | None:
        """The box as row vectors, shape (d, d)."""
        if self.box is None or self.box.ndim == 2:
            return self.box
        return np.diag(self.box)

    @property
    def orthorhombic(self) -> bool:
        """Whether the box is absent or along the coordinate axes."""
        return self.rows is None or not np.any(self.rows - np.diag(np.diag(self.rows)))

    @property
    def has_images(self) -> bool:
        """Whether a pair of points may be within the cutoff in more than one image."""
        if self.rows is None:
            return False
        heights = 1.0 / np.linalg.norm(np.linalg.inv(self.rows), axis=0)
        return bool(np.any(heights[list(self.periodic)] <= 2.0 * self.cutoff))

    def digest(self) -> str:
        """SHA-256 of everything that decides the answer, as hexadecimal digits."""
        state = hashlib.sha256()
        for array in (self.points, np.float64(self.cutoff), self.rows, np.array(self.periodic)):
            state.update(b"none" if array is None else np.ascontiguousarray(array).tobytes())
        return state.hexdigest()

    def bytes_of_output(self) -> int:
        """Bytes of our result, 0 when the number of pairs is not known."""
        if self.task == "count" or self.n_pairs is None:
            return 0
        width = np.dtype(self.index_dtype).itemsize
        size = {"i": width, "j": width, "P": 2 * width, "d": 8, "D": 8 * self.dim}
        return self.n_pairs * sum(size.get(letter, 4 * self.dim) for letter in self.quantities)


SCENES: dict[str, Callable[[], Scene]] = {}

QUICK = ("call-2", "molecule-30", "images-64", "silicon-8", "pairs-1e4-k52", "fcc-shell")


def load(name: str) -> Scene:
    """Build the scene of this name. Raises KeyError with the names that there are."""
    if name not in SCENES:
        raise KeyError(f"no scene {name!r}; there are {', '.join(SCENES)}")
    return SCENES[name]()


def _register(make: Callable[[], Scene]) -> Callable[[], Scene]:
    """Add a scene under its function's name, underscores written as hyphens."""
    SCENES[make.__name__.replace("_", "-")] = make
    return make


def _uniform(seed: int, n: int, dim: int) -> Floats:
    return np.random.RandomState(seed).random_sample((n, dim))


def _cube(name: str, stresses: str, n: int, length: float, cutoff: float, **rest: Any) -> Scene:
    """Points uniform in a periodic cube of density 0.1."""
    points = _uniform(20260101, n, 3) * length
    return Scene(name, stresses, points, cutoff, np.full(3, length), (True,) * 3, **rest)


# One precision above the others: how much the exact decision may cost.
_EXACT_COST = Limit("variant", 1.03, {"precision": "single"})
_CRYSTAL_COST = Limit("variant", 2.0, {"precision": "single"})


@_register
def pairs_1e5_k52() -> Scene:
    """Make the main figure: a large uniform periodic box, int64 indices."""
    return _cube(
        "pairs-1e5-k52", "everything at once: bins, search, output of int64",
        100_000, 100.0, 5.0, n_pairs=2_618_897, want=20.0,
        limits=(_EXACT_COST, Limit("floor", 3.0)),
    )  # fmt: skip


@_register
def pairs_1e5_k52_int32() -> Scene:
    """Make the main figure with indices half as wide."""
    return replace(
        pairs_1e5_k52(), name="pairs-1e5-k52-int32", stresses="the same with half the output",
        index_dtype="int32", want=30.0,
    )  # fmt: skip


@_register
def pairs_1e5_k419() -> Scene:
    """Make a box with many neighbours a point: output and hit rate decide."""
    return _cube(
        "pairs-1e5-k419", "output: 21 million pairs, fresh pages",
        100_000, 100.0, 10.0, n_pairs=20_940_722, want=25.0,
        limits=(_EXACT_COST, Limit("floor", 1.8)),
        peers=tuple(name for name in LIST_PEERS if name not in ("ase", "pymatgen", "freud")),
    )  # fmt: skip


@_register
def pairs_1e5_k419_int32() -> Scene:
    """Make the box of many neighbours with indices half as wide."""
    return replace(
        pairs_1e5_k419(), name="pairs-1e5-k419-int32", stresses="the same with half the output",
        index_dtype="int32", want=35.0,
    )  # fmt: skip


@_register
def pairs_1e4_k52() -> Scene:
    """Make the main figure at a size that fits the cache."""
    return _cube(
        "pairs-1e4-k52", "a medium box: cache-resident points",
        10_000, 46.4159, 5.0, n_pairs=261_983, want=25.0, limits=(_EXACT_COST,),
    )  # fmt: skip


@_register
def vectors_1e5_k52() -> Scene:
    """Make the main figure with all five quantities."""
    return replace(
        pairs_1e5_k52(), name="vectors-1e5-k52", stresses="distances, vectors and shifts",
        quantities="ijdDS", want=15.0, limits=(),
    )  # fmt: skip


@_register
def triclinic_1e4_k52() -> Scene:
    """Make a tilted box of the same volume as the cube of 10 000 points."""
    rows = np.array([[50.0, 0.0, 0.0], [-12.0, 47.0, 0.0], [9.0, -14.0, 42.5532]])
    parts = _uniform(20260102, 10_000, 3)
    points = sum(parts[:, [axis]] * rows[axis] for axis in range(3))
    return Scene(
        "triclinic-1e4-k52", "a tilted box: fractions, compensated wrap, tilted stencil",
        points, 5.0, rows, (True,) * 3, n_pairs=261_536,
        limits=(Limit("scene", 1.15, other="pairs-1e4-k52"),),
    )  # fmt: skip


@_register
def open_1e4() -> Scene:
    """Make a scene without a box."""
    return Scene(
        "open-1e4", "open space: bounds instead of a box, no shifts",
        _uniform(20260103, 10_000, 3) * 46.4159, 5.0, n_pairs=230_420, want=20.0,
    )  # fmt: skip


@_register
def plane_1e5_k20() -> Scene:
    """Make a scene in two dimensions."""
    return Scene(
        "plane-1e5-k20", "two dimensions, few neighbours: work per point",
        _uniform(20260104, 100_000, 2) * 1000.0, 7.9788, np.full(2, 1000.0), (True,) * 2,
        n_pairs=998_115, want=20.0,
    )  # fmt: skip


@_register
def clusters_1e5() -> Scene:
    """Make dense clusters in much empty space."""
    centres = _uniform(20260105, 300, 3) * 1000.0
    drawn = _uniform(20260106, 100_000, 5)
    size = 4.0 + 36.0 * drawn[:, [4]] * drawn[:, [4]]
    offset = 2.0 * drawn[:, :3] - 1.0
    points = centres[(drawn[:, 3] * 300.0).astype(np.int64)] + size * offset * offset * offset
    return Scene(
        "clusters-1e5", "uneven density: 300 peaked clusters, most space empty",
        points, 0.405, n_pairs=35_924, want=12.0,
    )  # fmt: skip


@_register
def count_1e5_k52() -> Scene:
    """Make the main figure, counted without a list."""
    return replace(
        pairs_1e5_k52(), name="count-1e5-k52", stresses="distance tests alone, no output",
        task="count", want=40.0, limits=(), peers=COUNT_PEERS,
    )  # fmt: skip


@_register
def count_1e5_k419() -> Scene:
    """Make the box of many neighbours, counted without a list."""
    return replace(
        pairs_1e5_k419(), name="count-1e5-k419", stresses="distance tests at a high hit rate",
        task="count", want=12.0, limits=(), peers=COUNT_PEERS,
    )  # fmt: skip


@_register
def call_2() -> Scene:
    """Make a scene that shows what a call costs before it does anything."""
    return Scene(
        "call-2", "the overhead of a call: arguments, binding, result",
        np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), 2.0, n_pairs=1,
        limits=(Limit("seconds", 3e-6),), peers=("neighborlist-rs", "vesin", "cKDTree"),
    )  # fmt: skip


@_register
def molecule_30() -> Scene:
    """Make a molecule: one short call."""
    return Scene(
        "molecule-30", "a short call: overhead and the all-pairs path",
        _uniform(20260107, 30, 3) * 6.7, 5.0, n_pairs=254, want=2.0,
    )  # fmt: skip


@_register
def images_64() -> Scene:
    """Make a box shorter than two cutoffs."""
    return Scene(
        "images-64", "several images of one pair in a small box",
        _uniform(20260108, 64, 3) * 8.62, 5.0, np.full(3, 8.62), (True,) * 3,
        quantities="ijS", n_pairs=1619, want=5.0,
    )  # fmt: skip


@_register
def silicon_8() -> Scene:
    """Make a unit cell, the cutoff more than twice its length."""
    points, box = _crystal(_DIAMOND, 1, 5.43)
    return Scene(
        "silicon-8", "a unit cell: many images, each point paired with its own",
        points, 12.0, box, (True,) * 3, quantities="ijS", n_pairs=1424, want=4.0,
    )  # fmt: skip


_FCC = np.array([[0, 0, 0], [0, 2, 2], [2, 0, 2], [2, 2, 0]])
_DIAMOND = np.concatenate([_FCC, _FCC + 1])


def _crystal(basis: NDArray[np.int64], repeats: int, constant: float) -> tuple[Floats, Floats]:
    """Make a cubic crystal; `basis` is in quarters of the lattice constant."""
    cells = np.stack(np.meshgrid(*[np.arange(repeats)] * 3, indexing="ij"), axis=-1)
    sites = (4 * cells.reshape(-1, 1, 3) + basis).reshape(-1, 3)
    lengths: Floats = np.full(3, repeats * constant)
    points: Floats = sites.astype(np.float64) * (constant / 4.0)
    return points, lengths


@_register
def fcc_shell() -> Scene:
    """Make a crystal with one shell within rounding of the cutoff, on either side of it."""
    points, box = _crystal(_FCC, 14, 4.05)
    return Scene(
        "fcc-shell", "a shell within rounding of the cutoff: the later stages decide",
        points, 8.1, box, (True,) * 3, n_pairs=753_032, limits=(_CRYSTAL_COST,),
    )  # fmt: skip


@_register
def fcc_tie() -> Scene:
    """Make a crystal of integers: one shell lies at exactly the cutoff."""
    points, box = _crystal(_FCC, 14, 4.0)
    return Scene(
        "fcc-tie", "a shell at exactly the cutoff: the last stage, and the tie rule",
        points, 8.0, box, (True,) * 3, n_pairs=768_320, limits=(_CRYSTAL_COST,),
    )  # fmt: skip


@_register
def diamond_shell() -> Scene:
    """Make a second crystal, whose shell mixes steps that round differently."""
    points, box = _crystal(_DIAMOND, 12, 5.431)
    return Scene(
        "diamond-shell", "a shell within rounding of the cutoff, more neighbours",
        points, 10.862, box, (True,) * 3, n_pairs=1_917_216, limits=(_CRYSTAL_COST,),
    )  # fmt: skip


def _growth(name: str, stresses: str, at_most: float, ordered: bool) -> Scene:
    """Make the main figure a hundred times as large: 2 GB of output a call."""
    points = _uniform(20260109, 10_000_000, 3) * 464.159
    if ordered:
        x, y, z = (points // 4.64159).astype(np.int64).T
        points = points[np.argsort((z * 100 + y) * 100 + x, kind="stable")]
    return Scene(
        name, stresses, points, 5.0, np.full(3, 464.159), (True,) * 3, index_dtype="int32",
        limits=(Limit("growth", at_most, other="pairs-1e5-k52-int32"),), peers=(),
    )  # fmt: skip


@_register
def growth_1e7() -> Scene:
    """Make ten million points in random order."""
    return _growth("growth-1e7", "points far apart in memory: bins beyond the cache", 1.5, False)


@_register
def growth_1e7_sorted() -> Scene:
    """Make ten million points in the order of a coarse grid."""
    return _growth("growth-1e7-sorted", "ten million points in a friendly order", 1.2, True)
