# SPDX-License-Identifier: BSD-3-Clause
"""Every image within a distance, in rational arithmetic, for boxes of any shape.

Nothing is shared with the package. Rows of the box are made shorter by whole multiples of each
other; shifts are then enumerated row by row, each row made orthogonal to those before it, with
bounds that are rounded outwards.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np

Vector = list[Fraction]


def exact(values) -> Vector:
    """Numbers as the fractions that they are."""
    return [Fraction(float(x)) for x in values]


def dot(a: Sequence, b: Sequence):
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def between(p: Sequence, q: Sequence) -> Vector:
    """The vector from p to q."""
    return [b - a for a, b in zip(p, q, strict=True)]


def _less(a: Sequence, times, b: Sequence) -> list:
    return [x - times * y for x, y in zip(a, b, strict=True)]


def _root(square: Fraction) -> Fraction:
    """A number not below the root, and above it by less than one part in 2**60."""
    if square <= 0:
        return Fraction(0)
    bits = max(0, 128 - (square.numerator.bit_length() - square.denominator.bit_length()))
    scaled = (square.numerator << (2 * bits)) // square.denominator
    return Fraction(math.isqrt(scaled) + 1, 1 << bits)


class Images:
    """The shifts of a box, None for open space, and which of them are within a distance."""

    def __init__(self, dim: int, box=None, periodic=None) -> None:
        rows = np.zeros((0, dim)) if box is None else np.asarray(box, np.float64)
        rows = np.full(dim, float(rows)) if rows.ndim == 0 else rows
        rows = np.diag(rows) if rows.ndim == 1 else rows
        repeats = np.broadcast_to(True if periodic is None else periodic, dim)
        self.dim = dim
        self.axes = [axis for axis in range(len(rows)) if repeats[axis]]
        self.rows = [exact(rows[axis]) for axis in self.axes]
        self._short = [list(row) for row in self.rows]
        self._shift = [[int(k == axis) for k in range(dim)] for axis in self.axes]  # of each
        self._shorten()
        self._apart: list[Vector] = []
        for row in self._short:
            for other in self._apart:
                row = _less(row, dot(row, other) / dot(other, other), other)
            self._apart.append(row)
        self._squares = [dot(row, row) for row in self._apart]

    def _shorten(self) -> None:
        changed = True
        while changed:
            changed = False
            for i, row in enumerate(self._short):
                for j, other in enumerate(self._short):
                    times = round(dot(row, other) / dot(other, other)) if i != j else 0
                    less = _less(row, times, other)
                    if dot(less, less) < dot(row, row):
                        self._short[i] = row = less
                        self._shift[i] = _less(self._shift[i], times, self._shift[j])
                        changed = True
        order = sorted(range(len(self._short)), key=lambda k: dot(self._short[k], self._short[k]))
        self._short = [self._short[k] for k in order]
        self._shift = [self._shift[k] for k in order]

    def within(
        self, apart: Vector, square: Fraction, inclusive: bool = True
    ) -> Iterator[tuple[tuple[int, ...], Vector, Fraction]]:
        """All (S, D, |D|**2) with D = apart + S @ box, and |D|**2 at most, or below, `square`."""
        for S, D in self._search(len(self._short) - 1, apart, square, [0] * self.dim):
            length = dot(D, D)
            if length < square or (inclusive and length == square):
                yield tuple(S), D, length

    def _search(self, k: int, apart: Vector, square: Fraction, S: list[int]):
        if k < 0:
            yield S, apart
            return
        along = dot(apart, self._apart[k]) / self._squares[k]
        width = _root(square / self._squares[k])
        for s in range(math.ceil(-along - width), math.floor(width - along) + 1):
            left = square - (along + s) ** 2 * self._squares[k]
            if left >= 0:
                moved = _less(apart, -s, self._short[k])
                yield from self._search(k - 1, moved, left, _less(S, -s, self._shift[k]))
