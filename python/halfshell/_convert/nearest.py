# SPDX-License-Identifier: BSD-3-Clause
"""What a search for the nearest takes besides points: k and a largest distance; and its rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from halfshell._convert.arrays import as_real_array
from halfshell._convert.foreign import is_a, shown
from halfshell._convert.lengths import as_number
from halfshell._convert.options import as_count
from halfshell._convert.types import Arrays

_MOST = 2**56  # more entries than any memory holds; NumPy has shapes (0, _MOST, 8)


def as_k(k: Any) -> int:
    """How many are wanted: a whole number from 1 on."""
    number = as_count(k, "k")
    if number > _MOST:
        raise MemoryError(f"k = {shown(number)} is more than fits in any memory")
    return number


def as_max_distance(value: Any) -> float:
    """A number that is not negative; infinity is one."""
    number = as_number(value, "max_distance")
    if not number >= 0.0:
        raise ValueError(f"max_distance must not be negative or NaN, got {number}")
    return number


def check_max_distances(values: Any) -> Any:
    """One for all systems or one a system, which are returned: as cutoffs they are converted."""
    if is_a(values, float):
        return as_max_distance(values)
    array = as_real_array(values, "max_distance", "be a number")
    if array.ndim == 0:
        return as_max_distance(values)
    if array.ndim > 1:
        raise ValueError(
            "max_distance must be a number or have shape (s,), one for each system, got "
                f"{array.shape}"
        )
    for s in np.flatnonzero(~(array >= 0.0)):
        raise ValueError(
            f"max_distance must not be negative or NaN, got max_distance[{s}] = {array[s]}"
        )
    return array


def in_rows(arrays: Arrays, n_rows: int, k: int) -> Arrays:
    """The arrays of the core, each with its entries as (rows, k)."""
    if isinstance(arrays, tuple):
        return tuple(column.reshape(n_rows, k, *column.shape[1:]) for column in arrays)
    return arrays.reshape(n_rows, k, *arrays.shape[1:])
