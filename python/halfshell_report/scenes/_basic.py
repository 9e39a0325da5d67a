# SPDX-License-Identifier: BSD-3-Clause
"""Uniform points, orders of them, other dimensions; crystals whose cutoff lies on a shell."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from halfshell_report.scenes._catalogue import Floats, Scene, Size, add, pick
from halfshell_report.scenes._make import (
    CUBE,
    FCC,
    ROTATION,
    cell_order,
    combine,
    cube,
    sites,
    stream,
)


@add({"uniform": ("points uniform in a periodic cube",)})
def uniform(size: Size) -> Scene:
    """Nothing: the reference with which the others are compared. About 52 neighbours a point."""
    points, edge = cube(size, 1)
    return Scene(points, 5.0, np.full(3, edge), CUBE)


@add(
    {
        "order-random": ("uniform points in random order", "random"),
        "order-sorted": ("the same points along the rows of a grid", "sorted"),
        "order-reversed": ("the same points along the rows of a grid, backwards", "reversed"),
        "order-dealt": ("the same points, each far from the one before", "dealt"),
    }
)
def order(size: Size, kind: str) -> Scene:
    """Where points lie in memory: each one that is read brings a line of the cache with it.

    The answer is the same but for the numbers; the time should nearly be.
    """
    points, edge = cube(size, 40, quick=4, full=20)
    box = np.full(3, edge)
    if kind == "random":
        return Scene(points, 2.5, box, CUBE)
    n = len(points)
    along = cell_order(points, 2.5)
    # About the golden ratio, without a common factor: no two of n steps end at one place.
    step = next(k for k in range(int(0.618 * n), n) if math.gcd(k, n) == 1)
    orders = {"sorted": along, "reversed": along[::-1], "dealt": along[np.arange(n) * step % n]}
    return Scene(points[orders[kind]], 2.5, box, CUBE)


@add({"line-1d": ("uniform points on a periodic line",)})
def line(size: Size) -> Scene:
    """One dimension: little work a point, so that everything else shows."""
    n = pick(size, 100, 4000, 100_000)
    return Scene(stream(41)((n, 1)) * n, 10.0, np.array([float(n)]), (True,))


@add({"line-1d-ties": ("tenths on a line, cutoff 1",)})
def line_ties(size: Size) -> Scene:
    """Two neighbours of each point within rounding of the cutoff: 0.1 is rounded in binary."""
    n = pick(size, 100, 4000, 100_000)
    return Scene(np.arange(float(n)).reshape(n, 1) * 0.1, 1.0)


@add({"plane-2d": ("uniform points in a periodic oblique plane",)})
def plane(size: Size) -> Scene:
    """Two dimensions in an oblique box: cells in a plane, and no third axis to pay for."""
    n = pick(size, 100, 4000, 100_000)
    edge = float(np.sqrt(10.0 * n))
    u, v = stream(42)((n, 2)).T
    points = np.stack([edge * u + 0.4 * edge * v, edge * v], axis=1)
    return Scene(points, 8.0, edge * np.array([[1.0, 0.0], [0.4, 1.0]]), (True, True))


@add({"space-5d": ("uniform points in a periodic box of five dimensions",)})
def five(size: Size) -> Scene:
    """Five dimensions: 243 neighbouring cells, and a ball that fills little of them."""
    n, edge = pick(size, (60, 2.0), (2000, 3.5), (100_000, 7.65))
    return Scene(stream(43)((n, 5)) * edge, 1.0, np.full(5, edge), (True,) * 5)


@add({"space-8d": ("uniform points in open space of eight dimensions",)})
def eight(size: Size) -> Scene:
    """Eight dimensions, the most there are: cells hardly help, and their number explodes."""
    n, edge = pick(size, (100, 1.7), (2000, 2.5), (10_000, 3.0))
    return Scene(stream(44)((n, 8)) * edge, 1.0)


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
