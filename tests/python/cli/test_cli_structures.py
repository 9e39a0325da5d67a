# SPDX-License-Identifier: BSD-3-Clause
"""Structure files of the command line that ASE does not read, and MDAnalysis may."""

import sys
import warnings

import numpy as np
import pytest

from halfshell._cli import structure_files
from halfshell._cli.errors import InputError
from halfshell._cli.files import read_frames, read_scene


@pytest.fixture
def universe_file(tmp_path):
    """A CHARMM coordinate file, which ASE does not know."""
    MDAnalysis = pytest.importorskip("MDAnalysis", reason="MDAnalysis is not installed")
    pytest.importorskip("ase", reason="ase is not installed")
    universe = MDAnalysis.Universe.empty(4, trajectory=True)
    universe.add_TopologyAttr("names", ["O", "H1", "H2", "O"])
    universe.add_TopologyAttr("resnames", ["WAT"])
    universe.add_TopologyAttr("resids", [1])
    universe.atoms.positions = np.arange(12.0).reshape(4, 3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        universe.atoms.write(str(tmp_path / "water.crd"))
    return tmp_path / "water.crd"


def test_what_ase_does_not_know_mdanalysis_may(universe_file):
    scene = read_scene(str(universe_file))
    assert scene.points.tolist() == np.arange(12.0).reshape(4, 3).tolist()
    assert scene.box is None and not any(scene.periodic)
    assert len(list(read_frames(str(universe_file), slice(None)))) == 1
    with pytest.raises(InputError, match="has no frame 3"):
        read_scene(str(universe_file), index=3)
    with pytest.raises(InputError, match="has none of these frames"):
        list(read_frames(str(universe_file), slice(5, None)))


def test_a_box_of_mdanalysis_is_that_of_its_frame(tmp_path):
    MDAnalysis = pytest.importorskip("MDAnalysis", reason="MDAnalysis is not installed")
    universe = MDAnalysis.Universe.empty(3, trajectory=True)
    universe.atoms.positions = np.arange(9.0).reshape(3, 3)
    universe.dimensions = [8.0, 9.0, 10.0, 90.0, 90.0, 60.0]
    found = structure_files._of_frame(universe.trajectory[0], None, "")
    assert found.box.tolist() == universe.trajectory.ts.triclinic_dimensions.tolist()
    assert found.periodic == (True, True, True) and found.points.dtype == np.float32


def test_without_mdanalysis_the_format_is_unknown(tmp_path, monkeypatch):
    pytest.importorskip("ase", reason="ase is not installed")
    monkeypatch.setitem(sys.modules, "MDAnalysis", None)
    (tmp_path / "points.crd").write_text("* title\n*\n    0\n")
    with pytest.raises(InputError, match="unknown format"):
        read_scene(str(tmp_path / "points.crd"))


def test_a_format_that_neither_knows(tmp_path):
    pytest.importorskip("ase", reason="ase is not installed")
    (tmp_path / "points.nothing").write_text("?\n")
    with pytest.raises(InputError, match="unknown format"):
        read_scene(str(tmp_path / "points.nothing"))
