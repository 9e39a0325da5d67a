# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a connectivity: a table of its lists for notebooks, and a drawing of its nodes."""

from __future__ import annotations

from html import escape
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.starts import starts_of
from halfshell._extras import needs
from halfshell._objects.node_sets import NodeSets

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt
    from matplotlib.axes import Axes

    from halfshell._objects.node_links import Links
    from halfshell._objects.node_list import NodeList

    #: A list, and which of its nodes are left, by their present numbers; None for all.
    Seen = tuple[NodeList, npt.NDArray[np.int64] | None]

#: Supports and pairs of more than these only blacken the picture.
_MOST_SUPPORTS, _MOST_PAIRS = 2000, 200_000


class NodePictures(NodeSets):
    """How `Connectivity` shows itself."""

    __slots__ = ("_box", "_extent", "_seen")

    _seen: list[Seen]
    _extent: float
    _box: npt.NDArray[Any] | None

    def _repr_html_(self) -> str:
        return html_of(self._links)

    def plot(self, axes: tuple[int, int] = (0, 1), ax: Axes | None = None) -> Axes:
        """Draw the nodes by list, their supports and the pairs; ghosts are hollow.

        Parameters
        ----------
        axes : tuple of int, default (0, 1)
            The two coordinates to draw. In one dimension each list has a line of its own.
        ax : matplotlib.axes.Axes, optional
            Where to draw. Default: axes of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
            What has been drawn on.

        Raises
        ------
        ImportError
            If matplotlib is not installed: ``pip install matplotlib``.
        ValueError
            If there are no such axes.

        Notes
        -----
        Nodes are drawn where the arrays of their lists say: as they were given, if these have not
        been written to since. Supports are shown for up to 2000 nodes, pairs up to 200000.
        """
        d = _dimensions(self._seen)
        if d > 1 and (len(axes) != 2 or not all(0 <= int(axis) < d for axis in axes)):
            raise ValueError(f"axes must be two of the {d} coordinates, got {axes}")
        return draw(self._links, self._seen, self._extent, self._box, axes, ax)


def html_of(links: Links) -> str:
    """What a notebook shows: a row for each list, and what the parts take."""
    nodes = links.nodes
    lengths = np.diff(links.offsets)
    rows = nodes.counts if links.how.ghost_rows else nodes.internal
    ends = starts_of(rows) * nodes.n_lists
    entries = [int(lengths[a:b].sum()) for a, b in pairwise(ends)]
    cells = "".join(
        f"<tr><td>{escape(name)}</td><td>{n}</td><td>{ghosts}</td><td>{mean:.1f}</td></tr>"
        for name, n, ghosts, mean in zip(
            nodes.names, nodes.internal, nodes.ghosts,
            (e / max(int(r), 1) for e, r in zip(entries, rows, strict=True)), strict=True,
        )
    )  # fmt: skip
    built = [name for name in ("overlap", "intersection") if getattr(links, name) is not None]
    more = f", with {' and '.join(built)}" if built else ""
    return (
        f"<p>Connectivity: {len(links.pairs)} pairs{more}</p><table><thead><tr><th>list</th>"
        "<th>nodes</th><th>ghosts</th><th>neighbours of a node</th></tr></thead>"
        f"<tbody>{cells}</tbody></table>"
    )


def draw(
    links: Links, seen: Sequence[Seen], extent: float, box: npt.NDArray[Any] | None,
    axes: tuple[int, int], ax: Axes | None,
) -> Axes:  # fmt: skip
    """Nodes by list, ghosts hollow, their supports, and the pairs."""
    try:
        from matplotlib import collections, pyplot
    except ImportError as error:
        raise ImportError(needs("plot", "matplotlib")) from error
    if ax is None:
        ax = pyplot.subplots(layout="constrained")[1]
    points = [_places(one, left, axes, k) for k, (one, left) in enumerate(seen)]
    lines = _lines(links, seen, points, box, axes)
    ax.add_collection(collections.LineCollection(list(lines), colors="0.7", linewidths=0.5))
    few = sum(len(one) for one in points) <= _MOST_SUPPORTS
    for k, ((one, left), place) in enumerate(zip(seen, points, strict=True)):
        color, internal = f"C{k % 10}", len(place) - int(links.nodes.ghosts[k])
        x, y = place.T
        ax.scatter(x[:internal], y[:internal], s=12, color=color, zorder=3, label=one.name)
        ax.scatter(
            x[internal:], y[internal:], s=12, edgecolors=color, facecolors="white", zorder=3
        )
        if few and len(place):
            ax.add_collection(_ellipses(one, left, place, extent, axes, color, ax))
    ax.set_aspect("equal" if _dimensions(seen) > 1 else "auto")
    ax.autoscale_view()
    if seen:
        ax.legend()
    return ax


def _dimensions(seen: Sequence[Seen]) -> int:
    return next((one.positions.shape[1] for one, _ in seen if not one.is_anywhere), 2)


def _of(values: npt.NDArray[Any], left: npt.NDArray[np.int64] | None) -> npt.NDArray[Any]:
    found: npt.NDArray[Any] = values if left is None else values[left]
    return found


def _places(
    one: NodeList, left: npt.NDArray[np.int64] | None, axes: tuple[int, int], k: int
) -> npt.NDArray[Any]:
    """Where nodes are in the picture: in one dimension each list has a line of its own."""
    x = _of(one.positions, left)
    if x.shape[1] == 1:
        return np.column_stack((x[:, 0], np.full(len(x), float(k))))
    return x[:, list(axes)]


def _lines(
    links: Links, seen: Sequence[Seen], points: Sequence[npt.NDArray[Any]],
    box: npt.NDArray[Any] | None, axes: tuple[int, int],
) -> npt.NDArray[Any]:  # fmt: skip
    pairs, first = links.pairs, links.nodes.first
    if len(pairs) == 0 or len(pairs) > _MOST_PAIRS:
        return np.empty((0, 2, 2))
    every = np.concatenate(points)
    start = every[first[pairs.i_list] + pairs.i_node]
    end = every[first[pairs.j_list] + pairs.j_node]
    if pairs._shifts is not None and box is not None and _dimensions(seen) > 1:
        end = end + (pairs._shifts @ box)[:, list(axes)]
    return np.stack((start, end), axis=1)


def _ellipses(
    one: NodeList, left: npt.NDArray[np.int64] | None, place: npt.NDArray[Any], extent: float,
    axes: tuple[int, int], color: str, ax: Axes,
) -> Any:  # fmt: skip
    """The shadows of supports on the plane of the picture, as widths, heights and angles."""
    from matplotlib import collections

    supports = _of(one.H, left)
    angles = np.zeros(len(place))
    if one.positions.shape[1] == 1:
        h = supports if supports.ndim == 1 else 1.0 / supports[:, 0, 0]
        widths, heights = 2.0 * extent * h, np.full(len(place), 0.2)
    elif supports.ndim == 1:
        widths = heights = 2.0 * extent * supports
    else:
        inverse = np.linalg.inv(supports)
        shadow = (inverse @ inverse.transpose(0, 2, 1))[:, axes][:, :, axes]
        squares, turns = np.linalg.eigh(shadow)
        widths, heights = 2.0 * extent * np.sqrt(squares.T)
        angles = np.degrees(np.arctan2(turns[:, 1, 0], turns[:, 0, 0]))
    return collections.EllipseCollection(
        widths, heights, angles, units="xy", offsets=place, facecolors="none", edgecolors=color,
        linewidths=0.4, alpha=0.5, offset_transform=ax.transData,
    )  # fmt: skip

