# SPDX-License-Identifier: BSD-3-Clause
"""Patch, remove, exclude and rebuild: each equals a build from nothing."""

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

import halfshell as hs
from node_oracle import Nodes, check, random_lists

PARTS = ("offsets", "indices", "overlap_offsets", "overlap_indices", "intersection_offsets",
         "intersection_indices")  # fmt: skip
COLUMNS = ("i_node", "i_list", "j_node", "j_list")


def assert_equal(c, other):
    for name in PARTS:
        try:
            want = getattr(other, name)
        except ValueError:
            continue
        assert np.array_equal(getattr(c, name), want), name
    for name in COLUMNS:
        assert np.array_equal(getattr(c.pairs, name), getattr(other.pairs, name)), name
    assert c.n_nodes == other.n_nodes
    assert c.n_ghosts == other.n_ghosts
    for k in range(len(c.names)):
        assert np.array_equal(c.traversal(k), other.traversal(k))
    ours, theirs = c.global_neighbors(), other.global_neighbors()
    for one, want in zip(ours, theirs, strict=True):
        assert np.array_equal(one, want)
    c.validate()


def random_options(rng):
    names = ("ghosts", "overlap", "intersection")
    options = {name: bool(rng.integers(2)) for name in names}
    return options | ({"order": "morton"} if rng.integers(3) == 0 else {})


def with_ids(lists, rng):
    """The same lists with ids of their own: a patch keeps those that nodes have."""
    n = sum(one.n_nodes for one in lists)
    ids = np.split(rng.permutation(n), np.cumsum([one.n_nodes for one in lists])[:-1])
    return [
        hs.NodeList(one.name, one.positions, one.H, one.n_ghost, own)
        for one, own in zip(lists, ids, strict=False)
    ]  # fmt: skip


def culled(lists, keep, old2new):
    """The lists as they are once nodes have gone."""
    out = []
    for one, mask, new in zip(lists, keep, old2new, strict=True):
        order = np.empty(mask.sum(), int)
        order[new[mask]] = np.flatnonzero(mask)
        ghosts = int(mask[one.n_internal :].sum())
        out.append(
            hs.NodeList(one.name, one.positions[order], one.H[order], ghosts, one.ids[order])
        )
    return out


def random_culling(lists, rng, shuffled):
    keep, old2new = [], []
    for one in lists:
        mask = rng.random(one.n_nodes) < rng.choice([0.3, 0.8, 1.0])
        new = np.full(one.n_nodes, -1)
        for part in (slice(0, one.n_internal), slice(one.n_internal, None)):
            kept = np.flatnonzero(mask[part]) + (part.start or 0)
            start = 0 if part.start == 0 else mask[: one.n_internal].sum()
            numbers = np.arange(start, start + len(kept))
            new[kept] = rng.permutation(numbers) if shuffled else numbers
        keep.append(mask)
        old2new.append(new)
    return keep, old2new


def test_a_patch_by_used_drops_ghosts_that_no_node_sees():
    rng = np.random.default_rng(4)
    lists = with_ids(random_lists(rng, (40, 30), 2, size=9.0), rng)
    c = hs.Connectivity(lists)
    keep = c.used()
    assert sum(int((~mask).sum()) for mask in keep) > 0
    pairs = c.pairs.view()
    c.patch(keep)
    assert len(c.pairs) == len(pairs)
    assert_equal(c, hs.Connectivity(culled(lists, keep, [np.cumsum(m) - 1 for m in keep])))


def test_pairs_that_are_excluded_by_number_count_nowhere():
    for seed in range(8):
        rng = np.random.default_rng([seed, 3])
        lists = random_lists(rng, (9, 0, 7), 2, lattice=True)
        n = 16
        gone = {tuple(sorted(rng.choice(n, 2, replace=False).tolist())) for _ in range(20)}
        label = [(i, 0) for i in range(9)] + [(i, 2) for i in range(7)]
        rows = [(*label[b], *label[a]) if (a + b) % 2 else (*label[a], *label[b]) for a, b in gone]
        c = hs.Connectivity(lists, overlap=True, intersection=True, exclude=rows)
        nodes = Nodes(lists, gone=gone)
        check(c, nodes)
        masked = hs.Connectivity(lists, ghosts=True)
        mask = np.zeros(len(masked.pairs), bool)
        for row in rows:
            try:
                mask[masked.pairs.index(row)] = True
            except KeyError:
                continue
        masked.remove(mask)
        check(masked, nodes, ghosts=True)


def test_removing_twice_does_not_bring_back_what_was_removed():
    """Nodes 0 and 1 overlap through node 2 as well, whatever else is removed later."""
    lists = [hs.NodeList("a", [[0.0], [1.0], [0.5], [9.0], [9.5]], [0.5] * 5)]
    c = hs.Connectivity(lists, overlap=True)
    c.remove(lambda i, a, j, b: (i == 0) & (j == 1))
    assert c.overlap(0, 0)[0].tolist() == [2]
    c.remove(lambda i, a, j, b: (i == 3) & (j == 4))
    assert c.overlap(0, 0)[0].tolist() == [2]
    c.patch([[True, True, True, False, True]])
    assert c.overlap(0, 0)[0].tolist() == [2]
    assert c.overlap(0, 1)[0].tolist() == [2]


def test_every_access_to_an_old_field_is_stale():
    lists = [hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3)]
    accesses = (
        lambda f: f[0], lambda f: f[(0, 0, 1, 0)], lambda f: f.values, lambda f: f.pairs,
        lambda f: len(f), lambda f: list(f), lambda f: f.zero(), lambda f: f.copy(),
        lambda f: f.__setitem__(0, 1.0), lambda f: f[:], lambda f: f[-1],
    )  # fmt: skip
    changes = (
        lambda c: c.rebuild(lists), lambda c: c.patch([[True] * 3]),
        lambda c: c.remove(np.zeros(2, bool)),
    )  # fmt: skip
    for change in changes:
        c = hs.Connectivity(lists)
        old = c.pairs
        field = hs.PairField(old, n_elements=1)
        wide = hs.PairField(old, np.float32, 3)
        assert wide.values.shape == (2, 3)
        change(c)
        for access in accesses:
            for one in (field, wide):
                with pytest.raises(hs.StaleError, match="PairField"):
                    access(one)
        with pytest.raises(hs.StaleError):
            hs.PairField(old)
        assert "no more" in repr(field)
        hs.PairField(c.pairs)[0] = 2.0
        change(c)
        with pytest.raises(hs.StaleError):
            _ = field[0]


class Machine(RuleBasedStateMachine):
    """Any sequence of changes leaves what a build from nothing gives, and no field alive."""

    @initialize(seed=st.integers(0, 2**32 - 1))
    def begin(self, seed):
        self.rng = np.random.default_rng(seed)
        self.options = random_options(self.rng)
        self.cut = []
        self.lists = self._lists()
        self.c = hs.Connectivity(self.lists, **self.options)
        self.fields = []

    def _lists(self):
        lists = random_lists(self.rng, self.rng.integers(0, 9, 2), 2, lattice=True, size=3.0)
        return with_ids(lists, self.rng)

    def _changed(self):
        for field in self.fields:
            with pytest.raises(hs.StaleError):
                _ = field[0]

    @rule()
    def field(self):
        field = hs.PairField(self.c.pairs)
        field.values[:] = np.arange(len(field))
        for k in range(min(len(field), 3)):
            i, a, j, b = self.c.pairs[k]
            assert field[j, b, i, a] == k
        self.fields.append(field)

    @rule()
    def rebuild(self):
        self.lists, self.cut = self._lists(), []
        self.c.rebuild(self.lists)
        self._changed()

    @rule(shuffled=st.booleans())
    def patch(self, shuffled):
        keep, old2new = random_culling(self.lists, self.rng, shuffled)
        self.lists = culled(self.lists, keep, old2new)
        self.c.patch(keep, old2new)
        self._changed()

    @rule(key=st.integers(0, 6))
    def remove(self, key):
        ids = [one.ids for one in self.lists]
        self.cut.append(key)
        self.c.remove(self._predicate([key], ids))
        self._changed()

    @staticmethod
    def _predicate(cut, ids):
        every = np.concatenate(ids)
        first = np.concatenate(([0], np.cumsum([len(one) for one in ids])))

        def gone(i_node, i_list, j_node, j_list):
            total = every[first[i_list] + i_node] + every[first[j_list] + j_node]
            return np.isin(total % 7, cut)

        return gone

    @invariant()
    def equals_a_build(self):
        exclude = self._predicate(self.cut, [one.ids for one in self.lists])
        assert_equal(self.c, hs.Connectivity(self.lists, exclude=exclude, **self.options))


TestMachine = Machine.TestCase
TestMachine.settings = settings(max_examples=40, stateful_step_count=8, deadline=None)
