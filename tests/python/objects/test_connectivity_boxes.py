# SPDX-License-Identifier: BSD-3-Clause
"""Connectivity in boxes that repeat: every image of every node, in fractions."""

from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from rational_images import Images, between, dot, exact


class Scene:
    """Node lists in a random box, and the (i, j, S) that are neighbours, over all nodes."""

    def __init__(self, seed):
        rng = self.rng = np.random.default_rng(seed)
        dim = self.dim = int(rng.choice([1, 2, 2, 3]))
        scale = 2.0 ** int(rng.choice([0, 0, 20, -100]))
        rows = np.diag(rng.choice([0.75, 1.0, 1.5], dim))
        rows += np.tril(rng.choice([0.0, 0.25, -0.5, 3.0], (dim, dim)), -1)
        self.periodic = rng.random(dim) < 0.8
        self.periodic[rng.integers(dim)] = True
        rows[~self.periodic] = 0.0
        self.box = rows * scale
        n = int(rng.integers(1, 13))
        x = np.where(
            rng.random((n, dim)) < 0.5, rng.integers(-8, 9, (n, dim)) / 4, rng.normal(size=(n, dim))
        )
        self.x, self.h = x * scale, rng.choice([0.0, 0.05, 0.125, 0.25, 0.35], n) * scale
        self.H = self.h if rng.integers(2) else self._matrices(scale)
        self.labels, self.ghost, self.lists, first = [], [], [], 0
        for k, count in enumerate(rng.multinomial(n, np.ones(3) / 3)):
            n_ghost = int(rng.integers(0, count + 1)) if rng.integers(2) else 0
            part = slice(first, first + count)
            self.lists.append(hs.NodeList(f"list {k}", self.x[part], self.H[part], n_ghost))
            self.labels += [(k, i) for i in range(count)]
            self.ghost += [i >= count - n_ghost for i in range(count)]
            first += count

    def _matrices(self, scale):
        H = np.empty((len(self.h), self.dim, self.dim))
        self.h = np.maximum(self.h, 0.01 * scale)  # the longest half axis, over the extent
        for one, h in zip(H, self.h):
            turn = np.linalg.qr(self.rng.standard_normal((self.dim, self.dim)))[0]
            one[:] = turn @ np.diag(np.exp(3.0 * self.rng.random(self.dim)) / h) @ turn.T
            one[:] = (one + one.T) / 2.0
        return H

    def reaches(self, i, D):
        if self.H.ndim == 1:
            return dot(D, D) <= (2 * Fraction(float(self.H[i]))) ** 2
        return sum(dot(exact(row), D) ** 2 for row in self.H[i]) <= 4

    def neighbors(self):
        images, x = Images(self.dim, self.box, self.periodic), [exact(row) for row in self.x]
        found = set()
        for i in range(len(x)):
            for j in range(len(x)):
                farthest = Fraction(201, 100) * Fraction(float(max(self.h[i], self.h[j])))
                for S, D, _ in images.within(between(x[i], x[j]), farthest**2):
                    apart = i != j or any(S)
                    if apart and (self.reaches(i, D) or self.reaches(j, D)):
                        found.add((i, j, S))
        return found


@pytest.mark.parametrize("ghosts", [False, True])
def test_rows_and_pairs_have_every_image(ghosts):
    for seed in range(20):
        scene = Scene(seed)
        c = hs.Connectivity(scene.lists, box=scene.box, periodic=scene.periodic, ghosts=ghosts)
        c.validate()
        near, labels, ghost = scene.neighbors(), scene.labels, scene.ghost
        for i, (of, node) in enumerate(labels):
            if ghost[i] and not ghosts:
                continue
            row = []
            for m in range(3):
                r = (c.row_start[of] + node) * 3 + m
                part = slice(c.offsets[r], c.offsets[r + 1])
                entries = zip(c.indices[part].tolist(), c.shifts[part].tolist())
                row += [(labels.index((m, j)), tuple(S)) for j, S in entries]
            assert row == sorted((j, S) for k, j, S in near if k == i)
        pairs = [
            (labels.index((p.i_list, p.i_node)), labels.index((p.j_list, p.j_node)), tuple(S))
            for p, S in zip(c.pairs, c.pairs.shifts.tolist())
        ]
        expected = set()
        for i, j, S in near:
            one, other = (ghost[i], i), (ghost[j], j)  # an internal node comes before a ghost
            if (one < other or (i == j and S > (0,) * scene.dim)) and (ghosts or not ghost[i]):
                expected.add((i, j, S))
        assert len(pairs) == len(expected) and set(pairs) == expected
        for k, (pair, S) in enumerate(zip(c.pairs, c.pairs.shifts)):
            assert c.pairs.index(pair, S) == c.pairs.index((*pair[2:], *pair[:2]), -S) == k


def test_a_shift_where_no_box_repeats_is_refused():
    c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0]], [1.0, 1.0])])
    with pytest.raises(ValueError, match="periodic boxes"):
        c.pairs.index((0, 0, 1, 0), [0])
