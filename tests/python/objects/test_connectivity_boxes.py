# SPDX-License-Identifier: BSD-3-Clause
"""Connectivity by every rule and extent, in open space and in boxes that repeat."""

import numpy as np
import pytest

import halfshell as hs
from node_oracle import Nodes, check, shifts_of


class Scene:
    """Node lists in a random box."""

    def __init__(self, seed, is_open=False):
        rng = self.rng = np.random.default_rng(seed)
        dim = self.dim = int(rng.choice([1, 2, 2, 3]))
        scale = 2.0 ** int(rng.choice([0, 0, 20, -100]))
        rows = np.diag(rng.choice([0.75, 1.0, 1.5], dim))
        rows += np.tril(rng.choice([0.0, 0.25, -0.5, 3.0], (dim, dim)), -1)
        self.periodic = (rng.random(dim) < 0.8) & (not is_open)
        self.periodic[rng.integers(dim)] = not is_open
        rows[~self.periodic] = 0.0
        self.box = rows * scale
        n = int(rng.integers(1, 13))
        x = np.where(
            rng.random((n, dim)) < 0.5, rng.integers(-8, 9, (n, dim)) / 4, rng.normal(size=(n, dim))
        )
        x /= 1 + 3 * is_open
        self.x, self.h = x * scale, rng.choice([0.0, 0.05, 0.125, 0.25, 0.35], n) * scale
        self.H = self.h if rng.integers(2) else self._matrices(scale)
        self.extents = rng.choice([2.0, 1.0, 0.1, 1.5], 3) if rng.integers(2) else np.full(3, 2.0)
        self.labels, self.ghost, self.lists, first = [], [], [], 0
        for k, count in enumerate(rng.multinomial(n, np.ones(3) / 3)):
            n_ghost = int(rng.integers(0, count + 1)) if rng.integers(2) else 0
            part = slice(first, first + count)
            self.lists.append(hs.NodeList(f"list {k}", self.x[part], self.H[part], n_ghost))
            self.labels += [(k, i) for i in range(count)]
            self.ghost += [i >= count - n_ghost for i in range(count)]
            first += count
        self.nodes = Nodes(self.lists, self.extents, *self.frame())

    def frame(self):
        return (self.box, self.periodic) if self.periodic.any() else (None, None)

    def _matrices(self, scale):
        H = np.empty((len(self.h), self.dim, self.dim))
        self.h = np.maximum(self.h, 0.01 * scale)  # the longest half axis, over the extent
        for one, h in zip(H, self.h):
            turn = np.linalg.qr(self.rng.standard_normal((self.dim, self.dim)))[0]
            one[:] = turn @ np.diag(np.exp(3.0 * self.rng.random(self.dim)) / h) @ turn.T
            one[:] = (one + one.T) / 2.0
        return H

    def build(self, **how):
        box, periodic = self.frame()
        return hs.Connectivity(self.lists, self.extents, box=box, periodic=periodic, **how)


@pytest.mark.parametrize("rule", ["max", "min", "gather", "scatter"])
@pytest.mark.parametrize("is_open", [False, True], ids=["box", "open"])
def test_rows_and_pairs_have_every_image(rule, is_open):
    for seed in range(18):
        ghosts, order = bool(seed % 2), "morton" if seed % 3 == 0 else "index"
        scene, how = Scene(seed, is_open), {"rule": rule, "ghosts": ghosts, "order": order}
        check(scene.build(**how), scene.nodes, **how)


def test_overlap_and_intersection_have_every_image():
    seen = 0
    for seed in range(40):
        scene = Scene(seed, is_open=seed % 5 == 4)
        how = {"rule": "min" if seed % 3 == 0 else "max", "ghosts": seed % 2 == 0,
               "order": "morton" if seed % 4 == 0 else "index"}  # fmt: skip
        c = scene.build(**how, overlap=True, intersection=True)
        seen += check(c, scene.nodes, **how)
    assert seen > 300


@pytest.mark.parametrize("rule", ["max", "min", "gather", "scatter"])
def test_changes_equal_a_build_by_every_rule(rule):
    """Patches, removals by masks and functions, with coupling, in boxes and with extents."""
    for seed in range(18):
        scene = Scene([seed, 1], is_open=seed % 5 == 0)
        rng = scene.rng
        has_parts = rule in ("max", "min")
        how = {"rule": rule, "ghosts": seed % 2 == 0, "order": ("index", "morton")[seed % 3 == 0]}
        how |= {"overlap": has_parts, "intersection": has_parts and seed % 4 == 0}
        scene.lists = [
            hs.NodeList(one.name, one.positions, one.H, one.n_ghost, ids=at + np.arange(len(one)))
            for one, at in zip(scene.lists, (0, 100, 200))
        ]  # fmt: skip
        c = scene.build(**how)
        c.pairs.coupling = np.arange(len(c.pairs))
        values = dict(zip(_named(c, scene.lists), c.pairs.coupling.tolist()))
        if has_parts:
            values |= {(j, i, tuple(-s for s in S)): value for (i, j, S), value in values.items()}
        keep = [rng.random(len(one)) < 0.7 for one in scene.lists]
        new = []
        for one, mask in zip(scene.lists, keep):
            internal = int(mask[: one.n_internal].sum())
            numbers = np.full(len(one), -1)
            numbers[: one.n_internal][mask[: one.n_internal]] = rng.permutation(internal)
            ghosts = mask[one.n_internal :]
            numbers[one.n_internal :][ghosts] = internal + rng.permutation(ghosts.sum())
            new.append(numbers)
        c.patch(keep, new if seed % 2 else None)
        left = []
        for one, mask, numbers in zip(scene.lists, keep, new):
            order = np.flatnonzero(mask)
            order = order[np.argsort(numbers[order])] if seed % 2 else order
            left.append(hs.NodeList(one.name, one.positions[order], one.H[order],
                                    int(mask[one.n_internal :].sum()), one.ids[order]))  # fmt: skip
        scene.lists = left
        other = scene.build(**how)
        _same(c, other)
        for name, value in zip(_named(c, left), c.pairs.coupling.tolist()):
            assert value == values[name]
        mask = rng.random(len(c.pairs)) < 0.4
        coupling = c.pairs.coupling[~mask]
        named = [name for name, gone in zip(_named(c, left), mask) if not gone]
        c.remove(mask)
        assert _named(c, left) == named and (c.pairs.coupling == coupling).all()
        c.validate()

        def gone(i_node, i_list, j_node, j_list):
            return (i_node + j_node + i_list * j_list) % 3 == 0

        other.remove(gone)
        scene_with = scene.build(**how, exclude=gone)
        _same(other, scene_with)


def _named(c, lists):
    """Pairs by ids, and their shifts."""
    shifts = shifts_of(c.pairs, "shifts")
    return [
        (lists[a].ids[i], lists[b].ids[j], () if shifts is None else tuple(shifts[k].tolist()))
        for k, (i, a, j, b) in enumerate(c.pairs)
    ]


def _same(c, other):
    for owner in ("", "overlap_", "intersection_"):
        for name in ("offsets", "indices", "shifts"):
            try:
                want = getattr(other, owner + name)
            except (AttributeError, ValueError):
                continue
            assert np.array_equal(getattr(c, owner + name), want), owner + name
    for one, want in zip(c.pairs._made, other.pairs._made, strict=True):
        assert one is want or np.array_equal(one, want)


def test_a_direction_has_no_overlap_and_no_intersection():
    nodes = [hs.NodeList("a", [[0.0]], [1.0])]
    for rule in ("gather", "scatter"):
        for option in ("overlap", "intersection"):
            with pytest.raises(ValueError, match=f'direction: rule="{rule}"'):
                hs.Connectivity(nodes, rule=rule, **{option: True})


def test_a_shift_where_no_box_repeats_is_refused():
    c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0]], [1.0, 1.0])])
    with pytest.raises(ValueError, match="periodic boxes"):
        c.pairs.index((0, 0, 1, 0), [0])


def test_an_intersection_in_seven_dimensions_that_repeat_is_refused():
    nodes = [hs.NodeList("a", np.zeros((1, 7)), [1.0])]
    with pytest.raises(ValueError, match="at most 6 dimensions"):
        hs.Connectivity(nodes, box=9.0, intersection=True)
    hs.Connectivity(nodes, box=9.0, overlap=True)
