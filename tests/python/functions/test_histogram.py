# SPDX-License-Identifier: BSD-3-Clause
"""Counts of pairs, within cutoffs and by distance."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import halfshell as hs
from calls import call
from halfshell._check.reference import exact_square, reference_pairs
from oracles import BOX_KINDS, lattice, random_scene, rotation, same_arrays


def test_one_cutoff_gives_an_int(rng):
    points = rng.random((20, 3))
    for cutoff in (0.5, 1, np.float32(0.5), np.array(0.5)):
        assert type(hs.count_pairs(points, cutoff)) is int


def test_several_cutoffs_at_ties(rng):
    for inclusive in (True, False):
        for kernel in hs.kernels():
            points, box = lattice("fcc", (3, 3, 3))
            turn = rotation(rng)
            roots = [math.sqrt(k) for k in (2, 4, 6, 8)]
            cutoffs = sorted(
                x for r in roots for x in (math.nextafter(r, 0), r, math.nextafter(r, 9))
            )
            for crystal, frame in (
                (points, box),
                (points @ turn, box @ turn),
                (points @ turn, None),
            ):
                how = {"box": frame, "inclusive": inclusive, "kernel": kernel}
                counts = call(hs.count_pairs, crystal, cutoffs, **how)
                assert counts.tolist() == [
                    len(call(hs.pairs, crystal, c, quantities="j", **how)) for c in cutoffs
                ]


def test_counting_needs_no_memory_for_the_list(rng):
    # 5e7 pairs would take 800 MB; counting them fits into far less.
    points = rng.random((10_000, 3))
    assert call(hs.count_pairs, points, 2.0, memory_limit=50_000_000) == 10_000 * 9_999 // 2


def test_without_cutoffs_all_else_is_checked():
    assert hs.count_pairs([[0.0], [1.0]], []).tolist() == []
    with pytest.raises(ValueError, match=r"points\[0, 0\]"):
        hs.count_pairs([[np.nan]], [])
    with pytest.raises(ValueError, match="kernel"):
        call(hs.count_pairs, [[0.0]], [], kernel="none")
    with pytest.raises(ValueError, match="queries"):
        hs.count_pairs([[0.0]], [], queries=[[np.inf]])


# ---- by distance -------------------------------------------------------------------------------


def bin_of(square, limits):
    """The bin of a squared distance among squared edges, all rational; None outside of them."""
    last = len(limits) - 2
    if square == limits[-1]:
        below = [k for k in range(last + 1) if limits[k] <= square]
        return max(below)
    found = [k for k in range(last + 1) if limits[k] <= square < limits[k + 1]]
    return found[0] if found else None


def expected(points, edges, box=None, periodic=None, types=None, weights=None):
    """The histogram in rational arithmetic: counts, or sums of products as fractions."""
    t = 1 if types is None else max(types, default=0) + 1
    bins = np.full((t, t, len(edges) - 1), Fraction(0), dtype=object)
    limits = [Fraction(float(edge)) ** 2 for edge in edges]
    for i, j, S in reference_pairs(points, edges[-1], box, periodic, True):
        k = bin_of(exact_square(points, i, j, S or None, box), limits)
        if k is None:
            continue
        a, b = (0, 0) if types is None else (types[i], types[j])
        term = Fraction(1)
        if weights is not None:
            term = Fraction(float(weights[i])) * Fraction(float(weights[j]))
        bins[a, b, k] += term
        if a != b:
            bins[b, a, k] += term
    dtype = np.int64 if weights is None else np.float64  # float(Fraction) rounds once, to even
    rounded = np.array([dtype(float(x)) for x in bins.ravel()], dtype).reshape(bins.shape)
    return rounded[0, 0] if types is None else rounded


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_bins_are_those_of_rational_arithmetic(kind, rng):
    for ndim in (1, 2, 3, 4):
        points, cutoff, box, periodic = random_scene(rng, 14, ndim, kind, neighbours=25, spread=2)
        d = hs.pairs(points, cutoff, box=box, quantities="d")
        some = rng.choice(d, 4) if len(d) else []
        edges = np.sort([0.0, cutoff, *some, *np.nextafter(some, 0.0), *(cutoff * rng.random(3))])
        types = rng.integers(0, 3, len(points))
        weights = rng.normal(size=len(points))
        for how in ({}, {"types": types}, {"weights": weights},
                    {"types": types, "weights": weights}):  # fmt: skip
            answer = expected(points, edges, box, periodic, **how)
            how |= {"box": box, "periodic": periodic}
            for kernel in hs.kernels():
                found = call(hs.pair_histogram, points, edges, kernel=kernel, **how)
                assert same_arrays(found, answer), (ndim, how)


def test_edges_beside_irrational_shells(rng):
    for kernel in hs.kernels():
        points, box = lattice("fcc", (3, 3, 3))
        turn = rotation(rng)
        roots = [math.sqrt(k) for k in (2, 4, 6, 8)]
        edges = sorted(x for r in roots for x in (math.nextafter(r, 0), r, math.nextafter(r, 9)))
        for crystal, frame in ((points, box), (points @ turn, box @ turn)):
            found = call(hs.pair_histogram, crystal, edges, box=frame, kernel=kernel)
            below = [hs.count_pairs(crystal, e, box=frame, inclusive=False) for e in edges[:-1]]
            below.append(hs.count_pairs(crystal, edges[-1], box=frame))
            assert found.tolist() == np.diff(below).tolist()


@pytest.mark.parametrize(
    ("dtype", "bins"), [(np.float32, 1), (np.float64, 7), (np.float32, 100), (np.float64, 3000)]
)
def test_away_from_edges_numpy_finds_the_same(dtype, bins, rng):
    points, cutoff, box, _ = random_scene(rng, 3000, neighbours=60)
    points = points.astype(dtype)
    d = hs.pairs(points, cutoff, box=box, quantities="d")
    for spaced, first in ((np.linspace, 0.0), (np.geomspace, 1e-3 * cutoff)):
        edges = spaced(first, cutoff, bins + 1)
        nearest = edges[np.clip(np.searchsorted(edges, d), 1, len(edges) - 1)]
        previous = edges[np.clip(np.searchsorted(edges, d) - 1, 0, len(edges) - 1)]
        assert min(np.abs(d - nearest).min(), np.abs(d - previous).min()) > 1e-13 * cutoff
        for kernel in hs.kernels():
            found = call(hs.pair_histogram, points, edges, box=box, kernel=kernel)
            assert found.dtype == np.int64
            assert np.array_equal(found, np.histogram(d, edges)[0])


@given(
    st.lists(st.tuples(*[st.integers(-3, 3)] * 2), min_size=0, max_size=9),
    st.lists(st.sampled_from([0.0, 0.5, 1.0, math.sqrt(2), 2.0, 3.0, 5.0]), min_size=2, max_size=6),
    st.booleans(),
)
def test_edges_as_numpy_takes_them(points, edges, periodic):
    # Equal edges too: only the last bin of none of its width has pairs.
    points = np.array(points, dtype=float).reshape(-1, 2)
    box = [4.0, 5.0] if periodic else None
    edges = sorted(edges)
    found = hs.pair_histogram(points, edges, box=box)
    d = hs.pairs(points, edges[-1], box=box, quantities="d")
    if math.sqrt(2) not in edges:  # the others are numbers
        assert found.tolist() == np.histogram(d, edges)[0].tolist()
    assert same_arrays(found, expected(points, edges, box))


def test_queries_meet_all_points(rng):
    for kernel in hs.kernels():
        points, cutoff, box, _ = random_scene(rng, 400, neighbours=20, spread=2)
        queries = np.concatenate([points[:20], random_scene(rng, 80, spread=3)[0]])
        edges = np.linspace(0.0, cutoff, 9)
        i, j, d = hs.pairs_between(queries, points, cutoff, box=box, quantities="ijd")
        found = call(hs.pair_histogram, points, edges, queries=queries, box=box, kernel=kernel)
        assert found.tolist() == np.histogram(d, edges)[0].tolist()
        assert found[0] >= 20  # each of those finds itself
        types, query_types = rng.integers(0, 2, 400), rng.integers(0, 3, 100)
        by_type = call(
            hs.pair_histogram,
            points,
            edges,
            queries=queries,
            types=types,
            query_types=query_types,
            box=box,
            kernel=kernel,
        )
        assert by_type.shape == (3, 3, 8)
        for a in range(3):
            for b in range(3):
                chosen = d[(query_types[i] == a) & (types[j] == b)]
                assert by_type[a, b].tolist() == np.histogram(chosen, edges)[0].tolist()
        weights, query_weights = rng.integers(-5, 6, 400), rng.integers(-5, 6, 100)
        for own, asking in ((weights, None), (None, query_weights), (weights, query_weights)):
            terms = (1 if own is None else own[j]) * (1 if asking is None else asking[i])
            sums = call(
                hs.pair_histogram,
                points,
                edges,
                queries=queries,
                weights=own,
                query_weights=asking,
                box=box,
                kernel=kernel,
            )
            assert sums.dtype == np.float64
            assert sums.tolist() == np.histogram(d, edges, weights=terms)[0].tolist()


@pytest.mark.parametrize("scale", [1.0, 1e-160, 1e150])
def test_weights_are_summed_exactly(scale, rng):
    points = rng.random((60, 3))
    weights = scale * rng.normal(size=60) * 10.0 ** rng.integers(-20, 4, 60)
    edges, order = [0.0, 0.2, 0.4, 0.6], rng.permutation(60)
    answer = expected(points, edges, weights=weights)
    for kernel in hs.kernels():
        for k in (slice(None), order):
            found = call(hs.pair_histogram, points[k], edges, weights=weights[k], kernel=kernel)
            assert same_arrays(found, answer)


@pytest.mark.parametrize("box", [None, [1.0, 1.0, 1.0]])
def test_nothing_depends_on_kernels_and_threads(box, rng):
    points = rng.random((30_000, 3))
    how = {"types": rng.integers(0, 3, 30_000), "weights": rng.normal(size=30_000)}
    edges = np.linspace(0.0, 0.08, 81)
    results = [
        call(hs.pair_histogram, points, edges, box=box, kernel=kernel, threads=threads, **how)
        for kernel in hs.kernels()
        for threads in (1, 2, 5)
    ]
    assert all(same_arrays(results[0], other) for other in results)
    order = rng.permutation(30_000)
    again = call(
        hs.pair_histogram,
        points[order],
        edges,
        box=box,
        **{name: values[order] for name, values in how.items()},
    )
    assert same_arrays(results[0], again)


def test_scenes_without_pairs():
    for kernel in hs.kernels():
        for points in ([], [[0.5, 0.5]], np.empty((0, 2)), [[0.0], [9.0]]):
            assert call(hs.pair_histogram, points, [0.0, 1.0, 2.0], kernel=kernel).tolist() == [
                0,
                0,
            ]
        assert call(hs.pair_histogram, [], [0.0, 1.0], types=[]).tolist() == [[[0]]]
        assert call(hs.pair_histogram, [], [0.0, 1.0], weights=[]).tolist() == [0.0]
        assert hs.pair_histogram([[0.0]], [0.0, 1.0], queries=[]).tolist() == [0]
        same_place = np.full((100, 3), 0.7)
        assert call(hs.pair_histogram, same_place, [0.0, 0.0], kernel=kernel).tolist() == [4950]
        assert call(hs.pair_histogram, same_place, [0.0, 1e-300], kernel=kernel).tolist() == [4950]
        assert call(hs.pair_histogram, same_place, [5e-324, 1.0], kernel=kernel).tolist() == [0]


def test_counts_of_many_cutoffs_are_those_of_single_ones(rng):
    for inclusive in (True, False):
        for kernel in hs.kernels():
            points, cutoff, box, _ = random_scene(rng, 500, neighbours=40)
            cutoffs = [0.0, 1e-9, *np.sort(cutoff * rng.random(30)), cutoff, cutoff]
            how = {"box": box, "inclusive": inclusive, "kernel": kernel}
            for queries in (None, points[:100]):
                found = call(hs.count_pairs, points, cutoffs, queries=queries, **how)
                assert found.dtype == np.int64
                assert found.tolist() == [
                    call(hs.count_pairs, points, c, queries=queries, **how) for c in cutoffs
                ]


def test_memory_is_that_of_the_bins(rng):
    points = rng.random((10_000, 3))  # 5e7 pairs
    edges = np.linspace(0.0, 2.0, 101)
    found = call(hs.pair_histogram, points, edges, memory_limit=50_000_000)
    assert found.sum() == 10_000 * 9_999 // 2
    with pytest.raises(MemoryError):
        call(hs.pair_histogram, points, edges, types=np.arange(10_000), memory_limit=50_000_000)


BAD_EDGES = {
    "one edge": ([1.0], ValueError, r"shape \(bins \+ 1,\)"),
    "none": ([], ValueError, "at least"),
    "not ascending": ([0.0, 2.0, 1.0], ValueError, r"edges\[1\] = 2.0 before edges\[2\] = 1.0"),
    "negative": ([-1.0, 1.0], ValueError, r"not negative, got edges\[0\] = -1.0"),
}


def test_bad_edges_are_refused():
    for edges, error, text in BAD_EDGES.values():
        with pytest.raises(error, match=text):
            hs.pair_histogram([[0.0], [1.0]], edges)


BAD_MARKS = {
    "types of another length": ({"types": [0]}, ValueError, r"types must have shape \(2,\)"),
    "a negative type": ({"types": [0, -1]}, ValueError, r"types\[1\] = -1"),
    "a type too large": ({"types": [0, 2**31]}, ValueError, r"types\[1\]"),
    "weights of another length": ({"weights": [1.0]}, ValueError, r"shape \(2,\)"),
    "types of one set": ({"queries": [[0.0]], "types": [0, 1]}, ValueError, "queries have none"),
    "query_weights of another length": (
        {"queries": [[0.0]], "query_weights": [1.0, 2.0]}, ValueError, r"shape \(1,\)",
    ),
    "an infinite query weight": (
        {"queries": [[0.0]], "query_weights": [math.inf]}, ValueError, r"weights\[0\] = inf",
    ),
    "queries of another dimension": ({"queries": [[0.0, 1.0]]}, ValueError, "columns"),
}  # fmt: skip


def test_bad_types_and_weights_are_refused():
    for marks, error, text in BAD_MARKS.values():
        with pytest.raises(error, match=text):
            call(hs.pair_histogram, [[0.0], [1.0]], [0.0, 1.0], **marks)


def test_results_beyond_memory_are_refused_at_once():
    points = np.zeros((2, 1))
    for last in (10**5, 2**31 - 2):
        with pytest.raises(MemoryError, match="types"):
            call(hs.pair_histogram, points, [0.0, 1.0], types=[0, last])
    with pytest.raises(MemoryError, match="edges"):
        hs.pair_histogram(points, np.broadcast_to(1.0, 2**40))
    with pytest.raises(ValueError, match="edges must have shape"):  # before it is copied
        hs.pair_histogram(points, np.broadcast_to(1.0, (2**30, 2**10)))
