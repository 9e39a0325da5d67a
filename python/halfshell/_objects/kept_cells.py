# SPDX-License-Identifier: BSD-3-Clause
"""Points in cells as the methods of `CellList` share them: how the core is asked about them."""

from __future__ import annotations

from typing import Any, TypedDict

from halfshell._convert.arrays import PointArray
from halfshell._convert.lengths import as_cutoff
from halfshell._convert.options import Precision, Progress, Search, as_flag
from halfshell._convert.scene import as_points
from halfshell._objects.origin import Origin


class Running(TypedDict, total=False):
    """Keywords of all methods that search."""

    kernel: str | None
    threads: int | None
    memory_limit: float | None


class Asking(Running, total=False):
    """Those of methods with a cutoff."""

    inclusive: bool


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
        array = as_points(queries, name, self._ndim)
        if array.shape[1] != self._ndim:
            raise ValueError(
                f"{name} must have {self._ndim} columns, as the points, got shape {array.shape}"
            )
        return array

    def _arguments(
        self, cutoff: Any, options: Asking, progress: Progress = None
    ) -> Search:
        for name in options.keys() - {"inclusive", "kernel", "threads", "memory_limit"}:
            raise TypeError(f"unexpected keyword argument {name!r}")
        reach = self._cutoff if cutoff is None else as_cutoff(cutoff)
        inclusive = as_flag(options.get("inclusive", True), "inclusive")
        return (
            self._cells, reach, None, 0, inclusive, self._precision, options.get("kernel"),
            options.get("memory_limit"), progress, options.get("threads", self._threads),
        )
