# SPDX-License-Identifier: BSD-3-Clause
"""Searches with the argument `indices`: the rows of some points, found as those of queries, and the
pairs that these points are in."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.arrays import entries_of, rows_of, starts_of
from halfshell._convert.call import Call, Known, part_of
from halfshell._convert.foreign import is_a
from halfshell._errors import CapacityError

if TYPE_CHECKING:
    from halfshell._convert.types import Arrays

Array = npt.NDArray[Any]

# A mark for each of so many points takes less time than one look-up among numbers that ascend.
_POINTS_PER_LOOKUP = 32

_POINTS_OF_PART = 4096  # whose pairs are held at a time, where not all are


class Rows(NamedTuple):
    """Rows of some points, without the points themselves."""

    offsets: npt.NDArray[np.int64]
    columns: tuple[Array, ...]
    numbers: npt.NDArray[np.int64]  # whose rows they are
    entries: npt.NDArray[np.int64]  # which of those that a search for these as queries finds


def rows_of_some(call: Call, quantities: str, index_bytes: int) -> Rows:
    """The rows of `call.indices`, each ascending by (j, S)."""
    numbers = call.indices
    assert numbers is not None
    letters = quantities if "j" in quantities else "j" + quantities
    order = None
    if call.points.batch is not None:  # systems come one after the other
        order = np.argsort(call.points.batch[numbers], kind="stable")
        numbers = numbers[order]
    offsets, *columns = call.run(
        _core.neighbors, letters, index_bytes, *call.as_queries(numbers), call.settings.algorithm,
        call.shells,
    )  # fmt: skip
    j = columns[letters.index("j")]
    row = rows_of(offsets)
    # A point meets its images in the order of S: the middle one is itself, at S = 0.
    own = np.flatnonzero(j == numbers[row])
    first = np.searchsorted(own, offsets)
    n_own = np.diff(first)
    found = np.flatnonzero(n_own % 2)
    itself = own[first[found] + n_own[found] // 2]
    entries = np.delete(np.arange(len(j)), itself)
    offsets = offsets - starts_of(n_own % 2)
    if order is not None:
        place = np.argsort(order)
        offsets, chosen = entries_of(offsets, place)
        entries, numbers = entries[chosen], numbers[place]
    kept = tuple(columns[letters.index(letter)][entries] for letter in quantities)
    for array in (offsets, *kept):
        array.flags.writeable = False
    return Rows(offsets, kept, numbers, entries)


def pairs_of_some(
    call: Call, quantities: str, sort: bool, index_bytes: int, out: Any
) -> Arrays:
    """Pairs with one of `call.indices`, as a half list."""
    asked = named_once(call)
    if out is not None:  # its types and shapes, before anything is searched for
        least = 0.0 if call.shells is None else call.cutoff
        _core.pairs(
            np.empty((0, call.array.shape[1])), least, None, 0, *call.rest[:4], None, call.threads,
            quantities, sort, index_bytes, out, None, "auto", call.shells,
        )  # fmt: skip
    arrays = _pairs_of_part(call, asked, slice(None), quantities, sort, index_bytes)
    if out is not None:
        arrays = _filled(arrays, out if is_a(out, tuple) else (out,))
    return arrays[0] if len(arrays) == 1 else arrays


def blocks_of_some(call: Call, quantities: str, index_bytes: int) -> Iterator[tuple[Array, ...]]:
    """Pairs with one of `call.indices`, not sorted: those of some of these points at a time."""
    asked = named_once(call)
    whole = copy(call)
    call.progress = call.bar = None
    if call.cells is None and not call.has_reach and call.points.batch is None:
        call.cells = call.run(_core.cells_build, 0.0, None)
    n = max(-(-len(asked) // _POINTS_OF_PART), 1)

    def each() -> Iterator[tuple[Array, ...]]:
        for k in range(n):
            some = slice(k * _POINTS_OF_PART, (k + 1) * _POINTS_OF_PART)
            call.progress = part_of(whole.progress, k, n)
            yield _pairs_of_part(call, asked, some, quantities, False, index_bytes)
        whole.close()

    return each()


def named_once(call: Call) -> npt.NDArray[np.int64]:
    """`call.indices`, ascending: of a batch, systems come one after the other."""
    assert call.indices is not None
    ascending = np.sort(call.indices)
    for k in np.flatnonzero(ascending[1:] == ascending[:-1]):
        raise ValueError(f"indices must name each point once, got {ascending[k]} twice")
    return ascending


def within_and_beyond(call: Call, numbers: npt.NDArray[np.int64]) -> list[Call]:
    """Calls for pairs of two of these points, and of one as a query with another point. They have
    no reach."""
    is_named = np.zeros(len(call.points), bool)
    is_named[numbers] = True
    rest = np.flatnonzero(~is_named)
    place = np.empty(len(call.points), np.int64)
    place[numbers], place[rest] = np.arange(len(numbers)), np.arange(len(rest))
    found = []
    for own, asking in ((numbers, None), (rest, numbers)):
        one = copy(call)
        one.cells = one.indices = None
        one.__dict__.pop("systems", None)  # not those of all points
        one.points = call.points[own]
        one.queries = None if asking is None else call.points[asking]
        one.known = call.known.some(own)
        one.known_of_queries = Known() if asking is None else call.known.some(asking)
        pairs = call.pairing and call.pairing.excluded
        if call.pairing is not None and pairs is not None:
            if asking is None:
                pairs = pairs[is_named[pairs].all(axis=1)]
            else:
                pairs = np.concatenate([pairs, pairs[:, ::-1]])
                pairs = pairs[is_named[pairs[:, 0]] & ~is_named[pairs[:, 1]]]
            one.pairing = call.pairing._replace(excluded=np.ascontiguousarray(place[pairs]))
        found.append(one)
    return found


def _pairs_of_part(
    call: Call, asked: npt.NDArray[np.int64], some: slice, quantities: str, sort: bool,
    index_bytes: int,
) -> tuple[Array, ...]:  # fmt: skip
    """Pairs that have some of the points asked for, and no pair that another part has."""
    letters = "j" + "".join(letter for letter in quantities if letter in "dDSk")
    part = asked[some]
    offsets, *columns = call.run(
        _core.neighbors, letters, index_bytes, *call.as_queries(part), call.settings.algorithm,
        call.shells,
    )  # fmt: skip
    found = dict(zip(letters, columns, strict=True))
    found = _half_list(found, rows_of(offsets), part, asked, len(call.points), sort)
    if "P" in quantities:
        found["P"] = np.stack([found["i"], found["j"]], axis=1)
    return tuple(found[letter] for letter in quantities)


def _half_list(
    columns: dict[str, Array], row: Array, numbers: npt.NDArray[np.int64],
    every: npt.NDArray[np.int64], n_points: int, sort: bool,
) -> dict[str, Array]:  # fmt: skip
    """Rows of these points, ascending by (j, S), as pairs that are there once in rows of every."""
    j = columns["j"]
    i = numbers.astype(j.dtype)[row]
    keep = ~_are_among(j, every, n_points) | (i < j)
    # A point meets its images in the order of S: the middle one is itself, at S = 0, and those
    # behind it have a positive first component.
    own = np.flatnonzero(i == j)
    n_own = np.bincount(row[own], minlength=len(numbers))
    rank = np.arange(len(own)) - np.repeat(np.cumsum(n_own) - n_own, n_own)
    keep[own] = rank > np.repeat(n_own // 2, n_own)
    entries = np.flatnonzero(keep)
    kept = {letter: array[entries] for letter, array in columns.items() if letter in "dDSk"}
    i, j = i[entries], j[entries]
    back = np.flatnonzero(j < i)  # these come from their second point
    i[back], j[back] = j[back], i[back]
    if "D" in kept:
        kept["D"][back] = 0.0 - kept["D"][back]  # a zero has no sign
    if "S" in kept:
        if kept["S"][back].min(initial=0) == np.iinfo(kept["S"].dtype).min:
            raise OverflowError("a shift does not fit int32: -2**31 has no opposite there")
        kept["S"][back] *= -1
    kept.update(i=i, j=j)
    if sort:
        place = np.arange(len(i))
        place[back] *= -1  # their shifts, turned round, descend
        order = np.lexsort((place, j, i))
        kept = {letter: array[order] for letter, array in kept.items()}
    return kept


def _are_among(j: Array, numbers: npt.NDArray[np.int64], n_points: int) -> npt.NDArray[np.bool_]:
    """Whether each of j is one of these numbers, which ascend."""
    if len(j) > n_points // _POINTS_PER_LOOKUP:
        is_named = np.zeros(n_points, dtype=bool)
        is_named[numbers] = True
        return is_named[j]
    ascending = np.append(numbers, -1)  # behind the last one
    found: npt.NDArray[np.bool_] = ascending[np.searchsorted(numbers, j)] == j
    return found


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
