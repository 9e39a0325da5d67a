# SPDX-License-Identifier: BSD-3-Clause
"""What pictures of points are made of, in two and three dimensions: lines, dots, edges of a box.

Points of one dimension are drawn on a line, at height 0. Points of more than three are refused.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from halfshell._plot import new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "axes_for", "box_lines", "draw_box", "draw_dots", "draw_lines", "draw_text", "draw_whole_box",
    "finish",
]  # fmt: skip

_Floats = npt.NDArray[np.float64]

#: Lines and dots beyond these only blacken the picture, and take minutes.
MOST_LINES, MOST_DOTS = 200_000, 500_000


def axes_for(ndim: int, ax: Axes | None) -> Axes:
    """Axes to draw points on; ValueError where these have another number of dimensions."""
    if ndim > 3:
        raise ValueError(f"pictures have up to 3 dimensions, and the points {ndim}")
    if ax is None:
        return new_axes(ndim, **({"figsize": (6.0, 6.0)} if ndim > 1 else {}))
    if (ndim == 3) != hasattr(ax, "get_zlim"):
        kind = 'projection="3d"' if ndim == 3 else "two dimensions"
        raise ValueError(f"ax must be axes of {kind} for points in {ndim} dimensions")
    return ax


def _columns(points: npt.NDArray[Any]) -> _Floats:
    """Points as they are drawn, of two or three columns."""
    drawn = np.asarray(points, dtype=np.float64)
    return np.column_stack((drawn, np.zeros(len(drawn)))) if drawn.shape[1] == 1 else drawn


def draw_lines(ax: Axes, starts: Any, ends: Any, **style: Any) -> Any:
    """A line from each start to its end; returns the collection."""
    from matplotlib import collections

    starts, ends = _columns(starts), _columns(ends)
    lines = np.stack((starts, ends), axis=1)
    style = {"linewidths": 1.0, "colors": "0.55", **style}
    if lines.shape[2] == 3:
        from mpl_toolkits.mplot3d.art3d import Line3DCollection

        many: Any = ax.add_collection(Line3DCollection(list(lines), **style))
    else:
        many = ax.add_collection(collections.LineCollection(list(lines), **style))
    if len(lines):
        ax.update_datalim(lines[:, :, :2].reshape(-1, 2))
        if lines.shape[2] == 3:
            auto: Any = ax
            auto.auto_scale_xyz(*lines.reshape(-1, 3).T, had_data=True)
    return many


def draw_dots(ax: Axes, points: Any, **style: Any) -> Any:
    """A dot for each point; returns the collection."""
    return ax.scatter(*_columns(points).T, **{"s": 18.0, "zorder": 3, **style})


def draw_text(ax: Any, place: list[float], text: str, **style: Any) -> Any:
    """Letters that begin at a place."""
    return ax.text(*_columns(np.array([place]))[0].tolist(), text, **style)


def box_lines(vectors: Any) -> tuple[_Floats, _Floats]:
    """Both ends of all edges of a box: from each corner along each vector that is not in it."""
    rows = np.asarray(vectors, dtype=np.float64)
    ndim = len(rows)
    corners = np.array(list(np.ndindex(*(2,) * ndim)))
    edges = [
        (corner @ rows, corner @ rows + rows[axis])
        for corner in corners for axis in np.flatnonzero(corner == 0)
    ]  # fmt: skip
    starts, ends = (np.array(side).reshape(-1, ndim) for side in zip(*edges, strict=True))
    return starts, ends


def draw_box(ax: Axes, vectors: Any, **style: Any) -> Any:
    """The edges of a box with a corner at the origin."""
    return draw_lines(ax, *box_lines(vectors), **{"colors": "tab:blue", **style})


def draw_whole_box(vectors: _Floats, ax: Axes | None, unit: str | None) -> Axes:
    """A box by itself: its edges, and the letters of its vectors at their ends."""
    ndim = len(vectors)
    ax = axes_for(ndim, ax)
    draw_box(ax, vectors)
    for letter, end in zip("abc", vectors.tolist(), strict=False):
        draw_text(ax, end, f" {letter}", color="tab:blue", fontsize=12)
    return finish(ax, ndim, unit)


def finish(ax: Axes, ndim: int, unit: str | None = None) -> Axes:
    """One scale along all axes, and what they are."""
    ax.autoscale_view()
    if ndim > 1:
        low, high = zip(*_limits(ax, ndim), strict=True)
        if all(b > a for a, b in zip(low, high, strict=True)):
            ax.set_aspect("equal", adjustable="box")
    else:
        ax.set_yticks([])
    for name in "xyz"[:ndim]:
        getattr(ax, f"set_{name}label")(name if unit is None else f"{name} / {unit}")
    return ax


def _limits(ax: Any, ndim: int) -> list[tuple[float, float]]:
    return [getattr(ax, f"get_{name}lim")() for name in "xyz"[:ndim]]
