# SPDX-License-Identifier: BSD-3-Clause
"""`halfshell.compat.matscipy` and `halfshell.compat.pymatgen` give what their owners give."""

from fractions import Fraction as F

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
def test_lists_of_atoms(name):
    for cutoff in (2.0, 3.3, 6.1):
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
    found, wanted = (module.neighbour_list("ijdS", atoms, cutoff) for module in (ours, theirs))
    assert as_set(*found).keys() == as_set(*wanted).keys()


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


WRONG = {
    "too few radii": {"cutoff": [1.0, 1.0]},
    "no radii": {"cutoff": []},
    "one radius": {"cutoff": np.array([2.0])},
    "text": {"cutoff": "a"},
    "text for a pair": {"cutoff": {("H", "C"): "x"}},
    "one element": {"cutoff": {"H": 2.0}},
    "letters that are none": {"quantities": 5},
    "a list of letters": {"quantities": ["i", "j"]},
    "no letters": {"quantities": ""},
    "a letter that is none": {"quantities": "ijx"},
    "few numbers": {"atoms": None, "positions": np.eye(3), "cell": np.eye(3), "numbers": [1, 1]},
    "nothing": {"atoms": None},
}


def test_errors_have_the_types_of_the_original():
    for case, wrong in WRONG.items():
        arguments = {"quantities": "ij", "atoms": STRUCTURES["molecule"], "cutoff": 2.0, **wrong}
        if case == "few numbers":
            arguments["pbc"] = [True] * 3
        outcomes = []
        for module in (theirs, ours):
            try:
                outcomes.append(module.neighbour_list(**arguments))
            except Exception as error:
                outcomes.append(type(error))
        assert outcomes[0] == outcomes[1], case


def test_unknown_elements_and_periods_without_a_cell_are_refused():
    with pytest.raises(ValueError, match="no element 'Q'"):
        ours.neighbour_list("i", STRUCTURES["molecule"], {("Q", "C"): 2.0})
    with pytest.raises(ValueError, match="provide a cell"):
        ours.neighbour_list("i", positions=np.eye(3), pbc=True, cutoff=2.0)


def test_a_matrix_of_cutoffs_has_a_row_for_each_atomic_number():
    atoms = STRUCTURES["molecule"]
    matrix = np.zeros((9, 9))
    matrix[6, 1] = matrix[1, 6] = 1.3
    matrix[6, 6] = 1.6
    found, wanted = (module.neighbour_list("ijdS", atoms, matrix) for module in (ours, theirs))
    assert as_set(*found).keys() == as_set(*wanted).keys() and len(found[0])
    matrix[1, 6] = 1.2
    for wrong in (matrix, np.zeros((6, 6)), np.zeros((9, 8))):
        with pytest.raises(ValueError, match="symmetric"):
            ours.neighbour_list("i", atoms, wrong)


FIRST = [
    (5, [1, 1, 1, 1, 3, 3, 3]), (4, [0, 0, 2]), (0, [0]), (3, [2, 2]), (3, [0.0, 1.0]), (3, [3, 3]),
    (1, [0, 1]), (2.0, [0]),
]  # fmt: skip
# Numbers above nat, for which matscipy 1.3.1 writes behind its array (Valgrind: "Invalid write"),
# as it does for a negative nat; what it returns is this.
BEYOND = {
    (2, (0, 5)): [0, 1, 1], (2, (5, 7)): [-1, -1, 0], (3, (4, 4)): [-1, -1, -1, 0], (-1, (0,)): [],
}  # fmt: skip


def test_first_neighbours():
    for nat, i in FIRST:
        if isinstance(nat, float):
            for module in (ours, theirs):
                with pytest.raises(TypeError):
                    module.first_neighbours(nat, i)
            continue
        found, wanted = (module.first_neighbours(nat, i) for module in (ours, theirs))
        assert found.dtype == wanted.dtype and found.tolist() == wanted.tolist()


def test_first_neighbours_of_what_the_original_does_not_take():
    for (nat, i), wanted in BEYOND.items():
        assert ours.first_neighbours(nat, i).tolist() == wanted
    assert ours.first_neighbours(2, []).tolist() == [0, 0, 0]
    for wrong in ([3, 1], [-1, 0], [[0, 1]], 5):
        with pytest.raises(ValueError, match="ascend"):
            ours.first_neighbours(3, wrong)


def test_jumps():
    for rows in ([0], [0, 0, 1, 1, 1], [0, 1, 2, 2], [0.0, 1.0]):
        found, wanted = (module.get_jump_indicies(rows) for module in (ours, theirs))
        assert found.dtype == wanted.dtype and found.tolist() == wanted.tolist()
    assert ours.get_jump_indicies([]).tolist() == [0, 0]
    for wrong in ([1, 1, 2], [0, 2], [0, 1, 0], [[0, 1]], [-1, 0]):
        with pytest.raises(ValueError, match="steps of at most 1"):
            ours.get_jump_indicies(wrong)


@pytest.mark.parametrize("name", STRUCTURES)
def test_counts_and_matrices_are_those_of_lists(name):
    for cutoff in (2.0, 3.3):
        atoms = STRUCTURES[name]
        i, j, D = ours.neighbour_list("ijD", atoms, cutoff)
        counts = np.bincount(i, minlength=len(atoms))
        assert np.array_equal(ours.coordination(atoms, cutoff), counts)
        parts = {"positions": atoms.positions, "cell": atoms.cell.array, "pbc": atoms.pbc}
        assert np.array_equal(ours.coordination(cutoff=cutoff, **parts), counts)
        idx, dist, count = ours.neighbour_matrix(atoms, cutoff, int(counts.max()) + 2)
        there = np.arange(idx.shape[1]) < count[:, None]
        assert np.array_equal(count, counts) and np.array_equal(idx[there], j)
        assert np.array_equal(dist[there], D) and not idx[~there].any() and not dist[~there].any()
        assert (idx.dtype, dist.dtype, count.dtype) == (np.int64, np.float64, np.int64)
        if counts[-1]:  # or the array of matscipy is shorter
            assert np.array_equal(theirs.coordination(atoms, cutoff), counts)


@pytest.mark.parametrize("cutoff", [{("C", "H"): 1.3}, "radii"], ids=str)
def test_counts_with_other_cutoffs(cutoff):
    atoms = STRUCTURES["molecule"]
    cutoff = np.linspace(0.5, 1.2, len(atoms)) if isinstance(cutoff, str) else cutoff
    i = ours.neighbour_list("i", atoms, cutoff)
    wanted = np.bincount(i, minlength=len(atoms))
    assert ours.coordination(atoms, cutoff).tolist() == wanted.tolist()
    assert ours.neighbour_matrix(atoms, cutoff, 12)[2].tolist() == wanted.tolist()


def test_matrices_are_those_of_their_owner():
    owner = pytest.importorskip("matscipy_neighbours", reason="matscipy-neighbours is missing")
    atoms = STRUCTURES["silicon"]
    found, wanted = (module.neighbour_matrix(atoms, 3.3, 8) for module in (ours, owner))
    for one, other in zip(found, wanted, strict=True):
        assert one.dtype == other.dtype and one.shape == other.shape
    assert np.array_equal(found[2], wanted[2])
    assert np.array_equal(np.sort(found[0], axis=1), np.sort(wanted[0], axis=1))
    assert np.allclose(found[1].sum(axis=1), wanted[1].sum(axis=1))
    for module in (ours, owner):
        for few in (0, 2, -1):
            with pytest.raises(ValueError):
                module.neighbour_matrix(atoms, 3.3, few)
        for options in ({"max_neighbours": 4}, {"cutoff": 3.3}, {"cutoff": 3.3, "device": "q"}):
            with pytest.raises(ValueError):
                module.neighbour_matrix(atoms, **options)
        empty = module.neighbour_matrix(positions=np.empty((0, 3)), cutoff=1.0, max_neighbours=3)
        assert [one.shape for one in empty] == [(0, 3), (0, 3, 3), (0,)]
        again = module.neighbour_matrix(atoms, 3.3, 8, device="cpu", array_namespace=np)
        assert np.array_equal(again[2], found[2])
    assert all(hasattr(one, "__dlpack__") for one in ours.neighbour_matrix(
        atoms, 3.3, 8, array_namespace="dlpack"))  # fmt: skip


def test_shortest_images(rng):
    vectors = rng.normal(size=(200, 3)) * 8.0
    box = np.diag([3.0, 4.0, 5.0])
    for pbc in (None, True, [True, False, True], False):
        found = ours.mic(vectors, box, pbc)
        flags = None if pbc is None else np.broadcast_to(pbc, 3)
        assert np.allclose(found, theirs.mic(vectors, box, flags), rtol=0.0, atol=1e-12)
    assert np.array_equal(ours.mic(vectors, np.zeros((3, 3)), False), vectors)
    for shape in ((3,), (0, 3), (2, 4, 3)):
        assert ours.mic(np.ones(shape), box).shape == shape
    assert ours.mic(vectors[:, :2], np.eye(2)).shape == (200, 2)


def test_the_shortest_of_images_that_seem_equal():
    """Half a period less one unit in the last place, and half a period more, cannot be confused."""
    half = np.nextafter(0.15, 0.0)
    period = 0.3  # twice 0.15, rounded
    for x in (half, np.nextafter(half, 1.0), np.nextafter(0.15, 1.0)):
        lengths = {k: abs(F(float(x)) + k * F(period)) for k in (-1, 0, 1)}
        k = min(lengths, key=lambda k: (lengths[k], k))
        assert ours.mic([[x]], [[period]]).item() == float(F(float(x)) + k * F(period))


@pytest.mark.parametrize(
    "arguments",
    [([[np.nan, 0.0, 0.0]], np.eye(3)), ([[0.0] * 3], np.zeros((3, 3))), ([[0.0] * 3], [1.0] * 3),
     (3.0, np.eye(3)), ([[0.0] * 3], np.eye(3), [1, 0])],
    ids=["NaN", "no cell", "lengths", "a number", "two flags"],
)  # fmt: skip
def test_what_has_no_shortest_image(arguments):
    with pytest.raises(ValueError):
        ours.mic(*arguments)


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


@pytest.mark.parametrize("periodic", [(1, 1, 1), (1, 0, 1), (0, 0, 0)])
def test_points_in_spheres(periodic, rng):
    for r in (0.4, 0.9, 1.0, 2.5, 4.0):
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
