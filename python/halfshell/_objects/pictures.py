# SPDX-License-Identifier: BSD-3-Clause
"""What pictures of points are made of, in two and three dimensions: lines, dots, edges of a box.

Points of one dimension are drawn on a line, at height 0. Points of more than three are refused.
"""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.arrays import as_point_numbers, rows_of, starts_of
from halfshell._convert.foreign import kind_of
from halfshell._errors import needs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    #: Positions and supports of a list.
    Seen = tuple[npt.NDArray[Any], npt.NDArray[Any]]

_Floats = npt.NDArray[np.float64]

#: Lines and dots beyond these only blacken the picture, and take minutes.
MOST_LINES, MOST_DOTS = 200_000, 500_000
MOST_NUMBERS = 40  # more of them cannot be read

RASTER = 400  # places along each axis of a picture at which cells are looked up
MOST_CELLS = 2000  # whose bounds are drawn in three dimensions
COLOURS = 8

#: Supports and pairs of nodes: more of them only blacken the picture.
_MOST_SUPPORTS, _MOST_PAIRS = 2000, 200_000


def axes_of(ax: Axes | None, ndim: int = 2, **size: Any) -> Axes:
    """The axes given, or those of a new figure, in three dimensions for points of three."""
    if ax is not None:
        if not hasattr(ax, "add_collection"):
            raise TypeError(
                f"ax must be axes of Matplotlib, got {kind_of(ax)}; to write a file: "
                "plot().figure.savefig(file)"
            )
        return ax
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError(needs("plot", "matplotlib")) from error
    flat = ndim != 3  # in three dimensions the layout would cut off labels
    how = {} if flat else {"projection": "3d"}
    layout = "constrained" if flat else None
    axes: Axes = pyplot.subplots(layout=layout, subplot_kw=how, **size)[1]
    return axes


def axes_for(ndim: int, ax: Axes | None) -> Axes:
    """Axes to draw points on; ValueError where these have another number of dimensions."""
    if ndim > 3:
        raise ValueError(f"pictures have up to 3 dimensions, and the points {ndim}")
    ax = axes_of(ax, ndim, **({"figsize": (6.0, 6.0)} if ndim > 1 else {}))
    if (ndim == 3) != hasattr(ax, "get_zlim"):
        kind = 'projection="3d"' if ndim == 3 else "two dimensions"
        raise ValueError(f"ax must be axes of {kind} for points in {ndim} dimensions")
    return ax


def _columns(points: npt.NDArray[Any]) -> _Floats:
    drawn = np.asarray(points, dtype=np.float64)
    return np.column_stack((drawn, np.zeros(len(drawn)))) if drawn.shape[1] == 1 else drawn


def draw_lines(ax: Axes, starts: Any, ends: Any, **style: Any) -> Any:
    """A line from each start to its end; returns the collection."""
    from matplotlib import collections

    starts, ends = _columns(starts), _columns(ends)
    lines = np.stack((starts, ends), axis=1)
    style = {"linewidths": 1.0, "colors": "0.55", **style}
    auto: Any = ax
    if lines.shape[2] == 2:
        return auto.add_collection(collections.LineCollection(list(lines), **style))
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    many = auto.add_collection(Line3DCollection(list(lines), **style))
    if len(lines):
        auto.auto_scale_xyz(*lines.reshape(-1, 3).T, had_data=True)
    return many


def draw_dots(ax: Axes, points: Any, **style: Any) -> Any:
    return ax.scatter(*_columns(points).T, **{"s": 18.0, "zorder": 3, **style})


def draw_text(ax: Any, place: list[float], text: str, **style: Any) -> Any:
    return ax.text(*_columns(np.array([place]))[0].tolist(), text, **style)


def draw_neighbors(
    name: str, vectors: _Floats, near: npt.NDArray[Any] | None, kinds: npt.NDArray[Any] | None,
    ax: Axes | None, unit: str | None,
) -> Axes:  # fmt: skip
    """A point at the origin and its neighbours: their numbers, and of all points their types."""
    ndim = vectors.shape[1]
    ax = axes_for(ndim, ax)
    draw_lines(ax, np.zeros_like(vectors), vectors, colors="0.45", linewidths=1.3)
    draw_dots(ax, np.zeros((1, ndim)), s=110.0, color="black", label=name)
    if kinds is None or near is None:
        draw_dots(ax, vectors, s=40.0, color="tab:blue", label=f"{len(vectors)} neighbours")
    else:
        for place, kind in enumerate(np.unique(kinds)):
            some = vectors[kinds[near] == kind]
            if len(some):
                draw_dots(ax, some, s=40.0, color=f"C{place % 10}", label=f"{len(some)} {kind}")
    if near is not None and len(near) <= MOST_NUMBERS:
        for number, vector in zip(near.tolist(), vectors.tolist(), strict=True):
            draw_text(ax, vector, f" {number}", fontsize=8, color="0.35")
    ax.legend(loc="upper left")
    return finish(ax, ndim, unit)


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
        limits = [getattr(ax, f"get_{name}lim")() for name in "xyz"[:ndim]]
        low, high = zip(*limits, strict=True)
        if all(b > a for a, b in zip(low, high, strict=True)):
            ax.set_aspect("equal", adjustable="box")
    else:
        ax.set_yticks([])
    for name in "xyz"[:ndim]:
        getattr(ax, f"set_{name}label")(name if unit is None else f"{name} / {unit}")
    return ax


# ---- cells ----------------------------------------------------------------------------------

def draw_cells(cells: Any, ax: Axes | None, unit: str | None) -> Axes:
    """Points in the colour of their cell; in up to two dimensions the cells, in three bounds."""
    points, vectors, bits = cells.points._scene
    ndim = points.shape[1]
    if len(points) > MOST_DOTS:
        raise ValueError(f"at most {MOST_DOTS} points can be drawn, got {len(points)}")
    ax = axes_for(ndim, ax)
    x = np.asarray(points, np.float64)
    if vectors is not None and len(x):  # where their cells are
        x = _core.box_wrap(x, vectors, bits)[0]
    colours = _colours(rows_of(cells.cell_start), cells)
    if ndim < 3:
        _raster(ax, cells, x, vectors, bits)
    elif len(x):
        starts = cells.cell_start[:-1][np.diff(cells.cell_start) > 0][:MOST_CELLS]
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
    found: npt.NDArray[Any] = (places @ np.array([1, 3, 5])[: places.shape[1]]) % COLOURS
    return found


def _raster(ax: Any, cells: Any, x: _Floats, vectors: _Floats | None, bits: int) -> None:
    """Cells as areas of pale colours, as `cell_of` finds them, round all that is drawn."""
    every = x if len(x) else np.zeros((1, x.shape[1]))
    if vectors is not None and bits:
        every = np.concatenate((x, *box_lines(vectors)))
    low, high = every.min(axis=0), every.max(axis=0)
    room = np.where(high > low, 0.03 * (high - low), 0.5)
    low, high = low - room, high + room
    sides = [a + (b - a) * (np.arange(RASTER) + 0.5) / RASTER for a, b in zip(low, high)]
    flat = len(sides) == 1
    grid = np.meshgrid(*sides) if not flat else [sides[0][None]]
    ids = cells.cell_of(np.stack([one.ravel() for one in grid], axis=1))
    colours = np.ma.masked_where(ids < 0, _colours(np.maximum(ids, 0), cells))
    area = (low[0], high[0], -1.0, 1.0) if flat else (low[0], high[0], low[1], high[1])
    ax.imshow(
        colours.reshape(grid[0].shape), extent=area, origin="lower", cmap="tab10", vmin=0, vmax=9,
        alpha=0.22, interpolation="nearest", aspect="auto", zorder=0,
    )  # fmt: skip


# ---- nodes ----------------------------------------------------------------------------------

def html_of(links: Any) -> str:
    """What a notebook shows: a row for each list, and what the parts take."""
    nodes = links.nodes
    rows = links.how.with_rows(nodes)
    entries = np.diff(links.rows.offsets[starts_of(rows) * nodes.n_lists])
    means = entries / np.maximum(rows, 1)
    cells = "".join(
        f"<tr><td>{escape(name)}</td><td>{n}</td><td>{ghosts}</td><td>{mean:.1f}</td></tr>"
        for name, n, ghosts, mean in zip(
            nodes.names, nodes.internal, nodes.ghosts, means, strict=True
        )
    )
    built = [name for name in ("overlap", "intersection") if getattr(links, name) is not None]
    more = f", with {' and '.join(built)}" if built else ""
    return (
        f"<p>Connectivity: {len(links.pairs)} pairs{more}</p><table><thead><tr><th>list</th>"
        "<th>nodes</th><th>ghosts</th><th>neighbours of a node</th></tr></thead>"
        f"<tbody>{cells}</tbody></table>"
    )


def draw_nodes(links: Any, seen: Sequence[Seen], axes: tuple[int, int], ax: Axes | None) -> Axes:
    """Nodes by list, ghosts hollow, their supports, and the pairs."""
    d = next((x.shape[1] for x, _ in seen if len(x)), 2)
    if d > 1:
        numbers = as_point_numbers(axes, "axes", d, "coordinates")
        if len(numbers) != 2:
            raise ValueError(f"axes must be two of the {d} coordinates, got {numbers.tolist()}")
        axes = int(numbers[0]), int(numbers[1])
    ax = axes_of(ax)
    from matplotlib import collections

    nodes, how, pairs = links.nodes, links.how, links.pairs
    places = [
        x[:, list(axes)] if d > 1 else np.column_stack((x[:, :1], np.full(len(x), float(k))))
        for k, (x, _) in enumerate(seen)
    ]  # in one dimension each list has a line of its own
    if 0 < len(pairs) <= _MOST_PAIRS:
        every = np.concatenate(places)
        start, end = (every[nodes.numbers(rank)] for rank in nodes.ranks_of(pairs._made))
        if how.bits and how.box is not None and d > 1:
            end = end + (pairs.shifts @ how.box)[:, list(axes)]
        draw_lines(ax, start, end, colors="0.7", linewidths=0.5)
    few = nodes.n <= _MOST_SUPPORTS
    extents = np.broadcast_to(how.extent, len(seen)).tolist()
    for k, (place, (_, supports), extent) in enumerate(zip(places, seen, extents, strict=True)):
        color, internal = f"C{k % 10}", int(nodes.internal[k])
        draw_dots(ax, place[:internal], s=12, color=color, label=nodes.names[k])
        draw_dots(ax, place[internal:], s=12, edgecolors=color, facecolors="white")
        if few and len(place):
            ax.add_collection(collections.EllipseCollection(
                *_shadows(supports, extent, axes, d), units="xy", offsets=place, facecolors="none",
                edgecolors=color, linewidths=0.4, alpha=0.5, offset_transform=ax.transData,
            ))  # fmt: skip
    ax.set_aspect("equal" if d > 1 else "auto")
    ax.autoscale_view()
    if seen:
        ax.legend()
    return ax


def _shadows(supports: Any, extent: float, axes: tuple[int, int], d: int) -> tuple[Any, Any, Any]:
    """Those of supports on the plane of the picture, as widths, heights and angles."""
    angles = np.zeros(len(supports))
    if d == 1:
        h = supports if supports.ndim == 1 else 1.0 / supports[:, 0, 0]
        return 2.0 * extent * h, np.full(len(h), 0.2), angles
    if supports.ndim == 1:
        return 2.0 * extent * supports, 2.0 * extent * supports, angles
    inverse = np.linalg.inv(supports)
    shadow = (inverse @ inverse.transpose(0, 2, 1))[:, axes][:, :, axes]
    squares, turns = np.linalg.eigh(shadow)
    angles = np.degrees(np.arctan2(turns[:, 1, 0], turns[:, 0, 0]))
    widths, heights = 2.0 * extent * np.sqrt(squares.T)
    return widths, heights, angles
