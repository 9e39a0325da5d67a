# SPDX-License-Identifier: BSD-3-Clause
"""`VerletList`: every step is that of a fresh search, whatever points and box do between them."""

import copy
import itertools
import math
import pickle
import re
import threading
from functools import partial

import numpy as np
import pytest
from hypothesis import given

import halfshell as hs
from full_lists import same_tables
from halfshell._objects.verlet_list import MOST_CHANGES, SEARCHES, AutoSkin
from halfshell._settings import settings
from oracles import BOX_KINDS, random_box, same_arrays
from refused_calls import check_refusals
from scene_strategies import scenes


def check(pair_list, points, box=None, periodic=None, inclusive=True):
    """The list has what a search finds, to the last bit; returns the number of pairs."""
    options = {"box": box, "periodic": periodic, "inclusive": inclusive}
    expected = hs.pairs(points, pair_list.cutoff, quantities="ijdDS", sort=True, **options)
    assert same_arrays(pair_list.pairs(quantities="ijdDS", sort=True), expected)
    as_listed = pair_list.pairs(quantities="ijS")
    order = np.lexsort([*as_listed[2].T[::-1], as_listed[1], as_listed[0]])
    assert same_arrays(
        tuple(np.ascontiguousarray(a[order]) for a in as_listed),
        (expected[0], expected[1], expected[4]),
    )
    rows = hs.neighbors(points, pair_list.cutoff, quantities="jdS", **options)
    assert same_tables(pair_list.neighbors(quantities="jdS"), rows)
    assert pair_list.margin >= 0.0 and pair_list.n_points == len(points)
    return len(expected[0])


def wrapped(points, box, periodic=None):
    """Points in the box, in their own dtype."""
    return hs.Box(box).wrap(points, periodic)[0].astype(points.dtype)


# ---- random walks --------------------------------------------------------------------------


class History:
    """A list, and the scene that it was last given."""

    def __init__(self, seed):
        rng = self.rng = np.random.default_rng(seed)
        kind = self.kind = (None, *BOX_KINDS)[seed % (1 + len(BOX_KINDS))]
        self.ndim = 1 + seed % 4
        length = 0.5 if self.ndim < 3 and seed % 3 == 0 else 1.0  # the cutoff has several images
        self.box = None if kind is None else random_box(rng, kind, self.ndim, length=length)
        self.periodic = None if kind is None else [True] * self.ndim
        self.inclusive, self.dtype = bool(rng.integers(2)), np.float64
        skin = ("auto", 0.0, 0.1, 0.1)[rng.integers(4)]
        self.list = hs.VerletList(0.35, skin, inclusive=self.inclusive)
        self.points = rng.random((40, self.ndim))

    def change(self):
        """Steps of some kind, and now and then another scene."""
        rng, box, shape = self.rng, self.box, self.points.shape
        kind = rng.integers(9)
        self.points = self.points + rng.normal(0.0, 0.005, shape)
        if kind == 0:
            self.points = rng.random((rng.choice([0, 1, 2, 40]), self.ndim))
        elif kind == 1:
            self.dtype = np.float32 if self.dtype is np.float64 else np.float64
        elif kind == 2:
            self.points = self.points + rng.normal(size=self.ndim)
        elif kind < 6 and box is not None:
            self.points = self.points + (rng.integers(-3, 4, shape) * self.periodic) @ box
        elif kind == 6 and box is not None:
            deformed = box @ (np.eye(self.ndim) + rng.normal(0.0, 0.002, box.shape))
            self.points = self.points @ np.linalg.inv(box) @ deformed
            self.box = deformed
        elif kind == 7 and box is not None:
            self.periodic = (rng.random(self.ndim) < 0.7).tolist()

    def refused(self):
        """Bad points leave the list as it was."""
        counts, points = (self.list.n_builds, self.list.n_updates), self.points.copy()
        bad = self.rng.choice([math.nan, math.inf, -math.inf])
        points[-1, 0] = bad
        with pytest.raises(ValueError, match=rf"points\[{len(points) - 1}, 0\]"):
            self.list.update(points, self.box, self.periodic)
        if self.box is not None:
            with pytest.raises(ValueError, match="box must be finite"):
                self.list.update(self.points, self.box + bad, self.periodic)
        assert (self.list.n_builds, self.list.n_updates) == counts


@pytest.mark.parametrize("seed", range(20))
def test_any_history(seed):
    history = History(seed)
    n_pairs = 0
    for _ in range(20):
        history.change()
        given = history.points.astype(history.dtype)
        kept, box = given.copy(), history.box
        history.list.update(given, box, history.periodic)
        given[:] = 0.0  # it was copied
        n_pairs += check(history.list, kept, box, history.periodic, history.inclusive)
        if len(kept):
            history.refused()
            check(history.list, kept, box, history.periodic, history.inclusive)
    assert n_pairs > 100 or history.ndim == 4
    assert history.list.n_updates == 20 and history.list.skin >= 0.0


@pytest.mark.parametrize("inclusive", [True, False])
def test_ties_at_the_cutoff(inclusive):
    grid = np.array(list(itertools.product(range(4), repeat=3)), float)
    pair_list = hs.VerletList(1.0, 0.5, box=[4.0] * 3, inclusive=inclusive)
    for step in range(4):
        points = grid + 0.25 * step
        assert pair_list.update(points) is (step == 0)
        assert check(pair_list, points, [4.0] * 3, inclusive=inclusive) == 192 * inclusive


# ---- how far points may come ---------------------------------------------------------------


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_points_that_approach_head_on_are_never_missed(dtype):
    cutoff = 1.0
    for skin in (0.0, 1e-12, 0.1, 0.3, 1.0, 123.4):
        last = cutoff + skin
        for start, *steps in itertools.product(
            (last, math.nextafter(last, math.inf)), (-1, 0, 1), (-1, 0, 1)
        ):
            left = np.array([0.0], dtype)
            right = np.array([start], dtype)
            pair_list = hs.VerletList(cutoff, skin)
            pair_list.update(np.array([left, right]))
            to_left, to_right = left + dtype(0.5 * skin), right - dtype(0.5 * skin)
            for side, way in zip((to_left, to_right), steps):
                side[:] = np.nextafter(side, dtype(way * 1e6)) if way else side
            points = np.array([to_left, to_right])
            pair_list.update(points)
            check(pair_list, points)


def test_margin_shrinks_as_points_move():
    pair_list = hs.VerletList(1.0, 0.5)
    pair_list.update([[0.0], [2.0], [9.0]])
    assert pair_list.margin == pytest.approx(0.5, abs=1e-15) and pair_list.margin <= 0.5
    assert not pair_list.update([[0.1], [1.9], [9.0]])
    assert 0.3 - 1e-12 < pair_list.margin <= 0.3
    assert not pair_list.update([[0.2], [1.8], [9.0]])
    assert 0.1 - 1e-12 < pair_list.margin <= 0.1 + 1e-15
    assert pair_list.update([[0.26], [1.74], [9.0]])
    assert pair_list.n_builds == 2


def test_without_a_skin_it_is_built_unless_nothing_has_moved(rng):
    box = random_box(rng, "triclinic")
    points = rng.random((50, 3))
    pair_list = hs.VerletList(0.4, 0.0, box=box)
    assert pair_list.update(points)
    assert not pair_list.update(points.copy(order="F"))
    assert pair_list.margin == 0.0
    check(pair_list, points, box)
    points[7, 1] = np.nextafter(points[7, 1], 2.0)
    assert pair_list.update(points)
    check(pair_list, points, box)


def test_any_unit_of_length(rng):
    for unit in (1e-300, 1e-160, 1e-20, 1e20, 1e150, 1e300):
        in_unit(rng, unit)


def in_unit(rng, unit):
    box = random_box(rng, "triclinic") * unit
    points = rng.random((40, 3)) @ box
    pair_list = hs.VerletList(0.4 * unit, 0.2 * unit, box=box)
    for _ in range(6):
        pair_list.update(points)
        assert check(pair_list, points, box) > 10
        points = points + rng.normal(0.0, 0.01, points.shape) * unit
    for _ in range(3):
        points = points + rng.normal(0.0, 0.5, points.shape) * unit
        assert pair_list.update(points)
        check(pair_list, points, box)


# ---- jumps and drift -----------------------------------------------------------------------


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_wrapping_is_no_movement(rng, kind):
    box = random_box(rng, kind)
    points = rng.random((80, 3)) @ box
    pair_list = hs.VerletList(0.3, 0.1, box=box)
    pair_list.update(points)
    for step in range(10):
        jumps = rng.integers(-3, 4, points.shape) * (rng.random((len(points), 1)) < 0.2)
        moved = points + jumps @ box
        assert not pair_list.update(wrapped(moved, box) if step % 2 else moved)
        check(pair_list, wrapped(moved, box) if step % 2 else moved, box)
    assert pair_list.margin > 0.09


@pytest.mark.parametrize("n", [3, 5000])
@pytest.mark.parametrize("box", [None, [10.0, 10.0, 10.0], [[10, 0, 0], [3, 10, 0], [0, 2, 10]]])
def test_drift_of_all_points_costs_nothing(rng, box, n):
    points = rng.random((n, 3)) * 10.0
    pair_list = hs.VerletList(0.5, 0.2, box=box)
    pair_list.update(points)
    for step in range(1, 6):
        moved = points + step * np.array([0.7, -0.4, 1.1]) + rng.normal(0.0, 0.001, points.shape)
        if box is not None and step % 2:
            moved = wrapped(moved, np.asarray(box, float))
        assert not pair_list.update(moved)
        check(pair_list, moved, box)


# ---- boxes that change ---------------------------------------------------------------------


def deform(rng, how, step):
    """F of one step."""
    if how == "shrinking":
        return np.eye(3) * (1.0 - 0.002 * step)
    if how == "growing":
        return np.eye(3) * (1.0 + 0.01 * step)
    if how == "shearing":
        return np.eye(3) + 0.003 * step * np.eye(3, k=1)
    if how == "rotating":
        c, s = math.cos(0.3 * step), math.sin(0.3 * step)
        return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.eye(3) + rng.normal(0.0, 0.002, (3, 3))


@pytest.mark.parametrize("how", ["shrinking", "growing", "shearing", "rotating", "shaking"])
def test_deforming_boxes(how):
    for kind in ("orthorhombic", "triclinic", "sheared"):
        deforming(np.random.default_rng(20260817), how, kind)


def deforming(rng, how, kind):
    start = random_box(rng, kind)
    fractions = rng.random((80, 3))
    pair_list = hs.VerletList(0.35, 0.1)
    for step in range(12):
        fractions = fractions + rng.normal(0.0, 0.0005, fractions.shape)
        box = start @ deform(rng, how, step)
        points = fractions @ box
        if step % 3 == 2:
            points = wrapped(points, box)
        pair_list.update(points, box)
        check(pair_list, points, box)
    assert pair_list.n_builds < 12
    if how in ("growing", "rotating"):
        assert pair_list.n_builds == 1


def test_a_box_that_collapses_is_an_error_of_the_box_alone(rng):
    points = rng.random((30, 3))
    pair_list = hs.VerletList(0.4, 0.1, box=np.eye(3))
    pair_list.update(points)
    with pytest.raises(ValueError, match="vector 2 of box is zero"):
        pair_list.update(points, np.diag([1.0, 1.0, 0.0]))
    check(pair_list, points, np.eye(3))
    with pytest.raises(ValueError, match="linearly independent"):
        pair_list.update(points, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    check(pair_list, points, np.eye(3))
    thin = np.diag([1.0, 1.0, 0.3])
    assert pair_list.update(points, thin)
    check(pair_list, points, thin)


# ---- other points, bad points --------------------------------------------------------------


def test_results_that_do_not_fit_leave_the_list_as_it_was(rng):
    points = rng.random((2000, 3))
    pair_list = hs.VerletList(0.05, 0.02)
    with settings(memory_limit=2_000_000):
        pair_list.update(points)
        with pytest.raises(MemoryError):
            pair_list.update(points * 0.05)
    check(pair_list, points)


# ---- the interface -------------------------------------------------------------------------


def test_before_the_first_update():
    pair_list = hs.VerletList(1.0)
    for ask in (pair_list.pairs, lambda: pair_list.margin):
        with pytest.raises(RuntimeError, match="call update first"):
            ask()
    assert (pair_list.n_points, pair_list.n_builds, pair_list.n_updates) == (0, 0, 0)
    with pytest.raises(ValueError):
        pair_list.update([[math.nan]])
    with pytest.raises(RuntimeError, match="call update first"):
        pair_list.pairs()


def test_bad_lengths_and_options(rng):
    pair_list = hs.VerletList(0.3, 0.1, box=[1.0])
    pair_list.update(rng.random((10, 1)))
    rows = pair_list.neighbors
    letters, words = "quantities must be some of the letters", "box must have shape (d,) or (d, d)"
    check_refusals([
        (partial(hs.VerletList, [1.0, 2.0]), TypeError, "cutoff"),
        (lambda: hs.VerletList(1.5e308, 1.5e308).update([[0.0]]), ValueError, "finite"),
        *((lambda shape=shape: hs.VerletList(1.0, box=np.ones(shape)), ValueError, re.escape(words))
          for shape in ((0,), (9,), (2, 3), (1, 2, 2), (9, 9))),
        *((partial(rows, quantities=x), ValueError, letters) for x in ("ij", "x", "jj", "P", "k")),
        (lambda: rows(quantities="jd").sort(), AttributeError, "this table has no points"),
        (hs.VerletList(1.0).neighbors, RuntimeError, "call update first"),
    ])  # fmt: skip


def test_points_that_know_more_than_one_cutoff_are_refused(rng):
    """`pairs` would take their radii and groups into account, and the list does not."""
    x = rng.random((20, 2))
    pair_list = hs.VerletList(0.3)
    fields = {"radii": x[:, 0], "groups": np.arange(20), "supports": [np.eye(2)] * 20}
    for what, values in fields.items():
        with pytest.raises(ValueError, match=f"VerletList cannot be combined with {what}: it"):
            pair_list.update(hs.Points(x, **{what: values}))
    for systems in ([x, x], hs.Points(x, batch=np.zeros(20, int))):
        with pytest.raises(ValueError, match="points must be one system, and have a batch"):
            pair_list.update(systems)
    assert pair_list.n_updates == 0
    pair_list.update(hs.Points(x, labels=np.arange(20), weights=x[:, 0], types=["A"] * 20))
    assert len(pair_list.pairs()[0]) == hs.count_pairs(x, 0.3)


def test_a_box_that_is_given_when_the_list_is_made_or_later():
    points = [[0.1, 0.1], [1.9, 0.1]]
    later = hs.VerletList(1.0, periodic=[True, False])
    with pytest.raises(ValueError, match="periodic needs a box"):
        later.update(points)
    assert later.update(points, box=[2.0, 2.0])
    assert len(later.pairs(quantities="i")) == 1
    for scene in ({"box": 2.0}, {"box": 2.0, "periodic": [True, False]}, {"box": hs.Box([2, 3])}):
        pair_list = hs.VerletList(0.5, **scene)
        assert pair_list.update(points)
        assert len(pair_list.pairs(quantities="i")) == hs.count_pairs(points, 0.5, **scene) == 1


def test_threads_take_turns(rng):
    points = rng.random((400, 3))
    pair_list = hs.VerletList(0.2, 0.1)
    pair_list.update(points)
    expected = pair_list.pairs(quantities="ij", sort=True)
    wrong = []

    def use():
        for _ in range(30):
            pair_list.update(points)
            if not same_arrays(pair_list.pairs(quantities="ij", sort=True), expected):
                wrong.append(1)

    threads = [threading.Thread(target=use) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong and pair_list.n_updates == 121


def test_a_call_within_a_call_is_refused():
    pair_list = hs.VerletList(1.0, 0.1)

    class Points:
        def __array__(self, dtype=None, copy=None):
            pair_list.update([[0.0]])
            return np.zeros((1, 1))

    with pytest.raises(TypeError, match="in the middle of another call"):
        pair_list.update(Points())
    assert pair_list.update([[0.0]])


def test_lists_are_not_copied():
    pair_list = hs.VerletList(1.0)
    for way in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="cannot be copied"):
            way(pair_list)
    assert repr(pair_list).startswith("VerletList(1.0, skin=0.1")


# ---- rows ------------------------------------------------------------------------------------


@given(scenes())
def test_rows_are_those_of_a_search(scene):
    how = {"box": scene.box, "periodic": scene.periodic, "inclusive": scene.inclusive}
    for skin in (0.3 * scene.cutoff, "auto"):
        pair_list = hs.VerletList(scene.cutoff, skin, **how)
        pair_list.update(scene.points)
        for quantities in ("j", "jdDS", "S", "Dj"):
            found = pair_list.neighbors(quantities=quantities)
            expected = hs.neighbors(scene.points, scene.cutoff, quantities=quantities, **how)
            assert same_tables(found, expected) and found.shape == expected.shape
            assert not any(array.flags.writeable for array in found._arrays)


def test_a_shift_without_an_opposite_is_refused():
    points = [[0.0], [2.0**31]]
    pair_list = hs.VerletList(0.25, 0.0, box=[1.0])
    pair_list.update(points)
    assert pair_list.pairs(quantities="S").tolist() == [[-(2**31)]]
    assert pair_list.neighbors().counts.tolist() == [1, 1]
    with pytest.raises(OverflowError, match="no opposite"):
        pair_list.neighbors(quantities="S")


# ---- the skin that is chosen ---------------------------------------------------------------


def run_auto(auto, n_points, found, a_step, n_steps):
    """A list of known pairs and movements; returns the skins it had, None without a list."""
    spent, skins = math.inf, []
    for _ in range(n_steps):
        if auto.searches:
            auto.searched()
            skins.append(None)
            spent = math.inf
            continue
        change = auto.wants_change(3)
        spent += a_step
        rebuilt = change or spent > auto.skin
        skin = auto.chosen if rebuilt else auto.skin
        margin = -math.inf if change or spent == math.inf else auto.skin - spent
        spent = 0.0 if rebuilt else spent
        listed = round(found * (1.0 + skin / auto.cutoff) ** 3)
        auto.updated(rebuilt, margin, 3, n_points, listed)
        skins.append(auto.skin)
    return skins


def test_automatic_skins_settle_near_the_best():
    for found, a_step in itertools.product((6, 26, 210), (0.0, 1e-5, 1e-3, 0.01)):
        auto = AutoSkin(2.0)
        skins = run_auto(auto, 10_000, 10_000 * found, a_step, 3000)
        assert auto.is_settled
        assert len(list(itertools.groupby(skins))) <= MOST_CHANGES + 1
        assert len(set(skins[-1000:])) == 1
        times = [auto.list_time(2.0 * 2.0 ** (k / 4.0), a_step, 3) for k in range(-40, 1)]
        assert auto.list_time(skins[-1], a_step, 3) <= 1.25 * min(times)
        assert min(times) < auto.search_time(3)


def test_points_that_move_fast_are_searched():
    """Until a list is tried again, which it is now and then."""
    auto = AutoSkin(2.0)
    skins = run_auto(auto, 10_000, 260_000, 0.2, 2 * SEARCHES + 100)
    runs = [(skin, len(list(group))) for skin, group in itertools.groupby(skins)]
    assert [count for skin, count in runs if skin is None][:2] == [SEARCHES, SEARCHES]
    assert sum(count for skin, count in runs if skin is not None) < 60


@pytest.mark.slow
def test_pairs_without_a_list_are_those_of_a_search(rng):
    """The same arrays, the same refusals, and the points of the step whatever happens to them."""
    points = rng.random((20_000, 3))
    pair_list = hs.VerletList(0.08, box=[1.0] * 3)
    with_list = 0
    for _ in range(12):
        rebuilt = pair_list.update(points)
        with_list += pair_list.margin > 0.0
        check(pair_list, points, [1.0] * 3)
        assert pair_list.n_points == len(points)
        last = points.copy()
        points += rng.normal(0.0, 0.01, points.shape)
    assert rebuilt and pair_list.margin == 0.0 and 0 < with_list < 12
    found = pair_list.pairs(quantities="ijdDS")
    searched = hs.pairs(last, 0.08, box=[1.0] * 3, quantities="ijdDS")
    for own, other in zip(found, searched, strict=True):
        np.testing.assert_array_equal(own, other)
    bad = last.copy()
    bad[7, 1] = np.nan
    with pytest.raises(ValueError, match="7"):
        pair_list.update(bad)
    with pytest.raises(ValueError, match="box"):
        pair_list.update(last, box=[[1.0, 0, 0], [1.0, 0, 0], [0, 0, 1.0]])
    np.testing.assert_array_equal(pair_list.pairs()[0], found[0])
