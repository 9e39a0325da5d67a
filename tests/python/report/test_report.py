# SPDX-License-Identifier: BSD-3-Clause
"""The report as a whole: right on every scene, rows that say so, CSV, times."""

import csv
import io
import math
from dataclasses import replace

import numpy as np
import pytest

import halfshell as hs
from halfshell._check.reference import exact_square, reach_by_radii, reference_pairs
from halfshell_report import report, scenes
from halfshell_report.measure import Patience, machine_facts, take_turns
from halfshell_report.page import page
from halfshell_report.reach import Balls, Ellipsoids, reach_of
from halfshell_report.rows import STATUSES, read_csv, write_csv
from halfshell_report.run import SCENES
from halfshell_report.truth import true_pairs
from needle_scenes import needle_pairs
from oracles import remembered

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def rows():
    """Two scenes, one of which moves, by every method of ours and SciPy's tree."""
    return report(["near-ties", "head-on"], peers=["cKDTree"], size="small")


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


@pytest.mark.parametrize("rule", ["sum", "mean", "max", "min"])
@pytest.mark.parametrize("name", scenes.names(radii=True))
def test_the_truth_of_balls_is_that_of_rational_brute_force(name, rule):
    scene = replace(scenes.load(name, "small"), rule=rule)
    periodic = scene.periodic if scene.box is not None else None
    truth = true_pairs(scene.points, None, scene.box, periodic, reach_of(scene))
    for inclusive in (True, False):
        # Of many images: those that a search of this package proposes with room to spare.
        far = 1.001 * reach_of(scene).largest + 1e-9
        candidates = hs.pairs(scene.points, far, box=scene.box, periodic=periodic, quantities="ijS")
        reaches = reach_by_radii(scene.radii, rule)
        expected = set()
        for i, j, S in zip(*(column.tolist() for column in candidates)):
            square = exact_square(scene.points, i, j, S, scene.box)
            limit = reaches[i][j] ** 2
            if square < limit or (inclusive and square == limit):
                expected.add((i, j, *S))
        pairs = truth.by_rule(inclusive)
        found = [(i, j, *S) for i, j, S in zip(*(getattr(pairs, k).tolist() for k in "ijS"))]
        assert len(found) == len(set(found)) and set(found) == expected


@pytest.mark.parametrize("rule", ["max", "min"])
@pytest.mark.parametrize("name", scenes.names(supports=True))
def test_the_truth_of_needles_is_that_of_rational_brute_force(name, rule):
    scene = replace(scenes.load(name, "small"), rule=rule)
    truth = true_pairs(scene.points, None, scene.box, scene.periodic, reach_of(scene))
    for inclusive in (True, False):
        expected = needle_pairs(replace(scene, inclusive=inclusive))
        pairs = truth.by_rule(inclusive)
        found = [(i, j, *S) for i, j, S in zip(*(getattr(pairs, k).tolist() for k in "ijS"))]
        assert sorted(found) == expected
    assert 0 < truth.n_by_integers < 20 * scene.n_points


def test_reaches_of_no_points_are_no_pairs():
    nothing = np.zeros((0, 3))
    for reach in (Balls(np.zeros(0), "sum"), Ellipsoids(np.zeros((0, 3, 3)), 1.0, "max")):
        truth = true_pairs(nothing, None, np.ones(3), None, reach)
        assert len(truth.pairs) == 0


def test_a_support_that_is_too_thin_for_the_truth_is_named():
    H = np.stack([np.eye(2), np.diag([1e-12, 1.0])])
    with pytest.raises(ValueError, match=r"supports\[1\] is too thin"):
        Ellipsoids(H, 1.0, "max")


def test_rounded_sums_are_told_from_real_ones():
    rows = report(["balls-rounded", "balls-equal"], peers=["cKDTree", "vesin"], size="small")
    at = {(row.scene, row.method): row for row in rows}
    rounded = at["balls-rounded", "exact"]
    assert rounded.wrong == 0 and rounded.ties > 0 and rounded.force_error is None
    # The others find that what touches in float64 touches.
    for method in ("double", "cKDTree"):
        assert at["balls-rounded", method].spurious > 5
    assert at["balls-equal", "double"].wrong == 0
    assert at["balls-equal", "cKDTree"].status == "not offered"  # images, in so small a box
    assert at["balls-rounded", "vesin"].status in ("not offered", "not installed")
    assert "rounded sums" in at["balls-rounded", "cKDTree"].note
    text = page(machine_facts(), rows)
    assert "touching exactly" in text and "at exactly the cutoff" in text.split("Scene by scene")[0]
    assert text.split("Scene by scene")[1].count("at exactly the cutoff") == 0


def test_needles_are_decided_wrongly_in_float64():
    rows = report(["needles", "needles-strict"], peers=["cKDTree", "NumPy", "vesin"],
                     size="small")  # fmt: skip
    at = {(row.scene, row.method): row for row in rows}
    for name in ("needles", "needles-strict"):
        assert at[name, "exact"].wrong == 0 and at[name, "exact"].ties > 5
        for method in ("double", "single", "cKDTree", "NumPy"):
            assert at[name, method].wrong > 5
        assert "|H D|" in at[name, "cKDTree"].note
        assert at[name, "vesin"].status in ("not offered", "not installed")
    assert at["needles", "NumPy"].seconds > at["needles", "exact"].seconds
    text = page(machine_facts(), rows)
    assert "exactly on a surface" in text and "touching exactly" not in text


def test_exact_is_right_on_every_scene_and_rounding_is_not():
    rows = report(methods=["exact", "double", "single"], size="small")
    assert list(dict.fromkeys(row.scene for row in rows)) == list(SCENES)
    assert {row.status for row in rows} == {"ok"}
    wrong = {method: {row.scene for row in rows if row.method == method and row.wrong}
             for method in ("exact", "double", "single")}  # fmt: skip
    assert wrong["exact"] == set()
    assert {"near-ties", "balls-rounded", "needles"} <= wrong["double"] & wrong["single"]
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


def test_kept_lists_have_rows_of_their_own(rows):
    kept = [row for row in rows if row.kind == "reuse"]
    assert {row.scene for row in kept} == {"head-on"}
    assert all(row.wrong == 0 for row in kept if row.method != "by the clock")
    late = [row for row in kept if row.method == "by the clock" and row.wrong]
    assert late and max(row.drift_kinetic for row in late) > 10.0
    verlet = [row for row in kept if row.method == "verlet"]
    assert len(verlet) == 3 and all(1 < row.builds < row.steps for row in verlet)


def test_names_are_checked():
    with pytest.raises(ValueError, match=r"there is no scene 'near-tie'; choose from near-ties"):
        report(["near-tie"])
    with pytest.raises(ValueError, match="there is no method 'exakt'; choose from exact"):
        report(["uniform"], methods=["exakt"])
    with pytest.raises(ValueError, match="there is no peer 'vesn'; choose from vesin"):
        report(["uniform"], peers=["vesn"])
    with pytest.raises(ValueError, match="size must be one of"):
        report(["uniform"], size="big")
    with pytest.raises(ValueError, match="patience must be"):
        report(["uniform"], patience=-1.0)
    with pytest.raises(TypeError, match="a sequence of names"):
        report("uniform")


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


def test_scenes_in_float32_are_not_rounded_again():
    (row,) = report(["float32-ulp"], methods=["float32"], size="small")
    assert (row.status, row.wrong) == ("not offered", None)
    assert "float32 as they are" in row.note
