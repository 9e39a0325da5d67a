# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell neighbors``, ``coordination``, ``nearest``, ``rdf``; points in text; boxes of six."""

import subprocess
import sys

import numpy as np
import pytest

import halfshell as hs
from halfshell import cli
from halfshell.structures import ALPHA_QUARTZ_CIF, alpha_quartz

POINTS = np.random.default_rng(5).random((60, 3)) * 8
LENGTHS = [8.0, 7.5, 9.0]


@pytest.fixture
def text(tmp_path):
    path = tmp_path / "points.csv"
    lines = [",".join(map(repr, row)) for row in POINTS.tolist()]
    path.write_text("x,y,z\n" + "\n".join(lines) + "\n")
    return path


@pytest.fixture
def run(capfdbinary):
    def call(*args):
        status = cli.main([str(arg) for arg in args])
        out, err = capfdbinary.readouterr()
        return status, out.decode(), err.decode()

    return call


def columns_of(path):
    names, *rows = path.read_text().splitlines() if hasattr(path, "read_text") else path
    names, cells = names.split(","), [row.split(",") for row in rows]
    return {name: [row[k] for row in cells] for k, name in enumerate(names)}


def numbers(column):
    return [float(cell) for cell in column]


def test_neighbors(told, text, tmp_path):
    out = tmp_path / "rows.csv"
    facts = told("neighbors", text, "--cutoff", 2, "--box", "8,7.5,9", "-o", out, "--threads", 1)
    table = hs.neighbors(POINTS, 2.0, box=LENGTHS, quantities="jdS")
    i, j, d, S = table.to_pairs(quantities="ijdS")
    found = columns_of(out)
    assert list(found) == ["i", "j", "d", "S0", "S1", "S2"]
    assert numbers(found["i"]) == i.tolist() and numbers(found["j"]) == j.tolist()
    assert numbers(found["d"]) == d.tolist() and numbers(found["S2"]) == S[:, 2].tolist()
    assert facts["entries"] == len(j) and facts["mean_coordination"] == len(j) / 60
    archive = tmp_path / "rows.npz"
    told("neighbors", text, "--cutoff", 2, "--strict", "-o", archive, "--quantities", "Di")
    with np.load(archive) as held:
        assert sorted(held) == ["D", "i"]
        assert np.array_equal(held["D"], hs.neighbors(POINTS, 2.0, quantities="D").vectors)


def test_coordination(told, run, text, tmp_path):
    out = tmp_path / "counts.csv"
    facts = told("coordination", text, "--cutoff", 1.5, "-o", out)
    counts = hs.coordination(POINTS, 1.5)
    assert numbers(columns_of(out)["count"]) == counts.tolist()
    assert (facts["least"], facts["most"]) == (counts.min(), counts.max())
    shipped = told("coordination", "--cutoff", 1.7)
    assert shipped["by_species"] == {"O": 2.0, "Si": 4.0}
    assert shipped["points_by_coordination"] == {"2": 3072, "4": 1536}
    status, out, _ = run("coordination", "--cutoff", "1.7", "-o", "-")
    found = columns_of(out.splitlines())
    assert status == 0 and list(found) == ["i", "count", "species"]
    assert set(zip(found["count"], found["species"], strict=True)) == {("2", "O"), ("4", "Si")}


def test_nearest(told, text, tmp_path):
    out = tmp_path / "nearest.csv"
    facts = told("nearest", text, "-k", 3, "--box", "8,7.5,9", "-o", out)
    j, d = hs.nearest(POINTS, 3, box=LENGTHS)
    found = columns_of(out)
    assert numbers(found["j"]) == j.ravel().tolist() and numbers(found["d"]) == d.ravel().tolist()
    assert numbers(found["rank"]) == [1, 2, 3] * 60
    assert facts["largest_distance"] == d.max() and facts["entries"] == 180
    # Where there are fewer points, rows are shorter.
    few = tmp_path / "few.txt"
    few.write_text("0 0\n1 0\n")
    assert told("nearest", few, "-k", 5)["entries"] == 2
    few.write_text("0 0\n")
    assert told("nearest", few)["largest_distance"] is None


def test_rdf(told, refusal, text, tmp_path):
    out = tmp_path / "g.csv"
    facts = told("rdf", text, "--cutoff", 3, "--bins", 30, "--box", "8 7.5 9", "-o", out)
    result = hs.rdf(POINTS, 3.0, 30, box=LENGTHS)
    found = columns_of(out)
    assert numbers(found["g"]) == result.g.tolist() and numbers(found["r"]) == result.r.tolist()
    assert numbers(found["counts"]) == result.counts.tolist()
    assert facts["pairs"] == int(result.counts.sum()) and facts["bins"] == 30
    assert "needs a box that is periodic" in refusal("rdf", text, "--cutoff", "3")


def test_cutoffs_and_counts_by_elements(told, run, tmp_path):
    pytest.importorskip("ase")
    positions, box, species = alpha_quartz()
    points = hs.Points(positions, box=box, types=species)
    cutoff = {("O", "Si"): 1.7, ("*", "*"): 3.2}
    option = "Si-O=1.7, *-*=3.2"
    out = tmp_path / "counts.csv"
    facts = told("coordination", "--cutoff", option, "--by-type", "-o", out)
    counts = hs.coordination(points, cutoff, by_type=True)
    found = columns_of(out)
    assert numbers(found["count_O"]) == counts[:, 0].tolist()
    assert numbers(found["count"]) == counts.sum(axis=1).tolist()
    assert facts["cutoff"] == {"Si-O": 1.7, "*-*": 3.2}
    assert facts["by_type"]["Si"] == {
        "O": 4.0, "Si": counts[species == "Si", 1].mean()
    }  # fmt: skip
    assert "types of Si" in run("coordination", "--cutoff", option, "--by-type")[1]
    assert told("neighbors", "--cutoff", option)["entries"] == counts.sum()
    pairs = told("pairs", ALPHA_QUARTZ_CIF, "--cutoff", option, "-o", tmp_path / "list.npz")
    assert pairs["cutoff"] == facts["cutoff"] and pairs["pairs"] * 512 * 2 == counts.sum()
    verdict = told("verify", ALPHA_QUARTZ_CIF, tmp_path / "list.npz", "--cutoff", option)
    assert verdict["ok"] and len(verdict["checks"]) == 2
    status, said, _ = run("verify", ALPHA_QUARTZ_CIF, tmp_path / "list.npz", "--cutoff", "Si-O=1.7")
    assert status == 1 and "these elements form no pairs" in said and "WRONG" in said
    assert "rows              6" in run("verify", ALPHA_QUARTZ_CIF, "--cutoff", "O-Si=1.606")[1]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["pairs", "--cutoff", "Si-O=1.7,O"], "'O' is not like Si-O=1.8, or *-*=3"),
        (["pairs", "--cutoff", "Si-O=-1"], "-1 is negative"),
        (["pairs", "--cutoff", "Si-Xx=1"], "'Xx' is neither an element nor a type"),
        (["rdf", "--cutoff", "Si-O=1.7"], "is not a number"),
        (["verify", "--cutoff", "Si-O=1.7", "--against", "ase"], "--against takes one cutoff"),
        (["coordination", "TEXT", "--cutoff", "Si-O=1.7"], "has no elements, which --cutoff of"),
        (["rdf", "TEXT", "--cutoff", "2", "--by-type"], "has no elements, which --by-type"),
        (["rdf", "TEXT", "--cutoff", "2"], "periodic along every axis, or --density"),
        (["rdf", "--plot", "g.gif"], "the name must end in"),
    ],
)
def test_elements_that_cannot_be(refusal, text, words, said):
    assert said in refusal(*[text if word == "TEXT" else word for word in words])


def test_partial_distributions_and_their_picture(told, text, tmp_path):
    pytest.importorskip("matplotlib")
    out, plot = tmp_path / "g.csv", tmp_path / "g.png"
    options = ["--cutoff", 5, "--bins", 50, "--by-type", "--plot", plot, "-o", out]
    facts = told("rdf", *options)
    positions, box, species = alpha_quartz()
    result = hs.rdf(hs.Points(positions, box=box, types=species), 5.0, 50, by_type=True)
    found = columns_of(out)
    assert list(found) == ["r", *(f"{what}_{two}" for two in ("O-O", "O-Si", "Si-Si")
                                  for what in ("g", "counts"))]  # fmt: skip
    assert numbers(found["g_O-Si"]) == result["O", "Si"].g.tolist()
    assert facts["pairs"] == hs.count_pairs(positions, 5.0, box=box)
    assert facts["highest"]["O-Si"][1] == result["O", "Si"].g.max()
    assert plot.read_bytes().startswith(b"\x89PNG")
    open_space = told("rdf", text, "--cutoff", 2, "--density", 0.25)
    assert open_space["highest"][1] == hs.rdf(POINTS, 2.0, density=0.25).g.max()


def test_summaries_for_people(run, text):
    for command in ("neighbors", "coordination", "rdf", "nearest"):
        status, out, err = run(command, text, "--box", "8,7.5,9")
        assert (status, err) == (0, "") and "points            60" in out
        assert all(len(line) < 120 for line in out.splitlines())


def test_pairs_on_standard_output(run, text):
    wanted = ["--quantities", "ij", "--sort"]
    status, out, err = run("pairs", text, "--cutoff", "2", "-o", "-", *wanted)
    assert (status, err) == (0, "")
    i, j = hs.pairs(POINTS, 2.0, sort=True)
    found = columns_of(out.splitlines())
    assert numbers(found["i"]) == i.tolist() and numbers(found["j"]) == j.tolist()


def test_a_reader_that_goes_away_is_no_error(text):
    command = f"{sys.executable} -m halfshell pairs -o - | head -n 1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True)
    assert done.stdout == "i,j,d,S0,S1,S2\n" and done.stderr == ""


FORMS = [
    ("0 0 0\n1 2 3\n", 2), ("x y z\n0 0 0\n", 1), ("# a remark\n\n0;1;2 # and one\n", 1),
    ("\ufeff0,1,2\n", 1), ("0.5\t1e3\t-2\r\n", 1), ("1\n2\n3\n", 3),
]  # fmt: skip


def test_forms_of_text(told, tmp_path):
    for content, rows in FORMS:
        for suffix in ("txt", "csv", "dat", "tsv"):
            path = tmp_path / f"points.{suffix}"
            path.write_text(content, encoding="utf-8")
            assert told("pairs", path, "--cutoff", 1)["points"] == rows


def test_text_that_is_none(run, refusal, tmp_path):
    path = tmp_path / "points.txt"
    path.write_bytes(b"\xff\xfe\x00\x01")
    status, _, err = run("pairs", path, "--cutoff", "1")
    assert status == 2 and err.count("\n") == 1
    (tmp_path / "points.csv").write_text("1,2,3\n")
    line = refusal("pairs", tmp_path / "points.csv", "--index", "0")
    assert "--index is for formats with several frames" in line


def test_lengths_and_angles(told, refusal, text):
    box = hs.Box.from_dimensions([9.0, 8.0, 10.0, 80.0, 75.0, 100.0])
    found = told("pairs", text, "--cutoff", 2, "--box", "9,8,10,80,75,100")
    assert np.allclose(found["box"], box.vectors, rtol=0.0, atol=0.0)
    assert found["pairs"] == hs.count_pairs(POINTS, 2.0, box=box)
    assert "--box" in refusal("pairs", text, "--box", "9,8,10,80,75,300")
    assert "or 6 (lengths and angles)" in refusal("pairs", text, "--box", "9,8")


def test_without_a_command_there_is_help(run):
    status, out, err = run()
    assert (status, err) == (0, "") and "commands:" in out


def test_large_outputs_are_told_beforehand(run, refusal, tmp_path):
    points = tmp_path / "points.npy"
    np.save(points, np.random.default_rng(0).random((400, 3)))
    for name in ("all.npz", "all.csv"):
        output = tmp_path / name
        status, out, err = run(
            "pairs", points, "--cutoff", "2", "-o", output, "--quantities", "ijdD",
            "--max-output", "1MB",
        )  # fmt: skip
        assert status != 0 and not output.exists() and not out
        assert "would have 79,800 pairs in about " in err and "--max-output 1 MB" in err
        if name.endswith("npz"):
            assert f"{79_800 * 48 / 1e6:.3g} MB" in err
        assert run("pairs", points, "--cutoff", "2", "-o", output, "--max-output", "9MB")[0] == 0
        assert output.stat().st_size > 1_000_000
    for wrong in ("0", "many", "-3GB", "1XB", "inf", ""):
        limit = f"--max-output={wrong}"
        line = refusal("pairs", points, "--cutoff", "1", "-o", "x.csv", limit)
        assert "is not a size such as 500MB or 4GB" in line


def test_large_rows_are_told_beforehand(run, refusal, tmp_path):
    points, output = tmp_path / "points.npy", tmp_path / "all.npz"
    np.save(points, np.random.default_rng(0).random((400, 3)))
    search = ("neighbors", points, "--cutoff", "2", "-o", output, "--quantities", "jd")
    line = refusal(*search, "--max-output", "1MB")
    assert "would have 159,600 pairs in about 2.55 MB, more than" in line
    assert not output.exists() and run(*search)[0] == 0 and output.exists()


@pytest.mark.parametrize("option", [["--sort"], ["--quantities", "ij"], ["--max-output", "1kB"]])
def test_options_that_would_be_ignored_are_errors(run, option):
    for command in ("pairs", "neighbors"):
        status, _, err = run(command, "--cutoff", "1.7", *option)
        assert status == 2
        if command == "pairs" or option[0] != "--sort":
            assert f"{option[0]} is for what -o writes: give -o as well" in err


MEANT = [
    (["pairs", "--index", "2"], "--index needs a file: give one"),
    (["verify", "--format", "xyz"], "--format needs a file: give one"),
    (["pairs", "--cuttoff", "2"], "unrecognized arguments: --cuttoff; did you mean --cutoff?"),
    (["pears"], "did you mean pairs?"),
    (["pairs", "x.npy", "--box", "10", "10", "10"], "10 10; numbers of one option are separated"),
    (["verify", "--sample", "-3"], "argument --sample: '-3' is not a whole number from 0 on"),
    (["pairs", "--index", ":"], "is not the number of a frame; only rdf reads several"),
    (["report", "--methods", "exat"], "choose from exact, verlet, double, single, float32, stale"),
    (["report", "--peers", "vessin"], "choose from vesin, cKDTree, neighborlist-rs,"),
    (["report", "--scenes", "zzz"], "space-8d, sc-shell, fcc-shell, ... (86 in all)"),
]  # fmt: skip


def test_what_is_probably_meant(refusal):
    for args, words in MEANT:
        assert words in refusal(*args)


def test_a_folder_is_no_file(run, tmp_path):
    status, _, err = run("pairs", tmp_path)
    assert status == 2 and err == f"halfshell: error: {tmp_path}: is a folder\n"


# ---- queries, frames, Parquet ----------------------------------------------------------------


@pytest.fixture
def queries(tmp_path):
    np.save(tmp_path / "queries.npy", POINTS[:5] + 0.25)
    return tmp_path / "queries.npy"


def test_queries_have_their_own_rows(told, text, queries, tmp_path):
    asking, out = np.load(queries), tmp_path / "rows.npz"
    scene = [text, "--box", "8,7.5,9", "--queries", queries, "-o", out]
    facts = told("neighbors", *scene, "--cutoff", 2)
    table = hs.neighbors(POINTS, 2.0, box=LENGTHS, queries=asking, quantities="jdS")
    assert facts["entries"] == len(table.indices) and facts["queries"] == str(queries)
    assert np.load(out)["j"].tolist() == table.indices.tolist()
    assert told("coordination", *scene, "--cutoff", 2)["entries"] == facts["entries"]
    assert np.load(out)["count"].tolist() == table.counts.tolist()
    told("nearest", *scene, "-k", 3)
    j, d = hs.nearest(POINTS, 3, box=LENGTHS, queries=asking, quantities="jd")
    assert np.load(out)["j"].tolist() == j.ravel().tolist()
    assert np.load(out)["d"].tolist() == d.ravel().tolist()


def test_queries_that_cannot_be_searched(refusal, text, tmp_path):
    np.save(tmp_path / "flat.npy", POINTS[:, :2])
    for options, words in (
        (["--queries", tmp_path / "flat.npy"], "has 2 coordinates a point"),
        (["--queries", tmp_path / "none.npy"], "no such file"),
    ):
        assert words in refusal("coordination", text, "--cutoff", 1, *options)
    assert "unrecognized arguments: --queries" in refusal("rdf", text, "--queries", text)


@pytest.fixture
def trajectory(tmp_path):
    ase = pytest.importorskip("ase", reason="ase is not installed")
    io = pytest.importorskip("ase.io", reason="ase is not installed")
    frames = [
        ase.Atoms("H60", POINTS * (1 + k / 10), cell=np.array(LENGTHS) * (1 + k / 10), pbc=True)
        for k in range(4)
    ]
    io.write(tmp_path / "run.extxyz", frames)
    return tmp_path / "run.extxyz", frames


@pytest.mark.parametrize(
    ("index", "chosen"), [(":", slice(None)), ("1:", slice(1, None)), ("::2", slice(None, None, 2)),
                          ("-1:", slice(-1, None)), ("2", slice(2, 3))],
)  # fmt: skip
def test_g_of_r_is_averaged_over_frames(told, trajectory, tmp_path, index, chosen):
    path, frames = trajectory
    facts = told("rdf", path, f"--index={index}", "--cutoff", 3, "--bins", 12,
                 "-o", tmp_path / "g.npz")
    own = [hs.rdf(frame, 3.0, 12) for frame in frames[chosen]]
    whole = sum(own[1:], start=own[0])
    assert facts["frames"] == len(own)
    assert np.load(tmp_path / "g.npz")["counts"].tolist() == whole.counts.tolist()
    assert np.allclose(np.load(tmp_path / "g.npz")["g"], whole.g)


def test_frames_that_are_not_there(refusal, trajectory, text):
    path, _ = trajectory
    for arguments, words in (
        (["rdf", path, "--index", "9:"], "has none of these frames"),
        (["rdf", path, "--index", "9"], "has no frame 9"),
        (["rdf", path, "--index", "x"], "'x' is not a frame"),
        (["rdf", path, "--index", "::0"], "'::0' is not a frame"),
        (["rdf", path, "--index", "1:2:3:4"], "is not a frame"),
        (["rdf", path, "--index", ""], "is not a frame"),
        (["rdf", text, "--index", ":"], "--index is for formats with several frames"),
        (["rdf", "missing.xyz", "--index", ":"], "no such file"),
        (["rdf", "--index", ":"], "give a file that has some"),
        (["pairs", path, "--index", ":"], "only rdf reads several frames"),
    ):
        assert words in refusal(*arguments)


def test_parquet_has_the_columns_of_the_archive(told, text, tmp_path, monkeypatch):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    monkeypatch.setattr("halfshell._cli.outputs._PARQUET_ROWS", 10)
    scene = [text, "--box", "8,7.5,9", "--cutoff", 2, "--quantities", "ijdS"]
    told("pairs", *scene, "--sort", "-o", tmp_path / "pairs.parquet")
    told("pairs", *scene, "--sort", "-o", tmp_path / "pairs.npz")
    table, held = parquet.read_table(tmp_path / "pairs.parquet"), np.load(tmp_path / "pairs.npz")
    assert table.column_names == ["i", "j", "d", "S0", "S1", "S2"]
    for name in "ijd":
        assert table[name].to_numpy().tobytes() == held[name].tobytes()
    for axis in range(3):
        assert table[f"S{axis}"].to_pylist() == held["S"][:, axis].tolist()
    assert parquet.ParquetFile(tmp_path / "pairs.parquet").num_row_groups > 1
    told("pairs", text, "--cutoff", 0, "-o", tmp_path / "none.parquet")
    assert parquet.read_table(tmp_path / "none.parquet").num_rows == 0


def test_without_pyarrow_one_line_says_what_is_missing(refusal, text, tmp_path, monkeypatch):
    monkeypatch.setattr("halfshell._cli.outputs.find_spec", lambda name: None)
    line = refusal("pairs", text, "--cutoff", 1, "-o", tmp_path / "pairs.parquet")
    assert "needs pyarrow" in line
    assert not (tmp_path / "pairs.parquet").exists()
