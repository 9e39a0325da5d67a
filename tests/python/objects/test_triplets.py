# SPDX-License-Identifier: BSD-3-Clause
"""Triplets of a table: two entries of one row, whole or in blocks."""

import itertools

import numpy as np
import pytest

import halfshell as hs


def expected(table, ordered):
    choose = itertools.permutations if ordered else itertools.combinations
    rows = itertools.pairwise(table.offsets.tolist())
    return sorted(pair for first, end in rows for pair in choose(range(first, end), 2))


def tables():
    rng = np.random.default_rng(0)
    yield hs.neighbors(rng.random((40, 3)), 0.4)
    yield hs.neighbors(rng.random((40, 2)), 0.05)  # nearly all rows are empty
    yield hs.neighbors(rng.random((5, 3)), 1.5, box=[1.0] * 3, quantities="jS")
    yield hs.neighbors(rng.random((9, 3)), 0.5, queries=rng.random((4, 3)))
    yield hs.neighbors(np.empty((0, 3)), 1.0)
    yield hs.neighbors([[0.0]], 1.0)


TABLES = list(tables())


@pytest.mark.parametrize("table", TABLES, ids=range(len(TABLES)))
def test_all_and_in_blocks(table):
    for ordered in (False, True):
        wanted = expected(table, ordered)
        first, second = table.triplets(ordered=ordered)
        assert first.dtype == second.dtype == np.int64
        assert list(zip(first.tolist(), second.tolist(), strict=True)) == wanted
        for block in (1, 7, 100, 10**9):
            parts = list(table.triplets(ordered=ordered, block=block))
            found = [pair for a, b in parts for pair in zip(a.tolist(), b.tolist(), strict=True)]
            assert found == wanted
            row = np.repeat(np.arange(len(table)), table.counts)
            assert all(len(a) <= block or len(set(row[a])) == 1 for a, _ in parts)
            assert all(len(a) > 0 for a, _ in parts)


def test_of_some_rows():
    table = TABLES[0]
    for rows in (table[5:12], table[[3, 1, 3]]):
        first, second = rows.triplets()
        assert list(zip(first.tolist(), second.tolist(), strict=True)) == expected(rows, False)


def test_too_many_are_refused_before():
    points = np.zeros((3000, 1))
    table = hs.neighbors(points, 1.0, queries=[[0.0]])
    assert len(table.triplets()[0]) == 3000 * 2999 // 2
    huge = hs.neighbors(np.zeros((10**6, 1)), 1.0, queries=[[0.0]])
    with pytest.raises(MemoryError, match="triplets"):
        huge.triplets()
    with pytest.raises(MemoryError, match="triplets"):
        next(huge.triplets(block=1000))


@pytest.mark.parametrize(
    ("options", "kind", "words"),
    [
        ({"ordered": "yes"}, TypeError, "ordered"), ({"block": 0}, ValueError, "block must be 1"),
        ({"block": 1.5}, TypeError, "block"), ({"block": "1"}, TypeError, "block"),
    ],
)  # fmt: skip
def test_bad_arguments(options, kind, words):
    with pytest.raises(kind, match=words):
        TABLES[0].triplets(**options)
