# SPDX-License-Identifier: BSD-3-Clause
"""What a connectivity must be, straight from the definitions: every node against every other.

Distances are compared in float64 where that is far from a tie, and else as fractions.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

import halfshell as hs
from oracles import whole


def _is_within(p, q, h, extent):
    apart = [Fraction(float(a)) - Fraction(float(b)) for a, b in zip(p, q, strict=True)]
    if np.ndim(h) == 0:
        reach = Fraction(float(extent)) * Fraction(float(h))
        return sum(a * a for a in apart) <= reach * reach
    rows = [sum(Fraction(float(a)) * b for a, b in zip(row, apart, strict=True)) for row in h]
    return sum(a * a for a in rows) <= Fraction(float(extent)) ** 2


def gather_rows(x, y, h, extent):
    """Whether the support of each of x, by its h, reaches each of y."""
    with np.errstate(over="ignore"):
        if h.ndim == 1:
            squares = sum((x[:, k, None] - y[None, :, k]) ** 2 for k in range(x.shape[1]))
            limits, width = ((extent * h) ** 2)[:, None], 1e-12
        else:
            axes = range(x.shape[1])
            apart = [x[:, k, None] - y[None, :, k] for k in axes]
            squares = sum(
                sum(h[:, a, b, None] * apart[b] for b in axes) ** 2 for a in axes
            )
            limits = np.full((len(x), 1), extent**2)
            width = 1e-13 * np.linalg.cond(h)[:, None] + 1e-12
    found = squares <= limits
    near = np.abs(squares - limits) <= width * np.maximum(limits, squares)
    near |= (limits < 1e-280) | ~np.isfinite(squares)
    for i, j in np.argwhere(near):
        found[i, j] = _is_within(x[i], y[j], h[i], extent)
    return found


def gather_matrix(x, h, extent):
    """Whether node i's own support reaches node j, the diagonal left out."""
    found = np.zeros((len(x), len(x)), bool)
    if len(x):
        found[:] = gather_rows(x, x, h, extent)
    np.fill_diagonal(found, False)
    return found


def foot_is_between(x, p, q):
    """Of points in whole numbers."""
    along = sum((a - b) * (c - b) for a, b, c in zip(x, p, q, strict=True))
    return 0 <= along <= sum((c - b) ** 2 for b, c in zip(p, q, strict=True))


class Expected:
    """Rows, pairs, overlap and intersection of node lists, in index order."""

    def __init__(self, lists, extent=2.0, ghosts=False, gone=()):
        self.lists = lists
        d = max((one.positions.shape[1] for one in lists if one.n_nodes), default=1)
        points = [one.positions.reshape(-1, d) for one in lists]
        self.x = np.concatenate(points) if points else np.empty((0, d))
        supports = [one.H for one in lists if one.n_nodes]
        self.whole = [[whole(a) for a in row] for row in self.x.tolist()]
        self.h = np.concatenate(supports) if supports else np.empty(0)
        self.labels = [(k, i) for k, one in enumerate(lists) for i in range(one.n_nodes)]
        self.ghost = [
            i >= one.n_internal for one in lists for i in range(one.n_nodes)
        ]  # fmt: skip
        self.ghosts = ghosts
        self.gather = gather_matrix(self.x, self.h, extent)
        for a, b in gone:
            self.gather[a, b] = self.gather[b, a] = False
        self.near = self.gather | self.gather.T
        self.gone = gone

    def split(self, numbers):
        """Numbers among all nodes, list by list."""
        out = [[] for _ in self.lists]
        for g in numbers:
            which, node = self.labels[g]
            out[which].append(node)
        return out

    def row(self, g):
        return self.split(np.flatnonzero(self.near[g]))

    def pairs(self):
        found = []
        for a, b in np.argwhere(np.triu(self.near)):
            if self.ghost[a] and self.ghost[b] and not self.ghosts:
                continue
            if self.ghost[a] and not self.ghost[b]:
                a, b = b, a
            found.append((self.labels[a][1], self.labels[a][0], *self.labels[b][::-1]))
        return found

    def overlap(self):
        own = (self.gather | np.eye(len(self.x), dtype=bool)).astype(np.float32)
        common = own @ own.T > 0
        np.fill_diagonal(common, False)
        for a, b in self.gone:
            common[a, b] = common[b, a] = False
        return common

    def number(self, which, node):
        return self.labels.index((which, node))

    def intersection(self, pair):
        a, b = self.number(pair[1], pair[0]), self.number(pair[3], pair[2])
        common = [
            k for k in np.flatnonzero(self.near[a] & self.near[b])
            if foot_is_between(self.whole[k], self.whole[a], self.whole[b])
        ]  # fmt: skip
        return self.split([*common, a, b])


def check(c, lists, extent=2.0, ghosts=False, gone=()):
    """Compare a connectivity in index order with the definitions."""
    want = Expected(lists, extent, ghosts, gone)
    has_rows = ghosts or "overlap" in _built(c) or "intersection" in _built(c)
    for g, (which, node) in enumerate(want.labels):
        if has_rows or not want.ghost[g]:
            assert [one.tolist() for one in c.neighbors(which, node)] == want.row(g), (which, node)
    assert [tuple(pair) for pair in c.pairs] == want.pairs()
    if "overlap" in _built(c):
        common = want.overlap()
        for g, (which, node) in enumerate(want.labels):
            got = [one.tolist() for one in c.overlap(which, node)]
            assert got == want.split(np.flatnonzero(common[g])), (which, node)
    if "intersection" in _built(c):
        for k, pair in enumerate(c.pairs):
            assert [one.tolist() for one in c.intersection(k)] == want.intersection(pair), pair
    c.validate()
    return want


def _built(c):
    found = []
    for name in ("overlap", "intersection"):
        try:
            getattr(c, f"{name}_offsets")
        except ValueError:
            continue
        found.append(name)
    return found


def random_lists(rng, counts, d, *, lattice=False, ghosts=True, h=(0.3, 1.2), size=4.0):
    """Node lists of these lengths; on a lattice many pairs are exactly at the end of a support."""
    lists = []
    for k, n in enumerate(counts):
        x = rng.integers(0, int(size) + 1, (n, d)) * 0.7 if lattice else rng.random((n, d)) * size
        supports = rng.choice([0.35, 0.7, 1.05], n) if lattice else rng.uniform(*h, n)
        n_ghost = int(rng.integers(0, n + 1)) if ghosts else 0
        lists.append(hs.NodeList(f"list {k}", x, supports, n_ghost))
    return lists
