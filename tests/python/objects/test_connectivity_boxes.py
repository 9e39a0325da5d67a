# SPDX-License-Identifier: BSD-3-Clause
"""Connectivity by every rule and extent, in open space and in boxes that repeat: every image of
every node, in fractions."""

from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from rational_images import Images, between, dot, exact


class Scene:
    """Node lists in a random box, and the (i, j, S) that are neighbours, over all nodes."""

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
        self.images = Images(dim, self.box, self.periodic)
        self.points = [exact(row) for row in self.x]
        self.gather = self._gather()

    def _matrices(self, scale):
        H = np.empty((len(self.h), self.dim, self.dim))
        self.h = np.maximum(self.h, 0.01 * scale)  # the longest half axis, over the extent
        for one, h in zip(H, self.h):
            turn = np.linalg.qr(self.rng.standard_normal((self.dim, self.dim)))[0]
            one[:] = turn @ np.diag(np.exp(3.0 * self.rng.random(self.dim)) / h) @ turn.T
            one[:] = (one + one.T) / 2.0
        return H

    def _gather(self):
        """All (i, j, S) such that j is in the support of i, and not i itself."""
        found = set()
        for i, (which, _) in enumerate(self.labels):
            extent = Fraction(float(self.extents[which]))
            farthest = Fraction(1001, 1000) * extent * Fraction(float(self.h[i]))
            for j in range(len(self.labels)):
                apart = between(self.points[i], self.points[j])
                for S, D, square in self.images.within(apart, farthest**2):
                    if self.H.ndim == 1:
                        is_within = square <= (extent * Fraction(float(self.h[i]))) ** 2
                    else:
                        is_within = sum(dot(exact(row), D) ** 2 for row in self.H[i]) <= extent**2
                    if is_within and (i != j or any(S)):
                        found.add((i, j, S))
        return found

    def neighbors(self, rule):
        turned = {(j, i, tuple(-s for s in S)) for i, j, S in self.gather}
        return {
            "max": self.gather | turned, "min": self.gather & turned, "gather": self.gather,
            "scatter": turned,
        }[rule]  # fmt: skip

    def build(self, **how):
        options = {"box": self.box, "periodic": self.periodic} if self.periodic.any() else {}
        return hs.Connectivity(self.lists, self.extents, **options, **how)

    def rows(self, offsets, indices, shifts, n_rows):
        """Entries of rows as (j, S), each list after the other."""
        for r in range(n_rows):
            row = []
            for m in range(3):
                for e in range(offsets[3 * r + m], offsets[3 * r + m + 1]):
                    S = (0,) * self.dim if shifts is None else tuple(shifts[e].tolist())
                    row.append((self.labels.index((m, int(indices[e]))), S))
            yield row

    def number(self, pair):
        return [self.labels.index((a, i)) for i, a in (pair[:2], pair[2:])]


def shifts_of(owner, name="shifts"):
    try:
        return getattr(owner, name)
    except AttributeError:
        return None


@pytest.mark.parametrize("rule", ["max", "min", "gather", "scatter"])
@pytest.mark.parametrize("is_open", [False, True], ids=["box", "open"])
def test_rows_and_pairs_have_every_image(rule, is_open):
    for seed in range(18):
        ghosts, order = bool(seed % 2), "morton" if seed % 3 == 0 else "index"
        scene = Scene(seed, is_open)
        c = scene.build(rule=rule, ghosts=ghosts, order=order)
        c.validate()
        near, ghost = scene.neighbors(rule), scene.ghost
        owners = [k for k in range(len(ghost)) if ghosts or order == "morton" or not ghost[k]]
        rows = scene.rows(c.offsets, c.indices, shifts_of(c), len(owners))
        for i, row in zip(owners, rows, strict=True):
            want = sorted((j, S) for k, j, S in near if k == i)
            assert sorted(row) == want
            assert order == "morton" or row == want
        shifts = shifts_of(c.pairs)
        pairs = [
            (*scene.number(p), (0,) * scene.dim if shifts is None else tuple(shifts[k].tolist()))
            for k, p in enumerate(c.pairs)
        ]
        want = set()
        for i, j, S in near:
            one, other = (ghost[i], i), (ghost[j], j)  # an internal node comes before a ghost
            is_first = one < other or (i == j and S > (0,) * scene.dim)
            if (rule in ("gather", "scatter") or is_first) and (ghosts or not ghost[i]):
                want.add((i, j, S))
        assert len(pairs) == len(want)
        if order == "index" or rule in ("gather", "scatter"):
            assert set(pairs) == want
            assert order == "morton" or rule == "max" or pairs == sorted(pairs) or any(ghost)
        for k, pair in enumerate(c.pairs):
            shift = None if shifts is None else shifts[k]
            assert c.pairs.index(pair, shift) == k
            if rule in ("max", "min"):
                turned = (*pair[2:], *pair[:2])
                assert c.pairs.index(turned, None if shift is None else -shift) == k


def test_overlap_and_intersection_have_every_image():
    seen = 0
    for seed in range(40):
        is_open = seed % 5 == 4
        scene = Scene(seed, is_open)
        rule = "min" if seed % 3 == 0 else "max"
        order = "morton" if seed % 4 == 0 else "index"
        c = scene.build(
            rule=rule, overlap=True, intersection=True, order=order, ghosts=seed % 2 == 0
        )
        c.validate()
        near, n = scene.neighbors(rule), len(scene.labels)
        zero = (0,) * scene.dim
        reached = [{(k, T) for i, k, T in scene.gather if i == a} | {(a, zero)} for a in range(n)]
        overlaps = scene.rows(
            c.overlap_offsets, c.overlap_indices, shifts_of(c, "overlap_shifts"), n
        )
        for i, row in enumerate(overlaps):
            want = {
                (j, tuple(t - u for t, u in zip(T, U)))
                for k, T in reached[i] for j in range(n) for m, U in reached[j] if m == k
            } - {(i, zero)}
            assert len(row) == len(want) and set(row) == want
            assert order == "morton" or row == sorted(row)
        sets = scene.rows(
            c.intersection_offsets, c.intersection_indices, shifts_of(c, "intersection_shifts"),
            len(c.pairs),
        )
        rows = [[(k, T) for i, k, T in near if i == a] for a in range(n)]
        for k, found in enumerate(sets):
            i, j = scene.number(c.pairs[k])
            S = zero if is_open else tuple(c.pairs.shifts[k].tolist())
            from_j = {(m, tuple(u + s for u, s in zip(U, S))) for m, U in rows[j]}
            want = [
                (m, T) for m, T in rows[i] if (m, T) in from_j and _is_between(scene, i, j, S, m, T)
            ]
            assert sorted(found) == sorted([*want, (i, zero), (j, S)])
            lists = [[e for e in found if scene.labels[e[0]][0] == m] for m in range(3)]
            for m, ends in enumerate(lists):
                own = [e for e in ((i, zero), (j, S)) if scene.labels[e[0]][0] == m]
                assert ends[len(ends) - len(own) :] == own
                between_them = ends[: len(ends) - len(own)]
                assert order == "morton" or between_them == sorted(between_them)
            seen += len(want)
    assert seen > 300


def _is_between(scene, i, j, S, k, T):
    p = scene.points[i]
    q, x = (
        [a + sum(s * row[axis] for s, row in zip(shift, _rows(scene)))
         for axis, a in enumerate(scene.points[node])]
        for node, shift in ((j, S), (k, T))
    )  # fmt: skip
    along, whole = dot(between(p, x), between(p, q)), between(p, q)
    return 0 <= along <= dot(whole, whole)


def _rows(scene):
    return [exact(row) for row in scene.box]


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
    shifts = shifts_of(c.pairs)
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
    for one, want in zip(c.pairs._all(), other.pairs._all(), strict=True):
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
