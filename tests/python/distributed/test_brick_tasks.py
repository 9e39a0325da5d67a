# SPDX-License-Identifier: BSD-3-Clause
"""What Dask and MPI do with bricks, without either: together the parts say what one search says."""

import pickle
import sys

import numpy as np
import pytest

import halfshell as hs
from brick_scenes import LETTERS, in_order, same, scenes, serial
from halfshell._functions import brick_tasks as tasks
from halfshell._functions import bricks
from halfshell._functions.bricks import Terms, divide, part_of, split, summary

HOW = {"precision": "exact"}
OPTIONS = {"inclusive": True, "threads": 1}


def parts_of(points, cutoff, options, n):
    array = np.asarray(points)
    chunks = np.array_split(array, 3)
    ndim = array.shape[1]
    terms = Terms(cutoff, None, options.get("box"), options.get("periodic"), ndim, ())
    each = [(chunk, ndim, array.dtype, k, {}) for k, chunk in enumerate(chunks)]
    summaries = [tasks.summary_of(*one, len(each)) for one in each]
    division = pickle.loads(pickle.dumps(divide(terms, n, *summaries)))
    pieces = [tasks.pieces_of(*one, division) for one in each]
    parts = [part_of(division, *[piece[k] for piece in pieces]) for k in range(n)]
    return pickle.loads(pickle.dumps(parts)), division


@pytest.mark.parametrize("number, name", [*enumerate(scenes())])
def test_parts_are_one_search(number, name, monkeypatch):
    """Points of a piece are divided some at a time, or all of them at once."""
    scene = scenes()[name]
    for tile, n in ((7, 7), (1 << 16, (1, 2, 50)[number % 3])):
        monkeypatch.setattr(bricks, "_TILE", tile)
        check_parts(*scene, n)


def check_parts(points, cutoff, scene, n):
    parts, division = parts_of(points, cutoff, scene, n)
    found = [tasks.pairs_of(part, HOW, {**OPTIONS, "quantities": LETTERS}) for part in parts]
    columns = [np.concatenate(column) for column in zip(*(one[0][1:] for one in found))]
    expected = serial(points, cutoff, scene)
    assert same(in_order(columns), expected)
    cuts = [tasks.cut(groups, division, n) for groups in found]
    ranges = [tasks.merged(*[one[k] for one in cuts])[0][1:] for k in range(n)]
    assert same([np.concatenate(column) for column in zip(*ranges)], expected)
    cutoffs = np.array([0.0, cutoff / 2.0, cutoff])
    counts = [tasks.counts_of(part, HOW, cutoffs, OPTIONS) for part in parts]
    assert tasks.total(*counts).tolist() == hs.count_pairs(points, cutoffs, **scene).tolist()
    edges = np.array([0.0, cutoff / 3.0, cutoff])
    binned = [tasks.histogram_of(part, HOW, edges, {"threads": 1}) for part in parts]
    assert tasks.total(*binned).tolist() == hs.pair_histogram(points, edges, **scene).tolist()
    counts = [tasks.coordination_of(part, HOW, OPTIONS) for part in parts]
    assert same([tasks.merged(*counts)[0][1]], [hs.coordination(points, cutoff, **scene)])
    rows = [tasks.neighbors_of(part, HOW, {**OPTIONS, "quantities": "jdDS"}) for part in parts]
    table = tasks.table_of("jdDS", True, division, *rows)
    whole = hs.neighbors(points, cutoff, quantities="jdDS", **scene)
    names = ("offsets", "indices", "distances", "vectors", "shifts")
    assert same([getattr(table, key) for key in names], [getattr(whole, key) for key in names])
    made = tasks.bricks_of(division, *[tasks.brick_of(part) for part in parts])
    assert sum(made.sizes) == len(points) and len(made) == n
    owned = np.concatenate([brick.owned for brick in made])
    assert sorted(owned.tolist()) == list(range(len(points)))


def test_chunks_are_what_the_whole_says():
    chunks = [np.zeros((2, 3)), np.zeros((2, 2))]
    with pytest.raises(ValueError, match=r"3 columns in every chunk; chunk 1 has shape \(2, 2\)"):
        for place, chunk in enumerate(chunks):
            tasks.of_chunk(chunk, 3, np.dtype(float), place, {})
    with pytest.raises(TypeError, match=r"float64 in every chunk.*chunk 1 is of int64"):
        tasks.of_chunk(np.ones((2, 3), np.int64), 3, np.dtype(float), 1, {})
    with pytest.raises(ValueError, match=r"points\[5, 1\]"):  # of all
        bad = np.array([[0.0, 1.0, 2.0], [3.0, np.nan, 4.0]])
        parts_of(np.concatenate((np.zeros((4, 3)), bad)), 1.0, {}, 2)


def test_masked_points_are_refused_by_their_place():
    whole = np.ma.masked_array(np.ones((3, 2)))
    assert same([tasks.of_chunk(whole, 2, np.dtype(float), 0, {}).positions], [whole.data])
    hidden = np.ma.masked_array(np.ones((3, 2)), [[False, False], [False, True], [False, False]])
    with pytest.raises(ValueError, match="masked"):
        tasks.of_chunk(hidden, 2, np.dtype(float), 0, {})


def test_types_of_all_chunks_are_numbers_or_names():
    chunks = [hs.Points(np.zeros((2, 3)), types=types) for types in ([0, 1], ["A", "B"])]
    terms = Terms({("*", "*"): 1.0}, None, None, None, 3, ("types",))
    with pytest.raises(TypeError, match="types of all points must be numbers, or of all be names"):
        divide(terms, 2, *[summary(chunk, 2) for chunk in chunks])


def test_a_piece_that_is_sent_takes_only_its_points():
    points = hs.Points(np.arange(60.0).reshape(20, 3), radii=np.full(20, 0.5))
    terms = Terms(1.0, None, None, None, 3, ("radii",))
    division = divide(terms, 4, summary(points, 1))
    pieces = split(points, division, 0)
    here, sent = part_of(division, pieces[0]), pickle.loads(pickle.dumps(pieces[0]))
    assert {len(one) for one in sent.columns.values()} == {sum(here.sizes)}
    assert sum(here.sizes) < len(points)
    assert sys.getsizeof(pieces[0]) < points.positions.nbytes
    again = pickle.loads(pickle.dumps(sent))  # what was sent may be sent on
    for other in (sent, again):
        there = part_of(division, other)
        assert there.sizes == here.sizes and there.columns.keys() == {"positions", "radii"}
        assert same(there.columns.values(), here.columns.values())
        assert there.numbers().tolist() == here.numbers().tolist()
