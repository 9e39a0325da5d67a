# SPDX-License-Identifier: BSD-3-Clause
"""Somebody's list of pairs, and numbers by which rows of two lists can be compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Answer", "Halved", "row_keys"]

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

_KEY_SIZE = 2**62  # a key is less than this, so that twice a key fits int64


@dataclass(frozen=True, eq=False)
class Answer:
    """A list of m pairs by one method.

    Attributes
    ----------
    i, j : ndarray of int, shape (m,)
    S : ndarray, shape (m, d), or None
        Shifts, with ``D = points[j] - points[i] + S @ box`` for the points as given; None where
        the method does not tell them.
    d, D : ndarray, shape (m,) and (m, d), or None
    inclusive : bool
        The rule of the method: ``d <= cutoff``, or ``d < cutoff``.
    full : bool
        Whether both (i, j, S) and (j, i, -S) are meant to be there.
    own_images_twice : bool
        Whether that is so of a point's own images alone.
    """

    i: NDArray[Any]
    j: NDArray[Any]
    S: NDArray[Any] | None = None
    d: NDArray[Any] | None = None
    D: NDArray[Any] | None = None
    inclusive: bool = True
    full: bool = False
    own_images_twice: bool = False

    def __len__(self) -> int:
        return len(self.i)


@dataclass(frozen=True, eq=False)
class Halved:
    """Rows turned so that ``i < j``, or ``i == j`` and S begins with a positive number."""

    columns: list[NDArray[Any]]  # i, j, and those of S
    turned: NDArray[np.bool_]  # which rows were turned

    @classmethod
    def of(cls, i: NDArray[Any], j: NDArray[Any], S: NDArray[Any] | None) -> Halved:
        """Turn what has to be turned."""
        i, j = i.astype(np.int64), j.astype(np.int64)
        turned = i > j
        shifts: Sequence[NDArray[Any]] = ()
        if S is not None:
            same = i == j
            for column in S.T:
                turned |= same & (column < 0)
                same = same & (column == 0)
            sign = np.where(turned, -1, 1)
            shifts = [sign * column for column in S.T]
        return cls([np.minimum(i, j), np.maximum(i, j), *shifts], turned)


def row_keys(*tables: Sequence[NDArray[Any]]) -> list[Ints]:
    """Number the rows of tables with the same columns: equal rows have equal keys.

    Examples
    --------
    >>> first, second = row_keys([np.array([1, 2]), np.array([0, 9])],
    ...                          [np.array([2]), np.array([9])])
    >>> bool(first[1] == second[0]), bool(first[0] == second[0])
    (True, False)
    """
    ends = np.cumsum([len(table[0]) for table in tables])
    keys = np.zeros(int(ends[-1]), dtype=np.int64)
    size = 1
    for parts in zip(*tables, strict=True):
        column = np.concatenate(parts)
        if not len(column):
            continue
        low = column.min()
        span = int(column.max()) - int(low) + 1
        if size * span >= _KEY_SIZE:
            keys, size = _renumbered(keys)
        if size * span >= _KEY_SIZE:
            column, span = _renumbered(column)
            low = 0
        keys = keys * span + (column - low).astype(np.int64)
        size *= span
    return np.split(keys, ends[:-1])


def _renumbered(values: NDArray[Any]) -> tuple[Ints, int]:
    unique, numbers = np.unique(values, return_inverse=True)
    return numbers.reshape(-1).astype(np.int64), len(unique)
