# SPDX-License-Identifier: BSD-3-Clause
"""Cutoffs much shorter and much longer than the box, and boxes that do not repeat everywhere."""

from __future__ import annotations

import numpy as np

from halfshell_report.scenes._catalogue import add
from halfshell_report.scenes._make import CUBE, combine, cube, integers, stream
from halfshell_report.scenes._scene import Scene, Size, pick


@add({"cutoff-tiny": ("cutoff a millionth of the box",)})
def tiny(size: Size) -> Scene:
    """There would be 1e18 cells as wide as the cutoff: memory must follow points, not volume.

    Points come in pairs, about half of which are within the cutoff.
    """
    draw = stream(17)
    points = draw((pick(size, 50, 2000, 50_000), 3))
    partners = points + 1e-6 * (2.0 * draw(points.shape) - 1.0)
    return Scene(np.concatenate([points, partners]), 1e-6, np.ones(3), CUBE)


@add({"cutoff-zero": ("cutoff 0: pairs are points at one place",)})
def zero(size: Size) -> Scene:
    """Neither a cell size nor a relative margin can be derived from this cutoff.

    Each point is there twice, the second time moved by whole box vectors.
    """
    draw, shape = stream(18), (pick(size, 50, 2000, 50_000), 3)
    # Few enough digits that adding whole numbers is exact.
    points = integers(draw, 0, 2**24 - 1, shape) * 2.0**-24
    return Scene(
        np.concatenate([points, points + integers(draw, -3, 3, shape)]), 0.0, np.ones(3), CUBE
    )


@add({"cutoff-30": ("cutoff thirty times the box",)})
def thirty(size: Size) -> Scene:
    """A hundred thousand images of each pair, and of each point with itself.

    The output is all there is; shifts have to be enumerated without missing or repeating one.
    """
    rows = np.array([[1.0, 0.0, 0.0], [0.23, 1.0, 0.0], [-0.31, 0.17, 1.0]])
    fractions = stream(19)((pick(size, 2, 3, 12), 3))
    return Scene(combine(fractions, rows), 30.0, rows, CUBE)


@add({"cutoff-2-boxes": ("a small cell, cutoff beyond two boxes",)})
def cell(size: Size) -> Scene:
    """A unit cell as in simulations of crystals: each pair occurs in dozens of images."""
    n = pick(size, 8, 80, 200)
    return Scene(stream(20)((n, 3)) * 5.43, 12.0, np.full(3, 5.43), CUBE)


@add({"thin-slab": ("periodic in two directions that are short, open and long in the third",)})
def thin_slab(size: Size) -> Scene:
    """Twenty images of each pair within a plane, and layers of them far apart."""
    n = pick(size, 40, 2000, 50_000)
    box = np.array([4.0, 4.0, 0.0])
    points = stream(49)((n, 3)) * np.array([4.0, 4.0, 1.0 * n])
    return Scene(points, 10.0, box, (True, True, False))


@add({"thin-wire": ("periodic along one short direction, open in the others",)})
def thin_wire(size: Size) -> Scene:
    """Columns: the images of a point stand above each other, ten within each cutoff."""
    n = pick(size, 60, 3000, 100_000)
    edge = np.sqrt(10.0 * n)
    points = stream(50)((n, 3)) * np.array([edge, edge, 1.0])
    return Scene(points, 5.0, np.array([0.0, 0.0, 1.0]), (False, False, True))


@add({"slab": ("periodic in two directions, third box vector zero",)})
def slab(size: Size) -> Scene:
    """Two periodic directions in a tilted plane; the third has no box vector at all."""
    points, edge = cube(size, 21)
    box = edge * np.array([[1.0, 0.1, 0.3], [-0.4, 0.9, 0.0], [0.0, 0.0, 0.0]])
    upright = np.array([0.0, 0.0, edge])
    factors = points / edge
    return Scene(
        combine(factors, box) + factors[:, [2]] * upright, 5.0, box, (True, True, False)
    )


@add({"wire": ("periodic along one oblique direction",)})
def wire(size: Size) -> Scene:
    """One periodic direction that is no coordinate axis, and points well outside the box."""
    points, edge = cube(size, 22)
    box = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.3 * edge, -0.2 * edge, edge]])
    along = integers(stream(23), -2, 2, (len(points), 1)) * box[2]
    return Scene(points + along, 5.0, box, (False, False, True))
