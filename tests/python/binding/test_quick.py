# SPDX-License-Identifier: BSD-3-Clause
"""Calls that go to C before Python fills in what was left out: to the same answers and errors."""

import inspect
import pickle
import sys

import numpy as np
import pytest

import halfshell as hs
from halfshell import _core

POINTS = np.random.default_rng(32).random((40, 3)) * 4.0
LENGTHS = np.array([4.0, 4.5, 5.0])
USUAL = (None, None, None, None, True, "exact", None, None, None, None)
PLACES = {"box": 2, "periodic": 3, "inclusive": 4}

CALLS = [
    {},
    {"box": LENGTHS},
    {"box": LENGTHS, "periodic": (True, False, True), "inclusive": False},
    {"precision": "double", "kernel": "scalar", "memory_limit": 1e9, "threads": 2},
]


def test_same_answer_as_the_function():
    for how in CALLS:
        assert hs.count_pairs(POINTS, 1.5, **how) == hs.count_pairs.__wrapped__(POINTS, 1.5, **how)
        for more in ({}, {"quantities": "ijdDS", "sort": True, "index_dtype": np.int32}):
            one = hs.pairs(POINTS, 1.5, **how, **more)
            other = hs.pairs.__wrapped__(POINTS, 1.5, **how, **more)
            for a, b in zip(one, other, strict=True):
                assert a.dtype == b.dtype
                assert a.tobytes() == b.tobytes()


WRONG = [
    {"threads": -1},
    {"threads": 1.5},
    {"kernel": "x"},
    {"precision": "half"},
    {"memory_limit": -1.0},
    {"periodic": (True, True)},
    {"box": np.zeros(3)},
    {"quantities": "q"},
    {"index_dtype": np.int16},
    {"out": (np.empty(1, np.int64), np.empty(1, np.int64))},
]


def test_same_errors_as_the_function():
    for how in WRONG:
        for search in (hs.pairs, hs.count_pairs):
            raised = []
            for function in (search, search.__wrapped__):
                with pytest.raises((TypeError, ValueError)) as caught:
                    function(POINTS, 1.5, **how)
                raised.append((caught.type, str(caught.value)))
            assert raised[0] == raised[1]


def test_plain_calls_do_not_reach_the_function(monkeypatch):
    def refuse(*arguments):
        raise AssertionError("the function was called")

    out = np.empty(999, np.int64), np.empty(999, np.int64)
    seen = []
    with monkeypatch.context() as context:
        context.setattr(_core, "plain", refuse)
        hs.pairs(POINTS, 1.5, box=LENGTHS, quantities="ij", sort=True, out=out, threads=1)
        hs.pairs(points=POINTS, cutoff=1.5, progress=seen.append)
        hs.count_pairs(POINTS, 1.5, box=LENGTHS, periodic=True)
        with pytest.raises(AssertionError):
            hs.pairs(POINTS, 1.5, box=hs.Box(LENGTHS))
        with pytest.raises(ValueError, match="cutoff"):
            hs.pairs(POINTS, -1.5)


def test_it_is_the_function_to_everyone_else():
    for function in (hs.pairs, hs.count_pairs):
        assert inspect.isfunction(function)
        assert "cutoff" in inspect.signature(function).parameters
        assert pickle.loads(pickle.dumps(function)) is function
        with pytest.raises(TypeError, match=rf"{function.__name__}\(\) takes 2 positional"):
            function(POINTS, 1.5, LENGTHS)
        with pytest.raises(TypeError, match=rf"{function.__name__}\(\) missing 1 required"):
            function(POINTS)
        with pytest.raises(TypeError, match="multiple values"):
            function(POINTS, 1.5, points=POINTS)
        with pytest.raises(TypeError, match=r"'pbc': did you mean periodic=\?"):
            function(POINTS, 1.5, pbc=True)


def quick(options, usual=USUAL, places=PLACES, function=_core.count_pairs):
    return _core.quick(function, usual, places, POINTS, 1.5, options)


def test_options_go_to_their_places():
    how = {"box": LENGTHS, "inclusive": False}
    assert quick(how) == hs.count_pairs(POINTS.tolist(), 1.5, **how)
    assert quick({"other": 1}) is NotImplemented
    assert quick({"box": LENGTHS.tolist()}) is NotImplemented
    for place in (-1, len(USUAL)):
        assert quick(how, places={"box": place, "inclusive": 4}) is NotImplemented
    with pytest.raises(TypeError):
        quick(how, places={"box": "2", "inclusive": 4})
    with pytest.raises(OverflowError):
        quick(how, places={"box": 1 << 80, "inclusive": 4})


def test_other_arguments_are_refused():
    for usual in ((), (1,), list(USUAL), 2 * USUAL):
        with pytest.raises(TypeError, match="quick takes"):
            quick({}, usual=usual)
    with pytest.raises(TypeError, match="quick takes"):
        quick([])
    with pytest.raises(TypeError, match="quick takes"):
        quick({}, places=[])
    with pytest.raises(TypeError, match="quick takes"):
        _core.quick()
    for function in (len, None, _core.quick, hs.pairs):
        with pytest.raises(TypeError):
            quick({}, function=function)
    with pytest.raises(TypeError, match="arguments"):
        quick({}, usual=USUAL[:5])


def test_arguments_are_not_kept():
    arguments = (POINTS, LENGTHS, Ellipsis)
    before = [sys.getrefcount(argument) for argument in arguments]
    for _ in range(100):
        quick({"box": LENGTHS})
        quick({"box": LENGTHS, "other": 1})
        quick({"box": ...})
        with pytest.raises(ValueError, match="precision"):
            quick({"box": LENGTHS}, usual=(*USUAL[:5], "none", *USUAL[6:]))
    assert [sys.getrefcount(argument) for argument in arguments] == before


def test_options_that_change_during_the_search_are_held():
    options = {"box": LENGTHS.copy()}

    def clear(fraction):
        options.clear()

    usual = (*USUAL[:8], clear, None)
    n = _core.quick(_core.count_pairs, usual, PLACES, POINTS, 40.0, options)
    assert n == hs.count_pairs(POINTS, 40.0, box=LENGTHS)
    assert not options
