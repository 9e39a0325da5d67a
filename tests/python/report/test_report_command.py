# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell report``: what it prints and writes, and what it says to wrong arguments."""

import re
import sys

import pytest

import halfshell as hs
from halfshell import cli
from halfshell_report import run
from halfshell_report.peers import LIBRARIES
from halfshell_report.rows import read_csv
from halfshell_report.run import SCENES
from report_helpers import parse, row

pytestmark = pytest.mark.slow


@pytest.fixture
def command(capsys, tmp_path, monkeypatch):
    """Run the command line in an empty folder; return its status and what it printed."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        status = cli.main(["report", *arguments])
        out, err = capsys.readouterr()
        return status, out, err

    return call


def test_the_command_writes_the_report(command, tmp_path):
    status, out, err = command(
        "--size", "small", "--scenes", "near-ties,head-on", "--peers", "cKDTree",
        "-o", "there/it is",
    )  # fmt: skip
    assert (status, err) == (0, "")
    assert "every one was right" in re.sub(r"\s+", " ", out)
    folder = tmp_path / "there" / "it is"
    assert sorted(path.name for path in folder.iterdir()) == ["report.csv", "report.html"]
    parse((folder / "report.html").read_text(encoding="utf-8"))
    with (folder / "report.csv").open(newline="", encoding="utf-8") as stream:
        facts, rows = read_csv(stream)
    assert facts["halfshell"] == hs.__version__
    assert {row.scene for row in rows} == {"near-ties", "head-on"}
    assert {"exact", "cKDTree", "verlet"} <= {row.method for row in rows}


def test_a_wrong_exact_list_is_an_exit_status(command, monkeypatch):
    monkeypatch.setattr(run, "run", lambda plan, progress: [row("exact", missed=1)])
    assert command("--scenes", "uniform")[0] == 1
    monkeypatch.setattr(run, "run", lambda plan, progress: [row("exact"), row("single", missed=1)])
    assert command("--scenes", "uniform")[0] == 0


def test_full_size_is_asked_for_and_says_how_long_it_takes(command, monkeypatch):
    plans = []

    def note(plan, progress):
        plans.append(plan)
        return [row("exact")]

    monkeypatch.setattr(run, "run", note)
    assert command("--peers", "none")[2] == ""
    _, _, said = command("--size", "full", "--peers", "vesin,ase", "--patience", "3")
    assert [plan.size for plan in plans] == ["quick", "full"]
    scenes = len(SCENES)
    assert said == (
        f"full size: about {-(-scenes // 6)} min for the truth and the methods of this "
        f"library, at most {-(-scenes * 6 // 60)} min more for other libraries\n"
    )
    alone = command("--size", "full", "--peers", "none", "--scenes", "uniform")[2]
    assert alone.endswith("about 1 min for the truth and the methods of this library\n")


def test_names_are_listed(command):
    status, out, _ = command("--list")
    assert status == 0
    assert all(name in out for name in (*SCENES, *LIBRARIES))


@pytest.mark.parametrize(
    "arguments",
    [
        ["--scenes", "no-such-scene"],
        ["--scenes", ","],
        ["--methods", "exact,guess"],
        ["--peers", "nobody"],
        ["--size", "huge"],
        ["--size", "small", "--quick"],
        ["--patience", "0"],
        ["--patience", "soon"],
        ["--quik"],
        ["file.xyz"],
        ["--scenes"],
        ["--scenes", "uniform", "-o", "taken"],
    ],
)
def test_wrong_arguments_are_one_line_and_exit_status_2(command, tmp_path, arguments):
    (tmp_path / "taken").write_text("a file")
    status, out, err = command(*arguments)
    assert (status, out) == (2, "")
    assert err.startswith("halfshell: error: ") and err.count("\n") == 1


@pytest.mark.parametrize("package", ["scipy", "matplotlib", "rich"])
def test_a_missing_extra_is_named(command, monkeypatch, package):
    name = {"scipy": "scipy.spatial", "matplotlib": "matplotlib.figure", "rich": "rich.console"}
    monkeypatch.setitem(sys.modules, name[package], None)
    status, _, err = command("--scenes", "uniform")
    assert status == 2
    assert f"report needs {package}: pip install {package}\n" in err


def test_quick_is_a_choice_of_scenes_and_one_thing(command, monkeypatch):
    plans = []
    monkeypatch.setattr(run, "run", lambda plan, progress: plans.append(plan) or [row("exact")])
    for options in ([], ["--quick"], ["--size", "quick"]):
        command(*options, "--peers", "none")
    assert plans[0] == plans[1] == plans[2]
    assert plans[0].scenes == run.QUICK and set(run.QUICK) < set(SCENES)
    assert any(name.startswith("balls-") for name in run.QUICK)
    assert "head-on" in run.QUICK
    command("--scenes", "all"), command("--size", "small")
    assert [plan.scenes for plan in plans[3:]] == [SCENES, SCENES]
    assert run.plan_of(None, None, "none", "quick") == plans[0]
