# SPDX-License-Identifier: BSD-3-Clause
"""Two sets: every query with every point, and how many pairs that makes."""


import numpy as np
import pytest

import halfshell as hs
from calls import call
from refused_calls import assert_refused

RNG = np.random.default_rng(43)
POINTS = RNG.random((40, 3)) * 4.0


# ---- errors --------------------------------------------------------------------------------

CALLS = {
    "pairs_between": lambda queries, points, cutoff, **how: call(
        hs.pairs_between, queries, points, cutoff, **how
    ),
    "count_pairs": lambda queries, points, cutoff, **how: call(
        hs.count_pairs, points, cutoff, queries=queries, **how
    ),
    "neighbors": lambda queries, points, cutoff, **how: call(
        hs.neighbors, points, cutoff, queries=queries, **how
    ),
    "coordination": lambda queries, points, cutoff, **how: call(
        hs.coordination, points, cutoff, queries=queries, **how
    ),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_other_dimensions_are_refused(call):
    for as_given in (np.asarray, np.ndarray.tolist):
        queries, points = as_given(np.zeros((5, 2))), as_given(np.zeros((10, 3)))
        with pytest.raises(ValueError, match=r"same number of columns.*\(5, 2\) and \(10, 3\)"):
            call(queries, points, 1.0)
    with pytest.raises(ValueError, match=r"\(0, 2\) and \(40, 3\)"):
        call(np.empty((0, 2)), POINTS, 1.0)


def test_shifts_that_do_not_fit():
    far = np.array([[0.5], [1e12]])
    for queries, points, name in (
        (far, far[:1], r"queries\[1\] lies"), (far[:1], far, r"queries\[0\] lies .* pairs with")
    ):  # fmt: skip
        assert_refused(
            lambda queries=queries, points=points: hs.pairs_between(
                queries, points, 0.75, box=[1.0], quantities="ijS"
            ),
            OverflowError, name, "box vectors away",
        )  # fmt: skip
    beyond = np.array([[0.0, 0.5], [0.0, 2.0**60]])
    box = [[1.0, 0.0], [0.5, 1.0]]
    for queries, points, name in ((beyond, beyond[:1], "queries"), (beyond[:1], beyond, "points")):
        assert_refused(
            lambda queries=queries, points=points: hs.pairs_between(queries, points, 1.0, box=box),
            OverflowError, rf"{name}\[1\] lies",
        )  # fmt: skip
    assert len(hs.pairs_between(far, far[:1], 0.25, box=[1.0], quantities="ij")[0]) == 1


def test_lists_without_elements_have_the_dimensions_of_the_others():
    some = np.zeros((4, 2))
    assert hs.pairs_between(some, [], 1.0, quantities="D").shape == (0, 2)
    assert hs.pairs_between([], some, 1.0, quantities="D").shape == (0, 2)
    assert hs.pairs_between([], [], 1.0, quantities="D").shape == (0, 3)
