# SPDX-License-Identifier: BSD-3-Clause
"""What Python decides exactly: rows by distance, in integers; small matrices, in fractions.

A distance is within 1 ulp of the true one. Entries of a row whose distances differ by a few ulps at
most are a group; in it the squares of the true distances are worked out as whole numbers of Python,
for the coordinates, box vectors and shifts as they are.
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
AT_A_TIME = 1 << 24  # bytes, but a group is never cut
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
    for part in _parts(groups, max(1, AT_A_TIME // (64 * points.shape[1]))):
        place, entries = places[part], order[places[part]]
        ends = (asking, rows[place]), (points, indices[entries])
        steps = None if shifts is None else shifts[entries]
        of_each = vectors if vectors.ndim == 2 else vectors[:, rows[place]]
        order[place] = entries[_exact(groups[part], entries, ends, steps, of_each)]


def _exact(
    groups: Integers, entries: Integers, ends: tuple[tuple[Array, Array], ...],
    shifts: Array | None, vectors: Array,
) -> Integers:  # fmt: skip
    """What sorts whole groups by |q - p + S @ vectors|, and equal ones by their entries.

    ends: points, and which of them are p; points, and which of them are q.
    """
    (some_p, own), (some_q, other) = (np.unique(at, return_inverse=True) for _, at in ends)
    p, q = ends[0][0][some_p].astype(np.float64), ends[1][0][some_q].astype(np.float64)
    arrays = [p, q] if shifts is None else [p, q, vectors]
    unit, n_bits = _range(np.concatenate([array[array != 0.0] for array in arrays]))
    d, most = p.shape[1], 0 if shifts is None else int(np.abs(shifts.astype(np.int64)).max())
    kind: Any = np.int64 if d * (2 + d * most) ** 2 << 2 * n_bits < 2**63 else object
    of_each = 5 * d * (44 + n_bits // 7)  # a number of Python, and where
    whole_p, whole_q = _whole(p, unit, kind), _whole(q, unit, kind)
    order = np.arange(len(groups))
    for part in _parts(groups, max(1, AT_A_TIME // of_each)):
        n = part.stop - part.start
        refuse_unavailable(of_each * n, f"{n} neighbours at the same distance, compared exactly,")
        squares = np.zeros(n, kind)
        for axis in range(d):
            D = whole_q[other[part], axis] - whole_p[own[part], axis]
            for k, steps in enumerate(() if shifts is None else shifts[part].T):
                at = np.flatnonzero(steps)
                along = vectors[k, axis] if vectors.ndim == 2 else vectors[k, part, axis][at]
                if len(at) and along.any():
                    D[at] += steps[at].astype(kind) * _whole(along, unit, kind)
            squares += D * D
        keys = squares
        if kind is object:
            ranks = {square: rank for rank, square in enumerate(sorted({*squares}))}
            keys = np.fromiter(map(ranks.__getitem__, squares), np.int64, n)
        order[part] = order[part][np.lexsort((entries[part], keys, groups[part]))]
    return order


def _range(values: Array) -> tuple[int, int]:
    """The exponent of the lowest bit that these have, and how many bits from there on."""
    if len(values) == 0:
        return 0, 0
    fractions, exponents = np.frexp(values)
    whole = np.ldexp(fractions, 53).astype(np.int64)
    trailing = np.frexp((whole & -whole).astype(np.float64))[1] - 1
    unit = int((exponents - 53 + trailing).min())
    return unit, int(exponents.max()) - unit


def _whole(x: Array, unit: int, kind: Any) -> Array:
    """x in units of 2**unit, of which all numbers are whole multiples, as int64 or Python's."""
    if kind is np.int64:
        small: Array = np.ldexp(x, -unit).astype(np.int64)
        return small
    fractions, exponents = np.frexp(x)
    lowest = min(int(exponents.min(initial=unit + 53)) - 53, unit)
    whole: Array = np.ldexp(fractions, 53).astype(np.int64).astype(object)
    whole <<= np.maximum(exponents - 53 - lowest, 0).astype(object)  # 0 for zeros
    return whole >> (unit - lowest)


def _parts(groups: Integers, n: int) -> Iterator[slice]:
    """Whole groups, `n` entries at most, or one group that has more."""
    offsets = np.concatenate(([0], np.flatnonzero(np.diff(groups)) + 1, [len(groups)]))
    for first, end in whole_rows(offsets, n):
        yield slice(int(offsets[first]), int(offsets[end]))


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
