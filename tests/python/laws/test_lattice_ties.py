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


# Box vectors that repeat, an equivalent basis as multiples of these, how many box vectors points
# are away, a power of two for all lengths, and the cutoff before that.
ANYWHERE = {
    "line": ([[3]], [[-1]], 1000, -1060, 7),
    "wire": ([[5, 2, 2]], [[1]], 3, 0, 3),
    "thin wire": ([[2, 1, 2]], [[-1]], 1, 900, 6),
    "plane": ([[2, 0], [1, 3]], [[1, 0], [-57, 1]], 40, 500, 5),
    "half of a period": ([[10, 0, 0], [0, 10, 0], [0, 0, 10]], None, 2, -500, 5),
    "skewed": ([[4, 1, 0], [0, 3, 1], [1, 0, 5]], [[1, 9, 0], [0, 1, 0], [-4, 2, 1]], 3, 5, 5),
    "slab": ([[6, 0, 0], [2, 5, 1]], [[1, 0], [100, 1]], 0, 0, 6),
    "four axes": ([[3, 0, 0, 0], [1, 2, 0, 0], [0, 0, 4, 1]], None, 1, 0, 4),
    "five axes": ([[4, 0, 0, 0, 0], [0, 0, 5, 0, 1]], [[0, 1], [1, -3]], 2, -3, 3),
    "seven axes": ([[2, 0, 0, 0, 0, 0, 0], [1, 0, 0, 3, 0, 0, 0]], None, 5, 0, 3),
    "eight axes": ([[0, 3, 0, 0, 0, 0, 0, 1], [2, 0, 0, 0, 0, 0, 0, 0]], None, 7, 900, 3),
    "open": ([], None, 0, -900, 4),
}


def full_list(points, vectors, reach):
    """Rows (i, j, multiples) of integer points within a common reach, and their squares."""
    m, n = len(vectors), len(points)
    D = points - points[:, None]
    steps = np.zeros((1, 0), int)
    if m:
        dual = np.linalg.pinv(vectors.astype(float)).T
        room = np.abs(D @ dual.T).max(axis=(0, 1)) + reach * np.linalg.norm(dual, axis=1) + 0.01
        steps = np.array(list(itertools.product(*[range(-int(a) - 1, int(a) + 2) for a in room])))
    squares = ((D + (steps @ vectors)[:, None, None]) ** 2).sum(axis=-1)
    k, i, j = np.nonzero((squares <= reach**2) & ((np.eye(n) < 1) | steps.any(1)[:, None, None]))
    return np.column_stack([i, j, steps[k]]), squares[k, i, j]


@pytest.mark.parametrize("name", ANYWHERE)
def test_lattices_of_any_dimension_basis_and_size(name, rng):
    """Integers decide everything: pairs, exclusion in the nearest image, the nearest points."""
    vectors, basis, away, exponent, cutoff = ANYWHERE[name]
    d = len(vectors[0]) if vectors else 3
    vectors, n = np.array(vectors, int).reshape(-1, d), 9
    m = len(vectors)
    basis = np.eye(m, dtype=int) if basis is None else np.array(basis)
    box = np.zeros((d, d), int)
    box[:m] = basis @ vectors
    points, turns = rng.integers(0, 4, (n, d)), rng.integers(-away, away + 1, (n, m))
    rows, squares = full_list(points, vectors, cutoff)
    i, j = rows[:, :2].T
    S = np.zeros((len(rows), d), int)
    S[:, :m] = np.rint(rows[:, 2:] @ np.linalg.inv(basis)).astype(int) + turns[i] - turns[j]
    order = np.lexsort([*S.T[::-1], j, i])
    i, j, S, squares = i[order], j[order], S[order], squares[order]
    scale, labels = 2.0**exponent, rng.integers(0, 3, n)
    scene = {"box": box * scale, "periodic": np.arange(d) < m} if m else {}
    given = hs.Points((points + turns @ box[:m]) * scale, labels=labels, **scene)
    nearest = np.ones(len(i), bool)  # as seen from the lower number
    for a, b in itertools.combinations(range(n), 2):
        at = np.flatnonzero((i == a) & (j == b))
        best = at[np.argsort(squares[at], kind="stable")[:1]]
        nearest[np.setdiff1d(at, best)] = False
        back = (i == b) & (j == a)
        nearest[back] = (S[back] == -S[best]).all(axis=1) if len(best) else False
    kept = (i == j) | (labels[i] != labels[j]) | ~nearest
    half = (i < j) | ((i == j) & (np.array([next(filter(None, s), 0) for s in S.tolist()]) > 0))
    for how in ({}, {"inclusive": False}, {"exclude": 0}, {"min_distance": (cutoff - 1) * scale}):
        counts = np.ones(len(i), bool)
        if "inclusive" in how:
            counts = squares < cutoff**2
        elif "exclude" in how:
            counts = kept
        elif how:
            counts = squares >= (cutoff - 1) ** 2
        for kernel in hs.kernels():
            with hs.settings(kernel=kernel):
                table = hs.neighbors(given, cutoff * scale, quantities="jS", **how)
                pairs = hs.pairs(given, cutoff * scale, quantities="SP", sort=True, **how)
            assert np.array_equal(table.offsets, np.searchsorted(i[counts], np.arange(n + 1)))
            assert np.array_equal(table.indices, j[counts])
            assert np.array_equal(table.shifts, S[counts])
            assert np.array_equal(pairs[0], S[counts & half])
            assert np.array_equal(pairs[1], np.column_stack([i, j])[counts & half])
    order = np.lexsort([*S.T[::-1], j, squares, i])
    found = hs.nearest(given, 5, max_distance=cutoff * scale, quantities="jS")
    for a in range(n):
        first = order[i[order] == a][:5]
        assert np.array_equal(found[0][a, : len(first)], j[first])
        assert np.array_equal(found[1][a, : len(first)], S[first])
