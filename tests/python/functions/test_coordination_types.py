# SPDX-License-Identifier: BSD-3-Clause
"""Neighbours counted by type, against the rows of the full list."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import halfshell as hs
from calls import call
from scene_strategies import scenes

NAMES = np.array(["Si", "O", "Na", "Cl"])


def of_rows(table, types, n_types):
    return [np.bincount(types[j], minlength=n_types).tolist() for j in table]


@given(scenes(), st.data())
def test_counts_are_those_of_rows(scene, data):
    n = len(scene.points)
    types = np.array(data.draw(st.lists(st.integers(0, 3), min_size=n, max_size=n)), np.int64)
    t = 1 + int(types.max(initial=0))
    how = {"box": scene.box, "periodic": scene.periodic, "inclusive": scene.inclusive}
    table = call(hs.neighbors, scene.points, scene.cutoff, **how)
    counts = call(hs.coordination, scene.points, scene.cutoff, types=types, by_type=True, **how)
    assert counts.dtype == np.int64 and counts.shape == (n, t)
    assert counts.tolist() == of_rows(table, types, t)
    names = NAMES[types]
    order, places = np.unique(names, return_inverse=True)
    named = call(hs.coordination, scene.points, scene.cutoff, types=names, by_type=True, **how)
    if n:
        assert named.tolist() == of_rows(table, places, len(order))
    some = data.draw(st.lists(st.integers(0, n - 1), max_size=5) if n else st.just([]))
    few = call(
        hs.coordination, scene.points, scene.cutoff, types=types, by_type=True, indices=some, **how
    )
    assert few.dtype == np.int64 and np.array_equal(few, counts[some])
    plain = call(hs.coordination, scene.points, scene.cutoff, **how)
    assert np.array_equal(counts.sum(axis=1), plain)


@pytest.mark.parametrize("ndim", [1, 2, 3, 5])
def test_many_images_ties_and_equal_points(ndim, rng):
    points = np.repeat(rng.integers(0, 8, (30, ndim)) / 8, 2, axis=0).astype(np.float32)
    types = rng.integers(0, 4, 60) + 1  # 0 has no points
    for cutoff, inclusive in itertools.product((0.0, 0.25, 1.0), (True, False)):
        scene = {"box": np.ones(ndim), "inclusive": inclusive}
        expected = of_rows(call(hs.neighbors, points, cutoff, **scene), types, 5)
        for kernel, threads in itertools.product(hs.kernels(), (1, 3)):
            how = {"kernel": kernel, "threads": threads, **scene}
            assert (
                call(hs.coordination, points, cutoff, types=types, by_type=True, **how).tolist()
                == expected
            )


def test_queries_need_no_types(rng):
    points, queries = rng.random((80, 3)), rng.random((30, 3)) * 3.0 - 1.0
    queries[:5] = points[:5]
    types = rng.integers(0, 3, 80)
    how = {"queries": queries, "box": [1.0, 1.1, 0.9], "periodic": [True, False, True]}
    table = call(hs.neighbors, points, 0.5, **how)
    counts = call(hs.coordination, points, 0.5, types=types, by_type=True, **how)
    assert counts.tolist() == of_rows(table, types, 3)


CUTOFFS = {("Si", "O"): 0.5, ("O", "O"): 0.3, ("Na", "Na"): 0.0}


def test_a_cutoff_for_each_pair_of_types(rng):
    for indices in (None, [3, 0, 3]):
        points, kinds = rng.random((80, 2)), rng.integers(0, 3, 80)
        how = {"types": NAMES[kinds], "box": [1.0, 1.0], "indices": indices}
        order, places = np.unique(NAMES[kinds], return_inverse=True)
        table = call(hs.neighbors, points, CUTOFFS, **how)
        counts = call(hs.coordination, points, CUTOFFS, by_type=True, **how)
        assert counts.tolist() == of_rows(table, places, len(order))
        assert call(hs.coordination, points, CUTOFFS, **how).tolist() == counts.sum(axis=1).tolist()
        cutoffs = np.array([[0.1, 0.2, 0.5], [0.2, 0.0, 0.3], [0.5, 0.3, 0.4]])
        how["types"] = kinds
        table = call(hs.neighbors, points, cutoffs, **how)
        counts = call(hs.coordination, points, cutoffs, by_type=True, **how)
        assert counts.tolist() == of_rows(table, kinds, 3)
        assert np.array_equal(call(hs.coordination, points, cutoffs, **how), counts.sum(axis=1))


def test_a_cutoff_for_each_pair_of_types_and_queries(rng):
    points, kinds = rng.random((80, 2)), rng.integers(0, 3, 80)
    queries, asking = rng.random((40, 2)), rng.integers(0, 2, 40)
    how = {"queries": queries, "box": [1.0, 1.0], "types": kinds, "query_types": asking}
    cutoffs = np.array([[0.1, 0.2, 0.5], [0.2, 0.0, 0.3], [0.5, 0.3, 0.4]])
    table = call(hs.neighbors, points, cutoffs, **how)
    assert call(hs.coordination, points, cutoffs, by_type=True, **how).tolist() == of_rows(
        table, kinds, 3
    )
    how |= {"types": NAMES[kinds], "query_types": NAMES[asking]}
    order, places = np.unique(NAMES[kinds], return_inverse=True)
    table = call(hs.neighbors, points, CUTOFFS, **how)
    counts = call(hs.coordination, points, CUTOFFS, by_type=True, **how)
    assert counts.tolist() == of_rows(table, places, len(order))


def test_elements_of_an_atoms_object():
    build = pytest.importorskip("ase.build")
    atoms = build.bulk("NaCl", "rocksalt", a=5.64)
    assert hs.coordination(atoms, 4.0, by_type=True).tolist() == [[6, 12], [12, 6]]
    cutoffs = {("Na", "Cl"): 3.0}
    counts = hs.coordination(atoms, cutoffs, by_type=True)
    assert counts.tolist() == [[6, 0], [0, 6]]


def test_nothing_to_count():
    for queries, n_rows in ((None, 0), ([[0.0]], 1)):
        none = np.empty((0, 1))
        assert call(hs.coordination, none, 1.0, types=[], by_type=True, queries=queries).shape == (
            n_rows,
            1,
        )
        empty = np.empty(0, np.str_)
        assert call(
            hs.coordination, none, 1.0, types=empty, by_type=True, queries=queries
        ).shape == (n_rows, 0)
    found = call(hs.coordination, [[0.0]], 1.0, types=["A"], by_type=True, queries=np.empty((0, 1)))
    assert found.shape == (0, 1)
    assert call(hs.coordination, [[0.0]], 1.0, types=["A"], by_type=True).tolist() == [[0]]


REFUSED = {
    "by_type without types": ({"by_type": True}, ValueError, "by_type needs types"),
    "by_type that is no bool": ({"by_type": "yes", "types": [0, 1]}, TypeError, "by_type"),
    "too few": ({"types": [0]}, ValueError, r"shape \(2,\)"),
    "negative types": ({"types": [0, -1]}, ValueError, r"types\[1\] = -1"),
    "bytes": ({"types": [b"A", b"B"]}, TypeError, "integers"),
    "queries and indices": (
        {"types": [0, 1], "queries": [[0.0]], "indices": [0]}, ValueError, "do not give queries",
    ),
    "a negative cutoff": ({"types": [0, 1], "cutoff": -1.0}, ValueError, "cutoff"),
    "a cutoff that is NaN": ({"types": ["A", "B"], "cutoff": np.nan}, ValueError, "cutoff"),
    "no cutoff": ({"types": [0, 1], "cutoff": None}, TypeError, "cutoff"),
    "several cutoffs": ({"types": [0, 1], "cutoff": [1.0, 2.0]}, TypeError, "must be a number"),
}  # fmt: skip


@pytest.mark.parametrize("how, error, text", REFUSED.values(), ids=REFUSED)
def test_what_does_not_go_together_is_refused(how, error, text):
    with pytest.raises(error, match=text):
        call(hs.coordination, [[0.0], [0.5]], **{"cutoff": 1.0, **how})


def test_a_wrong_cutoff_is_refused_for_no_points_too():
    with pytest.raises(ValueError, match="cutoff"):
        call(hs.coordination, np.empty((0, 2)), -1.0, types=[])


def test_counts_beyond_memory_are_refused():
    with pytest.raises(MemoryError, match="types would take"):
        call(hs.coordination, [[0.0], [0.5]], 1.0, types=[0, 2**31 - 2], by_type=True)
