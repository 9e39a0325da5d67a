# SPDX-License-Identifier: BSD-3-Clause
"""Pairs that touch some points: found from these, as rows of two sets, and made a half list."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.foreign import is_a
from halfshell._convert.listed import as_point_numbers
from halfshell._convert.options import check_letters
from halfshell._errors import CapacityError

if TYPE_CHECKING:
    from halfshell._convert.types import Arrays, Out, PointArray, Reach, Search

Array = npt.NDArray[Any]

# A mark for each of so many points takes less time than one look-up among numbers that ascend.
_POINTS_PER_LOOKUP = 32

# How a search for pairs writes them: quantities, sort, index_bytes, out.
Wanted = tuple[str, bool, int, "Out | None"]


def as_touching(touching: Any, n: int) -> npt.NDArray[np.int64]:
    """Numbers of points, none of them twice."""
    numbers = as_point_numbers(touching, "touching", n, "points")
    ascending = np.sort(numbers)
    for k in np.flatnonzero(ascending[1:] == ascending[:-1]):
        raise ValueError(f"touching must name each point once, got {ascending[k]} twice")
    return numbers


def pairs_touching(
    search: Search,
    points: PointArray,
    touching: Any,
    wanted: Wanted,
    reach: Reach | None,
    algorithm: str,
) -> Arrays:
    """Pairs with one of these points; `search` begins with the points, or with cells of them."""
    quantities, sort, index_bytes, out = wanted
    check_letters(quantities)
    if is_a(search[5], str) and search[5] == "single":
        raise ValueError("touching cannot be combined with precision 'single'")
    numbers = as_touching(touching, len(points))
    if out is not None:  # its types and shapes, before anything is searched for
        _core.pairs(
            np.empty((0, points.shape[1])), 0.0, None, 0, *search[4:8], None, search[9], *wanted,
            None, "auto", None,
        )  # fmt: skip
    letters = "ij" + "".join(letter for letter in quantities if letter in "dDS")
    rows = _core.pairs_between(
        *search, letters, True, index_bytes, None, points[numbers],
        asked_by(reach, numbers), algorithm,
    )  # fmt: skip
    columns = _half_list(dict(zip(letters, rows, strict=True)), numbers, len(points), sort)
    if "P" in quantities:
        columns["P"] = np.stack([columns["i"], columns["j"]], axis=1)
    arrays = tuple(columns[letter] for letter in quantities)
    if out is not None:
        arrays = _filled(arrays, out if isinstance(out, tuple) else (out,))
    return arrays[0] if len(arrays) == 1 else arrays


def asked_by(reach: Reach | None, numbers: npt.NDArray[np.int64]) -> Reach | None:
    """The reach of points, for some of them as queries too."""
    if reach is None:
        return None
    if len(reach) == 2:
        from halfshell._convert.selection import for_points

        return for_points(reach, asked_by(reach[0], numbers), numbers)
    fields: list[Any] = list(reach)
    for own in (1, 3, 6):  # radii, types and supports, before those of queries
        fields[own + 1] = None if fields[own] is None else fields[own][numbers]
    return cast("Reach", tuple(fields))


def _half_list(
    columns: dict[str, Array], numbers: npt.NDArray[np.int64], n_points: int, sort: bool
) -> dict[str, Array]:
    """Rows of these points, ascending by (j, S), as pairs that are there once."""
    row, j = columns["i"], columns["j"]
    i = numbers.astype(row.dtype)[row]
    keep = ~_are_among(j, numbers, n_points) | (i < j)
    # A point meets its images in the order of S: the middle one is itself, at S = 0, and those
    # behind it have a positive first component.
    own = np.flatnonzero(i == j)
    n_own = np.bincount(row[own], minlength=len(numbers))
    rank = np.arange(len(own)) - np.repeat(np.cumsum(n_own) - n_own, n_own)
    keep[own] = rank > np.repeat(n_own // 2, n_own)
    entries = np.flatnonzero(keep)
    kept = {letter: array[entries] for letter, array in columns.items() if letter in "dDS"}
    i, j = i[entries], j[entries]
    back = np.flatnonzero(j < i)  # these come from their second point
    i[back], j[back] = j[back], i[back]
    if "D" in kept:
        kept["D"][back] = 0.0 - kept["D"][back]  # a zero has no sign
    if "S" in kept:
        _check_opposites(kept["S"][back])
        kept["S"][back] *= -1
    kept.update(i=i, j=j)
    if sort:
        place = np.arange(len(i))
        place[back] *= -1  # their shifts, turned round, descend
        order = np.lexsort((place, j, i))
        kept = {letter: array[order] for letter, array in kept.items()}
    return kept


def _are_among(j: Array, numbers: npt.NDArray[np.int64], n_points: int) -> npt.NDArray[np.bool_]:
    """Whether each of j is one of these numbers."""
    if len(j) > n_points // _POINTS_PER_LOOKUP:
        is_touched = np.zeros(n_points, dtype=bool)
        is_touched[numbers] = True
        return is_touched[j]
    ascending = np.append(np.sort(numbers), -1)  # behind the last one
    found: npt.NDArray[np.bool_] = ascending[np.searchsorted(ascending[:-1], j)] == j
    return found


def _check_opposites(shifts: Array) -> None:
    if shifts.min(initial=0) == np.iinfo(shifts.dtype).min:
        raise OverflowError("a shift does not fit int32: -2**31 has no opposite there")


def _filled(arrays: tuple[Array, ...], out: tuple[Any, ...]) -> tuple[Array, ...]:
    """The front of each array of `out`, with what was found."""
    needed = len(arrays[0])
    if min(len(array) for array in out) < needed:
        raise CapacityError(
            f"out is too small: there are {needed} pairs, each array needs room for all", needed
        )
    views = tuple(np.asarray(array)[:needed] for array in out)
    for view, array in zip(views, arrays, strict=True):
        view[...] = array
    return views
