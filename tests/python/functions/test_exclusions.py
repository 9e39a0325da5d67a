# SPDX-License-Identifier: BSD-3-Clause
"""Which pairs count: groups, excluded pairs, a least distance, against fractions in every box."""

import random
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from calls import call
from full_lists import full_list, list_between
from halfshell._check.reference import exact_square
from rational_images import Images, between, exact

# ---- the rule, in fractions ------------------------------------------------------------------


class Rule:
    """What counts in a scene; entries are (i, j, S) of rows of points or of queries."""

    def __init__(self, scene, chosen, of_queries=None):
        self.points, self.cutoff, self.options = scene
        self.own = of_queries is None
        self.chosen = chosen
        self.of_asking = chosen if self.own else of_queries
        self.asking = self.points if self.own else of_queries["queries"]
        geometry = self.options.get("box"), self.options.get("periodic")
        self.images = Images(self.points.shape[1], *geometry)
        self.scene = (self.cutoff, *geometry, self.options["inclusive"])

    def is_excluded(self, i, j):
        exclude = self.chosen["exclude"]
        if exclude is None or (self.own and i == j):
            return False
        if exclude.ndim == 2:
            pairs = {tuple(pair) for pair in exclude.tolist()}
            return (i, j) in pairs or (self.own and (j, i) in pairs)
        label = (exclude if self.own else self.of_asking["query_exclude"])[i]
        return abs(int(label) - int(exclude[j])) <= (self.chosen["exclude_within"] or 0)

    def nearest(self, i, j):
        """Of images that are equally near the first one of the lower number: they ascend."""
        if self.own and j < i:
            return tuple(-s for s in self.nearest(j, i))
        apart = between(exact(self.asking[i]), exact(self.points[j]))
        found = self.images.within(apart, Fraction(self.cutoff) ** 2)
        return min(((square, S) for S, _, square in found), default=(None, None))[1]

    def is_left_out(self, i, j, S):
        groups, least = self.chosen["groups"], Fraction(self.chosen["min_distance"] or 0.0)
        if groups is not None:
            label = (groups if self.own else self.of_asking["query_groups"])[i]
            if label != groups[j]:
                return True
        both = (self.asking[i], self.points[j])
        square = exact_square(both, 0, 1, S, self.options.get("box"))
        return square < least**2 or (self.is_excluded(i, j) and S == self.nearest(i, j))

    def entries(self):
        if self.own:
            found = full_list(self.points, *self.scene)
        else:
            found = list_between(self.asking, self.points, *self.scene)
        return {entry for entry in found if not self.is_left_out(*entry)}


# ---- scenes ----------------------------------------------------------------------------------


def points_of(draw, n, ndim, length):
    if draw.random() < 0.6:
        rows = [[draw.randint(-2, 6) * 0.5 for _ in range(ndim)] for _ in range(n)]
    else:
        rows = [[draw.uniform(-1, length + 1) for _ in range(ndim)] for _ in range(n)]
    dtype = np.float32 if draw.random() < 0.3 else np.float64
    return np.array(rows, dtype).reshape(n, ndim)


def scene_of(draw):
    ndim = draw.choice([1, 2, 2, 3])
    n, length = draw.randint(0, 8 if ndim == 3 else 11), draw.choice([2.0, 3.0, 4.0])
    points = points_of(draw, n, ndim, length)
    options = {
        "inclusive": draw.random() < 0.6,
        "algorithm": draw.choice(["auto", "grid", "hash", "all-pairs", "hierarchy"]),
        "kernel": draw.choice(hs.kernels()),
        "threads": draw.choice([1, 2]),
    }
    if draw.random() < 0.75:
        box = np.diag([length * draw.choice([1, 1, 1.5]) for _ in range(ndim)])
        if draw.random() < 0.5 and ndim > 1:
            box[1, 0] = draw.choice([0.5, 1.0, -1.0])
            box[-1, -2] += draw.choice([0.5, -0.5, 0.0])
        options["box"] = box
        options["periodic"] = [draw.random() < 0.8 for _ in range(ndim)]
    cutoff = draw.choice([0.5, 1.0, 1.5, 2.0, draw.uniform(0.3, 2.2)])
    return points, cutoff, options


def labels_of(draw, n, low=-2):
    return np.array([draw.randint(low, 2) for _ in range(n)], np.int64)


def chosen_of(draw, n, q, cutoff):
    chosen = dict.fromkeys(("groups", "exclude", "exclude_within"))
    of_queries = {"query_groups": None, "query_exclude": None}
    if draw.random() < 0.4:
        chosen["groups"], of_queries["query_groups"] = labels_of(draw, n, 0), labels_of(draw, q, 0)
    kind = draw.random()
    if kind < 0.35:
        chosen["exclude"], of_queries["query_exclude"] = labels_of(draw, n), labels_of(draw, q)
        chosen["exclude_within"] = draw.choice([None, 0, 1])
    elif kind < 0.7 and n and q:
        pairs = [[draw.randrange(min(n, q)), draw.randrange(n)] for _ in range(draw.randint(0, n))]
        chosen["exclude"] = np.array(pairs, np.int64).reshape(-1, 2)
    chosen["min_distance"] = draw.choice([None, None, 0.0, 0.5, 1.0, cutoff])
    return chosen, of_queries


def entries_of(i, j, S):
    listed = list(zip(i.tolist(), j.tolist(), map(tuple, S.tolist()), strict=True))
    assert len(listed) == len(set(listed))
    return set(listed)


def of_table(table, numbers=None):
    numbers = np.arange(len(table)) if numbers is None else numbers
    return entries_of(np.repeat(numbers, table.counts), table.indices, table.shifts)


def in_parts(n, parts=4):
    """Run a test for the seeds below n, in some parts."""
    return pytest.mark.parametrize("seeds", [range(k, n, parts) for k in range(parts)], ids=str)


@in_parts(200)
def test_one_set(seeds):
    for seed in seeds:
        draw = random.Random(seed)
        points, cutoff, options = scene_of(draw)
        chosen, _ = chosen_of(draw, len(points), len(points), cutoff)
        full = Rule((points, cutoff, options), chosen).entries()
        zero = (0,) * points.shape[1]
        half = {(i, j, S) for i, j, S in full if i < j or (i == j and S > zero)}
        check_half_lists(points, cutoff, half, chosen, options)
        check_rows(points, cutoff, full, {**chosen, **options})
        check_some_points(draw, points, cutoff, full, half, chosen, options)


def check_half_lists(points, cutoff, half, chosen, options):
    every = {**chosen, **options}
    assert entries_of(*call(hs.pairs, points, cutoff, quantities="ijS", **every)) == half
    i, j, d, _, S = call(hs.pairs, points, cutoff, quantities="ijdDS", **every)
    assert entries_of(i, j, S) == half
    assert (d >= (chosen["min_distance"] or 0.0)).all() and (d <= cutoff).all()
    found = call(hs.pairs, points, cutoff, quantities="P", **every).tolist()
    assert sorted(map(tuple, found)) == sorted(entry[:2] for entry in half)
    assert call(hs.count_pairs, points, cutoff, **every) == len(half)
    assert call(hs.count_pairs, points, [cutoff / 2, cutoff], **every)[1] == len(half)
    blocks = list(call(hs.iter_pairs, points, cutoff, quantities="ijS", max_pairs=3, **every))
    assert set().union(*(entries_of(*block) for block in blocks)) == half
    reach = {"radii": np.full(len(points), cutoff), "rule": "max"}
    assert entries_of(*call(hs.pairs, points, None, quantities="ijS", **reach, **every)) == half
    if options["inclusive"] and not chosen["min_distance"]:
        scene = {key: options[key] for key in options if key != "inclusive"}
        scene |= {key: chosen[key] for key in chosen if key != "min_distance"}
        bins = call(hs.pair_histogram, points, [0.0, cutoff / 2, cutoff], **scene)
        assert bins.sum() == len(half)


def check_rows(points, cutoff, full, every):
    table = call(hs.neighbors, points, cutoff, quantities="jS", **every)
    assert of_table(table) == full
    assert call(hs.neighbors, points, cutoff, **every).indices.tolist() == table.indices.tolist()
    assert call(hs.coordination, points, cutoff, **every).tolist() == table.counts.tolist()


def check_some_points(draw, points, cutoff, full, half, chosen, options):
    n, every = len(points), {**chosen, **options}
    some = np.array(sorted(draw.sample(range(n), draw.randint(0, n))), np.int64)
    table = call(hs.neighbors, points, cutoff, quantities="jS", indices=some, **every)
    assert of_table(table, some) == {entry for entry in full if entry[0] in some}
    if chosen["exclude"] is None or chosen["exclude"].ndim == 1 or n:
        found = call(hs.pairs, points, cutoff, quantities="ijS", indices=some, **every)
        assert entries_of(*found) == {e for e in half if e[0] in some or e[1] in some}
    batch = np.sort(labels_of(draw, n, 0))
    found = call(hs.pairs, points, cutoff, quantities="ijS", batch=batch, **every)
    assert entries_of(*found) == {e for e in half if batch[e[0]] == batch[e[1]]}
    assert call(hs.count_pairs, points, cutoff, batch=batch, **every).sum() == len(found[0])


@in_parts(200)
def test_two_sets(seeds):
    for seed in seeds:
        draw = random.Random(seed)
        points, cutoff, options = scene_of(draw)
        queries = points_of(draw, draw.randint(0, 6), points.shape[1], 3.0)
        chosen, of_queries = chosen_of(draw, len(points), len(queries), cutoff)
        rule = Rule((points, cutoff, options), chosen, {"queries": queries, **of_queries})
        expected = rule.entries()
        every = {**chosen, **of_queries, **options}
        found = call(hs.pairs_between, queries, points, cutoff, quantities="ijS", **every)
        assert entries_of(*found) == expected
        assert call(hs.count_pairs, points, cutoff, queries=queries, **every) == len(expected)
        table = call(hs.neighbors, points, cutoff, queries=queries, quantities="jS", **every)
        assert of_table(table) == expected
        counts = call(hs.coordination, points, cutoff, queries=queries, **every)
        assert counts.tolist() == table.counts.tolist()


def test_large_scenes_are_those_of_a_filter():
    rng = np.random.default_rng(3)
    points, box = rng.random((20000, 3)) * 10.0, [10.0] * 3
    molecule = np.arange(20000) // 4
    i, j, d = hs.pairs(points, 0.6, box=box, quantities="ijd", sort=True)
    other = molecule[i] != molecule[j]
    for threads in (1, 2):
        found = call(
            hs.pairs,
            points,
            0.6,
            box=box,
            quantities="ijd",
            sort=True,
            exclude=molecule,
            threads=threads,
        )
        for column, all_of_it in zip(found, (i, j, d), strict=True):
            assert column.tobytes() == all_of_it[other].tobytes()
        found = hs.pairs(
            points, 0.6, box=box, quantities="ij", sort=True, min_distance=0.3, threads=threads
        )
        assert found[0].tobytes() == i[d >= 0.3].tobytes()
        found = call(
            hs.pairs,
            points,
            0.6,
            box=box,
            quantities="ij",
            sort=True,
            groups=molecule % 7,
            threads=threads,
        )
        assert found[0].tobytes() == i[molecule[i] % 7 == molecule[j] % 7].tobytes()


def test_names_are_labels_too():
    points = [[0.0], [1.0], [2.0]]
    for labels in (["a", "a", "b"], np.array(["a", "a", "b"]), np.array(["a", "a", "b"], object)):
        assert call(hs.pairs, points, 1.0, groups=labels, quantities="P").tolist() == [[0, 1]]
        assert call(hs.pairs, points, 1.0, exclude=labels, quantities="P").tolist() == [[1, 2]]
    found = call(
        hs.pairs_between,
        [[0.0]],
        points,
        5.0,
        groups=["a", "b", "a"],
        query_groups=["b"],
        quantities="j",
    )
    assert found.tolist() == [1]


def test_the_largest_labels():
    labels = [np.iinfo(np.int64).min, np.iinfo(np.int64).max]
    points = [[0.0], [1.0]]
    assert call(hs.count_pairs, points, 1.0, exclude=labels, exclude_within=2**63 - 1) == 1
    assert call(hs.count_pairs, points, 1.0, exclude=[0, labels[1]], exclude_within=2**63 - 1) == 0


def test_extreme_units():
    for scale in (2.0**-1030, 2.0**-500, 1.0, 2.0**500, 2.0**1000):
        points = np.array([[0.0], [1.0], [2.0], [3.0]]) * scale
        found = hs.pairs(
            points,
            2.0 * scale,
            box=[4.0 * scale],
            exclude=[[0, 1], [0, 2]],
            min_distance=scale,
            quantities="ijS",
            sort=True,
        )
        assert [column.tolist() for column in found] == [
            [0, 0, 1, 1, 1, 2],
            [2, 3, 2, 3, 3, 3],
            [[0], [-1], [0], [-1], [0], [0]],
        ]
        nearer = hs.count_pairs(points, 2.0 * scale, min_distance=np.nextafter(scale, np.inf))
        assert nearer == 2


BAD = [
    ({"groups": [0, 1]}, ValueError, r"groups must have shape \(3,\), one for each point"),
    ({"groups": [0.0, 1.0, 2.0]}, TypeError, "groups must hold integers or names"),
    ({"groups": [True, False, True]}, TypeError, "groups must hold integers or names"),
    ({"groups": np.array([2**64 - 1, 0, 0], np.uint64)}, ValueError, "groups must be less than"),
    ({"exclude": [0.5, 1, 2]}, TypeError, "labels must hold integers or names"),
    ({"exclude": [0, 1]}, ValueError, r"labels must have shape \(3,\)"),
    ({"exclude": [[0, 1, 2]]}, ValueError, r"exclude must be pairs of numbers, shape \(k, 2\)"),
    ({"exclude": [[0, 3]]}, ValueError, r"exclude\[:, 1\] must be numbers of points, from 0 to 2"),
    ({"exclude": [[-1, 0]]}, ValueError, r"exclude\[:, 0\] must be numbers of points"),
    ({"exclude": [[0.0, 1.0]]}, TypeError, "must hold integers"),
    ({"exclude": 1}, ValueError, "a whole number as exclude needs labels, and points have none"),
    ({"exclude": True}, TypeError, "exclude must be pairs of numbers, .* got True"),
    (
        {"exclude": 0.5},
        TypeError,
        "exclude must be pairs of numbers, .* or a whole number, got 0.5",
    ),
    ({"exclude": -1, "labels": [0, 1, 2]}, ValueError, "exclude must be from 0"),
    ({"exclude": 2**63, "labels": [0, 1, 2]}, ValueError, "exclude must be from 0"),
    ({"exclude": 1, "labels": ["a", "b", "c"]}, ValueError, "exclude must be 0 where labels are"),
    ({"min_distance": -1.0}, ValueError, "min_distance must be finite and not negative"),
    ({"min_distance": np.nan}, ValueError, "min_distance must be finite and not negative"),
    ({"min_distance": np.inf}, ValueError, "min_distance must be finite and not negative"),
    ({"min_distance": "1"}, TypeError, "min_distance must"),
    ({"min_distance": 0.5, "precision": "single"}, ValueError, "cannot be combined with precision"),
]


def test_bad_choices():
    for chosen, kind, words in BAD:
        points = [[0.0], [1.0], [2.0]]
        for batch in (None, [0, 0, 0]):
            for search in (hs.pairs, hs.iter_pairs, hs.neighbors, hs.count_pairs, hs.coordination):
                with pytest.raises(kind, match=words):
                    call(search, points, 1.0, batch=batch, **chosen)
    with pytest.raises(ValueError, match=r"got shape \(3,\): labels are those of Points"):
        hs.pairs(points, 1.0, exclude=[0, 1, 2])
    with pytest.raises(ValueError, match=r"got shape \(2,\): one pair is \[\[i, j\]\]"):
        hs.pairs(points, 1.0, exclude=[0, 1])


def test_labels_of_both_sets():
    points, queries = [[0.0], [1.0]], [[0.5]]
    with pytest.raises(
        ValueError, match="points have groups, and queries have none: both need them"
    ):
        call(hs.pairs_between, queries, points, 1.0, groups=[0, 1])
    with pytest.raises(ValueError, match="exclude needs labels, and points have none"):
        call(hs.pairs_between, queries, points, 1.0, query_exclude=[0], exclude=0)
    with pytest.raises(TypeError, match="both be numbers or both be names"):
        call(hs.pairs_between, queries, points, 1.0, groups=[0, 1], query_groups=["a"])
    with pytest.raises(ValueError, match=r"exclude\[:, 0\] must be numbers of queries"):
        hs.pairs_between(queries, points, 1.0, exclude=[[1, 0]])


def test_inputs_stay_and_empty_ones_are_nothing():
    points = np.array([[0.0], [1.0]])
    exclude = np.array([[1, 0], [0, 1]])
    before = exclude.copy()
    assert hs.count_pairs(points, 1.0, exclude=exclude) == 0
    assert (exclude == before).all()
    for nothing in ([], np.empty((0, 2), int)):
        assert hs.count_pairs(points, 1.0, exclude=nothing) == 1
    empty = np.empty((0, 3))
    assert call(hs.count_pairs, empty, 1.0, groups=[], exclude=[], min_distance=0.5) == 0


def test_counts_by_type():
    for seed in range(40):
        draw = random.Random(seed)
        points, cutoff, options = scene_of(draw)
        n = len(points)
        chosen, of_queries = chosen_of(draw, n, n, cutoff)
        types = labels_of(draw, n, 0)
        every = {**chosen, **options}
        table = call(hs.neighbors, points, cutoff, **every)
        wanted = np.zeros((n, 1 + types.max(initial=0)), int)
        np.add.at(wanted, (np.repeat(np.arange(n), table.counts), types[table.indices]), 1)
        assert (
            call(hs.coordination, points, cutoff, types=types, by_type=True, **every).tolist()
            == wanted.tolist()
        )
        some = [k for k in range(n) if draw.random() < 0.5]
        found = call(
            hs.coordination, points, cutoff, types=types, by_type=True, indices=some, **every
        )
        assert found.tolist() == wanted[some].tolist()
        queried = {**every, **of_queries}
        if chosen["exclude"] is None or chosen["exclude"].ndim == 1:
            table = call(hs.neighbors, points, cutoff, queries=points, **queried)
            wanted = np.zeros_like(wanted)
            np.add.at(wanted, (np.repeat(np.arange(n), table.counts), types[table.indices]), 1)
            found = call(
                hs.coordination,
                points,
                cutoff,
                queries=points,
                types=types,
                by_type=True,
                **queried,
            )
            assert found.tolist() == wanted.tolist()


def test_g_of_r_between_molecules():
    points = np.random.default_rng(6).random((600, 3)) * 5.0
    molecule = np.arange(600) // 3
    whole = hs.rdf(points, 2.0, 20, box=[5.0] * 3)
    parts = [call(hs.rdf, points, 2.0, 20, box=[5.0] * 3, exclude=molecule),
             call(hs.rdf, points, 2.0, 20, box=[5.0] * 3, groups=molecule)]  # fmt: skip
    assert (parts[0].counts + parts[1].counts == whole.counts).all() and parts[1].counts.sum() > 0
    assert np.allclose(parts[0].g + parts[1].g, whole.g)
    named = call(
        hs.rdf, points, 2.0, 20, box=[5.0] * 3, exclude=molecule, types=["a", "b", "a"] * 200
    )
    assert (np.array(named.counts).shape) == (2, 2, 20)
