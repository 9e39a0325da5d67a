# SPDX-License-Identifier: BSD-3-Clause
"""Full lists: every neighbour of every point, and how many there are."""


import numpy as np
import pytest

import halfshell as hs
from calls import call
from full_lists import same_tables
from oracles import BOX_KINDS, exact_pairs, random_scene
from refused_calls import assert_refused

POINTS = np.random.default_rng(41).random((40, 3)) * 4.0
LENGTHS = np.array([4.0, 4.5, 5.0])


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


def test_shifts_that_do_not_fit(rng):
    points = rng.random((5, 1))
    points[3] = 1e12
    assert_refused(
        lambda: hs.neighbors(points, 0.5, box=[1.0], quantities="jS"), OverflowError, "points"
    )
    assert hs.neighbors(points, 0.5, box=[1.0]).n_rows == 5
