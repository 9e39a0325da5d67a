# SPDX-License-Identifier: BSD-3-Clause
"""What the documentation shows runs, and signatures agree with the stubs."""

import ast
import doctest
import importlib
import inspect
import pkgutil
import re

import numpy as np
import pytest

import halfshell as hs
import halfshell_report
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


#: A page -> libraries that its examples need, and what holds when they have run.
PAGES = {
    "README.md": ([], [
        "i.dtype == np.int64", "len(table[7]) > 20", "len(i) == len(S) > 200_000",
        "min(len(contacts[0]), len(ions[0]), near.n_entries) > 0",
    ]),
    "docs/index.md": ([], []),
    "docs/bricks.md": ([], []),
    "docs/clusters.md": ([], [
        "found.sizes.sum() == 5000", "wide.spans.any()", "noise.any() and core.any()",
    ]),
    "docs/drop-ins.md": (["ase", "scipy", "MDAnalysis", "sklearn", "matscipy"], []),
    "docs/dynamic.md": ([], ["0 < accepted < 1000", "len(disks) == 100"]),
    "docs/explanation/how-pairs-are-found.md": ([], []),
    "docs/histograms.md": ([], [
        "counts.sum() == within[-1] == result.counts.sum()", "near.sum() == within[1]",
        "far.shape == (2, 2, 50)",
    ]),
    "docs/nearest.md": ([], [
        "masked.count() > 0", "(same.groups[j] == same.groups[:, None]).any()" ,"S.any()",
    ]),
    "docs/neighbors.md": ([], [
        "len(table) == 1000", "edge_index.shape == (2, len(again))", "len(near) == 10",
        "within[-1] == hs.count_pairs(points, 1.0, box=[10.0] * 3)",
    ]),
    "docs/points.md": (["ase"], [
        "0 < len(elsewhere[0]) < len(contacts[0])", "by_element.shape == (512, 2)",
        "len(again[0]) == hs.count_pairs(bare, 3.0)",
    ]),
    "docs/streaming.md": (["numba"], [
        "visited == hs.count_pairs(points, 0.05)",
        "np.isclose(total[0], lennard_jones(points), rtol=1e-9)",
    ]),
    "docs/supports.md": ([], [
        "(overlap >= 0.0).all()", "0 < len(hydrogen_bonds[0]) < others_too",
        "set(named.types[ions[0]]) == {'ion'}", "set(np.unique(gathered.counts)) <= {31, 32}",
        "len(mutual[0]) < gathered.counts.sum() / 2 < len(either[0])", "(eta <= 1.0).any()",
    ]),
    "docs/systems/spheral.md": ([], ["len(of_water) > 3", "c.nbytes['intersection'] > 0"]),
    "docs/verlet.md": ([], []),
}  # fmt: skip


def blocks_of(page):
    """The examples of a page."""
    return re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)


def run(code, names, page):
    exec(compile(code, page, "exec"), names)
    return names


def lennard_jones(points):
    """What docs/streaming.md adds up."""
    s = 1e-6 / hs.pairs(points, 0.1, box=[1.0] * 3, quantities="d") ** 6
    return (s * s - s).sum()


@pytest.mark.parametrize(
    "page", [pytest.param(one, marks=[pytest.mark.slow] * ("nearest" in one)) for one in PAGES]
)
def test_examples_of_pages_run(page):
    libraries, facts = PAGES[page]
    for library in libraries:
        pytest.importorskip(library, reason=f"{library} is not installed")
    names = {}
    for code in blocks_of(page):
        run(code, names, page)
    assert names
    for fact in facts:
        assert eval(fact, {"np": np, "hs": hs, "lennard_jones": lennard_jones, **names}), fact


def test_bonds_of_the_page_are_those_of_ase():
    neighborlist = pytest.importorskip("ase.neighborlist")
    names = run(blocks_of("docs/supports.md")[1], {"hs": hs}, "supports.md")
    cutoffs = neighborlist.natural_cutoffs(names["ethanol"], mult=1.1)
    i, j = neighborlist.neighbor_list("ij", names["ethanol"], cutoffs)
    found = set(zip(*(column.tolist() for column in names["bonds"])))
    assert found == {(a, b) for a, b in zip(i.tolist(), j.tolist()) if a < b}


def test_pages_name_tests_that_there_are():
    paths = [path for path in (ROOT / "tests").rglob("test_*.*") if path.suffix in (".c", ".py")]
    sources = "".join(f"{path.name}\n{path.read_text()}" for path in paths)
    named = [word for page in (ROOT / "docs" / "systems").glob("*.md")
             for word in re.findall(r"\btest_\w+|\bTest\w+", page.read_text())]  # fmt: skip
    exactness = (ROOT / "docs" / "exactness.md").read_text()
    named += re.findall(r"\| `(\w+)(?:\.\.\.)?` \|$", exactness, re.M)
    assert len(named) > 40 and [word for word in named if word not in sources] == []


def test_the_stub_names_what_the_module_has():
    core = importlib.import_module("halfshell._core")
    stub = ast.parse((ROOT / "python/halfshell/_core.pyi").read_text())
    named = {node.name for node in stub.body if isinstance(node, ast.FunctionDef)}
    named |= {ast.unparse(node.target) for node in stub.body if isinstance(node, ast.AnnAssign)}
    assert named - {"__getattr__"} <= set(dir(core))
