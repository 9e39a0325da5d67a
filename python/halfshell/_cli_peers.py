# SPDX-License-Identifier: BSD-3-Clause
"""Other libraries that make lists of pairs, asked for the same scene."""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell._files import InputError, Scene, one_line

__all__ = ["PEERS", "PairList", "Peer", "ask_peer", "find_peer"]


@dataclass(frozen=True)
class PairList:
    """Somebody's list of pairs.

    Attributes
    ----------
    i, j : ndarray of int64, shape (m,)
    S : ndarray of int64, shape (m, d)
    inclusive : bool
        The rule of its author: ``d <= cutoff``, or ``d < cutoff``.
    full : bool
        Whether it has both directions of every pair.
    """

    i: NDArray[np.int64]
    j: NDArray[np.int64]
    S: NDArray[np.int64]
    inclusive: bool
    full: bool

    def among(self, rows: NDArray[np.intp] | None, n: int) -> PairList:
        """Return the pairs among some of n points, numbered by their place among these."""
        if rows is None:
            return self
        place = np.full(n, -1, dtype=np.int64)
        place[rows] = np.arange(len(rows))
        i, j = place[self.i], place[self.j]
        kept = (i >= 0) & (j >= 0)
        return PairList(i[kept], j[kept], self.S[kept], self.inclusive, self.full)


def _module(name: str) -> Any:
    return importlib.import_module(name)


def _ask_ase(scene: Scene, cutoff: float) -> PairList:
    return _ask_with_atoms(scene, cutoff, _module("ase.neighborlist").neighbor_list)


def _ask_matscipy(scene: Scene, cutoff: float) -> PairList:
    return _ask_with_atoms(scene, cutoff, _module("matscipy.neighbours").neighbour_list)


def _ask_with_atoms(scene: Scene, cutoff: float, search: Callable[..., Any]) -> PairList:
    points, rows, flags = _in_three_dimensions(scene)
    atoms = _module("ase").Atoms(positions=points, cell=rows, pbc=flags)
    return _full_list(scene, *search("ijS", atoms, cutoff))


def _ask_matscipy_neighbours(scene: Scene, cutoff: float) -> PairList:
    points, rows, flags = _in_three_dimensions(scene)
    cell = rows if rows.any() else None
    found = _module("matscipy_neighbours").neighbour_list(
        "ijS", cutoff=cutoff, positions=points, cell=cell, pbc=flags
    )
    return _full_list(scene, *found)


def _ask_vesin(scene: Scene, cutoff: float) -> PairList:
    points, rows, flags = _in_three_dimensions(scene)
    search = _module("vesin").NeighborList(cutoff=cutoff, full_list=True)
    return _full_list(scene, *search.compute(points, rows, flags, "ijS"))


def _ask_scipy(scene: Scene, cutoff: float) -> PairList:
    points = np.asarray(scene.points, dtype=np.float64)
    lengths = np.zeros(points.shape[1])  # 0: the axis does not repeat
    if any(scene.periodic):
        rows = scene.box_rows
        assert rows is not None
        repeating = np.array(scene.periodic)
        if (rows - np.diag(rows.diagonal()))[repeating].any() or (rows.diagonal() < 0).any():
            raise InputError(f"{scene.source}: scipy has no boxes with other than right angles")
        lengths[repeating] = rows.diagonal()[repeating]
        outside = repeating & ((points < 0) | (points >= lengths)).any(axis=0)
        if outside.any():
            raise InputError(f"{scene.source}: scipy wants all points in the box [0, L)")
    tree = _module("scipy.spatial").KDTree(points, boxsize=lengths)
    pairs = tree.query_pairs(cutoff, output_type="ndarray")
    i, j = pairs.astype(np.int64).T
    with np.errstate(divide="ignore", invalid="ignore"):
        shifts = np.where(lengths > 0, np.rint((points[i] - points[j]) / lengths), 0.0)
    return PairList(i, j, shifts.astype(np.int64), inclusive=True, full=False)


def _full_list(scene: Scene, i: Any, j: Any, S: Any) -> PairList:
    """Return a list with both directions and the rule ``d < cutoff``."""
    ndim = scene.points.shape[1]
    shifts = np.asarray(S, dtype=np.int64)[:, :ndim]
    return PairList(i.astype(np.int64), j.astype(np.int64), shifts, inclusive=False, full=True)


def _in_three_dimensions(
    scene: Scene,
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[bool]]:
    """Return points (n, 3), box (3, 3) and flags; axes that are added do not repeat."""
    n, ndim = scene.points.shape
    if ndim > 3:
        raise InputError(f"{scene.source}: has {ndim} coordinates; this library knows 3")
    points = np.zeros((n, 3))
    points[:, :ndim] = scene.points
    rows = np.zeros((3, 3))
    if scene.box_rows is not None:
        rows[:ndim, :ndim] = scene.box_rows
    return points, rows, [*scene.periodic, *[False] * (3 - ndim)]


@dataclass(frozen=True)
class Peer:
    """Another library: what to import, what to install, how to ask it."""

    modules: tuple[str, ...]
    package: str
    ask: Callable[[Scene, float], PairList]

    def name_and_version(self) -> str:
        """Return the name of the package with its version, if it has one."""
        try:
            return f"{self.package} {importlib.metadata.version(self.package)}"
        except importlib.metadata.PackageNotFoundError:
            return self.package


PEERS = {
    "ase": Peer(("ase.neighborlist",), "ase", _ask_ase),
    "matscipy": Peer(("matscipy.neighbours", "ase"), "matscipy", _ask_matscipy),
    "matscipy-neighbours": Peer(
        ("matscipy_neighbours",), "matscipy-neighbours", _ask_matscipy_neighbours
    ),
    "scipy": Peer(("scipy.spatial",), "scipy", _ask_scipy),
    "vesin": Peer(("vesin",), "vesin", _ask_vesin),
}


def find_peer(name: str) -> Peer:
    """Return a library by its name, or say how to install it."""
    if name not in PEERS:
        raise InputError(f"--against {name}: is not one of {', '.join(PEERS)}")
    peer = PEERS[name]
    try:
        for module in peer.modules:
            importlib.import_module(module)
    except ImportError:
        raise InputError(
            f"--against {name}: is not installed: pip install {peer.package}"
        ) from None
    return peer


def ask_peer(peer: Peer, scene: Scene, cutoff: float) -> PairList:
    """Return the list of a library for a scene."""
    try:
        return peer.ask(scene, cutoff)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # a library may refuse a scene in any way
        raise InputError(
            f"{scene.source}: {peer.package} gives no list: "
            f"{type(error).__name__}: {one_line(error)}"
        ) from None
