# SPDX-License-Identifier: BSD-3-Clause
"""The report in a terminal: one line a method, and on request one a method and scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from halfshell_report.page.rows import ReportRow
from halfshell_report.page.standing import standings
from halfshell_report.page.words import duration, in_short, number

__all__ = ["SUMMARY", "method_label", "scene_table", "summary_cells", "summary_table"]

SUMMARY = (
    "method", "version", "right", "wrong", "timed out", "failed", "not offered", "missed",
    "spurious", "duplicate", "d, ulp", "time / exact",
)  # fmt: skip
# Narrower heads for 80 columns.
_NARROW = {"timed out": "late", "not offered": "n/a", "duplicate": "twice", "time / exact": "time"}


def summary_cells(rows: Sequence[ReportRow]) -> list[list[str]]:
    """One line a method over all scenes, the best first, under the heads of `SUMMARY`.

    Scenes with a right list, with a wrong one, with none in time, with an error or a crash, and
    scenes that the method does not offer; wrong pairs; the largest error of a distance; the median
    of the time over that of precision "exact".
    """
    lines = []
    for one in standings(rows):
        pairs = (one.missed, one.spurious, one.duplicate)
        lines.append([
            one.method, one.version,
            *map(str, (one.right, one.wrong, one.late, one.failed, one.not_offered)),
            *(map(number, pairs) if one.right + one.wrong else [""] * 3), number(one.ulp),
            number(one.slower) if one.method != "exact" else "",
        ])  # fmt: skip
    return lines


def summary_table(rows: Sequence[ReportRow]) -> Any:
    """Return a rich table of `summary_cells`, narrow enough for 80 columns."""
    from rich import box
    from rich.table import Table

    table = Table(
        title="All scenes: right, wrong, late, failed, not offered (n/a); wrong pairs",
        title_justify="left", box=box.SIMPLE_HEAD, padding=0, pad_edge=False,
    )  # fmt: skip
    for k, head in enumerate(SUMMARY):
        if k != 1:
            name = _NARROW.get(head, head)
            table.add_column(name, justify="right" if k else "left", no_wrap=True)
    for line in summary_cells(rows):
        wrong = f"[bold red]{line[3]}[/]" if line[3] != "0" else line[3]
        table.add_row(line[0], line[2], wrong, *line[4:])
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
