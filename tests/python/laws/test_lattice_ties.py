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
from oracles import EXACT_ROTATION, LATTICES, as_rows, as_set, check, check_large, lattice, rotation

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


def test_coordination_numbers_of_the_first_shells():
    expected = {"sc": 6, "bcc": 8, "fcc": 12, "diamond": 4, "hcp": 12}
    for name, number in expected.items():
        within, at = neighbours_within(name, SHELLS[name][0])
        assert within == at == number * len(LATTICES[name][1])


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


def test_rotated_crystals_in_two_dimensions(rng):
    grid = np.array(list(itertools.product(range(9), repeat=2)), float)
    hexagonal = np.array([[1.0, 0.0], [0.5, math.sqrt(0.75)]])
    for box in (9 * np.eye(2), 9 * hexagonal):
        for _ in range(4):
            turn = rotation(rng, 2)
            points = grid @ (box / 9) @ turn
            for square in (1, 2, 3, 4, 5, 25):
                check_large(points, math.sqrt(square), box @ turn)
                check_large(points, math.sqrt(square))


def test_crystal_of_the_smallest_cells_against_the_definition(rng):
    for name in LATTICES:
        points, box = lattice(name, (1, 1, 1))
        turn = rotation(rng)
        for square in SHELLS[name][:3]:
            check(points, math.sqrt(square), box)
            check(points @ turn, math.sqrt(square), box @ turn)


def test_half_list_of_a_perfect_triclinic_crystal_has_each_pair_once():
    # The image of a point that differs by an ulp from its original must not enter a pair
    # twice, nor drop it.
    shape = np.array([[1.0, 0.0, 0.0], [0.3, 0.9, 0.0], [-0.2, 0.4, 1.1]])
    steps = np.array(list(itertools.product(range(4), repeat=3)))
    points = steps @ shape + 0.05
    for cutoff in (1.0, 1.1, 1.25, 2.0):
        rows = check_large(points, cutoff, 4 * shape)
        i, j, S = rows[:, 0], rows[:, 1], rows[:, 2:]
        assert len(as_set(i, j, S) | as_set(j, i, -S)) == 2 * len(i)


def test_pythagorean_ties_do_not_depend_on_where_they_are():
    for kernel in hs.kernels():
        # 30 vectors of length 5 around each site: (0, 0, 5), (0, 3, 4) and all that look alike.
        points, box = lattice("sc", (12, 12, 12))
        within, at = neighbours_within("sc", 25)
        assert at == 30
        for offset in (0.0, 0.5, -1e6, 2.0**40):
            d = call(hs.pairs, points + offset, 5.0, box=box, quantities="d", kernel=kernel)
            assert len(d) == 864 * within
            assert np.count_nonzero(d == 5.0) == 864 * at
