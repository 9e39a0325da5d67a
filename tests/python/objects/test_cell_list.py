# SPDX-License-Identifier: BSD-3-Clause
"""`CellList` answers as the functions do, for any cutoff, any queries and any width of cells."""

import copy
import gc
import itertools
import pickle
import threading
import tracemalloc
from functools import partial

import numpy as np
import pytest
from ase import Atoms
from ase.build import bulk
from numpy.testing import assert_array_equal

import halfshell as hs
from calls import call
from cell_scenes import SCENES, WIDTHS, queries_of, scene_of
from full_lists import same_tables
from halfshell._objects import cell_list
from oracles import same_arrays
from refused_calls import check_refusals


class Alone:
    """What a list of cells answers, each by a search of its own."""

    def __init__(self, points, **scene):
        self.points, self.scene = points, scene

    def __getattr__(self, name):
        return partial(getattr(hs, name), self.points, **self.scene)

    def query(self, queries, radius, **how):
        return call(hs.neighbors, self.points, radius, queries=queries, **how, **self.scene)


def same(found, expected):
    if isinstance(expected, hs.NeighborTable):
        return same_tables(found, expected) and found.shape == expected.shape
    if isinstance(expected, (int, list)):
        return type(found) is type(expected) and found == expected
    return same_arrays(found, expected)


# Of cells, a radius, queries, and options.
ASKS = {
    "pairs": lambda c, r, q, how: c.pairs(r, quantities="ijdDS", sort=True, **how),
    "count_pairs": lambda c, r, q, how: c.count_pairs(r, **how),
    "count, queries": lambda c, r, q, how: c.count_pairs(r, queries=q, **how),
    "counts": lambda c, r, q, how: c.count_pairs(r * np.array([0.0, 0.5, 0.5, 0.9, 1.0]), **how),
    "counts, queries": lambda c, r, q, how: c.count_pairs([0.4 * r, r], queries=q, **how),
    "neighbors": lambda c, r, q, how: c.neighbors(r, quantities="jdDS", **how),
    "query": lambda c, r, q, how: c.query(q, r, quantities="jdDS", **how),
    "int32": lambda c, r, q, how: c.query(q, r, index_dtype=np.int32, **how),
    "coordination": lambda c, r, q, how: c.coordination(r, **how),
    "coordination, queries": lambda c, r, q, how: c.coordination(r, queries=q, **how),
}


@pytest.mark.parametrize("name", SCENES)
def test_answers_are_those_of_a_search_of_its_own(name):
    points, cutoff, scene = scene_of(name)
    alone, queries = Alone(points, **scene), queries_of(name)
    sizes = [(cutoff or 1.0) * factor for factor in WIDTHS]
    sized = itertools.cycle([hs.CellList(points, cutoff, cell_size=one, **scene) for one in sizes])
    plain = hs.CellList(points, cutoff, **scene)
    for factor in (1.0, 0.3, 0.0, 1.5):
        for inclusive in (True, False):
            lists = [plain, next(sized), next(sized)]
            for what, ask in ASKS.items():
                asked = (factor * cutoff, queries, {"inclusive": inclusive})
                expected = ask(alone, *asked)
                for cells in lists:
                    assert same(ask(cells, *asked), expected), (what, factor, inclusive)
    assert plain.count_pairs(cutoff) == plain.count_pairs() == alone.count_pairs(cutoff)


def edges_of(points, cutoff, scene, factor):
    """Edges up to a part of the cutoff or more, some of them exactly at distances."""
    last = cutoff * factor
    d = call(hs.pairs, points, last, quantities="d", **scene)[:3]
    return np.sort(np.concatenate([[0.0, 0.3 * last, 0.3 * last, last], np.minimum(d, last)]))


@pytest.mark.parametrize("name", SCENES)
def test_histograms_are_those_of_a_search_of_its_own(name, rng):
    points, cutoff, scene = scene_of(name)
    queries = queries_of(name)
    types, weights = rng.integers(0, 3, len(points)), rng.normal(size=len(points))
    plain = hs.Points(points, **scene)
    asks = [
        (plain, False, None),
        (plain.replace(types=types), True, None),
        (plain.replace(types=types, weights=weights), True, None),
        (plain, False, queries),
        (
            plain.replace(types=types), True,
            hs.Points(queries, types=rng.integers(0, 2, len(queries))),
        ),
        (
            plain.replace(weights=weights), False,
            hs.Points(queries, weights=rng.normal(size=len(queries))),
        ),
    ]  # fmt: skip
    for factor in (1.0, 0.5, 0.001, 1.25):
        edges = edges_of(points, cutoff, scene, factor)
        for known, by_type, asking in asks:
            options = {"queries": asking, "by_type": by_type}
            expected = hs.pair_histogram(known, edges, **options)
            for width in (None, cutoff / 2 or 1.0):
                cells = hs.CellList(known, cutoff, cell_size=width)
                assert same_arrays(cells.pair_histogram(edges, **options), expected)


@pytest.mark.parametrize("name", SCENES)
def test_nearest_are_those_of_a_search_of_its_own(name):
    points, cutoff, scene = scene_of(name)
    cells, alone = hs.CellList(points, cutoff, **scene), Alone(points, **scene)
    queries = queries_of(name)
    for k, limit in ((1, np.inf), (7, 0.75 * cutoff), (40, np.inf)):
        for asking in (None, queries, queries[:0]):
            how = {"queries": asking, "max_distance": limit, "quantities": "jdDS"}
            assert same_arrays(cells.nearest(k, **how), alone.nearest(k, **how))


@pytest.mark.parametrize("box", [None, 1.0, [[1.0, 0.0, 0.0], [0.6, 0.7, 0.0], [0.0, 0.3, 0.8]]])
def test_few_and_many_queries_far_apart_or_close(box, rng):
    points = rng.random((4000, 3))
    cells = hs.CellList(points, 0.07, box=box)
    for n in (1, 2, 9, 30, 200, 800, 5000):
        apart, close = rng.random((n, 3)) * 1.2 - 0.1, 0.5 + 0.02 * rng.random((n, 3))
        mixed = np.where(np.arange(n)[:, None] % 3 > 0, apart, close)
        for queries in (apart, close, mixed):
            for threads in (1, 2):
                how = {"queries": queries, "threads": threads}
                for radius in (0.07, 0.02):
                    expected = hs.neighbors(points, radius, box=box, **how)
                    assert same_tables(cells.query(queries, radius, threads=threads), expected)
                    assert cells.count_pairs(radius, **how) == expected.n_entries
                for k in (1, 8):
                    assert same_arrays(
                        cells.nearest(k, **how), hs.nearest(points, k, box=box, **how)
                    )


@pytest.mark.parametrize("precision", ["double", "single"])
def test_histograms_are_exact_for_any_precision(precision):
    points = np.stack(np.meshgrid(*[np.arange(6.0) * 0.1] * 3), -1).reshape(-1, 3)
    box, edges = [0.6] * 3, np.array([0.0, 0.1, 0.2, 0.3])
    cells = hs.CellList(points, 0.3, box=box)
    exact = hs.pair_histogram(points, edges, box=box)
    with hs.settings(precision=precision):
        assert_array_equal(cells.pair_histogram(edges), exact)
        # Counts are by the precision that is set, for one cutoff and for several.
        counts = cells.count_pairs(edges)
        assert counts.tolist() == [cells.count_pairs(one) for one in edges]
        if precision == "double":  # single depends on the cells
            assert_array_equal(counts, hs.count_pairs(points, edges, box=box))


@pytest.mark.parametrize("what", ["query", "nearest"])
def test_many_threads_may_ask_at_once(what, rng):
    points, queries, found = rng.random((3000, 3)) * 9.0, rng.random((500, 3)) * 9.0, []
    cells = hs.CellList(points, 1.0, box=9.0)

    def ask(one):
        if what == "query":
            return one.query(queries, 1.0).indices.tobytes(), one.count_pairs(0.7)
        return one.nearest(5, queries=queries, quantities="j").tobytes()

    asking = [
        threading.Thread(target=lambda: found.extend(ask(cells) for _ in range(3)))
        for _ in range(4)
    ]
    for thread in asking:
        thread.start()
    for thread in asking:
        thread.join()
    assert found == [ask(Alone(points, box=9.0))] * 12


# ---- a radius for each query ---------------------------------------------------------------------


# All at once, or one search of the cells for each radius.
MEANWHILE = [1 << 40, 1]


@pytest.mark.parametrize("name", SCENES)
def test_each_query_may_have_a_radius_of_its_own(name, monkeypatch):
    points, cutoff, scene = scene_of(name)
    cells, queries = hs.CellList(points, cutoff, **scene), queries_of(name, 25)
    parts = np.array([0.0, 0.01, 0.3, 0.3, 0.77, 1.0, 1.0, 1.2])
    radii = cutoff * np.resize(parts, len(queries))
    # Some are exactly the distance of a neighbour, or a step less.
    near = cells.query(queries, cutoff, quantities="d")
    for i in range(0, len(queries), 3):
        if len(near[i]):
            radii[i] = near[i][0] if i % 2 else np.nextafter(near[i][0], 0.0)
    for inclusive in (True, False):
        rows = [
            cells.query(queries[i : i + 1], radius, quantities="jdDS", inclusive=inclusive)[0]
            for i, radius in enumerate(radii.tolist())
        ]
        for sorted_meanwhile in MEANWHILE:
            monkeypatch.setattr(cell_list, "_SORTED_MEANWHILE", sorted_meanwhile)
            table = cells.query(queries, radii, quantities="jdDS", inclusive=inclusive)
            assert table.n_rows == len(rows) and all(map(same_arrays, table, rows))
            narrow = cells.query(queries, radii, inclusive=inclusive, index_dtype=np.int32)
            assert narrow.indices.dtype == np.int32
            assert_array_equal(narrow.indices, table.indices)


@pytest.mark.parametrize("sorted_meanwhile", MEANWHILE)
@pytest.mark.parametrize("precision", ["exact", "double"])
def test_a_table_of_radii_is_a_table_of_queries(sorted_meanwhile, precision, monkeypatch, rng):
    monkeypatch.setattr(cell_list, "_SORTED_MEANWHILE", sorted_meanwhile)
    cells = hs.CellList(rng.random((300, 3)), 0.5, box=1.0)
    queries, radii = rng.random((40, 3)), rng.choice([0.1, 0.2, 0.3, 0.4], 40)
    with hs.settings(precision=precision):
        table = cells.query(queries, radii, quantities="jd", index_dtype=np.int32)
    assert table.quantities == "jd" and table.n_points == 300
    assert not any(array.flags.writeable for array in table._arrays)
    queries[:], kept = 0.0, queries.copy()
    for k, (j, d) in enumerate(table.sort()):
        alone = cells.query(kept[k : k + 1], radii[k], quantities="jd").sort()
        assert np.array_equal(j, alone[0][0]) and np.array_equal(d, alone[0][1])
    with pytest.raises(ValueError, match="one set"):
        table.reverse()


def test_special_radii():
    cells = hs.CellList([[-1.5e308], [0.0], [1.5e308]], 1.0)
    table = cells.query([[0.0], [0.0], [0.0]], [1.6e308, 1.4e308, 0.0])
    assert [row.tolist() for row in table] == [[0, 1, 2], [1], [1]]
    table = hs.CellList([[0.0]], 1.0).query(np.empty((0, 1)), np.empty(0), quantities="jD")
    assert table.n_rows == 0 and table.vectors.shape == (0, 1)
    points, cutoff, scene = scene_of("plane")
    cells = hs.CellList(points, cutoff, **scene)
    for radius in (np.array(0.5), np.float32(0.5), np.full(len(points), 0.5)):
        assert_array_equal(cells.query(points, radius).indices, cells.query(points, 0.5).indices)


def shell(rng, n=3000):
    """Points between two spheres about the origin: none within 1.09, all within 1.99."""
    v = rng.normal(size=(n, 3))
    v /= np.linalg.norm(v, axis=1)[:, None]
    return hs.CellList(v * rng.uniform(1.1, 1.8, (n, 1)), 2.0)


def test_sorting_a_table_of_radii_searches_as_it_was_asked():
    """What is set, and what the caller's arrays hold, may be something else by then."""
    lattice = np.stack(np.meshgrid(*[np.arange(5.0) * 0.1] * 3), -1).reshape(-1, 3)
    cells = hs.CellList(lattice, 0.3, box=[0.5] * 3)
    for precision, sizes in itertools.product(("double", "exact"), ([0.1, 0.2], [0.2])):
        queries, exclude = lattice[:60].copy(), np.array([[0, 1]])
        radii = np.resize(sizes, 60)
        with hs.settings(precision=precision):
            table = cells.query(queries, radii, quantities="jd", exclude=exclude)
            whole = cells.query(queries, radii, quantities="jdS", exclude=exclude).sort()
        queries[:], radii[:], exclude[:] = 0.25, 0.0, 7
        assert_array_equal(table.sort().indices, whole.indices)


def test_small_results_of_radii_take_little_memory(rng):
    # With the largest radius of all, each query at the origin would find every point.
    cells, origin = shell(rng), np.zeros((3000, 3))
    for near in (np.full(3000, 1.0), rng.uniform(1.0, 1.09, 3000)):
        queries, radii = np.vstack([origin, [[50.0, 0.0, 0.0]]]), np.append(near, 1.99)
        for letters in ("j", "jdDS"):
            table = call(cells.query, queries, radii, quantities=letters, memory_limit=20e6)
            assert table.n_entries == 0 and len(table) == 3001
    near = np.append(rng.uniform(1.0, 1.09, 2999), 1.18)  # one band, and 1.18 finds some points
    tracemalloc.start()
    try:
        table = cells.query(origin, near)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert table.counts[:-1].sum() == 0 and table.counts[-1] > 0
    assert peak < 40e6
    radii = np.append(np.full(200, 1.95), np.full(200, 1.99))  # 3000 neighbours each, 8 bytes
    assert call(cells.query, origin[:400], radii, memory_limit=40e6).n_entries == 1_200_000
    for limit in (3e6, 8e6):
        with pytest.raises(MemoryError, match="would not fit"):
            call(cells.query, origin[:400], radii, memory_limit=limit)


# ---- blocks and visits ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", SCENES)
def test_blocks_and_visits_have_the_order_of_the_pairs(name):
    points, cutoff, scene = scene_of(name)
    for factor in (1.0, 1.5, 0.5):
        cells = hs.CellList(points, cutoff * factor, **scene)
        expected = cells.pairs(cutoff, quantities="ijdDS")
        m = len(expected[0])
        for most in {1, 7, max(m, 1), m + 1} if m < 300 else {m // 3, m + 1}:
            blocks = list(cells.iter_pairs(cutoff, quantities="ijdDS", max_pairs=most))
            assert len(blocks) == -(-m // most)
            for k, whole in enumerate(expected):
                joined = [block[k] for block in blocks]
                assert_array_equal(np.concatenate([whole[:0], *joined]), whole)
    seen = []
    n = cells.for_each_pair(lambda i, j, S, D, d2: seen.append((i, j, S, D)))
    i, j, S, D = cells.pairs(quantities="ijSD")
    assert n == len(i) == len(seen)
    rows = zip(i.tolist(), j.tolist(), map(tuple, S.tolist()), map(tuple, D.tolist()), strict=True)
    assert seen == list(rows)


def test_an_iterator_keeps_its_cells(rng):
    points = rng.random((2000, 3)) * 9.0
    cells = hs.CellList(points, 1.0)
    expected = cells.pairs(quantities="P")
    blocks = cells.iter_pairs(quantities="P", max_pairs=100)
    first, abandoned = next(blocks), cells.iter_pairs(max_pairs=100)
    next(abandoned)
    del cells, abandoned
    gc.collect()
    others = [hs.CellList(rng.random((2000, 3)) * 9.0, 1.0) for _ in range(4)]
    assert_array_equal(np.concatenate([first, *blocks]), expected)
    assert len(others[0].pairs(quantities="P")) != len(expected)


# ---- what is given, and what stays as it is ------------------------------------------------------


def test_queries_may_bring_the_box_of_the_list():
    crystal = bulk("Cu", cubic=True) * (2, 2, 2)
    probe = Atoms("H2", positions=[[0.9, 0.9, 0.9], [30.0, -8.0, 1.0]], cell=crystal.cell, pbc=True)
    cells = hs.CellList(crystal, 3.0)
    found, whole = cells.pairs(quantities="ijS", sort=True), {"quantities": "ijS", "sort": True}
    assert same_arrays(found, call(hs.pairs, crystal, 3.0, **whole))
    calls = [
        lambda asking: cells.neighbors(queries=asking).indices,
        lambda asking: cells.query(asking, [3.0, 2.0]).indices,
        lambda asking: cells.nearest(4, queries=asking, quantities="j"),
        lambda asking: cells.pair_histogram([0.0, 1.0, 3.0], queries=asking),
        lambda asking: cells.coordination(queries=asking),
        lambda asking: cells.count_pairs(queries=asking),
        lambda asking: cells.candidates(asking).start,
        lambda asking: cells.cell_of(asking),
    ]
    bare = Atoms("H2", positions=probe.positions)
    other = Atoms("H2", positions=probe.positions, cell=2.0 * crystal.cell, pbc=True)
    for ask in calls:
        for asking in (probe, bare):
            assert_array_equal(ask(asking), ask(probe.positions))
        with pytest.raises(ValueError, match="bring a box that is not that of points"):
            ask(other)
    in_open_space = hs.CellList(crystal.positions, 3.0)
    assert_array_equal(
        in_open_space.neighbors(queries=bare).indices,
        hs.neighbors(crystal.positions, 3.0, queries=bare).indices,
    )
    with pytest.raises(ValueError, match="bring a box that is not that of points"):
        in_open_space.neighbors(queries=probe)
    with pytest.raises(ValueError, match="same number of columns"):
        hs.CellList([[0.0, 0.0]], 1.0).neighbors(queries=probe)


def test_a_list_does_not_change(rng):
    points, types = rng.random((100, 3)) * 9.0, np.zeros(100, dtype=np.int64)
    for given in (points, hs.Points(points, types=types)):
        cells = hs.CellList(given, 1.0)
        expected = cells.count_pairs(), cells.count_pairs(3.0)
        points[:], kept = 0.0, points.copy()
        types[:] = 1
        assert (cells.count_pairs(), cells.count_pairs(3.0)) == expected
        assert_array_equal(cells.points.positions, kept)
        points[:] = kept
    edges = np.array([0.0, 0.5, 1.0])
    edges.flags.writeable = False
    first = cells.pair_histogram(edges, by_type=True)
    assert first.flags.writeable and first.shape == (1, 1, 2)
    first[:] = -1
    assert (cells.pair_histogram(edges, by_type=True) >= 0).all()
    with pytest.raises(AttributeError):
        cells.cutoff = 2.0
    assert copy.copy(cells) is cells and copy.deepcopy([cells])[0] is cells


@pytest.mark.parametrize("name", SCENES)
def test_pickles_and_lists_of_other_points_have_the_same_cells(name):
    points, cutoff, scene = scene_of(name)
    width = 0.7 * cutoff or 1.0
    for how in ({}, {"threads": 2}, {"cell_size": width}):
        cells = hs.CellList(points, cutoff, **how, **scene)
        other = hs.CellList(points[::2], cutoff, **how, **scene)
        for again in (pickle.loads(pickle.dumps(cells)), other.rebuild(points),
                      pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(other)))).rebuild(points)):
            assert repr(again) == repr(cells) and again.cell_sizes == cells.cell_sizes
            assert again.shape == cells.shape and len(other) == len(points[::2])
            assert_array_equal(again.order, cells.order)
            assert_array_equal(again.cell_start, cells.cell_start)
            assert same(again.pairs(quantities="ijdDS"), cells.pairs(quantities="ijdDS"))
            table = again.neighbors(quantities="jd").sort()
            assert same(table, cells.neighbors(quantities="jd").sort())


def test_other_points_are_those_of_the_list_in_kind(rng):
    cells = hs.CellList(rng.random((10, 3)), 0.2, box=[1.0] * 3)
    check_refusals([
        (lambda: cells.rebuild(np.zeros((3, 2))), ValueError, "points must have 3 columns"),
        (lambda: cells.rebuild([[np.nan] * 3]), ValueError, "finite"),
        (lambda: cells.rebuild("abc"), TypeError, "points"),
        (lambda: cells.rebuild(Atoms("H", cell=[2.0] * 3, pbc=True)), ValueError, "box"),
    ])  # fmt: skip
    assert len(cells.rebuild(np.empty((0, 3)))) == 0


CELLS = hs.CellList([[0.0, 0.0], [1.0, 1.0]], 2.0)
PERIODIC = hs.CellList([[0.1, 0.1, 0.1], [0.7, 0.2, 0.4]], 0.5, box=[1.0] * 3)
TYPED = hs.Points([[0.0, 0.0], [1.0, 1.0]], types=[0, 1])
EDGES = [0.0, 1.0]


def test_bad_input_is_named():
    build, query, counts = hs.CellList, CELLS.query, CELLS.count_pairs
    nearest, histogram = CELLS.nearest, CELLS.pair_histogram
    check_refusals([
        (lambda: build([[0.0]], 1.0, periodic=True), ValueError, "periodic needs a box"),
        (lambda: query([[0.0]]), ValueError, "(must have 2|same number of) columns"),
        (lambda: query([[0.0, 0.0]], [1.0, 2.0]), ValueError, r"shape \(1,\)"),
        (lambda: query([[0.0, 0.0]], [-1.0]), ValueError, r"radius\[0\]"),
        *((
            lambda radius=radius: PERIODIC.query(np.zeros((2, 3)), radius), MemoryError,
            "radius spans more images.*smaller radius",
        ) for radius in (1e300, [1e300] * 2, [1e300, 1.0], [1e300, 1.1e300])),
        (lambda: CELLS.candidates([[0, 0], [0, -1e300]]), ValueError, r"queries\[1, 1\] = -1e"),
        (lambda: CELLS.cell_of([[1.0, 2.0, 3.0]]), ValueError, "(2|number of) columns"),
        (lambda: CELLS.iter_pairs(sort=True), TypeError, "sort"),
        (lambda: counts([1.0, 0.5]), ValueError, r"cutoff\[0\] = 1.0 before"),
        (lambda: counts([0.5, 1.0], queries=[[1.0]]), ValueError, "number of columns"),
        (lambda: nearest(1, queries=[[0.0]]), ValueError, "number of columns"),
        (lambda: call(nearest, 1, memory_limit=10.0), MemoryError, "would not fit"),
        (lambda: histogram([0.0, 2.0, 1.0]), ValueError, r"edges\[1\]"),
        (lambda: histogram(EDGES, queries=[[1.0]]), ValueError, "number of columns"),
        (lambda: histogram(EDGES, by_type=True), ValueError, "by_type needs types"),
        (
            lambda: build(TYPED, 1.0).pair_histogram(EDGES, queries=[[0.0, 0.0]], by_type=True),
            ValueError, "queries have none: both need them",
        ),
        (lambda: histogram(EDGES, inclusive=True), TypeError, "inclusive"),
        (
            lambda: call(histogram, np.linspace(0.0, 1.0, 100_000), memory_limit=1e4), MemoryError,
            "counts: 10 kB are allowed",
        ),
    ])  # fmt: skip


@pytest.mark.parametrize("far", [1e6, 1e9, 1e15])
def test_queries_for_which_the_cells_do_not_serve_are_chosen_from_too(far):
    points = hs.Points([[0.0], [1.0], [2.0]], box=4.0, labels=[0, 1, 2], groups=[0, 0, 1])
    cells = hs.CellList(points, 1.0)
    queries = hs.Points([[4.0 * far], [-4.0 * far]], labels=[0, 5], groups=[0, 1])
    for exclude in (0, [[0, 1], [0, 2], [1, 0]], None):
        for least in (None, 0.5):
            how = {"exclude": exclude, "min_distance": least}
            found = hs.pairs_between(queries, cells, 1.0, **how)
            for one, other in zip(found, hs.pairs_between(queries, points, 1.0, **how)):
                assert np.array_equal(one, other)
