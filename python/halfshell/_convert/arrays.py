# SPDX-License-Identifier: BSD-3-Clause
"""Arrays of real numbers, with exactly the values that users pass, or a refusal.

Types and shapes are settled here: an array is converted only when no value changes. Values
(finite, not negative, independent) are checked in the core.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.foreign import (
    exact_number,
    is_a,
    kind_of,
    refuse_deep_lists,
    shown,
    told,
)
from halfshell._convert.memory import refuse_large
from halfshell._errors import brief

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import FloatArray

    IntArray = npt.NDArray[np.int64]

_BIGGEST_INTEGER = 2**53  # from here on float64 does not hold every integer
MOST_KEYS = 2**62  # keys of rows are less than this, so that twice a key fits int64


@brief
def as_real_array(
    values: Any,
    name: str,
    single: str = "hold real numbers",
    check_shape: Callable[[tuple[int, ...]], None] | None = None,
    flags: bool = False,
) -> npt.NDArray[Any]:
    """An array of native float32 or float64 with exactly the given values.

    Raises TypeError for kinds that are no real numbers and ValueError, with the place, for values
    that float64 cannot hold. `single` is what a message says that a value without a shape must do.
    `check_shape` raises for shapes that are refused, before anything is copied: views may be huge.
    flags: whether True and False count as 1 and 0.
    """
    array = as_array(values, name, single)
    kind, size = array.dtype.kind, array.dtype.itemsize
    if kind == "b" and not flags:
        must = "hold real numbers" if array.ndim else single
        raise TypeError(f"{name} must {must}, got {'bools' if array.ndim else shown(values)}")
    if kind == "O" and array.ndim == 0:  # what it is comes before what shape it has not
        array = _from_objects(array, name, single)
        kind, size = "f", 8
    if check_shape is not None and kind in "fbiuO":
        check_shape(array.shape)
    if kind == "f" and size in (4, 8) and array.dtype.isnative:
        return array
    if kind in "fbiu":
        refuse_large(8 * array.size, array, name)
    if kind == "f" and size in (4, 8):
        return array.astype(array.dtype.newbyteorder("="))
    if kind == "b" or (kind == "f" and size == 2):
        return array.astype(np.float64)
    if kind in "iu":
        if size == 8:
            array = array.copy()  # it may change meanwhile
            _refuse_big_integers(array, name)
        return array.astype(np.float64)
    if kind == "f":
        raise TypeError(f"{name} must be float64 or narrower: {array.dtype} would be rounded")
    if kind == "O":
        return _from_objects(array, name, single)
    must = "hold real numbers" if array.ndim else single
    raise TypeError(f"{name} must {must}, got dtype {array.dtype}")


@brief
def as_array(values: Any, name: str, single: str = "hold real numbers") -> npt.NDArray[Any]:
    """An array of whatever dtype; TypeError or ValueError, with the name, if there is none.

    What a conversion raises (a tensor on another device, or one that requires its gradient) is the
    cause of the TypeError.
    """
    if is_a(values, np.ma.MaskedArray):
        return _unmasked(values, name)
    if is_a(values, np.ndarray):
        return np.asarray(values)
    if is_a(values, (str, bytes)):
        raise TypeError(f"{name} must {single}, got {kind_of(values)}")
    if is_a(values, (list, tuple)):
        refuse_deep_lists(values, name)
        _refuse_masked_items(values, name)
    elif type(values) not in (float, int, bool, type(None)):
        from halfshell._convert.foreign import refuse_tensor  # which few calls need

        refuse_tensor(values, name)
    try:
        if not hasattr(values, "__array__") and hasattr(values, "__dlpack__"):
            return np.asarray(np.from_dlpack(values))
        return np.asarray(values)
    except MemoryError as error:
        if str(error):
            raise
        raise MemoryError(f"{name} cannot be converted to an array: too many items") from error
    except ValueError as error:
        raise ValueError(f"{name} must be a rectangular array of numbers: {told(error)}") from error
    except Exception as error:
        raise TypeError(
            f"{name} cannot be converted to an array: "
            f"{kind_of(values)} raised {kind_of(error)}: {told(error)}"
        ) from error


def of_shape(must: str, *shapes: tuple[int, ...]) -> Callable[[tuple[int, ...]], None]:
    """A check that refuses other shapes. must: what a message says."""

    def check(shape: tuple[int, ...]) -> None:
        if shape not in shapes:
            raise ValueError(f"{must}, got {shape}")

    return check


def one_each(
    name: str, n: int, each: str = "one for each point"
) -> Callable[[tuple[int, ...]], None]:
    """A check that refuses shapes but (n,)."""
    return of_shape(f"{name} must have shape ({n},), {each}", (n,))


def refuse_where(wrong: Any, array: npt.NDArray[Any], name: str, must: str) -> None:
    """ValueError, with the place, for the first value that is wrong."""
    for where in np.argwhere(wrong)[:1]:
        place = f"{_element(name, where)} = " if len(where) else ""
        raise ValueError(f"{name} must {must}, got {place}{array[tuple(where)]}")


def in_order(array: npt.NDArray[Any], dtype: type[Any]) -> npt.NDArray[Any]:
    """The array as the core takes small ones: of this type, C-contiguous and aligned."""
    array = np.ascontiguousarray(array, dtype)
    return array if array.flags.aligned else array.copy()


def _unmasked(values: Any, name: str) -> npt.NDArray[Any]:
    """The data of a masked array that masks nothing."""
    mask = np.array(np.ma.getmaskarray(values))
    if mask.dtype.kind == "b":  # structured ones are refused for their type
        for where in np.argwhere(mask):
            raise ValueError(f"{_element(name, where)} must not be masked")
    return np.asarray(values)


def _refuse_masked_items(values: list[Any] | tuple[Any, ...], name: str) -> None:
    """ValueError for masked arrays in a list: NumPy would drop their masks."""
    kind_of_list: Any = list if is_a(values, list) else tuple
    items = kind_of_list.__iter__(values)  # not one of its own, which may be anything
    kinds = set(map(type, items))
    if kinds <= {list, tuple, float, int, np.ndarray} or not any(
        issubclass(kind, np.ma.MaskedArray) for kind in kinds
    ):
        return
    for k, item in enumerate(kind_of_list.__iter__(values)):
        if is_a(item, np.ma.MaskedArray):
            _unmasked(item, f"{name}[{k}]")


def _element(name: str, where: Iterable[Any]) -> str:
    place = ", ".join(str(int(k)) for k in where)
    return f"{name}[{place}]" if place else name


def _refuse_big_integers(array: npt.NDArray[Any], name: str) -> None:
    if array.size == 0:
        return
    suspects = (array > _BIGGEST_INTEGER) | (array < -_BIGGEST_INTEGER)
    if not suspects.any():
        return
    # An integer is a float64 when at most 53 bits are left without the zeros at its end.
    size = array[suspects].astype(np.uint64)
    if array.dtype.kind == "i":
        size = np.where(array[suspects] < 0, ~size + np.uint64(1), size)
    odd = size // (size & (~size + np.uint64(1)))
    wrong = np.flatnonzero(odd > _BIGGEST_INTEGER)
    if len(wrong):
        where = np.argwhere(suspects)[wrong[0]]
        raise ValueError(
            f"{_element(name, where)} = {array[tuple(where)]} is not a float64; integers beyond "
            "2**53 are accepted only when float64 holds them exactly"
        )


def _from_objects(array: npt.NDArray[Any], name: str, single: str) -> FloatArray:
    """Plain Python numbers in an object array: mixed, or integers too big for int64."""
    result = np.empty(array.shape)
    for where in np.ndindex(array.shape):
        number = exact_number(array[where])
        if number is None:
            kind = kind_of(array[where])
            if not where:
                raise TypeError(f"{name} must {single}, got {kind}")
            raise TypeError(f"{name} must hold real numbers, got {kind} at {list(where)}")
        try:
            result[where] = float(number)
        except OverflowError:
            power = f"{'-' if number < 0 else ''}2**{int(number).bit_length() - 1}"
            raise OverflowError(
                f"{_element(name, where)} = about {power} is too large for float64"
            ) from None
        if is_a(number, int) and int(result[where]) != number:
            raise ValueError(f"{_element(name, where)} = {shown(number)} is not a float64")
    return result


# ---- rows of arrays --------------------------------------------------------------------------

def starts_of(lengths: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Where each part begins, and at last where all of them end: one number more than parts. A
    mask counts as parts of length 1 and 0."""
    starts = np.zeros(len(lengths) + 1, np.int64)
    np.cumsum(lengths, out=starts[1:])
    return starts


def rows_of(
    offsets: npt.NDArray[Any], dtype: npt.DTypeLike = np.int64
) -> npt.NDArray[Any]:
    """The row that each entry is in."""
    return np.repeat(np.arange(len(offsets) - 1, dtype=dtype), np.diff(offsets))


def entries_of(
    offsets: npt.NDArray[Any], rows: npt.NDArray[Any]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Offsets of these rows alone, and the entries that are in them."""
    counts = offsets[rows + 1] - offsets[rows]
    ends = starts_of(counts)
    return ends, np.repeat(offsets[rows] - ends[:-1], counts) + np.arange(ends[-1])


def whole_rows(offsets: npt.NDArray[Any], most: int) -> Iterator[tuple[int, int]]:
    """First rows and ends of parts: of at most so many entries, or of one row that has more."""
    first = 0
    while first < len(offsets) - 1:
        limit = int(offsets[first]) + most
        end = max(first + 1, int(np.searchsorted(offsets, limit, side="right")) - 1)
        yield first, end
        first = end


# ---- rows of pairs, (i, j, *S) ---------------------------------------------------------------

def are_backward(
    i: npt.NDArray[Any], j: npt.NDArray[Any], S: npt.NDArray[Any] | None
) -> npt.NDArray[np.bool_]:
    """Which pairs a half list has the other way round: i > j, or i == j and S begins with a
    negative number."""
    backward: npt.NDArray[np.bool_] = i > j
    undecided = i == j
    for column in () if S is None else S.T:
        backward |= undecided & (column < 0)
        undecided &= column == 0
    return backward


def row_keys(*tables: Sequence[npt.NDArray[Any]]) -> list[IntArray]:
    """A number for each row of some tables, which are given as columns: equal rows have equal ones,
    and they ascend as rows do.

    Examples
    --------
    >>> first, second = row_keys([np.array([1, 2]), np.array([0, 9])],
    ...                          [np.array([2]), np.array([9])])
    >>> bool(first[1] == second[0]), bool(first[0] == second[0])
    (True, False)
    """
    ends = np.cumsum([len(table[0]) for table in tables])
    keys, size = np.zeros(int(ends[-1]), np.int64), 1
    for parts in zip(*tables, strict=True):
        column = np.concatenate(parts)
        if not len(column):
            continue
        low = int(column.min())
        span = int(column.max()) - low + 1
        if size * span >= MOST_KEYS:
            keys, size = _renumbered(keys)
        if size * span >= MOST_KEYS:
            column, span = _renumbered(column)
            low = 0
        if column.dtype != object:
            column = column.astype(np.int64)
        keys = keys * span + (column - low).astype(np.int64, copy=False)
        size *= span
    return np.split(keys, ends[:-1])


def _renumbered(values: npt.NDArray[Any]) -> tuple[IntArray, int]:
    unique, numbers = np.unique(values, return_inverse=True)
    return numbers.reshape(-1).astype(np.int64), len(unique)


# ---- numbers of points -----------------------------------------------------------------------

def as_point_numbers(values: Any, name: str, n: int, numbered: str) -> IntArray:
    """Numbers of n points or queries."""
    column = as_array(values, name)
    if column.size and column.dtype.kind not in "iu":
        hint = f": use np.flatnonzero({name})" if column.dtype.kind == "b" else ""
        raise TypeError(f"{name} must hold integers, got dtype {column.dtype}{hint}")
    if column.ndim != 1:
        raise ValueError(f"{name} must have shape (m,), got {column.shape}")
    if column.size and n == 0:
        raise ValueError(f"{name} must be empty: there are no {numbered}")
    numbers = np.array(column, np.int64)  # one's own, as another thread may change the caller's
    wrong = (numbers < 0) | (numbers >= n)
    refuse_where(wrong, column, name, f"be numbers of {numbered}, from 0 to {n - 1}")
    return numbers


def as_listed(
    i: Any, j: Any, S: Any, ndim: int, n_points: int, n_queries: int | None = None
) -> tuple[IntArray, IntArray, IntArray | None]:
    """i, j and the shifts, or None, as int64 arrays.

    i numbers the queries, if there are any; all else are points.
    """
    asking, numbered = (n_points, "points") if n_queries is None else (n_queries, "queries")
    first = as_point_numbers(i, "i", asking, numbered)
    second = as_point_numbers(j, "j", n_points, "points")
    if first.shape != second.shape:
        raise ValueError(
            f"i and j must have the same length, got {len(first)} and {len(second)}"
        )
    if S is None:
        return first, second, None
    shifts = as_array(S, "S")
    of_shape(f"S must have shape ({len(first)}, {ndim})", (len(first), ndim))(shifts.shape)
    if shifts.size and (shifts.dtype.kind not in "iuf" or (shifts != np.rint(shifts)).any()):
        raise TypeError("S must hold whole numbers")
    if shifts.size and not (np.abs(shifts.astype(np.float64)) < 2.0**62).all():
        raise OverflowError("S must hold whole numbers below 2**62")
    return first, second, np.ascontiguousarray(shifts, np.int64)
