# SPDX-License-Identifier: BSD-3-Clause
"""Which pairs of two steps are the same: what `VerletList.changes` compares."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell import _show
from halfshell._convert.types import Arrays

__all__ = ["PairChanges", "Step", "compare"]

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Columns = tuple[npt.NDArray[Any], ...]
Flags = npt.NDArray[np.bool_]

MOST_KEYS = 2**62  # i, j and the image of a pair are one number where there are fewer


class PairChanges(NamedTuple):
    """The changes that `VerletList.changes` returns.

    Attributes
    ----------
    formed : ndarray or tuple of ndarray
        The pairs of the last step that did not exist in the previous step, as of the last step.
    broken : ndarray or tuple of ndarray
        The pairs of the previous step that no longer exist, as of the previous step.

    Examples
    --------
    >>> import halfshell as hs
    >>> pair_list = hs.VerletList(1.0, track_changes=True)
    >>> pair_list.update([[0.0], [0.9]])
    True
    >>> pair_list.changes()._fields
    ('formed', 'broken')
    """

    formed: Arrays
    broken: Arrays

    def __repr__(self) -> str:
        return _show.line(self)

    def _repr_html_(self) -> str:
        return _show.html(self)


class Step(NamedTuple):
    """The scene of one step."""

    points: npt.NDArray[Any]  # (n, d)
    vectors: Floats | None  # of the box
    bits: int  # axes that repeat

    @property
    def axes(self) -> set[int]:
        return {k for k in range(self.points.shape[1]) if self.bits >> k & 1}


class _Pairs(NamedTuple):
    """Pairs of a step."""

    i: npt.NDArray[Any]
    j: npt.NDArray[Any]
    S: npt.NDArray[Any]  # (m, d)


def compare(before: Step, old: Columns, now: Step, new: Columns) -> tuple[Integers, Integers]:
    """Which pairs (i, j, S) of the step before, and of this one, are not in the other one.

    Both lists ascend; what is returned are places in them, which ascend too.

    Points are told by their numbers, and images of them by continuity: a pair in this step goes
    on from the one whose vector, in units of the box vectors, differs from its own by less than a
    half along each. What that is depends on the two points alone, so that each pair goes on from
    one pair at most, however far points have moved.
    """
    was, then = _Pairs(*old), _Pairs(*new)
    if before.points.shape[1] != now.points.shape[1]:
        return np.arange(len(was.i)), np.arange(len(then.i))
    keys = _keys_of_both(before, was, now, then)
    every = np.sort(np.concatenate(keys), kind="stable")
    twice = every[1:] == every[:-1]
    alone = np.ones(len(every), bool)
    alone[1:] &= ~twice
    alone[:-1] &= ~twice
    single = every[alone]
    return _places_of(single, keys[0]), _places_of(single, keys[1])


def _places_of(single: Integers, keys: Integers) -> Integers:
    """Where those of these numbers are that are among the keys, each once."""
    if not np.all(keys[1:] > keys[:-1]):  # there were jumps
        places: Integers = np.flatnonzero(np.isin(keys, single))
        return places
    places = keys.searchsorted(single)
    inside = places < len(keys)
    places, single = places[inside], single[inside]
    found: Integers = places[keys[places] == single]
    return found


def _keys_of_both(before: Step, was: _Pairs, now: Step, then: _Pairs) -> tuple[Integers, Integers]:
    """Numbers of pairs, the same for one that goes on."""
    axes = sorted(before.axes & now.axes)
    if not axes:
        return _keys(was, was.S, then, then.S) or _rows_as_keys(was, was.S, then, then.S)
    change, old_places, new_places = _places(before, now, axes)
    turns = _turns(old_places, new_places)
    if turns is not None and np.array_equal(change, np.eye(len(axes))):
        new = then.S
        if turns.any():
            new = then.S.astype(np.int64)
            new[:, axes] += turns[then.j] - turns[then.i]
        keys = _keys(was, was.S, then, new)
        if keys is not None:
            return keys
    images = _images(was, then, axes, change, old_places, new_places)
    return _keys(was, images[0], then, images[1]) or _rows_as_keys(was, images[0], then, images[1])


def _turns(old_places: Floats, new_places: Floats) -> Integers | None:
    """Whole box vectors that each point has jumped by, if that is clear for all, but for a drift.

    It is where points have moved by less than a quarter besides, so that any two have by less than
    a half. 0 for points that one step does not have: they have no pairs to go on.
    """
    n = min(len(old_places), len(new_places))
    moves = new_places[:n] - old_places[:n]
    for drift in (0.0, moves[0]):
        whole = _whole(moves - drift)
        if np.all(np.abs(moves - drift - whole) < 0.2499):
            turns = np.zeros((max(len(old_places), len(new_places)), whole.shape[1]), np.int64)
            turns[:n] = whole
            return turns
    return None


def _images(
    was: _Pairs,
    then: _Pairs,
    axes: list[int],
    change: Integers,
    old_places: Floats,
    new_places: Floats,
) -> tuple[Integers, Integers]:
    """An image for each pair, small numbers that are the same for a pair that goes on."""
    others = [k for k in range(was.S.shape[1]) if k not in axes]
    least = min(len(old_places), len(new_places))

    def apart(places: Floats, of: _Pairs) -> Floats:
        last = len(places) - 1
        first, second = (places[np.minimum(last, numbers)] for numbers in (of.i, of.j))
        difference: Floats = second - first
        return difference

    old = was.S[:, axes] + _whole(apart(old_places, was))
    ago, today = apart(old_places, then), apart(new_places, then)
    goes_on = ((then.i < least) & (then.j < least))[:, None]
    turns = np.where(goes_on, _whole(today - ago) + _whole(ago), _whole(today))
    new = then.S[:, axes] @ change + turns
    return (
        _upright(np.hstack([old, was.S[:, others]]), was.i == was.j),
        _upright(np.hstack([new, then.S[:, others]]), then.i == then.j),
    )


def _places(
    before: Step, now: Step, axes: list[int]
) -> tuple[Integers, Floats, Floats]:
    """Points of both steps in units of the box vectors before, as they are deformed now.

    A box may have got another basis of nearly the same lattice in between. `change` has the new
    vectors as sums of the old ones: the identity for a box that was only deformed.
    """
    assert before.vectors is not None and now.vectors is not None  # as some axes repeat
    old_inverse = _right_inverse(before.vectors[axes])
    new_inverse = _right_inverse(now.vectors[axes])
    one = np.eye(len(axes))
    change = np.rint(_finite(now.vectors[axes] @ old_inverse))
    if np.abs(change).max() > 2**20 or round(abs(np.linalg.det(change))) != 1:
        change = one
    with np.errstate(over="ignore", invalid="ignore"):
        return (
            change.astype(np.int64),
            _finite(_padded(before.points) @ old_inverse),
            _finite(_padded(now.points) @ (new_inverse @ change)),
        )


def _padded(points: npt.NDArray[Any]) -> Floats:
    """In float64, and at least one: it stands for points that the other step does not have."""
    return np.zeros((1, points.shape[1])) if len(points) == 0 else points.astype(np.float64)


def _right_inverse(vectors: Floats) -> Floats:
    """A matrix (d, m) with vectors @ matrix = 1, for vectors of any length."""
    lengths = np.abs(vectors).max(axis=1)
    return np.asarray(np.linalg.pinv(vectors / lengths[:, None], rcond=0.0) / lengths)


def _finite(x: Floats) -> Floats:
    """Numbers that overflowed are 0: then S alone tells images apart."""
    return np.where(np.isfinite(x), x, 0.0)


def _whole(x: Floats) -> Integers:
    return np.rint(np.clip(x, -(2.0**60), 2.0**60)).astype(np.int64)


def _upright(images: Integers, is_own: Flags) -> Integers:
    """A pair of a point and its own image has two, opposite ones: the first number not 0 > 0."""
    rows = images[is_own]
    first = (rows != 0).argmax(axis=1)
    images[is_own] *= np.sign(rows[np.arange(len(rows)), first])[:, None]
    return images


def _keys(
    was: _Pairs, old: npt.NDArray[Any], then: _Pairs, new: npt.NDArray[Any]
) -> tuple[Integers, Integers] | None:
    """A number for each pair from i, j and its image, in their order; None: they are too many."""
    low = np.minimum(old.min(axis=0, initial=0), new.min(axis=0, initial=0)).astype(np.int64)
    high = np.maximum(old.max(axis=0, initial=0), new.max(axis=0, initial=0)).astype(np.int64)
    widths = [int(width) for width in high - low + 1]
    n = int(max(was.j.max(initial=0), then.j.max(initial=0))) + 1
    if n * n * math.prod(widths) > MOST_KEYS:
        return None

    def number(pairs: _Pairs, images: npt.NDArray[Any]) -> Integers:
        keys = pairs.i.astype(np.int64) * n
        keys += pairs.j
        for axis, width in enumerate(widths):
            if width > 1:
                keys *= width
                keys += images[:, axis]
                keys -= low[axis]
        return keys

    return number(was, old), number(then, new)


def _rows_as_keys(
    was: _Pairs, old: npt.NDArray[Any], then: _Pairs, new: npt.NDArray[Any]
) -> tuple[Integers, Integers]:
    """The same by sorting."""
    rows = [np.column_stack([was.i, was.j, old]), np.column_stack([then.i, then.j, new])]
    keys = np.unique(np.concatenate(rows), axis=0, return_inverse=True)[1].reshape(-1)
    return keys[: len(old)], keys[len(old) :]
