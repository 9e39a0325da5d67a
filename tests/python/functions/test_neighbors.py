# SPDX-License-Identifier: BSD-3-Clause
"""Full lists: every neighbour of every point, and how many there are."""

import itertools

import numpy as np
import pytest
from hypothesis import given

import halfshell as hs
from calls import call
from full_lists import (
    assert_last_place,
    both_ways,
    entries,
    large_full_rows,
    same_tables,
)
from oracles import BOX_KINDS, random_scene
from refused_calls import assert_refused
from scene_strategies import scenes

POINTS = np.random.default_rng(41).random((40, 3)) * 4.0
LENGTHS = np.array([4.0, 4.5, 5.0])


# ---- against rational arithmetic -----------------------------------------------------------


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_distances_and_vectors_to_the_last_place(real, rng):
    for ndim, kernel in itertools.product((1, 2, 3), hs.kernels()):
        points, cutoff, box, _ = random_scene(rng, 30, ndim, "sheared", 8, 2)
        points = points.astype(real)
        for frame in (box, None):
            table = call(hs.neighbors, points, cutoff, box=frame, quantities="DSdj", kernel=kernel)
            assert table.distances.dtype == table.vectors.dtype == np.float64
            assert table.vectors.shape == table.shifts.shape == (table.n_entries, ndim)
            assert table.shifts.dtype == np.int32
            i, j, S = zip(*entries(table))
            found = (i, j, S, table.distances.tolist(), table.vectors.tolist())
            assert_last_place(points, cutoff, frame, found)


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_larger_scenes(kind, rng):
    points, cutoff, box, flags = random_scene(rng, 3000, kind=kind, neighbours=30, spread=2)
    expected = large_full_rows(points, cutoff, box, flags, True)
    for kernel in hs.kernels():
        table = call(hs.neighbors, points, cutoff, box=box, quantities="jS", kernel=kernel)
        rows = np.repeat(np.arange(3000), table.counts)
        found = np.concatenate([np.stack([rows, table.indices], axis=1), table.shifts], axis=1)
        assert np.array_equal(found, expected)
        counts = call(hs.coordination, points, cutoff, box=box, kernel=kernel)
        assert np.array_equal(counts, table.counts)


# ---- against the half list and other libraries ---------------------------------------------


@given(scenes())
def test_neighbors_are_pairs_both_ways(scene):
    how = {"box": scene.box, "periodic": scene.periodic, "inclusive": scene.inclusive}
    table = call(hs.neighbors, scene.points, scene.cutoff, quantities="jdDS", **how)
    assert entries(table) == both_ways(scene.found())
    half = table.to_pairs(quantities="ijdDS", half=True)
    for ours, theirs in zip(half, scene.arrays("ijdDS", sort=True), strict=True):
        assert np.array_equal(ours, theirs)
    assert (
        table.counts.tolist() == call(hs.coordination, scene.points, scene.cutoff, **how).tolist()
    )
    # The other direction has the opposite vector, bit for bit, and the same distance.
    other = table.reverse()
    assert np.array_equal(table.distances[other], table.distances)
    assert np.array_equal(table.vectors[other], -table.vectors)
    assert np.array_equal(table.shifts[other], -table.shifts)


# ---- forms of input and output -------------------------------------------------------------


def test_quantities_in_their_order():
    for letters in ("j", "d", "D", "S", "jd", "dj", "SDdj"):
        whole = hs.neighbors(POINTS, 1.5, box=LENGTHS, quantities="jdDS")
        table = hs.neighbors(POINTS, 1.5, box=LENGTHS, quantities=letters)
        columns = {"j": "indices", "d": "distances", "D": "vectors", "S": "shifts"}
        assert table.quantities == letters
        assert np.array_equal(table.offsets, whole.offsets)
        row = table[3] if len(letters) > 1 else (table[3],)
        for letter, part in zip(letters, row, strict=True):
            column = getattr(table, columns[letter])
            assert np.array_equal(column, getattr(whole, columns[letter]))
            assert np.shares_memory(part, column)
            assert np.array_equal(part, column[table.offsets[3] : table.offsets[4]])


def test_large_and_small_results_are_read_only(rng):
    for n in (20, 40_000):
        points, cutoff, box, _ = random_scene(rng, n, neighbours=12)
        table = hs.neighbors(points, cutoff, box=box, quantities="jdDS")
        arrays = [table.offsets, table.counts, table.indices, table.distances, table.vectors,
                  table.shifts]  # fmt: skip
        assert not any(array.flags.writeable for array in arrays)
        with pytest.raises(ValueError, match="read-only"):
            table[0][0][:] = 5


def test_threads_change_no_byte(rng):
    points, cutoff, box, _ = random_scene(rng, 30_000, neighbours=20)
    for frame in (box, None):
        one, two, three = (
            hs.neighbors(points, cutoff, box=frame, quantities="jdDS", threads=k) for k in (1, 2, 3)
        )
        assert same_tables(one, two) and same_tables(one, three)
        for k in (1, 2, 3):
            counts = hs.coordination(points, cutoff, box=frame, threads=k)
            assert np.array_equal(counts, one.counts)


def test_rows_of_queries(rng):
    queries = rng.random((15, 3)) * 6.0 - 1.0
    table = hs.neighbors(POINTS, 1.5, queries=queries, box=LENGTHS, quantities="jdDS")
    i, *arrays = hs.pairs_between(queries, POINTS, 1.5, box=LENGTHS, quantities="ijdDS")
    assert table.shape == (15, 40)
    assert np.array_equal(i, np.repeat(np.arange(15), table.counts))
    for ours, theirs in zip(arrays, (table.indices, table.distances, table.vectors, table.shifts)):
        assert np.array_equal(ours, theirs)
    counts = hs.coordination(POINTS, 1.5, queries=queries.tolist(), box=LENGTHS)
    assert np.array_equal(counts, table.counts)


# ---- errors --------------------------------------------------------------------------------


@pytest.mark.parametrize("letters", ["i", "P", "ij", "jj", "x", "", "j d"])
def test_wrong_letters(letters):
    for points in (POINTS, POINTS.tolist()):
        assert_refused(
            lambda points=points: hs.neighbors(points, 1.0, quantities=letters),
            ValueError, "letters j d D S k, each at most once", repr(letters),
        )  # fmt: skip
    assert_refused(lambda: hs.neighbors(POINTS, 1.0, quantities=3), TypeError, "quantities")
    assert_refused(lambda: hs.neighbors(POINTS, 1.0, index_dtype=np.uint32), ValueError, "int32")


def test_what_would_not_fit_is_refused(rng):
    points = rng.random((20_000, 3))
    assert_refused(
        lambda: call(hs.neighbors, points, 2.0, memory_limit=1e8),
        MemoryError,
        "4e\\+08 pairs",
        "100 MB",
    )
    # Counting them needs no such memory.
    assert (call(hs.coordination, points[:5000], 2.0, memory_limit=1e8) == 4999).all()


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


def test_shifts_that_do_not_fit(rng):
    points = rng.random((5, 1))
    points[3] = 1e12
    assert_refused(
        lambda: hs.neighbors(points, 0.5, box=[1.0], quantities="jS"), OverflowError, "points"
    )
    assert hs.neighbors(points, 0.5, box=[1.0]).n_rows == 5
