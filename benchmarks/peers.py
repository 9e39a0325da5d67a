# SPDX-License-Identifier: BSD-3-Clause
"""One adapter for each library that ours is measured against.

What an adapter is, and what is timed, is said in `contestant`. The first line of each class
tells the method, whether its lists are half or full, and its rule at exactly the cutoff
(strict: such a pair is left out). pykdtree has no adapter: it finds nearest neighbours only.
"""

from __future__ import annotations

import importlib
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contestant import Call, Contestant, Floats, in_space
from scenes import Scene

__all__ = ["PEERS"]


class Vesin(Contestant):
    """vesin: cell list, half lists; strict."""

    name = distribution = module = "vesin"
    quantities = "ijdDS"
    flat = True

    def prepare(self, scene: Scene) -> Call:
        """Keep one calculator, as its documentation advises."""
        vesin = importlib.import_module("vesin")
        points, rows, periodic = in_space(scene)
        rows = np.zeros((3, 3)) if rows is None else rows
        search = vesin.NeighborList(cutoff=scene.cutoff, full_list=False, n_threads=1)
        wanted = "i" if scene.task == "count" else scene.quantities
        call = partial(search.compute, points, rows, periodic, wanted)
        return call if scene.task == "pairs" else lambda: len(call()[0])


class CKDTree(Contestant):
    """SciPy: k-d tree, half lists; inclusive; points inside the box, one image of a pair."""

    name = "cKDTree"
    distribution = "scipy"
    module = "scipy.spatial"
    inclusive = True
    dims = tuple(range(1, 9))
    triclinic = False
    images = False

    def prepare(self, scene: Scene) -> Call:
        """Build the cheaper, unbalanced tree and query it."""
        tree = importlib.import_module("scipy.spatial").cKDTree
        lengths = None
        if scene.rows is not None:
            lengths = np.where(scene.periodic, np.diag(scene.rows), 0.0)
        build = partial(
            tree, scene.points, boxsize=lengths, balanced_tree=False, compact_nodes=False
        )
        if scene.task == "count":

            def count() -> int:
                built = build()
                return int(built.count_neighbors(built, scene.cutoff) - scene.n) // 2

            return count
        return lambda: build().query_pairs(scene.cutoff, output_type="ndarray")

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return the columns of its (m, 2) array."""
        return result[:, 0], result[:, 1]


class NeighborlistRs(Contestant):
    """neighborlist-rs: cells, half lists with shifts; strict; box vectors are columns.

    Batches go through its own function for them.
    """

    name = "neighborlist-rs"
    distribution = "neighborlist-rs"
    module = "neighborlist_rs"
    quantities = "ijS"

    def refuses(self, scene: Scene) -> str | None:
        """Refuse sparse scenes too: its grid grows with the volume and aborts the process."""
        extent = np.ptp(scene.points, axis=0) / scene.cutoff if scene.cutoff > 0.0 else [np.inf]
        if scene.batch is None and np.prod(extent) > 1e8:
            return "grid larger than the memory"
        return super().refuses(scene)

    def for_batch(self) -> Contestant:
        """Return itself: it knows batches."""
        return self

    def prepare(self, scene: Scene) -> Call:
        """Make its box beforehand; without threads."""
        library = importlib.import_module("neighborlist_rs")
        library.set_num_threads(1)
        if scene.batch is not None:
            cells = None
            if scene.rows is not None:
                cells = np.ascontiguousarray(scene.rows.transpose(0, 2, 1))
            return partial(
                library.build_neighborlists_batch, scene.points, scene.batch.astype(np.int32),
                cells, scene.cutoff, parallel=False,
            )  # fmt: skip
        cell = None if scene.rows is None else library.PyCell(scene.rows.T.tolist())
        call = partial(
            library.build_neighborlists, cell, scene.points, scene.cutoff, parallel=False
        )
        return call if scene.task == "pairs" else lambda: call()["edge_index"].shape[1]

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return the rows of its (2, m) array."""
        return tuple(result["edge_index"])

    def shifts(self, result: Any) -> Any:
        """Return its shifts."""
        return result["shift"]


class MatscipyNeighbours(Contestant):
    """matscipy-neighbours: cells, full lists of int32; strict."""

    name = distribution = "matscipy-neighbours"
    module = "matscipy_neighbours"
    full = True
    quantities = "ijdDS"
    flat = True

    def prepare(self, scene: Scene) -> Call:
        """Return its call on explicit arrays."""
        library = importlib.import_module("matscipy_neighbours")
        points, rows, periodic = in_space(scene)
        return partial(
            library.neighbour_list, scene.quantities, positions=points, cell=rows, pbc=periodic,
            cutoff=scene.cutoff,
        )  # fmt: skip


class Ase(Contestant):
    """ASE: cells in NumPy, full lists; strict."""

    name = distribution = module = "ase"
    full = True
    quantities = "ijdDS"
    flat = True
    most_pairs = 3e5

    def prepare(self, scene: Scene) -> Call:
        """Return its call on explicit arrays, without an Atoms object."""
        library = importlib.import_module("ase.neighborlist")
        points, rows, periodic = in_space(scene)
        rows = np.zeros((3, 3)) if rows is None else rows
        return partial(
            library.primitive_neighbor_list, scene.quantities, periodic, rows, points,
            scene.cutoff,
        )  # fmt: skip


class MDAnalysis(Contestant):
    """MDAnalysis: grid or tree, half lists; float32 coordinates; inclusive; one image."""

    name = distribution = module = "MDAnalysis"
    inclusive = True
    images = False
    float_bits = 24

    def prepare(self, scene: Scene) -> Call:
        """Give it float32 points and its six box numbers."""
        library = importlib.import_module("MDAnalysis.lib.distances")
        points, rows, _ = in_space(scene)
        box = None
        if rows is not None:
            box = importlib.import_module("MDAnalysis.lib.mdamath").triclinic_box(*rows)
        return partial(
            library.self_capped_distance, points.astype(np.float32), scene.cutoff, box=box,
            return_distances=False,
        )  # fmt: skip

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return the columns of its (m, 2) array."""
        return result[:, 0], result[:, 1]


class Freud(Contestant):
    """freud: tree of boxes, full lists; float32; strict; one image of a pair."""

    name = "freud"
    distribution = "freud-analysis"
    module = "freud"
    full = True
    dims = (2, 3)
    images = False
    float_bits = 24
    most_pairs = 3e6

    def prepare(self, scene: Scene) -> Call:
        """Use its tree, faster than its cell list; open space is a box with a wide margin."""
        freud = importlib.import_module("freud")
        freud.parallel.set_num_threads(1)
        points = np.zeros((scene.n, 3), dtype=np.float32)
        points[:, : scene.dim] = scene.points
        rows = scene.rows
        if rows is None:
            rows = np.diag(np.ptp(scene.points, axis=0) + 3.0 * scene.cutoff)
        box = freud.box.Box.from_matrix(_columns(rows))
        arguments = {"r_max": scene.cutoff, "exclude_ii": True}
        tree = freud.locality.AABBQuery
        return lambda: tree(box, points).query(points, arguments).toNeighborList()

    def refuses(self, scene: Scene) -> str | None:
        """Refuse a box that is not in its lower-triangular form too."""
        if scene.rows is not None and np.any(np.triu(scene.rows, 1)):
            return "box not lower triangular"
        return super().refuses(scene)

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return the columns of its (m, 2) array."""
        return result[:][:, 0], result[:][:, 1]


def _columns(rows: Floats) -> Floats:
    """Box vectors as the columns of a 3 by 3 matrix, with a height of 0 for a plane."""
    matrix = np.zeros((3, 3))
    matrix[: len(rows), : len(rows)] = rows.T
    return matrix


class Pymatgen(Contestant):
    """pymatgen: cells, full lists with each point itself; a tolerance at the cutoff."""

    name = distribution = module = "pymatgen"
    inclusive = True
    full = True
    quantities = "ijdS"
    open_space = False
    tolerance = 1e-8
    most_pairs = 3e6

    def prepare(self, scene: Scene) -> Call:
        """Call the compiled function beneath its structures."""
        search = importlib.import_module("pymatgen.optimization.neighbors")
        points, rows, periodic = in_space(scene)
        return partial(
            search.find_points_in_spheres, points, points, scene.cutoff,
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


class Corrfunc(Contestant):
    """Corrfunc: vectorised counts in bins; needs a compiler and the GNU Scientific Library."""

    name = "Corrfunc"
    distribution = module = "Corrfunc"
    counts_alone = True
    triclinic = False
    images = False

    def prepare(self, scene: Scene) -> Call:
        """Count one bin, from almost zero to the cutoff."""
        count = importlib.import_module("Corrfunc.theory.DD").DD
        x, y, z = np.ascontiguousarray(scene.points.T)
        edges = np.array([1e-9 * scene.cutoff, scene.cutoff])
        options: dict[str, Any] = {"periodic": scene.box is not None}
        if scene.rows is not None:
            options["boxsize"] = tuple(np.diag(scene.rows))
        return lambda: int(count(1, 1, edges, x, y, z, **options)["npairs"].sum()) // 2


PEERS: dict[str, Contestant] = {
    peer.name: peer
    for peer in (
        Vesin(),
        CKDTree(),
        NeighborlistRs(),
        MatscipyNeighbours(),
        MDAnalysis(),
        Freud(),
        Pymatgen(),
        Ase(),
        Corrfunc(),
    )
}
