# SPDX-License-Identifier: BSD-3-Clause
"""`verify` of lists that leave pairs out: groups, exclusions, a least distance, rows, systems."""


import numpy as np
import pytest

import halfshell as hs


def dropped(columns, k):
    return [np.delete(column, k, axis=0) for column in columns]


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
    verdict = hs.verify(points, cutoff, *dropped(found, -1))
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
