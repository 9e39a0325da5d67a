# SPDX-License-Identifier: BSD-3-Clause
"""Other libraries in the report: they may be missing, raise, hang or abort, and nothing happens."""

from dataclasses import replace

import numpy as np
import pytest

import halfshell as hs
from halfshell_report import report
from halfshell_report.measure import PeerProcess
from halfshell_report.peers import LIBRARIES, Question
from report_helpers import fake, question

pytestmark = pytest.mark.slow


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


def test_a_library_that_is_missing_is_said_to_be():
    with PeerProcess("ase", 60.0, command=fake("pass", module="no_such_module")) as peer:
        assert peer.ask(question())["status"] == "not installed"
        assert peer.version is None


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
    if name == "NumPy":  # for supports alone: see below
        return
    rows = report(["uniform", "offset-1e3"], methods=[], peers=[name], size="small")
    assert {row.status for row in rows} <= {"ok", "not offered"}
    done = [row for row in rows if row.status == "ok"]
    assert done
    for row in done:
        assert row.wrong == 0
        assert row.d_max_relative is None or row.d_max_relative < 1e-3


@pytest.mark.parametrize("rule", ["max", "min"])
@pytest.mark.parametrize("name", ["cKDTree", "NumPy"])
def test_supports_in_float64_are_right_where_nothing_is_hard(name, rule, rng):
    points = rng.random((300, 3))
    axes = np.linalg.qr(rng.standard_normal((300, 3, 3)))[0]
    H = np.einsum("kab,kb,kcb->kac", axes, rng.uniform(8.0, 16.0, (300, 3)), axes)
    H = (H + H.transpose(0, 2, 1)) / 2.0
    for rows, periodic in ((None, ()), (np.eye(3), (True, False, True))):
        asked = Question(points, 0.13, rows, periodic, supports=H, extent=1.0, rule=rule)
        library = LIBRARIES[name]
        assert library.refuses(asked) is None
        box = {} if rows is None else {"box": rows, "periodic": periodic}
        expected = hs.pairs(hs.Points(points, supports=H, **box), 1.0, rule=rule)
        i, j = library.indices(library.prepare(asked)())
        assert set(zip(i.tolist(), j.tolist())) == set(zip(*(x.tolist() for x in expected)))
        assert len(i) > 20
        count = library.prepare(replace(asked, task="count"))
        assert name != "NumPy" or count() == len(i)


def test_who_takes_supports_and_who_does_not():
    many = Question(np.zeros((10_001, 3)), 0.5, supports=np.zeros((10_001, 3, 3)), extent=1.0)
    assert "more than 10,000 points" in LIBRARIES["NumPy"].refuses(many)
    assert "cKDTree" in LIBRARIES["NumPy"].refuses(Question(np.zeros((2, 3)), 0.5))
    assert LIBRARIES["vesin"].refuses(many) == "a support for each point"
    none = Question(np.zeros((0, 3)), 0.5, supports=np.zeros((0, 3, 3)), extent=1.0, rule="max")
    assert len(LIBRARIES["NumPy"].prepare(none)()) == 0


def test_a_library_that_took_its_time_is_left_out_of_the_rest():
    command = fake("time.sleep(0.2); return lambda: (np.array([0]), np.array([1]))")
    with PeerProcess("ase", 60.0, budget=0.1, command=command) as peer:
        assert peer.ask(question())["status"] == "ok"
        assert peer.ask(question())["status"] == "left out"
