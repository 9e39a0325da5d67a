# SPDX-License-Identifier: BSD-3-Clause
"""Other numbers of dimensions than three."""

from __future__ import annotations

import numpy as np

from halfshell.scenes._catalogue import add
from halfshell.scenes._make import stream
from halfshell.scenes._scene import Scene, Size, pick


@add({"line-1d": ("uniform points on a periodic line",)})
def line(size: Size) -> Scene:
    """One dimension: little work a point, so that everything else shows."""
    n = pick(size, 100, 4000, 100_000)
    return Scene(stream(41)((n, 1)) * n, 10.0, np.array([float(n)]), (True,))


@add({"line-1d-ties": ("whole numbers on a line, cutoff a whole number",)})
def line_ties(size: Size) -> Scene:
    """One dimension, two pairs of each point at exactly the cutoff, and none may be lost."""
    n = pick(size, 100, 4000, 100_000)
    return Scene(np.arange(float(n)).reshape(-1, 1) * 0.1, 1.0)


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
