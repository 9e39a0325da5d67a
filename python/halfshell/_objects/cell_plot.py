# SPDX-License-Identifier: BSD-3-Clause
"""A picture of a cell list: which cell each place and each point is in."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._objects.pictures import (
    MOST_DOTS,
    axes_for,
    box_lines,
    draw_box,
    draw_dots,
    draw_lines,
    finish,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_cells"]

_RASTER = 400  # places along each axis of a picture at which cells are looked up
_MOST_CELLS = 2000  # whose bounds are drawn in three dimensions
_COLOURS = 8

_Floats = npt.NDArray[np.float64]


def draw_cells(cells: Any, ax: Axes | None, unit: str | None) -> Axes:
    """Points in the colour of their cell; in up to two dimensions the cells, in three bounds."""
    points, vectors, bits = cells._origin.scene()
    ndim = points.shape[1]
    if len(points) > MOST_DOTS:
        raise ValueError(f"at most {MOST_DOTS} points can be drawn, got {len(points)}")
    ax = axes_for(ndim, ax)
    x = _wrapped(np.asarray(points, np.float64), vectors, bits)
    numbers = np.repeat(np.arange(len(cells.cell_start) - 1), np.diff(cells.cell_start))
    colours = _colours(numbers, cells)
    if ndim < 3:
        _raster(ax, cells, *_extent(x, vectors, bits))
    elif len(x):
        starts = cells.cell_start[:-1][np.diff(cells.cell_start) > 0][:_MOST_CELLS]
        sorted_points = x[cells.order]
        low = np.minimum.reduceat(sorted_points, starts)
        high = np.maximum.reduceat(sorted_points, starts)
        ends = np.array(box_lines(np.eye(3)))  # of the unit cube
        lines = low[:, None, None] + ends[None] * (high - low)[:, None, None]
        draw_lines(
            ax, *(lines[:, side].reshape(-1, 3) for side in (0, 1)), colors="0.8", linewidths=0.6
        )
    if vectors is not None:
        draw_box(ax, vectors)
    draw_dots(ax, x[cells.order], c=colours, cmap="tab10", vmin=0, vmax=9, s=14.0)
    return finish(ax, ndim, unit)


def _colours(numbers: npt.NDArray[Any], cells: Any) -> npt.NDArray[Any]:
    """One of some colours for each cell; neighbours along an axis have others."""
    if cells.cell_ids is not None:
        places = cells.cell_ids[numbers]
    else:
        places = np.stack(np.unravel_index(numbers, cells.shape, order="F"), axis=1)
    found: npt.NDArray[Any] = (places @ np.array([1, 3, 5])[: places.shape[1]]) % _COLOURS
    return found


def _wrapped(x: _Floats, vectors: _Floats | None, bits: int) -> _Floats:
    """Points where their cells are: in the box along the axes that repeat."""
    if vectors is None or not len(x):
        return x
    wrapped: _Floats = _core.box_wrap(x, vectors, bits)[0]
    return wrapped


def _extent(x: _Floats, vectors: _Floats | None, bits: int) -> tuple[_Floats, _Floats]:
    """Lowest and highest coordinates of what is drawn."""
    parts = [x] if len(x) else []
    if vectors is not None and bits:
        starts, ends = box_lines(vectors)
        parts += [starts, ends]
    every = np.concatenate(parts) if parts else np.zeros((1, x.shape[1]))
    low, high = every.min(axis=0), every.max(axis=0)
    room = np.where(high > low, 0.03 * (high - low), 0.5)
    return low - room, high + room


def _raster(ax: Any, cells: Any, low: _Floats, high: _Floats) -> None:
    """Cells as areas of pale colours, as `cell_of` finds them."""
    sides = [a + (b - a) * (np.arange(_RASTER) + 0.5) / _RASTER for a, b in zip(low, high)]
    flat = len(sides) == 1
    grid = np.meshgrid(*sides) if not flat else [sides[0][None]]
    ids = cells.cell_of(np.stack([one.ravel() for one in grid], axis=1))
    colours = np.ma.masked_where(ids < 0, _colours(np.maximum(ids, 0), cells))
    area = (low[0], high[0], -1.0, 1.0) if flat else (low[0], high[0], low[1], high[1])
    ax.imshow(
        colours.reshape(grid[0].shape), extent=area, origin="lower", cmap="tab10", vmin=0, vmax=9,
        alpha=0.22, interpolation="nearest", aspect="auto", zorder=0,
    )  # fmt: skip
