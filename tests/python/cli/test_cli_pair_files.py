# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell verify STRUCTURE LIST``: saved lists of ours and of others, never points."""

import io
import json
import zipfile

import numpy as np
import pytest

import halfshell as hs

POINTS = np.random.default_rng(6).random((50, 3)) * 6.0
BOX = [6.0, 7.0, 8.0]
CUTOFF = 2.0


@pytest.fixture
def scene(tmp_path):
    np.savez(tmp_path / "scene.npz", points=POINTS, box=BOX)
    np.save(tmp_path / "open.npy", POINTS)
    return tmp_path / "scene.npz"


@pytest.fixture
def judged(run, scene, tmp_path):
    """What is said of a list with this text, or in a file with this name."""

    def call(content, *options, name="list.csv", points=scene):
        if content is not None:
            (tmp_path / name).write_text(content)
        status, out, err = run(
            "verify", points, tmp_path / name, "--cutoff", CUTOFF, "--json", *options
        )
        assert status in (0, 1) and err == "", err
        told = json.loads(out)
        assert told["ok"] == (status == 0)
        return told

    return call


def listed(full=False, **options):
    i, j, S = hs.pairs(POINTS, CUTOFF, box=BOX, quantities="ijS", sort=True, **options)
    if full:
        i, j, S = np.r_[i, j], np.r_[j, i], np.r_[S, -S]
    return i, j, S


def text(names, *columns, between=","):
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return "\n".join([names, *(between.join(map(str, row)) for row in rows), ""])


@pytest.mark.parametrize("suffix", ["csv", "npz", "parquet"])
@pytest.mark.parametrize("command", ["pairs", "neighbors"])
def test_lists_of_ours(run, refusal, judged, scene, tmp_path, command, suffix):
    for letters in ("ijdS", "ij", "jDSi", "P"):
        if suffix == "parquet":
            pytest.importorskip("pyarrow", reason="pyarrow is not installed")
        if letters == "P" and command == "neighbors":
            letters = "ijS"
        name = f"list.{suffix}"
        assert run(command, scene, "--cutoff", CUTOFF, "-o", tmp_path / name,
                   "--quantities", letters)[0] == 0  # fmt: skip
        told = judged(None, name=name)
        assert told["ok"] and told["full"] == (command == "neighbors")
        assert [check["by"] for check in told["checks"]] == ["search", "integers"]
        assert told["rows"] == hs.count_pairs(POINTS, CUTOFF, box=BOX) * (1 + told["full"])
        assert "is a list of pairs (" in refusal("pairs", tmp_path / name)
        if suffix == "npz" and command == "pairs":  # which tells its cutoff
            assert run("verify", scene, tmp_path / name)[0] == 0
        else:
            assert "does not tell its cutoff" in run("verify", scene, tmp_path / name)[2]


@pytest.mark.parametrize(
    ("names", "between"),
    [
        ("i,j,S0,S1,S2", ","), ("source;target;Sx;Sy;Sz", ";"), ("# i j S_x S_y S_z", " "),
        ("idx_i\tidx_j\tcell_shift_a\tcell_shift_b\tcell_shift_c", "\t"),
        ('"first","second","shift0","shift1","shift2"', ","), ("i j S0 S1 S2", " "),
        ("Atom 1,Atom 2,Shift X,Shift Y,Shift Z", ","),
    ],
)  # fmt: skip
def test_columns_are_found_by_their_names(judged, names, between):
    for full in (False, True):
        i, j, S = listed(full)
        told = judged(text(names, i, j, *S.T, between=between))
        assert told["ok"] and told["full"] == full
        wrong = judged(text(names, i[1:], j[1:], *S[1:].T, between=between))
        assert not wrong["ok"] and wrong["full"] == full
        assert wrong["checks"][0]["examples"]["missed"] == [[i[0], j[0], *S[0]]]


def test_columns_without_names(judged, tmp_path):
    i, j, S = listed()
    for content in (np.c_[i, j], np.c_[i, j, S]):
        np.savetxt(tmp_path / "list.txt", content, fmt="%d")
        np.save(tmp_path / "list.npy", content)
        assert judged(None, name="list.txt")["ok"] and judged(None, name="list.npy")["ok"]


def test_shifts_of_the_other_sign_are_told(run, scene, tmp_path):
    i, j, S = listed()
    np.savez(tmp_path / "list.npz", i=i, j=j, S=-S)
    status, out, _ = run("verify", scene, tmp_path / "list.npz", "--cutoff", CUTOFF)
    assert status == 1 and out.rstrip().endswith("  S has the other sign: a pair is points[j] - "
                                                 "points[i] + S @ box")  # fmt: skip


def test_arrays_of_graphs(judged, tmp_path):
    i, j, S = listed(full=True)
    np.savez(tmp_path / "list.npz", edge_index=np.array([i, j]), cell_shifts=S, energy=np.eye(3))
    assert judged(None, name="list.npz")["full"]
    np.savez(tmp_path / "list.npz", pairs=np.c_[i, j].astype(float), d=S)
    assert judged(None, name="list.npz")["ok"]


def test_without_shifts_a_box_leaves_the_images_open(run, judged, scene, tmp_path):
    i, j, _ = listed()
    told = judged(text("i,j", i[1:], j[1:]))
    assert told["checks"][0]["examples"]["missed"] == [[i[0], j[0]]]
    out = run("verify", scene, tmp_path / "list.csv", "--cutoff", CUTOFF)[1]
    assert f"missed: i={i[0]} j={j[0]}\n" in out and out.count("WRONG") == 1
    i, j = hs.pairs(POINTS, CUTOFF, sort=True)
    points = tmp_path / "open.npy"
    assert judged(text("i,j", i, j), points=points)["ok"]
    told = judged(text("i,j", np.r_[i, 0], np.r_[j, 0]), points=points)
    assert told["checks"][1]["examples"]["spurious"] == [[0, 0, 0, 0, 0]]


def test_points_that_are_counted_from_one(refusal, judged, scene, tmp_path):
    i, j, S = listed()
    assert len(POINTS) - 1 in (*i, *j)
    told = judged(text("i,j,S0,S1,S2", i + 1, j + 1, *S.T))
    assert told["ok"] and "counts points from 1" in told["list"]
    for wrong in (np.r_[i + 1, 0], np.r_[i + 1, -1]):  # there is a 0, or less
        (tmp_path / "list.csv").write_text(text("i,j", wrong, np.r_[j + 1, 1]))
        line = refusal("verify", scene, tmp_path / "list.csv", "--cutoff", CUTOFF)
        assert "to 50; there are 50, 0 to 49" in line


def test_the_rule_and_the_cutoff_are_those_of_the_list(run, tmp_path):
    np.save(tmp_path / "line.npy", np.arange(6.0)[:, None])
    at, out = tmp_path / "line.npy", tmp_path / "list.npz"
    run("pairs", at, "--cutoff", 2, "--strict", "-o", out)
    status, told, _ = run("verify", at, out)
    assert status == 0 and "(d < cutoff)" in told
    assert "is a list for a cutoff of 2.0, not 3.0" in run("verify", at, out, "--cutoff", 3)[2]
    run("pairs", at, "--cutoff", 2, "-o", out)
    assert "leave out --strict" in run("verify", at, out, "--strict")[2]
    run("pairs", at, "--cutoff", 2, "--strict", "-o", tmp_path / "list.csv")
    assert run("verify", at, "--cutoff", 2, tmp_path / "list.csv")[0] == 1
    assert run("verify", at, tmp_path / "list.csv", "--cutoff", 2, "--strict")[0] == 0
    np.save(tmp_path / "line.npy", np.arange(7.0)[:, None])
    assert "is a list for 6 points; there are 7" in run("verify", at, out)[2]


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("list.csv", "a,b\n0,1\n", "has no columns i and j"),
        ("list.csv", "i,j,S0,S1\n0,1,0,0\n", "has shifts of 2 axes (S0, S1)"),
        ("list.csv", "i,j\n0,1.5\n", "j of row 0 is 1.5, not a whole number"),
        ("list.csv", "i,j\n0,nan\n", "field 2: nan is not a finite number"),
        ("list.csv", "i,j\n0\n", "line 2: has 1 fields, the first line has 2"),
        ("list.csv", "i,j\n0,x\n", "line 2, field 2: 'x' is not a number"),
        ("list.csv", "i,j\n0,1_0\n", "line 2, field 2: '1_0' is not a number"),
        ("list.csv", "i,j\n0,1.8e19\n", "j of row 0 is 1.8e+19, too large for an int64"),
        ("list.csv", "i,j,i\n0,1,2\n", "has more than one column i"),
        ("list.csv", "i,j,S0,S1,S2,s_0\n0,1,0,0,0,0\n", "has more than one column S0"),
        ("list.csv", "0,1,2\n", "has 3 columns without names"),
        ("list.csv", "i,j\n0,99\n", "has points 0 to 99; there are 50"),
        ("list.xyz", "1\n\nH 0 0 0\n", "lists of pairs are read from .csv"),
        ("list.npz", "junk", "cannot be read"),
        ("list.parquet", "junk", "cannot be read"),
        ("none.csv", None, "cannot be read: No such file"),
    ],
)
def test_lists_that_cannot_be_read(refusal, scene, tmp_path, name, content, words):
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    if content is not None:
        (tmp_path / name).write_text(content)
    assert words in refusal("verify", scene, tmp_path / name, "--cutoff", 1)


def test_archives_that_promise_too_much_are_refused(refusal, scene, tmp_path):
    header = io.BytesIO()
    facts = {"descr": "<i8", "fortran_order": False, "shape": (10**12,)}
    np.lib.format.write_array_header_1_0(header, facts)
    with zipfile.ZipFile(tmp_path / "list.npz", "w") as archive:
        archive.writestr("i.npy", header.getvalue())
        archive.writestr("j.npy", header.getvalue())
    line = refusal("verify", scene, tmp_path / "list.npz", "--cutoff", 1)
    assert "is cut off: that is 8,000,000,000,000 bytes" in line


@pytest.mark.parametrize(
    ("name", "words"),
    [("list.csv", "is not text"), ("list.npy", "cannot be read as a NumPy file"),
     ("list.npz", "cannot be read as a NumPy file"), ("list.parquet", "cannot be read"),
     ("list.xyz", "lists of pairs are read from .csv,")],
)  # fmt: skip
def test_files_that_are_no_lists_are_refused_by_name(run, scene, tmp_path, name, words):
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    (tmp_path / name).write_bytes(b"\xff\xfe\x00junk\n" * 9)
    status, _, err = run("verify", scene, tmp_path / name, "--cutoff", 1)
    assert status == 2 and err.startswith(f"halfshell: error: {tmp_path / name}: {words}")


def test_options_that_make_a_list_are_refused_with_one(refusal, scene, tmp_path):
    (tmp_path / "list.csv").write_text("i,j\n")
    for option in (["--against", "ase"], ["--kernel", "scalar"]):
        line = refusal("verify", scene, tmp_path / "list.csv", "--cutoff", 1, *option)
        assert "make a list" in line
    line = refusal("verify", scene, "--cutoff", 1, tmp_path / "list.csv", "third")
    assert "unrecognized arguments: third" in line


def test_an_empty_list_is_a_list(judged):
    assert judged("i,j,S0,S1,S2\n")["checks"][0]["missed"] == len(listed()[0])
    assert judged("i,j,S0,S1,S2\n", "--box", "1e3,1e3,1e3", "--sample", "5")["rows"] == 0


@pytest.mark.parametrize("missing", [("pyarrow",), ("pyarrow", "polars")])
def test_parquet_without_pyarrow(refusal, judged, scene, tmp_path, monkeypatch, missing):
    pyarrow = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    i, j, S = listed()
    columns = {"i": i, "j": j, "S0": S[:, 0], "S1": S[:, 1], "S2": S[:, 2]}
    parquet.write_table(pyarrow.table({k: v.copy() for k, v in columns.items()}),
                        tmp_path / "list.parquet")  # fmt: skip
    if "polars" not in missing:
        pytest.importorskip("polars", reason="polars is not installed")
    without = {*missing, "fastparquet"}
    monkeypatch.setattr("halfshell._cli.pair_files.find_spec", lambda name: name not in without or
                        None)  # fmt: skip
    if "polars" in missing:
        line = refusal("verify", scene, tmp_path / "list.parquet", "--cutoff", CUTOFF)
        assert "reading Parquet needs pyarrow" in line
    else:
        assert judged(None, name="list.parquet")["ok"]
