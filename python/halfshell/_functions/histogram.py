# SPDX-License-Identifier: BSD-3-Clause
"""`pair_histogram`: signature, arguments and documentation; the work is done in C."""

from __future__ import annotations

from typing import Never

import numpy as np
import numpy.typing as npt

from halfshell._convert.batch import as_systems, check_no_batch
from halfshell._convert.given import Chosen, Given
from halfshell._convert.lengths import as_edges
from halfshell._convert.marks import as_marks, binned
from halfshell._convert.search import as_rest, as_search
from halfshell._convert.selection import with_selection
from halfshell._convert.types import Algorithm, BoxLike, PeriodicLike, PointsLike
from halfshell._unknown import refuse_unknown


def pair_histogram(
    points: PointsLike,
    edges: npt.ArrayLike,
    *,
    queries: PointsLike | None = None,
    types: npt.ArrayLike | None = None,
    query_types: npt.ArrayLike | None = None,
    weights: npt.ArrayLike | None = None,
    query_weights: npt.ArrayLike | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    algorithm: Algorithm = "auto",
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    groups: npt.ArrayLike | None = None,
    query_groups: npt.ArrayLike | None = None,
    exclude: npt.ArrayLike | None = None,
    query_exclude: npt.ArrayLike | None = None,
    exclude_within: int | None = None,
    batch: npt.ArrayLike | None = None,
    query_batch: npt.ArrayLike | None = None,
    **unknown: Never,
) -> npt.NDArray[np.int64] | npt.NDArray[np.float64]:
    """Count pairs in bins of distance, always exact, without storing them.

    Parameters
    ----------
    points, box, periodic, algorithm, kernel, threads
        As in `pairs`.
    edges : array_like of float, shape (bins + 1,)
        Limits of the bins in ascending order, in the unit of `points`; finite, not negative, any
        spacing: ``np.linspace(0, 10, 101)``, ``np.geomspace(0.1, 10, 51)``. The largest is the
        cutoff and may be larger than the box. Pairs closer than the first edge are not counted.
    queries : array_like of float, shape (q, d), optional
        Coordinates of queries: count pairs of a query and a point instead, as `pairs_between`
        finds them.
    types : array_like of int or str, shape (n,), optional
        The type of each point, a number from 0 on or a name: one histogram for each pair of types.
    query_types : array_like of int or str, shape (q,), optional
        The types of the queries; needed with both `types` and `queries`.
    weights : array_like of float, shape (n,), optional
        Add up the product of the weights of both points instead of counting; finite.
    query_weights : array_like of float, shape (q,), optional
        The weights of the queries. If only one set has weights, those of the other are 1.
    memory_limit : float, optional
        Bytes that the search and the counts of each thread may take.
    groups, exclude, exclude_within
        As in `pairs`.
    query_groups, query_exclude : array_like of int or str, shape (q,), optional
        Labels of the queries, in addition to those of the points. With queries, each pair of
        numbers in `exclude` is a query and a point.
    batch : array_like of int, shape (n,), optional
        Many systems in one call, as in `pairs`: the system of each point, ascending. Only points
        of the same system pair. The first axis of the result is then the system: those for which
        `box` is given, or up to the largest number.
    query_batch : array_like of int, shape (q,), optional
        The system of each query, ascending; with `batch` and `queries`, and only then.

    Returns
    -------
    ndarray of int64, or with weights float64
        Shape (bins,), or (t, t, bins) with types, where t is one more than the largest type. If
        types are names, each has an entry, in the ascending order of ``np.unique``.

        Bins are half-open except the last, which is closed, as in ``numpy.histogram``: bin k counts
        ``edges[k] <= d < edges[k + 1]``, with each pair decided exactly for the real values of all
        inputs. A bin between two equal edges is empty, unless it is the last one.

        Without queries each pair counts once (half list). Entry [a, b] then counts the pairs of a
        point of type a with one of type b, whichever comes first: [b, a] is the same, and the
        number of all pairs is the sum over ``a <= b``. With queries [a, b] counts queries of type
        a with points of type b.

        Weighted sums are exact and rounded once: they are the float64 nearest to the real sum of
        the real products.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pairs` and `pairs_between`; ValueError also if there are fewer than two edges, or
        edges are negative, not finite or not ascending; if a type is negative or a weight not
        finite, or there is not one for each point; if only one set has types; or if the types,
        weights or labels of queries are given without queries.

    See Also
    --------
    count_pairs : cumulative counts.
    rdf : the histogram divided by that of an ideal gas.

    Notes
    -----
    Bins are found from float32 squares with a proven error bound; only pairs too close to an edge
    to tell are decided again, as in `pairs`. So neither the kernel nor the number of threads
    changes the result. The memory needed is that of the bins, once for each thread.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]  # distances 1, 2 and 3
    >>> hs.pair_histogram(points, [0.0, 1.0, 2.0, 3.0]).tolist()
    [0, 1, 2]
    >>> hs.pair_histogram(points, [0.0, 1.5, 3.0], types=[0, 1, 1]).tolist()
    [[[0, 0], [1, 1]], [[1, 1], [0, 1]]]
    >>> hs.pair_histogram(points, [0.0, 1.5, 3.0], weights=[1.0, -1.0, 0.5]).tolist()
    [-1.0, 0.0]
    """
    if unknown:
        refuse_unknown(pair_histogram, unknown)
    chosen = Chosen(groups, exclude, exclude_within, None, query_groups, query_exclude)
    if batch is not None:
        scene, own, selection, asking = as_systems(
            points, 0.0, box, periodic, batch, Given(), chosen, "exact", queries, query_batch
        )
        marks = as_marks(len(scene[0]), asking, types, query_types, weights, query_weights)
        rest = as_rest(False, "exact", kernel, memory_limit, None, threads)
        return binned(
            (*scene, *rest), as_edges(edges), asking, marks, algorithm=algorithm,
            selection=selection, systems=own,
        )  # fmt: skip
    check_no_batch(query_batch)
    search, asking = as_search(
        points, 0.0, box, periodic, False, "exact", kernel, memory_limit, None, threads, queries
    )
    marks = as_marks(len(search[0]), asking, types, query_types, weights, query_weights)
    n_asking = None if asking is None else len(asking)
    selection = with_selection(None, chosen, len(search[0]), n_asking)
    return binned(
        search, as_edges(edges), asking, marks, algorithm=algorithm, selection=selection
    )
