# SPDX-License-Identifier: BSD-3-Clause
"""The k nearest points: order and ties by rational arithmetic, images, clusters, bad arguments."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.spatial import cKDTree

import halfshell as hs
from calls import call
from definition import measured_pairs
from halfshell._check.reference import ulp_error
from oracles import BOX_KINDS, lattice, random_box, same_arrays


def check(points, k, **how):
    """Assert that all four quantities are those of the definition; and the same by each kernel."""
    points, queries = np.asarray(points), how.get("queries")
    arrays, *others = (
        call(hs.nearest, points, k, quantities="jdDS", kernel=kernel, **how)
        for kernel in hs.kernels()
    )
    assert all(same_arrays(arrays, other) for other in others)
    j, d, D, S = arrays
    asking = None if queries is None else hs.Points(queries)
    n, n_others = len(points if asking is None else asking), len(points) - (asking is None)
    assert j.shape == d.shape == (n, k) and D.shape == S.shape == (n, k, points.shape[1])
    assert d.dtype == D.dtype == np.float64 and S.dtype == np.int32
    known = hs.Points(points, box=how.get("box"), periodic=how.get("periodic"))
    reach = np.nextafter(np.nextafter(d[np.isfinite(d)].max(initial=0.0), np.inf), np.inf)
    every = measured_pairs(known, reach, asking, None, None, None, True)
    for i in range(n):
        row = sorted((square, other, T, true) for a, other, T, square, true in every if a == i)[:k]
        m = len(row)
        assert m == (k if known.box is not None else min(k, n_others))
        assert list(zip(j[i, :m].tolist(), map(tuple, S[i, :m].tolist()))) == [r[1:3] for r in row]
        assert (np.diff(d[i, :m]) >= 0).all()
        assert (j[i, m:] == -1).all() and (d[i, m:] == np.inf).all()
        assert np.isnan(D[i, m:]).all() and (S[i, m:] == 0).all()
        for e, (square, _, _, true) in enumerate(row):
            assert ulp_error(d[i, e], square) <= 1
            unit = Fraction(float(np.spacing(d[i, e])))
            assert all(abs(Fraction(x) - y) <= unit for x, y in zip(D[i, e].tolist(), true))


# ---- against rational arithmetic -----------------------------------------------------------


@pytest.mark.parametrize("kind", BOX_KINDS)
@pytest.mark.parametrize("ndim", [1, 2, 3])
def test_random_points_in_boxes(kind, ndim, rng):
    box = random_box(rng, kind, ndim, 3.0)
    for n, k in ((1, 4), (3, 11), (15, 6)):
        points = rng.uniform(-9, 9, (n, ndim))
        check(points, k, box=box)
        check(points, k, box=box, queries=rng.uniform(-20, 20, (5, ndim)))
        if ndim > 1:
            flags = [True] + [False] * (ndim - 1)
            check(points, k, box=box, periodic=flags)


@pytest.mark.parametrize("name", ["sc", "bcc", "fcc", "diamond", "hcp"])
def test_ties_on_crystals_are_in_order_of_number_and_shift(name):
    points, box = lattice(name, (2, 2, 2))
    for factor in (1.0, 0.1, 1e-200):
        check(points * factor, 14)
        check(points[:4] * factor, 20, box=box * factor)


def test_many_images_of_a_tiny_anisotropic_box():
    j, d, S = hs.nearest([[0.0, 0.0, 0.0]], 2000, box=[1.0, 1e6, 1e6], quantities="jdS")
    assert np.array_equal(d[0], np.repeat(np.arange(1.0, 1001.0), 2))
    assert np.array_equal(S[0, :, 0], np.stack([-d[0, ::2], d[0, ::2]], 1).ravel())
    assert not j.any() and not S[..., 1:].any()


@pytest.mark.parametrize("scale", [5e-324, 1e-320, 1e-300, 1e-160, 1e160, 1e300])
def test_any_scale(scale, rng):
    points = rng.integers(-8, 9, (40, 2)).astype(float) * scale
    check(points, 6)
    if scale > 1e-310:
        check(points, 6, box=[5 * scale, 7 * scale])


def test_a_cluster_and_an_outlier_on_different_scales(rng):
    points = rng.random((80, 3)) * 1e-150
    points[7] = 1e300
    points[30:50] += 1e9
    check(points, 4)


def test_points_that_their_places_in_a_box_do_not_tell_apart(rng):
    points = rng.random((300, 2)) * 10.0 ** rng.uniform(-40, 40, (300, 1))
    queries = points[np.abs(points).max(axis=1) < 1e25]
    box = [[4e39, 3e38], [-7e38, 6e39]]
    j, d = hs.nearest(points, 1, queries=queries)
    in_box = hs.nearest(points, 1, queries=queries, box=box)
    assert np.array_equal(in_box[0], j)
    assert np.array_equal(in_box[1], d)


# ---- larger scenes -------------------------------------------------------------------------


def scenes_of_all_densities(rng, n):
    two = rng.random((n, 3))
    two[n // 2 :] += 1e9
    outlier = rng.random((n, 3))
    outlier[5] = 1e300
    tiny = rng.random((n, 3)) * 2.0**-500
    tiny[5] = 1e300
    return {
        "even": rng.random((n, 3)),
        "two clusters": two,
        "lognormal": rng.lognormal(0.0, 3.0, (n, 3)),
        "plane": np.c_[rng.random((n, 2)), np.zeros(n)],
        "line": np.c_[rng.random(n), np.zeros((n, 2))],
        "outlier": outlier,
        "tiny beside an outlier": tiny,
    }


def test_distances_are_those_of_a_tree(rng):
    for kernel in hs.kernels():
        for name, points in scenes_of_all_densities(rng, 1500).items():
            j, d = call(hs.nearest, points, 9, kernel=kernel)
            rest = np.abs(points).max(axis=1) < 1e200
            near = points[rest]
            unit = 2.0**-500 if name.startswith("tiny") else 1.0  # the tree squares
            expected = cKDTree(near / unit).query(near / unit, 10)[0][:, 1:] * unit
            # Each coordinate is exact; the tree's distances have a few roundings.
            np.testing.assert_allclose(d[rest], expected, rtol=1e-14, err_msg=name)
            assert (j >= 0).all() and (j != np.arange(len(points))[:, None]).all()


@pytest.mark.slow
def test_cost_follows_the_points_not_their_distances(rng):
    # n^2 would be 1e10 distances, and minutes.
    n = 100_000
    same = np.ones((n, 3))
    j, d = hs.nearest(same, 3)
    assert np.array_equal(j[3:], np.broadcast_to([0, 1, 2], (n - 3, 3))) and not d.any()
    for points in scenes_of_all_densities(rng, n).values():
        assert (hs.nearest(points, 3, quantities="j") >= 0).all()


# ---- forms and errors ----------------------------------------------------------------------


@pytest.mark.parametrize("how", [
    {}, {"box": [4.0] * 3}, {"box": [[4, 0, 0], [1, 4, 0], [0, 2, 4.0]]},
    {"box": [4.0] * 3, "periodic": [True, False, True]},
])  # fmt: skip
def test_choices_among_many_that_coincide(how, rng):
    """Spots of some 11 points, and of 90: what does not count stands between those that do."""
    of_few, of_many = rng.integers(0, 3, (300, 3)), rng.integers(0, 2, (300, 3)) * [2, 0, 1]
    for at in (of_few, np.concatenate([of_many[:180], of_few[:40]])):
        n, by = len(at), {"groups": rng.integers(0, 3, len(at)), "labels": np.arange(len(at)) // 5}
        for kept, choice in (
            (by, {"exclude": 0}), ({"labels": by["labels"]}, {"exclude": 30}),
            ({"groups": by["groups"]}, {}), ({}, {"exclude": [[0, 1], [2, n - 1]]}),
            ({}, {"min_distance": 1.0}), ({}, {"min_distance": 1.5}), (by, {"min_distance": 0.5}),
            (by, {"exclude": 1, "min_distance": 2.0}),
        ):  # fmt: skip
            points = hs.Points(at.astype(float), **how, **kept)
            table = hs.neighbors(points, 5.0, quantities="jdS", **choice)
            for k in (1, 3, 40):
                j, d, S = hs.nearest(points, k, quantities="jdS", **choice)
                for i in rng.integers(0, n, 12).tolist():
                    rows = [getattr(table, name)[table.offsets[i] : table.offsets[i + 1]]
                            for name in ("indices", "distances", "shifts")]  # fmt: skip
                    order = np.lexsort([*rows[2].T[::-1], rows[0], rows[1]])[:k]
                    assert len(order) == k or not how
                    m = len(order)
                    assert np.array_equal(j[i, :m], rows[0][order]) and (j[i, m:] == -1).all()
                    assert np.array_equal(S[i, :m], rows[2][order])
                some = rng.integers(0, n, 5)
                found = hs.nearest(points, k, quantities="jdS", indices=some, **choice)
                assert same_arrays(found, (j[some], d[some], S[some]))


def test_the_way_through_all_open_axes_leaves_few_images(rng):
    """From 40 periods away along both of two open axes, of eight."""
    points, box = rng.random((20, 8)), np.eye(8) + np.tril(rng.random((8, 8)), -1) / 2
    periodic = ~np.isin(np.arange(8), [3, 6])
    A = box[periodic]
    far = points[:3] + 40.0 * np.linalg.qr(A.T, mode="complete")[0][:, 6:].sum(axis=1)
    j, d = hs.nearest(points, 4, queries=far, quantities="jd", box=box, periodic=periodic)
    images = np.array(list(np.ndindex(*[5] * 6))) - 2
    for row, query in enumerate(far):
        D = points - query
        D = (D - np.rint(D @ np.linalg.pinv(A)) @ A)[:, None] + images @ A
        lengths = np.linalg.norm(D, axis=2)
        order = np.argsort(lengths, axis=None)[:4]
        assert np.array_equal(j[row], order // len(images))
        assert np.allclose(d[row], lengths.flat[order], rtol=1e-14)


@pytest.mark.parametrize("d", [1, 2, 3, 8])
def test_rows_of_some_points_only(d, rng):
    points = np.repeat(rng.integers(0, 6, (60, d)) / 4.0, 2, axis=0)  # many that coincide
    for how in ({}, {"box": [1.5] * d}, {"box": [1.5] * d, "periodic": [True] + [False] * (d - 1)}):
        for k in (1, 4, 200):
            every = hs.nearest(points, k, quantities="jdDS", **how)
            for some in ([7], [3, 119, 3, 0], np.arange(119, -1, -7), []):
                found = hs.nearest(points, k, quantities="jdDS", indices=some, **how)
                for one, other in zip(found, every):
                    rows = other[np.asarray(some, int)]
                    assert one.dtype == rows.dtype and one.shape == rows.shape
                    if other is every[1]:
                        assert np.array_equal(one, rows)
                exact = hs.measure(points, np.repeat(some, k)[found[0].ravel() >= 0].astype(int),
                                   found[0][found[0] >= 0], found[3][found[0] >= 0],
                                   quantities="d", **how)  # fmt: skip
                assert np.array_equal(exact, found[1][found[0] >= 0])
                assert how or not (found[0] == np.reshape(some, (-1, 1))).any()
    systems = hs.Points.stack([points[:50], points[50:]])
    found = hs.nearest(systems, 3, indices=[110, 4, 60])
    assert np.array_equal(found[1], hs.nearest(systems, 3)[1][[110, 4, 60]])
    assert (found[0][0] >= 50).all() and (found[0][1] < 50).all()
    with pytest.raises(ValueError, match="indices select rows of the points: do not give queries"):
        hs.nearest(points, 2, indices=[0], queries=points)
    with pytest.raises(ValueError, match=r"indices must be numbers of points.*indices\[1\] = 120"):
        hs.nearest(points, 2, indices=[0, 120])
