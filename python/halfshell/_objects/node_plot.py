# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a connectivity: a table of its lists for notebooks, and a drawing of its nodes."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.listed import as_point_numbers
from halfshell._convert.starts import starts_of
from halfshell._extras import needs

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt
    from matplotlib.axes import Axes

    from halfshell._objects.node_links import Links

    #: Positions and supports of a list.
    Seen = tuple[npt.NDArray[Any], npt.NDArray[Any]]

#: Supports and pairs of more than these only blacken the picture.
_MOST_SUPPORTS, _MOST_PAIRS = 2000, 200_000


def html_of(links: Links) -> str:
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


def draw(links: Links, seen: Sequence[Seen], axes: tuple[int, int], ax: Axes | None) -> Axes:
    """Nodes by list, ghosts hollow, their supports, and the pairs."""
    d = next((x.shape[1] for x, _ in seen if len(x)), 2)
    if d > 1:
        numbers = as_point_numbers(axes, "axes", d, "coordinates")
        if len(numbers) != 2:
            raise ValueError(f"axes must be two of the {d} coordinates, got {numbers.tolist()}")
        axes = int(numbers[0]), int(numbers[1])
    try:
        from matplotlib import collections, pyplot
    except ImportError as error:
        raise ImportError(needs("plot", "matplotlib")) from error
    if ax is None:
        ax = pyplot.subplots(layout="constrained")[1]
    nodes, how, pairs = links.nodes, links.how, links.pairs
    places = [
        x[:, list(axes)] if d > 1 else np.column_stack((x[:, :1], np.full(len(x), float(k))))
        for k, (x, _) in enumerate(seen)
    ]  # in one dimension each list has a line of its own
    if 0 < len(pairs) <= _MOST_PAIRS:
        every = np.concatenate(places)
        start, end = (every[nodes.numbers(rank)] for rank in nodes.ranks_of(pairs._all()))
        if how.bits and how.box is not None and d > 1:
            end = end + (pairs.shifts @ how.box)[:, list(axes)]
        lines = np.stack((start, end), axis=1)
        ax.add_collection(collections.LineCollection(list(lines), colors="0.7", linewidths=0.5))
    few = nodes.n <= _MOST_SUPPORTS
    extents = np.broadcast_to(how.extent, len(seen)).tolist()
    for k, (place, (_, supports), extent) in enumerate(zip(places, seen, extents, strict=True)):
        color, internal = f"C{k % 10}", int(nodes.internal[k])
        x, y = place.T
        ax.scatter(x[:internal], y[:internal], s=12, color=color, zorder=3, label=nodes.names[k])
        ax.scatter(
            x[internal:], y[internal:], s=12, edgecolors=color, facecolors="white", zorder=3
        )
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
