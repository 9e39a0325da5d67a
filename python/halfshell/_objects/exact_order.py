# SPDX-License-Identifier: BSD-3-Clause
"""Rows by distance, exactly: what rounded distances cannot tell is compared in integers.

A distance is within 1 ulp of the true one. Entries of a row whose distances differ by a few ulps at
most are a group; in it the squares of the true distances are worked out as whole numbers, for the
coordinates, box vectors and shifts as they are. Such numbers are columns of int64, one for each of
their digits, so that NumPy works on all entries of a group, and of many groups, at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.memory import refuse_unavailable

Array = npt.NDArray[Any]
Integers = npt.NDArray[np.int64]

CLOSE = 4  # ulps: more than two distances lose together
BITS = 24  # of a digit: sums of the products of two fit int64, for 8 axes and any exponents
AT_A_TIME = 1 << 21  # int64s, 16 MB: but a group is never cut


def settle(
    order: Integers, rows: Array, indices: Array, distances: Array, shifts: Array | None,
    points: Array, asking: Array, vectors: Array,
) -> None:  # fmt: skip
    """Put entries that are sorted by row and rounded distance into exact order, in place.

    Parameters
    ----------
    order : ndarray of int64, shape (m,)
        Entries in that order; changed.
    rows : ndarray of int, shape (m,)
        The point or query of ``order[k]``, by its number in `asking`.
    indices, distances, shifts : ndarray
        Of the entries. Entries at the same distance are left by their numbers. `shifts` is None
        where all are zero.
    points, asking : ndarray of float, shape (n, d) and (q, d)
    vectors : ndarray of float64, shape (d, d) or (d, q, d)
        What shifts multiply: the same for all, or vector k of each in `asking` as ``vectors[k]``.
    """
    d = distances[order]
    with np.errstate(invalid="ignore"):
        apart = d[1:] - d[:-1] > CLOSE * np.spacing(d[1:])
    close = ~apart & (rows[1:] == rows[:-1])
    if not close.any():
        return
    begins = np.concatenate(([True], ~close))
    grouped = ~begins
    grouped[:-1] |= close
    places = np.flatnonzero(grouped)
    groups = np.cumsum(begins)[places]
    for part in _parts(groups, max(1, AT_A_TIME // (8 * points.shape[1]))):
        place, entries = places[part], order[places[part]]
        p = asking[rows[place]].astype(np.float64)
        q = points[indices[entries]].astype(np.float64)
        steps = None if shifts is None else shifts[entries]
        of_each = vectors if vectors.ndim == 2 else vectors[:, rows[place]]
        order[place] = entries[_exact(groups[part], entries, p, q, steps, of_each)]


def _exact(
    groups: Integers, entries: Integers, p: Array, q: Array, shifts: Array | None, vectors: Array
) -> Integers:
    """What sorts whole groups by |q - p + S @ vectors|, and equal ones by their entries."""
    scale = _range([p, q] if shifts is None else [p, q, vectors])
    # Digits of points twice, as they are and shortened, of squares twice, as sums and carried.
    of_each = scale[1] * (2 * p.shape[1] + 4) + 4 * p.shape[1] + 16
    order = np.arange(len(groups))
    for part in _parts(groups, max(1, AT_A_TIME // of_each)):
        n = part.stop - part.start
        what = f"{n} neighbours at the same distance, compared exactly,"
        refuse_unavailable(8 * of_each * n, what)
        steps = None if shifts is None else shifts[part]
        rows = vectors if vectors.ndim == 2 else vectors[:, part]
        keys = _squares(p[part], q[part], steps, rows, scale)
        order[part] = order[part][np.lexsort((entries[part], *keys, groups[part]))]
    return order


def _parts(groups: Integers, n: int) -> Iterator[slice]:
    """Whole groups, `n` entries at most, or one group that has more."""
    begin = 0
    while begin < len(groups):
        end = min(begin + n, len(groups))
        if end < len(groups) and groups[end] == groups[end - 1]:
            cut = groups[end]
            first = int(np.searchsorted(groups, cut))
            end = first if first > begin else int(np.searchsorted(groups, cut, side="right"))
        yield slice(begin, end)
        begin = end


def _squares(
    p: Array, q: Array, shifts: Array | None, vectors: Array, scale: tuple[int, int]
) -> list[Integers]:
    """|q - p + S @ vectors|**2 in some unit, as digits that are not negative, lowest first."""
    short = _short(_differences(p, q, shifts, vectors, scale))
    sums: list[Integers] = [np.zeros(len(p), np.int64) for _ in range(2 * len(short) - 1)]
    for a, one in enumerate(short):
        sums[2 * a] += (one * one).sum(axis=1)
        for b in range(a):
            sums[a + b] += 2 * (one * short[b]).sum(axis=1)
    return _carried(sums, 0)


def _differences(
    p: Array, q: Array, shifts: Array | None, vectors: Array, scale: tuple[int, int]
) -> list[Integers]:
    """q - p + S @ vectors, as digits of any sign, lowest first."""
    bottom, n_digits = scale
    digits = _digits(q, bottom, n_digits)
    digits -= _digits(p, bottom, n_digits)
    if shifts is not None:
        for column, vector in zip(shifts.T, vectors, strict=True):
            if column.any():
                steps = column.astype(np.int64)[:, None]
                for digit, of_vector in zip(digits, _digits(vector, bottom, n_digits), strict=True):
                    digit += steps * of_vector
    return list(digits)


def _range(arrays: list[Array]) -> tuple[int, int]:
    """Of the bits that these numbers have: the exponent of the lowest, digits from there on."""
    values = np.concatenate([array[array != 0.0] for array in arrays])
    if len(values) == 0:
        return 0, 1
    fractions, exponents = np.frexp(values)
    whole = np.ldexp(fractions, 53).astype(np.int64)
    trailing = np.frexp((whole & -whole).astype(np.float64))[1] - 1
    bottom = int((exponents - 53 + trailing).min())
    return bottom, -(-(int(exponents.max()) - bottom) // BITS)


def _digits(x: Array, bottom: int, n_digits: int) -> Integers:
    """x over 2**bottom, digit by digit, lowest first, each with the sign of x."""
    digits = np.empty((n_digits, *x.shape), np.int64)
    rest = x.copy()
    for k in reversed(range(n_digits)):
        digit = np.trunc(np.ldexp(rest, -(bottom + BITS * k)))
        rest -= np.ldexp(digit, bottom + BITS * k)
        digits[k] = digit
    return digits


def _short(digits: list[Integers]) -> list[Integers]:
    """The same numbers by digits of at most half the base, without those that are zero in all."""
    carried = _carried(digits, 1 << (BITS - 1))
    while len(carried) > 1 and not carried[-1].any():
        carried.pop()
    while len(carried) > 1 and not carried[0].any():
        carried.pop(0)
    return carried


def _carried(digits: list[Integers], half: int) -> list[Integers]:
    """The same numbers by digits from -half to base - half."""
    result = []
    carry = np.zeros_like(digits[0])
    k = 0
    while k < len(digits) or carry.any():
        digit = carry + digits[k] if k < len(digits) else carry
        carry = (digit + half) >> BITS
        result.append(digit - (carry << BITS))
        k += 1
    return result
