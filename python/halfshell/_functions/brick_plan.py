# SPDX-License-Identifier: BSD-3-Clause
"""Division of points that are in pieces, none of which sees the others.

Each piece is summed up; the summaries say where bricks are cut. Any cuts are right: a sample of the
points only makes bricks of about equal size.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell._functions.brick_places import Axes, axes_of

Array = npt.NDArray[Any]

# Points of each piece, and of all pieces, by which bricks are cut: not many more than these.
_SAMPLE, _SAMPLES = 1 << 13, 1 << 22


class Summary(NamedTuple):
    """What a division must know of a piece."""

    n_points: int
    largest: float  # of the coordinates, without signs
    sample: Array  # of shape (k, d)
    weight: float  # how many points each of the sample stands for
    error: Exception | None  # why the piece cannot be searched


class Cut(NamedTuple):
    """A range along an axis that is cut in two, and what its parts are: bricks or cuts."""

    axis: int
    low: float
    at: float
    high: float
    below: Cut | int
    above: Cut | int


class Division(NamedTuple):
    """Where bricks are cut, and where the numbers of each piece begin."""

    cuts: Cut | int
    n_bricks: int
    axes: Axes
    firsts: tuple[int, ...]
    n_points: int
    cutoff: float
    scene: tuple[Any, tuple[bool, ...]]


def summary(points: Array, n_pieces: int) -> Summary:
    """Sum up one of some pieces; points are named by their places in it."""
    n_points = len(points)
    step = 1 + n_points // max(1, min(_SAMPLE, _SAMPLES // n_pieces))
    largest = float(max(points.max(initial=0.0), -points.min(initial=0.0)))
    error = None
    if not np.isfinite(largest):
        wrong = np.argwhere(~np.isfinite(points)).tolist()
        row, column = wrong[0] if wrong else (0, 0)  # if another thread changes them
        value = points[row, column]
        error = ValueError(f"points must be finite, got points[{row}, {column}] = {value}")
    sample = points[::step].astype(np.float64)
    return Summary(n_points, largest, sample, n_points / max(1, len(sample)), error)


def divide(
    cutoff: float, n_bricks: int, vectors: Any, flags: tuple[bool, ...], *summaries: Summary
) -> Division:
    """Where to cut; raises what is wrong with the first piece that has an error."""
    ends = np.cumsum([0, *(one.n_points for one in summaries)], dtype=np.int64).tolist()
    for one, first in zip(summaries, ends, strict=False):
        if one.error is not None:
            raise renumbered(one.error, points=range(first, first + one.n_points))
    axes = axes_of(vectors, flags, cutoff, max((one.largest for one in summaries), default=0.0))
    samples = [one.sample for one in summaries if len(one.sample)]
    places = axes.places(np.concatenate(samples)) if samples else np.empty((len(flags), 0))
    weights = np.repeat([one.weight for one in summaries], [len(one.sample) for one in summaries])
    low = np.where(axes.repeats, 0.0, -np.inf)
    high = np.where(axes.repeats, 1.0, np.inf)
    bricks = iter(range(n_bricks))
    cuts = _cut(places, weights, n_bricks, (low, high), axes.widths, bricks)
    return Division(cuts, n_bricks, axes, tuple(ends[:-1]), ends[-1], cutoff, (vectors, flags))


def _cut(
    places: Array, weights: Array, n_parts: int, region: tuple[Array, Array], widths: Array,
    bricks: Iterator[int],
) -> Cut | int:  # fmt: skip
    """Cut a region across the longest side of its sample, so that both parts weigh their share."""
    if n_parts == 1:
        return next(bricks)
    first, (low, high) = n_parts // 2, region
    axis, at = 0, 0.0
    if len(weights):
        axis = int(np.argmax(np.ptp(places, axis=1) * widths))
        order = np.argsort(places[axis], kind="stable")
        sums = np.cumsum(weights[order])
        above = int(np.searchsorted(sums, sums[-1] * first / n_parts, side="right"))
        last, at = places[axis][order[[above - 1, above]]].tolist()
        middle = 0.5 * last + 0.5 * at
        at = middle if middle > last else at  # points at neither side of it need fewer others
    is_below = places[axis] < at
    ends, begins = high.copy(), low.copy()
    ends[axis] = begins[axis] = at
    return Cut(
        axis, float(low[axis]), at, float(high[axis]),
        _cut(places[:, is_below], weights[is_below], first, (low, ends), widths, bricks),
        _cut(places[:, ~is_below], weights[~is_below], n_parts - first, (begins, high), widths,
             bricks),
    )  # fmt: skip


def renumbered(error: Exception, **numbers: Any) -> Exception:
    """The same error with numbers among all points, by the name that it gives to some of them."""

    def other(found: re.Match[str]) -> str:
        return f"points[{numbers[found[1]][int(found[2])]}"

    return type(error)(re.sub(rf"\b({'|'.join(numbers)})\[(\d+)", other, str(error)))
