# SPDX-License-Identifier: BSD-3-Clause
# ruff: noqa: F811 - `bench` is a fixture
"""The twins that hard scenes are timed against, and the table and file of that command."""

from __future__ import annotations

import csv
from pathlib import Path
from types import SimpleNamespace

import pytest

import halfshell as hs
from benchmark_modules import bench, only_in_a_checkout  # noqa: F401
from halfshell_report import scenes

pytestmark = [pytest.mark.slow, only_in_a_checkout]


@pytest.mark.parametrize(
    "name",
    ["uniform", "plane-2d", "space-5d", "offset-1e15", "needle", "float32-ulp", "plummer",
     "cutoff-30", "coincident", "few-cells", "droplet"],
)  # fmt: skip
def test_a_twin_has_as_many_points_and_about_as_many_pairs(
    bench: SimpleNamespace, name: str
) -> None:  # fmt: skip
    scene = scenes.load(name, "quick")
    pairs = hs.count_pairs(**scene.arguments)
    other = bench.extreme.twin(scene, pairs)
    assert other["points"].shape == scene.points.shape
    assert other["points"].dtype == scene.points.dtype
    assert (other["box"] is not None) == any(scene.periodic)
    assert hs.count_pairs(**other) == pytest.approx(pairs, rel=0.02, abs=10)


@pytest.mark.parametrize("name", ["cutoff-zero", "stiff-chain", "coincident"])
def test_no_pair_and_all_pairs_have_twins_too(bench: SimpleNamespace, name: str) -> None:
    scene = scenes.load(name, "small")
    n = scene.n_points
    assert hs.count_pairs(**bench.extreme.twin(scene, 0)) <= 10
    if not any(scene.periodic):
        assert hs.count_pairs(**bench.extreme.twin(scene, n * (n - 1) // 2)) == n * (n - 1) // 2


def test_moving_scenes_are_searched_with_their_skin(bench: SimpleNamespace) -> None:
    scene = scenes.load("head-on", "small")
    assert bench.extreme.arguments(scene)["cutoff"] == scene.cutoff + scene.motion.skin
    assert bench.extreme.arguments(scenes.load("uniform", "small"))["cutoff"] == 5.0


def test_the_command_prints_a_table_and_writes_a_file(
    bench: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(bench.extreme, "pin_to_cores", lambda cores: False)
    output = tmp_path / "extreme.csv"
    options = ["--size", "small", "--repeats", "1", "--output", str(output)]
    assert bench.extreme.main(["needle", "head-on", *options]) == 0
    with output.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["scene"] for row in rows] == ["needle", "head-on"]
    assert [row["size"] for row in rows] == ["small", "small"]
    for row in rows:
        assert set(bench.extreme.COLUMNS) <= set(row)
        assert int(row["repeats"]) == 5
        ratio = float(row["ns_a_point"]) / float(row["twin_ns_a_point"])
        assert float(row["ratio"]) == pytest.approx(ratio, rel=0.01, abs=0.01)
    table = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in table[1:3]] == ["needle", "head-on"]
