# SPDX-License-Identifier: BSD-3-Clause
"""`halfshell.compat.ase`: ASE's own tests pass with it, and its lists are ASE's where rounding does
not decide."""

import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest
from ase import Atoms, neighborlist
from ase.build import molecule

from halfshell.compat import ase as ours

#: Runs ASE's tests with our names in the place of its own, which its tests import from there.
PATCHED = """
import sys, pytest
from ase import neighborlist
from halfshell.compat import ase as ours
for name in ours.__all__:
    setattr(neighborlist, name, getattr(ours, name))
status = pytest.main(["--pyargs", "ase.test.neighbor", "-q", "-p", "no:cacheprovider",
                      "-o", "addopts=", "-W", "default"])
from ase.test.neighbor import test_neighbor, test_neighbor_kernel
assert test_neighbor.NeighborList is ours.NeighborList
assert test_neighbor_kernel.neighbor_list is ours.neighbor_list
sys.exit(status)
"""

PERIODIC = [(x, y, z) for x in (False, True) for y in (False, True) for z in (False, True)]
SKEWED = [(0.2, 1.2, 1.4), (1.4, 0.1, 1.6), (1.3, 2.0, -0.1)]


@pytest.mark.slow
def test_the_tests_of_ase_pass(tmp_path):
    pytest.importorskip("ase.test.neighbor", reason="this release of ASE ships no tests")
    done = subprocess.run(
        [sys.executable, "-c", PATCHED], cwd=tmp_path, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed" in done.stdout and "skipped" not in done.stdout


def test_a_vector_that_is_alone_is_not_rounded():
    """ASE completes a cell of one vector by an SVD, which makes (2, 1, 2) shorter than 3."""
    wire = Atoms("H", pbc=[False, True, False], cell=[[0, 0, 0], [2, 1, 2], [0, 0, 0]])
    assert len(neighborlist.neighbor_list("i", wire, 3.0)) == 2  # not within 3
    assert len(ours.neighbor_list("i", wire, 3.0)) == 0
    assert ours.neighbor_list("d", wire, 3.5).tolist() == [3.0, 3.0]
    for kind in (ours.PrimitiveNeighborList, ours.NewPrimitiveNeighborList):
        lists = ours.NeighborList([1.5], 0.0, self_interaction=False, primitive=kind)
        assert lists.update(wire) and len(lists.get_neighbors(0)[0]) == 0


def entries(module, *arguments, **options):
    """Sorted rows (i, j, S), and D in that order."""
    i, j, d, D, S = module.primitive_neighbor_list("ijdDS", *arguments, **options)
    assert (np.diff(i) >= 0).all()
    assert np.allclose(d, np.sqrt((D * D).sum(1)), rtol=1e-15, atol=0.0)
    rows = np.column_stack([i, j, S])
    order = np.lexsort(rows.T[::-1])
    return rows[order], D[order]


def same(*arguments, **options):
    expected, vectors = entries(neighborlist, *arguments, **options)
    found, D = entries(ours, *arguments, **options)
    assert np.array_equal(found, expected)
    assert np.allclose(D, vectors, rtol=0.0, atol=1e-12)
    return len(found)


CELLS = [np.diag([3.0, 4.0, 5.0]), SKEWED]


@pytest.mark.parametrize("pbc", PERIODIC)
@pytest.mark.parametrize("selves", [False, True])
def test_lists_are_those_of_ase(rng, selves, pbc):
    cell = CELLS[(sum(pbc) + selves) % 2]
    scaled = 3.0 * rng.random((14, 3)) - 1.0
    points, numbers = scaled @ np.asarray(cell), rng.integers(1, 9, 14)
    radii = 0.3 + 0.1 * numbers
    radii[3] = 0.0
    table = {("H", "He"): 1.9, (3, 4): 2.3, ("C", "C"): 1.7, (6, 8): 0.0, (7, "H"): -1.0,
             (8, "Xe"): 2.0, ("nothing", 1): 2.0}  # fmt: skip
    options = {"self_interaction": selves}
    assert same(pbc, cell, points, 2.1, **options) > 0
    assert same(pbc, cell, points, radii.tolist(), **options) > 0
    same(pbc, cell, points, radii, **options)
    same(pbc, cell, points, table, numbers=numbers, **options)
    same(pbc, cell, scaled, 1.9, use_scaled_positions=True, **options)


def test_no_length_has_no_neighbours_and_not_the_atom_itself():
    for cutoff in (0.0, -1.0, np.float64(0.0)):
        for selves in (False, True):
            arguments = [True] * 3, np.eye(3), np.zeros((2, 3)), cutoff
            assert same(*arguments, self_interaction=selves) == 0


def test_where_rounding_decides_ours_is_right():
    """The squares of 0.2, 0.2 and 0.1 as floats have it just below 0.3; rounded it is 0.3."""
    points, cutoff = np.array([[0.5, 0.3, 0.6], [0.7, 0.5, 0.5]]), 0.3
    square = sum((Fraction(b) - Fraction(a)) ** 2 for a, b in zip(*points.tolist()))
    assert square < Fraction(cutoff) ** 2
    arguments = "j", [False] * 3, np.eye(3), points, cutoff
    assert ours.primitive_neighbor_list(*arguments).tolist() == [1, 0]
    assert neighborlist.primitive_neighbor_list(*arguments).tolist() == []


def test_what_is_refused():
    for error, quantities, points, cutoff, match in (
        (ValueError, "ix", np.zeros((2, 3)), 1.0, "quantities"),
        (ValueError, "x", np.zeros((0, 3)), 1.0, "quantities"),
        (ValueError, "i", [[0.0, 0.0, np.nan]], 1.0, "positions must be finite"),
        (ValueError, "i", np.zeros((2, 2)), 1.0, "box"),
        (ValueError, "i", np.zeros((2, 3)), np.nan, "cutoff"),
        (ValueError, "i", np.zeros((2, 3)), [1.0], "radii"),
        (ValueError, "i", np.zeros((2, 3)), [1.0, -1.0], "radii"),
        (ValueError, "i", np.zeros((1, 3)), {(1, 1): np.nan}, "cutoff"),
        (TypeError, "i", np.zeros((2, 3)), "1", "cutoff"),
    ):
        for selves in (False, True):
            with pytest.raises(error, match=match):
                ours.primitive_neighbor_list(
                    quantities, [True] * 3, np.eye(3), points, cutoff, numbers=[1],
                    self_interaction=selves,
                )  # fmt: skip


def test_a_dict_needs_numbers_and_linearly_dependent_cells_are_refused():
    with pytest.raises(TypeError, match="numbers"):
        ours.primitive_neighbor_list("i", [True] * 3, np.eye(3), np.zeros((1, 3)), {(1, 1): 1.0})
    with pytest.raises(ValueError, match="box"):
        ours.primitive_neighbor_list("i", [True] * 3, np.zeros((3, 3)), np.zeros((1, 3)), 1.0)


# ---- classes -------------------------------------------------------------------------------


PRIMITIVES = ["PrimitiveNeighborList", "NewPrimitiveNeighborList"]


def rows_of(nl, n):
    rows = []
    for i in range(n):
        j, S = nl.get_neighbors(i)
        assert (j.dtype, S.dtype, S.shape) == (int, int, (len(j), 3))
        rows += [(i, *row) for row in np.column_stack([j, S]).tolist()]
    assert len(set(rows)) == len(rows)
    return rows


def one_way(rows):
    """Each pair by the lesser of its two rows."""
    return sorted(min((i, j, *S), (j, i, *(-s for s in S))) for i, j, *S in rows)


@pytest.mark.parametrize("name", PRIMITIVES)
@pytest.mark.parametrize("bothways", [False, True])
@pytest.mark.parametrize("selves", [False, True])
def test_classes_hold_the_pairs_of_ase(name, bothways, selves):
    for pbc in PERIODIC:
        # Of other atoms ASE shifts rows by one: behind some that have none, with bothways=False.
        rng, n = np.random.default_rng(20260817), 9
        points = (3.0 * rng.random((n, 3)) - 1.0) @ SKEWED
        options = {"skin": 0.05, "self_interaction": selves, "bothways": bothways, "sorted": True}
        radii = rng.random(n)
        rows = []
        for module in (neighborlist, ours):
            nl = getattr(module, name)(radii, **options)
            assert nl.update(np.array(pbc), np.array(SKEWED), points)
            rows.append(rows_of(nl, n))
        assert rows[1] == sorted(rows[1])
        assert one_way(rows[0]) == one_way(rows[1])
        if bothways or name == "NewPrimitiveNeighborList":
            assert sorted(rows[0]) == rows[1]


@pytest.mark.parametrize("name", PRIMITIVES)
def test_skin_and_updates_are_those_of_ase(name):
    nl = ours.NeighborList([0.5, 0.5], skin=0.1, primitive=getattr(ours, name))
    assert isinstance(nl, neighborlist.NeighborList)
    with pytest.raises(RuntimeError, match="Must call update"):
        nl.get_neighbors(0)
    atoms = Atoms("H2", [(0, 0, 0), (0, 0, 1)])
    moves = [nl.update(atoms)]
    for step in (0.09, 0.005, 0.09, 0.0):
        atoms.positions[1, 2] += step
        moves.append(nl.update(atoms))
    assert moves == [True, False, False, True, False] and nl.nupdates == 2
    atoms.pbc = True
    assert nl.update(atoms)
    assert nl.get_connectivity_matrix(sparse=False).shape == (2, 2)


@pytest.mark.parametrize("name", PRIMITIVES)
def test_lists_of_no_atoms_and_radii_of_others(name):
    nl = getattr(ours, name)([])
    assert nl.update([True] * 3, np.eye(3), np.zeros((0, 3)))
    nl = getattr(ours, name)([1.0])
    with pytest.raises(ValueError, match="Wrong number of cutoff radii: 1 != 2"):
        nl.update([True] * 3, np.eye(3), np.zeros((2, 3)))


def test_the_default_class_is_ours_and_others_work_too():
    assert type(ours.NeighborList([1.0]).nl) is ours.PrimitiveNeighborList
    theirs = ours.NeighborList([1.0], primitive=neighborlist.PrimitiveNeighborList)
    assert type(theirs.nl) is neighborlist.PrimitiveNeighborList
    atoms = molecule("CH3CH2OH")
    nl = ours.build_neighbor_list(atoms, self_interaction=False, bothways=True)
    expected = neighborlist.build_neighbor_list(atoms, self_interaction=False, bothways=True)
    both = (one.get_connectivity_matrix(sparse=False) for one in (nl, expected))
    assert np.array_equal(*both)


def test_it_is_imported_by_name_alone():
    code = "import sys, halfshell; sys.exit(bool({'ase', 'halfshell.compat'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
