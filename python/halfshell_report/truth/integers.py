# SPDX-License-Identifier: BSD-3-Clause
"""Floats as Python integers of one unit, many at a time, and back with one rounding.

Every finite float is an integer times a power of two. Once all numbers of a scene are integers
of the same unit, sums and products are exact, and comparing them is comparing real numbers:
`fractions.Fraction` with a common denominator, kept in NumPy arrays of dtype object.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Objects", "as_integers", "common_unit", "nearest_float", "nearest_root", "signs"]

Objects = NDArray[np.object_]  # of Python integers

_ROOT_BITS = 140  # of a root before it is rounded to 53: twice, and room for the sticky bit


def _mantissas(values: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Odd integers (or 0) and exponents: ``values == mantissa * 2**exponent``, exactly."""
    fraction, exponent = np.frexp(np.asarray(values, dtype=np.float64))
    whole = (fraction * 2.0**53).astype(np.int64)
    lowest = np.where(whole == 0, 1, whole & -whole)
    zeros = np.frexp(lowest.astype(np.float64))[1].astype(np.int64) - 1
    return whole >> zeros, exponent.astype(np.int64) - 53 + zeros


def common_unit(*tables: NDArray[Any]) -> int:
    """Return the largest u such that every number is an integer times ``2**u``.

    Examples
    --------
    >>> common_unit(np.array([0.75, 2.0]), np.array([0.5]))
    -2
    """
    least = []
    for table in tables:
        mantissas, exponents = _mantissas(table)
        if np.any(mantissas):
            least.append(int(exponents[mantissas != 0].min()))
    return min(least, default=0)


def as_integers(values: Any, unit: int) -> Objects:
    """Return ``values / 2**unit`` as Python integers; `unit` must be a common unit.

    Examples
    --------
    >>> as_integers([0.75, -2.0], -2).tolist()
    [3, -8]
    """
    mantissas, exponents = _mantissas(np.asarray(values))
    shift = np.where(mantissas == 0, 0, exponents - unit)
    result: Objects = mantissas.astype(object) << shift.astype(object)
    return result


def nearest_float(whole: int, unit: int) -> float:
    """Return the float nearest to ``whole * 2**unit``.

    Examples
    --------
    >>> nearest_float(3, -2)
    0.75
    """
    return float(whole << unit) if unit >= 0 else whole / (1 << -unit)


def nearest_root(square: int, unit: int) -> float:
    """Return the float nearest to ``sqrt(square) * 2**unit``.

    The root is taken to more than twice the digits of a float, and a last digit says whether
    anything is left below them, so that the single rounding that follows is right.

    Examples
    --------
    >>> nearest_root(2, 0) == math.sqrt(2.0), nearest_root(9, -1)
    (True, 1.5)
    """
    extra = max(0, _ROOT_BITS - square.bit_length() // 2)
    scaled = square << 2 * extra
    root = math.isqrt(scaled)
    return nearest_float(2 * root + (root * root != scaled), unit - extra - 1)


def signs(values: Objects) -> NDArray[np.int64]:
    """Return -1, 0 or 1 for each.

    Examples
    --------
    >>> signs(np.array([10**40, 0, -3], dtype=object)).tolist()
    [1, 0, -1]
    """
    return (values > 0).astype(np.int64) - (values < 0).astype(np.int64)
