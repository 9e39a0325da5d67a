# SPDX-License-Identifier: BSD-3-Clause
"""Radii and rules as they may be given, and all that is refused, before anything is searched."""

import threading

import numpy as np
import pytest

import halfshell as hs
from oracles import same_arrays
from reach_scenes import RULES, SYMMETRIC
from refused_calls import INF, NAN, assert_refused

RNG = np.random.default_rng(11)
POINTS = RNG.random((30, 3))
RADII = RNG.integers(1, 9, 30) / 32.0
LARGE = RNG.random((100_000, 3))


def with_radius(k, value, n=30):
    radii = np.full(n, 0.01)
    radii[k] = value
    return radii


def calls(points=POINTS, **how):
    """Every function of one set, with these keywords."""
    return [
        lambda: hs.pairs(points, None, **how),
        lambda: hs.count_pairs(points, None, **how),
        lambda: hs.neighbors(points, None, **how),
        lambda: hs.coordination(points, None, **how),
        lambda: hs.iter_pairs(points, None, **how),
        lambda: hs.for_each_pair(points, None, lambda *pair: None, **how),
        lambda: hs.verify(points, None, [0], [1], **how),
        lambda: hs.explain(points, None, **how),
    ]


# ---- forms ---------------------------------------------------------------------------------


def test_radii_may_have_any_form():
    expected = hs.pairs(POINTS, None, radii=RADII, sort=True)
    assert len(expected[0]) > 10
    read_only = RADII.copy()
    read_only.flags.writeable = False
    unaligned = np.frombuffer(b"x" + RADII.tobytes(), dtype=np.float64, offset=1)
    for radii in (RADII.tolist(), tuple(RADII), RADII.astype(np.float32), RADII.astype(">f8"),
                  RADII.astype(np.float16), np.repeat(RADII, 3)[::3], RADII[::-1].copy()[::-1],
                  memoryview(RADII), read_only, unaligned, RADII.astype(object)):  # fmt: skip
        assert same_arrays(hs.pairs(POINTS, None, radii=radii, sort=True), expected)
    whole = np.ones(30, np.int64)
    for kind in (np.int64, np.uint8, np.bool_):
        found = hs.count_pairs(POINTS, 0.5, radii=whole.astype(kind))
        assert found == hs.count_pairs(POINTS, 0.5)


def test_the_sum_is_the_rule_unless_another_is_named():
    assert same_arrays(
        hs.pairs(POINTS, None, radii=RADII), hs.pairs(POINTS, None, radii=RADII, rule="sum")
    )
    counts = [hs.count_pairs(POINTS, None, radii=RADII, rule=rule) for rule in SYMMETRIC]
    assert counts[0] > counts[2] > counts[1] > counts[3] > 0


def test_several_upper_bounds_are_counted_at_once():
    bounds = [0.0, 0.1, 0.2, 0.4, 2.0]
    for how in ({"radii": RADII}, {"radii": RADII, "rule": "max", "box": 1.0}):
        several = hs.count_pairs(POINTS, bounds, **how)
        assert several.dtype == np.int64
        assert several.tolist() == [hs.count_pairs(POINTS, bound, **how) for bound in bounds]
        assert several[-1] == hs.count_pairs(POINTS, None, **how)


def test_inputs_are_not_changed_and_may_change_later():
    radii, points = RADII.copy(), POINTS.copy()
    table = hs.neighbors(points, None, radii=radii, quantities="jd", box=1.0)
    expected = table.sort().indices.tolist()
    again = hs.neighbors(points, None, radii=radii, quantities="jd", box=1.0)
    blocks = hs.iter_pairs(points, None, radii=radii, max_pairs=10)
    first = next(blocks)
    assert np.array_equal(radii, RADII)
    radii[:] = 0.0
    points[:] = 7.0
    assert again.sort().indices.tolist() == expected
    rest = [first, *blocks]
    found = tuple(np.concatenate(columns) for columns in zip(*rest))
    assert same_arrays(found, hs.pairs(POINTS, None, radii=RADII))


# ---- radii ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "value, fragments",
    [
        (-1.0, [r"finite and not negative", r"radii\[7\] = -1"]),
        (-5e-324, [r"finite and not negative", r"radii\[7\] = -"]),
        (NAN, [r"finite and not negative", r"radii\[7\] = nan"]),
        (INF, [r"finite and not negative", r"radii\[7\] = inf"]),
        (-INF, [r"finite and not negative", r"radii\[7\] = -inf"]),
        (np.nextafter(2.0**1022, INF), [r"2\*\*1022", r"radii\[7\]"]),
    ],
)
def test_radii_that_are_no_lengths(value, fragments):
    for call in calls(radii=with_radius(7, value)):
        assert_refused(call, ValueError, *fragments)
    for rule in RULES[1:]:
        assert_refused(
            lambda rule=rule: hs.neighbors(
                POINTS, None, radii=with_radius(7, value), rule=rule
            ), ValueError, *fragments,
        )  # fmt: skip
    fragments = [fragment.replace("radii", "query_radii") for fragment in fragments]
    for how in ({"rule": "gather"}, {"radii": RADII}):
        assert_refused(
            lambda how=how: hs.pairs_between(
                POINTS, POINTS, None, query_radii=with_radius(7, value), **how
            ), ValueError, *fragments,
        )  # fmt: skip


@pytest.mark.parametrize("row", [5, 140_000, 299_999])
def test_the_first_wrong_row_of_many(row):
    n = 300_000  # the caller's numbers are read in stretches, with a look for signals in between
    points, types = np.zeros((n, 1)), np.zeros(n, np.int32)
    points[:, 0] = np.arange(n)
    radii, table = with_radius(row, NAN, n), [[0.25]]

    def count(cutoff, **how):
        return lambda: hs.count_pairs(points, cutoff, **how)

    assert_refused(count(None, radii=radii), ValueError, rf"radii\[{row}\]")
    types[row] = 7
    assert_refused(count(table, types=types), ValueError, rf"types\[{row}\]")
    points[row] = NAN
    radii[row], types[row] = 0.01, 0
    assert_refused(count(None, radii=radii), ValueError, rf"points\[{row}")
    assert_refused(count(table, types=types), ValueError, rf"points\[{row}")


def test_radii_that_cannot_be_halved():
    small = np.nextafter(2.0**-1021, 0.0)
    for call in calls(radii=with_radius(7, small), rule="mean"):
        assert_refused(call, ValueError, r"2\*\*-1021", "mean", r"radii\[7\]")
    for radii in (with_radius(7, 2.0**-1021), with_radius(7, 0.0)):
        assert hs.count_pairs(POINTS, None, radii=radii, rule="mean") == 0
    for rule in ("sum", "max", "min"):
        assert hs.count_pairs(POINTS, None, radii=with_radius(7, small), rule=rule) == 0


def test_the_largest_radii_meet():
    points = np.array([[-(2.0**1022)], [2.0**1022]])
    for rule, count in (("sum", 1), ("mean", 0), ("max", 0)):
        assert hs.count_pairs(points, None, radii=[2.0**1022] * 2, rule=rule) == count


@pytest.mark.parametrize("shape", [(), (29,), (31,), (30, 1), (1, 30), (0,)])
def test_radii_of_a_wrong_shape(shape):
    for call in calls(radii=np.ones(shape)):
        assert_refused(call, ValueError, r"radii must have shape \(30,\)", str(shape)[1:-1])
    assert_refused(
        lambda: hs.pairs_between(
            POINTS[:3], POINTS, None, query_radii=np.ones(shape), radii=RADII
        ), ValueError, r"query_radii must have shape \(3,\)",
    )  # fmt: skip


@pytest.mark.parametrize(
    "radii", ["wide", b"wide", ["a"] * 30, np.ones(30, complex), np.ones(30, np.longdouble),
              np.zeros(30, "M8[s]"), [None] * 30, {1: 2}, object(), {"r": 1.0}],
)  # fmt: skip
def test_radii_of_a_wrong_kind(radii):
    if isinstance(radii, np.ndarray) and radii.dtype == np.float64:
        pytest.skip("long double is float64 on this machine")
    for call in calls(radii=radii):
        assert_refused(call, TypeError, "radii")


def test_masked_radii_and_integers_that_are_no_float64():
    masked = np.ma.array(RADII, mask=np.arange(30) == 4)
    for call in calls(radii=masked):
        assert_refused(call, ValueError, r"radii\[4\] must not be masked")
    for call in calls(radii=[2**53 + 1] * 30):
        assert_refused(call, ValueError, r"radii\[0\]", "float64")


def test_bad_radii_are_refused_before_anything_is_searched():
    for row, value in ((99_999, NAN), (50_000, -1.0)):
        radii = with_radius(row, value, 100_000)
        radii[0] = 5.0
        for call in (hs.pairs, hs.count_pairs, hs.neighbors, hs.coordination):
            assert_refused(
                lambda call=call, radii=radii: call(LARGE, None, radii=radii), ValueError,
                rf"radii\[{row}\]",
            )  # fmt: skip


# ---- rules and what goes together ----------------------------------------------------------


def test_cutoff_is_needed_without_radii():
    for call in calls():
        assert_refused(call, TypeError, "cutoff")
    for value in (-1.0, NAN, -5e-324):
        for call in (hs.pairs, hs.count_pairs, hs.neighbors, hs.coordination):
            assert_refused(
                lambda call=call, value=value: call(POINTS, value, radii=RADII), ValueError,
                "cutoff", "negative",
            )  # fmt: skip
    for value in ("far", 1j, [1.0] * 3, object()):
        assert_refused(
            lambda value=value: hs.pairs(POINTS, value, radii=RADII), TypeError, "cutoff"
        )


@pytest.mark.parametrize("rule", ["Sum", "", "diameter", "gather ", 1, b"sum", ("sum",)])
def test_rules_that_are_none(rule):
    exception = ValueError if isinstance(rule, str) else TypeError
    for call in calls(radii=RADII, rule=rule):
        assert_refused(call, exception, "rule")


def test_rules_need_radii():
    for rule in ("sum", "gather", "nonsense"):
        assert_refused(lambda rule=rule: hs.pairs(POINTS, 0.5, rule=rule), ValueError, "rule needs")
        assert_refused(
            lambda rule=rule: hs.pairs_between(POINTS, POINTS, 0.5, rule=rule), ValueError,
            "rule needs",
        )  # fmt: skip


@pytest.mark.parametrize("rule", ["gather", "scatter"])
def test_rules_with_a_direction_are_for_rows_and_two_sets(rule):
    how = {"radii": RADII, "rule": rule}
    for call in (
        lambda: hs.pairs(POINTS, None, **how),
        lambda: hs.iter_pairs(POINTS, None, **how),
        lambda: hs.for_each_pair(POINTS, None, print, **how),
        lambda: hs.count_pairs(POINTS, None, **how),
        lambda: hs.explain(POINTS, None, **how),
    ):
        assert_refused(call, ValueError, rule, "neighbors")
    assert hs.neighbors(POINTS, None, **how).n_entries == hs.coordination(POINTS, None, **how).sum()


def test_radii_of_two_sets():
    queries = {"queries": POINTS[:4]}
    for given, fragments in (
        ({"radii": RADII}, ["radii and query_radii must be given together"]),
        ({"query_radii": RADII[:4]}, ["radii and query_radii must be given together"]),
        ({"radii": RADII, "query_radii": RADII[:4], "rule": "gather"}, ["query_radii alone"]),
        ({"radii": RADII, "rule": "gather"}, ["query_radii alone"]),
        ({"query_radii": RADII[:4], "rule": "scatter"}, ["radii alone"]),
        ({"radii": RADII, "query_radii": RADII[:4], "rule": "scatter"}, ["radii alone"]),
    ):
        for call in (hs.neighbors, hs.count_pairs, hs.coordination):
            assert_refused(
                lambda call=call, given=given: call(POINTS, None, **given, **queries), ValueError,
                *fragments,
            )  # fmt: skip
    for call in (hs.neighbors, hs.count_pairs, hs.coordination):
        assert_refused(
            lambda call=call: call(POINTS, None, query_radii=RADII), ValueError,
            "query_radii needs queries",
        )  # fmt: skip
        assert_refused(
            lambda call=call: call(POINTS, None, radii=RADII, query_radii=RADII), ValueError,
            "query_radii needs queries",
        )  # fmt: skip


@pytest.mark.parametrize("batch", [{}, {"batch": [0] * 30}], ids=["", "batch"])
def test_radii_go_with_no_types(batch):
    for call in (hs.pairs, hs.count_pairs):
        assert_refused(
            lambda call=call: call(POINTS, 1.0, radii=RADII, types=[0] * 30, **batch), ValueError,
            "radii", "together", "types",
        )  # fmt: skip


def test_out_is_apart_from_radii():
    radii = np.ones(40)
    assert_refused(
        lambda: hs.pairs(POINTS, None, radii=radii[:30], quantities="d", out=radii), ValueError,
        "out must not share memory with radii",
    )  # fmt: skip
    assert_refused(
        lambda: hs.pairs_between(
            POINTS, POINTS, None, query_radii=radii[:30], rule="gather", quantities="d", out=radii
        ), ValueError, "out must not share memory with query_radii",
    )  # fmt: skip


@pytest.mark.parametrize("rule", SYMMETRIC)
def test_results_that_do_not_fit_are_refused(rule):
    radii = np.full(100_000, 1.0)
    for call in (hs.pairs, hs.neighbors):
        assert_refused(
            lambda call=call: call(LARGE, None, radii=radii, rule=rule, memory_limit=1e8),
            MemoryError, "fit",
        )  # fmt: skip


def test_a_further_cutoff_is_a_length():
    for cutoff in (INF, NAN, -1.0):
        with pytest.raises(ValueError, match="cutoff must be finite and not negative"):
            hs.count_pairs([[0.0], [1.0]], cutoff, radii=[1.0, 1.0])


def test_radii_that_change_meanwhile_do_no_harm():
    points, radii = LARGE[:1500], 0.04 * 2.0 ** -RNG.integers(0, 6, 1500)
    radii[:3] = 0.4
    stop = threading.Event()

    def write():
        k = 0
        values = (np.nan, -1.0, 0.3, 1e308, 0.0, np.inf, 0.01)
        while not stop.is_set():
            radii[k % len(radii)] = values[k % len(values)]
            radii[:] = 0.03
            k += 1

    writer = threading.Thread(target=write)
    writer.start()
    try:
        for _ in range(15):
            for search in (hs.pairs, hs.coordination, hs.count_pairs):
                try:
                    search(points, 0.1, radii=radii, threads=2)
                except ValueError as refused:
                    assert "radii" in str(refused)
    finally:
        stop.set()
        writer.join()
    i, j = hs.pairs(points, None, radii=radii)
    assert (i < j).all()
