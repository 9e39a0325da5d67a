# SPDX-License-Identifier: BSD-3-Clause
"""`measure`: given pairs against rational arithmetic, and against `pairs`, to the last bit."""

import itertools
import math
import re
from fractions import Fraction

import numpy as np
import pytest
from support.rational_images import Images, between, dot, exact

import halfshell as hs
from calls import call


def vector_of(points, i, j, S, box, periodic):
    """D of a pair, exactly."""
    images = Images(points.shape[1], box, periodic)
    apart = between(exact(points[i]), exact(points[j]))
    for axis, row in zip(images.axes, images.rows, strict=True):
        apart = [x + int(S[axis]) * y for x, y in zip(apart, row, strict=True)]
    return apart


def along(images, vector):
    """The part of a vector in the space of the box vectors: the rest is that of every image."""
    part = [Fraction(0)] * len(vector)
    for row, square in zip(images._apart, images._squares, strict=True):
        times = dot(vector, row) / square
        part = [x + times * y for x, y in zip(part, row, strict=True)]
    return part


def ulps(value, true):
    """|value - true| in units in the last place of a number of this size."""
    size = max(abs(true), Fraction(5e-324))
    return abs(Fraction(float(value)) - true) / Fraction(math.ulp(float(size)))


def check(points, i, j, box=None, periodic=None, **options):
    """Each pair is that of the nearest image with the least S, and measured to an ulp."""
    points = np.asarray(points)
    d, D, S = call(hs.measure, points, i, j, box=box, periodic=periodic, **options)
    assert d.dtype == D.dtype == np.float64 and S.dtype == np.int32
    assert d.shape == (len(i),) and D.shape == S.shape == (len(i), points.shape[1])
    images = Images(points.shape[1], box, periodic)
    for e, (a, b) in enumerate(zip(i, j, strict=True)):
        true = vector_of(points, a, b, S[e], box, periodic)
        square = dot(true, true)
        apart = along(images, between(exact(points[a]), exact(points[b])))
        least = dot(along(images, true), along(images, true))
        found = sorted((length, T) for T, _, length in images.within(apart, least))
        assert found[0] == (least, tuple(S[e].tolist())), (a, b, S[e], found[:3])
        length = Fraction(math.isqrt(square.numerator * square.denominator << 400)) / (
            square.denominator << 200
        )
        assert ulps(d[e], length) <= 1
        unit = Fraction(math.ulp(float(max(length, Fraction(5e-324)))))
        for k, component in enumerate(true):
            assert abs(Fraction(float(D[e, k])) - component) <= unit
    again = call(hs.measure, points, i, j, S, box=box, periodic=periodic, **options)
    for one, other in zip((d, D, S), again, strict=True):
        np.testing.assert_array_equal(one, other)
    return d, D, S


def some_pairs(rng, n, m):
    return rng.integers(0, n, m), rng.integers(0, n, m)


@pytest.mark.parametrize("dim", range(1, 9))
def test_nearest_images_are_those_of_rational_arithmetic(dim):
    for kind in ("open", "upright", "mixed", "skewed", "slanted"):
        rng = np.random.default_rng(dim)
        points = rng.uniform(-3.0, 4.0, (12, dim))
        box = np.diag(rng.uniform(0.5, 2.0, dim))
        periodic = None
        if kind == "open":
            box = None
        elif kind == "mixed":
            periodic = rng.integers(0, 2, dim).astype(bool)
        elif kind == "skewed":
            for row in range(1, dim):
                box[row] += rng.integers(-3, 4) * box[row - 1] * 1.01
        elif kind == "slanted":
            box = box + rng.uniform(-0.3, 0.3, (dim, dim))
            periodic = np.arange(dim) != dim // 2
        i, j = some_pairs(rng, 12, 20 if dim < 5 else 4)
        check(points, i, j, box, periodic)


BCC = np.array([[-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0]])
FCC = np.array([[0.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0]])


@pytest.mark.parametrize(
    "box",
    [
        np.eye(3), BCC, FCC, FCC + [[0, 0, 0], [3, 3, 0], [5, 0, 5]], np.diag([1.0, -2.0, 0.5]),
        [[1.0, 0.0, 0.0], [4.0, 1.0, 0.0], [7.0, -3.0, 1.0]],
        [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
    ],
)  # fmt: skip
def test_ties_go_to_the_least_shift(box):
    grid = np.array(list(itertools.product([0.0, 0.25, 0.5, 1.0], repeat=3)))
    points = np.concatenate([grid, grid @ np.asarray(box) + [3.0, 0.0, 1.0]])
    j = np.arange(len(points))
    check(points, np.zeros_like(j), j, box)
    _, _, S = check(points[:2] * 0.0, [0, 1, 0], [0, 0, 1], box)
    assert not S.any()


def test_a_last_bit_decides():
    below, above = np.nextafter(0.5, 0.0), np.nextafter(0.5, 1.0)
    points = np.array([[0.0], [below], [0.5], [above], [1e9 + 0.5]])
    _, _, S = check(points, [0] * 5, range(5), [1.0])
    assert S[:, 0].tolist() == [0, 0, -1, -1, -1_000_000_001]
    points = np.array([[0.0, 0.0], [0.5, below], [0.5, above], [0.5, 0.5]])
    check(points, [0] * 4, range(4), [[1.0, 0.0], [0.5, 1.0]])


def test_far_points_and_huge_coordinates():
    rng = np.random.default_rng(4)
    points = rng.uniform(0.0, 1.0, (10, 3)) + rng.integers(-(2**30), 2**30, (10, 3))
    i, j = some_pairs(rng, 10, 30)
    check(points, i, j, np.eye(3))
    check(points, i, j, np.eye(3) + 0.1)
    slab = rng.uniform(0.0, 1.0, (10, 3))
    slab[::2, 2] = 1e300
    hexagonal = [[1.0, 0.0, 0.0], [0.5, 0.75, 0.0], [0.0, 0.0, 0.0]]
    check(slab, i, j, hexagonal, [True, True, False])
    check(slab, i, j, [1.0, 1.0, 0.0], [True, True, False])
    wires = np.array([[1e300, 0.0], [0.0, 1e-300], [3e300, 1e-299], [-1e300, -7e-300]])
    check(wires, [0, 0, 1, 3], [1, 2, 2, 0], [1.5e300, 3e-300])
    for exponent in (-1070, -500, 500, 1020):
        scaled = np.ldexp(np.round(slab[1::2] * 8), exponent)
        check(scaled, [0, 1, 2, 3], [1, 2, 0, 4], np.ldexp(np.eye(3) * 3.0, exponent))
        check(scaled, [0, 1, 2, 3], [1, 2, 0, 4], np.ldexp(BCC * 3.0, exponent))


POINTS, BOX = np.zeros((3, 2)), [1.0, 1.0]


@pytest.mark.parametrize(
    ("arguments", "options", "error", "message"),
    [
        (([[0]], [1]), {}, ValueError, "i must have shape (m,), got (1, 1)"),
        (([0, 1], [0]), {}, ValueError, "i and j must have the same length, got 2 and 1"),
        (([0], [1], [[0]]), {}, ValueError, "S must have shape (1, 2), got (1, 1)"),
        (([0], [1], [[2.0**62, 0]]), {}, OverflowError, "below 2**62"),
        (([0], [1], [[1, 0]]), {}, ValueError, "pair 0: "),
        (([0], [1], [[0, 1]]), {"box": BOX, "periodic": [1, 0]}, ValueError, "pair 0: "),
        (([0], [1], [[2**40, 0]]), {"box": BOX}, OverflowError, "pair 0: "),
        (([0], [1]), {"quantities": "ij"}, ValueError, "letters d D S"),
        (([0], [1]), {"quantities": "dd"}, ValueError, "each at most once"),
        (([0], [1]), {"periodic": True}, ValueError, "periodic needs a box"),
        (([0], [1]), {"memory_limit": 8}, MemoryError, "8 bytes are allowed"),
    ],
)
def test_what_is_wrong_is_said(arguments, options, error, message):
    with pytest.raises(error, match=re.escape(message)):
        call(hs.measure, POINTS, *arguments, **options)


def test_what_no_float_holds_is_refused():
    far = [[0.0, 0.0], [1e300, 0.0], [-1.7e308, 0.0], [1.7e308, 0.0]]
    with pytest.raises(OverflowError, match=re.escape("pair 1: a point lies too many box")):
        hs.measure(far, [0, 0], [0, 1], box=BOX)
    with pytest.raises(OverflowError, match="pair 1: the vector is too long"):
        hs.measure(far, [0, 2], [1, 3], quantities="d")
    with pytest.raises(OverflowError, match=re.escape("pair 0: a point lies too many box")):
        hs.measure([[0.0, 0.0], [1e12, 0.0]], [0], [1], box=BOX)
    assert hs.measure([[0.0, 0.0], [1e12, 0.0]], [0], [1], box=BOX, quantities="d")[0] == 0.0
    with pytest.raises(ValueError, match="finite"):
        hs.measure([[0.0, np.nan]], [], [])
