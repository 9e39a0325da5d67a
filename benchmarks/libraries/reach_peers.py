# SPDX-License-Identifier: BSD-3-Clause
"""A reach for each pair: how each library is asked for it, ours included.

matscipy-neighbours and ASE take a radius for each point, or a cutoff for each two elements; SciPy's
tree finds all pairs within the largest reach, which are compared in float64 afterwards. PySPH
takes a smoothing length for each point, and the larger one counts.
"""

from __future__ import annotations

import importlib
from functools import partial
from typing import Any

import numpy as np

from halfshell_report.peers import in_space
from libraries.contestant import Call, Contestant, Halfshell
from libraries.peers import Ase, CKDTree, MatscipyNeighbours, PySPH
from scenes import Scene

__all__ = ["PEERS", "OwnReach"]


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


PEERS: dict[str, Contestant] = {
    peer.name: peer
    for peer in (CKDTreeReach(), MatscipyNeighboursReach(), AseReach(), PySPHReach())
}
