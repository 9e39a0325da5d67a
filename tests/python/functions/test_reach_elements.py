# SPDX-License-Identifier: BSD-3-Clause
"""Elements and covalent radii: objects of ASE, and the lists that ASE and matscipy make."""

import numpy as np
import pytest
from ase import Atoms
from ase.build import bulk, molecule
from ase.data import atomic_numbers, chemical_symbols
from ase.neighborlist import natural_cutoffs, neighbor_list

import halfshell as hs
from boundary import as_if_atoms
from halfshell._convert.species import SYMBOLS
from oracles import same_arrays
from refused_calls import assert_refused

CUTOFFS = {("O", "H"): 1.2, ("O", "O"): 3.1, ("H", "H"): 0.8}


def water(n=3):
    """Molecules in a skewed box that is too small for them, shaken."""
    atoms = molecule("H2O")
    atoms.set_cell([[3.1, 0.0, 0.0], [0.4, 3.3, 0.0], [-0.3, 0.2, 3.2]])
    atoms.pbc = [True, True, False]
    atoms = atoms.repeat((n, n, 1))
    atoms.rattle(0.1, seed=4)
    return atoms


def oxide():
    atoms = bulk("MgO", "rocksalt", a=4.21, cubic=True) * (2, 2, 2)
    atoms.rattle(0.05, seed=2)
    return atoms


def rows(i, j, S):
    return sorted(zip(i.tolist(), j.tolist(), map(tuple, np.asarray(S, int).tolist())))


def ours(atoms, cutoff, **how):
    """As ASE makes lists: both directions, pairs at the cutoff left out."""
    table = hs.neighbors(atoms, cutoff, quantities="jS", inclusive=False, **how)
    return rows(*table.to_pairs(quantities="ijS"))


@pytest.mark.parametrize("make", [water, oxide])
def test_the_dict_of_ase(make):
    atoms = make()
    for cutoffs in (CUTOFFS, {("Mg", "O"): 2.3, ("O", "O"): 3.1}, {("Mg", "Mg"): 4.5}):
        assert ours(atoms, cutoffs) == rows(*neighbor_list("ijS", atoms, cutoffs))
    numbers = {tuple(atomic_numbers[s] for s in pair): r for pair, r in CUTOFFS.items()}
    assert ours(atoms, numbers) == ours(atoms, CUTOFFS)
    mixed = {(8, "H"): 1.2, ("O", 8): 3.1, (1, "H"): 0.8}
    assert ours(atoms, mixed) == ours(atoms, CUTOFFS)


@pytest.mark.parametrize("make", [water, oxide])
@pytest.mark.parametrize("factor", [0.5, 1.0, 1.2])
def test_covalent_radii_of_ase(make, factor):
    atoms = make()
    radii = np.array(natural_cutoffs(atoms, mult=factor))
    found = ours(atoms, None, radii=radii)
    assert found == rows(*neighbor_list("ijS", atoms, radii))
    assert found or factor < 1.0


def test_water_has_two_bonds_a_molecule():
    atoms = molecule("H2O")
    radii = natural_cutoffs(atoms, mult=1.1)
    i, j = hs.pairs(atoms, None, radii=radii, sort=True)
    assert [{atoms.symbols[a], atoms.symbols[b]} for a, b in zip(i, j)] == [{"O", "H"}] * 2


def test_matscipy_agrees():
    neighbours = pytest.importorskip("matscipy.neighbours", reason="matscipy is not installed")
    atoms = oxide()
    for cutoffs in ({("Mg", "O"): 2.3, ("O", "O"): 3.1}, {("Mg", "Mg"): 4.5}):
        assert ours(atoms, cutoffs) == rows(*neighbours.neighbour_list("ijS", atoms, cutoffs))


def test_the_symbols_are_those_of_ase():
    assert chemical_symbols == SYMBOLS


def test_elements_of_two_sets():
    atoms = water()
    probe = Atoms("OH", positions=[[0.5, 0.5, 0.5], [2.0, 2.0, 0.0]])
    arrays = {"types": atoms.numbers, "query_types": probe.numbers}
    numbers = {tuple(atomic_numbers[s] for s in pair): r for pair, r in CUTOFFS.items()}
    expected = hs.pairs_between(probe.positions, atoms, numbers, **arrays)
    assert len(expected[0]) > 0
    within = Atoms("OH", positions=probe.positions, cell=atoms.cell, pbc=atoms.pbc)
    assert same_arrays(hs.pairs_between(within, atoms, CUTOFFS), expected)
    for symbols in (["O", "H"], np.array(["O", "H"])):
        found = hs.pairs_between(probe.positions, atoms, CUTOFFS, query_types=symbols)
        assert same_arrays(found, expected)
    assert_refused(
        lambda: hs.pairs_between(probe.positions, atoms, CUTOFFS), TypeError,
        "query_types must be given",
    )  # fmt: skip
    assert_refused(
        lambda: hs.pairs_between(probe.positions, atoms, CUTOFFS, query_types=[8, 1]), ValueError,
        "both be numbers",
    )  # fmt: skip


def test_types_that_are_given_stand_before_elements():
    atoms = oxide()
    types = np.arange(len(atoms)) % 2
    found = hs.pairs(atoms, {(0, 1): 3.0}, types=types, sort=True)
    expected = hs.pairs(
        atoms.positions, {(0, 1): 3.0}, types=types, box=atoms.cell[:], sort=True
    )
    assert same_arrays(found, expected)


def test_objects_that_have_symbols_only():
    atoms = water()

    class Symbols:
        positions, cell, pbc = atoms.positions, atoms.cell[:], atoms.pbc

        def get_chemical_symbols(self):
            return atoms.get_chemical_symbols()

    assert same_arrays(hs.pairs(Symbols(), CUTOFFS), hs.pairs(atoms, CUTOFFS))
    bare = as_if_atoms(atoms.positions, atoms.cell[:], atoms.pbc)
    assert_refused(lambda: hs.pairs(bare, CUTOFFS), TypeError, "types must be given")


def test_keys_that_are_no_elements():
    for cutoffs in ({("H", "Hx"): 1.0}, {("h", "O"): 1.0}, {("H", ""): 1.0}):
        assert_refused(lambda cutoffs=cutoffs: hs.pairs(water(), cutoffs), ValueError, "symbol")
    assert_refused(lambda: hs.pairs(water(), {(1, 119): 1.0}), ValueError, "119", "118")
    assert_refused(
        lambda: hs.pairs(water(), {("H", "O"): 1.0, (8, 1): 2.0}), ValueError, "contradicts"
    )
    assert_refused(lambda: hs.pairs(water(), np.ones((2, 2))), TypeError, "cutoff")
    strange = water()
    strange.numbers[3] = 300
    assert_refused(lambda: hs.pairs(strange, CUTOFFS), ValueError, r"numbers\[3\] = 300")
