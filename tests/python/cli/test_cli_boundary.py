# SPDX-License-Identifier: BSD-3-Clause
"""Any file and any arguments: done, or one line on standard error and exit status 2."""

import contextlib
import io
import os
import random
import subprocess
import sys
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from halfshell import cli

pytestmark = pytest.mark.slow
POINTS = np.arange(30.0).reshape(10, 3) % 7.0


def check(*arguments):
    """Run the command line; assert how it ended; return (status, standard error)."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # ours would be lines on standard error too
            try:
                status = cli.main([str(argument) for argument in arguments])
            except SystemExit as end:  # --help, --version
                status = end.code
    err = err.getvalue()
    assert status in (0, 2), (status, err)
    if status == 2:
        assert out.getvalue() == ""
        assert err.startswith("halfshell: error: ") and err.count("\n") == 1, err
        assert len(err) < 2000
    return status, err


def refused(*arguments):
    status, err = check(*arguments)
    assert status == 2
    return err


# ---- files ---------------------------------------------------------------------------------


def valid_bytes(kind):
    """A good file of a kind that NumPy reads."""
    stream = io.BytesIO()
    if kind == "npy":
        np.save(stream, POINTS)
    elif kind == "npz":
        np.savez(stream, points=POINTS, box=np.eye(3) * 7, periodic=[True, True, False])
    else:
        np.savez_compressed(stream, points=POINTS, box=np.full(3, 7.0))
    return stream.getvalue()


@st.composite
def broken(draw):
    """A file that was cut short, written over in places, or added to."""
    kind = draw(st.sampled_from(["npy", "npz", "compressed"]))
    data = bytearray(valid_bytes(kind))
    how = draw(st.sampled_from(["cut", "flip", "fill", "insert"]))
    if how == "cut":
        data = data[: draw(st.integers(1, len(data)))]
    for _ in range(draw(st.integers(1, 4)) if how != "cut" else 0):
        place = draw(st.integers(0, len(data) - 1) | st.integers(0, min(160, len(data) - 1)))
        if how == "flip":
            data[place] ^= 1 << draw(st.integers(0, 7))
        elif how == "fill":
            data[place : place + 8] = draw(st.sampled_from([b"\xff" * 8, b"\0" * 8, b"9" * 8]))
        else:
            data[place:place] = draw(st.binary(min_size=1, max_size=9))
    return "npy" if kind == "npy" else "npz", bytes(data)


@given(broken())
def test_broken_numpy_files(tmp_path_factory, drawn):
    suffix, data = drawn
    path = tmp_path_factory.getbasetemp() / f"broken.{suffix}"
    path.write_bytes(data)
    check("pairs", path, "--cutoff", "1.5")


SUFFIXES = ("npy", "npz", "csv", "xyz", "extxyz", "cif", "pdb", "gen", "traj", "json", "dat", "")
JUNK = {
    "empty": b"",
    "zeros": bytes(4096),
    "binary": random.Random(5).randbytes(4096),
    "text": b"what is this?\n" * 50,
    "NaN": b"x,y,z\n0.0,nan,1.0\n1.0,2.0,inf\n",
    "numbers": b"3\n\n1 2 3\n4 5 6\n",
    "xyz with NaN": b"2\nprops\nH 0 0 nan\nH 0 0 1\n",
    "xyz that lies": b"1000000\nprops\nH 0 0 0\n",
    "newlines": b"\n" * 100,
    "xyz of letters": b"1\n\nH a b c\n",
    "cif without a cell": b"data_x\n_cell_length_a abc\n",
    "zip of nothing": b"PK\x05\x06" + bytes(18),
    "latin": "\xe9\xe8".encode("latin-1") * 30,
}


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("name", JUNK)
def test_junk(tmp_path, name, suffix):
    path = tmp_path / (f"junk.{suffix}" if suffix else "junk")
    path.write_bytes(JUNK[name])
    refused("pairs", path, "--cutoff", "1.0")


def test_places_that_are_no_files(tmp_path):
    (tmp_path / "folder.npz").mkdir()
    for name in (tmp_path, tmp_path / "folder.npz", tmp_path / "none", "/", "", "\0", "a\nb", "~"):
        for command in ("pairs", "verify"):
            refused(command, name, "--cutoff", "1.0")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    refused("pairs", tmp_path / "loop", "--cutoff", "1.0")
    refused("pairs", "x" * 5000, "--cutoff", "1.0")


def test_a_pipe_is_not_waited_for(tmp_path):
    for suffix in (".npy", ".npz"):
        os.mkfifo(tmp_path / f"pipe{suffix}")
        for command in ("pairs", "verify"):
            error = refused(command, tmp_path / f"pipe{suffix}", "--cutoff", "1.0")
            assert error.endswith(f"pipe{suffix}: cannot be read: not a regular file\n")


# ---- arguments -----------------------------------------------------------------------------

WORDS = st.sampled_from(
    [
        *("", "0", "1.5", "-1", "nan", "inf", "1e400", "1e308", "1e-320", "0x10", "1_0", "abc"),
        *("\0", "\ud800", "é", "\uff11", "T", "TF", "TFTFTFTFT", "1,2,3", ",", "5,5,5", "ijd"),
        *("9" * 5000, "1 " * 100, "-", "--", "--help", "--cutoff", "--json", "scalar", "exact"),
    ]
)
OPTIONS = st.sampled_from(
    [
        *("--cutoff", "--box", "--periodic", "--format", "--index", "--strict", "--kernel"),
        *("--json", "-o", "--quantities", "--sort", "--plot", "--precision", "--no-progress"),
        *("--sample", "--against", "--nothing", "-x", "--version"),
    ]
)


COMMANDS = st.sampled_from(["pairs", "pairs", "verify", "info"])


@given(st.lists(st.tuples(OPTIONS, WORDS), max_size=3), COMMANDS)
def test_any_arguments(tmp_path_factory, options, command):
    path = tmp_path_factory.getbasetemp() / "good.npy"
    if not path.exists():
        np.save(path, POINTS)
    flat = [word for option in options for word in option]
    folder = os.getcwd()
    os.chdir(tmp_path_factory.getbasetemp())  # where a word may become a file
    try:
        check(command, path, *flat)
    finally:
        os.chdir(folder)


@pytest.mark.parametrize("name", [b"\xff\xfe.npy", b"a\nb.npy", "é.npy".encode()])
@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_names_that_cannot_be_written_to_the_terminal(tmp_path, name, encoding):
    path = os.path.join(os.fsencode(tmp_path), name)
    with open(path, "wb") as file:
        file.write(valid_bytes("npy"))
    environment = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "1"}
    for more, status in (([], 0), (["--json"], 0), (["--box", "1,2"], 2)):
        command = [sys.executable, "-m", "halfshell", "pairs", path, "--cutoff", "1.0", *more]
        done = subprocess.run(command, capture_output=True, env=environment, timeout=60)
        assert done.returncode == status, done.stderr
        assert done.stderr.count(b"\n") == (1 if status else 0), done.stderr
