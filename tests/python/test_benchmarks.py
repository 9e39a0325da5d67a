# SPDX-License-Identifier: BSD-3-Clause
"""The benchmarks measure what they say: scenes, comparison of answers, ratios, files.

Nothing here is timed against a clock, and no other library is needed.
"""

from __future__ import annotations

import csv
import importlib
import itertools
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
MODULES = (
    "scenes", "agreement", "contestant", "peers", "measure", "machine", "report", "run",
    "stages", "footprint",
)  # fmt: skip

pytestmark = pytest.mark.skipif(not BENCHMARKS.exists(), reason="only in a checkout")

# The first digits of SHA-256 over points, cutoff, box and periodic axes.
DIGESTS = {
    "call-2": "e1ae84fa1e9e83ac",
    "clusters-1e5": "b0ada625a20bf5e8",
    "count-1e5-k419": "89b7f67896d21537",
    "count-1e5-k52": "3e7ebaaea2290d9a",
    "diamond-shell": "91069461a3b41292",
    "fcc-shell": "bdcfc5de21d8b36c",
    "fcc-tie": "a56b60b0982ccd33",
    "images-64": "286f0c9fc8dafefb",
    "molecule-30": "ecf10619ec12ac10",
    "open-1e4": "9eb8f351d6b964f9",
    "pairs-1e4-k52": "591c588ebe613318",
    "pairs-1e5-k419": "89b7f67896d21537",
    "pairs-1e5-k419-int32": "89b7f67896d21537",
    "pairs-1e5-k52": "3e7ebaaea2290d9a",
    "pairs-1e5-k52-int32": "3e7ebaaea2290d9a",
    "plane-1e5-k20": "acfd44725c8b2005",
    "silicon-8": "5be367769c9fca4a",
    "triclinic-1e4-k52": "22250674d028a6ef",
    "vectors-1e5-k52": "3e7ebaaea2290d9a",
}
LARGEST = {"growth-1e7", "growth-1e7-sorted"}


@pytest.fixture(scope="module")
def bench() -> Iterator[SimpleNamespace]:
    """The modules of benchmarks/, which is a folder of scripts and no package."""
    sys.path.insert(0, str(BENCHMARKS))
    try:
        yield SimpleNamespace(**{name: importlib.import_module(name) for name in MODULES})
    finally:
        sys.path.remove(str(BENCHMARKS))
        for name in MODULES:
            sys.modules.pop(name, None)


def count_by_brute_force(scene: Any) -> int:
    """Pairs of a small scene in float64, every image within reach."""
    rows = scene.rows
    shifts = np.zeros((1, scene.dim))
    if rows is not None:
        reach = math.ceil(scene.cutoff / np.diag(rows).min()) + 1
        shifts = np.array(list(itertools.product(range(-reach, reach + 1), repeat=scene.dim)))
    found = 0
    for shift in shifts:
        moved = scene.points if rows is None else scene.points + shift @ rows
        square = np.sum((moved[None, :] - scene.points[:, None]) ** 2, axis=-1)
        found += int(np.sum(square <= scene.cutoff**2))
    return (found - scene.n) // 2


def measurement(bench: SimpleNamespace, contestant: str, seconds: float, **other: Any) -> Any:
    """A row with made-up figures."""
    values: dict[str, Any] = {
        "scene": "pairs-1e4-k52", "contestant": contestant, "version": "1.0", "task": "pairs",
        "n": 1000, "dim": 3, "cutoff": 5.0, "quantities": "ij", "index_dtype": "int64",
        "pairs": 20_000, "repeats": 7, "calls": 1, "fresh_median": seconds,
        "fresh_min": seconds, "recycled_median": seconds / 2.0, "recycled_min": seconds / 2.0,
        "all_held": True, "complete": True, "agreement": "same",
    }  # fmt: skip
    return bench.report.Measurement(**{**values, **other})


def test_scenes_are_the_same_bits_everywhere(bench: SimpleNamespace) -> None:
    names = set(bench.scenes.SCENES) - LARGEST
    assert {name: bench.scenes.load(name).digest()[:16] for name in sorted(names)} == DIGESTS


def test_scenes_keep_their_promises(bench: SimpleNamespace) -> None:
    for name in set(bench.scenes.SCENES) - LARGEST:
        scene = bench.scenes.load(name)
        assert scene.name == name
        assert scene.points.dtype == np.float64
        assert scene.points.flags.c_contiguous
        assert len(scene.periodic) == (0 if scene.box is None else scene.dim)
        assert set(scene.peers) <= set(bench.peers.PEERS)
        assert {limit.other for limit in scene.limits} <= {*bench.scenes.SCENES, ""}
        if scene.rows is not None:
            fractions = scene.points @ np.linalg.inv(scene.rows)
            assert fractions.min() >= 0.0
            assert fractions.max() < 1.0
    assert set(bench.scenes.QUICK) <= set(bench.scenes.SCENES)
    with pytest.raises(KeyError, match="no scene 'nothing'"):
        bench.scenes.load("nothing")


def test_pair_numbers_of_small_scenes_are_those_of_brute_force(bench: SimpleNamespace) -> None:
    for name in ("call-2", "molecule-30", "images-64", "silicon-8"):
        scene = bench.scenes.load(name)
        assert count_by_brute_force(scene) == scene.n_pairs, name


@pytest.mark.parametrize(
    "name",
    ["pairs-1e5-k52", "pairs-1e5-k419", "pairs-1e4-k52", "triclinic-1e4-k52", "plane-1e5-k20"],
)
def test_pair_numbers_of_uniform_scenes_follow_from_density(
    bench: SimpleNamespace, name: str
) -> None:
    scene = bench.scenes.load(name)
    ball = {2: math.pi * scene.cutoff**2, 3: 4.0 / 3.0 * math.pi * scene.cutoff**3}[scene.dim]
    expected = scene.n * (scene.n - 1) / 2.0 * ball / abs(np.linalg.det(scene.rows))
    assert abs(scene.n_pairs - expected) < 5.0 * math.sqrt(expected)


@pytest.mark.parametrize(
    ("name", "quarters", "bases"),
    [("fcc-tie", 8, 4), ("fcc-shell", 8, 4), ("diamond-shell", 8, 8)],
)
def test_pair_numbers_of_crystals_lie_between_strict_and_inclusive(
    bench: SimpleNamespace, name: str, quarters: int, bases: int
) -> None:
    scene = bench.scenes.load(name)
    sites = np.rint(scene.points * (4.0 / scene.cutoff * quarters / 4.0)).astype(np.int64)
    length = round(float(scene.box[0]) * quarters / scene.cutoff)
    near = []
    for site in sites[:bases]:
        step = (sites - site + length // 2) % length - length // 2
        near.append(np.sum(step * step, axis=1))
    strict = scene.n * (np.sum(np.array(near) < quarters**2) - bases) // bases // 2
    inclusive = scene.n * (np.sum(np.array(near) <= quarters**2) - bases) // bases // 2
    assert strict < scene.n_pairs <= inclusive
    if name == "fcc-tie":
        assert scene.n_pairs == inclusive


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
    assert peers["MDAnalysis"].refuses(load("plane-1e5-k20")) == "2 dimensions"
    assert peers["neighborlist-rs"].refuses(load("vectors-1e5-k52")) == "quantities Dd"
    assert peers["ase"].refuses(load("pairs-1e5-k52")) == "too many pairs for its speed"
    assert peers["Corrfunc"].refuses(load("pairs-1e4-k52")) == "quantities ij"
    assert peers["vesin"].refuses(load("plane-1e5-k20")) is None


def test_turns_are_all_taken_and_results_held(bench: SimpleNamespace) -> None:
    made: list[str] = []

    def call(name: str) -> Any:
        made.append(name)
        return np.zeros(1000)

    turns = {
        "a": bench.measure.Turn(lambda: call("a"), calls=2, repeats=5),
        "b": bench.measure.Turn(lambda: call("b"), calls=1, repeats=3),
    }
    held = bench.measure.take_turns(turns, keep=True)
    assert (made.count("a"), made.count("b")) == (10, 3)
    assert [len(held[name].seconds) for name in "ab"] == [5, 3]
    assert all(timing.all_held and timing.minimum > 0.0 for timing in held.values())
    some = bench.measure.take_turns(turns, keep=True, budget=90_000, yields=("a",))
    assert (some["a"].all_held, some["b"].all_held) == (True, False)
    dropped = bench.measure.take_turns(turns, keep=False)
    assert dropped["a"].median >= dropped["a"].minimum


def test_short_calls_are_repeated_and_long_ones_are_not(bench: SimpleNamespace) -> None:
    assert bench.measure.plan_turn(lambda: None, 7, 60.0).calls > 10
    slow = bench.measure.plan_turn(lambda: bench.measure.time.sleep(0.02), 7, 0.1)
    assert slow.calls == 1
    assert 1 <= slow.repeats < 7


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
        ],
        {
            "pairs-1e4-k52": (
                limit("variant", 2.0, {"precision": "single"}),
                limit("scene", 3.0, other="other"),
                limit("growth", 1.5, other="other"),
                limit("seconds", 0.001),
                limit("floor", 3.0),
            )
        },
    )
    assert [(label, state) for _, label, _, _, state in rows] == [
        ("precision=single", "reached"), ("other", "over"), ("other", "reached"),
        ("one call", "over"),
    ]  # fmt: skip
    assert [value for _, _, value, _, _ in rows] == pytest.approx([2.0, 4.0, 1.0, 0.004])


def test_tables_print_without_the_rich_package(
    bench: SimpleNamespace, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [measurement(bench, "halfshell", 0.004), measurement(bench, "fast", 0.05)]
    bench.report.render(bench.report.table_of_contestants(rows), rich=False)
    lines = capsys.readouterr().out.splitlines()
    assert lines[2].split()[:2] == ["scene", "contestant"]
    assert "50 ms" in lines[4]
    assert "12.50" in lines[4]


def test_result_files_name_machine_kernel_commit_and_versions(
    bench: SimpleNamespace, tmp_path: Path
) -> None:
    path = tmp_path / "cpu" / "today.csv"
    rows = [measurement(bench, "halfshell", 0.004), measurement(bench, "fast", 0.05)]
    facts = bench.machine.facts("lab", "avx2")
    bench.report.write_csv(path, facts, rows, {"pairs-1e4-k52": 30.0})
    bench.report.write_csv(path, facts, rows[:1], {"pairs-1e4-k52": 30.0})
    with path.open(newline="") as file:
        read = list(csv.DictReader(file))
    assert tuple(read[0]) == bench.report.COLUMNS
    assert {"date", "machine", "cpu", "kernel", "commit", "numpy", "version"} <= set(read[0])
    assert len(read) == 3
    assert (read[1]["machine"], read[1]["kernel"]) == ("lab", "avx2")
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


def test_stage_shares_are_of_the_pairs(bench: SimpleNamespace) -> None:
    counted = {
        "pairs": 200, "candidates": 1000, "ambiguous": 20, "by_float64": 10,
        "by_double_word": 6, "by_integers": 4, "groups": 3, "bytes_peak": 4096, "bytes": {},
    }  # fmt: skip
    row = bench.stages.shares("fcc-tie", counted)
    assert tuple(sorted(row)) == tuple(sorted(bench.stages.COLUMNS))
    assert (row["candidates_per_pair"], row["ambiguous"]) == (5.0, 0.1)
    assert (row["by_float64"], row["by_integers"]) == (0.05, 0.02)


def test_memory_allowance_depends_on_the_box(bench: SimpleNamespace) -> None:
    assert bench.footprint.allowance(bench.scenes.load("open-1e4")) == 8_480_000
    assert bench.footprint.allowance(bench.scenes.load("triclinic-1e4-k52")) == 8_720_000
