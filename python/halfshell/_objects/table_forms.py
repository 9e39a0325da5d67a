# SPDX-License-Identifier: BSD-3-Clause
"""What rows of neighbours can be turned into, given their offsets and columns."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import as_array
from halfshell._convert.foreign import kind_of, shown, whole_number
from halfshell._convert.lengths import as_number
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.starts import starts_of
from halfshell._errors import CapacityError
from halfshell._extras import needs

Array = npt.NDArray[Any]
Positions = npt.NDArray[np.int64]


def rows_of(offsets: Array, dtype: npt.DTypeLike = np.int64) -> Array:
    """The number of the row of each entry."""
    return np.repeat(np.arange(len(offsets) - 1, dtype=dtype), np.diff(offsets))


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
    if len(own) > 0:
        keep[own] = _leads_upwards(shifts()[own])
    return keep


def _leads_upwards(shifts: Array) -> Array:
    """Whether the first nonzero component is positive."""
    sign = np.zeros(len(shifts), np.int32)
    for column in shifts.T[::-1]:
        sign = np.where(column != 0, column, sign)
    return sign > 0


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
    if capacity is None or isinstance(capacity, bool):
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


def _order_by_index(indices: Array) -> Positions:
    """A stable argsort of numbers below 2**31; NumPy's is quick for 16 bits at a time."""
    order: Positions = np.argsort((indices & 0xFFFF).astype(np.uint16), kind="stable")
    if indices.max(initial=0) > 0xFFFF:
        upper = (indices >> 16).astype(np.uint16)
        order = order[np.argsort(upper[order], kind="stable")]
    return order


def order_by_distance(offsets: Array, distances: Array) -> Positions:
    """Entries by row, then distance, then as they were."""
    order = np.argsort(distances, kind="stable")
    return order[_order_by_index(rows_of(offsets)[order])]


def order_by_neighbor(offsets: Array, indices: Array) -> Positions:
    """Entries by row, then number of the neighbour."""
    order = _order_by_index(indices)
    return order[_order_by_index(rows_of(offsets)[order])]


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


def reverse_by_shift(offsets: Array, indices: Array, shifts: Array) -> Positions:
    """The same for entries in any order, some of which may be missing."""
    rows = rows_of(offsets, indices.dtype)
    columns = tuple(shifts.T[::-1])
    order = np.lexsort((*columns, indices, rows))
    other = np.lexsort((*(-column for column in columns), rows, indices))
    fits = (
        (rows[order] == indices[other])
        & (indices[order] == rows[other])
        & (shifts[order] == -shifts[other]).all(axis=1)
    )
    if not fits.all():
        raise ValueError(
            "an entry has no reverse in this table: filter both directions of a pair alike"
        )
    reverse = np.empty(len(order), np.int64)
    reverse[order] = other
    return reverse
