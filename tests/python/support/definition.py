# SPDX-License-Identifier: BSD-3-Clause
"""What every function must find, by fractions, whatever is known of points and which pairs count.

`rows_that_count` is the definition; `check` holds each function that has pairs to it.
"""

import bisect
import itertools
import math
from fractions import Fraction

import numpy as np

import halfshell as hs
from full_lists import entries
from halfshell._check.reference import ulp_error
from oracles import same_arrays, triples
from rational_images import Images, between, dot, exact

SYMMETRIC = ("sum", "mean", "max", "min")
RULES = (*SYMMETRIC, "gather", "scatter")
DIRECTED = ("gather", "scatter")
ALGORITHMS = ("auto", "all-pairs", "grid", "hash", "hierarchy")
LETTERS = "ijSdD"

#: What the rule makes of two radii.
COMBINED = {
    "sum": lambda a, b: a + b, "mean": lambda a, b: (a + b) / 2, "max": max, "min": min,
    "gather": lambda a, b: a, "scatter": lambda a, b: b,
}  # fmt: skip


class _Reach:
    """How far i of those that ask reaches j, and which vectors within that count."""

    def __init__(self, points, asking, cutoff, rule, inclusive):
        self.points, self.asking, self.cutoff = points, asking, cutoff
        self.inclusive, self.rule = inclusive, rule
        self.kind = "plain"
        for one, kind in ((asking, "radii"), (points, "radii"), (asking, "supports"),
                          (points, "supports")):  # fmt: skip
            if getattr(one, kind) is not None:
                self.kind = kind
                self.rule = rule or {"radii": "sum", "supports": "max"}[kind]
        if isinstance(cutoff, dict) or np.ndim(cutoff) == 2:
            self.kind = "types"
        if self.kind == "supports":
            self.lengths = [self._half_axes(one.supports) for one in (asking, points)]

    def _half_axes(self, supports):
        """No less than the longest of each support."""
        if supports is None:
            return None
        least = np.linalg.eigvalsh(supports)[:, 0] if len(supports) else np.empty(0)
        return [Fraction(1.01 * float(self.cutoff) / value) for value in least.tolist()]

    def of(self, i, j, system):
        """The farthest that can count; None if nothing does."""
        if self.kind == "plain":
            return Fraction(float(self.cutoff if np.ndim(self.cutoff) == 0
                                  else self.cutoff[system]))  # fmt: skip
        if self.kind == "types":
            a, b = self.asking.types[i], self.points.types[j]
            if not isinstance(self.cutoff, dict):
                return Fraction(float(self.cutoff[a][b]))
            for key in ((a, b), (b, a), (a, "*"), (b, "*"), ("*", "*")):  # few stars win
                if key in self.cutoff:
                    return Fraction(float(self.cutoff[key]))
            return None
        if self.kind == "radii":
            sides = [one.radii for one in (self.asking, self.points)]
        else:
            sides = self.lengths
        a, b = (None if side is None else Fraction(side[k]) for side, k in zip(sides, (i, j)))
        reach = COMBINED[self.rule](a, b)
        bound = None if self.kind == "supports" else self.cutoff
        return reach if bound is None else min(reach, Fraction(float(bound)))

    def counts(self, i, j, D):
        """Whether this vector, no longer than that, is a pair."""
        if self.kind != "supports":
            return True
        inside = []
        for one, k, other in ((self.asking, i, "scatter"), (self.points, j, "gather")):
            if self.rule != other:
                square = sum(dot(exact(row), D) ** 2 for row in one.supports[k])
                limit = Fraction(float(self.cutoff)) ** 2
                inside.append(square < limit or (self.inclusive and square == limit))
        return all(inside) if self.rule == "min" else any(inside)


def rows_that_count(
    points, cutoff, queries=None, *, rule=None, exclude=None, min_distance=None, inclusive=True
):
    """(i, j, S) of every point or query i and what it has as a neighbour, ascending."""
    rule_and_rest = rule, exclude, min_distance, inclusive
    return _keys(measured_pairs(points, cutoff, queries, *rule_and_rest))


def _keys(measured):
    return [entry[:3] for entry in measured]


def measured_pairs(points, cutoff, queries, rule, exclude, min_distance, inclusive):
    """(i, j, S, |D|**2, D) of each."""
    own = queries is None
    asking = points if own else queries
    reach = _Reach(points, asking, cutoff, rule, inclusive)
    least = Fraction(float(min_distance or 0.0)) ** 2
    dim = points.positions.shape[1]
    shapes = (points.box, 2), (points.periodic, 1)
    of_each = any(np.ndim(given) > own_axes for given, own_axes in shapes)  # for each system
    images = [
        Images(dim, *(given[s] if np.ndim(given) > own else given for given, own in shapes))
        for s in (range(points.n_systems) if of_each else [0])
    ]
    excluded = set()
    if exclude is not None and np.ndim(exclude) == 2:
        excluded = {tuple(pair) for pair in np.asarray(exclude).tolist()}
        excluded |= {(b, a) for a, b in excluded} if own else set()

    def is_excluded(i, j):
        if exclude is None or (own and i == j):
            return False
        if np.ndim(exclude) == 2:
            return (i, j) in excluded
        a, b = asking.labels[i], points.labels[j]
        return a == b if isinstance(a, str) else abs(int(a) - int(b)) <= exclude

    x, q = ([exact(row) for row in one.positions.tolist()] for one in (points, asking))
    found = []
    for i, j in itertools.product(range(len(q)), range(len(x))):
        system = None if points.batch is None else points.batch[j]
        if system is not None and asking.batch[i] != system:
            continue
        if points.groups is not None and asking.groups[i] != points.groups[j]:
            continue
        farthest = reach.of(i, j, system)
        if farthest is None:
            continue
        of_system = images[system if of_each else 0]
        closed = inclusive or reach.kind == "supports"
        near = [
            (square, S, D)
            for S, D, square in of_system.within(between(q[i], x[j]), farthest**2)
            if not own or i != j or any(S)
        ]
        first = None
        if near and is_excluded(i, j):  # the lower number's first of those that are nearest
            turn = -1 if own and j < i else 1
            first = min(near, key=lambda one: (one[0], [turn * s for s in one[1]]))[1]
        found += [
            (i, j, S, square, D)
            for square, S, D in near
            if S != first and square >= least and (closed or square < farthest**2)
            and reach.counts(i, j, D)
        ]  # fmt: skip
    return sorted(found)


# ---- functions against it --------------------------------------------------------------------


def is_of_half(i, j, S):
    """Whether an entry of a full list is of the half list."""
    return i < j or (i == j and S > (0,) * len(S))


def check(points, cutoff=None, queries=None, **options):
    """Assert that each function finds what the definition says; return it, of one set or two.

    By every kernel, and by one algorithm and number of threads after the other. `options`: rule,
    exclude, min_distance, inclusive.
    """
    points = points if isinstance(points, hs.Points) else hs.Points(points)
    usual = {"rule": None, "exclude": None, "min_distance": None, "inclusive": True}
    measured = measured_pairs(points, cutoff, queries, **{**usual, **options})
    full = _keys(measured)
    n = len(points if queries is None else queries)
    counts = np.bincount([i for i, _, _ in full], minlength=n).tolist()
    by = zip(hs.kernels(), itertools.cycle(ALGORITHMS), itertools.cycle((1, 2)))
    for number, (kernel, algorithm, threads) in enumerate(by):
        with hs.settings(kernel=kernel, algorithm=algorithm):
            how = {**options, "threads": threads}
            if queries is not None:
                how["queries"] = queries
            table = hs.neighbors(points, cutoff, quantities="jSdD", **how)
            assert entries(table) == full
            assert hs.coordination(points, cutoff, **how).tolist() == counts
            if points.types is not None:
                by_type = hs.coordination(points, cutoff, by_type=True, **how)
                assert by_type.tolist() == _by_type(points.types, table)
            if queries is not None:
                _check_between(points, cutoff, full, table, how)
            elif options.get("rule") not in DIRECTED:
                _check_half(points, cutoff, full, table, how, number)
            if number == 0 and n:
                _check_rest(points, cutoff, table, how)
                _check_table(table, measured)
            if type(cutoff) is float and options.keys() <= {"inclusive", "exclude", "min_distance"}:
                _check_distances(points, cutoff, measured, how)
    return full


def _by_distance(entry):
    i, j, S, square, _ = entry
    return i, square, j, S


def _check_table(table, measured):
    """The numbers of each entry to the last place, and what is made of the table."""
    for (*_, square, true), d, D in zip(
        measured, table.distances.tolist(), table.vectors.tolist(), strict=True
    ):
        assert ulp_error(d, square) <= 1
        assert all(abs(Fraction(a) - b) <= Fraction(math.ulp(d)) for a, b in zip(D, true))
    ordered = table.sort()
    assert entries(ordered) == _keys(sorted(measured, key=_by_distance))
    mask = np.arange(len(measured)) % 3 > 0
    some = [entry for entry, is_kept in zip(measured, mask) if is_kept]
    assert entries(table.filter(mask)) == _keys(some)
    assert entries(table.filter(mask).sort()) == _keys(sorted(some, key=_by_distance))
    graph = ordered.graph()
    assert np.array_equal(graph.edge_index[0], ordered.indices)
    assert np.array_equal(graph.shifts, -ordered.shifts)
    assert np.array_equal(graph.vectors, -ordered.vectors)


def _by_type(types, table):
    """How many neighbours of each type each row has."""
    order, places = np.unique(types, return_inverse=True)
    if types.dtype.kind != "U":  # numbers are places themselves
        order, places = range(1 + int(types.max(initial=0))), types
    return [np.bincount(places[j], minlength=len(order)).tolist() for j, *_ in table]


def _total(count):
    return int(np.sum(count))  # of a batch one for each system


def _check_between(points, cutoff, full, table, how):
    assert _total(hs.count_pairs(points, cutoff, **how)) == len(full)
    how = {**how, "quantities": LETTERS}
    found = hs.pairs_between(how.pop("queries"), points, cutoff, **how)
    assert triples(*found[:3]) == full
    assert same_arrays(found[3:], (table.distances, table.vectors))


def _check_half(points, cutoff, full, table, how, number):
    is_half = np.array([is_of_half(*entry) for entry in full], bool)
    half = [entry for entry, is_one in zip(full, is_half) if is_one]
    found = hs.pairs(points, cutoff, quantities=LETTERS, sort=True, **how)
    assert triples(*found[:3]) == half
    assert same_arrays(found[3:], (table.distances[is_half], table.vectors[is_half]))
    plain = hs.pairs(points, cutoff, quantities=LETTERS, **how)
    order = np.lexsort([*plain[2].T[::-1], plain[1], plain[0]])
    assert all(a.tobytes() == b[order].tobytes() for a, b in zip(found, plain, strict=True))
    assert _total(hs.count_pairs(points, cutoff, **how)) == len(half)
    if number == 0:
        blocks = hs.iter_pairs(points, cutoff, quantities=LETTERS, max_pairs=5, **how)
        columns = [np.concatenate(column) for column in zip(*blocks)] or [a[:0] for a in plain]
        assert sorted(triples(*columns[:3])) == half
        if points.batch is None:
            seen = []
            hs.for_each_pair(points, cutoff, lambda i, j, S, D, d2: seen.append((i, j, S)), **how)
            assert sorted((i, j, tuple(S)) for i, j, S in seen) == half
        _check_clusters(points, cutoff, half, how)


def _check_clusters(points, cutoff, half, how):
    joined = list(range(len(points)))
    for i, j, _ in half:
        one, other = sorted((joined[i], joined[j]))
        joined = [one if x == other else x for x in joined]
    labels = np.unique(joined, return_inverse=True)[1]
    assert hs.clusters(points, cutoff, **how).labels.tolist() == labels.tolist()


def _check_rest(points, cutoff, table, how):
    """Some of the points, lists of cells, and what `verify` says of the list."""
    i, j, S = table.to_pairs(quantities="ijS")
    both = {key: how[key] for key in how if key != "threads" and how[key] is not None}
    assert hs.verify(points, cutoff, table, **both).ok
    is_chosen = points.groups is not None or both.keys() & {"exclude", "min_distance"}
    if "queries" not in how and (points.batch is None or not is_chosen):
        some = np.arange(0, len(points), 3)[::-1]
        rows = hs.neighbors(points, cutoff, indices=some, quantities="jSdD", **how)
        for k, number in enumerate(some):
            for ours, theirs in zip(rows[k], table[number], strict=True):
                assert ours.tobytes() == theirs.tobytes()
        counts = hs.coordination(points, cutoff, indices=some, **how)
        assert counts.tolist() == table.counts[some].tolist()
        if how.get("rule") not in DIRECTED:
            part = np.isin(i, some) | np.isin(j, some)
            found = hs.pairs(points, cutoff, indices=some, quantities="ijS", sort=True, **how)
            count = hs.count_pairs(points, cutoff, indices=some, **how)
            assert _total(count) == len(found[0])
            assert triples(*found) == [
                one for one, is_in in zip(triples(i, j, S), part, strict=True)
                if is_in and is_of_half(*one)
            ]  # fmt: skip


def _check_distances(points, cutoff, measured, how):
    """Histograms, and the nearest points: of one cutoff that counts."""
    how = {"inclusive": True} | {key: value for key, value in how.items() if value is not None}
    edges = _beside(cutoff, measured)
    if points.batch is None:
        _check_cells(points, cutoff, measured, how)
        _check_shells(points, edges, measured, how)
    if how["inclusive"] and cutoff > 0.0:
        of_all = {key: value for key, value in how.items() if key != "inclusive"}
        _check_histogram(points, edges, measured, of_all)
    check_nearest(points, cutoff, measured, how)


def _beside(cutoff, measured):
    """The cutoff and lengths before it: some of the distances, or next to them."""
    some = [math.hypot(*map(float, D)) for *_, D in measured[:: 1 + len(measured) // 3]]
    lengths = [x for d in some for x in (math.nextafter(d, 0.0), d, math.nextafter(d, math.inf))]
    return sorted({0.0, 0.5 * cutoff, cutoff, *(x for x in lengths if x < cutoff)})


def _check_shells(points, edges, measured, how):
    """Each entry is in the first shell that holds it; counts are of all shells up to one."""
    how, squares = dict(how), [Fraction(edge) ** 2 for edge in edges]
    place = bisect.bisect_left if how["inclusive"] else bisect.bisect_right
    shells = [place(squares, square) for *_, square, _ in measured]
    table = hs.neighbors(points, edges, quantities="jSdk", **how)
    assert entries(table) == _keys(measured) and table.shells.tolist() == shells
    side = "left" if how["inclusive"] else "right"  # no distance contradicts its shell
    assert np.array_equal(np.searchsorted(edges, table.distances, side), table.shells)
    counts = np.zeros((len(edges), table.n_rows), np.int64)
    for (i, *_), shell in zip(measured, shells):
        counts[shell:, i] += 1
    assert np.array_equal(hs.coordination(points, edges, **how), counts)
    is_half = [is_of_half(*key) for key in _keys(measured)]
    if "queries" in how:
        is_half = [True] * len(measured)
        asking = how.pop("queries")
        *found, k = hs.pairs_between(asking, points, edges, quantities="ijSk", **how)
        how["queries"] = asking
    else:
        *found, k = hs.pairs(points, edges, quantities="ijSk", sort=True, **how)
    assert triples(*found) == [key for key, is_one in zip(_keys(measured), is_half) if is_one]
    some = [shell for shell, is_one in zip(shells, is_half) if is_one]
    assert k.tolist() == some
    total = [sum(shell <= most for shell in some) for most in range(len(edges))]
    assert hs.count_pairs(points, edges, **how).tolist() == total


def _check_cells(points, cutoff, measured, how):
    """Points in cells say what they say themselves."""
    cells, how = hs.CellList(points, cutoff), dict(how)
    queries = how.pop("queries", None)
    if queries is not None:
        found = hs.pairs_between(queries, cells, cutoff, quantities="ijS", **how)
        assert triples(*found) == _keys(measured)
        if points.groups is None and not how.keys() & {"exclude", "min_distance"}:
            assert entries(cells.query(queries, quantities="jS", **how)) == _keys(measured)
        return
    half = [key for key in _keys(measured) if is_of_half(*key)]
    assert triples(*cells.pairs(quantities="ijS", sort=True, **how)) == half
    assert triples(*hs.pairs(cells, cutoff, quantities="ijS", sort=True, **how)) == half
    assert entries(cells.neighbors(quantities="jS", **how)) == _keys(measured)
    assert cells.count_pairs(**how) == len(half)
    if points.groups is None and not how.keys() & {"exclude", "min_distance"}:
        scene = {"box": points.box, "periodic": points.periodic}
        kept = hs.VerletList(cutoff, 0.25 * cutoff, inclusive=how["inclusive"], **scene)
        kept.update(points.positions)
        assert triples(*kept.pairs(quantities="ijS", sort=True)) == half


def _check_histogram(points, edges, measured, how):
    """Counts, and sums of products of weights, of each bin, by type and over all of them."""
    queries, squares = how.get("queries"), [Fraction(edge) ** 2 for edge in edges]
    sides = [points if queries is None else queries, points]
    kinds = [np.zeros(len(one), int) if one.types is None else one.types for one in sides]
    names = np.unique(np.concatenate(kinds))
    is_named = kinds[0].dtype.kind == "U"
    kinds = [np.searchsorted(names, one) if is_named else one for one in kinds]
    n_types = max(1, len(names) if is_named else 1 + int(names.max(initial=0)))
    found = hs.pair_histogram(points, edges, **how)
    is_divided, is_weighted = points.batch is not None, points.weights is not None
    shape = len(found) if is_divided else 1, n_types, n_types, len(edges) - 1
    sums = np.full(shape, Fraction(0), dtype=object)
    upper = np.full((shape[0], shape[-1]), Fraction(0), dtype=object)
    some, of_some = np.arange(0, len(points), 3), np.zeros(upper.shape, np.int64)
    for i, j, S, square, _ in measured:
        if queries is None and not is_of_half(i, j, S):
            continue
        term = Fraction(1)
        if is_weighted:
            term = Fraction(sides[0].weights[i].item()) * Fraction(points.weights[j].item())
        k = min(bisect.bisect_right(squares, square), len(edges) - 1) - 1
        system, a, b = points.batch[j] if is_divided else 0, kinds[0][i], kinds[1][j]
        upper[system, k] += term
        of_some[system, k] += i % 3 == 0 or j % 3 == 0
        sums[system, a, b, k] += term
        if queries is None and a != b:
            sums[system, b, a, k] += term
    dtype = np.float64 if is_weighted else np.int64  # a fraction is rounded once, to even
    sums, upper = (np.array([dtype(float(x)) for x in one.ravel()], dtype).reshape(one.shape)
                   for one in (sums, upper))  # fmt: skip
    assert same_arrays(found, upper if is_divided else upper[0])
    if queries is None and not is_weighted and len(points):
        found = hs.pair_histogram(points, edges, indices=some, **how)
        assert same_arrays(found, of_some if is_divided else of_some[0])
    if points.types is not None:
        by_type = hs.pair_histogram(points, edges, by_type=True, **how)
        assert same_arrays(by_type, sums if is_divided else sums[0])


def check_nearest(points, cutoff, measured, how, letters="jS"):
    """Rows of `nearest` are the first ones of those within the cutoff, as far as it takes them."""
    columns = hs.nearest(points, 3, max_distance=cutoff, quantities=letters, **how)
    columns = columns if len(letters) > 1 else (columns, np.zeros((*columns.shape, 0), int))
    ordered = sorted(measured, key=_by_distance)
    for i, (numbers, shifts) in enumerate(zip(*map(np.ndarray.tolist, columns), strict=True)):
        mine = [entry[1:3] for entry in ordered if entry[0] == i][:3]
        found = [(a, tuple(s)) for a, s in zip(numbers, shifts) if a >= 0]
        assert found == [(j, S if len(letters) > 1 else ()) for j, S in mine]


# ---- scenes --------------------------------------------------------------------------------

FORMS = ("plain", "radii", "types", "supports")


class Scene:
    """Points full of ties in any box and unit, and a cutoff, radii, types or supports for them."""

    def __init__(self, seed, form, most=12):
        rng = self.rng = np.random.default_rng([seed, FORMS.index(form)])
        self.form = form
        dim = self.dim = int(rng.choice([1, 2, 3, 3, 4] if form != "supports" else [1, 2, 3]))
        widest = {"plain": 950, "radii": 950, "types": 400, "supports": 400}[form]
        self.unit = math.ldexp(float(rng.choice([1.0, 1 / 3])), int(rng.integers(-1, 2)) * widest)
        self.options = {"inclusive": bool(rng.integers(2))}
        self.box = self.periodic = None
        if rng.random() < 0.75:
            self._box()
        n, q = int(rng.integers(0, most + 1 if dim < 4 else 7)), int(rng.integers(1, most // 2))
        x = rng.integers(-8, 9, (n + q, dim)) / rng.choice([2.0, 4.0, 10.0])
        x = np.where(rng.random(x.shape) < 0.2, np.nextafter(x, 9.0), x)
        x[: n // 4] = x[n // 4 : n // 4 + n // 4]  # some coincide
        x *= self.unit
        if self.box is not None and rng.integers(2):  # far from home, where their images are not
            x += rng.choice([0, 1, -3, 1000], x.shape) * self.periodic @ self.box
        with np.errstate(over="ignore", under="ignore"):
            single = x.astype(np.float32)
        x = single if rng.random() < 0.2 and np.isfinite(single).all() else x
        self.n, self.x, self.fields, self.cutoff = n, x, {}, None
        getattr(self, f"_{form}")()

    def _box(self):
        rng, dim = self.rng, self.dim
        rows = np.diag(rng.choice([0.75, 1.0, 2.0], dim) * (1.0 if dim < 4 else 2.0))
        rows += np.tril(rng.choice([0.0, 0.25, -0.5, 3.0], (dim, dim)), -1)
        if dim > 1:
            rows[0] += rng.choice([0.0, 5.0, -30.0, 300.0]) * rows[1]
        rows = -rows[rng.permutation(dim)]
        self.periodic = rng.random(dim) < 0.8
        rows[~self.periodic] = 0.0
        self.box = rows * self.unit

    def _plain(self):
        cutoff = self.rng.choice([0.0, 0.25, 0.5, math.sqrt(0.5), 0.75, 1.0])
        self.cutoff = float(cutoff * self.unit)
        if self.rng.integers(2):
            kinds = self.rng.integers(0, 3, len(self.x))  # which are no matter
            self.fields["types"] = np.array(["O", "H", "Si"])[kinds] if kinds[0] else kinds
        if self.rng.integers(2):
            exact = self.rng.normal(size=len(self.x)) * 10.0 ** self.rng.integers(-20, 4)
            self.fields["weights"] = exact  # sums of their products are rounded once

    def _radii(self):
        rng, n = self.rng, len(self.x)
        self.options["rule"] = str(rng.choice(RULES))
        r = rng.choice([0.0, 0.1, 0.2, 0.25, 0.3, 0.5, math.sqrt(0.5)], n)
        r = np.where(rng.random(n) < 0.3, r * 10.0 ** -rng.integers(1, 7, n), r) * self.unit
        self.fields["radii"] = np.where(r < 2.0**-1021, 0.0, r)  # whose halves may be no float64
        self.cutoff = None if rng.integers(2) else 0.5 * self.unit

    def _types(self):
        rng, kinds = self.rng, int(self.rng.integers(1, 5))
        table = rng.choice([0.0, 1e-3, 0.25, 0.6, 1.0, math.sqrt(2)], (kinds, kinds)) * self.unit
        self.cutoff = table = np.maximum(table, table.T)
        types = rng.integers(0, kinds, len(self.x))
        if rng.integers(2):
            names = np.array(["H", "O", "Si", "C"]) if rng.integers(2) else np.arange(4)
            types = names[types]
            self.cutoff = {
                (names[a].item(), names[b].item()): float(table[a, b])
                for a in range(kinds) for b in range(a, kinds) if a == 0 or rng.integers(4)
            }  # fmt: skip
            if rng.integers(2):  # the only type that some of the others have a cutoff with
                self.cutoff[names[0].item(), "*"] = float(table[0, 0])
                self.cutoff["*", "*"] = float(table.max())
        self.fields["types"] = types

    def _supports(self):
        rng, n, dim = self.rng, len(self.x), self.dim
        self.cutoff, thin = float(rng.choice([0.5, 1.0, 1 / 3])), float(rng.choice([1, 100, 1e6]))
        H = np.empty((n, dim, dim))
        for one in H:
            half_axes = 0.6 * thin ** -rng.random(dim)
            turn = np.linalg.qr(rng.standard_normal((dim, dim)))[0]
            turn = turn if rng.integers(2) else np.eye(dim)
            one[:] = turn @ np.diag(self.cutoff / half_axes) @ turn.T
            one[:] = (one + one.T) / 2.0
        self.fields["supports"] = H / self.unit
        self.options["rule"] = str(rng.choice(["max", "min", *DIRECTED]))

    def choose(self):
        """Only some of the pairs."""
        rng, n = self.rng, len(self.x)
        if rng.random() < 0.4:
            self.fields["groups"] = rng.integers(0, 3, n)
        kind = rng.random()
        if kind < 0.35:
            self.fields["labels"] = rng.integers(-2, 3, n)
            self.options["exclude"] = int(rng.integers(0, 2))
        elif kind < 0.7 and self.n > 5:
            self.options["exclude"] = rng.integers(0, min(self.n, n - self.n), (self.n, 2))
        least = rng.choice([0.0, 0.25, 0.5, 1.0]) * self.unit
        self.options["min_distance"] = None if rng.integers(2) else float(least)
        return self

    def divide(self):
        """Into systems, some of them empty, each with a box and maybe a cutoff of its own."""
        rng = self.rng
        sizes = self.n, len(self.x) - self.n
        self.fields["batch"] = np.concatenate([np.sort(rng.integers(0, 4, k)) for k in sizes])
        if self.box is not None and rng.integers(2):
            self.box = self.box * rng.choice([1.0, 1.5, 2.0], (4, 1, 1))
        if self.box is not None and rng.integers(2):
            self.periodic = self.periodic & (rng.random((4, self.dim)) < 0.8)
        if self.form == "plain" and rng.integers(2):
            self.cutoff = self.cutoff * rng.choice([0.5, 1.0, 1.25], 4)
        return self

    def part(self, rows, **more):
        known = {name: values[rows] for name, values in self.fields.items()}
        return hs.Points(self.x[rows], **known, **more)

    def check(self):
        """One set, and two of them."""
        box = {} if self.box is None else {"box": self.box, "periodic": self.periodic}
        points = self.part(slice(self.n), **box)
        found = check(points, self.cutoff, **self.options)
        queries = self.part(slice(self.n, None))
        if self.unit < 1e30 and self.n % 2:
            queries = queries.replace(positions=queries.positions.astype(np.float32))
        return len(found) + len(check(points, self.cutoff, queries, **self.options))
