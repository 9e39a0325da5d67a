# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell bench``: answers are compared before they are timed, on the caller's own file."""

import json

import numpy as np
import pytest

import halfshell as hs

pytest.importorskip("scipy", reason="scipy is not installed")
pytest.importorskip("rich", reason="rich is not installed")


@pytest.fixture
def crystal(tmp_path):
    """A lattice whose second shell is at the cutoff."""
    points = np.stack(np.meshgrid(*[np.arange(6.0)] * 3), -1).reshape(-1, 3)
    np.savez(tmp_path / "lattice.npz", points=points, box=[6.0] * 3)
    return tmp_path / "lattice.npz"


def test_our_list_is_checked_and_timed(run, crystal):
    status, out, err = run("bench", crystal, "--cutoff", 1, "--peers", "none", "--json")
    facts = json.loads(out)
    assert (status, err) == (0, "")
    assert facts["points"] == 216 and facts["cutoff"] == 1.0 and not facts["cutoff_chosen"]
    (ours,) = facts["methods"]
    assert ours["method"] == "exact" and ours["status"] == "ok" and ours["seconds"] > 0.0
    assert ours["rows_given"] == 648 and ours["missed"] == ours["spurious"] == 0


def test_the_table_names_the_method_and_how_the_cutoff_was_chosen(run):
    status, out, err = run("bench", "--peers", "none")
    assert (status, err) == (0, "")
    assert "exact" in out and "right" in out and "the cutoff was chosen" in out
    assert "4,608 points" in out


@pytest.mark.slow
def test_other_libraries_are_compared_first(run, crystal):
    pytest.importorskip("ase", reason="ase is not installed")
    peers = "--peers", "ase,cKDTree", "--patience", 60
    status, out, _ = run("bench", crystal, "--cutoff", 1.25, *peers)
    assert status == 0 and "ase" in out and "the fastest other library" in out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--peers", "nobody"], "there is no peer 'nobody'"),
        (["--peers", ","], "--peers names nothing"),
        (["--patience", "0"], "not a positive number of seconds"),
        (["--kernel", "scalar"], "unrecognized arguments: --kernel"),
        (["--threads", "2"], "unrecognized arguments: --threads"),
        (["nothing.npz"], "nothing.npz: no such file"),
    ],
)
def test_what_is_refused(refusal, options, words):
    assert words in refusal("bench", *options)


def test_too_many_points_are_refused(refusal, tmp_path, monkeypatch):
    monkeypatch.setattr("halfshell_report.cli.MOST_POINTS", 10)
    np.save(tmp_path / "points.npy", np.arange(33.0).reshape(11, 3))
    line = refusal("bench", tmp_path / "points.npy", "--cutoff", 1)
    assert "has 11 points; bench compares answers up to 10" in line


def test_a_list_of_ours_that_is_wrong_is_status_1(run, crystal, monkeypatch):
    def wrong(*arguments, **options):
        found = search(*arguments, **options)
        return tuple(column[1:] for column in found)

    search = hs.pairs
    monkeypatch.setattr(hs, "pairs", wrong)
    status, out, _ = run("bench", crystal, "--cutoff", 1, "--peers", "none", "--json")
    assert status == 1 and json.loads(out)["methods"][0]["missed"] == 1
