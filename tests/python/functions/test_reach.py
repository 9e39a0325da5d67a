# SPDX-License-Identifier: BSD-3-Clause
"""A reach for each pair, by radii, types and supports, against rational arithmetic: in boxes of any
shape, at any scale, at the last bit."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import halfshell as hs
from calls import call
from full_lists import entries, same_tables
from oracles import same_arrays, triples
from rational_images import Images, between, dot, exact
from reach_scenes import (
    BOXES,
    RULES,
    SYMMETRIC,
    Reaching,
    assert_last_place,
    boxed,
    check,
    distance_is_the_rounded_sum,
    spread_radii,
    touching,
)
from scene_strategies import scenes


@pytest.mark.parametrize("kind", BOXES)
@pytest.mark.parametrize("rule", RULES)
def test_one_set_equals_the_definition(kind, rule, rng):
    for ndim in (1, 2, 3, 4):
        points, scene = boxed(rng, kind, ndim, 16)
        largest = {1: 0.3, 2: 0.3, 3: 0.3, 4: 0.25}[ndim] * (1 if rule == "sum" else 2)
        for decades, inclusive in ((0.5, True), (6.0, False)):
            radii = spread_radii(rng, 16, largest, decades)
            scene |= {"inclusive": inclusive}
            check(Reaching(points, radii=radii, rule=rule, **scene))


@pytest.mark.parametrize("kind", BOXES)
@pytest.mark.parametrize("rule", RULES)
def test_two_sets_equal_the_definition(kind, rule, rng):
    for ndim in (1, 2, 3):
        for q, n, decades in ((1, 12, 0.5), (8, 8, 3.0), (14, 2, 6.0)):
            points, scene = boxed(rng, kind, ndim, q + n)
            radii = spread_radii(rng, q + n, 0.3 if rule == "sum" else 0.6, decades)
            check(Reaching(points, None, q, radii=radii, rule=rule, **scene))


@pytest.mark.parametrize("rule", RULES)
def test_radii_larger_than_the_box(rule, rng):
    for kind in ("periodic", "mixed", "triclinic", "sheared"):
        points, scene = boxed(rng, kind, 2, 5, length=1.0)
        radii = np.array([1.7, 0.4, 0.0, 0.9, 1e-3])
        found = check(Reaching(points, radii=radii, rule=rule, **scene))
        # The first point sees its own images, except within the radius of another.
        assert any(i == j == 0 for i, j, _ in found)
        check(Reaching(points, None, 2, radii=radii, rule=rule, **scene))
    for ndim, n, large in ((1, 6, 20.0), (2, 4, 3.0), (3, 2, 1.5)):
        box = np.diag(rng.uniform(0.5, 1.0, ndim)) + 7.3 * np.eye(ndim, k=-1)
        one = Reaching(rng.random((n, ndim)) * 1000.0, radii=np.full(n, large), rule=rule, box=box)
        check(one)
        check(one.but(periodic=np.arange(ndim) == 0))
        check(one.but(cutoff=0.5, inclusive=False))


def test_float32_points_are_what_they_are(rng):
    for rule in RULES:
        points, scene = boxed(rng, "triclinic", 3, 20)
        radii = spread_radii(rng, 20, 0.3, 2.0)
        for dtype in (np.float32, np.float64):
            one = Reaching(points.astype(np.float32), radii=radii.astype(dtype), rule=rule, **scene)
            check(one)
            check(one.but(n_queries=7))


@pytest.mark.parametrize("rule", RULES)
def test_an_upper_bound_holds_as_well(rule, rng):
    for kind in ("open", "periodic"):
        points, scene = boxed(rng, kind, 3, 20)
        radii = spread_radii(rng, 20, 0.6, 1.0)
        for cutoff in (0.0, 0.2, np.float32(0.5), 2.0):
            for n_queries in (None, 9):
                one = Reaching(points, cutoff, n_queries, radii=radii, rule=rule, **scene)
                check(one)


def test_many_dimensions(rng):
    for rule in RULES:
        for ndim in (5, 6, 8):
            points = rng.random((14, ndim))
            radii = spread_radii(rng, 14, 0.5 if rule == "sum" else 1.0, 1.0)
            assert check(Reaching(points, radii=radii, rule=rule))


@pytest.mark.parametrize("rule", RULES)
def test_equal_radii_are_one_cutoff(rule, rng):
    points, scene = boxed(rng, "triclinic", 3, 60)
    marks, cutoff = {"radii": np.full(60, 0.25), "rule": rule}, 0.5 if rule == "sum" else 0.25
    for kernel in hs.kernels():
        how = {"box": scene["box"], "kernel": kernel}
        table = call(hs.neighbors, points, None, quantities="jSdD", **marks, **how)
        assert same_tables(table, call(hs.neighbors, points, cutoff, quantities="jSdD", **how))
        if rule in SYMMETRIC:
            how |= {"quantities": "ijSdD", "sort": True}
            one, other = (
                call(hs.pairs, points, None, **marks, **how),
                call(hs.pairs, points, cutoff, **how),
            )
            assert same_arrays(one, other)


def test_no_points_and_one():
    for rule in RULES:
        for ndim in (1, 3):
            for n in (0, 1):
                one = Reaching(np.zeros((n, ndim)), radii=np.ones(n), rule=rule)
                assert check(one) == []
                boxes = one.but(box=np.full(ndim, 1.5))
                assert bool(check(boxes)) == (n == 1 and rule == "sum")
                for q in range(n + 1):
                    check(boxes.but(n_queries=q))
        empty = call(hs.pairs, [], None, radii=[], quantities="ijdDS")
        assert [array.shape for array in empty] == [(0,), (0,), (0,), (0, 3), (0, 3)]
        assert len(call(hs.neighbors, [], None, radii=[], rule="gather")) == 0


def test_one_giant_among_dwarfs(rng):
    for rule in RULES:
        points, scene = boxed(rng, "periodic", 2, 25, length=10.0)
        radii = np.full(25, 1e-3)
        radii[13] = 12.0
        points[20] = points[19] + [5e-4, 0.0]
        found = check(Reaching(points, radii=radii, rule=rule, **scene))
        assert any(19 in (i, j) and 20 in (i, j) for i, j, _ in found)


@pytest.mark.parametrize("rule", RULES)
def test_ratios_of_sizes(rule, rng):
    """Clusters of every size, each in the middle of the next larger ball."""
    for ratio in (1e6, 1e300):
        sizes = np.geomspace(1.0, 1.0 / ratio, 6)
        points = np.concatenate([size * rng.random((5, 2)) for size in sizes])
        radii = np.repeat(sizes, 5) * rng.uniform(0.2, 0.8, 30)
        assert check(Reaching(points, radii=radii, rule=rule))
        assert check(Reaching(points, None, 13, radii=radii, rule=rule))
        if ratio < 1e7:
            box = np.array([[2.0, 0.0], [0.3, 2.0]])
            assert check(Reaching(points, radii=radii, rule=rule, box=box))


# ---- drawn scenes, and scenes moved by whole box vectors ---------------------------------------

SMALL = scenes(ndims=(1, 2, 3))
RADIUS = st.one_of(
    st.integers(0, 8).map(lambda k: k / 8), st.floats(0.0, 1.0),
    st.sampled_from([0.0, 1e-300, 5e-324, 1e-9, 0.1, 0.2, 0.3]),
)  # fmt: skip


@st.composite
def reaching(draw, rules=RULES):
    """A small scene full of ties, with a radius for each point."""
    scene = draw(SMALL)
    n = len(scene.points)
    rule = draw(st.sampled_from(rules))
    radii = np.array(draw(st.lists(RADIUS, min_size=n, max_size=n)))
    if rule == "mean":
        radii = np.where(radii < 1e-300, 0.0, radii)
    if rule != "sum":
        radii = 2.0 * radii
    bound = draw(st.sampled_from([None, None, scene.cutoff]))
    return Reaching(
        scene.points, bound, None, scene.box, scene.periodic, scene.inclusive, radii=radii,
        rule=rule,
    )  # fmt: skip


@given(reaching(), st.integers(0, 10))
@settings(max_examples=100)
def test_small_scenes_equal_the_definition(scene, q):
    check(scene)
    check(scene.but(n_queries=min(q, len(scene.points))))


def entries_of(scene):
    return entries(call(hs.neighbors, **scene.arguments, quantities="jS"))


def test_whole_box_vectors_change_shifts_alone(rng):
    for rule in RULES:
        box = np.array([[4.0, 0.0], [1.0, 3.0]])
        points, radii = rng.integers(0, 32, (40, 2)) / 8.0, rng.integers(0, 9, 40) / 8.0
        moves = rng.integers(-1000, 1001, (40, 2))
        home = Reaching(points, radii=radii, rule=rule, box=box)
        away = home.but(points=points + moves @ box)
        expected = sorted(
            (i, j, tuple(int(s) for s in np.array(S) + moves[i] - moves[j]))
            for i, j, S in entries_of(home)
        )
        assert entries_of(away) == expected


# ---- decided exactly ---------------------------------------------------------------------------


@pytest.mark.parametrize("rule", RULES)
def test_balls_that_touch_exactly(rule, rng):
    for inclusive in (True, False):
        for ndim in (1, 2, 3):
            points, radii = touching(rng, 24, ndim)
            one = Reaching(points, radii=radii, rule=rule, inclusive=inclusive)
            check(one)
            check(one.but(n_queries=10))
            check(one.but(box=np.full(ndim, 3.0)))
            check(one.but(points=points.astype(np.float32)))


@pytest.mark.parametrize("rule", RULES)
def test_radii_a_hair_beside_the_tie(rule, rng):
    for inclusive in (True, False):
        points, radii = touching(rng, 24, 2, hair=True)
        points = np.where(rng.random(points.shape) < 0.1, np.nextafter(points, 9.0), points)
        one = Reaching(points, radii=radii, rule=rule, inclusive=inclusive)
        check(one)
        check(one.but(box=[[3.0, 0.0], [0.5, 2.5]]))
        check(one.but(n_queries=12))


def test_one_and_two_tenths_touch_three_tenths_by_their_real_sum():
    for kernel in hs.kernels():
        for distance, touches in ((0.3, True), (0.30000000000000004, False)):
            assert (Fraction(distance) <= Fraction(0.1) + Fraction(0.2)) == touches
            points = [[0.0], [distance]]
            for inclusive in (True, False):
                how = {"radii": [0.1, 0.2], "inclusive": inclusive, "kernel": kernel}
                assert call(hs.count_pairs, points, None, **how) == touches
        # Rounded, the sum is the larger distance: single and double precision say so.
        how = {"radii": [0.1, 0.2], "precision": "double"}
        assert call(hs.count_pairs, [[0.0], [0.30000000000000004]], None, **how) == 1


@pytest.mark.parametrize("rule", ["sum", "mean"])
def test_distances_at_rounded_sums(rule, rng):
    for kernel in hs.kernels():
        answers = set()
        for _ in range(60):
            a, b = rng.random(2) * 2.0 ** rng.integers(-3, 3, 2)
            points, touches = distance_is_the_rounded_sum(a, b)
            radii = np.array([a, b]) * (1 if rule == "sum" else 2)
            exact = Fraction(a) + Fraction(b) == Fraction(a + b)
            for inclusive in (True, False):
                expected = touches and (inclusive or not exact)
                how = {"radii": radii, "rule": rule, "inclusive": inclusive, "kernel": kernel}
                i, d = call(hs.pairs, points, None, quantities="id", **how)
                assert len(i) == expected
                # Not beyond the rounded sum, but on it, also if a tie does not count.
                assert d.tolist() == [a + b] * expected
            answers.add(touches)
        assert answers == {True, False}


def test_sums_that_float64_cannot_tell_from_the_larger_radius():
    """A point just outside a ball, and dwarfs whose radius is less than half an ulp of it."""
    outside = math.nextafter(1.0, 2.0)
    gap = outside - 1.0
    for dwarf in (0.0, gap / 4.0, math.nextafter(gap, 0.0), gap, math.nextafter(gap, 1.0)):
        points = np.array([[0.0, 0.0], [outside, 0.0]])
        for inclusive in (True, False):
            one = Reaching(points, radii=[1.0, dwarf], inclusive=inclusive)
            found = check(one)
            assert len(found) == (dwarf >= gap if inclusive else dwarf > gap)


def test_sums_of_scales_that_no_double_word_holds():
    """Only whole numbers see a radius of 5e-324 beside one of 1."""
    points = np.array([[0.0, 0.0], [1.0, 5e-324], [-1.0, 0.0]])
    for radii in ([1.0, 0.0, 0.0], [1.0, 5e-324, 0.0], [1.0, 5e-324, 5e-324]):
        for inclusive in (True, False):
            one = Reaching(points, radii=radii, inclusive=inclusive)
            check(one)
            check(one.but(rule="max"))
            check(one.but(n_queries=1))


@pytest.mark.parametrize("rule", RULES)
def test_zero_radii(rule, rng):
    points = rng.integers(0, 3, (20, 2)).astype(float)
    for inclusive in (True, False):
        nobody = Reaching(points, radii=np.zeros(20), rule=rule, inclusive=inclusive)
        found = check(nobody)
        assert bool(found) == inclusive
        some = nobody.but(radii=np.where(np.arange(20) % 3, 0.0, 1.0))
        check(some)
        check(some.but(n_queries=9))
        check(some.but(box=[3.0, 3.0]))


@pytest.mark.parametrize("power", [-1070, -1060, -700, -540, 500, 700, 1019])
def test_scales_of_the_whole_scene(power, rng):
    points, radii = touching(rng, 20, 2)
    points[:8] = np.round(points[:8])
    unit = 2.0**power
    points, radii = points * unit, np.where(radii * unit / unit == radii, radii * unit, 0.0)
    for rule in RULES:
        if rule == "mean":
            radii = np.where(radii < 2.0**-1021, 0.0, radii)  # whose halves may be no float64
        for inclusive in (True, False):
            check(Reaching(points, radii=radii, rule=rule, inclusive=inclusive))
        box, periodic = np.diag([4.0 * unit, 3.0 * unit]), [True, False]
        check(Reaching(points[:10], radii=radii[:10], rule=rule, box=box, periodic=periodic))


@pytest.mark.parametrize("kind", ["open", "triclinic"])
@pytest.mark.parametrize("rule", SYMMETRIC)
def test_distances_and_vectors_to_the_last_place(kind, rule, rng):
    for kernel in hs.kernels():
        points, scene = boxed(rng, kind, 3, 25)
        radii = spread_radii(rng, 25, 0.4 if rule == "sum" else 1.0, 1.0)
        one = Reaching(points, radii=radii, rule=rule, **scene)
        i, j, S, d, D = call(hs.pairs, **one.arguments, quantities="ijSdD", kernel=kernel)
        assert len(i) > 10
        assert_last_place(one, i, j, S, d)
        plain = call(hs.pairs, points, 1.0, **scene, quantities="ijSdD", kernel=kernel)
        known = {
            (a, b, tuple(s)): (x, v)
            for a, b, s, x, v in zip(*(column.tolist() for column in plain), strict=True)
        }
        for a, b, s, x, v in zip(*(column.tolist() for column in (i, j, S, d, D)), strict=True):
            assert known[a, b, tuple(s)] == (x, v)


def test_the_other_precisions_find_ties_that_they_can_tell(rng):
    for kernel in hs.kernels():
        points, radii = touching(rng, 24, 2)  # sums of eighths are exact in every precision
        exact = call(hs.pairs, points, None, radii=radii, sort=True, kernel=kernel)
        for precision in ("double", "single"):
            found = call(
                hs.pairs, points, None, radii=radii, sort=True, kernel=kernel, precision=precision
            )
            assert all(np.array_equal(a, b) for a, b in zip(exact, found))


# ---- every image, in fractions -----------------------------------------------------------------


ALGORITHMS = ["auto", "all-pairs", "grid", "hash", "hierarchy"]


class Scene:
    """Points, arguments, and every (i, j, S) that counts."""

    def __init__(self, seed, form):
        rng = self.rng = np.random.default_rng(seed)
        self.form, self.inclusive = form, bool(rng.integers(2))
        dim = self.dim = int(rng.choice([1, 2, 3]))
        widest = {"radii": 950, "types": 400, "supports": 400}[form]
        self.scale = math.ldexp(float(rng.choice([1.0, 1 / 3])), int(rng.integers(-1, 2)) * widest)
        self._box()
        x = rng.integers(-8, 9, (int(rng.integers(2, 14)), dim)) / rng.choice([1.0, 4.0, 10.0])
        x = np.where(rng.random(x.shape) < 0.2, np.nextafter(x, 9.0), x)
        self.points = np.append(x, x[:1], axis=0) * self.scale  # two that coincide
        getattr(self, f"_{form}")()

    def _box(self):
        rng, dim = self.rng, self.dim
        self.geometry = {}
        if rng.random() < 0.3:
            return
        rows = np.diag(rng.choice([0.75, 1.0, 2.0], dim))
        rows += np.tril(rng.choice([0.0, 0.25, -0.5, 3.0], (dim, dim)), -1)
        if dim > 1:
            rows[0] += rng.choice([0.0, 5.0, -30.0, 300.0]) * rows[1]
        rows = -rows[rng.permutation(dim)]
        periodic = rng.random(dim) < 0.8
        rows[~periodic] = 0.0
        self.geometry = {"box": rows * self.scale, "periodic": periodic}

    def _radii(self):
        rng, n = self.rng, len(self.points)
        rule = str(rng.choice(["sum", "mean", "max", "min", "gather", "scatter"]))
        r = rng.choice([0.0, 0.1, 0.2, 0.25, 0.3, 0.5, math.sqrt(0.5)], n)
        r = np.where(rng.random(n) < 0.3, r * 10.0 ** -rng.integers(1, 7, n), r) * self.scale
        R = exact(r)
        reach = {
            "sum": lambda i, j: R[i] + R[j], "mean": lambda i, j: (R[i] + R[j]) / 2,
            "max": lambda i, j: max(R[i], R[j]), "min": lambda i, j: min(R[i], R[j]),
            "gather": lambda i, j: R[i], "scatter": lambda i, j: R[j],
        }[rule]  # fmt: skip
        self.rule, self.cutoff, self.how = rule, None, {"radii": r, "rule": rule}
        self.within = lambda i, j: (reach(i, j), None)

    def _types(self):
        rng, n = self.rng, len(self.points)
        kinds = int(rng.integers(1, 5))
        table = rng.choice([0.0, 1e-3, 0.25, 0.6, 1.0, math.sqrt(2)], (kinds, kinds)) * self.scale
        table = np.maximum(table, table.T)
        types = rng.integers(0, kinds, n)
        self.rule, self.cutoff, self.how = "sum", table, {"types": types}
        self.within = lambda i, j: (Fraction(float(table[types[i], types[j]])), None)

    def _supports(self):
        rng, n, dim = self.rng, len(self.points), self.dim
        extent, thin = float(rng.choice([0.5, 1.0, 1 / 3])), float(rng.choice([1.0, 100.0, 1e6]))
        H = np.empty((n, dim, dim))
        for one in H:
            half_axes = 0.6 * thin ** -rng.random(dim)
            turn = np.linalg.qr(rng.standard_normal((dim, dim)))[0]
            turn = turn if rng.integers(2) else np.eye(dim)
            one[:] = turn @ np.diag(extent / half_axes) @ turn.T
            one[:] = (one + one.T) / 2.0
        H /= self.scale
        rows = [[exact(row) for row in one] for one in H]
        farthest = Fraction(0.7 * self.scale)  # beyond the longest half axis, as rounded
        rule = str(rng.choice(["max", "min", "gather", "scatter"]))

        def reaches(i, D):
            square = sum(dot(row, D) ** 2 for row in rows[i])
            return square < Fraction(extent) ** 2 or (
                self.inclusive and square == Fraction(extent) ** 2
            )

        inside = {
            "max": lambda i, j, D: reaches(i, D) or reaches(j, D),
            "min": lambda i, j, D: reaches(i, D) and reaches(j, D),
            "gather": lambda i, j, D: reaches(i, D), "scatter": lambda i, j, D: reaches(j, D),
        }[rule]  # fmt: skip
        self.rule, self.cutoff = rule, None
        self.how = {"supports": H, "rule": rule, "extent": extent}
        self.within = lambda i, j: (farthest, lambda D: inside(i, j, D))

    def expected(self):
        images = Images(self.dim, **self.geometry)
        x = [exact(row) for row in self.points]
        found = set()
        for i in range(len(x)):
            for j in range(len(x)):
                reach, inside = self.within(i, j)
                for S, D, _ in images.within(between(x[i], x[j]), reach**2, self.inclusive):
                    if (i != j or any(S)) and (inside is None or inside(D)):
                        found.add((i, j, S))
        return found

    def ask(self, function, *rest, **more):
        rng = self.rng
        how = {
            **self.how, **self.geometry, "inclusive": self.inclusive,
            "algorithm": str(rng.choice(ALGORITHMS)), "kernel": str(rng.choice(hs.kernels())),
            "threads": int(rng.integers(1, 3)), **more,
        }  # fmt: skip
        return call(function, self.points, self.cutoff, *rest, **how)


@pytest.mark.parametrize("form", ["radii", "types", "supports"])
@pytest.mark.parametrize("seeds", [range(12), range(12, 25)], ids=str)
def test_every_function_has_every_image(form, seeds):
    for seed in seeds:
        check_images(Scene(seed, form))


def check_images(scene):
    full = scene.expected()
    table = scene.ask(hs.neighbors, quantities="jS")
    i = np.repeat(np.arange(len(scene.points)), table.counts)
    assert triples(i, table.indices, table.shifts) == sorted(full)
    counts = np.bincount([i for i, _, _ in full], minlength=len(scene.points))
    assert scene.ask(hs.coordination).tolist() == counts.tolist()
    given = {**scene.how, **scene.geometry, "inclusive": scene.inclusive}
    if scene.rule in ("gather", "scatter"):
        with pytest.raises(ValueError, match="neighbors"):
            scene.ask(hs.pairs)
        args = (i, table.indices, table.shifts)
        assert call(hs.verify, scene.points, scene.cutoff, *args, **given).ok
        return
    half = {(i, j, S) for i, j, S in full if i < j or (i == j and S > (0,) * scene.dim)}
    i, j, S = scene.ask(hs.pairs, quantities="ijS", sort=True)
    assert triples(i, j, S) == sorted(half)
    assert scene.ask(hs.count_pairs) == len(half)
    blocks = scene.ask(hs.iter_pairs, quantities="ijS", max_pairs=7)
    found = [pair for block in blocks for pair in triples(*block)]
    assert len(found) == len(half) and set(found) == half
    assert call(hs.verify, scene.points, scene.cutoff, i, j, S, **given).ok
    if half:
        assert not call(hs.verify, scene.points, scene.cutoff, i[1:], j[1:], S[1:], **given).ok
