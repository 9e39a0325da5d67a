# SPDX-License-Identifier: BSD-3-Clause
"""Several cutoffs in one search: each pair is in the innermost shell that holds it, exactly."""

import io
import pickle

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import same_arrays


def test_few_pairs_none_and_no_points():
    for n in (0, 1):
        for box in (None, np.full(3, 9.0)):
            k = hs.pairs(np.zeros((n, 3)), [1.0, 2.0], quantities="k", box=box)
            assert k.shape == (0,)
            assert k.dtype == np.int32
    assert hs.pairs([[0.0], [0.0]], [0.0], quantities="k").tolist() == [0]
    assert hs.pairs([[0.0], [0.0]], [0.0, 0.0, 1.0], quantities="k").tolist() == [0]
    strict = hs.pairs([[0.0], [0.0]], [0.0, 0.0, 1.0], quantities="k", inclusive=False)
    assert strict.tolist() == [2]
    assert hs.pairs([[0.0], [1.0]], [1.0, 1.0, 2.0], quantities="k", inclusive=False) == [2]
    assert hs.pairs([[0.0]], [1.0, 2.0, 3.0], box=1.0, quantities="k").tolist() == [0, 1, 2]


def test_same_bytes_for_each_kernel_number_of_threads_and_way(rng):
    for kernel in hs.kernels():
        points, box = rng.random((3000, 3)), np.ones(3)
        edges = np.array([0.05, 0.1, 0.15])
        whole = call(
            hs.pairs, points, edges, box=box, quantities="ijdSk", kernel="scalar", threads=1
        )
        for threads in (1, 2, 3):
            options = {"quantities": "ijdSk", "threads": threads}
            with hs.settings(kernel=kernel):
                cells = hs.CellList(points, 0.2, box=box)
                listed = cells.pairs(edges, sort=True, **options)
                ascending = hs.pairs(points, edges, box=box, sort=True, **options)
                blocks = list(hs.iter_pairs(points, edges, box=box, max_pairs=70_001, **options))
                rows = hs.neighbors(points, edges, box=box, quantities="jdSk", threads=threads)
                kept = cells.neighbors(edges, quantities="jdSk", threads=threads)
                narrow = hs.neighbors(points, edges, box=box, quantities="k", threads=threads)
                between = hs.pairs_between(points, points, edges, box=box, **options)
                of_cells = list(cells.iter_pairs(edges, max_pairs=20_001, **options))
                unsorted = cells.pairs(edges, **options)
                plain = hs.pairs(points, edges, box=box, **options)
            halves = rows.to_pairs(quantities="ijdSk", half=True)
            assert narrow.shells.tobytes() == rows.shells.tobytes()
            apart = (between[0] != between[1]) | between[3].any(axis=1)
            for column, letter in enumerate("ijdSk"):
                assert halves[column].tobytes() == ascending[column].tobytes()
                assert same_arrays(rows.to_pairs(quantities=letter), between[column][apart])
                assert same_arrays(
                    rows.to_pairs(quantities=letter), kept.to_pairs(quantities=letter)
                )
            for column, wanted in enumerate(plain):
                assert wanted.tobytes() == whole[column].tobytes()
                assert np.concatenate([b[column] for b in blocks]).tobytes() == wanted.tobytes()
                assert listed[column].tobytes() == ascending[column].tobytes()
                joined = np.concatenate([b[column] for b in of_cells])
                assert joined.tobytes() == unsorted[column].tobytes()


def test_tables_keep_their_shells(rng):
    points, edges = rng.random((50, 3)), np.array([0.2, 0.3, 0.5])
    table = hs.neighbors(points, edges, box=1.0, quantities="jdSk")
    other = pickle.loads(pickle.dumps(table))
    file = io.BytesIO()
    table.save(file)
    file.seek(0)
    stored = hs.NeighborTable.load(file)
    assert table.shells.tobytes() == other.shells.tobytes() == stored.shells.tobytes()
    for one in (table, other, stored):
        ordered = one.sort()
        assert (np.diff(ordered.to_padded(fill=9, quantity="k"), axis=1) >= 0).all()
        inner = ordered.filter(ordered.shells < 2)
        expected = hs.neighbors(points, 0.3, box=1.0, quantities="jdS").sort()
        assert inner.indices.tobytes() == expected.indices.tobytes()
        assert inner[7:9].shells.tolist() == [k for row in (7, 8) for k in inner[row][3].tolist()]
    assert table.shells[table.reverse()].tobytes() == table.shells.tobytes()
    assert np.array_equal(table.sum(table.shells <= 1), hs.coordination(points, edges, box=1.0)[1])
    with pytest.raises(AttributeError, match="no shells: request them with a 'k' in quantities"):
        expected.shells  # noqa: B018


def test_counts_of_several_cutoffs(rng):
    edges = [0.1, 0.2, 0.4]
    points = hs.Points(rng.random((60, 3)), box=1.0, types=rng.integers(0, 3, 60))
    by_type = hs.coordination(points, edges, by_type=True)
    assert by_type.shape == (3, 60, 3)
    assert np.array_equal(by_type.sum(axis=2), hs.coordination(points, edges))
    for k, cutoff in enumerate(edges):
        assert np.array_equal(by_type[k], hs.coordination(points, cutoff, by_type=True))
    assert hs.coordination(points, [0.3]).shape == (1, 60)
    balls = points.replace(types=None, radii=rng.random(60))
    for k, cutoff in enumerate(edges):
        assert np.array_equal(hs.coordination(balls, edges)[k], hs.coordination(balls, cutoff))
    told = []
    hs.coordination(points, edges, progress=told.append)
    assert told == sorted(told) and (not told or told[-1] == 1.0)
