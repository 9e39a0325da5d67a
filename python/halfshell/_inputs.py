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

MAX_DIM = 8
_BIGGEST_INTEGER = 2**53  # from here on float64 does not hold every integer

FloatArray = npt.NDArray[np.float64]
PointArray = npt.NDArray[np.float32] | FloatArray


def as_real_array(values: Any, name: str, single: str = "hold real numbers") -> npt.NDArray[Any]:
    """An array of native float32 or float64 with exactly the given values.

    Raises TypeError for kinds that are no real numbers and ValueError, with the place, for values
    that float64 cannot hold. `single` is what a message says that a value without a shape must do.
    """
    array = as_array(values, name, single)
    kind, size = array.dtype.kind, array.dtype.itemsize
    if kind == "f" and size in (4, 8):
        return array if array.dtype.isnative else array.astype(array.dtype.newbyteorder("="))
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
    if isinstance(values, np.ma.MaskedArray):
        if np.ma.getmaskarray(values).any():
            where = np.argwhere(np.ma.getmaskarray(values))[0]
            raise ValueError(f"{_element(name, where)} must not be masked")
        return np.asarray(values.data)
    if isinstance(values, np.ndarray):
        return np.asarray(values)
    if isinstance(values, (str, bytes)):
        raise TypeError(f"{name} must {single}, got {type(values).__name__}")
    try:
        if not hasattr(values, "__array__") and hasattr(values, "__dlpack__"):
            return np.from_dlpack(values)
        return np.asarray(values)
    except MemoryError:
        raise
    except ValueError as error:
        raise ValueError(f"{name} must be a rectangular array of numbers: {error}") from error
    except Exception as error:
        raise TypeError(
            f"{name} cannot be converted to an array: "
            f"{type(values).__name__} raised {type(error).__name__}: {error}"
        ) from error


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
    for where in np.argwhere(suspects):
        value = int(array[tuple(where)])
        if int(float(value)) != value:
            raise ValueError(
                f"{_element(name, where)} = {value} is not a float64; integers beyond 2**53 are "
                "accepted only when float64 holds them exactly"
            )


def _from_objects(array: npt.NDArray[Any], name: str, single: str) -> FloatArray:
    """Plain Python numbers in an object array: mixed, or integers too big for int64."""
    for where in np.ndindex(array.shape):
        value = array[where]
        if isinstance(value, (bool, float, np.float64, np.float32, np.float16, np.bool_)):
            continue
        if not isinstance(value, (int, np.integer)):
            kind = type(value).__name__
            if not where:
                raise TypeError(f"{name} must {single}, got {kind}")
            raise TypeError(f"{name} must hold real numbers, got {kind} at {list(where)}")
        try:
            exact = int(float(value)) == int(value)
        except OverflowError:
            power = f"{'-' if value < 0 else ''}2**{int(value).bit_length() - 1}"
            raise OverflowError(
                f"{_element(name, where)} = about {power} is too large for float64"
            ) from None
        if not exact:
            raise ValueError(f"{_element(name, where)} = {value} is not a float64")
    return array.astype(np.float64)


def as_points(values: Any, name: str = "points", ndim: int = 3) -> PointArray:
    """Points of shape (n, d); a list without elements counts as n = 0, d = `ndim`."""
    array = as_real_array(values, name)
    if array.ndim != 2 or not 1 <= array.shape[1] <= MAX_DIM:
        if array.shape == (0,):
            return np.empty((0, ndim))
        raise ValueError(
            f"{name} must have shape (n, d) with 1 <= d <= {MAX_DIM}, got {array.shape}"
        )
    if array.shape[0] >= 2**31:
        raise OverflowError(f"fewer than 2**31 points can be searched, got {array.shape[0]}")
    return array


def as_box(values: Any, ndim: int) -> FloatArray:
    """Box vectors as the rows of a float64 array (ndim, ndim), from rows, lengths or a Box."""
    array = as_real_array(getattr(values, "vectors", values), "box")
    if array.shape == (ndim,):
        return np.diag(array.astype(np.float64))
    if array.shape != (ndim, ndim):
        raise ValueError(
            f"box must have shape ({ndim},) or ({ndim}, {ndim}) for points in {ndim} dimensions, "
            f"got {array.shape}"
        )
    return np.ascontiguousarray(array, dtype=np.float64)


def as_periodic_bits(values: Any, ndim: int, default: bool) -> int:
    """Which axes repeat, as an integer with bit l set for box vector l."""
    if values is None:
        return (1 << ndim) - 1 if default else 0
    if isinstance(values, (bool, np.bool_)):
        return (1 << ndim) - 1 if values else 0
    if isinstance(values, (str, bytes)):
        raise TypeError(f"periodic must be a bool or {ndim} bools, got {values!r}")
    array = as_array(values, "periodic")
    if array.dtype.kind != "b" and not (
        array.dtype.kind in "iu" and bool(np.isin(array, (0, 1)).all())
    ):
        raise TypeError(f"periodic must be a bool or {ndim} bools, got {values!r}")
    if array.shape == ():
        return (1 << ndim) - 1 if array else 0
    if array.shape != (ndim,):
        raise ValueError(f"periodic must be a bool or {ndim} bools, got shape {array.shape}")
    return sum(1 << axis for axis in range(ndim) if array[axis])


def as_cutoff(value: Any) -> float:
    """A plain number; anything that float64 would have to round is refused."""
    if isinstance(value, float):
        return value
    array = as_real_array(value, "cutoff", "be a number")
    if array.ndim != 0:
        raise TypeError(f"cutoff must be a number, got shape {array.shape}")
    return float(array)


def as_cutoffs(value: Any) -> float | FloatArray:
    """One cutoff, or several in ascending order, which are finite and not negative."""
    if isinstance(value, float):
        return value
    array = as_real_array(value, "cutoff", "be a number").astype(np.float64)
    if array.ndim == 0:
        return float(array)
    if array.ndim != 1:
        raise ValueError(f"cutoff must be a number or have shape (k,), got {array.shape}")
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
    if isinstance(value, (bool, np.bool_)) or (
        isinstance(value, (int, np.integer)) and value in (0, 1)
    ):
        return bool(value)
    raise TypeError(f"{name} must be True or False, got {value!r}")


def as_index_bytes(index_dtype: Any) -> int:
    """4 or 8, for int32 or int64."""
    try:
        dtype = np.dtype(index_dtype)
    except TypeError:
        raise TypeError(f"index_dtype must be int32 or int64, got {index_dtype!r}") from None
    if dtype not in (np.dtype(np.int32), np.dtype(np.int64)):
        raise ValueError(f"index_dtype must be int32 or int64, got {dtype}")
    return int(dtype.itemsize)


def _brings_box(points: Any) -> bool:
    """Whether this is an object like ``ase.Atoms``, with a box of its own."""
    return hasattr(points, "positions") and hasattr(points, "cell") and hasattr(points, "pbc")


def _own_box(atoms: Any) -> tuple[Any, Any]:
    """The box and periodic of such an object, as arguments."""
    periodic = np.asarray(atoms.pbc, dtype=bool)
    return (np.asarray(atoms.cell), periodic) if periodic.any() else (None, None)


def scene(
    points: Any, box: Any, periodic: Any, ndim: int = 3
) -> tuple[PointArray, FloatArray | None, int]:
    """Points, box and periodic bits; from an ASE-like object all three. `ndim`: of an empty list.

    An object with ``positions``, ``cell`` and ``pbc`` brings its own box, so giving one is an
    error.
    """
    if _brings_box(points):
        if box is not None or periodic is not None:
            given = "box" if box is not None else "periodic"
            raise ValueError(f"{given} comes from the {type(points).__name__} object itself")
        box, periodic = _own_box(points)
        points = points.positions
    array = as_points(points, ndim=ndim)
    return array, *box_and_bits(box, periodic, array.shape[1])


def box_and_bits(box: Any, periodic: Any, ndim: int) -> tuple[FloatArray | None, int]:
    """Box vectors as rows, or None, and which of them repeat."""
    if box is None:
        if as_periodic_bits(periodic, ndim, default=False):
            raise ValueError("periodic needs a box: give box, or leave periodic out")
        return None, 0
    return as_box(box, ndim), as_periodic_bits(periodic, ndim, default=True)


def two_sets(
    queries: Any, points: Any, box: Any, periodic: Any
) -> tuple[PointArray, PointArray, FloatArray | None, int]:
    """Queries, points, box and periodic bits.

    The box of an ASE-like object holds for both sets: where both are such objects, they must agree.
    """
    own = _own_box(queries) if _brings_box(queries) else None
    queries = queries.positions if own is not None else queries
    asking = as_points(queries, "queries")
    array, vectors, bits = scene(points, box, periodic, asking.shape[1])
    if len(asking) == 0:
        asking = as_points(queries, "queries", array.shape[1])
    if asking.shape[1] != array.shape[1]:
        raise ValueError(
            "queries and points must have the same number of columns, got shapes "
            f"{asking.shape} and {array.shape}"
        )
    if own is not None and not _same_box(box_and_bits(*own, asking.shape[1]), (vectors, bits)):
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
