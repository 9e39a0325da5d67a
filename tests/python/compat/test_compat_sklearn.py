# SPDX-License-Identifier: BSD-3-Clause
"""`halfshell.compat.sklearn` gives what scikit-learn gives, and passes its checks of estimators."""

import numpy as np
import pytest
from scipy import sparse

theirs = pytest.importorskip("sklearn.neighbors", reason="scikit-learn is not installed")
from sklearn.base import clone  # noqa: E402
from sklearn.cluster import DBSCAN  # noqa: E402
from sklearn.pipeline import make_pipeline  # noqa: E402
from sklearn.utils.estimator_checks import parametrize_with_checks  # noqa: E402

from halfshell.compat import sklearn as ours  # noqa: E402

SETS = {
    "plane": (400, 2, np.float64), "space": (300, 3, np.float64), "single": (300, 3, np.float32),
    "many features": (200, 8, np.float64), "too many": (60, 9, np.float64),
    "one": (1, 2, np.float64),
}  # fmt: skip


@pytest.mark.slow
@parametrize_with_checks(
    [ours.RadiusNeighborsTransformer(radius=2.0), ours.KNeighborsTransformer()]
)
def test_estimators_pass_the_checks_of_their_owner(estimator, check):
    check(estimator)


def samples_of(name, rng):
    n, features, dtype = SETS[name]
    return rng.random((n, features)).astype(dtype), rng.random((50, features)).astype(dtype)


def assert_same(found, wanted):
    assert type(found) is type(wanted) and found.shape == wanted.shape
    assert found.indices.dtype == wanted.indices.dtype and found.data.dtype == wanted.data.dtype
    assert np.array_equal(found.indptr, wanted.indptr)
    for graph in (found, wanted):
        graph.sort_indices()
    assert np.array_equal(found.indices, wanted.indices)
    assert np.allclose(found.data, wanted.data, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("mode", ["distance", "connectivity"])
def test_radius(name, mode, rng):
    fitted, asking = samples_of(name, rng)
    for radius in (0.0, 0.21, 0.63):
        kinds = [
            owner.RadiusNeighborsTransformer(mode=mode, radius=radius).fit(fitted)
            for owner in (ours, theirs)
        ]
        for X in (asking, fitted):
            assert_same(*(kind.transform(X) for kind in kinds))
        assert_same(*(kind.radius_neighbors_graph(mode=mode) for kind in kinds))


@pytest.mark.parametrize("name", [name for name in SETS if name != "one"])
@pytest.mark.parametrize("mode", ["distance", "connectivity"])
def test_nearest(name, mode, rng):
    fitted, asking = samples_of(name, rng)
    for k in (1, 5):
        kinds = [
            owner.KNeighborsTransformer(mode=mode, n_neighbors=k).fit(fitted)
            for owner in (ours, theirs)
        ]
        assert_same(*(kind.transform(asking) for kind in kinds))
        assert_same(*(kind.kneighbors_graph(mode=mode) for kind in kinds))


@pytest.mark.parametrize("options", [{"metric": "manhattan"}, {"p": 1}, {"metric": "cosine"}])
def test_other_metrics_are_those_of_the_owner(options, rng):
    fitted, asking = samples_of("plane", rng)
    made = [
        owner.RadiusNeighborsTransformer(radius=0.2, **options).fit(fitted).transform(asking)
        for owner in (ours, theirs)
    ]
    assert_same(*made)


def test_sparse_samples_go_on_to_the_owner(rng):
    fitted, _ = samples_of("plane", rng)
    wanted = theirs.KNeighborsTransformer(n_neighbors=3).fit_transform(sparse.csr_array(fitted))
    assert_same(ours.KNeighborsTransformer(n_neighbors=3).fit_transform(sparse.csr_array(fitted)),
                wanted)


def test_errors_are_those_of_the_owner(rng):
    fitted, _ = samples_of("plane", rng)
    for owner in (ours, theirs):
        made = owner.KNeighborsTransformer(n_neighbors=1000).fit(fitted)
        with pytest.raises(ValueError, match="n_neighbors"):
            made.transform(fitted)
        with pytest.raises(ValueError, match="mode"):
            owner.RadiusNeighborsTransformer().fit(fitted).radius_neighbors_graph(mode="x")
        with pytest.raises(ValueError, match="features"):
            owner.RadiusNeighborsTransformer().fit(fitted).transform(fitted[:, :1])
        with pytest.raises(ValueError, match="NaN"):
            owner.RadiusNeighborsTransformer().fit([[np.nan, 0.0]])
        with pytest.raises(ValueError, match="NaN"):
            owner.RadiusNeighborsTransformer().fit(fitted).transform([[np.nan, 0.0]])


def test_neighbours_in_rows(rng):
    points, queries = rng.random((300, 3)), rng.random((20, 3))
    owner, mine = (m.RadiusNeighborsTransformer(radius=0.3).fit(points) for m in (theirs, ours))
    for X in (None, queries):
        far, near = (m.radius_neighbors(X, sort_results=True) for m in (owner, mine))
        for a, b in zip(far, near):
            assert (a.dtype, a.shape) == (b.dtype, b.shape)
            for one, other in zip(a, b):
                assert one.dtype == other.dtype and other.flags.writeable
                np.testing.assert_allclose(other, one, rtol=1e-7)
        alone = mine.radius_neighbors(X, 0.2, return_distance=False)
        for one, other in zip(owner.radius_neighbors(X, 0.2, return_distance=False), alone):
            assert np.array_equal(np.sort(one), other)
    for one in (owner, mine):
        with pytest.raises(ValueError, match="return_distance must be True"):
            one.radius_neighbors(queries, return_distance=False, sort_results=True)
    owner, mine = (m.KNeighborsTransformer(n_neighbors=4).fit(points) for m in (theirs, ours))
    for X in (None, queries):
        for a, b in zip(owner.kneighbors(X), mine.kneighbors(X)):
            assert a.dtype == b.dtype
            np.testing.assert_allclose(b, a, rtol=1e-7)
        assert np.array_equal(mine.kneighbors(X, 2, False), owner.kneighbors(X, 2, False))
    for one in (owner, mine):
        with pytest.raises(ValueError, match="n_neighbors"):
            one.kneighbors(queries, 301)


def test_ties_are_decided_exactly():
    """0.1 and 0.2 are 0.1 apart as floats say; 0.3 and 0.2 a little less."""
    graph = ours.RadiusNeighborsTransformer(radius=0.1).fit_transform([[0.1], [0.2], [0.3]])
    assert graph.toarray().astype(bool).tolist() == [
        [False, True, False], [True, False, True], [False, True, False]
    ]  # fmt: skip
    assert graph.nnz == 7  # and each itself, at distance 0


def test_dbscan_in_a_pipeline(rng):
    points = np.concatenate([rng.normal(c, 0.05, (200, 2)) for c in (0.0, 1.0, 2.0)])
    wanted = DBSCAN(eps=0.1, min_samples=5).fit_predict(points)
    made = make_pipeline(
        ours.RadiusNeighborsTransformer(radius=0.1),
        DBSCAN(eps=0.1, min_samples=5, metric="precomputed"),
    )
    assert np.array_equal(made.fit_predict(points), wanted)
    assert clone(made).get_params()["radiusneighborstransformer__radius"] == 0.1
