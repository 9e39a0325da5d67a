# SPDX-License-Identifier: BSD-3-Clause
"""Many systems, each with axes of its own that repeat, against one call for each."""

import numpy as np
import pytest

import halfshell as hs

N_SYSTEMS = 14


class Scene:
    def __init__(self, d, has_boxes, seed=0):
        rng = np.random.default_rng([seed, d])
        sizes = rng.integers(0, 30, N_SYSTEMS)
        sizes[4] = 0
        self.batch = np.repeat(np.arange(N_SYSTEMS), sizes)
        self.query_batch = np.repeat(np.arange(N_SYSTEMS), 3)
        self.points = rng.integers(-8, 40, (sizes.sum(), d)) / 8.0
        self.queries = rng.integers(-8, 40, (3 * N_SYSTEMS, d)) / 8.0
        self.periodic = rng.integers(0, 2, (N_SYSTEMS, d)).astype(bool)
        self.periodic[:2] = [[False] * d, [True] * d]
        boxes = np.eye(d) * 4.0 + rng.integers(-2, 3, (N_SYSTEMS, d, d)) / 4.0
        self.box = boxes if has_boxes else boxes[0]
        self.bonds = rng.integers(0, sizes.sum(), (60, 2))

    def parts(self):
        for s in range(N_SYSTEMS):
            own, asked = np.flatnonzero(self.batch == s), np.flatnonzero(self.query_batch == s)
            box = self.box[s] if self.box.ndim == 3 else self.box
            yield own, asked, {"box": box, "periodic": self.periodic[s]}


@pytest.mark.parametrize(
    ("d", "has_boxes", "threads"),
    [(1, True, 2), (2, False, 1), (3, True, 1), (3, False, 2), (8, True, 2), (8, False, 1)],
)
def test_axes_of_each_system(d, has_boxes, threads):
    scene = Scene(d, has_boxes)
    cutoff = min(1.5 + 0.5 * d, 4.0)
    periodic = scene.periodic if threads == 1 else scene.periodic.astype(int).tolist()
    how = {"box": scene.box, "batch": scene.batch, "threads": threads, "periodic": periodic}
    found = hs.pairs(scene.points, cutoff, quantities="ijdS", sort=True, **how)
    table = hs.neighbors(scene.points, cutoff, quantities="jdS", **how)
    asked = {"queries": scene.queries, "query_batch": scene.query_batch}
    rows = hs.neighbors(scene.points, cutoff, quantities="jdS", **how, **asked)
    near = hs.nearest(scene.points, 3, quantities="jdS", **how, **asked)
    counts = hs.count_pairs(scene.points, cutoff, **how)
    binned = hs.pair_histogram(scene.points, [0.0, 1.0, cutoff], **how)
    at = row_at = 0
    for s, (own, asking, one) in enumerate(scene.parts()):
        first = own[0] if len(own) else 0
        i, j, length, S = hs.pairs(scene.points[own], cutoff, quantities="ijdS", sort=True, **one)
        part = slice(at, at + len(i))
        for ours, theirs in zip(found, (i + first, j + first, length, S), strict=True):
            assert np.array_equal(ours[part], theirs)
        at += len(i)
        assert counts[s] == len(i) and binned[s].sum() == len(i)
        each = hs.neighbors(scene.points[own], cutoff, quantities="jdS", **one)
        many = table[own]
        assert np.array_equal(many.indices, each.indices + first)
        assert np.array_equal(many.shifts, each.shifts)
        assert np.array_equal(many.sort().indices, each.sort().indices + first)
        mine = scene.queries[asking]
        each = hs.neighbors(scene.points[own], cutoff, queries=mine, quantities="jdS", **one)
        part = slice(row_at, row_at + each.n_entries)
        assert np.array_equal(rows.indices[part], each.indices + first)
        assert np.array_equal(rows.distances[part], each.distances)
        row_at += each.n_entries
        j, length, S = hs.nearest(scene.points[own], 3, queries=mine, quantities="jdS", **one)
        assert np.array_equal(near[0][asking], np.where(j < 0, -1, j + first))
        assert np.array_equal(near[1][asking], length)
        assert np.array_equal(near[2][asking], S)
    assert at == len(found[0]) > 50 and row_at == rows.n_entries > 20


def test_nearest_images_of_excluded_pairs_are_those_of_each_system():
    scene = Scene(3, True, seed=1)
    found = hs.pairs(
        scene.points, 4.0, box=scene.box, periodic=scene.periodic, batch=scene.batch,
        exclude=scene.bonds, quantities="ijS", sort=True,
    )  # fmt: skip
    at = 0
    for own, _, one in scene.parts():
        first = own[0] if len(own) else 0
        bonds = scene.bonds[np.isin(scene.bonds, own).all(axis=1)] - first
        i, j, S = hs.pairs(
            scene.points[own], 4.0, exclude=bonds, quantities="ijS", sort=True, **one
        )
        part = slice(at, at + len(i))
        assert np.array_equal(found[0][part], i + first)
        assert np.array_equal(found[1][part], j + first)
        assert np.array_equal(found[2][part], S)
        at += len(i)
    assert at == len(found[0])


def test_rdf_needs_all_axes_of_each():
    scene = Scene(3, True, seed=2)
    how = {"box": scene.box, "batch": scene.batch}
    every = np.ones((N_SYSTEMS, 3), bool)
    plain, given = (
        hs.rdf(scene.points, 2.0, 5, **how),
        hs.rdf(scene.points, 2.0, 5, periodic=every, **how),
    )
    assert np.array_equal(plain.g, given.g)
    with pytest.raises(ValueError, match="rdf needs a box that is periodic along every axis"):
        hs.rdf(scene.points, 2.0, 5, periodic=scene.periodic, **how)


@pytest.mark.parametrize("search", [hs.pairs, hs.neighbors, hs.count_pairs])
def test_bad_input(search):
    points, batch, box = np.zeros((3, 3)), [0, 0, 1], np.array([np.eye(3)] * 2)
    good = np.ones((2, 3), bool)
    with pytest.raises(ValueError, match="periodic needs a box"):
        search(points, 1.0, batch=batch, periodic=good)
    with pytest.raises(ValueError, match=r"these for each system, \(s, 3\), got shape \(2, 2\)"):
        search(points, 1.0, batch=batch, box=box, periodic=good[:, :2])
    with pytest.raises(ValueError, match="the same number of systems, got 1 and 2"):
        search(points, 1.0, batch=batch, box=box, periodic=good[:1])
    with pytest.raises(ValueError, match="the same number of systems, got 3 and 2"):
        search(points, [1.0, 1.0], batch=batch, box=np.eye(3), periodic=np.ones((3, 3), bool))
    with pytest.raises(TypeError, match="periodic must hold bools, got dtype float64"):
        search(points, 1.0, batch=batch, box=box, periodic=good.astype(float))
    with pytest.raises(TypeError, match="periodic must hold bools"):
        search(points, 1.0, batch=batch, box=box, periodic=good * 2)
    with pytest.raises(ValueError, match=r"less than the number of .* periodic .*, 2, got"):
        search(points, 1.0, batch=[0, 1, 2], box=np.eye(3), periodic=good)
    with pytest.raises(ValueError, match="periodic must be a bool or 3 bools"):
        search(points, 1.0, box=np.eye(3), periodic=good)  # without a batch
    skewed = box.copy()
    skewed[1, 2] = 0.0  # of an axis that does not repeat
    good[1, 2] = False
    search(points, 0.5, batch=batch, box=skewed, periodic=good)
    good[1, 2] = True
    with pytest.raises(ValueError, match="vector 2 of box"):
        search(points, 0.5, batch=batch, box=skewed, periodic=good)
