# SPDX-License-Identifier: BSD-3-Clause
"""`NeighborTable.sort` orders by the true distances, as `nearest` does, ties by (j, S)."""

import pickle
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from halfshell._objects import exact_order
from oracles import BOX_KINDS, random_scene, same_arrays


def exact_square(p, q, shift, box):
    total = Fraction(0)
    for k in range(len(p)):
        d = Fraction(float(q[k])) - Fraction(float(p[k]))
        for s, row in zip(shift, box):
            d += int(s) * Fraction(float(row[k]))
        total += d * d
    return total


def assert_in_exact_order(done, points, box, queries=None, first=0):
    """Rows of a sorted table with j and S, by fractions."""
    asking = points if queries is None else queries
    box = np.zeros((0, 0)) if box is None else box
    at = [done.quantities.index(letter) for letter in "jS"]
    for k in range(len(done)):
        j, S = (done[k][a].tolist() for a in at)
        keys = [
            (exact_square(asking[first + k], points[b], s, box), b, tuple(s))
            for b, s in zip(j, S, strict=True)
        ]
        assert keys == sorted(keys)


def crystal(step, size, ndim, dtype=np.float64):
    return (np.indices((size,) * ndim).reshape(ndim, -1).T * step).astype(dtype)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("ndim", [1, 2, 3, 4])
def test_crystals_whose_shells_tie_but_for_rounding(ndim, dtype):
    size = 8 if ndim < 3 else 4
    points, box = crystal(0.1, size, ndim, dtype), np.eye(ndim) * 0.1 * size
    table = hs.neighbors(points, 0.31 if ndim < 4 else 0.21, box=box, quantities="djS")
    done = table.sort()
    assert_in_exact_order(done[:20], points, box)
    rounded = np.lexsort((table.distances, np.repeat(np.arange(len(table)), table.counts)))
    if ndim > 1 and dtype is np.float64:
        assert not np.array_equal(table.indices[rounded], done.indices)
    least = int(table.counts.min())
    j, S = hs.nearest(points, least, box=box, quantities="jS")
    for k, (_, row_j, row_S) in enumerate(done):
        assert np.array_equal(row_j[:least], j[k]) and np.array_equal(row_S[:least], S[k])


@pytest.mark.parametrize("kind", BOX_KINDS)
@pytest.mark.parametrize("ndim", [2, 3, 5])
def test_any_box_and_queries_as_fractions_say(kind, ndim, rng):
    points, cutoff, box, periodic = random_scene(rng, 12, ndim, kind, neighbours=5, spread=2)
    points = np.concatenate([points, np.nextafter(points, np.inf), points])  # near ties
    queries = np.concatenate([points[:7], np.nextafter(points[:7], -np.inf)])
    options = {"box": box, "periodic": periodic, "quantities": "dDjS"}
    assert_in_exact_order(hs.neighbors(points, cutoff, **options).sort(), points, box)
    table = hs.neighbors(points, cutoff, queries=queries, **options).sort()
    assert_in_exact_order(table, points, box, queries)


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


def test_slices_know_their_points():
    table = hs.neighbors(SCENE, 0.25, box=BOX, quantities="jdS")
    assert_in_exact_order(table[11:30].sort(), SCENE, BOX, first=11)
    assert_in_exact_order(table[5:40][6:9].sort(), SCENE, BOX, first=11)


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


def test_many_entries_are_taken_in_parts(monkeypatch):
    whole = hs.neighbors(SCENE, 0.25, box=BOX, quantities="jdS").sort()
    monkeypatch.setattr(exact_order, "AT_A_TIME", 24 * 50)
    parts = hs.neighbors(SCENE, 0.25, box=BOX, quantities="jdS").sort()
    assert same_arrays(parts.indices, whole.indices) and same_arrays(parts.shifts, whole.shifts)


def test_what_sorting_needs_is_named():
    table = hs.neighbors(SCENE, 0.25, quantities="jd")
    bare = hs.NeighborTable((table.offsets, table.indices, table.distances), "jd", 64, True)
    with pytest.raises(AttributeError, match="sort one that neighbors or CellList has made"):
        bare.sort()
    with pytest.raises(AttributeError, match="'j' in quantities"):
        hs.neighbors(SCENE, 0.25, quantities="d").sort()
