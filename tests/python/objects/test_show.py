# SPDX-License-Identifier: BSD-3-Clause
"""Objects in one line of text, and as a small table in notebooks."""

import inspect
from xml.etree import ElementTree

import numpy as np
import pytest

import halfshell as hs
from halfshell import _show, structures
from halfshell_report import report, scenes

POINTS = np.random.default_rng(5).random((40, 3))
BOX = np.ones(3)


def _verlet():
    made = hs.VerletList(0.2, skin=0.1, box=BOX, track_changes=True)
    made.update(POINTS)
    return made


def _dynamic():
    made = hs.DynamicCellList(3, 0.3, box=BOX)
    made.insert_many(np.arange(len(POINTS)), POINTS)
    return made


def _stale():
    nodes = hs.NodeList("a", POINTS, np.full(len(POINTS), 10.0))
    links = hs.Connectivity([nodes])
    field = hs.PairField(links.pairs)
    links.rebuild([nodes])
    return field


NODES = hs.NodeList("<script>&", POINTS, np.full(len(POINTS), 10.0))
LINKS = hs.Connectivity([NODES])
ROWS = report(["near-ties"], methods=["exact"], size="small")
SCENE = scenes.load("disks-touching", size="small")
TABLE = hs.neighbors(POINTS, 0.3, box=BOX, quantities="jdDS")
CELLS = hs.CellList(POINTS, 0.2, box=BOX)

SHOWN = {
    "Box": hs.Box(BOX),
    "Brick": hs.bricks(POINTS, 0.1, 2, box=BOX)[0],
    "Bricks": hs.bricks(POINTS, 0.1, 2, box=BOX),
    "CacheInfo": hs.cache_info(),
    "Candidates": CELLS.candidates(POINTS),
    "CellList": CELLS,
    "Clusters": hs.clusters(POINTS, 0.1, box=BOX),
    "Columns": LINKS.pairs._made,
    "Connectivity": LINKS,
    "DynamicCellList": _dynamic(),
    "Explanation": hs.explain(POINTS, 0.2, box=BOX, measure=True),
    "GlobalNeighbors": LINKS.global_neighbors(),
    "Graph": TABLE.graph(),
    "Motion": scenes.load("head-on", size="small").motion,
    "NeighborTable": TABLE,
    "NodeList": NODES,
    "PairChanges": _verlet().changes(),
    "PairField": hs.PairField(LINKS.pairs),
    "PairTable": LINKS.pairs,
    "Points": hs.Points(POINTS, box=BOX, types=["<script>&"] * len(POINTS)),
    "RadialDistribution": hs.rdf(POINTS, 0.5, box=BOX),
    "ReportRow": ROWS[0],
    "Scene": SCENE,
    "Structure": structures.alpha_quartz((1, 1, 1)),
    "Updates": SCENE.updates,
    "Verdict": hs.verify(POINTS, 0.2, [0] * 9, np.arange(9)),
    "VerletList": _verlet(),
}  # fmt: skip


def test_every_public_class_is_here():
    classes = {
        name for name in hs.__all__
        if inspect.isclass(getattr(hs, name)) and not issubclass(getattr(hs, name), Exception)
    }  # fmt: skip
    assert classes - {"settings"} <= SHOWN.keys()


def test_repr_is_short_and_names_the_class():
    for name, shown in SHOWN.items():
        text, *rows = repr(shown).split("\n")
        in_rows = name in ("NeighborTable", "Points")
        assert text.startswith(f"{name}(") and len(rows) == (6 if in_rows else 0)
        assert max(map(len, rows), default=0) < 130
        assert len(text) < 300 and "array" not in text and " at 0x" not in text, name


def test_html_is_well_formed_and_harmless():
    for name, shown in SHOWN.items():
        text = shown._repr_html_()
        ElementTree.fromstring(f"<body>{text}</body>")
        assert name in text and len(text) < 3000
        assert "<script" not in text and "color" not in text, name


def test_names_are_escaped():
    assert "&lt;script&gt;&amp;" in NODES._repr_html_()
    assert "&lt;script&gt;&amp;" in LINKS._repr_html_()


def test_what_is_told():
    found = hs.clusters([[0.0], [1.0], [5.0]], 1.5)
    assert repr(found) == (
        "Clusters(n_clusters=2, sizes=[2, 1], labels=[0, 0, 1], spans=[[False], [False]])"
    )
    assert repr(hs.rdf(POINTS, 0.4, box=BOX)) == (
        "RadialDistribution(r=float64 (100,), g=float64 (100,), counts=int64 (100,), "
        "edges=float64 (101,), n=float64 (100,), expected=float64 (100,), n_centers=40, "
        "n_frames=1, is_half=True)"
    )
    row = ROWS[0]
    assert row.scene in repr(row) and "missed=0" in repr(row) and "box" not in repr(row)
    assert "ok=False" in repr(SHOWN["Verdict"])
    assert str(SHOWN["Verdict"]).startswith("wrong: 9 rows")
    assert str(SHOWN["Explanation"]).startswith("40 points in 3 dimensions")
    told = SHOWN["Points"]._repr_html_()
    assert "float64 (40, 3)" in told and "<U9" not in told and "types" in told
    assert "radii" not in told and "periodic" in told
    assert "NeighborTable(40 rows" in TABLE._repr_html_() and "<th>4</th>" in TABLE._repr_html_()


def test_boxes():
    box = hs.Box([[3.0, 0.0], [3.0, 4.0]])
    assert eval(repr(box), {"Box": hs.Box}) == box
    assert str(box) == "box with edges 3 x 5, volume 12"
    assert "[[3, 0], [3, 4]]" in box._repr_html_()
    assert "float64 (8, 8)" in hs.Box(np.ones(8))._repr_html_()


@pytest.mark.parametrize("n", [0, 1])
def test_of_nothing_and_of_one(n):
    points = np.zeros((n, 2))
    made = [
        hs.CellList(points, 1.0), hs.clusters(points, 1.0), hs.Points(points[:0]),
        hs.explain(points, 1.0), hs.VerletList(1.0), hs.DynamicCellList(2, 1.0),
        hs.Connectivity([]), hs.Connectivity([]).pairs, hs.rdf(points, 0.5, box=[1.0, 1.0]),
    ]  # fmt: skip
    for each in made:
        assert "\n" not in repr(each)
        ElementTree.fromstring(f"<body>{each._repr_html_()}</body>")


def test_a_stale_field_shows_that_it_is():
    field = _stale()
    assert repr(field) in field._repr_html_()


def test_values_in_a_few_words():
    brief = _show._brief
    assert brief(0.1 + 0.2) == "0.3" and brief(np.float32(2.5)) == "2.5" and brief(()) == "()"
    assert brief((1,)) == "(1,)" and brief([1, 2.0]) == "[1, 2]" and brief({1: 2}) == "1 entries"
    assert brief(list(range(1000))) == "1000 of int" and brief("x" * 99).endswith("xxx...")
    assert brief("two\nlines") == r"'two\nlines'" and brief(np.zeros((0, 3))) == "float64 (0, 3)"
    assert brief(np.full((3, 3), 0.123456789)) == "float64 (3, 3)"
