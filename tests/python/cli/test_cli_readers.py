# SPDX-License-Identifier: BSD-3-Clause
"""What reads a file of the command line: each format, placeholders, refusals, columns of text."""

import gzip
import io
import json
import struct
import sys
import tracemalloc
import warnings

import numpy as np
import pytest

import halfshell as hs
from halfshell import cli
from halfshell._cli import files
from halfshell._cli.errors import InputError
from halfshell._cli.files import read_frames, read_scene
from structure_writers import write_by_mdanalysis

POINTS = np.array([[0.5, 0.25, 0.0], [1.0, 0.25, 0.0], [4.0, 4.5, 2.0], [4.0, 4.5, 2.75]])


@pytest.fixture
def scene(tmp_path):
    """Write a file and read it."""

    def read(name, content, **options):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_scene(str(path), **options)

    return read


@pytest.fixture
def refused(scene):
    """What is said of a file; reading it takes no more than some megabytes."""

    def read(name, content, **options):
        tracemalloc.start()
        try:
            with pytest.raises(InputError) as caught:
                scene(name, content, **options)
            assert tracemalloc.get_traced_memory()[1] < 50_000_000
        finally:
            tracemalloc.stop()
        return str(caught.value)

    return read


def need(*names):
    for name in names:
        pytest.importorskip(name, reason=f"{name} is not installed")


def pdb_atom(number, name, residue, point, element="  ", record="ATOM"):
    x, y, z = point
    return (
        f"{record:<6}{number:>5} {name:<4} {residue:>3} A{1:>4}    {x:8.3f}{y:8.3f}{z:8.3f}"
        f"  1.00  0.00          {element:>2}\n"
    )


TWO = (pdb_atom(1, " C", "ALA", (0, 0, 0), "C") + pdb_atom(2, " N", "ALA", (1.3, 0, 0), "N"))
CELL = "CRYST1{:9.3f}{:9.3f}{:9.3f}{:7.2f}{:7.2f}{:7.2f} P 1           1\n"


# ---- placeholders ----------------------------------------------------------------------------


PLACEHOLDERS = [
    ((1, 1, 1, 90, 90, 90), "1 x 1 x 1 is a placeholder"), ((0,) * 6, "are zero"),
    ((10, 10, 10, 0, 0, 0), "are zero"),
]  # fmt: skip


def test_a_placeholder_is_no_box(scene, tmp_path, capsys):
    for cell, words in PLACEHOLDERS:
        need("ase")
        found = scene("em.pdb", CELL.format(*cell) + TWO + "END\n")
        assert found.box is None and not any(found.periodic) and words in found.no_box
        assert hs.count_pairs(found.points, 2.0) == 1
        assert cli.main(["pairs", str(tmp_path / "em.pdb"), "--cutoff", "2"]) == 0
        assert words in capsys.readouterr().out
        assert cli.main(["pairs", str(tmp_path / "em.pdb"), "--cutoff", "2", "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert words in told["no_box"] and told["pairs"] == 1 and told["box"] is None
        assert told["reader"].startswith("ASE ") and told["dimensions"] == 3


def test_a_box_that_is_meant_stays(scene):
    need("ase")
    found = scene("real.pdb", CELL.format(10, 11, 12, 90, 90, 90) + TWO)
    assert found.box.diagonal().tolist() == [10, 11, 12] and found.no_box == ""
    small = '1\nLattice="1 0 0 0 1 0 0 0 1" Properties=species:S:1:pos:R:3 pbc="T T T"\nPo 0 0 0\n'
    assert scene("unit.extxyz", small).box.tolist() == np.eye(3).tolist()


def test_placeholders_of_objects_are_left_out_with_a_warning(tmp_path):
    need("ase")
    import ase.io

    (tmp_path / "em.pdb").write_text(CELL.format(1, 1, 1, 90, 90, 90) + TWO)
    for atoms in (ase.io.read(tmp_path / "em.pdb"), ase.Atoms("H2", POINTS[:2], pbc=True)):
        with pytest.warns(UserWarning, match="the box of points is left out") as caught:
            assert hs.pairs(atoms, 2.0, quantities="P").tolist() == [[0, 1]]
        assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(hs.pairs(ase.Atoms("H", [[0, 0, 0]], cell=[1, 1, 1], pbc=True), 1.0)[0]) == 3


# ---- formats ---------------------------------------------------------------------------------


def test_an_empty_last_frame_is_none(scene, tmp_path):
    need("ase")
    text = "".join(f"MODEL {k}\n{TWO}ENDMDL\n" for k in (1, 2)) + "END\n"
    assert len(scene("mm.pdb", text).points) == 2
    assert len(scene("mm.pdb", text, index=-1).points) == 2
    assert len([*read_frames(str(tmp_path / "mm.pdb"), slice(None))]) == 2
    with pytest.raises(InputError, match="has no frame 2"):
        scene("mm.pdb", text, index=2)


def lammps(style, rows, masses=""):
    head = f"LAMMPS data\n\n{len(rows)} atoms\n2 atom types\n\n"
    box = "".join(f"0 10 {axis}lo {axis}hi\n" for axis in "xyz")
    return head + box + masses + f"\nAtoms{style}\n\n" + "".join(f"{row}\n" for row in rows)


@pytest.mark.parametrize(
    ("style", "columns"),
    [(" # atomic", "{t}"), ("", "{t}"), (" # full", "1 {t} 0.5"), ("", "1 {t} -0.5"),
     (" # molecular", "7 {t}"), ("", "7 {t}"), (" # charge", "{t} 0.5"), ("", "{t} -0.5")],
)  # fmt: skip
def test_lammps_data(scene, style, columns):
    for name in ("tiny.data", "data.lmp", "data.unheard-of"):
        need("ase")
        rows = [
            f"{k + 1} {columns.format(t=k % 2 + 1)} {' '.join(map(str, point))} 0 0 1"
            for k, point in enumerate(POINTS)
        ]
        found = scene(name, lammps(style, rows))
        assert found.points.tolist() == POINTS.tolist()  # not unwrapped by images, which rounds
        assert found.box.tolist() == np.diag([10.0] * 3).tolist() and all(found.periodic)
        assert found.species is None and found.unit == "" and "types, not elements" in found.reader
        masses = "\nMasses\n\n1 15.999\n2 1.008\n"
        assert scene(name, lammps(style, rows, masses)).species.tolist() == ["O", "H"] * 2


def test_lammps_data_that_fit_no_style(refused):
    need("ase")
    line = refused("bad.data", lammps("", ["1 2 3"]))
    assert "no style of atoms fits" in line and "bad.data" in line


CHARMM_PDB = "".join([
    pdb_atom(1, " N", "CYS", (0, 0, 0)), pdb_atom(2, " CA", "CYS", (1.5, 0, 0)),
    pdb_atom(3, " HG", "SER", (3, 0, 0)), pdb_atom(4, "HE21", "GLN", (0, 3, 0)),
    pdb_atom(5, " OG1", "THR", (0, 5, 0)), pdb_atom(6, "CA", "CA", (0, 7, 0), record="HETATM"),
    pdb_atom(7, "ZN", "ZN2", (0, 9, 0), record="HETATM"), pdb_atom(8, " SG", "CYS", (0, 11, 0)),
    pdb_atom(9, "SOD", "SOD", (0, 13, 0)),
])  # fmt: skip
VIRTUAL_SITE = pdb_atom(10, " MW", "SOL", (0, 15, 0))  # which ASE takes for no atom


@pytest.mark.parametrize("library, more", [("ase", ""), ("MDAnalysis", VIRTUAL_SITE)])
def test_elements_of_a_protein_without_a_column_for_them(scene, library, more):
    need("ase", library)
    found = scene("charmm.pdb", CHARMM_PDB + more)
    wanted = ["N", "C", "H", "H", "O", "Ca", "Zn", "S", "Na", *(["X"] if more else [])]
    assert found.species.tolist() == wanted
    assert "elements by names of atoms" in found.reader


MMCIF = """data_1ABC
#
_entry.id   1ABC
_cell.length_a {0}
_cell.length_b {0}
_cell.length_c {0}
_cell.angle_alpha 90.0
_cell.angle_beta 90.0
_cell.angle_gamma 90.0
#
loop_
_atom_site.group_PDB
_atom_site.id
_atom_site.type_symbol
_atom_site.label_atom_id
_atom_site.Cartn_x
_atom_site.Cartn_y
_atom_site.Cartn_z
_atom_site.pdbx_PDB_model_num
ATOM 1 C "C5'" 0.0 0.0 0.0 1
ATOM 2 ZN 'Z N' 1.5 0.0 0.0 1
ATOM 3 C CA 0.0 0.0 0.5 2
ATOM 4 D D1 1.0 0.0 0.5 2
#
"""


def test_mmcif(scene, refused, tmp_path):
    need("ase")
    for name in ("a.cif", "a.mmcif", "a.pdbx"):
        found = scene(name, MMCIF.format("20.5"))
        assert found.points.tolist() == [[0, 0, 0.5], [1, 0, 0.5]]
        assert found.box.diagonal().tolist() == [20.5] * 3
        assert found.species.tolist() == ["C", "H"] and "mmcif" in found.reader
        first = scene(name, MMCIF.format("20.5"), index=0)
        assert first.species.tolist() == ["C", "Zn"]
    assert len([*read_frames(str(tmp_path / "a.cif"), slice(None))]) == 2
    packed = scene("b.cif.gz", gzip.compress(MMCIF.format("1.000").encode()))
    assert packed.box is None and "placeholder" in packed.no_box
    assert scene("c.cif", MMCIF.format("0.0")).no_box
    assert scene("d.cif", MMCIF.format("?")).box is None
    short = MMCIF.format("?").replace("CA 0.0", "CA")
    assert "an atom has 7 values, not 8" in refused("e.cif", short)


@pytest.mark.parametrize(("title", "species"), [("Si O", ["Si", "Si", "O", "O"]), ("what", None)])
def test_vasp_4(scene, title, species):
    need("ase")
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS / 10)
    text = f"{title}\n1.0\n10 0 0\n0 10 0\n0 0 10\n2 2\nDirect\n{rows}"
    found = scene("POSCAR", text)
    np.testing.assert_allclose(found.points, POINTS)
    assert found.box.diagonal().tolist() == [10] * 3
    assert (None if found.species is None else found.species.tolist()) == species


def dcd(title, order="<", n_atoms=4, cell=None):
    """A DCD file of CHARMM's kind, of two frames."""
    def record(content):
        mark = struct.pack(f"{order}i", len(content))
        return mark + content + mark

    control = [2, 0, 1, 0, 0, 0, 0, 0, 0]
    flags = [int(cell is not None)] + [0] * 8 + [24]
    head = b"CORD" + struct.pack(f"{order}9if10i", *control, 1.0, *flags)
    frames = b""
    for shift in (1.0, 0.0):
        if cell is not None:
            frames += record(struct.pack(f"{order}6d", *(cell[k] for k in (0, 5, 1, 4, 3, 2))))
        for axis in (POINTS + shift).T:
            frames += record(axis.astype(f"{order}f4").tobytes())
    titles = struct.pack(f"{order}i", 1) + title.encode().ljust(80)
    return record(head) + record(titles) + record(struct.pack(f"{order}i", n_atoms)) + frames


@pytest.mark.parametrize("title", ["CREATED BY CHARMM", "Created by NAMD"])
@pytest.mark.parametrize("order", "<>")
def test_dcd_of_charmm_and_namd(scene, title, order):
    need("MDAnalysis", "ase")
    found = scene("run.dcd", dcd(title, order))
    assert found.points.tolist() == POINTS.tolist() and found.box is None
    assert "MDAnalysis" in found.reader
    assert scene("run.dcd", dcd(title, order), index=0).points.tolist() == (POINTS + 1).tolist()
    cell = scene("cell.dcd", dcd(title, order, cell=(8, 9, 10, 90, 90, 90)))
    np.testing.assert_allclose(cell.box, np.diag([8, 9, 10]), atol=1e-5)


PSF = """PSF

       1 !NTITLE
 REMARKS nothing

       2 !NATOM
       1 A    1    ALA  N    NH1   -0.470000       14.0070           0
       2 A    1    ALA  CA   CT1    0.070000       12.0110           0

"""


def test_files_that_need_a_second_one_are_refused_in_clear_words(refused):
    need("MDAnalysis", "ase")
    line = refused("alone.psf", PSF)
    assert "holds a topology without coordinates" in line and "--trajectory" in line
    line = refused("alone.mdcrd", "title\n" + "  1.000" * 9 + "\n")
    assert "holds coordinates alone" in line and "--trajectory" in line


def test_what_ase_fails_on_mdanalysis_reads(scene):
    need("MDAnalysis", "ase")
    names = scene("names.xyz", "2\n\nQ1 0 0 0\nQ2 0 0 1\n")
    assert len(names.points) == 2 and names.reader.startswith("MDAnalysis")


def test_without_mdanalysis_the_reason_is_that_of_ase(monkeypatch, refused):
    need("ase")
    monkeypatch.setitem(sys.modules, "MDAnalysis", None)
    line = refused("names.xyz", "2\n\nQ1 0 0 0\nQ2 0 0 1\n")
    assert "ASE: cannot be read: KeyError" in line and "MDAnalysis does not know" in line


@pytest.mark.parametrize(
    "form", ["xyz", "extxyz", "cif", "proteindatabank", "vasp", "gen", "traj", "json", "xsf",
             "gromacs", "lammps-data", "res", "espresso-in", "cfg", "dlp4", "turbomole"],
)  # fmt: skip
def test_what_ase_writes_is_read(tmp_path, form):
    need("ase")
    import ase.io
    from ase.build import bulk

    atoms = bulk("NaCl", "rocksalt", a=5.64, cubic=True)
    suffix = {"proteindatabank": "pdb", "gromacs": "gro", "lammps-data": "data",
              "espresso-in": "in", "dlp4": "config"}.get(form, form)  # fmt: skip
    name = {"vasp": "POSCAR", "turbomole": "coord"}.get(form, f"a.{suffix}")
    options = {"pseudopotentials": {"Na": "a", "Cl": "b"}} if form == "espresso-in" else {}
    if form == "gromacs":
        atoms.arrays["residuenames"] = np.array(["ION"] * 8)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ase.io.write(tmp_path / name, atoms, format=form, **options)
    found = read_scene(str(tmp_path / name))
    box = None if found.box is None else found.box
    assert len(found.points) == 8 and found.reader.startswith("ASE ")
    if form not in ("xyz", "turbomole"):
        assert hs.count_pairs(found.points, 2.9, box=box) == 24


@pytest.mark.parametrize("form", ["gro", "pdb", "crd", "xyz", "dcd", "xtc", "trr", "ncdf", "pqr"])
def test_what_mdanalysis_writes_is_read(tmp_path, form):
    need("MDAnalysis", "ase", "scipy")
    found = read_scene(str(write_by_mdanalysis([(POINTS, [10, 11, 12])], tmp_path / f"a.{form}")))
    np.testing.assert_allclose(found.points, POINTS, atol=0.011)
    if form in ("gro", "pdb", "dcd", "xtc", "trr", "ncdf"):
        np.testing.assert_allclose(found.box, np.diag([10, 11, 12]), atol=1e-4)


# ---- point clouds ----------------------------------------------------------------------------

PLY = "ply\nformat ascii 1.0\nelement vertex {}\n{}end_header\n"
OF_PLY = "".join(f"property float {name}\n" for name in ("nx", "x", "y", "z"))
PCD = (
    "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {0}\n"
    "HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {0}\nDATA ascii\n"
)
VTK = "# vtk DataFile Version 3.0\ncloud\nASCII\nDATASET POLYDATA\nPOINTS {} float\n"
ROWS = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS)
CLOUDS = {
    "a.ply": ("plyfile", PLY.format(4, OF_PLY) + "7 " + ROWS.strip().replace("\n", "\n7 ") + "\n"),
    "a.pcd": ("pypcd4", PCD.format(4) + ROWS),
    "a.vtk": ("pyvista", VTK.format(4) + ROWS),
}


@pytest.mark.parametrize("name", CLOUDS)
def test_point_clouds(scene, name):
    library, text = CLOUDS[name]
    need(library)
    found = scene(name, text)
    assert found.points.tolist() == POINTS.tolist() and found.box is None
    assert found.reader.startswith(library) and found.unit == ""


@pytest.mark.parametrize("name", CLOUDS)
def test_point_clouds_without_their_library(monkeypatch, refused, name):
    for library in ("plyfile", "pypcd4", "pyvista"):
        monkeypatch.setitem(sys.modules, library, None)
    library, text = CLOUDS[name]
    assert f"needs {library}: pip install {library}" in refused(name, text)
    assert set(files.CLOUDS) >= {".ply", ".pcd", ".vtk", ".vtp", ".vtu"}


def test_pts(scene, refused):
    with_colours = "".join(f"{row} -12 1 2 3\n" for row in ROWS.splitlines())
    found = scene("a.pts", f"4\n{with_colours}")
    assert found.points.tolist() == POINTS.tolist() and found.reader == "text, columns x, y, z of 7"
    assert scene("a.pts", ROWS).points.tolist() == POINTS.tolist()
    assert "line 1: says 5 points, there are 4" in refused("a.pts", f"5\n{ROWS}")


# ---- headers that promise too much -----------------------------------------------------------

HUGE = 10**14


PROMISES = [
    ("a.xyz", f"{HUGE}\n\nH 0 0 0\n"), ("a.gro", f"title\n{HUGE}\n    1SOL     OW    1\n"),
    ("a.crd", f"* title\n*\n{HUGE} EXT\n"), ("a.vtk", VTK.format(HUGE)),
    ("a.data", f"LAMMPS\n\n{HUGE} atoms\n\nAtoms\n\n1 1"),
    ("a.lammpstrj", f"ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{HUGE}\nITEM: BOX BOUNDS\n"),
    ("a.ply", PLY.format(HUGE, OF_PLY)), ("a.pcd", PCD.format(HUGE)),
    ("a.pts", f"{HUGE}\n0 0 0\n"), ("a.dcd", dcd("NAMD", n_atoms=2**31 - 1)),
    ("a.dcd", dcd("NAMD", ">", n_atoms=10**9)), ("a.xyz", "1000000\n\nH 0 0 0\n"),
]  # fmt: skip


def test_headers_that_promise_more_than_the_file_can_hold(refused):
    for name, content in PROMISES:
        line = refused(name, content)
        assert "points, more than its" in line and "bytes can" in line, name


def test_numbers_that_are_no_promise(scene):
    assert scene("line.txt", "1000\n2000\n3000\n").points.tolist() == [[1000], [2000], [3000]]


def test_fewer_points_than_the_header_says_are_remarked(scene):
    need("ase")
    line = "    1SOL     OW    1   0.100   0.200   0.300\n"
    found = scene("cut.gro", f"title\n 9\n{line}{line}   1.0 1.0 1.0\n")
    assert any("its header says 9 points" in remark for remark in found.remarks)


# ---- text ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "reader"),
    [
        ("x,y,z\n1,2,3\n4,5,6\n", "columns x, y, z"),
        (",x,y,z\n0,1,2,3\n1,4,5,6\n", "columns x, y, z of 4"),
        ("id,x,y,z,intensity\n7,1,2,3,9\n8,4,5,6,9\n", "columns x, y, z of 5"),
        ("Z;X;name;Y\n3;1;a;2\n6;4;b;5\n", "columns X, Y, Z of 4"),
        ("x [A]\ty [A]\tz [A]\n1\t2\t3\n4\t5\t6\n", "columns x [A], y [A], z [A]"),
        ("t,pos_x,pos_y,pos_z,vx,vy,vz\n0,1,2,3,0,0,0\n0,4,5,6,0,0,0\n",
         "columns pos_x, pos_y, pos_z of 7"),
        ('"Points:0","Points:1","Points:2","Normals:0"\n1,2,3,0\n4,5,6,0\n',
         "columns Points:0, Points:1, Points:2 of 4"),
        (",0,1,2\n0,1,2,3\n1,4,5,6\n", "columns 0, 1, 2 of 4"),
        ("mass x_nm y_nm z_nm\n1 1 2 3\n1 4 5 6\n", "columns x_nm, y_nm, z_nm of 4"),
        ("# x y z charge\n1 2 3 9\n4 5 6 9\n", "columns x, y, z of 4"),
        ("x;y;z\n1,0;2,0;3\n4;5;6,0\n", "columns x, y, z, decimal commas"),
        ("1;2;3\n4,0;5;6\n", "3 columns without names, decimal commas"),
        ("2\n1 2 3\n4 5 6\n", "3 columns without names"),
        ("Xcoord Ycoord Zcoord Note\n1 2 3 -\n4 5 6 nan\n", "columns Xcoord, Ycoord, Zcoord of 4"),
        ("xpos,ypos,zpos\n1,2,3\n4,5,6\n", "columns xpos, ypos, zpos"),
    ],
)  # fmt: skip
def test_coordinates_are_found_by_their_names(scene, content, reader):
    for suffix in ("csv", "txt", ""):
        found = scene(f"points.{suffix}" if suffix else "points", content)
        assert found.points.tolist() == [[1, 2, 3], [4, 5, 6]]
        assert found.reader == f"text, {reader}"


COLUMNS = [
    ("a,b,c,d\n0,1,x,3\n", "b,d", [[1, 3]]), ("0 1 2 3\n", "2,4", [[1, 3]]),
    ("a,b,c\n1,2,3\n", "C,1", [[3, 1]]), ("H 1 2 3\n", "2,3,4", [[1, 2, 3]]),
    ("1 2 3 4 5 6\n", "1,2,3,4,5,6", [[1, 2, 3, 4, 5, 6]]), ("2 1\n7 8\n", "1", [[2], [7]]),
]  # fmt: skip


def test_columns_that_are_named(scene):
    for content, columns, points in COLUMNS:
        found = scene("points.csv", content, columns=columns.split(","))
        assert found.points.tolist() == points


BAD_TEXT = [
    ("0 0 0\n1 x 3\n", "line 2, field 2: 'x' is not a number"),
    ("0 0 0\n\n1 2\n", "line 3: has 2 fields, the first line has 3"),
    ("x y\nz w\n1 2\n", "line 2, field 1: 'z' is not a number"),
    ("0 y z\n", "line 1, field 2: 'y' is not a number"),
    ("# nothing\n", "holds no points"), ("\n\n", "holds no points"),
    ("3\nx y z\n1 2 3\n", "line 1: says 3 points, there are 1"),
    *((f"# three points\n0 0 0\n1 {word} 0\n", f"line 3, field 2: {word} is not a finite number")
      for word in ("nan", "inf", "-Infinity")),
    ("x,y,z\n1,,3\n4,5,\n", "line 2, field 2: is empty"),
    ("x,y,z\n1,2,3\n4,5,\n", "line 3, field 3: is empty"),
    ("0,1.5,2,3\n", "line 1: has 4 numbers without names; --columns"),
    ("x,y\n1,2,3\n", "line 2: has 3 fields, the first line has 2"),
    ("x,y,z\n1,2,3\n4,5\n", "line 3: has 2 fields"),
    ("x,y,z\n1_0,2,3\n", "line 2, field 1: '1_0' is not a number"),
    ("x,y,z\n0,5,0,0,0,0\n", "with decimal commas, separate the columns by ;"),
    ("0,5,0,0,0,0\n", "with decimal commas, separate the columns by ;"),
    ("0,5 0,0 0,0\n", "line 1: '0,5' has a decimal comma"),
    ("x;y\n0,5;1\n0.5;1\n", "line 3, field 1: '0.5': the file has decimal commas and"),
    ("i,j,d\n0,1,0.5\n", "is a list of pairs (i, j, d), not points"),
    ("a,b,c\n1,2,3\n", "columns 'a', 'b', 'c': none are known as coordinates"),
    ("ra,dec,z\n1,2,3\n", "none are known as coordinates"),
    ("pos_x,pos_y,com_x,com_y\n1,2,3,4\n", "several may be coordinates"),
    ("x0,y0,z0,x1,y1,z1\n1,2,3,4,5,6\n", "none are known"),  # two points to a line, not axes
    ("x_1,y_1,x_2,y_2\n1,2,3,4\n", "none are known"),
    ("x1,x2,x3,x4,x5,x6,x7,x8,x9\n1" + ",1" * 8, "has 9 columns of coordinates; at most 8"),
    ("x,x,y\n1,2,3\n", "none are known"), ("3\n1 2 3\n", "line 1: says 3 points, there are 1"),
    ("x y z\n1e999 0 0\n", "field 1: 1e999 is not a finite number"),
    ("x y z\n\uff11 0 0\n", "is not a number"), ("x,y,z\n", "holds no points"),
    ("x,y,z\n0,0,0,\n", "line 2: has 4 fields, the first line has 3; it ends with ',', which"),
    ("name,x,y\na,b,0,0.5\n", "line 2: has 4 fields, the first line has 3"),
    *(("x;y\n" + "0;1\n" * n + f"0{a}5;1\n" + "0;1\n" * 5000 + f"0{b}5;1\n",
       f"line {n + 5003}, field 1: '0{b}5': the file has decimal commas and decimal points")
      for n in (3, 4090) for a, b in (",.", ".,")),
    *(("x,y\n" + "0,1\n" * n + f"0,{word}\n" + "0,1\n" * 9, f"line {n + 2}, field 2: {said}")
      for n in (3, 4095, 4096)
      for word, said in (("nan", "nan is not a finite"), ("1_0", "'1_0'"), ("", "is empty"))),
]  # fmt: skip


def test_text_that_is_refused_says_where(refused):
    for content, words in BAD_TEXT:
        assert words in refused("points.csv", content), content


@pytest.mark.parametrize("quote", ['"', "'"])
def test_quoted_fields_hold_separators(scene, quote):
    for between in ",;\t|":
        content = f'"a{between}b"{between}"x"{between}y\n'
        content += f'"c{between}{between}d"{between}"1"{between}2.5\n' * 2
        found = scene("points.csv", content.replace('"', quote))
        assert found.points.tolist() == [[1.0, 2.5]] * 2
    found = scene("points.txt", '"a b" "x" y\n"c d" "1" 2.5\n'.replace('"', quote))
    assert found.points.tolist() == [[1.0, 2.5]]


def test_primes_are_no_quotes(scene):
    for between in (",", " "):
        content = f"x'{between}y'{between}x{between}y\n1{between}2{between}3{between}4\n"
        assert scene("points.csv", content).points.tolist() == [[3.0, 4.0]]


def test_bars_separate_columns(scene):
    assert scene("points.csv", "x|y|z\n1|2|3\n4,5|6|7\n").points.tolist() == [
        [1.0, 2.0, 3.0], [4.5, 6.0, 7.0]
    ]


def test_rows_that_numpy_reads_are_those_of_python(scene, rng):
    values = (rng.normal(size=(9000, 3)) * 10.0 ** rng.integers(-300, 300, (9000, 3))).tolist()
    for between in (",", ";", "\t", " ", " , "):
        lines = [between.join(map(repr, row)) for row in values]
        lines[5000] += "  # a remark"
        lines[8500:8500] = ["", "# another", "   "]
        assert scene("points.csv", "\n".join(lines)).points.tolist() == values


NO_COLUMNS = [
    ("q", "--columns q: names none of the columns 'x', 'y'"), ("3", "names none of the"),
    ("x,1", "names a column twice")
]  # fmt: skip


def test_columns_that_are_not_there(refused):
    for columns, words in NO_COLUMNS:
        assert words in refused("points.csv", "x,y\n1,2\n", columns=columns.split(","))


def test_the_summary_says_the_dimension_and_the_columns(tmp_path, capsys):
    path = tmp_path / "points.csv"
    path.write_text(",x,y,z\n0,0.0,0,0\n1,0.5,0,0\n")
    for command in ("pairs", "coordination", "neighbors", "nearest", "verify"):
        options = [] if command == "nearest" else ["--cutoff", "0.6"]
        assert cli.main([command, str(path), *options]) == 0
        out = capsys.readouterr().out
        assert "read by           text, columns x, y, z of 4" in out and "2 in 3-D" in out
        assert cli.main([command, str(path), *options, "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert (told["dimensions"], told["reader"]) == (3, "text, columns x, y, z of 4")
    assert cli.main(["pairs", str(path), "--columns", "x,2", "--cutoff", "1"]) == 2
    assert "names a column twice" in capsys.readouterr().err
    assert cli.main(["pairs", str(path), "--columns", "2,3", "--cutoff", "1"]) == 0
    assert "columns x, y of 4" in capsys.readouterr().out
    assert cli.main(["pairs", str(path), "--columns", "2,,3"]) == 2
    assert cli.main(["pairs", "--columns", "2,3"]) == 2


# ---- standard input and others ---------------------------------------------------------------


@pytest.mark.parametrize("kind", ["npy", "text", "xyz"])
def test_standard_input(monkeypatch, capsys, tmp_path, kind):
    if kind == "xyz":
        need("ase")
    stream = io.BytesIO()
    np.save(stream, POINTS)
    symbols = "".join(f"H {row}\n" for row in ROWS.splitlines())
    content = {"npy": stream.getvalue(), "text": ROWS.encode(), "xyz": f"4\n\n{symbols}".encode()}
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(content[kind])))
    monkeypatch.chdir(tmp_path)
    assert cli.main(["pairs", "-", "--cutoff", "0.8", "-o", "out.csv"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("standard input\n") and "4 in 3-D" in out
    assert len((tmp_path / "out.csv").read_text().splitlines()) == 3
    for kept, options, words in ((b"", (), "is empty"), (stream.getvalue(), ("--index", "0"),
                                                         "--index is for formats")):  # fmt: skip
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(kept)))
        assert cli.main(["pairs", "-", *options]) == 2
        assert f"standard input: {words}" in capsys.readouterr().err


def test_clouds_that_have_the_suffix_of_another_format(scene):
    need("ase")
    assert scene("cloud.xyz", ROWS).points.tolist() == POINTS.tolist()
    assert scene("cloud.unheard-of", ROWS).points.tolist() == POINTS.tolist()


def test_frames_of_what_ase_does_not_know(tmp_path):
    """A CHARMM coordinate file."""
    need("MDAnalysis", "ase")
    path = str(write_by_mdanalysis([(POINTS, [10, 11, 12])], tmp_path / "a.crd"))
    assert len(list(read_frames(path, slice(None)))) == 1
    with pytest.raises(InputError, match="has no frame 3"):
        read_scene(path, index=3)
    with pytest.raises(InputError, match="has none of these frames"):
        list(read_frames(path, slice(5, None)))


def test_without_mdanalysis_its_formats_are_unknown(refused, monkeypatch):
    need("ase")
    monkeypatch.setitem(sys.modules, "MDAnalysis", None)
    assert "unknown format" in refused("points.crd", "* title\n*\n    0\n")
    assert "unknown format" in refused("points.nothing", "?\n")


def test_every_reader_says_why(refused):
    need("ase", "MDAnalysis")
    line = refused("bad.xyz", "3\n\nH 0 0 0\n")
    assert "ASE: " in line and "MDAnalysis: " in line and "\n" not in line
    line = refused("bad", "3\n\nH 0 0 0\n", file_format="xyz")
    assert "ASE: " in line and "MDAnalysis: " in line
    line = refused("bad.nothing", "what is this\n")
    assert "ASE and MDAnalysis do not know the format" in line
