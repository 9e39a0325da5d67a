"""The report as a whole: rows, other libraries, CSV, words, figures, the page, the command."""

import base64
import csv
import doctest
import importlib
import io
import math
import pkgutil
import re
import sys
import textwrap
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest

import halfshell as hs
from halfshell import _cli_report, _peers, _report, cli, scenes
from halfshell._peers import LIBRARIES, Library, Question, wrapped
from halfshell._reference import reference_pairs
from halfshell._report import figures, html, table, words
from halfshell._report.facts import machine_facts
from halfshell._report.peers import PeerProcess
from halfshell._report.rows import STATUSES, ReportRow, read_csv, write_csv
from halfshell._report.timing import Patience, take_turns
from halfshell._report.truth import true_pairs
from oracles import remembered

MODULES = [
    f"{package.__name__}.{module.name}"
    for package in (_report, _peers)
    for module in pkgutil.iter_modules(package.__path__)
]


@pytest.fixture(scope="module")
def rows():
    """Two scenes, one of which moves, by every method of ours and SciPy's tree."""
    return hs.report(["near-ties", "head-on"], peers=["cKDTree"], size="small")


@pytest.mark.parametrize("name", MODULES)
def test_examples_in_docstrings_run(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0


# ---- the truth and our own search on every scene -------------------------------------------


@pytest.mark.parametrize("name", scenes.names())
def test_the_truth_is_that_of_rational_brute_force_on_every_scene(name):
    scene = scenes.load(name, "small")
    periodic = scene.periodic if scene.box is not None else None
    truth = true_pairs(scene.points, scene.cutoff, scene.box, periodic)
    # In the form in which other tests ask too, so that it is worked out once.
    expected = remembered(
        reference_pairs, scene.points, scene.cutoff, scene.box, scene.periodic, scene.inclusive
    )
    pairs = truth.by_rule(scene.inclusive)
    found = zip(pairs.i.tolist(), pairs.j.tolist(), map(tuple, pairs.S.tolist()))
    assert sorted(found) == expected


def test_exact_is_right_on_every_scene_and_rounding_is_not():
    rows = hs.report(methods=["exact", "double", "single"], size="small")
    assert list(dict.fromkeys(row.scene for row in rows)) == list(scenes.names())
    assert {row.status for row in rows} == {"ok"}
    wrong = {method: {row.scene for row in rows if row.method == method and row.wrong}
             for method in ("exact", "double", "single")}  # fmt: skip
    assert wrong["exact"] == set()
    assert "near-ties" in wrong["double"] & wrong["single"]
    for row in rows:
        assert row.d_max_ulp is None or row.d_max_ulp <= 1.0 or row.method != "exact"


# ---- rows ----------------------------------------------------------------------------------


def test_rows_say_what_was_asked_and_found(rows):
    exact = rows[0]
    assert (exact.scene, exact.kind, exact.method) == ("near-ties", "halfshell", "exact")
    assert (exact.status, exact.rule, exact.compared_by) == ("ok", "<=", "i j S")
    assert exact.version == hs.__version__
    assert exact.wrong == 0 and exact.pairs_true > 0 and exact.rows_given == exact.pairs_true
    assert exact.seconds >= exact.seconds_least > 0.0 and exact.repeats >= 1
    single = next(row for row in rows if row.method == "single")
    assert single.wrong > 0 and 0.0 < single.wrong_share < 1.0
    assert {row.status for row in rows} <= set(STATUSES)
    assert [row.method for row in rows if row.kind == "peer"] == ["cKDTree"] * 2


def test_float32_input_errs_by_float32(rows):
    row = next(row for row in rows if row.method == "float32" and row.scene == "near-ties")
    assert row.d_max_ulp > 1e6
    assert 1e-10 < row.d_max_relative < 1e-5


def test_kept_lists_have_rows_of_their_own(rows):
    kept = [row for row in rows if row.kind == "reuse"]
    assert {row.scene for row in kept} == {"head-on"}
    assert all(row.wrong == 0 for row in kept if row.method != "by the clock")
    late = [row for row in kept if row.method == "by the clock" and row.wrong]
    assert late and max(row.drift_kinetic for row in late) > 10.0
    verlet = [row for row in kept if row.method == "verlet"]
    assert len(verlet) == 3 and all(1 < row.builds < row.steps for row in verlet)


def test_scenes_in_float32_are_not_rounded_again():
    (row,) = hs.report(["float32-ulp"], methods=["float32"], size="small")
    assert (row.status, row.wrong) == ("not offered", None)
    assert "float32 as they are" in row.note


def test_names_are_checked():
    with pytest.raises(ValueError, match=r"there is no scene 'near-tie'; choose from near-ties"):
        hs.report(["near-tie"])
    with pytest.raises(ValueError, match="there is no method 'exakt'; choose from exact"):
        hs.report(["uniform"], methods=["exakt"])
    with pytest.raises(ValueError, match="there is no peer 'vesn'; choose from vesin"):
        hs.report(["uniform"], peers=["vesn"])
    with pytest.raises(ValueError, match="size must be one of"):
        hs.report(["uniform"], size="big")
    with pytest.raises(ValueError, match="patience must be"):
        hs.report(["uniform"], patience=-1.0)
    with pytest.raises(TypeError, match="a sequence of names"):
        hs.report("uniform")


def test_csv_is_read_back_as_it_was(rows):
    odd = replace(rows[0], note='a "quoted", note', d_max_ulp=math.inf, missed=None)
    stream = io.StringIO()
    facts = machine_facts()
    write_csv(stream, facts, [*rows, odd])
    stream.seek(0)
    assert read_csv(stream) == (facts, [*rows, odd])
    stream.seek(0)
    head = next(csv.reader(stream))
    assert {"scene", "missed", "d_max_ulp", "cpu", "date", "halfshell", "numpy"} <= set(head)


def test_every_field_is_documented():
    told = ReportRow.__doc__
    for name in ReportRow.__dataclass_fields__:
        assert re.search(rf"\b{name}\b", told), name


# ---- timing --------------------------------------------------------------------------------


def test_every_call_is_timed_and_patience_is_kept():
    made = []
    calls = {name: lambda name=name: made.append(name) for name in "ab"}
    timings = take_turns(calls, Patience(3, 10.0))
    assert set(made) == {"a", "b"}
    assert all(0.0 < timings[name].least <= timings[name].median for name in "ab")
    assert timings["a"].repeats == made.count("a") > 3
    once = take_turns({"slow": lambda: sum(range(300_000))}, Patience(1000, 0.01))
    assert 1 <= once["slow"].repeats < 500


# ---- other libraries -----------------------------------------------------------------------


def question(**other):
    scene = {"points": np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]), "cutoff": 1.0, "rows": None,
             "periodic": (), "patience": Patience(1, 0.01), "pairs": 1}  # fmt: skip
    return {**scene, **other}


def fake(prepare, module="json"):
    """A command that runs the worker with a library whose `prepare` is this code."""
    code = f"""
        import importlib, os, time
        import numpy as np
        from halfshell._peers import LIBRARIES, Library
        from halfshell._report.worker import main

        class Fake(Library):
            name = "fake"
            distribution = "numpy"
            module = "{module}"

            def prepare(self, question):
                {prepare}

        LIBRARIES["fake"] = Fake()
        raise SystemExit(main("fake"))
    """
    return [sys.executable, "-c", textwrap.dedent(code)]


def test_a_library_answers_from_its_own_process():
    command = fake("print('noise'); return lambda: (np.array([0]), np.array([1]))")
    with PeerProcess("ase", 60.0, command=command) as peer:
        for _ in range(2):
            reply = peer.ask(question())
            assert reply["status"] == "ok"
            assert reply["answer"]["i"].tolist() == [0]
            assert reply["timings"]["ij"].least > 0.0
        assert peer.version == np.__version__
        refused = peer.ask(question(points=np.zeros((2, 2))))
        assert (refused["status"], refused["note"]) == ("not offered", "2 dimensions")


def test_a_library_that_raises_has_failed():
    with PeerProcess("ase", 60.0, command=fake("raise ValueError('no  such\\nthing')")) as peer:
        assert peer.ask(question()) == {"status": "failed", "note": "ValueError: no such thing"}


def test_a_library_that_ends_the_process_has_crashed_and_is_started_again():
    with PeerProcess("ase", 60.0, command=fake("os.abort()")) as peer:
        for _ in range(2):
            reply = peer.ask(question())
            assert reply["status"] == "crashed"
            assert "SIGABRT" in reply["note"]
    with PeerProcess("ase", 60.0, command=fake("os._exit(3)")) as peer:
        assert "status 3" in peer.ask(question())["note"]


def test_a_library_that_hangs_is_ended():
    with PeerProcess("ase", 0.5, command=fake("time.sleep(60)")) as peer:
        assert peer.ask(question())["status"] == "timed out"
        assert peer.ask(question())["status"] == "timed out"


def test_a_library_that_took_its_time_is_left_out_of_the_rest():
    command = fake("time.sleep(0.2); return lambda: (np.array([0]), np.array([1]))")
    with PeerProcess("ase", 60.0, budget=0.1, command=command) as peer:
        assert peer.ask(question())["status"] == "ok"
        assert peer.ask(question())["status"] == "left out"


def test_a_list_of_all_and_nothing_is_no_answer():
    command = fake("return lambda: (np.zeros(10**7, int), np.ones(10**7, int))")
    with PeerProcess("ase", 60.0, command=command) as peer:
        reply = peer.ask(question())
        assert reply["status"] == "failed" and "10,000,000 rows" in reply["note"]


def test_a_library_that_is_missing_is_said_to_be():
    with PeerProcess("ase", 60.0, command=fake("pass", module="no_such_module")) as peer:
        assert peer.ask(question())["status"] == "not installed"
        assert peer.version is None


def test_rows_of_missing_libraries_say_so(monkeypatch):
    missing = fake("pass", module="no_such_module")
    start = PeerProcess.__init__
    monkeypatch.setattr(PeerProcess, "__init__", lambda self, name, *rest: start(
        self, name, *rest, command=missing))  # fmt: skip
    rows = hs.report(["uniform"], methods=["exact"], peers=["vesin"], size="small")
    (row,) = [row for row in rows if row.kind == "peer"]
    assert (row.method, row.status, row.note) == ("vesin", "not installed", "pip install vesin")
    assert row.wrong is None and row.seconds is None


def test_points_are_folded_for_a_library_that_demands_it(rng):
    points = rng.uniform(-3.0, 3.0, (60, 2)) * [1.0, 2.0]
    points[0], points[1] = (1.0, -1e-30), (2.0, 4.0)
    asked = Question(points, 0.2, np.diag([1.0, 2.0]), (True, False))
    folded, outside = wrapped(asked)
    assert outside
    assert ((folded.points[:, 0] >= 0.0) & (folded.points[:, 0] < 1.0)).all()
    assert (folded.points[:, 1] == points[:, 1]).all()
    assert not wrapped(folded)[1]
    tree = LIBRARIES["cKDTree"]
    i, _ = tree.indices(tree.prepare(folded)())
    assert len(i) == hs.count_pairs(points, 0.2, box=[1.0, 2.0], periodic=[True, False])


def test_what_a_question_asks_for():
    rows = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.0]])
    slab = Question(np.zeros((1, 3)), 0.5, rows, (True, True, False))
    assert slab.has_images and slab.orthorhombic
    assert not replace(slab, cutoff=0.4).has_images
    tilted = replace(slab, rows=rows + np.array([[0.0] * 3, [0.9, 0.0, 0.0], [0.0] * 3]))
    assert not tilted.orthorhombic
    assert LIBRARIES["cKDTree"].refuses(tilted) == "triclinic box"
    assert LIBRARIES["MDAnalysis"].refuses(slab) == "some axes periodic, some open"
    assert LIBRARIES["freud"].refuses(replace(slab, cutoff=0.1, quantities="ijS")) == "quantities S"
    line = Question(np.zeros((1, 1)), 0.5)
    assert LIBRARIES["freud"].refuses(line) == "1 dimension"
    assert LIBRARIES["vesin"].refuses(line) is None


@pytest.mark.parametrize("name", LIBRARIES)
def test_installed_libraries_are_right_where_nothing_is_hard(name):
    if LIBRARIES[name].version() is None:
        pytest.skip(f"{name} is not installed")
    rows = hs.report(["uniform", "offset-1e3"], methods=[], peers=[name], size="small")
    assert {row.status for row in rows} <= {"ok", "not offered"}
    done = [row for row in rows if row.status == "ok"]
    assert done
    for row in done:
        assert row.wrong == 0
        assert row.d_max_relative is None or row.d_max_relative < 1e-3


def test_no_adapter_shadows_another():
    assert list(LIBRARIES) == [library.name for library in LIBRARIES.values()]
    assert all(isinstance(library, Library) for library in LIBRARIES.values())


# ---- words, tables, figures, page ----------------------------------------------------------


def row(method, kind="halfshell", **other):
    blank = ReportRow("s", "a scene", 10, 3, 1.0, "open", kind, method, pairs_true=1000, missed=0,
                      spurious=0, duplicate=0, seconds=1.0, seconds_least=1.0)  # fmt: skip
    return replace(blank, **other)


def bare(method, status, **other):
    return row(method, "peer", status=status, missed=None, spurious=None, duplicate=None,
               pairs_true=None, seconds=None, **other)  # fmt: skip


def test_words_say_what_the_rows_say():
    said = words.findings([
        row("exact", d_max_ulp=0.0), row("double", missed=3, seconds_least=0.5, d_max_ulp=1.0),
        row("other", "peer", spurious=1, version="2"), bare("gone", "not installed"),
    ])  # fmt: skip
    text = "\n".join(said)
    assert "Precision 'exact' gave 1 list with 1,000 pairs in all, and every one was right." in text
    assert "1 of the lists is wrong, by 3 pairs. Worst on s: 3 missed of 1,000 pairs." in text
    assert "2.00 times as long as 'double'" in text
    assert "off by 1 unit in the last place" in text
    assert "gone: not installed; no list to judge." in text


def test_words_on_a_scene_tell_right_from_wrong():
    said = words.scene_words([
        row("exact"), row("single", missed=1, spurious=2),
        bare("other", "crashed", note="ended by SIGABRT"), bare("more", "not offered", note="2-D"),
    ])  # fmt: skip
    assert said == (
        "Right: exact. Wrong: single (1 missed, 2 spurious). "
        "No answer: other (crashed: ended by SIGABRT). Not offered: more (2-D)."
    )


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, ""), (0, "0"), (7, "7"), (12345, "12,345"), (0.5, "0.5"), (1e10, "1.0e+10"),
     (math.inf, "inf"), (3e-17, "3e-17")],
)  # fmt: skip
def test_numbers_are_short(value, text):
    assert words.number(value) == text


def test_durations_have_units():
    assert [words.duration(x) for x in (2.0, 3e-3, 4e-6, None)] == ["2 s", "3 ms", "4 µs", ""]


def test_tables_have_a_line_a_method(rows):
    from rich.console import Console

    stream = io.StringIO()
    console = Console(file=stream, width=80)
    console.print(table.summary_table(rows))
    for name in ("near-ties", "head-on"):
        console.print(table.scene_table([row for row in rows if row.scene == name]))
    console.print(table.scene_table([bare("other", "crashed", note="by SIGABRT")]))
    text = stream.getvalue()
    assert max(map(len, text.splitlines())) <= 80
    assert re.search(r"exact +2 +0 +0 +0 +0 +0 +0", text)
    assert re.search(r"single +<= .* spurious", text)
    assert "other: crashed: by SIGABRT" in text
    assert "…" not in text


def parse(page):
    head, _, rest = page.partition("\n")
    assert head == "<!DOCTYPE html>"
    return ElementTree.fromstring(rest)


def test_the_page_is_well_formed_and_needs_nothing_else(rows):
    page = html.page(machine_facts(), rows)
    tree = parse(page)
    assert "http" not in re.sub(r"base64,[^\"]*", "", page)
    for element in tree.iter():
        assert element.tag not in ("script", "link", "iframe", "object")
        for name, value in element.attrib.items():
            if name in ("src", "href"):
                assert value.startswith("data:image/svg+xml;base64,")
    images = [element.get("src") for element in tree.iter("img")]
    assert len(images) >= 5
    for image in images:
        svg = ElementTree.fromstring(base64.b64decode(image.partition(",")[2]))
        assert svg.tag == "{http://www.w3.org/2000/svg}svg"
    text = " ".join(tree.itertext())
    assert "every one was right" in text and "near-ties" in text
    assert len(page) < 500_000


def test_what_a_library_says_cannot_break_the_page(rows):
    note = '<script>alert("&")</script> \x1b[31m'
    page = html.page(machine_facts(), [*rows, bare("vesin", "failed", note=note)])
    parse(page)
    assert "<script>" not in page


def test_zero_and_infinity_have_a_place_in_the_figures(rows):
    odd = [row("exact", d_max_ulp=0.0, force_error=0.0),
           row("single", missed=5, d_max_ulp=math.inf, force_error=math.inf)]  # fmt: skip
    svg = figures.to_svg(figures.scene_figure(odd)).decode()
    assert ">0<" in svg and ">∞<" in svg
    assert figures.scene_figure([bare("vesin", "crashed")]) is None
    assert figures.cost_figure([row("exact")]) is None
    assert figures.drift_figure([row("exact")]) is None


def test_figures_are_the_same_bytes_each_time(rows):
    for make in (figures.map_figure, figures.cost_figure, figures.drift_figure):
        assert figures.to_svg(make(rows)) == figures.to_svg(make(rows))


def test_every_method_has_a_mark():
    assert set(figures.LOOKS) == {"exact", "double", "single", "float32", *LIBRARIES}


# ---- the command ---------------------------------------------------------------------------


@pytest.fixture
def command(capsys, tmp_path, monkeypatch):
    """Run the command line in an empty folder; return its status and what it printed."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        status = cli.main(["report", *arguments])
        out, err = capsys.readouterr()
        return status, out, err

    return run


def test_the_command_writes_the_report(command, tmp_path):
    status, out, err = command(
        "--quick", "--size", "small", "--scenes", "near-ties,head-on", "--peers", "cKDTree",
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


def test_libraries_that_are_missing_are_told_of_when_they_were_asked_for(command, monkeypatch):
    missing = fake("pass", module="no_such_module")
    start = PeerProcess.__init__
    monkeypatch.setattr(PeerProcess, "__init__", lambda self, name, *rest: start(
        self, name, *rest, command=missing))  # fmt: skip
    options = ("--scenes", "uniform", "--methods", "exact", "--size", "small")
    assert "not installed" in command(*options, "--peers", "vesin")[1]
    assert "vesin" not in command(*options)[1]


def test_a_wrong_exact_list_is_an_exit_status(command, monkeypatch):
    from halfshell._report import run

    monkeypatch.setattr(run, "run", lambda plan, progress: [row("exact", missed=1)])
    assert command("--scenes", "uniform")[0] == 1
    monkeypatch.setattr(run, "run", lambda plan, progress: [row("exact"), row("single", missed=1)])
    assert command("--scenes", "uniform")[0] == 0


def test_names_are_listed(command):
    status, out, _ = command("--list")
    assert status == 0
    assert all(name in out for name in (*scenes.names(), *LIBRARIES))


@pytest.mark.parametrize(
    "arguments",
    [
        ["--scenes", "no-such-scene"],
        ["--scenes", ","],
        ["--methods", "exact,guess"],
        ["--peers", "nobody"],
        ["--size", "huge"],
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
    assert f"report needs {package}: pip install 'halfshell[cli]'" in err


def test_quick_is_a_choice_of_scenes_that_there_are():
    assert set(_cli_report.QUICK) <= set(scenes.names())
    assert {"head-on", "stiff-chain"} <= set(_cli_report.QUICK)
