# SPDX-License-Identifier: BSD-3-Clause
"""The error measures of the report, held against lists that are wrong on purpose."""

import math
from fractions import Fraction

import numpy as np
import pytest

from halfshell._check.reference import exact_vector
from halfshell._convert.arrays import row_keys
from halfshell_report import scenes
from halfshell_report.accuracy import (
    Answer,
    pair_errors,
    quantity_errors,
    sample_of,
)
from halfshell_report.physics import (
    EveryStep,
    Stale,
    Verlet,
    force_errors,
    reference_forces,
    run_nve,
    why_no_forces,
)
from halfshell_report.truth import true_pairs
from oracles import lattice, random_scene


@pytest.fixture
def scene(rng):
    """Points, cutoff, box and flags with several images of a pair, and their truth."""
    points, cutoff, box, flags = random_scene(rng, 12, 3, "triclinic", 60, spread=2)
    return points, cutoff, box, true_pairs(points, cutoff, box, flags)


def right(truth, inclusive=True):
    """The true pairs as an answer, without rounding d or D more than once."""
    sample = sample_of(truth, 10**9)
    pairs = truth.pairs
    return Answer(pairs.i, pairs.j, pairs.S, sample.d, sample.D, inclusive)


def rows(answer, chosen, **changed):
    """An answer with some of its rows, and other properties."""
    parts = {name: getattr(answer, name)[chosen] for name in ("i", "j", "S", "d", "D")}
    return Answer(**parts, inclusive=answer.inclusive, **changed)


def both_ways(answer):
    """The full list."""
    return Answer(
        np.r_[answer.i, answer.j], np.r_[answer.j, answer.i], np.r_[answer.S, -answer.S],
        np.r_[answer.d, answer.d], np.r_[answer.D, -answer.D], answer.inclusive, full=True,
    )  # fmt: skip


def wrong(errors):
    return errors.missed, errors.spurious, errors.duplicate


# ---- pairs ---------------------------------------------------------------------------------


def test_the_truth_has_no_errors(scene):
    truth = scene[-1]
    answer = right(truth)
    assert (truth.pairs.i == truth.pairs.j).any() and len(answer) > 300
    for good in (answer, both_ways(answer)):
        errors = pair_errors(truth, good)
        assert wrong(errors) == (0, 0, 0)
        assert (errors.expected, errors.given) == (len(answer), len(good))


def test_a_full_list_misses_a_pair_that_lacks_a_direction(scene):
    full = both_ways(right(scene[-1]))
    lacking = rows(full, np.arange(1, len(full)), full=True)
    assert wrong(pair_errors(scene[-1], lacking)) == (1, 0, 0)
    half = rows(full, np.arange(len(full) // 2), full=True)
    assert wrong(pair_errors(scene[-1], half)) == (len(full) // 2, 0, 0)


def test_added_pairs_are_spurious_once_whichever_way_round(scene):
    answer = right(scene[-1])
    far = np.array([[9, 9, 9], [-9, -9, -9]])
    more = Answer(
        np.r_[answer.i, 0, 1], np.r_[answer.j, 1, 0], np.r_[answer.S, far], inclusive=True
    )
    errors = pair_errors(scene[-1], more)
    assert (errors.missed, errors.spurious) == (0, 1)
    shifted = Answer(answer.i, answer.j, np.r_[answer.S[:-1], far[:1]])
    assert wrong(pair_errors(scene[-1], shifted)) == (1, 1, 0)
    itself = Answer(np.r_[answer.i, 3], np.r_[answer.j, 3], np.r_[answer.S, [[0, 0, 0]]])
    assert wrong(pair_errors(scene[-1], itself)) == (0, 1, 0)


def test_rows_too_many_are_duplicates(scene):
    answer = right(scene[-1])
    twice = rows(answer, np.r_[np.arange(len(answer)), 3, 3, 5])
    assert wrong(pair_errors(scene[-1], twice)) == (0, 0, 3)
    turned = Answer(np.r_[answer.i, answer.j[:2]], np.r_[answer.j, answer.i[:2]],
                    np.r_[answer.S, -answer.S[:2]])  # fmt: skip
    assert wrong(pair_errors(scene[-1], turned)) == (0, 0, 2)


def test_own_images_may_come_twice_where_that_is_the_convention(scene):
    answer = right(scene[-1])
    own = np.flatnonzero(answer.i == answer.j)
    convention = Answer(
        np.r_[answer.i, answer.i[own]], np.r_[answer.j, answer.j[own]],
        np.r_[answer.S, -answer.S[own]], own_images_twice=True,
    )  # fmt: skip
    assert wrong(pair_errors(scene[-1], convention)) == (0, 0, 0)
    once = Answer(answer.i, answer.j, answer.S, own_images_twice=True)
    assert wrong(pair_errors(scene[-1], once)) == (len(own), 0, 0)


def test_each_rule_is_held_against_its_own_truth():
    points, box = lattice("fcc", (3, 3, 3))
    truth = true_pairs(points, 2.0, box)
    assert 0 < truth.tie.sum() < len(truth.pairs)
    closed = right(truth)
    open_ = rows(closed, ~truth.tie)
    strict = Answer(open_.i, open_.j, open_.S, inclusive=False)
    assert wrong(pair_errors(truth, closed)) == wrong(pair_errors(truth, strict)) == (0, 0, 0)
    assert wrong(pair_errors(truth, open_)) == (truth.tie.sum(), 0, 0)
    every = Answer(closed.i, closed.j, closed.S, inclusive=False)
    assert wrong(pair_errors(truth, every)) == (0, truth.tie.sum(), 0)


# ---- distances and vectors -----------------------------------------------------------------


@pytest.mark.parametrize("ulps", [1, 3, 1000])
def test_a_distance_that_is_some_ulps_off_is_reported_as_that(scene, ulps):
    truth = scene[-1]
    sample = sample_of(truth, 10**9)
    d = sample.d.copy()
    k = int(np.argmin(np.abs(np.frexp(d)[0] - 0.75)))  # its ulp stays the same
    d[k] += ulps * math.ulp(d[k])
    pairs = truth.pairs
    found = quantity_errors(sample, Answer(pairs.i, pairs.j, pairs.S, d))
    assert found.d_max_ulp == ulps
    assert found.d_rms_ulp == pytest.approx(ulps / math.sqrt(len(d)), rel=1e-12)
    assert found.d_max_relative == pytest.approx(ulps * math.ulp(d[k]) / d[k], rel=1e-12)
    assert found.D_max_ulp is None


def test_a_vector_counts_by_its_worst_component_either_way_round(scene):
    truth = scene[-1]
    sample = sample_of(truth, 10**9)
    D = sample.D.copy()
    D[4] += np.array([2.0, -5.0, 1.0]) * math.ulp(sample.d[4])
    pairs = truth.pairs
    exact = sample.D[4].tolist()
    worst = max(abs(Fraction(a) - Fraction(b)) for a, b in zip(D[4].tolist(), exact))
    expected = float(worst / Fraction(math.ulp(sample.d[4])))
    for answer in (Answer(pairs.i, pairs.j, pairs.S, None, D),
                   Answer(pairs.j, pairs.i, -pairs.S, None, -D)):  # fmt: skip
        found = quantity_errors(sample, answer)
        assert found.D_max_ulp == pytest.approx(expected, rel=1e-12)
        assert 4.0 <= found.D_max_ulp <= 6.0
        assert found.d_max_ulp is None


# ---- physics -------------------------------------------------------------------------------


class Plain:
    """What `force_errors` wants to know of a scene."""

    def __init__(self, points, rows=None, periodic=()):
        self.points, self.rows, self.periodic = points, rows, periodic


@pytest.fixture
def crystal(rng):
    """A crystal that is warm: points, box, cutoff, truth."""
    points, box = lattice("fcc", (2, 2, 2))
    points = points + rng.uniform(-0.1, 0.1, points.shape)
    return points, box, 2.5, true_pairs(points, 2.5, box)


def energy_of_pair(sigma, square):
    s6 = (Fraction(sigma) ** 2 / square) ** 3
    return 4 * (s6 * s6 - s6)


def test_the_reference_is_the_rational_sum_rounded_once(crystal):
    points, box, cutoff, truth = crystal
    sigma = cutoff / 2.5
    total = Fraction(0)
    force = [Fraction(0)] * 3
    pairs = truth.pairs
    for i, j, S in zip(pairs.i, pairs.j, pairs.S):
        D = exact_vector(points, i, j, S, box)
        square = sum(x * x for x in D)
        total += energy_of_pair(sigma, square)
        s6 = (Fraction(sigma) ** 2 / square) ** 3
        for point, sign in ((j, 1), (i, -1)):
            if point == 5:
                factor = sign * 24 * (2 * s6 * s6 - s6) / square * Fraction(sigma)
                force = [f + factor * x for f, x in zip(force, D)]
    found = reference_forces(truth, True, sigma)
    assert found.energy == float(total)
    assert found.forces[5].tolist() == pytest.approx([float(f) for f in force], rel=1e-15)
    assert found.scale > np.linalg.norm(found.forces, axis=1).mean()


def test_right_lists_err_by_rounding_alone(crystal):
    points, box, cutoff, truth = crystal
    answer, plain = right(truth), Plain(points, box, (True,) * 3)
    for one in (answer, both_ways(answer), Answer(answer.i, answer.j, answer.S)):
        assert max(force_errors(reference_forces(truth, True, cutoff / 2.5), one, plain)) < 1e-13


def test_a_missed_pair_costs_its_energy(crystal):
    points, box, cutoff, truth = crystal
    sigma = cutoff / 2.5
    reference = reference_forces(truth, True, sigma)
    answer = right(truth)
    k = int(np.argmin(answer.d))
    lost = energy_of_pair(sigma, Fraction(answer.d[k]) ** 2)
    kept = np.delete(np.arange(len(answer)), k)
    energy, force = force_errors(reference, rows(answer, kept), Plain(points, box, (True,) * 3))
    assert energy == pytest.approx(abs(float(lost) / reference.energy), rel=1e-9)
    assert force > 1e-3


def test_there_is_a_reason_where_forces_tell_nothing(crystal):
    truth = crystal[-1]
    assert why_no_forces(truth, 1.2, 10**6) is None
    assert "more than 10 pairs" in why_no_forces(truth, 1.2, 10)
    assert "closer" in why_no_forces(truth, 5.0, 10**6)
    assert why_no_forces(true_pairs(np.zeros((1, 3)), 1.0), 0.4, 10) == "no pairs"
    assert why_no_forces(true_pairs(np.zeros((2, 3)), 0.0), 0.0, 10) == "cutoff 0"


# ---- runs at constant energy ---------------------------------------------------------------


@pytest.fixture(scope="module")
def head_on():
    return scenes.load("head-on", "small")


def test_lists_that_are_right_conserve_energy(head_on):
    every = run_nve(head_on, EveryStep(head_on, "exact"))
    assert every.steps == head_on.motion.n_steps == every.builds - 1
    assert every.errors.wrong == 0 and every.errors.expected > 0
    assert every.drift < 0.02
    for share in (0.5, 1.0):
        kept = run_nve(head_on, Verlet(head_on, share * head_on.motion.skin))
        assert kept.errors.wrong == 0
        assert kept.builds < every.builds / 3
        assert kept.drift == pytest.approx(every.drift, rel=1e-9)


def test_lists_by_the_clock_miss_pairs_when_the_clock_is_slow(head_on):
    in_time = run_nve(head_on, Stale(head_on, head_on.motion.skin, 5))
    assert in_time.errors.wrong == 0 and in_time.drift < 0.02
    assert in_time.builds == 1 + head_on.motion.n_steps // 5
    late = run_nve(head_on, Stale(head_on, head_on.motion.skin, 50))
    assert late.errors.missed > 0 and late.errors.spurious == 0
    assert late.drift > 10.0


def test_springs_are_part_of_the_energy():
    chain = scenes.load("stiff-chain", "small")
    run = run_nve(chain, EveryStep(chain, "exact"))
    assert run.errors.wrong == 0
    assert run.drift < 0.2


def test_keys_hold_shifts_of_any_size(rng):
    wide = [rng.integers(0, 2**40, 500), rng.integers(-(2**62), 2**62, 500)]
    wide += [np.array([10**30, -(10**30)] * 250, dtype=object)]
    order = rng.permutation(500)
    first, second = row_keys(wide, [column[order] for column in wide])
    assert len(set(first.tolist())) == 500
    assert (first[order] == second).all()
