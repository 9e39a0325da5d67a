# SPDX-License-Identifier: BSD-3-Clause
"""Universes and groups of atoms of MDAnalysis in place of points."""

import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import halfshell as hs
from calls import call

DIMENSIONS = [4.0, 5.0, 6.0, 80.0, 90.0, 70.0]
POINTS = (np.random.default_rng(0).random((60, 3)) * 9.0 - 2.0).astype(np.float32)


@pytest.fixture(scope="module")
def mda():
    return pytest.importorskip("MDAnalysis")


@pytest.fixture(scope="module")
def universe(mda):
    made = mda.Universe.empty(60, trajectory=True)
    made.add_TopologyAttr("elements", ["Si", "O", "O"] * 20)
    made.load_new(POINTS[None], dimensions=[DIMENSIONS])
    return made


@pytest.fixture(scope="module")
def box(mda):
    return mda.lib.mdamath.triclinic_vectors(DIMENSIONS)


@pytest.fixture(scope="module")
def boxless(mda):
    made = mda.Universe.empty(60, trajectory=True)
    made.load_new(POINTS[None])
    return made


def same(ours, theirs):
    assert len(theirs[0]) > 0
    for a, b in zip(ours, theirs, strict=True):
        assert a.dtype == b.dtype and np.array_equal(a, b)


def test_a_universe_and_its_groups(universe, box):
    how = {"quantities": "ijdDS"}
    expected = call(hs.pairs, POINTS, 1.5, box=box, **how)
    same(call(hs.pairs, universe, 1.5, **how), expected)
    same(call(hs.pairs, universe.atoms, 1.5, **how), expected)
    some = universe.atoms[[5, 40, 3, *range(10, 30)]]
    same(call(hs.pairs, some, 2.5, **how), call(hs.pairs, some.positions, 2.5, box=box, **how))
    updating = universe.select_atoms("prop x > 1", updating=True)
    positions = updating.positions
    same(call(hs.pairs, updating, 2.5, **how), call(hs.pairs, positions, 2.5, box=box, **how))


def test_wherever_points_are_taken(universe, box):
    group, how = universe.atoms, {"box": box}
    assert hs.count_pairs(group, 2.0) == call(hs.count_pairs, POINTS, 2.0, **how) > 0
    assert np.array_equal(hs.coordination(group, 2.0), call(hs.coordination, POINTS, 2.0, **how))
    same((hs.neighbors(group, 2.0).indices,), (call(hs.neighbors, POINTS, 2.0, **how).indices,))
    same(hs.nearest(group, 3), call(hs.nearest, POINTS, 3, **how))
    same(hs.CellList(group, 2.0).pairs(sort=True), call(hs.pairs, POINTS, 2.0, sort=True, **how))
    assert np.array_equal(hs.rdf(group, 3.0).g, call(hs.rdf, POINTS, 3.0, **how).g)
    pair_list = hs.VerletList(2.0, 0.2)
    pair_list.update(group)
    same(pair_list.pairs(sort=True), call(hs.pairs, POINTS, 2.0, sort=True, **how))
    ((i, j),) = hs.trajectory_pairs([group], 2.0, sort=True)
    same((i, j), call(hs.pairs, POINTS, 2.0, sort=True, **how))
    assert hs.verify(group, 2.0, i, j, np.zeros((len(i), 3), int)).missed is not None


def test_cutoffs_and_types_by_element(universe, box):
    names, cutoffs = universe.atoms.elements, {("Si", "O"): 2.0, ("O", "O"): 1.0}
    expected = call(hs.pairs, POINTS, cutoffs, types=names, box=box)
    same(hs.pairs(universe, cutoffs), expected)
    same(hs.pairs(universe.atoms, cutoffs), expected)
    assert hs.rdf(universe, 3.0, by_type=True).types == ("O", "Si")
    assert hs.coordination(universe.atoms, 2.0, by_type=True).shape == (60, 2)


def test_without_elements_types_are_needed(boxless):
    with pytest.raises(ValueError, match="a dict of cutoffs needs types, and points have none"):
        hs.pairs(boxless, {("Si", "O"): 2.0})


def test_objects_with_no_positions_are_none(mda):
    bare = mda.Universe.empty(3)
    for points in (bare, bare.atoms, SimpleNamespace(universe=1, atoms=2)):
        with pytest.raises((TypeError, ValueError), match="points"):
            hs.pairs(points, 1.0)


def test_nothing_is_imported():
    code = (
        "import sys, numpy, halfshell as hs; hs.pairs(numpy.zeros((3, 3)), 1.0); "
        "hs.pairs(((0.0, 0.0), (1.0, 0.0)), 1.0); assert 'MDAnalysis' not in sys.modules; "
        "assert 'halfshell._convert.atom_groups' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
