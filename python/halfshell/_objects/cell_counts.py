# SPDX-License-Identifier: BSD-3-Clause
"""The methods of `CellList` that return numbers of pairs, and no pair."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack, overload

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.lengths import as_cutoffs, as_edges
from halfshell._functions.counts import count_within
from halfshell._functions.histogram import as_marks, binned
from halfshell._objects.kept_cells import Asking, KeptCells


class CellCounts(KeptCells):
    """Counts among the points in cells."""

    __slots__ = ()

    @overload
    def count_pairs(
        self,
        cutoff: float | np.floating[Any] | np.integer[Any] | None = None,
        *,
        queries: Any = None,
        **options: Unpack[Asking],
    ) -> int: ...
    @overload
    def count_pairs(
        self,
        cutoff: Sequence[float] | npt.NDArray[Any],
        *,
        queries: Any = None,
        **options: Unpack[Asking],
    ) -> npt.NDArray[np.int64]: ...
    def count_pairs(
        self, cutoff: Any = None, *, queries: Any = None, **options: Unpack[Asking]
    ) -> int | npt.NDArray[np.int64]:
        """Count the pairs within one or several cutoffs, as `halfshell.count_pairs` does.

        Parameters
        ----------
        cutoff : float or array_like of float, shape (k,), optional
            One, or several in ascending order. Default: that of the list.
        queries : array_like of float, shape (q, d), optional
            Count pairs of a query and a point instead.
        inclusive, kernel, threads, memory_limit
            As in `halfshell.count_pairs`.

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
        search = self._arguments(cutoffs if isinstance(cutoffs, float) else None, options)
        if not isinstance(cutoffs, float):
            return count_within(cutoffs, self._cells, None, 0, search[4:], asking)
        if asking is None:
            return _core.count_pairs(*search)
        return _core.count_between(*search, asking)

    def coordination(
        self, cutoff: Any = None, *, queries: Any = None, **options: Unpack[Asking]
    ) -> npt.NDArray[np.int64]:
        """Count the neighbours of each point, or of each query.

        Parameters
        ----------
        cutoff : float, optional
            Default: that of the list.
        queries, inclusive, kernel, threads, memory_limit
            As in `count_pairs`.

        Returns
        -------
        ndarray of int64, shape (n,) or (q,)

        Examples
        --------
        >>> import halfshell as hs
        >>> hs.CellList([[0.0], [1.0], [3.0]], 2.0).coordination().tolist()
        [1, 2, 1]
        """
        asking = None if queries is None else self._queries(queries)
        return _core.coordination(*self._arguments(cutoff, options), asking)

    def histogram(
        self,
        edges: npt.ArrayLike,
        *,
        queries: Any = None,
        types: npt.ArrayLike | None = None,
        query_types: npt.ArrayLike | None = None,
        weights: npt.ArrayLike | None = None,
        query_weights: npt.ArrayLike | None = None,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
    ) -> npt.NDArray[np.int64] | npt.NDArray[np.float64]:
        """Sort the pairs into bins by their distance, as `halfshell.pair_histogram` does.

        Parameters
        ----------
        edges : array_like of float, shape (bins + 1,)
            Limits of the bins. The last one may be larger than the cutoff of the list: that costs
            a search of its own.
        queries, types, query_types, weights, query_weights
            As in `halfshell.pair_histogram`.
        kernel, threads, memory_limit
            As in `halfshell.pair_histogram`; `threads` None: as many as the list was made with.

        Returns
        -------
        ndarray of int64, or with weights float64
            Shape (bins,), or (t, t, bins) with types. Always decided exactly, whatever `precision`
            the list was made with.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 3.0)
        >>> cells.histogram([0.0, 1.0, 2.0, 3.0]).tolist()
        [0, 1, 2]
        >>> cells.histogram([0.0, 1.5, 3.0], weights=[1.0, -1.0, 0.5]).tolist()
        [-1.0, 0.0]
        """
        asking = None if queries is None else self._queries(queries)
        limits = as_edges(edges)
        marks = as_marks(
            self._n_points, asking, types, query_types, weights, query_weights
        )
        own: Asking = {"inclusive": False, "kernel": kernel, "memory_limit": memory_limit}
        if threads is not None:
            own["threads"] = threads
        return binned(self._arguments(None, own), limits, asking, marks)
