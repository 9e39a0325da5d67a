# SPDX-License-Identifier: BSD-3-Clause
"""A reach for each pair, in boxes of any shape and at any scale, against every image in fractions:
whatever algorithm and kernel, in rows, pairs, counts and blocks."""

import math
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from oracles import triples
from rational_images import Images, between, dot, exact

ALGORITHMS = ["auto", "all-pairs", "grid", "hash", "hierarchy"]


class Scene:
    """Points, arguments, and every (i, j, S) that counts."""

    def __init__(self, seed, form):
        rng = self.rng = np.random.default_rng(seed)
        self.form, self.inclusive = form, bool(rng.integers(2))
        dim = self.dim = int(rng.choice([1, 2, 3]))
        widest = {"radii": 950, "types": 400, "supports": 400}[form]
        self.scale = math.ldexp(float(rng.choice([1.0, 1 / 3])), int(rng.integers(-1, 2)) * widest)
        self._box()
        x = rng.integers(-8, 9, (int(rng.integers(2, 14)), dim)) / rng.choice([1.0, 4.0, 10.0])
        x = np.where(rng.random(x.shape) < 0.2, np.nextafter(x, 9.0), x)
        self.points = np.append(x, x[:1], axis=0) * self.scale  # two that coincide
        getattr(self, f"_{form}")()

    def _box(self):
        rng, dim = self.rng, self.dim
        self.geometry = {}
        if rng.random() < 0.3:
            return
        rows = np.diag(rng.choice([0.75, 1.0, 2.0], dim))
        rows += np.tril(rng.choice([0.0, 0.25, -0.5, 3.0], (dim, dim)), -1)
        if dim > 1:
            rows[0] += rng.choice([0.0, 5.0, -30.0, 300.0]) * rows[1]
        rows = -rows[rng.permutation(dim)]
        periodic = rng.random(dim) < 0.8
        rows[~periodic] = 0.0
        self.geometry = {"box": rows * self.scale, "periodic": periodic}

    def _radii(self):
        rng, n = self.rng, len(self.points)
        rule = str(rng.choice(["sum", "mean", "max", "min", "gather", "scatter"]))
        r = rng.choice([0.0, 0.1, 0.2, 0.25, 0.3, 0.5, math.sqrt(0.5)], n)
        r = np.where(rng.random(n) < 0.3, r * 10.0 ** -rng.integers(1, 7, n), r) * self.scale
        R = exact(r)
        reach = {
            "sum": lambda i, j: R[i] + R[j], "mean": lambda i, j: (R[i] + R[j]) / 2,
            "max": lambda i, j: max(R[i], R[j]), "min": lambda i, j: min(R[i], R[j]),
            "gather": lambda i, j: R[i], "scatter": lambda i, j: R[j],
        }[rule]  # fmt: skip
        self.rule, self.cutoff, self.how = rule, None, {"radii": r, "rule": rule}
        self.within = lambda i, j: (reach(i, j), None)

    def _types(self):
        rng, n = self.rng, len(self.points)
        kinds = int(rng.integers(1, 5))
        table = rng.choice([0.0, 1e-3, 0.25, 0.6, 1.0, math.sqrt(2)], (kinds, kinds)) * self.scale
        table = np.maximum(table, table.T)
        types = rng.integers(0, kinds, n)
        self.rule, self.cutoff, self.how = "sum", table, {"types": types}
        self.within = lambda i, j: (Fraction(float(table[types[i], types[j]])), None)

    def _supports(self):
        rng, n, dim = self.rng, len(self.points), self.dim
        extent, thin = float(rng.choice([0.5, 1.0, 1 / 3])), float(rng.choice([1.0, 100.0, 1e6]))
        H = np.empty((n, dim, dim))
        for one in H:
            half_axes = 0.6 * thin ** -rng.random(dim)
            turn = np.linalg.qr(rng.standard_normal((dim, dim)))[0]
            turn = turn if rng.integers(2) else np.eye(dim)
            one[:] = turn @ np.diag(extent / half_axes) @ turn.T
            one[:] = (one + one.T) / 2.0
        H /= self.scale
        rows = [[exact(row) for row in one] for one in H]
        farthest = Fraction(0.7 * self.scale)  # beyond the longest half axis, as rounded
        rule = str(rng.choice(["max", "min", "gather", "scatter"]))

        def reaches(i, D):
            square = sum(dot(row, D) ** 2 for row in rows[i])
            return square < Fraction(extent) ** 2 or (
                self.inclusive and square == Fraction(extent) ** 2
            )

        inside = {
            "max": lambda i, j, D: reaches(i, D) or reaches(j, D),
            "min": lambda i, j, D: reaches(i, D) and reaches(j, D),
            "gather": lambda i, j, D: reaches(i, D), "scatter": lambda i, j, D: reaches(j, D),
        }[rule]  # fmt: skip
        self.rule, self.cutoff = rule, None
        self.how = {"supports": H, "rule": rule, "extent": extent}
        self.within = lambda i, j: (farthest, lambda D: inside(i, j, D))

    def expected(self):
        images = Images(self.dim, **self.geometry)
        x = [exact(row) for row in self.points]
        found = set()
        for i in range(len(x)):
            for j in range(len(x)):
                reach, inside = self.within(i, j)
                for S, D, _ in images.within(between(x[i], x[j]), reach**2, self.inclusive):
                    if (i != j or any(S)) and (inside is None or inside(D)):
                        found.add((i, j, S))
        return found

    def ask(self, function, *rest, **more):
        rng = self.rng
        how = {
            **self.how, **self.geometry, "inclusive": self.inclusive,
            "algorithm": str(rng.choice(ALGORITHMS)), "kernel": str(rng.choice(hs.kernels())),
            "threads": int(rng.integers(1, 3)), **more,
        }  # fmt: skip
        return function(self.points, self.cutoff, *rest, **how)


@pytest.mark.parametrize("form", ["radii", "types", "supports"])
@pytest.mark.parametrize("seeds", [range(12), range(12, 25)], ids=str)
def test_every_function_has_every_image(form, seeds):
    for seed in seeds:
        check(Scene(seed, form))


def check(scene):
    full = scene.expected()
    table = scene.ask(hs.neighbors, quantities="jS")
    i = np.repeat(np.arange(len(scene.points)), table.counts)
    assert triples(i, table.indices, table.shifts) == sorted(full)
    counts = np.bincount([i for i, _, _ in full], minlength=len(scene.points))
    assert scene.ask(hs.coordination).tolist() == counts.tolist()
    given = {**scene.how, **scene.geometry, "inclusive": scene.inclusive}
    if scene.rule in ("gather", "scatter"):
        with pytest.raises(ValueError, match="neighbors"):
            scene.ask(hs.pairs)
        args = (i, table.indices, table.shifts)
        assert hs.verify(scene.points, scene.cutoff, *args, **given).ok
        return
    half = {(i, j, S) for i, j, S in full if i < j or (i == j and S > (0,) * scene.dim)}
    i, j, S = scene.ask(hs.pairs, quantities="ijS", sort=True)
    assert triples(i, j, S) == sorted(half)
    assert scene.ask(hs.count_pairs) == len(half)
    blocks = scene.ask(hs.iter_pairs, quantities="ijS", max_pairs=7)
    found = [pair for block in blocks for pair in triples(*block)]
    assert len(found) == len(half) and set(found) == half
    assert hs.verify(scene.points, scene.cutoff, i, j, S, **given).ok
    if half:
        assert not hs.verify(scene.points, scene.cutoff, i[1:], j[1:], S[1:], **given).ok
