# SPDX-License-Identifier: BSD-3-Clause
"""The layout of a `CellList`: a sort of the points, `cell_size`, and `candidates`."""

import gc
import math
import pickle
from collections import Counter
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import halfshell as hs
from cell_scenes import SCENES, WIDTHS, queries_of, scene_of
from halfshell._objects import cell_list as cells_module
from refused_calls import check_refusals


def held_by(cells, block):
    """The points that each query's candidates are."""
    ends = zip(block.offsets[:-1], block.offsets[1:], strict=True)
    ranges = ([cells.order[block.start[r] : block.stop[r]] for r in range(a, b)] for a, b in ends)
    return [np.concatenate([np.empty(0, int), *one]).tolist() for one in ranges]


@pytest.mark.parametrize("name", SCENES)
def test_the_layout_is_a_sort_of_the_points(name):
    points, cutoff, scene = scene_of(name)
    for wanted in (None, *((cutoff or 1.0) * factor for factor in WIDTHS)):
        cells = hs.CellList(points, cutoff, cell_size=wanted, **scene)
        n_cells = len(cells.cell_start) - 1
        assert n_cells <= 2 * len(points) + 64
        assert cells.cell_start[0] == 0 and cells.cell_start[-1] == len(points) == len(cells)
        assert_array_equal(np.sort(cells.order), np.arange(len(points)))
        inside = np.repeat(np.arange(n_cells), np.diff(cells.cell_start))
        assert_array_equal(cells.cell_of(points)[cells.order], inside)
        assert (np.diff(cells.order)[np.diff(inside) == 0] > 0).all()
        if name != "digits that scaling loses":
            queries = queries_of(name)
            held = held_by(cells, cells.candidates(queries))
            for row, some in zip(cells.query(queries), held, strict=True):
                assert set(row.tolist()) <= set(some)
        assert len(cells.shape) == len(cells.cell_sizes) == points.shape[1]
        if cells.cell_ids is None:
            assert math.prod(cells.shape) == n_cells
            for count, width in zip(cells.shape, cells.cell_sizes, strict=True):
                assert count == 1 or wanted is None or width >= wanted
        else:
            assert cells.cell_ids.shape == (n_cells, points.shape[1])
            assert len(np.unique(cells.cell_ids, axis=0)) == n_cells


def test_arrays_are_read_only_and_outlive_the_list(rng):
    cells = hs.CellList(rng.random((100, 3)) * 9.0, 1.0)
    order, start = cells.order, cells.cell_start
    copies = order.copy(), start.copy()
    for array in (order, start):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    del cells
    gc.collect()
    rng.random(100_000)
    assert_array_equal(order, copies[0])
    assert_array_equal(start, copies[1])


@pytest.mark.parametrize("ndim", [1, 2, 3])
def test_a_block_of_cells_as_wide_as_the_cutoff(ndim):
    """With cells of a cutoff: 3 along each axis. With a half of it, 5; a third, 7."""
    points = np.random.default_rng(2).random((3000, ndim)) * 7.37
    for parts in (1, 2, 3):
        cells = hs.CellList(points, 0.5, cell_size=0.5 / parts)
        at = np.stack(np.unravel_index(cells.cell_of(points), cells.shape, order="F"), 1)
        for i, held in enumerate(held_by(cells, cells.candidates(points[:50]))):
            assert len(held) == len(set(held))
            assert (np.abs(at[held] - at[i]) <= parts).all()


@pytest.mark.parametrize(
    "box", [None, [5.0, 4.0, 3.0], [[0.0, 4.0, 0.0], [5.0, 0.0, 0.0], [0.0, 0.0, 3.0]]], ids=str
)
def test_a_domain_has_the_same_cells_for_any_points(box, rng):
    repeats = None if box is None else [True, False, False]
    low, high = [-1.0, 2.0, 3.0], [9.0, 12.0, 6.0]
    layouts = []
    for n, part in ((300, 1.0), (500, 0.2)):
        points = low + rng.random((n, 3)) * part * np.subtract(high, low)
        options = {"box": box, "periodic": repeats}
        cells = hs.CellList(points, 0.8, cell_size=1.0, domain=(low, high), **options)
        places = [[x, y, z] for x in (0.5, 4.5) for y in (2.5, 7.5, 11.5) for z in (3.25, 5.75)]
        layouts.append((cells.shape, cells.cell_sizes, cells.cell_of(places).tolist()))
        own = hs.CellList(points, 0.8, **options)
        wanted = own.pairs(quantities="ijdS", sort=True)
        for again in (cells, cells.rebuild(points), pickle.loads(pickle.dumps(cells))):
            assert again.shape == cells.shape
            found = again.pairs(quantities="ijdS", sort=True)
            for one, other in zip(found, wanted, strict=True):
                assert_array_equal(one, other)
        queries = points[:50] + 3.0
        found, wanted = (each.neighbors(queries=queries).indices for each in (cells, own))
        assert_array_equal(found, wanted)
    assert layouts[0] == layouts[1]
    axes = [k for k in range(3) if box is None or k != (1 if isinstance(box[0], list) else 0)]
    assert all(layouts[0][0][k] == (10, 10, 3)[k] for k in axes)
    beyond = hs.CellList(np.append(points, [[10.9, 2.0, 3.0]], axis=0), 0.8, cell_size=1.0,
                         domain=(low, high))  # fmt: skip
    assert beyond.shape == (11, 10, 3) and len(beyond) == len(points) + 1


def test_what_is_no_domain_is_refused():
    skewed = {"box": [[1.0, 0.0], [0.3, 1.0]], "periodic": [True, False]}
    make = partial(hs.CellList, [[0.0, 0.0]], 1.0)
    check_refusals([
        (partial(make, domain=3.0), TypeError, "domain must be a pair"),
        (partial(make, domain=(0.0, 1.0, 2.0)), TypeError, "domain must be a pair"),
        (partial(make, domain=(0.0, "a")), TypeError, "high end of domain"),
        (partial(make, domain=([0.0], 1.0)), ValueError, "low end of domain must have shape"),
        (partial(make, domain=(0.0, np.nan)), ValueError, "finite and not descend"),
        (partial(make, domain=(-np.inf, 0.0)), ValueError, "finite and not descend"),
        (partial(make, domain=([0.0, 2.0], 1.0)), ValueError, "got 2.0 to 1.0 in axis 1"),
        (partial(make, domain=(0.0, 1.0), **skewed), ValueError, "along the coordinate axes"),
    ])
    assert make(domain=(0.0, 0.0)).shape == (1, 1)
    assert hs.CellList(np.empty((0, 2)), 1.0, domain=(0.0, 9.0)).count_pairs() == 0


def test_what_is_no_size_is_refused():
    cases = [
        (0.0, ValueError, "cell_size must be finite and greater than 0, got 0.0"),
        ([1.0, 1.0], TypeError, "cell_size must be a number"),
    ]
    check_refusals([
        (lambda size=size: hs.CellList([[0.0, 0.0]], 1.0, cell_size=size), *how)
        for size, *how in cases
    ])  # fmt: skip


def test_one_cell_with_everything_says_so():
    points = [[0.0, 2.0**1000], [0.0, -(2.0**1000)]]
    box = [[2.0**-900, 0.0], [0.0, 1.0]]
    cells = hs.CellList(points, 2.0**-899, box=box, periodic=[True, False])
    assert cells.cell_sizes == (np.inf, np.inf) and cells.shape == (1, 1)
    assert cells.cell_of(points).tolist() == [0, 0] and cells.count_pairs() == 4
    calls = cells.candidates, lambda: cells.candidates([[0.0, 0.0]])
    for call in (*calls, lambda: list(cells.candidate_pairs())):
        with pytest.raises(ValueError, match="one cell holds everything"):
            call()
    with pytest.raises(ValueError, match="max_pairs must be 1 or more"):
        cells.candidate_pairs(max_pairs=0)


# ---- candidates ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SCENES)
def test_candidate_pairs_hold_all_pairs_of_two_points_in_each_image(name, monkeypatch):
    points, cutoff, scene = scene_of(name)
    cells = hs.CellList(points, cutoff, **scene)
    monkeypatch.setattr(cells_module, "_ASKED_AT_A_TIME", 7)
    whole = Counter()
    for most in (1000, 1 << 20):
        blocks = list(cells.candidate_pairs(max_pairs=most))
        assert all(i.dtype == j.dtype == np.int64 and 0 < len(i) <= most for i, j in blocks)
        i, j = (np.concatenate([block[k] for block in blocks] or [[]]).tolist() for k in (0, 1))
        assert all(a < b for a, b in zip(i, j, strict=True))
        found = Counter(zip(i, j, strict=True))
        assert whole in (Counter(), found)
        whole = found
    i, j = cells.pairs()
    expected = Counter((a, b) for a, b in zip(i.tolist(), j.tolist(), strict=True) if a != b)
    assert expected <= whole


def test_candidates_take_the_memory_of_their_ranges_only(rng):
    # 2e11 pairs would take terabytes.
    cells = hs.CellList(rng.random((1_000_000, 1)), 1000.0, box=[1.0])
    block = cells.candidates(np.zeros((100, 1)))
    assert (block.stop - block.start).sum() >= 100 * 1_999 * 1_000_000
    assert block.offsets[-1] == len(block.start)


def test_candidates_take_queries_at_any_distance_along_the_axes():
    for shift in (0.0, 1.0, -1e9):
        cells = hs.CellList([[shift], [shift + 0.125]], 0.125)
        block = cells.candidates([[shift + 0.375], [shift + 0.125], [1e200], [-1e200]])
        none, some, *beyond = np.diff(block.offsets).tolist()
        assert none == 0 and some > 0 and beyond == [0, 0]
    periodic = hs.CellList([[0.25, 0.0]], 0.5, box=[4.0, 4.0])
    for query in ([4e200, 0.0], [-(2.0**60), 2.0**100], [5e-324, -5e-324]):
        assert 0 in held_by(periodic, periodic.candidates([query]))[0]
    assert len(hs.CellList([[1e30]], 1e25).candidates([[5e-324]]).start) == 0


def test_candidates_that_are_refused_name_the_query():
    skewed = hs.CellList([[0.1, 0.1]], 0.3, box=[[1.0, 0.0], [0.3, 1.0]])
    with pytest.raises(ValueError, match=r"queries\[2, 1\] = 9000000.0 lies too far"):
        skewed.candidates([[0.0, 0.0], [1000.0, 0.0], [0.0, 9e6], [9e9, 0.0]])
    box = [[1.0, 0.0, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 1.0]]
    far = hs.CellList([[0.1, 0.1, 1e200]], 0.3, box=box, periodic=[True, True, False])
    with pytest.raises(ValueError, match="one cell holds everything"):
        far.candidates([[0.1, 0.1, 0.0]])
    assert len(far.query([[0.1, 0.1, 1e200]]).indices) == 1
