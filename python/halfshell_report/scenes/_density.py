# SPDX-License-Identifier: BSD-3-Clause
"""Uneven density: cores, halos, clusters far apart, lines, dust, and many points at one place."""

from __future__ import annotations

import math

import numpy as np

from halfshell_report.scenes._catalogue import Floats, Scene, Size, add, pick
from halfshell_report.scenes._make import (
    CUBE,
    combine,
    cube,
    directions,
    exponential,
    integers,
    normal,
    square,
    stream,
)


def _n(size: Size) -> int:
    return pick(size, 100, 4000, 100_000)


@add({"plummer": ("Plummer's star cluster, densities from 1 to 1e-9",)})
def plummer(size: Size) -> Scene:
    """A dense core and a halo a billion times thinner, as in simulations of star clusters.

    No cell size suits both.
    """
    draw, n = stream(24), _n(size)
    # The mass within r is w**3, r = w / sqrt(1 - w**2); density falls with (1 + r**2)**-2.5,
    # to 1e-9 of the centre at r = 63. The largest of three uniform numbers is a cube root.
    root = 0.99987 * draw((n, 3)).max(axis=1)
    radius = root / np.sqrt(1.0 - root * root)
    return Scene(radius[:, None] * directions(draw, n), pick(size, 0.5, 0.2, 0.1))


@add({"lognormal": ("a cloud whose radii are lognormal",)})
def lognormal(size: Size) -> Scene:
    """Density that falls by many decades without an edge: bounds say nothing about the bulk."""
    draw, n = stream(25), _n(size)
    radius = exponential(2.0 * normal(draw, n, 1))
    return Scene(radius * directions(draw, n), pick(size, 0.2, 0.05, 0.02))


@add({"log-scales": ("a cloud with as many points in each of forty octaves of distance",)})
def log_scales(size: Size) -> Scene:
    """Twelve decades of length in one scene.

    Thousands of points are within one cutoff, the rest up to 5e11 cutoffs away.
    """
    draw, n = stream(26), _n(size)
    octave = integers(draw, 0, 39, (n,))
    radius = np.ldexp(1.0 - 0.5 * draw((n,)), -octave)
    return Scene(radius[:, None] * directions(draw, n), math.ldexp(1.0, pick(size, -30, -36, -39)))


@add({"cantor-dust": ("a fractal: clusters of clusters, sixteen levels deep",)})
def cantor_dust(size: Size) -> Scene:
    """Clumps at every scale and voids at every scale, on integers: many equal distances."""
    draw, n = stream(27), _n(size)
    points = np.zeros((n, 3))
    for _ in range(16):
        points = 3.0 * points + 2.0 * integers(draw, 0, 1, (n, 3))
    return Scene(points, float(3 ** pick(size, 15, 13, 12)))


def _two_clusters(size: Size) -> Floats:
    points, _ = cube(size, 28)
    return points + (5e9 * (np.arange(len(points)) % 2))[:, None]


@add({"two-clusters": ("two clusters a billion cutoffs apart, in open space",)})
def two_clusters(size: Size) -> Scene:
    """A volume of 1e27 cells with points in two corners: no grid over it can be stored.

    Their numbers alternate, so that points next to each other in the array never are in space.
    """
    return Scene(_two_clusters(size), 5.0)


@add({"two-clusters-periodic": ("two clusters a billion cutoffs apart, in a periodic box",)})
def two_clusters_periodic(size: Size) -> Scene:
    """The same in a box, where the bounds of the points do not help."""
    return Scene(_two_clusters(size), 5.0, np.full(3, 1e10), CUBE)


@add({"outlier": ("a cloud, and one point 1e12 away",)})
def outlier(size: Size) -> Scene:
    """One stray point, as after a failed step: bounds and float32 offsets are spoilt for all."""
    points, _ = cube(size, 29)
    points[len(points) // 2] = [1e12, -1e12, 3e11]
    return Scene(points, 5.0)


@add({"diagonal": ("points on a line through space",)})
def diagonal(size: Size) -> Scene:
    """All cells of a cube but those along its diagonal are empty."""
    n = _n(size)
    return Scene(combine(stream(30)((n, 1)) * n, np.array([[1.0, 1.0, 1.0]])), 20.0)


@add({"sphere": ("points on a sphere",)})
def sphere(size: Size) -> Scene:
    """A surface: cells are occupied in two dimensions of three, and most are empty."""
    n = _n(size)
    return Scene(directions(stream(31), n) * (5.0 * np.sqrt(n / 80.0)), 5.0)


@add({"dense-core": ("a thin gas around a lump within one cutoff",)})
def dense_core(size: Size) -> Scene:
    """One cell in which every pair counts, among cells with hardly a point in them."""
    points, edge = cube(size, 51)
    lump = points[: len(points) // pick(size, 2, 10, 40)]
    lump[:] = 0.5 * edge + (0.02 / edge) * lump
    return Scene(points, 1.0, np.full(3, edge), CUBE)


@add({"droplet": ("a drop in a box of fifty times its volume",)})
def droplet(size: Size) -> Scene:
    """Vacuum around a liquid: 2 % of the cells hold everything."""
    n, edge = _n(size), pick(size, 37.0, 126.0, 369.0)
    # A ball in a cube, cut out of a uniform cloud: its volume is that of density 0.1.
    radius = pick(size, 6.2, 21.2, 62.04)
    points = 2.0 * stream(32)((2 * n + 100, 3)) - 1.0
    points = points[square(points) <= 1.0][:n] * radius
    return Scene(points, 5.0, np.full(3, edge), CUBE)


@add({"coincident": ("all points at one place",)})
def coincident(size: Size) -> Scene:
    """Bounds of no extent, one cell, every pair at distance 0: the output is quadratic."""
    return Scene(np.tile([0.1, 0.2, 0.3], (pick(size, 60, 1000, 4000), 1)), 1.0)


@add({"twice": ("every point twice",)})
def twice(size: Size) -> Scene:
    """Coincident points among others: each has a twin at distance 0, none is its own neighbour."""
    points, edge = cube(size, 33)
    half = points[: len(points) // 2]
    return Scene(np.concatenate([half, half]), 5.0, np.full(3, edge), CUBE)


@add({"stacked": ("points in stacks of fifty at one place each",)})
def stacked(size: Size) -> Scene:
    """Crowded cells among empty ones: no cell size separates points at the same place."""
    points, edge = cube(size, 34)
    places = points[: len(points) // 50]
    return Scene(np.tile(places, (50, 1)), 1.0, np.full(3, edge), CUBE)


@add({"one-cell": ("all points within one cutoff",)})
def one_cell(size: Size) -> Scene:
    """A grid cannot select anything: every pair counts, and cells only cost time."""
    return Scene(stream(35)((pick(size, 100, 1000, 4000), 3)), 2.0)


@add({"few-cells": ("cutoff half the extent of the points",)})
def few_cells(size: Size) -> Scene:
    """A grid selects hardly anything: a quarter of all pairs count."""
    return Scene(stream(36)((pick(size, 100, 1000, 6000), 3)) * 10.0, 5.0)
