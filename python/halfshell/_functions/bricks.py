# SPDX-License-Identifier: BSD-3-Clause
"""`bricks`: which points each part owns, and which it needs besides."""

from __future__ import annotations

import math
from typing import Any, Never

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.lengths import as_cutoff
from halfshell._convert.options import as_count
from halfshell._convert.scene import as_scene
from halfshell._convert.types import BoxLike, FloatArray, Number, PeriodicLike, PointsLike
from halfshell._objects.brick import Brick, Bricks
from halfshell._unknown import refuse_unknown

_Numbers = npt.NDArray[np.int64]

# Places are products of some terms with matrices that were inverted in float64: relative to their
# terms they are known to this, which is far more than they lose.
_ROUNDING = 2.0**-30


def bricks(
    points: PointsLike,
    cutoff: Number,
    n: int,
    *,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    **unknown: Never,
) -> Bricks:
    """Divide points into bricks for other threads or machines; their pairs are always exact.

    Parameters
    ----------
    points : array_like of float, shape (n_points, d)
        Coordinates, as in `pairs`.
    cutoff : float
        Largest distance of a pair, in the unit of `points`; finite, not negative. It may be larger
        than a brick, and than the box: bricks then need many other points, as `Bricks.overhead`
        tells beforehand.
    n : int
        Number of bricks, 1 or more. The numbers of points that they own differ by at most 1; with
        more bricks than points some own none.
    box, periodic
        As in `pairs`.

    Returns
    -------
    Bricks
        A sequence of `Brick`, each with ``owned`` and ``needed``. A pair belongs to the brick that
        owns its lower number; all bricks together have each pair once.

    Raises
    ------
    TypeError, ValueError, OverflowError
        As `pairs`; ValueError also if `n` is less than 1.

    See Also
    --------
    iter_pairs : all pairs in blocks, in one process.

    Notes
    -----
    Points are halved again and again across their longest side [1]_, so that bricks follow the
    points, even in clusters, and not the volume. The points that a brick needs are found from the
    range of its points along each box vector, widened by the cutoff and a bound on rounding. Each
    brick is searched with the whole box and the points as given: its decisions and shifts are
    those of a single search of all points.

    References
    ----------
    .. [1] M. J. Berger, S. H. Bokhari, "A partitioning strategy for nonuniform problems on
       multiprocessors", IEEE Trans. Comput. C-36, 570-580 (1987).

    Examples
    --------
    >>> import numpy as np
    >>> import halfshell as hs
    >>> points = np.random.default_rng(0).random((1000, 3))
    >>> parts = hs.bricks(points, 0.1, 4, box=[1.0, 1.0, 1.0])
    >>> parts.sizes
    [250, 250, 250, 250]
    >>> sum(part.count_pairs(points) for part in parts)
    2099
    >>> hs.count_pairs(points, 0.1, box=[1.0, 1.0, 1.0])
    2099
    """
    if unknown:
        refuse_unknown(bricks, unknown)
    array, vectors, bits = as_scene(points, box, periodic)
    largest, n_bricks = as_cutoff(cutoff), as_count(n, "n")
    # Refuses what a search would refuse, at the price of a search with the cutoff 0.
    _core.count_pairs(array, 0.0 if math.isfinite(largest) and largest >= 0.0 else largest,
                      vectors, bits, False, "exact", None, None, None, 1, None, "auto")  # fmt: skip
    n_points, ndim = array.shape
    flags = tuple(bool(bits >> k & 1) for k in range(ndim))
    places, reach, widths = _places(array.astype(np.float64), vectors, flags, largest)
    parts = _halved(places, widths, n_bricks)
    order = np.argsort(places[:, 0], kind="stable") if n_points else np.empty(0, np.int64)
    lines = places[order, 0] if n_points else np.empty(0)
    made = []
    for part in parts:
        owned = np.sort(part)
        needed = _near(places, order, lines, owned, flags, reach)
        made.append(Brick(owned, needed, n_points, largest, (vectors, flags)))
    return Bricks(made, n_points)


def _places(
    points: FloatArray, vectors: FloatArray | None, flags: tuple[bool, ...], cutoff: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where points are along each axis, how far a pair can be apart there, and the axes' lengths.

    Along axes that repeat, places are from 0 to 1; others have the length of the coordinates.
    """
    ndim = points.shape[1]
    rows = np.eye(ndim)
    repeating = [k for k in range(ndim) if flags[k]]
    if vectors is not None and repeating:
        given = np.asarray(vectors, np.float64)[repeating]
        scale = np.abs(given).max(axis=1, keepdims=True)
        others = np.linalg.svd(given / scale)[2][len(repeating) :]  # at right angles to all of them
        rows[repeating] = given
        rows[[k for k in range(ndim) if not flags[k]]] = others
    with np.errstate(all="ignore"):
        dual = np.linalg.inv(rows).T
        places = points @ dual.T
        lengths = np.linalg.norm(dual, axis=1)
        terms = np.abs(points).max(initial=0.0) * np.abs(dual).sum(axis=1) + 1.0
        reach = cutoff * lengths * (1.0 + _ROUNDING) + terms * _ROUNDING
    for k in repeating:
        places[:, k] -= np.floor(places[:, k])
    # Where numbers are too large for this, all points are needed.
    unknown = ~np.isfinite(places).all(axis=0) | ~np.isfinite(reach)
    places[:, unknown], reach[unknown] = 0.0, np.inf
    return places, reach, 1.0 / np.where(lengths > 0.0, lengths, 1.0)


def _halved(places: FloatArray, widths: FloatArray, n: int) -> list[_Numbers]:
    """Numbers of points in n parts: each set of parts is cut across its longest side."""
    parts: list[_Numbers] = []
    open_sets: list[tuple[_Numbers, int]] = [(np.arange(len(places)), n)]
    while open_sets:
        numbers, n_parts = open_sets.pop()
        if n_parts == 1:
            parts.append(numbers)
            continue
        first = n_parts // 2
        cut = len(numbers) * first // n_parts
        if len(numbers) > 1:
            own = places[numbers]
            axis = int(np.argmax(np.ptp(own, axis=0) * widths))
            numbers = numbers[np.argpartition(own[:, axis], cut)]  # a sort takes far longer
        open_sets += [(numbers[cut:], n_parts - first), (numbers[:cut], first)]
    return parts


def _near(
    places: FloatArray, order: _Numbers, lines: FloatArray, owned: _Numbers,
    flags: tuple[bool, ...], reach: FloatArray,
) -> _Numbers:  # fmt: skip
    """Other points whose places are within reach of the range of the owned ones, ascending."""
    if len(owned) == 0:
        return np.empty(0, np.int64)
    low = places[owned].min(axis=0) - reach
    high = places[owned].max(axis=0) + reach
    found = order[_slices(lines, float(low[0]), float(high[0]), flags[0])]
    for k in range(1, places.shape[1]):
        found = found[_within(places[found, k], low[k], high[k], flags[k])]
    return np.sort(np.setdiff1d(found, owned, assume_unique=True))


def _slices(lines: FloatArray, low: float, high: float, repeats: bool) -> Any:
    """Positions of ascending places within a range, which may go on from the other side."""
    if not repeats:
        return slice(np.searchsorted(lines, low), np.searchsorted(lines, high, side="right"))
    if not high - low < 1.0:
        return slice(None)
    turns = math.floor(low)
    low, high = low - turns, high - turns
    inside = np.arange(np.searchsorted(lines, low), np.searchsorted(lines, high, side="right"))
    behind = np.searchsorted(lines, high - 1.0, side="right") if high >= 1.0 else 0
    return np.concatenate((np.arange(behind), inside))


def _within(
    places: FloatArray, low: float, high: float, repeats: bool
) -> npt.NDArray[np.bool_]:
    if not repeats:
        return (places >= low) & (places <= high)
    if not high - low < 1.0:
        return np.ones(len(places), bool)
    turned = places - low
    found: npt.NDArray[np.bool_] = turned - np.floor(turned) <= high - low
    return found
