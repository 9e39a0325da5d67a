# SPDX-License-Identifier: BSD-3-Clause
"""Dynamic cell lists in boxes of any shape and at any scale, against every image in fractions."""

import copy
import math
import pickle
import threading
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from rational_images import Images, between, exact


class Scene:
    """A random list, and the positions that it must hold."""

    def __init__(self, seed):
        rng = self.rng = np.random.default_rng(seed)
        self.dim = dim = int(rng.choice([1, 2, 2, 2, 3, 3, 3, 4]))
        exponent = int(rng.choice([0, 0, 0, 1, -30, 200, -285]))
        self.scale = math.ldexp(float(rng.choice([1.0, 0.7, 1 / 3])), exponent)
        self.box, self.periodic = self._box()
        self.cell_size = self.scale * float(rng.choice([1.0, 0.5, 0.3, 2.0, 1 / 3]))
        times = float(rng.choice([0.3, 1.0, 2.5, 7.0]) if dim == 1 else rng.choice([0.3, 1.0, 1.5]))
        self.inclusive, self.tagged = bool(rng.integers(2)), bool(rng.integers(2))
        self.cells = hs.DynamicCellList(
            dim, self.cell_size, box=self.box, periodic=self.periodic,
            storage=str(rng.choice(["hash", "dense", "all-pairs"])),
            max_radius=self.cell_size * times, inclusive=self.inclusive, tagged=self.tagged,
        )  # fmt: skip
        self.images = Images(dim, self.box, self.periodic)
        self.held = {}
        extremes = [-(2**63), 2**63 - 1, 2**32, 0, 1, 2, 3, 4]
        tags = [0, -(2**31), 2**31 - 1]
        pairs = [(tag, key) for tag in tags for key in extremes]
        self.keys = pairs if self.tagged else extremes

    def _box(self):
        """Aligned, skewed or turned around; zero rows where it does not repeat."""
        rng, dim, kind = self.rng, self.dim, self.rng.integers(4)
        if kind == 0:
            return None, None
        rows = np.diag(rng.choice([0.75, 1.0, 1.5, 3.0], dim))
        if kind > 1:
            rows += np.tril(rng.choice([0.0, 0.25, -0.5, 1.0, -1.7], (dim, dim)), -1)
        if kind == 3 and dim > 1:
            one, other = rng.choice(dim, 2, replace=False)
            rows[one] += rng.choice([3.0, -7.0, 50.0, 1000.0]) * rows[other]
            rows = -rows[rng.permutation(dim)]
        periodic = rng.random(dim) < 0.75
        rows[~periodic] = 0.0
        return rows * self.scale, periodic

    def place(self):
        """On corners of cells and about them, subnormal numbers, outliers."""
        rng, dim, kind = self.rng, self.dim, self.rng.integers(6)
        x = self.cell_size * rng.integers(-24, 25, dim) / (8.0 if kind < 2 else 1.0)
        if kind == 3:
            x[rng.integers(dim)] = rng.choice([-0.0, 5e-324, -5e-324, 1e-310])
        elif kind == 4:
            x = rng.normal(size=dim) * self.scale * 3.0
        elif kind == 5 and rng.random() < 0.3:
            x[rng.integers(dim)] = 1.7e308 if self.box is None else self.scale * 2.0**15
        return np.where(rng.random(dim) < 0.3, np.nextafter(x, rng.choice([-1e300, 1e300])), x)

    def radius(self, position):
        """Multiples of the width, distances of points, and a hair beside either."""
        rng, most = self.rng, self.cells.max_radius
        r = self.cell_size * float(rng.integers(0, 4))
        if rng.random() < 0.3 and self.held:
            other = list(self.held.values())[rng.integers(len(self.held))]
            with np.errstate(over="ignore"):
                r = float(np.sqrt(((other - position) ** 2).sum()))
        r = rng.choice([r, math.nextafter(r, math.inf), math.nextafter(r, 0.0), 5e-324, most])
        return min(float(r), most)

    def change(self):
        """One change; a refusal must leave everything as it was."""
        rng, cells = self.rng, self.cells
        some = [self.keys[k] for k in rng.permutation(len(self.keys))[: rng.integers(1, 7)]]
        places = [self.place() for _ in some]
        kind = rng.integers(8)
        try:
            if kind < 3:
                cells.insert(some[0], places[0])
                self.held[some[0]] = places[0]
            elif kind < 5:
                cells.insert_many(some, places)
                self.held.update(zip(some, places))
            elif kind == 5:
                there = [key in self.held for key in some]
                assert cells.remove_many(some).tolist() == there
                for key in some:
                    self.held.pop(key, None)
            elif kind == 6:
                self.cells = [pickle.loads(pickle.dumps(cells)), copy.copy(cells)][rng.integers(2)]
            else:
                cells.shrink_to_fit()
        except ValueError as error:
            assert "GB" in str(error) or "box" in str(error)

    def check(self):
        cells, rng = self.cells, self.rng
        assert sorted(cells) == sorted(self.held)
        for key, position in self.held.items():
            assert cells.position(key).tobytes() == position.tobytes()
        at = self.place()
        if self.held and rng.random() < 0.7:
            at = list(self.held.values())[rng.integers(len(self.held))]
            if self.box is not None:
                at = at + (rng.integers(-2, 3, self.dim) * self.periodic) @ self.box
        r = self.radius(at)
        expected = {
            (key, S)
            for key, x in self.held.items()
            for S, _, _ in self.images.within(
                between(exact(at), exact(x)), Fraction(r) ** 2, self.inclusive
            )
        }
        keys, shifts = cells.within(at, r, shifts=True)
        keys = [tuple(key) if self.tagged else key for key in keys.tolist()]
        found = list(zip(keys, map(tuple, shifts.tolist())))
        assert len(found) == len(expected) and set(found) == expected
        near = [tuple(key) if self.tagged else key for key in cells.near(at, r).tolist()]
        assert len(near) == len(set(near)) and {key for key, _ in expected} <= set(near)
        assert cells.any_within(at, r) == bool(expected)
        for key in list(self.held)[:3]:
            others = expected - {(key, (0,) * self.dim)}
            assert cells.any_within(at, r, skip=key) == bool(others)


# The cells of seed 28 cover a large space and are all stored, which takes seconds.
@pytest.mark.parametrize("seed", [*range(28), pytest.param(28, marks=pytest.mark.slow), 29])
def test_any_box_any_scale_any_history(seed):
    scene = Scene(seed)
    for step in range(30):
        scene.change()
        if step % 5 == 4:
            scene.check()


def test_a_query_costs_no_more_than_the_points_there_are():
    """However many cells the ball could meet."""
    for storage in ("hash", "dense", "all-pairs"):
        for dim, radius in ((8, 10.0), (6, 20.0), (3, 1e5), (1, 1e15), (3, 1e80)):
            cells = hs.DynamicCellList(dim, 1.0, max_radius=radius, storage=storage)
            cells.insert_many(np.arange(9), np.full((9, dim), 0.5))
            assert len(cells.within(np.zeros(dim), radius)) == 9
            assert not cells.any_within(np.full(dim, 3.0 * radius), radius)


def test_iteration_notices_changes_before_the_first_key_and_after_the_last():
    cells = hs.DynamicCellList(1, 1.0)
    cells.insert_many([1, 2], [[0.0], [1.0]])
    not_begun, at_the_end = iter(cells), iter(cells)
    assert {next(at_the_end), next(at_the_end)} == {1, 2}
    cells.insert(3, [0.0])
    for keys in (not_begun, at_the_end):
        with pytest.raises(RuntimeError, match="changed during iteration"):
            next(keys)
    with pytest.raises(RuntimeError, match="changed during iteration"):
        for key in cells:
            cells.remove(key)
    assert len(cells) == 2
    cells.clear()
    assert list(cells) == []


@pytest.mark.parametrize("tagged", [False, True])
def test_iteration_goes_through_many_blocks_of_keys(tagged):
    cells = hs.DynamicCellList(1, 1.0, tagged=tagged)
    n = 5000
    keys = [(k % 3, k) for k in range(n)] if tagged else list(range(n))
    cells.insert_many(keys, np.zeros((n, 1)))
    assert sorted(cells) == sorted(keys)


def test_the_representation_has_axes_in_order():
    cells = hs.DynamicCellList(3, 1.0, box=[9.0, 9.0, 9.0], periodic=[True, False, False])
    assert "periodic along 0" in repr(cells)


def test_a_pickle_is_of_one_moment():
    """Other threads may change the list while it is pickled."""
    cells, done = hs.DynamicCellList(1, 1.0), threading.Event()
    keys = np.arange(200)

    def toggle():
        while not done.is_set():
            cells.insert_many(keys, np.zeros((200, 1)))
            cells.remove_many(keys)

    thread = threading.Thread(target=toggle)
    thread.start()
    try:
        for _ in range(100):
            assert len(pickle.loads(pickle.dumps(cells))) in (0, 200)
    finally:
        done.set()
        thread.join()
