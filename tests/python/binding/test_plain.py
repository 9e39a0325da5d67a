# SPDX-License-Identifier: BSD-3-Clause
"""Plain arguments take a shorter way through the binding: to the same answers and errors."""

import sys
from functools import partial

import numpy as np
import pytest

import halfshell as hs
from halfshell import _core
from halfshell._convert import scene, search
from refused_calls import check_refusals

POINTS = np.random.default_rng(31).random((40, 3)) * 4.0
LENGTHS = np.array([4.0, 4.5, 5.0])
ROWS = np.array([[4.0, 0.0, 0.0], [1.0, 4.0, 0.0], [0.5, -1.0, 5.0]])
SHARED = {
    "box": None,
    "periodic": None,
    "inclusive": True,
    "precision": "exact",
    "kernel": None,
    "memory_limit": None,
    "progress": None,
    "threads": None,
}


class Subclass(np.ndarray):
    pass


def plain(points, cutoff=1.5, *, quantities="ij", sort=False, index_dtype=np.int64, **options):
    shared = {**SHARED, **options}
    return _core.plain(
        _core.pairs, points, cutoff, *shared.values(), quantities, sort, index_dtype, None
    )


PERIODIC = [None, True, False, (True, False, True), [False, True, True]]
BOXES = [(None, None), *((box, periodic) for box in (LENGTHS, ROWS) for periodic in PERIODIC)]


def test_same_answer_as_converted_arguments():
    for number, (box, periodic) in enumerate(BOXES):
        points = POINTS.astype((np.float32, np.float64)[number % 2])
        options = {"box": box, "periodic": periodic, "quantities": "ijdDSP", "sort": True}
        options["index_dtype"] = (np.int32, np.int64)[number // 2 % 2]
        direct = plain(points, **options)
        converted = hs.pairs(points.view(Subclass), 1.5, **options)
        public = hs.pairs(points, 1.5, **options)
        for a, b, c in zip(direct, converted, public, strict=True):
            assert a.dtype == b.dtype == c.dtype
            assert a.tobytes() == b.tobytes() == c.tobytes()
        shared = SHARED | {"box": box, "periodic": periodic}
        assert _core.plain(_core.count_pairs, points, 1.5, *shared.values()) == len(direct[0])


QUERIES = POINTS[:7] + 0.25

# Each function of the core for plain arguments that may have queries, and its public counterpart;
# what comes between the shared arguments and the queries.
WITH_QUERIES = {
    "pairs_between": (
        ("ijdS", True, np.int64, None),
        lambda points, queries, **how: hs.pairs_between(
            queries, points, 1.5, quantities="ijdS", **how
        ),
    ),
    "count_between": (
        (),
        lambda points, queries, **how: hs.count_pairs(points, 1.5, queries=queries, **how),
    ),
    "neighbors": (
        ("jdS", np.int64),
        lambda points, queries, **how: hs.neighbors(
            points, 1.5, queries=queries, quantities="jdS", **how
        )._arrays,
    ),
    "coordination": (
        (),
        lambda points, queries, **how: hs.coordination(points, 1.5, queries=queries, **how),
    ),
}


def plain_with_queries(name, points, queries, **options):
    shared = {**SHARED, **options}
    more = WITH_QUERIES[name][0]
    return _core.plain(getattr(_core, name), points, 1.5, *shared.values(), *more, queries)


@pytest.mark.parametrize("name", WITH_QUERIES)
def test_same_answer_with_queries(name):
    for box, periodic in BOXES:
        for types in (("f4", "f8"), ("f8", "f4"), ("f8", None)):
            points = POINTS.astype(types[0])
            queries = None if types[1] is None else QUERIES.astype(types[1])
            if queries is None and "between" in name:
                with pytest.raises(TypeError, match="queries"):
                    plain_with_queries(name, points, queries)
                continue
            how = {"box": box, "periodic": periodic}
            direct = plain_with_queries(name, points, queries, **how)
            asking = queries if queries is None else queries.tolist()
            converted = WITH_QUERIES[name][1](points.tolist(), asking, **how)
            public = WITH_QUERIES[name][1](points, queries, **how)
            for one in (converted, public):
                np.testing.assert_equal(one, direct)


@pytest.mark.parametrize("name", WITH_QUERIES)
def test_other_queries_are_converted(name):
    for queries in (QUERIES.tolist(), QUERIES.view(Subclass), QUERIES.astype(int), QUERIES[:, :2],
                    QUERIES.astype(QUERIES.dtype.newbyteorder()), QUERIES[0]):  # fmt: skip
        assert plain_with_queries(name, POINTS, queries) is NotImplemented
    assert plain_with_queries(name, POINTS.tolist(), QUERIES) is NotImplemented
    with pytest.raises(TypeError, match="arguments"):
        _core.plain(getattr(_core, name), POINTS, 1.5)


def test_other_points_are_converted():
    for points in (
        POINTS.tolist(), POINTS.view(Subclass), np.ma.array(POINTS), POINTS.astype(np.float16),
        POINTS.astype(POINTS.dtype.newbyteorder()), POINTS.astype(int), POINTS[0],
        np.empty((3, 0)), np.empty((3, 9)),
    ):  # fmt: skip
        assert plain(points) is NotImplemented
        assert _core.plain(_core.count_pairs, points, 1.5, *SHARED.values()) is NotImplemented


OTHERS = [
    {"cutoff": 1},
    {"cutoff": np.float32(1)},
    {"periodic": False},
    {"periodic": (False, False, False)},
    {"box": [4.0, 4.0, 4.0]},
    {"box": hs.Box(LENGTHS)},
    {"box": LENGTHS.astype(np.float32)},
    {"box": LENGTHS[:2]},
    {"box": np.array(4.0)},
    {"box": np.asfortranarray(ROWS)},
    {"box": ROWS[:2]},
    {"box": LENGTHS, "periodic": (True, True)},
    {"box": LENGTHS, "periodic": (1, 0, 1)},
    {"box": LENGTHS, "periodic": "yes"},
    {"box": LENGTHS, "periodic": np.array([True, True, False])},
    {"inclusive": 1},
    {"sort": np.True_},
    {"index_dtype": "int32"},
]


def test_other_arguments_are_converted():
    for options in OTHERS:
        assert plain(POINTS, **options) is NotImplemented, options


def test_box_object_is_plain_to_the_public_functions(monkeypatch):
    def refuse(*arguments, **options):
        raise AssertionError("arguments were converted")

    expected = hs.pairs(POINTS, 1.5, box=LENGTHS.tolist(), quantities="P")
    for module in (scene, search):
        monkeypatch.setattr(module, "as_sets", refuse)
    assert (hs.pairs(POINTS, 1.5, box=hs.Box(LENGTHS), quantities="P") == expected).all()
    assert hs.count_pairs(POINTS, 1.5, box=hs.Box(LENGTHS)) == len(expected)


def test_arguments_are_not_kept():
    arguments = (POINTS, 1.5, LENGTHS, (True, True, False))
    before = [sys.getrefcount(argument) for argument in arguments]
    for _ in range(100):
        plain(arguments[0], arguments[1], box=arguments[2], periodic=arguments[3])
        with pytest.raises(ValueError, match="precision"):
            plain(POINTS, box=LENGTHS, precision="none")
    assert [sys.getrefcount(argument) for argument in arguments] == before


def test_progress_and_signals_reach_small_scenes_with_many_images():
    fractions = []
    shared = SHARED | {"box": LENGTHS, "progress": fractions.append}
    n = _core.plain(_core.count_pairs, POINTS, 40.0, *shared.values())
    assert n > 1_000_000
    assert fractions

    def stop(fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        _core.plain(_core.count_pairs, POINTS, 40.0, *(shared | {"progress": stop}).values())


def test_only_searches_of_the_core_are_called():
    for function in (len, _core.kernels, _core.cells_layout, hs.pairs, None):
        with pytest.raises(TypeError, match="a function of this module is wanted"):
            _core.plain(function, POINTS)
        with pytest.raises(TypeError, match="a function of this module is wanted"):
            _core.plain()


def test_functions_without_plain_arguments_refuse_them():
    functions = {name: getattr(_core, name) for name in dir(_core)}
    check_refusals({
        name: (partial(_core.plain, function, POINTS), (TypeError, ValueError), "")
        for name, function in functions.items()
        if callable(function) and name not in ("plain", "PairBlocks")
    })  # fmt: skip
