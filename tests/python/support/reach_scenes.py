# SPDX-License-Identifier: BSD-3-Clause
"""Scenes with a radius for each point, or a type, and what must come out: rational arithmetic."""

from fractions import Fraction

import numpy as np

import halfshell as hs
from calls import call
from full_lists import both_ways, entries
from halfshell._check.reference import (
    exact_square,
    reach_by_radii,
    reach_by_types,
    reference_pairs,
    ulp_error,
)
from oracles import by_kernels, random_box, triples

SYMMETRIC = ("sum", "mean", "max", "min")
RULES = (*SYMMETRIC, "gather", "scatter")

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

    # ---- what must come out ----------------------------------------------------------------

    def reach(self):
        """How far i reaches j, exactly."""
        if "types" in self.marks:
            return reach_by_types(list(self.marks["types"]), self.cutoff)
        return reach_by_radii(self.marks["radii"], self.rule, self.cutoff)

    def half(self):
        """Each pair once; of rules without a direction."""
        return self._among("there")

    def full(self):
        """(i, j, S) of rows: what i reaches, or is reached by."""
        if self.rule in SYMMETRIC:
            return both_ways(self.half())
        back = [(j, i, tuple(-s for s in S)) for i, j, S in self._among("back")]
        return sorted(self._among("there") + back)

    def between(self):
        """(i, j, S) of queries and points."""
        q = self.n_queries
        return sorted((i, j - q, S) for i, j, S in self._among("there") if i < q <= j)

    def _among(self, way):
        """(i, j, S) with i <= j within the reach of i to j, or "back" of j to i."""
        reach = self.reach()
        if way == "back":
            reach = [list(column) for column in zip(*reach)]
        return reference_pairs(self.points, reach, **self.scene)


def check(scene, **how):
    """Assert that all functions find what the definition says; return it, of one set or two.

    By every kernel, unless one is named.
    """
    if scene.n_queries is not None:
        return _check_between(scene, how)
    full = scene.full()
    half = None if scene.rule not in SYMMETRIC else [p for p in full if _is_of_half(*p)]
    for by in by_kernels(how):
        table = call(hs.neighbors, **scene.arguments, quantities="jS", **by)
        assert entries(table) == full
        counts = call(hs.coordination, **scene.arguments, **by)
        assert counts.tolist() == table.counts.tolist()
        if half is not None:
            found = call(hs.pairs, **scene.arguments, quantities="ijS", sort=True, **by)
            assert triples(*found) == half
            unsorted = call(hs.pairs, **scene.arguments, quantities="ijS", **by)
            assert sorted(triples(*unsorted)) == half
            assert call(hs.count_pairs, **scene.arguments, **by) == len(half)
    return full if half is None else half


def _is_of_half(i, j, S):
    return i < j or (i == j and S > (0,) * len(S))


def _check_between(scene, how):
    expected = scene.between()
    arguments = scene.of_two_sets
    numbers = np.bincount([i for i, _, _ in expected], minlength=scene.n_queries).tolist()
    for by in by_kernels(how):
        assert triples(*call(hs.pairs_between, **arguments, quantities="ijS", **by)) == expected
        assert entries(call(hs.neighbors, **arguments, quantities="jS", **by)) == expected
        assert call(hs.count_pairs, **arguments, **by) == len(expected)
        assert call(hs.coordination, **arguments, **by).tolist() == numbers
    return expected


def assert_last_place(scene, i, j, S, d):
    """d of pairs of one set is within 1 ulp, and on the right side of the rounded reach."""
    reach = scene.reach()
    for a, b, shift, length in zip(i.tolist(), j.tolist(), S.tolist(), d.tolist()):
        square = exact_square(scene.points, a, b, shift, scene.scene["box"])
        assert ulp_error(length, square) <= 1
        assert length <= float(reach[a][b])


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
