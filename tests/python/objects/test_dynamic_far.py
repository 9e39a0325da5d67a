# SPDX-License-Identifier: BSD-3-Clause
"""Dynamic lists whose points or queries are far away, and which cells `near` looks at."""

import itertools
import math
import signal
import subprocess
import sys
import threading
import time
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from rational_images import Images, between, exact
from subprocesses import HEARS_INTERRUPTS


def _far_scene(rng):
    dim = int(rng.choice([1, 2, 2, 3, 3, 4]))
    rows = np.diag(rng.choice([1.0, 1.5, 2.0, 3.0], dim))
    rows += np.tril(rng.choice([0.0, 0.25, -0.5, 1.0, -1.7], (dim, dim)), -1)
    rows = rows[rng.permutation(dim)] + 0.3 * rng.choice([0.0, 0.0, 0.3, -0.7], (dim, dim))
    return dim, rows, rng.random(dim) < 0.6


def _place(rng, dim, held):
    x = rng.integers(-12, 13, dim) / 4.0
    kind = rng.integers(5)
    if kind == 0:
        x[rng.integers(dim)] += rng.choice([-1, 1]) * 2.0 ** int(rng.integers(40, 60))
    elif kind == 1:
        x[rng.integers(dim)] = rng.choice([-1, 1]) * 2.0 ** int(rng.integers(-1000, 1020))
    elif kind == 2 and held:
        x = list(held.values())[rng.integers(len(held))] + rng.choice([0.0, 0.25, -0.5], dim)
    return x


@pytest.mark.parametrize("seed", range(24))
def test_far_points_in_any_box_against_fractions(seed):
    rng = np.random.default_rng(seed)
    dim, rows, periodic = _far_scene(rng)
    storage = str(rng.choice(["hash", "all-pairs"]))
    cells = hs.DynamicCellList(
        dim, 0.5, box=rows, periodic=periodic, max_radius=1.0, storage=storage
    )
    images, held = Images(dim, np.where(periodic[:, None], rows, 0.0), periodic), {}
    for _ in range(24):
        key, x = int(rng.integers(8)), _place(rng, dim, held)
        try:
            cells.insert(key, x)
            held[key] = x
        except OverflowError as error:
            assert "2**51 boxes" in str(error)
        gone = int(rng.integers(12))
        assert cells.remove(gone) == (held.pop(gone, None) is not None)
        at, radius = _place(rng, dim, held), float(rng.choice([0.0, 0.25, 0.5, 1.0]))
        try:
            keys, shifts = cells.within(at, radius, shifts=True)
        except OverflowError as error:
            assert "2**51 boxes" in str(error) or "2**31" in str(error)
            continue
        found = list(zip(keys.tolist(), map(tuple, shifts.tolist())))
        expected = {
            (key, S)
            for key, x in held.items()
            for S, _, _ in images.within(between(exact(at), exact(x)), Fraction(radius) ** 2, True)
        }
        assert len(found) == len(expected) and set(found) == expected
        assert cells.any_within(at, radius) == bool(expected)
        assert {key for key, _ in expected} <= set(cells.near(at, radius).tolist())


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


@pytest.mark.parametrize("storage", ["hash", "dense", "all-pairs"])
def test_near_is_the_same_after_any_history(storage):
    """Cells that far points have left do not matter."""
    rng = np.random.default_rng(1)
    cells, fresh = (
        hs.DynamicCellList(2, 0.5, box=[[4.0, 0.0], [-1.0, 5.0]], max_radius=3.0,
                           periodic=[True, False], storage=storage)
        for _ in range(2)
    )  # fmt: skip
    points = rng.normal(size=(30, 2))
    cells.insert_many(np.arange(60), np.concatenate([points, 50.0 * points]))
    cells.remove_many(np.arange(30, 60))
    fresh.insert_many(np.arange(30), points)
    for at, radius in itertools.product(points, (0.0, 0.5, 1.0, 3.0)):
        assert sorted(cells.near(at, radius)) == sorted(fresh.near(at, radius))


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
