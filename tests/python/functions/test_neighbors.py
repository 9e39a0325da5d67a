# SPDX-License-Identifier: BSD-3-Clause
"""Full lists: every neighbour of every point, and how many there are."""


import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import BOX_KINDS, exact_pairs, random_scene

# ---- against rational arithmetic -----------------------------------------------------------


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_larger_scenes(kind, rng):
    points, cutoff, box, flags = random_scene(rng, 3000, kind=kind, neighbours=30, spread=2)
    half = exact_pairs(points, cutoff, box, flags)
    half = np.concatenate([half, np.concatenate([half[:, 1::-1], -half[:, 2:]], axis=1)])
    expected = half[np.lexsort(half.T[::-1])]
    for kernel in hs.kernels():
        table = call(hs.neighbors, points, cutoff, box=box, quantities="jS", kernel=kernel)
        rows = np.repeat(np.arange(3000), table.counts)
        found = np.concatenate([np.stack([rows, table.indices], axis=1), table.shifts], axis=1)
        assert np.array_equal(found, expected)
        counts = call(hs.coordination, points, cutoff, box=box, kernel=kernel)
        assert np.array_equal(counts, table.counts)


# ---- forms of input and output -------------------------------------------------------------


def test_large_and_small_results_are_read_only(rng):
    for n in (20, 40_000):
        points, cutoff, box, _ = random_scene(rng, n, neighbours=12)
        table = hs.neighbors(points, cutoff, box=box, quantities="jdDS")
        arrays = [table.offsets, table.counts, table.indices, table.distances, table.vectors,
                  table.shifts]  # fmt: skip
        assert not any(array.flags.writeable for array in arrays)
        with pytest.raises(ValueError, match="read-only"):
            table[0][0][:] = 5


# ---- errors --------------------------------------------------------------------------------


@pytest.mark.parametrize("quantities", ["j", "jdD"])
def test_far_more_rows_than_the_density_foretells(rng, quantities):
    # A small table is held until its rows have places. This one is expected to be small, and is
    # not: it is begun again. Two threads count first.
    points = np.concatenate([rng.random((1000, 3)) * 1e-3, rng.random((1000, 3)) * 100.0])
    one, two = (hs.neighbors(points, 0.5, quantities=quantities, threads=n) for n in (1, 2))
    i, j = np.nonzero(np.linalg.norm(points[:, None] - points, axis=2) <= 0.5)
    assert len(one.indices) == 999_000 + np.count_nonzero((i >= 1000) & (i != j))
    assert one.offsets.tobytes() == two.offsets.tobytes()
    assert one.indices.tobytes() == two.indices.tobytes() == j[i != j].tobytes()
    if "d" in quantities:
        assert one.distances.tobytes() == two.distances.tobytes()
        assert one.vectors.tobytes() == two.vectors.tobytes()


def few_and_many():
    """Scenes with few neighbours and many: their tables are made in different ways."""
    rng = np.random.default_rng(20)
    skew = np.array([[1.0, 0.0, 0.0], [0.3, 1.1, 0.0], [-0.2, 0.4, 0.9]])
    for n, k in ((300, 1), (300, 60), (900, 4)):
        for d in (1, 2, 3, 4, 6):
            yield rng.random((n, d)), (k / n) ** (1.0 / d) * 0.6, None
            yield rng.random((n, d)) * 3.0 - 1.0, (k / n) ** (1.0 / d) * 0.6, np.ones(d)
        yield rng.random((n, 3)) @ skew, (k / n) ** (1.0 / 3.0) * 0.6, skew
    yield rng.random((300, 2)) * 0.1, 0.02, [[0.1, 0.0], [0.0, 0.004]]  # meets its own images
    yield np.round(rng.random((400, 3)) * 8.0), 1.0, [8.0, 8.0, 8.0]  # ties, coincident points
    yield rng.normal(size=(300, 3)) * np.geomspace(1e-3, 1e3, 300)[:, None], 0.2, None  # crowded
    yield rng.random((300, 3)) * 2.0**-600, 2.0**-604, np.full(3, 2.0**-600)


@pytest.mark.parametrize("threads", [1, 2])
def test_sorted_lists_and_tables_are_the_half_list_in_order(threads):
    for points, cutoff, box in few_and_many():
        options = {"box": box, "threads": threads}
        cutoffs = [cutoff / 2, cutoff]
        half = hs.pairs(points, cutoffs, quantities="ijdDSk", **options)
        i, j, d, D, S, k = half
        order = np.lexsort((*S.T[::-1], j, i))
        as_sorted = hs.pairs(points, cutoffs, quantities="ijdDSk", sort=True, **options)
        for found, expected in zip(as_sorted, half):
            assert np.array_equal(found, expected[order])
        i, j = np.concatenate([i, j]), np.concatenate([j, i])
        S, D = np.concatenate([S, -S]), np.concatenate([D, 0.0 - D])
        order = np.lexsort((*S.T[::-1], j, i))
        table = hs.neighbors(points, cutoffs, quantities="jdDSk", **options)
        assert np.array_equal(table.offsets, np.searchsorted(i[order], np.arange(len(points) + 1)))
        for found, expected in (
            (table.indices, j), (table.distances, np.tile(d, 2)), (table.vectors, D),
            (table.shifts, S), (table.shells, np.tile(k, 2)),
        ):  # fmt: skip
            assert np.array_equal(found, expected[order])
        # and into arrays of the caller, without what puts them in order
        out = np.empty((len(d), 2), np.int32), np.empty(len(d))
        options |= {"out": out, "index_dtype": np.int32}
        views = hs.pairs(points, cutoff, quantities="Pd", sort=True, **options)
        assert np.array_equal(views[0], np.stack(as_sorted[:2], 1))
        assert np.array_equal(views[1], as_sorted[2])


def test_rows_of_queries_are_the_pairs_of_both_sets_together():
    for points, cutoff, box in few_and_many():
        for n in (260, 30):  # queries, the rest are points
            i, j, d, D, S = hs.pairs(points, cutoff, box=box, quantities="ijdDS")
            across = (i < n) & (j >= n)
            i, j, d, D, S = i[across], j[across] - n, d[across], D[across], S[across]
            order = np.lexsort((*S.T[::-1], j, i))
            queries, others = points[:n], points[n:]
            options = {"queries": queries, "box": box, "quantities": "jdDS"}
            table = hs.neighbors(others, cutoff, **options)
            assert np.array_equal(table.offsets, np.searchsorted(i[order], np.arange(n + 1)))
            found = table.indices, table.distances, table.vectors, table.shifts
            for ours, expected in zip(found, (j, d, D, S), strict=True):
                assert np.array_equal(ours, expected[order])
            both = hs.pairs_between(queries, others, cutoff, box=box, quantities="ijS")
            for ours, expected in zip(both, (i, j, S), strict=True):
                assert np.array_equal(ours, expected[order])
