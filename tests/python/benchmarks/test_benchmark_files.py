# SPDX-License-Identifier: BSD-3-Clause
# ruff: noqa: F811 - `bench` is a fixture
"""What is made from result files: comparison of two, figures, the page of figures."""

from __future__ import annotations

import xml.etree.ElementTree as ET
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
    read = bench.results.read_csv(path)
    assert [row.one for row in read] == rows
    assert (read[0].kernel, read[0].facts["machine"], read[0].facts["want"]) == (
        "avx2", "lab", "25.0",
    )  # fmt: skip


def test_a_result_file_that_is_none_is_named(bench: SimpleNamespace, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("scene,n\ncall-2,2\n")
    with pytest.raises(ValueError, match=r"a\.csv, line 2: no column contestant"):
        bench.results.read_csv(path)
    write_results(bench, tmp_path / "b.csv", [measurement(bench, "halfshell", 0.004)])
    text = (tmp_path / "b.csv").read_text().replace(",1000,", ",many,")
    path.write_text(text)
    with pytest.raises(ValueError, match=r"line 2: .*'many'"):
        bench.results.read_csv(path)


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


def test_drift_is_the_median_of_libraries_of_the_same_version(
    bench: SimpleNamespace, tmp_path: Path
) -> None:
    def rows(ours: float, *peers: tuple[str, float, str]) -> list[Any]:
        all_rows = [measurement(bench, "halfshell", ours)]
        all_rows += [measurement(bench, name, s, version=v) for name, s, v in peers]
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.csv"
        return list(bench.results.read_csv(write_results(bench, path, all_rows)))

    old = rows(0.1, ("a", 1.0, "1"), ("b", 1.0, "1"), ("c", 1.0, "1"), ("d", 1.0, "1"))
    new = rows(0.2, ("a", 2.0, "1"), ("b", 1.9, "1"), ("c", 9.0, "1"), ("d", 0.1, "2"))
    fresh, recycled = bench.compare.changes(old, new)
    assert (fresh.mode, recycled.mode) == ("fresh", "recycled")
    assert fresh.drift == pytest.approx(2.0)
    assert fresh.ratio == pytest.approx(1.0)
    alone = bench.compare.changes(rows(0.1), rows(0.12))[0]
    assert alone.drift is None
    assert alone.ratio == pytest.approx(1.2)


def test_repeated_runs_in_one_file_count_as_their_fastest(
    bench: SimpleNamespace, tmp_path: Path
) -> None:
    rows = [measurement(bench, "halfshell", seconds) for seconds in (0.3, 0.1, 0.2)]
    read = bench.results.read_csv(write_results(bench, tmp_path / "a.csv", rows))
    assert bench.compare.changes(read, read)[0].old == pytest.approx(0.1)


def test_nothing_in_common_is_no_success(
    bench: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = rows_of(bench, 0.1, 1.0), rows_of(bench, 0.1, 1.0, scene="call-2")
    assert compare(bench, tmp_path, old, new) == 2
    said = capsys.readouterr().out
    assert "only in OLD: pairs-1e4-k52" in said
    assert "only in NEW: call-2" in said
    assert bench.compare.main([str(tmp_path / "old.csv"), str(tmp_path / "none.csv")]) == 2
    # Another kernel is another program.
    other = write_results(bench, tmp_path / "scalar.csv", old, kernel="scalar")
    assert bench.compare.main([str(tmp_path / "old.csv"), str(other), "--plain"]) == 2


def family(bench: SimpleNamespace) -> list[Any]:
    """Rows of group S1 with made-up times."""
    rows = []
    for size in ("1e3", "1e4", "1e5"):
        for neighbours in (6, 50, 400):
            n = int(float(size))
            other = {"scene": f"uniform-{size}-k{neighbours}", "n": n, "pairs": n * neighbours // 2}
            pairs = float(n * neighbours // 2)
            rows += [
                measurement(bench, "halfshell", 3e-9 * pairs, **other),
                measurement(bench, "halfshell [writing the output]", 1e-9 * pairs, **other),
                measurement(bench, "halfshell [rewriting the output]", 8e-10 * pairs, **other),
                measurement(bench, "slow", 9e-8 * pairs, **other),
                measurement(bench, "fast", 6e-8 * pairs, **other),
                measurement(bench, "wrong", 1e-8 * pairs, complete=False, **other),
            ]
    return rows


def test_lines_of_a_figure_are_ours_the_best_other_and_the_write_limit(
    bench: SimpleNamespace, tmp_path: Path
) -> None:
    path = write_results(bench, tmp_path / "a.csv", family(bench))
    write_results(bench, path, family(bench)[:1], kernel="scalar")
    rows = bench.results.read_csv(path)
    lines = bench.plot.series(rows, "fresh", "k", 100_000)
    assert list(lines["halfshell, avx2"]) == [6.0, 50.0, 400.0]
    assert lines["halfshell, avx2"][50.0] == pytest.approx(3.0)
    assert lines["fastest other library"][50.0] == pytest.approx(60.0)
    assert lines["write limit"][50.0] == pytest.approx(1.0)
    recycled = bench.plot.series(rows, "recycled", "n", 6)
    assert list(recycled) == [
        "halfshell, avx2", "write limit", "fastest other library", "halfshell, scalar",
    ]  # fmt: skip
    assert recycled["write limit"][1e3] == pytest.approx(0.4)
    assert list(recycled["halfshell, scalar"]) == [1e3]


def test_figures_are_drawn_and_the_same_each_time(
    bench: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    path = write_results(bench, tmp_path / "a.csv", family(bench))
    drawn = []
    for folder in ("one", "two"):
        assert bench.plot.main([str(path), "-o", str(tmp_path / folder)]) == 0
        drawn.append((tmp_path / folder / "ns-per-pair-fresh.svg").read_text())
    assert drawn[0] == drawn[1]
    assert ET.fromstring(drawn[0]).tag.endswith("svg")
    assert len(drawn[0]) < 200_000
    assert (tmp_path / "one" / "ns-per-pair-recycled.svg").exists()
    other = write_results(bench, tmp_path / "b.csv", rows_of(bench, 0.1, 1.0))
    assert bench.plot.main([str(other), "-o", str(tmp_path)]) == 2
    assert "no rows of group S1" in capsys.readouterr().err


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


def test_reproducing_runs_every_group_and_fills_the_page(
    bench: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    commands = bench.reproduce.commands(tmp_path / "day", ("avx512", "avx2"), 5.0)
    assert [command[0] for command in commands] == [
        "run.py", "run.py", "run.py", "footprint.py", "stages.py", "plot.py", "fill_docs.py",
    ]  # fmt: skip
    asked = [bench.run._parse(command[1:]) for command in commands[:3]]
    assert {name for one in asked for name in one.scenes} == set(bench.scenes.SCENES)
    assert (asked[2].kernel, asked[2].peers) == ("avx2", [])
    stem = bench.reproduce.result_stem(tmp_path)
    stem.parent.mkdir()
    Path(f"{stem}.csv").touch()
    assert bench.reproduce.result_stem(tmp_path).name == f"{stem.name}-2"
    assert bench.reproduce.main(["--dry-run", "--results", str(tmp_path)]) == 0
    assert capsys.readouterr().out.count("$ python benchmarks/") >= 6
