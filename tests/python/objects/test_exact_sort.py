# SPDX-License-Identifier: BSD-3-Clause
"""`NeighborTable.sort` orders by the true distances, as `nearest` does, ties by (j, S)."""

import pickle
import sys
import threading

import numpy as np
import pytest

import halfshell as hs
from halfshell import _core
from halfshell._check.reference import exact_square
from halfshell._objects import exact
from halfshell._objects.exact import Origin
from oracles import same_arrays


def assert_in_exact_order(done, points, box, queries=None, first=0):
    """Rows of a sorted table with j and S, by fractions."""
    asking = points if queries is None else queries
    at = [done.quantities.index(letter) for letter in "jS"]
    for k in range(len(done)):
        j, S = (done[k][a].tolist() for a in at)
        keys = [
            (exact_square((asking[first + k], points[b]), 0, 1, s, box), b, tuple(s))
            for b, s in zip(j, S, strict=True)
        ]
        assert keys == sorted(keys)


def crystal(step, size, ndim, dtype=np.float64):
    return (np.indices((size,) * ndim).reshape(ndim, -1).T * step).astype(dtype)


@pytest.mark.parametrize(
    "ndim, dtype", [(1, float), (2, np.float32), (2, float), (3, float), (4, np.float32)]
)
def test_crystals_whose_shells_tie_but_for_rounding(ndim, dtype):
    size = 8 if ndim < 3 else 4
    points, box = crystal(0.1, size, ndim, dtype), np.eye(ndim) * 0.1 * size
    table = hs.neighbors(points, 0.31 if ndim < 4 else 0.21, box=box, quantities="djS")
    done = table.sort()
    assert_in_exact_order(done[:20], points, box)
    rounded = np.lexsort((table.distances, np.repeat(np.arange(len(table)), table.counts)))
    if ndim > 1 and dtype is float:
        assert not np.array_equal(table.indices[rounded], done.indices)
    least = int(table.counts.min())
    j, S = hs.nearest(points, least, box=box, quantities="jS")
    for k, (_, row_j, row_S) in enumerate(done):
        assert np.array_equal(row_j[:least], j[k]) and np.array_equal(row_S[:least], S[k])


def test_numbers_of_every_scale_are_compared(rng):
    points = rng.choice([1.0, -1.0], (25, 2)) * 2.0 ** rng.integers(-1070, 500, (25, 2))
    table = hs.neighbors(points, 1e160, quantities="jdS").sort()
    assert_in_exact_order(table, points, None)
    tiny = rng.integers(-4, 4, (20, 3)) * 5e-324
    assert_in_exact_order(hs.neighbors(tiny, 1.0, quantities="jdS").sort(), tiny, None)


SCENE = crystal(0.1, 4, 3)
BOX = np.diag([0.4, 0.4, 0.4])


def makers():
    queries = SCENE[:9] + 0.05
    cells = hs.CellList(SCENE, 0.25, box=BOX)
    radii = np.linspace(0.1, 0.3, 9)
    return {
        "neighbors": lambda letters: hs.neighbors(SCENE, 0.25, box=BOX, quantities=letters),
        "list of lists": lambda letters: hs.neighbors(
            SCENE.tolist(), 0.25, box=[0.4] * 3, periodic=[True] * 3, quantities=letters
        ),
        "queries": lambda letters: hs.neighbors(
            SCENE, 0.25, queries=queries, box=BOX, quantities=letters
        ),
        "cells": lambda letters: cells.neighbors(quantities=letters),
        "query": lambda letters: cells.query(queries, quantities=letters),
        "radii": lambda letters: cells.query(queries, radii, quantities=letters),
        "open": lambda letters: hs.neighbors(SCENE, 0.25, quantities=letters),
    }


@pytest.mark.parametrize("maker", makers())
def test_tables_without_shifts_are_ordered_alike(maker):
    make = makers()[maker]
    wanted, bare = make("jdS").sort(), make("jd")
    assert np.array_equal(bare.sort().indices, wanted.indices)
    assert np.array_equal(bare.sort().sort().indices, wanted.indices)
    # Slices, filters, pickles, and these one after the other.
    part, full = bare[2:7], make("jdS")[2:7]
    assert np.array_equal(part.sort().indices, full.sort().indices)
    keep = np.arange(part.n_entries) % 3 != 1
    for one, other in ((part, full), (part[1:4], full[1:4])):
        mask = keep[: one.n_entries]
        a, b = one.filter(mask).sort(), other.filter(mask).sort()
        assert np.array_equal(a.indices, b.indices) and np.array_equal(a.distances, b.distances)
        assert np.array_equal(a[1:].sort().indices, b[1:].sort().indices)
        again = pickle.loads(pickle.dumps(one.filter(mask)))
        assert np.array_equal(again.sort().indices, b.indices)
    assert np.array_equal(pickle.loads(pickle.dumps(bare)).sort().indices, wanted.indices)


def sort_beside(table, stop):
    """Another thread sorts before line `stop` of `shifts`: what comes, and how many lines ran."""
    code, n_lines = Origin.shifts.__code__, 0

    def trace(frame, event, argument):
        nonlocal n_lines
        if frame.f_code is not code:
            return None
        n_lines += event == "line"
        if event == "line" and n_lines == stop:
            other = threading.Thread(target=table.sort)
            other.start()
            other.join()
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        return table.sort(), n_lines
    finally:
        sys.settrace(before)


def test_threads_may_need_shifts_at_once():
    """Another thread finds them before any line of the first, as a switch of threads might."""
    wanted = hs.neighbors(SCENE, 0.25, box=BOX, quantities="jdS").sort().indices
    for stop in range(1, 100):
        done, n_lines = sort_beside(hs.neighbors(SCENE, 0.25, box=BOX, quantities="jd"), stop)
        assert np.array_equal(done.indices, wanted)
        if n_lines < stop:
            break
    assert 3 < stop < 99


def wide_ties(n_rows, n_points):
    """Rows of entries at one distance, of numbers with bits from 2**-1000 to 1."""
    x = np.arange(n_rows * n_points) % 2 * 2.0 - 1.0
    points = np.stack((x, np.full_like(x, 2.0**-1000)), axis=1)
    rows = np.zeros((n_rows, 2))
    return hs.NeighborTable(
        (np.arange(n_rows + 1) * n_points, np.arange(len(x)), np.ones(len(x))), "jd", len(x),
        False, origin=Origin(points, rows, None, False),
    )  # fmt: skip


def test_a_long_tie_that_does_not_fit_is_refused(monkeypatch):
    table = wide_ties(1, 60_000)
    monkeypatch.setattr(_core, "available_memory", lambda: 50e6)
    with pytest.raises(MemoryError, match=r"60000 neighbours .* exactly, would take 0\.1"):
        table.sort()


def test_what_sorting_needs_is_named():
    table = hs.neighbors(SCENE, 0.25, quantities="jd")
    bare = hs.NeighborTable((table.offsets, table.indices, table.distances), "jd", 64, True)
    with pytest.raises(AttributeError, match="only tables from neighbors or CellList"):
        bare.sort()
    with pytest.raises(AttributeError, match="'j' in quantities"):
        hs.neighbors(SCENE, 0.25, quantities="d").sort()
    with pytest.raises(ValueError, match="'distance', got 'index'"):
        table.sort(by="index")


def test_rows_are_sorted_a_few_at_a_time(monkeypatch):
    points = crystal(0.1, 4, 3)
    points = np.concatenate([points, [[90.0, 0.0, 0.0]], points + 0.01])  # one row is empty
    table = hs.neighbors(points, 0.2, quantities="jdS")
    whole = table.sort()
    for at_a_time in (1, 7, 100):
        monkeypatch.setattr(exact, "SORTED_AT_A_TIME", at_a_time)
        parts, rows = table.sort(), table[3:90].sort()
        for one, other in ((parts, whole), (rows, whole[3:90])):
            pairs = (some.to_pairs(quantities="ijdS") for some in (one, other))
            assert same_arrays(*pairs)
        assert_in_exact_order(parts[5:9], points, None, first=5)
        assert hs.neighbors(points[:0], 0.2, quantities="jd").sort().n_entries == 0


def test_arguments_may_change_before_a_table_is_sorted():
    points, box = SCENE.copy(), list(BOX)
    table = hs.neighbors(points, 0.25, box=box, quantities="jd")
    wanted = hs.neighbors(SCENE, 0.25, box=BOX, quantities="jd").sort().indices
    points[:] = 0.0
    box[:] = [5.0] * len(box)
    assert np.array_equal(table.sort().indices, wanted)


def test_what_happens_to_the_arguments_changes_nothing():
    points, box, queries = SCENE.copy(), BOX.copy(), SCENE[:5] + 0.05
    cells = hs.CellList(points, 0.25, box=box)
    tables = [
        hs.neighbors(points, 0.25, queries=queries, box=box, quantities="jd"),
        cells.query(queries, quantities="jd"),
        cells.query(queries, [0.25] * 5, quantities="jd"),
    ]
    expected = [pickle.loads(pickle.dumps(table)).sort() for table in tables]
    points *= 0.3
    box *= 2.0
    queries += 0.01
    for table, right in zip(tables, expected, strict=True):
        assert same_arrays(table.sort().indices, right.indices)
