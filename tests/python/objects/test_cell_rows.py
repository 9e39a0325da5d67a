# SPDX-License-Identifier: BSD-3-Clause
"""Rows of neighbours from a `CellList`: of the points, of queries, of queries with radii."""

import numpy as np
import pytest
from ase import Atoms
from ase.build import bulk
from numpy.testing import assert_array_equal

import halfshell as hs
from cell_scenes import SCENES, queries_of, scene_of


def assert_same_table(found, expected):
    assert_array_equal(found.offsets, expected.offsets)
    tables = (table.to_pairs(quantities="jdDS") for table in (found, expected))
    for a, b in zip(*tables, strict=True):
        assert a.tobytes() == b.tobytes() and a.dtype == b.dtype and a.shape == b.shape
    assert found.n_points == expected.n_points


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("factor", [1.0, 0.3, 1.5])
def test_rows_are_those_of_a_search_of_its_own(name, factor):
    points, cutoff, scene = scene_of(name)
    cells, queries = hs.CellList(points, cutoff, **scene), queries_of(name)
    radius = cutoff * factor
    for inclusive in (True, False):
        how = {"quantities": "jdDS", "inclusive": inclusive}
        assert_same_table(
            cells.neighbors(radius, **how), hs.neighbors(points, radius, **how, **scene)
        )
        assert_same_table(
            cells.query(queries, radius, **how),
            hs.neighbors(points, radius, queries=queries, **how, **scene),
        )
    assert cells.neighbors(radius, index_dtype=np.int32).indices.dtype == np.int32


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("inclusive", [True, False])
def test_each_query_has_a_radius_of_its_own(name, inclusive):
    points, cutoff, scene = scene_of(name)
    cells, queries = hs.CellList(points, cutoff, **scene), queries_of(name, 25)
    parts = np.array([0.0, 0.01, 0.3, 0.3, 0.77, 1.0, 1.0, 1.2])
    radii = cutoff * np.resize(parts, len(queries))
    # Some are exactly the distance of a neighbour, or a step less.
    near = cells.query(queries, cutoff, quantities="d")
    for i in range(0, len(queries), 3):
        if len(near[i]):
            radii[i] = near[i][0] if i % 2 else np.nextafter(near[i][0], 0.0)
    how = {"quantities": "jdDS", "inclusive": inclusive}
    table = cells.query(queries, radii, **how)
    assert table.n_rows == len(queries)
    for i, radius in enumerate(radii.tolist()):
        expected = cells.query(queries[i : i + 1], radius, **how)
        for a, b in zip(table[i], expected[0], strict=True):
            assert a.tobytes() == b.tobytes() and a.dtype == b.dtype
    alone = cells.query(queries, radii, inclusive=inclusive, index_dtype=np.int32)
    assert_array_equal(alone.indices, table.indices)
    assert alone.indices.dtype == np.int32


def test_rows_of_radii_are_read_only_and_of_a_table_of_queries():
    points, cutoff, scene = scene_of("triclinic")
    cells = hs.CellList(points, cutoff, **scene)
    table = cells.query(points[:4], [0.5, 1.0, 1.5, 0.0], quantities="dj")
    assert table.quantities == "dj" and table.n_points == len(points)
    assert table[3][1].tolist() == [3]  # a radius of 0 finds what lies there
    with pytest.raises(ValueError, match="read-only"):
        table.distances[0] = 1.0
    with pytest.raises(ValueError, match="one set"):
        table.reverse()


def test_one_radius_in_an_array_is_one_for_all():
    points, cutoff, scene = scene_of("plane")
    cells = hs.CellList(points, cutoff, **scene)
    for radius in (np.array(0.5), np.float32(0.5), np.full(len(points), 0.5)):
        assert_array_equal(cells.query(points, radius).indices, cells.query(points, 0.5).indices)


def test_radii_are_decided_by_the_precision_of_the_list():
    # Far outside the box rounded and exact distances differ by many last places.
    points, box = np.random.default_rng(4).random((300, 2)) * 1e6, [3.9, 3.7]
    cells = hs.CellList(points, 0.5, precision="double", box=box)
    queries = points[:100]
    near = hs.neighbors(points, 0.5, queries=queries, quantities="d", box=box)
    radii = np.array([d[-1] for d in near]) * (1.0 + 1e-12)
    table = cells.query(queries, radii, quantities="jS")
    differ = 0
    for i, radius in enumerate(radii.tolist()):
        alone = cells.query(queries[i : i + 1], radius, quantities="jS")[0]
        assert_array_equal(table[i][0], alone[0])
        assert_array_equal(table[i][1], alone[1])
        exact = hs.neighbors(points, radius, queries=queries[i : i + 1], box=box)
        differ += len(exact[0]) != len(alone[0])
    assert differ > 0


def test_queries_may_bring_the_box_of_the_list():
    crystal = bulk("Cu", cubic=True) * (2, 2, 2)
    probe = Atoms("H2", positions=[[0.9, 0.9, 0.9], [30.0, -8.0, 1.0]], cell=crystal.cell, pbc=True)
    cells = hs.CellList(crystal, 3.0)
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
    for call in calls:
        assert_array_equal(call(probe), call(probe.positions))
    other = Atoms("H2", positions=probe.positions)
    for call in calls:
        with pytest.raises(ValueError, match="bring a box that is not that of points"):
            call(other)
    in_open_space = hs.CellList(crystal.positions, 3.0)
    assert_array_equal(
        in_open_space.neighbors(queries=other).indices,
        hs.neighbors(crystal.positions, 3.0, queries=other).indices,
    )
    with pytest.raises(ValueError, match="bring a box that is not that of points"):
        in_open_space.neighbors(queries=probe)
    with pytest.raises(ValueError, match="queries must have 2 columns"):
        hs.CellList([[0.0, 0.0]], 1.0).neighbors(queries=probe)
