# SPDX-License-Identifier: BSD-3-Clause
"""Cutoffs, boxes and coordinates whose ratios pass the range of float64, in every search.

No power of two brings both a cutoff of 1e-300 and a coordinate of 1e300 to an ordinary size. Each
function is compared with rational arithmetic. The only other answers are those that the
documentation names: S, cells and lists count box vectors, up to 2**51 of them, and a skewed box
places points as well as float64 does.
"""

import math
from fractions import Fraction
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

import halfshell as hs
from calls import call
from full_lists import assert_last_place, entries, full_list, joined, list_between
from halfshell._check.reference import exact_square, reference_pairs
from oracles import as_set, remembered

TOO_FAR = "lies too many box vectors away"
SMALLEST = -1074
LARGEST = 1023


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
    def options(self):
        return {"box": self.box, "periodic": self.periodic}

    @property
    def exact(self):
        return self.cutoff, self.box, self.periodic

    @property
    def loses_digits(self):
        """Whether a coordinate loses digits where the cutoff has an ordinary size."""
        sizes = np.abs(np.concatenate([self.points, self.queries]).astype(np.float64))
        least = sizes[sizes > 0].min(initial=np.inf)
        return self.cutoff > 1.0 and least / self.cutoff < 2.0**-1000

    @property
    def edges(self):
        return [0.0, 0.5 * self.cutoff, self.cutoff]


def unless_too_far(scene, search):
    """The result, or None where shifts cannot be counted and that is what is said."""
    try:
        return search()
    except OverflowError as error:
        assert TOO_FAR in str(error)
        # Twice as far apart are two points on both sides; S is int32.
        assert scene.turns >= 2.0**30
        return None


def unless_it_loses_digits(scene, search):
    """The same for the nearest points, which are then too many to tell which they are."""
    try:
        return unless_too_far(scene, search)
    except MemoryError as error:
        assert "too many images are about as near" in str(error)
        assert scene.loses_digits
        return None


def distances_of(scene, pairs, points):
    return [exact_square(points, i, j, S, scene.box) for i, j, S in pairs]


def binned(squares, edges):
    """As numpy.histogram: half-open, the last one closed."""
    squared = [Fraction(edge) ** 2 for edge in edges]
    counts = [sum(a <= s < b for s in squares) for a, b in pairwise(squared)]
    counts[-1] += sum(s == squared[-1] for s in squares)
    return counts


def pairs_of(table):
    """(row, j), ascending."""
    rows = np.repeat(np.arange(table.n_rows), table.counts)
    return sorted(zip(rows.tolist(), table.indices.tolist()))


def indices(pairs):
    return sorted((i, j) for i, j, _ in pairs)


# ---- checks --------------------------------------------------------------------------------


def check_half(scene):
    """Functions of one set whose answer is the half list, or its numbers."""
    points, cutoff, options = scene.points, scene.cutoff, scene.options
    expected = remembered(reference_pairs, points, *scene.exact)
    squares = distances_of(scene, expected, points)
    i, j = call(hs.pairs, points, cutoff, **options)
    assert sorted(zip(i.tolist(), j.tolist())) == indices(expected)
    found = unless_too_far(
        scene, lambda: call(hs.pairs, points, cutoff, quantities="ijSdD", **options)
    )
    if found is not None:
        assert as_set(*found[:3]) == set(expected)
        assert_last_place(points, cutoff, scene.box, found)
    blocks = list(call(hs.iter_pairs, points, cutoff, max_pairs=3, **options))
    assert sorted((i, j) for a, b in blocks for i, j in zip(a, b)) == indices(expected)
    seen = []
    if (
        unless_too_far(
            scene,
            lambda: call(
                hs.for_each_pair, points, cutoff, lambda *pair: seen.append(pair[:3]), **options
            ),
        )
        is not None
    ):
        assert sorted(seen) == expected
    assert call(hs.count_pairs, points, cutoff, **options) == len(expected)
    strict = sum(s < Fraction(cutoff) ** 2 for s in squares)
    assert call(hs.count_pairs, points, cutoff, inclusive=False, **options) == strict
    counts = [sum(s <= Fraction(c) ** 2 for s in squares) for c in scene.edges]
    assert call(hs.count_pairs, points, scene.edges, **options).tolist() == counts
    assert call(hs.pair_histogram, points, scene.edges, **options).tolist() == binned(
        squares, scene.edges
    )
    assert call(hs.explain, points, cutoff, measure=True, **options).measured["pairs"] == len(
        expected
    )
    twice = np.concatenate([points, points])
    i, j = call(hs.pairs, twice, cutoff, batch=np.arange(12) // 6, **options)
    assert sorted(zip(i.tolist(), j.tolist())) == sorted(
        indices(expected) + [(i + 6, j + 6) for i, j in indices(expected)]
    )


def check_full(scene):
    """Rows of neighbours, of points and of queries."""
    points, queries, cutoff, options = scene.points, scene.queries, scene.cutoff, scene.options
    for asking, expected in (
        (None, full_list(points, *scene.exact)),
        (queries, list_between(queries, points, *scene.exact)),
    ):
        sets = {} if asking is None else {"queries": asking}
        table = call(hs.neighbors, points, cutoff, **sets, **options)
        counts = [sum(i == row for i, *_ in expected) for row in range(table.n_rows)]
        assert sorted(pairs_of(table)) == indices(expected)
        found = unless_too_far(
            scene, partial(hs.neighbors, points, cutoff, quantities="jS", **sets, **options)
        )
        assert found is None or entries(found) == expected
        assert call(hs.coordination, points, cutoff, **sets, **options).tolist() == counts


def check_between(scene):
    points, queries, cutoff, options = scene.points, scene.queries, scene.cutoff, scene.options
    expected = list_between(queries, points, *scene.exact)
    everything = joined(queries, points)
    squares = distances_of(scene, [(i, j + 3, S) for i, j, S in expected], everything)
    i, j = call(hs.pairs_between, queries, points, cutoff, **options)
    assert sorted(zip(i.tolist(), j.tolist())) == indices(expected)
    found = unless_too_far(
        scene,
        lambda: call(hs.pairs_between, queries, points, cutoff, quantities="ijSdD", **options),
    )
    if found is not None:
        assert as_set(*found[:3]) == set(expected)
        i, j, *rest = found
        assert_last_place(everything, cutoff, scene.box, [i, j + 3, *rest])
    assert call(hs.count_pairs, points, cutoff, queries=queries, **options) == len(expected)
    counts = [sum(s <= Fraction(c) ** 2 for s in squares) for c in scene.edges]
    found = call(hs.count_pairs, points, scene.edges, queries=queries, **options)
    assert found.tolist() == counts
    found = call(hs.pair_histogram, points, scene.edges, queries=queries, **options)
    assert found.tolist() == binned(squares, scene.edges)


def set_of_pairs(cells, radius):
    return as_set(*cells.pairs(radius, quantities="ijS"))


def entries_of(search, *arguments):
    return entries(search(*arguments, quantities="jS"))


def number_visited(cells, radius):
    seen = []
    n = cells.for_each_pair(lambda *pair: seen.append(pair), radius)
    assert len(seen) == n
    return n


def check_cells(scene):
    """The same of cells that are kept, with the cutoff they are for and with a smaller one."""
    points, queries = scene.points, scene.queries
    cells = unless_too_far(scene, lambda: hs.CellList(points, scene.cutoff, **scene.options))
    if cells is None:
        return
    assert sorted(cells.order.tolist()) == list(range(6))
    for point, cell in enumerate(cells.cell_of(points).tolist()):
        assert point in cells.order[cells.cell_start[cell] : cells.cell_start[cell + 1]]
    for radius in (scene.cutoff, 0.5 * scene.cutoff):
        exact = radius, scene.box, scene.periodic
        half = remembered(reference_pairs, points, *exact)
        full, between = full_list(points, *exact), list_between(queries, points, *exact)
        assert cells.count_pairs(radius) == len(half)
        assert indices(half) == sorted(zip(*(x.tolist() for x in cells.pairs(radius))))
        blocks = list(cells.iter_pairs(radius, max_pairs=3))
        assert sorted((i, j) for a, b in blocks for i, j in zip(a, b)) == indices(half)
        assert cells.coordination(radius).tolist() == [
            sum(i == row for i, *_ in full) for row in range(6)
        ]
        asked = cells.query(queries, radius)
        assert pairs_of(asked) == indices(between)
        assert cells.pair_histogram([0.0, radius]).tolist() == [len(half)]
        assert cells.pair_histogram([0.0, radius], queries=queries).tolist() == [len(between)]
        for search, expected in (
            (partial(set_of_pairs, cells, radius), set(half)),
            (partial(entries_of, cells.neighbors, radius), full),
            (partial(entries_of, cells.query, queries, radius), between),
            (partial(number_visited, cells, radius), len(half)),
        ):
            found = unless_too_far(scene, search)
            assert found is None or found == expected
        assert cells.query(queries, np.full(3, radius)).counts.tolist() == asked.counts.tolist()
    found = unless_it_loses_digits(
        scene, lambda: cells.nearest(3, max_distance=scene.cutoff, quantities="jS")
    )
    assert found is None or nearest_rows(*found) == expected_nearest(scene, None, 3)


def check_verlet(scene):
    points, cutoff = scene.points, scene.cutoff
    cells = hs.VerletList(0.5 * cutoff, skin=0.5 * cutoff, **scene.options)
    for moved in (points, points + np.array(0.125 * cutoff, points.dtype)):
        if unless_too_far(scene, partial(cells.update, moved)) is None:
            return
        expected = remembered(reference_pairs, moved, 0.5 * cutoff, scene.box, scene.periodic)
        found = unless_too_far(scene, lambda: cells.pairs(quantities="ijSdD"))
        if found is not None:
            assert as_set(*found[:3]) == set(expected)
            assert_last_place(moved, 0.5 * cutoff, scene.box, found)


def nearest_rows(j, S):
    return [[(a, tuple(s)) for a, s in zip(*row) if a >= 0] for row in zip(j.tolist(), S.tolist())]


def expected_nearest(scene, queries, k):
    points = scene.points
    if queries is None:
        rows, found, everything = 6, full_list(points, *scene.exact), points
    else:
        rows, found = 3, list_between(queries, points, *scene.exact)
        everything = joined(queries, points)
    shift = 0 if queries is None else 3
    ranked = sorted(
        (exact_square(everything, i, j + shift, S, scene.box), j, S, i) for i, j, S in found
    )
    return [[(j, S) for _, j, S, i in ranked if i == row][:k] for row in range(rows)]


def check_nearest(scene):
    for queries in (None, scene.queries):
        expected = expected_nearest(scene, queries, 3)
        how = {"queries": queries, "max_distance": scene.cutoff, **scene.options}
        found = unless_it_loses_digits(scene, partial(hs.nearest, scene.points, 3, **how))
        if found is None:
            continue
        assert [[a for a in row if a >= 0] for row in found[0].tolist()] == [
            [j for j, _ in row] for row in expected
        ]
        found = unless_it_loses_digits(
            scene, partial(hs.nearest, scene.points, 3, quantities="jS", **how)
        )
        assert found is None or nearest_rows(*found) == expected


CHECKS = [check_half, check_full, check_between, check_cells, check_verlet, check_nearest]


# ---- sweeps --------------------------------------------------------------------------------


def scene_of(family, seed):
    rng = np.random.default_rng(seed)
    if family == "subnormal":
        return Scene.with_subnormals(rng, 2 + seed % 2)
    ndim = 3 if family == "skewed" else 1 + seed % 3
    return Scene(rng, ndim, single=family == "float32", skewed=family == "skewed")


@pytest.mark.parametrize(
    ("family", "seeds"),
    [
        *(("any ratio", range(k, k + 40)) for k in range(0, 160, 40)),
        *(
            (family, range(20 * k, 20 * k + 20))
            for k in range(3)
            for family in ("float32", "skewed")
        ),
        ("subnormal", range(40)),
    ],
    ids=str,
)
def test_every_search(family, seeds):
    for seed in seeds:
        scene = scene_of(family, seed)
        for check in CHECKS:
            check(scene)
