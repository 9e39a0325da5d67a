# SPDX-License-Identifier: BSD-3-Clause
"""Which pairs of two steps are the same: what `VerletList.changes` compares."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell import _show
from halfshell._convert.types import Arrays
from halfshell._objects.rational import as_fractions, determinant, product, solved, transposed

__all__ = ["PairChanges", "Step", "compare"]

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Columns = tuple[npt.NDArray[Any], ...]

MOST_KEYS = 2**62  # i, j and the image of a pair are one number where there are fewer
PLAIN = (2.0**-400, 2.0**400)  # between these products of numbers are ordinary ones
MOST_TURNS = 2**60  # more than any pair goes on by: S is int32


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
    half along each, or by a half that was taken off. What that is depends on the two points alone,
    so that each pair goes on from one pair at most, however far points have moved. It is decided
    for the real numbers that points and box vectors are.
    """
    was, then = _Pairs(*old), _Pairs(*new)
    if before.points.shape[1] != now.points.shape[1]:
        return np.arange(len(was.i)), np.arange(len(then.i))
    every = np.concatenate(_keys_of_both(before, was, now, then))
    order = np.argsort(every, kind="stable")  # of two lists that ascend, mostly
    twice = every[order[1:]] == every[order[:-1]]
    alone = np.ones(len(every), bool)
    alone[order[1:][twice]] = alone[order[:-1][twice]] = False
    return np.flatnonzero(alone[: len(was.i)]), np.flatnonzero(alone[len(was.i) :])


def _keys_of_both(before: Step, was: _Pairs, now: Step, then: _Pairs) -> tuple[Integers, Integers]:
    """Numbers of pairs, the same for one that goes on."""
    axes = sorted(before.axes & now.axes)
    if not axes:
        return _keys(was, was.S, then, then.S) or _rows_as_keys(was, was.S, then, then.S)
    change, moves = _moves_between(before, now, axes)
    turns = moves.turns()
    if turns is not None and np.array_equal(change, np.eye(len(axes))):
        new = then.S
        if turns.any():
            new = then.S.astype(np.int64)
            new[:, axes] += turns[then.j] - turns[then.i]
        keys = _keys(was, was.S, then, new)
        if keys is not None:
            return keys
    change_of = np.eye(then.S.shape[1], dtype=np.int64)
    change_of[np.ix_(np.array(axes), np.array(axes))] = change
    new = then.S @ change_of
    goes_on = (then.i < moves.n) & (then.j < moves.n)
    turns = moves.apart(then.i[goes_on], then.j[goes_on])
    new[np.ix_(np.flatnonzero(goes_on), np.array(axes))] += turns
    old, new = _upright(was.S, was), _upright(new, then)
    return _keys(was, old, then, new) or _rows_as_keys(was, old, then, new)


class _Moves:
    """How far points have moved, in units of the box vectors that they had.

    In float64, with a bound on the error; in fractions where that does not tell which integer is
    the nearest.
    """

    def __init__(
        self, old: Floats, new: Floats, to_old: list[list[Fraction]], to_new: list[list[Fraction]]
    ) -> None:
        self.n = min(len(old), len(new))  # points that both steps have
        self.n_all = max(len(old), len(new))
        self._points, self._to_units = (old, new), (to_old, to_new)
        self._known: dict[int, list[Fraction]] = {}
        places, error_of_old = _in_units(old, to_old)
        places_now, error_of_new = _in_units(new, to_new)
        self.floats = places_now[: self.n] - places[: self.n]
        # Of the difference of two moves, and of each itself.
        self.error = error_of_old + error_of_new + 2.0**-50 * _largest(self.floats)

    def turns(self) -> Integers | None:
        """Whole box vectors that each point has jumped by, where that is clear, but for a drift.

        It is where points have moved by less than a quarter besides, so that any two have by less
        than a half. 0 for points that one step does not have: they have no pairs to go on.
        """
        for drift in (0.0, self.floats[:1]):
            rest = self.floats - drift
            whole = np.rint(rest)
            if np.all(np.abs(rest - whole) + 2.0 * self.error < 0.2499):
                turns = np.zeros((self.n_all, whole.shape[1]), np.int64)
                turns[: self.n] = whole
                return turns
        return None

    def apart(self, i: npt.NDArray[Any], j: npt.NDArray[Any]) -> Integers:
        """The integer nearest to what j has moved by more than i; of two, the larger one."""
        more = self.floats[j] - self.floats[i] + 0.5
        whole = np.floor(more)
        is_sure = np.minimum(more - whole, whole + 1.0 - more) > 2.0 * self.error
        is_sure &= np.abs(more) < MOST_TURNS
        found = np.where(is_sure, whole, 0.0).astype(np.int64)
        for k in np.flatnonzero(~is_sure.all(axis=1)):
            pair = zip(self._exactly(int(i[k])), self._exactly(int(j[k])), strict=True)
            nearest = (math.floor(b - a + Fraction(1, 2)) for a, b in pair)
            found[k] = [max(-MOST_TURNS, min(turns, MOST_TURNS)) for turns in nearest]
        return found

    def _exactly(self, point: int) -> list[Fraction]:
        move = self._known.get(point)
        if move is None:
            old, new = (
                product(as_fractions(points[point : point + 1]), to_units)[0]
                for points, to_units in zip(self._points, self._to_units, strict=True)
            )
            move = [b - a for a, b in zip(old, new, strict=True)]
            self._known[point] = move
        return move


def _moves_between(before: Step, now: Step, axes: list[int]) -> tuple[Integers, _Moves]:
    """Points of both steps in units of the box vectors before, as they are deformed now.

    A box may have got another basis of nearly the same lattice in between. `change` has the new
    vectors as sums of the old ones: the identity for a box that was only deformed.
    """
    assert before.vectors is not None and now.vectors is not None  # as some axes repeat
    old, new = (as_fractions(step.vectors[axes]) for step in (before, now))  # type: ignore[index]
    to_old = _right_inverse(old)
    to_new = to_old if new == old else _right_inverse(new)
    change = [[math.floor(x + Fraction(1, 2)) for x in row] for row in product(new, to_old)]
    in_fractions = [[Fraction(x) for x in row] for row in change]
    if max(abs(x) for row in change for x in row) > 2**20 or abs(determinant(in_fractions)) != 1:
        change = np.eye(len(axes), dtype=int).tolist()
    else:
        to_new = product(to_new, in_fractions)
    points = (_padded(before.points), _padded(now.points))
    return np.array(change, np.int64), _Moves(*points, to_old, to_new)


def _padded(points: npt.NDArray[Any]) -> Floats:
    """In float64, and at least one: it stands for points that the other step does not have."""
    return np.zeros((1, points.shape[1])) if len(points) == 0 else points.astype(np.float64)


def _right_inverse(vectors: list[list[Fraction]]) -> list[list[Fraction]]:
    """A matrix (d, m) with vectors @ matrix = 1, at right angles to what they do not span."""
    columns = transposed(vectors)
    return transposed(solved(product(vectors, columns), vectors))


def _in_units(points: Floats, to_units: list[list[Fraction]]) -> tuple[Floats, Floats]:
    """points @ to_units, rounded, and a bound on the error, for each column.

    It is infinite for units in which floats would overflow or vanish: only fractions tell there.
    """
    largest = _largest(points)
    most = [max(abs(x) for x in column) for column in transposed(to_units)]  # none is 0
    sizes = [*(x for x in most), *(Fraction(x) for x in largest[largest > 0.0].tolist())]
    if not all(PLAIN[0] < size < PLAIN[1] for size in sizes):
        return np.zeros((len(points), len(most))), np.full(len(most), np.inf)
    factors = np.array([[float(x) for x in row] for row in to_units])
    return points @ factors, largest @ np.abs(factors) * 2.0**-48 + 2.0**-600


def _largest(x: Floats) -> Floats:
    """Of each column: several times as quick as all at once."""
    return np.array([np.abs(column).max(initial=0.0) for column in x.T])


def _upright(images: Integers, pairs: _Pairs) -> Integers:
    """A pair of a point and its own image has two, opposite ones: the first number not 0 > 0."""
    is_own = pairs.i == pairs.j
    rows = images[is_own]
    first = (rows != 0).argmax(axis=1)
    images = images.copy()
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
