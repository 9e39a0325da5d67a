# SPDX-License-Identifier: BSD-3-Clause
"""The methods of `CellList` that hand out pairs: all at once, in blocks, one by one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal, cast

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.callbacks import target_of
from halfshell._convert.options import AUTO, as_flag, as_index_bytes, as_room, most_pairs
from halfshell._convert.scene import check_apart
from halfshell._convert.search import with_bar
from halfshell._convert.shells import as_shells
from halfshell._convert.types import Arrays, Number, Out, PairBlocks
from halfshell._objects.kept_cells import KeptCells


class CellPairs(KeptCells):
    """Half lists of the points in cells."""

    __slots__ = ()

    def pairs(
        self,
        cutoff: Number | Sequence[float] | npt.NDArray[Any] | None = None,
        *,
        quantities: str = "ij",
        inclusive: bool = True,
        sort: bool = False,
        index_dtype: npt.DTypeLike = np.int64,
        out: Out | None = None,
        capacity: int | None = None,
        on_overflow: Literal["raise", "flag"] = "raise",
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
        progress: Callable[[float], object] | bool | None = None,
        touching: npt.ArrayLike | None = None,
    ) -> Arrays | tuple[Any, ...]:
        """Find every pair of points within a cutoff, as `halfshell.pairs` does.

        Parameters
        ----------
        cutoff : float or array_like of float, shape (k,), optional
            Default: that of the list. Several with the letter ``k``.
        quantities, inclusive, sort, index_dtype, out, capacity, on_overflow, kernel,
        memory_limit, progress
            As in `halfshell.pairs`.
        threads : int, optional
            As in `halfshell.pairs`. Default: that of the list.
        touching : array_like of int, shape (k,), optional
            As in `halfshell.pairs`; the time depends on their number alone.

        Returns
        -------
        ndarray or tuple of ndarray
            As from `halfshell.pairs`.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0)
        >>> cells.pairs(1.0, quantities="P").tolist()
        [[0, 1]]
        """
        if isinstance(progress, bool):
            return cast("Arrays", with_bar(CellPairs.pairs, locals()))
        options = inclusive, kernel, threads, memory_limit
        cutoff, shells = as_shells(cutoff, quantities, self._precision)
        search = self._arguments(cutoff, options, progress)
        wanted = quantities, as_flag(sort, "sort"), as_index_bytes(index_dtype), out
        room = as_room(capacity, on_overflow, out)
        if touching is None:
            return _core.pairs(*(*search, *wanted, None, AUTO, shells, room))
        if shells is not None or room is not None:
            other = "the letter k" if shells is not None else "capacity"
            raise ValueError(f"touching cannot be combined with {other}")
        check_apart(out, touching=touching)
        from halfshell._convert.touching import pairs_touching  # here: others do without

        points = self._origin.scene()[0]
        return pairs_touching(search, points, touching, wanted, None, AUTO)

    def iter_pairs(
        self,
        cutoff: Number | Sequence[float] | npt.NDArray[Any] | None = None,
        *,
        quantities: str = "ij",
        max_pairs: int = 1 << 20,
        inclusive: bool = True,
        index_dtype: npt.DTypeLike = np.int64,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
        progress: Callable[[float], object] | bool | None = None,
    ) -> PairBlocks[Any]:
        """Iterate over the pairs in blocks of bounded size, as `halfshell.iter_pairs` does.

        Parameters
        ----------
        cutoff : float or array_like of float, shape (k,), optional
            Default: that of the list. Several with the letter ``k``.
        quantities, max_pairs, inclusive, index_dtype, kernel, memory_limit, progress
            As in `halfshell.iter_pairs`.
        threads : int, optional
            As in `halfshell.iter_pairs`. Default: that of the list.

        Returns
        -------
        iterator of ndarray or tuple of ndarray
            Concatenated, the blocks are what `pairs` returns, in the same order. The iterator keeps
            the cells of the list alive.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0)
        >>> sum(len(i) for i, j in cells.iter_pairs(max_pairs=1))
        2
        """
        most = most_pairs(max_pairs)
        cutoff, shells = as_shells(cutoff, quantities, self._precision)
        search = self._arguments(
            cutoff, (inclusive, kernel, threads, memory_limit), progress
        )
        index_bytes = as_index_bytes(index_dtype)
        blocks = _core.iter_pairs(*search, quantities, index_bytes, most, None, AUTO, shells)
        return cast("PairBlocks[Any]", blocks)

    def for_each_pair(
        self,
        callback: Any,
        cutoff: Number | None = None,
        *,
        user_data: Any = None,
        inclusive: bool = True,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
        thread_safe: bool = False,
    ) -> int:
        """Call a function for each pair, as `halfshell.for_each_pair` does.

        Parameters
        ----------
        callback, user_data, inclusive, kernel, memory_limit, thread_safe
            As in `halfshell.for_each_pair`.
        cutoff : float, optional
            Default: that of the list.
        threads : int, optional
            As in `halfshell.for_each_pair`. Default: that of the list.

        Returns
        -------
        int
            The number of pairs for which it was called.

        Examples
        --------
        >>> import halfshell as hs
        >>> cells = hs.CellList([[0.0], [1.0], [3.0]], 2.0)
        >>> cells.for_each_pair(lambda i, j, S, D, d2: print(i, j, d2))
        0 1 1.0
        1 2 4.0
        2
        """
        target = target_of(callback, user_data)
        options = inclusive, kernel, threads, memory_limit
        return _core.for_each_pair(
            *self._arguments(cutoff, options), target.function, target.user,
            as_flag(thread_safe, "thread_safe"), None, AUTO,
        )
