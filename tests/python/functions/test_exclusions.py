# SPDX-License-Identifier: BSD-3-Clause
"""Which pairs count: groups, excluded pairs, a least distance, against fractions in every box."""


import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import same_arrays

# ---- scenes ----------------------------------------------------------------------------------


def test_large_scenes_are_those_of_a_filter():
    rng = np.random.default_rng(3)
    points, box = rng.random((20000, 3)) * 10.0, [10.0] * 3
    molecule = np.arange(20000) // 4
    i, j, d = hs.pairs(points, 0.6, box=box, quantities="ijd", sort=True)
    cases = [
        ({"exclude": molecule}, molecule[i] != molecule[j]),
        ({"groups": molecule % 7}, molecule[i] % 7 == molecule[j] % 7),
        ({"min_distance": 0.3}, d >= 0.3),
    ]
    for how, is_kept in cases:
        for threads in (1, 2):
            how |= {"box": box, "quantities": "ijd", "sort": True, "threads": threads}
            found = call(hs.pairs, points, 0.6, **how)
            assert same_arrays(found, (i[is_kept], j[is_kept], d[is_kept]))


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
    exclude = np.array([[1, 0], [0, 1]])
    assert hs.count_pairs([[0.0], [1.0]], 1.0, exclude=exclude) == 0
    assert exclude.tolist() == [[1, 0], [0, 1]]
    assert hs.count_pairs([[0.0], [1.0]], 1.0, exclude=[]) == 1


def test_bonds_of_many_points_take_what_the_bonds_take():
    n = 2**31 - 1
    bonds = [[0, 1], [1, n - 1]]
    assert hs.bonded(bonds, n).tolist() == [[0, 1], [0, n - 1], [1, n - 1]]
    for many in (2**31, 2**63, 10**400):
        with pytest.raises(OverflowError, match=r"^n must be less than 2\*\*31, the most points"):
            hs.bonded(bonds[:1], many)


def test_bonded_pairs_are_those_of_powers_of_the_bonds():
    rng = np.random.default_rng(8)
    for within in (1, 2, 3, 4, 9):
        for n in (0, 1, 7, 25):
            bonds = rng.integers(0, max(n, 1), (n, 2))
            bonded = np.eye(n, dtype=bool)
            bonded[bonds[:, 0], bonds[:, 1]] = bonded[bonds[:, 1], bonds[:, 0]] = True
            reached = np.linalg.matrix_power(bonded.astype(float), within) > 0.0
            expected = np.argwhere(np.triu(reached, 1))
            assert np.array_equal(hs.bonded(bonds, n, within=within), expected)
