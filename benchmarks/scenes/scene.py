# SPDX-License-Identifier: BSD-3-Clause
"""What a scene is: an input, the question asked about it, and what the answer should cost.

A scene is a function that makes it and a name; it is built when it is asked for. `known.csv` holds
the number of pairs and the first digits of the digest of every scene up to a million points.
`benchmarks/check_scenes.py` counts the pairs by other means and compares.
"""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "COUNT_PEERS", "FAST_PEERS", "GROUPS", "HISTOGRAM_PEERS", "LIST_PEERS", "NEAREST_PEERS",
    "REACH_PEERS", "SCENES", "TITLES", "Floats", "Limit", "Scene", "add", "known", "load",
]  # fmt: skip

Floats = NDArray[np.float64]

LIST_PEERS = (
    "vesin",
    "cKDTree",
    "neighborlist-rs",
    "matscipy-neighbours",
    "linkcell",
    "MDAnalysis",
    "pymatgen",
    "freud",
    "ase",
)
# Enough for families of many scenes: one of these was the fastest wherever all were measured.
FAST_PEERS = ("vesin", "cKDTree", "neighborlist-rs", "pymatgen")
HISTOGRAM_PEERS = ("Corrfunc", "cKDTree", "freud")
NEAREST_PEERS = ("pykdtree", "cKDTree", "freud")
REACH_PEERS = ("cKDTree", "matscipy-neighbours", "ase")
COUNT_PEERS = ("Corrfunc", "cKDTree", "vesin", "neighborlist-rs")


@dataclass(frozen=True)
class Limit:
    """Something of our own that a scene is held against.

    kind
        ``"variant"``: the same call with other `options`. ``"scene"``: our call on `other`,
        each per pair. ``"growth"``: our call on `other`, each per point. ``"floor"``: writing
        as many bytes once into new memory. ``"rewrite"``: writing them into memory in use,
        compared with recycled results. ``"seconds"``: the time of one call itself.
    at_most
        Largest ratio of our time to the other's (``"seconds"``: largest time). None: the
        ratio is reported and nothing is wanted of it.
    """

    kind: Literal["variant", "scene", "growth", "floor", "rewrite", "seconds"]
    at_most: float | None
    options: Mapping[str, Any] = field(default_factory=dict)
    other: str = ""

    @property
    def label(self) -> str:
        """A name for tables, which also tells limits of one scene apart."""
        if self.kind == "variant":
            return ",".join(f"{key}={value}" for key, value in self.options.items())
        fixed = {"floor": "writing the output", "rewrite": "rewriting the output",
                 "seconds": "one call"}  # fmt: skip
        return fixed.get(self.kind, self.other)


@dataclass(frozen=True, eq=False)
class Scene:
    """One input, what is asked about it, and what the answer should cost.

    With `batch` the points are those of several systems, one after the other, and pairs are
    sought within each; the box is then of shape (systems, d, d), or None. The task "between" takes
    the first `n_queries` points as queries, and pairs them with the others. With `radii` or `types`
    each pair has a reach of its own, and the cutoff is at least the largest.
    """

    name: str
    stresses: str
    points: Floats  # (n, d)
    cutoff: float
    box: Floats | None = None  # lengths (d,), row vectors (d, d), or None: open space
    periodic: tuple[bool, ...] = ()
    task: Literal["pairs", "count", "rows", "between", "nearest"] = "pairs"
    quantities: str = "ij"
    index_dtype: str = "int64"
    n_pairs: int | None = None  # the exact answer, a pair at the cutoff included
    about_pairs: float = 0.0  # an estimate, where the answer is not known
    want: float | None = None  # time of the fastest peer over ours
    limits: tuple[Limit, ...] = ()
    peers: tuple[str, ...] = LIST_PEERS
    batch: NDArray[np.int64] | None = None  # (n,) ascending numbers of systems
    radii: Floats | None = None  # (n,)
    rule: str = "sum"  # or "max", what is made of two radii
    supports: Floats | None = None  # (n, d, d); those of the report have some
    types: NDArray[np.int32] | None = None  # (n,)
    table: Floats | None = None  # (t, t), cutoffs by type
    n_queries: int = 0
    nearest: int = 0  # with the task "nearest": so many of each point; there is no cutoff
    bins: int = 0  # with the task "count": so many bins of equal width, or one number
    threads: int = 1
    latency: bool = False  # whether single calls are timed one by one as well

    @property
    def n(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def asking(self) -> Floats:
        """The queries."""
        return self.points[: self.n_queries]

    @property
    def found(self) -> Floats:
        """The points that are paired with queries."""
        return self.points[self.n_queries :]

    @property
    def dim(self) -> int:
        """Number of coordinates of a point."""
        return int(self.points.shape[1])

    @property
    def rows(self) -> Floats | None:
        """The box as row vectors, shape (d, d), or (systems, d, d) with `batch`."""
        if self.box is None or self.box.ndim > 1:
            return self.box
        return np.diag(self.box)

    def rows_at(self, point: int) -> Floats | None:
        """Return the box of the system that a point belongs to, as row vectors."""
        if self.rows is None or self.batch is None:
            return self.rows
        rows: Floats = self.rows[self.batch[point]]
        return rows

    @property
    def orthorhombic(self) -> bool:
        """Whether the box is absent or along the coordinate axes."""
        if self.rows is None:
            return True
        return not np.any(self.rows[..., ~np.eye(self.dim, dtype=np.bool_)])

    @property
    def has_images(self) -> bool:
        """Whether a pair of points may be within the cutoff in more than one image."""
        if self.rows is None:
            return False
        heights = 1.0 / np.linalg.norm(np.linalg.inv(self.rows), axis=-2)
        return bool(np.any(heights[..., list(self.periodic)] <= 2.0 * self.cutoff))

    @property
    def has_reach(self) -> bool:
        """Whether each pair has a reach of its own."""
        return self.radii is not None or self.types is not None

    def reach(self, i: int, j: int) -> tuple[float, ...]:
        """Return the numbers whose sum is the reach of a pair."""
        if self.table is not None and self.types is not None:
            return (float(self.table[self.types[i], self.types[j]]),)
        if self.radii is None:
            return (self.cutoff,)
        both = float(self.radii[i]), float(self.radii[j])
        return both if self.rule == "sum" else (max(both),)

    def systems(self) -> list[Scene]:
        """Return a scene for each system of a batch, or this scene alone."""
        if self.batch is None:
            return [self]
        ends = np.searchsorted(self.batch, np.arange(int(self.batch[-1]) + 2))
        return [
            replace(
                self, points=self.points[ends[k] : ends[k + 1]], batch=None, n_pairs=None,
                box=None if self.box is None else self.box[k],
            )
            for k in range(len(ends) - 1)
        ]  # fmt: skip

    def digest(self) -> str:
        """SHA-256 of everything that decides the answer, as hexadecimal digits."""
        state = hashlib.sha256()
        for array in (self.points, np.float64(self.cutoff), self.rows, np.array(self.periodic)):
            state.update(b"none" if array is None else np.ascontiguousarray(array).tobytes())
        if self.batch is not None:
            state.update(self.batch.tobytes())
        for array in (self.radii, self.types, self.table):
            if array is not None:
                state.update(array.tobytes() + self.rule.encode())
        if self.n_queries > 0:
            state.update(str(self.n_queries).encode())
        if self.nearest > 0:
            state.update(f"nearest {self.nearest}".encode())
        return state.hexdigest()

    def bytes_of_output(self) -> int:
        """Bytes of our result, from an estimate when the number of pairs is not known."""
        if self.task == "count":
            return 0
        width = np.dtype(self.index_dtype).itemsize
        size = {"i": width, "j": width, "P": 2 * width, "d": 8, "D": 8 * self.dim}
        pairs = round(self.about_pairs) if self.n_pairs is None else self.n_pairs
        entries = 2 * pairs if self.task == "rows" else pairs
        offsets = 8 * (self.n + 1) if self.task == "rows" else 0
        return offsets + entries * sum(size.get(letter, 4 * self.dim) for letter in self.quantities)


# ---- names of scenes, their groups, and what is known of each beforehand ------------------------

Make = Callable[[str], Scene]

SCENES: dict[str, Make] = {}

# What the groups are for; their scenes are added by the modules of this package.
TITLES = {
    "main": "the scenes with a wanted ratio",
    "growth": "cost a point from 1e4 to 1e7 points",
    "S1": "uniform periodic cubes: neighbours 6 to 400, points 1e3 to 1e7",
    "S2": "water: molecules at the density of the liquid",
    "S3": "crystals with a shell at the cutoff, and 1e-12 beside it",
    "S4": "much empty space: slab, droplet, two distant clusters",
    "S5": "clustered points in open space",
    "S6": "contacts: close packing, grains of sizes 1 to 10",
    "S7": "two dimensions",
    "S8": "narrow angles, and boxes shorter than two cutoffs",
    "S9": "batches of small systems",
    "S10": "single calls on few points: median and 99th percentile",
    "S11": "rows of all neighbours, and two sets",
    "S12": "histograms of distances",
    "S13": "input order: random, sorted, and the worst",
    "S14": "one thread and two",
    "S15": "the k nearest points",
    "S16": "a reach for each pair, by radii or types",
}
GROUPS: dict[str, list[str]] = {group: [] for group in TITLES}


def add(group: str, name: str = "") -> Callable[[Make], Make]:
    """Register a function that makes the scene of the name that it is given.

    Without `name` the scene bears the function's name, underscores written as hyphens.
    """

    def keep(make: Make) -> Make:
        full = name or make.__name__.replace("_", "-")
        SCENES[full] = make
        GROUPS[group].append(full)
        return make

    return keep


@cache
def known() -> dict[str, tuple[int, str]]:
    """Return the number of pairs and the digits of the digest, by scene."""
    with (Path(__file__).parent / "known.csv").open(newline="", encoding="utf-8") as file:
        return {row["scene"]: (int(row["pairs"]), row["digest"]) for row in csv.DictReader(file)}


def load(name: str) -> Scene:
    """Build the scene of this name. Raises KeyError with the names that there are."""
    if name not in SCENES:
        raise KeyError(f"no scene {name!r}; there are {', '.join(SCENES)}")
    scene = SCENES[name](name)
    if name in known():
        scene = replace(scene, n_pairs=known()[name][0])
    return scene
