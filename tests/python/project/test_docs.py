# SPDX-License-Identifier: BSD-3-Clause
"""What the documentation shows runs, and signatures agree with the stubs."""

import ast
import doctest
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys

import numpy as np
import pytest

import halfshell as hs
import halfshell_report
from calls import call
from checkout import ROOT

MODULES = ["halfshell", *(m.name for m in pkgutil.walk_packages(hs.__path__, "halfshell."))]
ELSEWHERE = ["torch", "jax", "dask"]  # frameworks/ and distributed/
MODULES += [
    "halfshell_report",
    *(m.name for m in pkgutil.walk_packages(halfshell_report.__path__, "halfshell_report.")),
]
MODULES = [m for m in MODULES if m not in [f"halfshell.{name}" for name in ELSEWHERE]]
OWNERS = {
    "halfshell.compat.ase": "ase",
    "halfshell.compat.matscipy": "ase",
    "halfshell.compat.mdanalysis": "MDAnalysis",
    "halfshell.compat.scipy": "scipy",
    "halfshell.compat.sklearn": "sklearn",
}


def failures_in(name):
    module = importlib.import_module(name)
    return doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE).failed


def test_examples_in_docstrings_run():
    names = [name for name in MODULES if name != "halfshell.__main__" and name not in OWNERS]
    assert len(names) > 60 and {name: n for name in names if (n := failures_in(name))} == {}


@pytest.mark.parametrize("name", OWNERS)
def test_examples_of_drop_ins_run(name):
    pytest.importorskip(OWNERS[name], reason=f"{OWNERS[name]} is not installed")
    assert failures_in(name) == 0


def check_documented(name, function, but):
    doc = inspect.getdoc(function)
    head = doc.split("Returns\n")[0]
    for argument in set(inspect.signature(function).parameters) - {but}:
        assert re.search(rf"\b{argument}\b", head), (name, argument)
    assert ">>>" in doc, name


def test_methods_of_a_cell_list_are_documented():
    for name, method in inspect.getmembers(hs.CellList, callable):
        if name[0] != "_":
            check_documented(name, method, "self")


def test_public_functions_have_examples_and_document_every_argument():
    for name in hs.__all__:
        assert ">>>" in inspect.getdoc(getattr(hs, name)) or name == "Verdict", name
    for name in (
        "bricks", "clusters", "coordination", "count_pairs", "explain", "for_each_pair",
        "iter_pairs", "nearest", "neighbors", "pair_histogram", "pairs", "pairs_between", "rdf",
        "verify",
    ):  # fmt: skip
        check_documented(name, getattr(hs, name), "unknown")


def blocks_of(page):
    """The examples of a page."""
    return re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)


def run(code, names, page):
    exec(compile(code, page, "exec"), names)
    return names


def test_readme_notebook_example_runs(capsys):
    first, more = blocks_of("README.md")
    names = run(first, {}, "README.md")
    assert names["i"].dtype == np.int64 and len(names["table"][7]) > 20
    run(more, names, "README.md")
    assert len(names["i"]) == len(names["S"]) > 200_000
    assert min(len(names["contacts"][0]), len(names["ions"][0]), names["near"].n_entries) > 0
    assert "algorithm" in capsys.readouterr().out


def test_example_of_tables_runs():
    tables, graphs, cells = blocks_of("docs/neighbors.md")
    names = run(tables, {}, "neighbors.md")
    assert len(names["table"]) == 1000 and len(names["first"]) == 100
    run(graphs, names, "neighbors.md")
    assert names["edge_index"].shape == (2, len(names["again"])) and names["distances"] is None
    run(cells, names, "neighbors.md")
    assert len(names["near"]) == 10 and len(names["each"]) == 3
    assert names["within"][-1] == hs.count_pairs(names["points"], 1.0, box=[10.0] * 3)


def test_examples_of_streaming_run():
    blocks, calls, compiled = blocks_of("docs/streaming.md")
    names = run(blocks, {}, "streaming.md")
    d = hs.pairs(names["points"], 0.1, box=[1.0] * 3, quantities="d")
    assert np.isclose(names["total"], d.sum(), rtol=1e-12)
    run(calls, names, "streaming.md")
    assert names["visited"] == hs.count_pairs(names["points"], 0.05)
    pytest.importorskip("numba")
    run(compiled, names, "streaming.md")
    s = 1e-6 / d**6
    assert np.isclose(names["total"][0], (s * s - s).sum(), rtol=1e-9)


def test_examples_of_supports_run():
    balls, bonds, types, many, smoothing, ellipsoids = blocks_of("docs/supports.md")
    names = run(balls, {}, "supports.md")
    assert len(names["i"]) > 100 and (names["overlap"] >= 0.0).all()
    assert names["contacts"].sum() == 2 * len(names["i"]) and len(names["near"][0]) > 10
    run(bonds, names, "supports.md")
    run(types, names, "supports.md")
    assert 0 < len(names["hydrogen_bonds"][0]) < names["others_too"]
    for one, other in zip(names["pairs_by_type"], names["same"]):
        assert len(one) > 100 and np.array_equal(np.sort(one), np.sort(other))
    assert set(names["named"].types[names["ions"][0]]) == {"ion"}
    run(many, names, "supports.md")
    i, j = names["in_each"]
    assert len(i) > 10_000 and (names["molecule"][i] == names["molecule"][j]).all()
    run(smoothing, names, "supports.md")
    counts = names["gathered"].counts
    assert ((counts == 31) | (counts == 32)).all()
    assert len(names["mutual"][0]) < counts.sum() / 2 < len(names["either"][0])
    run(ellipsoids, names, "supports.md")
    assert len(names["i"]) > 1000 and (names["eta"] <= 1.0).sum() > len(names["i"]) / 2


def test_bonds_of_the_page_are_those_of_ase():
    neighborlist = pytest.importorskip("ase.neighborlist")
    names = run(blocks_of("docs/supports.md")[1], {"hs": hs}, "supports.md")
    cutoffs = neighborlist.natural_cutoffs(names["ethanol"], mult=1.1)
    i, j = neighborlist.neighbor_list("ij", names["ethanol"], cutoffs)
    found = set(zip(*(column.tolist() for column in names["bonds"])))
    assert found == {(a, b) for a, b in zip(i.tolist(), j.tolist()) if a < b}


def test_the_picture_of_levels_is_right():
    text = (ROOT / "docs/supports.md").read_text()
    rows = re.search(r"width of cells.*?\n.*?\n(.*?)\n\n", text, re.DOTALL).group(1).splitlines()
    largest = [8.0, 4.0, 2.0, 1.0, 0.5]
    n = 0
    for level, row in enumerate(rows):
        widths = [float(x) for x in re.findall(r"[\d.]+", row[20:])]
        others = range(level == 4, level + 1)  # 3 and 4 are one search for 0
        assert widths == [largest[other] + largest[level] for other in others]
        n += len(widths)
    radii = np.array([8.0, 3.9, 1.9, 0.9, 0.4])[np.arange(500) % 5]
    points = np.random.default_rng(0).random((500, 3)) * 30.0
    reason = call(hs.explain, points, None, radii=radii, algorithm="hierarchy").reason
    assert f"in {n} searches" in reason and reason.startswith("5 octaves")
    for rule in ("max", "min"):
        options = {"radii": radii, "rule": rule, "algorithm": "hierarchy"}
        reason = call(hs.explain, points, None, **options).reason
        assert "in 9 searches" in reason  # with itself, and with all below or above it


def test_rules_of_the_page_are_symmetric_where_it_says_so():
    text = (ROOT / "docs/supports.md").read_text()
    rows = re.findall(r'^\| `"(\w+)"`.*\| (all|rows and two sets) \|$', text, re.MULTILINE)
    assert len(rows) == 6 + 4  # of radii and of supports
    rng = np.random.default_rng(3)
    points, radii = rng.random((200, 2)), 0.1 * rng.random(200)
    by_radii = {"radii": radii}
    by_supports = {"supports": np.eye(2) / (radii + 0.01)[:, None, None], "extent": 1.0}
    for k, (rule, lists) in enumerate(rows):
        reach = by_radii if k < 6 else by_supports
        rows_of = call(hs.neighbors, points, None, rule=rule, **reach).to_pairs(quantities="ij")
        found = set(zip(*(column.tolist() for column in rows_of)))
        assert (found == {(j, i) for i, j in found}) == (lists == "all")
        if lists == "all":
            assert call(hs.count_pairs, points, None, rule=rule, **reach) == len(found) / 2
        else:
            with pytest.raises(ValueError, match="neighbors"):
                call(hs.pairs, points, None, rule=rule, **reach)


def test_what_the_page_says_is_compared():
    a, b = 0.1, 0.2
    for x, touches in ((0.3, True), (0.30000000000000004, False)):
        found = call(hs.count_pairs, [[0.0], [x]], None, radii=[a, b])
        assert found == touches and 0.30000000000000004 == a + b


def test_examples_of_node_lists_run():
    names = {}
    for block in blocks_of("docs/systems/spheral.md"):
        run(block, names, "spheral.md")
    assert len(names["of_water"]) > 3 and names["c"].nbytes["intersection"] > 0


def test_example_of_histograms_runs():
    (code,) = blocks_of("docs/histograms.md")
    names = run(code, {}, "histograms.md")
    assert names["counts"].sum() == names["within"][-1] == names["result"].counts.sum()
    assert names["near"].sum() == names["within"][1] and names["far"].shape == (2, 2, 50)


def test_examples_of_bricks_run():
    names = {}
    for block in blocks_of("docs/bricks.md"):
        run(block, names, "bricks.md")


def test_example_of_clusters_runs():
    (code,) = blocks_of("docs/clusters.md")
    names = run(code, {}, "clusters.md")
    assert names["found"].sizes.sum() == 5000 and names["wide"].spans.any()
    assert names["noise"].any() and names["core"].any()


@pytest.mark.slow
def test_examples_of_nearest_run():
    searches, masks, chosen, cells, given = blocks_of("docs/nearest.md")
    names = run(searches, {}, "nearest.md")
    assert names["j"].shape == (1, 4) and names["S"].shape == (1, 4, 3)
    run(masks, names, "nearest.md")
    i, j, d, points = (names[name] for name in ("i", "j", "d", "points"))
    assert len(i) == len(j) == names["masked"].count() > 0 and d.max() <= 0.03
    assert not hs.verify(points, 0.03, i, j, queries=points, box=1.0).spurious.size
    run(chosen, names, "nearest.md")
    same, j = names["same"].groups, names["j"]
    assert (same[j] == same[:, None])[j >= 0].all() and (j >= 0).any()
    run(cells, names, "nearest.md")
    assert names["j"].shape == (10, 3) and (np.diff(names["d"]) >= 0.0).all()
    run(given, names, "nearest.md")
    assert names["d"].shape == (1000,) and names["S"].any()


def test_examples_of_points_run():
    pytest.importorskip("ase", reason="ase is not installed")
    names = {}
    for block in blocks_of("docs/points.md"):
        run(block, names, "points.md")
    assert 0 < len(names["elsewhere"][0]) < len(names["contacts"][0])
    assert names["by_element"].shape == (512, 2) and len(names["around"].counts) > 0
    assert len(names["again"][0]) == hs.count_pairs(names["bare"], 3.0)


def test_example_of_dynamic_lists_runs():
    (code,) = blocks_of("docs/dynamic.md")
    names = run(code, {}, "dynamic.md")
    assert 0 < names["accepted"] < 1000 and len(names["disks"]) == 100


def test_readme_commands_create_what_they_need():
    text = (ROOT / "README.md").read_text()
    commands = re.findall(r"```bash\n(.*?)\n```", text)
    assert len(commands) == 2
    for command in commands:
        assert command.startswith("python3 -m venv .venv && ")


def test_every_file_that_the_readme_names_exists():
    for name in ("README.md", "CONTRIBUTING.md"):
        for target in re.findall(r"\]\(([\w./-]+)\)", (ROOT / name).read_text()):
            assert (ROOT / target).exists(), target


def test_stub_and_module_name_the_same_functions():
    core = importlib.import_module("halfshell._core")
    stub = ast.parse((ROOT / "python/halfshell/_core.pyi").read_text())
    named = {node.name for node in stub.body if isinstance(node, ast.FunctionDef)}
    assert named == {name for name in dir(core) if not name.startswith("_")}


def test_the_stub_is_what_the_table_of_the_interface_says():
    done = subprocess.run(
        [sys.executable, ROOT / "tests/core_stub.py"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
