# SPDX-License-Identifier: BSD-3-Clause
"""`cell_size` of a `CellList`: another layout, the same answers."""

import math

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import halfshell as hs
from cell_scenes import SCENES, queries_of, scene_of

# In cutoffs; the smallest and the largest are no size that any cell can have.
WIDTHS = [1e-15, 0.07, 0.5, 1.0, 2.5, 1e6]


def width_of(cutoff, factor):
    return (cutoff or 1.0) * factor


def assert_same(found, expected):
    for a, b in zip(found, expected, strict=True):
        assert a.tobytes() == b.tobytes() and a.dtype == b.dtype


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("factor", WIDTHS)
def test_no_answer_depends_on_it(name, factor):
    points, cutoff, scene = scene_of(name)
    queries = queries_of(name)
    cells = hs.CellList(points, cutoff, cell_size=width_of(cutoff, factor), **scene)
    for within in (cutoff, 0.4 * cutoff, 1.25 * cutoff):
        assert_same(
            cells.pairs(within, quantities="ijdDS", sort=True),
            hs.pairs(points, within, quantities="ijdDS", sort=True, **scene),
        )
        expected = hs.neighbors(points, within, queries=queries, quantities="jdDS", **scene)
        rows = cells.query(queries, within, quantities="jdDS")
        assert_array_equal(rows.offsets, expected.offsets)
        assert_same(rows.to_pairs(quantities="jdDS"), expected.to_pairs(quantities="jdDS"))
        assert_array_equal(cells.coordination(within), hs.coordination(points, within, **scene))
    edges = [0.0, 0.5 * cutoff, cutoff]
    assert_array_equal(cells.pair_histogram(edges), hs.pair_histogram(points, edges, **scene))


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("factor", WIDTHS)
def test_the_layout_is_a_sort_of_the_points(name, factor):
    points, cutoff, scene = scene_of(name)
    wanted = width_of(cutoff, factor)
    cells = hs.CellList(points, cutoff, cell_size=wanted, **scene)
    n_cells = len(cells.cell_start) - 1
    assert n_cells <= 2 * len(points) + 64
    assert_array_equal(np.sort(cells.order), np.arange(len(points)))
    inside = np.repeat(np.arange(n_cells), np.diff(cells.cell_start))
    assert_array_equal(cells.cell_of(points)[cells.order], inside)
    block = cells.candidates(queries_of(name)) if name != "digits that scaling loses" else None
    for i, row in enumerate(cells.query(queries_of(name)) if block is not None else []):
        ranges = range(block.offsets[i], block.offsets[i + 1])
        held = [cells.order[block.start[r] : block.stop[r]] for r in ranges]
        assert set(row.tolist()) <= set(np.concatenate([np.empty(0, int), *held]).tolist())
    if cells.cell_ids is None:
        assert math.prod(cells.shape) == n_cells
        for count, width in zip(cells.shape, cells.cell_sizes, strict=True):
            assert count == 1 or width >= wanted


@pytest.mark.parametrize("width", [0.25, 0.5, 0.75, 1.0, 1.5, 3.0, 20.0])
def test_axes_are_cut_into_as_many_cells_as_are_wide_enough(width):
    points = np.random.default_rng(1).random((800, 2)) * [12.0, 5.0]
    points[:2] = [[0.0, 0.0], [12.0, 5.0]]
    for box in (None, [12.0, 5.0]):
        cells = hs.CellList(points, 0.7, box=box, cell_size=width)
        expected = [max(int(length / width), 1) for length in (12.0, 5.0)]
        assert list(cells.shape) == expected
        sizes = [length / count for length, count in zip((12.0, 5.0), expected, strict=True)]
        assert np.allclose(cells.cell_sizes, sizes)


@pytest.mark.parametrize("ndim", [1, 2, 3])
@pytest.mark.parametrize("parts", [1, 2, 3])
def test_a_block_of_cells_as_wide_as_the_cutoff(ndim, parts):
    # With cells of a cutoff: 3 along each axis. With a half of it, 5; a third, 7.
    points = np.random.default_rng(2).random((3000, ndim)) * 7.37
    cells = hs.CellList(points, 0.5, cell_size=0.5 / parts)
    block = cells.candidates(points[:50])
    at = np.stack(np.unravel_index(cells.cell_of(points), cells.shape, order="F"), 1)
    for i in range(50):
        ranges = range(block.offsets[i], block.offsets[i + 1])
        held = np.concatenate([cells.order[block.start[r] : block.stop[r]] for r in ranges])
        assert len(held) == len(set(held.tolist()))
        assert (np.abs(at[held] - at[i]) <= parts).all()


def test_clusters_far_apart_keep_their_occupied_cells():
    points, cutoff, _ = scene_of("clusters far apart")
    assert hs.CellList(points, cutoff, cell_size=0.05).cell_ids is not None
    one = hs.CellList(points, cutoff, cell_size=1e12)  # as wanted: all of them in one cell
    assert one.shape == (1, 1, 1) and one.count_pairs() == hs.count_pairs(points, cutoff)


def test_any_number_that_pairs_takes():
    points = np.random.default_rng(3).random((100, 2))
    for size in (1, np.float32(0.25), np.int64(2), np.array(0.5), 5e-324, 1.7e308):
        assert hs.CellList(points, 0.2, cell_size=size).count_pairs() == hs.count_pairs(points, 0.2)
    alike = hs.CellList(points, 0.2, cell_size=None), hs.CellList(points, 0.2)
    assert alike[0].shape == alike[1].shape


@pytest.mark.parametrize(
    "size, error, text",
    [
        (0.0, ValueError, "cell_size must be finite and greater than 0, got 0.0"),
        (-1.0, ValueError, "greater than 0, got -1.0"),
        (np.nan, ValueError, "greater than 0, got nan"),
        (np.inf, ValueError, "greater than 0, got inf"),
        ([1.0, 1.0], TypeError, "cell_size must be a number"),
        ("1", TypeError, "cell_size must be a number"),
        (1j, TypeError, "cell_size must be a number"),
        (10**400, OverflowError, "cell_size"),
    ],
)
def test_what_is_no_size_is_refused(size, error, text):
    with pytest.raises(error, match=text):
        hs.CellList([[0.0, 0.0]], 1.0, cell_size=size)


def test_one_cell_with_everything_says_so():
    points = [[0.0, 2.0**1000], [0.0, -(2.0**1000)]]
    box = [[2.0**-900, 0.0], [0.0, 1.0]]
    cells = hs.CellList(points, 2.0**-899, box=box, periodic=[True, False])
    assert cells.cell_sizes == (np.inf, np.inf) and cells.shape == (1, 1)
    assert cells.cell_of(points).tolist() == [0, 0] and cells.count_pairs() == 4
    for queries in (None, [[0.0, 0.0]]):
        with pytest.raises(ValueError, match="one cell holds everything"):
            cells.candidates(queries)
