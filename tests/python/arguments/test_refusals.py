# SPDX-License-Identifier: BSD-3-Clause
"""Arguments that are right alone and do not go together, and results that do not fit: by subject,
each call with the error that it raises and what this says."""

from functools import partial

import numpy as np
import pytest

import halfshell as hs
from calls import call
from refused_calls import check_refusals

LINE, FLAT, SOLID = [[0.0], [1.0]], [[0.0, 0.0], [1.0, 0.0]], np.zeros((10, 3))
FAR, BEYOND = np.array([[0.5], [1e12]]), np.array([[0.0, 0.5], [0.0, 2.0**60]])
LEANING = [[1.0, 0.0], [0.5, 1.0]]
RULED = (hs.neighbors, hs.count_pairs, hs.coordination)
RADII, TYPES = np.full(10, 0.25), np.arange(10) % 3
TABLE = np.full((4, 4), 0.5)
CELLS = hs.CellList(FLAT, 2.0)
BATCHED = hs.Points(np.zeros((4, 3)), batch=[0, 0, 1, 2])
ASKING = hs.Points(np.zeros((2, 3)), batch=[0, 2])
BOXES = np.array([np.eye(3)] * 3)


def with_queries(queries, points, *functions, **how):
    """The functions, of two sets."""
    return [partial(call, one, points, 1.0, queries=queries, **how) for one in functions] + (
        [partial(call, hs.pairs_between, queries, points, 1.0, **how)]
    )


def each(calls, error, words):
    return [(one, error, words) for one in calls]


def two_sets():
    for queries in (np.zeros((5, 2)), np.zeros((5, 2)).tolist(), np.empty((0, 2))):
        words = rf"same number of columns.*\({len(queries)}, 2\) and \(10, 3\)"
        yield from each(with_queries(queries, SOLID, *RULED), ValueError, words)
    for points, queries, words in (
        (BATCHED.positions, ASKING, "queries have a batch, and points"),
        (BATCHED, ASKING.positions, "points have a batch, and queries have none"),
        (BATCHED, hs.Points(np.zeros((2, 2)), batch=[0, 2]), "same number of columns"),
        (BATCHED.replace(box=BOXES), ASKING.replace(batch=[0, 3]), "batch must be less than the"),
    ):
        for search in (
            partial(hs.neighbors, points, 1.0), partial(hs.coordination, points, 1.0),
            partial(hs.nearest, points, 2), partial(hs.pair_histogram, points, [0.0, 1.0]),
        ):  # fmt: skip
            yield partial(search, queries=queries), ValueError, words
    for points, limit, words in (
        (BATCHED, [1.0, -1.0, 1.0], r"max_distance.*\[1\] = -1"),
        (BATCHED, np.ones((2, 2)), "max_distance.*a number or"),
        (BATCHED.positions, [1.0, 2.0], "max_distance must be a number, got shape"),
    ):
        yield partial(hs.nearest, points, 2, max_distance=limit), ValueError, words
    yield (partial(call, hs.pair_histogram, LINE, [0.0, 1.0], queries=[[0.0]], types=[0, 1]),
           ValueError, "queries have none")  # fmt: skip


def reach():
    both = "both sets need them, or rule 'gather' or 'scatter'"
    for given, words in (
        ({"radii": RADII}, "queries have no radii: " + both),
        ({"query_radii": RADII[:4]}, "points have no radii: " + both),
        ({"radii": RADII, "rule": "gather"}, "'gather' goes by the radii of queries"),
        ({"query_radii": RADII[:4], "rule": "scatter"}, "'scatter' goes by the radii of points"),
    ):
        for search in RULED:
            yield partial(call, search, SOLID, None, queries=SOLID[:4], **given), ValueError, words
    for cutoff, given, error, words in (
        (TABLE, {"types": TYPES}, ValueError, "needs types, and queries have none"),
        (TABLE, {"query_types": TYPES[:4]}, ValueError, "needs types, and points have none"),
        (TABLE, {"types": TYPES, "query_types": TYPES}, ValueError, r"types.*\(4,\).*\(10,\)"),
        (TABLE, {"types": TYPES, "query_types": TYPES[:4] + 9}, ValueError,
         r"less than 4.*type 9 of queries\[0\]"),
        ({(0, 1): 1.0}, {"types": TYPES, "query_types": ["H"] * 4}, TypeError, "both be numbers"),
    ):  # fmt: skip
        how = {"queries": SOLID[:4], **given}
        yield partial(call, hs.count_pairs, SOLID, cutoff, **how), error, words
    for cutoff, types, error, words in (
        ({(0, 1): 1.0, (1, 0): 2.0}, TYPES, ValueError, r"contradicts.*\(1, 0\)|\(1, 0\).*contra"),
        ({(0, 1): -1.0}, TYPES, ValueError, r"\(0, 1\).*not negative|not negative.*\(0, 1\)"),
        ({(0, 1): "far"}, TYPES, TypeError, r"cutoff\[\(0, 1\)\]"),
        ({(0, 1, 2): 1.0}, TYPES, TypeError, "pairs of types"),
        ({(0, 1.5): 1.0}, TYPES, TypeError, r"1\.5"), ({(0, -1): 1.0}, TYPES, ValueError, "-1"),
        ({("H", "O"): 1.0}, TYPES, ValueError, "names.*types are numbers"),
        ({(0, 1): 1.0}, ["H"] * 10, ValueError, "numbers.*types are names"),
        ({("H", "Hx"): 1.0}, ["H"] * 10, ValueError, "'Hx' is neither an element"),
        ({(0, 1): 1.0}, None, ValueError, "a dict of cutoffs needs types"),
        ({(0, 1): 1.0}, [0, 1], ValueError, r"types.*\(10,\).*\(2,\)"),
        (TABLE, TYPES + 2, ValueError, r"types must be less than 4.*type 4 of points\[2\]"),
        (TABLE, None, ValueError, "a table of cutoffs needs types"),
        ([[1.0, 2.0], [2.5, 1.0]], TYPES, ValueError,
         r"symmetric.*cutoff\[0, 1\] = 2.0.*cutoff\[1, 0\] = 2.5"),
        ([[1.0, 2.0]], TYPES, ValueError, r"\(t, t\).*\(1, 2\)"),
        ([[1.0, -2.0], [-2.0, 1.0]], TYPES, ValueError, r"not negative.*cutoff\[0, 1\] = -2"),
    ):  # fmt: skip
        for search in (hs.pairs, hs.coordination, hs.iter_pairs):
            yield partial(call, search, SOLID, cutoff, types=types), error, words


def shells():
    for how, error, words in (
        ({"cutoff": 1.0}, ValueError, "k in quantities needs several cutoffs, got one"),
        ({"cutoff": []}, ValueError, r"shape \(k,\), with one at least, got \(0,\)"),
        ({"cutoff": [[1.0]]}, ValueError, "a table of cutoffs needs types"),
        ({"cutoff": [2.0, 1.0]}, ValueError, r"ascending, got cutoff\[0\] = 2.0 before"),
        ({"cutoff": [-1.0, 1.0]}, ValueError, r"finite and not negative, got cutoff\[0\]"),
        ({"cutoff": {(0, 0): 1.0}, "types": [0, 0]}, ValueError, "with radii, supports or cutoffs"),
        ({"radii": [1.0, 1.0]}, ValueError, "several cutoffs cannot be combined with radii"),
        ({"supports": [np.eye(2)] * 2}, ValueError, "combined with supports"),
        ({"batch": [0, 0]}, ValueError, "cannot be combined with a batch"),
        ({"precision": "double"}, ValueError, "needs precision 'exact', got 'double'"),
    ):
        how = {"cutoff": [1.0, 2.0], "quantities": "ijk", **how}
        yield partial(call, hs.pairs, FLAT, **how), error, words
    words = "cutoff must be a number; several are for counts and the letter k in quantities"
    for several in ([1.0, 2.0], (1.0,), np.array([1.0, 2.0])):
        yield from each([
            *(partial(search, FLAT, several) for search in
              (hs.pairs, hs.iter_pairs, hs.neighbors, hs.clusters, hs.explain)),
            partial(hs.pairs_between, FLAT, FLAT, several), partial(CELLS.iter_pairs, several),
            partial(next, hs.trajectory_pairs([FLAT], several)), partial(CELLS.pairs, several),
            partial(hs.for_each_pair, FLAT, several, print), partial(hs.verify, FLAT, several, []),
        ], TypeError, words)  # fmt: skip
    yield from each([
        partial(CELLS.pairs, 1.0, quantities="k"), partial(CELLS.pairs, quantities="k"),
        partial(CELLS.iter_pairs, 1.0, quantities="k"), partial(CELLS.iter_pairs, quantities="k"),
        partial(hs.neighbors, FLAT, 1.0, quantities="jk"),
        partial(hs.neighbors, FLAT, 1.0, quantities="jk", indices=[0]),
        partial(hs.pairs_between, FLAT, FLAT, 1.0, quantities="ijk"),
        partial(hs.explain, FLAT, 1.0, quantities="ijk"),
        partial(next, hs.trajectory_pairs([FLAT], 1.0, quantities="ijk")),
    ], ValueError, "k in quantities needs several cutoffs, got one")  # fmt: skip
    yield partial(hs.nearest, FLAT, 1, quantities="jk"), ValueError, "of the letters j d D S, each"
    for known in ({"radii": [1.0, 1.0]}, {"supports": [np.eye(2)] * 2}):
        yield (partial(hs.neighbors, hs.Points(FLAT, **known), [1.0, 2.0], quantities="jk"),
               ValueError, "several cutoffs cannot be combined with")  # fmt: skip


def some_points():
    weighted = hs.Points(FLAT, weights=[1.0, 1.0])
    queries = {"indices": [0], "queries": FLAT}
    yield from each([
        partial(hs.neighbors, FLAT, 1.0, **queries), partial(hs.nearest, FLAT, 1, **queries),
        partial(hs.pair_histogram, FLAT, [0.0, 1.0], **queries),
    ], ValueError, "do not give queries")  # fmt: skip
    yield (partial(call, hs.coordination, FLAT, 1.0, indices=[0], precision="single"), ValueError,
           "cannot be combined with precision 'single'")  # fmt: skip
    for letters in ("jj", "i"):
        one = partial(hs.neighbors, FLAT, 1.0, indices=[0], quantities=letters)
        yield one, ValueError, "letters"
    yield hs.neighbors(FLAT, 1.0, indices=[0]).reverse, ValueError, "one set of points"
    yield (partial(hs.pair_histogram, weighted, [0.0, 1.0], indices=[0]), ValueError,
           "indices cannot be combined with weights")  # fmt: skip
    yield (partial(hs.pair_histogram, FLAT, [0.0, 1.0], indices=[0, 0]), ValueError,
           "indices must name each point once")  # fmt: skip


def distribution():
    for edges, words in (
        ([1.0], r"shape \(bins \+ 1,\)"), ([], "at least"),
        ([0.0, 2.0, 1.0], r"edges\[1\] = 2.0 before edges\[2\] = 1.0"),
        ([-1.0, 1.0], r"not negative, got edges\[0\] = -1.0"),
        (np.broadcast_to(1.0, (2**30, 2**10)), "edges must have shape"),  # before it is copied
    ):  # fmt: skip
        yield partial(hs.pair_histogram, LINE, edges), ValueError, words
    for how, words in (
        ({}, "periodic along every axis"),
        ({"box": [1.0] * 2, "periodic": [True, False]}, "along every axis"),
        ({"box": [1.0] * 2, "cutoff": 0.0}, "cutoff"),
        ({"box": [1.0] * 2, "types": [0, 0], "queries": [[0.0, 0.0]]}, "have none"),
    ):
        yield partial(call, hs.rdf, FLAT, **{"cutoff": 0.5, **how}), ValueError, words


def memory():
    slab = {"box": np.ones(3), "periodic": [True, True, False]}
    queries = [[0.0, 0.0, 1.0], [0.0, 0.0, 1e10]]
    for last in (10**5, 2**31 - 2):
        how = {"types": [0, last]}
        yield partial(call, hs.pair_histogram, LINE, [0.0, 1.0], **how), MemoryError, "types"
    yield partial(hs.pair_histogram, LINE, np.broadcast_to(1.0, 2**40)), MemoryError, "edges"
    yield (partial(hs.pair_histogram, BATCHED.replace(batch=[0, 0, 1, 2**40]), [0.0, 1.0]),
           MemoryError, "")  # fmt: skip
    yield (partial(call, hs.coordination, LINE, 1.0, types=[0, 2**31 - 2], by_type=True),
           MemoryError, "types would take")  # fmt: skip
    for bins in (2**40, 2**63, 10**400):
        yield partial(hs.rdf, [[0.0]], 1.0, bins, box=[2.0]), MemoryError, "so many bins"
    for points, cutoffs in ((np.zeros((3000, 2)), [1.0, 2.0]), (FLAT, np.linspace(0, 1, 10**6))):
        how = {"quantities": "k", "memory_limit": 1e6}
        yield partial(call, hs.pairs, points, cutoffs, **how), MemoryError, ""
    yield (partial(hs.nearest, [[0.0, 0.0]], 1, queries=[[0.0, 1e300]], box=[1.0, 1.0],
                   periodic=[True, False]), MemoryError, "images")  # fmt: skip
    # Memory would do, but not the time: some 1e8 images are about as near.
    yield (partial(hs.nearest, np.zeros((2, 3)), 1, queries=queries, **slab), MemoryError,
           r"too many images are about as near to queries\[1\]")  # fmt: skip
    yield (partial(call, hs.pairs, np.full((100_000, 3), 0.3), 0.1, memory_limit=1e9), MemoryError,
           r"about 5e\+09 pairs \(80 GB\) are expected, 1 GB")  # fmt: skip


def shifts():
    far, unit = [[2.0**40, 0.0], [0.0, 0.0]], {"box": [1.0], "quantities": "ijS"}
    square = {"box": [1.0, 1.0], "quantities": "S"}
    some = {"box": [1.0], "quantities": "S", "indices": [1]}
    for one, words in (
        (partial(hs.pairs_between, FAR, FAR[:1], 0.75, **unit),
         r"queries\[1\] lies.*box vectors away"),
        (partial(hs.pairs_between, FAR[:1], FAR, 0.75, **unit),
         r"queries\[0\] lies.*box vectors away.* pairs with"),
        (partial(hs.pairs_between, BEYOND, BEYOND[:1], 1.0, box=LEANING), r"queries\[1\] lies"),
        (partial(hs.pairs_between, BEYOND[:1], BEYOND, 1.0, box=LEANING), r"points\[1\] lies"),
        (partial(hs.neighbors, FAR, 0.5, box=[1.0], quantities="jS"), "points"),
        (partial(hs.nearest, far, 1, **square), r"points\["),
        (partial(hs.nearest, far[1:], 1, queries=far[:1], **square), r"queries\[0\]"),
        (partial(hs.pairs, [[0.0], [2.0**31]], 0.25, **some), ""),
        (partial(hs.pairs, [[2.0**31], [0.0]], 0.25, **some), r"-2\*\*31 has no opposite"),
    ):
        yield one, OverflowError, words


SUBJECTS = (two_sets, reach, shells, some_points, distribution, memory, shifts)


@pytest.mark.parametrize("subject", SUBJECTS, ids=lambda subject: subject.__name__)
def test_what_is_refused_says_why(subject):
    check_refusals(list(subject()))


def test_what_is_like_that_and_right():
    assert len(hs.pairs_between(FAR, FAR[:1], 0.25, box=[1.0], quantities="ij")[0]) == 1
    assert hs.neighbors(FAR, 0.5, box=[1.0]).n_rows == 2
    assert hs.nearest([[2.0**40], [0.0]], 1, box=[1.0])[1].tolist() == [[0.0], [0.0]]
    assert hs.pairs([[0.0], [2.0**31]], 0.25, box=[1.0], indices=[1])[0].tolist() == [0]
    assert not hs.neighbors(FLAT, 1.0, indices=[0]).indices.flags.writeable
