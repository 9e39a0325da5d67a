# SPDX-License-Identifier: BSD-3-Clause
"""`plot_pairs`: points and the lines of their pairs, drawn with matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from halfshell._convert.points import Points
from halfshell._functions.measure import measure
from halfshell._objects.pictures import (
    MOST_LINES,
    axes_for,
    draw_box,
    draw_dots,
    draw_lines,
    finish,
)
from halfshell._search import search

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from halfshell._convert.types import BoxLike, PeriodicLike, PointsLike


@search()
def plot_pairs(
    points: PointsLike,
    i: npt.ArrayLike,
    j: npt.ArrayLike,
    S: npt.ArrayLike | None = None,
    *,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    ax: Axes | None = None,
    unit: str | None = None,
) -> Axes:
    """Draw points and a line for each pair, in up to three dimensions; images are always exact.

    Parameters
    ----------
    {points}
        Each of their types has a colour and an entry in the legend.
    i, j : array_like of int, shape (m,)
        The points of each pair.
    S : array_like of int, shape (m, d), optional
        The shift of each pair. Default: that of the nearest image, as `measure` finds it.
    {box, periodic}
    {ax, unit}

    {drawn}
    TypeError, ValueError, OverflowError
        As `measure`; ValueError also for points of more than three dimensions, axes that do not
        fit, or more than 200 000 pairs.

    Notes
    -----
    Points are drawn where they are. A line goes from point i to the image of j that belongs to the
    pair. Lines to an image with S other than 0 are dotted, and end where no point is drawn.

    Examples
    --------
    >>> import halfshell as hs
    >>> points, box = [[0.5, 0.5], [1.5, 0.5], [3.5, 0.5]], [4.0, 4.0]
    >>> i, j, S = hs.pairs(points, 1.0, box=box, quantities="ijS")
    >>> ax = hs.plot_pairs(points, i, j, S, box=box)  # doctest: +SKIP
    """
    known = Points._of(points, "points", box, periodic)
    array, vectors, kinds = known.positions, known.box, known.types
    ndim = array.shape[1]
    D, shifts = measure(known, i, j, S, quantities="DS")
    if len(D) > MOST_LINES:
        raise ValueError(f"at most {MOST_LINES} pairs can be drawn, got {len(D)}")
    ax = axes_for(ndim, ax)
    start = array[np.asarray(i, dtype=np.int64).reshape(-1)].astype(np.float64)
    inside = ~shifts.any(axis=1)
    draw_lines(ax, start[inside], (start + D)[inside], colors="0.45")
    draw_lines(ax, start[~inside], (start + D)[~inside], colors="0.5", linestyles="dotted")
    if vectors is not None:
        draw_box(ax, vectors)
    if kinds is None:
        draw_dots(ax, array)
    else:
        for kind in np.unique(kinds):
            draw_dots(ax, array[kinds == kind], label=str(kind))
        if len(kinds):
            ax.legend()
    return finish(ax, ndim, unit)
