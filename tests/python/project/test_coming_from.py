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


def both_ways(i, j, S):
    return triples(i, j, S) | triples(j, i, -S)


def test_every_row_has_a_section():
    rows = re.findall(r"^\| (\w+(?: Geometric)?)", TEXT.split("## ")[0], re.MULTILINE)
    for name in rows:
        assert any(name in section for section in SECTIONS), name


def test_ase():
    names = run("ASE", "ase")
    assert triples(*names["theirs"]) == triples(*names["ours"])
    i = names["theirs"][0]
    assert (np.diff(i) >= 0).all() and len(i) > 4000
    from ase.neighborlist import first_neighbors

    offsets = first_neighbors(len(names["atoms"]), i)
    assert np.array_equal(offsets, names["table"].offsets)
    counts = hs.coordination(names["atoms"], 4.0, inclusive=False)
    assert np.array_equal(counts, np.bincount(i, minlength=len(names["atoms"])))
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
    with pytest.raises(ValueError):
        names["KDTree"](names["points"] + 1.0, boxsize=20.0)
    points = names["points"][:50]
    once = names["KDTree"](points, boxsize=20.0).query_pairs(15.0)
    assert len(once) < hs.count_pairs(points, 15.0, box=names["box"])


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_mdanalysis():
    names = run("MDAnalysis", "MDAnalysis")
    pairs = set(zip(names["i"].tolist(), names["j"].tolist()))
    assert {tuple(sorted(row)) for row in names["theirs"].tolist()} == pairs
    assert len(names["n_pairs"]) == 3 and names["atoms"][0].min() >= 100
    from MDAnalysis.analysis.rdf import InterRDF
    from MDAnalysis.lib.distances import calc_bonds

    group, dimensions = names["group"], names["u"].dimensions
    box = hs.Box.from_dimensions(dimensions)
    x, i, j = group.positions, np.arange(100), np.arange(100, 200)
    d = calc_bonds(x[i], x[j], box=dimensions)
    assert np.allclose(d, hs.measure(x, i, j, box=box, quantities="d"), atol=1e-5)
    everything = group.universe.atoms.positions
    group.universe.load_new(everything, dimensions=dimensions)
    theirs = InterRDF(group, group, nbins=20, range=(0, 5)).run().results.rdf
    ours = hs.rdf(everything[group.indices], 5.0, 20, box=box).g
    assert np.allclose(theirs[1:], ours[1:], rtol=1e-6) and theirs[0] > ours[0]
    found, _ = names["self_capped_distance"](LINE.astype(np.float32), 1.0)
    assert len(found) == 3


def test_freud():
    names = run("freud", "freud")
    freud, found = names["freud"], names["found"]
    i, j = np.asarray(found.query_point_indices), np.asarray(found.point_indices)
    order = np.lexsort((j, i))
    assert np.array_equal(i[order], names["i"]) and np.array_equal(j[order], names["j"])
    assert (np.diff(i.astype(np.int64)) >= 0).all()
    vectors = np.asarray(found.vectors)
    assert vectors.dtype == np.float32
    assert np.allclose(vectors[order], names["D"], atol=1e-5)
    query = freud.locality.AABBQuery(freud.box.Box.cube(10.0), LINE)
    options = {"r_max": 1.0, "exclude_ii": True}
    assert len(query.query(LINE, options).toNeighborList()) == 0
    sizes = np.bincount(names["cluster"].cluster_idx)
    ours = hs.clusters(names["points"], 1.2, box=names["length"]).sizes
    assert (np.diff(sizes) <= 0).all() and np.array_equal(np.sort(ours)[::-1], sizes)
    with pytest.raises(RuntimeError):
        query.query(LINE, {"r_max": 5.5, "exclude_ii": True}).toNeighborList()
    options = {"num_neighbors": 3, "exclude_ii": True}
    nearest = names["query"].query(names["points"], options).toNeighborList()
    j = np.sort(np.asarray(nearest.point_indices).reshape(-1, 3), axis=1)
    ours, _ = hs.nearest(names["points"], 3, box=names["length"])
    assert np.mean(j == np.sort(ours, axis=1)) > 0.999  # float32 may see another one


def test_vesin_and_matscipy():
    names = run("vesin and matscipy", "vesin", "matscipy")
    points, box = names["points"], names["box"]
    half = hs.pairs(points, 2.0, box=box, quantities="ijS", inclusive=False)
    assert triples(names["i"], names["j"], names["S"]) == triples(*half)
    again = points[names["j"]] - points[names["i"]] + names["S"] @ box
    assert np.allclose(again, names["D"])
    assert triples(*names["full"]) == triples(*names["ours"]) == both_ways(*half)
    assert (np.diff(names["full"][0]) >= 0).all()
    (shifts,) = names["calculator"].compute(
        points=np.zeros((1, 3)), box=np.eye(3), periodic=True, quantities="S"
    )
    ours = hs.pairs(np.zeros((1, 3)), 2.0, box=1.0, quantities="S", inclusive=False)
    assert {tuple(S) for S in np.concatenate((shifts, -shifts)).tolist()} == {
        tuple(S) for S in np.concatenate((ours, -ours)).tolist()
    }
    assert len(shifts) == len(ours)
    open_space = {"points": LINE, "box": np.zeros((3, 3)), "periodic": False, "quantities": "i"}
    calculator = names["vesin"].NeighborList(cutoff=1.0, full_list=False)
    assert len(calculator.compute(**open_space)[0]) == 0
    cell = {"cell": np.eye(3) * 10.0, "pbc": [False] * 3}
    assert len(names["neighbour_list"]("i", cutoff=1.0, positions=LINE, **cell)) == 0


def test_pytorch_geometric():
    names = run("PyTorch Geometric")
    assert np.array_equal(names["source"], names["table"].indices) and len(names["source"])
