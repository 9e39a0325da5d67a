# SPDX-License-Identifier: BSD-3-Clause
"""Counts and histograms of a `CellList`: those of the functions, from the cells that are kept."""

import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import halfshell as hs
from cell_scenes import SCENES, queries_of, scene_of


def edges_of(points, cutoff, scene, factor):
    """Edges up to a part of the cutoff or more, some of them exactly at distances."""
    last = cutoff * factor
    d = hs.pairs(points, last, quantities="d", **scene)[:3]
    return np.sort(np.concatenate([[0.0, 0.3 * last, 0.3 * last, last], np.minimum(d, last)]))


def assert_same(found, expected):
    assert found.dtype == expected.dtype and found.shape == expected.shape
    assert found.tobytes() == expected.tobytes()


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("factor", [1.0, 0.5, 0.001, 1.25])
def test_histograms_are_those_of_a_search_of_its_own(name, factor):
    points, cutoff, scene = scene_of(name)
    queries, cells = queries_of(name), hs.CellList(points, cutoff, **scene)
    edges = edges_of(points, cutoff, scene, factor)
    rng = np.random.default_rng(1)
    types, weights = rng.integers(0, 3, len(points)), rng.normal(size=len(points))
    asked = {"queries": queries}
    for marks in (
        {},
        {"types": types},
        {"types": types, "weights": weights},
        asked,
        {**asked, "types": types, "query_types": rng.integers(0, 2, len(queries))},
        {**asked, "weights": weights, "query_weights": rng.normal(size=len(queries))},
    ):
        expected = hs.pair_histogram(points, edges, **marks, **scene)
        assert_same(cells.pair_histogram(edges, **marks), expected)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("inclusive", [True, False])
def test_several_cutoffs_are_as_many_counts(name, inclusive):
    points, cutoff, scene = scene_of(name)
    cells = hs.CellList(points, cutoff, **scene)
    cutoffs = cutoff * np.array([0.0, 0.5, 0.5, 0.999, 1.0, 1.25])
    for queries in (None, queries_of(name)):
        found = cells.count_pairs(cutoffs, queries=queries, inclusive=inclusive)
        assert found.dtype == np.int64 and found.shape == (6,)
        assert found.tolist() == [
            cells.count_pairs(one, queries=queries, inclusive=inclusive)
            for one in cutoffs.tolist()
        ]
        assert_array_equal(
            found,
            hs.count_pairs(points, cutoffs, queries=queries, inclusive=inclusive, **scene),
        )


def test_shells_of_a_lattice_by_whole_numbers():
    shape = (4, 5)
    points = np.array(list(itertools.product(*map(range, shape))), dtype=np.float64)
    squares = [
        (a - c) ** 2 + (b - d) ** 2
        for (a, b), (c, d) in itertools.combinations(itertools.product(*map(range, shape)), 2)
    ]
    cells = hs.CellList(points, 3.0)
    # Each bin begins at a shell, which counts in it; the last one ends at a shell.
    limits = [1, 4, 5, 9]
    edges = [0.0, 1.0, 2.0, math.nextafter(math.sqrt(5.0), 0.0), 3.0]
    expected = [
        sum(a <= s < b or (b == 9 and s == 9) for s in squares)
        for a, b in itertools.pairwise([0, *limits])
    ]
    assert cells.pair_histogram(edges).tolist() == expected
    within = [sum(s <= limit for s in squares) for limit in (1, 4, 9)]
    assert cells.count_pairs([1.0, 2.0, 3.0]).tolist() == within


@pytest.mark.parametrize("precision", ["double", "single"])
def test_histograms_are_exact_for_any_precision(precision):
    points = np.stack(np.meshgrid(*[np.arange(6.0) * 0.1] * 3), -1).reshape(-1, 3)
    box, edges = [0.6] * 3, np.array([0.0, 0.1, 0.2, 0.3])
    cells = hs.CellList(points, 0.3, box=box, precision=precision)
    assert_array_equal(cells.pair_histogram(edges), hs.pair_histogram(points, edges, box=box))
    # Counts are by the precision of the list, for one cutoff and for several.
    assert cells.count_pairs(edges).tolist() == [cells.count_pairs(one) for one in edges]
    if precision == "double":  # single depends on the cells
        expected = hs.count_pairs(points, edges, box=box, precision="double")
        assert_array_equal(cells.count_pairs(edges), expected)


@pytest.mark.parametrize("threads", [1, 2])
def test_neither_kernel_nor_threads_matter(kernel, threads):
    points = np.random.default_rng(5).random((25_000, 3))
    cells = hs.CellList(points, 0.05, box=[1.0] * 3, threads=threads)
    weights = np.random.default_rng(6).normal(size=len(points))
    edges = np.linspace(0.0, 0.05, 12)
    expected = hs.pair_histogram(points, edges, weights=weights, box=[1.0] * 3, kernel="scalar")
    assert_same(cells.pair_histogram(edges, weights=weights, kernel=kernel), expected)
    assert_same(cells.pair_histogram(edges, weights=weights, kernel=kernel, threads=2), expected)


def test_nothing_is_changed():
    points, cutoff, scene = scene_of("triclinic")
    cells = hs.CellList(points, cutoff, **scene)
    edges, types = np.array([0.0, 0.5, 1.0]), np.zeros(len(points), dtype=np.int64)
    for array in (edges, types):
        array.flags.writeable = False
    first = cells.pair_histogram(edges, types=types)
    assert first.flags.writeable and first.shape == (1, 1, 2)
    first[:] = -1
    assert (cells.pair_histogram(edges, types=types) >= 0).all()


CELLS = hs.CellList([[0.0, 0.0], [1.0, 1.0]], 2.0)
BAD = {
    "edges that descend": (
        lambda: CELLS.pair_histogram([0.0, 2.0, 1.0]), ValueError, r"edges\[1\]",
    ),
    "one edge": (lambda: CELLS.pair_histogram([1.0]), ValueError, "edges must have shape"),
    "a negative edge": (
        lambda: CELLS.pair_histogram([-1.0, 1.0]), ValueError, r"edges\[0\] = -1.0",
    ),
    "an edge that is NaN": (lambda: CELLS.pair_histogram([0.0, np.nan]), ValueError, r"edges\[1\]"),
    "edges that are words": (lambda: CELLS.pair_histogram(["a", "b"]), TypeError, "edges"),
    "no edges": (lambda: CELLS.pair_histogram(), TypeError, "edges"),
    "queries of another dimension": (
        lambda: CELLS.pair_histogram([0.0, 1.0], queries=[[1.0]]), ValueError, "2 columns",
    ),
    "too few types": (
        lambda: CELLS.pair_histogram([0.0, 1.0], types=[0]),
        ValueError, r"types must have shape \(2,\)",
    ),
    "types of one set": (
        lambda: CELLS.pair_histogram([0.0, 1.0], types=[0, 1], queries=[[0.0, 0.0]]),
        ValueError, "together",
    ),
    "query_weights alone": (
        lambda: CELLS.pair_histogram([0.0, 1.0], query_weights=[1.0]), ValueError, "needs queries",
    ),
    "a weight that is NaN": (
        lambda: CELLS.pair_histogram([0.0, 1.0], weights=[1.0, np.nan]),
        ValueError, r"weights\[1\]",
    ),
    "inclusive": (
        lambda: CELLS.pair_histogram([0.0, 1.0], inclusive=True), TypeError, "inclusive",
    ),
    "no such kernel": (
        lambda: CELLS.pair_histogram([0.0, 1.0], kernel="none"), ValueError, "kernel",
    ),
    "no memory": (
        lambda: CELLS.pair_histogram(np.linspace(0.0, 1.0, 100_000), memory_limit=1e4),
        MemoryError, "counts: 10 kB are allowed",
    ),
    "cutoffs that descend": (
        lambda: CELLS.count_pairs([1.0, 0.5]), ValueError, r"cutoff\[0\] = 1.0 before",
    ),
    "a cutoff that is NaN": (
        lambda: CELLS.count_pairs([0.5, np.nan]), ValueError, r"cutoff\[1\] = nan",
    ),
    "cutoffs in a table": (lambda: CELLS.count_pairs([[1.0]]), ValueError, "cutoff"),
    "counts of other queries": (
        lambda: CELLS.count_pairs([0.5, 1.0], queries=[[1.0]]), ValueError, "2 columns",
    ),
}  # fmt: skip


@pytest.mark.parametrize("call, error, text", BAD.values(), ids=BAD)
def test_bad_input_is_named(call, error, text):
    with pytest.raises(error, match=text):
        call()
