# SPDX-License-Identifier: BSD-3-Clause
"""`VerletList.changes`: what two searches differ by, whatever points, box and list do between."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from halfshell._convert import arrays
from oracles import BOX_KINDS, random_box, same_arrays


def rows(i, j, S):
    return {(int(a), int(b), *map(int, s)) for a, b, s in zip(i, j, S)}


def upright(i, j, S):
    """The one of a pair of a point with its own image that a search finds."""
    first = next((x for x in S if x), 0)
    return (i, j, *(-x for x in S)) if i == j and first < 0 else (i, j, *S)


def expected(cutoff, before, turns_before, now, turns, options=None):
    """Formed and broken pairs by (i, j, S), S as of their step; turns: boxes a point was moved by.

    Points less their turns do not jump, and two searches of these differ by what has changed.
    """

    def found(scene, moved):
        points, box = scene
        i, j, S = hs.pairs(points, cutoff, box=box, quantities="ijS", **(options or {}))
        return {
            upright(a, b, tuple(s + moved[b] - moved[a])): upright(a, b, tuple(s))
            for a, b, s in zip(i.tolist(), j.tolist(), S.astype(np.int64))
        }

    old, new = found(before, turns_before), found(now, turns)
    formed = {new[key] for key in new.keys() - old.keys()}
    broken = {old[key] for key in old.keys() - new.keys()}
    return formed, broken, len(new.keys() & old.keys())


def check(changes, wanted):
    """Each exactly once, in ascending order; returns how many there are of each."""
    for side, want in zip(changes, wanted):
        listed = list(zip(side[0].tolist(), side[1].tolist(), map(tuple, side[2].tolist())))
        assert listed == sorted(listed)
        assert rows(*side) == want and len(listed) == len(want)
    return np.array([len(side[0]) for side in changes])


KINDS = [None, "slab", *BOX_KINDS]


@pytest.mark.parametrize("kind", KINDS)
def test_random_walks_with_jumps(rng, kind):
    """Of each kind of box with any skin, and in any number of dimensions."""
    for ndim in (1, 2, 3, 4):
        walk(rng, kind, ndim, (0.0, 0.1, "auto")[(ndim + KINDS.index(kind)) % 3])


def walk(rng, kind, ndim, skin):
    index_dtype = np.int64 if ndim % 2 else np.int32
    box = None if kind is None else random_box(rng, "triclinic" if kind == "slab" else kind, ndim)
    periodic = None if kind != "slab" else [axis != ndim - 1 for axis in range(ndim)]
    pair_list = hs.VerletList(0.35, skin, box=box, periodic=periodic, track_changes=True)
    options = {} if box is None else {"periodic": periodic}
    points = rng.random((40, ndim))
    before = (points[:0], box), np.zeros((0, ndim), int)
    seen, rebuilt = np.zeros(2, int), set()
    turns = np.zeros((40, ndim), int)
    for _ in range(8):
        given = points if box is None else points + turns @ box
        rebuilt.add(pair_list.update(given))
        changes = pair_list.changes(quantities="ijS", index_dtype=index_dtype)
        assert changes.formed[0].dtype == changes.broken[1].dtype == index_dtype
        *wanted, _ = expected(0.35, *before, (given, box), turns, options)
        seen += check(changes, wanted)
        before = (given, box), turns
        points = points + rng.normal(0.0, 0.01, points.shape)
        if box is not None:
            jumps = rng.integers(-3, 4, turns.shape) * (rng.random((40, 1)) < 0.3)
            turns = turns + jumps * (True if periodic is None else periodic)
    assert seen.min() > 5 and True in rebuilt
    assert skin != 0.1 or rebuilt == {True, False}


@pytest.mark.parametrize("kind, ndim", [(BOX_KINDS[0], 1), (BOX_KINDS[-1], 2), ("triclinic", 3)])
def test_several_images_of_the_same_two_points(rng, kind, ndim):
    """A cutoff beyond the box: pairs of a point with itself, and several of the same two."""
    box = random_box(rng, kind, ndim, length=0.5)
    pair_list = hs.VerletList(1.1, 0.1, track_changes=True)
    fractions = rng.random((5, ndim))
    turns = np.zeros(fractions.shape, int)
    before = (np.zeros((0, ndim)), box), turns[:0]
    went = np.zeros(2, int)
    for step in range(8):
        vectors = box * (1.0 + 0.05 * math.sin(step))
        points = (fractions + turns) @ vectors
        pair_list.update(points, vectors)
        *wanted, _ = expected(1.1, *before, (points, vectors), turns)
        went += check(pair_list.changes(quantities="ijS"), wanted)
        before = (points, vectors), turns
        fractions = fractions + rng.normal(0.0, 0.02, fractions.shape)
        turns = turns + rng.integers(-2, 3, turns.shape)
    assert went.min() > 3


@pytest.mark.parametrize("stray", [False, True])
def test_drift_of_all_points_breaks_nothing(rng, stray):
    """By half a box and more in a step, which no rule for single points could tell. The drift is
    that of the first point, unless that has another one."""
    box = random_box(rng, "triclinic")
    points = rng.random((60, 3)) @ box
    pair_list = hs.VerletList(0.4, 0.2, box=box, track_changes=True)
    for step in range(6):
        drifted = points + 0.5 * step * box[0] + 0.77 * step * box[2]
        if stray:
            drifted[0] = rng.random(3) @ box
        pair_list.update(hs.Box(box).wrap(drifted)[0] if step % 2 else drifted)
        formed, broken = pair_list.changes(quantities="ijd")
        if step:
            near = np.r_[formed[2][formed[0] >= stray], broken[2][broken[0] >= stray]]
            assert len(pair_list.pairs(quantities="i")) > 200  # but for rounding of the drift
            assert np.all(abs(near - 0.4) < 1e-13)


@pytest.mark.parametrize("turned", [[[0, 1], [1, 0]], [[-1, 0], [0, 1]], [[1, 1], [0, -1]]])
def test_another_basis_breaks_nothing(rng, turned):
    """Pairs of a point with its own image, too, of which the search finds another one then."""
    box = np.array([[0.6, 0.1], [0.05, 0.5]])
    points = rng.random((6, 2))
    pair_list = hs.VerletList(0.9, 0.1, track_changes=True)
    pair_list.update(points, box)
    assert len(pair_list.changes().formed[0]) > 40
    pair_list.update(points, np.array(turned) @ box)
    assert [len(side) for side in pair_list.changes(quantities="i")] == [0, 0]


def test_a_box_that_becomes_another_one(rng):
    """Twice as long is no other basis: images then go by their numbers."""
    points = rng.random((10, 1)) * 1e-3
    pair_list = hs.VerletList(1.5, 0.1, track_changes=True)
    before = None
    for box in ([[1.0]], [[2.0]], [[1e-2]], [[2.0]]):
        pair_list.update(points, box)
        i, j, S = hs.pairs(points, 1.5, box=box, quantities="ijS")
        if before is not None:
            formed, broken = pair_list.changes(quantities="ijS")
            assert rows(*formed) <= rows(i, j, S) and rows(*broken) <= rows(*before)
            kept = rows(i, j, S) - rows(*formed)
            assert len(kept) == len(before[0]) - len(broken[0]) >= 45
        before = i, j, S


def test_quantities_are_those_of_their_step(rng):
    box = random_box(rng, "triclinic")
    points = rng.random((60, 3))
    pair_list = hs.VerletList(0.4, 0.1, box=box, track_changes=True)
    scenes = []
    for step in range(4):
        scenes.append(points % 1.0)
        pair_list.update(scenes[-1])
        if step in (1, 3):  # not known from the step before; then other letters; then the same
            for letters in ("PdDS", "Sid", "PdDS", "PdDS"):
                formed, broken = pair_list.changes(quantities=letters)
                for side, scene in ((formed, scenes[-1]), (broken, scenes[-2])):
                    every = hs.pairs(scene, 0.4, box=box, quantities=letters, sort=True)
                    at = dict(zip(every[letters.index("d")].tolist(), itertools.count()))
                    chosen = [at[d] for d in side[letters.index("d")].tolist()]
                    assert chosen == sorted(chosen)
                    assert same_arrays(side, tuple(column[chosen] for column in every))
        points = points + rng.normal(0.0, 0.03, points.shape)
    assert isinstance(pair_list.changes(quantities="d").formed, np.ndarray)


def test_another_number_of_dimensions_breaks_all(rng):
    pair_list = hs.VerletList(0.5, track_changes=True)
    flat, solid = rng.random((20, 2)), rng.random((20, 3))
    pair_list.update(flat)
    pair_list.update(solid)
    formed, broken = pair_list.changes(quantities="ijd")
    assert same_arrays(formed, hs.pairs(solid, 0.5, quantities="ijd", sort=True))
    assert same_arrays(broken, hs.pairs(flat, 0.5, quantities="ijd", sort=True))


@pytest.mark.parametrize("limit", [0, 2**62])
def test_pairs_with_too_many_images_for_one_number(rng, monkeypatch, limit):
    monkeypatch.setattr(arrays, "MOST_KEYS", limit)
    box = random_box(rng, "triclinic")
    pair_list = hs.VerletList(0.4, 0.1, box=box, track_changes=True)
    points = rng.random((40, 3))
    before = (points, box), np.zeros((40, 3), int)
    pair_list.update(points)
    points, turns = points + rng.normal(0.0, 0.05, points.shape), rng.integers(-4, 5, (40, 3))
    pair_list.update(points + turns @ box)
    *wanted, kept = expected(0.4, *before, (points + turns @ box, box), turns)
    assert check(pair_list.changes(quantities="ijS"), wanted).min() > 5 and kept > 20


def test_refusals(rng):
    with pytest.raises(RuntimeError, match="track_changes=True"):
        hs.VerletList(1.0).changes()
    with pytest.raises((TypeError, ValueError), match="track_changes"):
        hs.VerletList(1.0, track_changes="yes")
    pair_list = hs.VerletList(1.0, track_changes=True)
    with pytest.raises(RuntimeError, match="call update first"):
        pair_list.changes()
    pair_list.update(rng.random((4, 3)))
    for wrong in ("ii", "x", "", 3, "ijSS"):
        like_pairs = pytest.raises((TypeError, ValueError))
        with like_pairs as caught:
            pair_list.changes(quantities=wrong)
        with pytest.raises(caught.type) as of_pairs:
            pair_list.pairs(quantities=wrong)
        assert str(of_pairs.value) == str(caught.value)
    with pytest.raises((TypeError, ValueError), match="index_dtype"):
        pair_list.changes(index_dtype=np.int16)
    far = hs.VerletList(0.5, 0.1, box=[1.0, 1.0], track_changes=True)
    far.update([[0.25, 0.5], [0.5 + 2.0**33, 0.5]])
    with pytest.raises(OverflowError, match="too many box vectors away"):
        far.changes()


def goes_on(before, now, old, new):
    """Pairs of both lists that are the same by the definition, in fractions; one basis for both."""
    (points_before, vectors_before), (points_now, vectors_now) = before, now

    def in_units(point, vectors):
        """X with X @ vectors nearest to the point: by the normal equations, and Cramer's rule."""
        rows = [[Fraction(x) for x in row] for row in vectors.tolist()]
        target = [Fraction(x) for x in point]
        gram = [[sum(a * b for a, b in zip(p, q)) for q in rows] for p in rows]
        right = [sum(a * b for a, b in zip(p, target)) for p in rows]
        if len(rows) == 1:
            return [right[0] / gram[0][0]]
        whole = gram[0][0] * gram[1][1] - gram[0][1] ** 2
        return [
            (right[0] * gram[1][1] - right[1] * gram[0][1]) / whole,
            (right[1] * gram[0][0] - right[0] * gram[0][1]) / whole,
        ]

    places = [
        [in_units(x, vectors) for x in points.tolist()]
        for points, vectors in ((points_before, vectors_before), (points_now, vectors_now))
    ]
    axes = range(len(vectors_before))
    same = set()
    for i, j, *S in old:
        more = [
            (places[1][j][k] - places[1][i][k]) - (places[0][j][k] - places[0][i][k]) for k in axes
        ]
        turns = [math.floor(x + Fraction(1, 2)) for x in more]
        image = tuple(S[k] - turns[k] if k in axes else S[k] for k in range(len(S)))
        image = upright(i, j, image)
        if image in new:
            same.add(((i, j, *S), image))
    return same


@pytest.mark.parametrize("skew", [0, 1, 5, 2**20])
def test_jumps_by_whole_vectors_are_told_exactly_in_any_unit(rng, skew):
    jumps_in(rng, 0, 1, skew)
    for exponent in (-1060, -1030, -100, 0, 980):
        jumps_in(rng, exponent, 2, skew)


def jumps_in(rng, exponent, n_axes, skew):
    """Whole numbers of one unit as coordinates, so that sums of points and vectors are exact."""
    vectors = np.array([[16, 0], [16 * skew + 3, 16]])[:n_axes]
    points = rng.integers(0, 16, (25, 2))
    unit = 2.0**exponent
    box = np.zeros((2, 2))
    box[:n_axes] = vectors
    pair_list = hs.VerletList(
        7.5 * unit, box=box * unit, periodic=[k < n_axes for k in range(2)], track_changes=True,
        skin=0.0,
    )  # fmt: skip
    pair_list.update(points * unit)
    seen = rows(*pair_list.changes(quantities="ijS").formed)
    jumps = rng.integers(-5, 6, (25, n_axes)) @ vectors
    pair_list.update((points + jumps) * unit)
    changes = pair_list.changes(quantities="ijS")
    assert len(seen) > 40
    assert [len(side[0]) for side in changes] == [0, 0]
    # Everything at once: moves of up to half a vector and beyond, which many points share exactly.
    moves = rng.integers(-9, 10, (25, 2))
    moved = points + rng.integers(-5, 6, (25, n_axes)) @ vectors + moves
    pair_list.update(moved * unit)
    i, j, S = hs.pairs(
        moved * unit, 7.5 * unit, box=box * unit, periodic=[k < n_axes for k in range(2)],
        quantities="ijS",
    )  # fmt: skip
    old = rows(*hs.pairs(
        (points + jumps) * unit, 7.5 * unit, box=box * unit,
        periodic=[k < n_axes for k in range(2)], quantities="ijS",
    ))  # fmt: skip
    new = rows(i, j, S)
    same = goes_on((points + jumps, vectors), (moved, vectors), old, new)
    wanted = new - {b for _, b in same}, old - {a for a, _ in same}
    counts = check(pair_list.changes(quantities="ijS"), wanted)
    assert counts.min() > 3 and len(same) > 3


def test_a_move_by_just_half_a_vector_does_not_depend_on_wrapping():
    """One of the two images goes on, the same wherever the points are written down."""
    found = set()
    for turns in range(-3, 4):
        pair_list = hs.VerletList(6.0, box=[8.0], track_changes=True)
        pair_list.update([[0.0], [1.0]])
        pair_list.update([[0.0], [5.0 + 8.0 * turns]])
        formed, broken = pair_list.changes(quantities="ijDS")
        found.add((tuple(formed[2][:, 0].tolist()), tuple(broken[2][:, 0].tolist())))
        assert len(formed[0]) + len(broken[0]) == 1
    assert len(found) == 1


def test_far_points_and_another_box_are_compared_exactly(rng):
    """Coordinates of 2^27 boxes; the deformation of the box moves points by millions of vectors."""
    vectors = np.array([[8.0, 0.0], [3.0, 8.0]])
    deformed = np.array([[8.25, 0.5], [3.0, 7.5]])
    points = rng.integers(0, 8, (30, 2)) + 2.0**-3
    far = points + rng.integers(-(2**27), 2**27, (30, 2)) @ vectors
    moved = far + rng.integers(-2, 3, (30, 2)) @ vectors + rng.integers(-4, 5, (30, 2))
    pair_list = hs.VerletList(5.0, box=vectors, track_changes=True)
    pair_list.update(far)
    pair_list.update(moved, box=deformed)
    old = rows(*hs.pairs(far, 5.0, box=vectors, quantities="ijS"))
    new = rows(*hs.pairs(moved, 5.0, box=deformed, quantities="ijS"))
    same = goes_on((far, vectors), (moved, deformed), old, new)
    wanted = new - {b for _, b in same}, old - {a for a, _ in same}
    check(pair_list.changes(quantities="ijS"), wanted)
