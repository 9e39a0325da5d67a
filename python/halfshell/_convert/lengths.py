# SPDX-License-Identifier: BSD-3-Clause
"""Cutoffs, radii and the like: one length, or several."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_real_array
from halfshell._convert.foreign import is_a, shown
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.options import as_count
from halfshell._convert.types import Arrays
from halfshell._errors import brief

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import FloatArray

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
    """A number that is finite and greater than 0."""
    number = as_number(value, name)
    if not (math.isfinite(number) and number > 0.0):
        raise ValueError(f"{name} must be finite and greater than 0, got {number}")
    return number


def as_cutoff(value: Any) -> float:
    """One cutoff; the core checks its value."""
    return as_number(value, "cutoff")


def as_radii(value: Any, n: int) -> float | FloatArray | None:
    """None, one number, or an array of one for each of n queries; finite and not negative."""
    if value is None:
        return None

    def check(shape: tuple[int, ...]) -> None:
        if shape not in ((), (n,)):
            raise ValueError(
                f"radius must be a number or have shape ({n},), one for each query, got {shape}"
            )

    array = as_real_array(value, "radius", "be a number", check).astype(np.float64)
    if array.ndim == 0:
        if not (np.isfinite(array) and array >= 0.0):
            raise ValueError(f"radius must be finite and not negative, got {float(array)}")
        return float(array)
    check_lengths(array, "radius")
    return array


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
    for k in np.flatnonzero(~(np.isfinite(array) & (array >= 0.0))):
        raise ValueError(f"{name} must be finite and not negative, got {name}[{k}] = {array[k]}")


def check_ascending(array: FloatArray, name: str, all_of_them: str) -> None:
    """ValueError, with the place, where one is less than the one before."""
    for k in np.flatnonzero(array[1:] < array[:-1]):
        raise ValueError(
            f"{all_of_them} must be ascending, got {name}[{k}] = {array[k]} before "
            f"{name}[{k + 1}] = {array[k + 1]}"
        )


def as_length(value: float, name: str) -> float:
    """A number that is finite and not negative."""
    if not (math.isfinite(value) and value >= 0.0):
        raise ValueError(f"{name} must be finite and not negative, got {value!r}")
    return value


def as_skin(value: Any) -> float:
    """A plain number, or "auto", which is no number and is settled before."""
    if is_a(value, str):
        raise ValueError(f'skin must be a number or "auto", got {shown(value)}')
    return as_length(as_number(value, "skin", 'be a number or "auto"'), "skin")


# ---- the nearest -----------------------------------------------------------------------------

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
