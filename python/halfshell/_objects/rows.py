# SPDX-License-Identifier: BSD-3-Clause
"""Arrays in rows: where each begins, and columns of all entries, one row after the other.

What a `NeighborTable` is turned into, from these alone.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import as_array
from halfshell._convert.foreign import is_a, kind_of, shown, whole_number
from halfshell._convert.lengths import as_number
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.starts import starts_of
from halfshell._errors import CapacityError
from halfshell._extras import needs

Array = npt.NDArray[Any]
Positions = npt.NDArray[np.int64]

_LEAST_SHIFT = -(2**31)
_COPIES = 5  # arrays of int64 that triplets have at one time, of the length of the result

#: What is summed in which type, by the kind of the dtype.
_SUMMED_IN = {"b": np.int64, "i": np.int64, "u": np.uint64, "f": np.float64}


def read_only(array: Array) -> Array:
    array.flags.writeable = False
    return array


def opposite(shifts: Array) -> Array:
    """-S, where all of them have one."""
    if shifts.min(initial=0) == _LEAST_SHIFT:
        raise OverflowError("a shift S of -2**31 has no opposite that fits int32")
    return -shifts


def rows_of(offsets: Array, dtype: npt.DTypeLike = np.int64) -> Array:
    """The number of the row of each entry."""
    return np.repeat(np.arange(len(offsets) - 1, dtype=dtype), np.diff(offsets))


# ---- some of them --------------------------------------------------------------------------


def part_of(part: slice | Array, chosen: slice | Array) -> slice | Array:
    """A part of a part: slices have both ends and a step of 1, arrays are positions."""
    if isinstance(part, slice):
        if isinstance(chosen, slice):
            return slice(part.start + chosen.start, part.start + chosen.stop)
        moved: Array = chosen + part.start
        return moved
    some: Array = part[chosen]
    return some


def as_rows(chosen: Any, n_rows: int) -> Positions:
    """Numbers of rows from 0 on, of an array of whole numbers or a mask."""
    if not (is_a(chosen, (list, np.ndarray, memoryview)) or hasattr(type(chosen), "__array__")):
        raise _refused(type(chosen).__name__)
    array = as_array(chosen, "rows", "hold whole numbers or bools")
    if array.ndim == 0:
        raise _refused(type(chosen).__name__)
    if array.ndim != 1:
        raise ValueError(f"rows must be chosen by an array of one axis, got shape {array.shape}")
    if array.dtype.kind == "b":
        if len(array) != n_rows:
            raise ValueError(
                f"a mask of rows must have shape ({n_rows},), one bool for each row, got "
                f"{array.shape}"
            )
        return np.flatnonzero(array.copy())  # another thread may change the caller's
    if len(array) == 0 and is_a(chosen, list):
        return np.empty(0, np.int64)
    if array.dtype.kind not in "iu":
        raise _refused(f"an array of {array.dtype}")
    array = array.copy()
    for k in np.flatnonzero((array >= n_rows) | (array < -n_rows)):
        raise IndexError(f"row {array[k]} (at [{k}]) of a table of {n_rows} rows")
    rows: Positions = array.astype(np.int64)
    rows[rows < 0] += n_rows
    return rows


def _refused(kind: str) -> TypeError:
    return TypeError(
        "a row is chosen by a whole number, rows by a slice, an array of whole numbers or a mask, "
        f"got {kind}"
    )


def entries_of(offsets: Array, rows: Positions) -> tuple[Array, Positions]:
    """Offsets of these rows alone, and the entries that are in them."""
    counts = offsets[rows + 1] - offsets[rows]
    ends = starts_of(counts)
    return ends, np.repeat(offsets[rows] - ends[:-1], counts) + np.arange(ends[-1])


def as_mask(mask: npt.ArrayLike, n_entries: int) -> npt.NDArray[np.bool_]:
    """One bool for each entry."""
    array = as_array(mask, "mask", "hold bools")
    if array.shape != (n_entries,):
        raise ValueError(
            f"mask must have shape ({n_entries},), one bool for each entry, got {array.shape}"
        )
    if array.dtype != np.bool_ and n_entries > 0:
        raise TypeError(f"mask must hold bools, got dtype {array.dtype}")
    return array.astype(np.bool_)  # a copy, as another thread may change the caller's


def first_halves(rows: Array, indices: Array, shifts: Callable[[], Array]) -> Array:
    """Which entries of a full list are those of the half list."""
    keep: Array = rows < indices
    own = np.flatnonzero(rows == indices)
    if len(own) > 0:  # those whose first nonzero component is positive
        sign = np.zeros(len(own), np.int32)
        for column in shifts()[own].T[::-1]:
            sign = np.where(column != 0, column, sign)
        keep[own] = sign > 0
    return keep


# ---- sums and other shapes -----------------------------------------------------------------


def row_sums(offsets: Array, values: npt.ArrayLike) -> Array:
    """The sum of the values of each row's entries; 0 for rows without any."""
    array = as_array(values, "values")
    n_entries = int(offsets[-1])
    if array.ndim == 0 or len(array) != n_entries:
        raise ValueError(
            f"values must have shape ({n_entries}, ...), one for each entry, got {array.shape}"
        )
    dtype = _SUMMED_IN.get(array.dtype.kind)
    if dtype is None or array.dtype.itemsize > 8:
        raise TypeError(f"values must hold real numbers, got dtype {array.dtype}")
    sums = np.zeros((len(offsets) - 1, *array.shape[1:]), dtype)
    filled = np.flatnonzero(np.diff(offsets))
    if len(filled):  # rows without entries are passed over: between two of these there are none
        sums[filled] = np.add.reduceat(array, offsets[filled], axis=0, dtype=dtype)
    return sums


def padded(offsets: Array, column: Array, capacity: Any, fill: Any) -> Array:
    """A row for each row, of `capacity` entries."""
    counts = np.diff(offsets)
    needed = int(counts.max(initial=0))
    length = needed if capacity is None else _as_capacity(capacity)
    if length < needed:
        raise CapacityError(
            f"capacity is too small: row {int(counts.argmax())} has {needed} entries, got {length}",
            needed,
        )
    shape = (len(counts), length, *column.shape[1:])
    # And a bool for each entry.
    n_rows = max(len(counts), 1)
    needed_bytes = n_rows * math.prod(shape[1:]) * column.dtype.itemsize + n_rows * length
    refuse_unavailable(needed_bytes, f"rows padded to a capacity of {shown(length)}")
    array = np.full(shape, _as_fill(fill, column.dtype), column.dtype)
    array[np.arange(length) < counts[:, None]] = column
    return array


def _as_capacity(value: Any) -> int:
    capacity = whole_number(value, "capacity")
    if capacity is None or is_a(capacity, bool):
        raise TypeError(f"capacity must be a whole number, got {kind_of(value)}")
    if capacity < 0:
        raise ValueError(f"capacity must not be negative, got {shown(capacity)}")
    return capacity


def _as_fill(value: Any, dtype: np.dtype[Any]) -> Any:
    """A number that this type holds as it is."""
    number = as_number(value, "fill")
    if dtype.kind == "f":
        return number
    limits = np.iinfo(dtype)
    if not number.is_integer() or not limits.min <= int(number) <= limits.max:
        raise ValueError(f"fill must be a whole number that {dtype} holds, got {shown(value)}")
    return int(number)


def sparse_array(
    offsets: Array, indices: Array, distances: Array, n_points: int, keeps_nearest: bool
) -> Any:
    """SciPy's, of one entry for each point in a row; rows ascend by j."""
    try:
        sparse = importlib.import_module("scipy.sparse")
    except ImportError as error:
        raise ImportError(needs("to_scipy", "scipy")) from error
    shape = (len(offsets) - 1, n_points)
    is_first = np.ones(len(indices), np.bool_)
    is_first[1:] = indices[1:] != indices[:-1]
    is_first[offsets[:-1][np.diff(offsets) > 0]] = True
    if is_first.all():
        return sparse.csr_array((distances, indices, offsets), shape=shape, copy=True)
    if not keeps_nearest:
        k = int(np.flatnonzero(~is_first)[0])
        row = int(np.searchsorted(offsets, k, side="right")) - 1
        raise ValueError(
            f"row {row} has several images of point {indices[k]}, and a matrix has one entry for "
            "them: duplicates='min' keeps the nearest"
        )
    nearest = np.minimum.reduceat(distances, np.flatnonzero(is_first))
    before = starts_of(is_first)
    return sparse.csr_array((nearest, indices[is_first], before[offsets]), shape=shape)


# ---- order and directions ------------------------------------------------------------------


def _order_by_index(indices: Array) -> Positions:
    """A stable argsort of numbers below 2**31; NumPy's is quick for 16 bits at a time."""
    order: Positions = np.argsort((indices & 0xFFFF).astype(np.uint16), kind="stable")
    if indices.max(initial=0) > 0xFFFF:
        upper = (indices >> 16).astype(np.uint16)
        order = order[np.argsort(upper[order], kind="stable")]
    return order


def order_in_rows(rows: Array, values: Array) -> Positions:
    """Entries by row, then by an index or a distance, then as they were."""
    by_index = values.dtype.kind in "iu"
    order = _order_by_index(values) if by_index else np.argsort(values, kind="stable")
    return order[_order_by_index(rows[order])]


def both_directions(columns: dict[str, Array]) -> dict[str, Array]:
    """Entries of both points of each pair, whose columns are i, j and any of d, D and S.

    Backwards first, in reverse: where pairs ascend by (i, j, S), so do all entries of one (i, j),
    for -S of pairs backwards ascend as well, and those of a point and its images come before S.
    """
    found = {
        "i": np.concatenate((columns["j"][::-1], columns["i"])),
        "j": np.concatenate((columns["i"][::-1], columns["j"])),
    }
    for letter in columns.keys() - {"i", "j"}:
        back = column = columns[letter][::-1]
        if letter != "d":
            back = opposite(column) if letter == "S" else 0.0 - column  # of 0.0 it is 0.0
        found[letter] = np.concatenate((back, columns[letter]))
    return found


def reverse_in_order(offsets: Array, indices: Array) -> Positions:
    """Where (j, i, -S) of each (i, j, S) is, in all of a full list that ascends by (i, j, S).

    A stable sort by j orders entries by (j, i, S), and so puts in place k the one whose other
    direction is entry k; but where several images of j are in one row these come out by S and
    not by -S: they are turned round.
    """
    order = _order_by_index(indices)
    rows = rows_of(offsets, indices.dtype)
    m = len(indices)
    is_first = np.ones(m, np.bool_)
    is_first[1:] = (indices[1:] != indices[:-1]) | (rows[1:] != rows[:-1])
    if is_first.all():
        return order
    starts = np.flatnonzero(is_first)
    ends = np.append(starts[1:], m)
    image = np.cumsum(is_first) - 1  # which run of images each entry is in
    turned: Positions = order[starts[image] + ends[image] - 1 - np.arange(m)]
    return turned


def reverse_by_shift(offsets: Array, indices: Array, shifts: Array) -> Positions | None:
    """The same for entries in any order; None where that of one of them is missing."""
    rows = rows_of(offsets, indices.dtype)
    columns = tuple(shifts.T[::-1])
    order = np.lexsort((*columns, indices, rows))
    other = np.lexsort((*(-column for column in columns), rows, indices))
    if not (
        np.array_equal(rows[order], indices[other])
        and np.array_equal(indices[order], rows[other])
        and np.array_equal(shifts[order], -shifts[other])
    ):
        return None
    reverse = np.empty(len(order), np.int64)
    reverse[order] = other
    return reverse


# ---- two entries of a row ------------------------------------------------------------------


def triplets(offsets: Positions, ordered: bool) -> tuple[Positions, Positions]:
    """All of them, as positions among the entries."""
    counts = np.diff(offsets)
    # As Python numbers: a product of the counts of a huge row may pass int64 when it is summed.
    total = int(np.dot(counts.astype(object), counts - 1)) if len(counts) else 0
    total = total if ordered else total // 2
    refuse_unavailable(8 * _COPIES * total, f"{total} triplets")
    return _triplets_of(offsets[:-1], counts, ordered)


def blocks_of_triplets(
    offsets: Positions, ordered: bool, most: int
) -> Iterator[tuple[Positions, Positions]]:
    """Whole rows at a time, together of at most so many triplets, or one row that has more."""
    counts = np.diff(offsets)
    several = counts * (counts - 1)
    sums = np.cumsum(several if ordered else several // 2)
    first = 0
    while first < len(counts):
        before = int(sums[first - 1]) if first else 0
        end = max(first + 1, int(np.searchsorted(sums, before + most, side="right")))
        refuse_unavailable(8 * _COPIES * (int(sums[end - 1]) - before), "the triplets of one row")
        if int(sums[end - 1]) > before:
            yield _triplets_of(offsets[first:end], counts[first:end], ordered)
        first = end


def _triplets_of(starts: Positions, counts: Array, ordered: bool) -> tuple[Positions, Positions]:
    """Of these rows; each entry as the first one, with those behind it or all others."""
    n_entries = int(counts.sum())
    row_start = np.repeat(starts, counts)
    entry = np.arange(n_entries) + (int(starts[0]) if len(starts) else 0)
    place = entry - row_start
    others = np.repeat(counts, counts) - 1 - (0 if ordered else place)
    first = np.repeat(entry, others)
    step = np.arange(len(first)) - np.repeat(np.cumsum(others) - others, others)
    if not ordered:
        return first, first + 1 + step
    # Those before the entry, then those behind it.
    second = np.repeat(row_start, others) + step
    second += step >= np.repeat(place, others)
    return first, second
