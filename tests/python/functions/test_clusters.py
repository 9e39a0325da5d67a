# SPDX-License-Identifier: BSD-3-Clause
"""`clusters` are the components of the graph of `pairs`, and DBSCAN's, and span boxes as replicas
say."""

import itertools

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import halfshell as hs
from calls import call

TRICLINIC = np.array([[1.0, 0.0, 0.0], [0.3, 0.9, 0.0], [-0.2, 0.4, 1.1]])
BOXES = {
    "open": {},
    "periodic": {"box": [1.0, 1.0, 1.0]},
    "mixed": {"box": [1.0, 1.0, 1.0], "periodic": [True, False, True]},
    "triclinic": {"box": TRICLINIC},
}


def dbscan(points, cutoff, least, **options):
    """From the definition, by sets of neighbours."""
    n = len(points)
    rows = call(hs.neighbors, points, cutoff, **options)
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


def spanned(points, members, cutoff, rows, axes):
    """Whether a component spans each axis, by its copies in a ring of seven boxes along it:
    they hang together if it does, unless by a multiple of seven boxes, which is far from here."""
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
def test_core_points_are_those_of_the_definition(name, rng):
    for n, cutoff, least in [(60, 0.2, 2), (300, 0.12, 4), (300, 0.12, 9), (50, 0.1, 1000)]:
        points = rng.random((n, 3))
        found = call(hs.clusters, points, cutoff, min_points=least, **BOXES[name])
        labels, core = dbscan(points, cutoff, least, **BOXES[name])
        assert np.array_equal(found.labels, labels) and np.array_equal(found.core, core)
        assert np.array_equal(found.sizes, np.bincount(labels[labels >= 0]))


@pytest.mark.parametrize("periodic", list(itertools.product([True, False], repeat=3)))
def test_clusters_span_a_box_as_copies_of_them_hang_together(periodic, rng):
    for trial in range(6):
        n = int(rng.integers(1, 40))
        rows = TRICLINIC if trial % 2 else np.eye(3)
        points = rng.uniform(-3.0, 3.0, (n, 3))  # not wrapped
        cutoff = float(rng.uniform(0.15, 0.5))
        found = hs.clusters(points, cutoff, box=rows, periodic=periodic)
        for k, spans in enumerate(found.spans):
            members = found.labels == k
            assert spans.tolist() == spanned(points, members, cutoff, rows, periodic)


def test_the_memory_limit_holds_for_what_is_noted_for_each_point(rng):
    points = rng.random((100_000, 3))
    with pytest.raises(MemoryError):
        call(hs.clusters, points, 0.001, memory_limit=300_000)
    assert len(call(hs.clusters, points, 0.001, memory_limit=100e6).labels) == 100_000


# ---- made whole, and their centres -----------------------------------------------------------


def whole_by_fractions(points, found, cutoff, rows, periodic):
    """Whether each cluster that spans nothing is joined by pairs with S = 0 once unwrapped."""
    moved, x = found.unwrap(), np.asarray(points, float)
    i, j, S = hs.pairs(x, cutoff, box=rows, periodic=periodic, quantities="ijS")
    shifts = np.rint(np.linalg.solve(rows.T, (moved - x).T).T).astype(int)
    assert np.allclose(x + shifts @ rows, moved, rtol=0.0, atol=1e-12)
    assert not shifts[:, ~np.asarray(periodic)].any()
    inside = (found.labels[i] == found.labels[j]) & ~found.spans.any(axis=1)[found.labels[i]]
    assert np.array_equal((shifts[j] - shifts[i])[inside], S[inside])
    lowest = [np.argmax(found.labels == k) for k in range(found.n_clusters)]
    assert not shifts[lowest].any()
    means = [moved[found.labels == k].mean(axis=0) for k in range(found.n_clusters)]
    assert np.allclose(found.centers(), np.reshape(means, (-1, x.shape[1])), atol=1e-12)


@pytest.mark.parametrize("periodic", list(itertools.product([True, False], repeat=3)))
def test_unwrapped_clusters_are_whole(periodic, rng):
    for rows in (TRICLINIC, np.diag([1.0, 1.25, 0.75])):
        for n, cutoff in ((40, 0.3), (100, 0.3), (300, 0.15)):
            spread = np.where(periodic, 5.0, 1.0)
            points = rng.uniform(-2.0, -2.0 + spread, (n, 3))
            found = hs.clusters(points, cutoff, box=rows, periodic=periodic)
            assert found.sizes.max() > 2
            whole_by_fractions(points, found, cutoff, rows, periodic)


def test_a_chain_across_faces_is_one_line():
    for scale in (1.0, 2.0**-900, 2.0**900):
        line = np.arange(40.0)[:, None] * [0.5, 0.25]
        box = np.diag([4.0, 64.0])
        wrapped = hs.Box(box).wrap(line)[0]
        found = hs.clusters(wrapped * scale, 0.6 * scale, box=box * scale)
        assert found.n_clusters == 1 and not found.spans[0, 1]
        if not found.spans.any():
            assert np.array_equal(found.unwrap(), line * scale)
        far = hs.clusters(wrapped * scale, 0.6 * scale, box=np.diag([64.0, 64.0]) * scale)
        assert np.array_equal(far.unwrap(), wrapped * scale)  # nothing to move
    line = np.arange(12.0)[:, None] * [0.5, 0.25]
    found = hs.clusters(hs.Box([8.0, 1.0]).wrap(line)[0], 0.6, box=[8.0, 1.0])
    assert found.n_clusters == 1 and not found.spans.any()
    assert np.array_equal(found.unwrap(), line)
    assert found.centers().tolist() == [line.mean(axis=0).tolist()]


def test_weights_types_and_points_of_no_cluster():
    x = [[0.25], [3.75], [2.0], [9.0], [9.5]]
    points = hs.Points(x[:3], weights=[3.0, 1.0, 5.0], box=4.0)
    found = hs.clusters(points, 0.5)
    assert found.unwrap().tolist() == [[0.25], [-0.25], [2.0]]
    assert found.centers().tolist() == [[0.125], [2.0]]
    lonely = hs.clusters(points, 0.5, min_points=2)
    assert lonely.labels.tolist() == [0, 0, -1]
    assert lonely.unwrap().tolist() == [[0.25], [-0.25], [2.0]]
    assert lonely.centers().tolist() == [[0.125]]
    # 3.75 is a core point; 0.25 and 3.25 lie at its sides, and are of its cluster.
    dense = hs.clusters([[0.25], [3.25], [3.75]], 0.5, min_points=3, box=4.0)
    assert dense.labels.tolist() == [0, 0, 0] and dense.core.tolist() == [False, False, True]
    assert dense.unwrap().tolist() == [[4.25], [3.25], [3.75]]
    open_space = hs.clusters(x, 0.5)
    assert open_space.unwrap().tolist() == x and not open_space.spans.any()
    nothing = hs.clusters(np.empty((0, 2)), 1.0, box=1.0)
    assert nothing.unwrap().shape == nothing.centers().shape == (0, 2)


def test_where_a_point_between_two_ends_goes_depends_on_nothing_but_the_points(rng):
    """The last point is no core point, and touches both ends of a chain that spans nothing."""
    chain = np.append(np.arange(0.0, 6.25, 0.5), 7.1)[:, None]
    for _ in range(10):
        points = hs.Points(rng.permutation(chain), box=8.2)
        first = hs.clusters(points, 1.2, min_points=4)
        assert first.core.sum() == 13 and not first.spans.any()
        cells = [hs.CellList(points, 1.2, cell_size=size) for size in (0.4, 1.2, 8.0)]
        assert all(
            np.array_equal(one.clusters(min_points=4).unwrap(), first.unwrap()) for one in cells
        )
        for algorithm in ("all-pairs", "grid", "hash", "hierarchy"):
            with hs.settings(algorithm=algorithm):
                found = hs.clusters(points, 1.2, min_points=4)
                assert np.array_equal(found.unwrap(), first.unwrap())


@pytest.mark.parametrize("least", [1, 3])
def test_clusters_of_a_batch_are_those_of_each_system(least, rng):
    boxes = [TRICLINIC, np.eye(3), 1.5 * np.eye(3), None]
    flags = [True, [True, False, True], False, None]
    each = [
        hs.Points(rng.uniform(-1.0, 2.0, (n, 3)), box=box, periodic=axes, weights=rng.random(n))
        for n, box, axes in zip((80, 0, 60, 40), boxes, flags)
    ]
    found = hs.clusters(each, 0.2, min_points=least)
    first = number = 0
    for one in each:
        alone = hs.clusters(one, 0.2, min_points=least)
        own, some = slice(first, first + len(one)), slice(number, number + alone.n_clusters)
        labels = np.where(alone.labels < 0, -1, alone.labels + number)
        assert np.array_equal(found.labels[own], labels)
        assert np.array_equal(found.core[own], alone.core)
        assert np.array_equal(found.sizes[some], alone.sizes)
        assert np.array_equal(found.spans[some], alone.spans)
        assert np.array_equal(found.unwrap()[own], alone.unwrap())
        assert np.allclose(found.centers()[some], alone.centers())
        first, number = own.stop, some.stop
    assert found.n_clusters == number > 5
