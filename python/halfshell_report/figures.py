# SPDX-License-Identifier: BSD-3-Clause
"""The figures of a report, as SVG: of all scenes, of one, what exactness costs, kept lists.

Each method has a mark and a colour. Error axes are logarithmic and end in a band labelled 0, where
what is right is drawn.
"""

from __future__ import annotations

import importlib
import io
import math
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from halfshell_report.findings import Standing, exact_times, ratios, standings
from halfshell_report.rows import ReportRow

__all__ = [
    "LOOKS", "called", "cost_figure", "drift_figure", "map_figure", "new_figure",
    "overview_figure", "rules", "scene_figure", "to_svg",
]  # fmt: skip

# The mark and the colour of each method; ours in colours that colour-blind readers tell apart as
# well (Okabe and Ito). exact comes last, so that it is drawn on top.
LOOKS: dict[str, tuple[str, str]] = {
    "vesin": ("v", "#0b3c8c"),
    "cKDTree": ("^", "#d55e00"),
    "neighborlist-rs": ("<", "#7a5195"),
    "matscipy-neighbours": (">", "#8c564b"),
    "matscipy": ("h", "#c49c94"),
    "MDAnalysis": ("p", "#a6a51a"),
    "freud": ("P", "#3a7d8c"),
    "pymatgen": ("X", "#e7298a"),
    "ase": ("D", "#a50026"),
    "NumPy": ("d", "#666666"),
    "float32": ("s", "#cc79a7"),
    "single": ("s", "#e69f00"),
    "double": ("s", "#56b4e9"),
    "exact": ("o", "#009e73"),
}
_RULES: Any = {"axes.spines.top": False, "axes.spines.right": False, "font.size": 8.0,
               "svg.fonttype": "none", "svg.hashsalt": "halfshell",
               "axes.linewidth": 0.6}  # fmt: skip


def part(module: str, name: str) -> Any:
    """Something of matplotlib, imported when it is needed."""
    return getattr(importlib.import_module(f"matplotlib{module}"), name)


def rules() -> Any:
    """A context in which figures are made and drawn."""
    return part("", "rc_context")(_RULES)


def new_figure(width: float, height: float, layout: str | None = "constrained") -> Any:
    """An empty figure, in inches."""
    return part(".figure", "Figure")(figsize=(width, height), layout=layout)


def to_svg(figure: Any) -> bytes:
    """Return a figure as SVG, the same bytes for the same figure."""
    stream = io.BytesIO()
    with rules():
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return _smaller(stream.getvalue().decode()).encode()


def _smaller(svg: str) -> str:
    """Leave out what a picture does not need: half of its size."""
    svg = re.sub(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<!--.*?-->|<metadata>.*?</metadata>", "", svg,
                 flags=re.DOTALL)  # fmt: skip
    svg = re.sub(r"font-family: [^;\"]*;? ?", "", svg)
    svg = svg.replace("*{", "*{font-family: sans-serif; ", 1)
    svg = re.sub(r" ?\n(?=[LMCQz])", "", svg)
    svg = re.sub(r' transform="rotate\(-?0 [^"]*"', "", svg)
    # Coordinates, not the numbers that labels show.
    svg = re.sub(r"<[^>]*>", lambda tag: re.sub(r"(\d\.\d)\d+", r"\1", tag[0]), svg)
    svg = re.sub(r'<g id="(?!axes|legend)[^"]*"', "<g", svg)
    return re.sub(r">\s+<", "><", svg).strip()


def called(name: str) -> str:
    """The name of a method where it stands by itself."""
    if name == "float32":
        return "float32 input"
    own = {"exact": "halfshell", "double": "halfshell, double", "single": "halfshell, single"}
    return own.get(name, name)


def mark(name: str) -> Any:
    """The mark of a method, for a legend."""
    marker, color = LOOKS[name]
    return part(".lines", "Line2D")([], [], linestyle="", marker=marker, color=color, markersize=5)


def log_axis(axis: Any, values: Sequence[float]) -> Callable[[float], float]:
    """Make the y axis logarithmic, with a place for 0 below and for infinity above.

    Returns the function that places a value. The axis itself is linear in the logarithm.
    """
    logs = [math.log10(x) for x in values if 0.0 < x < math.inf]
    if not logs and math.inf not in values:
        return _only_zero(axis)
    low = math.floor(min(logs, default=-1.0) - 0.01)
    high = math.ceil(max(logs, default=0.0) + 0.01)
    step = max(1, -(-(high - low) // 5))
    gap = max(0.18 * (high - low), 0.5)
    ticks: dict[float, str] = {low - gap: "0"}
    ticks.update({k: power(k) for k in range(low, high + 1, step)})
    top = high + 0.05 * (high - low)
    if math.inf in values:
        top = high + gap
        ticks[top] = "∞"
    axis.set_ticks(list(ticks), list(ticks.values()))
    axis.axes.set_ylim(low - 1.5 * gap, top)
    axis.axes.axhspan(low - 1.5 * gap, low - 0.5 * gap, color="0.93", linewidth=0, zorder=0)

    def place(value: float) -> float:
        if value == 0.0:
            return low - gap
        return math.log10(value) if value < math.inf else top

    return place


def _only_zero(axis: Any) -> Callable[[float], float]:
    """An axis of values that are all 0."""
    axis.set_ticks([0.0], ["0"])
    axis.axes.set_ylim(-0.5, 2.5)
    axis.axes.axhspan(-0.5, 0.5, color="0.93", linewidth=0, zorder=0)
    return lambda value: 0.0


def power(k: int) -> str:
    """A power of ten, as text."""
    digits = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    return {0: "1", 1: "10"}.get(k, "10" + str(k).translate(digits))


#: States that leave a method without a list on a scene that it should be able to do.
_NO_LIST = ("failed", "crashed", "timed out")


def overview_figure(rows: Sequence[ReportRow]) -> Any | None:
    """Draw how often each method is right against how long it takes, or return None if none ran."""
    shown = [one for one in standings(rows) if one.slower and one.asked]
    if not shown:
        return None
    with rules():
        figure = new_figure(7.6, 4.2)
        axes = figure.subplots()
        logs = [math.log10(one.slower or 1.0) for one in shown]
        low, high = math.floor(min(logs) - 0.1), math.ceil(max(logs) + 0.4)
        axes.set_xlim(low - 0.5, high)
        axes.set_ylim(-6.0, 106.0)
        axes.axvline(0.0, color="0.8", linewidth=0.8, zorder=0)
        for one, x in zip(shown, logs):
            marker, color = LOOKS[one.method]
            axes.plot(x, 100.0 * one.share, linestyle="", marker=marker, color=color, markersize=7,
                      clip_on=False)  # fmt: skip
        places = [(x, 100.0 * one.share) for one, x in zip(shown, logs)]
        _label(figure, axes, shown, places)
        axes.set_xticks(range(low, high + 1), [power(k) for k in range(low, high + 1)])
        axes.set_yticks(range(0, 101, 20), [f"{k} %" for k in range(0, 101, 20)])
        axes.set_xlabel("median run time, relative to halfshell")
        axes.set_title("scenes with a right list, of those that the method offers", fontsize=8,
                       loc="left")  # fmt: skip
    return figure


def _label(
    figure: Any, axes: Any, shown: Sequence[Standing], places: Sequence[tuple[float, float]]
) -> None:
    """Write the names beside the points, where nothing else is."""
    figure.draw_without_rendering()  # the axes get their place
    to_points = 72.0 / figure.dpi
    points = [tuple(to_points * part for part in axes.transData.transform(at)) for at in places]
    taken = [(x - 5.0, y - 5.0, x + 5.0, y + 5.0) for x, y in points]
    for one, (x, y), at in zip(shown, points, places):
        name = called(one.method)
        width, height = 4.6 * len(name), 9.0
        # Beside the point, then above and below; then farther away, with a line.
        tries = [(7.0, -height / 2), (-7.0 - width, -height / 2)]
        tries += [(7.0, side * k * height - height / 2) for k in range(1, 12) for side in (-1, 1)]
        dx, dy = next(
            (
                (dx, dy)
                for dx, dy in tries
                if not any(
                    x + dx < right and left < x + dx + width
                    and y + dy < top and bottom < y + dy + height
                    for left, bottom, right, top in taken
                )
            ),
            tries[0],
        )  # fmt: skip
        taken.append((x + dx, y + dy, x + dx + width, y + dy + height))
        far = abs(dy + height / 2) > height / 2
        axes.annotate(
            name, at, (dx, dy + height / 2), textcoords="offset points", va="center",
            color=LOOKS[one.method][1], annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": "0.7", "linewidth": 0.6} if far else None,
        )  # fmt: skip


def _short(ratio: float) -> str:
    """Two digits, and k for thousands."""
    if ratio >= 995.0:
        return f"{float(f'{ratio / 1000.0:.2g}'):g}k"
    return f"{ratio:.0f}" if ratio >= 9.95 else f"{ratio:.1f}"


def map_figure(rows: Sequence[ReportRow]) -> Any:
    """Draw who errs where: scenes downwards, methods to the right, share of wrong pairs.

    The number in a field is the run time, relative to that of precision "exact" on that scene.
    """
    exact = exact_times(rows)
    plain = [row for row in rows if row.kind in ("halfshell", "peer")]
    scenes = list(dict.fromkeys(row.scene for row in plain))
    columns = [one.method for one in standings(plain)]
    table = np.full((len(scenes), len(columns), 3), 1.0)
    shades = part(".colors", "LinearSegmentedColormap").from_list(
        "wrong", ["#fde0c5", "#eb4a40", "#5a0d1c"]
    )
    fixed = {"right": (0.80, 0.92, 0.86), "no list: the reason in words": (0.25, 0.25, 0.25),
             "not offered": (0.90, 0.90, 0.90),
             "left out or not installed": (1.0, 1.0, 1.0)}  # fmt: skip
    for row in plain:
        cell = scenes.index(row.scene), columns.index(row.method)
        if row.status == "ok":
            share = row.wrong_share or 0.0
            depth = 1.0 + math.log10(min(share, 1.0)) / 7.0 if share else 0.0
            table[cell] = shades(max(depth, 0.0))[:3] if share else fixed["right"]
        elif row.status in _NO_LIST:
            table[cell] = fixed["no list: the reason in words"]
        elif row.status == "not offered":
            table[cell] = fixed["not offered"]
    with rules():
        figure = new_figure(2.4 + 0.48 * len(columns), 1.9 + 0.18 * len(scenes))
        axes = figure.subplots()
        axes.imshow(table, aspect="auto", interpolation="nearest")
        for row in plain:
            across, down = columns.index(row.method), scenes.index(row.scene)
            dark = table[down, across].mean() < 0.5
            if row.status in _NO_LIST:
                axes.text(across, down, row.status, fontsize=6.5, ha="center", va="center",
                          color="white")  # fmt: skip
            elif row.status == "ok" and row.seconds and row.scene in exact:
                axes.text(across, down, _short(row.seconds / exact[row.scene]), fontsize=7,
                          ha="center", va="center", color="white" if dark else "0.15")  # fmt: skip
        axes.set_xticks(range(len(columns)), list(map(called, columns)), rotation=55, ha="left",
                        rotation_mode="anchor")  # fmt: skip
        axes.xaxis.tick_top()
        axes.set_yticks(range(len(scenes)), scenes)
        axes.tick_params(length=0)
        axes.set_xticks(np.arange(len(columns) + 1) - 0.5, minor=True)
        axes.set_yticks(np.arange(len(scenes) + 1) - 0.5, minor=True)
        axes.grid(which="minor", color="white", linewidth=1.0)
        axes.spines[:].set_visible(False)
        axes.tick_params(which="minor", length=0)
        wrong = {f"wrong: {text}": shades(depth)[:3] for text, depth in
                 (("1e-7 of the pairs", 0.0), ("3e-4", 0.5), ("all", 1.0))}  # fmt: skip
        patch = part(".patches", "Patch")
        keys = [patch(facecolor=color, edgecolor="0.7", label=name)
                for name, color in {**fixed, **wrong}.items()]  # fmt: skip
        figure.legend(handles=keys, loc="outside lower center", ncols=2, frameon=False)
    return figure


_RATIOS = (1 / 1024, 1 / 256, 1 / 64, 1 / 16, 0.25, 0.5, 1, 2, 4, 8, 16, 64, 256)
_PANEL, _KEY = 2.65, 1.6  # widths of a diagram and of the names beside them, in inches
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
    names = {name for _, shown in panels for name, *_ in shown}
    with rules():
        width, height = _PANEL * len(panels) + _KEY, max(2.5, 0.4 + 0.19 * len(names))
        figure = new_figure(width, height, layout=None)
        for axes, (label, shown) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels):
            _work_precision(axes, label, shown)
        # By hand, because laying out a hundred figures takes half a minute.
        figure.subplots_adjust(0.5 / width, 0.45 / height, 1.0 - (0.1 + _KEY) / width,
                               1.0 - 0.25 / height, wspace=0.35)  # fmt: skip
        shown = [name for name in reversed(LOOKS) if name in names]
        figure.legend([mark(name) for name in shown], [called(name) for name in shown],
                      loc="center left", bbox_to_anchor=(1.0 - _KEY / width, 0.5), frameon=False,
                      handletextpad=0.2, borderaxespad=0.0)  # fmt: skip
    return figure


def _work_precision(axes: Any, label: str, shown: Sequence[tuple[str, float, float]]) -> None:
    """Draw one diagram: run time to the right, error upwards."""
    values = [error for _, _, error in shown]
    place = log_axis(axes.yaxis, values)
    order = list(LOOKS)
    for name, seconds, error in sorted(shown, key=lambda item: order.index(item[0])):
        marker, color = LOOKS[name]
        axes.plot(math.log10(seconds), place(error), linestyle="", marker=marker, color=color,
                  markersize=5, clip_on=False)  # fmt: skip
    times = [math.log10(seconds) for _, seconds, _ in shown]
    low, high = math.floor(min(times)), math.ceil(max(times))
    axes.set_xlim(low, max(high, low + 1))
    axes.set_xticks(range(low, max(high, low + 1) + 1), [power(k) for k in
                    range(low, max(high, low + 1) + 1)])  # fmt: skip
    axes.set_xlabel("run time (s)")
    axes.set_title(label, fontsize=8, loc="left")


def cost_figure(rows: Sequence[ReportRow]) -> Any | None:
    """Draw what the exact decision costs on every scene, over the rounded ones."""
    found = {other: ratios(rows, "exact", other) for other in ("double", "single")}
    scenes = [name for name in dict.fromkeys(row.scene for row in rows) if name in found["double"]]
    if not scenes:
        return None
    with rules():
        figure = new_figure(5.6, 0.9 + 0.135 * len(scenes))
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
        ticks = [k for k in _RATIOS if low <= k <= high]
        told = [f"{k}" if k >= 1 else f"1/{1 / k:.0f}" for k in ticks or [1]]
        axes.set_xticks(ticks or [1], told)
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
    with rules():
        figure = new_figure(3.6 * len(scenes), 2.8)
        for axes, scene in zip(figure.subplots(1, len(scenes), squeeze=False)[0], scenes):
            _drift(axes, [row for row in moving if row.scene == scene])
            axes.set_title(scene, fontsize=8, loc="left")
    return figure


def _drift(axes: Any, rows: Sequence[ReportRow]) -> None:
    """One scene: rebuilt by the clock at the interval; rebuilt in time at its mean interval."""
    place = log_axis(axes.yaxis, [row.drift_kinetic or 0.0 for row in rows])
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
