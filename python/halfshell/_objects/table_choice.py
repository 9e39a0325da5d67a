# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a table that are chosen by number or by mask, and sums over rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import as_array
from halfshell._convert.foreign import is_a
from halfshell._convert.starts import starts_of

__all__ = ["as_rows", "entries_of", "row_sums"]

Array = npt.NDArray[Any]
Positions = npt.NDArray[np.int64]

#: What is summed in which type, by the kind of the dtype.
_SUMMED_IN = {"b": np.int64, "i": np.int64, "u": np.uint64, "f": np.float64}


def as_rows(chosen: Any, n_rows: int) -> Positions:
    """Numbers of rows from 0 on, of an array of whole numbers or a mask."""
    if not (is_a(chosen, (list, np.ndarray, memoryview)) or hasattr(type(chosen), "__array__")):
        raise _refused(type(chosen).__name__)
    array = as_array(chosen, "rows", "hold whole numbers or bools")
    if array.ndim == 0:
        raise _refused(type(chosen).__name__)
    if array.ndim != 1:
        raise ValueError(f"rows must be chosen by an array of one axis, got shape {array.shape}")
    if array.dtype.kind == "b":
        if len(array) != n_rows:
            raise ValueError(
                f"a mask of rows must have shape ({n_rows},), one bool for each row, got "
                f"{array.shape}"
            )
        return np.flatnonzero(array.copy())  # another thread may change the caller's
    if len(array) == 0 and is_a(chosen, list):
        return np.empty(0, np.int64)
    if array.dtype.kind not in "iu":
        raise _refused(f"an array of {array.dtype}")
    array = array.copy()
    for k in np.flatnonzero((array >= n_rows) | (array < -n_rows)):
        raise IndexError(f"row {array[k]} (at [{k}]) of a table of {n_rows} rows")
    rows: Positions = array.astype(np.int64)
    rows[rows < 0] += n_rows
    return rows


def _refused(kind: str) -> TypeError:
    return TypeError(
        "a row is chosen by a whole number, rows by a slice, an array of whole numbers or a mask, "
        f"got {kind}"
    )


def entries_of(offsets: Array, rows: Positions) -> tuple[Array, Positions]:
    """Offsets of these rows alone, and the entries that are in them."""
    counts = offsets[rows + 1] - offsets[rows]
    ends = starts_of(counts)
    return ends, np.repeat(offsets[rows] - ends[:-1], counts) + np.arange(ends[-1])


def row_sums(offsets: Array, values: npt.ArrayLike) -> Array:
    """The sum of the values of each row's entries; 0 for rows without any."""
    array = as_array(values, "values")
    n_entries = int(offsets[-1])
    if array.ndim == 0 or len(array) != n_entries:
        raise ValueError(
            f"values must have shape ({n_entries}, ...), one for each entry, got {array.shape}"
        )
    dtype = _SUMMED_IN.get(array.dtype.kind)
    if dtype is None or array.dtype.itemsize > 8:
        raise TypeError(f"values must hold real numbers, got dtype {array.dtype}")
    sums = np.zeros((len(offsets) - 1, *array.shape[1:]), dtype)
    filled = np.flatnonzero(np.diff(offsets))
    if len(filled):  # rows without entries are passed over: between two of these there are none
        sums[filled] = np.add.reduceat(array, offsets[filled], axis=0, dtype=dtype)
    return sums
