# SPDX-License-Identifier: BSD-3-Clause
"""Options that searches share, converted, and the kernels."""

from __future__ import annotations

from typing import Any

import numpy as np

from halfshell import _core
from halfshell._convert.foreign import exact_number, is_a, kind_of, shown

# Blocks are counted by int64, and two of them must be.
_MOST_PAIRS = 2**62


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
    if value is True or value is False:
        return value
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


def most_pairs(max_pairs: Any) -> int:
    """A number of pairs from 1 on, as the core takes it."""
    return min(as_count(max_pairs, "max_pairs"), _MOST_PAIRS)


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
