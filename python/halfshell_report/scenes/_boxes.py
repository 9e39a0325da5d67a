# SPDX-License-Identifier: BSD-3-Clause
"""Boxes that are thin, narrow, sheared, turned, half open; cutoffs much shorter or longer."""

from __future__ import annotations

import math

import numpy as np

from halfshell_report.scenes._catalogue import Floats, Scene, Size, add, pick
from halfshell_report.scenes._make import CUBE, ROTATION, combine, cube, integers, stream


@add({"needle": ("box a million times longer than wide, cutoff five widths",)})
def needle(size: Size) -> Scene:
    """An aspect ratio of 1e6, and several images of each pair across the two short edges.

    A grid of equal numbers of cells along the axes, or one image a pair, does not work here.
    """
    box = np.array([1e6, 1.0, 1.0])
    return Scene(stream(9)((pick(size, 60, 3000, 100_000), 3)) * box, 5.0, box, CUBE)


@add({"plate": ("box a million times wider than thick, cutoff twenty thicknesses",)})
def plate(size: Size) -> Scene:
    """An aspect ratio of 1e6, mostly empty plane, and forty images of each neighbour."""
    box, draw = np.array([1e6, 1e6, 1.0]), stream(10)
    points = draw((pick(size, 20, 1500, 50_000), 3)) * box
    partners = points + (2.0 * draw(points.shape) - 1.0) * np.array([15.0, 15.0, 0.5])
    return Scene(np.concatenate([points, partners]), 20.0, box, CUBE)


# Cosine, sine, and the edge of the box over that of the cube of the same volume.
_ANGLES = {
    30: (0.8660254037844387, 0.5, 1.653),
    5: (0.9961946980917455, 0.08715574274765817, 5.336),
    1: (0.9998476951563913, 0.01745240643728351, 15.59),
}


@add(
    {
        "angle-30": ("box with three angles of 30 degrees", 30),
        "angle-5": ("box with three angles of 5 degrees", 5),
        "angle-1": ("box with three angles of 1 degree", 1),
    }
)
def narrow(size: Size, degrees: int) -> Scene:
    """Box vectors that are nearly parallel: the box is a spike, much longer than it is thick.

    Nearest images are many box vectors away, and a grid along the given vectors would have
    slivers for cells.
    """
    cosine, sine, stretch = _ANGLES[degrees]
    y = (cosine - cosine * cosine) / sine
    rows = [[1.0, 0.0, 0.0], [cosine, sine, 0.0], [cosine, y, math.sqrt(sine * sine - y * y)]]
    return _filled(size, 11, np.array(rows), stretch)


@add({"angle-179": ("box with an angle of 179 degrees",)})
def obtuse(size: Size) -> Scene:
    """Two box vectors that are nearly opposite, so that their sum is the short way round."""
    return _filled(size, 12, np.array([[1.0, 0.0, 0.0], [-57.28996163, 1.0, 0.0], [0, 0, 1.0]]))


@add(
    {
        "sheared-1000": (
            "cube sheared by 1000 widths: the same lattice",
            [[1.0, 0.0, 0.0], [1000.0, 1.0, 0.0], [-1000.0, 1000.0, 1.0]],
        ),
        "sheared-oblique": (
            "box sheared by no whole number of widths",
            [[1.0, 0.0, 0.0], [1000.37, 1.0, 0.0], [-999.41, 1000.23, 1.0]],
        ),
    }
)
def sheared(size: Size, shape: list[list[float]]) -> Scene:
    """Vectors a thousand and a million times longer than the cell that they span.

    The box has to be reduced without rounding, and shifts over the given vectors are large.
    """
    points, edge = cube(size, 13)
    return Scene(points, 5.0, edge * np.array(shape), CUBE)


@add({"left-handed": ("triclinic box of negative volume",)})
def left_handed(size: Size) -> Scene:
    """Box vectors in left-handed order: a volume or a height of the wrong sign."""
    return _filled(size, 14, np.array([[0.31, 1.07, 0.0], [1.0, -0.12, 0.1], [-0.2, 0.3, 0.93]]))


@add({"rotated-box": ("cube turned by a general angle",)})
def rotated(size: Size) -> Scene:
    """A cube whose vectors have no zeros: code that expects triangular matrices fails."""
    return _filled(size, 15, ROTATION)


@add({"rotated-needle": ("thin triclinic box turned by a general angle, points not wrapped",)})
def rotated_needle(size: Size) -> Scene:
    """Everything at once: edges of 1000 to 1, turned, left-handed, points many boxes away."""
    rows = combine(np.array([[0.2, 0.0, 0.02], [0.0, 200.0, 0.0], [0.0, 3.0, 0.2]]), ROTATION)
    n, draw = pick(size, 60, 3000, 100_000), stream(16)
    box = pick(size, 2.0, 10.0, 32.0) * rows[[1, 0, 2]]
    far = draw((n, 3)) + integers(draw, -500, 500, (n, 3))
    return Scene(combine(far, box), 5.0, box, CUBE)


def _filled(size: Size, seed: int, rows: Floats, stretch: float = 1.0) -> Scene:
    """Points uniform in a box of this shape."""
    points, edge = cube(size, seed)
    box = (edge * stretch) * rows
    return Scene(combine(points / edge, box), 5.0, box, CUBE)


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
