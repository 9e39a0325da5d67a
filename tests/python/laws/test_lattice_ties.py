# SPDX-License-Identifier: BSD-3-Clause
"""Whole shells of a crystal exactly at the cutoff: every one of these pairs is a tie.

On lattices of integers the right counts follow from number theory, with no oracle at all. On
rotated lattices the ties become near ties, within rounding of the cutoff, and every library
that compares rounded squares errs; there the oracle decides in integers.
"""

import functools
import itertools
import math

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import EXACT_ROTATION, LATTICES, as_rows, check_large, lattice, rotation

# Cutoffs that are integers and the radius of a shell: of the lattice as `LATTICES` writes it.
EXACT_SHELLS = {"sc": (1, 2, 3, 5), "bcc": (2, 4), "fcc": (2, 4), "diamond": (4,), "hcp": (6,)}
# All shells in between, by their squared radius; the root is rounded.
SHELLS = {
    "sc": (1, 2, 3, 4, 5, 6, 8, 9),
    "bcc": (3, 4, 8, 11, 12),
    "fcc": (2, 4, 6, 8, 10),
    "diamond": (3, 8, 11, 16, 19),
    "hcp": (18, 36, 48, 54, 66),
}
CRYSTALS = [(name, c) for name, cutoffs in EXACT_SHELLS.items() for c in cutoffs]


@functools.cache
def neighbours_within(name, square):
    """Lattice vectors from each basis point with squared length <= square: (within, at)."""
    unit, basis = LATTICES[name]
    steps = np.array(list(itertools.product(range(-9, 10), repeat=3))) @ unit
    within = at = 0
    for p, q in itertools.product(np.array(basis), repeat=2):
        lengths = ((steps + q - p) ** 2).sum(axis=1)
        within += np.count_nonzero((lengths <= square) & (lengths > 0))
        at += np.count_nonzero(lengths == square)
    return within, at


@pytest.mark.parametrize("name, cutoff", CRYSTALS)
def test_a_shell_at_the_cutoff_is_all_in_or_all_out(name, cutoff):
    for kernel in hs.kernels():
        within, at = neighbours_within(name, cutoff**2)
        assert at > 0
        for repeats in ((1, 1, 1), (2, 3, 1), (4, 4, 4), (5, 6, 7)):
            points, box = lattice(name, repeats)
            cells = math.prod(repeats)
            for inclusive, expected in ((True, within), (False, within - at)):
                i, j, S, d = call(
                    hs.pairs,
                    points,
                    cutoff,
                    box=box,
                    quantities="ijSd",
                    inclusive=inclusive,
                    kernel=kernel,
                )
                assert 2 * len(i) == cells * expected
                rows = as_rows(i, j, S)
                assert (rows[1:] != rows[:-1]).any(axis=1).all()  # none is listed twice
                per_point = np.bincount(i, minlength=len(points)) + np.bincount(
                    j, minlength=len(points)
                )
                assert (per_point == expected // len(LATTICES[name][1])).all()
                assert np.count_nonzero(d == cutoff) == (cells * at // 2 if inclusive else 0)


@pytest.mark.parametrize("name, cutoff", CRYSTALS)
def test_an_exactly_rotated_crystal_has_the_same_ties(name, cutoff):
    for kernel in hs.kernels():
        within, at = neighbours_within(name, cutoff**2)
        points, box = lattice(name, (4, 3, 5))
        points, box = points @ EXACT_ROTATION, box @ EXACT_ROTATION
        for inclusive, expected in ((True, within), (False, within - at)):
            found = call(
                hs.count_pairs, points, 3 * cutoff, box=box, inclusive=inclusive, kernel=kernel
            )
            assert 2 * found == 60 * expected


@pytest.mark.parametrize("name", LATTICES)
def test_one_ulp_of_cutoff_moves_a_whole_shell(name):
    for kernel in hs.kernels():
        points, box = lattice(name, (3, 3, 4))
        for cutoff in EXACT_SHELLS[name]:
            within, at = neighbours_within(name, cutoff**2)
            below, above = math.nextafter(cutoff, 0), math.nextafter(cutoff, math.inf)
            counts = [
                call(hs.count_pairs, points, c, box=box, inclusive=inclusive, kernel=kernel) / 18
                for c, inclusive in ((below, True), (cutoff, False), (cutoff, True), (above, False))
            ]
            assert counts == [within - at, within - at, within, within]


@pytest.mark.parametrize("name", LATTICES)
def test_irrational_shells_follow_the_rounding_of_their_root(name):
    for kernel in hs.kernels():
        # sqrt(2) is rounded up, sqrt(3) down: the shell at exactly sqrt(k) is in or out as a whole.
        points, box = lattice(name, (4, 3, 3))
        for square in SHELLS[name]:
            cutoff = math.sqrt(square)
            a, b = cutoff.as_integer_ratio()
            within, at = neighbours_within(name, square)
            expected = within if a * a >= square * b * b else within - at
            assert call(hs.count_pairs, points, cutoff, box=box, kernel=kernel) == 18 * expected


@pytest.mark.parametrize("name", LATTICES)
def test_rotated_crystals(name, rng):
    points, box = lattice(name, (3, 3, 3))
    for periodic in (True, False, (True, False, True)):
        turn = rotation(rng)
        for square in SHELLS[name]:
            check_large(points @ turn, math.sqrt(square), box @ turn, periodic)


@pytest.mark.parametrize("name", LATTICES)
def test_scaled_and_displaced_crystals(name, rng):
    # Lattice constants that are not dyadic, and a displacement that rounds every coordinate.
    points, box = lattice(name, (3, 2, 3))
    for constant in (0.1, 1 / 3, 3.615, 5.431, 1e-10, 1e5):
        for offset in (np.zeros(3), rng.normal(size=3) * constant, [1e4 * constant] * 3):
            for square in SHELLS[name][:3]:
                check_large(
                    points * constant + offset, constant * math.sqrt(square), box * constant
                )
