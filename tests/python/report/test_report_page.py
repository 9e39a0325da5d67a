# SPDX-License-Identifier: BSD-3-Clause
"""What the report says: words, tables, figures, and the page that holds them all."""

import base64
import io
import math
import re
import xml.etree.ElementTree as ElementTree

import pytest

from checkout import ROOT
from halfshell_report import figures, findings, report
from halfshell_report import page as html
from halfshell_report.measure import machine_facts
from halfshell_report.rows import read_csv
from report_helpers import bare, parse, row


@pytest.fixture(scope="module")
def rows():
    """Two scenes, one of which moves, by every method of ours and SciPy's tree."""
    return report(["near-ties", "head-on"], peers=["cKDTree"], size="small")


def test_words_say_what_the_rows_say():
    said = findings.findings([
        row("exact", d_max_ulp=0.0), row("double", missed=3, seconds_least=0.5, d_max_ulp=1.0),
        row("other", "peer", spurious=1, version="2"), bare("gone", "not installed"),
        row("by the clock", "reuse", missed=1, scene="t"),
    ])  # fmt: skip
    text = "\n".join(said)
    assert "Precision 'exact' gave 1 list with 1,000 pairs in all, and every one was right." in text
    assert "1 of the lists is wrong, by 3 pairs." in text
    assert "Worst on s, which has 1,000 pairs: 3 missed." in text
    assert "2.00 times as long as 'double'" in text
    assert "off by 1 unit in the last place" in text
    assert "gone: not installed; no list to judge." in text
    assert "On t, 1 run with lists rebuilt by the clock: 1 missed pairs." in text


def test_words_on_a_scene_tell_right_from_wrong():
    said = findings.scene_words([
        row("exact"), row("single", missed=1, spurious=2),
        bare("other", "crashed", note="ended by SIGABRT"), bare("more", "not offered", note="2-D"),
    ])  # fmt: skip
    assert said == (
        "Right: exact. Wrong: single (1 missed, 2 spurious). "
        "No answer: other (crashed: ended by SIGABRT). Not offered: more (2-D)."
    )


def test_numbers_are_short():
    texts = {
        None: "", 0: "0", 7: "7", 12345: "12,345", 0.5: "0.5", 1e10: "1.0e+10", math.inf: "inf",
        3e-17: "3e-17", 99.9: "100", 9.96: "10", 580.4: "580",
    }  # fmt: skip
    assert {value: findings.number(value) for value in texts} == texts


def test_tables_have_a_line_a_method(rows):
    from rich.console import Console

    stream = io.StringIO()
    console = Console(file=stream, width=80)
    console.print(findings.summary_table(rows))
    for name in ("near-ties", "head-on"):
        console.print(findings.scene_table([row for row in rows if row.scene == name]))
    console.print(findings.scene_table([bare("other", "crashed", note="by SIGABRT")]))
    text = stream.getvalue()
    assert max(map(len, text.splitlines())) <= 80
    assert re.search(r"exact +2 +0 +0 +0 +0 +0 +0", text)
    assert re.search(r"single +<= .* spurious", text)
    assert "other: crashed: by SIGABRT" in text
    assert "…" not in text


def test_the_page_is_well_formed_and_needs_nothing_else(rows):
    page = html.page(machine_facts(), rows)
    tree = parse(page)
    assert "http" not in re.sub(r"base64,[^\"]*", "", page)
    names = {element.get("id") for element in tree.iter()}
    for element in tree.iter():
        assert element.tag not in ("script", "link", "iframe", "object")
        for name, value in element.attrib.items():
            if name == "src":
                assert value.startswith("data:image/svg+xml;base64,")
            if name == "href":
                assert value[0] == "#" and value[1:] in names
    images = [element.get("src") for element in tree.iter("img")]
    assert len(images) >= 5
    for image in images:
        svg = ElementTree.fromstring(base64.b64decode(image.partition(",")[2]))
        assert svg.tag == "{http://www.w3.org/2000/svg}svg"
    text = " ".join(tree.itertext())
    assert "every one was right" in text and "near-ties" in text
    assert len(page) < 500_000


def test_what_a_library_says_cannot_break_the_page(rows):
    note = '<script>alert("&")</script> \x1b[31m'
    more = [bare("vesin", "failed", note=note), bare("ase", "not installed")]
    page = html.page(machine_facts(), [*rows, *more])
    parse(page)
    assert "<script>" not in page


def test_the_headline_names_the_best_other_library():
    ours = [row("exact", seconds=1.0)]
    assert findings.headline([]) == ""
    assert findings.headline(ours) == "halfshell was right on the one scene."
    one = [*ours, row("tree", "peer", missed=1, seconds=2.0)]
    assert findings.headline(one).endswith(
        "tree, the other library, was right on 0 of 1, and took 2 times as long in the median."
    )
    two = [*one, row("other", "peer", seconds=5.0)]
    assert findings.headline(two).endswith(
        "Of 2 other libraries the best one, other, was right on 1 of 1, and took 5 times as long "
        "in the median."
    )


def test_labels_of_the_overview_do_not_cover_each_other():
    Text = pytest.importorskip("matplotlib.text").Text
    many = [row(name, "halfshell" if name in ("exact", "double", "single", "float32") else "peer",
                seconds=1.0 + 0.01 * k) for k, name in enumerate(figures.LOOKS)]  # fmt: skip
    figure = figures.overview_figure(many)
    assert outside(figure) <= 0.0
    extents = [Text.get_window_extent(text) for text in figure.axes[0].texts]  # without lines
    assert len(extents) == len(figures.LOOKS)
    for k, one in enumerate(extents):
        assert not any(one.overlaps(other) for other in extents[:k])
    assert figures.overview_figure([bare("vesin", "crashed")]) is None


def test_zero_and_infinity_have_a_place_in_the_figures(rows):
    odd = [row("exact", d_max_ulp=0.0, force_error=0.0),
           row("single", missed=5, d_max_ulp=math.inf, force_error=math.inf)]  # fmt: skip
    svg = figures.to_svg(figures.scene_figure(odd)).decode()
    assert ">0<" in svg and ">∞<" in svg
    assert figures.scene_figure([bare("vesin", "crashed")]) is None
    assert figures.cost_figure([row("exact")]) is None
    assert figures.drift_figure([row("exact")]) is None


# Geometry ----------------------------------------------------------------------------------


def outside(figure):
    """How far what is drawn reaches beyond the picture, in inches."""
    agg = pytest.importorskip("matplotlib.backends.backend_agg")
    with figures.rules():
        canvas = agg.FigureCanvasAgg(figure)
        canvas.draw()
        drawn, page = figure.get_tightbbox(canvas.get_renderer()), figure.bbox_inches
    return max(-drawn.x0, -drawn.y0, drawn.x1 - page.x1, drawn.y1 - page.y1)


@pytest.mark.slow
def test_no_figure_of_the_committed_report_is_cut():
    with (ROOT / "docs" / "report" / "report.csv").open(newline="", encoding="utf-8") as stream:
        rows = read_csv(stream)[1]
    made = [figures.overview_figure(rows), figures.map_figure(rows), figures.cost_figure(rows),
            figures.drift_figure(rows)]  # fmt: skip
    for name in list(dict.fromkeys(one.scene for one in rows))[::8]:
        made.append(figures.scene_figure([one for one in rows if one.scene == name]))
    assert all(outside(figure) < 1e-6 for figure in made if figure is not None)
