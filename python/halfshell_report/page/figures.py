# SPDX-License-Identifier: BSD-3-Clause
"""The figures of single questions: one scene, what exactness costs, lists that are kept.

Error axes are logarithmic and end in a band labelled 0, where what is right is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from halfshell_report.page.looks import (
    LOOKS,
    called,
    log_axis,
    mark,
    new_figure,
    power,
    rules,
)  # fmt: skip
from halfshell_report.page.rows import ReportRow
from halfshell_report.page.words import ratios

__all__ = ["cost_figure", "drift_figure", "scene_figure"]

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
