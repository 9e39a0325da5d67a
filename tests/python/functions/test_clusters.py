# SPDX-License-Identifier: BSD-3-Clause
"""`clusters` are the components of the graph of `pairs`, and DBSCAN's, and wind as replicas say."""

import itertools

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import halfshell as hs

TRICLINIC = np.array([[1.0, 0.0, 0.0], [0.3, 0.9, 0.0], [-0.2, 0.4, 1.1]])
BOXES = {
    "open": {},
    "periodic": {"box": [1.0, 1.0, 1.0]},
    "mixed": {"box": [1.0, 1.0, 1.0], "periodic": [True, False, True]},
    "triclinic": {"box": TRICLINIC},
}


def components(n, i, j):
    """SciPy's, which are numbered by their lowest points."""
    count, labels = connected_components(coo_matrix((np.ones(len(i)), (i, j)), (n, n)), False)
    first = np.array([np.argmax(labels == k) for k in range(count)])
    return np.argsort(np.argsort(first))[labels]


def dbscan(points, cutoff, least, **options):
    """From the definition, by sets of neighbours."""
    n = len(points)
    rows = hs.neighbors(points, cutoff, **options)
    core = np.diff(rows.offsets) + 1 >= least
    labels = np.full(n, -1)
    for start in np.flatnonzero(core):
        if labels[start] >= 0:
            continue
        number = labels.max() + 1
        waiting = [start]
        labels[start] = number
        while waiting:
            for q in rows[waiting.pop()]:
                if core[q] and labels[q] < 0:
                    labels[q] = number
                    waiting.append(q)
    for p in range(n):
        if not core[p]:
            near = [labels[q] for q in rows[p] if core[q]]
            labels[p] = min(near, default=-1)
    return labels, core


def winds(points, members, cutoff, rows, axes):
    """Whether a component winds along each axis, by its copies in a ring of seven boxes along it:
    they hang together if it winds, unless by a multiple of seven boxes, which is far from here."""
    found = []
    for axis in range(len(rows)):
        i, j, S = hs.pairs(points, cutoff, box=rows, periodic=axes, quantities="ijS")
        inside = members[i]
        i, j, shift = i[inside], j[inside], S[inside, axis]
        n = 7 * len(points)
        a = np.concatenate([i * 7 + copy for copy in range(7)])
        b = np.concatenate([j * 7 + (copy + shift) % 7 for copy in range(7)])
        _, labels = connected_components(coo_matrix((np.ones(len(a)), (a, b)), (n, n)), False)
        first = np.flatnonzero(members)[0] * 7
        found.append(bool(labels[first] == labels[first + 1]))
    return found


@pytest.mark.parametrize("name", BOXES)
def test_components_are_scipys(name, rng):
    for n, cutoff in [(40, 0.15), (300, 0.09), (2000, 0.06)]:
        points = rng.uniform(-1.0, 2.0, (n, 3))
        expected = components(n, *hs.pairs(points, cutoff, **BOXES[name]))
        for kernel, threads in itertools.product(hs.kernels(), (1, 2)):
            found = hs.clusters(points, cutoff, kernel=kernel, threads=threads, **BOXES[name])
            assert np.array_equal(found.labels, expected)
            assert np.array_equal(found.sizes, np.bincount(expected))
            assert found.core.all() and found.winding is None
            assert found.labels.dtype == found.sizes.dtype == np.int64


@pytest.mark.parametrize("name", BOXES)
def test_core_points_are_those_of_the_definition(name, rng):
    for n, cutoff, least in [(60, 0.2, 2), (300, 0.12, 4), (300, 0.12, 9), (50, 0.1, 1000)]:
        points = rng.random((n, 3))
        found = hs.clusters(points, cutoff, min_points=least, **BOXES[name])
        labels, core = dbscan(points, cutoff, least, **BOXES[name])
        assert np.array_equal(found.labels, labels) and np.array_equal(found.core, core)
        assert np.array_equal(found.sizes, np.bincount(labels[labels >= 0]))


@pytest.mark.parametrize("dim", range(1, 9))
def test_any_dimension(dim, rng):
    for dtype in (np.float32, np.float64):
        points = rng.random((60, dim)).astype(dtype)
        cutoff = 0.5 * 60 ** (-1.0 / dim) if dim > 1 else 0.01
        for options in [{}, {"box": [1.0] * dim}]:
            i, j = hs.pairs(points, cutoff, **options)
            found = hs.clusters(points, cutoff, winding=True, **options)
            assert np.array_equal(found.labels, components(60, i, j))
            assert found.winding.shape == (len(found.sizes), dim) and found.winding.dtype == bool
            assert options or not found.winding.any()


@pytest.mark.parametrize("periodic", list(itertools.product([True, False], repeat=3)))
def test_clusters_wind_as_copies_of_them_hang_together(periodic, rng):
    for trial in range(6):
        n = int(rng.integers(1, 40))
        rows = TRICLINIC if trial % 2 else np.eye(3)
        points = rng.uniform(-3.0, 3.0, (n, 3))  # not wrapped
        cutoff = float(rng.uniform(0.15, 0.5))
        found = hs.clusters(points, cutoff, box=rows, periodic=periodic, winding=True)
        for k, winding in enumerate(found.winding):
            members = found.labels == k
            assert winding.tolist() == winds(points, members, cutoff, rows, periodic)


def test_a_point_that_meets_its_own_image_winds():
    found = hs.clusters([[0.5, 0.5]], 1.0, box=[1.0, 3.0], winding=True)
    assert found.winding.tolist() == [[True, False]]
    diagonal = hs.clusters([[0.0, 0.0]], 1.0, box=[[0.5, 0.5], [0.0, 9.0]], winding=True)
    assert diagonal.winding.tolist() == [[True, False]]


def test_a_ring_within_the_box_does_not_wind():
    angles = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    for offset in (0.0, 1.7, 40.0):  # across the faces of the box, too
        found = hs.clusters(ring + offset, 0.2, box=[4.0, 4.0], winding=True)
        assert found.sizes.tolist() == [40] and not found.winding.any()


def test_the_cutoff_is_decided_exactly():
    points = np.array([[0.0], [0.1], [0.1 + 0.2]])  # 0.30000000000000004 - 0.1 rounds to 0.2
    assert hs.clusters(points, 0.2).labels.tolist() == [0, 0, 1]
    assert hs.clusters([[0.0], [1.0]], 1.0, inclusive=False).labels.tolist() == [0, 1]


def test_radii_types_and_supports(rng):
    points = rng.random((200, 3))
    radii = rng.uniform(0.01, 0.1, 200)
    types = rng.integers(0, 2, 200)
    ways = [
        {"cutoff": None, "radii": radii},
        {"cutoff": None, "radii": radii * 4.0 ** rng.integers(-4, 1, 200), "rule": "max"},
        {"cutoff": {(0, 0): 0.12, (1, 1): 0.05}, "types": types},
        {"cutoff": None, "supports": np.eye(3) / radii[:, None, None], "extent": 1.2},
    ]
    for way, options in itertools.product(ways, BOXES.values()):
        i, j = hs.pairs(points, **way, **options)
        found = hs.clusters(points, **way, **options)
        assert np.array_equal(found.labels, components(200, i, j))
        found = hs.clusters(points, min_points=3, **way, **options)
        counts = np.bincount(np.concatenate([i, j]), minlength=200) + 1
        assert np.array_equal(found.core, counts >= 3)


def test_nothing_and_one_point():
    for dim in (1, 3):
        found = hs.clusters(np.empty((0, dim)), 1.0, box=[2.0] * dim, winding=True, min_points=2)
        assert found.labels.shape == found.core.shape == found.sizes.shape == (0,)
        assert found.winding.shape == (0, dim)
    alone = hs.clusters([[1.0, 2.0]], 1.0, min_points=2)
    assert alone.labels.tolist() == [-1] and alone.sizes.shape == (0,)


def test_labels_are_those_of_scikit_learn(rng):
    cluster = pytest.importorskip("sklearn.cluster", reason="scikit-learn is not installed")
    centres = rng.random((20, 3))
    points = np.concatenate([c + 0.03 * rng.standard_normal((60, 3)) for c in centres])
    for least in (1, 4, 12):
        other = cluster.DBSCAN(eps=0.04, min_samples=least).fit(points)
        found = hs.clusters(points, 0.04, min_points=least)
        assert np.array_equal(found.labels, other.labels_)
        assert np.array_equal(np.flatnonzero(found.core), other.core_sample_indices_)


def test_extreme_scales(rng):
    points = rng.random((50, 2))
    plain = hs.clusters(points, 0.125, box=[1.0, 1.0], winding=True)
    for exponent in (-1000, -300, 300, 1000):
        scale = 2.0**exponent
        found = hs.clusters(points * scale, 0.125 * scale, box=[scale] * 2, winding=True)
        assert np.array_equal(found.labels, plain.labels)
        assert np.array_equal(found.winding, plain.winding)
    far = hs.clusters([[0.0], [1.0], [1e300]], 1.0)
    assert far.labels.tolist() == [0, 0, 1]


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"min_points": 0}, ValueError, "min_points"),
        ({"min_points": 2.5}, TypeError, "min_points"),
        ({"min_points": True}, TypeError, "min_points"),
        ({"winding": "yes"}, TypeError, "winding"),
        ({"rule": "gather", "radii": [1.0] * 3, "cutoff": None}, ValueError, "gather"),
        ({"cutoff": -1.0}, ValueError, "cutoff"),
        ({"cutoff": [1.0, 2.0]}, TypeError, "cutoff"),
        ({"points": [[np.nan]]}, ValueError, r"points\[0, 0\] = nan"),
        ({"box": [1.0], "periodic": True, "kernel": "none"}, ValueError, "kernel"),
    ],
)
def test_bad_arguments(options, error, message):
    arguments = {"points": [[0.0], [1.0], [2.0]], "cutoff": 1.0, **options}
    with pytest.raises(error, match=message):
        hs.clusters(**arguments)


def test_the_memory_limit_holds_for_what_is_noted_for_each_point(rng):
    points = rng.random((100_000, 3))
    with pytest.raises(MemoryError):
        hs.clusters(points, 0.001, memory_limit=300_000)
    assert len(hs.clusters(points, 0.001, memory_limit=100e6).labels) == 100_000
