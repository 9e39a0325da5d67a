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
from halfshell_report.peers import LIBRARIES
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
    ])  # fmt: skip
    text = "\n".join(said)
    assert "Precision 'exact' gave 1 list with 1,000 pairs in all, and every one was right." in text
    assert "1 of the lists is wrong, by 3 pairs." in text
    assert "Worst on s, which has 1,000 pairs: 3 missed." in text
    assert "2.00 times as long as 'double'" in text
    assert "off by 1 unit in the last place" in text
    assert "gone: not installed; no list to judge." in text


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


def test_durations_have_units():
    assert [findings.duration(x) for x in (2.0, 3e-3, 4e-6, None)] == ["2 s", "3 ms", "4 µs", ""]


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
    page = html.page(machine_facts(), [*rows, bare("vesin", "failed", note=note)])
    parse(page)
    assert "<script>" not in page


def test_methods_are_ranked_by_what_a_reader_cares_about():
    found = findings.standings([
        row("exact", seconds=1.0), row("tree", "peer", missed=2, seconds=0.5),
        bare("slow", "timed out"), bare("slow", "not offered", scene="t"),
        row("quick", "peer", seconds=3.0), bare("quick", "crashed", scene="t"),
        row("exact", seconds=1.0, scene="t"), row("tree", "peer", seconds=2.0, scene="t"),
    ])  # fmt: skip
    assert [one.method for one in found] == ["exact", "quick", "tree", "slow"]
    quick, tree, slow = found[1:]
    assert (quick.right, quick.failed, quick.share, quick.slower) == (1, 1, 0.5, 3.0)
    assert (tree.right, tree.wrong, tree.missed, tree.slower) == (1, 1, 2, 1.25)
    assert (slow.late, slow.not_offered, slow.asked, slow.share) == (1, 1, 1, 0.0)


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


def test_figures_are_the_same_bytes_each_time(rows):
    for make in (
        figures.overview_figure, figures.map_figure, figures.cost_figure, figures.drift_figure
    ):  # fmt: skip
        assert figures.to_svg(make(rows)) == figures.to_svg(make(rows))


def test_labels_keep_their_digits():
    figure = figures.new_figure(2.0, 2.0)
    figure.text(0.123456, 0.5, "skin 0.0312")
    svg = figures.to_svg(figure)
    assert b"skin 0.0312" in svg and b"23456" not in svg


def test_the_map_says_why_there_is_no_list(rows):
    more = [*rows, bare("freud", "timed out"), bare("ase", "crashed")]
    svg = figures.to_svg(figures.map_figure(more)).decode()
    assert ">timed out<" in svg and ">crashed<" in svg


def test_every_method_has_a_mark():
    assert set(figures.LOOKS) == {"exact", "double", "single", "float32", *LIBRARIES}


# Geometry ----------------------------------------------------------------------------------


def outside(figure):
    """How far what is drawn reaches beyond the picture, in inches."""
    agg = pytest.importorskip("matplotlib.backends.backend_agg")
    with figures.rules():
        canvas = agg.FigureCanvasAgg(figure)
        canvas.draw()
        drawn, page = figure.get_tightbbox(canvas.get_renderer()), figure.bbox_inches
    return max(-drawn.x0, -drawn.y0, drawn.x1 - page.x1, drawn.y1 - page.y1)


@pytest.mark.parametrize(
    "n",
    [
        pytest.param(n, marks=[] if n in (1, 6, len(figures.LOOKS)) else pytest.mark.slow)
        for n in range(1, len(figures.LOOKS) + 1)
    ],
)
def test_every_method_has_its_name_beside_the_diagrams(n):
    ours = {"exact", "double", "single", "float32"}
    for names in (list(figures.LOOKS)[:n], list(figures.LOOKS)[-n:]):
        shown = [
            row(name, "halfshell" if name in ours else "peer", d_max_ulp=1.0) for name in names
        ]
        figure = figures.scene_figure(shown)
        (legend,) = figure.legends
        assert [text.get_text() for text in legend.get_texts()] == [
            figures.called(name) for name in reversed(figures.LOOKS) if name in names
        ]
        assert outside(figure) <= 0.0
        left = legend.get_window_extent().x0
        assert all(axes.get_window_extent().x1 < left for axes in figure.axes)


@pytest.mark.slow
def test_no_figure_of_the_committed_report_is_cut():
    with (ROOT / "docs" / "report" / "report.csv").open(newline="", encoding="utf-8") as stream:
        rows = read_csv(stream)[1]
    made = [figures.overview_figure(rows), figures.map_figure(rows), figures.cost_figure(rows),
            figures.drift_figure(rows)]  # fmt: skip
    for name in list(dict.fromkeys(one.scene for one in rows))[::8]:
        made.append(figures.scene_figure([one for one in rows if one.scene == name]))
    assert all(outside(figure) < 1e-6 for figure in made if figure is not None)
