# SPDX-License-Identifier: BSD-3-Clause
"""`verify` where pairs have a reach each: right lists pass, and every fault is named."""

import numpy as np
import pytest

import halfshell as hs
from calls import call
from halfshell._check.right import Right
from reach_scenes import RULES, SYMMETRIC, Reaching, boxed, spread_radii
from refused_calls import assert_refused

POINTS = [[0.0], [1.0], [3.0], [6.0]]
RADII = [0.5, 0.5, 1.5, 0.0]  # the first two touch, and the next two


def columns_of(rows, ndim=3):
    """i, j and S of (i, j, S), as keywords."""
    array = np.array([[i, j, *S] for i, j, S in rows], int).reshape(-1, 2 + ndim)
    return {"i": array[:, 0], "j": array[:, 1], "S": array[:, 2:]}


def test_faults_are_named():
    how = {"radii": RADII}
    assert str(call(hs.verify, POINTS, None, [0, 2], [1, 1], **how)) == "correct: 2 pairs"
    for i, j, kind, row in (
        ([0], [1], "missed", [1, 2]),
        ([0, 1, 2], [1, 2, 3], "spurious", [2, 3]),
        ([0, 1, 1], [1, 2, 0], "duplicate", [0, 1]),
    ):
        verdict = call(hs.verify, POINTS, None, i, j, **how)
        assert not verdict and getattr(verdict, kind).tolist() == [row]
    assert call(hs.verify, POINTS, None, [], [], inclusive=False, **how)
    assert call(hs.verify, POINTS, 1.5, [0], [1], **how)
    assert call(hs.verify, POINTS, None, [0, 1, 1, 2], [1, 0, 2, 1], full=True, **how)


def test_faults_in_lists_with_a_direction():
    how = {"radii": [1.0, 0.0, 2.0, 0.0], "rule": "gather"}
    assert call(hs.verify, POINTS, None, [0, 2], [1, 1], **how)
    verdict = call(hs.verify, POINTS, None, [0, 1], [1, 2], **how)
    assert verdict.missed.tolist() == [[2, 1]] and verdict.spurious.tolist() == [[1, 2]]
    assert call(hs.verify, POINTS, None, [1, 1], [0, 2], **how | {"rule": "scatter"})
    assert_refused(
        lambda: call(hs.verify, POINTS, None, [0, 2], [1, 1], full=True, **how), ValueError, "full"
    )
    table = call(hs.neighbors, POINTS, None, **how)
    assert call(hs.verify, POINTS, None, table, **how)
    assert not call(hs.verify, POINTS, None, table, **how | {"rule": "scatter"})
    assert_refused(lambda: call(hs.verify, POINTS, None, table[:2], **how), ValueError, "2 rows")
    assert_refused(
        lambda: call(hs.verify, POINTS, None, table, radii=RADII), ValueError, "one set of points"
    )


def test_types_and_queries():
    cutoffs, types = {(0, 1): 2.0, (1, 1): 3.0}, [0, 0, 1, 1]
    assert call(hs.verify, POINTS, cutoffs, [1, 2], [2, 3], types=types)
    verdict = call(hs.verify, POINTS, cutoffs, [0, 2], [1, 3], types=types, inclusive=True)
    assert verdict.spurious.tolist() == [[0, 1]] and verdict.missed.tolist() == [[1, 2]]
    queries = {"queries": [[2.0], [5.0]], "types": types, "query_types": [0, 1]}
    assert call(hs.verify, POINTS, cutoffs, [0, 1, 1], [2, 2, 3], **queries)
    assert not call(hs.verify, POINTS, cutoffs, [0, 1], [2, 2], **queries)
    shifts = [[0], [0], [0]]
    assert call(hs.verify, POINTS, cutoffs, [0, 1, 1], [2, 2, 3], shifts, **queries)
    wrong = call(hs.verify, POINTS, cutoffs, [0, 0, 1], [2, 0, 3], shifts, **queries)
    assert wrong.spurious.tolist() == [[0, 0, 0]] and wrong.missed.tolist() == [[1, 2, 0]]


@pytest.mark.parametrize(("rule", "kind"), [*zip(RULES, ["open", "periodic", "sheared"] * 2)])
def test_the_right_list_is_that_of_rational_arithmetic(rule, kind, rng):
    points, scene = boxed(rng, kind, 3, 25)
    for decades in (1.0, 300.0):
        radii = spread_radii(rng, 25, 0.5 if rule == "sum" else 1.0, decades)
        if rule == "mean":
            radii = np.where(radii < 1e-300, 0.0, radii)
        for cutoff in (None, 0.4):
            one = Reaching(points, cutoff, radii=radii, rule=rule, **scene)
            full = one.full()
            is_full = rule in SYMMETRIC
            assert call(hs.verify, **one.arguments, **columns_of(full), full=is_full)
            for k in range(0, len(full), 1 + len(full) // 4):
                fewer = columns_of(full[:k] + full[k + 1 :])
                verdict = call(hs.verify, **one.arguments, **fewer, full=is_full)
                i, j, S = full[k]
                assert verdict.missed.tolist() == [[i, j, *S]]
            between = one.but(n_queries=9)
            assert call(hs.verify, **between.of_two_sets, **columns_of(between.between()))


def test_differences_are_decided_again(monkeypatch):
    """A right list that is wrong would not stand against rational arithmetic."""
    rows = Right.rows
    monkeypatch.setattr(Right, "rows", lambda *given, **how: rows(*given, **how)[1:])
    with pytest.raises(AssertionError, match="rational arithmetic disagree"):
        call(hs.verify, POINTS, None, [0, 1], [1, 2], [[0], [0]], radii=RADII)
