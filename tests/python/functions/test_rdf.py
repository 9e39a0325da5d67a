# SPDX-License-Identifier: BSD-3-Clause
"""The radial distribution function: the histogram over that of an ideal gas."""

import math

import numpy as np
import pytest

import halfshell as hs

BALLS = {1: 2.0, 2: math.pi, 3: 4.0 * math.pi / 3.0, 4: math.pi**2 / 2.0}


@pytest.mark.parametrize("ndim", BALLS)
def test_an_ideal_gas_has_one_everywhere(ndim, rng):
    box = np.diag(np.full(ndim, 10.0)) + np.tril(rng.uniform(-2, 2, (ndim, ndim)), -1)
    points = rng.random((1500, ndim)) @ box
    result = hs.rdf(points, 4.0, bins=4, box=box)
    assert result.r.tolist() == [0.5, 1.5, 2.5, 3.5]
    assert result.edges.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert result.counts.tolist() == hs.pair_histogram(points, result.edges, box=box).tolist()
    volume = abs(np.linalg.det(box))
    shells = BALLS[ndim] * np.diff(result.edges**ndim)
    assert np.allclose(result.g, 2.0 * result.counts * volume / (1500**2 * shells), rtol=1e-12)
    assert np.all(np.abs(result.g - 1.0) < 0.2)


def test_all_images_beyond_the_box(rng):
    points = rng.random((40, 3))
    result = hs.rdf(points, 6.0, bins=30, box=[1.0, 1.0, 1.0])
    assert abs(result.g[15:].mean() - 1.0) < 0.01


def test_types_are_weighted_by_their_numbers(rng):
    points = rng.random((2000, 2))
    types = np.repeat([0, 1], [500, 1500])
    result = hs.rdf(points, 0.3, bins=3, types=types, box=[1.0, 1.0])
    assert result.g.shape == result.counts.shape == (2, 2, 3)
    assert np.all(np.abs(result.g - 1.0) < 0.1)
    alone = hs.rdf(points[:500], 0.3, bins=3, box=[1.0, 1.0])
    assert np.allclose(result.g[0, 0], alone.g, rtol=1e-12)
    cross = hs.rdf(points[500:], 0.3, bins=3, queries=points[:500], box=[1.0, 1.0])
    assert np.array_equal(result.counts[0, 1], cross.counts)
    assert np.allclose(result.g[0, 1], cross.g, rtol=1e-12)


def test_types_around_queries(rng):
    points, queries = rng.random((900, 2)), rng.random((400, 2))
    types, query_types = np.arange(900) % 3, np.repeat([0, 1], [100, 300])
    result = hs.rdf(
        points, 0.3, bins=3, queries=queries, types=types, query_types=query_types, box=[1.0, 1.0]
    )
    assert result.g.shape == (3, 3, 3) and (result.g[2] == 0.0).all()
    for a in (0, 1):
        for b in range(3):
            some = hs.rdf(
                points[types == b], 0.3, bins=3, queries=queries[query_types == a], box=[1.0, 1.0]
            )
            assert np.array_equal(result.counts[a, b], some.counts)
            assert np.allclose(result.g[a, b], some.g, rtol=1e-12)
    assert np.all(np.abs(result.g[:2] - 1.0) < 0.2)


def test_an_atoms_object_brings_its_box():
    build = pytest.importorskip("ase.build")
    atoms = build.bulk("Cu", cubic=True)
    result = hs.rdf(atoms, 3.0, bins=30)
    assert result.counts.sum() == 24  # 4 atoms with 12 neighbours each
    assert np.flatnonzero(result.counts).tolist() == [25]  # at 2.55


@pytest.mark.filterwarnings("error")
def test_no_points_and_absent_types_have_a_g_of_zero():
    assert hs.rdf([], 1.0, bins=2, box=[1.0] * 3).g.tolist() == [0.0, 0.0]
    one = hs.rdf([[0.0]], 0.4, bins=2, box=[1.0])
    assert one.g.tolist() == [0.0, 0.0] and one.counts.tolist() == [0, 0]
    result = hs.rdf([[0.0], [0.3]], 0.4, bins=2, types=[0, 2], box=[1.0])
    assert (result.g[1] == 0.0).all() and (result.g[:, 1] == 0.0).all()
    assert result.g[0, 2].tolist() == result.g[2, 0].tolist() == [0.0, 2.5]
    none = hs.rdf(np.empty((0, 1)), 0.4, bins=2, queries=[[0.5]], box=[1.0])
    assert none.g.tolist() == [0.0, 0.0]
    none = hs.rdf([[0.5]], 0.4, bins=2, queries=np.empty((0, 1)), box=[1.0])
    assert none.g.tolist() == [0.0, 0.0]


@pytest.mark.filterwarnings("error")
def test_shells_that_float64_does_not_hold_are_0_or_infinite():
    points = [[0.0] * 3, [1e-120] * 3, [0.5] * 3]
    result = hs.rdf(points, 4e-120, bins=2, box=[1.0] * 3)
    assert result.counts.tolist() == [1, 0] and result.g.tolist() == [math.inf, 0.0]


REFUSED = {
    "no box": ({}, ValueError, "periodic along every axis"),
    "a slab": ({"box": [1.0] * 2, "periodic": [True, False]}, ValueError, "along every axis"),
    "no bins": ({"box": [1.0] * 2, "bins": 0}, ValueError, "bins"),
    "bins that are no number": ({"box": [1.0] * 2, "bins": 1.5}, TypeError, "bins"),
    "bins that are a bool": ({"box": [1.0] * 2, "bins": True}, TypeError, "bins"),
    "r_max of zero": ({"box": [1.0] * 2, "r_max": 0.0}, ValueError, "r_max"),
    "r_max that is NaN": ({"box": [1.0] * 2, "r_max": math.nan}, ValueError, "r_max"),
    "several r_max": ({"box": [1.0] * 2, "r_max": [1.0, 2.0]}, TypeError, "r_max"),
    "types with queries": (
        {"box": [1.0] * 2, "types": [0, 0], "queries": [[0.0, 0.0]]}, ValueError, "together",
    ),
}  # fmt: skip


@pytest.mark.parametrize("how, error, text", REFUSED.values(), ids=REFUSED)
def test_what_has_no_density_is_refused(how, error, text):
    with pytest.raises(error, match=text):
        hs.rdf([[0.0, 0.0], [0.5, 0.5]], **{"r_max": 0.5, **how})


@pytest.mark.parametrize("bins", [2**40, 2**63, 10**400])
def test_bins_beyond_memory_are_refused_at_once(bins):
    with pytest.raises(MemoryError, match="so many bins"):
        hs.rdf([[0.0]], 1.0, bins, box=[2.0])


@pytest.mark.parametrize("power", [-600, -300, 300, 600])
@pytest.mark.filterwarnings("error")
def test_the_unit_of_length_changes_nothing(power):
    points, box = np.random.default_rng(1).random((50, 3)), np.eye(3) + 0.3 * np.eye(3, k=1)
    plain = hs.rdf(points, 0.7, 9, box=box)
    scaled = hs.rdf(
        np.ldexp(points, power), math.ldexp(0.7, power), 9, box=np.ldexp(box, power)
    )
    assert scaled.g.tobytes() == plain.g.tobytes()
    assert scaled.counts.tobytes() == plain.counts.tobytes()
