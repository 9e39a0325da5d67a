# SPDX-License-Identifier: BSD-3-Clause
# ruff: noqa: F811 - `bench` is a fixture
"""The benchmarks measure what they say: comparison of answers, turns, ratios, files.

Nothing here is timed against a clock, and no other library is needed.
"""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmark_modules import bench, measurement, only_in_a_checkout  # noqa: F401

pytestmark = [pytest.mark.slow, only_in_a_checkout]


def test_keys_do_not_depend_on_the_form_of_a_list(bench: SimpleNamespace) -> None:
    scene = bench.scenes.load("images-64")
    i, j = np.array([0, 3, 5]), np.array([2, 1, 5])
    shift = np.array([[0, 1, 0], [0, 0, -1], [0, -1, 2]])
    half = bench.agreement.half_keys(scene, i, j, shift)
    again = bench.agreement.half_keys(scene, j[::-1], i[::-1].astype(np.uint32), -shift[::-1])
    full = bench.agreement.half_keys(
        scene, np.append(i, j), np.append(j, i), np.concatenate([shift, -shift]), full=True
    )
    assert np.array_equal(half, again)
    assert np.array_equal(half, full)


def test_differences_are_counted_and_judged(bench: SimpleNamespace) -> None:
    scene = bench.scenes.load("molecule-30")
    square = np.sum((scene.points[None] - scene.points[:, None]) ** 2, axis=-1)
    i, j = np.nonzero(np.triu(square <= scene.cutoff**2, 1))
    far = np.argwhere(np.triu(square > scene.cutoff**2, 1))[0]
    ours = bench.agreement.half_keys(scene, i, j)
    theirs = bench.agreement.half_keys(
        scene, np.append(i[2:], [i[4], far[0]]), np.append(j[2:], [j[4], far[1]])
    )
    verdict = bench.agreement.compare(scene, ours, theirs, True, 1e-12, False)
    assert (verdict.missed, verdict.spurious, verdict.duplicate) == (2, 1, 1)
    assert (verdict.judged, verdict.ours_wrong, verdict.beyond) == (3, 0, 3)
    assert not verdict.complete
    assert str(verdict) == "2 missed, 1 spurious, 1 duplicate, 3 beyond rounding"
    swapped = bench.agreement.compare(scene, theirs, ours, True, 1e-12, False)
    assert swapped.ours_wrong == 3
    assert str(bench.agreement.compare(scene, ours, ours, True, 0.0, False)) == "same"


def test_a_tie_is_judged_by_its_rule(bench: SimpleNamespace) -> None:
    scene = bench.scenes.load("fcc-tie")
    nearest = int(np.flatnonzero((scene.points == [0.0, 0.0, 48.0]).all(axis=1))[0])
    assert bench.agreement.is_pair(scene, 0, nearest, None, True) == (True, 0.0)
    assert bench.agreement.is_pair(scene, 0, nearest, (0, 0, -1), False) == (False, 0.0)


def test_adapters_refuse_what_they_cannot_do(bench: SimpleNamespace) -> None:
    peers = bench.peers.PEERS
    load = bench.scenes.load
    assert peers["cKDTree"].refuses(load("triclinic-1e4-k52")) == "triclinic box"
    assert peers["freud"].refuses(load("silicon-8")) == "several images of one pair"
    assert peers["pymatgen"].refuses(load("open-1e4")) == "open space"
    assert peers["linkcell"].refuses(load("vectors-1e5-k52")) == "quantities Dd"
    assert peers["MDAnalysis"].refuses(load("plane-1e5-k20")) == "2 dimensions"
    assert peers["neighborlist-rs"].refuses(load("vectors-1e5-k52")) == "quantities Dd"
    assert peers["ase"].refuses(load("pairs-1e5-k52")) == "too many pairs for its speed"
    assert peers["Corrfunc"].refuses(load("pairs-1e4-k52")) == "quantities ij"
    assert peers["vesin"].refuses(load("plane-1e5-k20")) is None


def test_ratios_are_peer_over_ours_for_the_fastest_complete_peer(bench: SimpleNamespace) -> None:
    rows = bench.report.ratio_rows(
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
    title, head, body = bench.report.table_of_ratios(rows)
    assert len(body[0]) == len(head)
    assert body[0][5:] == ["25.0", "25.0", "30", "short"]
    assert "fastest peer" in title


def test_limits_compare_as_a_whole_by_pair_or_by_point(bench: SimpleNamespace) -> None:
    limit = bench.scenes.Limit
    rows = bench.report.limit_rows(
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
    bench.report.write_csv(path, facts, rows, {"pairs-1e4-k52": 30.0})
    bench.report.write_csv(path, facts, rows[:1], {"pairs-1e4-k52": 30.0})
    with path.open(newline="") as file:
        read = list(csv.DictReader(file))
    assert tuple(read[0]) == bench.report.COLUMNS
    assert {"date", "machine", "cpu", "kernel", "commit", "numpy", "version"} <= set(read[0])
    assert len(read) == 3
    assert (read[1]["machine"], read[1]["kernel"]) == ("lab", "avx2")
    assert (read[0]["compiler"], read[0]["call_median"], read[0]["systems"]) == ("gcc 1", "", "1")
    assert (read[1]["ratio_fresh"], read[1]["ns_per_pair"], read[1]["want"]) == (
        "12.5", "2500", "30.0",
    )  # fmt: skip


def test_runner_starts_with_nothing_installed(
    bench: SimpleNamespace, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench.run, "pin_threads", lambda: None)
    monkeypatch.setattr(bench.machine, "touch_memory", lambda n_bytes: None)
    assert bench.run.main(["--quick", "--without-halfshell", "--peers", "--no-pin"]) == 0
    assert "silicon-8: a unit cell" in capsys.readouterr().out


def test_result_files_of_other_columns_are_left_alone(
    bench: SimpleNamespace, tmp_path: Path
) -> None:
    path = tmp_path / "old.csv"
    path.write_text("scene,time\n")
    with pytest.raises(ValueError, match="other columns"):
        bench.report.write_csv(path, {}, [measurement(bench, "halfshell", 0.1)], {})
    assert path.read_text() == "scene,time\n"


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


def test_a_library_without_memory_is_left_out(
    bench: SimpleNamespace, capsys: pytest.CaptureFixture[str]
) -> None:
    class Greedy(bench.contestant.Halfshell):
        name = "cKDTree"

        def prepare(self, scene: Any) -> Any:
            raise MemoryError

    scene = bench.scenes.load("molecule-30")
    patience = bench.runner.Patience(repeats=1, seconds=0.01, quick=True)
    rows, correct = bench.runner.measure_scene(
        scene, bench.contestant.Halfshell(), [Greedy()], patience
    )
    assert correct and "cKDTree" not in {row.contestant for row in rows}
    assert "without cKDTree: it asked for more memory" in capsys.readouterr().out


class Strict:
    """A library without batches: pairs of an open system, from brute force, full lists."""

    def __new__(cls, bench: SimpleNamespace) -> Any:
        class Library(bench.contestant.Contestant):
            name = distribution = module = "numpy"
            full = True
            quantities = "ijS"

            def prepare(self, scene: Any) -> Any:
                def search() -> Any:
                    steps = scene.points[None] - scene.points[:, None]
                    near = np.sum(steps**2, axis=-1) < scene.cutoff**2
                    np.fill_diagonal(near, False)
                    return np.nonzero(near)

                return search

        return Library()


def test_a_library_without_batches_is_called_for_each_system(bench: SimpleNamespace) -> None:
    whole = bench.scenes.load("batch-30")
    scene = replace(whole, points=whole.points[:90], batch=whole.batch[:90], n_pairs=None)
    looped = Strict(bench).for_batch()
    assert looped.refuses(scene) is None
    result = looped.prepare(scene)()
    keys = looped.keys(scene, result)
    i, j = np.divmod(keys, scene.n)
    assert len(result) == 3
    assert len(keys) == looped.count(scene, result)
    assert np.array_equal(i // 30, j // 30)
    assert set(i // 30) == {0, 1, 2}
    square = np.sum((scene.points[i] - scene.points[j]) ** 2, axis=-1)
    assert square.max() < scene.cutoff**2
    assert bench.agreement.compare(scene, keys, keys[1:], False, 1e-12, False).missed == 1
    periodic = bench.scenes.load("batch-1e4-periodic")
    assert (
        bench.peers.PEERS["cKDTree"].for_batch().refuses(periodic) == "several images of one pair"
    )
    assert bench.peers.PEERS["neighborlist-rs"].for_batch().name == "neighborlist-rs"


def test_pairs_of_a_batch_are_judged_in_the_box_of_their_system(bench: SimpleNamespace) -> None:
    scene = bench.scenes.Scene(
        "two", "", np.array([[0.0, 0, 0], [4, 0, 0], [0, 0, 0], [4, 0, 0]]), 1.0,
        np.array([np.eye(3) * 5.0, np.eye(3) * 9.0]), (True,) * 3,
        batch=np.array([0, 0, 1, 1]),
    )  # fmt: skip
    assert bench.agreement.is_pair(scene, 0, 1, (-1, 0, 0), True) == (True, 0.0)
    assert not bench.agreement.is_pair(scene, 2, 3, (-1, 0, 0), True)[0]
    assert not bench.agreement.is_pair(scene, 2, 3, None, True)[0]


def test_options_are_keywords_or_set_around_the_call(bench: SimpleNamespace) -> None:
    scene = bench.scenes.load("threads-pairs-1e5-k52")
    assert bench.contestant.Halfshell().prepare(scene).keywords["threads"] == 2
    assert bench.contestant.Halfshell({"threads": 1}).prepare(scene).keywords["threads"] == 1
    single = bench.contestant.Halfshell({"precision": "single"}).prepare(scene)
    assert single.func.__name__ == "run" and "precision" not in single.keywords


def test_groups_choose_scenes(bench: SimpleNamespace, capsys: pytest.CaptureFixture[str]) -> None:
    parse = bench.run._parse
    assert parse([]).scenes == bench.scenes.GROUPS["main"]
    assert parse(["--quick"]).scenes == list(bench.scenes.QUICK)
    assert parse(["--group", "S7", "--scenes", "plane-1e5-k8", "call-2"]).scenes == [
        "plane-1e5-k8", "plane-1e5-k30", "call-2",
    ]  # fmt: skip
    assert set(parse(["--group", "all"]).scenes) == set(bench.scenes.SCENES)
    assert bench.run.main(["--list"]) == 0
    assert "S13: input order" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        parse(["--group", "S99"])


def test_nearest_points_are_compared_by_their_distances(bench: SimpleNamespace) -> None:
    scene = bench.scenes.Scene(
        "row", "", np.array([[0.0], [1.0], [3.0], [7.0]]), 0.0, task="nearest", nearest=1,
    )  # fmt: skip
    ours = np.array([[1.0], [1.0], [2.0], [4.0]]), np.array([[1], [0], [1], [2]])
    assert bench.agreement.compare_nearest(scene, ours, ours, 53).complete
    d = ours[0] + [[1e-16], [1e-9], [0.0], [-1.0]]
    verdict = bench.agreement.compare_nearest(scene, ours, (d, ours[1]), 53)
    assert (verdict.missed, verdict.spurious, verdict.ours_wrong) == (1, 1, 0)
    assert not verdict.complete
    assert bench.agreement.compare_nearest(scene, ours, (d, ours[1]), 24).missed == 0
    far = np.array([[3.0], [1.0], [2.0], [4.0]]), np.array([[2], [0], [1], [2]])
    assert bench.agreement.compare_nearest(scene, far, ours, 53).ours_wrong == 1
