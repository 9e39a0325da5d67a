# SPDX-License-Identifier: BSD-3-Clause
"""The libraries that ours is measured against, as contestants, and what each is asked.

How each is called for pairs within one cutoff stands in `halfshell_report.peers`; here is what only
measuring needs: how many pairs a slow one can list in reasonable time, batches, a library that
counts, and the other tasks of scenes, for each of which a library takes part where it offers that:

rows, between
    Full lists, row after row, and the pairs of a query and a point. All give the rows in order, but
    only in ours, vesin's and SciPy's is each row sorted as well.
histograms
    The number of pairs in bins of equal width up to the cutoff. Answers are compared by their sum.
    SciPy counts by pairs of nodes of two trees, freud by neighbours in float32, Corrfunc by cells.
nearest
    k numbers and distances for each point. Libraries that list the point itself are asked for one
    more, whose first column is left out when answers are compared.
reach
    matscipy-neighbours and ASE take a radius for each point, or a cutoff for each two elements;
    SciPy's tree finds all pairs within the largest reach, which are compared in float64 afterwards.
    PySPH takes a smoothing length for each point, and the larger one counts.

Trees are built inside the call.
"""

from __future__ import annotations

import importlib
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from halfshell_report import peers as adapters
from halfshell_report.peers import Floats, columns, in_space
from libraries.contestant import Call, Contestant, Halfshell
from scenes import Scene

__all__ = ["PEERS", "for_scene", "ours_for"]


class Vesin(adapters.Vesin, Contestant):
    """vesin."""


class CKDTree(adapters.CKDTree, Contestant):
    """SciPy's k-d tree."""


class NeighborlistRs(adapters.NeighborlistRs, Contestant):
    """neighborlist-rs; batches go through its own function for them."""

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
        """Make the boxes of a batch beforehand."""
        if scene.batch is None:
            return super().prepare(scene)
        library = importlib.import_module("neighborlist_rs")
        library.set_num_threads(1)
        cells = None
        if scene.rows is not None:
            cells = np.ascontiguousarray(scene.rows.transpose(0, 2, 1))
        return partial(
            library.build_neighborlists_batch, scene.points, scene.batch.astype(np.int32),
            cells, scene.cutoff, parallel=False,
        )  # fmt: skip


class MatscipyNeighbours(adapters.MatscipyNeighbours, Contestant):
    """matscipy-neighbours."""


class Linkcell(Contestant):
    """linkcell, of Python 3.12 on: i, j, S and squared distances, whatever is wanted of them."""

    name = distribution = module = "linkcell"
    quantities = "ijS"
    open_space = some_axes = False

    def prepare(self, scene: Scene) -> Call:
        """Hand points and rows over as they are."""
        find = importlib.import_module("linkcell").pairs_within
        asked = (scene.points, scene.rows, scene.cutoff)
        return lambda: [np.from_dlpack(column) for column in find(*asked, half=True)]

    def shifts(self, result: Any) -> Any:
        """Return S, which comes before the squared distances."""
        return result[2]


class MDAnalysis(adapters.MDAnalysis, Contestant):
    """MDAnalysis."""


class Freud(adapters.Freud, Contestant):
    """freud."""

    most_pairs = 3e6


class Pymatgen(adapters.Pymatgen, Contestant):
    """pymatgen."""

    most_pairs = 3e6


class Ase(adapters.Ase, Contestant):
    """ASE."""

    most_pairs = 3e5


class Corrfunc(Contestant):
    """Corrfunc: vectorised counts in bins; needs a compiler and the GNU Scientific Library."""

    name = "Corrfunc"
    distribution = module = "Corrfunc"
    counts_alone = True
    triclinic = False
    images = False

    def edges(self, scene: Scene) -> Floats:
        """Return the limits of one bin."""
        return np.array([0.0, scene.cutoff])

    def prepare(self, scene: Scene) -> Call:
        """Count in bins, the first from almost zero, below which it leaves out; each pair twice."""
        count = importlib.import_module("Corrfunc.theory.DD").DD
        x, y, z = np.ascontiguousarray(scene.points.T)
        edges = self.edges(scene)
        edges[0] = 1e-9 * scene.cutoff
        options: dict[str, Any] = {"periodic": scene.box is not None}
        if scene.rows is not None:
            options["boxsize"] = tuple(np.diag(scene.rows))
        return lambda: int(count(1, 1, edges, x, y, z, **options)["npairs"].sum()) // 2


class NoPairs(Contestant):
    """A library that takes part in one of the tasks below alone."""

    counts_alone = True
    lacks = "no pairs"

    def refuses(self, scene: Scene) -> str | None:
        """Refuse all that has no class of its own below."""
        return self.lacks

    def prepare(self, scene: Scene) -> Call:
        """Fail: whoever is refused is not asked."""
        raise ValueError(f"{self.name}: {self.lacks}")


class PyKDTree(NoPairs):
    """pykdtree: the nearest points alone."""

    name = distribution = module = "pykdtree"


class PySPH(NoPairs):
    """PySPH: neighbours within the larger smoothing length alone."""

    name = "PySPH"
    distribution = "pysph"
    module = "pysph.base.nnps"
    lacks = "one cutoff"


# ---- full lists, and two sets ---------------------------------------------------------------

class OwnRows(Halfshell):
    """Our table of rows."""

    full = True

    def prepare(self, scene: Scene) -> Call:
        """Return our call with the keywords of the scene."""
        return self.call("neighbors", scene, scene.points, scene.cutoff, **self.listed(scene))

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return both indices of each entry."""
        i, j = result.to_pairs()
        return i, j


class OwnBetween(OwnRows):
    """Our pairs of two sets."""

    full = False

    def prepare(self, scene: Scene) -> Call:
        """Return our call with the keywords of the scene."""
        self.first = len(scene.asking)
        return self.call(
            "pairs_between", scene, scene.asking, scene.found, scene.cutoff, **self.listed(scene)
        )

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return both numbers among queries and points together."""
        return result[0], result[1] + self.first


class VesinRows(Vesin):
    """vesin: full and sorted lists."""

    full = True

    def prepare(self, scene: Scene) -> Call:
        """Keep one calculator, as its documentation advises."""
        vesin = importlib.import_module("vesin")
        points, rows, periodic = in_space(scene)
        rows = np.zeros((3, 3)) if rows is None else rows
        search = vesin.NeighborList(
            cutoff=scene.cutoff, full_list=True, sorted=True, n_threads=1
        )  # fmt: skip
        return partial(search.compute, points, rows, periodic, "ij")


class CKDTreeRows(CKDTree):
    """SciPy: lists of Python numbers, sorted, each point itself among them."""

    full = True

    def prepare(self, scene: Scene) -> Call:
        """Build the cheaper, unbalanced tree and query it."""
        build = self.tree(scene, scene.points)
        return lambda: build().query_ball_point(scene.points, scene.cutoff, return_sorted=True)

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Join the rows, and leave each point itself out."""
        i = np.repeat(np.arange(len(result)), [len(row) for row in result])
        j = np.concatenate([np.asarray(row, dtype=np.int64) for row in result])
        return i[i != j], j[i != j]


class BothLetters:
    """A library whose full lists need i to tell rows apart."""

    def prepare(self, scene: Scene) -> Call:
        """Ask for both indices."""
        call: Call = super().prepare(replace(scene, quantities="ij"))  # type: ignore[misc]
        return call


class AseRows(BothLetters, Ase):
    """ASE: as it is."""


class MatscipyNeighboursRows(BothLetters, MatscipyNeighbours):
    """matscipy-neighbours: as it is."""


class CKDTreeBetween(CKDTree):
    """SciPy: the pairs of two trees, with distances."""

    def prepare(self, scene: Scene) -> Call:
        """Build both trees and query them."""
        build = self.tree(scene, scene.asking), self.tree(scene, scene.found)
        self.first = len(scene.asking)

        def call() -> Any:
            asking, found = (tree() for tree in build)
            return asking.sparse_distance_matrix(found, scene.cutoff, output_type="ndarray")

        return call

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return both numbers among queries and points together."""
        return result["i"], result["j"] + self.first


class FreudBetween(Freud):
    """freud: queries."""

    full = False

    def prepare(self, scene: Scene) -> Call:
        """Use its tree of the points."""
        freud = self.library()
        box = freud.box.Box.from_matrix(columns(scene.rows))
        asking, found = (np.asarray(part, np.float32) for part in (scene.asking, scene.found))
        arguments = {"r_max": scene.cutoff, "exclude_ii": False}
        self.first = len(asking)
        tree = freud.locality.AABBQuery
        return lambda: tree(box, found).query(asking, arguments).toNeighborList()

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return both numbers among queries and points together."""
        return result[:][:, 0], result[:][:, 1].astype(np.int64) + self.first


class MDAnalysisBetween(MDAnalysis):
    """MDAnalysis: its function for two sets."""

    def prepare(self, scene: Scene) -> Call:
        """Give it float32 points and its six box numbers."""
        library = importlib.import_module("MDAnalysis.lib.distances")
        box = importlib.import_module("MDAnalysis.lib.mdamath").triclinic_box(*scene.rows)
        asking, found = (np.asarray(part, np.float32) for part in (scene.asking, scene.found))
        self.first = len(asking)
        return partial(
            library.capped_distance, asking, found, scene.cutoff, box=box, return_distances=False
        )

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Return both numbers among queries and points together."""
        return result[:, 0], result[:, 1] + self.first


# ---- histograms -----------------------------------------------------------------------------

def _edges(scene: Scene) -> Floats:
    return np.linspace(0.0, scene.cutoff, scene.bins + 1)


class OwnHistogram(Halfshell):
    """Our histogram; a pair at exactly the cutoff is in the last bin."""

    def prepare(self, scene: Scene) -> Call:
        """Return our call with the keywords of the scene."""
        call = self.call("pair_histogram", scene, scene.points, _edges(scene))
        return lambda: int(call().sum())


class CorrfuncHistogram(Corrfunc):
    """Corrfunc: the same call with more bins."""

    def edges(self, scene: Scene) -> Floats:
        """Return the limits of all bins."""
        return _edges(scene)


class CKDTreeHistogram(CKDTree):
    """SciPy: cumulative counts at each edge."""

    def prepare(self, scene: Scene) -> Call:
        """Build the tree, and count each pair twice and each point with itself."""
        build = self.tree(scene, scene.points)

        def count() -> int:
            built = build()
            within = built.count_neighbors(built, _edges(scene))
            return int(np.diff(within).sum() + within[0] - scene.n) // 2

        return count


class FreudHistogram(Freud):
    """freud: the counts of its radial distribution function."""

    most_pairs = np.inf

    def prepare(self, scene: Scene) -> Call:
        """Count ordered pairs, in float32."""
        freud = self.library()
        points = scene.points.astype(np.float32)
        box = freud.box.Box.from_matrix(columns(scene.rows))

        def count() -> int:
            function = freud.density.RDF(bins=scene.bins, r_max=scene.cutoff)
            return int(function.compute((box, points)).bin_counts.sum()) // 2

        return count


# ---- the nearest ----------------------------------------------------------------------------

class NearestRows(Contestant):
    """A library that gives distances and numbers of the nearest, itself among them."""

    def refuses(self, scene: Scene) -> str | None:
        """Say why it cannot; there is no cutoff, so no question of images."""
        if scene.box is not None and not self.periodic:
            return "periodic box"
        return None if scene.orthorhombic else "triclinic box"

    periodic = True

    def nearest(self, scene: Scene, result: Any) -> tuple[Any, Any]:
        """Return distances and numbers, without the points themselves."""
        return result[0][:, 1:], result[1][:, 1:]

    def count(self, scene: Scene, result: Any) -> int:
        """Return the number of neighbours."""
        return int(self.nearest(scene, result)[1].size)


class OwnNearest(Halfshell):
    """Our rows."""

    def prepare(self, scene: Scene) -> Call:
        """Return our call with the keywords of the scene."""
        return self.call("nearest", scene, scene.points, scene.nearest, **self.listed(scene))

    def nearest(self, scene: Scene, result: Any) -> tuple[Any, Any]:
        """Return distances and numbers."""
        return result[1], result[0]

    def count(self, scene: Scene, result: Any) -> int:
        """Return the number of neighbours."""
        return int(np.count_nonzero(result[0] >= 0))


class CKDTreeNearest(NearestRows, CKDTree):
    """SciPy: the balanced tree, which is the faster one to ask."""

    def prepare(self, scene: Scene) -> Call:
        """Build the tree and query it with the points."""
        tree = importlib.import_module("scipy.spatial").cKDTree
        lengths = None if scene.rows is None else np.diag(scene.rows)
        return lambda: tree(scene.points, boxsize=lengths).query(scene.points, scene.nearest + 1)


class PyKDTreeNearest(NearestRows, PyKDTree):
    """pykdtree: open space."""

    periodic = False

    def prepare(self, scene: Scene) -> Call:
        """Build the tree and query it with the points."""
        tree = importlib.import_module("pykdtree.kdtree").KDTree
        return lambda: tree(scene.points).query(scene.points, scene.nearest + 1)


class FreudNearest(NearestRows, Freud):
    """freud: its tree of boxes, in float32; periodic boxes only."""

    def refuses(self, scene: Scene) -> str | None:
        """Refuse open space."""
        return "open space" if scene.box is None else super().refuses(scene)

    def prepare(self, scene: Scene) -> Call:
        """Give it float32 points; it leaves the points themselves out."""
        freud = self.library()
        points = scene.points.astype(np.float32)
        box = freud.box.Box.from_matrix(columns(scene.rows))
        query = {"num_neighbors": scene.nearest, "exclude_ii": True}
        tree = freud.locality.AABBQuery
        return lambda: tree(box, points).query(points, query).toNeighborList()

    def nearest(self, scene: Scene, result: Any) -> tuple[Any, Any]:
        """Sort each row by distance."""
        d = np.asarray(result.distances, dtype=np.float64).reshape(scene.n, -1)
        j = np.asarray(result[:][:, 1], dtype=np.int64).reshape(scene.n, -1)
        order = np.argsort(d, axis=1, kind="stable")
        return np.take_along_axis(d, order, 1), np.take_along_axis(j, order, 1)


# ---- a reach for each pair ------------------------------------------------------------------

class OwnReach(Halfshell):
    """Our pairs by radii or types."""

    def prepare(self, scene: Scene) -> Call:
        """Return our call with the keywords of the scene."""
        how: dict[str, Any] = {} if scene.types is not None else {"rule": scene.rule}
        return self.call("pairs", scene, scene.points, scene.table, **how, **self.listed(scene))


def _reason(scene: Scene, types: bool) -> str | None:
    """What is lacking of libraries that add radii up."""
    if scene.radii is not None and scene.rule != "sum":
        return f"rule {scene.rule}"
    return None if scene.types is None or types else "cutoffs by type"


def _elements(scene: Scene) -> tuple[Any, dict[tuple[int, int], float]]:
    """Types as atomic numbers, and a cutoff for each two of them."""
    assert scene.types is not None and scene.table is not None
    table = {
        (a + 1, b + 1): float(scene.table[a, b])
        for a in range(len(scene.table))
        for b in range(a, len(scene.table))
    }
    return scene.types + 1, table


class CKDTreeReach(CKDTree):
    """SciPy: radii alone."""

    def refuses(self, scene: Scene) -> str | None:
        """Refuse other rules, and types."""
        return super().refuses(scene) or _reason(scene, types=False)


class MatscipyNeighboursReach(MatscipyNeighbours):
    """matscipy-neighbours: radii, or a dict of cutoffs."""

    def refuses(self, scene: Scene) -> str | None:
        """Refuse other rules."""
        return super().refuses(scene) or _reason(scene, types=True)

    def prepare(self, scene: Scene) -> Call:
        """Give it types as atomic numbers."""
        if scene.types is None:
            return super().prepare(scene)
        library = importlib.import_module(self.module)
        points, rows, periodic = in_space(scene)
        numbers, table = _elements(scene)
        return partial(
            library.neighbour_list, scene.quantities, positions=points, cell=rows, pbc=periodic,
            cutoff=table, numbers=numbers,
        )  # fmt: skip


class AseReach(Ase):
    """ASE: radii, or a dict of cutoffs."""

    def refuses(self, scene: Scene) -> str | None:
        """Refuse other rules."""
        return super().refuses(scene) or _reason(scene, types=True)

    def prepare(self, scene: Scene) -> Call:
        """Give it types as atomic numbers."""
        if scene.types is None:
            return super().prepare(scene)
        library = importlib.import_module("ase.neighborlist")
        points, rows, periodic = in_space(scene)
        rows = np.zeros((3, 3)) if rows is None else rows
        numbers, table = _elements(scene)
        return partial(
            library.primitive_neighbor_list, scene.quantities, periodic, rows, points, table,
            numbers=numbers,
        )  # fmt: skip


class PySPHReach(PySPH):
    """PySPH: the larger smoothing length counts; each point is its own neighbour; strict."""

    full = True
    counts_alone = False
    radii = True
    quantities = "ij"

    def refuses(self, scene: Scene) -> str | None:
        """Refuse what is not its own kind of scene."""
        if scene.rule != "max" or scene.box is not None or scene.dim != 3:
            return "anything but smoothing lengths in open space"
        return Contestant.refuses(self, scene)

    def prepare(self, scene: Scene) -> Call:
        """Keep its particles; its octree, the quickest of its searches here, is made anew."""
        utils = importlib.import_module("pysph.base.utils")
        nnps = importlib.import_module("pysph.base.nnps")
        x, y, z = (np.ascontiguousarray(column) for column in scene.points.T)
        assert scene.radii is not None
        self.n = scene.n
        particles = utils.get_particle_array(name="cloud", x=x, y=y, z=z, h=scene.radii)

        def call() -> Any:
            search = nnps.CompressedOctreeNNPS(
                dim=3, particles=[particles], radius_scale=1.0, cache=True
            )
            search.set_context(0, 0)
            search.cache[0].find_all_neighbors()
            return search

        return call

    def count(self, scene: Scene, result: Any) -> int:
        """Return the number of pairs, each counted once."""
        return len(self.indices(result)[0]) // 2

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Ask for the neighbours of each point, which have been found already."""
        row = importlib.import_module("cyarray.api").UIntArray()
        rows = []
        for i in range(self.n):
            result.get_nearest_particles(0, 0, i, row)
            rows.append(row.get_npy_array()[: row.length].astype(np.int64))
        i = np.repeat(np.arange(self.n), [len(found) for found in rows])
        j = np.concatenate(rows)
        return i[i != j], j[i != j]


# ---- who is asked ---------------------------------------------------------------------------

PEERS: dict[str, Contestant] = {
    peer.name: peer
    for peer in (
        Vesin(), CKDTree(), NeighborlistRs(), MatscipyNeighbours(), Linkcell(), MDAnalysis(),
        Freud(), Pymatgen(), Ase(), Corrfunc(), PyKDTree(), PySPH(),
    )
}  # fmt: skip

# By task: our search, and those who take part.
_TASKS: dict[str, tuple[type[Halfshell], tuple[Contestant, ...]]] = {
    "rows": (
        OwnRows, (VesinRows(), CKDTreeRows(), MatscipyNeighboursRows(), Freud(), AseRows())
    ),
    "between": (OwnBetween, (CKDTreeBetween(), MDAnalysisBetween(), FreudBetween())),
    "histogram": (OwnHistogram, (CorrfuncHistogram(), CKDTreeHistogram(), FreudHistogram())),
    "nearest": (OwnNearest, (PyKDTreeNearest(), CKDTreeNearest(), FreudNearest())),
    "reach": (
        OwnReach, (CKDTreeReach(), MatscipyNeighboursReach(), AseReach(), PySPHReach())
    ),
}  # fmt: skip


def _task_of(scene: Scene) -> str:
    """Which of these tasks a scene is; empty for pairs within one cutoff."""
    if scene.bins:
        return "histogram"
    if scene.task in _TASKS:
        return scene.task
    return "reach" if scene.has_reach else ""


def for_scene(peer: Contestant, scene: Scene) -> Contestant:
    """Return the peer as it is asked for this scene. Raises KeyError where it has no such list."""
    if task := _task_of(scene):
        return {one.name: one for one in _TASKS[task][1]}[peer.name]
    return peer if scene.batch is None else peer.for_batch()


def ours_for(ours: Halfshell | None, scene: Scene) -> Halfshell | None:
    """Return our search as it is asked for this scene."""
    task = _task_of(scene)
    return _TASKS[task][0](ours.options) if ours is not None and task else ours
