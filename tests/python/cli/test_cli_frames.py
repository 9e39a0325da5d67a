# SPDX-License-Identifier: BSD-3-Clause
"""Frames of the command line: one at a time in memory, named where one fails; with a topology."""

import sys

import numpy as np
import pytest

import halfshell as hs
from halfshell._cli.files import read_frames
from structure_writers import write_by_mdanalysis
from subprocesses import run as run_script

POINTS = np.random.default_rng(5).random((60, 3)) * 8
LENGTHS = np.array([8.0, 7.5, 9.0])


def extxyz(path, n_frames, points=POINTS, spoil=None):
    """A trajectory; `spoil` changes the words of the first atom of one frame."""
    with path.open("w") as stream:
        for k in range(n_frames):
            rows = points * (1 + k / 1000)
            edges = " ".join(map(str, np.diag(LENGTHS * (1 + k / 1000)).ravel()))
            stream.write(f'{len(rows)}\nLattice="{edges}" Properties=species:S:1:pos:R:3\n')
            lines = [f"H {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in rows.tolist()]
            if spoil is not None and spoil[0] == k:
                lines[0] = spoil[1]
            stream.writelines(lines)
    return path


@pytest.fixture
def topology(tmp_path):
    """A topology and a trajectory of five frames, as MDAnalysis writes them."""
    frames = [(POINTS * (1 + k / 10), LENGTHS * (1 + k / 10)) for k in range(5)]
    write_by_mdanalysis(frames, tmp_path / "top.gro", tmp_path / "run.xtc", tmp_path / "run.dcd")
    return tmp_path / "top.gro", tmp_path


# ---- memory ----------------------------------------------------------------------------------

PEAK = """
import json, sys
import numpy as np
import halfshell as hs
from halfshell import cli
WAY, FILES = sys.argv[1], sys.argv[2:]
if WAY == "rdf":
    assert cli.main(["rdf", *FILES, "--index=:", "--cutoff", "0.5", "--threads", "1"]) == 0
else:
    import MDAnalysis
    universe = MDAnalysis.Universe(FILES[0], FILES[2], to_guess=())
    for i, j in hs.trajectory_pairs(universe.trajectory, 0.5, threads=1):
        pass
with open("/proc/self/status") as lines:  # of this program; ru_maxrss is at least its parent's
    peak = next(line.split()[1] for line in lines if line.startswith("VmHWM"))
print(json.dumps(int(peak) * 1024))
"""


def peak(*arguments):
    return run_script(PEAK.replace("sys.argv[1], sys.argv[2:]", f"{arguments[0]!r}, "
                                   f"{list(map(str, arguments[1:]))!r}"))  # fmt: skip


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="VmHWM is of Linux")
@pytest.mark.parametrize("way", ["rdf of ASE", "rdf", "trajectory_pairs"])
def test_memory_does_not_grow_with_the_number_of_frames(tmp_path, way):
    pytest.importorskip("ase", reason="ase is not installed")
    if way == "rdf of ASE":
        points = np.random.default_rng(1).random((2000, 3)) * LENGTHS
        files = [(extxyz(tmp_path / f"{n}.extxyz", n, points),) for n in (10, 200)]
        kept = 190 * 2000 * 32
    else:
        points = np.random.default_rng(1).random((20_000, 3)) * LENGTHS * 3
        files = []
        for n in (10, 200):
            top, run = tmp_path / f"{n}.gro", tmp_path / f"{n}.xtc"
            write_by_mdanalysis([(points, LENGTHS * 3)] * n, top, run)
            files.append((top, "--trajectory", run))
        kept = 190 * 20_000 * 12
    few, many = (peak(way.split()[0], *some) for some in files)
    assert many - few < 0.4 * kept


# ---- frames that fail ------------------------------------------------------------------------


NAN = "positions must be finite, got positions[0, 1] = nan"


@pytest.mark.parametrize(
    ("index", "words"),
    [
        (":", f"frame 4: {NAN}"),
        ("1::3", f"frame 4: {NAN}"),
        ("-3:", f"frame 1, counted from the first that --index names: {NAN}"),
    ],
)
def test_a_frame_with_a_bad_point_is_named(run, tmp_path, index, words):
    pytest.importorskip("ase", reason="ase is not installed")
    path = extxyz(tmp_path / "run.extxyz", 6, spoil=(4, "H 1 nan 1\n"))
    status, out, err = run("rdf", path, f"--index={index}", "--cutoff", 2)
    assert (status, out) == (2, "") and err == f"halfshell: error: {path}: {words}\n"
    assert run("rdf", path, "--index=:4", "--cutoff", 2)[0] == 0


def test_a_frame_that_cannot_be_read_is_named(refusal, tmp_path):
    pytest.importorskip("ase", reason="ase is not installed")
    path = extxyz(tmp_path / "run.extxyz", 6, spoil=(4, "H 1 what 1\n"))
    assert f"{path}: frame 4: " in refusal("rdf", path, "--index=:", "--cutoff", 2)


def test_a_frame_that_has_no_g_of_r_is_named(refusal, tmp_path):
    ase = pytest.importorskip("ase", reason="ase is not installed")
    io = pytest.importorskip("ase.io", reason="ase is not installed")
    frames = [ase.Atoms("H60", POINTS, cell=LENGTHS, pbc=[True, True, k != 2]) for k in range(4)]
    path = tmp_path / "run.extxyz"
    io.write(path, frames)
    assert f"{path}: frame 2: g(r) needs a box" in refusal("rdf", path, "--index=:", "--cutoff", 2)


def test_only_frames_that_are_wanted_are_read(tmp_path):
    pytest.importorskip("ase", reason="ase is not installed")
    path = extxyz(tmp_path / "run.extxyz", 6, spoil=(4, "H 1 nan 1\n"))
    frames = read_frames(str(path), slice(None))
    assert [next(frames).frame for _ in range(4)] == [f"frame {k}" for k in range(4)]


# ---- topology and trajectory -----------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["xtc", "dcd"])
def test_a_topology_with_a_trajectory(told, topology, suffix):
    top, folder = topology
    both = [top, "--trajectory", folder / f"run.{suffix}", "--cutoff", 2]
    import MDAnalysis

    universe = MDAnalysis.Universe(str(top), str(folder / f"run.{suffix}"), to_guess=())

    def scene(number):
        step = universe.trajectory[number]
        return {"points": step.positions.copy(), "box": step.triclinic_dimensions.copy()}

    for options, number in (([], -1), (["--index", "1"], 1)):
        facts = told("pairs", *both, *options)
        assert facts["pairs"] == hs.count_pairs(cutoff=2.0, **scene(number))
        assert facts["species"] == {"H": 30, "O": 30}
    rows = told("coordination", *both, "--index", 2)["entries"]
    assert rows == 2 * hs.count_pairs(cutoff=2.0, **scene(2))
    assert told("nearest", *both[:3], "-k", 2)["entries"] == 120
    facts = told("rdf", *both, "--index=1::2")
    assert facts["frames"] == 2
    assert facts["pairs"] == sum(hs.count_pairs(cutoff=2.0, **scene(k)) for k in (1, 3))


def test_trajectories_that_cannot_be_read(run, refusal, topology, tmp_path, monkeypatch):
    top, folder = topology
    for name, words in (("none.xtc", "none.xtc: no such file"), ("bad.xtc", "cannot be read")):
        if words == "cannot be read":
            (tmp_path / name).write_bytes(b"junk" * 99)
        line = refusal("pairs", top, "--trajectory", tmp_path / name, "--cutoff", 2)
        assert words in line
    assert f"error: {top} with {tmp_path / 'bad.xtc'}: cannot be read" in line
    line = refusal("rdf", top, "--trajectory", folder / "run.xtc", "--index", "7:")
    assert "has none of these frames" in line
    assert "--trajectory needs a file" in run("pairs", "--trajectory", folder / "run.xtc")[2]
    monkeypatch.setitem(sys.modules, "MDAnalysis", None)
    line = refusal("pairs", top, "--trajectory", folder / "run.xtc", "--cutoff", 2)
    assert "--trajectory needs MDAnalysis: pip install MDAnalysis" in line
