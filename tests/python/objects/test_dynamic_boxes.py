# SPDX-License-Identifier: BSD-3-Clause
"""Dynamic cell lists in boxes of any shape and at any scale, against every image in fractions."""

import copy
import math
import pickle
import signal
import subprocess
import sys
import threading
import time
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from dynamic_model import Model, check, check_points
from rational_images import exact
from subprocesses import HEARS_INTERRUPTS


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
        self.model = Model(dim, self.box, self.periodic, self.inclusive)
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
            x[rng.integers(dim)] = rng.choice([-1, 1]) * self._far()
        return np.where(rng.random(dim) < 0.3, np.nextafter(x, rng.choice([-1e300, 1e300])), x)

    def _far(self):
        """Beyond what shifts hold, or boxes that can be counted, or only beyond the scene."""
        if self.box is None:
            return 1.7e308
        powers = self.rng.choice([15, self.rng.integers(28, 60), self.rng.integers(60, 300)])
        return self.scale * 2.0 ** int(powers)

    def radius(self, position):
        """Multiples of the width, distances of points, and a hair beside either."""
        rng, most = self.rng, self.cells.max_radius
        r = self.cell_size * float(rng.integers(0, 4))
        if rng.random() < 0.3 and self.model.points:
            other = list(self.model.points.values())[rng.integers(len(self.model.points))]
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
                self.model.points[some[0]] = places[0]
            elif kind < 5:
                cells.insert_many(some, places)
                self.model.points.update(zip(some, places))
            elif kind == 5:
                there = [key in self.model.points for key in some]
                assert cells.remove_many(some).tolist() == there
                for key in some:
                    self.model.points.pop(key, None)
            elif kind == 6:
                self.cells = [pickle.loads(pickle.dumps(cells)), copy.copy(cells)][rng.integers(2)]
            else:
                cells.shrink_to_fit()
        except (ValueError, OverflowError) as error:  # which far points are, of dense cells
            assert "GB" in str(error) or "2**51 boxes" in str(error)

    def check(self):
        cells, rng = self.cells, self.rng
        check_points(cells, self.model)
        at = self.place()
        if self.model.points and rng.random() < 0.7:
            at = list(self.model.points.values())[rng.integers(len(self.model.points))]
            if self.box is not None:
                at = at + (rng.integers(-2, 3, self.dim) * self.periodic) @ self.box
        r = self.radius(at)
        try:
            check(cells, self.model, at, r)
        except OverflowError as error:
            assert "2**51 boxes" in str(error) or "2**31" in str(error)


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


@pytest.mark.parametrize("tagged", [False, True])
def test_iteration_goes_through_many_blocks_of_keys(tagged):
    cells = hs.DynamicCellList(1, 1.0, tagged=tagged)
    n = 5000
    keys = [(k % 3, k) for k in range(n)] if tagged else list(range(n))
    cells.insert_many(keys, np.zeros((n, 1)))
    assert sorted(cells) == sorted(keys)


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


def test_boxes_of_too_different_lengths_are_refused():
    """Rounding along the long vector spans many of the short one."""
    with pytest.raises(ValueError, match="max_radius"):
        hs.DynamicCellList(2, 1.0, box=[[1.0, 1.0], [2.0**100, -(2.0**99)]])


def _square(at, radius, point, periods):
    """From a centre to the closed cell of a point along one axis; infinity: it is out of reach,
    as it ends where the ball begins."""
    squares = []
    for turn in range(-2, 3) if periods else (0,):
        low = Fraction(math.floor(point)) + turn * periods
        apart = max(low - at, at - (low + 1), Fraction(0))
        squares.append(math.inf if radius is not None and at - radius == low + 1 else apart**2)
    return min(squares)


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("periods", [0, 8])
def test_near_returns_the_points_of_the_cells_that_the_ball_meets(dim, periods):
    """However few cells are occupied, and however many the ball meets; dense cells are the same.
    Cells end before their upper faces: one that only touches the ball there may count."""
    rng = np.random.default_rng(dim)
    box = [float(periods)] * dim if periods else None
    lists = [
        hs.DynamicCellList(dim, 1.0, box=box, max_radius=9.0, storage=kind)
        for kind in ("hash", "dense")
    ]
    n_left_out = 0
    for n in (1, 4, 40):
        points = rng.integers(-80, 80, (n, dim)) / 16.0
        points = points % 8.0 - 4.0 if periods else points
        for cells in lists:
            cells.insert_many(np.arange(n), points)
        for _ in range(12):
            at = rng.integers(-64, 64, dim) / 16.0
            radius = float(rng.choice([0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.5, 9.0]))
            at_least, at_most = set(), set()
            for key, point in enumerate(points):
                squares = [
                    [_square(exact([x])[0], r, exact([p])[0], periods) for x, p in zip(at, point)]
                    for r in (Fraction(radius), None)
                ]
                at_least |= {key} if sum(squares[0]) <= radius**2 else set()
                at_most |= {key} if sum(squares[1]) <= radius**2 else set()
            near = [sorted(cells.near(at, radius).tolist()) for cells in lists]
            assert near[0] == near[1]
            assert at_least <= set(near[0]) <= at_most
            n_left_out += n - len(at_most)
    assert n_left_out > 100


def test_near_tells_cells_apart_whose_numbers_are_the_same():
    """Sparse cells are numbered modulo 2**32."""
    cells = hs.DynamicCellList(1, 1.0, max_radius=2.0**40)
    places = [0.5 + turns * 2.0**32 for turns in range(-3, 4)]
    cells.insert_many(range(7), np.array(places)[:, None])
    for copied in (cells, cells.copy()):
        for key, place in enumerate(places):
            for radius in (0.25, 1.0, 100.0, 2.0**31):
                assert copied.near([place], radius).tolist() == [key]
        assert sorted(copied.near([0.5], 2.0**32 + 1.0).tolist()) == [2, 3, 4]
    lone = hs.DynamicCellList(1, 1.0)
    lone.insert(0, [0.5])
    assert lone.near([2.0**32 + 0.5], 1.0).tolist() == []


LONG_QUERY = """
import signal, sys
import numpy as np
import halfshell as hs

# A million images of many points, none of which is within
cells = hs.DynamicCellList(
    2, 1.0, box=[1.0, 1.0], periodic=[True, False], max_radius=5e5, storage="all-pairs"
)
cells.insert_many(np.arange(100_000), np.full((100_000, 2), 1e6))
queries = {
    "any_within": lambda: cells.any_within([0.5, 0.5], 5e5),
    "within": lambda: cells.within([0.5, 0.5], 5e5),
    "within_many": lambda: cells.within_many([[0.5, 0.5]], 5e5),
}
heard = []

def handle(*_):
    print("heard", flush=True)
    heard.append(1)
    if len(heard) == 2:
        raise RuntimeError("enough")

if sys.argv[2] == "handled":
    signal.signal(signal.SIGINT, handle)
print("ready", flush=True)
try:
    queries[sys.argv[1]]()
except KeyboardInterrupt:
    print("interrupted")
except RuntimeError as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
@pytest.mark.parametrize(
    "query, handler", [("any_within", "default"), ("within", "handled"), ("within_many", "default")]
)
def test_ctrl_c_ends_one_long_query(query, handler):
    """A handler that returns does not end it: it is made again."""
    with subprocess.Popen(
        [sys.executable, "-c", HEARS_INTERRUPTS + LONG_QUERY, query, handler],
        stdout=subprocess.PIPE, text=True,
    ) as child:  # fmt: skip
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        time.sleep(0.2)
        child.send_signal(signal.SIGINT)
        if handler == "handled":
            assert child.stdout.readline() == "heard\n"
            time.sleep(0.2)
            child.send_signal(signal.SIGINT)
            assert child.stdout.readline() == "heard\n"
        assert child.stdout.readline() in ("interrupted\n", "enough\n")


def test_a_change_waits_for_a_long_query_without_the_gil():
    """The query needs the GIL to look for signals, and the change has it when it begins to wait."""
    cells = hs.DynamicCellList(
        2, 1.0, box=[1.0, 1.0], periodic=[True, False], max_radius=2e3, storage="all-pairs"
    )
    cells.insert_many(np.arange(50_000), np.full((50_000, 2), 1e4))
    query = threading.Thread(target=cells.within_many, args=([[0.5, 0.5]] * 4, 2e3))
    query.start()
    n_changes = 0
    while query.is_alive():
        cells.insert(1, [0.5, 1e4])
        n_changes += 1
    query.join()
    assert n_changes > 0
