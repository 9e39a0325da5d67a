# SPDX-License-Identifier: BSD-3-Clause
"""Whether two answers are the same, and who is right where they are not.

A result becomes one sorted array of integers, a row for each pair; rows are compared by a number
for each, so that lists of millions of pairs take a second or two. Every pair on which two lists
differ is then judged in rational arithmetic, so that a difference is never put down to the wrong
side.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell._convert.arrays import are_backward, row_keys
from scenes import Scene

__all__ = ["Verdict", "compare", "compare_counts", "compare_nearest", "half_rows", "is_pair"]

Rows = NDArray[np.int64]

_JUDGED = 500  # of each kind are judged one by one; rational arithmetic is slow


@dataclass(frozen=True)
class Verdict:
    """How an answer differs from ours. Counts are of pairs of the half list."""

    missed: int = 0  # ours has them, the peer has not
    spurious: int = 0  # the peer has them, we have not
    duplicate: int = 0  # the peer has them more than once
    beyond: int = 0  # judged pairs that are not explained by the peer's rounding
    ours_wrong: int = 0  # judged pairs on which the peer is right
    judged: int = 0

    @property
    def complete(self) -> bool:
        """Whether the pairs are ours but for some within rounding of the cutoff."""
        return self.beyond == 0

    def __str__(self) -> str:
        words = {
            "missed": self.missed,
            "spurious": self.spurious,
            "duplicate": self.duplicate,
            "beyond rounding": self.beyond,
        }
        return ", ".join(f"{count} {word}" for word, count in words.items() if count) or "same"


def half_rows(i: Any, j: Any, shift: Any = None, full: bool = False) -> Rows:
    """Turn pairs into the sorted rows (i, j, *S) of the half list.

    Parameters
    ----------
    i, j : array_like, shape (m,)
        Point numbers, of any integer type.
    shift : array_like, shape (m, d), optional
        Shifts. Without them pairs are told apart by their point numbers alone, which is
        enough wherever no pair of points has several images.
    full : bool, default False
        Whether each pair is present in both directions.

    Returns
    -------
    numpy.ndarray of int64, shape (m, 2 + d) or (m, 2), half as long for a full list
    """
    i, j = (np.asarray(one).astype(np.int64) for one in (i, j))
    shift = None if shift is None else np.asarray(shift).astype(np.int64)
    turned = are_backward(i, j, shift)
    columns = [np.minimum(i, j), np.maximum(i, j)]
    columns += [] if shift is None else [*np.where(turned[:, None], -shift, shift).T]
    # A full list holds every pair twice, so every other one is the half list; what is present
    # once or three times shows up as missing or duplicate.
    order = np.argsort(row_keys(columns)[0])[:: 2 if full else 1]
    return np.column_stack(columns)[order]


def compare(scene: Scene, ours: Rows, theirs: Rows, inclusive: bool, band: float) -> Verdict:
    """Compare the rows of two half lists.

    Parameters
    ----------
    inclusive : bool
        The tie rule of both lists.
    band : float
        Differences are the peer's rounding where the distance is within this fraction of the
        cutoff.
    """
    own, other = row_keys(ours.T, theirs.T)
    if np.array_equal(own, other) and bool((other[1:] > other[:-1]).all()):
        return Verdict()  # nearly always, and sets of millions of keys take half a minute
    unique, first = np.unique(other, return_index=True)
    missed = ours[np.isin(own, unique, invert=True)]
    spurious = theirs[first[np.isin(unique, own, invert=True)]]
    beyond = ours_wrong = 0
    sample = [(row, True) for row in missed[:_JUDGED].tolist()]
    sample += [(row, False) for row in spurious[:_JUDGED].tolist()]
    for (i, j, *shift), in_ours in sample:
        inside, relative = is_pair(scene, i, j, tuple(shift) or None, inclusive)
        ours_wrong += inside != in_ours
        beyond += abs(relative) > band
    return Verdict(
        len(missed), len(spurious), len(theirs) - len(unique), beyond, ours_wrong, len(sample)
    )


def compare_counts(ours: int, theirs: int) -> Verdict:
    """Compare two numbers of pairs; which pairs differ is not known."""
    return Verdict(missed=max(ours - theirs, 0), spurious=max(theirs - ours, 0))


def compare_nearest(
    scene: Scene, ours: tuple[Any, Any], theirs: tuple[Any, Any], float_bits: int
) -> Verdict:
    """Compare distances and numbers of the nearest points, row by row.

    Ties may come in any order, so that distances decide. An entry of theirs that is further away
    than ours is missed, one that is nearer is spurious: unless the point is where they say, which
    means that ours is wrong.
    """
    d, other = np.asarray(ours[0]), np.asarray(theirs[0], dtype=np.float64)
    # Differences, squares and a sum are rounded; and coordinates, where they are wrapped or become
    # float32.
    moves = scene.box is not None or float_bits < 53
    extent = float(np.abs(scene.points).max()) if moves else 0.0
    room = 32.0 * 2.0**-float_bits * (d + extent)
    missed, spurious = np.argwhere(other > d + room), np.argwhere(other < d - room)
    wrong = 0
    for i, e in spurious[:_JUDGED]:
        nearer = replace(scene, cutoff=float(d[i, e]))
        wrong += is_pair(nearer, int(i), int(theirs[1][i, e]), None, False)[0]
    judged = len(missed) + len(spurious)
    return Verdict(len(missed), len(spurious), 0, judged, wrong, judged)


def is_pair(
    scene: Scene, i: int, j: int, shift: tuple[int, ...] | None, inclusive: bool
) -> tuple[bool, float]:
    """Decide one pair in rational arithmetic.

    Returns whether it is within the cutoff, and by how much its distance passes the cutoff,
    as a fraction of the cutoff. Without `shift` the nearest image is meant.
    """
    rows = scene.rows_at(i)
    between = [Fraction(b) - Fraction(a) for a, b in zip(*scene.points[[i, j]], strict=True)]
    if rows is None:
        vectors = [between]
    elif shift is not None:
        vectors = [_moved(between, rows, np.array(shift))]
    else:
        vectors = [_moved(between, rows, near) for near in _nearest(scene, rows, i, j)]
    square = min(sum(x * x for x in vector) for vector in vectors)
    reach = sum(Fraction(part) for part in scene.reach(i, j))
    limit = reach**2
    inside = square <= limit if inclusive else square < limit
    # sqrt(1 + e) - 1 = e / 2 where it matters, and the sign is exact.
    return inside, float((square - limit) / limit * reach) / 2.0 / scene.cutoff


def _nearest(scene: Scene, rows: NDArray[np.float64], i: int, j: int) -> NDArray[np.float64]:
    """Shifts of the image of j that is nearest to i, several where rounding leaves it open."""
    between = scene.points[j] - scene.points[i]
    periodic = np.array(scene.periodic, dtype=np.float64)
    near = -np.rint(between @ np.linalg.inv(rows)) * periodic
    steps = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * scene.dim), axis=-1)
    shifts = near + np.unique(steps.reshape(-1, scene.dim) * periodic, axis=0)
    squares = np.sum((between + shifts @ rows) ** 2, axis=1)
    nearest: NDArray[np.float64] = shifts[squares <= squares.min() * (1.0 + 1e-9)]
    return nearest


def _moved(between: list[Fraction], rows: NDArray[np.float64], shift: Any) -> list[Fraction]:
    """Add `shift` box vectors to a vector."""
    return [
        part + sum(int(s) * Fraction(row[axis]) for s, row in zip(shift, rows, strict=True))
        for axis, part in enumerate(between)
    ]
