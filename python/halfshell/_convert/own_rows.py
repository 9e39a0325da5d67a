# SPDX-License-Identifier: BSD-3-Clause
"""Rows of some of the points: found as those of queries, without the points themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.foreign import is_a
from halfshell._convert.listed import as_point_numbers
from halfshell._convert.options import check_letters
from halfshell._convert.touching import asked_by

if TYPE_CHECKING:
    from halfshell._convert.types import PointArray, Reach, Search

Array = npt.NDArray[Any]


def check_alone(queries: Any) -> None:
    """ValueError where there are queries as well."""
    if queries is not None:
        raise ValueError("indices select rows of the points: do not give queries as well")


def rows_of_points(
    search: Search,
    points: PointArray,
    indices: Any,
    quantities: str,
    index_bytes: int,
    reach: Reach | None,
    algorithm: str,
) -> tuple[tuple[Array, ...], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Offsets and columns of the rows of these points, their numbers, and the entries kept.

    `search` begins with the points, or with cells of them. The last result is positions among the
    entries that a search for the same points as queries has.
    """
    if is_a(search[5], str) and search[5] == "single":
        raise ValueError("indices cannot be combined with precision 'single'")
    numbers = as_point_numbers(indices, "indices", len(points), "points")
    check_letters(quantities)
    letters = quantities if "j" in quantities else "j" + quantities
    offsets, *columns = _core.neighbors(
        *search, letters, index_bytes, points[numbers], asked_by(reach, numbers), algorithm
    )
    j = columns[letters.index("j")]
    row = np.repeat(np.arange(len(numbers)), np.diff(offsets))
    # A point meets its images in the order of S: the middle one is itself, at S = 0.
    own = np.flatnonzero(j == numbers[row])
    first = np.searchsorted(own, offsets)
    n_own = np.diff(first)
    found = np.flatnonzero(n_own % 2)
    itself = own[first[found] + n_own[found] // 2]
    entries = np.delete(np.arange(len(j)), itself)
    fewer = np.zeros(len(offsets), np.int64)
    fewer[1:] = np.cumsum(n_own % 2)
    kept = (columns[letters.index(letter)][entries] for letter in quantities)
    arrays = (offsets - fewer, *kept)
    for array in arrays:
        array.flags.writeable = False
    return arrays, numbers, entries
