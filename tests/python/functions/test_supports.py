# SPDX-License-Identifier: BSD-3-Clause
"""Ellipsoids around points: every pair by rational arithmetic, and supports that are refused."""

import math
import time
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from calls import call
from definition import DIRECTED, is_of_half, rows_that_count
from halfshell._check.right import spheres_of

RULES = ("max", "min", "gather", "scatter")


def brute(x, H, extent, rule, box=None, periodic=None, inclusive=True):
    """All (i, j, *S): of one set each pair once, or rows of it for rules with a direction."""
    periodic = None if box is None else periodic
    points = hs.Points(x, supports=H, box=box, periodic=periodic)
    rows = rows_that_count(points, extent, rule=rule, inclusive=inclusive)
    return [(i, j, *S) for i, j, S in rows if rule in DIRECTED or is_of_half(i, j, S)]


def rotations(rng, n, d):
    return np.linalg.qr(rng.standard_normal((n, d, d)))[0]


def tensors(rng, n, d, h, aspect, rotated=True):
    """Supports whose longest axis is about h, and the shortest one about h / aspect."""
    values = np.exp(rng.uniform(0.0, math.log(aspect), (n, d))) / h
    values[:, 0] = 1.0 / h
    values[:, -1] = aspect / h if d > 1 else 1.0 / h
    if not rotated:
        return np.stack([np.diag(v) for v in values]) if n else np.empty((0, d, d))
    Q = rotations(rng, n, d)
    H = np.einsum("nab,nb,ncb->nac", Q, values, Q)
    return (H + H.transpose(0, 2, 1)) / 2.0


def rows_of(result):
    i, j, S = result
    return sorted(zip(i.tolist(), j.tolist(), *S.T.tolist()))


def found(x, rule, **how):
    how = {"rule": rule, "quantities": "ijS", **how}
    if "queries" in how:
        return rows_of(call(hs.pairs_between, how.pop("queries"), x, None, **how))
    if rule in ("gather", "scatter"):
        table = call(hs.neighbors, x, None, **{**how, "quantities": "jS"})
        return rows_of(table.to_pairs(quantities="ijS"))
    return rows_of(call(hs.pairs, x, None, **how))


def tie_scene():
    """Pairs at which |H D| is exactly the extent, 5, and beside it by one unit of a coordinate."""
    H = np.array([[3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.25]])
    H = np.stack([H, np.array([[2.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 1.0]])])
    x, T = [], []
    for k, (h, D) in enumerate([(0, (1.0, 2.0, 0.0)), (0, (0.0, 0.0, 20.0)), (1, (3.0, -1.0, 0.0)),
                                (1, (1.0, 1.0, 0.0)), (0, (1.0, 0.0, 16.0))]):  # fmt: skip
        for beside in (-1, 0, 1):
            q = np.array(D)
            axis = int(np.argmax(np.abs(q)))
            if beside:
                q[axis] = np.nextafter(q[axis], beside * np.sign(q[axis]) * np.inf)
            origin = np.array([64.0 * (3 * k + beside + 1), 0.0, 0.0])
            x += [origin * 0.0, q]
            T += [H[h], 1e6 * np.eye(3)]
            yield np.array(x[-2:]), np.array(T[-2:]), beside


def test_ties_are_decided_exactly():
    kept = 0
    for x, H, beside in tie_scene():
        for inclusive in (True, False):
            expected = brute(x, H, 5.0, "max", inclusive=inclusive)
            for kernel in hs.kernels():
                got = found(x, "max", supports=H, extent=5.0, inclusive=inclusive, kernel=kernel)
                assert got == expected
            if beside:
                assert len(expected) == (beside < 0)
            kept += len(expected)
    assert kept > 8


def test_other_precisions_are_those_of_any_kernel():
    for precision in ("double", "single"):
        rng = np.random.default_rng(8)
        x = rng.random((400, 3))
        args = {"supports": tensors(rng, 400, 3, 0.3, 6.0), "extent": 1.0, "box": 1.0}
        exact = set(found(x, "max", **args))
        answers = [found(x, "max", precision=precision, kernel=k, **args) for k in hs.kernels()]
        assert all(a == answers[0] for a in answers)
        assert len(exact ^ set(answers[0])) <= 2


# ---- what is refused ---------------------------------------------------------------------------


X, BATCH = np.random.default_rng(0).random((6, 3)), [0, 0, 1, 1, 1, 7]
H = np.tile(np.diag([1.0, 2.0, 4.0]), (6, 1, 1))


def changed(k, a, b, value, both=True):
    matrices = H.copy()
    matrices[k, a, b] = value
    if both:
        matrices[k, b, a] = value
    return matrices


CALLS = {
    "pairs": lambda **how: call(hs.pairs, X, None, **how),
    "neighbors": lambda **how: call(hs.neighbors, X, None, **how),
    "pairs_between": lambda **how: call(
        hs.pairs_between, X, X, None, query_supports=how.get("supports"), **how
    ),
    "iter_pairs": lambda **how: list(call(hs.iter_pairs, X, None, **how)),
    "explain": lambda **how: call(hs.explain, X, None, **how),
    "pairs of a batch": lambda **how: call(hs.pairs, X, None, batch=BATCH, **how),
}

REFUSED = [
    ({"supports": H, "extent": -1.0}, ValueError, "cutoff must be finite and not negative, got -1"),
    ({"supports": H}, TypeError, "with supports it is the extent"),
    ({"supports": H[:5], "extent": 1.0}, ValueError, r"shape \(6, 3, 3\)"),
    ({"supports": H[:, :2, :2], "extent": 1.0}, ValueError, r"shape \(6, 3, 3\)"),
    ({"supports": changed(3, 2, 1, 0.5, False), "extent": 1.0}, ValueError,
     r"supports must be symmetric, got supports\[3, 2, 1\] = 0.5 and supports\[3, 1, 2\] = 0.0"),
    ({"supports": changed(4, 2, 1, np.nan), "extent": 1.0}, ValueError,
     r"supports must be finite, got supports\[4, 1, 2\] = nan"),
    ({"supports": changed(4, 0, 0, np.inf), "extent": 1.0}, ValueError, r"supports\[4, 0, 0\]"),
    ({"supports": changed(2, 0, 0, 0.0), "extent": 1.0}, ValueError,
     r"positive definite; supports\[2\] is not"),
    ({"supports": changed(5, 1, 1, -2.0), "extent": 1.0}, ValueError, r"supports\[5\]"),
    ({"supports": changed(1, 0, 1, 2.0), "extent": 1.0}, ValueError, r"supports\[1\]"),
    ({"supports": H * 1e-308, "extent": 4.0}, ValueError, r"supports\[0\] reaches further"),
    ({"supports": H, "extent": 1.0, "rule": "sum"}, ValueError, "rule must be one of"),
    ({"supports": H, "extent": 1.0, "rule": "mean"}, ValueError, "rule must be one of"),
    ({"supports": H, "extent": 1.0, "radii": np.ones(6)}, ValueError,
     "radii and supports cannot be given together"),
    ({"supports": H, "extent": {(0, 0): 1.0}, "types": np.zeros(6, int)}, ValueError,
     "types cannot be combined with supports|queries have none"),
    ({"rule": "max"}, ValueError, "rule needs radii or supports"),
]  # fmt: skip


@pytest.mark.parametrize(("how", "error", "message"), REFUSED)
def test_what_is_refused_says_why(how, error, message):
    for search in CALLS.values():
        with pytest.raises(error, match=message):
            search(**how)


def test_supports_of_two_sets_go_together():
    q = X[:4]
    with pytest.raises(ValueError, match="queries have no supports: both sets need them"):
        call(hs.pairs_between, q, X, None, supports=H, extent=1.0)
    with pytest.raises(
        ValueError, match="'gather' goes by the supports of queries, which have none"
    ):
        call(hs.pairs_between, q, X, None, supports=H, extent=1.0, rule="gather")
    with pytest.raises(ValueError, match=r"supports must have shape \(4, 3, 3\)"):
        call(hs.pairs_between, q, X, None, query_supports=H, extent=1.0, rule="gather")
    with pytest.raises(ValueError, match=r"supports\[2\] is not"):
        call(
            hs.pairs_between,
            q,
            X,
            None,
            query_supports=changed(2, 0, 0, -1.0)[:4],
            extent=1.0,
            rule="gather",
        )


def test_a_large_scene_is_refused_before_it_is_searched():
    n = 200_000
    x = np.random.default_rng(1).random((n, 3))
    matrices = np.tile(np.eye(3), (n, 1, 1))
    matrices[n - 1, 2, 2] = 0.0  # every support reaches across the box
    begun = time.perf_counter()
    with pytest.raises(ValueError, match=rf"supports\[{n - 1}\] is not"):
        call(hs.pairs, x, None, supports=matrices, extent=1.0, box=1.0)
    assert time.perf_counter() - begun < 1.0


def is_definite(matrix):
    """By leading minors of fractions."""
    rows = [[Fraction(x) for x in row] for row in matrix.tolist()]

    def determinant(m):
        if len(m) == 1:
            return m[0][0]
        return sum(
            (-1) ** k * m[0][k] * determinant([row[:k] + row[k + 1 :] for row in m[1:]])
            for k in range(len(m))
        )

    return all(determinant([row[:k] for row in rows[:k]]) > 0 for k in range(1, len(rows) + 1))


THIRD = 1.0 / 3.0  # of thirds: 1/3 * 3 is rounded to 1
#: Singular in exact arithmetic, and the entry that makes it otherwise.
SINGULAR = [
    ([[THIRD * THIRD, THIRD], [THIRD, 1.0]], (0, 0)), ([[1.0, 3.0], [3.0, 9.0]], (1, 1)),
    ([[2.0**-600, 2.0**-300], [2.0**-300, 1.0]], (0, 0)),
]  # fmt: skip


@pytest.mark.parametrize(("matrix", "place"), SINGULAR)
def test_singular_ones_are_told_exactly(matrix, place):
    seen = set()
    for step in range(-3, 4):
        beside = np.array(matrix)
        for _ in range(abs(step)):
            beside[place] = np.nextafter(beside[place], np.inf * step)
        points = hs.Points(np.zeros((1, 2)))
        seen.add(is_definite(beside))
        if is_definite(beside):
            assert hs.count_pairs(points.replace(supports=beside[None]), 1.0) == 0
            assert spheres_of(beside[None], 1.0)[0] > 1e6
        else:
            with pytest.raises(ValueError, match=r"supports\[0\] is not"):
                hs.count_pairs(points.replace(supports=beside[None]), 1.0)
    assert seen == {True, False}


def test_random_matrices_near_the_border_are_told_exactly():
    rng = np.random.default_rng(12)
    counts = [0, 0]
    for trial in range(300):
        d = 2 + trial % 2
        v = rng.integers(-40, 40, (d, d - 1)).astype(float)
        matrix = v @ v.T  # singular
        for _ in range(trial % 4):
            k = rng.integers(d)
            matrix[k, k] += rng.integers(-1, 2) * 2.0 ** -rng.integers(0, 30)
        expected = is_definite(matrix)
        counts[expected] += 1
        try:
            call(hs.count_pairs, np.zeros((1, d)), None, supports=matrix[None], extent=1.0)
            assert expected
        except ValueError as error:
            assert not expected and "positive definite" in str(error)
    assert min(counts) > 40


def test_a_scene_without_supports_pays_for_none():
    x = np.random.default_rng(2).random((5000, 3))
    measured = hs.explain(x, 0.1, box=1.0, measure=True).measured["bytes"]
    assert measured["supports"] == 0
    assert measured["points"] > 0


def test_the_plan_names_octaves_of_supports():
    plan = call(hs.explain, X, None, supports=H, extent=1.0, algorithm="hierarchy")
    assert plan.algorithm == "hierarchy"
    assert plan.reason == "by octaves of supports, with cells of their own size, in 1 search"


def test_an_extent_of_zero_holds_coincident_points():
    x = np.array([[0.0, 0.0], [0.0, 0.0], [1e-300, 0.0], [1.0, 1.0], [1.0, 1.0]])
    points = hs.Points(x, supports=[np.diag([1.0, 2.0])] * 5)
    assert hs.pairs(points, 0.0, quantities="P", sort=True).tolist() == [[0, 1], [3, 4]]
    assert hs.count_pairs(points, 0.0, inclusive=False) == 0


@pytest.mark.parametrize("rule", RULES)
def test_several_extents_are_counted_one_by_one(rule):
    rng = np.random.default_rng(5)
    points = hs.Points(rng.random((30, 2)), supports=tensors(rng, 30, 2, 0.2, 3.0), box=1.0)
    extents = [0.0, 0.5, 1.0, 1.5]
    for how in ({"queries": points}, {"indices": [3, 1, 8]}, {}):
        if rule not in DIRECTED or "queries" in how:
            counts = hs.count_pairs(points, extents, rule=rule, **how)
            each = [hs.count_pairs(points, e, rule=rule, **how) for e in extents]
            assert counts.tolist() == each and len(set(each)) > 2
        counts = hs.coordination(points, extents, rule=rule, **how)
        each = [hs.coordination(points, e, rule=rule, **how) for e in extents]
        assert np.array_equal(counts, each)
