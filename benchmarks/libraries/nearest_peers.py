# SPDX-License-Identifier: BSD-3-Clause
"""The k nearest points: how each library is asked for them, ours included.

Every library gives k numbers and distances for each point. Those that list the point itself are
asked for one more, whose first column is left out when answers are compared. Trees are built
inside the call.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from halfshell_report.peers import columns
from libraries.contestant import Call, Contestant, Halfshell
from libraries.peers import CKDTree, Freud, PyKDTree
from scenes import Scene

__all__ = ["PEERS", "OwnNearest"]


class Rows(Contestant):
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


class CKDTreeNearest(Rows, CKDTree):
    """SciPy: the balanced tree, which is the faster one to ask."""

    def prepare(self, scene: Scene) -> Call:
        """Build the tree and query it with the points."""
        tree = importlib.import_module("scipy.spatial").cKDTree
        lengths = None if scene.rows is None else np.diag(scene.rows)
        return lambda: tree(scene.points, boxsize=lengths).query(scene.points, scene.nearest + 1)


class PyKDTreeNearest(Rows, PyKDTree):
    """pykdtree: open space."""

    periodic = False

    def prepare(self, scene: Scene) -> Call:
        """Build the tree and query it with the points."""
        tree = importlib.import_module("pykdtree.kdtree").KDTree
        return lambda: tree(scene.points).query(scene.points, scene.nearest + 1)


class FreudNearest(Rows, Freud):
    """freud: its tree of boxes, in float32; periodic boxes only."""

    def refuses(self, scene: Scene) -> str | None:
        """Refuse open space."""
        return "open space" if scene.box is None else super().refuses(scene)

    def prepare(self, scene: Scene) -> Call:
        """Give it float32 points; it leaves the points themselves out."""
        freud = importlib.import_module("freud")
        freud.parallel.set_num_threads(1)
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


PEERS: dict[str, Rows] = {
    peer.name: peer for peer in (PyKDTreeNearest(), CKDTreeNearest(), FreudNearest())
}
