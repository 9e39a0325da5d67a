# SPDX-License-Identifier: BSD-3-Clause
"""Boxes of six numbers: lengths and angles in one array."""

import math
from functools import partial

import numpy as np
import pytest
from ase.geometry import cellpar_to_cell

import halfshell as hs
from refused_calls import assert_refused

SIX = [4.25, 5.5, 6.1, 75.3, 98.0, 112.0]


@pytest.mark.parametrize("kind", [float, np.float32, int])
def test_dimensions_are_lengths_and_angles(kind):
    six = np.array(SIX).astype(kind)
    box = hs.Box.from_dimensions(six)
    assert box == hs.Box.from_lengths_angles(six[:3], six[3:])
    assert box == hs.Box.from_dimensions(six.tolist())


def test_dimensions_are_those_of_ase():
    ours = hs.Box.from_dimensions(SIX).vectors
    assert np.allclose(ours, cellpar_to_cell(SIX), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize(
    ("given", "kind", "words"),
    [
        ((1, 2, 3), ValueError, "six numbers"),
        (np.ones((6, 1)), ValueError, "dimensions"),
        (np.zeros(6), ValueError, "lengths must be finite and positive"),
        ((1, 2, math.inf, 90, 90, 90), ValueError, "lengths"),
        ((1, 2, 3, 90, 90, math.nan), ValueError, "angles"),
        ((1, 2, 3, 30, 30, 90), ValueError, "angles"),
        ("abcdef", TypeError, "dimensions"),
        (None, TypeError, "dimensions"),
        ([1j] * 6, TypeError, "dimensions"),
    ],
)
def test_what_are_no_dimensions(given, kind, words):
    assert_refused(partial(hs.Box.from_dimensions, given), kind, words)


def test_six_bare_numbers_are_told_where_to_go():
    assert_refused(
        lambda: hs.pairs([[0.0] * 3], 1.0, box=SIX), ValueError, r"got \(6,\)", "from_dimensions"
    )
