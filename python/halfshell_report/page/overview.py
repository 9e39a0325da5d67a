# SPDX-License-Identifier: BSD-3-Clause
"""The two pictures of all scenes: error against run time, and who errs where."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from halfshell_report.page.looks import LOOKS, called, new_figure, part, power, rules
from halfshell_report.page.rows import ReportRow
from halfshell_report.page.standing import Standing, exact_times, standings

__all__ = ["map_figure", "overview_figure"]

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
        axes.set_xlabel("median run time, relative to precision 'exact'")
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
        axes.set_xticks(range(len(columns)), columns, rotation=55, ha="left",
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
