# SPDX-License-Identifier: BSD-3-Clause
"""Scenes made to break a reach for each pair, against rational arithmetic of their own.

The brute force here shares nothing with that of `verify` or of the other tests: all numbers become
integers of one unit, shifts are bounded by an exact inverse of the Gram matrix, and a pair counts
by integers. Scenes are small and hostile: scales at both ends of float64, ties of rounded sums,
images of tiny boxes, and arrays that change while they are read.
"""

import itertools
import math
import threading
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs

RULES = ("sum", "mean", "max", "min", "gather", "scatter")
DIRECTED = ("gather", "scatter")


def inverse(matrix):
    """Of a matrix of integers, exactly."""
    m = len(matrix)
    rows = [
        [*map(Fraction, r), *(Fraction(k == c) for c in range(m))] for k, r in enumerate(matrix)
    ]
    for c in range(m):
        pivot = next(r for r in range(c, m) if rows[r][c])
        rows[c], rows[pivot] = rows[pivot], rows[c]
        rows[c] = [x / rows[c][c] for x in rows[c]]
        for r in range(m):
            if r != c:
                rows[r] = [x - rows[r][c] * y for x, y in zip(rows[r], rows[c], strict=True)]
    return [r[m:] for r in rows]


def shifts_within(offset, reach, edges):
    """All integer rows that may bring `offset` within `reach`, all of them integers of one unit."""
    if not edges:
        return [()]
    gram = [[sum(x * y for x, y in zip(a, b, strict=True)) for b in edges] for a in edges]
    inv = inverse(gram)
    along = [sum(x * y for x, y in zip(a, offset, strict=True)) for a in edges]
    ranges = []
    for k, row in enumerate(inv):
        centre = -sum(x * y for x, y in zip(row, along, strict=True))
        square = reach * reach * row[k]
        width = Fraction(math.isqrt(math.floor(square * 2**40)) + 1, 2**20)
        ranges.append(range(math.ceil(centre - width), math.floor(centre + width) + 1))
    return itertools.product(*ranges)


def full_list(points, radii, rule, box=None, periodic=None, cutoff=None, inclusive=True):
    """The set of (i, j, S), both ways."""
    points, dim = np.asarray(points), np.shape(points)[1]
    numbers = [*points.ravel(), *radii, *([] if box is None else np.ravel(box))]
    bits = max(float(x).as_integer_ratio()[1].bit_length() for x in numbers + [cutoff or 0.0])

    def whole(x):
        return int(Fraction(float(x)) * 2 ** (bits + 1))

    P, r = [[whole(x) for x in p] for p in points], [whole(x) for x in radii]
    axes = [] if box is None else [k for k in range(dim) if periodic is None or periodic[k]]
    edges = [[whole(x) for x in np.asarray(box)[k]] for k in axes]
    found = set()
    for i, j in itertools.product(range(len(P)), repeat=2):
        reach = {
            "sum": r[i] + r[j], "mean": (r[i] + r[j]) // 2, "max": max(r[i], r[j]),
            "min": min(r[i], r[j]), "gather": r[i], "scatter": r[j],
        }[rule]  # fmt: skip
        reach = reach if cutoff is None else min(reach, whole(cutoff))
        offset = [b - a for a, b in zip(P[i], P[j], strict=True)]
        for shift in shifts_within(offset, reach, edges):
            S = [0] * dim
            for k, s in zip(axes, shift, strict=True):
                S[k] = s
            D = [x + sum(s * e[k] for s, e in zip(shift, edges, strict=True))
                 for k, x in enumerate(offset)]  # fmt: skip
            excess = sum(x * x for x in D) - reach * reach
            if (excess < 0 or (inclusive and excess == 0)) and (i != j or any(S)):
                found.add((i, j, tuple(S)))
    return found


def half(full):
    return {(i, j, S) for i, j, S in full if i < j or (i == j and next(filter(None, S)) > 0)}


def keys(i, j, S):
    return list(zip(i.tolist(), j.tolist(), map(tuple, S.tolist()), strict=True))


def check(points, radii, rule, cutoff=None, **scene):
    """That rows, pairs and counts are those of the brute force; returns their number."""
    want = full_list(points, radii, rule, cutoff=cutoff, **scene)
    given = {"radii": radii, "rule": rule, **scene}
    table = hs.neighbors(points, cutoff, quantities="jdDS", **given)
    rows = np.repeat(np.arange(len(points)), table.counts)
    assert keys(rows, table.indices, table.shifts) == sorted(want)
    assert (hs.coordination(points, cutoff, **given) == table.counts).all()
    if rule in DIRECTED:
        return len(want)
    first = hs.pairs(points, cutoff, quantities="ijSd", threads=1, **given)
    found = keys(*first[:3])
    assert len(found) == len(set(found))
    assert set(found) == half(want)
    for kernel in hs.kernels():
        again = hs.pairs(points, cutoff, quantities="ijSd", threads=2, kernel=kernel, **given)
        assert all(a.tobytes() == b.tobytes() for a, b in zip(first, again, strict=True))
    assert hs.count_pairs(points, cutoff, **given) == len(found)
    assert hs.verify(points, cutoff, *first[:3], **given)
    if rule == "sum" and scene.get("inclusive", True):
        r = np.asarray(radii, dtype=np.float64)
        assert (first[3] <= r[first[0]] + r[first[1]]).all()
    return len(want)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("exponent", [-1074, -1022, -540, 500, 1019])
def test_scales_at_both_ends_of_float64(rule, exponent):
    rng = np.random.default_rng(exponent + 2000)
    for dim in (1, 2, 5):
        points = np.ldexp(rng.integers(-4, 5, (16, dim)).astype(float), exponent)
        radii = np.ldexp(rng.integers(0, 3, 16).astype(float), exponent)
        if rule == "mean":
            radii = np.where(radii < 2.0**-1021, 0.0, radii)
        for inclusive in (True, False):
            check(points, radii, rule, inclusive=inclusive)
        box, first = np.diag(np.full(dim, np.ldexp(8.0, exponent))), np.arange(dim) == 0
        check(points[:8], radii[:8], rule, box=box, periodic=first.tolist())


@pytest.mark.parametrize("rule", RULES)
def test_radii_of_six_hundred_decades(rule):
    rng = np.random.default_rng(7)
    radii = 10.0 ** rng.uniform(-300, 300, 24)
    points = np.zeros((24, 3))
    points[:, 0] = radii * rng.choice([0, 0.5, 1, 2], 24)
    points[:, 1] = 10.0 ** rng.uniform(-320, 300, 24)
    points[::2] = points[1::2]
    assert check(points, radii, rule) > 0
    check(points, radii, rule, cutoff=1e-5, inclusive=False)


def test_sums_that_float64_rounds_either_way():
    rng = np.random.default_rng(3)
    ways = set()
    for _ in range(40):
        a, b = rng.random() * 2.0 ** rng.integers(-40, 1), rng.random()
        exact = Fraction(a) + Fraction(b)
        for x in (math.nextafter(a + b, 0), a + b, math.nextafter(a + b, 9)):
            for inclusive in (True, False):
                is_in = Fraction(x) < exact or (inclusive and Fraction(x) == exact)
                given = {"radii": [a, b], "inclusive": inclusive}
                assert hs.count_pairs([[0.0], [x]], None, **given) == is_in
                assert hs.count_pairs([[0.0], [x / 2]], None, rule="mean", **given) == is_in
                assert hs.count_pairs([[0.0], [x]], a + b, **given) == (
                    is_in and (x < a + b or (inclusive and x == a + b))
                )
            ways.add((Fraction(x) > exact) - (Fraction(x) < exact))
    assert {-1, 1} <= ways


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_radii_far_larger_than_a_skewed_box(rule, dim):
    rng = np.random.default_rng(dim)
    n, large = {1: (6, 20.0), 2: (4, 3.0), 3: (2, 1.5)}[dim]
    box = np.diag(rng.uniform(0.5, 1, dim))
    box[np.tril_indices(dim, -1)] = rng.choice([0.5, 7.3, -3.0], dim * (dim - 1) // 2)
    radii = rng.choice([0.01, 0.5, large], n)
    radii[0] = large
    for far in (0, 1000):
        points = rng.random((n, dim)) * (1 + far)
        check(points, radii, rule, box=box)
        check(points, radii, rule, box=box, periodic=[True] + [False] * (dim - 1))
        check(points, radii, rule, box=box, cutoff=0.5, inclusive=False)


@pytest.mark.parametrize("rule", RULES)
def test_octaves_at_powers_of_two_on_a_lattice(rule):
    rng = np.random.default_rng(11)
    points = rng.integers(0, 6, (60, 3)) / 4.0
    radii = rng.choice([0.0, 0.25, 0.5, math.nextafter(0.5, 0), 1.0], 60)
    for inclusive in (True, False):
        check(points.astype(np.float32), radii, rule, inclusive=inclusive)
        check(points, radii, rule, cutoff=0.5, inclusive=inclusive)


def lump(n=1500, seed=5):
    rng = np.random.default_rng(seed)
    radii = 0.04 * 2.0 ** -rng.integers(0, 6, n)
    radii[:3] = 0.4
    return rng.random((n, 3)), radii


def test_iterators_and_callbacks_end_midway():
    points, radii = lump()
    i, j = hs.pairs(points, None, radii=radii)
    blocks = hs.iter_pairs(points, None, radii=radii, max_pairs=100)
    a, b = next(blocks)
    assert (a == i[:100]).all() and (b == j[:100]).all()
    blocks.close()
    assert list(blocks) == []
    seen = []
    ended = hs.for_each_pair(
        points, None, lambda *pair: seen.append(pair[:2]) or len(seen) == 57, radii=radii
    )
    assert ended == 57 and seen == list(zip(i[:57].tolist(), j[:57].tolist(), strict=True))

    def fail(*_):
        raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        hs.for_each_pair(points, None, fail, radii=radii)
    fractions = []
    found = hs.pairs(points, None, radii=radii, progress=fractions.append, threads=2)
    assert (found[0] == i).all() and fractions == sorted(fractions)
    assert all(0 <= f <= 1 for f in fractions)
    with pytest.raises(KeyError, match="enough"):
        list(hs.iter_pairs(points, None, radii=radii, progress=fail))


def test_out_is_large_enough_and_apart_from_inputs():
    points, radii = lump(300)
    i, j, d = hs.pairs(points, None, radii=radii, quantities="ijd")
    m = len(i)
    out = (np.full(m + 5, -1), np.full(m, -1), np.full(m + 1, -1.0))
    found = hs.pairs(points, None, radii=radii, quantities="ijd", out=out)
    assert all((a == b).all() for a, b in zip(found, (i, j, d), strict=True))
    assert (out[0][m:] == -1).all() and out[2][m] == -1
    with pytest.raises(hs.CapacityError) as caught:
        hs.pairs(points, None, radii=radii, out=(out[0], np.zeros(m - 1, dtype=np.int64)))
    assert caught.value.needed == m
    with pytest.raises(ValueError, match="out"):
        hs.pairs(points, None, radii=radii, out=(out[0], out[0]))
    with pytest.raises(ValueError, match="out"):
        hs.pairs(points, 0.01, radii=radii, quantities="d", out=radii)


def test_radii_that_change_meanwhile_do_no_harm():
    points, radii = lump()
    stop = threading.Event()

    def write():
        k = 0
        values = (np.nan, -1.0, 0.3, 1e308, 0.0, np.inf, 0.01)
        while not stop.is_set():
            radii[k % len(radii)] = values[k % len(values)]
            radii[:] = 0.03
            k += 1

    writer = threading.Thread(target=write)
    writer.start()
    try:
        for _ in range(15):
            for search in (hs.pairs, hs.coordination, hs.count_pairs):
                try:
                    search(points, 0.1, radii=radii, threads=2)
                except ValueError as refused:
                    assert "radii" in str(refused)
    finally:
        stop.set()
        writer.join()
    i, j = hs.pairs(points, None, radii=radii)
    assert (i < j).all()


@pytest.mark.parametrize("t", [1, 8, 9, 40])
def test_tables_of_many_types_with_pairs_left_out(t):
    rng = np.random.default_rng(t)
    points, types = rng.integers(0, 8, (300, 3)) / 8.0, rng.integers(0, t, 300)
    table = rng.choice([0.0, 0.125, 0.25, 0.375, math.nextafter(0.25, 0)], (t, t))
    table = np.maximum(table, table.T)
    left_out = rng.random((t, t)) < 0.3
    left_out[0, 0] = False
    left_out |= left_out.T
    cutoffs = {(a, b): table[a, b] for a in range(t) for b in range(a, t) if not left_out[a, b]}
    # whole eighths: squares are exact, and roots of those that are no squares are far from them
    distance = np.sqrt(((points[None] - points[:, None]) ** 2).sum(-1))
    reach = table[np.ix_(types, types)]
    kept = ~left_out[np.ix_(types, types)] & np.triu(np.ones((300, 300), bool), 1)
    for inclusive in (True, False):
        near = distance <= reach if inclusive else distance < reach
        i, j = hs.pairs(points, cutoffs, types=types, inclusive=inclusive, sort=True)
        assert np.array_equal(np.argwhere(near & kept), np.column_stack([i, j]))
