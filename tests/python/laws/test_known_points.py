# SPDX-License-Identifier: BSD-3-Clause
"""All that is known of points at once, against a brute force in integers.

Radii, types, supports, groups, labels, excluded pairs, a least distance, systems with boxes of
their own, queries, some of the points, and points in cells: what each does alone other tests show;
here they meet. Coordinates are small whole numbers times a power of two, so that distances often
are exactly the cutoff, and images are found by Fincke and Pohst's enumeration.
"""

import math
import pickle
import random
from collections import Counter
from fractions import Fraction
from math import isqrt

import numpy as np
import pytest

import halfshell as hs

UNITS = [0, 0, 0, 3, -20, 60, -160, 300, -530, 530, 900, -1040, -1070]
RULES = [None, "sum", "mean", "max", "min", "gather", "scatter"]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


class Lattice:
    """All whole combinations of vectors of integers, which belong to these axes."""

    def __init__(self, vectors, axes):
        self.vectors, self.axes, self.across = vectors, axes, []
        for vector in vectors:  # what is orthogonal to those before it, in integers
            rest = [Fraction(x) for x in vector]
            for other in self.across:
                share = Fraction(dot(vector, other), dot(other, other))
                rest = [x - share * y for x, y in zip(rest, other, strict=True)]
            scale = math.lcm(*(x.denominator for x in rest))
            whole = [int(x * scale) for x in rest]
            divisor = math.gcd(*whole)
            if divisor == 0:
                raise ZeroDivisionError("dependent vectors")
            self.across.append([x // divisor for x in whole])

    def within(self, vector, square):
        """(S, D, square) of each image of a vector that is not longer."""
        found, shift = [], [0] * len(vector)

        def place(k, vector):
            if k < 0:
                if dot(vector, vector) <= square:
                    found.append((tuple(shift), tuple(vector), dot(vector, vector)))
                return
            across, row, axis = self.across[k], self.vectors[k], self.axes[k]
            c, step, most = (
                dot(vector, across),
                dot(row, across),
                isqrt(square * dot(across, across)),
            )
            for s in range(-((most + c) // step), (most - c) // step + 1):
                shift[axis] = s
                place(k - 1, [x + s * y for x, y in zip(vector, row, strict=True)])
            shift[axis] = 0

        place(len(self.vectors) - 1, list(vector))
        return found

    def nearest(self, vector):
        """The S of the nearest image, of several the least."""
        near = list(vector)
        for across, row in zip(self.across[::-1], self.vectors[::-1], strict=True):
            s = (2 * dot(near, across) + dot(row, across)) // (2 * dot(row, across))
            near = [x - s * y for x, y in zip(near, row, strict=True)]
        return min((square, S) for S, _, square in self.within(vector, dot(near, near)))[1]


class Scene:
    """Points, queries and systems; lengths are whole quarters of a unit."""

    def __init__(self, seed):
        self.rng = rng = random.Random(seed)
        pick = rng.choice
        self.d = pick([1, 2, 2, 3, 3, 3, 4, 5, 8])
        self.unit = 2.0 ** pick(UNITS) / 4.0
        self.n_systems = pick([1, 1, 2, 3])
        self.kind = pick(["number", "systems", "types", "radii"] + ["supports"] * (self.d <= 3))
        self.rule = None
        if self.kind == "radii":
            self.rule = pick(RULES)
            if self.rule == "mean" and self.unit < 2.0**-1000:
                self.rule = "sum"  # half of a radius must be a float64
        elif self.kind == "supports":
            self.rule = pick([None, *RULES[3:]])
        self.lengths = pick([[4, 4], [4, 8], [0, 4], [8, 8], [4, 5]])
        has_box = rng.random() < 0.8
        self.boxes = [self.box() if has_box else None for _ in range(self.n_systems)]
        self.far = pick([0, 0, 0, 1, 1000])
        self.has = {what: rng.random() < 0.3 for what in ("groups", "labels", "excluded", "least")}
        self.points, self.queries = self.side(pick([0, 1, 3, 6, 8])), self.side(pick([1, 2, 4]))
        self.inclusive = pick([True, True, False])
        self.least = pick([0, 4, 5]) if self.has["least"] else None
        self.within = pick([0, 1, 3])
        self.table = {(a, b): pick([None, *self.lengths]) for a in range(3) for b in range(a, 3)}
        self.threads = pick([None, 1, 2])

    def box(self):
        rng, d = self.rng, self.d
        while True:
            rows = np.diag([4 * rng.choice([2, 2, 3, 4]) for _ in range(d)])
            for _ in range(rng.choice([0, 1, 2]) if d > 1 else 0):
                a, b = rng.sample(range(d), 2)
                rows[a] += rng.choice([1, -1, 3, 20 if d < 4 else 1]) * rows[b]
            flags = [rng.random() < 0.75 for _ in range(d)]
            for k in range(d):
                rows[k] *= flags[k] or rng.choice([0, 1])
            axes = [k for k in range(d) if flags[k]]
            lattice = Lattice([rows[k].tolist() for k in axes], axes)
            heights = [
                dot(a, b) / math.sqrt(dot(b, b))
                for a, b in zip(lattice.vectors, lattice.across, strict=True)
            ]
            if math.prod(1.0 + 16.0 / h for h in heights) < 300.0:
                return rows, flags, lattice

    def side(self, n):
        rng, pick = self.rng, self.rng.choice
        batch = sorted(rng.randrange(self.n_systems) for _ in range(n))
        rows = []
        for s in batch:
            row = np.array([4 * rng.randint(-3, 3) for _ in range(self.d)])
            if self.boxes[s] is not None:
                moves = [self.far * rng.randint(-1, 1) * flag for flag in self.boxes[s][1]]
                row = row + np.array(moves) @ self.boxes[s][0]
            rows.append(rows[-1] if rows and rng.random() < 0.15 else row)
        known = {"types": [rng.randrange(3) for _ in range(n)], "batch": batch}
        if self.kind == "radii":
            known["radii"] = [pick([0, 2, 2, 4]) for _ in range(n)]
        if self.kind == "supports":
            known["supports"] = [self.support() for _ in range(n)]
        if self.has["groups"]:
            known["groups"] = [rng.randrange(2) for _ in range(n)]
        if self.has["labels"]:
            known["labels"] = [rng.randrange(4) for _ in range(n)]
        return np.array(rows, np.int64).reshape(n, self.d), known

    def support(self):
        """Four times a matrix without a unit: the cutoff has it."""
        H = np.diag([self.rng.choice([2, 4, 4, 8]) for _ in range(self.d)])
        if self.d > 1:
            H[0, 1] = H[1, 0] = self.rng.choice([0, 1, -1])
        return H

    # ---- as the library takes it -----------------------------------------------------------

    def made(self, side):
        """`hs.Points`, made one way or another."""
        x, known = side
        scaled = dict(known)
        for name, unit in (("radii", self.unit), ("supports", 0.25)):
            if name in known:
                tail = (self.d, self.d) if name == "supports" else ()
                scaled[name] = np.array(known[name], float).reshape(-1, *tail) * unit
        if self.n_systems == 1 and self.rng.random() < 0.7:
            del scaled["batch"]
        box = {}
        if self.boxes[0] is not None:
            box = {
                "box": [b[0] * self.unit for b in self.boxes],
                "periodic": [b[1] for b in self.boxes],
            }
            if "batch" not in scaled:
                box = {name: value[0] for name, value in box.items()}
        points = hs.Points(x * self.unit, **scaled, **box)
        return self.rng.choice(
            [points, pickle.loads(pickle.dumps(points)), points[np.arange(len(x))]]
        )

    def cutoff(self):
        lengths = [x * self.unit for x in self.lengths]
        if self.kind == "types":
            found = {pair: x * self.unit for pair, x in self.table.items() if x is not None}
            return found or {("*", "*"): 0.0}
        if self.kind == "systems" and self.n_systems > 1:
            return [lengths[s % 2] for s in range(self.n_systems)]
        return None if self.kind == "radii" and self.rng.random() < 0.5 else max(lengths)

    # ---- all pairs -------------------------------------------------------------------------

    def found(self, points, cutoff, excluded, queries=None):
        """(i, j, S, square, D), ascending: of queries and points, or both directions of points."""
        asking, own = (points if queries is None else queries), points
        every = []
        for i, (p, a) in enumerate(zip(*self.rows(asking), strict=True)):
            for j, (q, b) in enumerate(zip(*self.rows(own), strict=True)):
                if a["batch"] != b["batch"] or a.get("groups") != b.get("groups"):
                    continue
                box, D = self.boxes[a["batch"]], (q - p).tolist()
                lattice = Lattice([], []) if box is None else box[2]
                images = self.reached(lattice, D, a, b, cutoff)
                out = None
                if (queries is not None or i != j) and self.is_excluded(
                    i, j, a, b, excluded, queries
                ):
                    back = queries is None and j < i
                    out = lattice.nearest([-x for x in D] if back else D)
                    out = tuple(-s for s in out) if back else out
                for S, D, square in images:
                    is_itself = queries is None and i == j and not any(S)
                    if not is_itself and S != out and square >= (self.least or 0) ** 2:
                        every.append((i, j, S, square, D))
        return sorted(every)

    @staticmethod
    def rows(side):
        x, known = side
        return x, [{name: values[k] for name, values in known.items()} for k in range(len(x))]

    def is_excluded(self, i, j, a, b, excluded, queries):
        if excluded is None:
            return False
        if isinstance(excluded, int):
            return abs(a["labels"] - b["labels"]) <= excluded
        return [i, j] in excluded or (queries is None and [j, i] in excluded)

    def reached(self, lattice, D, a, b, cutoff):
        if self.kind == "supports":
            most = (4 * max(self.lengths)) ** 2
            sides = []
            for H in (a["supports"], b["supports"]):
                vectors = [(H @ np.array(v)).tolist() for v in lattice.vectors]
                inner = Lattice(vectors, lattice.axes).within((H @ np.array(D)).tolist(), most)
                sides.append({S for S, _, square in inner if self.inclusive or square < most})
            wanted = {
                None: sides[0] | sides[1], "max": sides[0] | sides[1], "min": sides[0] & sides[1],
                "gather": sides[0], "scatter": sides[1],
            }[self.rule]  # fmt: skip
            reach = max((self.square_of(lattice, D, S) for S in wanted), default=0)
            return [image for image in lattice.within(D, reach) if image[0] in wanted]
        limit = max(self.lengths)
        if self.kind == "types":
            limit = self.table[min(a["types"], b["types"]), max(a["types"], b["types"])]
            limit = 0 if cutoff == {("*", "*"): 0.0} else limit
        elif self.kind == "systems" and self.n_systems > 1:
            limit = self.lengths[a["batch"] % 2]
        elif self.kind == "radii":
            p, q = a["radii"], b["radii"]
            own = {
                "mean": (p + q) // 2,
                "max": max(p, q),
                "min": min(p, q),
                "gather": p,
                "scatter": q,
            }
            own = own.get(self.rule, p + q)
            limit = own if cutoff is None else min(own, limit)
        if limit is None:
            return []
        images = lattice.within(D, limit**2)
        return [image for image in images if self.inclusive or image[2] < limit**2]

    @staticmethod
    def square_of(lattice, D, S):
        for axis, row in zip(lattice.axes, lattice.vectors, strict=True):
            D = [x + S[axis] * y for x, y in zip(D, row, strict=True)]
        return dot(D, D)


def keys(pairs):
    return [pair[:3] for pair in pairs]


def listed(i, j, S):
    return [(a, b, tuple(s)) for a, b, s in zip(i.tolist(), j.tolist(), S.tolist(), strict=True)]


def check(seed):
    scene = Scene(seed)
    rng, cutoff = scene.rng, scene.cutoff()
    points, queries = scene.made(scene.points), scene.made(scene.queries)
    if (points.batch is None) != (queries.batch is None):
        points = points.replace(batch=scene.points[1]["batch"])
        queries = queries.replace(batch=scene.queries[1]["batch"])
    n, q = len(points), len(queries)
    how = {"inclusive": scene.inclusive, "threads": scene.threads}
    if scene.rule is not None:
        how["rule"] = scene.rule
    if scene.least is not None:
        how["min_distance"] = scene.least * scene.unit
    excluded = scene.within if scene.has["labels"] else None
    among = across = excluded
    if scene.has["excluded"]:
        among = [[rng.randrange(n), rng.randrange(n)] for _ in range(n)]
        across = [[rng.randrange(q), rng.randrange(n)] for _ in range(n)]
    full = scene.found(scene.points, cutoff, among)
    both = scene.found(scene.points, cutoff, across, scene.queries)
    half = [p for p in full if p[0] < p[1] or (p[0] == p[1] and p[2] > (0,) * scene.d)]
    own = points
    if points.batch is None and rng.random() < 0.5:
        own = hs.CellList(points, rng.choice([1.0, 8.0]) * scene.unit)
    setting = {
        "kernel": rng.choice(hs.kernels()),
        "algorithm": rng.choice(["auto", "grid", "hash"]),
    }
    with hs.settings(**setting):
        # two sets
        found = hs.pairs_between(queries, own, cutoff, quantities="ijSd", exclude=across, **how)
        assert listed(*found[:3]) == keys(both)
        for d, pair in zip(found[3].tolist(), both, strict=True):
            assert Fraction(math.nextafter(d, math.inf) / scene.unit) ** 2 >= pair[3]
            assert Fraction(max(math.nextafter(d, 0), 0) / scene.unit) ** 2 <= pair[3]
        table = hs.neighbors(own, cutoff, queries=queries, exclude=across, **how)
        assert hs.verify(own, cutoff, table, queries=queries, exclude=across, **how)
        # rows of some points
        some = rng.sample(range(n), rng.randint(0, n))
        for numbers in (None, some):
            rows = [
                p for k in (range(n) if numbers is None else numbers) for p in full if p[0] == k
            ]
            table = hs.neighbors(
                own, cutoff, quantities="jdS", indices=numbers, exclude=among, **how
            )
            assert listed(np.array([p[0] for p in rows], int), table.indices, table.shifts) == keys(
                rows
            )
            counts = hs.coordination(own, cutoff, indices=numbers, exclude=among, **how)
            assert counts.tolist() == table.counts.tolist()
            by_distance = sorted(rows, key=lambda p: (p[3], p[1], p[2]))
            by_distance = [
                p[1]
                for k in (range(n) if numbers is None else numbers)
                for p in by_distance
                if p[0] == k
            ]
            assert table.sort().indices.tolist() == by_distance
        assert hs.verify(own, cutoff, table, indices=some, exclude=among, **how)
        if scene.rule in ("gather", "scatter"):
            return
        # each pair once
        found = hs.pairs(own, cutoff, quantities="ijS", sort=True, exclude=among, **how)
        assert listed(*found) == keys(half)
        blocks = hs.iter_pairs(own, cutoff, quantities="P", max_pairs=2, exclude=among, **how)
        P = hs.pairs(own, cutoff, quantities="P", exclude=among, **how)
        assert np.array_equal(np.concatenate([np.empty((0, 2), int), *blocks]), P)
        assert np.sum(hs.count_pairs(own, cutoff, exclude=among, **how)) == len(half)
        found = hs.pairs(own, cutoff, quantities="ijS", indices=some, exclude=among, **how)
        assert Counter(listed(*found)) == Counter(p for p in keys(half) if {*p[:2]} & {*some})
        labels = hs.clusters(own, cutoff, exclude=among, **how).labels
        joined = list(range(n))
        for i, j, *_ in half:
            one, other = joined[i], joined[j]
            joined = [min(one, other) if x in (one, other) else x for x in joined]
        assert labels.tolist() == [sorted({*joined}).index(x) for x in joined]


@pytest.mark.parametrize("first", range(0, 120, 30))
def test_everything_at_once(first):
    for seed in range(first, first + 30):
        check(seed)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1000, 2500, 500))
def test_everything_at_once_many_times(first):
    for seed in range(first, first + 500):
        check(seed)
