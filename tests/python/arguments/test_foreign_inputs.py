# SPDX-License-Identifier: BSD-3-Clause
"""Points and boxes as other libraries have them: taken as they are, or refused by what they are."""

from enum import IntEnum
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse

import halfshell as hs
from calls import call
from halfshell._convert.points import as_points

POINTS = np.random.default_rng(5).uniform(-1.0, 6.0, (60, 3))
ROWS = np.array([[4.0, 0.0, 0.0], [2.5, 3.0, 0.0], [1.5, 2.0, 3.5]])
LETTERS = "ijdDS"


class Device(IntEnum):
    CPU = 1
    CUDA = 2
    PINNED = 3
    METAL = 8


class Handed:
    """An array that has no more than DLPack."""

    def __init__(self, array, device=Device.CPU):
        self.array, self.device = array, device

    def __dlpack__(self, **options):
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self):
        return (self.device, 0)


class Converted:
    """An array that has no more than ``__array__``, and perhaps what tensors say of themselves."""

    def __init__(self, array, **attributes):
        self.array = array
        vars(self).update(attributes)

    def __array__(self, dtype=None, copy=None):
        return self.array


def same(ours, theirs):
    assert all(np.array_equal(a, b) for a, b in zip(ours, theirs, strict=True))


def check_points(given, array, is_a_view=True):
    """It is searched as the array, and not copied where that is not needed."""
    same(hs.pairs(given, 1.3, quantities=LETTERS, box=ROWS),
         hs.pairs(array, 1.3, quantities=LETTERS, box=ROWS))  # fmt: skip
    same(hs.pairs_between(given, given, 1.3), hs.pairs_between(array, array, 1.3))
    assert np.shares_memory(as_points(given), array) == is_a_view


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_protocols(real):
    array = POINTS.astype(real)
    check_points(Handed(array), array)
    check_points(Converted(array), array)
    check_points(memoryview(array), array)
    check_points(Converted(array, requires_grad=False, is_sparse=False), array)


def test_a_table_with_two_columns_of_one_name_is_refused():
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame(np.zeros((2, 3)), columns=list("xyz"))
    with pytest.raises(ValueError, match=r"points must have one column [xyz], got 2"):
        hs.pairs(pandas.concat([table, table], axis=1), 1.0)


def test_tables_of_pandas():
    pandas = pytest.importorskip("pandas")
    for array in (POINTS, POINTS.astype(np.float32), np.asfortranarray(POINTS)):
        table = pandas.DataFrame(array, columns=list("xyz"), copy=False)
        check_points(table, array)
    check_points(pandas.DataFrame(POINTS).astype("Float64"), POINTS, is_a_view=False)
    mixed = pandas.DataFrame({"x": [0.0, 1.0], "y": [0, 1]})
    assert hs.pairs(mixed, 2.0, quantities="P").tolist() == [[0, 1]]
    with pytest.raises(TypeError, match="points must hold real numbers, got str"):
        hs.pairs(pandas.DataFrame({"x": ["a", "b"]}), 1.0)
    missing = pandas.DataFrame(POINTS).astype("Float64").mask(POINTS < 0.0)
    with pytest.raises(TypeError, match="points must hold real numbers, got NAType"):
        hs.pairs(missing, 1.0)


def test_tables_of_polars():
    polars = pytest.importorskip("polars")
    table = polars.DataFrame({name: POINTS[:, k] for k, name in enumerate("xyz")})
    check_points(table, POINTS, is_a_view=False)
    with pytest.raises((TypeError, ValueError), match="points"):
        hs.pairs(polars.DataFrame({"x": ["a", "b"]}), 1.0)


def test_arrays_of_xarray():
    xarray = pytest.importorskip("xarray")
    check_points(xarray.DataArray(POINTS, dims=("atom", "axis")), POINTS)


@pytest.mark.parametrize("kind", ["csr_array", "csc_array", "coo_array", "csr_matrix", "lil_array"])
def test_sparse_matrices(kind):
    sparse = getattr(scipy.sparse, kind)(POINTS)
    with pytest.raises(TypeError, match=f"points must be dense, got a sparse {kind}"):
        hs.pairs(sparse, 1.0)
    with pytest.raises(TypeError, match="box must be dense"):
        hs.pairs(POINTS, 1.0, box=getattr(scipy.sparse, kind)(ROWS))


@pytest.mark.parametrize("sparse", [
    Converted(POINTS, is_sparse=True), Converted(POINTS, layout="torch.sparse_csr"),
])  # fmt: skip
def test_sparse_tensors(sparse):
    with pytest.raises(TypeError, match="points must be dense, got a sparse Converted"):
        hs.pairs(sparse, 1.0)


def test_tensors_that_need_a_gradient():
    tensor = Converted(POINTS, requires_grad=True)
    for find, name in (
        (lambda: hs.pairs(tensor, 1.0), "points"),
        (lambda: hs.pairs(POINTS, 1.0, box=Converted(ROWS, requires_grad=True)), "box"),
        (lambda: hs.pairs_between(tensor, POINTS, 1.0), "queries"),
        (lambda: hs.Points(POINTS, radii=Converted(POINTS[:, 0], requires_grad=True)), "radii"),
    ):  # fmt: skip
        with pytest.raises(TypeError, match=f"{name} must not need a gradient.*detach"):
            find()


@pytest.mark.parametrize("device, name", [(2, "CUDA"), (8, "Metal"), (10, "ROCm"), (14, "oneAPI")])
def test_other_devices(device, name):
    for tensor in (
        Handed(POINTS, device), Converted(POINTS, __dlpack_device__=lambda: (device, 0))
    ):  # fmt: skip
        with pytest.raises(TypeError, match=f"points must be in memory that the CPU reads.*{name}"):
            hs.pairs(tensor, 1.0)
    with pytest.raises(TypeError, match="CPU reads, got a Handed on Metal"):
        hs.pairs(Handed(POINTS, Device.METAL), 1.0)


@pytest.mark.parametrize("form", [np.asarray, Converted, Handed])
def test_complex_numbers(form):
    with pytest.raises(TypeError, match="points must hold real numbers, got dtype complex128"):
        hs.pairs(form(POINTS + 0j), 1.0)


def freud_box(rows, periodic=(True, True, True), dimensions=3):
    """As ``freud.box.Box``: vectors are columns."""
    return SimpleNamespace(
        to_matrix=lambda: np.array(rows).T, periodic=np.array(periodic), dimensions=dimensions
    )


def check_box(box, rows, points=POINTS, periodic=None, **options):
    expected = hs.pairs(points, 1.3, box=rows, periodic=periodic, quantities=LETTERS)
    assert len(expected[0]) > 20
    same(call(hs.pairs, points, 1.3, box=box, quantities=LETTERS, **options), expected)
    found = hs.CellList(points, 1.3, box=box, **options).pairs(quantities=LETTERS, sort=True)
    sorted_ = hs.pairs(points, 1.3, box=rows, periodic=periodic, quantities=LETTERS, sort=True)
    same(found, sorted_)
    steps = hs.VerletList(1.3, 0.2, box=box, **options)
    steps.update(points)
    same(steps.pairs(quantities=LETTERS, sort=True), sorted_)
    batch = np.zeros(len(points), int)
    same(call(hs.pairs, points, 1.3, box=box, quantities=LETTERS, batch=batch, **options), expected)


def test_boxes_of_freud():
    check_box(freud_box(ROWS), ROWS)
    mixed = [True, False, True]
    check_box(freud_box(ROWS, mixed), ROWS, periodic=mixed)
    same(hs.pairs(POINTS, 1.3, box=freud_box(ROWS, mixed), periodic=True),
         hs.pairs(POINTS, 1.3, box=ROWS))  # fmt: skip
    assert np.array_equal(hs.Box(freud_box(ROWS)).vectors, ROWS)


def test_boxes_that_are_none():
    def fails():
        raise RuntimeError("no matrix")

    with pytest.raises(TypeError, match="to_matrix raised RuntimeError: no matrix"):
        hs.pairs(POINTS, 1.0, box=SimpleNamespace(to_matrix=fails))
    with pytest.raises(ValueError, match="box must have shape"):
        hs.pairs(POINTS, 1.0, box=SimpleNamespace(to_matrix=lambda: np.ones(3)[:2], periodic=1))
    with pytest.raises(TypeError, match="box must be lengths or vectors"):
        hs.pairs(POINTS, 1.0, box=object())


def test_boxes_of_mdtraj():
    check_box(SimpleNamespace(unitcell_vectors=ROWS[None].astype(np.float32)), ROWS)
    check_box(SimpleNamespace(unitcell_vectors=ROWS), ROWS)
    with pytest.raises(ValueError, match="that of one frame, got a SimpleNamespace of 2"):
        hs.pairs(POINTS, 1.0, box=SimpleNamespace(unitcell_vectors=np.stack([ROWS, ROWS])))
    with pytest.raises(ValueError, match="box must be a box, got a SimpleNamespace that has none"):
        hs.pairs(POINTS, 1.0, box=SimpleNamespace(unitcell_vectors=None))


def test_boxes_of_mdanalysis():
    check_box(SimpleNamespace(triclinic_dimensions=ROWS.astype(np.float32)), ROWS)
    with pytest.raises(ValueError, match="that has none"):
        hs.pairs(POINTS, 1.0, box=SimpleNamespace(triclinic_dimensions=None))
    mda = pytest.importorskip("MDAnalysis")
    universe = mda.Universe.empty(60, trajectory=True)
    universe.load_new(POINTS[None].astype(np.float32), dimensions=[[4, 5, 6, 80, 90, 70]])
    box = universe.trajectory.ts
    check_box(box, mda.lib.mdamath.triclinic_vectors(box.dimensions))


# ---- structures of pymatgen ----------------------------------------------------------------


class Structure:
    """What we read of it."""

    def __init__(self, points, rows, pbc, numbers):
        self.cart_coords, self.atomic_numbers = points, numbers
        self.lattice = SimpleNamespace(matrix=rows, pbc=pbc)

    def __len__(self):
        return len(self.cart_coords)


def like_pymatgen(pbc):
    return Structure(POINTS, ROWS, pbc, (11, 17) * 30)


def of_pymatgen(pbc):
    core = pytest.importorskip("pymatgen.core")
    lattice = core.Lattice(ROWS, pbc=pbc)
    return core.Structure(lattice, ["Na", "Cl"] * 30, POINTS, coords_are_cartesian=True)


@pytest.mark.parametrize("made", [like_pymatgen, of_pymatgen])
@pytest.mark.parametrize("pbc", [(True, True, True), (True, False, True), (False, False, False)])
def test_structures_of_pymatgen(made, pbc):
    structure = made(pbc)
    points, rows = np.asarray(structure.cart_coords), np.asarray(structure.lattice.matrix)
    how = {"box": rows, "periodic": list(pbc)} if any(pbc) else {}
    expected = call(hs.pairs, points, 1.5, quantities="ijS", **how)
    cells = hs.CellList(structure, 1.5).pairs(quantities="ijS", sort=True)
    for one, other in zip(hs.pairs(structure, 1.5, quantities="ijS"), expected, strict=True):
        assert np.array_equal(one, other)
    for one, other in zip(
        cells, call(hs.pairs, points, 1.5, quantities="ijS", sort=True, **how), strict=True
    ):
        assert np.array_equal(one, other)
    cutoffs = {("Na", "Cl"): 1.5}
    of_types = call(hs.neighbors, points, cutoffs, types=["Na", "Cl"] * 30, **how)
    assert np.array_equal(hs.neighbors(structure, cutoffs).indices, of_types.indices)
    with pytest.raises(ValueError, match=r"points of type \w*Structure bring their own box"):
        hs.pairs(structure, 1.0, box=ROWS)


def test_structures_where_there_is_no_place_for_a_box():
    structure = of_pymatgen((True, True, True))
    with pytest.raises(ValueError, match="a Structure brings a box, for which there is no place"):
        hs.NodeList("a", structure, [1.0] * 60)


def test_molecules_of_pymatgen():
    core = pytest.importorskip("pymatgen.core")
    molecule = core.Molecule(["H"] * 60, POINTS)
    assert hs.count_pairs(molecule, 1.5) == hs.count_pairs(POINTS, 1.5)
    assert hs.count_pairs(molecule, 1.5, box=ROWS) == hs.count_pairs(POINTS, 1.5, box=ROWS)
