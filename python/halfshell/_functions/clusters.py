# SPDX-License-Identifier: BSD-3-Clause
"""`clusters`: connected components and DBSCAN, with no pair stored; done in C."""

from __future__ import annotations

from typing import Never

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.given import Given
from halfshell._convert.options import as_count, as_flag
from halfshell._convert.scene import flags_of
from halfshell._convert.search import as_rest, as_search_of_each
from halfshell._convert.types import (
    Algorithm,
    ArrayLike,
    BoxLike,
    PairCutoff,
    PeriodicLike,
    PointsLike,
    Precision,
    Rule,
)
from halfshell._objects.clusters import Clusters
from halfshell._unknown import refuse_unknown


def clusters(
    points: PointsLike,
    cutoff: PairCutoff,
    *,
    min_points: int = 1,
    winding: bool = False,
    radii: ArrayLike | None = None,
    rule: Rule | None = None,
    types: npt.ArrayLike | None = None,
    supports: ArrayLike | None = None,
    extent: float | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    inclusive: bool = True,
    precision: Precision = "exact",
    algorithm: Algorithm = "auto",
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    **unknown: Never,
) -> Clusters:
    """Group points into connected components, or into the clusters of DBSCAN.

    Parameters
    ----------
    points, cutoff, radii, rule, types, supports, extent, box, periodic
        As in `pairs`, whose pairs are the edges of the graph.
    min_points : int, default 1
        Number of points that must lie within the cutoff of a core point, itself included; each
        image counts. Two core points that form a pair are in the same cluster. Any other point is
        in the cluster of a core point within its cutoff (the first cluster, if there are several),
        or in none. With 1, all points are core points and clusters are connected components.
    winding : bool, default False
        Whether to find the box vectors along which each cluster winds.
    inclusive, precision, algorithm, kernel, threads
        As in `pairs`. Several threads sort the points and count; one joins the pairs.
    memory_limit : float, optional
        Bytes that the search may take, including its notes for each point: 4 bytes, or 5 + 4 d
        with `winding` in a periodic box.

    Returns
    -------
    Clusters
        `labels` (n,), `sizes` (c,), `core` (n,) and `winding` (c, d) or None. Clusters are
        numbered in the order of their lowest core points. Nothing depends on kernel, threads or
        the order in which pairs are found.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pairs`; MemoryError only if the search itself would not fit. ValueError if
        `min_points` is less than 1.

    See Also
    --------
    coordination : the number of neighbours of each point.
    for_each_pair : pass each pair to a function.

    Notes
    -----
    A cluster winds along a box vector if a path of pairs from one of its core points, over other
    core points, leads to an image of that point shifted along this box vector; it may be
    shifted along others as well. In a simulation such a cluster percolates. The shifts of the
    pairs are added along the path, so it does not matter whether points are wrapped. [2]_

    Components are found with disjoint sets and path halving [3]_ during the search; no pair is
    stored. With `min_points` above 1 there are up to three searches: to count, to join,
    and to find clusters for points that are not core points. Labels are those of
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
    >>> points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [0.0, 2.0], [1.0, 2.0]]
    >>> found = hs.clusters(points, 1.0, box=[4.0, 4.0], winding=True)
    >>> found.labels.tolist(), found.sizes.tolist(), found.winding.tolist()
    ([0, 0, 0, 0, 1, 1], [4, 2], [[True, False], [False, False]])

    DBSCAN:

    >>> hs.clusters([[0.0], [0.5], [1.0], [2.0], [9.0]], 1.0, min_points=3).labels.tolist()
    [0, 0, 0, 0, -1]
    """
    if unknown:
        refuse_unknown(clusters, unknown)
    least = as_count(min_points, "min_points")
    with_winding = as_flag(winding, "winding")
    rest = as_rest(inclusive, precision, kernel, memory_limit, None, threads)
    given = Given(radii, None, rule, types, None, supports, None, extent)
    search, _, reach = as_search_of_each(points, cutoff, box, periodic, rest, given)
    n, d = search[0].shape
    core = None
    if least > 1:
        core = _core.coordination(*search, None, reach, algorithm) >= least - 1
    count, labels, bits = _core.clusters(*search, core, with_winding, reach, algorithm)
    return Clusters(
        labels,
        np.bincount(labels[labels >= 0] if core is not None else labels, minlength=count),
        np.ones(n, np.bool_) if core is None else core,
        None if bits is None else flags_of(bits[:count], d),
    )
