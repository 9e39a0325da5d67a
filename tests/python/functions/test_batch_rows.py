# SPDX-License-Identifier: BSD-3-Clause
"""Rows, counts, nearest points and histograms of many systems, against one call for each."""

import pickle

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


def joined(tables):
    """Offsets and columns of tables, one behind the other; of each with its first number."""
    offsets, columns = [0], [[] for _ in tables[0][0].quantities]
    names = {"j": "indices", "d": "distances", "D": "vectors", "S": "shifts"}
    for table, first in tables:
        offsets += (np.asarray(table.offsets[1:]) + offsets[-1]).tolist()
        for column, letter in zip(columns, table.quantities, strict=True):
            values = getattr(table, names[letter])
            column.append(values + first if letter == "j" else values)
    return np.array(offsets), [np.concatenate(column) for column in columns]


def columns_of(table):
    names = {"j": "indices", "d": "distances", "D": "vectors", "S": "shifts"}
    return [getattr(table, names[letter]) for letter in table.quantities]


def check_table(found, tables):
    offsets, columns = joined(tables)
    assert np.array_equal(found.offsets, offsets)
    for one, other in zip(columns_of(found), columns, strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize(
    "kind, d, threads", [*zip(KINDS, (1, 2, 3, 4, 3), (1, 3, 1, 3, 3)), ("boxes", 1, 3)]
)
def test_rows_are_those_of_one_call_each(kind, d, threads):
    scene = Scene(kind, d)
    how = {"box": scene.box, "batch": scene.batch, "threads": threads}
    for quantities in ("jdDS", "j", "Sd"):
        tables, asked_tables = [], []
        for s, own, asked, first in scene.parts():
            box, cutoff = scene.at(s)
            tables.append(
                (hs.neighbors(scene.points[own], cutoff, box=box, quantities=quantities), first)
            )
            asked_tables.append((hs.neighbors(
                scene.points[own], cutoff, queries=scene.queries[asked], box=box,
                quantities=quantities), first))  # fmt: skip
        found = call(hs.neighbors, scene.points, scene.cutoff, quantities=quantities, **how)
        check_table(found, tables)
        assert (
            call(hs.coordination, scene.points, scene.cutoff, **how).tolist()
            == found.counts.tolist()
        )
        asked = dict(how, queries=scene.queries, query_batch=scene.query_batch)
        rows = call(hs.neighbors, scene.points, scene.cutoff, quantities=quantities, **asked)
        check_table(rows, asked_tables)
        counts = call(hs.coordination, scene.points, scene.cutoff, **asked)
        assert counts.tolist() == rows.counts.tolist()
        assert found.n_entries > 0 and rows.n_entries > 0


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
    "kind, rule",
    [*zip(KINDS, ("sum", "max", "min", "gather", "scatter")), ("boxes and cutoffs", "gather")],
)
def test_radii_and_rules(kind, rule):
    scene = Scene(kind, seed=2)
    cutoff = scene.cutoff if kind != "open" else None
    unused = {"gather": "radii", "scatter": "query_radii"}.get(rule)  # with queries
    tables, asked_tables = [], []
    for s, own, asked, first in scene.parts():
        box, own_cutoff = scene.at(s)
        each = {
            "radii": scene.radii[own], "rule": rule, "box": box, "quantities": "jdS",
        }  # fmt: skip
        limit = None if cutoff is None else own_cutoff
        tables.append((call(hs.neighbors, scene.points[own], limit, **each), first))
        both = {**each, "queries": scene.queries[asked], "query_radii": scene.query_radii[asked]}
        both = {name: values for name, values in both.items() if name != unused}
        asked_tables.append((call(hs.neighbors, scene.points[own], limit, **both), first))
    how = {
        "radii": scene.radii, "rule": rule, "box": scene.box, "quantities": "jdS",
        "batch": scene.batch,
    }  # fmt: skip
    found = call(hs.neighbors, scene.points, cutoff, **how)
    check_table(found, tables)
    how |= {
        "queries": scene.queries, "query_radii": scene.query_radii,
        "query_batch": scene.query_batch,
    }  # fmt: skip
    how.pop(unused, None)
    check_table(call(hs.neighbors, scene.points, cutoff, **how), asked_tables)
    if rule in ("gather", "scatter"):
        with pytest.raises(ValueError, match="direction"):
            found.reverse()


@pytest.mark.parametrize(
    "kind, what",
    [*zip(KINDS, ("groups", "labels", "bonds", "within", "least")), *((k, "all") for k in KINDS)],
)
def test_selections(kind, what):
    scene = Scene(kind, seed=3)
    tables, asked_tables = [], []

    def chosen(own, bonds):
        parts = {
            "groups": {"groups": scene.labels[own]},
            "labels": {"exclude": scene.labels[own]},
            "bonds": {"exclude": bonds},
            "within": {"exclude": scene.labels[own], "exclude_within": 1},
            "least": {"min_distance": 0.4},
        }
        if what == "all":
            return {**parts["groups"], **parts["bonds"], **parts["least"]}
        return parts[what]

    def asked_chosen(asked):
        return {
            "groups": {"query_groups": scene.query_labels[asked]},
            "labels": {"query_exclude": scene.query_labels[asked]},
            "within": {"query_exclude": scene.query_labels[asked]},
            "all": {"query_groups": scene.query_labels[asked]},
        }.get(what, {})

    rng = np.random.default_rng(5)
    q = len(scene.queries)
    between = np.stack([rng.integers(0, q, 200), rng.integers(0, len(scene.points), 200)], axis=1)
    for s, own, asked, first in scene.parts():
        box, cutoff = scene.at(s)
        each = {"box": box, "quantities": "jS"}
        bonds = scene.among(own, scene.bonds)
        tables.append(
            (call(hs.neighbors, scene.points[own], cutoff, **chosen(own, bonds), **each), first)
        )
        mine = between[np.isin(between[:, 0], asked) & np.isin(between[:, 1], own)]
        mine = mine - [asked[0] if len(asked) else 0, first]
        asked_tables.append((call(hs.neighbors,
            scene.points[own], cutoff, queries=scene.queries[asked], **each,
            **chosen(own, mine), **asked_chosen(asked)), first))  # fmt: skip
    how = {"box": scene.box, "quantities": "jS", "batch": scene.batch}
    every = slice(None)
    found = call(hs.neighbors, scene.points, scene.cutoff, **how, **chosen(every, scene.bonds))
    check_table(found, tables)
    rows = call(hs.neighbors,
        scene.points, scene.cutoff, queries=scene.queries, query_batch=scene.query_batch, **how,
        **chosen(every, between), **asked_chosen(every),
    )  # fmt: skip
    check_table(rows, asked_tables)
    half = call(hs.pairs, scene.points, scene.cutoff, box=scene.box, batch=scene.batch,
                    **chosen(every, scene.bonds))  # fmt: skip
    assert 2 * len(half[0]) == found.n_entries


@pytest.mark.parametrize("kind, threads", [*zip(KINDS, (1, 2, 1, 2, 2))])
def test_nearest_of_each(kind, threads):
    scene = Scene(kind, seed=4)
    limit = scene.cutoffs if scene.has_cutoffs else 1.4
    expected, asked_expected = [[] for _ in "jdDS"], [[] for _ in "jdDS"]
    for s, own, asked, first in scene.parts():
        box, _ = scene.at(s)
        each = {
            "max_distance": float(scene.cutoffs[s]) if scene.has_cutoffs else 1.4, "box": box,
            "quantities": "jdDS",
        }  # fmt: skip
        for columns, queries in ((expected, None), (asked_expected, scene.queries[asked])):
            found = call(hs.nearest, scene.points[own], 5, queries=queries, **each)
            for column, values in zip(columns, found, strict=True):
                is_number = values.dtype == np.int64
                column.append(np.where(values < 0, -1, values + first) if is_number else values)
    how = {
        "max_distance": limit, "box": scene.box, "quantities": "jdDS", "batch": scene.batch,
        "threads": threads,
    }  # fmt: skip
    for one, columns in zip(call(hs.nearest, scene.points, 5, **how), expected, strict=True):
        assert np.array_equal(one, np.concatenate(columns), equal_nan=one.dtype.kind == "f")
    asked = dict(how, queries=scene.queries, query_batch=scene.query_batch, index_dtype=np.int32)
    for one, columns in zip(
        call(hs.nearest, scene.points, 5, **asked), asked_expected, strict=True
    ):
        assert np.array_equal(one, np.concatenate(columns), equal_nan=one.dtype.kind == "f")
    assert len(call(hs.nearest, scene.points, 2, batch=scene.batch)[0]) == len(scene.points)


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


def test_coordination_by_type():
    scene = Scene("boxes and cutoffs", seed=8)
    names = np.array(["H", "O", "Si"])[scene.labels]
    how = {"box": scene.box, "batch": scene.batch}
    found = call(hs.coordination, scene.points, scene.cutoff, types=names, by_type=True, **how)
    asked = call(hs.coordination,
        scene.points, scene.cutoff, types=names, by_type=True, queries=scene.queries,
        query_batch=scene.query_batch, **how,
    )  # fmt: skip
    for s, own, rows, _ in scene.parts():
        box, cutoff = scene.at(s)
        if len(set(names[own])) == 3:
            one = call(
                hs.coordination, scene.points[own], cutoff, types=names[own], by_type=True, box=box
            )
            assert np.array_equal(found[own], one)
            one = call(
                hs.coordination,
                scene.points[own],
                cutoff,
                types=names[own],
                by_type=True,
                box=box,
                queries=scene.queries[rows],
            )
            assert np.array_equal(asked[rows], one)
    table = np.array([[0.5, 1.0, 0.8], [1.0, 0.2, 1.2], [0.8, 1.2, 1.5]])
    numbers = {"types": scene.labels, "box": scene.box, "batch": scene.batch}
    by_type = call(hs.coordination, scene.points, table, by_type=True, **numbers)
    assert np.array_equal(
        by_type.sum(axis=1), call(hs.coordination, scene.points, table, **numbers)
    )
    assert by_type.shape == (len(scene.points), 3) and by_type.any()
    with pytest.raises(ValueError, match="by_type needs types"):
        call(hs.coordination, scene.points, 1.0, batch=scene.batch, by_type=True)


@pytest.mark.parametrize("kind, quantities", [*zip(KINDS, ("jd", "jdS", "jdS", "jd", "jd"))])
def test_tables_are_sorted_by_distance_exactly(kind, quantities):
    rng = np.random.default_rng(9)
    scene = Scene(kind, seed=9)
    # Many equal distances: whole numbers, and boxes of them.
    scene.points = rng.integers(0, 4, scene.points.shape).astype(float)
    scene.boxes = np.round(scene.boxes) + rng.integers(-1, 2, scene.boxes.shape) * 0.25
    scene.cutoffs += 1.5
    scene.box = scene.boxes if scene.has_boxes else scene.box
    cutoff = scene.cutoffs if scene.has_cutoffs else 2.5
    found = call(
        hs.neighbors, scene.points, cutoff, box=scene.box, batch=scene.batch, quantities=quantities
    )
    again = pickle.loads(pickle.dumps(found))
    rows = np.array([5, 3, 40, 41, 3])
    some = pickle.loads(pickle.dumps(found[rows])).sort()
    in_order = found.sort()
    tables = []
    for s, own, _, first in scene.parts():
        box = scene.at(s)[0]
        limit = float(scene.cutoffs[s]) if scene.has_cutoffs else 2.5
        one = hs.neighbors(scene.points[own], limit, box=box, quantities=quantities)
        tables.append((one.sort(), first))
    check_table(in_order, tables)
    check_table(again.sort(), tables)
    for k, row in enumerate(rows):
        for one, other in zip(some[k], in_order[row], strict=True):
            assert np.array_equal(one, other)


# ---- what is refused, and no systems ---------------------------------------------------------


def test_bad_input():
    points, batch = np.zeros((4, 3)), np.array([0, 0, 1, 2])
    queries, asked = np.zeros((2, 3)), np.array([0, 2])
    for search in (hs.neighbors, hs.coordination, lambda p, c, **h: hs.nearest(p, 2, **h),
                   lambda p, c, **h: hs.pair_histogram(p, [0.0, 1.0], **h)):  # fmt: skip
        with pytest.raises(ValueError, match="queries have a batch, and points have none"):
            call(search, points, 1.0, queries=queries, query_batch=asked)
        with pytest.raises(ValueError, match="points have a batch, and queries have none"):
            call(search, points, 1.0, batch=batch, queries=queries)
        with pytest.raises(ValueError, match=r"batch must ascend, got batch\[0\] = 1 before 0"):
            call(search, points, 1.0, batch=[1, 0, 1, 2])
        with pytest.raises(ValueError, match=r"batch must ascend, got batch"):
            call(search, points, 1.0, batch=batch, queries=queries, query_batch=[2, 0])
        with pytest.raises(ValueError, match="batch must be from 0 on"):
            call(search, points, 1.0, batch=batch, queries=queries, query_batch=[-2, 0])
        with pytest.raises(ValueError, match=r"shape .2,., one number for each"):
            call(search, points, 1.0, batch=batch, queries=queries, query_batch=[0])
        with pytest.raises(TypeError, match="batch must hold integers"):
            call(search, points, 1.0, batch=batch, queries=queries, query_batch=[0.0, 1.0])
        with pytest.raises(ValueError, match="same number of columns"):
            call(search, points, 1.0, batch=batch, queries=np.zeros((2, 2)), query_batch=asked)
        with pytest.raises(ValueError, match=r"batch must be less than the number of"):
            call(search, points, 1.0, batch=batch, queries=queries, query_batch=[0, 3],
                   box=np.array([np.eye(3)] * 3))  # fmt: skip
        worse = points.copy()
        worse[3, 1] = np.nan
        with pytest.raises(ValueError, match=r"positions\[3, 1\] = nan"):
            call(search, worse, 1.0, batch=batch)
        asking = queries.copy()
        asking[1, 2] = np.inf
        with pytest.raises(ValueError, match=r"positions\[1, 2\] = inf"):
            call(search, points, 1.0, batch=batch, queries=asking, query_batch=asked)
        with pytest.raises(ValueError, match=r"box"):
            call(
                search,
                points,
                1.0,
                batch=batch,
                box=np.array([np.eye(3), np.eye(3), np.zeros((3, 3))]),
            )
    for search in (hs.neighbors, hs.coordination):
        with pytest.raises(ValueError, match=r"radii.*radii\[2\] = -1"):
            call(search, points, None, batch=batch, radii=[1.0, 1.0, -1.0, 1.0])
        with pytest.raises(ValueError, match="cutoff"):
            call(search, points, -1.0, batch=batch)
        with pytest.raises(ValueError, match="cutoff"):
            call(search, points[:0], -1.0, batch=batch[:0])
        with pytest.raises(ValueError, match="cutoff"):
            call(search, points, [1.0, -1.0, 1.0], batch=batch)
    with pytest.raises(ValueError, match=r"max_distance\[1\] = -1"):
        call(hs.nearest, points, 2, batch=batch, max_distance=[1.0, -1.0, 1.0])
    with pytest.raises(ValueError, match=r"max_distance must be a number or"):
        call(hs.nearest, points, 2, batch=batch, max_distance=np.ones((2, 2)))
    with pytest.raises(ValueError, match="rdf needs a box"):
        call(hs.rdf, points, 1.0, batch=batch)
    with pytest.raises(MemoryError):
        call(hs.pair_histogram, points, [0.0, 1.0], batch=[0, 0, 1, 2**40])
    assert call(hs.pair_histogram, points, [0.0, 1.0], batch=[0, 0, 1, 2**10]).shape == (1025, 1)


def test_systems_before_the_first_that_has_points_are_empty():
    points = np.array([[0.0], [0.5], [0.0], [0.5], [0.9]])
    found = call(hs.pair_histogram, points, [0.0, 1.0], batch=[1, 1, 3, 3, 3])
    assert found.tolist() == [[0], [1], [0], [3]]


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


@pytest.mark.parametrize("kind", KINDS)
def test_counts_and_streams_of_each(kind):
    scene = Scene(kind, seed=12)
    points = hs.Points(scene.points, box=scene.box, batch=scene.batch)
    queries = hs.Points(scene.queries, batch=scene.query_batch)
    some = np.random.default_rng(2).permutation(len(scene.points))[:30]
    asked_counts = hs.count_pairs(points, scene.cutoff, queries=queries)
    some_counts = hs.count_pairs(points, scene.cutoff, indices=some)
    found = hs.pairs(points, scene.cutoff, indices=some, quantities="ijd", sort=True)
    rows = hs.neighbors(points, scene.cutoff, indices=some)
    at, first_asked = 0, 0
    for s, own, asked, first in scene.parts():
        box, cutoff = scene.at(s)
        one, mine = hs.Points(scene.points[own], box=box), some[np.isin(some, own)] - first
        expected = hs.pairs(one, cutoff, indices=mine, quantities="ijd", sort=True)
        part = slice(at, at + len(expected[0]))
        for ours, theirs, more in zip(found, expected, (first, first, 0)):
            assert np.array_equal(ours[part], theirs + more)
        at = part.stop
        counted = hs.count_pairs(one, cutoff, queries=scene.queries[asked])
        for counts, count in ((some_counts, len(expected[0])), (asked_counts, counted)):
            assert (counts[s] if s < len(counts) else 0) == count
        first_asked += len(asked)
    assert at == len(found[0]) == some_counts.sum() > 10
    table = hs.neighbors(points, scene.cutoff)
    assert all(np.array_equal(rows[k], table[i]) for k, i in enumerate(some))
    for most in (17, 1 << 20):
        blocks = list(hs.iter_pairs(points, scene.cutoff, quantities="ijd", max_pairs=most))
        assert all(len(block[0]) <= most for block in blocks)
        joined = [np.concatenate(column) for column in zip(*blocks)]
        order = np.lexsort(joined[::-1])
        whole = hs.pairs(points, scene.cutoff, quantities="ijd")
        assert len(joined[0]) == len(whole[0])
        for ours, theirs in zip(joined, whole):
            assert np.array_equal(ours[order], theirs[np.lexsort(whole[::-1])])
