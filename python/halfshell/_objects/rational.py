# SPDX-License-Identifier: BSD-3-Clause
"""Small matrices of floats, for the real numbers that these are: solved in fractions."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

__all__ = ["Rows", "as_fractions", "determinant", "is_definite", "product", "solved", "transposed"]

Rows = list[list[Fraction]]


def as_fractions(matrix: Any) -> Rows:
    """The entries of an array (m, n)."""
    return [[Fraction(x) for x in row] for row in matrix.tolist()]


def transposed(matrix: Rows) -> Rows:
    return [list(column) for column in zip(*matrix, strict=True)]


def product(a: Rows, b: Rows) -> Rows:
    columns = transposed(b)
    return [
        [sum((x * y for x, y in zip(row, column, strict=True)), Fraction(0)) for column in columns]
        for row in a
    ]


def solved(matrix: Rows, right: Rows) -> Rows:
    """X with ``matrix @ X = right``, of which there is one."""
    return _eliminated(matrix, right)[0]


def determinant(matrix: Rows) -> Fraction:
    return _eliminated(matrix, [[] for _ in matrix])[1]


def _eliminated(matrix: Rows, right: Rows) -> tuple[Rows, Fraction]:
    """What is left of `right`, and the determinant: as far as it is not 0."""
    rows = [[*a, *b] for a, b in zip(matrix, right, strict=True)]
    d, found = len(rows), Fraction(1)
    for k in range(d):
        pivot = next((m for m in range(k, d) if rows[m][k] != 0), None)
        if pivot is None:
            return [], Fraction(0)
        if pivot != k:
            rows[k], rows[pivot] = rows[pivot], rows[k]
            found = -found
        found *= rows[k][k]
        rows[k] = [value / rows[k][k] for value in rows[k]]
        for m in range(d):
            if m != k and rows[m][k] != 0:
                rows[m] = [a - rows[m][k] * b for a, b in zip(rows[m], rows[k], strict=True)]
    return [row[d:] for row in rows], found


def is_definite(matrix: Rows) -> bool:
    """Whether a symmetric matrix is positive definite."""
    left = matrix
    while left:
        pivot = left[0][0]
        if pivot <= 0:
            return False
        left = [
            [a - row[0] * b / pivot for a, b in zip(row[1:], left[0][1:], strict=True)]
            for row in left[1:]
        ]
    return True
