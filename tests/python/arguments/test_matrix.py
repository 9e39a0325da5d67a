# SPDX-License-Identifier: BSD-3-Clause
"""Each argument of everything public, with each kind of bad value and with anything at all: a
documented error that names the argument, in few frames, or a right answer; nothing else.

HALFSHELL_FUZZ_ROUNDS=9 goes on for so many rounds of further examples in each test, the same in
each run; HALFSHELL_FUZZ_SECONDS=60 for so many seconds in all. Rounds are drawn with the seeds
HALFSHELL_FUZZ_SEED (1 without it), the next number, and so on; a failure says which.
"""

import datetime
import decimal
import faulthandler
import fractions
import functools
import itertools
import os
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

import boundary
import halfshell as hs
from boundary import (
    INF,
    NAN,
    POINTS,
    answering,
    anything,
    called_with,
    cyclic,
    dressed,
    frames_of_ours,
    laid_out,
    outcome,
    raising,
)
from halfshell._check.reference import reference_pairs

SLOWDOWN = float(os.environ.get("HALFSHELL_SLOWDOWN", "1"))  # more under sanitizers
CALLS = dict(boundary.public_calls())
ARGUMENTS = [
    (name, argument) for name, function in CALLS.items()
    for argument in boundary.arguments_of(name, function)
]  # fmt: skip

# ---- kinds of bad values -------------------------------------------------------------------

MINE = RuntimeError("mine")
WRONG = np.zeros((2, 2, 2))


def rows(value, dtype=float):
    """Usual points with another coordinate somewhere."""
    array = POINTS.astype(dtype)
    array[2, 1] = value
    return array


#: Wrong wherever a value is taken.
OBJECTS = {
    "object": object(), "complex": 1j, "complex array": POINTS * 1j, "function": len,
    "date": np.datetime64("2020-01-01"), "dates": np.zeros((4, 3), "M8[s]"), "void": np.void(b"12"),
    "records": np.zeros(4, [("x", float), ("y", float)]), "set": {1.0, 2.0},
    "surrogate": "\ud800", "far": "far", "empty word": "", "bytes": b"1", "words": ["a", "b"],
    "nested": cyclic(1), "fraction": fractions.Fraction(1, 3), "decimal": decimal.Decimal("0.1"),
    "a day": datetime.date(2020, 1, 1), "array raises": raising(("__array__",), MINE),
    "number raises": raising(("__float__",), MINE), "index raises": raising(("__index__",), MINE),
    "class raises": raising(("__class__",), MINE), "nothing to show":
    raising(("__repr__", "__str__"), MINE), "shape raises": raising(("shape", "ndim"), MINE),
    "all raises": raising(("__getattr__",), MINE), "iteration raises": raising(("__iter__",), MINE),
    "length raises": raising(("__len__", "__getitem__"), MINE),
    "says float": answering(__class__=float), "says array": answering(__class__=np.ndarray),
    "says word": answering(__class__=str), "says masked": answering(__class__=np.ma.MaskedArray),
    "says tuple": answering(__class__=tuple), "long word": "x" * 10**5, "words nested": cyclic(2),
    "truth raises": raising(("__bool__",), MINE), "words raise": raising(("__array__",),
    boundary.WithoutWords()), "no equality": raising(("__eq__", "__hash__"), MINE),
}  # fmt: skip
NOT_FINITE = {"nan": NAN, "inf": INF, "-inf": -INF, "float32 nan": np.float32(NAN)}
NUMBER = {
    **OBJECTS, **NOT_FINITE, "negative": -1.0, "least negative": -5e-324, "three axes": WRONG,
    "huge": 10**400, "not held": 2**53 + 1, "masked": np.ma.array(1.0, mask=True),
    "dict": {"H": 1.0}, "list of words": ["1.0"], "flag": True, "flag of NumPy": np.True_,
    "empty": [], "flags": [True, True],
}  # fmt: skip
if np.dtype(np.longdouble).itemsize > 8:  # it would be rounded
    NUMBER["long double"] = np.longdouble(1.0)
WHOLE = {
    **OBJECTS, **NOT_FINITE, "fraction of one": 0.5, "float": 2.0, "flag": True, "negative": -1,
    "three axes": WRONG, "array": np.arange(3), "most digits": -(10**5000), "dict": {},
}  # fmt: skip
FLAG = {
    **OBJECTS, **NOT_FINITE, "none": None, "zero": 0, "one": 1, "two": 2, "float": 0.0,
    "list": [True], "empty": [], "int64": np.int64(1), "array": np.array(True), "dict": {},
}  # fmt: skip
WORD = {**OBJECTS, "number": 3, "array": POINTS, "list": ["ij"], "nan": NAN}
COORDINATES = {
    **OBJECTS, "nan": rows(NAN), "inf": rows(INF), "-inf": rows(-INF, np.float32),
    "number": 1.0, "number of NumPy": np.float64(1.0), "ragged": [[0.0, 0.0], [1.0]],
    "three axes": WRONG[:, :0], "no columns": np.zeros((4, 0)), "nine columns": np.zeros((4, 9)),
    "masked": np.ma.array(POINTS, mask=POINTS == POINTS[2, 1]), "dict": {"x": [1.0]},
    "huge": [[10**400, 0, 0]], "not held": rows(2**62 + 1, np.int64), "text": [["1", "2", "3"]],
    "not held, unsigned": rows(2**63 + 1, np.uint64), "nothing in it": [[None, 0.0, 0.0]],
    "too many": np.broadcast_to(np.float32(0.0), (2**40, 3)),
}  # fmt: skip
if np.dtype(np.longdouble).itemsize > 8:
    COORDINATES["long double"] = POINTS.astype(np.longdouble)
IDS = {
    **OBJECTS, **NOT_FINITE, "negative": [-1], "out of range": [99], "floats": [0.5],
    "flags": [True, False], "three axes": WRONG, "huge": [10**400], "dict": {},
    "most": np.array([2**64 - 1], np.uint64), "masked": np.ma.array([0], mask=True),
}  # fmt: skip
REALS = {
    **OBJECTS, "nan": [NAN] * 4, "inf": [INF] * 4, "three axes": WRONG, "dict of words": {"x": "y"},
    "huge": [10**400] * 4, "not held": [2**53 + 1] * 4, "text": ["1.0"] * 4,
    "masked": np.ma.array([0.5] * 4, mask=True), "none in it": [None] * 4, "flags": [True] * 4,
}  # fmt: skip
LABELS = {
    **OBJECTS, "nan": [NAN] * 4, "floats": [0.5] * 4, "three axes": WRONG, "wrong length": [0],
    "masked": np.ma.array([0] * 4, mask=True), "mixed": ["a", 1, "b", 2], "huge": [10**400] * 4,
    "most": np.full(4, 2**64 - 1, np.uint64), "large": np.broadcast_to(0, (2**40,)), "number": 1,
}  # fmt: skip
BOX = {
    **OBJECTS, **NOT_FINITE, "nan inside": [1.0, NAN, 1.0], "zero": 0.0, "flat": np.ones((3, 3)),
    "two": [1.0, 2.0], "six": [1, 1, 1, 90, 90, 90], "two rows": np.ones((2, 3)), "flag": True,
    "three axes": np.ones((1, 3, 3, 1)), "masked": np.ma.array(np.eye(3), mask=np.eye(3) > 0),
    "huge": [10**400] * 3, "not held": [2**53 + 1] * 3, "empty": [], "dict": {"x": 1.0},
}  # fmt: skip
PERIODIC = {
    **OBJECTS, **NOT_FINITE, "two": [True, True], "words": ["T", "F", "T"], "numbers": [1, 0, 2],
    "halves": [0.5, 1.0, 1.0], "nested": [[[True] * 3]], "empty": [], "none": [None, True, True],
}  # fmt: skip
DTYPE = {
    **OBJECTS, "unsigned": np.uint64, "short": np.int16, "float": np.float64, "other order": ">i8",
    "unheard of": "banana", "no type": "i4,(", "no names": {"names": 1},
    "objects": object, "list": [1], "nan": NAN,
}  # fmt: skip
OUT = {
    **OBJECTS, **NOT_FINITE, "one": np.zeros(9, np.int64), "floats": (np.zeros(9),) * 2,
    "number": 3, "small": (np.zeros(0, np.int64),) * 2, "same": (np.zeros(9, np.int64),) * 2,
    "read only": tuple(np.broadcast_to(np.int64(0), (9,)) for _ in "ij"), "dict": {},
}  # fmt: skip
CALLABLE = {k: v for k, v in OBJECTS.items() if k != "function"} | {"number": 3, "array": POINTS}
#: What a sequence raises while it is read is the user's.
LISTS = {k: v for k, v in OBJECTS.items() if k not in ("iteration raises", "length raises", "void")}
LISTS |= {"number": 3, "array": POINTS, "list": [1], "dict": {"x": 1}, "nan": NAN}

#: Arguments by what they take.
KINDS = {
    "cutoff min_distance radius cell_size skin density max_radius": NUMBER,
    "extent": NUMBER, "max_distance": {k: v for k, v in NUMBER.items() if k != "inf"},
    "memory_limit": {"flag": True, "complex": np.complex128(1e9)} | {
        k: v for k, v in NUMBER.items() if k not in ("inf", "not held", "masked")
    },
    "threads": {**WHOLE, "zero": 0, "many": 1025, "most": 2**63},
    "limit": {k: v for k, v in NUMBER.items() if k not in ("inf", "huge", "not held")},
    "row node i_node j_node list i_list j_list": {**WHOLE, "negative": -99},
    "k n min_points max_pairs dim n_elements n_ghost block n_points n_queries": WHOLE,
    "inclusive sort by_type finite_size full measure thread_safe half ordered shifts": FLAG,
    "ghosts overlap intersection tagged track_changes": FLAG,
    "rule quantities algorithm kernel precision storage order by duplicates quantity": WORD,
    "points positions queries": COORDINATES, "indices i j": IDS,
    "exclude": {**IDS, "one axis": [0, 1], "three columns": [[0, 1, 2]], "number": -1},
    "bonds": {**IDS, "three columns": [[0, 1, 2]]},
    "S": {**IDS, "wrong length": [[0, 0, 0]] * 3},
    "edges angles lengths dimensions matrix vectors": REALS,
    "radii weights H": {**REALS, "wrong length": [0.5], "large": np.broadcast_to(0.5, (2**40,))},
    "supports": {**REALS, "not symmetric": [np.tri(3)] * 4, "too few": [np.eye(3)]},
    "types groups labels batch": LABELS, "box": BOX, "periodic": PERIODIC, "index_dtype": DTYPE,
    "out": OUT, "callback progress": CALLABLE, "frames systems lists": LISTS,
}  # fmt: skip
#: Right, where they are.
RIGHT = {
    ("Connectivity.intersection_of", "points"): ("iteration raises", "length raises"),
    ("Connectivity.plot", "axes"): ("iteration raises",),
    ("VerletList", "box"): ("two", "six"), ("PairField", "dtype"): ("date", "void"),
    ("Connectivity", "exclude"): ("function",), ("Connectivity.remove", "which"): ("function",),
    ("Connectivity.patch", "keep"): ("iteration raises",),
    ("Connectivity.patch", "old2new"): ("iteration raises",), ("Points", "weights"): ("flags",),
} | {  # all pairs, in open space
    (name, "cutoff"): ("inf",)
    for name in (
        "bricks", "coordination", "count_pairs", "explain", "for_each_pair", "iter_pairs",
        "neighbors", "pairs", "pairs_between", "trajectory_pairs", "verify",
    )
}  # fmt: skip
BAD = {name: bad for words, bad in KINDS.items() for name in words.split()}


def test_everything_public_answers_its_usual_arguments():
    for name, function in CALLS.items():
        called_with(name, function)


@pytest.mark.parametrize(("name", "argument"), ARGUMENTS)
def test_bad_values_are_refused_by_name(name, argument):
    faults = {}
    for kind, value in BAD.get(argument, OBJECTS).items():
        if kind in RIGHT.get((name, argument), ()):
            continue
        result = outcome(called_with, name, CALLS[name], slowdown=SLOWDOWN, **{argument: value})
        if result.error is None:
            faults[kind] = f"gives {result.answer!r:.80}"
        elif not boundary.names(result.message, argument):
            faults[kind] = f"is not named: {result.message}"
        elif frames_of_ours(result.error) > 5:
            faults[kind] = f"has {frames_of_ours(result.error)} frames"
        elif len(result.message) > 400 or "\n" in result.message:
            faults[kind] = f"is long: {result.message!r}"
    assert faults == {}


# ---- anything at all -----------------------------------------------------------------------

FUZZ_ROUNDS = int(os.environ.get("HALFSHELL_FUZZ_ROUNDS", "0"))
FUZZ_SECONDS = float(os.environ.get("HALFSHELL_FUZZ_SECONDS", "0"))
FUZZ_SEED = int(os.environ.get("HALFSHELL_FUZZ_SEED", "1"))
STUCK = 60 * SLOWDOWN  # seconds after which a call that hangs is ended, with its traceback
SHARES = 4  # of the seconds: one for each test


def fuzz(strategy, check, examples):
    """Check examples, then, if that is wanted, rounds of as many others."""
    settled = {"deadline": None, "database": None, "suppress_health_check": list(HealthCheck)}
    end = time.monotonic() + FUZZ_SECONDS / SHARES

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


def plain_truth(points, cutoff, box=None, periodic=None, inclusive=True):
    """The pairs by exact arithmetic, where the scene is small and made of plain objects."""
    plain = (float, int, bool, list, tuple, np.ndarray, np.float64, type(None))
    if not all(type(x) in plain for x in (points, cutoff, box, periodic)):
        return None
    points = np.asarray(points, np.float64)
    points = np.empty((0, 3)) if points.shape == (0,) else points
    box = None if box is None else np.asarray(box, np.float64)
    if type(periodic) in (np.ndarray, list):
        periodic = np.asarray(periodic, bool)
        periodic = bool(periodic) if periodic.ndim == 0 else periodic
    if points.ndim == 3 or np.ndim(cutoff):  # a list of systems, several cutoffs
        return None
    return reference_pairs(points, float(cutoff), box, periodic, inclusive)


@st.composite
def wild(draw):
    """A call, of which one to three arguments are anything."""
    name = draw(st.sampled_from(sorted(name for name in CALLS if "plot" not in name)))
    most = boundary.arguments_of(name, CALLS[name])
    some = st.lists(st.sampled_from(most), min_size=1, max_size=3, unique=True)
    chosen = draw(some) if most else []
    return name, {argument: draw(anything()) for argument in chosen}


def check_wild(drawn):
    """A right answer, or a documented error that names one of the arguments."""
    name, given_ = drawn
    if name == "pairs" and "quantities" not in given_:
        given_ |= {"quantities": "ijS"}
    with hs.settings(memory_limit=1e7):
        result = outcome(called_with, name, CALLS[name], slowdown=SLOWDOWN, **given_)
    hs.set_cache_limit(2**28)
    if result.error is None:
        scene = {k: given_[k] for k in given_ if k in ("box", "periodic", "inclusive")}
        if name == "pairs" and given_.keys() <= {*scene, "points", "cutoff", "quantities"}:
            points, cutoff = given_.get("points", POINTS), given_.get("cutoff", 0.75)
            i, j, S = (column.tolist() for column in result.answer)
            truth = plain_truth(points, cutoff, **scene) if len(i) < 500 else None
            assert truth is None or list(zip(i, j, map(tuple, S))) == truth
    elif isinstance(result.error, (MemoryError, LookupError)):
        pass  # of a result, or of what is not there
    elif not any(map(callable, given_.values())):  # which may raise what they like
        every = ["points", *boundary.arguments_of(name, CALLS[name])]
        assert any(boundary.names(result.message, one) for one in every), result.message
        assert len(result.message) < 1000


def test_any_objects_as_arguments():
    fuzz(wild(), check_wild, 80)


@pytest.mark.slow
def test_many_objects_as_arguments():
    fuzz(wild(), check_wild, 3_000)


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

    fuzz(scenes(), check, 80)
