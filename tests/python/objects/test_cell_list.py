# SPDX-License-Identifier: BSD-3-Clause
"""`CellList` answers as the functions do, for any cutoff and any queries, and shows its layout."""

import copy
import gc
import pickle
import threading
import weakref

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import halfshell as hs

QUANTITIES = "ijdDS"
BOXES = {
    "open": (None, None),
    "box": ([9.0, 8.0, 7.0], None),
    "slab": ([[9.0, 0, 0], [2.0, 8.0, 0], [1.0, -2.0, 7.0]], [True, False, True]),
    "triclinic": ([[9.0, 0, 0], [4.0, 8.0, 0], [-3.0, 2.0, 7.0]], None),
    "sheared": ([[9.0, 0, 0], [9000.0, 8.0, 0], [1.0, 8000.0, 7.0]], None),
    "tiny": ([1.5, 1.25, 1.0], None),
}


def random_points(n, seed, ndim=3, spread=9.0):
    return np.random.default_rng(seed).random((n, ndim)) * spread


def scene_of(name, ndim=3):
    box, periodic = BOXES[name]
    return {"box": box, "periodic": periodic}


def assert_same(found, expected):
    assert len(found) == len(expected)
    for a, b in zip(found, expected, strict=True):
        assert_array_equal(a, b)
        assert a.dtype == b.dtype


@pytest.mark.parametrize("name", BOXES)
@pytest.mark.parametrize("factor", [1.0, 0.5, 0.0, 1.5])
def test_pairs_are_those_of_a_search_of_its_own(name, factor):
    points, scene = random_points(60 if name == "tiny" else 300, 1), scene_of(name)
    cells = hs.CellList(points, 2.0, **scene)
    for inclusive in (True, False):
        expected = hs.pairs(
            points, 2.0 * factor, quantities=QUANTITIES, sort=True, inclusive=inclusive, **scene
        )
        found = cells.pairs(2.0 * factor, quantities=QUANTITIES, sort=True, inclusive=inclusive)
        assert_same(found, expected)
        assert cells.count_pairs(2.0 * factor, inclusive=inclusive) == len(expected[0])


@pytest.mark.parametrize("name", BOXES)
@pytest.mark.parametrize("factor", [1.0, 0.5, 0.0, 1.5])
def test_queries_get_the_rows_of_neighbors(name, factor):
    points, scene = random_points(60 if name == "tiny" else 300, 2), scene_of(name)
    queries = random_points(50, 3, spread=30.0) - 10.0
    cells = hs.CellList(points, 2.0, **scene)
    expected = hs.neighbors(points, 2.0 * factor, queries=queries, quantities="jdDS", **scene)
    found = cells.query(queries, 2.0 * factor, quantities="jdDS")
    assert_array_equal(found.offsets, expected.offsets)
    for name_of in ("indices", "distances", "vectors", "shifts"):
        assert_array_equal(getattr(found, name_of), getattr(expected, name_of))
    assert cells.count_pairs(2.0 * factor, queries=queries) == expected.n_entries
    assert_array_equal(cells.coordination(2.0 * factor, queries=queries), expected.counts)


@pytest.mark.parametrize("name", ["open", "slab", "tiny"])
def test_rows_of_the_points_leave_each_point_out(name):
    points, scene = random_points(80, 4), scene_of(name)
    cells = hs.CellList(points, 1.5, **scene)
    expected = hs.neighbors(points, 1.5, quantities="jS", **scene)
    found = cells.neighbors(quantities="jS")
    assert_array_equal(found.offsets, expected.offsets)
    assert_array_equal(found.indices, expected.indices)
    assert_array_equal(found.shifts, expected.shifts)
    assert_array_equal(cells.coordination(), expected.counts)


@pytest.mark.parametrize("inclusive", [True, False])
def test_each_query_may_have_a_radius_of_its_own(inclusive):
    # On a lattice, where many distances are exactly a radius or a step beside it.
    points = np.stack(np.meshgrid(*[np.arange(5.0)] * 3), -1).reshape(-1, 3)
    queries = points[::3]
    rng = np.random.default_rng(5)
    radii = np.sqrt(rng.integers(0, 9, len(queries)).astype(float))
    radii = rng.choice([radii, np.nextafter(radii, 9.0), np.nextafter(radii, 0.0)])
    cells = hs.CellList(points, 2.0, box=[5.0, 5.0, 6.0], periodic=[True, False, True])
    table = cells.query(queries, radii, quantities="dSj", inclusive=inclusive)
    for i, radius in enumerate(radii):
        expected = cells.query(queries[i : i + 1], radius, quantities="dSj", inclusive=inclusive)
        assert_same(table[i], expected[0])


def test_radii_of_no_queries():
    table = hs.CellList([[0.0]], 1.0).query(np.empty((0, 1)), np.empty(0), quantities="jD")
    assert table.n_rows == 0 and table.vectors.shape == (0, 1)


@pytest.mark.parametrize("kernel", hs.kernels())
@pytest.mark.parametrize("threads", [1, 2])
def test_the_answer_depends_on_neither_kernel_nor_threads(kernel, threads):
    points, queries = random_points(2000, 6), random_points(900, 7)
    cells = hs.CellList(points, 1.0, box=[9.0, 9.0, 9.0], threads=threads)
    first = cells.query(queries, quantities="jd", kernel="scalar", threads=1)
    other = cells.query(queries, quantities="jd", kernel=kernel, threads=threads)
    assert first.indices.tobytes() == other.indices.tobytes()
    assert first.distances.tobytes() == other.distances.tobytes()


@pytest.mark.parametrize("ndim", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("periodic", [False, True])
def test_the_layout_is_a_sort_of_the_points(ndim, periodic):
    points = random_points(200, ndim, ndim)
    cells = hs.CellList(points, 2.0, box=[9.0] * ndim if periodic else None)
    assert cells.cell_ids is None and len(cells.shape) == len(cells.cell_sizes) == ndim
    assert cells.cell_start[0] == 0 and cells.cell_start[-1] == len(points) == len(cells)
    assert (np.diff(cells.cell_start) >= 0).all()
    assert len(cells.cell_start) == np.prod(cells.shape) + 1
    assert_array_equal(np.sort(cells.order), np.arange(len(points)))
    home = cells.cell_of(points)
    for c in range(len(cells.cell_start) - 1):
        inside = cells.order[cells.cell_start[c] : cells.cell_start[c + 1]]
        assert (np.diff(inside) > 0).all()
        assert (home[inside] == c).all()


def test_clusters_far_apart_have_occupied_cells_only():
    points = np.concatenate([random_points(2000, 1, spread=1.0), random_points(2000, 2) + 1e9])
    cells = hs.CellList(points, 0.1)
    assert cells.cell_ids.shape == (len(cells.cell_start) - 1, 3)
    assert len(np.unique(cells.cell_ids, axis=0)) == len(cells.cell_ids)
    home = cells.cell_of(points)
    for c in range(0, len(cells.cell_start) - 1, 17):
        assert (home[cells.order[cells.cell_start[c] : cells.cell_start[c + 1]]] == c).all()
    assert cells.cell_of([[5e8, 0.0, 0.0]]).tolist() == [-1]


@pytest.mark.parametrize("name", BOXES)
def test_candidates_hold_every_neighbour(name):
    points, scene = random_points(60 if name == "tiny" else 300, 8), scene_of(name)
    queries = random_points(40, 9)
    cells = hs.CellList(points, 1.0, **scene)
    block = cells.candidates(queries)
    for i, row in enumerate(cells.query(queries)):
        ranges = slice(block.offsets[i], block.offsets[i + 1])
        held = [
            cells.order[a:b] for a, b in zip(block.start[ranges], block.stop[ranges], strict=True)
        ]
        assert set(row.tolist()) <= set(np.concatenate([np.empty(0, int), *held]).tolist())


def test_candidates_of_the_points_hold_each_pair_both_ways():
    points = random_points(200, 10, 2)
    cells = hs.CellList(points, 1.0)
    block = cells.candidates()
    held = [
        np.concatenate([cells.order[block.start[r] : block.stop[r]] for r in range(a, b)])
        for a, b in zip(block.offsets[:-1], block.offsets[1:], strict=True)
    ]
    for i, j in zip(*cells.pairs(), strict=True):
        assert j in held[i] and i in held[j]
    assert all(i in row for i, row in enumerate(held))


def test_arrays_are_read_only_and_outlive_the_list():
    cells = hs.CellList(random_points(100, 11), 1.0)
    order, start = cells.order, cells.cell_start
    copies = order.copy(), start.copy()
    for array in (order, start):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    del cells
    gc.collect()
    np.random.default_rng(0).random(100000)
    assert_array_equal(order, copies[0])
    assert_array_equal(start, copies[1])


def test_points_are_copied():
    points = random_points(100, 12)
    cells = hs.CellList(points, 1.0)
    expected = cells.count_pairs(), cells.count_pairs(3.0)
    points[:] = 0.0
    assert (cells.count_pairs(), cells.count_pairs(3.0)) == expected


def test_many_threads_may_ask_at_once():
    cells = hs.CellList(random_points(3000, 13), 1.0, box=[9.0, 9.0, 9.0])
    queries = random_points(500, 14)
    expected = cells.query(queries).indices.tobytes(), cells.count_pairs(0.7)
    found = []

    def ask():
        for _ in range(5):
            found.append((cells.query(queries).indices.tobytes(), cells.count_pairs(0.7)))

    asking = [threading.Thread(target=ask) for _ in range(4)]
    for thread in asking:
        thread.start()
    for thread in asking:
        thread.join()
    assert found == [expected] * 20


@pytest.mark.parametrize("name", BOXES)
def test_nearest_are_those_of_a_search_of_its_own(name):
    points, scene = random_points(60 if name == "tiny" else 300, 16), scene_of(name)
    queries = random_points(50, 17, spread=30.0) - 10.0
    cells = hs.CellList(points, 2.0, **scene)
    for k in (1, 7, 40):
        for limit in (np.inf, 1.5):
            for asking in (None, queries, queries * 100.0, queries[:0]):
                expected = hs.nearest(
                    points, k, queries=asking, max_distance=limit, quantities="jdDS", **scene
                )
                found = cells.nearest(k, queries=asking, max_distance=limit, quantities="jdDS")
                assert_same(found, expected)


def test_nearest_do_not_depend_on_what_the_cells_are_for():
    points = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), -1).reshape(-1, 3) * 0.1
    for cutoff, precision in ((0.0, "exact"), (0.1, "single"), (1e200, "double")):
        cells = hs.CellList(points, cutoff, precision=precision)
        assert_same(cells.nearest(14), hs.nearest(points, 14))
    scene = np.array([[1e300, 0.0], [1e-300, 0.0], [0.0, 3e-300], [0.0, 0.0]])
    cells = hs.CellList(scene, 1.0)
    assert_same(cells.nearest(2), hs.nearest(scene, 2))
    assert_same(cells.nearest(2, queries=scene), hs.nearest(scene, 2, queries=scene))
    assert_same(
        cells.nearest(2, max_distance=2e-300), hs.nearest(scene, 2, max_distance=2e-300)
    )


def test_nearest_of_many_threads_at_once():
    points, queries = random_points(3000, 18), random_points(500, 19)
    expected = hs.nearest(points, 5, queries=queries, quantities="j").tobytes()
    for _ in range(5):
        cells, found = hs.CellList(points, 1.0), []

        def ask(cells=cells, found=found):
            for _ in range(3):
                found.append(cells.nearest(5, queries=queries, quantities="j").tobytes())

        asking = [threading.Thread(target=ask) for _ in range(4)]
        for thread in asking:
            thread.start()
        for thread in asking:
            thread.join()
        assert found == [expected] * 12


def test_nearest_of_nothing():
    cells = hs.CellList(np.empty((0, 2)), 1.0, box=[3.0, 3.0])
    assert cells.nearest(3)[0].shape == (0, 3)
    j, d = cells.nearest(3, queries=[[0.0, 0.0]])
    assert j.tolist() == [[-1] * 3] and np.isinf(d).all()
    assert hs.CellList([[1.0]], 1.0).nearest(2, queries=np.empty((0, 1)))[0].shape == (0, 2)


def test_float32_and_ase_atoms():
    ase = pytest.importorskip("ase.build")
    atoms = ase.bulk("NaCl", "rocksalt", a=5.64, cubic=True)
    cells = hs.CellList(atoms, 4.0)
    assert_same(
        cells.pairs(quantities="ijS", sort=True), hs.pairs(atoms, 4.0, quantities="ijS", sort=True)
    )
    points = random_points(100, 15).astype(np.float32)
    assert hs.CellList(points, 2.0).count_pairs() == hs.count_pairs(points, 2.0)


def test_empty_lists():
    cells = hs.CellList(np.empty((0, 2)), 1.0, box=[3.0, 3.0])
    assert len(cells) == 0 and cells.count_pairs() == 0 and len(cells.order) == 0
    assert cells.query([[0.0, 0.0]]).counts.tolist() == [0]
    assert hs.CellList([[1.0]], 1.0).query(np.empty((0, 1))).n_rows == 0


def test_a_list_can_be_collected():
    class Owner:
        pass

    owner = Owner()
    owner.cells = hs.CellList(random_points(10, 1), 1.0)
    gone = weakref.ref(owner)
    del owner
    gc.collect()
    assert gone() is None


@pytest.mark.parametrize("built_for", [0.5, 1.0, 1.01, 2.0])
@pytest.mark.parametrize("tilt", [None, 0.0, 0.3])
def test_blocks_and_visits_have_the_order_of_the_pairs(built_for, tilt):
    for n, cutoff in ((20, 0.45), (1000, 0.3), (20000, 0.1)):
        points = np.random.default_rng(n).random((n, 3))
        box = None if tilt is None else np.eye(3) + tilt * np.eye(3, k=-1)
        cells = hs.CellList(points, built_for * cutoff, box=box)
        expected = cells.pairs(cutoff, quantities="P")
        blocks = list(cells.iter_pairs(cutoff, quantities="P", max_pairs=1000))
        assert_array_equal(np.concatenate(blocks), expected)
        if n < 20000:
            seen = []
            cells.for_each_pair(lambda i, j, *_: seen.append((i, j)), cutoff)  # noqa: B023
            assert_array_equal(seen, expected)


def test_more_pairs_than_memory_holds_are_counted_and_streamed():
    points = np.random.default_rng(18).random((2000, 3))
    cells = hs.CellList(points, 1.5, box=[1.0] * 3, memory_limit=5e6)
    assert next(cells.iter_pairs(max_pairs=10))[0].shape == (10,)
    assert cells.count_pairs(0.1) == hs.count_pairs(points, 0.1, box=[1.0] * 3)
    with pytest.raises(MemoryError, match="pairs"):
        cells.pairs(memory_limit=5e6)


def test_candidates_take_the_memory_of_their_ranges_only():
    # 2e11 pairs would take terabytes.
    cells = hs.CellList(np.random.default_rng(19).random((1_000_000, 1)), 1000.0, box=[1.0])
    block = cells.candidates(np.zeros((100, 1)))
    assert (block.stop - block.start).sum() >= 100 * 1_999 * 1_000_000
    assert block.offsets[-1] == len(block.start)


def test_an_iterator_keeps_its_cells():
    points = random_points(2000, 16)
    cells = hs.CellList(points, 1.0)
    expected = cells.pairs(quantities="P")
    blocks = cells.iter_pairs(quantities="P", max_pairs=100)
    abandoned = cells.iter_pairs(max_pairs=100)
    next(abandoned)
    del cells, abandoned
    gc.collect()
    others = [hs.CellList(random_points(2000, seed), 1.0) for seed in range(30, 34)]
    assert_array_equal(np.concatenate(list(blocks)), expected)
    assert len(others[0].pairs(quantities="P")) != len(expected)
    blocks.close()


def test_a_list_does_not_change():
    cells = hs.CellList(random_points(10, 17), 1.0)
    with pytest.raises(AttributeError):
        cells.cutoff = 2.0
    assert copy.copy(cells) is cells and copy.deepcopy([cells])[0] is cells
    with pytest.raises(TypeError, match="a CellList cannot be pickled"):
        pickle.dumps(cells)


CELLS = hs.CellList([[0.0, 0.0], [1.0, 1.0]], 1.0)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: hs.CellList([[0.0, np.nan]], 1.0), ValueError, r"points\[0, 1\]"),
        (lambda: hs.CellList([[0.0]], -1.0), ValueError, "cutoff"),
        (lambda: hs.CellList([[0.0]], 1.0, periodic=True), ValueError, "periodic needs a box"),
        (lambda: hs.CellList("ab", 1.0), TypeError, "points"),
        (lambda: CELLS.query([[0.0]]), ValueError, "queries must have 2 columns"),
        (lambda: CELLS.query([[0.0, np.inf]]), ValueError, r"queries\[0, 1\]"),
        (lambda: CELLS.query([[0.0, 0.0]], -1.0), ValueError, "radius .* got -1.0"),
        (lambda: CELLS.query([[0.0, 0.0]], np.nan), ValueError, "radius .* got nan"),
        (lambda: CELLS.query([[0.0, 0.0]], 10**400), OverflowError, "radius"),
        (lambda: CELLS.query([[0.0, 0.0]], [1.0, 2.0]), ValueError, r"shape \(1,\)"),
        (lambda: CELLS.query([[0.0, 0.0]], [-1.0]), ValueError, r"radius\[0\]"),
        (lambda: CELLS.query([[0.0, 0.0]], "a"), TypeError, "radius"),
        (lambda: CELLS.pairs(quantities="x"), ValueError, "quantities"),
        (lambda: CELLS.pairs(np.nan), ValueError, "cutoff"),
        (lambda: CELLS.pairs(wrong=1), TypeError, "wrong"),
        (lambda: CELLS.candidates([[0, 0], [0, -1e300]]), ValueError, r"queries\[1, 1\] = -1e"),
        (lambda: CELLS.cell_of([[1.0, 2.0, 3.0]]), ValueError, "2 columns"),
        (lambda: CELLS.count_pairs(kernel="none"), ValueError, "kernel"),
        (lambda: CELLS.nearest(0), ValueError, "k must be 1 or more"),
        (lambda: CELLS.nearest(1.0), TypeError, "k must be a whole number"),
        (lambda: CELLS.nearest(1, queries=[[0.0]]), ValueError, "queries must have 2 columns"),
        (lambda: CELLS.nearest(1, queries=[[np.nan, 0.0]]), ValueError, r"queries\[0, 0\]"),
        (lambda: CELLS.nearest(1, max_distance=-1.0), ValueError, "max_distance"),
        (lambda: CELLS.nearest(1, quantities="ij"), ValueError, "quantities"),
        (lambda: CELLS.nearest(1, inclusive=False), TypeError, "inclusive"),
        (lambda: CELLS.nearest(1, wrong=False), TypeError, "wrong"),
        (lambda: CELLS.nearest(1, memory_limit=10.0), MemoryError, "would not fit"),
    ],
)
def test_bad_input_is_named(call, error, message):
    with pytest.raises(error, match=message):
        call()
