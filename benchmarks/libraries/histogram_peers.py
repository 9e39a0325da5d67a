# SPDX-License-Identifier: BSD-3-Clause
"""Histograms of distances: how each library is asked for them, ours included.

A scene of the task "count" with `bins` wants the number of pairs in so many bins of equal width up
to the cutoff. Answers are compared by their sum. Libraries that have lists only do not take part:
SciPy counts by pairs of nodes of two trees, freud by neighbours in float32, Corrfunc by cells.
"""

from __future__ import annotations

import importlib
from functools import partial
from typing import Any

import numpy as np

from halfshell_report.peers import Floats, columns
from libraries.contestant import Call, Contestant, Halfshell
from libraries.peers import CKDTree, Corrfunc, Freud
from scenes import Scene

__all__ = ["PEERS", "OwnHistogram"]


def _edges(scene: Scene) -> Floats:
    return np.linspace(0.0, scene.cutoff, scene.bins + 1)


class OwnHistogram(Halfshell):
    """Our histogram; a pair at exactly the cutoff is in the last bin."""

    def prepare(self, scene: Scene) -> Call:
        """Return our call with the keywords of the scene."""
        call = self.call("pair_histogram", scene, scene.points, _edges(scene))
        return lambda: int(call().sum())


class CorrfuncHistogram(Corrfunc):
    """Corrfunc: the first bin begins at almost zero, as it leaves out what is below."""

    def prepare(self, scene: Scene) -> Call:
        """Count in bins; each pair comes twice."""
        count = importlib.import_module("Corrfunc.theory.DD").DD
        x, y, z = np.ascontiguousarray(scene.points.T)
        edges = _edges(scene)
        edges[0] = 1e-9 * scene.cutoff
        options: dict[str, Any] = {"periodic": scene.box is not None}
        if scene.rows is not None:
            options["boxsize"] = tuple(np.diag(scene.rows))
        return lambda: int(count(1, 1, edges, x, y, z, **options)["npairs"].sum()) // 2


class CKDTreeHistogram(CKDTree):
    """SciPy: cumulative counts at each edge."""

    def prepare(self, scene: Scene) -> Call:
        """Build the tree, and count each pair twice and each point with itself."""
        tree = importlib.import_module("scipy.spatial").cKDTree
        lengths = None if scene.rows is None else np.diag(scene.rows)
        build = partial(
            tree, scene.points, boxsize=lengths, balanced_tree=False, compact_nodes=False
        )

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
        freud = importlib.import_module("freud")
        freud.parallel.set_num_threads(1)
        points = scene.points.astype(np.float32)
        box = freud.box.Box.from_matrix(columns(scene.rows))

        def count() -> int:
            function = freud.density.RDF(bins=scene.bins, r_max=scene.cutoff)
            return int(function.compute((box, points)).bin_counts.sum()) // 2

        return count


PEERS: dict[str, Contestant] = {
    peer.name: peer for peer in (CorrfuncHistogram(), CKDTreeHistogram(), FreudHistogram())
}
