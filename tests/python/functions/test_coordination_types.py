# SPDX-License-Identifier: BSD-3-Clause
"""Neighbours counted by type, against the rows of the full list."""


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
    "cutoffs that descend": ({"types": [0, 1], "cutoff": [2.0, 1.0]}, ValueError, "ascending"),
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
