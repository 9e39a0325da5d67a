# SPDX-License-Identifier: BSD-3-Clause
"""Options that searches share, converted, and the kernels."""

from __future__ import annotations

from typing import Any

import numpy as np

from halfshell import _core
from halfshell._convert.foreign import exact_number, is_a, kind_of, read, shown, whole_number

# The default of `algorithm`: what is this string itself needs no conversion.
AUTO = "auto"

#: The letters of quantities, in the order in which arrays come.
LETTERS = "ijdDSP"

#: That of shells, which needs several cutoffs.
SHELL = "k"

# Blocks are counted by int64, and two of them must be.
_MOST_PAIRS = 2**62
_MOST_BRICKS = 2**20
_BYTES_OF_A_VIEW = 100


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
    """A bool, also one of NumPy's; no number."""
    if value is True or value is False:
        return value
    if is_a(value, np.bool_):
        return bool(np.generic.item(value))
    raise TypeError(f"{name} must be True or False, got {shown(value)}")


def as_whole(value: Any, name: str) -> int:
    number = exact_number(value)
    if isinstance(number, bool) or not isinstance(number, int):
        raise TypeError(f"{name} must be a whole number, got {shown(value)}")
    return number


def as_count(value: Any, name: str) -> int:
    number = as_whole(value, name)
    if number < 1:
        raise ValueError(f"{name} must be 1 or more, got {shown(number)}")
    return number


def as_threads(value: Any) -> int | None:
    """A number of threads, or None."""
    must = "threads must be a whole number from 1 to 1024 or None"
    if value is None or (type(value) is int and 1 <= value <= 1024):
        return value
    number = None if is_a(value, (bool, np.bool_)) else whole_number(value, "threads")
    if number is None:
        raise TypeError(f"{must}, got {kind_of(value)}")
    if not 1 <= number <= 1024:
        raise ValueError(f"{must}, got {shown(value)}")
    return number


def as_brick_count(n: Any) -> int:
    """A number of bricks; each costs time and memory, even if it owns no points."""
    number = as_count(n, "n")
    if number > _MOST_BRICKS:
        raise ValueError(f"n must be at most {_MOST_BRICKS:,} bricks, got {shown(number)}")
    return number


def most_pairs(max_pairs: Any) -> int:
    """A number of pairs from 1 on, as the core takes it."""
    return min(as_count(max_pairs, "max_pairs"), _MOST_PAIRS)


def as_list(value: Any, name: str, of_what: str) -> list[Any]:
    """What a sequence has."""
    from halfshell._convert.arrays import as_array  # here, as the next one: few calls need them
    from halfshell._convert.memory import refuse_large

    if is_a(value, memoryview):
        value = as_array(value, name)
    is_array = is_a(value, np.ndarray)
    if (
        not hasattr(type(value), "__iter__")
        or is_a(value, (str, bytes, dict))
        or (is_array and not value.ndim)
    ):
        raise TypeError(f"{name} must be a sequence of {of_what}, got {kind_of(value)}")
    if is_array:
        refuse_large(_BYTES_OF_A_VIEW * len(value), value, name)
    try:
        found: list[Any] = read(name, value, lambda: list(value))
        return found
    except MemoryError as error:
        raise MemoryError(f"{name} cannot be made a list: too many items") from error


def as_choice(value: Any, name: str, choices: tuple[str, ...]) -> str:
    if not is_a(value, str):
        raise TypeError(f"{name} must be a string, got {kind_of(value)}")
    value = str.__str__(value)  # what it is, whatever it says
    if value not in choices:
        from halfshell._unknown import nearest_word

        few = len(choices) <= 2
        words = " or ".join(map(repr, choices)) if few else f"one of {' '.join(choices)}"
        meant = nearest_word(value, choices)
        hint = f": did you mean {meant!r}?" if meant else ""
        raise ValueError(f"{name} must be {words}, got {shown(value)}{hint}")
    return str(value)


def are_letters(text: str, letters: str = LETTERS) -> bool:
    """Whether these are some of the letters of quantities, each at most once."""
    return bool(text) and set(text) <= set(letters) and len(set(text)) == len(text)


def check_letters(quantities: Any, letters: str = LETTERS) -> None:
    """Raise unless these are some of the letters, those of `pairs`, each at most once.

    Letters with j and without i are those of rows.
    """
    if not is_a(quantities, str):
        raise TypeError(f"quantities must be a string of letters, got {kind_of(quantities)}")
    quantities = str.__str__(quantities)
    if not are_letters(quantities, letters):
        raise ValueError(
            f"quantities must be some of the letters {' '.join(letters)}, each at most once"
            f"{' (i is the row itself)' * ('i' not in letters and 'j' in letters)}, got "
            f"{shown(quantities)}"
        )


def as_dtype(value: Any, name: str, one_of: str) -> np.dtype[Any]:
    try:
        dtype: np.dtype[Any] = np.dtype(value)
        return dtype
    except MemoryError:
        raise
    except Exception as error:
        raise TypeError(f"{name} must be {one_of}, got {shown(value)}") from error


def as_index_bytes(index_dtype: Any) -> int:
    """4 or 8, for int32 or int64."""
    dtype = as_dtype(index_dtype, "index_dtype", "int32 or int64")
    if dtype not in (np.dtype(np.int32), np.dtype(np.int64)):
        raise ValueError(f"index_dtype must be int32 or int64, got {dtype}")
    return int(dtype.itemsize)
