# SPDX-License-Identifier: BSD-3-Clause
"""Rows by distance, exactly: what rounded distances cannot tell is compared in integers.

A distance is within 1 ulp of the true one. Entries of a row whose distances differ by a few ulps at
most are a group; in it the squares of the true distances are worked out as whole numbers, for the
coordinates, box vectors and shifts as they are. Such numbers are columns of int64, one for each of
their digits, so that NumPy works on all entries of a group, and of many groups, at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.lengths import as_cutoff
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.options import AUTO, as_flag
from halfshell._convert.points import Points
from halfshell._convert.types import PointArray, Reach
from halfshell._objects.rows import order_in_rows, part_of, rows_of

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

    Parameters
    ----------
    points, queries : ndarray of float, shape (n, d) and (q, d)
        `queries` is None where the points themselves ask. They and the box are copied, for the
        caller's may change, unless they are its own.
    box : ndarray of float64, shape (d,) or (d, d), or None; with `systems` (s, d, d)
    periodic
        As users pass it, or as bits.
    find : callable, optional
        Returns S of all entries of all rows, for tables that have no shifts: called with this
        object when they are first needed.
    systems : ndarray of int64, shape (rows,), optional
        Which box each row has.
    shifts, numbers : ndarray, optional
        All shifts, and the numbers of `points`, ascending, if they are not all.
    """

    __slots__ = (
        "_box", "_find", "_numbers", "_periodic", "_shifts", "_systems", "points", "queries",
    )  # fmt: skip

    def __init__(
        self, points: PointArray, queries: PointArray | None, box: Floats | None, periodic: Any,
        find: FindShifts | None = None, systems: Integers | None = None, *,
        shifts: Array | None = None, numbers: Array | None = None, is_own: bool = False,
    ) -> None:  # fmt: skip
        self.points = points if is_own else points.copy()
        self.queries = queries if is_own or queries is None else queries.copy()
        self._box = box if is_own or box is None else box.copy()
        self._periodic = tuple(periodic) if isinstance(periodic, list) else periodic
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
        _, box, bits = self.scene()
        systems = None if self._systems is None else self._systems[rows]
        return {
            "points": points, "queries": queries, "box": box, "periodic": bits,
            "systems": systems, "shifts": shifts, "numbers": numbers,
        }  # fmt: skip

    def scene(self) -> tuple[PointArray, Floats | None, int]:
        """Points, box vectors and periodic bits as the core takes them."""
        if isinstance(self._periodic, int) and not isinstance(self._periodic, bool):
            return self.points, self._box, self._periodic
        return Points._of(self.points, "points", self._box, self._periodic)._scene

    @property
    def has_images(self) -> bool:
        """Whether shifts may be other than zero."""
        return self.scene()[2] != 0

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
        """Where in `points` these are, by their numbers."""
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
        _, box, bits = self.scene()
        ndim = self.points.shape[1]
        repeats = np.array([bits >> k & 1 for k in range(ndim)], np.float64)
        # Those that repeat; others are multiplied by no shift.
        vectors = np.zeros((ndim, ndim)) if box is None else box * repeats[:, None]
        for first, end in _parts_of(offsets):
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


def _parts_of(offsets: Array) -> Iterator[tuple[int, int]]:
    """Whole rows, first and end, of so many entries at most, or one row that has more."""
    first, n_rows = 0, len(offsets) - 1
    while first < n_rows:
        most = offsets[first] + SORTED_AT_A_TIME
        end = max(first + 1, int(np.searchsorted(offsets, most, side="right")) - 1)
        yield first, end
        first = end


def shifts_of_search(
    cutoff: Any, inclusive: Any, precision: Any, threads: int | None, reach: Reach | None = None
) -> FindShifts:
    """A search for the shifts of all rows that `neighbors` returns for these arguments."""
    largest, includes_cutoff = as_cutoff(cutoff), as_flag(inclusive, "inclusive")
    own: Any = copied(reach)  # the caller's arrays may change

    def find(origin: Origin) -> Array:
        points, vectors, bits = origin.scene()
        return _core.neighbors(
            points, largest, vectors, bits, includes_cutoff, precision, None, None, None, threads,
            "S", 8, origin.queries, own, AUTO,
        )[1]

    return find


def copied(part: Any) -> Any:
    """A tuple with copies of the arrays in it."""
    if isinstance(part, tuple):
        return tuple(copied(one) for one in part)
    return part.copy() if isinstance(part, np.ndarray) else part


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
