# SPDX-License-Identifier: BSD-3-Clause
"""Connectivity against its definitions, on all nodes: rows, pairs, overlap, intersection."""

from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from node_oracle import check, gather_rows, random_lists


@pytest.mark.parametrize("d", [1, 2, 3])
def test_random_lists_are_what_the_definitions_say(d):
    for seed in range(12):
        rng = np.random.default_rng([seed, d])
        counts = rng.integers(0, 25, rng.integers(0, 5))
        lists = random_lists(rng, counts, d, lattice=seed % 2 == 0)
        ghosts, overlap, intersection = (bool(rng.integers(2)) for _ in range(3))
        extent = float(rng.choice([2.0, 1.1, 0.1 * 7]))
        c = hs.Connectivity(
            lists, extent, ghosts=ghosts, overlap=overlap, intersection=intersection
        )
        check(c, lists, extent, ghosts)


def adjacent_boxes(counts, d, seed=0):
    """Three lists in boxes next to each other, with the supports of Spheral's tests."""
    rng = np.random.default_rng(seed)
    lists = []
    for k, n in enumerate(counts):
        x = rng.random((n, d))
        x[:, 0] += k
        spacing = n ** (-1.0 / d)
        lists.append(hs.NodeList(f"box {k}", x, 2.01 * rng.uniform(0.5, 2.0, n) * spacing))
    return lists


def rotated(lists, seed):
    """H as in Spheral's tests: a rotation of semi-axes that differ by up to four."""
    rng = np.random.default_rng(seed)
    found = []
    for one in lists:
        n, d = one.positions.shape
        turns = np.linalg.qr(rng.normal(size=(n, d, d)))[0]
        axes = 1.0 / (2.01 * rng.uniform(0.5, 2.0, (n, d)) * n ** (-1.0 / d))
        H = np.einsum("iab,ib,icb->iac", turns, axes, turns)
        found.append(hs.NodeList(one.name, one.positions, (H + H.transpose(0, 2, 1)) / 2.0))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("counts", "d"), [((4000, 10000, 2000), 2), ((1000, 2500, 1500), 3)], ids=["2", "3"]
)
def test_three_large_lists_with_rotated_supports(counts, d):
    lists = rotated(_along_the_first_axis(adjacent_boxes(counts, d)), d)
    _check_as_a_whole(hs.Connectivity(lists, threads=2), lists, 2.0)


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True], ids=["lengths", "rotated"])
def test_a_cylinder(turned):
    r, angle = np.meshgrid((np.arange(100) + 0.5) / 100, np.arange(100) / 50 * np.pi)
    x = np.column_stack(((r * np.cos(angle)).ravel(), (r * np.sin(angle)).ravel()))
    lists = _along_the_first_axis([hs.NodeList("cylinder", x, np.full(len(x), 2.01 * 0.01))])
    lists = rotated(lists, 9) if turned else lists
    _check_as_a_whole(hs.Connectivity(lists), lists, 2.0)


def _along_the_first_axis(lists):
    """The same nodes in another order, of which some hundred meet few others."""
    order = [np.argsort(one.positions[:, 0]) for one in lists]
    return [
        hs.NodeList(one.name, one.positions[own], one.H[own])
        for one, own in zip(lists, order, strict=True)
    ]


def _longest_reach(h, extent):
    """How far any support reaches, and a little more."""
    longest = h.max() if h.ndim == 1 else 1.0 / np.linalg.eigvalsh(h).min()
    return 1.001 * extent * longest


def _check_as_a_whole(c, lists, extent):
    """All rows and pairs, for lists without ghosts, some hundred nodes at a time."""
    x = np.concatenate([one.positions for one in lists])
    h = np.concatenate([one.H for one in lists])
    first = np.concatenate(([0], np.cumsum([one.n_nodes for one in lists])))
    n_lists, n, reach = len(lists), len(x), _longest_reach(h, extent)
    pairs = []
    for start in range(0, n, 500):
        own = np.arange(start, min(start + 500, n))
        low, high = x[own, 0].min() - reach, x[own, 0].max() + reach
        some = np.flatnonzero((x[:, 0] >= low) & (x[:, 0] <= high))  # the others are out of reach
        near = gather_rows(x[own], x[some], h[own], extent)
        near |= gather_rows(x[some], x[own], h[some], extent).T
        near &= own[:, None] != some
        owner, other = np.nonzero(near)
        other = some[other]
        lists_of = np.searchsorted(first[1:], other, side="right")
        lengths = np.bincount(owner * n_lists + lists_of, minlength=len(own) * n_lists)
        offsets = c.offsets[start * n_lists : (own[-1] + 1) * n_lists + 1]
        assert (np.diff(offsets) == lengths).all()
        assert (c.indices[offsets[0] : offsets[-1]] == other - first[lists_of]).all()
        once = own[owner] < other
        pairs.append(np.column_stack((own[owner][once], other[once])))
    i, j = np.concatenate(pairs).T
    assert (first[c.pairs.i_list] + c.pairs.i_node == i).all()
    assert (first[c.pairs.j_list] + c.pairs.j_node == j).all()
    c.validate()


def test_a_support_ends_where_the_real_product_does():
    """extent * h need not be a float64: neighbours of what it is rounded to are on either side."""
    for extent in (2.0, 0.1, 1.1, 1 / 3):
        rng = np.random.default_rng(3)
        h = rng.uniform(0.5, 1.0, 400)
        product = extent * h
        at = np.concatenate((product, np.nextafter(product, 0), np.nextafter(product, 9)))
        x = np.concatenate((np.zeros(1200), at))[:, None]
        x = np.column_stack((x, np.tile(np.arange(1200) * 100.0, 2)))  # each pair by itself
        lists = [
            hs.NodeList("from", x[:1200], np.tile(h, 3)),
            hs.NodeList("to", x[1200:], np.zeros(1200)),
        ]
        c = hs.Connectivity(lists, extent)
        want = [
            k for k in range(1200)
            if Fraction(float(at[k])) <= Fraction(extent) * Fraction(float(h[k % 400]))
        ]  # fmt: skip
        assert c.pairs.i_node.tolist() == want
        assert 400 <= len(want) <= 800


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-140, 1.0, 1e140])
def test_sizes_of_a_ratio_of_a_million_and_any_scale(scale):
    rng = np.random.default_rng(5)
    h = 10.0 ** rng.uniform(-6, 0, 150) * scale
    lists = [hs.NodeList("all", rng.random((150, 3)) * scale, h)]
    check(hs.Connectivity(lists, 1.3, overlap=True, intersection=True), lists, 1.3)


def random_matrices(rng, n, d, aspect=4.0):
    """Symmetric positive definite: rotations of semi-axes of this ratio."""
    turns = np.linalg.qr(rng.normal(size=(n, d, d)))[0]
    axes = rng.uniform(1.0, aspect, (n, d)) if aspect < 100 else aspect ** rng.random((n, d))
    matrices = np.einsum("iab,ib,icb->iac", turns, axes, turns)
    return (matrices + matrices.transpose(0, 2, 1)) / 2.0


@pytest.mark.parametrize("d", [1, 2, 3])
def test_supports_that_are_ellipsoids(d):
    for seed in range(6):
        rng = np.random.default_rng([seed, d, 7])
        lists = []
        for k, n in enumerate((14, 0, 11)):
            x = rng.integers(0, 5, (n, d)) * 0.5 if seed % 2 else rng.random((n, d)) * 2.5
            H = random_matrices(rng, n, d) * 1.2
            if seed % 2:  # many ties: axes along the lattice
                H = np.einsum("i,ab->iab", rng.choice([1.0, 2.0], n), np.eye(d))
            lists.append(hs.NodeList(f"{k}", x if n else [], H if n else [], n // 4))
        options = {name: bool(rng.integers(2)) for name in ("ghosts", "overlap", "intersection")}
        check(hs.Connectivity(lists, **options), lists, 2.0, options["ghosts"])


def test_needles_of_a_ratio_of_a_million():
    rng = np.random.default_rng(1)
    x = rng.random((80, 3)) * np.array([1.0, 1.0, 1e-3])
    lists = [hs.NodeList("needles", x, random_matrices(rng, 80, 3, 1e6))]
    check(hs.Connectivity(lists, 5.0, overlap=True), lists, 5.0)


def test_matrices_of_sizes_of_a_ratio_of_a_million():
    """Needles among them, and nodes that coincide."""
    rng = np.random.default_rng(4)
    x = rng.random((90, 3))
    x[80:] = x[:10]
    H = random_matrices(rng, 90, 3, 30.0) * 10.0 ** rng.uniform(0.0, 6.0, (90, 1, 1))
    lists = [hs.NodeList("a", x[:50], H[:50], n_ghost=20), hs.NodeList("b", x[50:], H[50:])]
    for options in ({}, {"overlap": True, "intersection": True}):
        c = hs.Connectivity(lists, 3.0, **options)
        want = check(c, lists, 3.0)
        assert want.near[80:, :10].diagonal().all()


def test_the_supports_of_each_list_may_be_of_a_size_of_their_own():
    """In Spheral a list whose extent is smaller may lose pairs: here there is one for all."""
    rng = np.random.default_rng(8)
    lists = [
        hs.NodeList(f"{h}", rng.random((25, 2)), np.full(25, h), n_ghost=5)
        for h in (1e-9, 0.3, 0.01, 0.0)
    ]
    for extent in (2.0, 0.5):
        c = hs.Connectivity(lists, extent, overlap=True, intersection=True)
        check(c, lists, extent)
    assert any(a != b for _, a, _, b in c.pairs)


def test_lengths_and_matrices_cannot_be_mixed():
    """A length h is no matrix of float64s as a rule: 1 / h is none."""
    x = np.zeros((2, 2))
    lists = [
        hs.NodeList("none", [], []), hs.NodeList("round", x, [1.0, 0.1]),
        hs.NodeList("flat", x, [np.eye(2)] * 2), hs.NodeList("nobody", np.empty((0, 2)), []),
    ]  # fmt: skip
    with pytest.raises(ValueError, match="'flat' has matrices, 'round' has lengths"):
        hs.Connectivity(lists)
    for some in (lists[:2] + lists[3:], lists[:1] + lists[2:]):  # lists without nodes have neither
        c = hs.Connectivity(some)
        assert len(c.pairs) == 1


def test_matrices_that_are_no_supports_are_refused():
    x = [[0.0, 0.0], [1.0, 0.0]]
    good = np.eye(2)
    for bad, message in (
        ([[1.0, 2.0], [2.0, 1.0]], "positive definite"), ([[1.0, 0.5], [0.4, 1.0]], "symmetric"),
        ([[np.nan, 0.0], [0.0, 1.0]], "finite"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=message):
            hs.NodeList("a", x, [good, bad])
    with pytest.raises(ValueError, match="1 to 3 dimensions"):
        hs.NodeList("a", np.zeros((1, 4)), np.eye(4)[None])
    with pytest.raises(ValueError, match="lengths in all lists"):
        hs.Connectivity([hs.NodeList("a", x, [good] * 2), hs.NodeList("b", x, [1.0] * 2)])


def test_coincident_nodes_are_neighbours_and_none_is_its_own():
    lists = [
        hs.NodeList("a", [[1.0, 2.0]] * 3, [0.0] * 3), hs.NodeList("b", [[1.0, 2.0]] * 2, [0.1] * 2)
    ]  # fmt: skip
    c = hs.Connectivity(lists, intersection=True, overlap=True)
    check(c, lists)
    assert len(c.pairs) == 10
    assert [one.tolist() for one in c.intersection(0)] == [[2, 0, 1], [0, 1]]


def test_supports_that_merely_touch_do_not_overlap():
    lists = [hs.NodeList("a", [[0.0], [3.0]], [1.0, 1.0])]
    assert c_overlap(lists) == [[[]], [[]]]
    between = [hs.NodeList("a", [[0.0], [3.0], [1.5]], [1.0, 1.0, 0.0])]
    assert c_overlap(between) == [[[1, 2]], [[0, 2]], [[0, 1]]]


def c_overlap(lists):
    c = hs.Connectivity(lists, overlap=True)
    return [[one.tolist() for one in c.overlap(0, i)] for i in range(lists[0].n_nodes)]


def test_a_pair_across_lists_with_a_ghost_below_is_there_once():
    """Spheral's rule gives a pair twice whose end in the lower list is a ghost."""
    lists = [
        hs.NodeList("a", [[0.0], [1.0]], [1.0] * 2, n_ghost=1), hs.NodeList("b", [[1.5]], [1.0])
    ]  # fmt: skip
    for options in ({}, {"ghosts": True}, {"overlap": True}, {"intersection": True}):
        c = hs.Connectivity(lists, **options)
        assert [tuple(p) for p in c.pairs] == [(0, 0, 1, 0), (0, 0, 0, 1), (0, 1, 1, 0)]


def test_a_support_larger_than_the_scene_reaches_all():
    """Spheral's tree loses nodes of its root level."""
    x = np.random.default_rng(0).random((60, 3))
    lists = [hs.NodeList("a", x, np.where(np.arange(60) == 7, 100.0, 1e-3))]
    c = hs.Connectivity(lists)
    check(c, lists)
    assert c.n_neighbors(0, 7) == 59


def test_a_box_without_nodes_has_no_shifts_of_any():
    none = [hs.NodeList("a", [], []), hs.NodeList("b", np.empty((0, 2)), [])]
    for lists in ([], none[:1], none[1:], none):
        c = hs.Connectivity(lists, box=[2.0, 3.0], exclude=[])
        assert c.shifts.shape == c.pairs.shifts.shape == (0, 2)
        c.patch([[]] * len(lists))
        apart = hs.Connectivity(lists, [1.0, 2.0][: len(lists)], box=[2.0, 3.0], overlap=True)
        assert apart.shifts.shape == apart.overlap_shifts.shape == (0, 2)
        assert len(hs.Connectivity(lists, box=[2.0, 3.0]).shifts) == 0


def test_rows_are_read_only_and_flat():
    c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3)], intersection=True)
    arrays = [c.offsets, c.indices, c.pairs.i_node, c.pairs.j_list, c.intersection_indices]
    for array in (*arrays, *c.neighbors(0, 1)):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    assert c.neighbors(0, 1)[0].base is not None
    assert c.offsets.dtype == np.int64
    assert c.indices.dtype == c.pairs.i_node.dtype == np.int32


def test_helpers():
    lists = [
        hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3, 1, ids=[5, 3, 9]),
        hs.NodeList("b", [[1.5]], [0.5], ids=[4]),
    ]
    c = hs.Connectivity(lists)
    assert c.n_neighbors(0).tolist() == [1, 3]
    assert c.n_neighbors("b", 0) == 2
    found = c.global_neighbors()
    rows = np.split(found.neighbors, found.offsets[1:-1])
    assert dict(zip(found.ids.tolist(), [r.tolist() for r in rows], strict=True)) == {
        5: [3], 3: [5, 9, 4], 4: [3, 9]
    }  # fmt: skip
    assert [one.tolist() for one in c.union_of(0, 0, 1, 0)] == [[1, 2], []]
    assert [one.tolist() for one in c.intersection_of("a", 0, "b", 0)] == [[1, 0], [0]]
    assert c.traversal(0).tolist() == [0, 1]
    assert [one.tolist() for one in c.used()] == [[True, True, True], [True]]


def test_the_foot_of_what_is_given_decides():
    lists = [hs.NodeList("a", [[0.0, 0.0], [1.0, 0.0], [0.0, 0.5], [-0.5, 0.2]], [1.0] * 4)]
    c = hs.Connectivity(lists)
    assert c.intersection_of(0, 0, 0, 1)[0].tolist() == [2, 3, 0, 1]
    assert c.intersection_of(0, 0, 0, 1, [lists[0].positions])[0].tolist() == [2, 0, 1]
