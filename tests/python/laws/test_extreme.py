# SPDX-License-Identifier: BSD-3-Clause
"""Scenes at the ends of float64: the same answers, in time that follows points and pairs."""

import math

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import check, same_arrays

LARGEST = 1.7e308
SMALLEST = 5e-324


def scales(rng, n, ndim, lowest, highest):
    """Numbers of all sizes between two powers of ten, of both signs."""
    return 10.0 ** rng.uniform(lowest, highest, (n, ndim)) * rng.choice([-1, 1], (n, ndim))


def near_points(rng, points, cutoff):
    """Half of the coordinates become those of other points, about a cutoff away."""
    n = len(points)
    for row in range(1, n):
        for k in range(points.shape[1]):
            x = points[rng.integers(row), k]
            step = rng.choice([0.0, cutoff, -cutoff, cutoff * rng.uniform(-2, 2)])
            choices = [x, np.nextafter(x, np.inf), x + step, -x, points[row, k]]
            choice = choices[rng.integers(5)]
            points[row, k] = choice if math.isfinite(choice) else x
    return points


# ---- pairs, exactly ------------------------------------------------------------------------


@pytest.mark.parametrize("cutoff", [SMALLEST, 1e-310, 1e-200, 1e-9, 0.5, 1e9, 1e200, 1e307, 0.0])
def test_open_scenes_of_all_scales(rng, cutoff):
    for ndim in (1, 2, 3):
        for lowest, highest in [(-320, 308), (-3, 300), (-323, -300), (0, 0.1)]:
            points = scales(rng, 25, ndim, lowest, highest)
            check(near_points(rng, points, cutoff), cutoff)


@pytest.mark.parametrize("cutoff", [SMALLEST, 1e-300, 1e-17, 0.4, 1e200, 0.0])
@pytest.mark.parametrize("length", [1.0, 1e-300, 1e300, 3 * SMALLEST])
def test_periodic_scenes_of_all_scales(rng, cutoff, length):
    if cutoff > 3 * length:
        return  # more images than there is room for
    for outside in (0, 3):
        points = rng.uniform(-outside, outside + 1, (20, 2)) * length
        points[:4, 0] = [length / 2, -length / 2, 0, np.nextafter(length / 2, 0)]
        near_points(rng, points, cutoff)
        check(points, cutoff, [length, 2 * length])
        check(points, cutoff, [[0, -length], [length, 0]], [True, False])


def test_tilted_boxes_with_tiny_cutoffs(rng):
    box = np.array([[1.0, 0, 0], [0.3, 1, 0], [0, 0, 1]])
    points = rng.random((30, 3)) @ box
    points[15:] = points[:15]
    points[20:25, 2] = [1e300, -1e300, 0, LARGEST, -LARGEST]
    for cutoff in (0.0, SMALLEST, 1e-200):
        found = check(points, cutoff, box, [True, True, False])
        assert len(found) >= 10
        points[:, 2] %= 1.0
        assert len(check(points, cutoff, box)) >= 10


def test_points_wrapped_from_far_away_count_their_turns():
    # The box is far wider than the cutoff can tell, and points lie outside of it.
    box = [1.0, 1.0]
    points = np.array([[0.25, 0.5], [3.25, 0.5], [-2.75, 0.5], [0.25, 8.5], [0.5, 0.5]])
    expected = {(0, 1, (-3, 0)), (0, 2, (3, 0)), (1, 2, (6, 0)), (0, 3, (0, -8))}
    expected |= {(1, 3, (3, -8)), (2, 3, (-3, -8))}
    for cutoff in (0.0, 1e-300, SMALLEST):
        assert check(points, cutoff, box) == expected
    points[4, 0] = 2.0**51
    for kernel in hs.kernels():
        assert call(hs.count_pairs, points, 1e-300, box=box, kernel=kernel) == 6
    with pytest.raises(OverflowError, match=r"points\[4\] lies too many box vectors away"):
        hs.pairs(points * 4, 1e-300, box=box, quantities="S")


def long_boxes(aspect):
    """Skewed boxes with one vector, or two, so many times as long as the others."""
    yield np.array([[aspect, 0, 0], [0, 1, 0.3], [0, 0, 1]])
    yield np.array([[aspect, 0.3, 0], [0, 1, 0], [0, 0, 1]])
    yield np.array([[1, 0, 0], [0.3, aspect, 0], [0, 0, aspect]])


@pytest.mark.parametrize("aspect", [1e6, 1e12, 1e16, 1e19, 1e25])
def test_long_skewed_boxes(rng, aspect):
    for box in long_boxes(aspect):
        points = rng.uniform(-1, 2, (25, 3)) @ box
        points[15:] = points[:10] + rng.uniform(-0.6, 0.6, (10, 3))
        for cutoff in (0.3, 0.9):
            check(points, cutoff, box)
    report = hs.explain(rng.random((2000, 3)) @ box, 0.3, box=box, measure=True)
    assert report.measured["candidates"] < 300 * 2000


# ---- work, counted -------------------------------------------------------------------------


def work(points, cutoff, box=None):
    """Candidates, decisions beyond float32 and in integers, a point and pair."""
    n = len(points)
    report = call(hs.explain, points, cutoff, box=box, measure=True, threads=1, memory_limit=1e12)
    counts = report.measured
    things = n + counts["pairs"]
    return [counts[name] / things for name in ("candidates", "ambiguous", "by_integers")]


WIDE = {
    "outlier": lambda u: (np.concatenate([u, [[1e300] * u.shape[1]]]), 0.05, None),
    "tiny cutoff": lambda u: (u, SMALLEST, None),
    "tiny cutoff in a box": lambda u: (u, 1e-200, np.ones(u.shape[1])),
    "huge spread": lambda u: ((u - 0.5) * 2e300, 1e-200, None),
    "huge box": lambda u: ((u - 0.5) * 1e300, 1.0, np.full(u.shape[1], 1e300)),
    "subnormal": lambda u: (u * 1e-310, 0.05 * 1e-310, None),
    "exponential": lambda u: (10.0 ** (620 * u - 320), 1e-300, None),
    "exponential, large cutoff": lambda u: (10.0 ** (303 * u - 3), 1e100, None),
    "exponential, largest cutoff": lambda u: (10.0 ** (620 * u[:1500] - 320), 1e290, None),
}


@pytest.mark.parametrize("scene", WIDE.values(), ids=WIDE)
def test_work_follows_points_and_pairs(rng, scene):
    for ndim in (1, 2, 3):
        points, cutoff, box = scene(rng.random((3000, ndim)))
        candidates, ambiguous, by_integers = work(points, cutoff, box)
        assert candidates < 100
        assert ambiguous < 0.1
        assert by_integers < 0.01


# ---- refusals ------------------------------------------------------------------------------


def test_double_refuses_what_rounding_drowns(rng):
    points = rng.random((200, 3))
    for box in ([1.0] * 3, [[1.0, 0, 0], [0.3, 1, 0], [0, 0.2, 1]]):
        for far in (0.0, 1e6, 1e9):
            points[5] = far + 0.5
            count = call(hs.count_pairs, points, 0.2, box=box, precision="double")
            assert abs(count - hs.count_pairs(points, 0.2, box=box)) <= 10
        for far in (1e14, 1e15):
            points[5] = far
            with pytest.raises(OverflowError, match=r"points\[5\].*precision='double'"):
                call(hs.count_pairs, points, 0.2, box=box, precision="double")
        with pytest.raises(OverflowError, match=r"points\[205\].*precision='double'"):
            twice = np.concatenate([points * 1e-9, points])
            call(hs.pairs, twice, 0.2, box=box, precision="double", batch=np.arange(400) // 200)
        for far in (1e17, 1e300):
            points[5] = far
            with pytest.raises(OverflowError, match=r"points\[5\]"):
                call(hs.count_pairs, points, 0.2, box=box, precision="double")


@pytest.mark.parametrize(
    ("limit", "options"),
    [(0, {}), (1000, {"box": [1.0] * 3}), (3e5, {"sort": True}), (3e5, {"threads": 2})],
)
def test_a_refusal_says_what_was_expected(rng, limit, options):
    points = rng.random((20_000, 3))
    count = hs.count_pairs(points, 0.05)
    for batch in (None, np.zeros(20_000, int)):
        with pytest.raises(MemoryError, match="are expected") as caught:
            call(hs.pairs, points, 0.05, memory_limit=limit, batch=batch, **options)
        text = str(caught.value)
        expected = float(text.split("about ")[1].split(" pairs")[0])
        assert 0.8 * count < expected < 1.3 * count
        # systems are sorted in a second list; one system is found in order
        lists = 2 if "sort" in options and batch is not None else 1
        assert f"{expected * 16 * lists / 1e6:.2f}"[:2] in text
        assert (" 0 bytes are allowed" in text) == (limit == 0)


def test_arrays_of_out_must_lie_apart_from_each_other(rng):
    points = rng.random((50, 2))
    room = np.empty(3000, np.int64)
    for i, j in ((room, room), (room[:2000], room[1999:]), (room[1000:], room[:1001])):
        with pytest.raises(ValueError, match="the arrays of out must not overlap"):
            hs.pairs(points, 0.2, out=(i, j))
    with pytest.raises(ValueError, match="out for 'd' must not share memory with points"):
        hs.pairs(points, 0.2, quantities="d", out=points.reshape(-1))
    whole = np.arange(100).reshape(50, 2)
    with pytest.raises(ValueError, match="must not share memory with points"):
        hs.pairs(whole, 3.0, quantities="i", out=whole.reshape(-1))  # also if converted first
    found = hs.pairs(points, 0.2, out=(room[:1500], room[1500:]))
    assert same_arrays(found, hs.pairs(points, 0.2))


# ---- full lists, queries, and cells that are kept ---------------------------------------------

SKEWED = "box is too skewed, or its vectors differ"


def turned_box(rng, aspect):
    """A box with one vector so many times as long as the others, along no coordinate axis."""
    return np.diag([aspect, 1.0, 1.0]) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]


# ---- boxes that are refused ----------------------------------------------------------------


def searches(points, cutoff, box, **keywords):
    """Every function that takes a box, as (name, call)."""
    keywords["box"] = box
    edges = [0.0, cutoff]
    yield "pairs", lambda: hs.pairs(points, cutoff, **keywords)
    yield "neighbors", lambda: hs.neighbors(points, cutoff, **keywords)
    yield "queries", lambda: hs.neighbors(points, cutoff, queries=points[:5], **keywords)
    yield "pairs_between", lambda: hs.pairs_between(points, points[:5], cutoff, **keywords)
    yield "coordination", lambda: hs.coordination(points, cutoff, **keywords)
    yield "pair_histogram", lambda: hs.pair_histogram(points, edges, **keywords)
    yield "iter_pairs", lambda: list(hs.iter_pairs(points, cutoff, **keywords))
    yield "CellList", lambda: hs.CellList(points, cutoff, **keywords)
    yield "VerletList", lambda: hs.VerletList(cutoff, skin=0.1 * cutoff, **keywords).update(points)


def test_every_search_refuses_boxes_that_float64_does_not_place_points_in(rng):
    sheared = np.array([[1.0, 0, 0], [1e12, 1, 0], [-3e11, 7e11, 1]])
    for box in (turned_box(rng, 1e17), sheared):
        for name, search in searches(rng.random((50, 3)), 0.1, box):
            with pytest.raises(ValueError, match=SKEWED):
                search()
                raise AssertionError(name)


def test_a_point_too_far_out_along_an_open_direction_is_named(rng):
    # The vectors that repeat have parts along the third axis: wrapping moves points along it.
    box = hs.Box([[1.0, 0, 0.2], [0.3, 1, 0.1], [0, 0, 1]])
    points = rng.random((20, 3))
    far = points.copy()
    far[7, 2] += 1e15
    keywords = {"box": box, "periodic": [True, True, False]}
    beyond = r"\[7\] lies so far from box, along a direction that does not repeat, that float64"
    for name, search in searches(far, 0.4, **keywords):
        if name != "queries":
            with pytest.raises(ValueError, match="(points|queries)" + beyond):
                search()
                raise AssertionError(name)
    with pytest.raises(ValueError, match="queries" + beyond):
        hs.neighbors(points, 0.4, queries=far, **keywords)
    with pytest.raises(ValueError, match="points" + beyond):
        hs.neighbors(far, 0.4, queries=points, **keywords)


def test_cells_for_a_large_cutoff_refuse_what_is_smaller_than_rounding(rng):
    # Along the short vectors points are known to some units: the cutoff has to be larger.
    box = turned_box(rng, 2.0**50)
    points = (rng.random((12, 3)) - 0.5) * 4.0
    cells = hs.CellList(points, 10.0, box=box)
    assert cells.count_pairs() == hs.count_pairs(points, 10.0, box=box)
    for search in (cells.pairs, cells.neighbors, cells.coordination):
        with pytest.raises(ValueError, match=SKEWED):
            search(1e-3)
    with pytest.raises(ValueError, match=SKEWED):
        cells.query(points[:3], 1e-3)
    assert cells.count_pairs() == hs.count_pairs(points, 10.0, box=box)
