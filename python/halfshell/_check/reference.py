# SPDX-License-Identifier: BSD-3-Clause
"""What a correct answer is: every pair by exact rational arithmetic.

This file is the definition that the fast search is held to. It is short, slow (every point
meets every point) and independent: it uses Python integers and `fractions` and calls nothing
of the compiled core.

A pair is ``(i, j, S)`` with the vector ``D = points[j] - points[i] + S @ box``, S an integer
row that is 0 on every axis that does not repeat. It counts when ``|D| <= cutoff`` (or
``<``), where each pair may have a cutoff of its own, such as the sum of two radii. Every float is
taken as the real number that it is. The half list has each pair once:
``i < j``, or ``i == j`` and the first nonzero component of S is positive.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

_Vector = list[int]
_Pair = tuple[int, int, tuple[int, ...]]
_Reach = list[list[Fraction | None]]


def reference_pairs(
    points: Any,
    cutoff: Any,
    box: Any = None,
    periodic: Any = None,
    inclusive: bool = True,
    *,
    progress: Callable[[float], object] | None = None,
) -> list[_Pair]:
    """Find every pair within the cutoff, each once, in exact arithmetic.

    points: floats of any width, integers or Fractions, shape (n, d), all finite. cutoff: not
    negative; or a table of one for each i and j (those with j >= i are used), None for those that
    are no pairs, as `reach_by_radii` and `reach_by_types` make it. box: edge lengths, or edge
    vectors as rows; rows of axes that do not repeat are not used. periodic: which axes repeat, by
    default all with a box. progress: called with the fraction of the work done.

    Returns the half list as (i, j, S), ascending. ValueError if the periodic rows of `box` are
    linearly dependent, `cutoff` is negative, or `periodic` is true without a box.

    Examples
    --------
    >>> reference_pairs([[0.0], [0.75]], 0.25, box=[1.0])
    [(0, 1, (-1,))]
    >>> reference_pairs([[0.0]], 1.0, box=[1.0])
    [(0, 0, (1,))]
    >>> reference_pairs([[0.0], [1.0], [3.0]], reach_by_radii([0.5, 0.5, 1.25]))
    [(0, 1, (0,))]
    """
    rows, flags = _box_rows(box, periodic, np.shape(points)[1])
    is_own = isinstance(cutoff, list)  # of each pair
    table, grid, reach = _common_unit(
        _fractions(points), [row for row, flag in zip(rows, flags) if flag],
        _numbers(cutoff) if is_own else _fractions([[cutoff]]),
    )  # fmt: skip
    if not is_own and reach[0][0] < 0:
        raise ValueError(f"cutoff is {cutoff}; it must not be negative")
    axes = [axis for axis, flag in enumerate(flags) if flag]
    lattice = _Lattice(grid, axes, len(flags))

    pairs = []
    for i, p in enumerate(table):
        if progress is not None:
            progress(1.0 - (1.0 - i / len(table)) ** 2)
        for j in range(i, len(table)):
            radius = reach[i][j] if is_own else reach[0][0]
            if radius < 0:
                continue
            limit = radius**2
            between = list(map(operator.sub, table[j], p))
            for shift, vector in lattice.images_within(between, limit):
                square = _dot(vector, vector)
                if square > limit or (square == limit and not inclusive):
                    continue
                if i < j or shift > (0,) * len(flags):
                    pairs.append((i, j, shift))
    return sorted(pairs)


def reach_by_radii(radii: Sequence[Any], rule: str = "sum", cutoff: Any = None) -> _Reach:
    """Return how far i reaches j, as a table of exact rational numbers.

    rule: of two radii "sum", "mean" (half of it), "max", "min", "gather" (that of i), "scatter"
    (that of j). cutoff: the largest distance of any pair.

    Examples
    --------
    >>> reach_by_radii([0.5, 1.0], "mean")
    [[Fraction(1, 2), Fraction(3, 4)], [Fraction(3, 4), Fraction(1, 1)]]
    """
    exact = _fractions([radii])[0]
    combine: Any = {
        "sum": lambda a, b: a + b,
        "mean": lambda a, b: (a + b) / 2,
        "max": max,
        "min": min,
        "gather": lambda a, b: a,
        "scatter": lambda a, b: b,
    }[rule]
    table: _Reach = [[combine(a, b) for b in exact] for a in exact]
    if cutoff is None:
        return table
    most = Fraction(float(cutoff))
    return [[min(reach, most) for reach in row if reach is not None] for row in table]


def reach_by_types(types: Sequence[Any], cutoffs: Any) -> _Reach:
    """Return how far i reaches j by their types, None for those that are no pairs.

    types: rows of a symmetric table, or what the keys of a dict are made of, which count both ways.

    Examples
    --------
    >>> reach_by_types(["H", "O"], {("O", "H"): 0.5})
    [[None, Fraction(1, 2)], [Fraction(1, 2), None]]
    """

    def reach(a: Any, b: Any) -> Fraction | None:
        if not isinstance(cutoffs, dict):
            return Fraction(float(cutoffs[a][b]))
        length = cutoffs.get((a, b), cutoffs.get((b, a)))
        return None if length is None else Fraction(float(length))

    return [[reach(a, b) for b in types] for a in types]


def _numbers(reach: _Reach) -> list[list[Fraction]]:
    """The table with -1 for those that are no pairs."""
    return [[Fraction(-1) if x is None else Fraction(x) for x in row] for row in reach]


class _Lattice:
    """The box vectors that repeat, in integers, ready to list the images near a vector.

    ``ortho[k]`` is a multiple of what is left of vector k when everything along the vectors
    before it is removed (Gram-Schmidt). Adding multiples of the vectors before k does not
    change the component along ``ortho[k]``, and the squares of these components sum to at
    most ``|D|**2``. So, from the last vector to the first, each shift is confined to an
    interval whose ends are found exactly: no image within the limit is left out, however
    skewed the box is and however far away the points are.
    """

    def __init__(self, vectors: list[_Vector], axes: list[int], ndim: int) -> None:
        by_length = sorted(range(len(axes)), key=lambda k: _dot(vectors[k], vectors[k]))
        self.ndim = ndim
        self.axes = [axes[k] for k in by_length]
        self.vectors = [vectors[k] for k in by_length]
        self.ortho: list[_Vector] = []
        for vector in self.vectors:
            rest = [Fraction(x) for x in vector]
            for other in self.ortho:
                part = Fraction(_dot(vector, other), _dot(other, other))
                rest = [x - part * y for x, y in zip(rest, other)]
            if not any(rest):
                raise ValueError("the periodic rows of box are linearly dependent")
            scale = math.lcm(*(x.denominator for x in rest))
            whole = [int(x * scale) for x in rest]
            common = math.gcd(*whole)
            self.ortho.append([x // common for x in whole])
        # The component of D along ortho[k] is (start + s * step) / |ortho[k]|: squares of them are
        # summed in units of 1 / unit, in which they are integers.
        lengths2 = [_dot(along, along) for along in self.ortho]
        self.unit = math.lcm(*lengths2)
        self.shares = [self.unit // length2 for length2 in lengths2]
        self.steps = [_dot(edge, along) for edge, along in zip(self.vectors, self.ortho)]

    def images_within(
        self, vector: _Vector, limit: int
    ) -> Iterator[tuple[tuple[int, ...], _Vector]]:
        """Yield (S, vector + S @ box), among them every one of squared length <= limit."""
        return self._descend(len(self.axes) - 1, vector, limit * self.unit, [0] * self.ndim)

    def _descend(
        self, k: int, vector: _Vector, left: int, shift: list[int]
    ) -> Iterator[tuple[tuple[int, ...], _Vector]]:
        """Shift along vectors 0 to k, whose components have `left` / unit of the limit to share."""
        if k < 0:
            yield tuple(shift), vector
            return
        axis, edge, step, share = self.axes[k], self.vectors[k], self.steps[k], self.shares[k]
        start = _dot(vector, self.ortho[k])
        reach = math.isqrt(left // share)  # |start + s * step| <= reach
        for s in range(-((reach + start) // step), (reach - start) // step + 1):
            shift[axis] = s
            moved = [x + s * y for x, y in zip(vector, edge)]
            yield from self._descend(k - 1, moved, left - (start + s * step) ** 2 * share, shift)


def exact_vector(
    points: Any, i: int, j: int, S: Sequence[int] | None = None, box: Any = None
) -> list[Fraction]:
    """Return ``points[j] - points[i] + S @ box`` as exact rational numbers.

    Examples
    --------
    >>> exact_vector([[0.0], [0.75]], 0, 1, S=(-1,), box=[1.0])
    [Fraction(-1, 4)]
    """
    q, p = _fractions([points[j], points[i]])
    vector = list(map(operator.sub, q, p))
    if S is not None and any(S):
        rows, _ = _box_rows(box, None, len(vector))
        for s, edge in zip(S, rows):
            vector = [x + int(s) * y for x, y in zip(vector, edge)]
    return vector


def exact_square(
    points: Any, i: int, j: int, S: Sequence[int] | None = None, box: Any = None
) -> Fraction:
    """Return the squared length of `exact_vector`, exactly.

    Examples
    --------
    >>> exact_square([[0.0, 0.0], [0.5, 1.0]], 0, 1)
    Fraction(5, 4)
    """
    return sum((x * x for x in exact_vector(points, i, j, S, box)), Fraction(0))


def ulp_error(distance: float, square: Fraction) -> Fraction:
    """Return ``|distance - sqrt(square)|`` in units in the last place of the true distance.

    The result is never too small, and too large by less than 2**-60.

    Examples
    --------
    >>> ulp_error(5.0, Fraction(25)) < Fraction(1, 2**60)
    True
    >>> round(ulp_error(math.nextafter(5.0, 6.0), Fraction(25)))
    1
    """
    if square == 0:
        return abs(Fraction(float(distance))) / Fraction(math.ulp(0.0))
    size = square.numerator.bit_length() - square.denominator.bit_length()
    bits = min(max(0, 128 - size // 2), 1140)  # 127 bits of the root, or all that an ulp sees
    low = math.isqrt((square.numerator << 2 * bits) // square.denominator)
    ends = [Fraction(low, 1 << bits), Fraction(low + 1, 1 << bits)]
    unit = Fraction(math.ulp(float(ends[0])))
    return max(abs(Fraction(float(distance)) - end) for end in ends) / unit


def _box_rows(box: Any, periodic: Any, ndim: int) -> tuple[list[list[Fraction]], list[bool]]:
    """Return the box as rows of Fractions, and which axes repeat."""
    if box is None:
        if periodic is not None and np.any(periodic):
            raise ValueError("periodic needs a box")
        return [[Fraction(0)] * ndim] * ndim, [False] * ndim
    table = np.asarray(box)
    rows = _fractions(table if table.ndim == 2 else np.diag(np.broadcast_to(table, ndim)))
    flags = np.broadcast_to(True if periodic is None else np.asarray(periodic), ndim)
    return rows, [bool(flag) for flag in flags]


def _fractions(table: Any) -> list[list[Fraction]]:
    return [[Fraction(x) for x in np.asarray(row).tolist()] for row in table]


def _common_unit(*tables: list[list[Fraction]]) -> list[list[_Vector]]:
    """Multiply all tables by the same number so that every entry is an integer."""
    unit = math.lcm(1, *(x.denominator for table in tables for row in table for x in row))
    return [
        [[x.numerator * (unit // x.denominator) for x in row] for row in table] for table in tables
    ]


def _dot(a: Sequence[int], b: Sequence[int]) -> int:
    return sum(map(operator.mul, a, b))
