# SPDX-License-Identifier: BSD-3-Clause
"""Other libraries that list pairs, with one adapter for each: report, `verify`, benchmarks.

An adapter runs its library on one thread, in the cheapest mode that gives the same answer:
half lists where there are any, indices alone where only indices are wanted, and input of
the type that the library works on, converted beforehand. Whatever a caller has to do for each
new set of points (building a tree or a grid) is part of the call. The first line of its class
tells the method, whether its lists are half or full, and its rule at exactly the cutoff (strict:
such a pair is left out). pykdtree has no adapter: it finds nearest neighbours only.

Libraries are imported when they are first used; a missing one is reported, not an error.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["LIBRARIES", "Call", "Library", "Question", "in_space", "pin_threads", "wrapped"]

Call = Callable[[], Any]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Question:
    """The pairs of which points, in which box. Other classes with these attributes will do.

    `task` is "pairs" or "count"; `batch` numbers the system of each point, or is None. With
    `radii`, one a point, pairs are those of balls that touch; with `supports` H, a matrix a point,
    those with ``|H D| <= extent`` for either point, or by the `rule` "min" for both. No reach
    passes the cutoff.
    """

    points: Floats  # (n, d)
    cutoff: float
    rows: Floats | None = None  # the box as row vectors (d, d), or None: open space
    periodic: tuple[bool, ...] = ()
    quantities: str = "ij"
    task: str = "pairs"
    batch: Any = None
    radii: Floats | None = None
    supports: Floats | None = None
    extent: float | None = None
    rule: str | None = None

    @property
    def n(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def dim(self) -> int:
        """Number of coordinates of a point."""
        return int(self.points.shape[1])

    @property
    def box(self) -> Floats | None:
        """The box again, under the name that tells open space."""
        return self.rows

    @property
    def orthorhombic(self) -> bool:
        """Whether the box vectors that repeat are along the coordinate axes."""
        if self.rows is None:
            return True
        rows = self.rows * ~np.eye(self.dim, dtype=np.bool_)
        return not np.any(rows[list(self.periodic)])

    @property
    def has_images(self) -> bool:
        """Whether a pair of points may be within the cutoff in more than one image."""
        if self.rows is None or not any(self.periodic):
            return False
        rows = self.rows[list(self.periodic)]
        sizes = np.abs(rows).max(axis=1)  # so that no square overflows or vanishes
        units = rows / sizes[:, None]
        duals = np.linalg.solve(units @ units.T, units)
        heights = 1.0 / np.linalg.norm(duals, axis=1)  # in sizes
        return bool(np.any(heights / 2.0 <= self.cutoff / sizes))


class Library(ABC):
    """What is known about a library, and how it is called.

    A question is a `Question` or a scene of the benchmarks.
    """

    name: ClassVar[str]
    distribution: ClassVar[str]
    module: ClassVar[str]
    inclusive: ClassVar[bool] = False  # whether a pair at exactly the cutoff counts
    full: ClassVar[bool] = False  # whether a pair comes in both directions
    own_images_twice: ClassVar[bool] = False  # whether (i, i, S) does, in a half list
    quantities: ClassVar[str] = "ij"
    dims: ClassVar[tuple[int, ...]] = (3,)
    flat: ClassVar[bool] = False  # whether a plane can be given as a slab open in z
    open_space: ClassVar[bool] = True
    some_axes: ClassVar[bool] = True  # whether only some axes may repeat
    triclinic: ClassVar[bool] = True
    images: ClassVar[bool] = True
    radii: ClassVar[bool] = False  # whether points may have one each, and touch by their sum
    supports: ClassVar[bool] = False  # whether points may have one each
    inside: ClassVar[bool] = False  # whether points must lie in the box
    counts_alone: ClassVar[bool] = False  # no list of pairs at all
    float_bits: ClassVar[int] = 53
    tolerance: ClassVar[float] = 0.0  # relative, beyond rounding
    remark: ClassVar[str] = ""  # what a reader of its errors should know
    remark_on_radii: ClassVar[str] = ""  # and of those where points have radii
    remark_on_supports: ClassVar[str] = ""  # or supports

    def version(self) -> str | None:
        """Return the installed version, None where it is missing or cannot be imported."""
        try:
            importlib.import_module(self.module)
            return importlib.metadata.version(self.distribution)
        except ImportError:
            return None

    def refuses(self, question: Any) -> str | None:
        """Say what of the question this library does not offer, or return None."""
        if question.dim not in self.dims and not (question.dim < 3 and self.flat):
            return f"{question.dim} dimension{'s' if question.dim > 1 else ''}"
        if question.box is None and not self.open_space:
            return "open space"
        if question.box is not None and not self.some_axes and not all(question.periodic):
            return "some axes periodic, some open"
        if not question.orthorhombic and not self.triclinic:
            return "triclinic box"
        if question.has_images and not self.images:
            return "several images of one pair"
        if question.radii is not None and not self.radii:
            return "a radius for each point"
        if question.supports is not None and not self.supports:
            return "a support for each point"
        if question.task == "count":
            return None
        lacking = set(question.quantities) - set(self.quantities)
        if lacking or self.counts_alone:
            return f"quantities {''.join(sorted(lacking)) or question.quantities}"
        return None

    @abstractmethod
    def prepare(self, question: Any) -> Call:
        """Convert the input, and return the call that is to be timed."""

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return i and j of a result. Default: the first two arrays."""
        return result[0], result[1]

    def shifts(self, result: Any) -> Any:
        """Return S of a result for quantities "ijS" or "ijdDS". Default: the last array."""
        return result[-1]

    def distances(self, result: Any) -> Any:
        """Return d of a result for quantities that begin with "ijd". Default: the third."""
        return result[2]

    def vectors(self, result: Any) -> Any:
        """Return D of a result for quantities that begin with "ijdD". Default: the fourth."""
        return result[3]


def pin_threads() -> None:
    """Hold every library to one thread. To be called before any of them is imported."""
    for name in ("OMP", "RAYON", "OPENBLAS", "MKL", "NUMEXPR", "NUMBA", "TBB"):
        os.environ[f"{name}_NUM_THREADS"] = "1"


def in_space(question: Any) -> tuple[Floats, Floats | None, list[bool]]:
    """Points, rows of the box and periodic axes, what is flat laid at 0 in a slab open there."""
    rows, periodic = question.rows, list(question.periodic) or [False] * question.dim
    if question.dim == 3:
        return question.points, rows, periodic
    open_axes = 3 - question.dim
    points = np.zeros((question.n, 3))
    points[:, : question.dim] = question.points
    if rows is None:
        return points, None, [False] * 3
    slab = np.diag(np.full(3, 2.0 * question.cutoff or 1.0))
    slab[: question.dim, : question.dim] = rows
    return points, slab, [*periodic, *[False] * open_axes]


def wrapped(question: Question) -> tuple[Question, bool]:
    """Fold points into the box in float64; return whether any was outside."""
    if question.rows is None or not any(question.periodic):
        return question, False
    periodic = np.array(question.periodic)
    points = question.points
    if question.orthorhombic:
        lengths = np.where(periodic, np.diag(question.rows), 1.0)
        outside = periodic & ((points < 0.0) | (points >= lengths))
        folded = points - np.floor(points / lengths) * lengths
        folded[folded >= lengths] = 0.0  # rounded up to the face
        folded[folded < 0.0] = 0.0
        folded = np.where(outside, folded, points)
    else:
        rows = question.rows[periodic]
        size = np.abs(rows).max()
        turns = np.floor((points / size) @ np.linalg.pinv(rows / size))
        outside = turns != 0.0
        folded = points - turns @ rows
    return (replace(question, points=folded), True) if outside.any() else (question, False)


class Vesin(Library):
    """vesin: cell list, half lists; strict."""

    name = distribution = module = "vesin"
    quantities = "ijdDS"
    flat = True

    def prepare(self, question: Any) -> Call:
        """Keep one calculator, as its documentation advises."""
        vesin = importlib.import_module("vesin")
        points, rows, periodic = in_space(question)
        rows = np.zeros((3, 3)) if rows is None else rows
        search = vesin.NeighborList(cutoff=question.cutoff, full_list=False, n_threads=1)
        wanted = "i" if question.task == "count" else question.quantities
        call = partial(search.compute, points, rows, periodic, wanted)
        return call if question.task == "pairs" else lambda: len(call()[0])


class CKDTree(Library):
    """SciPy: k-d tree, half lists; inclusive; points inside the box, one image of a pair."""

    name = "cKDTree"
    distribution = "scipy"
    module = "scipy.spatial"
    inclusive = True
    dims = tuple(range(1, 9))
    triclinic = False
    images = False
    inside = True
    radii = True
    remark_on_radii = (
        "all pairs within the largest reach, then distances in float64 against rounded sums"
    )
    supports = True
    remark_on_supports = "all pairs within the largest reach, then |H D| in float64"

    def tree(self, question: Any, points: Any) -> Call:
        """Return what builds the cheaper, unbalanced tree of points."""
        tree = importlib.import_module("scipy.spatial").cKDTree
        lengths = None
        if question.rows is not None:
            lengths = np.where(question.periodic, np.diag(question.rows), 0.0)
        return partial(tree, points, boxsize=lengths, balanced_tree=False, compact_nodes=False)

    def prepare(self, question: Any) -> Call:
        """Build a tree and query it."""
        build = self.tree(question, question.points)
        if question.task == "count":

            def count() -> int:
                built = build()
                return int(built.count_neighbors(built, question.cutoff) - question.n) // 2

            return count
        if question.radii is None and question.supports is None:
            return lambda: build().query_pairs(question.cutoff, output_type="ndarray")
        return lambda: reached(
            question, build().query_pairs(question.cutoff, output_type="ndarray")
        )

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return the columns of its (m, 2) array."""
        return result[:, 0], result[:, 1]


class NeighborlistRs(Library):
    """neighborlist-rs: cells, half lists with shifts; strict; box vectors are columns."""

    name = "neighborlist-rs"
    distribution = "neighborlist-rs"
    module = "neighborlist_rs"
    quantities = "ijS"
    own_images_twice = True
    remark = "a point's own images come in both directions, other pairs once"

    def prepare(self, question: Any) -> Call:
        """Make its box beforehand; without threads."""
        library = importlib.import_module("neighborlist_rs")
        library.set_num_threads(1)
        cell = None
        if question.rows is not None:
            cell = library.PyCell(question.rows.T.tolist(), [bool(x) for x in question.periodic])
        call = partial(
            library.build_neighborlists, cell, question.points, question.cutoff, parallel=False
        )
        return call if question.task == "pairs" else lambda: call()["edge_index"].shape[1]

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return the rows of its (2, m) array."""
        return tuple(result["edge_index"])

    def shifts(self, result: Any) -> Any:
        """Return its shifts."""
        return result["shift"]


class MatscipyNeighbours(Library):
    """matscipy-neighbours: cells, full lists of int32; strict."""

    name = distribution = "matscipy-neighbours"
    module = "matscipy_neighbours"
    full = True
    quantities = "ijdDS"
    flat = True
    radii = True

    def prepare(self, question: Any) -> Call:
        """Return its call on explicit arrays."""
        library = importlib.import_module(self.module)
        points, rows, periodic = in_space(question)
        return partial(
            library.neighbour_list, question.quantities, positions=points, cell=rows,
            pbc=periodic, cutoff=question.cutoff if question.radii is None else question.radii,
        )  # fmt: skip


class Matscipy(MatscipyNeighbours):
    """matscipy: the same call, from the older package; full lists of int32; strict."""

    name = distribution = "matscipy"
    module = "matscipy.neighbours"


class Ase(Library):
    """ASE: cells in NumPy, full lists; strict."""

    name = distribution = module = "ase"
    full = True
    quantities = "ijdDS"
    flat = True
    radii = True

    def prepare(self, question: Any) -> Call:
        """Return its call on explicit arrays, without an Atoms object."""
        library = importlib.import_module("ase.neighborlist")
        points, rows, periodic = in_space(question)
        rows = np.zeros((3, 3)) if rows is None else rows
        return partial(
            library.primitive_neighbor_list, question.quantities, periodic, rows, points,
            question.cutoff if question.radii is None else question.radii,
        )  # fmt: skip


class MDAnalysis(Library):
    """MDAnalysis: grid or tree, half lists; float32 coordinates; inclusive; one image."""

    name = distribution = module = "MDAnalysis"
    inclusive = True
    images = False
    some_axes = False
    float_bits = 24
    quantities = "ijd"
    remark = "takes float32 coordinates and a box of lengths and angles"

    def refuses(self, question: Any) -> str | None:
        """Refuse a box that its six numbers cannot express too."""
        rows = question.rows
        reason = super().refuses(question)
        if reason is None and rows is not None and rows.ndim == 2 and (
            np.any(np.triu(rows, 1)) or np.any(np.diag(rows) <= 0.0)
        ):  # fmt: skip
            return "box not lower triangular"
        return reason

    def prepare(self, question: Any) -> Call:
        """Give it float32 points and its six box numbers."""
        library = importlib.import_module("MDAnalysis.lib.distances")
        points, rows, _ = in_space(question)
        box = None
        if rows is not None:
            box = importlib.import_module("MDAnalysis.lib.mdamath").triclinic_box(*rows)
        return partial(
            library.self_capped_distance, points.astype(np.float32), question.cutoff, box=box,
            return_distances="d" in question.quantities,
        )  # fmt: skip

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return the columns of its (m, 2) array."""
        pairs = result[0] if isinstance(result, tuple) else result
        return pairs[:, 0], pairs[:, 1]

    def distances(self, result: Any) -> Any:
        """Return what stands beside its array."""
        return result[1]


class Freud(Library):
    """freud: tree of boxes, full lists; float32; strict; one image of a pair."""

    name = "freud"
    distribution = "freud-analysis"
    module = "freud"
    full = True
    dims = (2, 3)
    images = False
    inside = True
    float_bits = 24
    quantities = "ijdD"
    remark = "computes in float32; without a box its points are centred in one beforehand"

    def library(self) -> Any:
        """Return the library, told to use one thread."""
        freud = importlib.import_module("freud")
        freud.parallel.set_num_threads(1)
        return freud

    def prepare(self, question: Any) -> Call:
        """Use its tree, faster than its cell list; open space is a wide box round the origin."""
        freud = self.library()
        given, rows = question.points, question.rows
        if rows is None:
            low, high = given.min(axis=0), given.max(axis=0)
            given = given - (low + 0.5 * (high - low))
            length = (high - low).max() + 3.0 * question.cutoff
            box = {2: freud.box.Box.square, 3: freud.box.Box.cube}[question.dim](length)
        else:
            box = freud.box.Box.from_matrix(columns(rows))
        points = np.zeros((question.n, 3), dtype=np.float32)
        points[:, : question.dim] = given
        if rows is not None and not all(question.periodic):
            box.periodic = [*question.periodic, *[False] * (3 - question.dim)]
        arguments = {"r_max": question.cutoff, "exclude_ii": True}
        tree = freud.locality.AABBQuery
        return lambda: tree(box, points).query(points, arguments).toNeighborList()

    def refuses(self, question: Any) -> str | None:
        """Refuse a box that is not in its lower-triangular form too."""
        reason = super().refuses(question)
        if reason is None and question.rows is not None and np.any(np.triu(question.rows, 1)):
            return "box not lower triangular"
        return reason

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return the columns of its (m, 2) array."""
        return result[:][:, 0], result[:][:, 1]

    def distances(self, result: Any) -> Any:
        """Return its distances, which are float32."""
        return result.distances

    def vectors(self, result: Any) -> Any:
        """Return its vectors, which are float32 and always have three components."""
        return result.vectors


def columns(rows: Floats) -> Floats:
    """Box vectors as the columns of a 3 by 3 matrix, with a height of 0 for a plane."""
    matrix = np.zeros((3, 3))
    matrix[: len(rows), : len(rows)] = rows.T
    return matrix


class Pymatgen(Library):
    """pymatgen: cells, full lists with each point itself; a tolerance at the cutoff."""

    name = distribution = module = "pymatgen"
    inclusive = True
    full = True
    quantities = "ijdS"
    open_space = False
    tolerance = 1e-8
    remark = "keeps pairs up to 1e-8 beyond the cutoff on purpose; they count as spurious"

    def prepare(self, question: Any) -> Call:
        """Call the compiled function beneath its structures."""
        search = importlib.import_module("pymatgen.optimization.neighbors")
        points, rows, periodic = in_space(question)
        return partial(
            search.find_points_in_spheres, points, points, question.cutoff,
            np.array(periodic, dtype=np.int64), np.ascontiguousarray(rows),
        )  # fmt: skip

    def _others(self, result: Any) -> NDArray[np.bool_]:
        """Mark what is left without each point itself."""
        others: NDArray[np.bool_] = result[0] != result[1]
        others |= (result[2] != 0.0).any(axis=1)
        return others

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return both indices without each point itself."""
        others = self._others(result)
        return result[0][others], result[1][others]

    def shifts(self, result: Any) -> Any:
        """Return its shifts, which are floats, without each point itself."""
        return np.rint(result[2][self._others(result)])

    def distances(self, result: Any) -> Any:
        """Return its distances without each point itself."""
        return result[3][self._others(result)]


class NumPy(Library):
    """NumPy: |H D| of all pairs in float64, where points have supports; inclusive; one image."""

    name = "NumPy"
    distribution = module = "numpy"
    inclusive = True
    dims = (1, 2, 3)
    triclinic = False
    images = False
    radii = True
    supports = True
    remark_on_supports = "|H D| of all pairs in float64"
    most_points = 10_000

    def refuses(self, question: Any) -> str | None:
        """Refuse what cKDTree does with the same arithmetic, and what would take minutes."""
        if question.supports is None:
            return "distances, for which cKDTree stands"
        if question.n > self.most_points:
            return f"more than {self.most_points:,} points, of which it looks at all pairs"
        return super().refuses(question)

    def prepare(self, question: Any) -> Call:
        """Return what looks at the points row by row."""
        found = partial(all_reached, question)
        return found if question.task == "pairs" else lambda: len(found())

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return the columns of its (m, 2) array."""
        return result[:, 0], result[:, 1]


LIBRARIES: dict[str, Library] = {
    library.name: library
    for library in (
        Vesin(),
        CKDTree(),
        NeighborlistRs(),
        MatscipyNeighbours(),
        Matscipy(),
        MDAnalysis(),
        Freud(),
        Pymatgen(),
        Ase(),
        NumPy(),
    )
}


_AT_ONCE = 1 << 18  # candidates: some tens of megabytes


def reached(question: Any, pairs: NDArray[Any]) -> NDArray[Any]:
    """Those of the candidates, shape (m, 2), that reach each other by radii or supports."""
    kept = [pairs[:0]]
    for first in range(0, len(pairs), _AT_ONCE):
        part = pairs[first : first + _AT_ONCE]
        i, j = part[:, 0], part[:, 1]
        vectors = question.points[j] - question.points[i]
        if question.rows is not None:
            lengths = np.where(question.periodic, np.diag(question.rows), 0.0)
            turns = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)
            vectors -= np.rint(turns) * lengths
        if question.radii is not None:
            reach = question.radii[i] + question.radii[j]
            within = np.linalg.norm(vectors, axis=1) <= reach
        else:
            sides = [
                np.linalg.norm(np.einsum("kab,kb->ka", question.supports[k], vectors), axis=1)
                <= question.extent
                for k in (i, j)
            ]
            within = sides[0] & sides[1] if question.rule == "min" else sides[0] | sides[1]
        kept.append(part[within])
    return np.concatenate(kept)


def all_reached(question: Any) -> NDArray[Any]:
    """All pairs that reach each other, shape (m, 2)."""
    n, rows = question.n, max(_AT_ONCE // max(question.n, 1), 1)
    kept = [np.empty((0, 2), dtype=np.int64)]
    for first in range(0, n, rows):
        i, j = np.triu_indices(min(rows, n - first), 1, n - first)
        kept.append(reached(question, np.column_stack([i, j]) + first))
    return np.concatenate(kept)
