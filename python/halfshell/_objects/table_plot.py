# SPDX-License-Identifier: BSD-3-Clause
"""A picture of one row of a table: a point, or a query, and its neighbours around it."""

from __future__ import annotations

from typing import TYPE_CHECKING, SupportsIndex

import numpy as np
import numpy.typing as npt

from halfshell._convert.labels import as_kinds
from halfshell._objects.pictures import axes_for, draw_dots, draw_lines, draw_text, finish
from halfshell._objects.table_rows import TableRows

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["TablePictures"]

_MOST_NUMBERS = 40  # more of them cannot be read


class TablePictures(TableRows):
    """How a `NeighborTable` is drawn."""

    __slots__ = ()

    def plot(
        self,
        row: SupportsIndex = 0,
        *,
        types: npt.ArrayLike | None = None,
        ax: Axes | None = None,
        unit: str | None = None,
    ) -> Axes:
        """Draw the neighbours of one point, or of one query, which is put at the origin.

        Parameters
        ----------
        row : int, default 0
            Whose neighbours.
        types : array_like of int or str, shape (n_points,), optional
            A colour for each type of a neighbour, and an entry of the legend. The table must have
            'j' for it.
        ax : matplotlib.axes.Axes, optional
            Where to draw; for points in three dimensions with ``projection="3d"``. Default: axes
            of a new figure.
        unit : str, optional
            The unit of the points, for the labels of the axes: "Å".

        Returns
        -------
        matplotlib.axes.Axes
            What has been drawn on.

        Raises
        ------
        ImportError
            If matplotlib is not installed: ``pip install matplotlib``.
        AttributeError
            If the table has no vectors: ask for 'D' in `quantities`.
        IndexError
            If there is no such row.
        TypeError, ValueError
            If points have more than three dimensions, axes do not fit, or `types` are not one for
            each point.

        Notes
        -----
        Neighbours are drawn in the images in which they are near. With 'j' in the table up to 40
        of them have their numbers beside them.
        """
        vectors = self.vectors
        k = range(self.n_rows)[row]
        first, end = self.offsets[k : k + 2]
        vectors = vectors[first:end]
        ndim = vectors.shape[1]
        near = self.indices[first:end] if "j" in self.quantities or types is not None else None
        kinds = None if types is None else as_kinds(types, self.n_points)
        ax = axes_for(ndim, ax)
        draw_lines(ax, np.zeros_like(vectors), vectors, colors="0.45", linewidths=1.3)
        draw_dots(ax, np.zeros((1, ndim)), s=110.0, color="black", label=f"row {k}")
        if kinds is None or near is None:
            draw_dots(ax, vectors, s=40.0, color="tab:blue", label=f"{len(vectors)} neighbours")
        else:
            for place, kind in enumerate(np.unique(kinds)):
                some = vectors[kinds[near] == kind]
                if len(some):
                    draw_dots(
                        ax, some, s=40.0, color=f"C{place % 10}", label=f"{len(some)} {kind}"
                    )
        if near is not None and len(near) <= _MOST_NUMBERS:
            for number, vector in zip(near.tolist(), vectors.tolist(), strict=True):
                draw_text(ax, vector, f" {number}", fontsize=8, color="0.35")
        ax.legend(loc="upper left")
        return finish(ax, ndim, unit)
