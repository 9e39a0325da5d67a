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


POINTS = np.arange(12.0).reshape(4, 3)
BAD = [
    ({"i": [0], "j": [4]}, ValueError, "j"),
    ({"i": [0, 1], "j": [1]}, ValueError, "i and j|length"),
    ({"i": [[0]], "j": [[1]]}, ValueError, "i.*shape"),
    ({"i": [0], "j": [1], "S": [[0, 0]]}, ValueError, "S"),
    ({"i": [0], "j": [1], "S": [0, 0, 0]}, ValueError, "S"),
]


@pytest.mark.parametrize("change, exception, fragment", BAD)
def test_bad_lists(change, exception, fragment):
    arguments = {"points": POINTS, "cutoff": 1.0, **change}
    with pytest.raises(exception, match=fragment):
        hs.verify(**arguments)


def test_pairs_without_points():
    with pytest.raises(ValueError, match=r"^i must be empty: there are no points$"):
        hs.verify([], 1.0, [0], [1])


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
