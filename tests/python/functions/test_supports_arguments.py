# SPDX-License-Identifier: BSD-3-Clause
"""Supports that are refused, in no time and by name, and what is left out without any."""

import time
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from halfshell._check.by_supports import spheres_of

X, BATCH = np.random.default_rng(0).random((6, 3)), [0, 0, 1, 1, 1, 7]
H = np.tile(np.diag([1.0, 2.0, 4.0]), (6, 1, 1))


def changed(k, a, b, value, both=True):
    matrices = H.copy()
    matrices[k, a, b] = value
    if both:
        matrices[k, b, a] = value
    return matrices


CALLS = {
    "pairs": lambda **how: hs.pairs(X, None, **how),
    "neighbors": lambda **how: hs.neighbors(X, None, **how),
    "coordination": lambda **how: hs.coordination(X, None, **how),
    "count_pairs": lambda **how: hs.count_pairs(X, None, **how),
    "pairs_between": lambda **how: hs.pairs_between(
        X, X, None, query_supports=how.get("supports"), **how
    ),
    "iter_pairs": lambda **how: list(hs.iter_pairs(X, None, **how)),
    "for_each_pair": lambda **how: hs.for_each_pair(X, None, lambda *pair: None, **how),
    "verify": lambda **how: hs.verify(X, None, [], [], **how),
    "explain": lambda **how: hs.explain(X, None, **how),
    "pairs of a batch": lambda **how: hs.pairs(X, None, batch=BATCH, **how),
    "count_pairs of a batch": lambda **how: hs.count_pairs(X, None, batch=BATCH, **how),
}

REFUSED = [
    ({"supports": H, "extent": -1.0}, ValueError, "extent must be finite and not negative, got -1"),
    ({"supports": H, "extent": np.nan}, ValueError, "extent must be finite"),
    ({"supports": H, "extent": np.inf}, ValueError, "extent must be finite"),
    ({"supports": H, "extent": "2"}, TypeError, "extent"),
    ({"supports": H, "extent": [1.0]}, TypeError, "extent must be a number"),
    ({"supports": H}, ValueError, "supports need an extent"),
    ({"extent": 1.0}, ValueError, "extent needs supports"),
    ({"supports": H[:5], "extent": 1.0}, ValueError, r"shape \(6, 3, 3\)"),
    ({"supports": H[:, :2, :2], "extent": 1.0}, ValueError, r"shape \(6, 3, 3\)"),
    ({"supports": H[0], "extent": 1.0}, ValueError, r"shape \(6, 3, 3\)"),
    ({"supports": 1.0, "extent": 1.0}, (TypeError, ValueError), "supports must"),
    ({"supports": H.astype(complex), "extent": 1.0}, TypeError, "supports"),
    ({"supports": changed(3, 2, 1, 0.5, False), "extent": 1.0}, ValueError,
     r"supports must be symmetric, got supports\[3, 2, 1\] = 0.5 and supports\[3, 1, 2\] = 0.0"),
    ({"supports": changed(4, 2, 1, np.nan), "extent": 1.0}, ValueError,
     r"supports must be finite, got supports\[4, 1, 2\] = nan"),
    ({"supports": changed(4, 0, 0, np.inf), "extent": 1.0}, ValueError, r"supports\[4, 0, 0\]"),
    ({"supports": changed(2, 0, 0, 0.0), "extent": 1.0}, ValueError,
     r"positive definite; supports\[2\] is not"),
    ({"supports": changed(5, 1, 1, -2.0), "extent": 1.0}, ValueError, r"supports\[5\]"),
    ({"supports": changed(1, 0, 1, 2.0), "extent": 1.0}, ValueError, r"supports\[1\]"),
    ({"supports": H * 0.0, "extent": 1.0}, ValueError, r"supports\[0\]"),
    ({"supports": H * 1e-308, "extent": 4.0}, ValueError, r"supports\[0\] reaches further"),
    ({"supports": H, "extent": 1.0, "rule": "sum"}, ValueError, "rule must be one of"),
    ({"supports": H, "extent": 1.0, "rule": "mean"}, ValueError, "rule must be one of"),
    ({"supports": H, "extent": 1.0, "radii": np.ones(6)}, ValueError,
     "radii and supports cannot be given together"),
    ({"radii": np.ones(6), "extent": 1.0}, ValueError, "radii and supports cannot"),
    ({"supports": H, "extent": 1.0, "types": np.zeros(6, int)}, ValueError,
     "types and supports cannot be given together"),
    ({"rule": "max"}, ValueError, "rule needs radii or supports"),
]  # fmt: skip


@pytest.mark.parametrize(("how", "error", "message"), REFUSED)
def test_what_is_refused_says_why(how, error, message):
    for call in CALLS.values():
        with pytest.raises(error, match=message):
            call(**how)


def test_rules_with_a_direction_are_for_rows():
    for name in ("pairs", "pairs of a batch", "iter_pairs", "for_each_pair", "explain"):
        for rule in ("gather", "scatter"):
            with pytest.raises(ValueError, match="has a direction"):
                CALLS[name](supports=H, extent=1.0, rule=rule)


def test_supports_of_two_sets_go_together():
    q = X[:4]
    with pytest.raises(ValueError, match="supports and query_supports must be given together"):
        hs.pairs_between(q, X, None, supports=H, extent=1.0)
    with pytest.raises(ValueError, match="goes by query_supports alone"):
        hs.pairs_between(q, X, None, supports=H, extent=1.0, rule="gather")
    with pytest.raises(ValueError, match="query_supports needs queries"):
        hs.neighbors(X, None, supports=H, query_supports=H, extent=1.0)
    with pytest.raises(ValueError, match=r"query_supports must have shape \(4, 3, 3\)"):
        hs.pairs_between(q, X, None, query_supports=H, extent=1.0, rule="gather")
    with pytest.raises(ValueError, match=r"query_supports\[2\] is not"):
        hs.pairs_between(
            q, X, None, query_supports=changed(2, 0, 0, -1.0)[:4], extent=1.0, rule="gather"
        )


def test_more_than_three_dimensions_are_refused():
    d = 4
    with pytest.raises(ValueError, match=f"1 to 3 dimensions, got {d}"):
        hs.pairs(np.zeros((2, d)), None, supports=np.tile(np.eye(d), (2, 1, 1)), extent=1.0)


def test_a_large_scene_is_refused_before_it_is_searched():
    n = 200_000
    x = np.random.default_rng(1).random((n, 3))
    matrices = np.tile(np.eye(3), (n, 1, 1))
    matrices[n - 1, 2, 2] = 0.0  # every support reaches across the box
    begun = time.perf_counter()
    with pytest.raises(ValueError, match=rf"supports\[{n - 1}\] is not"):
        hs.pairs(x, None, supports=matrices, extent=1.0, box=1.0)
    assert time.perf_counter() - begun < 1.0


def singular(kind):
    """Singular in exact arithmetic, and the entry that makes it otherwise."""
    if kind == "two":  # of thirds: 1/3 * 3 is rounded to 1
        a, b = 1.0 / 3.0, 1.0
        return np.array([[a * a, a * b], [a * b, b * b]]), (0, 0)
    if kind == "exact":
        return np.array([[1.0, 3.0], [3.0, 9.0]]), (1, 1)
    if kind == "tiny":
        return np.array([[2.0**-600, 2.0**-300], [2.0**-300, 1.0]]), (0, 0)
    v = np.array([1.0, 3.0, 5.0])
    return np.outer(v, v) + np.outer([2.0, 1.0, 0.0], [2.0, 1.0, 0.0]), (2, 2)


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


@pytest.mark.parametrize("kind", ["two", "exact", "tiny", "three"])
def test_singular_ones_are_told_exactly(kind):
    matrix, (a, b) = singular(kind)
    d = len(matrix)
    seen = set()
    for step in range(-3, 4):
        beside = matrix.copy()
        for _ in range(abs(step)):
            beside[a, b] = np.nextafter(beside[a, b], np.inf * step)
        args = {"supports": beside[None], "extent": 1.0}
        seen.add(is_definite(beside))
        if is_definite(beside):
            assert hs.count_pairs(np.zeros((1, d)), None, **args) == 0
            radius = spheres_of(beside[None], 1.0)[0]
            assert radius > 1e6
        else:
            with pytest.raises(ValueError, match=r"supports\[0\] is not"):
                hs.count_pairs(np.zeros((1, d)), None, **args)
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
            hs.count_pairs(np.zeros((1, d)), None, supports=matrix[None], extent=1.0)
            assert expected
        except ValueError as error:
            assert not expected and "positive definite" in str(error)
    assert min(counts) > 40


def test_other_types_are_converted_exactly():
    for dtype in (np.float32, np.int64, ">f8", np.float16):
        expected = hs.pairs(X, None, supports=H, extent=1.5)
        again = hs.pairs(X, None, supports=H.astype(dtype), extent=1.5)
        assert all(np.array_equal(a, b) for a, b in zip(expected, again))
        strided = np.empty((12, 3, 6))[::2, :, ::2]
        strided[...] = H
        strided.flags.writeable = False
        again = hs.pairs(X, None, supports=strided, extent=1.5)
        assert all(np.array_equal(a, b) for a, b in zip(expected, again))


def test_no_points_and_one_point():
    assert hs.pairs(np.empty((0, 3)), None, supports=np.empty((0, 3, 3)), extent=1.0)[0].size == 0
    table = hs.neighbors([[0.0]], None, supports=[[[1.0]]], extent=2.5, box=1.0, quantities="jS")
    assert table.shifts.ravel().tolist() == [-2, -1, 1, 2]


def test_a_scene_without_supports_pays_for_none():
    x = np.random.default_rng(2).random((5000, 3))
    measured = hs.explain(x, 0.1, box=1.0, measure=True).measured["bytes"]
    assert measured["supports"] == 0
    assert measured["points"] > 0


def test_the_plan_names_octaves_of_supports():
    plan = hs.explain(X, None, supports=H, extent=1.0, algorithm="hierarchy")
    assert plan.algorithm == "hierarchy"
    assert plan.reason.startswith("1 octave of supports up to 1, each searched with cells of its")


def test_verify_finds_what_is_missed_and_what_is_spurious():
    x = np.array([[0.0, 0.0], [0.9, 0.0], [0.0, 0.9]])
    narrow = np.tile(np.diag([1.0, 2.0]), (3, 1, 1))
    assert hs.verify(x, None, [0], [1], supports=narrow, extent=1.0)
    verdict = hs.verify(x, None, [0], [2], supports=narrow, extent=1.0)
    assert verdict.missed.tolist() == [[0, 1]] and verdict.spurious.tolist() == [[0, 2]]
    wide = hs.verify(x, None, [0, 0], [1, 2], supports=narrow[:, ::-1, ::-1], extent=1.0)
    assert wide.spurious.tolist() == [[0, 1]]
