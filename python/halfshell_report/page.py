# SPDX-License-Identifier: BSD-3-Clause
"""The report as one page that needs nothing but itself: words, figures, tables.

It is well-formed XML as well as HTML, so that a strict parser can check it.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape as _escape
from typing import Any

from halfshell_report.figures import (
    cost_figure,
    drift_figure,
    map_figure,
    overview_figure,
    scene_figure,
    to_svg,
)
from halfshell_report.findings import (
    SUMMARY,
    duration,
    findings,
    headline,
    in_short,
    method_label,
    number,
    scene_words,
    summary_cells,
)
from halfshell_report.rows import ReportRow
from halfshell_report.scenes import names

__all__ = ["page"]

_STYLE = """
:root { color-scheme: light dark; --text: #222; --page: #fff; --quiet: #666; --line: #e4e4e4;
  --wrong: #a3121f; --link: #0b57a4; }
@media (prefers-color-scheme: dark) { :root { --text: #ddd; --page: #16181b; --quiet: #a0a0a0;
  --line: #34373b; --wrong: #ff8a80; --link: #8ab4f8; }
  img { filter: invert(0.91) hue-rotate(180deg); } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--text); background: var(--page);
  margin: 2rem auto; max-width: 62rem; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
h3 { font-size: 1rem; margin: 1.6rem 0 0.2rem; } p, li, dd { max-width: 48rem; }
a { color: var(--link); } .lead { font-size: 1.15rem; }
table { border-collapse: collapse; font-size: 13px; margin: 0.5rem 0; }
th, td { padding: 0.15rem 0.6rem; text-align: right; border-bottom: 1px solid var(--line); }
th:first-child, td:first-child, td.text, th.text { text-align: left; }
tr.wrong td { color: var(--wrong); } .facts { color: var(--quiet); font-size: 13px; }
.wide { overflow-x: auto; } img { display: block; background: #fff; border-radius: 4px; }
details { margin: 0.3rem 0; } summary { cursor: pointer; color: var(--quiet); font-size: 13px; }
dt { font-weight: 600; } dd { margin: 0 0 0.4rem 1rem; }
"""

_HOW = (
    "Every list is compared with a truth that does not use this library's compiled core: explicit "
    "images and SciPy's k-d tree with a proven margin; inside the margin, integer arithmetic on "
    "the exact values of the floats. Each method is judged by its own rule for a pair at exactly "
    "the cutoff (≤ or &lt;), and only by what it returns: by i and j alone if it returns no "
    "shifts. A feature that it does not offer is not an error. Two balls are a pair if their "
    "distance is at most the exact sum of their radii; precision 'double' and other libraries "
    "compare with the rounded sum. If points have supports, a pair is judged by the length of H D, "
    "which those compute in float64. Times are those of one call for i and j on one thread; each "
    "of the other libraries runs in a process of its own. Distances are compared with the true "
    "ones rounded once, in units in the last place (ulp). Energy and forces are Lennard-Jones "
    "sums over the list with sigma = cutoff / 2.5 (unless the scene sets its own), cut off and "
    "not shifted, and compared with a sum that is rounded once."
)


#: What words of the page mean.
_GLOSSARY = {
    "scene": "Named points, with a box and a cutoff, that are difficult in some way.",
    "exact, double, single": "Precisions of this library: pairs are decided for the exact values "
    "of your numbers, or by a single comparison in float64 or float32.",
    "float32 input": "Points rounded to float32 beforehand, then decided exactly.",
    "right": "No pair is missed, none is invented, and none is listed twice.",
    "missed, spurious, duplicate": "Pairs that are not in the list but should be; pairs that are "
    "in it but should not be; repetitions.",
    "timed out, failed, crashed": "No list within the time limit; an error was raised; the process "
    "died.",
    "not offered": "A feature that the library does not claim to have, such as skewed boxes.",
    "tie": "A pair at exactly the cutoff.",
    "ulp": "A unit in the last place: the distance between neighbouring float64 numbers.",
    "rule": "Whether a pair at exactly the cutoff counts (≤) or does not (<).",
    "skin": "How much farther than the cutoff a list reaches if it is kept for several steps.",
    "energy drift": "The largest change of the total energy during a run, divided by the kinetic "
    "energy at the start.",
}


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
        f'<p class="lead">{escape(headline(rows))}</p>',
        *_picture(overview_figure(rows), "how often each method is right, against its run time"),
        "<h2>Who errs where</h2>",
        "<p>Each row is a scene, each column a method. The number in a field is the run time "
        "divided by that of halfshell; the stronger the red, the more pairs are wrong.</p>",
        *_picture(map_figure(rows), "wrong pairs by scene and method"),
        "<h2>All methods</h2>",
        "<p>The number of scenes with a right list, a wrong one or none; the wrong pairs of all "
        "lists together; the largest error of a distance; the median run time divided by that of "
        "precision 'exact', halfshell's own. The method with the most right lists comes first.</p>",
        _table(SUMMARY, [(line, False) for line in summary_cells(rows)]),
        "<details><summary>In words</summary><ul>",
        *(f"<li>{escape(text)}</li>" for text in findings(rows)),
        "</ul></details>",
        f"<details><summary>How this was measured</summary><p>{_HOW}</p></details>",
        "<details><summary>What the words mean</summary><dl>",
        *(f"<dt>{escape(word)}</dt><dd>{escape(text)}</dd>" for word, text in _GLOSSARY.items()),
        "</dl></details>",
        f'<p class="facts">{escape(_facts(facts))}</p>',
    ]
    for title, figure in (
        ("What the exact decision costs", cost_figure(rows)),
        ("Lists that are kept over steps", drift_figure(rows)),
    ):
        if figure is not None:
            parts += [f"<h2>{title}</h2>", *_picture(figure, title)]
    scenes = dict.fromkeys(row.scene for row in rows)
    parts += [
        "<h2>Scene by scene</h2>",
        "<p>Errors increase upwards, run times to the right; in the grey band the error is 0.</p>",
        "<p>" + ", ".join(map(_link, scenes)) + "</p>",
    ]
    for name in scenes:
        parts += _scene([row for row in rows if row.scene == name])
    return "\n".join([*parts, "</body></html>", ""])


def _link(scene: str) -> str:
    return f'<a href="#{escape(scene)}">{escape(scene)}</a>'


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
    parts += _picture(scene_figure(rows), f"error against run time on {first.scene}")
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


def _picture(figure: Any | None, text: str) -> list[str]:
    """A figure in its own size, which small screens scroll; nothing where there is none."""
    if figure is None:
        return []
    data = base64.b64encode(to_svg(figure)).decode()
    image = f'<img alt="{escape(text)}" src="data:image/svg+xml;base64,{data}"/>'
    return [f'<div class="wide">{image}</div>']
