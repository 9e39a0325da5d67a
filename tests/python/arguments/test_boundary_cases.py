# SPDX-License-Identifier: BSD-3-Clause
"""What fuzzing the arguments found, each by name; objects that change arrays; nothing is kept."""

import gc
import sys

import numpy as np
import pytest

import boundary
import halfshell as hs
from boundary import CUBE, POINTS, answering, as_if_atoms, outcome, raising
from calls import call

MINE = RuntimeError("mine")


def refusal(kind, call, *arguments, **options):
    """The message of an error of exactly this kind."""
    result = outcome(call, *arguments, **options)
    assert type(result.error) is kind, f"{type(result.error).__name__}: {result.message}"
    return result.message


# ---- wrong answers and refusals of what is right -------------------------------------------


def test_points_of_an_object_that_has_positions_but_no_box():
    points = answering(
        positions=np.zeros((9, 9)), __array__=lambda self, dtype=None, copy=None: POINTS
    )
    boxes = np.array([CUBE] * 2)
    expected = call(hs.count_pairs, POINTS, 0.5, box=boxes, batch=[0, 0, 1, 1]).tolist()
    assert call(hs.count_pairs, points, 0.5, box=boxes, batch=[0, 0, 1, 1]).tolist() == expected


def test_periodic_of_atoms_is_checked_like_any_other():
    atoms_of_points = as_if_atoms(POINTS, CUBE, True)
    for pbc in ("TTT", [0.5, 1.0, 1.0], [True], None):
        atoms = as_if_atoms(POINTS, CUBE, pbc)
        result = outcome(hs.pairs, atoms, 0.5)
        assert result.error is None if pbc is None else "periodic" in result.message
        assert result.error is None or "of points" in result.message
        result = outcome(hs.pairs_between, atoms, atoms_of_points, 0.5)
        assert pbc is None or "of queries: periodic" in result.message
    for cell in (10**400, "a cube", np.full((2, 2), np.nan)):
        result = outcome(hs.nearest, POINTS, 1, queries=as_if_atoms(POINTS, cell, True))
        assert "of queries: box" in result.message


def test_numbers_in_lists_are_what_they_are_and_not_what_they_say():
    lying = answering(float, __float__=lambda self: 7.0)
    assert hs.pairs([[lying], [2**70]], 0.5, quantities="d").tolist() == []
    assert hs.pairs(np.array([[lying], [0]], object), 0.0, quantities="d").tolist() == [0.0]
    assert hs.count_pairs(POINTS, answering(float, __float__=lambda self: 9.0)) == hs.count_pairs(
        POINTS, 0.0
    )


def test_views_of_out_are_arrays_whatever_out_is():
    out = np.zeros(20, np.int64).view(boundary.Subclass)  # which has no items
    expected = hs.pairs(POINTS, 1.0, quantities="i")
    found = hs.pairs(POINTS, 1.0, quantities="i", out=out)
    assert type(found) is np.ndarray and found.base is not None
    assert found.tolist() == expected.tolist()
    assert np.shares_memory(found, out)
    wide = np.zeros((20, 3))
    found = hs.pairs(POINTS, 1.0, quantities="D", out=wide)
    assert np.shares_memory(found, wide) and found.shape == (len(expected), 3)


# ---- exceptions that were not documented ---------------------------------------------------


def test_the_smallest_angles_make_no_cell():
    for angle in (5e-324, 1e-320, 1e-308, 1e-155):
        message = refusal(ValueError, hs.Box.from_lengths_angles, [1.0] * 3, [angle] * 3)
        assert "angles" in message


def test_a_batch_with_too_many_systems_to_count():
    for number in (2**50, 2**61, 2**62 - 1):
        batch = np.full(4, number)
        assert "batch" in refusal(MemoryError, call, hs.count_pairs, POINTS, 1.0, batch=batch)
        assert len(call(hs.pairs, POINTS, 1.0, batch=batch)) == 2


# ---- calls that took their time ------------------------------------------------------------


def test_views_too_large_to_convert_are_refused_before_they_are():
    flat = np.broadcast_to(np.int8(1), (2**31 - 1, 8))
    assert "points" in refusal(MemoryError, hs.pairs, flat, 1.0)
    many = np.broadcast_to(np.float32(1), (2**45,))
    assert "cutoff" in refusal(MemoryError, hs.count_pairs, POINTS, many)
    assert "cutoff" in refusal(MemoryError, call, hs.count_pairs, POINTS, many, batch=[0] * 4)
    boxes = np.broadcast_to(CUBE, (2**45, 3, 3))
    assert "box" in refusal(MemoryError, call, hs.pairs, POINTS, 1.0, box=boxes, batch=[0] * 4)
    flags = np.broadcast_to(True, (2**40,))
    assert "periodic" in refusal(ValueError, hs.pairs, POINTS, 1.0, box=CUBE, periodic=flags)


def test_a_cutoff_that_spans_any_number_of_boxes_is_refused_at_once():
    for axes in [(0, 1), (0, 2), (1, 2), (2,), (0, 1, 2)]:
        for cutoff in (1e8, 2.0**31, 1e12, 1e100):
            box = np.array([[2.0, 0.0, 0.0], [0.5, 2.0, 0.0], [0.25, -0.5, 2.0]])
            scene = {"box": box, "periodic": [axis in axes for axis in range(3)]}
            for search in (hs.pairs, hs.explain):
                if len(axes) > 1 or cutoff > 1e9:  # along a chain 10^9 pairs may well fit
                    refusal(MemoryError, call, search, POINTS, cutoff, **scene, memory_limit=1e10)
                if len(axes) > 1:
                    refusal(MemoryError, search, POINTS, cutoff, **scene)
            refusal(MemoryError, hs.verify, POINTS, 1e100, [], [], **scene)


# ---- arrays that other arguments change ----------------------------------------------------


def give_up_memory(array):
    array.resize((0, 3), refcheck=False)


def change_shape(array):
    array.shape = (3, 4)


def write(array):
    array[:] = np.nan


def change_dtype(array):
    array.dtype = np.int64


CHANGES = (give_up_memory, change_shape, write, change_dtype)
TRIGGERS = {
    "threads": lambda act: answering(__index__=lambda self: act() or 1),
    "memory_limit": lambda act: answering(__index__=lambda self: act() or 10**9),
    "cutoff": lambda act: answering(__array__=lambda self, *a, **k: act() or np.array(0.5)),
    "box": lambda act: answering(__array__=lambda self, *a, **k: act() or CUBE),
    "periodic": lambda act: answering(__array__=lambda self, *a, **k: act() or np.array(True)),
    "batch": lambda act: answering(__array__=lambda self, *a, **k: act() or np.zeros(4, int)),
    "kernel": lambda act: answering(str, __str__=lambda self: act() or "scalar"),
}


@pytest.mark.filterwarnings("ignore:Setting the shape:DeprecationWarning")
@pytest.mark.filterwarnings("ignore:Setting the dtype:DeprecationWarning")
@pytest.mark.parametrize("change", CHANGES)
def test_an_argument_that_changes_the_points(change):
    for name in TRIGGERS:
        for search in (hs.pairs, hs.count_pairs, hs.explain, hs.verify):
            for batch in ([0, 0, 1, 1], None):
                points = np.arange(12.0).reshape(4, 3) / 8
                options = {"points": points, "cutoff": 0.5, "box": CUBE}
                if search is hs.verify:
                    options |= {"i": [], "j": []}
                elif search is not hs.explain:
                    options["batch"] = batch
                if search is hs.verify and name not in ("cutoff", "box", "periodic"):
                    continue
                if name == "batch" and search is hs.explain:
                    continue
                options[name] = TRIGGERS[name](lambda points=points: change(points))
                try:
                    call(search, **options)
                except (TypeError, ValueError):
                    pass


# ---- nothing is kept -----------------------------------------------------------------------

FAILING = {
    "points": lambda points, box: hs.pairs(points[0], 1.0),
    "nan": lambda points, box: hs.pairs(points * np.nan, 1.0),
    "cutoff": lambda points, box: hs.pairs(points, -1.0, box=box),
    "box": lambda points, box: hs.pairs(points, 1.0, box=box[:2]),
    "surrogate": lambda points, box: hs.pairs(points, 1.0, box=box, quantities="\ud800"),
    "kernel": lambda points, box: call(hs.pairs, points, 1.0, box=box, kernel="x"),
    "precision": lambda points, box: call(hs.pairs, points, 1.0, box=box, precision=object()),
    "threads": lambda points, box: hs.pairs(points, 1.0, threads=raising(("__index__",), MINE)),
    "limit": lambda points, box: call(hs.count_pairs, points, 1.0, memory_limit=1),
    "wordless": lambda points, box: call(
        hs.pairs, points, 1.0, precision=raising(("__repr__",), MINE)
    ),
    "capacity": lambda points, box: hs.pairs(points, 1.0, out=(np.zeros(1, int),) * 2),
    "batch": lambda points, box: call(hs.pairs, points, 1.0, box=box, batch=[1, 0, 0, 0]),
    "counts": lambda points, box: call(hs.count_pairs, points, 1.0, batch=[0, 0, 0, 2**61]),
    "verify": lambda points, box: hs.verify(points, 1.0, [9], [0], box=box),
    "wrap": lambda points, box: hs.Box(box).wrap(points * 1e300),
}


def assert_keeps_nothing(call, kept):
    """`kept` counts references of the arguments, and blocks of memory."""
    for _ in range(600):  # until what CPython keeps for objects to come is full
        call()
    growth = []
    for _ in range(3):  # others of the process may grow meanwhile, but not each time
        before = kept()
        for _ in range(300):
            call()
        after = kept()
        assert after[0] == before[0]
        growth.append(after[1] - before[1])
    assert min(growth) < 100  # an object lost in each call would be 300


@pytest.mark.parametrize("name", FAILING)
def test_a_call_that_fails_keeps_nothing(name):
    points, box = POINTS.copy(), CUBE.copy()

    def fail():
        try:
            FAILING[name](points, box)
        except (TypeError, ValueError, OverflowError, MemoryError) as error:
            error.__cause__ = error.__context__ = None
            return
        raise AssertionError("no error")

    def kept():
        MINE.__traceback__ = None  # it is raised again and again
        gc.collect()
        return [sys.getrefcount(x) for x in (points, box)], sys.getallocatedblocks()

    assert_keeps_nothing(fail, kept)
