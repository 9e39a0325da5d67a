# SPDX-License-Identifier: BSD-3-Clause
"""docs/start/coming-from.md: what it says of other libraries is so, where they are installed."""

import re

import numpy as np
import pytest

import halfshell as hs
from checkout import ROOT

TEXT = (ROOT / "docs/start/coming-from.md").read_text()
SECTIONS = dict(re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", TEXT, re.MULTILINE | re.DOTALL))
LINE = np.arange(4.0)[:, None] * [1.0, 0.0, 0.0]  # neighbours at exactly 1


def run(section, *libraries):
    for library in libraries:
        pytest.importorskip(library, reason=f"{library} is not installed")
    names = {}
    for code in re.findall(r"```python\n(.*?)```", SECTIONS[section], re.DOTALL):
        exec(compile(code, f"coming-from.md, {section}", "exec"), names)
    return names


def triples(i, j, S):
    return set(zip(i.tolist(), j.tolist(), map(tuple, np.asarray(S).tolist())))


def test_every_row_has_a_section():
    rows = re.findall(r"^\| (\w+(?: Geometric)?)", TEXT.split("## ")[0], re.MULTILINE)
    for name in rows:
        assert any(name in section for section in SECTIONS), name


def test_ase():
    names = run("ASE", "ase")
    assert triples(*names["theirs"]) == triples(*names["ours"]) and len(names["theirs"][0]) > 4000
    atoms = names["Atoms"]("H4", positions=LINE)
    assert len(names["neighbor_list"]("i", atoms, 1.0)) == 0


def test_scipy():
    names = run("SciPy", "scipy")
    i, j = hs.pairs(names["points"], 2.0, box=names["box"])
    assert set(map(tuple, names["pairs"].tolist())) == set(zip(i.tolist(), j.tolist()))
    tree = names["KDTree"](LINE)
    assert tree.query_pairs(1.0) == {(0, 1), (1, 2), (2, 3)}
    assert np.isinf(tree.query(LINE[:1], k=2, distance_upper_bound=1.0)[0][0, 1])
    assert hs.nearest(LINE, 2, queries=LINE[:1], max_distance=1.0, quantities="d")[0, 1] == 1.0


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_mdanalysis():
    names = run("MDAnalysis", "MDAnalysis")
    pairs = set(zip(names["i"].tolist(), names["j"].tolist()))
    assert {tuple(sorted(row)) for row in names["theirs"].tolist()} == pairs
    assert len(names["n_pairs"]) == 3 and names["atoms"][0].min() >= 100
    assert len(names["self_capped_distance"](LINE.astype(np.float32), 1.0)[0]) == 3


def test_freud():
    names = run("freud", "freud")
    i, j = (np.asarray(getattr(names["found"], name)) for name in
            ("query_point_indices", "point_indices"))  # fmt: skip
    order = np.lexsort((j, i))
    assert np.array_equal(i[order], names["i"]) and np.array_equal(j[order], names["j"])
    assert np.allclose(np.asarray(names["found"].vectors)[order], names["D"], atol=1e-5)
    sizes = np.bincount(names["cluster"].cluster_idx)
    ours = hs.clusters(names["points"], 1.2, box=names["length"]).sizes
    assert np.array_equal(np.sort(ours)[::-1], sizes)


def test_vesin_and_matscipy():
    names = run("vesin and matscipy", "vesin", "matscipy")
    half = hs.pairs(
        names["points"], 2.0, box=names["box"], quantities="ijS", inclusive=False
    )
    assert triples(names["i"], names["j"], names["S"]) == triples(*half)
    assert triples(*names["full"]) == triples(*names["ours"])
    open_space = {"points": LINE, "box": np.zeros((3, 3)), "periodic": False, "quantities": "i"}
    calculator = names["vesin"].NeighborList(cutoff=1.0, full_list=False)
    assert len(calculator.compute(**open_space)[0]) == 0


def test_pytorch_geometric():
    names = run("PyTorch Geometric")
    assert np.array_equal(names["source"], names["table"].indices) and len(names["source"])
