# SPDX-License-Identifier: BSD-3-Clause
"""The methods of `CellList` that return numbers of pairs, and no pair."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypedDict, Unpack, overload

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.lengths import as_cutoffs, as_edges
from halfshell._convert.marks import as_marks, binned
from halfshell._convert.options import AUTO
from halfshell._convert.own_rows import check_alone, rows_of_points
from halfshell._convert.search import count_within
from halfshell._convert.types import Number, PointsLike
from halfshell._objects.kept_cells import KeptCells


class _CountOptions(TypedDict, total=False):
    """For overloads: the keywords of `count_pairs`."""

    queries: PointsLike | None
    inclusive: bool
    kernel: str | None
    threads: int | None
    memory_limit: float | None


class CellCounts(KeptCells):
    """Counts among the points in cells."""

    __slots__ = ()

    @overload
    def count_pairs(
        self, cutoff: Number | None = None, **options: Unpack[_CountOptions]
    ) -> int: ...
    @overload
    def count_pairs(
        self, cutoff: Sequence[float] | npt.NDArray[Any], **options: Unpack[_CountOptions]
    ) -> npt.NDArray[np.int64]: ...
    def count_pairs(
        self,
        cutoff: npt.ArrayLike | None = None,
        *,
        queries: PointsLike | None = None,
        inclusive: bool = True,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
    ) -> int | npt.NDArray[np.int64]:
        """Count the pairs within one or several cutoffs, as `halfshell.count_pairs` does.

        Parameters
        ----------
        cutoff : float or array_like of float, shape (k,), optional
            One, or several in ascending order. Default: that of the list.
        queries : array_like of float, shape (q, d), optional
            Count pairs of a query and a point instead.
        inclusive, kernel, memory_limit
            As in `halfshell.count_pairs`.
        threads : int, optional
            As in `halfshell.count_pairs`. Default: that of the list.

        Returns
        -------
        int or ndarray of int64, shape (k,)

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0)
        >>> cells.count_pairs(), cells.count_pairs(1.0), cells.count_pairs(queries=[[2.0]])
        (2, 1, 3)
        >>> cells.count_pairs([0.5, 1.0, 2.0]).tolist()
        [0, 1, 2]
        """
        cutoffs = self._cutoff if cutoff is None else as_cutoffs(cutoff)
        asking = None if queries is None else self._queries(queries)
        reach = cutoffs if isinstance(cutoffs, float) else None
        search = self._arguments(reach, (inclusive, kernel, threads, memory_limit))
        if not isinstance(cutoffs, float):
            return count_within(cutoffs, self._cells, None, 0, search[4:], asking)
        if asking is None:
            return _core.count_pairs(*search, None, AUTO)
        return _core.count_between(*search, asking, None, AUTO)

    def coordination(
        self,
        cutoff: Number | None = None,
        *,
        queries: PointsLike | None = None,
        inclusive: bool = True,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
        indices: npt.ArrayLike | None = None,
    ) -> npt.NDArray[np.int64]:
        """Count the neighbours of each point, or of each query.

        Parameters
        ----------
        cutoff : float, optional
            Default: that of the list.
        queries, inclusive, kernel, threads, memory_limit
            As in `count_pairs`.
        indices : array_like of int, shape (r,), optional
            As in `halfshell.coordination`.

        Returns
        -------
        ndarray of int64, shape (n,), (q,) or (r,)

        Examples
        --------
        >>> import halfshell as hs
        >>> hs.CellList([[0.0], [1.0], [3.0]], 2.0).coordination().tolist()
        [1, 2, 1]
        """
        options = inclusive, kernel, threads, memory_limit
        search = self._arguments(cutoff, options)
        if indices is not None:
            check_alone(queries)
            points = self._origin.scene()[0]
            (offsets, _), _, _ = rows_of_points(search, points, indices, "j", 4, None, AUTO)
            return np.diff(offsets)
        asking = None if queries is None else self._queries(queries)
        return _core.coordination(*search, asking, None, AUTO)

    def pair_histogram(
        self,
        edges: npt.ArrayLike,
        *,
        queries: PointsLike | None = None,
        types: npt.ArrayLike | None = None,
        query_types: npt.ArrayLike | None = None,
        weights: npt.ArrayLike | None = None,
        query_weights: npt.ArrayLike | None = None,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
    ) -> npt.NDArray[np.int64] | npt.NDArray[np.float64]:
        """Count the pairs by distance, as `halfshell.pair_histogram` does; always exact.

        Parameters
        ----------
        edges : array_like of float, shape (bins + 1,)
            Limits of the bins. The last one may be larger than the cutoff of the list: that costs
            a search of its own.
        queries, types, query_types, weights, query_weights
            As in `halfshell.pair_histogram`.
        kernel, memory_limit
            As in `halfshell.pair_histogram`.
        threads : int, optional
            As in `halfshell.pair_histogram`. Default: that of the list.

        Returns
        -------
        ndarray of int64, or with weights float64
            Shape (bins,), or (t, t, bins) with types. The `precision` of the list plays no part.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 3.0)
        >>> cells.pair_histogram([0.0, 1.0, 2.0, 3.0]).tolist()
        [0, 1, 2]
        >>> cells.pair_histogram([0.0, 1.5, 3.0], weights=[1.0, -1.0, 0.5]).tolist()
        [-1.0, 0.0]
        """
        asking = None if queries is None else self._queries(queries)
        limits = as_edges(edges)
        marks = as_marks(
            self._n_points, asking, types, query_types, weights, query_weights
        )
        search = self._arguments(None, (False, kernel, threads, memory_limit))
        return binned(search, limits, asking, marks)

    #: A shorter name for it.
    histogram = pair_histogram
