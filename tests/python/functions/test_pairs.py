# SPDX-License-Identifier: BSD-3-Clause
"""Pairs of small scenes and of large ones, in every number of dimensions, and their order."""

import itertools
from functools import partial

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import (
    BOX_KINDS,
    check_large,
    random_scene,
    same_arrays,
)

# ---- dimensions --------------------------------------------------------------------------------


DIMENSIONS = range(1, 9)


def test_integer_lattice_ties():
    for ndim in DIMENSIONS:
        for kernel in hs.kernels():
            # Integer points of a small torus: each has two neighbours per axis, exactly at 1.
            size = {1: 16, 2: 8, 3: 5}.get(ndim, 3)
            steps = list(itertools.product(range(size), repeat=min(ndim, 6)))
            points = np.zeros((len(steps), ndim))
            points[:, : min(ndim, 6)] = steps
            box = np.full(ndim, float(size))
            count = call(hs.count_pairs, points, 1.0, box=box, kernel=kernel)
            assert count == len(points) * min(ndim, 6)
            below = call(hs.count_pairs, points, 1.0, box=box, inclusive=False, kernel=kernel)
            assert below == 0


# ---- large scenes ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_thousands_of_points_in_every_kind_of_box(kind, rng):
    for n, ndim, neighbours in ((6000, 3, 12), (4000, 2, 20), (3000, 4, 6), (1000, 6, 4)):
        flags = rng.random(ndim) < 0.7
        points, cutoff, box, flags = random_scene(rng, n, ndim, kind, neighbours, 2, flags)
        check_large(points, cutoff, box, flags)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_a_hundred_thousand_points(dtype, rng):
    points, cutoff, box, _ = random_scene(rng, 100_000, 3, "triclinic", neighbours=10)
    rows = check_large(points.astype(dtype), cutoff, box)
    assert 450_000 < len(rows) < 550_000


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_crowded_cells(dtype, rng):
    # Hundreds of neighbours, in one spot and everywhere.
    points, cutoff, box, _ = random_scene(rng, 1500, 3, "triclinic", neighbours=500)
    check_large(points.astype(dtype), cutoff, box)
    spots = np.concatenate(
        [rng.random((700, 3)) * 0.01 + corner for corner in ([0, 0, 0], [1, 1, 1], [1, 0, 0.5])]
    )
    check_large(spots.astype(dtype), 0.008, [2.0, 2.0, 2.0])


def test_clustered_points(rng):
    # Densities that differ by a factor of 1e6, as in a galaxy catalogue.
    centres = rng.random((40, 3))
    widths = 10.0 ** rng.uniform(-4, -1, 40)
    points = np.concatenate(
        [c + w * rng.normal(size=(100, 3)) for c, w in zip(centres, widths, strict=True)]
    )
    for cutoff in (1e-4, 1e-3, 0.02):
        check_large(points, cutoff, [1.0, 1.0, 1.0])
        check_large(points, cutoff)


# ---- order -------------------------------------------------------------------------------------


@pytest.mark.parametrize("ndim", DIMENSIONS)
def test_every_kernel_returns_the_same_bytes_in_the_same_order(ndim, rng):
    for sort in (False, True):
        for n in (2, 33, 500):
            points, cutoff, box, _ = random_scene(rng, n, ndim, neighbours=15 if ndim < 7 else 4)
            for dtype in (np.float64, np.float32):
                for frame in (box, None):
                    results = [
                        call(
                            hs.pairs,
                            points.astype(dtype),
                            cutoff,
                            box=frame,
                            quantities="ijSdD",
                            sort=sort,
                            kernel=name,
                        )
                        for name in [*hs.kernels(), None]
                    ]
                    assert all(same_arrays(results[0], other) for other in results[1:])


# ---- arrays of the caller ----------------------------------------------------------------------


CLOUD = np.random.default_rng(9).random((100, 3))


def kept_list():
    pair_list = hs.VerletList(0.3, 0.1, box=1.0)
    pair_list.update(CLOUD)
    return pair_list


FILLED = {
    "pairs": partial(hs.pairs, CLOUD, 0.3, box=1.0),
    "sorted": partial(hs.pairs, CLOUD, 0.3, box=1.0, sort=True),
    "some": partial(hs.pairs, CLOUD, 0.3, box=1.0, indices=[5, 9, 0]),
    "shells": partial(hs.pairs, CLOUD, [0.2, 0.3], box=1.0),
    "between": partial(hs.pairs_between, CLOUD[:15] + 0.1, CLOUD, 0.3, box=1.0),
    "cells": hs.CellList(CLOUD, 0.3, box=1.0).pairs,
    "list": kept_list().pairs,
    "sorted list": partial(kept_list().pairs, sort=True),
}


@pytest.mark.parametrize("index_dtype", [np.int32, np.int64])
@pytest.mark.parametrize("name", FILLED)
def test_any_letters_fill_arrays_of_the_caller(name, index_dtype):
    search = partial(FILLED[name], index_dtype=index_dtype)
    shells = "k" * (name == "shells")
    whole = dict(zip("ijdDSPk", search(quantities="ijdDSP" + shells)))
    for letters in ("i", "P", "S", "D", "dj", "SPd", "Di"):
        quantities = letters + shells
        found = search(quantities=quantities)
        assert isinstance(found, tuple) == (len(quantities) > 1)
        found = found if isinstance(found, tuple) else (found,)
        for letter, array in zip(quantities, found, strict=True):
            assert same_arrays(array, whole[letter])
        m = len(found[0])
        out = tuple(np.full((m + 7, *a.shape[1:]), -7, a.dtype) for a in found)
        filled = search(quantities=quantities, out=out)
        assert same_arrays(filled, found)
        for view, array in zip(filled if len(out) > 1 else (filled,), out, strict=True):
            assert np.shares_memory(view, array) and (array[m:] == -7).all()
        with pytest.raises(hs.CapacityError, match=f"there are {m} pairs") as caught:
            search(quantities=quantities, out=tuple(array[: m - 1] for array in out))
        assert caught.value.needed == m
        with pytest.raises(TypeError, match="out for"):
            search(quantities=quantities, out=tuple(array.astype("c16") for array in out))


# ---- an infinite cutoff ----------------------------------------------------------------------


def test_an_infinite_cutoff_takes_all_pairs(rng):
    points = rng.random((7, 3))
    for inf in (np.inf, np.float64(np.inf), np.array(np.inf)):
        for how in ({}, {"box": 1.0, "periodic": False}, {"inclusive": False}):
            assert hs.pairs(points, inf, sort=True, quantities="P", **how).tolist() == [
                [i, j] for i in range(7) for j in range(i + 1, 7)
            ]
            assert hs.count_pairs(points, inf, queries=points[:2], **how) == 14
            assert hs.coordination(points, inf, **how).tolist() == [6] * 7
            assert hs.neighbors(points, inf, quantities="jd", **how).sort().counts.sum() == 42
            assert sum(map(len, hs.iter_pairs(points, inf, quantities="P", **how))) == 21
            assert hs.clusters(points, inf, **how).n_clusters == 1
            assert hs.verify(points, inf, *hs.pairs(points, inf, **how), **how).ok
            (found,) = hs.trajectory_pairs([points], inf, quantities="P", **how)
            assert len(found) == 21
    for part in hs.bricks(points, np.inf, 2):  # also of points that are further apart later
        assert part.cutoff == np.inf and len(part.members) == 7
        assert part.pairs(5.0 * points)[0].tolist() == [
            i for i in part.owned.tolist() for j in range(i + 1, 7)
        ]
    assert hs.count_pairs([points, points[:2], points[:0]], np.inf).tolist() == [21, 1, 0]
    assert hs.count_pairs([points, points[:2]], [0.0, np.inf]).tolist() == [0, 1]
    assert hs.count_pairs(np.zeros((3, 2)), np.inf, inclusive=False) == 3
    assert hs.count_pairs([[1e308], [0.0]], np.inf) == 1
    assert hs.count_pairs(np.empty((0, 3)), np.inf) == 0
    assert hs.count_pairs(hs.CellList(points, 0.1), np.inf) == 21


def test_an_infinite_cutoff_among_others_takes_all_other_pairs(rng):
    points = rng.random((9, 3))
    for first in (0.0, 1e-3, 0.5, 1e3, 1e300):
        counts = hs.count_pairs(points, [first, np.inf])
        assert counts.tolist() == [hs.count_pairs(points, first), 36]
    k = hs.pairs(points, [0.5, np.inf], quantities="k")
    assert (k == 1).sum() == 36 - hs.count_pairs(points, 0.5) and k.max() == 1
    known = hs.Points(points, types=np.arange(9) % 2)
    for cutoff in ({(0, 1): np.inf}, [[0.0, np.inf], [np.inf, 0.0]]):
        assert hs.count_pairs(known, cutoff) == 20
        i, j = hs.pairs(known, cutoff)
        assert hs.verify(known, cutoff, i, j).ok
    balls = hs.Points(points, radii=rng.random(9) * 0.3, box=1.0)  # no further limit
    assert hs.count_pairs(balls, np.inf) == hs.count_pairs(balls, None) > 0


def test_an_infinite_cutoff_is_refused_where_there_is_no_end(rng):
    points = rng.random((7, 3))
    axes = [True, False, False]
    typed = hs.Points(points, types=np.arange(7) % 2, box=1.0)
    for call_, error, message in (
        (lambda: hs.pairs(points, np.inf, box=1.0), ValueError, "box vectors repeat, got inf"),
        (lambda: hs.pairs(points, np.inf, box=1.0, periodic=axes), ValueError, "no end of images"),
        (lambda: hs.count_pairs(points, [1.0, np.inf], box=1.0), ValueError, "no end of images"),
        (lambda: hs.count_pairs(typed, {(0, 1): np.inf}), ValueError, "no end of images"),
        (lambda: hs.bricks(points, np.inf, 2, box=1.0), ValueError, "no end of images"),
        (lambda: hs.pairs([[1e308], [-1e308]], np.inf), OverflowError, "do not fit float64"),
        (lambda: hs.pairs([[np.nan]], np.inf), ValueError, r"points\[0, 0\] = nan"),
        (lambda: hs.count_pairs([[np.nan]], [1.0, np.inf]), ValueError, r"points\[0, 0\] = nan"),
        (lambda: hs.pairs(points, -np.inf), ValueError, "not negative, got -inf"),
        (lambda: hs.CellList(points, np.inf), ValueError, "cutoff must be finite"),
        (lambda: hs.VerletList(np.inf), ValueError, "cutoff must be finite"),
        (lambda: hs.rdf(points, np.inf, density=1.0), ValueError, "cutoff must be finite"),
    ):
        with pytest.raises(error, match=message):
            call_()
