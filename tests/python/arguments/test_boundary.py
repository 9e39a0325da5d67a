# SPDX-License-Identifier: BSD-3-Clause
"""Any object as any argument: a right answer or a documented error that names it; nothing else.

HALFSHELL_FUZZ_ROUNDS=9 goes on for so many rounds of further examples in each test, the same in
each run; HALFSHELL_FUZZ_SECONDS=60 for so many seconds in all. Rounds are drawn with the seeds
HALFSHELL_FUZZ_SEED (1 without it), the next number, and so on; a failure says which.
"""

import faulthandler
import functools
import inspect
import itertools
import os
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

import boundary
import halfshell as hs
from boundary import CUBE, POINTS, anything, calls, dressed, laid_out, outcome
from halfshell._check.reference import reference_pairs

FUZZ_ROUNDS = int(os.environ.get("HALFSHELL_FUZZ_ROUNDS", "0"))
FUZZ_SECONDS = float(os.environ.get("HALFSHELL_FUZZ_SECONDS", "0"))
FUZZ_SEED = int(os.environ.get("HALFSHELL_FUZZ_SEED", "1"))
SLOWDOWN = float(os.environ.get("HALFSHELL_SLOWDOWN", "1"))  # more under sanitizers
STUCK = 60 * SLOWDOWN  # seconds after which a call that hangs is ended, with its traceback
CALLS = calls()
ARGUMENTS = [(name, argument) for name, (_, usual) in CALLS.items() for argument in usual]
SHARES = len(ARGUMENTS) + 3 * 20  # of the seconds: one for each argument, 20 for each other test


def fuzz(strategy, check, examples, shares=20):
    """Check examples, then, if that is wanted, rounds of as many others."""
    settled = {"deadline": None, "database": None, "suppress_health_check": list(HealthCheck)}
    end = time.monotonic() + FUZZ_SECONDS * shares / SHARES

    @functools.wraps(check)
    def watched(**drawn):
        faulthandler.dump_traceback_later(STUCK, exit=True)
        try:
            check(**drawn)
        finally:
            faulthandler.cancel_dump_traceback_later()

    def run(test, **how):
        settings(max_examples=examples, **settled, **how)(given(strategy)(test))()

    run(watched, derandomize=True)
    for number in itertools.count(FUZZ_SEED):
        if number >= FUZZ_SEED + FUZZ_ROUNDS and time.monotonic() >= end:
            break
        try:
            run(seed(number)(watched), derandomize=False)
        except BaseException as error:
            error.add_note(f"drawn with HALFSHELL_FUZZ_SEED={number}")
            raise


# ---- anything at all -----------------------------------------------------------------------


def arguments_of(name, wild):
    """The usual arguments of a function, with wild ones in their place."""
    _, usual = CALLS[name]
    arguments = usual | wild
    limited = name.startswith("pairs")
    if "cutoff" in wild and not limited and "box" not in wild:
        arguments |= {"box": None, "periodic": None}  # or there are more pairs than we wait for
    return arguments


def plain_truth(arguments):
    """The pairs by exact arithmetic, where the scene is small and made of plain objects."""
    plain = (float, int, bool, list, tuple, np.ndarray, np.float64, type(None))
    points, cutoff, box, periodic = (arguments[k] for k in ("points", "cutoff", "box", "periodic"))
    if not all(type(x) in plain for x in (points, cutoff, box, periodic)):
        return None
    points = np.asarray(points, np.float64)
    points = np.empty((0, 3)) if points.shape == (0,) else points
    box = None if box is None else np.asarray(box, np.float64)
    if type(periodic) in (np.ndarray, list):
        periodic = np.asarray(periodic, bool)
        periodic = bool(periodic) if periodic.ndim == 0 else periodic
    cutoff = float(cutoff)
    return reference_pairs(points, cutoff, box, periodic, arguments["inclusive"])


def check_answer(name, arguments, answer):
    """Where an answer was given it is the right one."""
    if name != "pairs" or len(answer) != 3 or len(answer[0]) > 500:
        return
    truth = plain_truth(arguments)
    if truth is not None:
        i, j, S = (column.tolist() for column in answer)
        assert list(zip(i, j, map(tuple, S))) == truth


@pytest.mark.parametrize(("name", "argument"), ARGUMENTS)
def test_any_object_as_one_argument(name, argument):
    def check(value):
        arguments = arguments_of(name, {argument: value})
        if name == "pairs" and argument != "quantities":
            arguments["quantities"] = "ijS"
        result = outcome(CALLS[name][0], slowdown=SLOWDOWN, **arguments)
        if result.error is None:
            if argument in ("points", "cutoff", "box", "periodic", "inclusive"):
                check_answer(name, arguments, result.answer)
        elif not isinstance(result.error, MemoryError):
            assert boundary.names(result.message, argument), result.message
            assert len(result.message) < 1000

    fuzz(anything(), check, 15, shares=1)
    hs.set_cache_limit(2**28)


@st.composite
def several_wild(draw):
    """A function and two or three of its arguments, wild."""
    name = draw(st.sampled_from([name for name, (_, usual) in CALLS.items() if len(usual) > 1]))
    most = [a for a in CALLS[name][1] if a != "memory_limit"]  # which keeps results small
    if "cutoff" in most and draw(st.booleans()):
        most.remove("cutoff")
    elif "box" in most:
        most.remove("box")
    chosen = draw(st.lists(st.sampled_from(most), min_size=2, max_size=3, unique=True))
    return name, {argument: draw(anything()) for argument in chosen}


@pytest.mark.slow
def test_any_objects_as_several_arguments():
    def check(drawn):
        name, wild = drawn
        result = outcome(CALLS[name][0], slowdown=SLOWDOWN, **arguments_of(name, wild))
        if result.error is not None and not isinstance(result.error, MemoryError):
            mentioned = [a for a in CALLS[name][1] if boundary.names(result.message, a)]
            assert mentioned, result.message

    fuzz(several_wild(), check, 300)


# ---- flags ---------------------------------------------------------------------------------

TABLE = hs.neighbors(POINTS, 0.5, quantities="jdDS")
NODES = [hs.NodeList("a", POINTS, [0.3] * len(POINTS))]
ONE_EACH = hs.bricks(POINTS, 0.5, 1)
DYNAMIC = hs.DynamicCellList(3, 1.0)
#: Every public function and method with arguments that are bools, but for the flag.
FLAGS = {
    "Brick.count_pairs": lambda **how: ONE_EACH[0].count_pairs(POINTS, **how),
    "Brick.neighbors": lambda **how: ONE_EACH[0].neighbors(POINTS, **how),
    "Brick.pairs": lambda **how: ONE_EACH[0].pairs(POINTS, **how),
    "CellList.coordination": lambda **how: hs.CellList(POINTS, 0.5).coordination(**how),
    "CellList.count_pairs": lambda **how: hs.CellList(POINTS, 0.5).count_pairs(**how),
    "CellList.for_each_pair": lambda **how: hs.CellList(POINTS, 0.5).for_each_pair(print, **how),
    "CellList.iter_pairs": lambda **how: list(hs.CellList(POINTS, 0.5).iter_pairs(**how)),
    "CellList.neighbors": lambda **how: hs.CellList(POINTS, 0.5).neighbors(**how),
    "CellList.pairs": lambda **how: hs.CellList(POINTS, 0.5).pairs(**how),
    "CellList.query": lambda **how: hs.CellList(POINTS, 0.5).query(POINTS, **how),
    "Connectivity": lambda **how: hs.Connectivity(NODES, **how),
    "DynamicCellList": lambda **how: hs.DynamicCellList(3, 1.0, **how),
    "DynamicCellList.within": lambda **how: DYNAMIC.within(POINTS[0], 1.0, **how),
    "DynamicCellList.within_many": lambda **how: DYNAMIC.within_many(POINTS, 1.0, **how),
    "NeighborTable.to_pairs": TABLE.to_pairs,
    "NeighborTable.triplets": TABLE.triplets,
    "VerletList": lambda **how: hs.VerletList(0.5, **how),
    "VerletList.pairs": lambda **how: kept().pairs(**how),
    "clusters": lambda **how: hs.clusters(POINTS, 0.5, box=CUBE, **how),
    "coordination": lambda **how: hs.coordination(
        POINTS, np.full((2, 2), 0.5), types=[0, 1, 0, 1], **how
    ),
    "count_pairs": lambda **how: hs.count_pairs(POINTS, 0.5, **how),
    "explain": lambda **how: hs.explain(POINTS, 0.5, **how),
    "for_each_pair": lambda **how: hs.for_each_pair(POINTS, 0.5, print, **how),
    "iter_pairs": lambda **how: list(hs.iter_pairs(POINTS, 0.5, **how)),
    "neighbors": lambda **how: hs.neighbors(POINTS, 0.5, **how),
    "pairs": lambda **how: hs.pairs(POINTS, 0.5, **how),
    "pairs_between": lambda **how: hs.pairs_between(POINTS, POINTS, 0.5, **how),
    "trajectory_pairs": lambda **how: list(hs.trajectory_pairs([POINTS], 0.5, **how)),
    "verify": lambda **how: hs.verify(POINTS, 0.5, [0], [1], **how),
}
MADE_BY_OTHERS = {
    "NeighborTable",
    "RadialDistribution",
    "Verdict",
}  # users call no constructor of theirs


def kept():
    made = hs.VerletList(0.5)
    made.update(POINTS)
    return made


def flags_of(function):
    """Names of the arguments that are bools."""
    parameters = inspect.signature(function).parameters.values()
    return [one.name for one in parameters if one.annotation in ("bool", "bool | None")]


def public_flags():
    """(name, flag) of everything public."""
    for name in hs.__all__:
        thing = getattr(hs, name)
        members = [(name, thing)] if callable(thing) and name not in MADE_BY_OTHERS else []
        if inspect.isclass(thing):
            own = inspect.getmembers(thing, inspect.isfunction)
            members += [(f"{name}.{k}", member) for k, member in own if k[0] != "_"]
        for full_name, member in members:
            yield from ((full_name, flag) for flag in flags_of(member))


def test_flags_are_bools():
    for name, flag in sorted(set(public_flags())):
        call = FLAGS[name]
        for value in (True, False, np.True_, np.False_):
            if "for_each_pair" not in name:  # whose callback has to be of C
                call(**{flag: value})
        for value in (
            0,
            1,
            2,
            0.0,
            "True",
            b"",
            [],
            [True],
            np.int64(1),
            np.array(True),
            np.array([1]),
        ):
            with pytest.raises(TypeError, match=flag):
                call(**{flag: value})


def test_excluded_pairs_have_two_columns():
    for shape in ((4, 0), (1, 0), (0, 0), (0, 3), (0, 1), (0, 2, 0)):
        with pytest.raises(ValueError, match=r"exclude must have shape"):
            hs.pairs(POINTS, 0.5, exclude=np.empty(shape))
        with pytest.raises(ValueError, match=r"exclude must have shape"):
            hs.Connectivity(NODES, exclude=np.empty(shape))


def test_no_excluded_pairs():
    count = hs.count_pairs(POINTS, 0.5)
    for nothing in ([], np.empty((0, 2)), np.empty((0, 2), int)):
        assert hs.count_pairs(POINTS, 0.5, exclude=nothing) == count
    pairs = len(hs.Connectivity(NODES).pairs)
    for nothing in ([], np.empty((0, 4)), np.empty((0, 4), int)):
        assert len(hs.Connectivity(NODES, exclude=nothing).pairs) == pairs


# ---- good scenes in odd clothes ------------------------------------------------------------


@st.composite
def scenes(draw):
    """A small scene of exact ties, and the same scene in other objects."""
    ndim = draw(st.integers(1, 3))
    n = draw(st.integers(0, 6))
    eighths = st.integers(-16, 16)
    rows = draw(st.lists(st.lists(eighths, min_size=ndim, max_size=ndim), min_size=n, max_size=n))
    values = np.array(rows, np.float64).reshape(n, ndim)
    dtype = np.dtype(draw(st.sampled_from(["f8", ">f8", "f4", ">f4", "f2", "i2", ">i8", "?", "O"])))
    if dtype.kind == "f":
        values /= 8
    points = values.astype(dtype)
    truth = {"points": points.astype(np.float64), "cutoff": draw(st.integers(0, 12)) / 8}
    truth["inclusive"] = draw(st.booleans())
    box = None
    if draw(st.booleans()):
        box = np.diag(draw(st.lists(st.integers(1, 3), min_size=ndim, max_size=ndim))).astype(float)
        box += np.tril(draw(st.integers(-2, 2)) / 4 * np.ones((ndim, ndim)), -1)
        truth["box"] = box
        truth["periodic"] = draw(st.lists(st.booleans(), min_size=ndim, max_size=ndim))
    coat = st.sampled_from(boundary.COATS)
    layout = st.sampled_from(boundary.LAYOUTS[:-2] + ("read-only",))  # not one row for all
    worn = dict(truth)
    worn["points"] = dressed(laid_out(points, draw(layout)), draw(coat)) if n else points
    cutoff = truth["cutoff"]
    worn["cutoff"] = draw(
        st.sampled_from([cutoff, np.float32(cutoff), np.array(cutoff), np.array([[cutoff]])[0, 0]])
    )
    if box is not None:
        worn["box"] = dressed(laid_out(box, draw(layout)), draw(coat))
        flags = np.array(truth["periodic"])
        worn["periodic"] = draw(
            st.sampled_from([flags, flags.tolist(), flags.astype(">i2"), flags[::-1].copy()[::-1]])
        )
    return truth, worn


def test_a_scene_in_any_clothes_has_the_same_pairs():
    def check(drawn):
        truth, worn = drawn
        expected = reference_pairs(**truth)
        found = outcome(hs.pairs, slowdown=SLOWDOWN, **worn, quantities="ijS", sort=True)
        assert found.error is None, found.message
        i, j, S = (column.tolist() for column in found.answer)
        assert list(zip(i, j, map(tuple, S))) == expected
        counted = outcome(hs.count_pairs, slowdown=SLOWDOWN, **worn)
        assert counted.answer == len(expected)
        i, j, S = found.answer
        verdict = outcome(hs.verify, slowdown=SLOWDOWN, i=i, j=j, S=S, **worn)
        assert verdict.answer is not None and verdict.answer.ok, verdict.message

    fuzz(scenes(), check, 150)


@st.composite
def outputs(draw):
    """Arrays for `out` of the scene that has six pairs or so, most of them not quite right."""
    dtypes = st.sampled_from(["i8", "i8", "i8", "i4", ">i8", "f8", "u8", "O", "?"])
    length = draw(st.sampled_from([0, 1, 3, 20, 20, 20]))
    rows = st.sampled_from([(length,), (length,), (length, 3), (length, 2), ()])
    made = [np.zeros(draw(rows), draw(dtypes)) for _ in range(draw(st.sampled_from([2, 2, 2, 1])))]
    if draw(st.booleans()):
        made = [laid_out(array, draw(st.sampled_from(boundary.LAYOUTS))) for array in made]
    if draw(st.integers(0, 4)) == 0:
        made = [made[0], made[0][1:] if made[0].ndim else made[0]]
    return tuple(made) if draw(st.integers(0, 4)) else made


def test_any_arrays_to_write_to():
    expected = hs.pairs(POINTS, 1.0, sort=True)

    def check(out):
        options = {"sort": True, "out": out}
        result = outcome(hs.pairs, POINTS, 1.0, may_change=True, slowdown=SLOWDOWN, **options)
        if result.error is None:
            for array, column, whole in zip(result.answer, expected, out, strict=True):
                assert array.tolist() == column.tolist()
                assert len(array) == 0 or np.shares_memory(array, whole)
        else:
            assert "out" in result.message

    fuzz(outputs(), check, 100)
