# SPDX-License-Identifier: BSD-3-Clause
"""Floats as Python integers of one unit, many at a time, and back with one rounding.

Every finite float is an integer times a power of two. Once all numbers of a scene are integers
of the same unit, sums and products are exact, and comparing them is comparing real numbers:
`fractions.Fraction` with a common denominator, kept in NumPy arrays of dtype object.

And a short basis of the lattice that a box repeats on. A sheared box of width 1 may be a million
long; the images of a point near another one would then have to be looked for in a million places.
The lattice has a basis of short vectors as well, and `short_basis` finds one (Lenstra, Lenstra and
Lovasz 1982), with the integers that lead back.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Objects", "as_integers", "common_unit", "nearest_float", "nearest_root", "short_basis",
    "signs",
]  # fmt: skip

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


_Row = list[int]
_LOVASZ = Fraction(3, 4)  # the value of the paper; any between 1/4 and 1 gives a basis


def short_basis(rows: list[_Row]) -> tuple[list[_Row], list[_Row]]:
    """Return short rows B that span the lattice of `rows`, and U with ``B = U @ rows``.

    Parameters
    ----------
    rows : list of list of int, k rows of d integers
        Linearly independent.

    Returns
    -------
    (list of list of int, list of list of int)
        B, k rows of d, and U, k rows of k, of determinant 1 or -1.

    Raises
    ------
    ValueError
        If the rows are linearly dependent.

    Examples
    --------
    >>> short_basis([[1, 0], [1000000, 1]])
    ([[1, 0], [0, 1]], [[1, 0], [-1000000, 1]])
    """
    basis = [list(row) for row in rows]
    steps = [[int(a == b) for b in range(len(rows))] for a in range(len(rows))]
    k = 1
    ortho, along = _orthogonal(basis)
    while k < len(basis):
        for m in range(k - 1, -1, -1):
            times = round(along[k][m])
            if times:
                basis[k] = [x - times * y for x, y in zip(basis[k], basis[m])]
                steps[k] = [x - times * y for x, y in zip(steps[k], steps[m])]
                along[k] = [
                    x - times * (y if n < m else int(n == m))
                    for n, (x, y) in enumerate(zip(along[k], along[m]))
                ]
        if ortho[k] >= (_LOVASZ - along[k][k - 1] ** 2) * ortho[k - 1]:
            k += 1
            continue
        for table in (basis, steps):
            table[k], table[k - 1] = table[k - 1], table[k]
        ortho, along = _orthogonal(basis)
        k = max(k - 1, 1)
    return basis, steps


def _orthogonal(basis: list[_Row]) -> tuple[list[Fraction], list[list[Fraction]]]:
    """Gram-Schmidt: squared lengths, and each row's parts along the ones before it."""
    vectors: list[list[Fraction]] = []
    squares: list[Fraction] = []
    along: list[list[Fraction]] = []
    for row in basis:
        rest = [Fraction(x) for x in row]
        parts = [Fraction(0)] * len(basis)
        for m, (other, square) in enumerate(zip(vectors, squares)):
            parts[m] = sum((x * y for x, y in zip(row, other)), Fraction(0)) / square
            rest = [x - parts[m] * y for x, y in zip(rest, other)]
        square = sum((x * x for x in rest), Fraction(0))
        if square == 0:
            raise ValueError("the periodic rows of the box are linearly dependent")
        vectors.append(rest)
        squares.append(square)
        along.append(parts)
    return squares, along
