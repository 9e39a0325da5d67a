# SPDX-License-Identifier: BSD-3-Clause
"""Points in cells as the methods of `CellList` share them, and what the core takes for them."""

from __future__ import annotations

from typing import Any

from halfshell._convert.lengths import as_cutoff
from halfshell._convert.scene import as_queries, check_own_box
from halfshell._convert.search import as_rest
from halfshell._convert.types import PointArray, Precision, Search
from halfshell._objects.origin import Origin

# Of methods that search: inclusive, kernel, threads, memory_limit.
Options = tuple[bool, str | None, int | None, float | None]


class KeptCells:
    """What `CellList` keeps, and the first arguments of every search."""

    __slots__ = (
        "_cells", "_cutoff", "_layout", "_n_points", "_ndim", "_origin", "_precision", "_threads",
    )

    _cells: Any  # of the core
    _cutoff: float
    _layout: dict[str, Any]
    _n_points: int
    _ndim: int
    _origin: Origin
    _precision: Precision
    _threads: int | None

    def _queries(self, queries: Any, name: str = "queries") -> PointArray:
        """Queries of the dimension of the points; a box that they bring must be that of these."""
        array, own = as_queries(queries, name, self._ndim)
        if array.shape[1] != self._ndim:
            raise ValueError(
                f"{name} must have {self._ndim} columns, as the points, got shape {array.shape}"
            )
        check_own_box(name, own, self._origin.scene()[1:])
        return array

    def _arguments(self, cutoff: Any, options: Options, progress: Any = None) -> Search:
        inclusive, kernel, threads, memory_limit = options
        reach = self._cutoff if cutoff is None else as_cutoff(cutoff)
        threads = self._threads if threads is None else threads
        return (
            self._cells, reach, None, 0,
            *as_rest(inclusive, self._precision, kernel, memory_limit, progress, threads),
        )  # fmt: skip
