# SPDX-License-Identifier: BSD-3-Clause
"""Cutoffs, boxes and coordinates whose ratios pass the range of float64, in every search.

No power of two brings both a cutoff of 1e-300 and a coordinate of 1e300 to an ordinary size. Each
function is compared with rational arithmetic. The only other answers are those that the
documentation names: S, cells and lists count box vectors, up to 2**51 of them, and a skewed box
places points as well as float64 does.
"""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import settings

import definition
import halfshell as hs

TOO_FAR = "lies too many box vectors away"
SMALLEST = -1074
LARGEST = 1023
#: Times as many scenes as usually, with HALFSHELL_EXAMPLES.
MANY = -(-settings().max_examples // 50)


# ---- scenes --------------------------------------------------------------------------------


def power(rng, lowest, highest):
    """A number between two powers of two, of any exponent with the same probability."""
    exponent = int(rng.integers(max(lowest, SMALLEST), min(highest, LARGEST - 1) + 1))
    return max(math.ldexp(rng.uniform(1, 2), exponent), math.ldexp(1.0, SMALLEST))


def place(rng, places, cutoff):
    """A coordinate at one of some places, or about a cutoff from it."""
    x = rng.choice(places)
    step = rng.choice([0.0, cutoff, 0.5 * cutoff, cutoff * rng.uniform(0, 1.5)])
    moved = x + step * rng.choice([-1, 1])
    moved = np.nextafter(x, rng.choice([-np.inf, np.inf])) if rng.random() < 0.1 else moved
    return float(moved) if math.isfinite(moved) else float(x)


class Scene:
    """Points, queries, a cutoff and a box; `turns`: about how many box vectors points are away."""

    def __init__(self, rng, ndim, single=False, skewed=False):
        exponent = int(rng.integers(SMALLEST, LARGEST - 22))
        if single:  # so that float32 holds both ends
            exponent = int(rng.integers(-149, 100))
        cutoff = (
            float(math.ldexp(rng.uniform(1, 2), exponent))
            if exponent > -1022
            else (math.ldexp(int(rng.integers(1, 9)), exponent))
        )
        flags = rng.random(ndim) < 0.6
        if skewed:
            flags[:2] = True
        lengths = np.zeros(ndim)
        columns, self.turns = [], Fraction(0)
        for k in range(ndim):
            if flags[k]:
                longest = [exponent + 3, exponent + 60, LARGEST][rng.integers(3 - 2 * skewed)]
                lengths[k] = max(power(rng, exponent, longest), cutoff)
            far = power(rng, exponent + 5, [exponent + 70, LARGEST][rng.integers(2)])
            if skewed and k < 2:
                far = lengths[k] = lengths[0]
            places = [0.0, far, -far, 0.5 * lengths[k], -0.5 * lengths[k]]
            columns.append([place(rng, places, cutoff) for _ in range(9)])
            if flags[k]:
                largest = max(map(abs, columns[k]))
                self.turns = max(self.turns, Fraction(largest) / Fraction(lengths[k]))
        everything = np.array(columns).T
        if single:
            with np.errstate(over="ignore"):
                narrow = everything.astype(np.float32)
            everything = np.where(np.isfinite(narrow), narrow, np.float32(0)).astype(np.float32)
        self.points, self.queries, self.cutoff = everything[:6], everything[6:], cutoff
        self.box = np.diag(lengths) if flags.any() else None
        if skewed:
            self.box[1, 0] = 0.3 * lengths[0]
        self.periodic = flags if flags.any() else None

    @classmethod
    def with_subnormals(cls, rng, ndim):
        """A long period, a short one and numbers that any scale between them brings to nothing."""
        scene = cls.__new__(cls)
        exponent = int(rng.choice([-30, -1, 1, 10, 20, 21, 60, 500, 990]))
        scene.cutoff = math.ldexp(rng.choice([0.5, 1.0, 1.5, 2.5]), exponent)
        short = math.ldexp(1.0, exponent)
        long = math.ldexp(rng.choice([1.0, -1.25]), int(rng.integers(max(965, exponent + 2), 1021)))
        lengths = rng.permutation([short, long, rng.choice([short, long])])[:ndim]
        lengths[:2] = rng.permutation([short, long])
        tiny = [5e-324, -1e-310, math.ldexp(1.0, -1050), math.ldexp(1.0, -1000)]
        columns = []
        for length in lengths:
            near = 0.5 * length - math.copysign(min(scene.cutoff, abs(length) / 4), length)
            far = [0.0, *tiny, 0.5 * length, -0.5 * length, near, 3 * length, -5.5 * length]
            columns.append(rng.choice(far, 9))
        scene.turns = Fraction(6)
        scene.points, scene.queries = np.array(columns).T[:6], np.array(columns).T[6:]
        scene.box, scene.periodic = np.diag(lengths), rng.random(ndim) < 0.8
        return scene

    @property
    def loses_digits(self):
        """Whether a coordinate loses digits where the cutoff has an ordinary size."""
        sizes = np.abs(np.concatenate([self.points, self.queries]).astype(np.float64))
        least = sizes[sizes > 0].min(initial=np.inf)
        return self.cutoff > 1.0 and least / self.cutoff < 2.0**-1000

    def check(self, inclusive):
        """Each function, of one set and of two; without S where that does not fit."""
        points = hs.Points(self.points)
        if self.box is not None:
            points = points.replace(box=self.box, periodic=self.periodic)
        for queries in (None, hs.Points(self.queries)):
            with_queries = {} if queries is None else {"queries": queries}
            try:
                definition.check(points, self.cutoff, inclusive=inclusive, **with_queries)
            except OverflowError as error:
                assert TOO_FAR in str(error)
                # Twice as far apart are two points on both sides; S is int32.
                assert self.turns >= 2.0**30
                self.check_without_shifts(points, queries, {"inclusive": inclusive})
            except MemoryError as error:  # of the nearest, too many to tell which they are
                assert "too many images are about as near" in str(error)
                assert self.loses_digits

    def check_without_shifts(self, points, queries, how):
        every = definition.measured_pairs(points, self.cutoff, queries, None, None, None, **how)
        found = [entry[:2] for entry in every]
        counts = np.bincount([i for i, _ in found], minlength=len(queries or points)).tolist()
        how |= {} if queries is None else {"queries": queries}
        assert sorted(zip(*map(list, hs.neighbors(points, self.cutoff, **how).to_pairs()))) == found
        assert hs.coordination(points, self.cutoff, **how).tolist() == counts
        if queries is None:
            found = [entry[:2] for entry in every if definition.is_of_half(*entry[:3])]
            listed = hs.pairs(points, self.cutoff, **how)
            blocks = list(hs.iter_pairs(points, self.cutoff, quantities="P", max_pairs=3, **how))
            blocks = np.concatenate([np.empty((0, 2), int), *blocks])
            assert np.array_equal(blocks, np.stack(listed, axis=1))
        else:
            one = {key: value for key, value in how.items() if key != "queries"}
            listed = hs.pairs_between(queries, points, self.cutoff, **one)
        assert sorted(zip(*map(list, listed))) == found
        assert hs.count_pairs(points, self.cutoff, **how) == len(found)
        if how["inclusive"]:
            of_all = {key: value for key, value in how.items() if key != "inclusive"}
            assert hs.pair_histogram(points, [0.0, self.cutoff], **of_all) == [len(found)]
        try:
            definition.check_nearest(points, self.cutoff, every, how, "j")
        except MemoryError:
            assert self.loses_digits


def scene_of(family, seed):
    rng = np.random.default_rng(seed)
    if family == "subnormal":
        return Scene.with_subnormals(rng, 2 + seed % 2)
    ndim = 3 if family == "skewed" else 1 + seed % 3
    return Scene(rng, ndim, single=family == "float32", skewed=family == "skewed")


@pytest.mark.parametrize(
    ("family", "seeds"),
    [
        *(("any ratio", range(k, k + 20)) for k in range(0, 80 * MANY, 20)),
        *((f, range(k, k + 15)) for k in range(0, 30 * MANY, 15) for f in ("float32", "skewed")),
        *(("subnormal", range(k, k + 20)) for k in range(0, 20 * MANY, 20)),
    ],
    ids=str,
)
def test_every_search(family, seeds):
    for seed in seeds:
        scene_of(family, seed).check(inclusive=seed % 3 > 0)
