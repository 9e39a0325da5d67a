# SPDX-License-Identifier: BSD-3-Clause
"""`CellList.query` with a radius for each query: rows, memory, and the cost of equal radii."""

import tracemalloc

import numpy as np
import pytest

import halfshell as hs
from halfshell._objects import radii as radii_module
from oracles import same_arrays

RNG = np.random.default_rng(0)


def shell(n=3000):
    """Points between two spheres about the origin: none within 1.09, all within 1.99."""
    v = RNG.normal(size=(n, 3))
    v /= np.linalg.norm(v, axis=1)[:, None]
    return hs.CellList(v * RNG.uniform(1.1, 1.8, (n, 1)), 2.0)


@pytest.mark.parametrize("near", [np.full(3000, 1.0), RNG.uniform(1.0, 1.09, 3000)])
@pytest.mark.parametrize("quantities", ["j", "jdDS"])
def test_small_results_fit_a_small_limit(near, quantities):
    # With the largest radius of all, each query at the origin would find every point.
    queries = np.vstack([np.zeros((3000, 3)), [[50.0, 0.0, 0.0]]])
    table = shell().query(
        queries, np.append(near, 1.99), quantities=quantities, memory_limit=20e6
    )
    assert table.n_entries == 0 and len(table) == 3001


def test_what_is_left_out_takes_little_memory_at_a_time():
    cells = shell()
    near = np.append(RNG.uniform(1.0, 1.09, 2999), 1.18)  # one band, and 1.18 finds some points
    tracemalloc.start()
    try:
        table = cells.query(np.zeros((3000, 3)), near)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert table.counts[:-1].sum() == 0 and table.counts[-1] > 0
    assert peak < 40e6


# All at once, or one search of the cells for each radius.
both_ways = pytest.mark.parametrize("sorted_meanwhile", [1 << 40, 1])


@both_ways
@pytest.mark.parametrize("inclusive", [True, False])
@pytest.mark.parametrize("cutoff", [1.5, 2.5])  # less than some radii, and than none
def test_rows_are_those_of_each_radius_alone(sorted_meanwhile, inclusive, cutoff, monkeypatch):
    monkeypatch.setattr(radii_module, "_SORTED_MEANWHILE", sorted_meanwhile)
    grid = np.indices((5, 5, 5)).reshape(3, -1).T.astype(float)
    cells = hs.CellList(grid, cutoff, box=[5.0] * 3)
    queries = np.vstack([grid, RNG.random((40, 3)) * 5.0])
    exact = np.sqrt(np.array([0.0, 1.0, 2.0, 3.0, 5.0]))
    radii = RNG.choice(np.concatenate([exact, np.nextafter(exact, 9.0), RNG.random(30) * 2.2]), 165)
    table = cells.query(queries, radii, quantities="jdDS", inclusive=inclusive)
    for k in range(len(queries)):
        alone = cells.query(
            queries[k : k + 1], radii[k], quantities="jdDS", inclusive=inclusive
        )
        assert same_arrays(table[k], alone[0])


@both_ways
@pytest.mark.parametrize("precision", ["exact", "double"])
def test_the_table_can_be_sorted_and_is_read_only(sorted_meanwhile, precision, monkeypatch):
    monkeypatch.setattr(radii_module, "_SORTED_MEANWHILE", sorted_meanwhile)
    points = RNG.random((300, 3))
    cells = hs.CellList(points, 0.5, box=1.0, precision=precision)
    queries, radii = RNG.random((40, 3)), RNG.choice([0.1, 0.2, 0.3, 0.4], 40)
    table = cells.query(queries, radii, quantities="jd", index_dtype=np.int32)
    assert table.indices.dtype == np.int32
    assert not any(array.flags.writeable for array in table._arrays)
    queries[:], kept = 0.0, queries.copy()
    near = table.sort()
    for k, (j, d) in enumerate(near):
        alone = cells.query(kept[k : k + 1], radii[k], quantities="jd").sort()
        assert np.array_equal(j, alone[0][0]) and np.array_equal(d, alone[0][1])


def test_radii_at_the_end_of_float64():
    cells = hs.CellList([[-1.5e308], [0.0], [1.5e308]], 1.0)
    table = cells.query([[0.0], [0.0], [0.0]], [1.6e308, 1.4e308, 0.0])
    assert [row.tolist() for row in table] == [[0, 1, 2], [1], [1]]


def test_equal_radii_are_one_search(monkeypatch):
    seen = []
    core = hs._core.neighbors

    def counted(*arguments):
        seen.append(arguments[10])
        return core(*arguments)

    cells = shell(500)
    monkeypatch.setattr(hs._core, "neighbors", counted)
    queries = RNG.random((100, 3))
    for n in (1, 100):
        table = cells.query(queries[:n], np.full(n, 1.5))
        assert seen == ["j"]  # no distances, which nothing is to be left out by
        seen.clear()
        assert np.array_equal(table.indices, cells.query(queries[:n], 1.5).indices)
        seen.clear()


def test_a_result_that_does_not_fit_is_refused():
    cells = shell()
    queries = np.zeros((400, 3))
    radii = np.append(np.full(200, 1.95), np.full(200, 1.99))  # 3000 neighbours each, 8 bytes
    assert cells.query(queries, radii, memory_limit=40e6).n_entries == 1_200_000
    for limit in (3e6, 8e6):
        with pytest.raises(MemoryError, match=r"would not fit"):
            cells.query(queries, radii, memory_limit=limit)


def test_messages_name_the_radius():
    cells = hs.CellList(RNG.random((50, 3)), 0.5, box=[1.0] * 3)
    for radius in (1e300, [1e300] * 2, [1e300, 1.0], [1e300, 1.1e300]):
        with pytest.raises(MemoryError, match=r"radius spans more images.*smaller radius"):
            cells.query(np.zeros((2, 3)), radius)
