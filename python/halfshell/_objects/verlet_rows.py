# SPDX-License-Identifier: BSD-3-Clause
"""Rows of neighbours made of the pairs of a `VerletList`, without another search."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.options import as_index_bytes, check_letters
from halfshell._convert.starts import starts_of
from halfshell._objects.alone import Alone, Owner
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._objects.table_rows import read_only

__all__ = ["VerletRows"]

_Array = npt.NDArray[Any]
_LEAST_SHIFT = -(2**31)  # which has no opposite in int32


class VerletRows(Owner):
    """The method of `VerletList` that returns rows."""

    @property
    def n_points(self) -> int:
        """Number of points of the last step."""
        raise NotImplementedError

    def _find(self, quantities: str, sort: bool, index_bytes: int, out: Any) -> Any:
        raise NotImplementedError

    def neighbors(
        self, *, quantities: str = "j", index_dtype: npt.DTypeLike = np.int64
    ) -> NeighborTable:
        """All neighbours of each point of the last step, as `halfshell.neighbors` finds them.

        Parameters
        ----------
        quantities : str, default "j"
            Any of the letters ``j d D S``, each at most once.
        index_dtype : dtype, default int64
            As in `halfshell.neighbors`.

        Returns
        -------
        NeighborTable
            The table of `halfshell.neighbors`, bit for bit, with a row for each point: the full
            list. It does not keep the points, so it cannot ``sort()``; to sort rows by
            distance, use `halfshell.neighbors`.

        Raises
        ------
        RuntimeError
            Before the first `update`.
        TypeError, ValueError, OverflowError, MemoryError
            As `pairs`; OverflowError also for a shift of -2**31, which has no opposite in int32.

        Notes
        -----
        The pairs are sorted into rows, which takes longer than `pairs`. It pays if you need the
        rows and the list lasts for many steps.

        Examples
        --------
        >>> import halfshell as hs
        >>> pair_list = hs.VerletList(1.5, box=[4.0, 4.0])
        >>> pair_list.update([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]])
        True
        >>> [row.tolist() for row in pair_list.neighbors()]
        [[1, 2], [0], [0]]
        """
        check_letters(quantities)
        if not set(quantities) <= set("jdDS"):
            raise ValueError(
                "quantities must be some of the letters j d D S, each at most once (i is the row "
                f"itself), got {quantities!r}"
            )
        index_bytes = as_index_bytes(index_dtype)
        more = "".join(letter for letter in quantities if letter != "j")
        with Alone(self):
            half = self._find("ij" + more, True, index_bytes, None)
            n = self.n_points
        columns = dict(zip("ij" + more, half, strict=True))
        return NeighborTable(_both_directions(columns, quantities, n), quantities, n, True)


def _both_directions(columns: dict[str, _Array], quantities: str, n: int) -> tuple[_Array, ...]:
    """Offsets and columns of the full list, of a half list that ascends by (i, j, S)."""
    i, j = columns.pop("i"), columns.pop("j")
    shifts = columns.get("S")
    if shifts is not None and (shifts == _LEAST_SHIFT).any():
        raise OverflowError("a shift S of -2**31 has no opposite that fits int32")
    rows = np.concatenate((j[::-1], i))
    found = {"j": np.concatenate((i[::-1], j))}
    # Backwards, -S ascend for each two points; for images of one point all of them come before S.
    # So entries of one (i, j) are in order, and stay so.
    order = np.argsort(rows * np.int64(max(n, 1)) + found["j"], kind="stable")
    for letter, column in columns.items():
        back = column[::-1]
        opposite = back if letter == "d" else 0 - back  # of 0.0 it is 0.0
        found[letter] = np.concatenate((opposite, column))
    offsets = starts_of(np.bincount(rows, minlength=n))
    return read_only(offsets), *(read_only(found[letter][order]) for letter in quantities)
