# SPDX-License-Identifier: BSD-3-Clause
"""What comes out where pairs have a reach each: quantities, order, streams, threads, kernels; and
scenes too large for rational arithmetic, held against searches that have one cutoff each."""

import itertools

import numpy as np
import pytest

import halfshell as hs
from calls import call
from full_lists import same_tables
from oracles import same_arrays
from reach_scenes import RULES, SYMMETRIC, boxed, spread_radii

RNG = np.random.default_rng(77)
POINTS = RNG.random((400, 3))
RADII = spread_radii(RNG, 400, 0.15, 3.0)
TYPES = RNG.integers(0, 4, 400)
CUTOFFS = {(0, 1): 0.2, (2, 2): 0.15, (3, 3): 0.05, (0, 3): 0.1}

#: Cutoff and keywords.
SCENES = {
    "radii": (None, {"radii": RADII, "box": 1.0}),
    "radii within a bound": (0.21, {"radii": RADII, "rule": "max"}),
    "triclinic": (None, {"radii": 2 * RADII, "rule": "mean",
                         "box": [[1.0, 0.0, 0.0], [0.4, 0.9, 0.0], [-0.3, 0.2, 1.1]]}),
    "types": (CUTOFFS, {"types": TYPES, "box": 1.0, "periodic": [True, False, True]}),
}  # fmt: skip
every_scene = pytest.mark.parametrize("name", SCENES)


@every_scene
def test_blocks_and_calls_are_pairs_in_their_order(name):
    cutoff, how = SCENES[name]
    expected = call(hs.pairs, POINTS, cutoff, quantities="ijSdD", **how)
    for most in (1 << 20, 1000, 37):
        for threads in (1, 2):
            seen = []
            blocks = list(call(hs.iter_pairs,
                POINTS, cutoff, quantities="ijSdD", max_pairs=most, threads=threads,
                progress=seen.append, **how,
            ))  # fmt: skip
            assert seen == sorted(seen) and 0.0 <= seen[0] and seen[-1] == 1.0
            assert [len(block[0]) for block in blocks[:-1]] == [most] * (len(blocks) - 1)
            found = tuple(np.concatenate(columns) for columns in zip(*blocks))
            assert same_arrays(found, expected)
    visited = []
    count = call(hs.for_each_pair, POINTS, cutoff, lambda *pair: visited.append(pair), **how)
    i, j, S, d, D = expected
    assert count == len(i)
    assert visited == list(zip(i.tolist(), j.tolist(), map(tuple, S.tolist()),
                               map(tuple, D.tolist()), (d * d).tolist()))  # fmt: skip
    stopped = []
    how = how | {"threads": 1}
    assert call(
        hs.for_each_pair, POINTS, cutoff, lambda i, *_: stopped.append(i) or i == 3, **how
    ) == (len(stopped))


# ---- large scenes --------------------------------------------------------------------------

LARGE = {
    "two octaves": lambda n, rng: rng.uniform(0.5, 2.0, n),
    "lognormal": lambda n, rng: np.exp(0.7 * rng.normal(size=n)),
    "six decades": lambda n, rng: 3.0 * 10.0 ** -rng.uniform(0, 6, n),
    "one giant": lambda n, rng: np.where(np.arange(n) == n // 3, 12.0, 0.7),
    "two sizes": lambda n, rng: rng.choice([0.01, 2.0], n),
    "zero and one": lambda n, rng: rng.choice([0.0, 1.0], n),
}


@pytest.mark.parametrize(
    ("name", "rule", "kind"),
    [
        *zip(LARGE, RULES, itertools.cycle(["open", "triclinic"])),
        *zip(LARGE, reversed(RULES), itertools.cycle(["triclinic", "open"])),
        *zip(LARGE, (*RULES[3:], *RULES[:3]), itertools.cycle(["triclinic", "open"])),
    ],
)
def test_large_scenes_are_right(name, rule, kind, rng):
    n = 1000
    points, scene = boxed(rng, kind, 3, n)
    radii = LARGE[name](n, rng) * 0.04 * (1 if rule == "sum" else 2)
    how = {"radii": radii, "rule": rule, **scene}
    verdict = call(
        hs.verify, points, None, call(hs.neighbors, points, None, quantities="jS", **how), **how
    )
    assert verdict, str(verdict)
    assert verdict.n_expected > 0
    if rule in SYMMETRIC:
        found = call(hs.pairs, points, None, quantities="ijS", **how)
        assert call(hs.verify, points, None, *found, **how)
    queries = {"queries": points[:300], "query_radii": radii[:300], "radii": radii[300:]}
    if rule in ("gather", "scatter"):
        del queries["radii" if rule == "gather" else "query_radii"]
    how = scene | {"rule": rule} | queries
    table = call(hs.neighbors, points[300:], None, quantities="jS", **how)
    assert call(hs.verify, points[300:], None, table, **how)


def test_many_types_in_a_large_scene(rng):
    points, scene = boxed(rng, "triclinic", 3, 4000)
    types = rng.integers(0, 12, 4000)
    table = rng.uniform(0.0, 0.12, (12, 12))
    table = np.minimum(table, table.T)
    found = call(hs.pairs, points, table, types=types, quantities="ijS", **scene)
    assert call(hs.verify, points, table, *found, types=types, **scene)
    again = call(hs.neighbors, points, table, types=types, quantities="jS", **scene)
    assert call(hs.verify, points, table, again, types=types, **scene)
    assert not same_tables(again, call(hs.neighbors, points, 0.12, quantities="jS", **scene))


def test_dwarfs_in_a_giant_cost_what_they_find(rng):
    """One giant over all: its pairs are n, not n squared, and so is the work."""
    n = 200_000
    points = rng.random((n, 3))
    radii = np.full(n, 1e-3)
    radii[7] = 2.0
    assert call(hs.count_pairs, points, None, radii=radii, threads=1) < 3 * n
    assert len(call(hs.pairs, points, None, radii=radii, quantities="i", memory_limit=2e8)) < 3 * n
