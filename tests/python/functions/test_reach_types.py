# SPDX-License-Identifier: BSD-3-Clause
"""A cutoff for each pair of types, as a table or a dict, against rational arithmetic."""

import math

import numpy as np
import pytest

import halfshell as hs
from oracles import same_arrays
from reach_scenes import BOXES, Reaching, boxed, check
from refused_calls import INF, NAN, assert_refused

TABLE = np.array([[0.3, 0.5, 0.0, 0.1], [0.5, 0.0, 0.2, 0.6], [0.0, 0.2, 0.7, 0.4],
                  [0.1, 0.6, 0.4, 0.25]])  # fmt: skip
PAIRS = {(0, 1): 0.5, (2, 2): 0.7, (3, 0): 0.25, (7, 1): 0.3}
POINTS = np.random.default_rng(5).random((20, 3))
TYPES = np.arange(20) % 3


@pytest.mark.parametrize("kind", BOXES)
def test_equals_the_definition(kind, rng):
    for ndim in (1, 2, 3, 4):
        for cutoff in (TABLE, PAIRS):
            points, scene = boxed(rng, kind, ndim, 18)
            types = rng.integers(0, 4, 18)
            for inclusive in (True, False):
                scene |= {"inclusive": inclusive}
                one = Reaching(points, cutoff, types=types, **scene)
                check(one)
                check(one.but(n_queries=7))
                check(one.but(points=points.astype(np.float32)))


def test_types_that_nobody_has_and_types_that_pair_with_nobody(rng):
    points = rng.random((20, 2))
    for types in (np.full(20, 2), rng.choice([1, 3], 20), rng.integers(0, 9, 20)):
        for cutoff in ({(1, 3): 0.4}, {(2, 2): 0.3}, {(5, 6): 0.5, (6, 8): 0.3}, {}):
            check(Reaching(points, cutoff, types=types))
            check(Reaching(points, cutoff, 8, types=types))
    for types in (np.full(20, 2), rng.choice([1, 3], 20)):
        check(Reaching(points, TABLE, types=types))
    assert hs.count_pairs(points, np.zeros((1, 1)), types=[0] * 20) == 0


def test_ties_at_each_cutoff(rng):
    points = rng.integers(-6, 7, (30, 2)) / 4.0
    table = rng.integers(0, 7, (3, 3)) / 4.0
    table = np.maximum(table, table.T)
    for inclusive in (True, False):
        one = Reaching(points, table, types=rng.integers(0, 3, 30), inclusive=inclusive)
        check(one)
        check(one.but(box=[3.0, 3.0]))
        check(one.but(n_queries=11))


def test_cutoffs_of_every_size(rng):
    points = np.concatenate([rng.random((12, 2)), 1e-5 * rng.random((12, 2))])
    table = [[0.5, 1e-3, 1e-9], [1e-3, 3e-6, 0.0], [1e-9, 0.0, 4e-6]]
    assert check(Reaching(points, np.array(table), types=rng.integers(0, 3, 24)))


def test_cutoffs_larger_than_the_box(rng):
    for kind in ("periodic", "triclinic"):
        points, scene = boxed(rng, kind, 2, 5)
        cutoffs = {(0, 0): 2.5, (0, 1): 0.3, (1, 1): 1.1}
        found = check(Reaching(points, cutoffs, types=[0, 1, 1, 0, 2], **scene))
        assert any(i == j for i, j, _ in found)


def test_one_cutoff_for_all_types_is_one_cutoff(rng):
    for kernel in hs.kernels():
        points = rng.random((500, 3))
        how = {"quantities": "ijSdD", "sort": True, "box": 1.0, "kernel": kernel}
        table = np.full((5, 5), 0.2)
        found = hs.pairs(points, table, types=rng.integers(0, 5, 500), **how)
        assert same_arrays(found, hs.pairs(points, 0.2, **how))


@pytest.mark.parametrize("t", [1, 8, 9, 40])
def test_tables_of_many_types_with_pairs_left_out(t):
    rng = np.random.default_rng(t)
    points, types = rng.integers(0, 8, (300, 3)) / 8.0, rng.integers(0, t, 300)
    table = rng.choice([0.0, 0.125, 0.25, 0.375, math.nextafter(0.25, 0)], (t, t))
    table = np.maximum(table, table.T)
    left_out = rng.random((t, t)) < 0.3
    left_out[0, 0] = False
    left_out |= left_out.T
    cutoffs = {(a, b): table[a, b] for a in range(t) for b in range(a, t) if not left_out[a, b]}
    # whole eighths: squares are exact, and roots of those that are no squares are far from them
    distance = np.sqrt(((points[None] - points[:, None]) ** 2).sum(-1))
    reach = table[np.ix_(types, types)]
    kept = ~left_out[np.ix_(types, types)] & np.triu(np.ones((300, 300), bool), 1)
    for inclusive in (True, False):
        near = distance <= reach if inclusive else distance < reach
        i, j = hs.pairs(points, cutoffs, types=types, inclusive=inclusive, sort=True)
        assert np.array_equal(np.argwhere(near & kept), np.column_stack([i, j]))


# ---- forms ---------------------------------------------------------------------------------


def test_a_table_may_have_any_form():
    expected = hs.pairs(POINTS, TABLE, types=TYPES, sort=True)
    assert len(expected[0]) > 0
    for cutoff in (TABLE.tolist(), np.asfortranarray(TABLE), TABLE.astype(">f8"),
                   np.repeat(TABLE, 2, axis=1)[:, ::2]):  # fmt: skip
        for types in (TYPES.tolist(), TYPES.astype(np.uint8), TYPES.astype(">i8"),
                      np.repeat(TYPES, 2)[::2]):  # fmt: skip
            found = hs.pairs(POINTS, cutoff, types=types, sort=True)
            assert same_arrays(found, expected)
    whole = np.array([[1, 0], [0, 0]])
    assert hs.count_pairs(POINTS, whole, types=TYPES % 2) == hs.count_pairs(
        POINTS, whole.astype(np.float32), types=TYPES % 2
    )


def test_a_dict_counts_both_ways_and_may_have_names():
    numbers = {(0, 1): 0.5, (2, 0): 0.25, (1, 1): 0.4}
    expected = hs.pairs(POINTS, numbers, types=TYPES, sort=True)
    assert len(expected[0]) > 0
    turned = {(b, a): length for (a, b), length in numbers.items()}
    assert same_arrays(hs.pairs(POINTS, turned, types=TYPES, sort=True), expected)
    assert same_arrays(hs.pairs(POINTS, turned | numbers, types=TYPES, sort=True), expected)
    names = np.array(["H", "CA", "solvent"])
    by_name = {(names[a], names[b]): length for (a, b), length in numbers.items()}
    labels = names[TYPES]
    for types in (labels, labels.tolist(), labels.astype(object), labels.astype("U20")):
        assert same_arrays(hs.pairs(POINTS, by_name, types=types, sort=True), expected)
        q = hs.count_pairs(
            POINTS[5:], by_name, types=types[5:], queries=POINTS[:5], query_types=types[:5]
        )
        assert q == sum(i < 5 <= j for i, j in zip(*(column.tolist() for column in expected)))
    # Elements may be named that no point is.
    absent = by_name | {("O", "Og"): 0.3, ("H", "O"): 0.2}
    assert same_arrays(hs.pairs(POINTS, absent, types=labels, sort=True), expected)


def test_of_no_points_types_may_be_anything():
    for cutoff in (TABLE, PAIRS, {("H", "CA"): 1.0}):
        assert hs.count_pairs(np.empty((0, 2)), cutoff, types=[]) == 0


# ---- what is refused -----------------------------------------------------------------------


@pytest.mark.parametrize(
    "table, fragments",
    [
        ([[1.0, 2.0], [2.5, 1.0]], [r"symmetric.*cutoff\[0, 1\] = 2.0.*cutoff\[1, 0\] = 2.5"]),
        ([[1.0, 2.0]], [r"\(t, t\)", r"\(1, 2\)"]),
        (np.ones((2, 2, 2)), [r"\(t, t\)", r"\(2, 2, 2\)"]),
        ([1.0, 2.0], [r"\(t, t\)", r"\(2,\)"]),
        (1.5, [r"\(t, t\)", r"\(\)"]),
        ([[1.0, -2.0], [-2.0, 1.0]], [r"not negative.*cutoff\[0, 1\] = -2"]),
        ([[1.0, NAN], [NAN, 1.0]], [r"finite.*cutoff\[0, 1\] = nan"]),
        ([[INF]], [r"finite.*cutoff\[0, 0\] = inf"]),
    ],
)
def test_tables_that_are_none(table, fragments):
    types = np.zeros(20, int)
    for call in (hs.pairs, hs.count_pairs, hs.neighbors, hs.iter_pairs):
        assert_refused(
            lambda call=call: call(POINTS, table, types=types), ValueError, "cutoff", *fragments
        )


@pytest.mark.parametrize(
    "cutoff, types, exception, fragments",
    [
        ({(0, 1): 1.0, (1, 0): 2.0}, TYPES, ValueError, ["contradicts", r"\(1, 0\)"]),
        ({(0, 1): -1.0}, TYPES, ValueError, ["not negative", r"\(0, 1\)"]),
        ({(0, 1): NAN}, TYPES, ValueError, ["finite", "nan"]),
        ({(0, 1): "far"}, TYPES, TypeError, [r"cutoff\[\(0, 1\)\]"]),
        ({(0, 1, 2): 1.0}, TYPES, TypeError, ["pairs of types"]),
        ({0: 1.0}, TYPES, TypeError, ["pairs of types"]),
        ({(0, 1.5): 1.0}, TYPES, TypeError, ["1.5"]),
        ({(0, True): 1.0}, TYPES, TypeError, ["True"]),
        ({(0, -1): 1.0}, TYPES, ValueError, ["-1"]),
        ({("H", "O"): 1.0}, TYPES, ValueError, ["names.*types are numbers"]),
        ({(0, 1): 1.0}, ["H"] * 20, ValueError, ["numbers.*types are names"]),
        ({("H", "Hx"): 1.0}, ["H"] * 20, ValueError, ["'Hx' is neither an element"]),
        ({(0, 1): 1.0}, None, TypeError, ["types must be given.*dict"]),
        ({(0, 1): 1.0}, [0, 1], ValueError, [r"types.*\(20,\).*\(2,\)"]),
        ({(0, 1): 1.0}, np.full(20, -1), ValueError, [r"types.*types\[0\] = -1"]),
        ({(0, 1): 1.0}, np.zeros(20), TypeError, ["types.*float64"]),
        (TABLE, TYPES + 2, ValueError, [r"types must be less than 4.*types\[2\] = 4"]),
        (TABLE, None, TypeError, ["cutoff"]),
        (TABLE, ["H"] * 20, TypeError, ["types"]),
        (None, TYPES, TypeError, ["cutoff"]),
    ],
)
def test_types_and_dicts_that_do_not_fit(cutoff, types, exception, fragments):
    for call in (hs.pairs, hs.coordination, hs.iter_pairs):
        assert_refused(lambda call=call: call(POINTS, cutoff, types=types), exception, *fragments)


def test_types_of_two_sets_go_together():
    queries = {"queries": POINTS[:4]}
    for given, fragments in (
        ({"types": TYPES}, ["query_types must be given"]),
        ({"query_types": TYPES[:4]}, ["types must be given"]),
        ({"types": TYPES, "query_types": TYPES}, [r"query_types.*\(4,\).*\(20,\)"]),
        ({"types": TYPES, "query_types": TYPES[:4] + 9}, [r"query_types must be less.*\[0\] = 9"]),
    ):
        assert_refused(
            lambda given=given: hs.count_pairs(POINTS, TABLE, **given, **queries),
            ValueError, *fragments,
        )  # fmt: skip
    assert_refused(
        lambda: hs.count_pairs(
            POINTS, {(0, 1): 1.0}, types=TYPES, query_types=["H"] * 4, **queries
        ),
        ValueError, "both be numbers",
    )  # fmt: skip
    assert_refused(
        lambda: hs.neighbors(POINTS, TABLE, types=TYPES, query_types=TYPES),
        ValueError, "query_types needs queries",
    )  # fmt: skip


def test_types_with_other_arguments():
    for given in ({"radii": np.ones(20)}, {"rule": "sum"}):
        assert_refused(
            lambda given=given: hs.pairs(POINTS, TABLE, types=TYPES, **given), ValueError,
            *given, "together|needs radii",
        )  # fmt: skip


def test_a_table_of_no_types_holds_for_no_points():
    nothing, table = np.zeros((0, 3)), np.zeros((0, 0))
    i, j = hs.pairs(nothing, table, types=[])
    assert len(i) == len(j) == hs.count_pairs(nothing, table, types=[]) == 0
    assert hs.neighbors(nothing, table, types=[]).n_rows == 0
