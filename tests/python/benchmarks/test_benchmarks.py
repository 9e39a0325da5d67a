# SPDX-License-Identifier: BSD-3-Clause
# ruff: noqa: F811 - `bench` is a fixture
"""The benchmarks measure what they say: comparison of answers, turns, ratios, files.

Nothing here is timed against a clock, and no other library is needed.
"""

from __future__ import annotations

import csv
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmark_modules import bench, measurement, only_in_a_checkout  # noqa: F401
from checkout import BENCHMARKS

pytestmark = [pytest.mark.slow, only_in_a_checkout]


def test_keys_do_not_depend_on_the_form_of_a_list(bench: SimpleNamespace) -> None:
    i, j = np.array([0, 3, 5]), np.array([2, 1, 5])
    shift = np.array([[0, 1, 0], [0, 0, -1], [0, -1, 2]])
    half = bench.agreement.half_rows(i, j, shift)
    again = bench.agreement.half_rows(j[::-1], i[::-1].astype(np.uint32), -shift[::-1])
    full = bench.agreement.half_rows(
        np.append(i, j), np.append(j, i), np.concatenate([shift, -shift]), full=True
    )
    assert np.array_equal(half, again)
    assert np.array_equal(half, full)


def test_differences_are_counted_and_judged(bench: SimpleNamespace) -> None:
    scene = bench.scenes.load("molecule-30")
    square = np.sum((scene.points[None] - scene.points[:, None]) ** 2, axis=-1)
    i, j = np.nonzero(np.triu(square <= scene.cutoff**2, 1))
    far = np.argwhere(np.triu(square > scene.cutoff**2, 1))[0]
    ours = bench.agreement.half_rows(i, j)
    theirs = bench.agreement.half_rows(
        np.append(i[2:], [i[4], far[0]]), np.append(j[2:], [j[4], far[1]])
    )
    verdict = bench.agreement.compare(scene, ours, theirs, True, 1e-12)
    assert (verdict.missed, verdict.spurious, verdict.duplicate) == (2, 1, 1)
    assert (verdict.judged, verdict.ours_wrong, verdict.beyond) == (3, 0, 3)
    assert not verdict.complete
    assert str(verdict) == "2 missed, 1 spurious, 1 duplicate, 3 beyond rounding"
    swapped = bench.agreement.compare(scene, theirs, ours, True, 1e-12)
    assert swapped.ours_wrong == 3
    assert str(bench.agreement.compare(scene, ours, ours, True, 0.0)) == "same"


def test_ratios_are_peer_over_ours_for_the_fastest_complete_peer(bench: SimpleNamespace) -> None:
    rows = bench.pages.ratio_rows(
        [
            measurement(bench, "halfshell", 0.002),
            measurement(bench, "halfshell [precision=single]", 0.001),
            measurement(bench, "slow", 0.1),
            measurement(bench, "fast", 0.05),
            measurement(bench, "incomplete", 0.001, complete=False),
            measurement(bench, "halfshell", 0.002, scene="call-2"),
        ],
        {"pairs-1e4-k52": 30.0, "call-2": None},
    )
    assert len(rows) == 1
    assert rows[0].peer.contestant == "fast"
    assert (rows[0].fresh, rows[0].recycled) == pytest.approx((25.0, 25.0))
    assert rows[0].state == "short"
    title, head, body = bench.pages.table_of_ratios(rows)
    assert len(body[0]) == len(head)
    assert body[0][5:] == ["25.0", "25.0", "30", "short"]
    assert "fastest peer" in title


def test_limits_compare_as_a_whole_by_pair_or_by_point(bench: SimpleNamespace) -> None:
    limit = bench.scenes.Limit
    rows = bench.pages.limit_rows(
        [
            measurement(bench, "halfshell", 0.004),
            measurement(bench, "halfshell [precision=single]", 0.002),
            measurement(bench, "halfshell [other]", 0.002, pairs=40_000, n=500),
            measurement(bench, "halfshell [rewriting the output]", 0.1, recycled_median=0.0005),
        ],
        {
            "pairs-1e4-k52": (
                limit("variant", 2.0, {"precision": "single"}),
                limit("scene", 3.0, other="other"),
                limit("growth", 1.5, other="other"),
                limit("seconds", 0.001),
                limit("floor", 3.0),
                limit("rewrite", None),
            )
        },
    )
    assert [(label, state) for _, label, _, _, state in rows] == [
        ("precision=single", "reached"), ("other", "over"), ("other", "reached"),
        ("one call", "over"), ("rewriting the output", ""),
    ]  # fmt: skip
    assert [value for _, _, value, _, _ in rows] == pytest.approx([2.0, 4.0, 1.0, 0.004, 4.0])


def test_result_files_name_machine_kernel_commit_and_versions(
    bench: SimpleNamespace, tmp_path: Path
) -> None:
    path = tmp_path / "cpu" / "today.csv"
    rows = [measurement(bench, "halfshell", 0.004), measurement(bench, "fast", 0.05)]
    facts = bench.machine.facts("lab", "avx2", "gcc 1")
    bench.pages.write_csv(path, facts, rows, {"pairs-1e4-k52": 30.0})
    bench.pages.write_csv(path, facts, rows[:1], {"pairs-1e4-k52": 30.0})
    with path.open(newline="") as file:
        read = list(csv.DictReader(file))
    assert tuple(read[0]) == bench.pages.COLUMNS
    assert {"date", "machine", "cpu", "kernel", "commit", "numpy", "version"} <= set(read[0])
    assert len(read) == 3
    assert (read[1]["machine"], read[1]["kernel"]) == ("lab", "avx2")
    assert (read[0]["compiler"], read[0]["call_median"], read[0]["systems"]) == ("gcc 1", "", "1")
    assert (read[1]["ratio_fresh"], read[1]["ns_per_pair"], read[1]["want"]) == (
        "12.5", "2500", "30.0",
    )  # fmt: skip


def test_a_scene_is_measured_with_its_limits_and_single_calls(
    bench: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench.turns, "touch_memory", lambda n_bytes: None)
    scene = replace(
        bench.scenes.load("single-30"),
        limits=(
            bench.scenes.Limit("floor", 3.0),
            bench.scenes.Limit("rewrite", None),
            bench.scenes.Limit("variant", 1.1, {"precision": "single"}),
        ),
    )
    patience = bench.runner.Patience(repeats=2, seconds=0.05, quick=True)
    rows, correct = bench.runner.measure_scene(scene, bench.contestant.Halfshell(), [], patience)
    assert correct
    assert [row.contestant for row in rows] == [
        "halfshell", "halfshell [writing the output]", "halfshell [rewriting the output]",
        "halfshell [precision=single]",
    ]  # fmt: skip
    assert all(row.scene == "single-30" and row.pairs == scene.n_pairs for row in rows)
    assert rows[0].call_p99 >= rows[0].call_median > 0.0
    assert rows[1].call_median is None
    wrong = replace(scene, n_pairs=scene.n_pairs + 1)
    assert not bench.runner.measure_scene(wrong, bench.contestant.Halfshell(), [], patience)[1]
    patience = bench.runner.Patience(largest=10)
    rows, correct = bench.runner.measure_scene(scene, bench.contestant.Halfshell(), [], patience)
    assert (rows, correct) == ([], True)


def test_the_benchmark_of_drop_ins_compares_equal_lists() -> None:
    pytest.importorskip("ase")
    command = [sys.executable, str(BENCHMARKS / "drop_ins.py"), "--points", "300", "--turns", "1"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "ase.NeighborList" in done.stdout
    few = ["--points", "1", "30", "--queries", "3", "--open", "--only", "KDTree"]
    done = subprocess.run([*command, *few], capture_output=True, text=True)
    assert done.returncode == 0 and "30 points, 3 queries" in done.stdout, done.stderr
    assert "KDTree.query_pairs" in done.stdout and "ase" not in done.stdout
