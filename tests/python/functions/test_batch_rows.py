# SPDX-License-Identifier: BSD-3-Clause
"""Rows, counts, nearest points and histograms of many systems, against one call for each."""

import ctypes

import numpy as np
import pytest

import halfshell as hs
from calls import call

KINDS = ["open", "shared box", "boxes", "cutoffs", "boxes and cutoffs"]


class Scene:
    """Systems of 0 to 40 points, of which some are missing, with queries in most."""

    def __init__(self, kind, d=3, seed=0, dtype=np.float64):
        rng = np.random.default_rng([seed, d, KINDS.index(kind)])
        sizes = rng.integers(0, 40, 12)
        sizes[[3, 7]] = 0
        asking = rng.integers(0, 9, 12)
        asking[[4, 7]] = 0
        self.n_systems, self.d = 12, d
        self.batch = np.repeat(np.arange(12), sizes)
        self.query_batch = np.repeat(np.arange(12), asking)
        n, q = sizes.sum(), asking.sum()
        self.points = rng.uniform(-1.0, 4.0, (n, d)).astype(dtype)
        self.queries = rng.uniform(-1.0, 4.0, (q, d)).astype(dtype)
        shape = np.eye(d) * 3.0
        self.boxes = shape + rng.uniform(-0.4, 0.4, (12, d, d))
        self.cutoffs = rng.uniform(0.3, 1.6, 12)
        self.labels = rng.integers(0, 3, n)
        self.query_labels = rng.integers(0, 3, q)
        self.radii = rng.uniform(0.1, 0.9, n)
        self.query_radii = rng.uniform(0.1, 0.9, q)
        self.bonds = rng.integers(0, n, (3 * n, 2))
        self.has_boxes = "boxes" in kind
        self.has_cutoffs = "cutoffs" in kind
        self.box = self.boxes if self.has_boxes else shape if kind == "shared box" else None
        self.cutoff = self.cutoffs if self.has_cutoffs else 1.1

    def at(self, s):
        """The box and cutoff of a system."""
        box = self.boxes[s] if self.has_boxes else self.box
        return box, float(self.cutoffs[s]) if self.has_cutoffs else 1.1

    def parts(self):
        for s in range(self.n_systems):
            own, asked = np.flatnonzero(self.batch == s), np.flatnonzero(self.query_batch == s)
            first = own[0] if len(own) else 0
            yield s, own, asked, first

    def among(self, own, pairs):
        """Those pairs of numbers that are among these points, numbered there."""
        kept = np.isin(pairs, own).all(axis=1)
        return pairs[kept] - (own[0] if len(own) else 0)


@pytest.mark.parametrize(
    "kind, index_dtype", [*zip(KINDS, [np.int32, np.int64, np.int32, np.int64, np.int64])]
)
def test_pairs_between_are_those_of_one_call_each(kind, index_dtype):
    scene = Scene(kind, seed=1)
    how = {
        "box": scene.box, "batch": scene.batch, "query_batch": scene.query_batch,
        "quantities": "ijdDSP", "index_dtype": index_dtype,
    }  # fmt: skip
    expected, first_asked = [[] for _ in "ijdDSP"], 0
    for s, own, asked, first in scene.parts():
        box, cutoff = scene.at(s)
        found = list(
            hs.pairs_between(
                scene.queries[asked], scene.points[own], cutoff, box=box, quantities="ijdDSP"
            )
        )
        found[0] = found[0] + first_asked
        found[1] = found[1] + first
        found[5] = found[5] + [first_asked, first]
        first_asked += len(asked)
        for column, values in zip(expected, found, strict=True):
            column.append(values)
    expected = [np.concatenate(column) for column in expected]
    args = scene.queries, scene.points, scene.cutoff
    for one, other in zip(call(hs.pairs_between, *args, **how), expected, strict=True):
        assert np.array_equal(one, other)
    m = len(expected[0])
    out = tuple(
        np.full_like(c, 7, dtype=index_dtype if k in (0, 1, 5) else None)
        for k, c in enumerate(np.concatenate((c, c)) for c in expected)
    )
    filled = call(hs.pairs_between, *args, out=out, **how)
    for one, whole, other in zip(filled, out, expected, strict=True):
        assert np.array_equal(one, other) and (whole[m:] == 7).all()
    with pytest.raises(hs.CapacityError):
        call(hs.pairs_between, *args, out=tuple(one[: m - 1] for one in out), **how)


@pytest.mark.parametrize(
    "kind, marks",
    [
        ("open", "types"),
        ("shared box", "weights"),
        ("boxes", ""),
        ("boxes", "types"),
        ("boxes", "names"),
    ],
)
def test_histograms_of_each(kind, marks):
    scene = Scene(kind, seed=6)
    edges = np.linspace(0.0, 2.0, 8)
    names = np.array(["H", "O", "Si"])

    def of(own, asked=None):
        labels = scene.labels[own], None if asked is None else scene.query_labels[asked]
        key = "types" if marks in ("types", "names") else marks
        if marks == "weights":
            labels = scene.radii[own], None if asked is None else scene.query_radii[asked]
        if marks == "names":
            labels = names[labels[0]], None if asked is None else names[labels[1]]
        found = {key: labels[0]} if key else {}
        return found if asked is None or not key else {**found, f"query_{key}": labels[1]}

    every = slice(None)
    how = {"box": scene.box, "batch": scene.batch}
    found = call(hs.pair_histogram, scene.points, edges, **how, **of(every))
    asked_found = call(hs.pair_histogram,
        scene.points, edges, queries=scene.queries, query_batch=scene.query_batch, **how,
        **of(every, every),
    )  # fmt: skip
    n_systems = 12 if scene.has_boxes else 1 + max(scene.batch[-1], scene.query_batch[-1])
    assert asked_found.shape[0] == n_systems
    assert found.shape[0] == (12 if scene.has_boxes else 1 + scene.batch[-1])
    t = 3 if marks in ("types", "names") else None
    for s, own, asked, _ in scene.parts():
        box, _ = scene.at(s)
        for whole, one in (
            (found, call(hs.pair_histogram, scene.points[own], edges, box=box, **of(own))),
            (asked_found, call(hs.pair_histogram,
                scene.points[own], edges, queries=scene.queries[asked], box=box,
                **of(own, asked))),
        ):  # fmt: skip
            if s >= len(whole):
                assert len(own) == 0
            elif t is None:
                assert np.array_equal(whole[s], one)
            elif marks == "types":
                k = one.shape[0]
                assert np.array_equal(whole[s, :k, :k], one) and whole[s].sum() == one.sum()
            else:
                assert whole[s].sum() == one.sum()
    assert found.sum() > 0 and found.dtype == (np.float64 if marks == "weights" else np.int64)


@pytest.mark.parametrize(
    "kind, has_types, has_queries",
    [("shared box", False, False), ("shared box", True, True), ("boxes", True, False),
     ("boxes", False, True)],
)  # fmt: skip
def test_rdf_is_that_of_all_frames(kind, has_types, has_queries):
    scene = Scene(kind, seed=7)
    whole = {"types": np.array(["O", "Si", "H"])[scene.labels]} if has_types else {}
    if has_queries:
        whole["queries"], whole["query_batch"] = scene.queries, scene.query_batch
        if has_types:
            whole["query_types"] = np.array(["O", "Si", "H"])[scene.query_labels]
    found = call(hs.rdf, scene.points, 1.5, 6, box=scene.box, batch=scene.batch, **whole)
    each = []
    for s, own, asked, _ in scene.parts():
        if len(own) + (len(asked) if has_queries else 0) == 0:
            continue
        part = {k: v[own if k == "types" else asked] for k, v in whole.items()}
        part.pop("query_batch", None)
        each.append(call(hs.rdf, scene.points[own], 1.5, 6, box=scene.at(s)[0], **part))
    expected = sum(each)
    assert np.array_equal(found.counts, expected.counts) and found.types == expected.types
    assert np.allclose(found.g, expected.g, rtol=1e-13, atol=0.0)
    assert np.allclose(found.n, expected.n, rtol=1e-13, atol=0.0)
    assert found.n_frames == len(each)
    assert found.g.max() > 0.5


# ---- what is refused, and no systems ---------------------------------------------------------


def test_bad_input():
    points, batch = np.zeros((4, 3)), np.array([0, 0, 1, 2])
    queries, asked = np.zeros((2, 3)), np.array([0, 2])
    boxes = np.array([np.eye(3)] * 3)
    worse, asking, flat = points.copy(), queries.copy(), boxes.copy()
    worse[3, 1], asking[1, 2], flat[2] = np.nan, np.inf, 0.0
    plain = {"batch": batch}
    both = {**plain, "queries": queries, "query_batch": asked}
    cases = [
        (points, {"queries": queries, "query_batch": asked}, "queries have a batch, and points"),
        (points, {**plain, "queries": queries}, "points have a batch, and queries have none"),
        (points, {**both, "query_batch": [2, 0]}, "batch must ascend, got batch"),
        (points, {**both, "query_batch": [0]}, r"shape .2,., one number for each"),
        (points, {**both, "queries": np.zeros((2, 2))}, "same number of columns"),
        (points, {**both, "query_batch": [0, 3], "box": boxes}, "batch must be less than the num"),
        (worse, plain, r"positions\[3, 1\] = nan"),
        (points, {**both, "queries": asking}, r"positions\[1, 2\] = inf"),
        (points, {**plain, "box": flat}, "box"),
    ]
    for search in (hs.neighbors, hs.coordination, lambda p, c, **h: hs.nearest(p, 2, **h),
                   lambda p, c, **h: hs.pair_histogram(p, [0.0, 1.0], **h)):  # fmt: skip
        for given, how, message in cases:
            with pytest.raises(ValueError, match=message):
                call(search, given, 1.0, **how)
    for function, rest, how, message in (
        (hs.neighbors, [None], {"radii": [1.0, 1.0, -1.0, 1.0]}, r"radii.*radii\[2\] = -1"),
        (hs.coordination, [[1.0, -1.0, 1.0]], {}, "cutoff"),
        (hs.nearest, [2], {"max_distance": [1.0, -1.0, 1.0]}, r"max_distance\[1\] = -1"),
        (hs.nearest, [2], {"max_distance": np.ones((2, 2))}, "max_distance must be a number or"),
        (hs.rdf, [1.0], {}, "rdf needs a box"),
    ):
        with pytest.raises(ValueError, match=message):
            call(function, points, *rest, batch=batch, **how)
    with pytest.raises(MemoryError):
        call(hs.pair_histogram, points, [0.0, 1.0], batch=[0, 0, 1, 2**40])


def test_nothing():
    none = np.zeros((0, 3))
    batch = np.zeros(0, int)
    assert len(call(hs.neighbors, none, 1.0, batch=batch)) == 0
    assert call(hs.coordination, none, 1.0, batch=batch).shape == (0,)
    assert call(hs.nearest, none, 2, batch=batch)[0].shape == (0, 2)
    assert call(hs.pair_histogram, none, [0.0, 1.0], batch=batch).shape == (0, 1)
    rows = call(hs.neighbors, none, 1.0, batch=batch, queries=np.zeros((2, 3)), query_batch=[4, 9])
    assert rows.counts.tolist() == [0, 0]
    j, d = call(hs.nearest, none, 2, batch=batch, queries=np.zeros((2, 3)), query_batch=[4, 9])
    assert (j == -1).all() and np.isinf(d).all()
    i, _ = call(hs.pairs_between, np.zeros((2, 3)), none, 1.0, batch=batch, query_batch=[0, 0])
    assert i.size == 0
    empty = call(hs.rdf, none, 1.0, box=np.eye(3), batch=batch)
    assert empty.counts.sum() == 0 and np.isfinite(empty.g).all()


# ---- pairs that are measured, and functions that are called ----------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_given_pairs_are_measured_in_the_box_of_their_system(kind, rng):
    scene = Scene(kind, seed=5)
    points = hs.Points(scene.points, box=scene.box, batch=scene.batch)
    queries = hs.Points(scene.queries, batch=scene.query_batch)
    i, j, S, d, D = hs.pairs(points, scene.cutoff, quantities="ijSdD")
    order = rng.permutation(len(i))
    i, j, S, d, D = (column[order] for column in (i, j, S, d, D))
    found = hs.measure(points, i, j, S)
    assert all(map(np.array_equal, found, (d, D, S)))
    nearest = hs.measure(points, i, j, quantities="Sd")
    for s, own, _, first in scene.parts():
        mine = scene.batch[i] == s
        box = scene.at(s)[0]
        one = hs.measure(
            scene.points[own], i[mine] - first, j[mine] - first, box=box, quantities="Sd"
        )
        assert all(map(np.array_equal, one, (nearest[0][mine], nearest[1][mine])))
    itself = hs.pairs_between(points, points, scene.cutoff, quantities="ijS")
    rows = hs.pairs_between(hs.Points(scene.points, batch=scene.batch), points, scene.cutoff)
    assert all(map(np.array_equal, itself, rows))
    a, b, T, e = hs.pairs_between(queries, points, scene.cutoff, quantities="ijSd")
    told = []
    again = hs.measure(points, a, b, T, queries=queries, quantities="d", progress=told.append)
    assert np.array_equal(again, e) and told == sorted(told)
    assert hs.measure(points, [], [])[0].shape == (0,)


def test_measured_pairs_are_of_one_system_and_named_by_their_number():
    points = hs.Points([[0.0], [1.0], [2.0], [1e300]], batch=[0, 0, 1, 1], box=[[[4.0]], [[5.0]]])
    with pytest.raises(
        ValueError, match=r"pair 1 is of two systems: i\[1\] of system 0, j\[1\] of"
    ):
        hs.measure(points, [0, 1], [1, 2])
    with pytest.raises(OverflowError, match=r"^pair 2: a point lies too many box vectors away"):
        hs.measure(points, [0, 1, 2], [1, 0, 3])
    empty = hs.Points(np.empty((0, 2)), batch=[])
    assert [one.shape for one in hs.measure(empty, [], [])] == [(0,), (0, 2), (0, 2)]


@pytest.mark.parametrize("kind", KINDS)
def test_functions_are_called_for_each_pair_of_all_systems(kind):
    scene = Scene(kind, seed=6)
    points = hs.Points(scene.points, box=scene.box, batch=scene.batch, groups=scene.labels % 2)
    cutoff = scene.cutoff
    i, j, S, D = (c.tolist() for c in hs.pairs(points, cutoff, quantities="ijSD"))
    seen = []
    how = {"exclude": scene.bonds, "min_distance": 0.2}
    n = hs.for_each_pair(points, cutoff, lambda *pair: seen.append(pair[:4]))
    assert n == len(i) > 30
    assert seen == list(zip(i, j, map(tuple, S), map(tuple, D)))
    few = []
    stop = hs.for_each_pair(points, cutoff, lambda *pair: few.append(pair[:2]) or len(few) == 25)
    assert stop == 25 and few == [pair[:2] for pair in seen[:25]]

    def note(a, b, *rest):
        numbers.append((a, b))
        return len(numbers) == most[0]

    kinds = ctypes.c_int64, ctypes.c_int64, *[ctypes.POINTER(ctypes.c_int32)]
    signature = ctypes.CFUNCTYPE(
        ctypes.c_int, *kinds, ctypes.POINTER(ctypes.c_double), ctypes.c_double, ctypes.c_void_p
    )
    most = [0]
    for most[0], right in ((25, 25), (0, len(i))):
        numbers = []
        assert hs.for_each_pair(points, cutoff, signature(note)) == right
        assert numbers == [pair[:2] for pair in seen[:right]]
    numbers = []
    n = hs.for_each_pair(points, cutoff, signature(note), **how)
    a, b = hs.pairs(points, cutoff, **how)
    assert n == len(a) and numbers == list(zip(a.tolist(), b.tolist()))
