# SPDX-License-Identifier: BSD-3-Clause
"""The crystal that ships with the package is the published one, and the same as its file."""

import subprocess
import sys

import numpy as np
import pytest

from halfshell import structures

ase = pytest.importorskip("ase")


def as_atoms(structure):
    return ase.Atoms(
        structure.species.tolist(), positions=structure.positions, cell=structure.box, pbc=True
    )


def distance_to_nearest(atoms, others, symbol):
    """How far each atom of a kind is from the nearest atom of that kind in `others`."""
    from ase.geometry import get_distances

    def of_kind(a):
        return a.positions[a.symbols == symbol]

    return get_distances(of_kind(atoms), of_kind(others), cell=atoms.cell, pbc=True)[1].min(axis=1)


def test_unit_cell_is_that_of_the_space_group():
    from ase.spacegroup import crystal

    # The standard origin of P3_2 21 (number 154) is 1/3 c below that of the paper.
    published = crystal(
        ["Si", "O"],
        [(0.4697, 0, 2 / 3), (0.4135, 0.2669, 0.1191 + 2 / 3)],
        spacegroup=154,
        cellpar=[4.916, 4.916, 5.4054, 90, 90, 120],
    )
    published.positions -= published.cell[2] * (2 / 3)
    ours = as_atoms(structures.alpha_quartz((1, 1, 1)))
    np.testing.assert_allclose(ours.cell.array, published.cell.array, rtol=0, atol=1e-12)
    for symbol in ("Si", "O"):
        assert distance_to_nearest(ours, published, symbol).max() < 1e-12
        assert distance_to_nearest(published, ours, symbol).max() < 1e-12


def test_bonds_are_those_of_quartz():
    from ase.neighborlist import neighbor_list

    atoms = as_atoms(structures.alpha_quartz((2, 3, 2)))
    i, j, d = neighbor_list("ijd", atoms, 1.8)
    symbols = np.array(atoms.get_chemical_symbols())
    assert (symbols[i] != symbols[j]).all()
    coordination = np.bincount(i, minlength=len(atoms))
    assert set(coordination[symbols == "Si"]) == {4}
    assert set(coordination[symbols == "O"]) == {2}
    assert sorted(set(d.round(3))) == [1.605, 1.614]


@pytest.mark.parametrize("repeat", [(0, 1, 1), (1, 1), (1.0, 1, 1), 3, "111", (1, 1, -2)])
def test_repeat_must_be_three_positive_integers(repeat):
    with pytest.raises(ValueError, match="three positive integers"):
        structures.alpha_quartz(repeat)


def test_needs_no_other_package():
    script = (
        "import sys; from halfshell.structures import alpha_quartz; alpha_quartz();"
        "assert not {'ase', 'scipy', 'matplotlib', 'rich'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
