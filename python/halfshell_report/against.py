# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell verify --against``: the lists of pairs that other libraries make of a scene."""

from __future__ import annotations

import importlib
import importlib.metadata

import numpy as np
from numpy.typing import NDArray

from halfshell._cli.errors import InputError, one_line
from halfshell._cli.structure_files import Scene
from halfshell._errors import how_to_install
from halfshell_report.peers import LIBRARIES, Library, Question, wrapped

__all__ = ["PEERS", "ask_peer", "find_peer", "name_and_version"]

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


#: What can be asked for a list, by the names that users know.
PEERS = {
    "scipy" if name == "cKDTree" else name: LIBRARIES[name]
    for name in ("ase", "matscipy", "matscipy-neighbours", "cKDTree", "vesin")
}


def find_peer(name: str) -> Library:
    """Return a library by its name, or say how to install it."""
    if name not in PEERS:
        raise InputError(f"--against {name}: is not one of {', '.join(PEERS)}")
    library = PEERS[name]
    try:
        importlib.import_module(library.module)
    except ImportError:
        raise InputError(
            f"--against {name}: is not installed: {how_to_install(library.distribution)}"
        ) from None
    return library


def name_and_version(library: Library) -> str:
    """Return the name of the package with its version, if it has one."""
    try:
        return f"{library.distribution} {importlib.metadata.version(library.distribution)}"
    except importlib.metadata.PackageNotFoundError:
        return library.distribution


def ask_peer(library: Library, scene: Scene, cutoff: float) -> Rows:
    """Return the list of a library for a scene."""
    ask = _ask if "S" in library.quantities else _ask_scipy
    try:
        return ask(library, scene, cutoff)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # a library may refuse a scene in any way
        raise InputError(
            f"{scene.source}: {library.distribution} returned no list: "
            f"{type(error).__name__}: {one_line(error)}"
        ) from None
