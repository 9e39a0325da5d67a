# SPDX-License-Identifier: BSD-3-Clause
"""Two sets: every query with every point, and how many pairs that makes."""


import numpy as np
import pytest
from ase import Atoms
from ase.build import bulk

import halfshell as hs
from calls import call
from full_lists import assert_last_place, joined, list_between
from oracles import random_scene, same_arrays, triples
from refused_calls import assert_refused

RNG = np.random.default_rng(43)
POINTS = RNG.random((40, 3)) * 4.0
QUERIES = RNG.random((15, 3)) * 5.0 - 0.5
LENGTHS = np.array([4.0, 4.5, 5.0])


def check(queries, points, cutoff, box=None, periodic=None, inclusive=True):
    """Assert that pairs and their number are those of the reference, by every kernel."""
    expected = list_between(queries, points, cutoff, box, periodic, inclusive)
    for kernel in hs.kernels():
        how = {"box": box, "periodic": periodic, "inclusive": inclusive, "kernel": kernel}
        found = call(hs.pairs_between, queries, points, cutoff, quantities="ijS", **how)
        assert triples(*found) == expected
        assert call(hs.count_pairs, points, cutoff, queries=queries, **how) == len(expected)
    return expected


# ---- against rational arithmetic -----------------------------------------------------------


@pytest.mark.parametrize("types", [("f4", "f8"), ("f8", "f4"), ("f4", "f4")])
def test_types_may_be_mixed(types, rng):
    points, cutoff, box, flags = random_scene(rng, 30, neighbours=8, kind="triclinic")
    queries, points = points[:12].astype(types[0]), points[12:].astype(types[1])
    for frame in (box, None):
        check(queries, points, cutoff, frame, flags if frame is box else None)


def test_distances_and_vectors_to_the_last_place(rng):
    for ndim in (1, 2, 3):
        for kernel in hs.kernels():
            points, cutoff, box, _ = random_scene(rng, 40, ndim, "sheared", 8, 2)
            queries, points = points[:15].astype(np.float32), points[15:]
            for frame in (box, None):
                i, j, S, d, D = call(
                    hs.pairs_between,
                    queries,
                    points,
                    cutoff,
                    box=frame,
                    quantities="ijSdD",
                    kernel=kernel,
                )
                found = (i.tolist(), (j + 15).tolist(), S.tolist(), d.tolist(), D.tolist())
                assert_last_place(joined(queries, points), cutoff, frame, found)


def test_queries_far_outside_the_points(rng):
    points, cutoff, box, _ = random_scene(rng, 40, neighbours=8, kind="triclinic")
    near = rng.random((10, 3)) @ box
    far = near + np.array([[10**6, -(10**6), 31]]) @ box
    assert check(far, points, cutoff, box)
    # In open space nobody is there, and it costs no memory to find that out.
    for distance in (1e3, 1e9, 1e300):
        assert hs.count_pairs(points, cutoff, queries=near + distance) == 0
        assert len(hs.pairs_between(near + distance, points, cutoff, quantities="i")) == 0
        mixed = np.concatenate([near + distance, near])
        i, j = hs.pairs_between(mixed, points, cutoff)
        same = hs.pairs_between(near, points, cutoff)
        assert same_arrays((i - 10, j), same)


# ---- other libraries -----------------------------------------------------------------------


def test_atoms_bring_their_box():
    crystal = bulk("Cu", cubic=True) * (2, 2, 2)
    probe = Atoms("H2", positions=[[0.9, 0.9, 0.9], [30.0, -8.0, 1.0]])
    expected = hs.pairs_between(
        probe.positions, crystal.positions, 3.0, box=crystal.cell[:], quantities="ijdDS"
    )
    assert len(expected[0]) > 10
    plain = hs.pairs_between(probe.positions, crystal, 3.0, quantities="ijdDS")
    assert same_arrays(plain, expected)
    assert hs.count_pairs(crystal, 3.0, queries=probe.positions) == len(expected[0])
    within = Atoms("H2", positions=probe.positions, cell=crystal.cell, pbc=True)
    assert same_arrays(hs.pairs_between(within, crystal, 3.0, quantities="ijdDS"), expected)
    how = {"box": crystal.cell[:], "quantities": "ijdDS"}
    assert same_arrays(call(hs.pairs_between, within, crystal.positions, 3.0, **how), expected)
    assert same_arrays(hs.pairs_between(probe, crystal, 3.0, quantities="ijdDS"), expected)
    assert_refused(
        lambda: hs.pairs_between(within, crystal.positions, 3.0), ValueError, "queries bring a box"
    )
    within.cell[0, 0] += 1e-9
    assert_refused(
        lambda: hs.pairs_between(within, crystal, 3.0), ValueError, "queries bring a box"
    )
    assert_refused(
        lambda: hs.pairs_between(within, crystal, 3.0, box=np.eye(3)),
        ValueError,
        "bring their own box",
    )
    open_space = hs.pairs_between(probe, crystal.positions, 3.0)
    assert same_arrays(open_space, hs.pairs_between(probe.positions, crystal.positions, 3.0))


# ---- special scenes ------------------------------------------------------------------------


def test_lists_without_elements_have_the_dimensions_of_the_others():
    for ndim in (1, 2, 3):
        some = np.zeros((4, ndim))
        assert len(hs.pairs_between([], some, 1.0, quantities="D")) == 0
        assert hs.pairs_between(some, [], 1.0, quantities="D").shape == (0, ndim)
        assert hs.pairs_between([], some, 1.0, quantities="D").shape == (0, ndim)
    assert hs.pairs_between([], [], 1.0, quantities="D").shape == (0, 3)


# ---- forms of input and output -------------------------------------------------------------


def test_quantities_and_types():
    for letters in ("i", "j", "d", "D", "S", "P", "PSDdji", "jd", "SP"):
        for dtype in (np.int32, np.int64):
            how = {"box": LENGTHS, "index_dtype": dtype}
            whole = dict(
                zip(
                    "ijdDS", call(hs.pairs_between, QUERIES, POINTS, 1.5, quantities="ijdDS", **how)
                )
            )
            whole["P"] = np.stack((whole["i"], whole["j"]), axis=1)
            found = call(hs.pairs_between, QUERIES, POINTS, 1.5, quantities=letters, **how)
            assert isinstance(found, tuple) == (len(letters) > 1)
            assert same_arrays(found, tuple(whole[letter] for letter in letters))
            arrays = found if isinstance(found, tuple) else (found,)
            assert all(array.flags.writeable and array.flags.c_contiguous for array in arrays)


def test_own_arrays_are_filled():
    found = hs.pairs_between(QUERIES, POINTS, 1.5, quantities="ijd")
    m = len(found[0])
    for room in (m, m + 7):
        out = (np.full(room, -5), np.full(room, -5), np.full(room, -5.0))
        views = hs.pairs_between(QUERIES, POINTS, 1.5, quantities="ijd", out=out)
        assert same_arrays(views, found)
        for view, array in zip(views, out):
            assert np.shares_memory(view, array) and (array[m:] == -5).all()
    small = (np.empty(m - 1, np.int64), np.empty(m, np.int64))
    with pytest.raises(hs.CapacityError, match=f"there are {m} pairs") as caught:
        hs.pairs_between(QUERIES, POINTS, 1.5, out=small)
    assert caught.value.needed == m
    both = np.empty((m, 2), np.int32)
    view = hs.pairs_between(QUERIES, POINTS, 1.5, quantities="P", index_dtype=np.int32, out=both)
    assert np.array_equal(view, np.stack(found[:2], axis=1))


# ---- errors --------------------------------------------------------------------------------

CALLS = {
    "pairs_between": lambda queries, points, cutoff, **how: call(
        hs.pairs_between, queries, points, cutoff, **how
    ),
    "count_pairs": lambda queries, points, cutoff, **how: call(
        hs.count_pairs, points, cutoff, queries=queries, **how
    ),
    "neighbors": lambda queries, points, cutoff, **how: call(
        hs.neighbors, points, cutoff, queries=queries, **how
    ),
    "coordination": lambda queries, points, cutoff, **how: call(
        hs.coordination, points, cutoff, queries=queries, **how
    ),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_other_dimensions_are_refused(call):
    for as_given in (np.asarray, np.ndarray.tolist):
        queries, points = as_given(np.zeros((5, 2))), as_given(np.zeros((10, 3)))
        with pytest.raises(ValueError, match=r"same number of columns.*\(5, 2\) and \(10, 3\)"):
            call(queries, points, 1.0)
    with pytest.raises(ValueError, match=r"\(0, 2\) and \(40, 3\)"):
        call(np.empty((0, 2)), POINTS, 1.0)


def test_two_sets_need_queries():
    for points in (POINTS, POINTS.tolist()):
        assert_refused(
            lambda points=points: hs.pairs_between(None, points, 1.0), TypeError, "queries"
        )
    assert_refused(
        lambda: call(hs.count_pairs, POINTS, 1.0, queries=QUERIES, batch=np.zeros(40, int)),
        ValueError, "points have a batch, and queries have none",
    )  # fmt: skip
    assert_refused(
        lambda: hs.pairs_between(QUERIES, POINTS, 1.0, quantities="x"), ValueError, "i j d D S P"
    )


def test_what_would_not_fit_is_refused(rng):
    queries, points = rng.random((30_000, 3)), rng.random((20_000, 3))
    assert_refused(
        lambda: call(hs.pairs_between, queries, points, 2.0, memory_limit=1e8),
        MemoryError, "6e\\+08 pairs", "100 MB",
    )  # fmt: skip


def test_shifts_that_do_not_fit():
    far = np.array([[0.5], [1e12]])
    for queries, points, name in (
        (far, far[:1], r"queries\[1\] lies"), (far[:1], far, r"queries\[0\] lies .* pairs with")
    ):  # fmt: skip
        assert_refused(
            lambda queries=queries, points=points: hs.pairs_between(
                queries, points, 0.75, box=[1.0], quantities="ijS"
            ),
            OverflowError, name, "box vectors away",
        )  # fmt: skip
    beyond = np.array([[0.0, 0.5], [0.0, 2.0**60]])
    box = [[1.0, 0.0], [0.5, 1.0]]
    for queries, points, name in ((beyond, beyond[:1], "queries"), (beyond[:1], beyond, "points")):
        assert_refused(
            lambda queries=queries, points=points: hs.pairs_between(queries, points, 1.0, box=box),
            OverflowError, rf"{name}\[1\] lies",
        )  # fmt: skip
    assert len(hs.pairs_between(far, far[:1], 0.25, box=[1.0], quantities="ij")[0]) == 1
