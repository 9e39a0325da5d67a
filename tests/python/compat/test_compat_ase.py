# SPDX-License-Identifier: BSD-3-Clause
"""`halfshell.compat.ase` passes ASE's own tests, and gives what ASE gives but for its rounding."""

import re
import sys
from fractions import Fraction

import numpy as np
import pytest
from ase import Atoms, neighborlist
from ase.build import bulk, molecule

from checkout import SUPPORT
from halfshell.compat import ase as ours
from subprocesses import subprocess

LETTERS = "ijdDS"
TRICLINIC = np.array([[4.0, 0.0, 0.0], [1.2, 3.7, 0.0], [-0.8, 1.5, 4.4]])


def rows(found):
    """Entries in the order of (i, j, S)."""
    i, j, d, D, S = found
    order = np.lexsort((*S.T[::-1], j, i))
    return i[order], j[order], d[order], D[order], S[order]


def assert_same(found, wanted):
    for a, b in zip(rows(found), rows(wanted), strict=True):
        assert a.dtype == b.dtype and a.shape == b.shape
        if a.dtype == np.float64:
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)
        else:
            assert np.array_equal(a, b)


def random_atoms(rng, n, pbc, spread=1.0):
    points = (rng.random((n, 3)) * 2 * spread - spread) @ TRICLINIC
    return Atoms(rng.choice(["O", "H", "Si"], n), points, cell=TRICLINIC, pbc=pbc)


def test_the_tests_of_ase_pass():
    command = [sys.executable, SUPPORT / "owners_tests.py", "halfshell.compat.ase"]
    command += ["ase.neighborlist", "ase.test.neighbor", "-m", "", "-p", "no:randomly"]
    done = subprocess.run(command, capture_output=True, text=True, cwd="/")
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert int(re.search(r"(\d+) passed", done.stdout)[1]) >= 30
    assert "skipped" not in done.stdout and "failed" not in done.stdout


@pytest.mark.parametrize("pbc", [False, True, (True, False, True)])
@pytest.mark.parametrize("self_interaction", [False, True])
def test_lists_are_those_of_ase(pbc, self_interaction, rng):
    cutoffs = [
        2.3,
        6.0,
        {("O", "H"): 2.0, (1, 1): 1.5, ("Si", "O"): 3.1, ("Cu", "O"): 9.0},
        rng.uniform(0.2, 1.5, 25),
        np.where(np.arange(25) % 3 == 0, 0.0, 1.4),
    ]
    for spread in (1.0, 3.0):
        atoms = random_atoms(rng, 25, pbc, spread)
        for cutoff in cutoffs:
            arguments = LETTERS, atoms, cutoff, self_interaction
            assert_same(ours.neighbor_list(*arguments), neighborlist.neighbor_list(*arguments))


def test_scaled_positions_and_cutoffs_without_numbers(rng):
    fractions = rng.random((20, 3))
    for options in [{"use_scaled_positions": True}, {}]:
        arguments = LETTERS, [True] * 3, TRICLINIC, fractions, 1.2
        assert_same(
            ours.primitive_neighbor_list(*arguments, **options),
            neighborlist.primitive_neighbor_list(*arguments, **options),
        )
    for module in (ours, neighborlist):
        with pytest.raises(TypeError):
            module.primitive_neighbor_list("i", True, TRICLINIC, fractions, {("O", "O"): 1.2})


def test_entries_are_sorted_and_may_be_written_to(rng):
    atoms = random_atoms(rng, 30, True)
    for with_itself in (False, True):
        i, j, S = found = ours.neighbor_list("ijS", atoms, 5.0, with_itself)
        order = np.lexsort((*S.T[::-1], j, i))
        assert np.array_equal(order, np.arange(len(i)))
        assert all(array.flags.writeable and array.flags.c_contiguous for array in found)


def test_any_letters_in_any_order():
    atoms = bulk("Cu", "fcc", a=3.6)
    d, i, again = ours.neighbor_list("did", atoms, 2.6)
    assert len(d) == len(i) == 12 and np.array_equal(d, again)
    assert isinstance(ours.neighbor_list("S", atoms, 2.6), np.ndarray)
    for call in (ours.neighbor_list, neighborlist.neighbor_list):
        with pytest.raises(ValueError, match=r"Unsupported quantity specified\."):
            call("ijx", atoms, 2.6)


def test_nothing_to_list():
    for letters in ("ijdDS", "j", "S"):
        nothing = ours.neighbor_list(letters, Atoms(), 1.0)
        theirs = neighborlist.neighbor_list(letters, Atoms(), 1.0)
        if len(letters) == 1:
            nothing, theirs = (nothing,), (theirs,)
        for a, b in zip(nothing, theirs, strict=True):
            assert a.shape == b.shape and a.dtype == b.dtype
    alone = ours.neighbor_list("ij", Atoms("H"), 1.0, self_interaction=True)
    assert [array.tolist() for array in alone] == [[0], [0]]
    assert len(ours.neighbor_list("i", Atoms("H"), 0.0, self_interaction=True)) == 0


def test_pairs_at_the_cutoff_are_those_of_the_real_numbers():
    """0.3 - 0.1 is less than 0.2 for the real numbers that these floats are, and ASE's is not."""
    x, cutoff = [0.1, 0.3], 0.2
    assert Fraction(x[1]) - Fraction(x[0]) < Fraction(cutoff)
    atoms = Atoms("H2", [[x[0], 0.0, 0.0], [x[1], 0.0, 0.0]])
    assert ours.neighbor_list("j", atoms, cutoff).tolist() == [1, 0]
    at = Atoms("H2", [[0.0, 0.0, 0.0], [0.25, 0.0, 0.0]])  # below the cutoff, not at it
    for call in (ours.neighbor_list, neighborlist.neighbor_list):
        assert call("j", at, 0.25).tolist() == []


@pytest.mark.parametrize("bothways", [False, True])
@pytest.mark.parametrize("self_interaction", [False, True])
@pytest.mark.parametrize("sort", [False, True])
def test_lists_with_a_skin_are_those_of_ase(bothways, self_interaction, sort, rng):
    atoms = random_atoms(rng, 30, (True, True, False))
    radii = rng.uniform(0.5, 1.2, 30)
    options = {
        "skin": 0.2, "sorted": sort, "bothways": bothways, "self_interaction": self_interaction
    }  # fmt: skip
    found = ours.NeighborList(radii, **options)
    wanted = neighborlist.NeighborList(
        radii, primitive=neighborlist.NewPrimitiveNeighborList, **options
    )
    with pytest.raises(RuntimeError, match="Must call update"):
        found.get_neighbors(0)
    for step in range(6):
        assert found.update(atoms) == wanted.update(atoms)
        for a in range(30):
            entries = [
                sorted(zip(j.tolist(), map(tuple, S.tolist()), strict=True))
                for j, S in (found.get_neighbors(a), wanted.get_neighbors(a))
            ]
            assert entries[0] == entries[1]
        atoms.positions += rng.normal(0.0, 0.03 * step, (30, 3))
    assert found.nupdates == wanted.nupdates > 1
    matrices = [n.get_connectivity_matrix(sparse=False) for n in (found, wanted)]
    assert np.array_equal(*matrices)


def test_numbers_of_neighbours_that_ase_counts():
    atoms = molecule("CH3CH2OH")
    for options in ({}, {"bothways": True}, {"self_interaction": False}):
        found, wanted = (
            module.NeighborList(neighborlist.natural_cutoffs(atoms), **options)
            for module in (ours, neighborlist)
        )
        found.update(atoms)
        wanted.update(atoms)
        with pytest.warns(FutureWarning):
            assert found.nneighbors == wanted.nneighbors
        with pytest.warns(FutureWarning):
            assert found.npbcneighbors == wanted.npbcneighbors


def test_what_cannot_be_searched_is_refused(rng):
    atoms = random_atoms(rng, 5, True)
    with pytest.raises(ValueError, match="cutoff"):
        ours.neighbor_list("ij", atoms, -1.0)
    atoms.positions[2, 1] = np.nan
    with pytest.raises(ValueError, match=r"points\[2, 1\] = nan"):
        ours.neighbor_list("ij", atoms, 1.0)
