# SPDX-License-Identifier: BSD-3-Clause
"""Lists of pairs that users give: numbers of points, and shifts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_array

if TYPE_CHECKING:
    import numpy.typing as npt

    IntArray = npt.NDArray[np.int64]


def as_point_numbers(values: Any, name: str, n: int, numbered: str) -> IntArray:
    """Numbers of n points or queries."""
    column = as_array(values, name)
    if column.size and column.dtype.kind not in "iu":
        hint = f": use np.flatnonzero({name})" if column.dtype.kind == "b" else ""
        raise TypeError(f"{name} must hold integers, got dtype {column.dtype}{hint}")
    if column.ndim != 1:
        raise ValueError(f"{name} must have shape (m,), got {column.shape}")
    if column.size and n == 0:
        raise ValueError(f"{name} must be empty: there are no {numbered}")
    numbers = np.array(column, np.int64)  # one's own, as another thread may change the caller's
    for k in np.flatnonzero((numbers < 0) | (numbers >= n)):
        raise ValueError(
            f"{name} must be numbers of {numbered}, from 0 to {n - 1}, got {name}[{k}] = "
            f"{column[k]}"
        )
    return numbers


def as_listed(
    i: Any, j: Any, S: Any, ndim: int, n_points: int, n_queries: int | None = None
) -> tuple[IntArray, IntArray, IntArray | None]:
    """i, j and the shifts, or None, as int64 arrays.

    i numbers the queries, if there are any; all else are points.
    """
    asking, numbered = (n_points, "points") if n_queries is None else (n_queries, "queries")
    first = as_point_numbers(i, "i", asking, numbered)
    second = as_point_numbers(j, "j", n_points, "points")
    if first.shape != second.shape:
        raise ValueError(
            f"i and j must have the same length, got {len(first)} and {len(second)}"
        )
    if S is None:
        return first, second, None
    shifts = as_array(S, "S")
    if shifts.shape != (len(first), ndim):
        raise ValueError(f"S must have shape ({len(first)}, {ndim}), got {shifts.shape}")
    if shifts.size and (shifts.dtype.kind not in "iuf" or (shifts != np.rint(shifts)).any()):
        raise TypeError("S must hold whole numbers")
    if shifts.size and not (np.abs(shifts.astype(np.float64)) < 2.0**62).all():
        raise OverflowError("S must hold whole numbers below 2**62")
    return first, second, np.ascontiguousarray(shifts, np.int64)
