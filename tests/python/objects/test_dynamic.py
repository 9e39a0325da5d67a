# SPDX-License-Identifier: BSD-3-Clause
"""`DynamicCellList`: after any history it answers as a dict and rational arithmetic do."""

import copy
import math
import pickle
import threading
from functools import partial

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

import halfshell as hs
from dynamic_model import Model, check, check_points, keys_of
from refused_calls import check_refusals

STORAGES = ("hash", "dense", "all-pairs")
BOXES = {
    "open": (None, None),
    "periodic": ([4.0, 5.0], None),
    "mixed": ([4.0, 5.0], [False, True]),
    "skewed": ([[4.0, 0.0], [1.5, 5.0]], None),
    "small": ([[1.25, 0.0], [0.25, 1.0]], None),
}


# ---- any history ---------------------------------------------------------------------------

KEYS = st.integers(0, 12)
#: On a grid of eighths, where distances tie with radii.
COORDINATES = st.integers(-16, 64).map(lambda k: k / 8.0) | st.floats(-3.0, 9.0)
POSITIONS = st.tuples(COORDINATES, COORDINATES)
RADII = st.sampled_from([0.0, 0.125, 0.5, math.nextafter(0.5, 1), math.nextafter(0.5, 0), 1.0, 1.5])


class History(RuleBasedStateMachine):
    @initialize(
        storage=st.sampled_from(STORAGES), box=st.sampled_from(list(BOXES)), tagged=st.booleans(),
        inclusive=st.booleans(), cell_size=st.sampled_from([0.4, 0.5, 1.5]),
    )  # fmt: skip
    def begin(self, storage, box, tagged, inclusive, cell_size):
        vectors, periodic = BOXES[box]
        self.tagged = tagged
        self.model = Model(2, vectors, periodic, inclusive)
        self.cells = hs.DynamicCellList(
            2, cell_size, box=vectors, periodic=periodic, storage=storage, max_radius=1.5,
            inclusive=inclusive, tagged=tagged,
        )  # fmt: skip

    def key(self, number):
        return (number % 3 - 1, number) if self.tagged else number

    @rule(key=KEYS, position=POSITIONS)
    def insert(self, key, position):
        self.cells.insert(self.key(key), position)
        self.model.insert(self.key(key), position)

    @rule(key=KEYS, position=POSITIONS)
    def move(self, key, position):
        if self.key(key) in self.model.points:
            self.cells.move(self.key(key), np.array(position))
            self.model.insert(self.key(key), position)
        else:
            with pytest.raises(KeyError):
                self.cells.move(self.key(key), position)

    @rule(key=KEYS)
    def remove(self, key):
        was_there = self.model.points.pop(self.key(key), None) is not None
        assert self.cells.remove(self.key(key)) == was_there

    @rule(rows=st.lists(st.tuples(KEYS, POSITIONS), max_size=8), moves=st.booleans())
    def put_many(self, rows, moves):
        keys, positions = [self.key(key) for key, _ in rows], [x for _, x in rows]
        put = self.cells.move_many if moves else self.cells.insert_many
        if len(set(keys)) < len(keys):
            with pytest.raises(ValueError, match=r"keys must differ, but keys\[\d\] = .* before"):
                put(keys, positions)
        elif moves and not set(keys) <= self.model.points.keys():
            with pytest.raises(KeyError):
                put(keys, positions)
        else:
            put(keys, np.reshape(positions, (-1, 2)))
            for key, position in zip(keys, positions):
                self.model.insert(key, position)

    @rule(keys=st.lists(KEYS, unique=True, max_size=6))
    def remove_many(self, keys):
        keys = [self.key(key) for key in keys]
        removed = self.cells.remove_many(keys)
        assert removed.tolist() == [
            self.model.points.pop(key, None) is not None for key in keys
        ]

    @rule(row=st.integers(0, 2), bad=st.sampled_from([math.nan, math.inf]))
    def refused(self, row, bad):
        positions = np.ones((3, 2))
        positions[row, 1] = bad
        with pytest.raises(ValueError, match=rf"positions\[{row}, 1\] must be finite"):
            self.cells.insert_many([self.key(k) for k in range(3)], positions)
        with pytest.raises(ValueError, match=r"position\[1\] must be finite"):
            self.cells.insert(self.key(0), positions[row])

    @rule(how=st.sampled_from(["copy", "pickle", "deepcopy", "shrink", "clear"]))
    def whole(self, how):
        if how == "clear":
            self.cells.clear()
            self.model.points.clear()
        elif how == "shrink":
            self.cells.shrink_to_fit()
        elif how == "pickle":
            self.cells = pickle.loads(pickle.dumps(self.cells))
        else:
            old, self.cells = self.cells, getattr(copy, how)(self.cells)
            old.clear()

    @rule(position=POSITIONS, radius=RADII)
    def ask(self, position, radius):
        check(self.cells, self.model, position, radius)

    @invariant()
    def same_points(self):
        if hasattr(self, "cells"):
            check_points(self.cells, self.model)


TestHistory = History.TestCase
TestHistory.settings = settings(max_examples=40, stateful_step_count=30, deadline=None)


# ---- radii and cells -----------------------------------------------------------------------


def test_cells_are_those_of_the_original():
    cells = hs.DynamicCellList(3, 2.0)
    cells.insert(0, (-41.5, 18.5, -0.125))
    assert cells.cell(0) == cells.cell_of((-41.5, 18.5, -0.125)) == (-21, 9, -1)


def test_cells_of_positions_that_hold_nothing():
    cells = hs.DynamicCellList(2, 1.0, box=[4.0, 0.0], periodic=[True, False])
    for turns in (0, 1, -3):
        assert cells.cell_of([-1.75 + 4.0 * turns, -0.5]) == (0, -1)
        assert cells.cell_of([1.75 + 4.0 * turns, 7.5]) == (3, 7)
    assert len(cells) == 0 and cells.keys.shape == (0,) and cells.positions.shape == (0, 2)
    assert hs.DynamicCellList(1, 1.0, tagged=True).keys.shape == (0, 2)


def test_cells_come_nearest_first():
    """In each of the places of the centre within its cell: least distance between the cells."""
    cells = hs.DynamicCellList(2, 1.0, max_radius=2.0)
    cells.insert_many(np.arange(49), [(x + 0.5, y + 0.5) for x in range(7) for y in range(7)])
    keys = cells.near([3.5, 3.5], 2.0)
    offsets = np.abs(np.stack([keys // 7 - 3, keys % 7 - 3]))
    least = (np.maximum(offsets - 1, 0) ** 2).sum(axis=0)
    assert (np.diff(least) >= 0).all()
    assert keys[0] == 24
    assert len(keys) == 21  # those at the corners are 1.5 * sqrt(2) away


# ---- bulk, memory, threads -----------------------------------------------------------------


def test_equal_histories_give_equal_orders(rng):
    where = rng.random((400, 2)) * 10
    lists = [hs.DynamicCellList(2, 1.0, box=[10.0, 10.0]) for _ in range(2)]
    for cells in lists:
        cells.insert_many(np.arange(400), where)
        for key in range(0, 400, 3):
            cells.insert(key, where[-key - 1])
            cells.remove((key * 7) % 400)
    assert list(lists[0]) == list(lists[1])
    for x in where[:40]:
        assert np.array_equal(lists[0].near(x, 1.0), lists[1].near(x, 1.0))
        assert np.array_equal(lists[0].within(x, 1.0), lists[1].within(x, 1.0))


def test_memory_follows_the_points(rng):
    cells = hs.DynamicCellList(3, 1.0)
    empty = cells.nbytes
    cells.insert_many(np.arange(10000), rng.normal(scale=1e6, size=(10000, 3)))
    spread = cells.nbytes
    for _ in range(20):
        cells.move_many(np.arange(10000), rng.normal(scale=1e6, size=(10000, 3)))
    assert cells.nbytes < 4 * spread  # cells that were left are used again
    cells.shrink_to_fit()
    assert cells.nbytes <= spread
    cells.remove_many(np.arange(100, 10000))
    cells.shrink_to_fit()
    assert cells.nbytes < spread / 20
    cells.clear()
    assert cells.nbytes == empty


def test_dense_cells_are_bounded():
    cells = hs.DynamicCellList(2, 1.0, storage="dense")
    cells.insert(0, [0.0, 0.0])
    before = cells.nbytes
    with pytest.raises(ValueError, match=r'"dense" would need .* GB .*: use storage="hash"'):
        cells.insert(1, [1e6, 1e6])
    with pytest.raises(ValueError, match='storage="dense" would need'):
        cells.insert_many([1, 2], [[5.0, 5.0], [-1e9, 0.0]])
    assert list(cells) == [0]
    assert cells.nbytes == before
    cells.insert(1, [-1e6, 0.0])  # a line of a million cells
    assert sorted(cells) == [0, 1]


def test_changing_a_list_while_iterating():
    """Before the first key, between two, and after the last."""
    cells = hs.DynamicCellList(1, 1.0)
    for change in (
        lambda: cells.insert(9, [0.0]), lambda: cells.move(9, [1.0]), lambda: cells.remove(9),
        cells.clear,
    ):  # fmt: skip
        cells.insert_many([1, 2, 3], [[0.0], [1.0], [2.0]])
        begun = [iter(cells) for _ in range(3)]
        for keys, n in zip(begun, (0, 1, len(cells))):
            assert len([next(keys) for _ in range(n)]) == n
        change()
        for keys in begun:
            with pytest.raises(RuntimeError, match="changed during iteration"):
                next(keys)
    assert list(cells) == []


def test_threads_ask_while_others_change(rng):
    """Points that stay are always found, whatever the others do."""
    cells = hs.DynamicCellList(2, 1.0, box=[20.0, 20.0])
    fixed = rng.random((200, 2)) * 20
    cells.insert_many(np.arange(200), fixed)
    expected = [set(cells.within(x, 1.0).tolist()) for x in fixed]
    failures, done = [], threading.Event()

    def ask():
        try:
            while not done.is_set():
                offsets, keys = cells.within_many(fixed, 1.0)
                for row in range(200):
                    found = {k for k in keys[offsets[row] : offsets[row + 1]].tolist() if k < 200}
                    assert found == expected[row]
        except BaseException as error:
            failures.append(error)

    def change(first):
        random = np.random.default_rng(first)
        try:
            for _ in range(300):
                cells.insert(first, random.random(2) * 20)
                cells.insert_many(np.arange(first, first + 5), random.random((5, 2)) * 20)
                cells.remove(first + 1)
        except BaseException as error:
            failures.append(error)

    askers = [threading.Thread(target=ask) for _ in range(2)]
    changers = [threading.Thread(target=change, args=(1000 * k,)) for k in (1, 2)]
    for thread in askers + changers:
        thread.start()
    for thread in changers:
        thread.join()
    done.set()
    for thread in askers:
        thread.join()
    assert not failures
    assert len(cells) == 200 + 2 * 4


# ---- refusals ------------------------------------------------------------------------------


def test_bad_lists():
    cases = [
        ((2, 1e-100), ValueError, r"cell_size must be from 2\*\*-300"),
        ((2, 1.0, {"periodic": True}), ValueError, "periodic needs a box"),
        ((2, 1.0, {"box": [1e-4, 1e-4]}), ValueError, "span at most"),
    ]
    check_refusals([
        (partial(hs.DynamicCellList, *some[:2], **(some[2] if some[2:] else {})), *how)
        for some, *how in cases
    ])  # fmt: skip


def test_bad_keys():
    cells = hs.DynamicCellList(2, 1.0)
    for key in (1.0, True, "1", None, (0, 1), np.float64(1), np.bool_(1), [1]):
        calls = [
            partial(cells.insert, key, [0.0, 0.0]), partial(cells.move, key, [0.0, 0.0]),
            partial(cells.remove, key), partial(cells.__contains__, key),
            partial(cells.position, key), partial(cells.cell, key),
        ]  # fmt: skip
        check_refusals([(call, TypeError, "key must be an integer") for call in calls])
    assert len(cells) == 0


class NoInteger:
    def __index__(self):
        raise LookupError("no integer")


@pytest.mark.parametrize("tagged", [False, True])
def test_errors_of_keys_are_the_cause(tagged):
    cells = hs.DynamicCellList(2, 1.0, tagged=tagged)
    for key in ((0, NoInteger()), (NoInteger(), 0)) if tagged else (NoInteger(),):
        for call in (
            lambda key=key: cells.insert(key, [0.0, 0.0]), lambda key=key: cells.remove(key),
            lambda key=key: key in cells, lambda key=key: cells.position(key),
        ):  # fmt: skip
            with pytest.raises(TypeError, match=r"^key cannot be read: NoInteger") as refused:
                call()
            assert isinstance(refused.value.__cause__, LookupError)
    assert len(cells) == 0


def test_keys_of_the_other_kind_and_size():
    tagged = hs.DynamicCellList(1, 1.0, tagged=True)
    for key in (1, (1,), (1, 2, 3), (1.0, 2), (1, True), [1, 2]):
        with pytest.raises(TypeError, match=r"key must be a tuple \(tag, integer\)"):
            tagged.insert(key, [0.0])
    with pytest.raises(OverflowError, match="tag of key must fit int32"):
        tagged.insert((2**31, 0), [0.0])
    with pytest.raises(OverflowError, match="must fit int64"):
        tagged.insert((0, 2**63), [0.0])
    for keys, error, message in (
        ([1], TypeError, "must be integers, got dtype object"),
        ([2, "a", 2**63], OverflowError, "must fit int64, got 9223372036854775808"),
        ([None], TypeError, "must be integers, got dtype object"),
    ):
        with pytest.raises(error, match=message):
            hs.DynamicCellList(1, 1.0).insert_many(np.array(keys, object), [[0.0]] * len(keys))
    tagged.insert((np.int8(-1), np.uint64(5)), [0.0])
    assert list(tagged) == [(-1, 5)]
    with pytest.raises(ValueError, match="keys must have shape"):
        tagged.insert_many([1, 2], [[0.0], [1.0]])
    plain = hs.DynamicCellList(1, 1.0)
    for keys, kind in (([0.5], TypeError), ([True], TypeError), ([2**63], OverflowError),
                       ([[1, 2]], ValueError), (["a"], TypeError)):  # fmt: skip
        with pytest.raises(kind):
            plain.insert_many(keys, [[0.0]])
    plain.insert(-(2**63), [0.0])
    plain.insert(2**63 - 1, [0.0])
    assert sorted(plain) == [-(2**63), 2**63 - 1]


def test_bad_positions_and_radii():
    cells = hs.DynamicCellList(2, 1.0, box=[3.0, 3.0])
    cells.insert(0, [1.0, 1.0])
    for position, kind in (([0.0], ValueError), ([0.0, 0.0, 0.0], ValueError), ("ab", TypeError),
                           ([0.0, math.inf], ValueError), ([[0.0, 0.0]], ValueError),
                           ([1j, 0], TypeError), (None, TypeError),
                           ([1e300, 0], OverflowError)):  # fmt: skip
        with pytest.raises(kind):
            cells.insert(0, position)
    for position in ([0, 1], np.float32([0, 1]), np.array([0.0, 9.0, 1.0])[::2], (0, 1.0)):
        cells.insert(1, position)
        assert cells.position(1).tolist() == [0.0, 1.0]
    for radius in (1.0000001, math.nextafter(1.0, 2.0), -0.5, math.nan, math.inf):
        for call in (cells.near, cells.within, cells.any_within):
            with pytest.raises(ValueError, match=r"radius must be from 0 to max_radius, got .*= 1"):
                call([0.0, 0.0], radius)
    for radius in ("1", None, True, 1j):
        with pytest.raises(TypeError, match="radius must be a number"):
            cells.within([0.0, 0.0], radius)
    for call in (cells.cell_of, partial(cells.near, radius=1.0)):
        with pytest.raises(OverflowError, match=r"position lies 2\*\*51 boxes away, or more"):
            call([1e300, 0.0])
    with pytest.raises(ValueError, match=r"position\[1\] must be finite"):
        cells.cell_of([0.0, math.nan])
    for call in (
        lambda rows: cells.insert_many([2, 3], rows),
        lambda rows: cells.within_many(rows, 1.0),
    ):
        with pytest.raises(OverflowError, match=r"positions\[1\] lies 2\*\*51 boxes away"):
            call([[0.0, 0.0], [0.0, -1e300]])
    assert len(cells.within([1.0, 1.0 + 3.0 * 2.0**40], 0.0)) == 1  # far, but none wants to know S
    for call in (cells.within, lambda one, *rest, **more: cells.within_many([one], *rest, **more)):
        with pytest.raises(OverflowError, match=r"S holds 2\*\*31 boxes"):
            call([1.0, 1.0 + 3.0 * 2.0**40], 0.0, shifts=True)
    with pytest.raises(KeyError):
        cells.any_within([0.0, 0.0], 1.0, skip=7)
    assert cells.position(0).tolist() == [1.0, 1.0]


def test_keys_without_positions():
    cells = hs.DynamicCellList(2, 1.0, storage="all-pairs", tagged=True)
    cells.insert((0, 1), None)
    cells.insert((1, 1), [0.0, 0.0])
    assert sorted(keys_of(cells.near([9.0, 9.0], 0.5))) == [(0, 1), (1, 1)]
    positions = dict(zip(keys_of(cells.keys), cells.positions.tolist(), strict=True))
    assert positions[1, 1] == [0.0, 0.0] and all(map(math.isnan, positions[0, 1]))
    for call in (cells.within, cells.any_within):
        with pytest.raises(ValueError, match="distances need positions"):
            call([0.0, 0.0], 1.0)
    for call in (cells.position, cells.cell):
        with pytest.raises(ValueError, match=r"key \(0, 1\) has no position"):
            call((0, 1))
    again = pickle.loads(pickle.dumps(cells))
    assert sorted(again) == [(0, 1), (1, 1)]
    cells.insert((0, 1), [0.5, 0.0])
    assert len(cells.within([0.0, 0.0], 1.0)) == 2


def test_pickles_of_another_version():
    make, arguments = hs.DynamicCellList(2, 1.0).__reduce__()
    with pytest.raises(ValueError, match="pickled by another version"):
        make(99, *arguments[1:])


@pytest.mark.parametrize("storage", STORAGES)
def test_every_dimension(rng, storage):
    for dim in (1, 2, 3, 5, 8):
        cells = hs.DynamicCellList(dim, 0.5, storage=storage, max_radius=1.0, box=[2.0] * dim,
                                   periodic=[True] + [False] * (dim - 1))  # fmt: skip
        model = Model(dim, [2.0] * dim, [True] + [False] * (dim - 1))
        for key in range(60):
            position = rng.integers(-8, 9, dim) / 8.0
            cells.insert(key, position)
            model.insert(key, position)
        check_points(cells, model)
        for radius in (0.0, 0.3, 0.5, 1.0):
            check(cells, model, rng.integers(-8, 9, dim) / 8.0, radius)


@pytest.mark.parametrize("tagged, good", [(False, 1), (True, (1, 2))])
def test_a_key_to_skip_of_a_wrong_kind_is_called_skip(tagged, good):
    cells = hs.DynamicCellList(2, 1.0, tagged=tagged)
    cells.insert(good, [0.0, 0.0])
    for bad in ("a", 1.5, [1], (1, 2, 3), (1.5, 2), True, np.array(1)):
        with pytest.raises(TypeError, match=r"^skip must be "):
            cells.any_within([0.0, 0.0], 1.0, skip=bad)
        with pytest.raises(TypeError, match=r"^key must be "):
            cells.remove(bad)
    with pytest.raises(OverflowError, match=r"^skip must fit int64|the tag of skip must fit int32"):
        cells.any_within([0.0, 0.0], 1.0, skip=(2**40, 2) if tagged else 2**70)
    assert not cells.any_within([0.0, 0.0], 1.0, skip=good)
