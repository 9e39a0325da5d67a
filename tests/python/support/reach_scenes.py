# SPDX-License-Identifier: BSD-3-Clause
"""Scenes with a radius for each point, or a type, and what must come out: rational arithmetic."""

from fractions import Fraction

import numpy as np

import definition
import halfshell as hs
from definition import RULES, SYMMETRIC  # noqa: F401, for the tests of reach
from oracles import random_box

# box kind (None: open space) and flags
BOXES = {
    "open": (None, None),
    "periodic": ("orthorhombic", None),
    "mixed": ("triclinic", "first"),
    "triclinic": ("triclinic", None),
    "sheared": ("sheared", None),
    "left-handed": ("left-handed", None),
}


class Reaching:
    """Points with radii or types; of two sets the queries are what comes first.

    `marks`: keywords of the functions, of one set. `n_queries`: None for one set.
    """

    def __init__(
        self, points, cutoff=None, n_queries=None, box=None, periodic=None, inclusive=True, **marks
    ):
        self.points = np.asarray(points)
        self.cutoff = cutoff
        self.n_queries = n_queries
        self.scene = {"box": box, "periodic": periodic, "inclusive": inclusive}
        self.marks = marks
        self.rule = marks.get("rule") or "sum"

    def but(self, **changes):
        """The same with other arguments."""
        return Reaching(**{
            "points": self.points, "cutoff": self.cutoff, "n_queries": self.n_queries,
            **self.scene, **self.marks, **changes,
        })  # fmt: skip

    # ---- what is passed --------------------------------------------------------------------

    @property
    def arguments(self):
        """Of functions of one set."""
        return {"points": self.points, "cutoff": self.cutoff, **self.scene, **self.marks}

    @property
    def of_two_sets(self):
        """Of functions with queries."""
        q = self.n_queries
        found = {"queries": self.points[:q], "points": self.points[q:], "cutoff": self.cutoff}
        found |= self.scene
        if "types" in self.marks:
            types = np.asarray(self.marks["types"])
            return found | {"query_types": types[:q], "types": types[q:]}
        radii = np.asarray(self.marks["radii"])
        if self.rule != "scatter":
            found["query_radii"] = radii[:q]
        if self.rule != "gather":
            found["radii"] = radii[q:]
        return found | {k: v for k, v in self.marks.items() if k != "radii"}

    def fields(self, rows=slice(None)):
        """What is known of these points."""
        known = {k: np.asarray(v)[rows] for k, v in self.marks.items() if k != "rule"}
        return hs.Points(self.points[rows], **known)

    def of_one_set(self):
        """Points in their box, and how they are searched."""
        inclusive = {"inclusive": self.scene["inclusive"], "rule": self.marks.get("rule")}
        scene = {key: self.scene[key] for key in ("box", "periodic")}
        return self.fields().replace(**scene), {k: v for k, v in inclusive.items() if v is not None}

    def full(self):
        """(i, j, S) of rows: what i reaches, or is reached by."""
        points, how = self.of_one_set()
        return definition.rows_that_count(points, self.cutoff, **how)

    def between(self):
        """(i, j, S) of queries and points."""
        points, how = self.of_one_set()
        q = self.n_queries
        return definition.rows_that_count(points[q:], self.cutoff, self.fields(slice(q)), **how)


def check(scene):
    """Assert that all functions find what the definition says; return it, of one set or two."""
    points, how = scene.of_one_set()
    q = scene.n_queries
    if q is not None:
        return definition.check(points[q:], scene.cutoff, scene.fields(slice(q)), **how)
    full = definition.check(points, scene.cutoff, **how)
    return full if scene.rule not in SYMMETRIC else [p for p in full if definition.is_of_half(*p)]


# ---- scenes --------------------------------------------------------------------------------


def boxed(rng, kind, ndim, n, length=1.0):
    """Points about a box of this kind, some outside it; box and flags as keywords."""
    name, flags = BOXES[kind]
    if name is None:
        return rng.random((n, ndim)) * length, {"box": None, "periodic": None}
    box = random_box(rng, name, ndim, length)
    periodic = None if flags is None else np.arange(ndim) == 0
    return rng.uniform(-0.5, 1.5, (n, ndim)) @ box, {"box": box, "periodic": periodic}


def spread_radii(rng, n, largest, decades):
    """Radii over so many decades, a few of them 0, a few equal."""
    radii = largest * 10.0 ** -rng.uniform(0.0, decades, n)
    radii[rng.random(n) < 0.1] = 0.0
    radii[rng.random(n) < 0.1] = largest
    return radii


def touching(rng, n, ndim, hair=False):
    """Balls on a dyadic grid, many of which touch exactly: their sums are distances."""
    points = rng.integers(-8, 9, (n, ndim)) / 4.0
    radii = rng.integers(0, 7, n) / 8.0
    if hair:
        moved = np.nextafter(radii, rng.choice([0.0, 9.0], n))
        radii = np.where((rng.random(n) < 0.3) & (radii > 0.0), moved, radii)
    return points, radii


def distance_is_the_rounded_sum(a, b):
    """Two points whose distance is float64 ``a + b``, and whether they really touch."""
    distance = a + b
    return np.array([[0.0], [distance]]), Fraction(distance) <= Fraction(a) + Fraction(b)
