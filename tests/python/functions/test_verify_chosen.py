# SPDX-License-Identifier: BSD-3-Clause
"""`verify` of lists that leave pairs out: groups, exclusions, a least distance, rows, systems."""

import random

import numpy as np
import pytest

import halfshell as hs

SEEDS = range(25)


def scene_of(draw, n):
    """Points on a lattice in which many distances are equal, in a box a few of them long."""
    ndim = draw.choice([1, 2, 3])
    length = draw.choice([2.0, 3.0])
    positions = [[draw.randint(-2, 6) * 0.5 for _ in range(ndim)] for _ in range(n)]
    scene = {"positions": np.array(positions).reshape(n, ndim)}
    if draw.random() < 0.8:
        box = np.diag([length] * ndim)
        box[-1, 0] += draw.choice([0.0, 0.5, -1.0]) if ndim > 1 else 0.0
        scene |= {"box": box, "periodic": [draw.random() < 0.8 for _ in range(ndim)]}
    return scene


def fields_of(draw, n, ndim, kind):
    """What is known of points, with a cutoff and keywords that go with it."""
    fields, cutoff, how = {}, draw.choice([0.5, 1.0, 1.5]), {}
    if kind == "radii":
        fields["radii"] = [draw.choice([0.0, 0.25, 0.5, 1.0]) for _ in range(n)]
        cutoff = draw.choice([None, 1.0])
        how["rule"] = draw.choice(["sum", "mean", "max", "min", "gather", "scatter"])
    elif kind == "types":
        fields["types"] = [draw.choice("HOC") for _ in range(n)]
        cutoff = {("H", "O"): 1.0, ("*", "*"): 0.5, ("C", "*"): 1.5}
    elif kind == "supports":
        sizes = [[draw.choice([1.0, 2.0]) for _ in range(ndim)] for _ in range(n)]
        fields["supports"] = np.array(sizes).reshape(n, ndim, 1) * np.eye(ndim)
        how["rule"] = draw.choice(["max", "min", "gather", "scatter"])
    if draw.random() < 0.4:
        fields["groups"] = [draw.randint(0, 1) for _ in range(n)]
    fields["labels"] = [draw.choice([0, 1, 2, 2**62, -(2**62)]) for _ in range(n)]
    how["exclude"] = draw.choice([None, 0, 1, 2**63 - 1])
    how["min_distance"] = draw.choice([None, 0.5, 1.0])
    how["inclusive"] = draw.random() < 0.6
    return fields, cutoff, how


def dropped(columns, k):
    return [np.delete(column, k, axis=0) for column in columns]


@pytest.mark.parametrize("kind", ["plain", "radii", "types", "supports"])
def test_what_each_search_leaves_out_is_left_out(kind):
    for seed in SEEDS:
        draw = random.Random(f"{kind} {seed}")
        n, q = draw.randint(0, 9), draw.randint(0, 5)
        scene = scene_of(draw, n)
        ndim = scene["positions"].shape[1]
        fields, cutoff, how = fields_of(draw, n, ndim, kind)
        points = hs.Points(**scene, **fields)
        if how["exclude"] is None and n and draw.random() < 0.5:
            how["exclude"] = [[draw.randrange(n), draw.randrange(n)] for _ in range(n)]
        shifted = hs.neighbors(points, cutoff, quantities="jS", **how)
        assert hs.verify(points, cutoff, shifted, **how)
        assert hs.verify(points, cutoff, hs.neighbors(points, cutoff, **how), **how)
        rows = [draw.randrange(n) for _ in range(3)] if n else []
        own = {**how, "indices": rows}
        table = hs.neighbors(points, cutoff, quantities="jS", **own)
        assert hs.verify(points, cutoff, table, **own)
        if how.get("rule") not in ("gather", "scatter"):
            own["indices"] = sorted(set(rows))
            for chosen in (how, own):
                found = hs.pairs(points, cutoff, quantities="ijS", **chosen)
                assert hs.verify(points, cutoff, *found, **chosen)
                assert hs.verify(points, cutoff, *found[:2], **chosen)
                if len(found[0]):
                    k = draw.randrange(len(found[0]))
                    verdict = hs.verify(points, cutoff, *dropped(found, k), **chosen)
                    assert (len(verdict.missed), len(verdict.spurious)) == (1, 0)
        asking = hs.Points(scene_of(draw, q)["positions"][:, :1] * np.ones(ndim), **{
            name: (values * q)[:q] if len(values) else [0] * q if name != "types" else ["H"] * q
            for name, values in fields.items() if name != "supports"
        } | (
            {"supports": np.tile(np.eye(ndim), (q, 1, 1))} if kind == "supports" else {}
        ))  # fmt: skip
        if n and q:
            if isinstance(how["exclude"], list):
                how["exclude"] = [[i % q, j] for i, j in how["exclude"]]
            found = hs.pairs_between(asking, points, cutoff, quantities="ijS", **how)
            assert hs.verify(points, cutoff, *found, queries=asking, **how)
            if len(found[0]):
                verdict = hs.verify(points, cutoff, *dropped(found, 0), queries=asking, **how)
                assert (len(verdict.missed), len(verdict.spurious)) == (1, 0)


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


def test_of_equally_near_images_the_first_is_excluded():
    points = [[0.0], [1.0]]  # half a box apart
    how = {"box": 2.0, "exclude": [[1, 0]]}
    assert hs.verify(points, 1.0, [0], [1], [[0]], **how)
    assert hs.verify(points, 1.0, [1], [0], [[0]], **how)
    assert not hs.verify(points, 1.0, [0], [1], [[-1]], **how)
    # of a query and a point, as the query sees them
    how["exclude"] = [[0, 0]]
    assert hs.verify(points[:1], 1.0, [0], [0], [[1]], queries=points[1:], **how)


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
