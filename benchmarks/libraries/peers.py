# SPDX-License-Identifier: BSD-3-Clause
"""The libraries that ours is measured against, as contestants.

How each is called stands in `halfshell_report.peers`; here is what only measuring needs:
how many pairs a slow one can list in reasonable time, batches, and a library that counts.
"""

from __future__ import annotations

import importlib
from functools import partial
from typing import Any

import numpy as np

from halfshell_report import peers as adapters
from libraries.contestant import Call, Contestant
from scenes import Scene

__all__ = ["PEERS"]


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

    def prepare(self, scene: Scene) -> Call:
        """Count one bin, from almost zero to the cutoff."""
        count = importlib.import_module("Corrfunc.theory.DD").DD
        x, y, z = np.ascontiguousarray(scene.points.T)
        edges = np.array([1e-9 * scene.cutoff, scene.cutoff])
        options: dict[str, Any] = {"periodic": scene.box is not None}
        if scene.rows is not None:
            options["boxsize"] = tuple(np.diag(scene.rows))
        return lambda: int(count(1, 1, edges, x, y, z, **options)["npairs"].sum()) // 2


class PyKDTree(Contestant):
    """pykdtree: the nearest points alone (`nearest_peers`)."""

    name = distribution = module = "pykdtree"
    counts_alone = True

    def refuses(self, scene: Scene) -> str | None:
        """Refuse all that `nearest_peers` does not ask for."""
        return "no pairs"

    def prepare(self, scene: Scene) -> Call:
        """Fail: whoever is refused is not asked."""
        raise ValueError(f"{self.name} finds no pairs")


class PySPH(Contestant):
    """PySPH: neighbours within the larger smoothing length alone (`reach_peers`)."""

    name = "PySPH"
    distribution = "pysph"
    module = "pysph.base.nnps"
    counts_alone = True

    def refuses(self, scene: Scene) -> str | None:
        """Refuse all that `reach_peers` does not ask for."""
        return "one cutoff"

    def prepare(self, scene: Scene) -> Call:
        """Fail: whoever is refused is not asked."""
        raise ValueError(f"{self.name} does not take one cutoff")


PEERS: dict[str, Contestant] = {
    peer.name: peer
    for peer in (
        Vesin(),
        CKDTree(),
        NeighborlistRs(),
        MatscipyNeighbours(),
        Linkcell(),
        MDAnalysis(),
        Freud(),
        Pymatgen(),
        Ase(),
        Corrfunc(),
        PyKDTree(),
        PySPH(),
    )
}
