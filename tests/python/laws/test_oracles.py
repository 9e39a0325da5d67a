# SPDX-License-Identifier: BSD-3-Clause
"""The oracles agree with each other and with cases that can be worked out by hand."""

import itertools
from fractions import Fraction

import numpy as np
import pytest

from halfshell._check.reference import exact_square, reference_pairs
from oracles import (
    BOX_KINDS,
    as_integers,
    exact_pairs,
    lattice,
    random_scene,
    within_exactly,
)


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_two_independent_oracles_agree(kind, rng):
    for ndim in (1, 2, 3):
        for neighbours in (0.5, 4, 30):
            n = int(rng.integers(1, 14))
            flags = rng.random(ndim) < 0.7
            points, cutoff, box, flags = random_scene(
                rng, n, ndim, kind, neighbours, spread=3, periodic=flags
            )
            expected = [(i, j, *S) for i, j, S in reference_pairs(points, cutoff, box, flags)]
            found = exact_pairs(points, cutoff, box, flags)
            assert [tuple(row) for row in found.tolist()] == expected


def test_two_independent_oracles_agree_on_ties():
    points, box = lattice("fcc", (2, 2, 1))
    for inclusive in (True, False):
        expected = [(i, j, *S) for i, j, S in reference_pairs(points, 2.0, box, None, inclusive)]
        found = exact_pairs(points, 2.0, box, None, inclusive)
        assert [tuple(row) for row in found.tolist()] == expected


def test_reference_equals_blind_enumeration(rng):
    # Nothing clever: every shift in a range that is obviously large enough.
    shifts = np.array(list(itertools.product(range(-40, 41), repeat=2)))
    for _ in range(20):
        box = np.array([[2, 0], [int(rng.integers(-6, 7)), 1]])
        points = rng.integers(-3, 4, (4, 2))
        cutoff = float(rng.integers(0, 5))
        expected = []
        for i, j in itertools.combinations_with_replacement(range(4), 2):
            D = points[j] - points[i] + shifts @ box
            near = map(tuple, shifts[(D * D).sum(axis=1) <= cutoff**2].tolist())
            expected += [(i, j, S) for S in near if i < j or S > (0, 0)]
        assert reference_pairs(points, cutoff, box) == sorted(expected)


def test_reference_counts_integer_vectors_in_a_ball():
    for cutoff in (1, 2, 3, 5):
        inside = sum(
            0 < a * a + b * b + c * c <= cutoff * cutoff
            for a, b, c in itertools.product(range(-cutoff, cutoff + 1), repeat=3)
        )
        assert len(reference_pairs([[7.0, -2.0, 0.5]], cutoff, box=[1, 1, 1])) == inside // 2


def test_integers_keep_the_exact_values(rng):
    values = np.concatenate(
        [rng.normal(size=20), [0.0, -0.0, 5e-324, 1e-310, 1e300, -3.0, 2.0**70]]
    )
    (whole,) = as_integers(values)
    unit = Fraction(5e-324)
    assert [Fraction(x) * unit for x in whole] == [Fraction(x) for x in values.tolist()]


def test_integers_decide_as_the_definition(rng):
    points = rng.integers(-8, 8, (20, 3)) / 3
    i, j = np.triu_indices(20, 1)
    S = rng.integers(-2, 3, (len(i), 2))
    box = rng.normal(size=(2, 3))
    full = np.concatenate([box, np.zeros((1, 3))])
    for inclusive in (True, False):
        found = within_exactly(points, 2.5, i, j, S, box, inclusive)
        for k in range(len(i)):
            square = exact_square(points, i[k], j[k], (*S[k].tolist(), 0), full)
            assert found[k] == (square < 6.25 or (inclusive and square == 6.25))


def test_reference_refuses_dependent_rows():
    with pytest.raises(ValueError, match="dependent"):
        reference_pairs([[0.0, 0.0]], 1.0, box=[[1.0, 2.0], [2.0, 4.0]])
