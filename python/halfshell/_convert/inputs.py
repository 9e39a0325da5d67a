# SPDX-License-Identifier: BSD-3-Clause
"""What users pass, brought to the few forms that the core takes.

Types and shapes are settled here, exactly: an array is converted only when no value changes.
Values (finite, not negative, independent) are checked in the core.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.available import refuse_large
from halfshell._convert.foreign import (
    attribute,
    exact_number,
    is_a,
    kind_of,
    refuse_deep_lists,
    shown,
    told,
)

MAX_DIM = 8
LENGTHS_AND_ANGLES = "lengths and angles are for Box.from_lengths_angles((a, b, c), (alpha, ...))"
_BIGGEST_INTEGER = 2**53  # from here on float64 does not hold every integer
_MISSING = object()

FloatArray = npt.NDArray[np.float64]
PointArray = npt.NDArray[np.float32] | FloatArray


def check_apart(out: Any, **inputs: Any) -> None:
    """Raise ValueError if an array of `out` may share memory with an input, which it names.

    For inputs as they were given: the core checks what they were converted to.
    """
    outputs = out if isinstance(out, tuple) else (out,)
    for name, values in inputs.items():
        for array in outputs:
            if (
                isinstance(array, np.ndarray)
                and isinstance(values, np.ndarray)
                and np.may_share_memory(array, values)
            ):
                raise ValueError(f"out must not share memory with {name}")


def as_real_array(values: Any, name: str, single: str = "hold real numbers") -> npt.NDArray[Any]:
    """An array of native float32 or float64 with exactly the given values.

    Raises TypeError for kinds that are no real numbers and ValueError, with the place, for values
    that float64 cannot hold. `single` is what a message says that a value without a shape must do.
    """
    array = as_array(values, name, single)
    kind, size = array.dtype.kind, array.dtype.itemsize
    if kind == "f" and size in (4, 8) and array.dtype.isnative:
        return array
    if kind in "fbiu":
        refuse_large(8 * array.size, array, name)
    if kind == "f" and size in (4, 8):
        return array.astype(array.dtype.newbyteorder("="))
    if kind == "b" or (kind == "f" and size == 2):
        return array.astype(np.float64)
    if kind in "iu":
        _refuse_big_integers(array, name)
        return array.astype(np.float64)
    if kind == "f":
        raise TypeError(f"{name} must be float64 or narrower: {array.dtype} would be rounded")
    if kind == "O":
        return _from_objects(array, name, single)
    must = "hold real numbers" if array.ndim else single
    raise TypeError(f"{name} must {must}, got dtype {array.dtype}")


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


def _unmasked(values: Any, name: str) -> npt.NDArray[Any]:
    """The data of a masked array that masks nothing."""
    mask = np.asarray(np.ma.getmaskarray(values))
    if mask.dtype.kind == "b" and mask.any():  # structured ones are refused for their type
        raise ValueError(f"{_element(name, np.argwhere(mask)[0])} must not be masked")
    return np.asarray(values)


def in_order(array: npt.NDArray[Any], dtype: type[Any]) -> npt.NDArray[Any]:
    """The array as the core takes small ones: of this type, C-contiguous and aligned."""
    array = np.ascontiguousarray(array, dtype)
    return array if array.flags.aligned else array.copy()


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


def as_choice(value: Any, name: str, choices: tuple[str, ...]) -> str:
    """One of some words."""
    if not isinstance(value, str):
        raise TypeError(f"{name} must be a string, got {kind_of(value)}")
    if value not in choices:
        few = len(choices) <= 2
        words = " or ".join(map(repr, choices)) if few else f"one of {' '.join(choices)}"
        raise ValueError(f"{name} must be {words}, got {shown(value)}")
    return value


def _element(name: str, where: Iterable[Any]) -> str:
    """``points[2, 1]``, or the name alone for a single number."""
    place = ", ".join(str(int(k)) for k in where)
    return f"{name}[{place}]" if place else name


def _refuse_big_integers(array: npt.NDArray[Any], name: str) -> None:
    if array.size == 0 or array.dtype.itemsize < 8:
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
            raise ValueError(f"{_element(name, where)} = {number} is not a float64")
    return result


def as_points(values: Any, name: str = "points", ndim: int = 3) -> PointArray:
    """Points of shape (n, d); a list without elements counts as n = 0, d = `ndim`."""
    array = as_array(values, name)
    if array.ndim == 2 and array.shape[0] >= 2**31:  # before they are converted
        raise OverflowError(f"fewer than 2**31 points can be searched, got {array.shape[0]}")
    array = as_real_array(array, name)
    if array.ndim != 2 or not 1 <= array.shape[1] <= MAX_DIM:
        if array.shape == (0,):
            return np.empty((0, ndim))
        raise ValueError(
            f"{name} must have shape (n, d) with 1 <= d <= {MAX_DIM}, got {array.shape}"
        )
    return array


def vectors_of(values: Any, name: str = "box") -> Any:
    """The vectors of a Box, or of another object that has some; else the object itself."""
    if type(values) in (np.ndarray, list, tuple):
        return values
    return attribute(values, "vectors", name, values)


def as_box(values: Any, ndim: int) -> FloatArray:
    """Box vectors as the rows of a float64 array (ndim, ndim), from rows, lengths or a Box."""
    array = as_real_array(vectors_of(values), "box")
    if array.shape == (ndim,):
        return np.diag(array.astype(np.float64))
    if array.shape != (ndim, ndim):
        hint = f": {LENGTHS_AND_ANGLES}" if array.shape == (6,) else ""
        raise ValueError(
            f"box must have shape ({ndim},) or ({ndim}, {ndim}) for points in {ndim} dimensions, "
            f"got {array.shape}{hint}"
        )
    return in_order(array, np.float64)


def as_periodic_bits(values: Any, ndim: int, default: bool) -> int:
    """Which axes repeat, as an integer with bit l set for box vector l."""
    if values is None:
        return (1 << ndim) - 1 if default else 0
    if is_a(values, (bool, np.bool_)):
        return (1 << ndim) - 1 if values else 0
    if is_a(values, (str, bytes)):
        raise TypeError(f"periodic must be a bool or {ndim} bools, got {shown(values)}")
    array = as_array(values, "periodic")
    if array.shape not in ((), (ndim,)) and array.dtype.kind in "biu":
        raise ValueError(f"periodic must be a bool or {ndim} bools, got shape {array.shape}")
    if array.dtype.kind != "b" and not (
        array.dtype.kind in "iu" and bool(((array == 0) | (array == 1)).all())
    ):
        raise TypeError(f"periodic must be a bool or {ndim} bools, got {shown(values)}")
    if array.shape == ():
        return (1 << ndim) - 1 if array else 0
    return sum(1 << axis for axis in range(ndim) if array[axis])


def as_cutoff(value: Any) -> float:
    """A plain number; anything that float64 would have to round is refused."""
    if is_a(value, float):
        return float.__float__(value)
    array = as_real_array(value, "cutoff", "be a number")
    if array.ndim != 0:
        raise TypeError(f"cutoff must be a number, got shape {array.shape}")
    return float(array)


def as_cutoffs(value: Any) -> float | FloatArray:
    """One cutoff, or several in ascending order, which are finite and not negative."""
    if is_a(value, float):
        return float.__float__(value)
    array = as_real_array(value, "cutoff", "be a number")
    if array.ndim == 0:
        return float(array)
    if array.ndim != 1:
        raise ValueError(f"cutoff must be a number or have shape (k,), got {array.shape}")
    refuse_large(8 * array.size, array, "cutoff")
    array = array.astype(np.float64)
    for k in np.flatnonzero(~(np.isfinite(array) & (array >= 0.0))):
        raise ValueError(f"cutoff must be finite and not negative, got cutoff[{k}] = {array[k]}")
    for k in np.flatnonzero(array[1:] < array[:-1]):
        raise ValueError(
            f"several cutoffs must be ascending, got cutoff[{k}] = {array[k]} before "
            f"cutoff[{k + 1}] = {array[k + 1]}"
        )
    return array


def as_flag(value: Any, name: str) -> bool:
    """A bool; also one of NumPy's, and the integers 0 and 1."""
    number = exact_number(value)
    if is_a(number, int) and number in (0, 1):
        return bool(number)
    raise TypeError(f"{name} must be True or False, got {shown(value)}")


def as_count(value: Any, name: str) -> int:
    """A whole number from 1 on."""
    number = exact_number(value)
    if isinstance(number, bool) or not isinstance(number, int):
        raise TypeError(f"{name} must be a whole number, got {shown(value)}")
    if number < 1:
        raise ValueError(f"{name} must be 1 or more, got {shown(number)}")
    return number


def as_index_bytes(index_dtype: Any) -> int:
    """4 or 8, for int32 or int64."""
    try:
        dtype = np.dtype(index_dtype)
    except MemoryError:
        raise
    except Exception as error:
        raise TypeError(
            f"index_dtype must be int32 or int64, got {shown(index_dtype)}"
        ) from error
    if dtype not in (np.dtype(np.int32), np.dtype(np.int64)):
        raise ValueError(f"index_dtype must be int32 or int64, got {dtype}")
    return int(dtype.itemsize)


def brings_its_box(points: Any, name: str = "points") -> bool:
    """Whether points are an object with ``positions``, ``cell`` and ``pbc``, like ASE's Atoms."""
    return type(points) not in (np.ndarray, list) and all(
        attribute(points, part, name, _MISSING) is not _MISSING
        for part in ("positions", "cell", "pbc")
    )


def _own_scene(
    atoms: Any, name: str = "points", ndim: int = 3
) -> tuple[PointArray, FloatArray | None, int]:
    """`scene` of an object that brings its box."""
    array = as_points(attribute(atoms, "positions", name), name, ndim)
    ndim = array.shape[1]
    bits = as_periodic_bits(attribute(atoms, "pbc", "periodic"), ndim, default=False)
    if not bits:
        return array, None, 0
    return array, as_box(as_array(attribute(atoms, "cell", "box"), "box"), ndim), bits


def scene(
    points: Any, box: Any, periodic: Any, ndim: int = 3
) -> tuple[PointArray, FloatArray | None, int]:
    """Points, box and periodic bits; from an ASE-like object all three. `ndim`: of an empty list.

    An object with ``positions``, ``cell`` and ``pbc`` brings its own box, so giving one is an
    error.
    """
    if brings_its_box(points):
        if box is not None or periodic is not None:
            given = "box" if box is not None else "periodic"
            raise ValueError(
                f"{given} comes from the {kind_of(points)} object itself that points are"
            )
        return _own_scene(points, ndim=ndim)
    array = as_points(points, ndim=ndim)
    ndim = array.shape[1]
    if box is None:
        if as_periodic_bits(periodic, ndim, default=False):
            raise ValueError("periodic needs a box: give box, or leave periodic out")
        return array, None, 0
    return array, as_box(box, ndim), as_periodic_bits(periodic, ndim, default=True)


def two_sets(
    queries: Any, points: Any, box: Any, periodic: Any
) -> tuple[PointArray, PointArray, FloatArray | None, int]:
    """Queries, points, box and periodic bits.

    The box of an ASE-like object holds for both sets: where both are such objects, they must agree.
    """
    own = _own_scene(queries, "queries") if brings_its_box(queries, "queries") else None
    asking = as_points(queries, "queries") if own is None else own[0]
    array, vectors, bits = scene(points, box, periodic, asking.shape[1])
    if len(asking) == 0 and own is None:
        asking = as_points(queries, "queries", array.shape[1])
    if asking.shape[1] != array.shape[1]:
        raise ValueError(
            "queries and points must have the same number of columns, got shapes "
            f"{asking.shape} and {array.shape}"
        )
    if own is not None and not _same_box(own[1:], (vectors, bits)):
        raise ValueError(
            "queries bring a box that is not that of points: give arrays, and box and periodic"
        )
    return asking, array, vectors, bits


def _same_box(
    one: tuple[FloatArray | None, int], other: tuple[FloatArray | None, int]
) -> bool:
    """Whether the same axes repeat by the same vectors."""
    if one[1] != other[1]:
        return False
    if one[0] is None or other[0] is None:
        return True  # no axis repeats
    return all(
        np.array_equal(a, b) for k, (a, b) in enumerate(zip(one[0], other[0])) if one[1] >> k & 1
    )
