# SPDX-License-Identifier: BSD-3-Clause
"""The report as one page that needs nothing but itself: words, figures, tables.

It is well-formed XML as well as HTML, so that a strict parser can check it.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape as _escape
from typing import Any

from halfshell._report.page import figures
from halfshell._report.page.rows import ReportRow
from halfshell._report.page.table import SUMMARY, method_label, summary_cells
from halfshell._report.page.words import duration, findings, in_short, number, scene_words
from halfshell.scenes import names

__all__ = ["page"]

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; background: #fff; margin: 2rem auto;
  max-width: 62rem; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
h3 { font-size: 1rem; margin: 1.6rem 0 0.2rem; } p, li { max-width: 48rem; }
table { border-collapse: collapse; font-size: 13px; margin: 0.5rem 0; }
th, td { padding: 0.15rem 0.6rem; text-align: right; border-bottom: 1px solid #e4e4e4; }
th:first-child, td:first-child, td.text, th.text { text-align: left; }
tr.wrong td { color: #a3121f; } .facts { color: #666; font-size: 13px; }
img { max-width: 100%; display: block; } .wide { overflow-x: auto; }
details { margin: 0.3rem 0; } summary { cursor: pointer; color: #555; font-size: 13px; }
"""

_HOW = (
    "Every list is held against a truth that calls nothing of this library's compiled core: "
    "explicit images, SciPy's k-d tree with a proven margin, and integer arithmetic inside the "
    "margin, for the numbers that the floats are. A method is judged by its own rule for a pair "
    "at exactly the cutoff (≤ or &lt;), and by what it tells: where it gives no shifts, by i "
    "and j. What it does not offer is not held against it. Balls are pairs where the distance is "
    "at most the real sum of two radii; precision 'double' and other libraries compare with the "
    "rounded one. Where points have supports, a pair is judged by the length of H D, which they "
    "compute in float64. Times are of one call for i and j on "
    "one thread, other libraries each in a process of their own. Distances are compared with the "
    "true ones rounded once, in units in the last place (ulp). Energy and forces are "
    "Lennard-Jones sums over the list with sigma = cutoff / 2.5 unless the scene has its own, "
    "cut and not shifted, against a sum that is rounded once."
)


def escape(text: str) -> str:
    """Return text for a page, without the control characters that XML does not allow."""
    return _escape("".join(c if c.isprintable() else " " for c in text))


def page(facts: Mapping[str, str], rows: Sequence[ReportRow]) -> str:
    """Return the whole page."""
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8"/>',
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>',
        "<title>halfshell: error against run time</title>",
        f"<style>{_STYLE}</style></head><body>",
        "<h1>Error against run time</h1>",
        f'<p class="facts">{escape(_facts(facts))}</p>',
        "<h2>What was found</h2><ul>",
        *(f"<li>{escape(text)}</li>" for text in findings(rows)),
        "</ul><h2>How</h2>",
        f"<p>{_HOW}</p>",
        "<h2>All methods</h2>",
        "<p>Lists that are right, lists that are wrong, scenes without a list; pairs; the largest "
        "error of a distance; the median of the run time over that of precision 'exact'.</p>",
        _table(SUMMARY, [(line, line[3] != "0") for line in summary_cells(rows)]),
        "<h2>Who errs where</h2>",
        _image(figures.map_figure(rows), "wrong pairs by scene and method"),
    ]
    for title, figure in (
        ("What the exact decision costs", figures.cost_figure(rows)),
        ("Lists that are kept over steps", figures.drift_figure(rows)),
    ):
        if figure is not None:
            parts += [f"<h2>{title}</h2>", _image(figure, title)]
    parts += [
        "<h2>Scene by scene</h2>",
        "<p>Error upwards, run time to the right; the grey band is error 0.</p>",
        _image(figures.key_figure(rows), "marks of the methods"),
    ]
    for name in dict.fromkeys(row.scene for row in rows):
        parts += _scene([row for row in rows if row.scene == name])
    return "\n".join([*parts, "</body></html>", ""])


def _facts(facts: Mapping[str, str]) -> str:
    return (
        f"{facts['date']}; {facts['cpu']}, {facts['cores']} cores, one thread used; "
        f"{facts['machine']}; halfshell {facts['halfshell']}, kernel {facts['kernel']}; Python "
        f"{facts['python']}, NumPy {facts['numpy']}, SciPy {facts['scipy']}"
    )


def _scene(rows: Sequence[ReportRow]) -> list[str]:
    """One scene: what it is, the diagram, the words, the figures to look up."""
    first = rows[0]
    size = f"{first.points:,} points in {first.dimensions}-D, {first.box}"
    pairs = next((row.pairs_true for row in rows if row.pairs_true is not None), None)
    ties = next((row.ties for row in rows if row.ties is not None), 0)
    at = "touching exactly" if first.scene in names(radii=True) else (
        "exactly on a surface" if first.scene in names(supports=True) else "at exactly the cutoff"
    )
    told = f"{size}; {pairs:,} pairs, {ties:,} {at}" if pairs is not None else size
    parts = [
        f'<h3 id="{escape(first.scene)}">{escape(first.scene)}: {escape(first.title)}</h3>',
        f'<p class="facts">{escape(told)}</p>',
    ]
    figure = figures.scene_figure(rows)
    if figure is not None:
        parts.append(_image(figure, f"error against run time on {first.scene}"))
    parts.append(f"<p>{escape(scene_words(rows))}</p>")
    parts += ["<details><summary>figures</summary>", _details(rows), "</details>"]
    return parts


def _details(rows: Sequence[ReportRow]) -> str:
    heads = ("method", "rule", "time", "pairs", "d, ulp: max", "rms", "D, ulp: max", "rms",
             "energy", "forces", "drift", "note")  # fmt: skip
    body = [
        (
            [
                method_label(row), row.rule, duration(row.seconds), in_short(row),
                number(row.d_max_ulp), number(row.d_rms_ulp), number(row.D_max_ulp),
                number(row.D_rms_ulp), number(row.energy_error), number(row.force_error),
                number(row.drift_kinetic), row.note,
            ],
            bool(row.wrong),
        )
        for row in rows
    ]  # fmt: skip
    return _table(heads, body)


def _table(heads: Sequence[str], body: Sequence[tuple[Sequence[str], bool]]) -> str:
    lines = ['<div class="wide"><table><tr>']
    lines += [f"<th>{escape(head)}</th>" for head in heads]
    lines.append("</tr>")
    for cells, wrong in body:
        inner = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
        lines.append(f'<tr class="wrong">{inner}</tr>' if wrong else f"<tr>{inner}</tr>")
    return "".join([*lines, "</table></div>"])


def _image(figure: Any, text: str) -> str:
    data = base64.b64encode(figures.to_svg(figure)).decode()
    return f'<img alt="{escape(text)}" src="data:image/svg+xml;base64,{data}"/>'
