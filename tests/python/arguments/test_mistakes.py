# SPDX-License-Identifier: BSD-3-Clause
"""What a user's mistake is answered: the keyword that is meant, and a short traceback."""

import inspect
import os
import traceback

import numpy as np
import pytest

import halfshell as hs

HERE = os.path.dirname(hs.__file__)
POINTS = np.random.default_rng(0).random((10, 3))

CALLS = {
    "pairs": lambda x, **how: hs.pairs(x, 1.0, **how),
    "pairs_between": lambda x, **how: hs.pairs_between(x, POINTS, 1.0, **how),
    "neighbors": lambda x, **how: hs.neighbors(x, 1.0, **how),
    "coordination": lambda x, **how: hs.coordination(x, 1.0, **how),
    "count_pairs": lambda x, **how: hs.count_pairs(x, 1.0, **how),
    "nearest": lambda x, **how: hs.nearest(x, 2, **how),
    "pair_histogram": lambda x, **how: hs.pair_histogram(x, [0.0, 1.0], **how),
    "rdf": lambda x, **how: hs.rdf(x, 1.0, **{"box": 5.0, **how}),
    "iter_pairs": lambda x, **how: list(hs.iter_pairs(x, 1.0, **how)),
    "for_each_pair": lambda x, **how: hs.for_each_pair(x, 1.0, print, **how),
    "clusters": lambda x, **how: hs.clusters(x, 1.0, **how),
    "explain": lambda x, **how: hs.explain(x, 1.0, **how),
    "measure": lambda x, **how: hs.measure(x, [0], [1], **how),
    "bricks": lambda x, **how: hs.bricks(x, 1.0, 2, **how),
    "trajectory_pairs": lambda x, **how: list(hs.trajectory_pairs([x], 1.0, **how)),
    "CellList": lambda x, **how: hs.CellList(x, 1.0, **how),
    "VerletList": lambda x, **how: hs.VerletList(1.0, 0.1, **how).update(x),
}

WRONG_POINTS = {
    "one axis": np.zeros(3),
    "nan": np.array([[0.0, np.nan, 1.0]]),
    "words": ["a", "b"],
    "object": object(),
    "complex": np.zeros((2, 3), complex),
}

WRONG_ARGUMENTS = [
    {"box": [1, 2]}, {"box": "x"}, {"box": np.zeros((3, 3))}, {"box": 5.0, "periodic": "x"},
    {"periodic": [1, 2, 3]}, {"radii": [1.0]}, {"types": ["a"]}, {"supports": [1.0]},
    {"kernel": "x"}, {"threads": -1}, {"memory_limit": "much"}, {"groups": [1]}, {"batch": [3]},
    {"exclude": [[0, 99]]}, {"algorithm": "gird"}, {"quantities": "xy"}, {"precision": "exat"},
    {"index_dtype": "float"}, {"queries": [[1.0]]}, {"indices": [99]}, {"unheard_of": 3},
]  # fmt: skip


def frames_of_ours(call):
    """How many frames of the package a refused call has; None if it was not refused."""
    try:
        call()
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        return sum(frame.filename.startswith(HERE) for frame in frames)
    return None


@pytest.mark.parametrize("name", CALLS)
def test_tracebacks_of_wrong_points_are_short(name):
    for points in WRONG_POINTS.values():
        assert frames_of_ours(lambda points=points: CALLS[name](points)) <= 5


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("how", WRONG_ARGUMENTS, ids=lambda how: "-".join(how))
def test_tracebacks_of_wrong_arguments_are_short(name, how):
    assert (frames_of_ours(lambda: CALLS[name](POINTS, **how)) or 0) <= 5


def test_frames_of_the_users_own_code_stay():
    class Broken:
        def __array__(self, *arguments, **more):
            return self.inner()

        def inner(self):
            raise ZeroDivisionError("mine")

    with pytest.raises(TypeError, match="Broken raised ZeroDivisionError: mine") as refused:
        hs.neighbors(Broken(), 1.0)
    cause = refused.value.__cause__
    assert "inner" in [frame.name for frame in traceback.extract_tb(cause.__traceback__)]

    class Reader:
        def __iter__(self):
            yield POINTS
            raise ZeroDivisionError("read")

    frames = hs.trajectory_pairs(Reader(), 1.0)
    next(frames)
    with pytest.raises(ZeroDivisionError, match="read") as refused:
        next(frames)
    names = [frame.name for frame in traceback.extract_tb(refused.value.__traceback__)]
    assert "__iter__" in names


MEANT = {"pbc": "periodic", "cell": "box", "boxsize": "box", "workers": "threads"}


@pytest.mark.parametrize("name", [name for name in CALLS if name.islower()])
def test_keywords_of_other_libraries_are_answered_with_ours(name):
    known = inspect.signature(getattr(hs, name)).parameters
    assert list(known)[-1] == "unknown"
    for theirs, ours in MEANT.items():
        if ours not in known:
            continue
        with pytest.raises(TypeError) as refused:
            CALLS[name](POINTS, **{theirs: None})
        assert str(refused.value) == (
            f"{name}() got an unexpected keyword argument {theirs!r}: did you mean {ours}=?"
        )


@pytest.mark.parametrize("search, given, message", [
    (hs.pairs, {"threds": 2}, "did you mean threads=?"),
    (hs.pairs, {"quantity": "ij"}, "did you mean quantities=?"),
    (hs.nearest, {"distance_upper_bound": 1.0}, "did you mean max_distance=?"),
    (hs.clusters, {"min_samples": 3}, "did you mean min_points=?"),
    (hs.pairs, {"zzz": 1}, "unexpected keyword argument 'zzz'"),
])  # fmt: skip
def test_what_is_spelled_alike_is_named(search, given, message):
    with pytest.raises(TypeError) as refused:
        search(POINTS, 1, **given)
    assert str(refused.value).endswith(message)


def test_words_that_are_spelled_alike_are_named():
    with pytest.raises(ValueError, match=r"got 'maxx': did you mean 'max'\?"):
        hs.pairs(POINTS, None, radii=np.ones(10), rule="maxx")
    with pytest.raises(ValueError, match=r"rule must be one of .* got 'zzz'$"):
        hs.pairs(POINTS, None, radii=np.ones(10), rule="zzz")
