# SPDX-License-Identifier: BSD-3-Clause
"""Options that searches share, and what they return: types, conversions, and the kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypedDict

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.foreign import exact_number, is_a, kind_of, shown

Precision = Literal["exact", "double", "single"]

# What functions return that take `quantities`, and one of its letters.
Arrays = npt.NDArray[Any] | tuple[npt.NDArray[Any], ...]
Letter = Literal["i", "j", "d", "D", "S", "P"]

Progress = Callable[[float], object] | None

# What the core takes from `inclusive` to `threads`.
Rest = tuple[bool, Precision, str | None, float | None, Progress, int | None]

# The first arguments of all its searches: points, cutoff, box and periodic before these, or cells
# in place of points and box.
Search = tuple[
    Any, float, npt.NDArray[np.float64] | None, int,
    bool, Precision, str | None, float | None, Progress, int | None,
]  # fmt: skip


class SearchOptions(TypedDict, total=False):
    """For type checkers: the keywords that all searches share."""

    box: Any
    periodic: Any
    inclusive: bool
    precision: Precision
    kernel: str | None
    threads: int | None
    memory_limit: float | None


class ArrayOptions(SearchOptions, total=False):
    """The same, and those of functions that return arrays of pairs, without `quantities`."""

    sort: bool
    index_dtype: npt.DTypeLike
    out: Any


def kernels() -> list[str]:
    """Names of the kernels that this CPU can run, the best one first.

    Examples
    --------
    >>> import halfshell as hs
    >>> "scalar" in hs.kernels()
    True
    """
    return list(_core.kernels())


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


def as_choice(value: Any, name: str, choices: tuple[str, ...]) -> str:
    """One of some words."""
    if not isinstance(value, str):
        raise TypeError(f"{name} must be a string, got {kind_of(value)}")
    if value not in choices:
        few = len(choices) <= 2
        words = " or ".join(map(repr, choices)) if few else f"one of {' '.join(choices)}"
        raise ValueError(f"{name} must be {words}, got {shown(value)}")
    return value


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
