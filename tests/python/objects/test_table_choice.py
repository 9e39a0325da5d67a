# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a table by numbers and masks, and sums over rows."""

import copy
import pickle
import re
from functools import partial

import numpy as np
import pytest

import halfshell as hs
from oracles import same_arrays
from refused_calls import assert_refused

RNG = np.random.default_rng(17)
POINTS = RNG.random((30, 2)) * 6.0
POINTS[3] = POINTS[4]
CHOICES = [
    [], [0], [29, 0, 5, 5], [-1, -30], np.array([7], np.int32), np.array([7, 2], np.uint64),
    np.arange(30), np.arange(30) % 3 == 0, np.zeros(30, bool), [True] * 30, np.arange(60)[8:2:-2],
    np.empty(0, np.int64),
]  # fmt: skip


def numbers_of(choice):
    return np.arange(30)[np.asarray(choice, None if len(choice) else np.int64)]


@pytest.mark.parametrize(
    "letters, box", [("j", None), ("jd", [6.0, 6.0]), ("DjSd", [6.0, 6.0]), ("d", None)]
)
def test_chosen_rows_are_those_of_the_table(box, letters):
    table = hs.neighbors(POINTS, 1.5, box=box, quantities=letters)
    for choice in CHOICES:
        part, numbers = table[choice], numbers_of(choice)
        assert part.shape == (len(numbers), 30) and part.quantities == letters
        assert part.offsets.dtype == np.int64 and part.offsets[-1] == part.n_entries
        for row, k in zip(part, numbers, strict=True):
            assert same_arrays(row, table[k])
        assert not any(column.flags.writeable for column in part._arrays)
        assert_refused(part.reverse, (ValueError, AttributeError))


@pytest.mark.parametrize("letters", ["jd", "jdS"])
@pytest.mark.parametrize("queries", [None, POINTS[::-1] + 0.25])
def test_rows_of_rows_sort_and_are_pickled_as_those_of_the_whole(queries, letters):
    grid = np.argwhere(np.ones((6, 5))).astype(float)  # many distances are the same
    table = hs.neighbors(grid, 3.0, queries=queries, box=[6.0, 5.0], quantities=letters)
    whole = table.sort()
    picks = [[9, 2, 2, 29], np.arange(30) > 20, slice(4, 11)]
    for first in picks:
        for then in ([1, 0], slice(1, 3), np.array([-1])):
            for step in (lambda t: t, copy.deepcopy, lambda t: pickle.loads(pickle.dumps(t))):
                part = step(table[first])[then]
                numbers = np.arange(30)[first][then]
                for row, k in zip(step(part).sort(), numbers, strict=True):
                    assert all(map(np.array_equal, row, whole[k]))
    part = table[[9, 2]].filter(table[[9, 2]].distances > 1.0)
    for row, k in zip(part.sort(), (9, 2), strict=True):
        assert np.array_equal(row[0], whole[k][0][whole[k][1] > 1.0])


def test_what_chooses_no_rows():
    table = hs.neighbors(POINTS, 1.0)
    for choice, kind, words in (
        ([30], IndexError, "row 30 (at [0]) of a table of 30 rows"),
        ([0, -31], IndexError, "row -31 (at [1])"),
        (np.array([0, 2**64 - 1], np.uint64), IndexError, "at [1]"),
        ([0.0], TypeError, "whole number"),
        (np.empty(0), TypeError, "float64"),
        (["a"], TypeError, "whole number"),
        ([True] * 29, ValueError, "one bool for each row"),
        ([[0, 1]], ValueError, "one axis"),
        ([[0], [0, 1]], ValueError, "rows must be a rectangular array"),
        (np.ma.array([0, 1], mask=[0, 1]), ValueError, "masked"),
        ((0, 1), TypeError, "an array of whole numbers or a mask, got tuple"),
    ):  # fmt: skip
        assert_refused(partial(table.__getitem__, choice), kind, re.escape(words))


def test_types_of_sums():
    types = [
        (bool, np.int64), (np.int8, np.int64), (np.int64, np.int64), (np.uint8, np.uint64),
        (np.float16, np.float64), (np.float32, np.float64), (">f8", np.float64),
    ]  # fmt: skip
    for n in (0, 2):
        table = hs.neighbors(np.zeros((n, 1)), 1.0)
        for given, summed in types:
            sums = table.sum(np.ones(table.n_entries, given))
            assert sums.dtype == summed and sums.tolist() == [1] * n


def test_values_that_cannot_be_summed():
    table = hs.neighbors([[0.0], [1.0]], 1.0)
    for values in (1.0, [1.0], [[1.0, 2.0]], None):
        assert_refused(partial(table.sum, values), (ValueError, TypeError), "values")
    for values in (["a", "b"], [1j, 2j], [None, None], np.ones(2, np.longdouble), "ab"):
        assert_refused(partial(table.sum, values), TypeError, "values")
