# SPDX-License-Identifier: BSD-3-Clause
"""Calls that C answers without a line of Python: with the values and errors of the functions."""

import gc
import inspect
import pickle
import sys

import numpy as np
import pytest

import halfshell as hs
from halfshell import _core
from halfshell._convert.lengths import in_rows
from halfshell._functions.pairs import PairBlocks

POINTS = np.random.default_rng(31).random((40, 3)) * 4.0
WHOLE = np.random.default_rng(32).integers(-3, 9, (40, 3))
LENGTHS = np.array([4.0, 4.5, 5.0])
ROWS = np.array([[4.0, 0.0, 0.0], [1.0, 4.0, 0.0], [0.5, -1.0, 5.0]])
SEARCHES = {
    name: getattr(hs, name)
    for name in ("pairs", "count_pairs", "pairs_between", "neighbors", "coordination", "nearest",
                 "iter_pairs")
}  # fmt: skip
BOX = hs.Box(ROWS)


class Subclass(np.ndarray):
    pass


class Number(float):
    pass


def attempt_of(name):
    known = inspect.signature(SEARCHES[name]).parameters.values()
    usual = {one.name: one.default for one in known if one.default is not one.empty}
    positional = [one for one in known if one.kind is one.POSITIONAL_OR_KEYWORD]
    return _core.quick(name, tuple(one.name for one in known), len(positional), usual)


ATTEMPTS = {name: attempt_of(name) for name in SEARCHES}


def attempt(name, *arguments, **options):
    found = ATTEMPTS[name](arguments, options)
    return PairBlocks(*found) if name == "iter_pairs" and isinstance(found, tuple) else found


def columns_of(answer):
    """What tables and iterators hold."""
    if isinstance(answer, hs.NeighborTable):
        columns = {"j": "indices", "d": "distances", "D": "vectors", "S": "shifts"}
        return answer.offsets, *(getattr(answer, columns[letter]) for letter in answer.quantities)
    return tuple(answer) if isinstance(answer, PairBlocks) else answer


def same(one, other):
    one, other = columns_of(one), columns_of(other)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray):
        return (one.dtype, one.shape) == (other.dtype, other.shape) and (
            one.tobytes() == other.tobytes() and one.flags.writeable == other.flags.writeable
        )
    return type(one) is type(other) and one == other


# ---- what is plain ---------------------------------------------------------------------------


def unaligned(array):
    made = np.empty(array.nbytes + 1, np.uint8)[1:].view(array.dtype).reshape(array.shape)
    made[...] = array
    return made


PLAIN_POINTS = {
    "float64": POINTS,
    "float32": POINTS.astype(np.float32),
    "strided": np.repeat(POINTS, 2, axis=0)[::2],
    "backward": POINTS[::-1, ::-1],
    "Fortran": np.asfortranarray(POINTS),
    "unaligned": unaligned(POINTS),
    "big endian": POINTS.astype(">f8"),
    "big endian float32": POINTS.astype(">f4"),
    "float16": POINTS.astype(np.float16),
    "int64": WHOLE,
    "strided int8": np.repeat(WHOLE, 3, axis=1).astype(np.int8)[:, ::3],
    "uint64": np.abs(WHOLE).astype(np.uint64),
    "largest integers": WHOLE + np.array([[2**53 - 20, 0, 0]]),
    "bool": WHOLE > 4,
    "read-only": np.frombuffer(POINTS.tobytes()).reshape(-1, 3),
    "lists": POINTS.tolist(),
    "tuples": tuple(map(tuple, POINTS.tolist())),
    "rows": list(POINTS),
    "scalars": [list(row) for row in POINTS],
    "whole numbers": WHOLE.tolist(),
    "mixed": [[0, 1.5, 2**53], (0.0, 1, -(2**53))],
    "one column": [[1.0], [2.5], [3]],
    "no rows": np.empty((0, 3)),
}
TOO_FAR = ("largest integers", "mixed")  # from a box, for S
PLAIN_BOXES = {
    "lengths": LENGTHS,
    "rows": ROWS,
    "list": [4, 4.5, 5],
    "tuple": (4.0, np.float64(4.5), 5.0),
    "one length": 4.5,
    "whole length": 5,
    "one of NumPy": np.float32(4.5),
    "one of NumPy's integers": np.int32(5),
    "lists": ROWS.tolist(),
    "list of rows": list(ROWS),
    "float32": LENGTHS.astype(np.float32),
    "integers": np.array([4, 5, 6]),
    "Fortran": np.asfortranarray(ROWS),
    "strided": np.repeat(LENGTHS, 2)[::2],
    "big endian": ROWS.astype(">f8"),
    "Box": hs.Box(ROWS),
}
PLAIN_PERIODIC = [
    True, False, np.True_, (True, False, True), [False, True, True], [1, 0, 1], [True, 0, np.True_],
    np.array([True, False, False]), np.array([True, True, False, True])[::-1][:3],
]  # fmt: skip
PLAIN_OPTIONS = [
    {"cutoff": 2},
    {"cutoff": np.float32(1.5)},
    {"cutoff": np.float64(1.5)},
    {"cutoff": np.int64(1)},
    {"cutoff": Number(1.5)},
    {"inclusive": False},
    {"inclusive": np.False_},
    {"threads": 2},
    {"periodic": False},
    {"periodic": [0, 0, 0]},
    {"rule": None, "exclude": None},
    {"box": LENGTHS, "indices": None, "by_type": False},
    {"max_pairs": 7},
    {"max_distance": 1},
    {"max_distance": np.inf},
]
OF_PAIRS = [
    {"quantities": "ijdDSP", "sort": True},
    {"quantities": "d", "sort": np.True_},
    {"index_dtype": np.int32},
    {"index_dtype": np.dtype(np.int32)},
    {"index_dtype": "int32"},
    {"index_dtype": "int64"},
]


def agrees(name, *arguments, **options):
    """Whether C answers, as the function does when it has no help from C."""
    answer = attempt(name, *arguments, **options)
    known = {key: value for key, value in options.items() if value is not None}
    with pytest.MonkeyPatch.context() as context:
        context.setattr(_core, "scene", lambda *given: NotImplemented)
        expected = SEARCHES[name].__wrapped__(*arguments, **known)
    if answer is not NotImplemented and name == "nearest":
        answer = in_rows(answer, -1, arguments[1])
    return answer is not NotImplemented and same(answer, expected)


@pytest.mark.parametrize("kind", PLAIN_POINTS)
def test_plain_points(kind):
    points = PLAIN_POINTS[kind]
    for box in (None,) if kind in TOO_FAR else (None, 9.0):
        assert agrees("pairs", points, 1.5, box=box, quantities="ijdDS")
        assert agrees("count_pairs", points, 1.5, box=box)
        assert agrees("coordination", points, 1.5, box=box)
        assert agrees("neighbors", points, 1.5, box=box, quantities="jdDS")
        assert agrees("nearest", points, 3, box=box, quantities="jdDS")
        assert agrees("iter_pairs", points, 1.5, box=box, quantities="ijdDS", max_pairs=50)
        for queries in (points, np.array(points)[:7] * 0.5):
            assert agrees("pairs_between", queries, points, 1.5, box=box, quantities="ijdDS")
            assert agrees("count_pairs", points, 1.5, queries=queries, box=box)
            assert agrees("coordination", points, 1.5, queries=queries, box=box)
            assert agrees("neighbors", points, 1.5, queries=queries, box=box)
            assert agrees("nearest", points, 2, queries=queries, box=box, max_distance=2)


@pytest.mark.parametrize("kind", PLAIN_BOXES)
def test_plain_boxes(kind):
    for periodic in (None, *PLAIN_PERIODIC):
        how = {"box": PLAIN_BOXES[kind], "periodic": periodic}
        assert agrees("pairs", POINTS, 1.5, quantities="ijdDS", **how)
        assert agrees("coordination", POINTS, 1.5, **how)


@pytest.mark.parametrize("name", SEARCHES)
def test_plain_options(name):
    known = inspect.signature(SEARCHES[name]).parameters
    for given in PLAIN_OPTIONS + OF_PAIRS * ("pairs" in name and name != "count_pairs"):
        options = {key: given[key] for key in given if key in known and key != "cutoff"}
        first = (POINTS[:9], POINTS) if name == "pairs_between" else (POINTS,)
        last = 2 if name == "nearest" else given.get("cutoff", 1.5)
        assert agrees(name, *first, last, **options), given


# ---- what is not -----------------------------------------------------------------------------


def deep(levels):
    inner = [1.0, 2.0, 3.0]
    for _ in range(levels):
        inner = [inner]
    return inner


OTHER_POINTS = [
    POINTS.view(Subclass), np.ma.array(POINTS), POINTS.astype(np.longdouble),
    POINTS.astype(complex), POINTS.astype(object), POINTS[0], np.empty((3, 0)), np.empty((3, 9)),
    np.zeros((2, 2, 3)), WHOLE + 2**53, np.full((2, 3), 2**63, np.uint64), [], (), [[]], [[], []],
    [1.0, 2.0], [[1.0, 2.0], [1.0]], [[1.0] * 9], [["1", "2"]], [[True, False]], [[None, 1.0]],
    [[1.0, 2**53 + 1]], [[1.0, 10**400]], [[np.float32(1.0), 2.0]], [[Number(1.0), 2.0]],
    [POINTS[0].astype(np.float32)], [POINTS[0], POINTS[0, :2]], deep(30), "points", None,
    memoryview(POINTS), [[1.0, 2.0], None], [POINTS, POINTS],
]  # fmt: skip
OTHER_BOXES = [
    np.array(4.0), True, [True, True, True], ROWS[:2], LENGTHS[:2], [4.0, 4.0], np.float16(4.0),
    [4.0] * 6, [[4.0, 0.0], [0.0, 4.0]], [4.0, [4.0], 4.0], [4.0, 4.0, "4"], "4", {}, LENGTHS * 1j,
    LENGTHS.view(Subclass), 2**53 + 1, [4.0, 4.0, 2**60 + 1], np.array([4, 4, 2**53 + 1]),
    hs.Box([4.0, 4.0]), np.ma.array(LENGTHS), deep(40), Number(4.0), np.zeros((1, 3, 3)), [],
]  # fmt: skip
OTHER_OPTIONS = [
    {"cutoff": True}, {"cutoff": np.array(1.5)}, {"cutoff": [1.0, 2.0]}, {"cutoff": "1"},
    {"cutoff": 2**53 + 1}, {"cutoff": None}, {"cutoff": {}}, {"inclusive": 1}, {"inclusive": None},
    {"progress": True}, {"progress": 3}, {"periodic": True}, {"periodic": (True, False, True)},
    {"box": LENGTHS, "periodic": (True, True)}, {"box": LENGTHS, "periodic": (1.0, 0.0, 1.0)},
    {"box": LENGTHS, "periodic": (2, 0, 1)}, {"box": LENGTHS, "periodic": "yes"},
    {"box": LENGTHS, "periodic": 1}, {"box": LENGTHS, "periodic": np.array([1, 0, 1])},
    {"exclude": [[0, 1]]}, {"rule": "sum"}, {"min_distance": 0.5},
]  # fmt: skip
OTHERS_OF_BLOCKS = [
    {"max_pairs": 0}, {"max_pairs": True}, {"max_pairs": 2.0}, {"max_pairs": np.int64(3)},
    {"max_pairs": 2**62 + 1}, {"max_pairs": 10**400}, {"max_pairs": -1},
]  # fmt: skip
OTHERS_OF_PAIRS = [
    {"sort": 1}, {"index_dtype": int}, {"index_dtype": "i8"}, {"index_dtype": np.int16},
    {"index_dtype": np.dtype(">i8")}, {"index_dtype": None},
]  # fmt: skip


def outcome(search, *arguments, **options):
    try:
        return search(*arguments, **options)
    except Exception as error:
        return type(error), str(error)


def test_other_points_are_left_to_the_function():
    for points in OTHER_POINTS:
        for name, first in (
            ("pairs", (points,)), ("count_pairs", (points,)),
            ("pairs_between", (POINTS, points)), ("pairs_between", (points, POINTS)),
        ):  # fmt: skip
            assert attempt(name, *first, 1.5) is NotImplemented, points
            one = outcome(SEARCHES[name], *first, 1.5)
            assert same(one, outcome(SEARCHES[name].__wrapped__, *first, 1.5)), points


def test_other_boxes_are_left_to_the_function():
    for box in OTHER_BOXES:
        assert attempt("pairs", POINTS, 1.5, box=box) is NotImplemented, box
        one = outcome(hs.pairs, POINTS, 1.5, box=box)
        assert same(one, outcome(hs.pairs.__wrapped__, POINTS, 1.5, box=box)), box


@pytest.mark.parametrize("name", ["pairs", "count_pairs", "coordination", "iter_pairs"])
def test_other_options_are_left_to_the_function(name):
    more = {"pairs": OTHERS_OF_PAIRS, "iter_pairs": OTHERS_OF_BLOCKS}
    for given in OTHER_OPTIONS + more.get(name, []):
        options = dict(given)
        arguments = POINTS, options.pop("cutoff", 1.5)
        assert attempt(name, *arguments, **options) is NotImplemented, given
        one = outcome(SEARCHES[name], *arguments, **options)
        assert same(one, outcome(SEARCHES[name].__wrapped__, *arguments, **options)), given


def test_other_numbers_of_neighbours_are_left_to_the_function():
    for k in (0, -1, True, 2.0, "2", None, np.int64(2), 2**56 + 1, 10**400):
        assert attempt("nearest", POINTS, k) is NotImplemented
        one = outcome(hs.nearest, POINTS, k)
        assert same(one, outcome(hs.nearest.__wrapped__, POINTS, k)), k
    for most in (-1.0, np.nan, None, [1.0, 2.0], "1"):
        assert attempt("nearest", POINTS, 2, max_distance=most) is NotImplemented
        one = outcome(hs.nearest, POINTS, 2, max_distance=most)
        assert same(one, outcome(hs.nearest.__wrapped__, POINTS, 2, max_distance=most)), most


def test_what_it_does_not_know_is_left_to_the_function():
    for given in ({"unknown": 1}, {"points": POINTS}, {"algorithm": "grid"}, {"kernel": "scalar"}):
        for name in ("pairs", "count_pairs", "coordination"):
            assert attempt(name, POINTS, 1.5, **given) is NotImplemented
            with pytest.raises(TypeError, match=next(iter(given))):
                SEARCHES[name](POINTS, 1.5, **given)


def test_what_is_missing_or_too_much_is_left_to_the_function():
    for name, search in SEARCHES.items():
        for arguments in ((), (POINTS,), (POINTS, POINTS, 1.5, LENGTHS)):
            assert attempt(name, *arguments) is NotImplemented
            with pytest.raises(TypeError, match=rf"{name}\(\)|^cutoff must be a number"):
                search(*arguments)


def test_queries_have_as_many_columns():
    assert attempt("coordination", POINTS, 1.5, queries=POINTS[:, :2]) is NotImplemented
    with pytest.raises(ValueError, match="the same number of columns"):
        hs.coordination(POINTS, 1.5, queries=POINTS[:, :2])
    assert attempt("pairs_between", None, POINTS, 1.5) is NotImplemented


WRONG = [
    {"threads": -1},
    {"threads": 1.5},
    {"box": np.zeros(3)},
    {"box": [4.0, np.nan, 4.0]},
    {"box": 0},
    {"quantities": "q"},
    {"quantities": 3},
    {"out": (np.empty(1, np.int64), np.empty(1, np.int64))},
]


def test_same_errors_as_the_function():
    for how in WRONG:
        for points, cutoff in ((POINTS, 1.5), (POINTS.tolist(), 1), (np.full((3, 3), np.inf), 1),
                               (POINTS, -1), (POINTS, np.nan)):  # fmt: skip
            one = outcome(hs.pairs, points, cutoff, **how)
            other = outcome(hs.pairs.__wrapped__, points, cutoff, **how)
            assert isinstance(one, tuple) and isinstance(one[0], type), how
            assert one[0] is other[0], how


def test_out_is_compared_with_what_was_given():
    whole = np.zeros((4, 3), np.int64)
    i, j = whole.reshape(-1)[:6], np.empty(6, np.int64)
    with pytest.raises(ValueError, match="must not share memory with points"):
        hs.pairs(whole, 1.5, out=(i, j))
    i = np.empty(6, np.int64)
    assert attempt("pairs", whole.tolist(), 1.5, out=(i, j))[0].base is i


# ---- Points, settings, names ------------------------------------------------------------------


def test_one_scene_for_all_functions():
    for box in (None, 4, [4, 5, 6], ROWS.tolist(), ROWS, hs.Box(ROWS)):
        points, rows, bits = _core.scene(WHOLE, box, None)
        with pytest.MonkeyPatch.context() as context:
            context.setattr(_core, "scene", lambda *given: NotImplemented)
            expected = hs.Points(WHOLE, box=box)
        assert same(points, np.asarray(WHOLE, np.float64)) and bits == (box is not None) * 7
        assert rows is None if box is None else np.array_equal(rows, expected.box)
    assert _core.scene("points", None, None) is NotImplemented
    with pytest.raises(TypeError, match="scene takes other arguments"):
        _core.scene(POINTS)


def test_points_with_a_box():
    for box, periodic in ((None, None), (9.0, None), (ROWS, [True, False, True]), (9.0, False)):
        points = hs.Points(POINTS, box=box, periodic=periodic, types=WHOLE[:, 0] % 3 + 0)
        answer = attempt("pairs", points, 1.5, quantities="ijdDS")
        assert same(answer, hs.pairs(POINTS, 1.5, box=box, periodic=periodic, quantities="ijdDS"))
        assert agrees("pairs", points, 1.5, quantities="ijdDS")
        assert agrees("coordination", points, 1.5)
        assert agrees("neighbors", points, 1.5)
    points = hs.Points(POINTS, box=9.0)
    for given in ({"box": 9.0}, {"periodic": True}):
        assert attempt("pairs", points, 1.5, **given) is NotImplemented
    n = len(POINTS)
    for known in ({"radii": np.ones(n)}, {"groups": np.ones(n, int)}, {"batch": np.zeros(n, int)},
                  {"supports": np.stack([np.eye(3)] * n)}):  # fmt: skip
        assert attempt("pairs", hs.Points(POINTS, **known), 1.5) is NotImplemented
    assert attempt("pairs", points, None) is NotImplemented
    assert attempt("coordination", POINTS, 1.5, queries=points) is NotImplemented


def test_settings_are_read():
    with hs.settings(algorithm="all-pairs", threads=1, kernel="scalar", precision="double"):
        assert agrees("pairs", POINTS, 1.5, box=9.0, quantities="ijd")
        assert agrees("count_pairs", POINTS, 1.5)
        assert agrees("nearest", POINTS, 3)
    with hs.settings(memory_limit=1.0), pytest.raises(MemoryError):
        attempt("pairs", POINTS, 1.5)
    with hs.settings(threads=2):
        assert attempt("pairs", POINTS, 1.5, threads=0) is NotImplemented
    assert agrees("pairs", POINTS, 1.5)


def test_names():
    with pytest.raises(ValueError, match="no function is called 'cells'"):
        _core.quick("cells", (), 0, {})
    for names in (tuple(map(str, range(21))), ("\ud800",)):
        with pytest.raises(ValueError, match=r"fewer arguments|surrogates"):
            _core.quick("pairs", names, 2, {})
    with pytest.raises(TypeError, match="quick takes a name"):
        _core.quick("pairs")
    with pytest.raises(TypeError, match="a tuple and a dict"):
        ATTEMPTS["pairs"]([POINTS, 1.5], {})
    with pytest.raises(ValueError, match="know takes"):
        _core.know("box", hs.Box)
    with pytest.raises(TypeError, match="know takes other arguments"):
        _core.know("Box")
    key = "".join(["b", "o", "x"])  # not interned
    assert attempt("count_pairs", POINTS, 1.5, **{key: 4.0}) == hs.count_pairs(POINTS, 1.5, box=4.0)


def test_it_is_the_function_to_everyone_else():
    for function in SEARCHES.values():
        assert inspect.isfunction(function)
        assert "points" in inspect.signature(function).parameters
        assert pickle.loads(pickle.dumps(function)) is function
    with pytest.raises(TypeError, match="multiple values"):
        hs.pairs(POINTS, 1.5, points=POINTS)
    with pytest.raises(TypeError, match=r"'pbc': did you mean periodic=\?"):
        hs.pairs(POINTS, 1.5, pbc=True)


def frames_of(call):
    """How many functions of Python it enters."""
    entered = []
    sys.setprofile(lambda frame, event, _: entered.append(frame) if event == "call" else None)
    try:
        call()
    finally:
        sys.setprofile(None)
    return len(entered) - 1


def test_plain_calls_enter_few_functions():
    calls = [
        lambda: hs.pairs(POINTS, 5, box=[10, 10, 10]),
        lambda: hs.pairs(POINTS.tolist(), 5, box=10.0, periodic=[True, False, True]),
        lambda: hs.count_pairs(POINTS, 5, box=BOX),
        lambda: hs.coordination(WHOLE, 2, box=[10, 10, 10]),
    ]
    for call in calls:
        assert frames_of(call) <= 2


def test_arguments_are_not_kept():
    arguments = (POINTS, 1.5, LENGTHS, (True, True, False), [4, 4, 4], WHOLE)
    gc.collect()  # of what other tests left
    before = [sys.getrefcount(argument) for argument in arguments]
    for _ in range(100):
        attempt("pairs", POINTS, 1.5, box=LENGTHS, periodic=arguments[3])
        attempt("pairs", WHOLE, 1.5, box=arguments[4])
        attempt("pairs", POINTS, 1.5, box=arguments[4], unknown=LENGTHS)
        attempt("pairs", POINTS, 1.5, box=arguments[4], cutoff=LENGTHS)
        _core.scene(WHOLE, arguments[4], arguments[3])
        with pytest.raises(ValueError, match="cutoff"):
            attempt("pairs", POINTS, -1.5, box=LENGTHS)
    assert [sys.getrefcount(argument) for argument in arguments] == before


def test_options_that_change_during_the_search_are_held():
    options = {"box": LENGTHS.copy(), "quantities": "i"}

    def clear(fraction):
        options.clear()

    options["progress"] = clear
    i = ATTEMPTS["pairs"]((POINTS, 40.0), options)
    assert len(i) == hs.count_pairs(POINTS, 40.0, box=LENGTHS)
    assert not options


def test_progress_and_signals_reach_small_scenes_with_many_images():
    fractions = []
    i = attempt("pairs", POINTS, 40.0, box=LENGTHS, quantities="i", progress=fractions.append)
    assert len(i) > 1_000_000
    assert fractions

    def stop(fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        attempt("pairs", POINTS, 40.0, box=LENGTHS, quantities="i", progress=stop)
