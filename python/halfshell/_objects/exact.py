# SPDX-License-Identifier: BSD-3-Clause
"""What Python decides exactly: rows by distance, in integers; small matrices, in fractions.

A distance is within 1 ulp of the true one. Entries of a row whose distances differ by a few ulps at
most are a group; in it the squares of the true distances are worked out as whole numbers, for the
coordinates, box vectors and shifts as they are. Such numbers are columns of int64, one for each of
their digits, so that NumPy works on all entries of a group, and of many groups, at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import rows_of, whole_rows
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.types import PointArray

Array = npt.NDArray[Any]
Integers = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
FindShifts = Callable[["Origin"], Array]

CLOSE = 4  # ulps: more than two distances lose together
BITS = 24  # of a digit: sums of the products of two fit int64, for 8 axes and any exponents
AT_A_TIME = 1 << 21  # int64s, 16 MB: but a group is never cut
SORTED_AT_A_TIME = 1 << 17  # entries: some milliseconds


class Origin:
    """What exact sorting needs of the search that a table comes from.

    queries: None if the rows are those of the points themselves. Points, queries and box are
    copied, as the caller may change them, unless `is_own`. box: its vectors, or those of each
    system; `systems` then tells which system each row is of. find: returns S of all entries of all
    rows, when a table without shifts first needs them. shifts: these, if they are known. numbers:
    those of `points`, ascending, if they are only some of the points of the search.
    """

    __slots__ = (
        "_bits", "_box", "_find", "_numbers", "_shifts", "_systems", "points", "queries",
    )  # fmt: skip

    def __init__(
        self, points: PointArray, queries: PointArray | None, box: Floats | None, periodic: Any,
        find: FindShifts | None = None, systems: Integers | None = None, *,
        shifts: Array | None = None, numbers: Array | None = None, is_own: bool = False,
    ) -> None:  # fmt: skip
        self.points = points if is_own else points.copy()
        self.queries = queries if is_own or queries is None else queries.copy()
        self._box = box if is_own or box is None else box.copy()
        self._bits = int(periodic)
        self._find = find
        self._systems = systems
        self._shifts = shifts
        self._numbers = numbers

    def part(self, rows: slice | Array, indices: Array, shifts: Array | None) -> dict[str, Any]:
        """The arguments that make one for these rows alone, without a search.

        It has the points that their entries name; `shifts` are those of the entries, if the table
        has none.
        """
        points, numbers, queries = self.points, self._numbers, self.queries
        if queries is not None or not (isinstance(rows, slice) and rows == slice(0, len(points))):
            queries = self._asking[rows]
            named = np.unique(indices)
            taken = points[self._places_of(named)]
            if taken.nbytes + named.nbytes < points.nbytes:
                points, numbers = taken, named
        systems = None if self._systems is None else self._systems[rows]
        return {
            "points": points, "queries": queries, "box": self._box, "periodic": self._bits,
            "systems": systems, "shifts": shifts, "numbers": numbers,
        }  # fmt: skip

    @property
    def has_images(self) -> bool:
        return self._bits != 0

    def shifts(self) -> Array:
        """S of all entries of all rows. Threads may ask at once: each then searches."""
        find = self._find  # before the shifts are looked at, which come before it goes
        found = self._shifts
        if found is None:
            assert find is not None
            self._shifts = found = find(self)
            self._find = None
        return found

    @property
    def _asking(self) -> PointArray:
        return self.points if self.queries is None else self.queries

    def _places_of(self, indices: Array) -> Array:
        return indices if self._numbers is None else np.searchsorted(self._numbers, indices)

    def order(
        self, rows: slice | Array, offsets: Array, indices: Array, distances: Array,
        shifts: Array | None,
    ) -> Integers:  # fmt: skip
        """The entries of these rows by row and true distance.

        Some rows are done at a time, between which Ctrl-C works. `shifts` is None where all are
        zero.
        """
        order = np.empty(len(distances), np.int64)
        places = self._places_of(indices)
        box, ndim = self._box, self.points.shape[1]
        repeats = np.array([self._bits >> k & 1 for k in range(ndim)], np.float64)
        # Those that repeat; others are multiplied by no shift.
        vectors = np.zeros((ndim, ndim)) if box is None else box * repeats[:, None]
        for first, end in whole_rows(offsets, SORTED_AT_A_TIME):
            own = offsets[first : end + 1]
            a, b = int(own[0]), int(own[-1])
            row = rows_of(own)  # from 0 on: two rows of one point are two
            order[a:b] = a + order_in_rows(row, distances[a:b])
            these = part_of(rows, slice(first, end))
            of_rows = vectors
            if self._systems is not None:
                of_rows = vectors[self._systems[these]].transpose(1, 0, 2)
            settle(
                order[a:b], row, places, distances, shifts, self.points, self._asking[these],
                of_rows,
            )  # fmt: skip
        return order


class LateOrigin:
    """An origin that is made when it is first needed: few tables are sorted or pickled."""

    __slots__ = ("_find", "_found")

    def __init__(self, find: Callable[[], Origin | None]) -> None:
        self._find = find
        self._found: Origin | None = None

    def __getattr__(self, name: str) -> Any:
        if self._found is None:
            self._found = self._find()
        return getattr(self._found, name)


def copied(part: Any) -> Any:
    """The same with copies of its arrays, which may stand in tuples and lists."""
    if isinstance(part, (tuple, list)):
        copies = [copied(one) for one in part]
        return copies if isinstance(part, list) else tuple(copies)
    return part.copy() if isinstance(part, np.ndarray) else part


def settle(
    order: Integers, rows: Array, indices: Array, distances: Array, shifts: Array | None,
    points: Array, asking: Array, vectors: Array,
) -> None:  # fmt: skip
    """Put entries that are sorted by row and rounded distance into exact order, in place.

    rows: the place in `asking` of the point or query of ``order[k]``. indices, distances, shifts:
    of the entries; no shifts where all are zero. Entries at the same distance are left by their
    numbers. vectors: what shifts multiply, (d, d), or (d, q, d) with vector k of each in `asking`.
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
    offsets = np.concatenate(([0], np.flatnonzero(np.diff(groups)) + 1, [len(groups)]))
    for first, end in whole_rows(offsets, n):
        yield slice(int(offsets[first]), int(offsets[end]))


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


# ---- order of entries, and parts of them ---------------------------------------------------

def order_by_index(indices: Array) -> Integers:
    """A stable argsort of numbers below 2**31; NumPy's is quick for 16 bits at a time."""
    order: Integers = np.argsort((indices & 0xFFFF).astype(np.uint16), kind="stable")
    if indices.max(initial=0) > 0xFFFF:
        upper = (indices >> 16).astype(np.uint16)
        order = order[np.argsort(upper[order], kind="stable")]
    return order


def order_in_rows(rows: Array, values: Array) -> Integers:
    """Entries by row, then by an index or a distance, then as they were."""
    by_index = values.dtype.kind in "iu"
    order = order_by_index(values) if by_index else np.argsort(values, kind="stable")
    return order[order_by_index(rows[order])]


def part_of(part: slice | Array, chosen: slice | Array) -> slice | Array:
    """A part of a part: slices have both ends and a step of 1, arrays are positions."""
    if isinstance(part, slice):
        if isinstance(chosen, slice):
            return slice(part.start + chosen.start, part.start + chosen.stop)
        moved: Array = chosen + part.start
        return moved
    some: Array = part[chosen]
    return some


# ---- small matrices of floats, solved in fractions -------------------------------------------

Rows = list[list[Fraction]]


def as_fractions(matrix: Any) -> Rows:
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
