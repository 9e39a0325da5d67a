# SPDX-License-Identifier: BSD-3-Clause
"""A `CellList` in place of points, for all searches, and its pickles and candidates."""

import pickle

import numpy as np
import pytest

import halfshell as hs
from oracles import same_arrays

RNG = np.random.default_rng(5)
X = RNG.uniform(-1.0, 3.0, (400, 3))
SKEWED = np.array([[2.0, 0.0, 0.0], [0.5, 1.75, 0.0], [-0.25, 0.5, 2.5]])
SCENES = {
    "open": {},
    "box": {"box": [2.0, 2.0, 2.0]},
    "slab": {"box": SKEWED, "periodic": [True, False, True]},
}
KNOWN = {
    "radii": RNG.uniform(0.05, 0.2, 400), "types": RNG.integers(0, 3, 400),
    "groups": RNG.integers(0, 2, 400), "labels": np.arange(400) // 3, "weights": RNG.random(400),
}  # fmt: skip
QUERIES = RNG.uniform(-1.0, 3.0, (30, 3))

SEARCHES = [
    lambda p: hs.pairs(p, 0.3, quantities="ijdDS", sort=True),
    lambda p: hs.pairs(p, [0.1, 0.3], quantities="ijk", sort=True),
    lambda p: hs.pairs(p, 0.3, indices=[3, 7], sort=True),
    lambda p: hs.pairs(p, 0.9, sort=True),  # beyond the cutoff of the cells
    lambda p: hs.pairs_between(QUERIES, p, 0.3, quantities="ijdS"),
    lambda p: hs.neighbors(p, 0.3, quantities="jdS", indices=[5, 1]).to_pairs(quantities="ijdS"),
    lambda p: hs.neighbors(p, 0.3, queries=QUERIES).to_pairs(),
    lambda p: hs.coordination(p, 0.3),
    lambda p: hs.count_pairs(p, [0.1, 0.2, 0.3]),
    lambda p: hs.count_pairs(p, 0.3, queries=QUERIES),
    lambda p: hs.count_pairs(p, 0.3, exclude=[[0, 1], [5, 9]], min_distance=0.1),
    lambda p: hs.nearest(p, 4, quantities="jdS"),
    lambda p: hs.nearest(p, 4, queries=QUERIES),
    lambda p: hs.pair_histogram(p, [0.0, 0.1, 0.3]),
    lambda p: hs.clusters(p, 0.15).labels,
    lambda p: hs.clusters(p, 0.15).unwrap(),
    lambda p: hs.for_each_pair(p, 0.3, lambda *pair: None),
    lambda p: sorted(i for block in hs.iter_pairs(p, 0.3, max_pairs=50) for i in block[0].tolist()),
    lambda p: hs.measure(p, [0, 1], [2, 3], quantities="dD"),
]


def as_arrays(found):
    return found if isinstance(found, tuple) else (np.asarray(found),)


@pytest.mark.parametrize("name", SCENES)
def test_searches_of_cells_are_those_of_their_points(name):
    for x in (X, X.astype(np.float32)):
        points = hs.Points(x, **SCENES[name])
        cells = hs.CellList(points, 0.3)
        assert len(cells) == 400 and np.array_equal(cells.points.positions, x)
        for search in SEARCHES:
            assert same_arrays(as_arrays(search(cells)), as_arrays(search(points)))


def test_what_cells_are_not():
    cells = hs.CellList(X, 0.3, box=SKEWED)
    with pytest.raises(ValueError, match="Points bring their own box: leave box out"):
        hs.pairs(cells, 0.3, box=SKEWED)
    with pytest.raises(ValueError, match="CellList cannot be combined with batch: cells are those"):
        hs.CellList([X[:5], X[5:]], 0.3)
    with pytest.raises(TypeError, match="memory_limit"):
        hs.CellList(X, 0.3, memory_limit=1e9)


@pytest.mark.parametrize("name", SCENES)
def test_pickles_are_the_same_cells(name):
    cells = hs.CellList(hs.Points(X, **KNOWN, **SCENES[name]), 0.3, cell_size=0.4)
    again = pickle.loads(pickle.dumps(cells))
    for part in ("cutoff", "shape", "cell_sizes"):
        assert getattr(again, part) == getattr(cells, part)
    assert same_arrays((again.order, again.cell_start), (cells.order, cells.cell_start))
    assert same_arrays(again.pairs(exclude=0), cells.pairs(exclude=0))


def test_queries_with_a_radius_each_do_not_look_at_those_of_the_points():
    for box in SCENES.values():
        plain = hs.CellList(X, 0.3, **box)
        near = hs.CellList(hs.Points(X, radii=KNOWN["radii"], **box), 0.3)
        for radius in (0.2, np.linspace(0.0, 0.5, 30)):
            assert np.array_equal(near.query(QUERIES, radius).counts,
                                  plain.query(QUERIES, radius).counts)  # fmt: skip
