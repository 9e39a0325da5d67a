# SPDX-License-Identifier: BSD-3-Clause
"""Draw nanoseconds a pair against points and against neighbours, with the write limit.

    python benchmarks/plot.py RESULTS.csv [MORE.csv ...] -o docs/figures/

Needs matplotlib and the rows of group S1 (`run.py --group S1`). The write limit is measured in
the same run: filling new memory of the output's size (for results that are kept) and writing
over memory in use (for results that are dropped). Lines differ by marker and dashes, not by
colour alone.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pages import OURS, Row, is_ours, is_reference, read_csv

__all__ = ["main", "series"]

_NAME = re.compile(r"uniform-1e(\d)-k(\d+)")
_LIMIT = {"fresh": "writing the output", "recycled": "rewriting the output"}
_OTHERS = "fastest other library"

# Marker, dashes and grey level by line; other kernels take them in turn.
_KERNELS = (("o", "-", "0.0"), ("s", "--", "0.25"), ("^", "-.", "0.4"), ("v", ":", "0.4"))
_STYLES = {_OTHERS: ("D", "-", "0.55"), "write limit": ("", (0, (1, 1)), "0.0")}

Points = dict[float, float]


def series(rows: Sequence[Row], mode: str, along: str, fixed: int) -> dict[str, Points]:
    """Collect the lines of one panel.

    Parameters
    ----------
    rows : sequence of Row
    mode : {"fresh", "recycled"}
    along : {"n", "k"}
        The axis: number of points, or of neighbours.
    fixed : int
        The value of the other one.

    Returns
    -------
    dict of str to dict of float to float
        Nanoseconds a pair by axis value, by name of the line: our kernels, the fastest other
        library, and the write limit. Of several runs the fastest counts.
    """
    lines: dict[str, Points] = {}
    for row in rows:
        match = _NAME.fullmatch(row.one.scene)
        if match is None:
            continue
        n, neighbours = 10 ** int(match[1]), int(match[2])
        if (neighbours if along == "n" else n) != fixed:
            continue
        name = _line(row, mode)
        if name is None:
            continue
        value = 1e9 * getattr(row.one, f"{mode}_median") / max(row.one.pairs, 1)
        line = lines.setdefault(name, {})
        at = float(n if along == "n" else neighbours)
        line[at] = min(value, line.get(at, value))
    return {name: dict(sorted(line.items())) for name, line in lines.items()}


def _line(row: Row, mode: str) -> str | None:
    """Name the line that a row is a point of."""
    contestant = row.one.contestant
    if contestant == OURS:
        return f"halfshell, {row.kernel or 'default kernel'}"
    if contestant == f"{OURS} [{_LIMIT[mode]}]":
        return "write limit"
    if is_ours(contestant) or is_reference(contestant) or not row.one.complete:
        return None
    return _OTHERS


def _draw(axes: Any, lines: dict[str, Points], label: str) -> None:
    styles = iter(_KERNELS * 2)
    for name in sorted(lines, key=lambda one: (one in _STYLES, one)):
        marker, dashes, grey = _STYLES.get(name) or next(styles)
        axes.plot(
            list(lines[name]), list(lines[name].values()), marker=marker, linestyle=dashes,
            color=grey, label=name, markersize=4.5, linewidth=1.3,
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(label)
    axes.grid(True, which="major", linewidth=0.4, color="0.85")


def _figure(rows: Sequence[Row], mode: str, neighbours: int, n: int, path: Path) -> None:
    """Write one figure of two panels."""
    import matplotlib

    matplotlib.use("svg")
    # The same file for the same figures: no dates, no random identifiers.
    matplotlib.rcParams["svg.hashsalt"] = "halfshell"
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.8), sharey=True)
    _draw(left, series(rows, mode, "n", neighbours), f"points, {neighbours} neighbours each")
    _draw(right, series(rows, mode, "k", n), f"neighbours, {n:_} points".replace("_", " "))
    left.set_ylabel("nanoseconds a pair")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=len(labels), frameon=False)
    what = "results kept" if mode == "fresh" else "results dropped"
    cpu = rows[0].facts.get("cpu", "")
    figure.text(0.5, 0.01, f"{cpu}, one thread, int32, {what}", ha="center", fontsize=8)
    figure.tight_layout(rect=(0.0, 0.04, 1.0, 0.92))
    figure.savefig(path, format="svg", metadata={"Date": None})
    plt.close(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("results", type=Path, nargs="+", metavar="CSV")
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/figures"), metavar="FOLDER")
    parser.add_argument("--neighbours", type=int, default=50, help="of the left panel (50)")
    parser.add_argument("--points", type=int, default=100_000, help="of the right panel (100000)")
    options = parser.parse_args(arguments)
    rows = [row for path in options.results for row in read_csv(path)]
    if not any(_NAME.fullmatch(row.one.scene) for row in rows):
        print("no rows of group S1: run.py --group S1 --output CSV", file=sys.stderr)
        return 2
    options.output.mkdir(parents=True, exist_ok=True)
    for mode in _LIMIT:
        path = options.output / f"ns-per-pair-{mode}.svg"
        _figure(rows, mode, options.neighbours, options.points, path)
        print(f"wrote {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
