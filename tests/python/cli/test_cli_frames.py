# SPDX-License-Identifier: BSD-3-Clause
"""Frames of the command line: one at a time in memory, named where one fails; with a topology."""

import sys
import warnings

import numpy as np
import pytest

import halfshell as hs
from halfshell._cli.files import read_frames
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
    MDAnalysis = pytest.importorskip("MDAnalysis", reason="MDAnalysis is not installed")
    universe = MDAnalysis.Universe.empty(60, n_residues=60, atom_resindex=range(60),
                                         trajectory=True)  # fmt: skip
    universe.add_TopologyAttr("names", ["O", "H"] * 30)
    universe.add_TopologyAttr("resnames", ["WAT"] * 60)
    universe.add_TopologyAttr("resids", range(1, 61))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        universe.atoms.positions = POINTS
        universe.dimensions = [*LENGTHS, 90, 90, 90]
        universe.atoms.write(str(tmp_path / "top.gro"))
        for suffix in ("xtc", "dcd"):
            with MDAnalysis.Writer(str(tmp_path / f"run.{suffix}"), 60) as writer:
                for k in range(5):
                    universe.atoms.positions = POINTS * (1 + k / 10)
                    universe.dimensions = [*LENGTHS * (1 + k / 10), 90, 90, 90]
                    writer.write(universe.atoms)
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
        files = [universe_files(tmp_path, points, n) for n in (10, 200)]
        kept = 190 * 20_000 * 12
    few, many = (peak(way.split()[0], *some) for some in files)
    assert many - few < 0.4 * kept


def universe_files(folder, points, n_frames):
    """A topology and a trajectory that repeats one frame, as options."""
    MDAnalysis = pytest.importorskip("MDAnalysis", reason="MDAnalysis is not installed")
    universe = MDAnalysis.Universe.empty(len(points), trajectory=True)
    paths = folder / f"{n_frames}.gro", folder / f"{n_frames}.xtc"
    universe.atoms.positions, universe.dimensions = points, [*LENGTHS * 3, 90, 90, 90]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        universe.atoms.write(str(paths[0]))
        with MDAnalysis.Writer(str(paths[1]), len(points)) as writer:
            for _ in range(n_frames):
                writer.write(universe.atoms)
    return paths[0], "--trajectory", paths[1]


# ---- frames that fail ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("index", "words"),
    [
        (":", "frame 4: point 0, coordinate 1 is nan"),
        ("1::3", "frame 4: point 0, coordinate 1 is nan"),
        ("-3:", "frame 1, counted from the first that --index names: point 0, coordinate 1 is nan"),
    ],
)
def test_a_frame_with_a_bad_point_is_named(run, tmp_path, index, words):
    pytest.importorskip("ase", reason="ase is not installed")
    path = extxyz(tmp_path / "run.extxyz", 6, spoil=(4, "H 1 nan 1\n"))
    status, out, err = run("rdf", path, f"--index={index}", "--cutoff", 2)
    assert (status, out) == (2, "") and err == f"halfshell: error: {path}: {words}\n"
    assert run("rdf", path, "--index=:4", "--cutoff", 2)[0] == 0


def test_a_frame_that_cannot_be_read_is_named(run, tmp_path):
    pytest.importorskip("ase", reason="ase is not installed")
    path = extxyz(tmp_path / "run.extxyz", 6, spoil=(4, "H 1 what 1\n"))
    status, out, err = run("rdf", path, "--index=:", "--cutoff", 2)
    assert (status, out) == (2, "") and f"{path}: frame 4: " in err and err.count("\n") == 1


def test_a_frame_that_has_no_g_of_r_is_named(run, tmp_path):
    ase = pytest.importorskip("ase", reason="ase is not installed")
    io = pytest.importorskip("ase.io", reason="ase is not installed")
    frames = [ase.Atoms("H60", POINTS, cell=LENGTHS, pbc=[True, True, k != 2]) for k in range(4)]
    path = tmp_path / "run.extxyz"
    io.write(path, frames)
    status, _, err = run("rdf", path, "--index=:", "--cutoff", 2)
    assert status == 2 and f"{path}: frame 2: g(r) needs a box" in err


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


def test_trajectories_that_cannot_be_read(run, topology, tmp_path, monkeypatch):
    top, folder = topology
    for name, words in (("none.xtc", "none.xtc: no such file"), ("bad.xtc", "cannot be read")):
        if words == "cannot be read":
            (tmp_path / name).write_bytes(b"junk" * 99)
        status, out, err = run("pairs", top, "--trajectory", tmp_path / name, "--cutoff", 2)
        assert (status, out) == (2, "") and words in err and err.count("\n") == 1
    assert f"error: {top} with {tmp_path / 'bad.xtc'}: cannot be read" in err
    status, _, err = run("rdf", top, "--trajectory", folder / "run.xtc", "--index", "7:")
    assert status == 2 and "has none of these frames" in err
    assert "--trajectory needs a file" in run("pairs", "--trajectory", folder / "run.xtc")[2]
    monkeypatch.setitem(sys.modules, "MDAnalysis", None)
    status, _, err = run("pairs", top, "--trajectory", folder / "run.xtc", "--cutoff", 2)
    assert status == 2 and "--trajectory needs MDAnalysis: pip install MDAnalysis" in err
