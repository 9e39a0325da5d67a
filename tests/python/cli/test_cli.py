# SPDX-License-Identifier: BSD-3-Clause
"""The command line: what it reads, prints, writes, and how it refuses."""

import contextlib
import csv
import io
import json
import os
import signal
import subprocess
import sys
from functools import partial

import numpy as np
import pytest

import halfshell as hs
from halfshell import cli, selftest
from halfshell._cli import scene as cli_scene
from halfshell._cli import verify as cli_verify
from halfshell._cli.errors import InputError
from halfshell._cli.files import Scene, read_scene
from halfshell._cli.outputs import replacing, write_csv
from halfshell_report import against as cli_peers
from halfshell_report.peers import Library

POINTS = np.random.default_rng(5).random((60, 3)) * 8
BOX = np.array([[8.0, 0.0, 0.0], [1.0, 7.5, 0.0], [-0.5, 2.0, 9.0]])


@pytest.fixture
def npz(tmp_path):
    """A triclinic scene as .npz."""
    path = tmp_path / "scene.npz"
    np.savez(path, points=POINTS, box=BOX)
    return path


@pytest.fixture
def npy(tmp_path):
    """An open scene as .npy."""
    path = tmp_path / "scene.npy"
    np.save(path, POINTS)
    return path


# pairs: what it reads ----------------------------------------------------------------------


def test_without_a_file_the_quartz_and_a_cutoff_that_is_named(run):
    status, out, err = run("pairs")
    assert (status, err) == (0, "")
    assert "alpha-quartz" in out
    assert "4,608" in out
    assert "5.31 Å   (chosen: about 50 neighbours at this density; --cutoff sets it)" in out
    assert "121,344" in out
    assert "1.60463 Å" in out
    lines = out.splitlines()[1:]
    assert all(line.startswith("  ") and line[19] == " " != line[20] for line in lines)  # aligned


def test_mixed_periodic_axes_come_from_the_file(told, tmp_path):
    pytest.importorskip("ase")
    from ase.build import fcc111
    from ase.io import write

    slab = fcc111("Al", (3, 3, 3), vacuum=5.0)
    slab.info.clear()
    write(tmp_path / "slab.extxyz", slab)
    facts = told("pairs", tmp_path / "slab.extxyz", "--cutoff", "3")
    assert facts["periodic"] == [True, True, False] and facts["unit"] == "angstrom"
    assert facts["species"] == {"Al": 27} and facts["points"] == 27
    assert facts["mean_coordination"] == (12 * 9 + 9 * 18) / 27


def test_takes_the_named_frame_and_the_last_by_default(told, refusal, tmp_path):
    pytest.importorskip("ase")
    from ase import Atoms
    from ase.io import write

    frames = [Atoms("H2", [[0, 0, 0], [0, 0, 1.0 + k]]) for k in range(3)]
    write(tmp_path / "frames.xyz", frames)
    assert told("pairs", tmp_path / "frames.xyz", "--cutoff", "9")["nearest_distance"] == 3.0
    first = told("pairs", tmp_path / "frames.xyz", "--cutoff", "9", "--index", "0")
    assert first["nearest_distance"] == 1.0
    assert "has no frame 7" in refusal("pairs", tmp_path / "frames.xyz", "--index", "7")


def test_format_forces_the_ase_format(told, refusal, tmp_path):
    pytest.importorskip("ase")
    path = tmp_path / "structure.unheard-of"
    path.write_text("2\n\nH 0 0 0\nH 0 0 1\n")
    assert "unknown format" in refusal("pairs", path)
    assert told("pairs", path, "--format", "xyz", "--cutoff", "1")["pairs"] == 1
    assert "nonsense" in refusal("pairs", path, "--format", "nonsense")


def test_npz_brings_box_and_periodic(told, npz, tmp_path):
    assert told("pairs", npz, "--cutoff", "3")["pairs"] == hs.count_pairs(POINTS, 3.0, box=BOX)
    flags = np.array([True, False, True])
    np.savez(tmp_path / "mixed.npz", points=POINTS, box=[8.0, 7.5, 9.0], periodic=flags)
    facts = told("pairs", tmp_path / "mixed.npz", "--cutoff", "3")
    assert facts["periodic"] == flags.tolist()
    assert facts["pairs"] == hs.count_pairs(POINTS, 3.0, box=[8.0, 7.5, 9.0], periodic=flags)


def test_box_and_periodic_options_take_the_place_of_the_file(told, npz, npy):
    lengths = told("pairs", npy, "--cutoff", "2", "--box", "8,8,8")
    assert lengths["pairs"] == hs.count_pairs(POINTS, 2.0, box=[8.0] * 3)
    assert told("pairs", npy, "--cutoff", "2", "--box", "8")["box"] == lengths["box"]
    vectors = ",".join(map(str, BOX.ravel()))
    assert told("pairs", npy, "--cutoff", "2", f"--box={vectors}")["box"] == BOX.tolist()
    mixed = told("pairs", npz, "--cutoff", "2", "--periodic", "tfF")
    assert mixed["periodic"] == [True, False, False]
    assert mixed["pairs"] == hs.count_pairs(POINTS, 2.0, box=BOX, periodic=[True, False, False])
    open_space = told("pairs", npz, "--cutoff", "2", "--periodic", "F")
    assert open_space["pairs"] == hs.count_pairs(POINTS, 2.0)


def test_strict_leaves_out_the_pairs_at_the_cutoff(told, tmp_path):
    np.save(tmp_path / "two.npy", np.array([[0.0], [0.5]]))
    assert told("pairs", tmp_path / "two.npy", "--cutoff", "0.5")["pairs"] == 1
    facts = told("pairs", tmp_path / "two.npy", "--cutoff", "0.5", "--strict")
    assert (facts["pairs"], facts["nearest_distance"], facts["inclusive"]) == (0, None, False)


def test_box_is_described_by_lengths_angles_and_what_repeats():
    hexagonal = np.array([[2.0, 0.0, 0.0], [-1.0, 3.0**0.5, 0.0], [0.0, 0.0, 5.0]])
    for box, periodic, text in [
        (None, (False,) * 3, "none (open in every direction)"),
        (hexagonal, (False,) * 3, "none (open in every direction)"),
        (hexagonal, (True,) * 3, "2 x 2 x 5, angles 90 90 120, periodic TTT"),
        (np.array([1.0, 2.5, 3.0]), (True,) * 3, "1 x 2.5 x 3, periodic TTT"),
        (np.array([1.0, 2.0, 0.0]), (True, True, False), "1 x 2 x open, periodic TTF"),
        (np.array([[1.0, 0.0], [1.0, 1.0]]), (True, True), "1 x 1.41421, angles 45, periodic TT"),
        (np.ones(5), (True,) * 5, "1 x 1 x 1 x 1 x 1, periodic TTTTT"),
    ]:
        scene = Scene(np.ones((1, len(periodic))), box, periodic, "")
        assert cli_scene.describe_box(scene) == text


def test_cutoff_is_chosen_in_any_scene(run, tmp_path):
    random = np.random.default_rng(0)
    scenes = {
        "cube": (random.random((4000, 3)) * 70, None, None),
        "plane": (random.random((4000, 2)) @ [[1.0, 2.0, 3.0], [-2.0, 0.0, 0.5]], None, None),
        "slab": (
            random.random((4000, 3)) * [50.0, 50.0, 9.0],
            [50.0, 50.0, 500.0],
            [True, True, False],
        ),
        "five": (random.random((4000, 5)), np.ones(5), [True] * 5),
        "huge": (random.random((4000, 3)) * 1e300, None, None),
    }
    for name, (points, box, periodic) in scenes.items():
        content = {"points": points}
        if box is not None:
            content.update(box=box, periodic=periodic)
        np.savez(tmp_path / f"{name}.npz", **content)
        status, out, _ = run("pairs", tmp_path / f"{name}.npz", "--json")
        assert status == 0
        assert 25 < json.loads(out)["mean_coordination"] < 100, name


def test_small_molecule_gets_all_its_pairs(run, tmp_path):
    np.save(tmp_path / "three.npy", np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 1.0, 0]]))
    _, out, _ = run("pairs", tmp_path / "three.npy")
    assert "all points are neighbours" in out
    assert "pairs             3 " in out


def test_scene_without_a_length_needs_a_cutoff(refusal, told, tmp_path):
    np.save(tmp_path / "same.npy", np.ones((70, 3)))
    assert "give --cutoff" in refusal("pairs", tmp_path / "same.npy")
    assert told("pairs", tmp_path / "same.npy", "--cutoff", "0")["pairs"] == 70 * 69 // 2


# pairs: what it writes ---------------------------------------------------------------------


def test_npz_output_holds_the_pairs(told, npz, tmp_path):
    told("pairs", npz, "--cutoff", "3", "-o", tmp_path / "out.npz")
    i, j, d, S = hs.pairs(POINTS, 3.0, box=BOX, quantities="ijdS")
    with np.load(tmp_path / "out.npz") as out:
        assert set(out.files) == {"i", "j", "d", "S", "n", "cutoff", "inclusive"}
        np.testing.assert_array_equal(out["i"], i)
        np.testing.assert_array_equal(out["j"], j)
        np.testing.assert_array_equal(out["d"], d)
        np.testing.assert_array_equal(out["S"], S)
        assert (out["n"], out["cutoff"], out["inclusive"]) == (60, 3.0, True)


def test_csv_output_reads_back_to_the_same_numbers(told, npz, tmp_path):
    path = tmp_path / "out.csv"
    told("pairs", npz, "--cutoff", "3", "-o", path, "--quantities", "PSDdij", "--sort")
    rows = list(csv.reader(path.read_text().splitlines()))
    header = ["P0", "P1", "S0", "S1", "S2", "D0", "D1", "D2", "d", "i", "j"]
    assert rows[0] == header
    P, S, D, d, i, j = hs.pairs(POINTS, 3.0, box=BOX, quantities="PSDdij", sort=True)
    table = np.array([[float(x) for x in row] for row in rows[1:]])
    np.testing.assert_array_equal(table, np.column_stack([P, S, D, d, i, j]))


def test_csv_is_written_in_blocks_without_loss():
    columns = {"i": np.arange(150_000), "D": np.arange(300_000.0).reshape(-1, 2) / 3}
    stream = io.BytesIO()
    write_csv(stream, columns)
    lines = stream.getvalue().decode().splitlines()
    assert lines[0] == "i,D0,D1"
    assert len(lines) == 150_001
    assert lines[-1] == f"149999,{columns['D'][-1, 0]!s},{columns['D'][-1, 1]!s}"


@pytest.mark.parametrize("name", ["g.png", "g.pdf", "g.svg"])
def test_plot_makes_a_picture(run, npz, npy, tmp_path, name):
    pytest.importorskip("matplotlib")
    starts = {"png": b"\x89PNG\r\n\x1a\n", "pdf": b"%PDF-", "svg": b"<?xml"}
    scene = npy if name == "g.pdf" else npz
    status, out, err = run("pairs", scene, "--cutoff", "3", "--plot", tmp_path / name)
    assert (status, err) == (0, "")
    assert f"plot written to   {tmp_path / name}" in out
    content = (tmp_path / name).read_bytes()
    assert content.startswith(starts[name[2:]])
    assert len(content) > 2000


def test_radial_distribution_of_an_ideal_gas_is_one():
    figure = pytest.importorskip("matplotlib.figure")
    points = np.random.default_rng(2).random((3000, 3))
    d = hs.pairs(points, 0.3, box=np.ones(3), quantities="d")
    closed, open_ = figure.Figure().subplots(2)
    cli_scene.draw_distances(closed, d, Scene(points, np.ones(3), (True,) * 3, ""), 0.3)
    g = closed.lines[0].get_ydata()
    assert len(g) == 200 and closed.get_ylabel() == "g(r)"
    assert abs(g[100:].mean() - 1) < 0.01
    # Where an axis is open there is no volume: the neighbours of a point per unit of distance.
    cli_scene.draw_distances(open_, d, Scene(points, np.ones(3), (True, True, False), ""), 0.3)
    raw = open_.patches[0].get_data().values
    assert raw.sum() * (0.3 / 200) == pytest.approx(2 * len(d) / 3000)


def test_output_is_not_touched_by_a_failing_search(monkeypatch, run, npz, tmp_path):
    out = tmp_path / "out.npz"
    out.write_bytes(b"old")
    before = sorted(os.listdir(tmp_path))
    for error in (MemoryError("too much"), ValueError("two\nlines"), KeyboardInterrupt()):

        def pairs(*_, error=error, **__):
            assert len(os.listdir(tmp_path)) == len(before) + 1
            raise error

        monkeypatch.setattr(hs, "pairs", pairs)
        status, _, err = run("pairs", npz, "--cutoff", "3", "-o", out)
        assert status == (130 if isinstance(error, KeyboardInterrupt) else 2)
        assert err.count("\n") == 1
        assert out.read_bytes() == b"old"
        assert sorted(os.listdir(tmp_path)) == before


def test_output_is_not_touched_by_a_failing_write(monkeypatch, refusal, npz, tmp_path):
    out = tmp_path / "out.npz"
    out.write_bytes(b"old")

    def savez(stream, **_):
        stream.write(b"half of it")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", savez)
    line = refusal("pairs", npz, "--cutoff", "3", "-o", out)
    assert "out.npz: cannot be written: No space left on device" in line
    assert out.read_bytes() == b"old"
    assert sorted(os.listdir(tmp_path)) == ["out.npz", "scene.npz"]


def test_output_is_checked_before_the_search(monkeypatch, refusal, npz, tmp_path):
    def pairs(*_, **__):
        raise AssertionError("searched")

    monkeypatch.setattr(hs, "pairs", pairs)
    missing = tmp_path / "missing" / "out.npz"
    assert "cannot be written: No such file" in refusal("pairs", npz, "-o", missing)
    assert "must end in .npz, .csv or .parquet" in refusal("pairs", npz, "-o", tmp_path / "out.txt")
    assert "must end in .png" in refusal("pairs", npz, "--plot", tmp_path / "out.gif")
    assert "not overwritten" in refusal("pairs", npz, "-o", npz)
    (tmp_path / "folder.npz").mkdir()
    assert "not a regular file" in refusal("pairs", npz, "-o", tmp_path / "folder.npz")
    assert sorted(os.listdir(tmp_path)) == ["folder.npz", "scene.npz"]


def test_read_only_output_is_refused(monkeypatch, refusal, npz, tmp_path):
    out = tmp_path / "out.npz"
    out.touch()
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
    assert "read-only" in refusal("pairs", npz, "-o", out)
    assert out.read_bytes() == b""


def test_replacing_keeps_mode_and_links(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_bytes(b"old")
    target.chmod(0o640)
    link.symlink_to(target)
    with replacing(str(link)) as stream:
        stream.write(b"new")
        assert target.read_bytes() == b"old"
    assert link.is_symlink()
    assert target.read_bytes() == b"new"
    assert target.stat().st_mode & 0o777 == 0o640
    with pytest.raises(InputError, match="not a regular file"), replacing(os.devnull):
        pass


# How it refuses ----------------------------------------------------------------------------


def test_unreadable_files_are_refused(refusal, tmp_path):
    assert "missing.cif: no such file" in refusal("pairs", tmp_path / "missing.cif")
    (tmp_path / "short.npy").write_bytes(b"\x93NUMPY")
    assert "cannot be read as a NumPy file" in refusal("pairs", tmp_path / "short.npy")
    (tmp_path / "empty.npy").write_bytes(b"")
    assert "empty.npy: is empty" in refusal("pairs", tmp_path / "empty.npy")
    (tmp_path / "text.npz").write_text("hello")
    assert "as a NumPy file: it is not one" in refusal("pairs", tmp_path / "text.npz")
    np.save(tmp_path / "objects.npy", np.array([None]), allow_pickle=True)
    assert "Python objects" in refusal("pairs", tmp_path / "objects.npy")
    (tmp_path / "folder.npy").mkdir()
    assert "Is a directory" in refusal("pairs", tmp_path / "folder.npy")


SPOILED = POINTS.copy()
SPOILED[7, 1] = np.nan
DEPENDENT = np.array([[1.0, 0, 0], [2.0, 0, 0], [0, 0, 1.0]])
WRONG_CONTENT = [
    ("positions must be finite, got positions[7, 1] = nan", {"points": SPOILED}, ""),
    ("holds no points", {"points": np.empty((0, 3))}, ""),
    ("shape (60,)", {"points": POINTS[:, 0]}, ""),
    ("must hold real numbers", {"points": np.array([["a", "b"]])}, ""),
    ("must hold real numbers", {"points": POINTS * 1j}, ""),
    ("must hold real numbers", {"points": np.zeros((2, 3), "M8[s]")}, ""),
    ("(n, d)", {"points": np.zeros(3, "f8,f8")}, ""),
    ("would be rounded", {"points": np.zeros((2, 3), np.longdouble)}, ""),
    ("is not a float64", {"points": np.array([[2**53 + 1, 0]])}, ""),
    ("shape (3, 9)", {"points": np.zeros((3, 9))}, ""),
    ("no array 'points' (it holds positions)", {"positions": POINTS}, ""),
    ("box must have shape (3,) or (3, 3)", {"points": POINTS, "box": [1.0, 2.0]}, ""),
    ("box must be finite", {"points": POINTS, "box": [1.0, 2.0, np.inf]}, ""),
    ("'periodic' must be", {"points": POINTS, "box": np.ones(3), "periodic": "TTF"}, ""),
    ("no box", {"points": POINTS, "periodic": True}, ""),
    ("no box", {"points": POINTS}, "--periodic TTT"),
    ("scene.npz: ", {"points": POINTS, "box": DEPENDENT}, "--cutoff 1"),
    ("scene.npz: ", {"points": POINTS, "box": DEPENDENT}, ""),
    ("--box has 4 numbers", {"points": POINTS}, "--box 1,2,3,4"),
    ("--periodic has 2 letters", {"points": POINTS, "box": BOX}, "--periodic TF"),
    ("--index", {"points": POINTS}, "--index 0"),
]


def test_wrong_content_is_refused_with_its_place(refusal, tmp_path):
    for words, arrays, options in WRONG_CONTENT:
        np.savez(tmp_path / "scene.npz", **arrays)
        assert words in refusal("pairs", tmp_path / "scene.npz", *options.split())


@pytest.mark.parametrize("arguments", [
    "unheard-of", "pairs --unheard-of", "pairs --cutoff", "pairs --cutoff -1",
    "pairs --cutoff 1e999", "pairs --box 1,x,3", "pairs --periodic yes", "pairs --quantities ijx",
    "pairs --kernel abacus", "pairs --index last", "pairs --plot g.png --cutoff 0", "pairs --cut 3",
    "verify --sample few", "verify --against oracle", "verify --against ase --strict",
    "verify --against ase --kernel scalar", "info file", "nearest --cutoff 3", "nearest --strict",
    "rdf --strict", "rdf --bins 0", "nearest -k 0", "nearest -k x", "pairs --threads 0",
    "verify --threads 0", "neighbors --quantities ijP", "coordination -o out.txt",
    "pairs -o - --json", "coordination -o - --json", "rdf --cutoff 0",
])  # fmt: skip
def test_wrong_options_are_refused(refusal, arguments):
    refusal(*arguments.split())


def test_what_is_not_installed_is_named(monkeypatch, refusal, npz, tmp_path):
    (tmp_path / "a.xyz").write_text("1\n\nH 0 0 0\n")
    for name in (
        "ase", "ase.io", "ase.neighborlist", "MDAnalysis", "matplotlib", "matplotlib.figure",
        "vesin",
    ):  # fmt: skip
        monkeypatch.setitem(sys.modules, name, None)
    assert "needs ase: pip install ase" in refusal("pairs", tmp_path / "a.xyz")
    plot = refusal("pairs", npz, "--plot", tmp_path / "g.png")
    assert "--plot needs matplotlib: pip install matplotlib" in plot
    assert "pip install vesin" in refusal("verify", npz, "--against", "vesin")
    assert "pip install ase" in refusal("verify", npz, "--against", "ase")
    assert sorted(os.listdir(tmp_path)) == ["a.xyz", "scene.npz"]


def test_too_little_memory_is_said_in_one_line(refusal, tmp_path):
    np.save(tmp_path / "one.npy", np.array([[0.5, 0.5, 0.5]]))
    line = refusal("pairs", tmp_path / "one.npy", "--box", "1e-6,1e-6,1e-6", "--cutoff", "1e3")
    assert "one.npy: " in line


def test_ase_remarks_are_passed_on_as_warnings(monkeypatch, run, tmp_path):
    pytest.importorskip("ase")
    import warnings

    import ase.io

    def read(*_, **__):
        warnings.warn("odd\nfile", UserWarning, stacklevel=1)
        return ase.Atoms("H2", [[0, 0, 0], [0, 0, 1]])

    (tmp_path / "a.xyz").write_text("anything")
    monkeypatch.setattr(ase.io, "read", read)
    status, _, err = run("pairs", tmp_path / "a.xyz", "--cutoff", "1")
    assert status == 0
    assert err == f"halfshell: warning: {tmp_path / 'a.xyz'}: odd file\n"


# verify ------------------------------------------------------------------------------------


def test_own_list_is_right(run, npz, kernel):
    status, out, err = run("verify", npz, "--cutoff", "3", "--kernel", kernel)
    assert (status, err) == (0, "")
    assert "by integers       0 missed, 0 spurious, 0 duplicate" in out
    assert "every pair among all 60 points" in out
    assert out.endswith("verdict           right\n")


@pytest.mark.parametrize("peer", ["ase", "matscipy", "matscipy-neighbours", "vesin"])
def test_lists_of_peers_are_checked_by_their_rule(run, npz, peer):
    for options in ([], ["--periodic", "F"], ["--periodic", "TFT"]):
        for module in {"matscipy-neighbours": ["matscipy_neighbours"]}.get(peer, [peer, "ase"]):
            pytest.importorskip(module)
        status, out, err = run(
            "verify", npz, "--cutoff", "3", "--against", peer, "--json", *options
        )
        assert (status, err) == (0, "")
        told = json.loads(out)
        assert told["ok"]
        assert (told["inclusive"], told["full"]) == (False, peer != "vesin")
        assert [check["by"] for check in told["checks"]] == ["search", "integers"]
        assert told["list"].startswith(peer)


def test_scipy_is_checked_by_its_rule_and_refuses_what_it_cannot(run, refusal, npz, npy):
    pytest.importorskip("scipy")
    status, out, _ = run("verify", npy, "--cutoff", "3", "--against", "scipy")
    assert status == 0
    assert "(d <= cutoff)" in out
    box = ["--box", "8,8,8"]
    assert run("verify", npy, "--cutoff", "3", "--against", "scipy", *box)[0] == 0
    assert run("verify", npy, "--cutoff", "6", "--against", "scipy", *box)[0] == 1  # images
    assert "right angles" in refusal("verify", npz, "--against", "scipy")
    assert "[0, L)" in refusal("verify", npy, "--against", "scipy", "--box", "4,4,4")


def test_two_dimensions_are_put_to_peers_in_three(run, tmp_path):
    pytest.importorskip("ase")
    np.savez(tmp_path / "flat.npz", points=POINTS[:, :2], box=BOX[:2, :2])
    assert run("verify", tmp_path / "flat.npz", "--cutoff", "2", "--against", "ase")[0] == 0


def test_rounding_of_a_peer_is_found_at_ties(run, tmp_path):
    pytest.importorskip("scipy")
    np.save(tmp_path / "lattice.npy", np.indices((9, 9, 9)).reshape(3, -1).T * 0.1)
    args = ["verify", tmp_path / "lattice.npy", "--cutoff", "0.3", "--sample", "100"]
    status, out, _ = run(*args, "--against", "scipy")
    assert status == 1
    assert "WRONG" in out
    assert "spurious: i=15 j=" in out
    assert "distance - cutoff = +9.252e-18" in out
    assert run(*args)[0] == 0


def test_wrong_rows_are_found_both_ways(monkeypatch, run, npz):
    i, j, S = hs.pairs(POINTS, 3.0, box=BOX, quantities="ijS", sort=True)
    i, j = j, i  # either way round is right
    S = -S.astype(np.int64)

    class Oracle(Library):
        name = distribution = module = "json"
        inclusive, quantities = True, "ijS"

        def prepare(self, question):
            wrong_i = np.r_[i[1:], i[5], 3]  # the first missed, one twice, one invented
            wrong_j = np.r_[j[1:], j[5], 3]
            return lambda: (wrong_i, wrong_j, np.r_[S[1:], S[5:6], [[9, 9, 9]]])

    monkeypatch.setitem(cli_peers.PEERS, "oracle", Oracle())
    status, out, _ = run("verify", npz, "--cutoff", "3", "--against", "oracle", "--json")
    assert status == 1
    for check in json.loads(out)["checks"]:
        assert (check["missed"], check["spurious"], check["duplicate"]) == (1, 1, 1)
        assert check["examples"]["missed"] == [[j[0], i[0], *(-S[0])]]
        assert check["examples"]["spurious"] == [[3, 3, 9, 9, 9]]
        assert check["examples"]["duplicate"] == [[j[5], i[5], *(-S[5])]]
    status, out, _ = run("verify", npz, "--cutoff", "3", "--against", "oracle")
    assert "1 missed, 1 spurious, 1 duplicate" in out
    assert "spurious: i=3 j=3 S=[9, 9, 9]" in out


def test_a_peer_that_fails_is_an_error_in_one_line(monkeypatch, refusal, npz):
    class Oracle(Library):
        name = distribution = module = "json"
        quantities = "ijS"

        def prepare(self, question):
            raise RuntimeError("no\nlist")

    monkeypatch.setitem(cli_peers.PEERS, "oracle", Oracle())
    line = refusal("verify", npz, "--against", "oracle")
    assert "json returned no list: RuntimeError: no list" in line


def test_sample_is_points_near_one_another(npz):
    scene = read_scene(str(npz))
    rows = cli_verify.sample_points(scene, 24)
    assert 6 <= len(rows) <= 24
    assert len(set(rows.tolist())) == len(rows)
    inside = hs.count_pairs(POINTS[rows], 3.0, box=BOX) / len(rows)
    anywhere = hs.count_pairs(POINTS[: len(rows)], 3.0, box=BOX) / len(rows)
    assert inside > anywhere
    assert len(cli_verify.sample_points(scene, 1)) == 1
    assert cli_verify.sample_points(scene, 60) is None


# info, selftest and the process ------------------------------------------------------------


def test_info_names_version_kernels_and_build(run):
    status, out, err = run("info")
    assert (status, err) == (0, "")
    for word in (hs.__version__, *hs.kernels(), np.__version__, "compiler", "cpu"):
        assert word in out
    told = json.loads(run("info", "--json")[1])
    assert told["kernels"] == list(hs.kernels())
    assert told["kernel used"] == (os.environ.get("HALFSHELL_KERNEL") or hs.kernels()[0])


@pytest.mark.parametrize("form", [[], ["--json"]])
def test_info_says_that_a_kernel_of_the_environment_is_unknown(form):
    run = subprocess.run(
        [sys.executable, "-m", "halfshell", "info", *form],
        capture_output=True, text=True, env={**os.environ, "HALFSHELL_KERNEL": "no\x1bsense"},
    )  # fmt: skip
    assert run.returncode == 2
    assert run.stderr.startswith(
        r"halfshell: error: HALFSHELL_KERNEL=no\x1bsense: is not a kernel of this CPU ("
    )
    assert "searches that name none are refused" in run.stderr and run.stderr.count("\n") == 1
    if form:
        told = json.loads(run.stdout)
        assert told["kernel used"] is None and told["kernels"] == list(hs.kernels())
    else:
        assert "kernel used   none\n" in run.stdout


def test_selftest_passes_its_status_on(monkeypatch, run):
    monkeypatch.setattr(selftest, "run", lambda: 0)
    assert run("selftest")[0] == 0
    monkeypatch.setattr(selftest, "run", lambda: 2)
    assert run("selftest")[0] == 1


def test_help_and_version(capsys):
    for args in (["--help"], ["pairs", "--help"], ["verify", "--help"], ["--version"]):
        with pytest.raises(SystemExit) as stop:
            cli.main(args)
        assert stop.value.code == 0
    assert hs.__version__ in capsys.readouterr().out


def test_imports_nothing_that_is_not_needed(npz):
    script = (
        "import sys; from halfshell.cli import main;"
        "statuses = [main(run.split()) for run in sys.argv[1:]];"
        "print(statuses, {'ase', 'scipy', 'matplotlib', 'rich', 'pandas'} & set(sys.modules))"
    )
    commands = ["pairs", f"pairs {npz} --json", "info", f"verify {npz}"]
    done = subprocess.run(
        [sys.executable, "-c", script, *commands], capture_output=True, text=True, timeout=120
    )
    assert done.stdout.splitlines()[-1] == "[0, 0, 0, 0] set()", done.stderr


def test_module_runs_and_exits_with_the_status(tmp_path):
    run = [sys.executable, "-m", "halfshell", "pairs", "--cutoff", "2"]
    done = subprocess.run(run, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0
    assert "6,144" in done.stdout
    done = subprocess.run([*run, tmp_path / "no.cif"], capture_output=True, text=True, timeout=120)
    assert done.returncode == 2
    assert done.stderr == f"halfshell: error: {tmp_path / 'no.cif'}: no such file\n"


@pytest.mark.skipif(os.name != "posix", reason="named pipes and signals of POSIX")
def test_ctrl_c_is_one_line_and_status_130(tmp_path):
    pipe = tmp_path / "points.xyz"
    os.mkfifo(pipe)
    run = [sys.executable, "-m", "halfshell", "pairs", str(pipe)]
    with subprocess.Popen(
        run,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        # A shell that runs the tests in the background has them ignore it, and their children.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    ) as process:
        with open(pipe, "wb"):  # returns once the run waits for our bytes
            for attempt in range(12):  # an interpreter may swallow one, in a clean-up of its own
                process.send_signal(signal.SIGINT)
                try:
                    out, err = process.communicate(timeout=5)
                    break
                except subprocess.TimeoutExpired:
                    assert attempt < 11
    assert process.returncode == 130
    assert (out, err) == ("", "halfshell: interrupted\n")


@pytest.mark.parametrize(
    "command, words", [("pairs", "searching"), ("verify", "checking by integers")]
)
def test_a_progress_bar_unless_it_is_in_the_way(monkeypatch, run, npz, command, words):
    shown = []

    def bar(wanted, what):
        shown.append((wanted, what))
        return contextlib.nullcontext()

    for module in ("lists", "verify"):
        monkeypatch.setattr(f"halfshell._cli.{module}.progress_bar", bar)
    for options, wanted in (([], True), (["--no-progress"], False), (["--json"], False)):
        assert run(command, npz, "--cutoff", "2", *options)[0] == 0
        assert shown.pop() == (wanted, words)
