# SPDX-License-Identifier: BSD-3-Clause
"""What the methods of `CellList` share: cells, how they look, and how they are asked."""

from __future__ import annotations

from typing import Any, NamedTuple, Self, TypedDict, cast

import numpy as np
import numpy.typing as npt

from halfshell import _core, _inputs
from halfshell._box import Box
from halfshell._options import Precision, Progress, Search
from halfshell._origin import Origin


class Candidates(NamedTuple):
    """Ranges of `CellList.order` for each query: what the cells around it hold."""

    offsets: npt.NDArray[np.int64]
    """Where the ranges of each query begin; shape (q + 1,)."""
    start: npt.NDArray[np.int64]
    """Where each range begins in `CellList.order`; shape (m,)."""
    stop: npt.NDArray[np.int64]
    """Where it ends, not included; shape (m,)."""


class Running(TypedDict, total=False):
    """Keywords of all methods that search."""

    kernel: str | None
    threads: int | None
    memory_limit: float | None


class Asking(Running, total=False):
    """Those of methods with a cutoff."""

    inclusive: bool


class CellLayout:
    """Points in cells, as `CellList` documents them."""

    __slots__ = (
        "_cells", "_cutoff", "_layout", "_n_points", "_ndim", "_origin", "_precision", "_threads",
    )

    def __init__(
        self,
        points: Any,
        cutoff: Any,
        *,
        box: Any = None,
        periodic: Any = None,
        cell_size: Any = None,
        precision: Precision = "exact",
        threads: int | None = None,
        memory_limit: float | None = None,
    ) -> None:
        if type(box) is Box:
            box = box.vectors
        array, vectors, bits = _inputs.scene(points, box, periodic)
        self._cutoff = _inputs.as_cutoff(cutoff)
        self._cells = _core.cells_build(
            array, self._cutoff, vectors, bits, True, precision, None, memory_limit, None, threads,
            _as_cell_size(cell_size),
        )
        self._layout = _core.cells_layout(self._cells)
        self._n_points: int = array.shape[0]
        self._ndim: int = array.shape[1]
        self._precision = precision
        self._origin = Origin(array, None, vectors, bits)
        self._threads = threads

    def __len__(self) -> int:
        """Number of points."""
        return self._n_points

    def __repr__(self) -> str:
        cells = len(self.cell_start) - 1
        kind = "cells" if self.cell_ids is None else "occupied cells"
        return f"CellList({self._n_points} points, {cells} {kind}, cutoff {self.cutoff!r})"

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self  # it does not change

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError("a CellList cannot be pickled: pickle its points, and make it again")

    @property
    def cutoff(self) -> float:
        return self._cutoff

    @property
    def shape(self) -> tuple[int, ...]:
        return cast("tuple[int, ...]", self._layout["shape"])

    @property
    def cell_sizes(self) -> tuple[float, ...]:
        return cast("tuple[float, ...]", self._layout["cell_sizes"])

    @property
    def cell_start(self) -> npt.NDArray[np.int32]:
        return cast("npt.NDArray[np.int32]", self._layout["cell_start"])

    @property
    def order(self) -> npt.NDArray[np.int32]:
        return cast("npt.NDArray[np.int32]", self._layout["order"])

    @property
    def cell_ids(self) -> npt.NDArray[np.int64] | None:
        return cast("npt.NDArray[np.int64] | None", self._layout["cell_ids"])

    def cell_of(self, points: Any) -> npt.NDArray[np.int64]:
        """Find the cell that each of some points would be in.

        Parameters
        ----------
        points : array_like of float, shape (m, d)
            They need not be those of the list. They are wrapped into the box; those beyond an open
            face count as on it.

        Returns
        -------
        ndarray of int64, shape (m,)
            Cell ids; -1 where only occupied cells have one and this cell holds no point.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.5], [1.5], [9.5]], 1.0)
        >>> found = cells.cell_of([[0.5], [1.5], [9.5]])
        >>> all(i in cells.order[cells.cell_start[c]:cells.cell_start[c + 1]]
        ...     for i, c in enumerate(found))
        True
        """
        return _core.cells_find(self._cells, self._queries(points, "points"))

    def candidates(self, queries: Any = None) -> Candidates:
        """The raw block of cells around each query, without a distance test.

        Parameters
        ----------
        queries : array_like of float, shape (q, d), optional
            Default: the points of the list.

        Returns
        -------
        Candidates
            ``(offsets, start, stop)``: the ranges of query i are numbers ``offsets[i]`` to
            ``offsets[i + 1] - 1``, and range r means the points ``order[start[r]:stop[r]]``.
            Together they hold at least all points within the cutoff, the query itself included if
            it is one of them; in a periodic box a range occurs once for each image of its cells.

        Raises
        ------
        ValueError
            If a query is much further away than the points and the box reach, or if there is but
            one cell with everything (`cell_sizes` is infinite).

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.5], [1.5], [9.5]], 1.0)
        >>> block = cells.candidates([[9.0]])
        >>> found = [cells.order[a:b].tolist() for a, b in zip(block.start, block.stop)]
        >>> 2 in sum(found, [])
        True
        """
        asking = None if queries is None else self._queries(queries)
        return Candidates(*_core.cells_candidates(*self._arguments(None, {}), asking))

    def _queries(self, queries: Any, name: str = "queries") -> _inputs.PointArray:
        array = _inputs.as_points(queries, name, self._ndim)
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
        return (
            self._cells,
            self.cutoff if cutoff is None else _inputs.as_cutoff(cutoff),
            None,
            0,
            _inputs.as_flag(options.get("inclusive", True), "inclusive"),
            self._precision,
            options.get("kernel"),
            options.get("memory_limit"),
            progress,
            options.get("threads", self._threads),
        )


def _as_cell_size(value: Any) -> float:
    """The least width of cells; 0: none is asked for."""
    if value is None:
        return 0.0
    array = _inputs.as_real_array(value, "cell_size", "be a number")
    if array.ndim != 0:
        raise TypeError(f"cell_size must be a number, got shape {array.shape}")
    if not (np.isfinite(array) and array > 0.0):
        raise ValueError(f"cell_size must be finite and greater than 0, got {float(array)}")
    return float(array)
