# SPDX-License-Identifier: BSD-3-Clause
"""`rdf`: the radial distribution function, a histogram over that of an ideal gas."""

from __future__ import annotations

from typing import Any, Never

import numpy as np
import numpy.typing as npt

from halfshell._convert.batch import check_no_batch
from halfshell._convert.foreign import is_a, shown
from halfshell._convert.given import Chosen
from halfshell._convert.lengths import as_positive
from halfshell._convert.marks import as_named_marks, binned
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.options import as_count
from halfshell._convert.search import as_rest, as_search
from halfshell._convert.selection import with_selection
from halfshell._convert.types import (
    BoxLike,
    FloatArray,
    Number,
    PeriodicLike,
    PointsLike,
)
from halfshell._functions.ideal_gas import (
    centers,
    in_shells,
    known_types,
    partners,
    refuse_types,
    shell_shares,
)
from halfshell._objects.radial_distribution import RadialDistribution
from halfshell._unknown import refuse_unknown

_COLUMNS = 12  # of a result without types, and what makes them


def rdf(
    points: PointsLike,
    r_max: Number,
    bins: int = 100,
    *,
    queries: PointsLike | None = None,
    types: npt.ArrayLike | None = None,
    query_types: npt.ArrayLike | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
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
) -> RadialDistribution:
    """Compute the radial distribution function g(r) of a periodic box; counts are always exact.

    Parameters
    ----------
    points, kernel, threads, memory_limit
        As in `pair_histogram`.
    r_max : float
        The largest distance, in the unit of `points`; finite, greater than 0. It may exceed half
        the box, and the whole box: all images are counted.
    bins : int, default 100
        Bins of equal width from 0 to `r_max`.
    queries : array_like of float, shape (q, d), optional
        Compute g(r) of the points around these instead. A query that coincides with a point finds
        it at distance 0, in the first bin.
    types : array_like of int or str, shape (n,), optional
        The type of each point, a number from 0 on or a name, such as ``atoms.symbols`` in ASE, to
        compute g(r) for each pair of types. Names are in ascending order.
    query_types : array_like of int or str, shape (q,), optional
        The types of the queries; needed with both `types` and `queries`. [a, b] is then g(r) of
        points of type b around queries of type a.
    box : float, array_like of float, shape (d,) or (d, d), or Box
        As in `pairs`. It must be periodic along every axis, as g(r) needs a density.
    periodic : bool or sequence of bool, shape (d,), optional
        As in `pairs`; all True, which is the default.
    groups, query_groups, exclude, query_exclude, exclude_within
        Which pairs count, as in `pair_histogram`: with molecules as `exclude`, g(r) is between
        molecules; as `groups`, within them. Both are relative to the same ideal gas, of all pairs.
    batch : array_like of int, shape (n,), optional
        Many systems in one call, as in `pair_histogram`; each system with points counts as a
        frame, and the result is their average.
    query_batch : array_like of int, shape (q,), optional
        The system of each query, ascending; with `batch` and `queries`, and only then.

    Returns
    -------
    RadialDistribution
        An object with ``r``, ``g``, ``counts``, ``edges``, the coordination numbers ``n_r``,
        ``types`` and ``plot()``. To average over frames, add their results:
        ``sum(rdf(x, 5.0, box=box) for x in frames)``.

        g is the mean number of neighbours in a shell divided by the number that the density n / V
        of all points would put there: ``2 counts / (n * n / V * shell)``. For [a, b] with two
        different types it is ``counts / (n_a * n_b / V * shell)``, for queries
        ``counts / (q * n / V * shell)``, with types ``counts / (q_a * n_b / V * shell)``. It is 0
        where counts are 0, even if n_a or n_b is 0. A shell is the length, area, volume, ...
        between two spheres, in any number of dimensions.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pair_histogram`; ValueError also without a box, if an axis is not periodic, or if
        `r_max` or `bins` is not positive.

    See Also
    --------
    pair_histogram : counts only, in bins of any width, in any box or in open space.

    Notes
    -----
    n random points have n (n - 1) / 2 pairs in their box, not n**2 / 2, so below half the box
    their g is (n - 1) / n on average; for large r, where all images count, it tends to 1.

    Examples
    --------
    >>> import numpy as np
    >>> import halfshell as hs
    >>> points = np.random.default_rng(0).random((2000, 3))
    >>> result = hs.rdf(points, 0.4, bins=4, box=[1.0, 1.0, 1.0])
    >>> result.r.tolist()
    [0.05, 0.15000000000000002, 0.25, 0.35000000000000003]
    >>> bool(abs(result.g - 1.0).max() < 0.05)
    True
    >>> int(result.counts.sum()) == hs.count_pairs(points, 0.4, box=[1.0, 1.0, 1.0])
    True

    By type name, averaged over ten frames:

    >>> names = np.where(np.arange(2000) < 500, "Si", "O")
    >>> frames = np.random.default_rng(1).random((10, 2000, 3))
    >>> result = sum(hs.rdf(x, 0.4, 4, types=names, box=[1.0, 1.0, 1.0]) for x in frames)
    >>> result.types, result.n_frames
    (('O', 'Si'), 10)
    >>> partial = result["Si", "O"]
    >>> bool(abs(partial.g - 1.0).max() < 0.02)
    True
    >>> partial.n_r.round().tolist()  # oxygens within 0.1, 0.2, 0.3 and 0.4 of a silicon
    [6.0, 50.0, 170.0, 402.0]
    """
    if unknown:
        refuse_unknown(rdf, unknown)
    edges = _edges(r_max, bins)
    chosen = Chosen(groups, exclude, exclude_within, None, query_groups, query_exclude)
    if batch is not None:
        from halfshell._functions.rdf_of_systems import rdf_of_systems  # here: few need it

        rest = as_rest(False, "exact", kernel, memory_limit, None, threads)
        return rdf_of_systems(
            points, edges, box, periodic, batch, rest, chosen, queries, query_batch, types,
            query_types,
        )  # fmt: skip
    check_no_batch(query_batch)
    search, asking = as_search(
        points, 0.0, box, periodic, False, "exact", kernel, memory_limit, None, threads, queries
    )
    n, shares = len(search[0]), shell_shares(search[2], search[3], edges)
    marks, names = as_named_marks(n, asking, types, query_types)
    selection = with_selection(None, chosen, n, None if asking is None else len(asking))
    refuse_types(marks, len(shares))
    found = binned(search, edges, asking, marks, "r_max", selection=selection)
    counts = found.astype(np.int64, copy=False)
    expected = in_shells(partners(n, None if asking is None else len(asking), marks), shares)
    return RadialDistribution(
        counts, edges, known_types(marks, names), expected, centers(n, asking, marks),
        is_half=asking is None,
    )  # fmt: skip


def _edges(r_max: Any, bins: Any) -> FloatArray:
    if is_a(bins, (list, tuple, np.ndarray)):
        raise TypeError(
            f"bins must be a whole number, got {shown(bins)}: pair_histogram takes edges"
        )
    n_bins = as_count(bins, "bins")
    largest = as_positive(r_max, "r_max")
    # Of float64: edges, what numpy needs to make them, r, g and the shells.
    refuse_unavailable(_COLUMNS * 8 * n_bins, "r, g and counts for so many bins")
    return np.linspace(0.0, largest, n_bins + 1)
