# SPDX-License-Identifier: BSD-3-Clause
"""The functions of _core refuse what the Python layer never gives them: there is no other check
between them and memory."""

import re

import numpy as np
import pytest

from halfshell import _core

POINTS = np.random.default_rng(3).uniform(0.0, 3.0, (12, 3))
BATCH = np.repeat(np.arange(3), 4)
CUTOFFS = np.full(3, 1.5)
BOXES = np.stack([3.0 * np.eye(3)] * 3)

NO_ARRAYS = [None, 3, 1.5, "points", b"points", (), POINTS.tolist(), memoryview(POINTS), object()]


def count(points, box=None, periodic=0):
    return _core.count_pairs(
        points, 1.5, box, periodic, True, "exact", None, None, None, None
    )  # fmt: skip


def batch(name, numbers, cutoffs=None, boxes=None, box=None, periodic=0):
    shared = (POINTS, 1.5, box, periodic, True, "exact", None, None, None, None)
    own = numbers, cutoffs, boxes, None, None
    if name == "pairs":
        return _core.pairs(*shared, "ij", False, 8, None, None, "auto", None, None, own)
    return _core.count_pairs(*shared, None, "auto", None, own)


def refuse_points(points):
    message = f"points must be an array, got {type(points).__name__}"
    with pytest.raises(TypeError, match=re.escape(message)):
        count(points)
    if points is not None:
        with pytest.raises(TypeError, match="queries must be an array, got"):
            _core.coordination(
                POINTS, 1.5, None, 0, True, "exact", None, None, None, None, points
            )  # fmt: skip
    with pytest.raises(TypeError, match="points must be an array, got"):
        _core.box_wrap(points, np.eye(3), 7)


def test_points_are_an_array():
    for points in NO_ARRAYS:
        refuse_points(points)


def test_points_are_native_floats():
    for dtype in ("i8", "f2", "c16", "O", ">f8", "f16"):
        with pytest.raises(TypeError, match="points must be native float32 or float64"):
            count(POINTS.astype(dtype))


def test_points_are_rows_of_1_to_8_numbers():
    for shape in ((), (3,), (2, 2, 3), (4, 0), (4, 9)):
        with pytest.raises(ValueError, match=r"points must have shape \(n, d\)"):
            count(np.zeros(shape))


def test_a_box_is_an_array_of_its_size():
    for box in (
        3.0, "box", np.eye(3).tolist(), np.eye(3, dtype=np.float32), np.eye(3, dtype=int),
        np.eye(3).astype(">f8"), np.tri(3).T, np.ones(2), np.ones((3, 2)), np.ones((2, 3)),
        np.ones((3, 3, 3)), np.float64(3.0), np.ones(()),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"box must be a float64 array of shape \(3, 3\)"):
            count(POINTS, box, 7)


def test_what_is_measured_is_a_square_box_and_bits():
    for arguments in (
        (), (np.eye(3),), (np.eye(3), 7, 7), (None, 7), (np.eye(3).tolist(), 7),
        (np.ones(3), 7), (np.ones((1, 3, 3)), 7), (np.ones(()), 7),
    ):  # fmt: skip
        with pytest.raises(TypeError, match=r"box_measure takes a box \(d, d\) and periodic bits"):
            _core.box_measure(*arguments)


def test_a_box_to_be_measured_has_1_to_8_dimensions():
    for d in (0, 9):
        with pytest.raises(ValueError, match=r"box must have shape \(d, d\) with 1 <= d <= 8"):
            _core.box_measure(np.eye(d), 1)


@pytest.mark.parametrize("arguments", [(), (POINTS, np.eye(3)), (POINTS, np.eye(3), 7, None)])
def test_wrapping_takes_three_arguments(arguments):
    with pytest.raises(TypeError, match="box_wrap takes points, a box and periodic bits"):
        _core.box_wrap(*arguments)
    with pytest.raises(TypeError, match="box_wrap needs a box"):
        _core.box_wrap(POINTS, None, 0)


@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        ((), TypeError, "box_places takes points, a box, periodic bits, a cutoff and the largest"),
        ((POINTS, None, 0, "1", 9.0), TypeError, "must be real number"),
        ((POINTS, None, 0, 1.0, None), TypeError, "must be real number"),
        ((POINTS.tolist(), None, 0, 1.0, 9.0), TypeError, "points must be an array"),
        ((POINTS, np.eye(2), 7, 1.0, 9.0), ValueError, "box must be a float64 array"),
        ((POINTS, None, 0, -1.0, 9.0), ValueError, "cutoff must be"),
        ((POINTS, None, 0, 1.0, np.inf), ValueError, "argument"),
        ((POINTS + 10.0, None, 0, 1.0, 9.0), ValueError, "argument"),
    ],
)
def test_what_places_are_told_by(arguments, kind, words):
    with pytest.raises(kind, match=words):
        _core.box_places(*arguments)


@pytest.mark.parametrize("periodic", [-1, 1 << 64])
def test_periodic_is_bits(periodic):
    with pytest.raises(OverflowError):
        count(POINTS, np.eye(3), periodic)
    with pytest.raises(TypeError):
        count(POINTS, np.eye(3), "7")


@pytest.mark.parametrize("name", ["pairs", "count_pairs"])
def test_numbers_are_int64_one_a_point(name):
    for numbers in (
        None, BATCH.tolist(), BATCH.astype(np.int32), BATCH.astype(float), BATCH.astype(">i8"),
        BATCH[:-1], np.repeat(BATCH, 2)[::2],
    ):  # fmt: skip
        with pytest.raises(TypeError, match="batch must be an int64 array with a number for each"):
            batch(name, numbers)


@pytest.mark.parametrize("name", ["pairs", "count_pairs"])
def test_cutoffs_are_float64(name):
    for cutoffs in (
        1.5, CUTOFFS.tolist(), CUTOFFS.astype(np.float32), CUTOFFS.astype(int),
        CUTOFFS.astype(">f8"), CUTOFFS[:, None], np.repeat(CUTOFFS, 2)[::2], np.float64(1.5),
    ):  # fmt: skip
        with pytest.raises(TypeError, match="a float64 array with 1 axes is expected"):
            batch(name, BATCH, cutoffs)


@pytest.mark.parametrize("name", ["pairs", "count_pairs"])
def test_boxes_are_float64(name):
    for boxes in (
        3.0, BOXES.tolist(), BOXES.astype(np.float32), BOXES[0], BOXES[None], np.tri(3) + BOXES.T,
        BOXES[:, ::-1],
    ):  # fmt: skip
        with pytest.raises(TypeError, match="a float64 array with 3 axes is expected"):
            batch(name, BATCH, None, boxes, np.eye(3), 7)


@pytest.mark.parametrize("name", ["pairs", "count_pairs"])
def test_boxes_fit(name):
    for boxes, cutoffs, box in [
        (BOXES, None, None),
        (BOXES[:, :2, :2].copy(), None, np.eye(3)),
        (np.ones((3, 3, 2)), None, np.eye(3)),
        (np.ones((3, 2, 3)), None, np.eye(3)),
        (BOXES[:2], CUTOFFS, np.eye(3)),
    ]:
        with pytest.raises(ValueError, match="boxes do not fit points, box and cutoffs"):
            batch(name, BATCH, cutoffs, boxes, box, 0 if box is None else 7)
    assert len(batch(name, BATCH, CUTOFFS, BOXES, np.eye(3), 7)) > 0


class Shrinks:
    """A number that makes an array shorter, and gives its memory back, when it is read."""

    def __init__(self, array, value):
        self.array = array
        self.value = value

    def read(self):
        self.array.resize((2, *self.array.shape[1:]), refcheck=False)
        return self.value

    __index__ = __float__ = __bool__ = read


SHARED = (True, "exact", None, None, None, None)

# How a function is called with its number, and how long what it returns is for two points.
WITH_NUMBERS = {
    "neighbors": (8, lambda p, n: _core.neighbors(p, 9.0, None, 0, *SHARED, "j", n, None), 2),
    "explain": (
        True, lambda p, n: _core.explain(p, 9.0, None, 0, *SHARED, "ij", False, 8, n)["pairs"], 1,
    ),
    "histogram": (
        1,
        lambda p, n: int(_core.histogram(
            p, 0.0, None, 0, *SHARED, np.array([0.0, 9.0]), True, None, n, *[None] * 4
        ).sum()),
        1,
    ),
    "iter_pairs": (
        5, lambda p, n: sum(len(i) for i in _core.iter_pairs(
            p, 9.0, None, 0, *SHARED, "i", 8, n
        )), 1,
    ),
    "nearest": (1, lambda p, n: len(_core.nearest(p, 9.0, None, 0, *SHARED, "j", 8, None, n)), 2),
    "pairs": (False, lambda p, n: len(_core.pairs(p, 9.0, None, 0, *SHARED, "i", n, 8, None)), 1),
    "inclusive": (
        True, lambda p, n: _core.count_pairs(p, 9.0, None, 0, n, *SHARED[1:]), 1,
    ),
    "cells": (
        1.0, lambda p, n: len(_core.cells_layout(
            _core.cells_build(p, 9.0, None, 0, *SHARED, n, None)
        )["order"]), 2,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WITH_NUMBERS)
def test_numbers_are_read_before_arrays_are_looked_at(name):
    value, call, expected = WITH_NUMBERS[name]
    points = np.random.default_rng(5).random((20_000, 3))
    found = call(points, Shrinks(points, value))
    assert len(points) == 2
    assert (len(found[0]) - 1 if name == "neighbors" else found) == expected


def test_the_skin_is_read_before_the_points():
    points = np.random.default_rng(5).random((20_000, 3))
    pair_list = _core.verlet_new()
    skin = Shrinks(points, 0.5)
    assert _core.verlet_update(pair_list, points, 0.1, None, 0, *SHARED, skin, False)
    assert _core.verlet_look(pair_list)["n_points"] == 2
