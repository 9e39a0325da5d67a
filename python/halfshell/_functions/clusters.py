# SPDX-License-Identifier: BSD-3-Clause
"""`clusters`: connected components and DBSCAN, with no pair stored."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from halfshell import _core, _show
from halfshell._convert.arrays import entries_of
from halfshell._convert.call import Call, take
from halfshell._convert.options import as_count
from halfshell._convert.points import flags_of
from halfshell._functions.pairs import pairs_wanted
from halfshell._search import search

if TYPE_CHECKING:
    from typing import Unpack

    from halfshell._convert.types import CutoffLike, FloatArray, Options, PointsLike


@search(lacks="indices")
def clusters(
    points: PointsLike, cutoff: CutoffLike = None, *, min_points: int = 1, **search: Unpack[Options]
) -> Clusters:
    """Group points into connected components, or into the clusters of DBSCAN.

    Parameters
    ----------
    {points, cutoff}
    min_points : int, default 1
        Number of points that must lie within the cutoff of a core point, itself included; each
        image counts. Two core points that form a pair are in the same cluster. Any other point is
        in the cluster of a core point within its cutoff (the first cluster, if there are several),
        or in none. With 1, all points are core points and clusters are connected components.
    {box, periodic, rule, exclude, min_distance, inclusive, threads, progress}

    Returns
    -------
    Clusters
        `labels` (n,), `sizes` (c,), `n_clusters`, `core` (n,) and `spans` (c, d), and the methods
        ``unwrap()`` and ``centers()``. Clusters are numbered in the order of their lowest core
        points, in a batch one system after the other. Nothing depends on kernel, threads or the
        order in which pairs are found.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `count_pairs`.

    Notes
    -----
    A cluster spans a box vector, or percolates along it, if a path of pairs from one of its core
    points, over other core points, leads to an image of that point shifted along this box vector;
    it may be shifted along others as well. The shifts of the pairs are added along the path, so it
    does not matter whether points are wrapped. [2]_

    Components are found with disjoint sets and path halving [3]_ during the search; no pair is
    stored. With `min_points` above 1 there are up to three searches: to count, to join, and to find
    clusters for points that are not core points. Labels are those of
    ``sklearn.cluster.DBSCAN(eps=cutoff, min_samples=min_points)``, whose distances are rounded.

    References
    ----------
    .. [1] M. Ester, H.-P. Kriegel, J. Sander, X. Xu, "A density-based algorithm for discovering
       clusters in large spatial databases with noise", KDD-96, 226-231 (1996).
    .. [2] J. Machta, Y. S. Choi, A. Lucke, T. Schweizer, L. V. Chayes, "Invaded cluster algorithm
       for Potts models", Phys. Rev. E 54, 1332 (1996).
    .. [3] R. E. Tarjan, J. van Leeuwen, "Worst-case analysis of set union algorithms", J. ACM 31,
       245-281 (1984).

    Examples
    --------
    A chain of points that closes around a periodic box, and one beside it that does not:

    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [0.0, 2.0], [3.0, 2.0]]
    >>> found = hs.clusters(points, 1.0, box=4.0)
    >>> found.labels.tolist(), found.sizes.tolist(), found.spans.tolist()
    ([0, 0, 0, 0, 1, 1], [4, 2], [[True, False], [False, False]])

    The second one made whole, and its centre:

    >>> found.unwrap()[4:].tolist(), found.centers()[1].tolist()
    ([[0.0, 2.0], [-1.0, 2.0]], [-0.5, 2.0])

    DBSCAN:

    >>> hs.clusters([[0.0], [0.5], [1.0], [2.0], [9.0]], 1.0, min_points=3).labels.tolist()
    [0, 0, 0, 0, -1]
    """
    least = as_count(min_points, "min_points")
    call = take(points, cutoff, **search)
    n, d = call.array.shape
    core = None
    algorithm = call.settings.algorithm
    if least > 1:
        core = call.run(_core.coordination, None, call.pairing, algorithm) >= least - 1
    has_images = bool(np.any(call.points._axes))
    count, labels, bits = call.run(_core.clusters, core, has_images, call.pairing, algorithm)
    return Clusters(
        labels,
        np.bincount(labels[labels >= 0] if core is not None else labels, minlength=count),
        np.ones(n, np.bool_) if core is None else core,
        flags_of(bits[:count], d) if has_images else np.zeros((count, d), np.bool_),
        call,
    )


class Clusters:
    """The clusters of points that `clusters` returns.

    Attributes
    ----------
    labels : ndarray of int64, shape (n,)
        The cluster of each point, from 0 on, in the order of their lowest core points; -1 for
        points that belong to none.
    sizes : ndarray of int64, shape (c,)
        Number of points in each cluster.
    n_clusters : int
        The number of clusters, c.
    core : ndarray of bool, shape (n,)
        Which points have `min_points` points within their cutoff, themselves included.
    spans : ndarray of bool, shape (c, d)
        Whether each cluster percolates along each box vector; False in open space.

    Examples
    --------
    >>> import halfshell as hs
    >>> found = hs.clusters([[0.0], [1.0], [5.0]], 1.5)
    >>> found.labels.tolist(), found.sizes.tolist(), found.n_clusters
    ([0, 0, 1], [2, 1], 2)
    """

    _shown = ("n_clusters", "sizes", "labels", "spans")
    __repr__ = _show.line
    _repr_html_ = _show.html

    def __init__(
        self,
        labels: npt.NDArray[np.int64],
        sizes: npt.NDArray[np.int64],
        core: npt.NDArray[np.bool_],
        spans: npt.NDArray[np.bool_],
        call: Call,
    ) -> None:
        self.labels, self.sizes, self.core, self.spans = labels, sizes, core, spans
        self._call = call

    @property
    def n_clusters(self) -> int:
        """The number of clusters."""
        return len(self.sizes)

    def unwrap(self) -> FloatArray:
        """Positions at which each cluster is whole.

        Returns
        -------
        ndarray of float64, shape (n, d)
            The positions, each shifted by whole box vectors, so that the points of a cluster that
            spans no box vector are all joined by pairs with S = 0. Its lowest core point stays
            where it is. Points of no cluster stay, and in clusters that span a box vector, which
            are never whole, one way of joining them is taken.

        Notes
        -----
        Pairs are searched for again, with their shifts, and followed breadth first. The points
        must not have changed since.
        """
        positions = np.array(self._call.array, np.float64)
        shifts = self._shifts()
        box = self._call.points.box
        if shifts is None or box is None:
            return positions
        moved: FloatArray = positions + self._moved(shifts, box)
        return moved

    def _moved(self, shifts: npt.NDArray[np.int64], box: FloatArray) -> FloatArray:
        """Shifts times the box vectors of each point's system."""
        if box.ndim == 3:
            box = box[self._call.points.batch]
        vectors = np.broadcast_to(box, (len(shifts), *box.shape[-2:]))
        found: FloatArray = np.einsum("nk,nkd->nd", shifts, vectors)
        return found

    def centers(self) -> FloatArray:
        """The mean of the unwrapped positions of each cluster.

        Returns
        -------
        ndarray of float64, shape (c, d)
            Weighted by the weights of the points, if they have some.
        """
        positions, weights = self.unwrap(), self._call.points.weights
        inside = self.labels >= 0
        labels = self.labels[inside]
        shares = np.ones(len(labels)) if weights is None else weights[inside]
        with np.errstate(invalid="ignore", divide="ignore"):
            total = np.bincount(labels, shares, self.n_clusters)
            sums = [
                np.bincount(labels, shares * column, self.n_clusters)
                for column in positions[inside].T
            ]
            return np.stack(sums, axis=1) / total[:, None]

    def _shifts(self) -> npt.NDArray[np.int64] | None:
        """By how many box vectors each point moves."""
        call = self._call
        if call.points.box is None:
            return None
        i, j, S = pairs_wanted(call, "ijS", True, 8, None)  # whatever found them
        both = self.core[i] & self.core[j]
        join = both & (i != j)
        core = np.flatnonzero(self.core & (self.labels >= 0))
        lowest = core[np.unique(self.labels[core], return_index=True)[1]]  # of each cluster
        shifts = _follow(len(call.array), i[join], j[join], S[join], lowest)
        # Points that are not core follow one core point of their cluster.
        for a, b, sign in ((i, j, 1), (j, i, -1)):
            lead = self.core[a] & ~self.core[b] & (self.labels[a] == self.labels[b])
            shifts[b[lead]] = shifts[a[lead]] + sign * S[lead]
        return shifts


def _follow(
    n: int,
    i: npt.NDArray[Any],
    j: npt.NDArray[Any],
    S: npt.NDArray[Any],
    starts: npt.NDArray[np.int64],
) -> npt.NDArray[np.int64]:
    """Shifts of all points that are reached from these, breadth first, so that pairs have S = 0."""
    source, target = np.concatenate([i, j]), np.concatenate([j, i])
    steps = np.concatenate([S, -S]).astype(np.int64)
    order = np.argsort(source, kind="stable")
    source, target, steps = source[order], target[order], steps[order]
    begins = np.searchsorted(source, np.arange(n + 1))
    shifts = np.zeros((n, S.shape[1]), np.int64)
    seen = np.zeros(n, bool)
    seen[starts] = True
    front = starts
    while len(front):
        edges = entries_of(begins, front)[1]
        edges = edges[~seen[target[edges]]]
        front, first = np.unique(target[edges], return_index=True)
        edges = edges[first]
        shifts[front] = shifts[source[edges]] + steps[edges]
        seen[front] = True
    return shifts


