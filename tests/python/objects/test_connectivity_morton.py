# SPDX-License-Identifier: BSD-3-Clause
"""The order of the Z curve: the same pairs of ids for any storage and any split into ghosts."""

from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from halfshell import _core


def key_of(x, low, high):
    """Bits in turns, from fractions of the box, by whole numbers."""
    d = len(x)
    bits = 63 // d
    key = 0
    for k in range(d):
        width = high[k] - low[k]
        part = (x[k] - low[k]) / width if width > 0 else 0.0
        slot = min(int(Fraction(float(part)) * 2**bits), 2**bits - 1)
        for b in range(bits):
            key |= (slot >> b & 1) << (b * d + k)
    return key


def test_keys():
    for d in range(1, 9):
        rng = np.random.default_rng(d)
        x = np.concatenate((rng.random((60, d)), rng.integers(0, 2, (20, d)))) * 3.0 - 1.0
        low, high = x.min(axis=0), x.max(axis=0)
        keys = _core.morton_keys(x, low, high)
        assert keys.tolist() == [key_of(one, low, high) for one in x]
        assert keys.max() < 2**63
        assert keys[np.flatnonzero((x == high).all(axis=1))].tolist() == [
            2 ** (63 // d * d) - 1
        ] * int((x == high).all(axis=1).sum())


def test_keys_of_lists_can_be_read():
    rng = np.random.default_rng(3)
    x = rng.random((30, 2))
    lists = [hs.NodeList("a", x[:12], np.full(12, 0.2), 5), hs.NodeList("b", x[12:], [0.1] * 18)]
    c = hs.Connectivity(lists, order="morton")
    for k, one in enumerate(lists):
        keys = c.morton_keys(one.name)
        want = [key_of(place, x.min(axis=0), x.max(axis=0)) for place in one.positions]
        assert keys.tolist() == want
        assert (np.diff(keys[c.traversal(k)].astype(np.int64)) >= 0).all()
    c.patch([np.arange(12) < 0, np.ones(18, bool)])
    assert c.morton_keys(0).tolist() == []
    low, high = x[12:].min(axis=0), x[12:].max(axis=0)
    assert c.morton_keys(1).tolist() == [key_of(place, low, high) for place in x[12:]]


def test_boxes_without_width_and_near_the_largest_number():
    x = np.array([[1.0, 0.0], [1.0, 2.0]])
    assert _core.morton_keys(x, np.array([1.0, 0.0]), np.array([1.0, 2.0]))[0] == 0
    big = np.array([[-1.7e308], [0.0], [1.7e308]])
    keys = _core.morton_keys(big, big[0], big[2])
    assert keys[0] == 0
    assert keys[0] < keys[1] < keys[2]
    assert keys[2] == 2**63 - 1


def scene(rng, n, d, tied):
    x = rng.integers(0, 4, (n, d)) * 1.0 if tied else rng.random((n, d)) * 4
    return x, rng.uniform(0.2, 0.6, n), rng.integers(0, 2, n), rng.permutation(n * 3)[:n]


def lists_of(x, h, which, ids, ghost):
    """Two lists, with the ghosts of each at its end."""
    lists = []
    for k in range(2):
        own = np.flatnonzero(which == k)
        own = np.concatenate((own[~ghost[own]], own[ghost[own]]))
        lists.append(hs.NodeList(f"{k}", x[own], h[own], int(ghost[own].sum()), ids[own]))
    return lists


def id_pairs(c, lists):
    ids = [one.ids for one in lists]
    return [(int(ids[a][i]), int(ids[b][j])) for i, a, j, b in c.pairs]


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("tied", [False, True])
def test_storage_and_division_do_not_change_the_sequence(d, tied):
    for seed in range(4):
        rng = np.random.default_rng([seed, d])
        x, h, which, ids = scene(rng, 60, d, tied)
        none = np.zeros(60, bool)
        lists = lists_of(x, h, which, ids, none)
        serial = hs.Connectivity(lists, order="morton", morton_box=[[-1.0] * d, [5.0] * d])
        want = id_pairs(serial, lists)
        walk = [
            [int(lists[k].ids[i]) for i in serial.traversal(k)] for k in range(2)
        ]  # fmt: skip
        assert {frozenset(p) for p in want} == {
            frozenset(p) for p in id_pairs(hs.Connectivity(lists), lists)
        }
        for _ in range(3):
            order = rng.permutation(60)
            ghost = rng.random(60) < 0.4
            parts = lists_of(x[order], h[order], which[order], ids[order], ghost)
            options = {"order": "morton", "morton_box": [[-1.0] * d, [5.0] * d]}
            c = hs.Connectivity(parts, ghosts=True, **options)
            c.validate()
            assert id_pairs(c, parts) == want
            owned = hs.Connectivity(parts, **options)
            is_ghost = dict(zip(ids[order].tolist(), ghost, strict=True))
            assert id_pairs(owned, parts) == [
                (a, b) for a, b in want if not (is_ghost[a] and is_ghost[b])
            ]
            assert [[int(parts[k].ids[i]) for i in c.traversal(k)] for k in range(2)] == walk
            for k in range(2):
                for i in range(parts[k].n_nodes):
                    at = int(np.flatnonzero(lists[k].ids == parts[k].ids[i])[0])
                    for m in range(2):
                        row = parts[m].ids[c.neighbors(k, i)[m]]
                        assert (row == lists[m].ids[serial.neighbors(k, at)[m]]).all()


def test_nodes_outside_the_box_are_refused():
    lists = [hs.NodeList("a", [[0.0], [1.0]], [1.0, 1.0])]
    for box in ([[0.0], [0.9]], [[0.1], [2.0]]):
        with pytest.raises(ValueError, match="morton_box must hold all nodes"):
            hs.Connectivity(lists, order="morton", morton_box=box)
    c = hs.Connectivity(lists, order="morton", morton_box=[[0.0], [2.0]])
    with pytest.raises(ValueError, match="morton_box"):
        c.rebuild([hs.NodeList("a", [[0.0], [3.0]], [1.0, 1.0])])
    assert len(c.pairs) == 1
    assert hs.PairField(c.pairs).values.tolist() == [0.0]
