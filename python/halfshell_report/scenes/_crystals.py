# SPDX-License-Identifier: BSD-3-Clause
"""Crystals whose cutoff lies on a shell of neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from halfshell_report.scenes._catalogue import add
from halfshell_report.scenes._make import CUBE, FCC, ROTATION, combine, sites
from halfshell_report.scenes._scene import Floats, Scene, Size, pick

# name: rows of the unit cell, sites in it, repeats of the three sizes; all in integers.
_LATTICES: dict[str, tuple[NDArray[np.int64], NDArray[np.int64], tuple[int, int, int]]] = {
    "sc": (np.eye(3, dtype=np.int64), np.zeros((1, 3), np.int64), (6, 16, 46)),
    "fcc": (4 * np.eye(3, dtype=np.int64), FCC, (3, 10, 29)),
    "bcc": (2 * np.eye(3, dtype=np.int64), np.array([[0, 0, 0], [1, 1, 1]]), (4, 12, 37)),
    "diamond": (4 * np.eye(3, dtype=np.int64), np.concatenate([FCC, FCC + 1]), (3, 8, 23)),
    # Stacked along (1, 1, 1), where ideal close packing has integer coordinates.
    "hcp": (
        np.array([[3, -3, 0], [0, 3, -3], [4, 4, 4]]),
        np.array([[0, 0, 0], [4, 1, 1]]),
        (4, 12, 37),
    ),
}


def _crystal(size: Size, lattice: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    rows, basis, repeats = _LATTICES[lattice]
    return sites(rows, basis, (pick(size, *repeats),) * 3)


@add(
    {
        "sc-shell": ("simple cubic crystal, cutoff on its eighth shell", "sc", 3.0),
        "fcc-shell": ("fcc crystal, cutoff on its eighth shell", "fcc", 8.0),
        "bcc-shell": ("bcc crystal, cutoff on its sixth shell", "bcc", 4.0),
        "diamond-shell": ("diamond, cutoff on its fourth shell", "diamond", 4.0),
        "hcp-shell": ("ideal close packing, cutoff on its second shell", "hcp", 6.0),
    }
)
def shell(size: Size, lattice: str, cutoff: float) -> Scene:
    """A whole shell of neighbours at exactly the cutoff, in numbers that binary holds exactly.

    Each of these ties has to be decided by the rule for a pair at the cutoff. A rounded
    comparison that is off by one unit loses the shell.
    """
    points, rows = _crystal(size, lattice)
    return Scene(points.astype(np.float64), cutoff, rows.astype(np.float64), CUBE)


@add({"fcc-strict": ("fcc crystal, cutoff on a shell that does not count",)})
def strict(size: Size) -> Scene:
    """A whole shell at exactly the cutoff that must be left out, down to the last pair."""
    points, rows = _crystal(size, "fcc")
    return Scene(points.astype(np.float64), 8.0, rows.astype(np.float64), CUBE, inclusive=False)


@add({"silicon-shell": ("silicon, cutoff at the lattice constant of 5.431",)})
def silicon(size: Size) -> Scene:
    """A shell within rounding of the cutoff: 5.431 and its quarters are rounded in binary.

    Whether a pair counts depends on how its two coordinates were rounded. Equal vectors of the
    crystal get different answers, and only exact arithmetic tells which.
    """
    points, rows = _crystal(size, "diamond")
    unit = 5.431 / 4.0
    return Scene(points * unit, 5.431, np.diag(rows * unit).copy(), CUBE)


_TURNS = {
    "3-4-5": (np.array([[3, 4, 0], [-4, 3, 0], [0, 0, 5]]), 5.0),
    "1-2-2": (np.array([[1, 2, 2], [2, 1, -2], [2, -2, 1]]), 3.0),
}


@add(
    {
        "fcc-3-4-5": ("fcc crystal turned in a plane by a rational angle", "3-4-5"),
        "fcc-1-2-2": ("fcc crystal turned in space, coordinates still exact", "1-2-2"),
    }
)
def turned(size: Size, turn: str) -> Scene:
    """Exact ties along no coordinate axis, in a box that is no longer along the axes."""
    matrix, length = _TURNS[turn]
    points, rows = _crystal(size, "fcc")
    return Scene(_float(points @ matrix), 8.0 * length, _float(rows @ matrix), CUBE)


@add({"fcc-rotated": ("fcc crystal turned by a general angle, rounded",)})
def rotated(size: Size) -> Scene:
    """A shell that rounding has spread to both sides of the cutoff.

    Every coordinate and every box vector is rounded, so each pair of the shell is a decision
    of its own, a few units of the last place from the cutoff.
    """
    points, rows = _crystal(size, "fcc")
    return Scene(combine(points, ROTATION), 8.0, combine(rows, ROTATION), CUBE)


def _float(values: NDArray[np.int64]) -> Floats:
    return values.astype(np.float64)
