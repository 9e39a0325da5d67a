# SPDX-License-Identifier: BSD-3-Clause
"""How figures of the report look: a mark and a colour for each method, axes, pictures as SVG."""

from __future__ import annotations

import importlib
import io
import math
import re
from collections.abc import Callable, Sequence
from typing import Any

__all__ = ["LOOKS", "called", "log_axis", "mark", "new_figure", "part", "power", "rules", "to_svg"]

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
    return f"precision {name}" if name in ("exact", "double", "single") else name


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
