# SPDX-License-Identifier: BSD-3-Clause
"""The report in a terminal: one line a method, and on request one a method and scene."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import Any

from halfshell._report.rows import ReportRow
from halfshell._report.words import duration, in_short, methods_of, number

__all__ = ["SUMMARY", "method_label", "scene_table", "summary_cells", "summary_table"]

SUMMARY = (
    "method", "version", "right", "wrong", "none", "missed", "spurious", "duplicate", "d, ulp",
    "time / exact",
)  # fmt: skip


def summary_cells(rows: Sequence[ReportRow]) -> list[list[str]]:
    """One line a method over all scenes, under the heads of `SUMMARY`.

    Lists that are right, lists that are wrong, scenes without a list; pairs; the largest error
    of a distance; the median of the time over that of precision "exact".
    """
    exact = {
        row.scene: row.seconds for row in rows if row.kind == "halfshell" and row.method == "exact"
    }
    lines = []
    for method in methods_of(rows, "halfshell", "peer"):
        mine = [row for row in rows if row.method == method and row.kind != "reuse"]
        done = [row for row in mine if row.status == "ok"]
        slower = [
            row.seconds / base
            for row in done
            if row.seconds and (base := exact.get(row.scene)) and method != "exact"
        ]
        ulps = [row.d_max_ulp for row in done if row.d_max_ulp is not None]
        kinds = ("missed", "spurious", "duplicate")
        counts = [number(sum(getattr(row, kind) or 0 for row in done)) for kind in kinds]
        lines.append([
            method, next((row.version for row in mine if row.version), ""),
            str(sum(1 for row in done if not row.wrong)),
            str(sum(1 for row in done if row.wrong)), str(len(mine) - len(done)),
            *(counts if done else [""] * 3), number(max(ulps)) if ulps else "",
            f"{median(slower):.3g}" if slower else "",
        ])  # fmt: skip
    return lines


def summary_table(rows: Sequence[ReportRow]) -> Any:
    """Return a rich table of `summary_cells`, narrow enough for 80 columns."""
    from rich import box
    from rich.table import Table

    table = Table(
        title="All scenes: lists right, lists wrong, scenes without a list; wrong pairs",
        title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False,
    )  # fmt: skip
    heads = [head.replace("duplicate", "twice").replace(" / exact", "") for head in SUMMARY]
    for k, head in enumerate(heads):
        if k != 1:
            table.add_column(head, justify="right" if k else "left", no_wrap=True)
    for line in summary_cells(rows):
        table.add_row(line[0], *line[2:], style="bold red" if line[3] != "0" else None)
    return table


def scene_table(rows: Sequence[ReportRow]) -> Any:
    """Return a rich table of one scene, a line a method."""
    from rich import box
    from rich.table import Table

    first = rows[0]
    table = Table(
        title=f"{first.scene}: {first.title} ({first.points:,} points)", title_justify="left",
        box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False,
    )  # fmt: skip
    heads = ("method", "rule", "time", "pairs", "d, ulp", "D, ulp", "energy", "forces", "drift")
    for k, head in enumerate(heads):
        table.add_column(head, justify="left" if k in (0, 1, 3) else "right")
    for row in rows:
        result = in_short(row)
        if row.status != "ok" and row.note:
            result += f" ({row.note})"
        table.add_row(
            method_label(row), row.rule, duration(row.seconds), result,
            number(row.d_max_ulp), number(row.D_max_ulp), number(row.energy_error),
            number(row.force_error), number(row.drift_kinetic),
            style="bold red" if row.wrong else None,
        )  # fmt: skip
    return table


def method_label(row: ReportRow) -> str:
    """A method with what tells its runs apart."""
    parts = [row.method]
    if row.skin is not None:
        parts.append(f"skin {row.skin:.3g}")
    if row.method == "by the clock":
        parts.append(f"every {row.rebuild_every}")
    return ", ".join(parts)
