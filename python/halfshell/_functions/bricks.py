# SPDX-License-Identifier: BSD-3-Clause
"""`bricks`: which points each part owns, and which it needs besides."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Never

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.lengths import as_cutoff
from halfshell._convert.options import as_brick_count
from halfshell._convert.scene import as_scene
from halfshell._convert.types import BoxLike, FloatArray, Number, PeriodicLike, PointsLike
from halfshell._functions.brick_places import Axes, axes_of, within
from halfshell._objects.brick import Brick, Bricks
from halfshell._unknown import refuse_unknown

_Numbers = npt.NDArray[np.int64]


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
        Number of bricks, 1 to 2**20. The numbers of points that they own differ by at most 1; with
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
        As `pairs`; ValueError also if `n` is not from 1 to 2**20.

    See Also
    --------
    iter_pairs : all pairs in blocks, in one process.

    Notes
    -----
    Points are halved again and again across their longest side [1]_, so that bricks follow the
    points, even in clusters, and not the volume. The points that a brick needs are found from the
    range of its points along each vector of a short basis of the box, or open axis, widened by the
    cutoff and a bound on rounding, however long, short or skewed the box is. Each
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
    largest, n_bricks = as_cutoff(cutoff), as_brick_count(n)
    rest = (vectors, bits, False, "exact", None, None, None, 1, None, "auto")
    try:  # refuses what a search would refuse, at the price of a search with the cutoff 0
        _core.count_pairs(array, 0.0, *rest)
    except ValueError:  # which needs more of a box than a larger cutoff
        _core.count_pairs(array, largest, *rest)
    n_points, ndim = array.shape
    flags = tuple(bool(bits >> k & 1) for k in range(ndim))
    largest_of_all = max(array.max(initial=0.0), -array.min(initial=0.0))
    axes = axes_of(vectors, flags, largest, float(largest_of_all))
    places = axes.places(array)
    every, is_owned = np.arange(n_points), np.zeros(n_points, bool)
    made = []
    for owned, members in _halved(places, axes, every, every, n_bricks):
        is_owned[owned] = True
        made.append(Brick(members, is_owned[members], n_points, largest, (vectors, flags)))
        is_owned[owned] = False
    return Bricks(made, n_points)


def _halved(
    places: FloatArray, axes: Axes, owned: _Numbers, near: _Numbers, n: int
) -> Iterator[tuple[_Numbers, _Numbers]]:
    """Owned points in n parts, cut across their longest side, each with all that it may need."""
    if n == 1:
        yield owned, _near(places, axes, owned, near, range(len(places)))
        return
    first = n // 2
    cut, axis = len(owned) * first // n, 0
    if len(owned) > 1:
        axis = int(np.argmax([np.ptp(line[owned]) for line in places] * axes.widths))
        owned = owned[np.argpartition(places[axis][owned], cut)]  # a sort takes far longer
    for part, n_parts in ((owned[:cut], first), (owned[cut:], n - first)):
        yield from _halved(places, axes, part, _near(places, axes, part, near, [axis]), n_parts)


def _near(
    places: FloatArray, axes: Axes, owned: _Numbers, numbers: _Numbers, along: Iterable[int]
) -> _Numbers:
    """Of these points, those within reach of the range of the owned ones, along some axes."""
    if len(owned) == 0:
        return owned
    for axis in along:
        own, reach = places[axis][owned], axes.reach[axis]
        low, high = float(own.min()) - reach, float(own.max()) + reach
        near = within(places[axis].take(numbers), low, high, axes.repeats[axis])
        numbers = numbers.take(np.flatnonzero(near))  # quicker than numbers[near]
    return numbers
