# SPDX-License-Identifier: BSD-3-Clause
"""`VerletList` refuses arguments when it is made, in the words of `pairs`."""

import numpy as np
import pytest

import halfshell as hs

WRONG = [
    {"box": [1.0, 1.0, np.nan]},
    {"box": np.ones((3, 3))},
    {"box": [1.0, 1.0, 0.0]},
    {"box": True},
    {"box": "a"},
    {"box": print},
    {"box": [1.0, 2.0, 3.0], "periodic": [True, False]},
    {"periodic": "a"},
    {"periodic": [2, 0, 0]},
    {"periodic": np.ones((2, 2), bool)},
    {"inclusive": 2},
    {"kernel": "none"},
    {"kernel": 3},
    {"threads": 0},
    {"threads": 1.5},
    {"threads": 1025},
    {"memory_limit": -1},
    {"memory_limit": "a"},
    {"memory_limit": 10**400},
]


def refusal(call):
    with pytest.raises((TypeError, ValueError, OverflowError)) as caught:
        call()
    return type(caught.value), str(caught.value)


@pytest.mark.parametrize("wrong", WRONG, ids=str)
def test_arguments_are_refused_at_once(wrong):
    at_once = refusal(lambda: hs.VerletList(1.0, **wrong))
    assert at_once == refusal(lambda: hs.pairs(np.zeros((1, 3)), 1.0, **wrong))


@pytest.mark.parametrize("shape", [(0,), (9,), (2, 3), (1, 2, 2), (9, 9)])
def test_shapes_that_fit_no_points_are_refused_at_once(shape):
    with pytest.raises(ValueError, match=r"box must have shape \(d,\) or \(d, d\) with"):
        hs.VerletList(1.0, box=np.ones(shape))


def test_periodic_without_a_box_waits_for_one():
    pair_list = hs.VerletList(1.0, periodic=[True, False])
    with pytest.raises(ValueError, match="periodic needs a box"):
        pair_list.update([[0.1, 0.1], [1.9, 0.1]])
    assert pair_list.update([[0.1, 0.1], [1.9, 0.1]], box=[2.0, 2.0])
    assert len(pair_list.pairs(quantities="i")) == 1


@pytest.mark.parametrize(
    "scene",
    [{"box": 2.0}, {"box": 2.0, "periodic": [True, False]}, {"box": hs.Box([2.0, 3.0])}],
    ids=str,
)
def test_boxes_of_points_in_two_dimensions(scene):
    points = [[0.1, 0.1], [1.9, 0.1]]
    pair_list = hs.VerletList(0.5, **scene)
    assert pair_list.update(points)
    assert len(pair_list.pairs(quantities="i")) == hs.count_pairs(points, 0.5, **scene) == 1


def test_whether_memory_suffices_is_said_by_the_step():
    pair_list = hs.VerletList(1.0, memory_limit=0)
    with pytest.raises(MemoryError):
        pair_list.update([[0.0]])
