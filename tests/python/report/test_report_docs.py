# SPDX-License-Identifier: BSD-3-Clause
"""docs/errors.md and docs/report: made from two committed reports, by benchmarks/fill_errors.py."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import SimpleNamespace

import pytest

from benchmark_modules import bench, only_in_a_checkout  # noqa: F401
from checkout import BENCHMARKS
from halfshell_report.rows import read_csv
from halfshell_report.run import SCENES

pytestmark = only_in_a_checkout
DOCS = BENCHMARKS.parent / "docs"
REPORT, FULL = DOCS / "report", DOCS / "report" / "full"


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
