# SPDX-License-Identifier: BSD-3-Clause
"""What counts at exactly the limit: the table of docs/exactness.md, by function."""

import inspect
import re
from functools import partial

import numpy as np

import halfshell as hs
from calls import call
from checkout import ROOT

POINTS = np.array([[0.0, 0.0], [3.0, 4.0]])  # at distance 5
CELLS = hs.CellList(POINTS, 7.0)
BALL = hs.CellList(POINTS, 5.0)


def visited(**how):
    return call(hs.for_each_pair, POINTS, 5.0, lambda *pair: None, **how)


def kept(inclusive=True):
    pair_list = hs.VerletList(5.0, 0.5, inclusive=inclusive)
    pair_list.update(POINTS)
    return len(pair_list.pairs(quantities="i"))


CHOOSES = {
    "pairs": lambda **how: len(call(hs.pairs, POINTS, 5.0, quantities="i", **how)),
    "pairs_between": lambda **how: len(
        call(hs.pairs_between, POINTS[:1], POINTS[1:], 5.0, quantities="i", **how)
    ),
    "iter_pairs": lambda **how: sum(
        map(len, call(hs.iter_pairs, POINTS, 5.0, quantities="i", **how))
    ),
    "for_each_pair": visited,
    "trajectory_pairs": lambda **how: sum(
        map(len, call(hs.trajectory_pairs, [POINTS], 5.0, quantities="i", **how))
    ),
    "neighbors": lambda **how: call(hs.neighbors, POINTS, 5.0, **how).n_entries // 2,
    "coordination": lambda **how: call(hs.coordination, POINTS, 5.0, **how)[0],
    "count_pairs": lambda **how: call(hs.count_pairs, POINTS, 5.0, **how),
    "several cutoffs": lambda **how: call(hs.count_pairs, POINTS, [1.0, 5.0], **how)[1],
    "verify": lambda **how: call(hs.verify, POINTS, 5.0, [], [], **how).n_expected,
    "clusters": lambda **how: 2 - len(call(hs.clusters, POINTS, 5.0, **how).sizes),
    "bricks": lambda **how: sum(
        part.count_pairs(POINTS, **how) for part in hs.bricks(POINTS, 5.0, 2)
    ),
    "explain": lambda **how: call(hs.explain, POINTS, 5.0, measure=True, **how).measured["pairs"],
    "CellList.pairs": lambda **how: len(BALL.pairs(quantities="i", **how)),
    "CellList.iter_pairs": lambda **how: len([*CELLS.iter_pairs(5.0, quantities="i", **how)]),
    "CellList.for_each_pair": lambda **how: CELLS.for_each_pair(lambda *pair: None, 5.0, **how),
    "CellList.neighbors": lambda **how: BALL.neighbors(**how).n_entries // 2,
    "CellList.query": lambda **how: BALL.query([[-3.0, -4.0]], **how).n_entries,
    "CellList.query, a radius each": lambda **how: (
        CELLS.query([[-3.0, -4.0], [9.0, 9.0]], [5.0, 0.1], **how).n_entries
    ),
    "CellList.coordination": lambda **how: CELLS.coordination(5.0, **how)[1],
    "CellList.count_pairs": lambda **how: CELLS.count_pairs(5.0, **how),
    "VerletList": kept,
}


def test_the_ball_is_closed_unless_inclusive_is_false():
    for name in CHOOSES:
        assert CHOOSES[name]() == CHOOSES[name](inclusive=True) == 1
        assert CHOOSES[name](inclusive=False) == 0


def test_nearest_is_always_closed():
    for nearest in (partial(hs.nearest, POINTS, 1), partial(CELLS.nearest, 1)):
        assert nearest(max_distance=5.0, quantities="j").tolist() == [[1], [0]]
        less = np.nextafter(5.0, 0.0)
        assert nearest(max_distance=less, quantities="j").tolist() == [[-1], [-1]]


def test_bins_are_half_open_and_the_last_one_is_closed():
    for histogram in (lambda edges: hs.pair_histogram(POINTS, edges), CELLS.pair_histogram):
        assert histogram([0.0, 5.0, 6.0]).tolist() == [0, 1]
        assert histogram([0.0, 4.0, 5.0]).tolist() == [0, 1]
        assert histogram([5.0, 6.0]).tolist() == [1]
    assert hs.rdf(POINTS, 5.0, bins=5, box=100.0).counts.tolist() == [0, 0, 0, 0, 1]
    assert hs.rdf(POINTS, 10.0, bins=2, box=100.0).counts.tolist() == [0, 1]


def test_candidates_have_all_of_the_closed_ball():
    block = BALL.candidates([[-3.0, -4.0]])
    found = [BALL.order[a:b] for a, b in zip(block.start, block.stop)]
    assert 0 in np.concatenate(found)


def test_boxes_are_half_open():
    wrapped, shifts = hs.Box([2.0, 4.0]).wrap([[0.0, 4.0], [2.0, -4.0]])
    assert wrapped.tolist() == [[0.0, 0.0]] * 2 and shifts.tolist() == [[0, -1], [-1, 1]]


def test_the_table_names_every_function_with_a_limit():
    text = (ROOT / "docs/exactness.md").read_text()
    table = text.split("## What is closed")[1].split("\n## ")[0]
    named = set(re.findall(r"`([\w.]+)`", "".join(re.findall(r"^\| ([^|]*)\|", table, re.M))))
    limits = {"cutoff", "edges", "max_distance", "radius"}
    for name in hs.__all__:
        value = getattr(hs, name)
        if inspect.isfunction(value) and limits & set(inspect.signature(value).parameters):
            assert name in named, name
    assert {"CellList", "VerletList"} <= named
    for name in named:
        value = hs
        for part in name.split("."):
            value = getattr(value, part)
