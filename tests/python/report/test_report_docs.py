# SPDX-License-Identifier: BSD-3-Clause
"""docs/errors.md and docs/report: made from two committed reports, by benchmarks/fill_errors.py."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import SimpleNamespace

import pytest

from benchmark_modules import bench, only_in_a_checkout  # noqa: F401
from checkout import BENCHMARKS
from halfshell_report.rows import ReportRow, read_csv, write_csv
from halfshell_report.run import SCENES

pytestmark = only_in_a_checkout
DOCS = BENCHMARKS.parent / "docs"
REPORT, FULL = DOCS / "report", DOCS / "report" / "full"
FACTS = {
    "date": "2026-01-02T03:04:05+00:00", "machine": "lab", "cpu": "chip", "cores": "2",
    "threads": "1", "kernel": "avx2", "halfshell": "1", "python": "3", "numpy": "2", "scipy": "1",
}  # fmt: skip


def test_the_page_is_that_of_the_committed_report(bench: SimpleNamespace) -> None:  # noqa: F811
    page = (DOCS / "errors.md").read_text(encoding="utf-8")
    filled = bench.fill_errors.fill_page(page, REPORT / "report.csv", FULL / "report.csv")
    assert filled == page, "fill_errors.py, with the two files in docs/report"


@pytest.mark.parametrize("folder", [REPORT, FULL], ids=["small", "full"])
def test_the_committed_reports_are_whole(folder: Path) -> None:
    with (folder / "report.csv").open(newline="", encoding="utf-8") as stream:
        facts, rows = read_csv(stream)
    assert facts["cpu"] and facts["date"]
    assert {row.scene for row in rows} == set(SCENES)
    assert not any(row.wrong for row in rows if row.method in ("exact", "verlet"))
    html = (folder / "report.html").read_text(encoding="utf-8")
    assert len(html.encode()) < 2_000_000
    ElementTree.fromstring(html.partition("\n")[2])


def test_sections_say_what_the_rows_say(bench: SimpleNamespace, tmp_path) -> None:  # noqa: F811
    blank = ReportRow("s", "a scene", 10, 3, 1.0, "open", "halfshell", "exact", pairs_true=1000,
                      ties=4, missed=0, spurious=0, duplicate=0, seconds=2e-3,
                      seconds_least=1e-3)  # fmt: skip
    vary = lambda **other: ReportRow(**{**vars(blank), **other})  # noqa: E731
    rows = [
        blank, vary(method="double", missed=2, seconds_least=5e-4),
        vary(kind="peer", method="fast", version="1.2", spurious=3),
        vary(kind="peer", method="slow", status="crashed", note="ended | badly", missed=None),
        vary(kind="reuse", method="by the clock", skin=0.5, rebuild_every=7, steps=64, builds=10,
             missed=6, drift_kinetic=12.0),
    ]  # fmt: skip
    report = tmp_path / "report.csv"
    with report.open("w", newline="", encoding="utf-8") as stream:
        write_csv(stream, FACTS, rows)
    page = tmp_path / "page.md"
    page.write_text((DOCS / "errors.md").read_text(encoding="utf-8"), encoding="utf-8")
    assert bench.fill_errors.main([str(report), "--page", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    for line in (
        "Others: fast 1.2.",
        "| scene | pairs | at the cutoff | exact | double | fast | slow |",
        "| `s` | 1,000 | 4 | 0 | **2** | **3** | crashed |",
        "| `s` | by the clock, skin 0.5, every 7 | 10 | 64 | 6 | 12 |",
        "* Precision 'exact' gave 1 list with 1,000 pairs in all, and every one was right.",
    ):
        assert line in text
    assert bench.marks.EMPTY not in text
