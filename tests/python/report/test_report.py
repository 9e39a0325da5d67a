# SPDX-License-Identifier: BSD-3-Clause
"""The report as a whole: right on every scene, rows that say so, CSV, times."""

import csv
import io
import math
import re
from dataclasses import replace

import pytest

import halfshell as hs
from halfshell import scenes
from halfshell._check.reference import reference_pairs
from halfshell._report.measure.facts import machine_facts
from halfshell._report.measure.timing import Patience, take_turns
from halfshell._report.page.rows import STATUSES, ReportRow, read_csv, write_csv
from halfshell._report.truth.pairs import true_pairs
from oracles import remembered

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def rows():
    """Two scenes, one of which moves, by every method of ours and SciPy's tree."""
    return hs.report(["near-ties", "head-on"], peers=["cKDTree"], size="small")


# ---- the truth and our own search on every scene -------------------------------------------


@pytest.mark.parametrize("name", scenes.names())
def test_the_truth_is_that_of_rational_brute_force_on_every_scene(name):
    scene = scenes.load(name, "small")
    periodic = scene.periodic if scene.box is not None else None
    truth = true_pairs(scene.points, scene.cutoff, scene.box, periodic)
    # In the form in which other tests ask too, so that it is worked out once.
    expected = remembered(
        reference_pairs, scene.points, scene.cutoff, scene.box, scene.periodic, scene.inclusive
    )
    pairs = truth.by_rule(scene.inclusive)
    found = zip(pairs.i.tolist(), pairs.j.tolist(), map(tuple, pairs.S.tolist()))
    assert sorted(found) == expected


def test_exact_is_right_on_every_scene_and_rounding_is_not():
    rows = hs.report(methods=["exact", "double", "single"], size="small")
    assert list(dict.fromkeys(row.scene for row in rows)) == list(scenes.names())
    assert {row.status for row in rows} == {"ok"}
    wrong = {method: {row.scene for row in rows if row.method == method and row.wrong}
             for method in ("exact", "double", "single")}  # fmt: skip
    assert wrong["exact"] == set()
    assert "near-ties" in wrong["double"] & wrong["single"]
    for row in rows:
        assert row.d_max_ulp is None or row.d_max_ulp <= 1.0 or row.method != "exact"


# ---- rows ----------------------------------------------------------------------------------


def test_rows_say_what_was_asked_and_found(rows):
    exact = rows[0]
    assert (exact.scene, exact.kind, exact.method) == ("near-ties", "halfshell", "exact")
    assert (exact.status, exact.rule, exact.compared_by) == ("ok", "<=", "i j S")
    assert exact.version == hs.__version__
    assert exact.wrong == 0 and exact.pairs_true > 0 and exact.rows_given == exact.pairs_true
    assert exact.seconds >= exact.seconds_least > 0.0 and exact.repeats >= 1
    single = next(row for row in rows if row.method == "single")
    assert single.wrong > 0 and 0.0 < single.wrong_share < 1.0
    assert {row.status for row in rows} <= set(STATUSES)
    assert [row.method for row in rows if row.kind == "peer"] == ["cKDTree"] * 2


def test_float32_input_errs_by_float32(rows):
    row = next(row for row in rows if row.method == "float32" and row.scene == "near-ties")
    assert row.d_max_ulp > 1e6
    assert 1e-10 < row.d_max_relative < 1e-5


def test_kept_lists_have_rows_of_their_own(rows):
    kept = [row for row in rows if row.kind == "reuse"]
    assert {row.scene for row in kept} == {"head-on"}
    assert all(row.wrong == 0 for row in kept if row.method != "by the clock")
    late = [row for row in kept if row.method == "by the clock" and row.wrong]
    assert late and max(row.drift_kinetic for row in late) > 10.0
    verlet = [row for row in kept if row.method == "verlet"]
    assert len(verlet) == 3 and all(1 < row.builds < row.steps for row in verlet)


def test_scenes_in_float32_are_not_rounded_again():
    (row,) = hs.report(["float32-ulp"], methods=["float32"], size="small")
    assert (row.status, row.wrong) == ("not offered", None)
    assert "float32 as they are" in row.note


def test_names_are_checked():
    with pytest.raises(ValueError, match=r"there is no scene 'near-tie'; choose from near-ties"):
        hs.report(["near-tie"])
    with pytest.raises(ValueError, match="there is no method 'exakt'; choose from exact"):
        hs.report(["uniform"], methods=["exakt"])
    with pytest.raises(ValueError, match="there is no peer 'vesn'; choose from vesin"):
        hs.report(["uniform"], peers=["vesn"])
    with pytest.raises(ValueError, match="size must be one of"):
        hs.report(["uniform"], size="big")
    with pytest.raises(ValueError, match="patience must be"):
        hs.report(["uniform"], patience=-1.0)
    with pytest.raises(TypeError, match="a sequence of names"):
        hs.report("uniform")


def test_csv_is_read_back_as_it_was(rows):
    odd = replace(rows[0], note='a "quoted", note', d_max_ulp=math.inf, missed=None)
    stream = io.StringIO()
    facts = machine_facts()
    write_csv(stream, facts, [*rows, odd])
    stream.seek(0)
    assert read_csv(stream) == (facts, [*rows, odd])
    stream.seek(0)
    head = next(csv.reader(stream))
    assert {"scene", "missed", "d_max_ulp", "cpu", "date", "halfshell", "numpy"} <= set(head)


def test_every_field_is_documented():
    told = ReportRow.__doc__
    for name in ReportRow.__dataclass_fields__:
        assert re.search(rf"\b{name}\b", told), name


# ---- timing --------------------------------------------------------------------------------


def test_every_call_is_timed_and_patience_is_kept():
    made = []
    calls = {name: lambda name=name: made.append(name) for name in "ab"}
    timings = take_turns(calls, Patience(3, 10.0))
    assert set(made) == {"a", "b"}
    assert all(0.0 < timings[name].least <= timings[name].median for name in "ab")
    assert timings["a"].repeats == made.count("a") > 3
    once = take_turns({"slow": lambda: sum(range(300_000))}, Patience(1000, 0.01))
    assert 1 <= once["slow"].repeats < 500
