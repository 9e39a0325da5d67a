# SPDX-License-Identifier: BSD-3-Clause
"""Nothing that the command line prints for people makes a terminal do anything."""

import json
import os

import numpy as np
import pytest

from halfshell import cli
from halfshell._cli.errors import printable

EVIL = "bad\x1b[31m\x9b2J\u202e\x07\n.npy"
POINTS = np.random.default_rng(5).random((60, 3))

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")


@pytest.fixture
def command(capsys):
    def run(*args):
        status = cli.main([str(arg) for arg in args])
        captured = capsys.readouterr()
        for text in (captured.out, captured.err):
            assert text.replace("\n", "").isprintable()
        return status, captured.out, captured.err

    return run


@pytest.fixture
def evil(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save(EVIL, POINTS)
    return EVIL


def test_names_of_files_are_escaped_in_summaries(command, evil):
    status, out, err = command("pairs", evil, "--cutoff", "0.2", "-o", evil + ".csv")
    assert (status, err) == (0, "")
    lines = out.splitlines()
    name = r"bad\x1b[31m\x9b2J\u202e\x07\n.npy"
    assert lines[0] == name and lines[-1].endswith(name + ".csv")
    status, out, _ = command("verify", evil, "--cutoff", "0.2")
    assert status == 0 and out.splitlines()[0] == name


def test_json_has_the_name_as_it_is(command, evil):
    for name in ("pairs", "verify"):
        assert json.loads(command(name, evil, "--cutoff", "0.2", "--json")[1])["file"] == evil


def test_messages_escape_names(command, evil):
    with open("broken" + EVIL, "wb") as stream:
        stream.write(b"nothing")
    np.savez("variable.npz", **{"what\x1b]0;title\x07": POINTS})
    for arguments in (
        ["pairs", "missing" + EVIL],
        ["pairs", "broken" + EVIL],
        ["pairs", EVIL, "--cutoff", "x\x1b"],
        ["pairs", EVIL, "--periodic", "T"],
        ["pairs", EVIL, "--kernel", "\x1b[0m"],
        ["pairs", EVIL, "-o", "no\x1b"],
        ["pairs", EVIL, "-o", "no\x1b/out.csv"],
        ["verify", EVIL, "--against", "\x1b"],
        ["pairs", EVIL, "--\x1b"],
        ["pairs", "variable.npz"],
        ["report", "-o", EVIL],
        ["report", "--scenes", "\x1b"],
        ["\x1b"],
    ):
        status, out, err = command(*arguments)
        assert (status, out, err.count("\n")) == (2, "", 1)
        if arguments[-1] == "variable.npz":
            assert r"(it holds what\x1b]0;title\x07)" in err


def test_plain_text_stays_as_it_is():
    assert printable("Å größer 10 x 10 中 \\x1b") == "Å größer 10 x 10 中 \\x1b"
    assert printable("a\tb\x85\ud800\U000e0001") == r"a\tb\x85\ud800\U000e0001"
    assert printable("") == ""
