# SPDX-License-Identifier: BSD-3-Clause
"""Bricks: all of them together say what one search of everything says, byte for byte."""

import itertools
import pickle

import numpy as np
import pytest

import halfshell as hs
from brick_scenes import LETTERS, NO_INVERSE, every_scene, in_order, rows_of, same, without_rule

SCENES = every_scene()


@pytest.mark.parametrize("name, n", [*zip(SCENES, itertools.cycle([7, 1, 2, 40, 3]))])
def test_together_they_are_one_search(name, n):
    known, cutoff, scene, which = SCENES[name]
    points, rest = hs.Points(**known, **scene), without_rule(which)
    parts = hs.bricks(points, cutoff, n, **({} if rest == which else {"rule": which["rule"]}))
    assert len(parts) == n
    owned = np.concatenate([part.owned for part in parts])
    assert np.array_equal(np.sort(owned), np.arange(len(points)))
    assert max(parts.sizes) - min(parts.sizes) <= 1
    whole = hs.pairs(points, cutoff, quantities=LETTERS, sort=True, **which)
    found = [part.pairs(points, quantities=LETTERS, **rest) for part in parts]
    assert same(in_order([np.concatenate(column) for column in zip(*found, strict=True)]), whole)
    assert sum(part.count_pairs(points, **rest) for part in parts) == len(whole[0])
    table = hs.neighbors(points, cutoff, quantities="jdS", **which)
    for part in pickle.loads(pickle.dumps(list(parts))):
        assert (np.diff(part.owned) > 0).all() and (np.diff(part.needed) > 0).all()
        assert not set(part.owned.tolist()) & set(part.needed.tolist())
        some = hs.Points(**rows_of(known, part.members))  # those alone will do, with own names
        rows = part.neighbors(some, quantities="jdS", **rest)
        names = ("counts", "indices", "distances", "shifts")
        assert same(*([getattr(one, key) for key in names] for one in (rows, table[part.owned])))


def test_images_whose_shifts_no_column_holds():
    box = NO_INVERSE
    points = np.random.default_rng(6).random((200, 2)) @ box
    parts = hs.bricks(points, 100.0, 4, box=box)
    assert sum(part.count_pairs(points) for part in parts) == hs.count_pairs(points, 100.0, box=box)
    assert parts.overhead < 2.0


def test_a_box_that_no_cutoff_of_0_can_be_searched_in():
    rng = np.random.default_rng(2)
    box = np.array([[900.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.1, -0.1, 0.6]])
    points = (rng.random((17, 3)) * 2.0 - 1.0) @ box * 2.0 ** rng.integers(36, 47)
    scene = {"box": box, "periodic": [False, False, True]}
    with pytest.raises(ValueError, match="does not place it in the box"):
        hs.bricks(points, 0.0, 3, **scene)
    parts = hs.bricks(points, 4.0, 3, **scene)
    assert sum(part.count_pairs(points) for part in parts) == 102
    assert hs.count_pairs(points, 4.0, **scene) == 102


def test_bricks_follow_the_points():
    rng = np.random.default_rng(1)
    points = np.concatenate((rng.random((900, 3)), 1e6 + rng.random((100, 3))))
    parts = hs.bricks(points, 0.05, 10)
    assert parts.sizes == [100] * 10
    assert sum(900 <= part.owned.min() for part in parts) == 1  # the far ones are one brick
    assert parts.overhead < 2.0
    uniform = rng.random((20000, 3))
    assert hs.bricks(uniform, 0.02, 8, box=[1.0] * 3).overhead < 1.3
    assert hs.bricks(uniform, 0.6, 8, box=[1.0] * 3).overhead == 8.0


def test_they_show_themselves():
    parts = hs.bricks(np.zeros((10, 2)), 1.0, 3)
    assert repr(parts) == "Bricks(3 of 10 points, overhead 3)"
    assert "<table>" in parts._repr_html_() and "n_points" in repr(parts[0])
    assert [len(part.owned) for part in parts[1:]] == parts.sizes[1:]
    assert len(hs.bricks(np.empty((0, 2)), 1.0, 3)) == 3
    assert hs.bricks(np.empty((0, 2)), 1.0, 3).overhead == 1.0


def test_bad_boxes_and_other_points():
    with pytest.raises(ValueError, match="vector 0 of box is zero"):
        hs.bricks([[0.0]], 1.0, 2, box=[0.0])
    part = hs.bricks(np.arange(10.0)[:, None], 1.0, 2)[0]
    for bad in (np.zeros((3, 1)), np.zeros(10), np.zeros((11, 1))):
        with pytest.raises(ValueError, match="points must have shape"):
            part.pairs(bad)
    with pytest.raises(ValueError, match="quantities"):
        part.pairs(np.zeros((10, 1)), quantities="x")


@pytest.mark.parametrize("precision", ["double", "single"])
def test_rounded_decisions_are_refused(precision):
    points = np.arange(10.0)[:, None]
    part = hs.bricks(points, 1.0, 2)[0]
    for method in (part.pairs, part.count_pairs, part.neighbors):
        with hs.settings(precision=precision), pytest.raises(ValueError, match="bricks need prec"):
            method(points)


def test_rules_with_a_direction_have_rows_and_no_pairs():
    rng = np.random.default_rng(8)
    points = hs.Points(rng.random((80, 2)) * 4.0, box=4.0, radii=rng.random(80))
    table = hs.neighbors(points, None, rule="scatter")
    parts = hs.bricks(points, None, 3, rule="scatter")
    for part in parts:
        assert np.array_equal(part.neighbors(points).indices, table[part.owned].indices)
        for method in (part.pairs, part.count_pairs):
            with pytest.raises(ValueError, match="'scatter' has a direction"):
                method(points)


def test_supports_that_are_nearly_flat_need_many_points():
    flat = np.array([[1.0, 0.0], [0.0, 1e-17]])
    points = np.array([[0.0, 0.0], [0.0, 5e16], [0.5, 1e17], [3.0, 0.0], [1e18, 0.0], [0.0, 2e18]])
    given = hs.Points(points, supports=np.broadcast_to(flat, (6, 2, 2)))
    parts = hs.bricks(given, 1.5, 3)
    found = np.concatenate([part.pairs(given, quantities="P") for part in parts])
    assert sorted(map(tuple, found.tolist())) == [(0, 1), (0, 2), (1, 2)]
    assert sorted(map(tuple, hs.pairs(given, 1.5, quantities="P").tolist())) == [
        (0, 1), (0, 2), (1, 2)]  # fmt: skip


def test_what_a_brick_does_not_take():
    points = hs.Points(np.arange(10.0)[:, None], box=20.0, types=["A", "B"] * 5)
    with pytest.raises(ValueError, match="bricks cannot be combined with batch"):
        hs.bricks([[[0.0]], [[1.0]]], 1.0, 2)
    with pytest.raises(TypeError, match="cutoff must be a number"):
        hs.bricks(points, [1.0, 2.0], 2)
    part = hs.bricks(points, {("A", "B"): 1.0}, 2)[0]
    with pytest.raises(ValueError, match="a box that is not that of the brick"):
        part.pairs(hs.Points(points.positions, box=10.0))
    with pytest.raises(ValueError, match="types of the divided points have no 'C'"):
        part.pairs(points.replace(types=["A", "C"] * 5))
    with pytest.raises(ValueError, match="exclude must be numbers of points, from 0 to 9"):
        part.pairs(points, exclude=[[0, 10]])
    for bad in ([0, 1], [[0.5, 1.0]], "x"):
        with pytest.raises((TypeError, ValueError), match="exclude"):
            part.pairs(points, exclude=bad)
