# SPDX-License-Identifier: BSD-3-Clause
"""Cutoffs, radii and the like: one length, or several."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_real_array, of_shape, refuse_where
from halfshell._convert.foreign import is_a, shown
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.options import as_count
from halfshell._errors import brief

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import Arrays, FloatArray

# The array, the one that it is checked with, and the counts.
_EDGE_COPIES = 4


@brief
def as_number(value: Any, name: str, single: str = "be a number") -> float:
    """A plain number; anything that float64 would have to round is refused."""
    if is_a(value, float):
        return float.__float__(value)
    if type(value) is int and -(2**53) <= value <= 2**53:
        return float(value)

    def check(shape: tuple[int, ...]) -> None:
        if shape != ():
            hint = ""
            if name == "cutoff":
                hint = (
                    ": several cutoffs are for count_pairs and the letter k of pairs, a length for "
                    "each point is one of radii"
                )
            raise TypeError(f"{name} must {single}, got shape {shape}{hint}")

    return float(as_real_array(value, name, single, check))


def as_positive(value: Any, name: str) -> float:
    number = as_number(value, name)
    if not (math.isfinite(number) and number > 0.0):
        raise ValueError(f"{name} must be finite and greater than 0, got {number}")
    return number


def as_radii(value: Any, n: int) -> float | FloatArray | None:
    """None, one number, or an array of one for each of n queries; finite and not negative."""
    if value is None:
        return None
    check = of_shape(f"radius must be a number or have shape ({n},), one for each query", (), (n,))
    array = as_real_array(value, "radius", "be a number", check).astype(np.float64)
    check_lengths(array, "radius")
    return array if array.ndim else float(array)


def as_edges(values: npt.ArrayLike, name: str = "edges") -> FloatArray:
    """Two or more limits of bins: finite, not negative, not descending."""

    def check(shape: tuple[int, ...]) -> None:
        if len(shape) != 1 or shape[0] < 2:
            raise ValueError(
                f"{name} must have shape (bins + 1,), with one bin at least, got {shape}"
                f"{'' if shape else ': as from np.linspace(0.0, cutoff, bins + 1)'}"
            )

    array = as_real_array(values, name, check_shape=check)
    refuse_unavailable(_EDGE_COPIES * 8 * len(array), f"{name} of shape {array.shape}")
    array = array.astype(np.float64)
    check_lengths(array, name)
    check_ascending(array, name, name)
    return np.ascontiguousarray(array)


def check_lengths(array: FloatArray, name: str) -> None:
    """ValueError, with the place, unless all are finite and not negative."""
    wrong = ~(np.isfinite(array) & (array >= 0.0))
    refuse_where(wrong, array, name, "be finite and not negative")


def check_ascending(array: FloatArray, name: str, all_of_them: str) -> None:
    for k in np.flatnonzero(array[1:] < array[:-1]):
        raise ValueError(
            f"{all_of_them} must be ascending, got {name}[{k}] = {array[k]} before "
            f"{name}[{k + 1}] = {array[k + 1]}"
        )


def as_length(value: float, name: str) -> float:
    """The same number, if it is finite and not negative."""
    if not (math.isfinite(value) and value >= 0.0):
        raise ValueError(f"{name} must be finite and not negative, got {value!r}")
    return value


# ---- the nearest -----------------------------------------------------------------------------

_MOST = 2**56  # more entries than any memory holds; NumPy has shapes (0, _MOST, 8)


def as_k(k: Any) -> int:
    """How many are wanted: a whole number from 1 on."""
    number = as_count(k, "k")
    if number > _MOST:
        raise MemoryError(f"k = {shown(number)} is more than fits in any memory")
    return number


def check_max_distances(values: Any) -> Any:
    """One for all systems or one a system, which are returned: as cutoffs they are converted."""

    def check(shape: tuple[int, ...]) -> None:
        if len(shape) > 1:
            raise ValueError(
                "max_distance must be a number or have shape (s,), one for each system, got "
                f"{shape}"
            )

    array = as_real_array(values, "max_distance", "be a number", check)
    refuse_where(~(array >= 0.0), array, "max_distance", "not be negative or NaN")
    return array if array.ndim else float(array)


def in_rows(arrays: Arrays, n_rows: int, k: int) -> Arrays:
    if isinstance(arrays, tuple):
        return tuple(column.reshape(n_rows, k, *column.shape[1:]) for column in arrays)
    return arrays.reshape(n_rows, k, *arrays.shape[1:])
