# SPDX-License-Identifier: BSD-3-Clause
"""The functions of _core refuse what the Python layer never gives them: there is no other check
between them and memory."""

from functools import partial

import numpy as np
import pytest

import halfshell as hs
from halfshell import _core
from refused_calls import check_refusals

POINTS = np.random.default_rng(3).uniform(0.0, 3.0, (12, 3))
FIRST = np.array([0, 4, 8, 12])
CUTOFFS = np.full(3, 1.5)
BOXES = np.stack([3.0 * np.eye(3)] * 3)
OTHERS = "takes other arguments$"

NO_ARRAYS = [None, 3, 1.5, "points", b"points", POINTS.tolist(), memoryview(POINTS), object()]


def count(points, box=None, periodic=0):
    return _core.count_pairs(
        points, 1.5, box, periodic, True, "exact", None, None, None, None
    )  # fmt: skip


def batch(name, first, cutoffs=1.5, boxes=None, periodic=0):
    of_points = (POINTS, *[None] * 6, first)
    shared = (of_points, cutoffs, boxes, periodic, True, "exact", None, None, None, None)
    return getattr(_core, name)(*shared, *(("ij", False, 8, None) if name == "pairs" else ()))


def points_that_are_none():
    for points in (
        *NO_ARRAYS, *(POINTS.astype(dtype) for dtype in ("i8", "f2", "c16", "O", ">f8", "f16")),
        *(np.zeros(shape) for shape in ((), (3,), (2, 2, 3), (4, 0), (4, 9))),
    ):  # fmt: skip
        yield partial(count, points), TypeError, f"count_pairs {OTHERS}"
        yield partial(_core.box_wrap, points, np.eye(3), 7), TypeError, f"box_wrap {OTHERS}"
        if points is not None:
            queries = (POINTS, 1.5, None, 0, True, "exact", None, None, None, None, points)
            yield partial(_core.coordination, *queries), TypeError, f"coordination {OTHERS}"


def boxes_that_are_none():
    for box in (
        3.0, "box", np.eye(3).tolist(), np.eye(3, dtype=np.float32), np.eye(3, dtype=int),
        np.eye(3).astype(">f8"), np.tri(3).T, np.ones(2), np.ones((3, 2)), np.ones((2, 3)),
        np.float64(3.0), np.ones(()), np.ones((1, 3, 2)), np.ones((1, 3, 3), np.float32),
    ):  # fmt: skip
        yield partial(count, POINTS, box, 7), TypeError, OTHERS
    for arguments in (
        (), (np.eye(3),), (np.eye(3), 7, 7), (None, 7), (np.eye(3).tolist(), 7),
        (np.ones(3), 7), (np.ones((1, 3, 3)), 7), (np.ones(()), 7), (np.eye(0), 1), (np.eye(9), 1),
    ):  # fmt: skip
        yield partial(_core.box_measure, *arguments), TypeError, f"box_measure {OTHERS}"
    for arguments in ((), (POINTS, np.eye(3)), (POINTS, np.eye(3), 7, None), (POINTS, None, 0)):
        yield partial(_core.box_wrap, *arguments), TypeError, f"box_wrap {OTHERS}"
    for bits in (-1, 1 << 64):
        yield partial(count, POINTS, np.eye(3), bits), OverflowError, ""
    yield partial(count, POINTS, np.eye(3), "7"), TypeError, ""


def places_that_are_none():
    for arguments, kind, words in (
        ((), TypeError, f"box_places {OTHERS}"),
        ((POINTS, None, 0, "1", 9.0), TypeError, "must be real number"),
        ((POINTS, None, 0, 1.0, None), TypeError, "must be real number"),
        ((POINTS.tolist(), None, 0, 1.0, 9.0), TypeError, OTHERS),
        ((POINTS, np.eye(2), 7, 1.0, 9.0), TypeError, OTHERS),
        ((POINTS, None, 0, -1.0, 9.0), ValueError, "cutoff must be"),
        ((POINTS, None, 0, 1.0, np.inf), ValueError, "argument"),
        ((POINTS + 10.0, None, 0, 1.0, 9.0), ValueError, "argument"),
    ):
        yield partial(_core.box_places, *arguments), kind, words


def systems_that_are_none():
    """Where they begin is int64, cutoffs and boxes are float64, axes bits; as many of each."""
    eights, one = np.full((3, 1), 7, np.uint8), {"boxes": BOXES, "periodic": 7}
    for name in ("pairs", "count_pairs"):
        for first in (
            FIRST.tolist(), FIRST.astype(np.int32), FIRST.astype(float), FIRST.astype(">i8"),
            np.repeat(FIRST, 2)[::2], FIRST[:0],
        ):  # fmt: skip
            yield partial(batch, name, first), TypeError, OTHERS
        for first in (FIRST[:-1], FIRST[::-1].copy(), FIRST + 1, FIRST * 2**60):
            yield partial(batch, name, first), ValueError, "argument"
        yield partial(batch, name, None, CUTOFFS), TypeError, OTHERS
        for cutoffs in (
            CUTOFFS.astype(np.float32), CUTOFFS.astype(int), CUTOFFS.astype(">f8"),
            CUTOFFS[:, None], np.repeat(CUTOFFS, 2)[::2], CUTOFFS.tolist(), "1.5", None,
        ):  # fmt: skip
            yield partial(batch, name, FIRST, cutoffs), TypeError, OTHERS
        for boxes in (
            BOXES.astype(np.float32), np.tri(3) + BOXES.T, BOXES[:, ::-1], BOXES[:, :2, :2],
        ):  # fmt: skip
            yield partial(batch, name, FIRST, **(one | {"boxes": boxes})), TypeError, OTHERS
        for axes in (np.full(3, 7), eights, np.full(6, 7, np.uint8)[::2]):
            yield partial(batch, name, FIRST, **(one | {"periodic": axes})), TypeError, OTHERS
        for axes in (7, np.full(3, 7, np.uint8), np.full(2, 7, np.uint8)):
            yield partial(batch, name, FIRST, CUTOFFS[:2], BOXES, axes), TypeError, OTHERS
    yield partial(count, (POINTS, FIRST)), TypeError, OTHERS


@pytest.mark.parametrize(
    "kind",
    [points_that_are_none, boxes_that_are_none, places_that_are_none, systems_that_are_none],
    ids=lambda kind: kind.__name__,
)
def test_what_has_another_type_or_shape_is_refused(kind):
    check_refusals(list(kind()))


def test_systems_that_fit_are_taken():
    for name in ("pairs", "count_pairs"):
        assert len(batch(name, FIRST, CUTOFFS, BOXES, 7)) > 0


class Shrinks:
    """A number that makes an array shorter, and gives its memory back, when it is read."""

    def __init__(self, array, value):
        self.array = array
        self.value = value

    def read(self):
        self.array.resize((2, *self.array.shape[1:]), refcheck=False)
        return self.value

    __index__ = __float__ = __bool__ = read


def shared(inclusive=True, threads=None):
    return (0.0, None, 0, inclusive, "exact", None, None, None, threads)


# What users give as threads may run code of theirs: it is read before arrays are looked at.
WITH_THREADS = {
    "neighbors": lambda p, n: len(hs.neighbors(p, 0.01, threads=n)),
    "nearest": lambda p, n: len(hs.nearest(p, 1, threads=n)[0]),
    "coordination": lambda p, n: len(hs.coordination(p, 0.01, threads=n)),
    "CellList": lambda p, n: len(hs.CellList(p, 0.01, threads=n).order),
}


@pytest.mark.parametrize("name", WITH_THREADS)
def test_numbers_are_read_before_arrays_are_looked_at(name):
    points = np.random.default_rng(5).random((20_000, 3))
    assert WITH_THREADS[name](points, Shrinks(points, 2)) == 2
    assert len(points) == 2


# Numbers are those of Python: nothing runs while they are read.
OF_PYTHON = {
    "coordination": lambda p, n: _core.coordination(p, *shared(threads=n)),
    "neighbors": lambda p, n: _core.neighbors(p, *shared(), "j", n, None),
    "explain": lambda p, n: _core.explain(p, *shared(), "ij", False, 8, n),
    "histogram": lambda p, n: _core.histogram(p, *shared(), np.array([0.0, 9.0]), True, None, n),
    "iter_pairs": lambda p, n: _core.iter_pairs(p, *shared(), "i", 8, n),
    "nearest": lambda p, n: _core.nearest(p, *shared(), "j", 8, None, n),
    "pairs": lambda p, n: _core.pairs(p, *shared(), "i", n, 8, None),
    "count_pairs": lambda p, n: _core.count_pairs(p, *shared(inclusive=n)),
    "cells_build": lambda p, n: _core.cells_build(p, *shared(), n, None),
    "verlet_update": lambda p, n: _core.verlet_update(p, *shared(), _core.verlet_new(), n, False),
}


@pytest.mark.parametrize("name", OF_PYTHON)
def test_numbers_are_those_of_python(name):
    points = POINTS.copy()
    with pytest.raises(TypeError, match=f"{name} {OTHERS}"):
        OF_PYTHON[name](points, Shrinks(points, 1))
    assert len(points) == len(POINTS)
