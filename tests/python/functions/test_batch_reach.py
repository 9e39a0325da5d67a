# SPDX-License-Identifier: BSD-3-Clause
"""Batches with radii, types or supports: the same as one call for each system, and as rational
arithmetic."""

from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from halfshell_report import scenes
from oracles import same_arrays
from reach_scenes import SYMMETRIC

COVER = [(False, 1, True), (True, 3, False)]  # periodic, threads, sort
SIZES = [30, 0, 1, 2, 7, 64, 65, 0, 0, 200, 30, 3, 0]


def one_by_one(points, cutoff, batch, n_systems, marks, box=None, **options):
    """What the batch must give, from single calls: i, j, d, S, and the count of each system."""
    parts, counts = [], []
    for s in range(n_systems):
        first, end = np.searchsorted(batch, [s, s + 1])
        own = None if box is None else box[s] if np.ndim(box) == 3 else box
        of_all = ("rule", "extent")
        given = {k: v if k in of_all else v[first:end] for k, v in marks.items()}
        within = cutoff[s] if isinstance(cutoff, np.ndarray) and cutoff.ndim == 1 else cutoff
        i, j, d, S = hs.pairs(
            points[first:end], within, box=own, quantities="ijdS", **given, **options
        )
        parts.append((i + first, j + first, d, S))
        counts.append(len(i))
    return tuple(np.concatenate(columns) for columns in zip(*parts, strict=True)), counts


@pytest.fixture(scope="module")
def systems():
    """Points of all systems, their numbers, boxes and radii over a decade."""
    rng = np.random.default_rng(12)
    batch = np.repeat(np.arange(len(SIZES)), SIZES)
    edge = np.maximum(np.asarray(SIZES, dtype=float), 1.0) ** (1.0 / 3.0)
    points = rng.random((len(batch), 3)) * edge[batch][:, None]
    boxes = (np.eye(3) + 0.2 * rng.uniform(-1.0, 1.0, (len(SIZES), 3, 3))) * edge[:, None, None]
    return points, batch, boxes, 10.0 ** rng.uniform(-1.0, 0.0, len(batch))


@pytest.mark.parametrize("periodic, threads, sort", COVER)
@pytest.mark.parametrize("rule", SYMMETRIC)
def test_radii_are_those_of_single_calls(systems, rule, periodic, threads, sort):
    points, batch, boxes, radii = systems
    box = boxes if periodic else None
    marks = {"radii": radii, "rule": rule}
    for cutoff in (None, 0.7, np.linspace(0.2, 1.2, len(SIZES))):
        expected, counts = one_by_one(points, cutoff, batch, len(SIZES), marks, box, sort=sort)
        found = hs.pairs(
            points, cutoff, batch=batch, box=box, quantities="ijdS", sort=sort, threads=threads,
            **marks,
        )  # fmt: skip
        assert same_arrays(found, expected)
        by_system = hs.count_pairs(points, cutoff, batch=batch, box=box, threads=threads, **marks)
        assert by_system.tolist() == counts[: len(by_system)]
        assert not any(counts[len(by_system) :])


def test_types_are_those_of_single_calls(systems):
    for threads in (1, 3):
        points, batch, boxes, _ = systems
        types = np.random.default_rng(1).integers(0, 3, len(points))
        table = np.array([[0.2, 0.9, 0.5], [0.9, 1.1, 0.0], [0.5, 0.0, 0.7]])
        for cutoff in (table, {(0, 1): 1.0, (2, 2): 0.5}):
            for box in (None, boxes):
                expected, counts = one_by_one(
                    points, cutoff, batch, len(SIZES), {"types": types}, box, sort=True
                )
                found = hs.pairs(
                    points, cutoff, types=types, batch=batch, box=box, quantities="ijdS", sort=True,
                    threads=threads,
                )  # fmt: skip
                assert same_arrays(found, expected)
                by_system = hs.count_pairs(points, cutoff, types=types, batch=batch, box=box)
                assert by_system.tolist() == counts[: len(by_system)]


def needles(rng, n, d, aspect):
    """Supports turned every way, which reach 0.3 to 1.2."""
    axes = np.linalg.qr(rng.standard_normal((n, d, d)))[0]
    values = rng.uniform(0.8, 3.0, (n, 1)) * aspect ** rng.random((n, d))
    H = np.einsum("kab,kb,kcb->kac", axes, values, axes)
    return (H + H.transpose(0, 2, 1)) / 2.0


@pytest.mark.parametrize("periodic, threads, sort", COVER)
@pytest.mark.parametrize("rule", ["max", "min"])
def test_supports_are_those_of_single_calls(systems, rule, periodic, threads, sort):
    points, batch, boxes, _ = systems
    box = boxes if periodic else None
    for aspect in (1.5, 1e3):
        H = needles(np.random.default_rng(8), len(points), 3, aspect)
        marks = {"supports": H, "extent": 1.0, "rule": rule}
        for cutoff in (None, 0.5, np.linspace(0.2, 0.9, len(SIZES))):
            expected, counts = one_by_one(points, cutoff, batch, len(SIZES), marks, box, sort=sort)
            assert sum(counts) > (20 if aspect < 2.0 else -1)
            found = hs.pairs(
                points, cutoff, batch=batch, box=box, quantities="ijdS", sort=sort,
                threads=threads, **marks,
            )  # fmt: skip
            assert same_arrays(found, expected)
            by_system = hs.count_pairs(
                points, cutoff, batch=batch, box=box, threads=threads, **marks
            )
            assert by_system.tolist() == counts[: len(by_system)]
            assert not any(counts[len(by_system) :])


@pytest.mark.parametrize(("d", "dtype"), [(1, np.float64), (2, np.float32), (3, np.float64)])
def test_supports_of_a_batch_in_each_dimension_and_kernel(d, dtype):
    rng = np.random.default_rng(d)
    batch = np.sort(rng.integers(0, 40, 600)) + 3
    points = (rng.random((600, d)) * 3.0).astype(dtype)
    points[5] = points[4]
    for rule, extent in (("max", 0.7), ("min", 1.4), ("max", 0.0)):
        marks = {"supports": needles(rng, 600, d, 10.0), "extent": extent, "rule": rule}
        expected, counts = one_by_one(points, None, batch, 43, marks, np.eye(d) * 3.0)
        how = {"batch": batch, "box": [3.0] * d, **marks}
        for kernel in hs.kernels():
            found = hs.pairs(points, None, quantities="ijdS", kernel=kernel, **how)
            assert same_arrays(found, expected)
        assert hs.count_pairs(points, None, **how).tolist() == counts


def test_the_needles_of_a_batch_are_decided_exactly():
    scene = scenes.load("needles", "small")
    expected = hs.pairs(**scene.arguments, sort=True)
    assert len(expected[0]) > 20
    points, H = np.tile(scene.points, (3, 1)), np.tile(scene.supports, (3, 1, 1))
    n = scene.n_points
    found = hs.pairs(
        points, None, box=scene.box, supports=H, extent=scene.extent, rule=scene.rule,
        batch=np.repeat([0, 4, 5], n), sort=True,
    )  # fmt: skip
    for column, one in zip(found, expected, strict=True):
        assert np.array_equal(column, np.concatenate([one, one + n, one + 2 * n]))


def test_every_algorithm_finds_them(systems):
    for algorithm in ("all-pairs", "grid", "hash", "hierarchy"):
        points, batch, boxes, radii = systems
        H = needles(np.random.default_rng(2), len(points), 3, 5.0)
        for marks in ({"radii": radii}, {}, {"supports": H, "extent": 1.0}):
            cutoff = None if marks else 1.1
            expected, _ = one_by_one(
                points, cutoff, batch, len(SIZES), marks, boxes, algorithm=algorithm
            )
            found = hs.pairs(
                points,
                cutoff,
                batch=batch,
                box=boxes,
                quantities="ijdS",
                algorithm=algorithm,
                **marks,
            )
            assert same_arrays(found, expected)


def test_balls_of_a_batch_touch_by_rational_arithmetic():
    rng = np.random.default_rng(3)
    radii = rng.choice([0.1, 0.2, 0.3, 0.7], 60)
    points = np.round(rng.uniform(0.0, 1.5, (60, 2)), 1)
    batch = np.repeat([2, 3, 9], 20)
    expected = set()
    for i in range(60):
        for j in range(i + 1, 60):
            D = [Fraction(float(b)) - Fraction(float(a)) for a, b in zip(points[i], points[j])]
            reach = Fraction(float(radii[i])) + Fraction(float(radii[j]))
            if batch[i] == batch[j] and sum(x * x for x in D) <= reach * reach:
                expected.add((i, j))
    i, j = hs.pairs(points, None, radii=radii, batch=batch)
    assert len(expected) > 50 and set(zip(i.tolist(), j.tolist())) == expected


def test_memory_and_bytes_are_the_callers(systems):
    points, batch, _, radii = systems
    i, j = hs.pairs(points, None, radii=radii, batch=batch, index_dtype=np.int32)
    out = np.empty(1000, np.int32), np.empty(1000, np.int32)
    a, b = hs.pairs(points, None, radii=radii, batch=batch, index_dtype=np.int32, out=out)
    assert same_arrays((a, b), (i, j)) and a.base is out[0]
    with pytest.raises(hs.CapacityError):
        hs.pairs(points, None, radii=radii, batch=batch, quantities="i", out=np.empty(3, np.int64))
    with pytest.raises(MemoryError):
        hs.pairs(points, None, radii=radii, batch=batch, memory_limit=1000)
    with pytest.raises(ValueError, match="radii"):
        hs.pairs(points, None, radii=radii, batch=batch, quantities="d", out=radii)


def test_what_is_wrong_is_named(systems):
    points, batch, _, radii = systems
    bad = radii.copy()
    bad[40] = -1.0
    refused = [
        ({"radii": bad}, r"radii\[40\] = -1"),
        ({"radii": radii[:-1]}, "radii must have shape"),
        ({"radii": radii, "rule": "gather"}, "has a direction"),
        ({"rule": "sum"}, "rule needs radii|cutoff must"),
        ({"types": np.zeros(len(points), int)}, "cutoff must"),
        ({"supports": -np.tile(np.eye(3), (len(points), 1, 1)), "extent": 1.0}, r"supports\[0\]"),
    ]
    for marks, message in refused:
        with pytest.raises((TypeError, ValueError), match=message):
            hs.pairs(points, None, batch=batch, **marks)
    cutoffs = np.ones(len(SIZES))
    cutoffs[5] = -2.0
    with pytest.raises(ValueError, match=r"cutoff\[5\]|cutoff.*-2"):
        hs.pairs(points, cutoffs, radii=radii, batch=batch)
    with pytest.raises(ValueError, match="shape"):
        hs.pairs(points, np.ones((2, 2)), radii=radii, batch=batch)


def test_no_points_are_no_pairs():
    nothing, batch = np.zeros((0, 3)), np.zeros(0, int)
    supports = {"cutoff": None, "supports": np.zeros((0, 3, 3)), "extent": 1.0}
    for given in (
        {"cutoff": None, "radii": []}, {"cutoff": np.ones((1, 1)), "types": []}, supports
    ):  # fmt: skip
        i, j = hs.pairs(nothing, batch=batch, **given)
        assert len(i) == len(j) == 0
