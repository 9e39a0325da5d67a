# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell verify --against``: the lists of pairs that other libraries make of a scene."""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from halfshell._cli.errors import InputError, one_line
from halfshell._cli.structure_files import Scene
from halfshell._errors import how_to_install
from halfshell_report.peers import LIBRARIES, Library, Question, wrapped

__all__ = ["PEERS", "Peer", "ask_peer", "find_peer"]

Ints = NDArray[np.int64]
#: i, j and S; whether pairs at exactly the cutoff count, and whether both directions are there.
Rows = tuple[Ints, Ints, Ints, bool, bool]


def _ask(library: Library, scene: Scene, cutoff: float) -> Rows:
    """Return the list of a library that tells shifts."""
    question = _question(scene, cutoff, "ijS")
    if question.dim > 3:
        raise InputError(f"{scene.source}: has {question.dim} coordinates; this library knows 3")
    result = library.prepare(question)()
    i, j = (np.asarray(part).astype(np.int64) for part in library.indices(result))
    shifts = np.asarray(library.shifts(result), dtype=np.int64)[:, : question.dim]
    return i, j, shifts, library.inclusive, library.full


def _ask_scipy(library: Library, scene: Scene, cutoff: float) -> Rows:
    """Return its list, with the shifts of the nearest images, which are those it means."""
    question = _question(scene, cutoff, "ij")
    lengths = np.zeros(question.dim)  # 0: the axis does not repeat
    if question.rows is not None:
        if not question.orthorhombic or (np.diag(question.rows)[list(scene.periodic)] < 0).any():
            raise InputError(f"{scene.source}: scipy has only boxes with right angles")
        lengths = np.where(scene.periodic, np.diag(question.rows), 0.0)
        if wrapped(question)[1]:
            raise InputError(f"{scene.source}: scipy wants all points in the box [0, L)")
    i, j = (part.astype(np.int64) for part in library.indices(library.prepare(question)()))
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.rint((question.points[i] - question.points[j]) / lengths)
    shifts = np.where(lengths > 0, turns, 0.0)
    return i, j, shifts.astype(np.int64), library.inclusive, library.full


def _question(scene: Scene, cutoff: float, quantities: str) -> Question:
    points = np.asarray(scene.points, dtype=np.float64)
    rows = scene.box_rows
    return Question(points, cutoff, rows, tuple(scene.periodic) if rows is not None else (),
                    quantities)  # fmt: skip


@dataclass(frozen=True)
class Peer:
    """Another library: what to import, what to install, how to ask it."""

    modules: tuple[str, ...]
    package: str
    ask: Callable[[Scene, float], Rows]

    def name_and_version(self) -> str:
        """Return the name of the package with its version, if it has one."""
        try:
            return f"{self.package} {importlib.metadata.version(self.package)}"
        except importlib.metadata.PackageNotFoundError:
            return self.package


def _peer(name: str, ask: Callable[[Library, Scene, float], Rows]) -> Peer:
    library = LIBRARIES[name]
    return Peer((library.module,), library.distribution, partial(ask, library))


PEERS = {
    "ase": _peer("ase", _ask),
    "matscipy": _peer("matscipy", _ask),
    "matscipy-neighbours": _peer("matscipy-neighbours", _ask),
    "scipy": _peer("cKDTree", _ask_scipy),
    "vesin": _peer("vesin", _ask),
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
            f"--against {name}: is not installed: {how_to_install(peer.package)}"
        ) from None
    return peer


def ask_peer(peer: Peer, scene: Scene, cutoff: float) -> Rows:
    """Return the list of a library for a scene."""
    try:
        return peer.ask(scene, cutoff)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # a library may refuse a scene in any way
        raise InputError(
            f"{scene.source}: {peer.package} returned no list: "
            f"{type(error).__name__}: {one_line(error)}"
        ) from None
