# SPDX-License-Identifier: BSD-3-Clause
"""Full lists and two sets: how each library is asked for them, ours included.

Scenes of the task "rows" want all neighbours of each point, row after row; those of "between" the
pairs of a query and a point. A library takes part where it offers that. All give the rows in order,
but only in ours, vesin's and SciPy's is each row sorted as well.
"""

from __future__ import annotations

import importlib
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from halfshell_report.peers import columns, in_space
from libraries import histogram_peers, nearest_peers, reach_peers
from libraries.contestant import Call, Contestant, Halfshell
from libraries.peers import Ase, CKDTree, Freud, MatscipyNeighbours, MDAnalysis, Vesin
from scenes import Scene

__all__ = ["for_scene", "ours_for"]


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
        build = partial(_tree, scene, scene.points)
        return lambda: build().query_ball_point(scene.points, scene.cutoff, return_sorted=True)

    def indices(self, result: Any) -> tuple[Any, Any]:
        """Join the rows, and leave each point itself out."""
        i = np.repeat(np.arange(len(result)), [len(row) for row in result])
        j = np.concatenate([np.asarray(row, dtype=np.int64) for row in result])
        return i[i != j], j[i != j]


def _tree(scene: Scene, points: Any) -> Any:
    tree = importlib.import_module("scipy.spatial").cKDTree
    lengths = None if scene.rows is None else np.diag(scene.rows)
    return tree(points, boxsize=lengths, balanced_tree=False, compact_nodes=False)


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
        build = partial(_tree, scene, scene.asking), partial(_tree, scene, scene.found)
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
        freud = importlib.import_module("freud")
        freud.parallel.set_num_threads(1)
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


_PEERS: dict[str, dict[str, Contestant]] = {
    "rows": {
        peer.name: peer
        for peer in (VesinRows(), CKDTreeRows(), MatscipyNeighboursRows(), Freud(), AseRows())
    },
    "between": {
        peer.name: peer for peer in (CKDTreeBetween(), MDAnalysisBetween(), FreudBetween())
    },
}


def for_scene(peer: Contestant, scene: Scene) -> Contestant:
    """Return the peer as it is asked for this scene. Raises KeyError where it has no such list."""
    if scene.bins:
        return histogram_peers.PEERS[peer.name]
    if scene.nearest:
        return nearest_peers.PEERS[peer.name]
    if scene.task in _PEERS:
        return _PEERS[scene.task][peer.name]
    if scene.has_reach:
        return reach_peers.PEERS[peer.name]
    return peer if scene.batch is None else peer.for_batch()


def ours_for(ours: Halfshell | None, scene: Scene) -> Halfshell | None:
    """Return our search as it is asked for this scene."""
    kinds = {"rows": OwnRows, "between": OwnBetween}
    if ours is not None and scene.bins:
        return histogram_peers.OwnHistogram(ours.options)
    if ours is not None and scene.nearest:
        return nearest_peers.OwnNearest(ours.options)
    if ours is not None and scene.has_reach:
        return reach_peers.OwnReach(ours.options)
    if ours is None or scene.task not in kinds:
        return ours
    return kinds[scene.task](ours.options)
