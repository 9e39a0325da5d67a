# SPDX-License-Identifier: BSD-3-Clause
"""Fill the marked sections of docs/errors.md from a report, and from one of full size.

    halfshell report --scenes all --patience 3 -o docs/report
    halfshell report --size full -o docs/report/full
    python benchmarks/fill_errors.py docs/report/report.csv --full docs/report/full/report.csv

How sections are marked is said in `marks`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from halfshell_report.findings import (
    SUMMARY,
    findings,
    method_label,
    methods_of,
    number,
    summary_cells,
)
from halfshell_report.rows import ReportRow, read_csv
from pages import Lines, fill, table

__all__ = ["SECTIONS", "fill_page", "main"]

_DOCS = Path(__file__).resolve().parents[1] / "docs"

Facts = Mapping[str, str]
Rows = Sequence[ReportRow]


def machine(facts: Facts, rows: Rows) -> Lines:
    """Say where, when and with what the figures were measured."""
    versions = {row.method: row.version for row in rows if row.kind == "peer" and row.version}
    others = ", ".join(f"{name} {version}" for name, version in versions.items())
    return [
        f"{facts['cpu']}, {facts['cores']} cores, one thread used, {facts['machine']}; halfshell",
        f"{facts['halfshell']}, kernel {facts['kernel']}, Python {facts['python']}, NumPy "
        f"{facts['numpy']}, SciPy {facts['scipy']}. Measured on {facts['date'][:10]}, on "
        f"{len({row.scene for row in rows})} scenes of up to "
        f"{max(row.points for row in rows):,} points.",
        f"Others: {others}." if others else "Other libraries were not asked.",
    ]


def found(facts: Facts, rows: Rows) -> Lines:
    """The words of the report on our own methods; the tables tell of others."""
    return [f"* {text}" for text in findings([row for row in rows if row.kind != "peer"])]


def methods(facts: Facts, rows: Rows) -> Lines:
    """One line a method."""
    return table(SUMMARY, summary_cells(rows))


def scenes(facts: Facts, rows: Rows) -> Lines:
    """Wrong pairs of every method on the scenes where a library or "double" errs."""
    plain = [row for row in rows if row.kind in ("halfshell", "peer")]
    names = methods_of(plain, "halfshell", "peer")
    body = []
    for scene in dict.fromkeys(row.scene for row in plain):
        mine = {row.method: row for row in plain if row.scene == scene}
        first = next((row for row in mine.values() if row.pairs_true is not None), None)
        if first is None or not any(_notable(row) for row in mine.values()):
            continue
        body.append([f"`{scene}`", f"{first.pairs_true:,}", f"{first.ties:,}",
                     *(_cell(mine.get(name)) for name in names)])  # fmt: skip
    return table(["scene", "pairs", "at the cutoff", *names], body)


def _notable(row: ReportRow) -> bool:
    return bool(row.wrong) and row.method not in ("single", "float32")


def _cell(row: ReportRow | None) -> str:
    if row is None or row.status in ("left out", "not installed"):
        return ""
    if row.status != "ok":
        return "-" if row.status == "not offered" else row.status
    return number(row.wrong) if row.wrong == 0 else f"**{number(row.wrong)}**"


def kept(facts: Facts, rows: Rows) -> Lines:
    """Lists that are kept over steps."""
    body = [
        [f"`{row.scene}`", method_label(row), number(row.builds), f"{row.steps}",
         number(row.missed), number(row.drift_kinetic)]
        for row in rows
        if row.kind == "reuse" and row.status == "ok"
    ]  # fmt: skip
    return table(["scene", "lists", "built", "steps", "missed", "energy drift"], body)


SECTIONS: dict[str, Callable[[Facts, Rows], Lines]] = {
    "machine": machine,
    "found": found,
    "methods": methods,
    "scenes": scenes,
    "kept": kept,
}

FULL_SECTIONS = {f"full {name}": SECTIONS[name] for name in ("machine", "methods", "scenes")}


def fill_page(page: str, report: Path, full: Path | None = None) -> str:
    """Return the page with every section filled from a report, and from one of full size."""
    for path, sections in ((report, SECTIONS), (full, FULL_SECTIONS)):
        if path is not None:
            with path.open(newline="", encoding="utf-8") as stream:
                facts, rows = read_csv(stream)
            page = fill(page, {name: make(facts, rows) for name, make in sections.items()})
    return page


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("report", type=Path, metavar="CSV", help="of halfshell report")
    parser.add_argument("--full", type=Path, metavar="CSV", help="of one of full size")
    parser.add_argument("--page", type=Path, default=_DOCS / "errors.md", metavar="MD")
    options = parser.parse_args(arguments)
    page = fill_page(options.page.read_text(encoding="utf-8"), options.report, options.full)
    options.page.write_text(page, encoding="utf-8")
    print(f"wrote {options.page}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
