# SPDX-License-Identifier: BSD-3-Clause
"""The verdict on a list, whoever made it."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given

import halfshell as hs
from halfshell._check.reference import reference_pairs
from halfshell._check.verify import _COMPARING
from oracles import lattice, random_scene
from scene_strategies import scenes


@pytest.fixture
def scene(rng):
    points, cutoff, box, _ = random_scene(rng, 60, neighbours=12, spread=2)
    return points, cutoff, box


def listed(scene, **how):
    points, cutoff, box = scene
    return hs.pairs(points, cutoff, box=box, quantities="ijS", **how)


def doubled(i, j, S):
    return np.concatenate([i, j]), np.concatenate([j, i]), np.concatenate([S, -S])


def rows(array):
    return [tuple(row) for row in array.tolist()]


@given(scenes())
def test_the_list_of_the_definition_is_right(scene):
    pairs = reference_pairs(scene.points, scene.cutoff, scene.box, scene.periodic, scene.inclusive)
    i = np.array([p[0] for p in pairs], int)
    j = np.array([p[1] for p in pairs], int)
    S = np.array([p[2] for p in pairs], int).reshape(-1, scene.points.shape[1])
    how = {"box": scene.box, "periodic": scene.periodic, "inclusive": scene.inclusive}
    assert hs.verify(scene.points, scene.cutoff, i, j, S, **how).ok
    assert hs.verify(scene.points, scene.cutoff, *doubled(i, j, S), full=True, **how).ok
    if pairs:
        verdict = hs.verify(scene.points, scene.cutoff, i[1:], j[1:], S[1:], **how)
        assert not verdict.ok
        assert rows(verdict.missed) == [(i[0], j[0], *S[0].tolist())]
        assert not len(verdict.spurious) and not len(verdict.duplicate)


def test_all_three_at_once(scene):
    points, cutoff, box = scene
    i, j, S = (x[2:] for x in listed(scene))
    more = np.append(i, [i[5], 0]), np.append(j, [j[5], 1]), np.append(S, [S[5], [8, 8, 8]], axis=0)
    verdict = hs.verify(points, cutoff, *more, box=box)
    assert (len(verdict.missed), len(verdict.spurious), len(verdict.duplicate)) == (2, 1, 1)
    assert not verdict
    assert "missed" in str(verdict) and "spurious" in str(verdict) and "duplicate" in str(verdict)


@pytest.mark.parametrize("full", [False, True])
def test_shifts_that_mean_something_else_are_told(scene, full):
    points, cutoff, box = scene
    i, j, S = doubled(*listed(scene)) if full else listed(scene)
    cells = np.arange(len(points))[:, None] % [2, 3, 5]  # that points are moved by
    for other, told in (
        (-S, "S has the other sign: a pair is points[j] - points[i] + S @ box"),
        (S + cells[j] - cells[i], "only S is wrong: it belongs to the points as given"),
    ):
        verdict = hs.verify(points, cutoff, i, j, other, box=box, full=full)
        assert not verdict and told in str(verdict)
        assert "S" not in str(hs.verify(points, cutoff, i[1:], j[1:], other[1:], box=box))


def test_a_point_as_its_own_neighbour_is_spurious():
    points = [[0.0, 0.0], [1.0, 0.0]]
    verdict = hs.verify(points, 1.0, [0, 0], [1, 0])
    assert len(verdict.spurious) == 1
    verdict = hs.verify(points, 1.0, [0, 0], [1, 0], [[0, 0], [0, 0]])
    assert rows(verdict.spurious) == [(0, 0, 0, 0)]
    verdict = hs.verify(points, 1.0, [0, 1], [1, 1], [[0, 0], [0, 0]], box=[9.0, 9.0])
    assert rows(verdict.spurious) == [(1, 1, 0, 0)]


def test_shifts_in_open_space_and_on_open_axes_are_spurious():
    # Whatever their length comes to: there is no such image.
    points = [[0.0, 0.0], [1.0, 0.0]]
    verdict = hs.verify(points, 2.0, [0, 0], [1, 1], [[0, 0], [1, 0]])
    assert rows(verdict.spurious) == [(0, 1, 1, 0)]
    box = [[0.5, 0.0], [0.0, 10.0]]
    verdict = hs.verify(
        points, 1.0, [0, 0], [1, 1], [[0, 0], [-1, 0]], box=box, periodic=[False, True]
    )
    assert rows(verdict.spurious) == [(0, 1, -1, 0)]
    assert not len(verdict.missed)


def test_the_rule_at_the_cutoff_is_that_of_the_list():
    points, box = lattice("sc", (3, 3, 3))
    closed = hs.pairs(points, 1.0, box=box, quantities="ijS")
    assert hs.verify(points, 1.0, *closed, box=box).ok
    verdict = hs.verify(points, 1.0, *closed, box=box, inclusive=False)
    assert len(verdict.spurious) == len(closed[0]) == 81
    nothing = np.empty((0, 3), int)
    assert hs.verify(points, 1.0, [], [], nothing, box=box, inclusive=False).ok


# Tables -------------------------------------------------------------------------------------


@pytest.mark.parametrize("quantities", ["j", "jS", "dSj"])
def test_a_table_of_neighbours_is_a_full_list(scene, quantities):
    points, cutoff, box = scene
    table = hs.neighbors(points, cutoff, box=box, quantities=quantities)
    verdict = hs.verify(points, cutoff, table, box=box)
    assert verdict and verdict.n_given == table.n_entries == 2 * len(listed(scene)[0])
    mask = np.ones(table.n_entries, bool)
    mask[[0, 5]] = False
    verdict = hs.verify(points, cutoff, table.filter(mask), box=box)
    left_out = np.stack(table.to_pairs(), axis=1)[~mask]
    assert not verdict and sorted(rows(verdict.missed[:, :2])) == sorted(rows(left_out))


@pytest.mark.parametrize("quantities", ["j", "jS"])
def test_lists_and_tables_of_two_sets(scene, rng, quantities):
    points, cutoff, box = scene
    queries = points[:7].astype(np.float32)
    table = hs.neighbors(points, cutoff, queries=queries, box=box, quantities=quantities)
    assert hs.verify(points, cutoff, table, queries=queries, box=box)
    found = hs.pairs_between(queries, points, cutoff, box=box, quantities="ijS")
    assert len(found[0]) == table.n_entries > 7
    order = rng.permutation(len(found[0]))
    i, j, S = (column[order] for column in found)
    assert hs.verify(points, cutoff, i, j, S, queries=queries, box=box)
    verdict = hs.verify(points, cutoff, i[1:], j[1:], S[1:], queries=queries, box=box)
    assert rows(verdict.missed) == [(i[0], j[0], *S[0].tolist())]
    assert not len(verdict.spurious)
    swapped = hs.verify(points, cutoff, j, i % 7, S, queries=points, box=box)
    assert len(swapped.missed) and swapped.n_expected > len(i)


TABLE = hs.neighbors([[0.0], [1.0], [3.0]], 2.0)
OF_QUERIES = hs.neighbors([[0.0], [1.0], [3.0]], 2.0, queries=[[0.0], [1.0]])


@pytest.mark.parametrize(
    ("how", "exception", "fragment"),
    [
        ({"i": TABLE, "j": [0]}, TypeError, "leave j, S and full out"),
        ({"i": TABLE, "S": [[0]]}, TypeError, "leave j, S and full out"),
        ({"i": TABLE, "full": True}, TypeError, "leave j, S and full out"),
        ({"i": TABLE, "points": [[0.0]]}, ValueError, "table of 3 points, got 1 points"),
        ({"i": OF_QUERIES}, ValueError, "rows of this one are of queries"),
        ({"i": TABLE[:2]}, ValueError, "rows of this one are of queries"),
        ({"i": OF_QUERIES, "queries": [[0.0]]}, ValueError, "table of 2 rows, got 1 queries"),
        ({"i": [0]}, TypeError, "j must be given"),
        ({"i": [0, 1], "j": [1]}, ValueError, "i and j must have the same length"),
        ({"points": [], "i": [0], "j": [1]}, ValueError, "^i must be empty: there are no points$"),
        ({"i": [0], "j": [0], "queries": [[0.0]], "full": True}, ValueError, "full is for"),
        ({"i": [1], "j": [0], "queries": [[0.0]]}, ValueError, "i must be numbers of queries"),
        ({"i": [0], "j": [0], "queries": []}, ValueError, "there are no queries"),
        ({"i": hs.neighbors([[0.0], [1.0], [3.0]], 2.0, quantities="d")}, AttributeError, "'j'"),
    ],
)
def test_bad_tables_and_sets(how, exception, fragment):
    with pytest.raises(exception, match=fragment):
        hs.verify(**{"points": [[0.0], [1.0], [3.0]], "cutoff": 2.0, **how})


def test_a_list_that_could_not_be_compared_is_refused_before_it_is_found(monkeypatch):
    points = np.random.default_rng(3).random((4000, 3))
    monkeypatch.setattr(hs._core, "available_memory", lambda: 0.0)
    for radii in (None, np.full(4000, 1.0)):
        with pytest.raises(MemoryError, match="would not fit"):
            hs.verify(hs.Points(points, radii=radii), 2.0, [0], [1])
    assert hs.verify(points[:3], 2.0, [0, 0, 1], [1, 2, 2]).ok  # little is found anyway


@pytest.mark.parametrize("full", [False, True])
def test_comparing_takes_no_more_memory_than_is_counted_with(full):
    points = np.random.default_rng(4).random((300, 3))
    box = np.eye(3)
    i, j, S = hs.pairs(points, 0.5, box=box, quantities="ijS")
    n_bytes = i.nbytes + j.nbytes + S.nbytes
    if full:
        i, j, S = np.r_[i, j], np.r_[j, i], np.r_[S, -S]
    assert hs.verify(points[:2], 0.5, [], [], box=box).n_given == 0  # modules are loaded by now
    tracemalloc.start()
    assert hs.verify(points, 0.5, i, j, S, box=box, full=full).ok
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < _COMPARING["full" if full else "half"] * n_bytes


@pytest.mark.parametrize("unit", [2.0**-900, 1.0, 2.0**600, 2.0**900])
def test_supports_of_any_unit(unit):
    points = hs.Points(
        unit * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]),
        box=4.0 * unit, supports=[[[1.0, 0.0], [0.0, 0.5]]] * 4,
    )  # fmt: skip
    for rule in ("min", "scatter"):
        table = hs.neighbors(points, unit, rule=rule, quantities="jS")
        assert table.n_entries == 8 and hs.verify(points, unit, table, rule=rule)


@pytest.mark.parametrize("unit", [2.0**-700, 2.0**-300, 1.0, 2.0**700])
def test_supports_of_any_unit_are_compared_in_float64(unit, rng, monkeypatch):
    points = hs.Points(unit * rng.random((100, 3)), supports=np.eye(3) * rng.random((100, 1, 1)))
    pairs = hs.pairs(points, 0.1 * unit, quantities="ijS")
    monkeypatch.setattr("halfshell._check.right.exact_vector", None)  # no rational arithmetic
    assert len(pairs[0]) > 100 and hs.verify(points, 0.1 * unit, *pairs)


# Lists that leave pairs out: groups, exclusions, a least distance, rows, systems ---------------


def test_a_pair_that_does_not_count_is_spurious():
    points = hs.Points([[0.0], [1.0], [2.0]], box=10.0, labels=["a", "a", "b"], groups=[0, 0, 0])
    for how, wrong in (
        ({"exclude": 0}, [0, 1]), ({"exclude": [[2, 1]]}, [1, 2]), ({"min_distance": 1.5}, [0, 1]),
    ):  # fmt: skip
        i, j, S = hs.pairs(points, 2.0, quantities="ijS")
        verdict = hs.verify(points, 2.0, i, j, S, **how)
        assert verdict.spurious[:, :2].tolist()[0] == wrong and not len(verdict.missed)
    apart = points.replace(groups=[0, 1, 0])
    assert hs.verify(apart, 2.0, [0], [2]) and not hs.verify(points, 2.0, [0], [2])


@pytest.mark.parametrize("exponent", [8, 30, 500])
def test_excluded_points_that_coincide_in_a_small_box(exponent):
    edge = 2.0**-exponent
    points = hs.Points([[-edge], [-edge]], box=[edge], labels=[0, 0])
    i, j, S = hs.pairs(points, 2 * edge, exclude=0, quantities="ijS")
    rest = np.arange(len(i)) != np.nonzero(i != j)[0][0]
    verdict = hs.verify(points, 2 * edge, i[rest], j[rest], S[rest], exclude=0)
    assert len(verdict.missed) == 1 and not len(verdict.spurious)


def test_excluded_pairs_of_many_images(rng):
    box = [[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.3, 0.4, 1.0]]
    points = hs.Points(rng.random((4, 3)) * 3.0, box=box)
    excluded = np.column_stack(np.triu_indices(4, 1))
    right = hs.pairs(points, 4.0, quantities="ijS", exclude=excluded)
    nothing = [column[:0] for column in right]
    verdict = hs.verify(points, 4.0, *nothing, exclude=excluded)
    assert len(verdict.missed) == len(right[0]) > 1000
    every = hs.pairs(points, 4.0, quantities="ijS")
    verdict = hs.verify(points, 4.0, *every, exclude=excluded)
    assert verdict.spurious[:, :2].tolist() == excluded.tolist() and not len(verdict.missed)


def test_rows_of_some_points():
    points = [[0.0], [1.0], [2.0], [3.0]]
    how = {"indices": [2, 0]}
    assert hs.verify(points, 1.0, [0, 1, 2], [1, 2, 3], **how)
    assert hs.verify(points, 1.0, [2, 2, 0], [1, 3, 1], full=True, **how)
    assert not hs.verify(points, 1.0, [0, 1], [1, 2], **how)
    table = hs.neighbors(points, 1.0, **how)
    assert hs.verify(points, 1.0, table, **how)
    assert not hs.verify(points, 1.0, table, indices=[0, 2])
    with pytest.raises(ValueError, match="table of 2 rows, got 1 indices"):
        hs.verify(points, 1.0, table, indices=[2])


@pytest.mark.parametrize("cutoff", [1.0, [1.0, 0.5, 2.0], {("A", "B"): 1.0}])
def test_batches(cutoff, rng):
    systems = [
        hs.Points(rng.random((n, 2)) * 3, box=box, types=["A", "B", "C"][:2] * (n // 2))
        for n, box in ((8, 3.0), (0, None), (10, [[2.0, 0.0], [1.0, 2.0]]))
    ]
    points = hs.Points.stack(systems)
    found = hs.pairs(points, cutoff, quantities="ijS")
    assert len(found[0]) and hs.verify(points, cutoff, *found)
    verdict = hs.verify(points, cutoff, *(column[:-1] for column in found))
    assert verdict.missed[:, :2].tolist() == [[found[0][-1], found[1][-1]]]
    across = hs.verify(points, cutoff, [*found[0], 0], [*found[1], 17])
    assert across.spurious.tolist() == [[0, 17]]
    assert hs.verify(points, cutoff, hs.neighbors(points, cutoff, quantities="jS"))
    queries = hs.Points(points.positions[::3], batch=points.batch[::3], types=points.types[::3])
    found = hs.pairs_between(queries, points, cutoff, quantities="ijS")
    assert hs.verify(points, cutoff, *found, queries=queries)
    other = hs.verify(points, cutoff, [*found[0], 0], [*found[1], 17],
                      [*found[2], [0, 0]], queries=queries)  # fmt: skip
    assert other.spurious.tolist() == [[0, 17, 0, 0]]


def test_progress_ascends_over_all_searches(rng):
    told = []
    points = [rng.random((100_000, 3)), rng.random((100_000, 3))]
    assert not hs.verify(points, 0.01, [], [], progress=told.append)
    assert told == sorted(told) and 0.5 < told[-1] <= 1.0


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("indices", [[], [3], [0, 4]])
def test_pairs_of_other_points_are_spurious(indices, full):
    points = np.random.default_rng(3).random((8, 2))
    i, j, S = hs.pairs(points, 0.6, quantities="ijS")
    if full:
        i, j, S = np.r_[i, j], np.r_[j, i], np.r_[S, -S]
    right = np.isin(i, indices) | (False if full else np.isin(j, indices))
    verdict = hs.verify(points, 0.6, i, j, S, indices=indices, full=full)
    assert len(verdict.spurious) == np.count_nonzero(~right) > 0
    assert len(verdict.missed) == len(verdict.duplicate) == 0
    assert hs.verify(points, 0.6, i[right], j[right], S[right], indices=indices, full=full)
