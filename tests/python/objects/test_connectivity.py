# SPDX-License-Identifier: BSD-3-Clause
"""Connectivity against its definitions, on all nodes: rows, pairs, overlap, intersection."""

from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from node_oracle import Nodes, check, random_lists


@pytest.mark.parametrize("d", [1, 2, 3])
def test_random_lists_are_what_the_definitions_say(d):
    for seed in range(6):
        rng = np.random.default_rng([seed, d])
        counts = rng.integers(0, 25, rng.integers(0, 5))
        lists = random_lists(rng, counts, d, lattice=seed % 2 == 0)
        ghosts, overlap, intersection = (bool(rng.integers(2)) for _ in range(3))
        extent = float(rng.choice([2.0, 1.1, 0.1 * 7]))
        c = hs.Connectivity(
            lists, extent, ghosts=ghosts, overlap=overlap, intersection=intersection
        )
        check(c, Nodes(lists, extent), ghosts=ghosts)


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


def random_matrices(rng, n, d, aspect=4.0):
    """Symmetric positive definite: rotations of semi-axes of this ratio."""
    turns = np.linalg.qr(rng.normal(size=(n, d, d)))[0]
    axes = rng.uniform(1.0, aspect, (n, d)) if aspect < 100 else aspect ** rng.random((n, d))
    matrices = np.einsum("iab,ib,icb->iac", turns, axes, turns)
    return (matrices + matrices.transpose(0, 2, 1)) / 2.0


def test_needles_of_a_ratio_of_a_million():
    rng = np.random.default_rng(1)
    x = rng.random((80, 3)) * np.array([1.0, 1.0, 1e-3])
    lists = [hs.NodeList("needles", x, random_matrices(rng, 80, 3, 1e6))]
    check(hs.Connectivity(lists, 5.0, overlap=True), Nodes(lists, 5.0))


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
