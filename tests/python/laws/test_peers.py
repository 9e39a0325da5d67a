# SPDX-License-Identifier: BSD-3-Clause
"""Equality with the libraries people use today, on generic points; where a peer errs, on
ties, the test proves by rational numbers that every difference is the peer's."""

import itertools
import math
from fractions import Fraction

import pytest
from ase import Atoms
from ase.neighborlist import neighbor_list
from scipy.spatial import cKDTree

import halfshell as hs
from halfshell._check.reference import exact_square
from oracles import BOX_KINDS, as_set, lattice, random_scene, rotation


def half(i, j, S):
    """The half list of a full list (i, j, S)."""
    full = as_set(i, j, S)
    zero = (0,) * len(S[0]) if len(S) else ()
    found = {(a, b, s) for a, b, s in full if a < b or (a == b and s > zero)}
    assert 2 * len(found) == len(full)
    return found


def assert_differences_are_theirs(ours, theirs, points, cutoff, box=None, inclusive=True):
    """Prove in rational arithmetic that ours is right wherever the two differ."""
    limit = Fraction(cutoff) ** 2
    for i, j, S in ours ^ theirs:
        square = exact_square(points, i, j, S or None, box)
        right = square < limit or (inclusive and square == limit)
        assert right == ((i, j, S) in ours), (i, j, S)
    return len(ours ^ theirs)


@pytest.mark.parametrize("ndim", [1, 2, 3, 6])
def test_equals_ckdtree_in_open_space(ndim, rng):
    for n in (2, 50, 800):
        points = rng.normal(size=(n, ndim))
        for cutoff in (0.02, 0.3, 1.0):
            theirs = cKDTree(points).query_pairs(cutoff, output_type="ndarray")
            ours = as_set(*hs.pairs(points, cutoff))
            assert_differences_are_theirs(ours, as_set(*theirs.T), points, cutoff)
            assert hs.count_pairs(points, cutoff) == len(ours)


# Each kind of box periodic, and each kind of periodicity.
FLAGS = list(itertools.product([False, True], repeat=3))
CASES = [(kind, FLAGS[-1]) for kind in BOX_KINDS] + list(
    zip(itertools.cycle(BOX_KINDS), FLAGS[:-1])
)


@pytest.mark.parametrize(("kind", "flags"), CASES)
def test_equals_ase(kind, flags, rng):
    sizes = ((1, 8), (2, 12), (20, 6)) if kind == "sheared" else ((1, 16), (2, 20), (50, 12))
    for n, neighbours in sizes:
        points, cutoff, box, flags = random_scene(
            rng, n, 3, kind, neighbours, spread=2, periodic=flags
        )
        atoms = Atoms(f"H{n}", positions=points, cell=box, pbc=flags)
        theirs = half(*neighbor_list("ijS", atoms, cutoff))
        ours = as_set(
            *hs.pairs(points, cutoff, box=box, periodic=flags, quantities="ijS", inclusive=False)
        )
        assert ours == theirs


# ---- where peers err: kept as proof of why the decision is exact ---------------------------


def test_where_ckdtree_errs_on_a_rotated_lattice_the_rationals_are_with_us(rng):
    points, _ = lattice("sc", (7, 7, 7))
    points = points @ rotation(rng)
    differences = 0
    for cutoff in (1.0, math.sqrt(2.0), math.sqrt(3.0), 2.0, math.sqrt(5.0), 3.0):
        theirs = as_set(*cKDTree(points).query_pairs(cutoff, output_type="ndarray").T)
        ours = as_set(*hs.pairs(points, cutoff))
        differences += assert_differences_are_theirs(ours, theirs, points, cutoff)
    assert differences > 0  # a whole shell lies within an ulp of each cutoff


def test_where_ase_errs_on_a_rotated_lattice_the_rationals_are_with_us(rng):
    points, box = lattice("fcc", (3, 3, 3))
    turn = rotation(rng)
    points, box = points @ turn, box @ turn
    differences = 0
    for cutoff in (math.sqrt(2.0), 2.0, math.sqrt(6.0)):
        atoms = Atoms(f"H{len(points)}", positions=points, cell=box, pbc=True)
        theirs = half(*neighbor_list("ijS", atoms, cutoff))
        ours = as_set(*hs.pairs(points, cutoff, box=box, quantities="ijS", inclusive=False))
        differences += assert_differences_are_theirs(
            ours, theirs, points, cutoff, box, inclusive=False
        )
    assert differences > 0
