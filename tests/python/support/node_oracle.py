# SPDX-License-Identifier: BSD-3-Clause
"""What a connectivity must be, straight from the definitions: every image of every node, in
fractions.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

import halfshell as hs
from rational_images import Images, between, dot, exact


def turned(S):
    return tuple(-s for s in S)


class Nodes:
    """Node lists, and the (i, j, S) such that j is in the support of i, over all nodes.

    `gone`: pairs of numbers that count nowhere.
    """

    def __init__(self, lists, extent=2.0, box=None, periodic=None, gone=()):
        self.lists, self.gone = lists, gone
        self.dim = max((one.positions.shape[1] for one in lists if len(one)), default=1)
        self.labels = [(k, i) for k, one in enumerate(lists) for i in range(len(one))]
        self.ghost = [i >= lists[k].n_internal for k, i in self.labels]
        self.images = Images(self.dim, box, periodic)
        self.points = [exact(lists[k].positions[i]) for k, i in self.labels]
        self.zero = (0,) * self.dim
        extents = [exact(np.broadcast_to(extent, len(lists)))[k] for k, _ in self.labels]
        self.gather = {
            (i, j, S)
            for i, (k, n) in enumerate(self.labels)
            for j, S in self._within(i, lists[k].H[n], extents[i])
            if (i, j) not in gone and (j, i) not in gone and (i != j or any(S))
        }

    def _within(self, i, h, extent):
        round_ = np.ndim(h) == 0
        farthest = extent * Fraction(float(h)) if round_ else extent / Fraction(
            0.99 * float(np.linalg.eigvalsh(h)[0])
        )
        rows = None if round_ else [exact(row) for row in h]
        for j, q in enumerate(self.points):
            for S, D, _ in self.images.within(between(self.points[i], q), farthest**2):
                if round_ or sum(dot(row, D) ** 2 for row in rows) <= extent**2:
                    yield j, S

    def neighbors(self, rule):
        other = {(j, i, turned(S)) for i, j, S in self.gather}
        return {
            "max": self.gather | other, "min": self.gather & other, "gather": self.gather,
            "scatter": other,
        }[rule]  # fmt: skip

    def split(self, row):
        """Entries (j, S) of a row, list by list."""
        return [[one for one in row if self.labels[one[0]][0] == k] for k in range(len(self.lists))]

    def rows(self, c, part, n_rows):
        """Rows of entries (j, S) that were found, list by list."""
        offsets, indices = getattr(c, part + "offsets"), getattr(c, part + "indices")
        shifts, n_lists = shifts_of(c, part + "shifts"), len(self.lists)
        assert len(offsets) == n_rows * n_lists + 1
        first = np.cumsum([0, *map(len, self.lists)])
        for r in range(n_rows):
            yield [
                [(first[m] + indices[e], self.zero if shifts is None else tuple(shifts[e].tolist()))
                 for e in range(offsets[r * n_lists + m], offsets[r * n_lists + m + 1])]
                for m in range(n_lists)
            ]  # fmt: skip

    def number(self, which, node):
        return self.labels.index((which, node))

    def pairs(self, c):
        """(i, j, S) of each pair that was found."""
        shifts = shifts_of(c.pairs, "shifts")
        return [
            (self.number(a, i), self.number(b, j),
             self.zero if shifts is None else tuple(shifts[k].tolist()))
            for k, (i, a, j, b) in enumerate(c.pairs)
        ]  # fmt: skip

    def place(self, node, S):
        """Where an image is."""
        moves = [S[axis] for axis in self.images.axes]
        return [
            a + sum(s * row[k] for s, row in zip(moves, self.images.rows))
            for k, a in enumerate(self.points[node])
        ]

    def is_between(self, i, j, S, k, T):
        """Whether the foot of an image of k on the line from i to that of j is between them."""
        whole = between(self.points[i], self.place(j, S))
        return 0 <= dot(between(self.points[i], self.place(k, T)), whole) <= dot(whole, whole)


def shifts_of(owner, name):
    try:
        return getattr(owner, name)
    except AttributeError:
        return None


def is_built(c, part):
    try:
        getattr(c, part + "offsets")
    except ValueError:
        return False
    return True


def check(c, nodes, rule="max", ghosts=False, order="index"):
    """Compare a connectivity with the definitions: rows, pairs, and what else was built."""
    near, n, seen = nodes.neighbors(rule), len(nodes.labels), 0
    in_order = order == "index"
    rows = [sorted((j, S) for k, j, S in near if k == i) for i in range(n)]
    has_all = ghosts or not in_order or is_built(c, "overlap_") or is_built(c, "intersection_")
    owners = [k for k in range(n) if has_all or not nodes.ghost[k]]
    for i, row in zip(owners, nodes.rows(c, "", len(owners)), strict=True):
        want = nodes.split(rows[i])
        assert [sorted(one) for one in row] == want and (not in_order or row == want)
        found = [one.tolist() for one in c.neighbors(*nodes.labels[i])]
        assert found == [[nodes.labels[j][1] for j, _ in one] for one in row]
    pairs = nodes.pairs(c)
    directed, want = rule in ("gather", "scatter"), set()
    for i, j, S in near:
        one, other = (nodes.ghost[i], i), (nodes.ghost[j], j)  # an internal node before a ghost
        is_first = one < other or (i == j and S > nodes.zero)
        if (directed or is_first) and (ghosts or not nodes.ghost[i]):
            want.add((i, j, S))
    assert len(pairs) == len(want)
    if in_order or directed:
        assert set(pairs) == want
    if in_order and (rule != "max" or not nodes.images.axes):
        low_first = [(*sorted(pair[:2]), pair[2]) if rule == "max" else pair for pair in pairs]
        assert low_first == sorted(low_first) or (rule != "max" and any(nodes.ghost))
    for k, pair in enumerate(c.pairs):
        shift = None if not nodes.images.axes else c.pairs.shifts[k]
        assert c.pairs.index(pair, shift) == k
        if not directed:
            assert c.pairs.index((*pair[2:], *pair[:2]), None if shift is None else -shift) == k
    if is_built(c, "overlap_"):
        _check_overlap(c, nodes, in_order)
    if is_built(c, "intersection_"):
        for (i, j, S), found in zip(
            pairs, nodes.rows(c, "intersection_", len(pairs)), strict=True
        ):
            from_j = {(m, tuple(u + s for u, s in zip(U, S))) for m, U in rows[j]}
            want = [(m, T) for m, T in rows[i] if (m, T) in from_j
                    and nodes.is_between(i, j, S, m, T)]  # fmt: skip
            ends, seen = nodes.split([(i, nodes.zero), (j, S)]), seen + len(want)
            for row, right, own in zip(found, nodes.split(want), ends, strict=True):
                assert row[len(right) :] == own and sorted(row[: len(right)]) == right
                assert not in_order or row[: len(right)] == right
    c.validate()
    return seen


def _check_overlap(c, nodes, in_order):
    n = len(nodes.labels)
    reached = [{(k, T) for i, k, T in nodes.gather if i == a} | {(a, nodes.zero)} for a in range(n)]
    by = [{m: [U for k, U in reached[j] if k == m] for m in range(n)} for j in range(n)]
    for i, row in enumerate(nodes.rows(c, "overlap_", n)):
        want = {
            (j, tuple(t - u for t, u in zip(T, U)))
            for k, T in reached[i] for j in range(n) for U in by[j][k]
            if (i, j) not in nodes.gone and (j, i) not in nodes.gone
        } - {(i, nodes.zero)}  # fmt: skip
        want = nodes.split(sorted(want))
        assert [sorted(one) for one in row] == want and (not in_order or row == want)
        found = [one.tolist() for one in c.overlap(*nodes.labels[i])]
        assert found == [[nodes.labels[j][1] for j, _ in one] for one in row]


def random_lists(rng, counts, d, *, lattice=False, ghosts=True, h=(0.3, 1.2), size=4.0):
    """Node lists of these lengths; on a lattice many pairs are exactly at the end of a support."""
    lists = []
    for k, n in enumerate(counts):
        x = rng.integers(0, int(size) + 1, (n, d)) * 0.7 if lattice else rng.random((n, d)) * size
        supports = rng.choice([0.35, 0.7, 1.05], n) if lattice else rng.uniform(*h, n)
        n_ghost = int(rng.integers(0, n + 1)) if ghosts else 0
        lists.append(hs.NodeList(f"list {k}", x, supports, n_ghost))
    return lists
