# SPDX-License-Identifier: BSD-3-Clause
"""Which pairs count: groups, excluded pairs, a least distance, against fractions in every box."""


import numpy as np
import pytest

import halfshell as hs
from calls import call

# ---- scenes ----------------------------------------------------------------------------------


def test_large_scenes_are_those_of_a_filter():
    rng = np.random.default_rng(3)
    points, box = rng.random((20000, 3)) * 10.0, [10.0] * 3
    molecule = np.arange(20000) // 4
    i, j, d = hs.pairs(points, 0.6, box=box, quantities="ijd", sort=True)
    other = molecule[i] != molecule[j]
    for threads in (1, 2):
        found = call(
            hs.pairs,
            points,
            0.6,
            box=box,
            quantities="ijd",
            sort=True,
            exclude=molecule,
            threads=threads,
        )
        for column, all_of_it in zip(found, (i, j, d), strict=True):
            assert column.tobytes() == all_of_it[other].tobytes()
        found = hs.pairs(
            points, 0.6, box=box, quantities="ij", sort=True, min_distance=0.3, threads=threads
        )
        assert found[0].tobytes() == i[d >= 0.3].tobytes()
        found = call(
            hs.pairs,
            points,
            0.6,
            box=box,
            quantities="ij",
            sort=True,
            groups=molecule % 7,
            threads=threads,
        )
        assert found[0].tobytes() == i[molecule[i] % 7 == molecule[j] % 7].tobytes()


def test_names_are_labels_too():
    points = [[0.0], [1.0], [2.0]]
    for labels in (["a", "a", "b"], np.array(["a", "a", "b"]), np.array(["a", "a", "b"], object)):
        assert call(hs.pairs, points, 1.0, groups=labels, quantities="P").tolist() == [[0, 1]]
        assert call(hs.pairs, points, 1.0, exclude=labels, quantities="P").tolist() == [[1, 2]]
    found = call(
        hs.pairs_between,
        [[0.0]],
        points,
        5.0,
        groups=["a", "b", "a"],
        query_groups=["b"],
        quantities="j",
    )
    assert found.tolist() == [1]


def test_the_largest_labels():
    labels = [np.iinfo(np.int64).min, np.iinfo(np.int64).max]
    points = [[0.0], [1.0]]
    assert call(hs.count_pairs, points, 1.0, exclude=labels, exclude_within=2**63 - 1) == 1
    assert call(hs.count_pairs, points, 1.0, exclude=[0, labels[1]], exclude_within=2**63 - 1) == 0


def test_extreme_units():
    for scale in (2.0**-1030, 2.0**-500, 1.0, 2.0**500, 2.0**1000):
        points = np.array([[0.0], [1.0], [2.0], [3.0]]) * scale
        found = hs.pairs(
            points,
            2.0 * scale,
            box=[4.0 * scale],
            exclude=[[0, 1], [0, 2]],
            min_distance=scale,
            quantities="ijS",
            sort=True,
        )
        assert [column.tolist() for column in found] == [
            [0, 0, 1, 1, 1, 2],
            [2, 3, 2, 3, 3, 3],
            [[0], [-1], [0], [-1], [0], [0]],
        ]
        nearer = hs.count_pairs(points, 2.0 * scale, min_distance=np.nextafter(scale, np.inf))
        assert nearer == 2
        for limit in (np.inf, 2.0 * scale):
            j, S = hs.nearest(
                points, 2, max_distance=limit, box=[4.0 * scale], exclude=[[0, 1], [0, 2]],
                min_distance=scale, quantities="jS",
            )  # fmt: skip
            assert j.tolist() == [[3, 2], [2, 3], [1, 3], [0, 2]]
            assert S[..., 0].tolist() == [[-1, 0], [0, -1], [0, 0], [1, 0]]
        j = hs.nearest(points, 4, min_distance=np.nextafter(scale, np.inf), quantities="j")
        assert j.tolist() == [[2, 3, -1, -1], [3, -1, -1, -1], [0, -1, -1, -1], [1, 0, -1, -1]]
        j = hs.nearest(points, 3, max_distance=2.0 * scale, inclusive=False, quantities="j")
        assert j.tolist() == [[1, -1, -1], [0, 2, -1], [1, 3, -1], [2, -1, -1]]


BAD = [
    ({"groups": [0, 1]}, ValueError, r"groups must have shape \(3,\), one for each point"),
    ({"groups": [0.0, 1.0, 2.0]}, TypeError, "groups must hold integers or names"),
    ({"groups": np.array([2**64 - 1, 0, 0], np.uint64)}, ValueError, "groups must be less than"),
    ({"exclude": [0.5, 1, 2]}, TypeError, "labels must hold integers or names"),
    ({"exclude": [[0, 1, 2]]}, ValueError, r"exclude must be pairs of numbers, shape \(k, 2\)"),
    ({"exclude": [[0, 3]]}, ValueError, r"exclude\[:, 1\] must be numbers of points, from 0 to 2"),
    ({"exclude": [[-1, 0]]}, ValueError, r"exclude\[:, 0\] must be numbers of points"),
    ({"exclude": 1}, ValueError, "a whole number as exclude needs labels, and points have none"),
    (
        {"exclude": 0.5},
        TypeError,
        "exclude must be pairs of numbers, .* or a whole number, got 0.5",
    ),
    ({"exclude": -1, "labels": [0, 1, 2]}, ValueError, "exclude must be from 0"),
    ({"exclude": 2**63, "labels": [0, 1, 2]}, ValueError, "exclude must be from 0"),
    ({"exclude": 1, "labels": ["a", "b", "c"]}, ValueError, "exclude must be 0 where labels are"),
    ({"min_distance": -1.0}, ValueError, "min_distance must be finite and not negative"),
    ({"min_distance": 0.5, "precision": "single"}, ValueError, "cannot be combined with precision"),
]


def test_bad_choices():
    for chosen, kind, words in BAD:
        points = [[0.0], [1.0], [2.0]]
        for batch in (None, [0, 0, 0]):
            for search in (hs.pairs, hs.iter_pairs, hs.neighbors, hs.count_pairs, hs.coordination):
                with pytest.raises(kind, match=words):
                    call(search, points, 1.0, batch=batch, **chosen)
    with pytest.raises(ValueError, match=r"got shape \(3,\): labels are those of Points"):
        hs.pairs(points, 1.0, exclude=[0, 1, 2])
    with pytest.raises(ValueError, match=r"got shape \(2,\): one pair is \[\[i, j\]\]"):
        hs.pairs(points, 1.0, exclude=[0, 1])


def test_labels_of_both_sets():
    points, queries = [[0.0], [1.0]], [[0.5]]
    with pytest.raises(
        ValueError, match="points have groups, and queries have none: both need them"
    ):
        call(hs.pairs_between, queries, points, 1.0, groups=[0, 1])
    with pytest.raises(ValueError, match="exclude needs labels, and points have none"):
        call(hs.pairs_between, queries, points, 1.0, query_exclude=[0], exclude=0)
    with pytest.raises(TypeError, match="both be numbers or both be names"):
        call(hs.pairs_between, queries, points, 1.0, groups=[0, 1], query_groups=["a"])
    with pytest.raises(ValueError, match=r"exclude\[:, 0\] must be numbers of queries"):
        hs.pairs_between(queries, points, 1.0, exclude=[[1, 0]])


def test_inputs_stay_and_empty_ones_are_nothing():
    points = np.array([[0.0], [1.0]])
    exclude = np.array([[1, 0], [0, 1]])
    before = exclude.copy()
    assert hs.count_pairs(points, 1.0, exclude=exclude) == 0
    assert (exclude == before).all()
    for nothing in ([], np.empty((0, 2), int)):
        assert hs.count_pairs(points, 1.0, exclude=nothing) == 1
    empty = np.empty((0, 3))
    assert call(hs.count_pairs, empty, 1.0, groups=[], exclude=[], min_distance=0.5) == 0


def test_g_of_r_between_molecules():
    points = np.random.default_rng(6).random((600, 3)) * 5.0
    molecule = np.arange(600) // 3
    whole = hs.rdf(points, 2.0, 20, box=[5.0] * 3)
    parts = [call(hs.rdf, points, 2.0, 20, box=[5.0] * 3, exclude=molecule),
             call(hs.rdf, points, 2.0, 20, box=[5.0] * 3, groups=molecule)]  # fmt: skip
    assert (parts[0].counts + parts[1].counts == whole.counts).all() and parts[1].counts.sum() > 0
    assert np.allclose(parts[0].g + parts[1].g, whole.g)
    named = call(
        hs.rdf, points, 2.0, 20, box=[5.0] * 3, exclude=molecule, types=["a", "b", "a"] * 200
    )
    assert (np.array(named.counts).shape) == (2, 2, 20)
