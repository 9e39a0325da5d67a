# SPDX-License-Identifier: BSD-3-Clause
"""`halfshell.compat.matscipy` and `halfshell.compat.pymatgen` give what their owners give."""

import numpy as np
import pytest

ase_build = pytest.importorskip("ase.build", reason="ASE is not installed")
from halfshell.compat import matscipy as ours  # noqa: E402
from halfshell.compat.pymatgen import find_points_in_spheres  # noqa: E402

theirs = pytest.importorskip("matscipy.neighbours", reason="matscipy is not installed")


def structures():
    rng = np.random.default_rng(0)
    silicon = ase_build.bulk("Si", cubic=True) * 2
    silicon.rattle(0.05, seed=1)
    skewed = ase_build.bulk("Ti") * (2, 2, 3)
    skewed.rattle(0.05, seed=2)
    slab = ase_build.fcc111("Cu", (3, 3, 2), vacuum=6.0)
    slab.rattle(0.05, seed=3)
    slab.positions += rng.normal(size=3) * 20.0
    water = ase_build.molecule("C6H6")
    water.rattle(0.01, seed=4)
    water.set_cell(np.eye(3) * 12.0)
    return {"silicon": silicon, "skewed": skewed, "slab": slab, "molecule": water}


STRUCTURES = structures()


def as_set(i, j, d, S):
    return {
        (a, b, tuple(c)): e
        for a, b, c, e in zip(i.tolist(), j.tolist(), S.tolist(), d.tolist(), strict=True)
    }


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("cutoff", [2.0, 3.3, 6.1])
def test_lists_of_atoms(name, cutoff):
    atoms = STRUCTURES[name]
    found = ours.neighbour_list("ijdDS", atoms, cutoff)
    wanted = theirs.neighbour_list("ijdDS", atoms, cutoff)
    for one, other in zip(found, wanted, strict=True):
        assert one.dtype == other.dtype and one.shape == other.shape
    i, j, d, D, S = found
    mine, other = as_set(i, j, d, S), as_set(wanted[0], wanted[1], wanted[2], wanted[4])
    assert mine.keys() == other.keys()
    assert all(abs(mine[key] - other[key]) < 1e-9 for key in mine)
    assert np.allclose(D, atoms.positions[j] - atoms.positions[i] + S @ atoms.cell.array)
    assert np.array_equal(np.lexsort((S[:, 2], S[:, 1], S[:, 0], j, i)), np.arange(len(i)))


@pytest.mark.parametrize(
    "cutoff",
    [{("C", "H"): 1.3}, {(6, 6): 1.6, ("H", "H"): 2.6}, {("N", "N"): 3.0}, "radii", 0.0],
    ids=str,
)
def test_cutoffs(cutoff):
    atoms = STRUCTURES["molecule"]
    cutoff = np.linspace(0.5, 1.2, len(atoms)) if isinstance(cutoff, str) else cutoff
    found, wanted = (
        module.neighbour_list("ijdS", atoms, cutoff) for module in (ours, theirs)
    )
    assert as_set(*found).keys() == as_set(*wanted).keys()


def test_parts_of_atoms():
    atoms = STRUCTURES["skewed"]
    parts = {"positions": atoms.positions, "cell": atoms.cell.array, "pbc": atoms.pbc}
    whole = ours.neighbour_list("ijS", atoms, 4.0)
    for one, other in zip(ours.neighbour_list("ijS", cutoff=4.0, **parts), whole, strict=True):
        assert np.array_equal(one, other)
    flat = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert ours.neighbour_list("j", positions=flat, cutoff=1.5).tolist() == [1, 0]
    assert ours.neighbour_list("j", positions=flat, cutoff=1.0).tolist() == []


@pytest.mark.parametrize(
    "arguments",
    [("x", "molecule", 2.0), ("i", "molecule", None), ("i", "molecule", "a"), ("i", None, 1.0)],
)
def test_bad_arguments(arguments):
    quantities, name, cutoff = arguments
    with pytest.raises((TypeError, ValueError)):
        ours.neighbour_list(quantities, STRUCTURES.get(name), cutoff)
    with pytest.raises(ValueError, match="cell as well"):
        ours.neighbour_list("i", STRUCTURES["molecule"], 1.0, cell=np.eye(3))


@pytest.mark.parametrize("name", STRUCTURES)
def test_triplets(name):
    atoms = STRUCTURES[name]
    i, j, d = ours.neighbour_list("ijd", atoms, 3.3)
    first = ours.first_neighbours(len(atoms), i)
    wanted = theirs.first_neighbours(len(atoms), i)
    assert first.dtype == wanted.dtype and np.array_equal(first, wanted)
    for more in ((), (d, 2.9)):
        found, other = ours.triplet_list(first, *more), theirs.triplet_list(first, *more)
        for one, two in zip(found, other, strict=True):
            assert one.dtype == two.dtype and np.array_equal(one, two)
    ij, ik, jk = ours.triplet_list(first, d, 2.9, i, j)
    near = jk >= 0
    assert np.array_equal(i[jk[near]], j[ij[near]]) and np.array_equal(j[jk[near]], j[ik[near]])
    pairs = set(zip(i.tolist(), j.tolist(), strict=True))
    assert not any((a, b) in pairs for a, b in zip(j[ij[~near]], j[ik[~near]], strict=True))


def test_triplets_of_nothing():
    for first in ([0], [0, 0], [0, 1, 1]):
        assert [array.tolist() for array in ours.triplet_list(first)] == [[], []]
    assert len(ours.triplet_list([0, 0], i_p=[], j_p=[])) == 3


@pytest.mark.parametrize("periodic", [(1, 1, 1), (1, 0, 1), (0, 0, 0)])
@pytest.mark.parametrize("r", [0.4, 0.9, 1.0, 2.5, 4.0])
def test_points_in_spheres(periodic, r, rng):
    owner = pytest.importorskip("pymatgen.optimization.neighbors", reason="pymatgen is missing")
    lattice = np.array([[4.0, 0.0, 0.0], [1.0, 3.5, 0.0], [0.5, -0.5, 3.0]])
    points = rng.random((30, 3)) @ lattice
    centres = rng.random((9, 3)) @ lattice
    pbc = np.array(periodic, np.int64)
    found = find_points_in_spheres(points, centres, r, pbc, lattice)
    wanted = owner.find_points_in_spheres(points, centres, r, pbc, lattice)
    for one, other in zip(found, wanted, strict=True):
        assert one.dtype == other.dtype and one.shape == other.shape
    sets = [as_set(i, j, d, S) for i, j, S, d in (found, wanted)]
    assert sets[0].keys() == sets[1].keys()
    assert all(abs(sets[0][key] - sets[1][key]) < 1e-9 for key in sets[0])


def test_spheres_have_a_tolerance():
    owner = pytest.importorskip("pymatgen.optimization.neighbors", reason="pymatgen is missing")
    pbc, lattice = np.ones(3, np.int64), np.eye(3) * 9.0
    for far in (0.5, 2.0):
        points = np.array([[0.0, 0.0, 0.0], [far, 0.0, 0.0]])
        for less in (0.0, 1e-12, 1e-9, 2.4e-9, 2.6e-9, 1e-8):
            found, wanted = (
                function(points, points[:1].copy(), far - less, pbc, lattice)[1]
                for function in (find_points_in_spheres, owner.find_points_in_spheres)
            )
            assert sorted(found) == sorted(wanted)
