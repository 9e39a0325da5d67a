# SPDX-License-Identifier: BSD-3-Clause
"""Rows and counts of many systems: input that is refused, and none at all."""

import numpy as np
import pytest

import halfshell as hs


def test_bad_input():
    points, batch = np.zeros((4, 3)), np.array([0, 0, 1, 2])
    queries, asked = np.zeros((2, 3)), np.array([0, 2])
    for search in (hs.neighbors, hs.coordination, lambda p, c, **h: hs.nearest(p, 2, **h),
                   lambda p, c, **h: hs.pair_histogram(p, [0.0, 1.0], **h)):  # fmt: skip
        with pytest.raises(ValueError, match="query_batch needs batch"):
            search(points, 1.0, queries=queries, query_batch=asked)
        for given in ({"queries": queries}, {"query_batch": asked}):
            with pytest.raises(ValueError, match="queries and query_batch must be given together"):
                search(points, 1.0, batch=batch, **given)
        with pytest.raises(ValueError, match=r"batch must be ascending, got batch\[0\] = 1 before"):
            search(points, 1.0, batch=[1, 0, 1, 2])
        with pytest.raises(ValueError, match=r"query_batch must be ascending, got query_b"):
            search(points, 1.0, batch=batch, queries=queries, query_batch=[2, 0])
        with pytest.raises(ValueError, match=r"query_batch must not be negative"):
            search(points, 1.0, batch=batch, queries=queries, query_batch=[-2, 0])
        with pytest.raises(ValueError, match=r"shape .2,., one number for each q"):
            search(points, 1.0, batch=batch, queries=queries, query_batch=[0])
        with pytest.raises(TypeError, match="query_batch must hold integers"):
            search(points, 1.0, batch=batch, queries=queries, query_batch=[0.0, 1.0])
        with pytest.raises(ValueError, match="same number of columns"):
            search(points, 1.0, batch=batch, queries=np.zeros((2, 2)), query_batch=asked)
        with pytest.raises(ValueError, match=r"query_batch must be less than the number of"):
            search(points, 1.0, batch=batch, queries=queries, query_batch=[0, 3],
                   box=np.array([np.eye(3)] * 3))  # fmt: skip
        worse = points.copy()
        worse[3, 1] = np.nan
        with pytest.raises(ValueError, match=r"points\[3, 1\] = nan"):
            search(worse, 1.0, batch=batch)
        asking = queries.copy()
        asking[1, 2] = np.inf
        with pytest.raises(ValueError, match=r"queries\[1, 2\] = inf"):
            search(points, 1.0, batch=batch, queries=asking, query_batch=asked)
        with pytest.raises(ValueError, match=r"box"):
            search(points, 1.0, batch=batch, box=np.array([np.eye(3), np.eye(3), np.zeros((3, 3))]))
        atoms = pytest.importorskip("ase").Atoms("H", positions=[[0.0, 0.0, 0.0]])
        with pytest.raises(ValueError, match="queries must be an array"):
            search(points, 1.0, batch=batch, queries=atoms, query_batch=[0])
    for search in (hs.neighbors, hs.coordination):
        with pytest.raises(ValueError, match="indices cannot be combined with batch"):
            search(points, 1.0, batch=batch, indices=[0])
        with pytest.raises(ValueError, match=r"radii.*radii\[2\] = -1"):
            search(points, None, batch=batch, radii=[1.0, 1.0, -1.0, 1.0])
        with pytest.raises(ValueError, match="cutoff"):
            search(points, -1.0, batch=batch)
        with pytest.raises(ValueError, match="cutoff"):
            search(points[:0], -1.0, batch=batch[:0])
        with pytest.raises(ValueError, match="cutoff"):
            search(points, [1.0, -1.0, 1.0], batch=batch)
    with pytest.raises(ValueError, match=r"max_distance\[1\] = -1"):
        hs.nearest(points, 2, batch=batch, max_distance=[1.0, -1.0, 1.0])
    with pytest.raises(ValueError, match=r"max_distance must be a number or"):
        hs.nearest(points, 2, batch=batch, max_distance=np.ones((2, 2)))
    with pytest.raises(ValueError, match="rdf needs a box"):
        hs.rdf(points, 1.0, batch=batch)
    with pytest.raises(MemoryError):
        hs.pair_histogram(points, [0.0, 1.0], batch=[0, 0, 1, 2**40])
    assert hs.pair_histogram(points, [0.0, 1.0], batch=[0, 0, 1, 2**10]).shape == (1025, 1)


def test_systems_before_the_first_that_has_points_are_empty():
    points = np.array([[0.0], [0.5], [0.0], [0.5], [0.9]])
    found = hs.pair_histogram(points, [0.0, 1.0], batch=[1, 1, 3, 3, 3])
    assert found.tolist() == [[0], [1], [0], [3]]


def test_nothing():
    none = np.zeros((0, 3))
    batch = np.zeros(0, int)
    assert len(hs.neighbors(none, 1.0, batch=batch)) == 0
    assert hs.coordination(none, 1.0, batch=batch).shape == (0,)
    assert hs.nearest(none, 2, batch=batch)[0].shape == (0, 2)
    assert hs.pair_histogram(none, [0.0, 1.0], batch=batch).shape == (0, 1)
    rows = hs.neighbors(none, 1.0, batch=batch, queries=np.zeros((2, 3)), query_batch=[4, 9])
    assert rows.counts.tolist() == [0, 0]
    j, d = hs.nearest(none, 2, batch=batch, queries=np.zeros((2, 3)), query_batch=[4, 9])
    assert (j == -1).all() and np.isinf(d).all()
    i, _ = hs.pairs_between(np.zeros((2, 3)), none, 1.0, batch=batch, query_batch=[0, 0])
    assert i.size == 0
    empty = hs.rdf(none, 1.0, box=np.eye(3), batch=batch)
    assert empty.counts.sum() == 0 and np.isfinite(empty.g).all()
