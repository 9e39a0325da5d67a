# SPDX-License-Identifier: BSD-3-Clause
"""Graphs of neighbours in place of those of ``sklearn.neighbors``.

The transformers are subclasses of scikit-learn's, with its parameters, attributes, checks and
sparse matrices, and its rule: a sample is a neighbour if its distance is at most the radius
(``<=``). Here that is decided for the exact values of the floats, and no tree is built.

Euclidean distances of dense samples with at most 8 features are found by `halfshell`; other metrics
and more features go on to scikit-learn.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from joblib import effective_n_jobs
from scipy import sparse
from sklearn import neighbors as _owner
from sklearn.utils.validation import check_is_fitted, validate_data

import halfshell as hs

__all__ = ["KNeighborsTransformer", "RadiusNeighborsTransformer"]

try:  # what scikit-learn returns: an array or a matrix, by its configuration
    from sklearn.utils._sparse import _align_api_if_sparse as _as_configured
except ImportError:  # before 1.9

    def _as_configured(graph: Any) -> Any:
        return sparse.csr_matrix(graph)


_MOST_FEATURES = 8


class _Graphs:
    """What both transformers share; ``super()`` is the transformer of scikit-learn."""

    def _fit(self: Any, X: Any, y: Any = None) -> Any:
        """Fit, without building a tree where no method here would use it."""
        algorithm = self.algorithm
        if self._goes_by_distance() and algorithm in ("auto", "kd_tree", "ball_tree"):
            shape: tuple[int, ...] = tuple(getattr(X, "shape", ()))
            few = len(shape) == 2 and 0 < shape[1] <= _MOST_FEATURES
            self.algorithm = "brute" if few else algorithm
        try:
            return super()._fit(X, y)  # type: ignore[misc]
        finally:
            self.algorithm = algorithm

    def _goes_by_distance(self: Any) -> bool:
        of_points = self.metric == "euclidean" or (self.metric == "minkowski" and self.p == 2)
        return of_points and self.metric_params is None

    def _samples(self: Any, X: Any) -> tuple[Any, Any] | None:
        """Samples that were fitted and those that ask, or None where scikit-learn is to search."""
        check_is_fitted(self)
        own = self._fit_X
        usual = self._goes_by_distance() and not sparse.issparse(own) and not sparse.issparse(X)
        if not usual or own.shape[1] > _MOST_FEATURES or own.dtype not in (np.float32, np.float64):
            return None
        if X is None:
            return own, None
        return own, validate_data(self, X, dtype=own.dtype, reset=False, order="C")

    def _within(self: Any, X: Any, radius: Any, quantities: str) -> Any:
        """The table of samples within the radius, or None where scikit-learn is to search."""
        samples = self._samples(X)
        radius = self.radius if radius is None else radius
        if samples is None or not radius >= 0.0:  # there it has no neighbours
            return None
        own, asking = samples
        return hs.neighbors(
            own, float(radius), queries=asking, quantities=quantities,
            threads=effective_n_jobs(self.n_jobs),
        )  # fmt: skip

    def _nearest(self: Any, X: Any, n_neighbors: Any) -> tuple[Any, Any] | None:
        """Numbers and distances of the nearest samples, or None where scikit-learn is to search."""
        samples = self._samples(X)
        k = self.n_neighbors if n_neighbors is None else n_neighbors
        most = self.n_samples_fit_ - (X is None) if samples is not None else 0
        if samples is None or not isinstance(k, int | np.integer) or not 0 < k <= most:
            return None
        own, asking = samples
        found: tuple[Any, Any] = hs.nearest(
            own, int(k), queries=asking, quantities="jd", threads=effective_n_jobs(self.n_jobs)
        )
        return found

    def _graph(self: Any, data: Any, indices: Any, starts: Any) -> Any:
        # Copies: matrices are the caller's to change.
        data = np.ones(len(indices)) if data is None else np.array(data)
        shape = (len(starts) - 1, self.n_samples_fit_)
        columns = data, np.array(indices), np.array(starts)
        return _as_configured(sparse.csr_array(columns, shape=shape))


def _in_rows(column: Any, starts: Any) -> Any:
    """An array of arrays, which are the caller's to change."""
    column, ends = np.array(column), starts.tolist()
    rows = np.empty(len(ends) - 1, object)
    rows[:] = [column[a:b] for a, b in pairwise(ends)]
    return rows


class RadiusNeighborsTransformer(_Graphs, _owner.RadiusNeighborsTransformer):
    """A subclass of ``sklearn.neighbors.RadiusNeighborsTransformer``, which documents it.

    Rows ascend by distance, and neighbours at one distance by their number; with mode
    "connectivity" by their number alone.

    Examples
    --------
    >>> from halfshell.compat.sklearn import RadiusNeighborsTransformer
    >>> graph = RadiusNeighborsTransformer(radius=1.5).fit_transform([[0.0], [1.0], [3.0]])
    >>> graph.toarray().tolist()
    [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    """

    def radius_neighbors_graph(
        self,
        X: Any = None,
        radius: float | None = None,
        mode: str = "connectivity",
        sort_results: bool = False,
    ) -> Any:
        """The graph of samples within the radius, as scikit-learn documents it."""
        letters = {"distance": "jd", "connectivity": "j"}.get(mode)
        table = self._within(X, radius, letters) if letters is not None else None
        if table is None:
            return super().radius_neighbors_graph(X, radius, mode, sort_results)
        if sort_results and mode == "distance":
            table = table.sort(by="distance")
        data = table.distances if mode == "distance" else None
        return self._graph(data, table.indices, table.offsets)

    def radius_neighbors(
        self,
        X: Any = None,
        radius: float | None = None,
        return_distance: bool = True,
        sort_results: bool = False,
    ) -> Any:
        """Neighbours within the radius, as scikit-learn documents it; rows ascend by number."""
        is_usual = return_distance or not sort_results
        table = self._within(X, radius, "jd" if return_distance else "j") if is_usual else None
        if table is None:
            return super().radius_neighbors(X, radius, return_distance, sort_results)
        if sort_results:
            table = table.sort(by="distance")
        starts = table.offsets
        if not return_distance:
            return _in_rows(table.indices, starts)
        return _in_rows(table.distances, starts), _in_rows(table.indices, starts)


class KNeighborsTransformer(_Graphs, _owner.KNeighborsTransformer):
    """A subclass of ``sklearn.neighbors.KNeighborsTransformer``, which documents it.

    Rows ascend by distance, and neighbours at one distance by their number.

    Examples
    --------
    >>> from halfshell.compat.sklearn import KNeighborsTransformer
    >>> graph = KNeighborsTransformer(n_neighbors=1).fit_transform([[0.0], [1.0], [3.0]])
    >>> graph.toarray().tolist()
    [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]
    """

    def kneighbors_graph(
        self, X: Any = None, n_neighbors: int | None = None, mode: str = "connectivity"
    ) -> Any:
        """The graph of the nearest samples, as scikit-learn documents it."""
        found = self._nearest(X, n_neighbors) if mode in ("distance", "connectivity") else None
        if found is None:
            return super().kneighbors_graph(X, n_neighbors, mode)  # also for its errors
        j, d = found
        starts = np.arange(0, j.size + 1, j.shape[1])
        return self._graph(d.ravel() if mode == "distance" else None, j.ravel(), starts)

    def kneighbors(
        self, X: Any = None, n_neighbors: int | None = None, return_distance: bool = True
    ) -> Any:
        """The nearest samples, as scikit-learn documents it."""
        found = self._nearest(X, n_neighbors)
        if found is None:
            return super().kneighbors(X, n_neighbors, return_distance)
        j, d = found
        return (d, j) if return_distance else j
