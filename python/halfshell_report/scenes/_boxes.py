# SPDX-License-Identifier: BSD-3-Clause
"""Boxes that are thin, narrow-angled, sheared, turned, or left-handed."""

from __future__ import annotations

import math

import numpy as np

from halfshell_report.scenes._catalogue import add
from halfshell_report.scenes._make import CUBE, ROTATION, combine, cube, integers, stream
from halfshell_report.scenes._scene import Floats, Scene, Size, pick


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
