# SPDX-License-Identifier: BSD-3-Clause
"""The report in a terminal: one line a method, and on request one a method and scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

from halfshell._report.page.rows import ReportRow
from halfshell._report.page.words import duration, in_short, methods_of, number

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
            number(median(slower)) if slower else "",
        ])  # fmt: skip
    return lines


def summary_table(rows: Sequence[ReportRow]) -> Any:
    """Return a rich table of `summary_cells`, narrow enough for 80 columns."""
    from rich import box
    from rich.table import Table

    table = Table(
        title="All scenes: lists right, lists wrong, scenes without a list; wrong pairs",
        title_justify="left", box=box.SIMPLE_HEAD, padding=0, pad_edge=False,
    )  # fmt: skip
    heads = [head.replace("duplicate", "twice").replace(" / exact", "") for head in SUMMARY]
    for k, head in enumerate(heads):
        if k != 1:
            table.add_column(head, justify="right" if k else "left", no_wrap=True)
    for line in summary_cells(rows):
        table.add_row(line[0], *line[2:], style="bold red" if line[3] != "0" else None)
    return table


def scene_table(rows: Sequence[ReportRow]) -> Any:
    """Return what rich prints for one scene: a line a method, then why some have none."""
    from rich.console import Group
    from rich.text import Text

    first = rows[0]
    parts: list[Any] = [Text(f"{first.scene}: {first.title}; {first.points:,} points", "bold")]
    plain = [row for row in rows if row.kind != "reuse" and row.status == "ok"]
    parts.append(_lines(plain, {
        "method": lambda row: row.method,
        "": lambda row: row.rule,
        "time": lambda row: duration(row.seconds),
        "pairs": in_short,
        "d, ulp": lambda row: number(row.d_max_ulp),
        "D, ulp": lambda row: number(row.D_max_ulp),
        "energy": lambda row: number(row.energy_error),
        "forces": lambda row: number(row.force_error),
    }))  # fmt: skip
    parts += [
        Text(f"{row.method}: {row.status}{': ' if row.note else ''}{row.note}", "dim")
        for row in rows
        if row.status != "ok"
    ]
    parts.append(_lines([row for row in rows if row.kind == "reuse"], {
        "lists": lambda row: row.method,
        "skin": lambda row: number(row.skin),
        "every": lambda row: number(row.rebuild_every),
        "built": lambda row: number(row.builds),
        "a step": lambda row: duration(row.seconds),
        "pairs": in_short,
        "drift": lambda row: number(row.drift_kinetic),
    }))  # fmt: skip
    return Group(*(part for part in parts if part is not None), "")


def _lines(
    rows: Sequence[ReportRow], columns: dict[str, Callable[[ReportRow], str]]
) -> Any | None:
    """A rich table, without columns that are empty; None without rows."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    shown = []
    for head, cell in columns.items():
        cells = [cell(row) for row in rows]
        if any(cells):
            shown.append(cells)
            left = head in ("method", "lists", "pairs", "")
            table.add_column(head, justify="left" if left else "right", no_wrap=True)
    for row, *line in zip(rows, *shown):
        table.add_row(*line, style="bold red" if row.wrong else None)
    return table if rows else None


def method_label(row: ReportRow) -> str:
    """A method with what tells its runs apart."""
    parts = [row.method]
    if row.skin is not None:
        parts.append(f"skin {row.skin:.3g}")
    if row.method == "by the clock":
        parts.append(f"every {row.rebuild_every}")
    return ", ".join(parts)
