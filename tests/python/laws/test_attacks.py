# SPDX-License-Identifier: BSD-3-Clause
"""Small scenes of every scale against a brute force in fractions.

Where other tests look at one function or one scale, here everything that can go wrong meets: ties
on the cutoff, units from subnormal numbers to 1e150, sheared boxes that repeat along some axes,
points moved by box vectors, float32 beside float64, and all functions and tables, sorted and
filtered.
"""

import itertools
import math
import random
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from calls import call
from full_lists import entries
from oracles import same_arrays, triples
from rational_images import Images, between, exact

# ---- brute force, in fractions -------------------------------------------------------------


class Brute:
    """All pairs (i, j, S, square, vector) of queries and points, ascending."""

    def __init__(self, points, cutoff, box, periodic, queries=None):
        images = Images(points.shape[1], box, periodic)
        rows = [exact(row) for row in points.tolist()]
        asking = rows if queries is None else [exact(row) for row in queries.tolist()]
        self.limit = self.squared(cutoff)
        self.pairs = sorted(
            (i, j, S, square, D)
            for i, p in enumerate(asking)
            for j, q in enumerate(rows)
            for S, D, square in images.within(between(p, q), self.limit)
            if queries is not None or i != j or any(S)
        )

    def squared(self, length):
        return Fraction(length) ** 2

    def half(self):
        return [p for p in self.pairs if p[0] < p[1] or (p[0] == p[1] and p[2] > (0,) * len(p[2]))]

    def check_numbers(self, pair, d, D, largest):
        """d within 1 ulp and not beyond its bound, D within 1 ulp of |D|."""
        *_, square, vector = pair
        below, above = math.nextafter(d, -math.inf), math.nextafter(d, math.inf)
        assert below < 0 or self.squared(below) <= square
        assert square <= self.squared(above)
        assert 0.0 <= d <= largest
        for x, true in zip(D.tolist(), vector, strict=True):
            assert abs(Fraction(x) - true) <= Fraction(math.ulp(above))


def keys(pairs):
    return [pair[:3] for pair in pairs]


def by_distance(pairs):
    return keys(sorted(pairs, key=lambda p: (p[0], p[3], p[1], p[2])))


# ---- scenes --------------------------------------------------------------------------------

UNITS = [1.0, 0.1, 1 / 3, 2.0**-30, 1e-200, 7e150, 3 * 5e-324, 1e-310]


class Ties:
    """Points on a lattice of any unit, a cutoff on a shell or next to it, a box of its vectors."""

    def __init__(self, seed):
        self.random = rng = random.Random(seed)
        unit = UNITS[seed % len(UNITS)]
        ndim = rng.choice([1, 2, 2, 3, 3, 4, 5])
        side = {1: 6, 2: 4, 3: 2, 4: 2, 5: 1}[ndim]
        self.n = rng.choice([3, 6, 8]) if ndim < 4 else 4
        both = np.array([
            [rng.randint(-side, side) * unit for _ in range(ndim)] for _ in range(self.n + 3)
        ])  # fmt: skip
        shell = rng.choice([1, 2, 3, 5]) if ndim < 4 else rng.choice([1, 1, 2])
        self.cutoff = math.sqrt(shell) * unit
        if unit < 1e-300:
            self.cutoff = unit * rng.choice([1, 2])
        if rng.random() < 0.4:
            self.cutoff = math.nextafter(self.cutoff, rng.choice([0, math.inf]))
        self.periodic = [rng.random() < 0.7 for _ in range(ndim)]
        self.box = None
        if any(self.periodic):
            self.box = np.diag([
                rng.choice([1, 2, 2, 3, -2]) * unit * (2 if ndim >= 4 else 1) for _ in range(ndim)
            ])  # fmt: skip
            if ndim > 1 and rng.random() < 0.5:
                a, b = rng.sample(range(ndim), 2)
                self.box[a] += rng.choice([1, -1, 2, 5]) * self.box[b]
            if rng.random() < 0.5:
                for row in both:
                    for k in np.flatnonzero(self.periodic):
                        row += rng.choice([0, 0, 1, -3, 1000]) * self.box[k]
        else:
            self.periodic = None
        with np.errstate(over="ignore", under="ignore"):
            single = both.astype(np.float32)
        if rng.random() < 0.3 and np.isfinite(single).all():
            both = single
        self.points, self.queries = both[: self.n], both[self.n :]
        self.how = {"box": self.box, "periodic": self.periodic}
        self.types = np.array([2, *(rng.randrange(3) for _ in range(self.n - 1))])
        self.edges = sorted({0.0, self.cutoff / 3, self.cutoff / 2, self.cutoff})
        self.some = {"kernel": rng.choice(hs.kernels()), "threads": rng.choice([1, 2, 3])}

    def brute(self, queries=None, points=None, cutoff=None):
        points = self.points if points is None else points
        cutoff = self.cutoff if cutoff is None else cutoff
        return Brute(points, cutoff, self.box, self.periodic, queries)


def histogram(brute, pairs, edges):
    squares = [brute.squared(edge) for edge in edges]
    counts = [sum(a <= p[3] < b for p in pairs) for a, b in itertools.pairwise(squares)]
    counts[-1] += sum(p[3] == squares[-1] for p in pairs)
    return counts


def check_table(scene, table, brute, pairs, largest):
    """A table with jSdD: its rows, each number, what sort, filter and graph make of them."""
    assert entries(table) == keys(pairs)
    for pair, d, D in zip(pairs, table.distances.tolist(), table.vectors, strict=True):
        brute.check_numbers(pair, d, D, largest[pair[0]])
    assert entries(table.sort()) == by_distance(pairs)
    mask = np.array([scene.random.random() < 0.6 for _ in pairs], bool)
    kept = [pair for pair, keep in zip(pairs, mask, strict=True) if keep]
    filtered = table.filter(mask)
    assert entries(filtered) == keys(kept)
    assert entries(filtered.sort()) == by_distance(kept)
    assert entries(table.sort().filter(np.ones(len(mask), bool)).sort()) == by_distance(pairs)
    graph = table.sort().graph()
    ordered = table.sort()
    assert np.array_equal(graph.edge_index[0], ordered.indices)
    assert np.array_equal(graph.shifts, -ordered.shifts)
    assert np.array_equal(graph.vectors, -ordered.vectors)


in_parts = pytest.mark.parametrize("seeds", [range(k, 48, 3) for k in range(3)], ids=str)


# ---- one scene, one function after the other ------------------------------------------------


@in_parts
def test_half_lists_and_reductions(seeds):
    for seed in seeds:
        scene = Ties(seed)
        points, cutoff, how = scene.points, scene.cutoff, scene.how | scene.some
        brute = scene.brute()
        half = brute.half()
        strict = [pair for pair in half if pair[3] < brute.limit]
        for inclusive, expected in ((True, half), (False, strict)):
            i, j, S, d, D = call(
                hs.pairs, points, cutoff, quantities="ijSdD", sort=True, inclusive=inclusive, **how
            )
            assert triples(i, j, S) == keys(expected)
            largest = cutoff if inclusive else math.nextafter(cutoff, 0.0)
            for pair, length, vector in zip(expected, d.tolist(), D, strict=True):
                brute.check_numbers(pair, length, vector, largest)
        assert call(hs.pair_histogram, points, scene.edges, **how).tolist() == histogram(
            brute, half, scene.edges
        )
        by_type = call(hs.pair_histogram, points, scene.edges, types=scene.types, **how)
        for a in range(3):
            for b in range(a, 3):
                mine = [p for p in half if sorted(scene.types[[p[0], p[1]]].tolist()) == [a, b]]
                counts = histogram(brute, mine, scene.edges)
                assert by_type[a, b].tolist() == by_type[b, a].tolist() == counts
        within = [sum(p[3] < brute.squared(c) for p in half) for c in scene.edges]
        assert call(hs.count_pairs, points, scene.edges, inclusive=False, **how).tolist() == within
        parts = []
        blocks = list(
            call(hs.iter_pairs, points, cutoff, max_pairs=2, progress=parts.append, **how)
        )
        assert sorted((a, b) for i, j in blocks for a, b in zip(i, j, strict=True)) == sorted(
            pair[:2] for pair in half
        )
        assert parts == sorted(parts) and parts[-1] == 1.0


@in_parts
def test_tables_of_points_and_of_queries(seeds):
    for seed in seeds:
        scene = Ties(seed)
        points, queries, cutoff = scene.points, scene.queries, scene.cutoff
        for asking in (None, queries):
            brute = scene.brute(asking)
            options = {"queries": asking, **scene.how, **scene.some}
            table = call(hs.neighbors, points, cutoff, quantities="jSdD", **options)
            largest = [cutoff] * len(table)
            check_table(scene, table, brute, brute.pairs, largest)
            bare = call(hs.neighbors, points, cutoff, quantities="jd", **options).sort()
            assert same_arrays(bare.indices, table.sort().indices)
            j, S = call(hs.nearest, points, 3, max_distance=cutoff, quantities="jS", **options)
            for i, (row, shifts) in enumerate(zip(j.tolist(), S.tolist(), strict=True)):
                mine = [key[1:] for key in by_distance(p for p in brute.pairs if p[0] == i)][:3]
                assert [(a, tuple(s)) for a, s in zip(row, shifts) if a >= 0] == mine


@in_parts
def test_cells_are_asked_with_a_radius_for_each_query(seeds):
    for seed in seeds:
        scene = Ties(seed)
        cells = hs.CellList(scene.points, scene.cutoff, threads=scene.some["threads"], **scene.how)
        brute = scene.brute(scene.queries)
        radii = [scene.random.choice([0.0, 0.5, 0.9, 1.0]) * scene.cutoff for _ in scene.queries]
        pairs = [pair for pair in brute.pairs if pair[3] <= brute.squared(radii[pair[0]])]
        table = call(
            cells.query, scene.queries, radii, quantities="jSdD", kernel=scene.some["kernel"]
        )
        check_table(scene, table, brute, pairs, radii)
        block = cells.candidates()
        everything = scene.brute()
        for i in range(scene.n):
            ranges = range(*block.offsets[i : i + 2])
            found = Counter(j for r in ranges for j in cells.order[block.start[r] : block.stop[r]])
            assert not Counter(p[1] for p in everything.pairs if p[0] == i) - found


@in_parts
def test_lists_of_many_steps(seeds):
    for seed in seeds:
        scene = Ties(seed)
        cutoff = scene.cutoff / 2
        skin = [cutoff, 0.0, cutoff / 4, "auto"][seed % 4]
        kept = hs.VerletList(cutoff, skin=skin, threads=scene.some["threads"], **scene.how)
        points = scene.points
        for _ in range(3):
            kept.update(points)
            brute = scene.brute(points=points, cutoff=cutoff)
            i, j, S, d, D = kept.pairs(quantities="ijSdD", sort=True)
            assert triples(i, j, S) == keys(brute.half())
            for pair, length, vector in zip(brute.half(), d.tolist(), D, strict=True):
                brute.check_numbers(pair, length, vector, cutoff)
            step = [scene.random.choice([0.0, 0.25, -0.125]) * cutoff for _ in range(points.size)]
            points = (points + np.reshape(step, points.shape)).astype(points.dtype)


# ---- kernels and threads -------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_tables_that_are_sorted_have_the_same_bytes_for_any_kernel_and_threads(seed):
    rng = np.random.default_rng(seed)
    ndim = 2 + seed % 3
    box = np.eye(ndim)
    box[1, 0] = 0.3
    points = np.round(rng.random((1500, ndim)) * 12) / 12 if seed % 2 else rng.random((1500, ndim))
    cutoff = [math.sqrt(2) / 12, 0.11, 0.25][ndim - 2]
    queries = (points[:200] + 0.3 * cutoff).astype(np.float32)
    expected = None
    for kernel in hs.kernels():
        for threads in (1, 4):
            how = {"kernel": kernel, "threads": threads}
            table = call(
                hs.neighbors, points, cutoff, queries=queries, box=box, quantities="jd", **how
            ).sort()
            cells = hs.CellList(points, cutoff, box=box, threads=threads)
            asked = call(cells.query, queries, cutoff, quantities="jdS", kernel=kernel).sort()
            parts = []
            blocks = list(
                call(
                    hs.iter_pairs,
                    points,
                    cutoff,
                    box=box,
                    max_pairs=997,
                    progress=parts.append,
                    **how,
                )
            )
            assert parts == sorted(parts) and parts[-1] == 1.0
            found = (
                table.offsets, table.indices, table.distances,
                asked.indices, asked.distances, asked.shifts,
                *map(np.concatenate, zip(*blocks, strict=True)),
            )  # fmt: skip
            expected = expected or found
            assert same_arrays(found, expected)
