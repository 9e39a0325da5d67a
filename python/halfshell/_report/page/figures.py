# SPDX-License-Identifier: BSD-3-Clause
"""The figures of the report: error against run time, who errs where, what exactness costs.

Error axes are logarithmic and end in a band labelled 0, where what is right is drawn.
"""

from __future__ import annotations

import importlib
import io
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from halfshell._report.page.rows import ReportRow
from halfshell._report.page.words import methods_of, ratios

__all__ = [
    "LOOKS", "cost_figure", "drift_figure", "key_figure", "map_figure", "scene_figure", "to_svg",
]  # fmt: skip

# Ours in colours that are told apart by colour-blind readers too (Okabe and Ito); others in
# shades of grey and by their marks. exact comes last, so that it is drawn on top.
LOOKS: dict[str, tuple[str, str]] = {
    "vesin": ("v", "0.35"),
    "cKDTree": ("^", "0.35"),
    "neighborlist-rs": ("<", "0.35"),
    "matscipy-neighbours": (">", "0.35"),
    "matscipy": ("h", "0.35"),
    "MDAnalysis": ("p", "0.35"),
    "freud": ("P", "0.35"),
    "pymatgen": ("X", "0.35"),
    "ase": ("D", "0.35"),
    "NumPy": ("d", "0.35"),
    "float32": ("s", "#cc79a7"),
    "single": ("s", "#e69f00"),
    "double": ("s", "#56b4e9"),
    "exact": ("o", "#009e73"),
}
_RULES: Any = {"axes.spines.top": False, "axes.spines.right": False, "font.size": 8.0,
               "svg.fonttype": "none", "svg.hashsalt": "halfshell",
               "axes.linewidth": 0.6}  # fmt: skip


def _part(module: str, name: str) -> Any:
    """Something of matplotlib, imported when it is needed."""
    return getattr(importlib.import_module(f"matplotlib{module}"), name)


def _rules() -> Any:
    return _part("", "rc_context")(_RULES)


def _figure(width: float, height: float, layout: str | None = "constrained") -> Any:
    return _part(".figure", "Figure")(figsize=(width, height), layout=layout)


def to_svg(figure: Any) -> bytes:
    """Return a figure as SVG, the same bytes for the same figure."""
    stream = io.BytesIO()
    with _rules():
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return _smaller(stream.getvalue().decode()).encode()


def _smaller(svg: str) -> str:
    """Leave out what a picture does not need: half of its size."""
    svg = re.sub(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<!--.*?-->|<metadata>.*?</metadata>", "", svg,
                 flags=re.DOTALL)  # fmt: skip
    svg = re.sub(r"font-family: [^;\"]*", "font-family: sans-serif", svg)
    svg = re.sub(r' transform="rotate\(-?0 [^"]*"', "", svg)
    svg = re.sub(r"(\d\.\d\d)\d+", r"\1", svg)
    svg = re.sub(r'<g id="(?!axes|legend)[^"]*"', "<g", svg)
    return re.sub(r">\s+<", "><", svg).strip()


_KEY_WIDTH = 7.6  # inches
_KEY_FILLED = 0.95  # of it at most: letters of a browser may be a little wider


def key_figure(rows: Sequence[ReportRow]) -> Any:
    """Say which mark is which method, once for all scenes."""
    with _rules():
        figure = _figure(_KEY_WIDTH, 1.0, layout=None)
        shown = [name for name in reversed(LOOKS) if name in methods_of(rows, "halfshell", "peer")]
        marks = [_mark(name) for name in shown]
        names = [f"precision {name}" if name in ("exact", "double", "single") else
                 "float32 input" if name == "float32" else name for name in shown]  # fmt: skip
        for columns in range(7, 0, -1):  # as many as fit
            legend = figure.legend(marks, names, loc="center", ncols=columns, frameon=False,
                                   handletextpad=0.2)  # fmt: skip
            extent = legend.get_window_extent()
            if columns == 1 or extent.width <= _KEY_FILLED * figure.bbox.width:
                figure.set_figheight(extent.height / figure.dpi + 0.1)
                return figure
            legend.remove()
    raise AssertionError("one column is always taken")


def _mark(name: str) -> Any:
    marker, color = LOOKS[name]
    return _part(".lines", "Line2D")([], [], linestyle="", marker=marker, color=color, markersize=5)


_PANELS: Any = (
    ("wrong pairs / pairs", "seconds", lambda row: row.wrong_share),
    ("largest error of d (ulp)", "seconds_with_d", lambda row: row.d_max_ulp),
    ("error of forces", "seconds_with_d", lambda row: row.force_error),
)


def scene_figure(rows: Sequence[ReportRow]) -> Any | None:
    """Draw error against run time on one scene, or return None if nothing was measured."""
    plain = [row for row in rows if row.status == "ok" and row.kind in ("halfshell", "peer")]
    panels = []
    for label, time, error in _PANELS:
        shown: Any = [
            (row.method, getattr(row, time) or row.seconds, error(row))
            for row in plain
            if error(row) is not None and (getattr(row, time) or row.seconds)
        ]
        if shown:
            panels.append((label, shown))
    if not panels:
        return None
    with _rules():
        width, height = 2.6 * len(panels), 1.9
        figure = _figure(width, height, layout=None)
        for axes, (label, shown) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels):
            _work_precision(axes, label, shown)
        # By hand, because laying out a hundred figures takes half a minute.
        figure.subplots_adjust(0.5 / width, 0.45 / height, 1.0 - 0.12 / width, 1.0 - 0.25 / height,
                               wspace=0.38)  # fmt: skip
    return figure


def _work_precision(axes: Any, label: str, shown: Sequence[tuple[str, float, float]]) -> None:
    """Draw one diagram: run time to the right, error upwards."""
    values = [error for _, _, error in shown]
    place = _log_axis(axes.yaxis, values)
    order = list(LOOKS)
    for name, seconds, error in sorted(shown, key=lambda item: order.index(item[0])):
        marker, color = LOOKS[name]
        axes.plot(math.log10(seconds), place(error), linestyle="", marker=marker, color=color,
                  markersize=5, clip_on=False)  # fmt: skip
    times = [math.log10(seconds) for _, seconds, _ in shown]
    low, high = math.floor(min(times)), math.ceil(max(times))
    axes.set_xlim(low, max(high, low + 1))
    axes.set_xticks(range(low, max(high, low + 1) + 1), [_power(k) for k in
                    range(low, max(high, low + 1) + 1)])  # fmt: skip
    axes.set_xlabel("run time (s)")
    axes.set_title(label, fontsize=8, loc="left")


def _log_axis(axis: Any, values: Sequence[float]) -> Any:
    """Make a logarithmic axis with a place for 0 below and for infinity above.

    Returns the function that places a value. The axis itself is linear in the logarithm.
    """
    logs = [math.log10(x) for x in values if 0.0 < x < math.inf]
    low = math.floor(min(logs, default=-1.0) - 0.01)
    high = math.ceil(max(logs, default=0.0) + 0.01)
    step = max(1, -(-(high - low) // 5))
    gap = max(0.18 * (high - low), 0.5)
    ticks: dict[float, str] = {low - gap: "0"}
    ticks.update({k: _power(k) for k in range(low, high + 1, step)})
    top = high + 0.05 * (high - low)
    if math.inf in values:
        top = high + gap
        ticks[top] = "∞"
    axis.set_ticks(list(ticks), list(ticks.values()))
    (axis.axes.set_ylim if axis.axis_name == "y" else axis.axes.set_xlim)(low - 1.5 * gap, top)
    band = axis.axes.axhspan if axis.axis_name == "y" else axis.axes.axvspan
    band(low - 1.5 * gap, low - 0.5 * gap, color="0.93", linewidth=0, zorder=0)

    def place(value: float) -> float:
        if value == 0.0:
            return low - gap
        return math.log10(value) if value < math.inf else top

    return place


def _power(k: int) -> str:
    digits = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    return {0: "1", 1: "10"}.get(k, "10" + str(k).translate(digits))


def map_figure(rows: Sequence[ReportRow]) -> Any:
    """Draw who errs where: scenes downwards, methods to the right, share of wrong pairs."""
    plain = [row for row in rows if row.kind in ("halfshell", "peer")]
    scenes = list(dict.fromkeys(row.scene for row in plain))
    columns = methods_of(plain, "halfshell", "peer")
    table = np.full((len(scenes), len(columns), 3), 1.0)
    shades = _part(".colors", "LinearSegmentedColormap").from_list(
        "wrong", ["#fde0c5", "#eb4a40", "#5a0d1c"]
    )
    fixed = {"right": (0.80, 0.92, 0.86), "failed, crashed or timed out": (0.25, 0.25, 0.25),
             "not offered": (0.90, 0.90, 0.90),
             "left out or not installed": (1.0, 1.0, 1.0)}  # fmt: skip
    for row in plain:
        cell = scenes.index(row.scene), columns.index(row.method)
        if row.status == "ok":
            share = row.wrong_share or 0.0
            depth = 1.0 + math.log10(min(share, 1.0)) / 7.0 if share else 0.0
            table[cell] = shades(max(depth, 0.0))[:3] if share else fixed["right"]
        elif row.status in ("failed", "crashed", "timed out"):
            table[cell] = fixed["failed, crashed or timed out"]
        elif row.status == "not offered":
            table[cell] = fixed["not offered"]
    with _rules():
        figure = _figure(2.4 + 0.38 * len(columns), 1.9 + 0.135 * len(scenes))
        axes = figure.subplots()
        axes.imshow(table, aspect="auto", interpolation="nearest")
        axes.set_xticks(range(len(columns)), columns, rotation=55, ha="left",
                        rotation_mode="anchor")  # fmt: skip
        axes.xaxis.tick_top()
        axes.set_yticks(range(len(scenes)), scenes, fontsize=7)
        axes.tick_params(length=0)
        axes.set_xticks(np.arange(len(columns) + 1) - 0.5, minor=True)
        axes.set_yticks(np.arange(len(scenes) + 1) - 0.5, minor=True)
        axes.grid(which="minor", color="white", linewidth=1.0)
        axes.spines[:].set_visible(False)
        axes.tick_params(which="minor", length=0)
        wrong = {f"wrong: {text}": shades(depth)[:3] for text, depth in
                 (("1e-7 of the pairs", 0.0), ("3e-4", 0.5), ("all", 1.0))}  # fmt: skip
        patch = _part(".patches", "Patch")
        keys = [patch(facecolor=color, edgecolor="0.7", label=name)
                for name, color in {**fixed, **wrong}.items()]  # fmt: skip
        figure.legend(handles=keys, loc="outside lower center", ncols=2, frameon=False, fontsize=7)
    return figure


def cost_figure(rows: Sequence[ReportRow]) -> Any | None:
    """Draw what the exact decision costs on every scene, over the rounded ones."""
    found = {other: ratios(rows, "exact", other) for other in ("double", "single")}
    scenes = [name for name in dict.fromkeys(row.scene for row in rows) if name in found["double"]]
    if not scenes:
        return None
    with _rules():
        figure = _figure(5.6, 0.9 + 0.135 * len(scenes))
        axes = figure.subplots()
        for other, values in found.items():
            marker, color = LOOKS[other]
            places = [(values[name], k) for k, name in enumerate(scenes) if name in values]
            if places:
                axes.plot(*zip(*places), linestyle="", marker=marker, color=color, markersize=4,
                          label=f"over {other}")  # fmt: skip
        axes.axvline(1.0, color="0.6", linewidth=0.8)
        axes.set_yticks(range(len(scenes)), scenes, fontsize=7)
        axes.set_ylim(len(scenes) - 0.4, -0.6)
        axes.set_xscale("log", base=2)
        low, high = axes.get_xlim()
        ticks = [k for k in (0.25, 0.5, 1, 1.5, 2, 3, 4, 8, 16, 32, 64) if low <= k <= high]
        axes.set_xticks(ticks or [1], [f"{k:g}" for k in ticks or [1]])
        axes.minorticks_off()
        axes.set_xlabel("run time of the exact decision over that of a rounded one")
        axes.legend(frameon=False, loc="best")
    return figure


def drift_figure(rows: Sequence[ReportRow]) -> Any | None:
    """Draw energy drift against the rebuild interval, a line for each skin."""
    moving = [row for row in rows if row.kind == "reuse" and row.drift_kinetic is not None]
    scenes = list(dict.fromkeys(row.scene for row in moving))
    if not scenes:
        return None
    with _rules():
        figure = _figure(3.6 * len(scenes), 2.8)
        for axes, scene in zip(figure.subplots(1, len(scenes), squeeze=False)[0], scenes):
            _drift(axes, [row for row in moving if row.scene == scene])
            axes.set_title(scene, fontsize=8, loc="left")
    return figure


def _drift(axes: Any, rows: Sequence[ReportRow]) -> None:
    """One scene: rebuilt by the clock at the interval; rebuilt in time at its mean interval."""
    place = _log_axis(axes.yaxis, [row.drift_kinetic or 0.0 for row in rows])
    stale = [row for row in rows if row.method == "by the clock"]
    colors = iter(("#d55e00", "#e69f00", "#cc79a7"))
    for skin in dict.fromkeys(row.skin for row in stale):
        line = [row for row in stale if row.skin == skin]
        axes.plot([math.log10(row.rebuild_every or 1) for row in line],
                  [place(row.drift_kinetic or 0.0) for row in line], marker="s", markersize=4,
                  linewidth=1.0, color=next(colors),
                  label=f"by the clock, skin {skin:.3g}")  # fmt: skip
    for method, label, marker, color in (
        ("verlet", "rebuilt in time", "o", "#009e73"),
        ("exact, every step", "a new list every step", "x", "0.2"),
    ):
        points = [row for row in rows if row.method == method]
        axes.plot([math.log10(max((row.steps or 0) / max(row.builds or 1, 1), 1.0)) for row in
                   points], [place(row.drift_kinetic or 0.0) for row in points], linestyle="",
                  marker=marker, color=color, markersize=5, label=label)  # fmt: skip
    axes.set_xticks([0, 1, 2], ["1", "10", "100"])
    axes.set_xlabel("steps between two lists (mean)")
    axes.set_ylabel("energy drift / kinetic energy")
    axes.legend(frameon=False, fontsize=6.5)
