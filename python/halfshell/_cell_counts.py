# SPDX-License-Identifier: BSD-3-Clause
"""The methods of `CellList` that return numbers of pairs, and no pair."""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._cell_layout import Asking, CellLayout


class CellCounts(CellLayout):
    """Counts among the points in cells."""

    __slots__ = ()

    def count_pairs(
        self, cutoff: Any = None, *, queries: Any = None, **options: Unpack[Asking]
    ) -> int:
        """Count the pairs within a cutoff, as `halfshell.count_pairs` does.

        Parameters
        ----------
        cutoff : float, optional
            Default: that of the list.
        queries : array_like of float, shape (q, d), optional
            Count pairs of a query and a point instead.
        inclusive, kernel, threads, memory_limit
            As in `halfshell.count_pairs`.

        Returns
        -------
        int

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0)
        >>> cells.count_pairs(), cells.count_pairs(1.0), cells.count_pairs(queries=[[2.0]])
        (2, 1, 3)
        """
        if queries is None:
            return _core.count_pairs(*self._arguments(cutoff, options))
        return _core.count_between(*self._arguments(cutoff, options), self._queries(queries))

    def coordination(
        self, cutoff: Any = None, *, queries: Any = None, **options: Unpack[Asking]
    ) -> npt.NDArray[np.int64]:
        """Count the neighbours of each point, or of each query.

        Parameters
        ----------
        cutoff, queries, inclusive, kernel, threads, memory_limit
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
