# SPDX-License-Identifier: BSD-3-Clause
# ruff: noqa: F811 - `bench` is a fixture
"""What is made from result files: comparison of two, figures, the page of figures."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from benchmark_modules import (  # noqa: F401
    bench,
    measurement,
    only_in_a_checkout,
    write_results,
)

pytestmark = [pytest.mark.slow, only_in_a_checkout]


def rows_of(bench: SimpleNamespace, ours: float, peer: float, **other: Any) -> list[Any]:
    """Us, a variant, the write limit and one library."""
    return [
        measurement(bench, "halfshell", ours, **other),
        measurement(bench, "halfshell [precision=single]", ours / 1.1, **other),
        measurement(bench, "halfshell [writing the output]", 1e-4, **other),
        measurement(bench, "fast", peer, **other),
    ]


def test_a_result_file_reads_back_as_it_was(bench: SimpleNamespace, tmp_path: Path) -> None:
    rows = [
        measurement(bench, "halfshell", 0.004, call_median=1e-6, call_p99=2e-6, all_held=False),
        measurement(bench, "fast", 0.05, systems=3, threads=2, complete=False),
    ]
    path = write_results(bench, tmp_path / "a.csv", rows)
    read = bench.pages.read_csv(path)
    assert [row.one for row in read] == rows
    assert (read[0].kernel, read[0].facts["machine"], read[0].facts["want"]) == (
        "avx2", "lab", "25.0",
    )  # fmt: skip


def compare(bench: SimpleNamespace, folder: Path, old: list[Any], new: list[Any],
            *options: str) -> int:  # fmt: skip
    """Write two files and compare them."""
    for name in ("old.csv", "new.csv"):
        (folder / name).unlink(missing_ok=True)
    before = write_results(bench, folder / "old.csv", old)
    after = write_results(bench, folder / "new.csv", new)
    return int(bench.compare.main([str(before), str(after), "--plain", *options]))


def test_a_slower_search_is_a_regression_and_a_slower_machine_is_none(
    bench: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old = rows_of(bench, 0.002, 0.05)
    assert compare(bench, tmp_path, old, old) == 0
    assert compare(bench, tmp_path, old, rows_of(bench, 0.004, 0.1)) == 0
    capsys.readouterr()
    assert compare(bench, tmp_path, old, rows_of(bench, 0.0024, 0.05)) == 1
    said = capsys.readouterr().out
    assert said.count("SLOWER") == 4
    assert "writing" not in said
    assert "4 times compared, 4 slower by more than 10%" in said
    assert compare(bench, tmp_path, old, rows_of(bench, 0.0024, 0.05), "--threshold", "0.3") == 0
    # As slow as before while the others became faster.
    assert compare(bench, tmp_path, old, rows_of(bench, 0.002, 0.04)) == 1


def test_the_page_has_marks_for_every_section_and_is_filled_between_them(
    bench: SimpleNamespace, tmp_path: Path
) -> None:
    page = bench.fill_docs._PAGE.read_text()
    names = [*bench.fill_docs.SECTIONS, "memory", "stages"]
    empty = bench.fill_docs.fill(page, {name: [] for name in names})
    assert empty.count(bench.fill_docs.EMPTY) == len(names)
    filled = bench.fill_docs.fill(empty, {"growth": ["| a |", "| --- |"]})
    assert "<!-- begin: growth -->\n| a |\n| --- |\n<!-- end: growth -->" in filled
    assert filled.replace("| a |\n| --- |", bench.fill_docs.EMPTY) == empty
    with pytest.raises(ValueError, match="no marks of the section nothing"):
        bench.fill_docs.fill(page, {"nothing": []})


def test_sections_say_what_the_result_files_say(bench: SimpleNamespace, tmp_path: Path) -> None:
    rows = rows_of(bench, 0.002, 0.06, n=10_000)
    for name, seconds, n in (("growth-1e5", 0.01, 100_000), ("growth-1e7", 1.4, 10_000_000)):
        rows.append(measurement(bench, "halfshell", seconds, scene=name, n=n))
    rows.append(measurement(bench, "halfshell [growth-1e5]", 0.01, scene="growth-1e7", n=100_000))
    rows.append(measurement(bench, "halfshell", 0.06, scene="threads-pairs-1e5-k52"))
    rows.append(measurement(bench, "halfshell [threads=1]", 0.09, scene="threads-pairs-1e5-k52"))
    for name, seconds in (("halfshell", 1e-6), ("fast", 2e-6)):
        single = {"call_median": seconds, "call_p99": 3.0 * seconds}
        rows.append(measurement(bench, name, seconds, scene="single-10", n=10, **single))
    path = write_results(bench, tmp_path / "a.csv", rows)
    write_results(bench, path, rows_of(bench, 1.0, 2.0), kernel="scalar")
    memory = tmp_path / "memory.csv"
    memory.write_text(
        "scene,quantities,n,output,beyond,allowed\ngrowth-1e4,ij,10000,2000000,600000,8480000\n"
    )
    page = tmp_path / "page.md"
    page.write_text(bench.fill_docs._PAGE.read_text())
    arguments = ["--results", str(path), "--memory", str(memory), "--page", str(page)]
    assert bench.fill_docs.main(arguments) == 0
    text = page.read_text()
    for line in (
        "| `pairs-1e4-k52` | 2 ms | 100.00 | fast, 60 ms | 30.0 | 30.0 |",
        "| `pairs-1e4-k52` | precision=single | 1.100 | 1.03 |",
        "| 1e7 | random | 1.4 s | 140 | 1.40 |",
        "| `threads-pairs-1e5-k52` | 1.50 |",
        "| `single-10` | 10 | 1 us | 3 us | 2 us | 6 us | fast |",
        "| `growth-1e4` | ij | 2.0 MB | 0.6 MB | 60 | 8.5 MB |",
        "fast 1.0.",
    ):
        assert line in text
    assert "kernel avx2" in text
    assert f"<!-- begin: stages -->\n{bench.fill_docs.EMPTY}\n" in text
    assert bench.fill_docs.main(["--page", str(page)]) == 0
    left = page.read_text().partition("## Single calls")[2]
    assert not any(found in left for found in ("| fast |", "fast, ", "fast 1.0"))
