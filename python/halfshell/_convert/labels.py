# SPDX-License-Identifier: BSD-3-Clause
"""Types that are names, such as symbols of elements, as the numbers that the core counts by."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import as_array, one_each
from halfshell._convert.foreign import is_a

#: Types of points and of queries as numbers, and the name of each number, if they have names.
Labels = tuple[Any, Any, tuple[str, ...] | None]


def as_names(array: npt.NDArray[Any]) -> npt.NDArray[np.str_] | None:
    """An array of strings as NumPy's own; None for what holds something else."""
    if array.dtype.kind == "T" or (
        array.dtype.kind == "O" and array.size and all(is_a(one, str) for one in array.flat)
    ):
        return array.astype(np.str_)
    return array if array.dtype.kind == "U" else None


def as_kinds(types: Any, n: int) -> npt.NDArray[Any]:
    """Integers or names, one for each of n points, for pictures."""
    array = as_array(types, "types", "hold integers or names")
    one_each("types", n)(array.shape)
    names = as_names(array)
    if names is None and array.dtype.kind not in "iu" and n:
        raise TypeError(f"types must hold integers or names, got dtype {array.dtype}")
    return (array if names is None else names).copy()  # it may change meanwhile


def as_labels(types: Any, query_types: Any) -> Labels:
    """Names become their places among all names of both sets, which ascend.

    What holds no names is returned as it is given, for `as_types` to look at.
    """
    given = {"types": types, "query_types": query_types}
    arrays = {
        name: as_array(values, name, "hold integers or names")
        for name, values in given.items()
        if values is not None
    }
    named = {name: names for name, one in arrays.items() if (names := as_names(one)) is not None}
    if not named:
        return types, query_types, None
    for name, array in arrays.items():
        if name not in named and array.size:
            raise ValueError("types and query_types must both be numbers, or both be names")
        named.setdefault(name, np.empty(array.shape, np.str_))
    every = np.concatenate([one.ravel() for one in named.values()])  # they may change meanwhile
    names, numbers = np.unique(every, return_inverse=True)
    ends = np.cumsum([one.size for one in named.values()])
    parts = np.split(numbers.reshape(-1), ends[:-1])
    places = {
        name: part.reshape(one.shape)
        for (name, one), part in zip(named.items(), parts, strict=True)
    }
    return places.get("types"), places.get("query_types"), tuple(names.tolist())
