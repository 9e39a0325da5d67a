# SPDX-License-Identifier: BSD-3-Clause
"""Whatever holds real numbers works as input; the numbers count, not how they are stored."""

import itertools

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import as_set, check, same_arrays

BOX = np.array([[1.5, 0.0, 0.0], [0.25, 1.75, 0.0], [-0.5, 0.125, 2.0]])
CUTOFF = 0.875


@pytest.fixture
def points(rng):
    """Coordinates that float16 and float32 hold exactly."""
    return rng.integers(-32, 32, (30, 3)) / 16


def solve(points, box=BOX, **how):
    return call(hs.pairs, points, CUTOFF, box=box, quantities="ijSdD", **how)


def test_integers_and_booleans_are_taken_as_they_are(rng):
    for dtype in "bhilqBHILQ?":
        for kernel in hs.kernels():
            whole = rng.integers(0, 2 if dtype == "?" else 12, (25, 3)).astype(dtype)
            plain = whole.astype(float)
            assert same_arrays(
                call(hs.pairs, whole, 3, quantities="ijd", kernel=kernel),
                call(hs.pairs, plain, 3.0, quantities="ijd", kernel=kernel),
            )
            assert same_arrays(
                call(hs.pairs, whole, 3, box=[5, 6, 7], quantities="ijdS", kernel=kernel),
                call(hs.pairs, plain, 3.0, box=[5.0, 6.0, 7.0], quantities="ijdS", kernel=kernel),
            )


def test_large_integers_that_float64_holds_are_exact():
    points = np.array([[2**53, 0], [2**53 - 1, 0], [2**62, 2**40], [2**62, 2**40 + 1]])
    assert as_set(*hs.pairs(points, 1)) == {(0, 1, ()), (2, 3, ())}
    assert as_set(*hs.pairs(points.astype(np.uint64), 1)) == {(0, 1, ()), (2, 3, ())}


def test_float32_values_are_not_rounded_again(rng):
    # 0.1f is 0.100000001490116...: a pair at that distance is beyond a cutoff of 0.1.
    points = np.array([[0.0], [0.1]], np.float32)
    assert check(points, 0.1) == set()
    assert len(check(points, np.float32(0.1))) == 1
    crowd = rng.random((60, 3)).astype(np.float32)
    box = rng.random((3, 3)).astype(np.float32) + np.eye(3, dtype=np.float32)
    check(crowd, 0.3, box)


def test_float32_far_from_the_origin(rng):
    # |a|^2 + |b|^2 - 2 ab would cancel here.
    points = (rng.random((40, 3)) * 4 + 1e6).astype(np.float32)
    for cutoff in (0.5, 1.0, 1.5):
        check(points, cutoff)
        check(points, cutoff, [4.0, 4.0, 4.0])
    points = np.array([[1e8, 1e8], [1e8 + 8, 1e8], [1e8, 1e8 + 16]], np.float32)
    assert check(points, 8.0) == {(0, 1, (0, 0))}


def test_float32_overflow_and_subnormals():
    big = np.array([[3.4e38, 0.0], [-3.4e38, 0.0], [3.4e38, 3e38]], np.float32)
    for cutoff in (1.0, 3.1e38, 6.9e38, 1e39):
        check(big, cutoff)
    tiny = np.float32(1e-45) * np.array([[0, 0], [1, 0], [3, 4], [0, 5]], np.float32)
    for cutoff in (0.0, float(tiny[1, 0]), 5 * float(tiny[1, 0])):
        check(tiny, cutoff)


def test_every_form_of_periodic(points):
    for flags in itertools.product([False, True], repeat=3):
        expected = solve(points, periodic=np.array(flags))
        for form in (list(flags), tuple(flags), tuple(map(np.bool_, flags))):
            assert same_arrays(solve(points, periodic=form), expected)


def test_one_flag_stands_for_all_axes(points):
    assert same_arrays(solve(points, periodic=True), solve(points))
    assert same_arrays(solve(points, periodic=np.True_), solve(points))
    assert same_arrays(solve(points, periodic=False), solve(points, periodic=[False] * 3))
    assert same_arrays(
        hs.pairs(points, CUTOFF, periodic=False), hs.pairs(points, CUTOFF, periodic=[False] * 3)
    )


def test_dlpack_producers_are_understood(points):
    class Tensor:
        """Nothing but the exchange protocol, like an array of another library."""

        def __init__(self, array):
            self.array = array

        def __dlpack__(self, **how):
            return self.array.__dlpack__(**how)

        def __dlpack_device__(self):
            return self.array.__dlpack_device__()

    assert same_arrays(solve(Tensor(points)), solve(points))
    assert same_arrays(solve(Tensor(points.astype(np.float32))), solve(points.astype(np.float32)))
