# SPDX-License-Identifier: BSD-3-Clause
"""`Graph`: a neighbour table as graph networks take it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell import _show

__all__ = ["Graph", "check_complete", "turned"]


class Graph(NamedTuple):
    """A graph, as `NeighborTable.graph` returns it.

    Attributes
    ----------
    edge_index : ndarray of the type of `indices`, shape (2, m)
        Row 0 is the source of each edge, the neighbour j; row 1 is the target, the point i in whose
        row it is.
    shifts : ndarray of int32, shape (m, d)
        Box vectors to add, with ``vectors = points[edge_index[1]] - points[edge_index[0]] +
        shifts @ box``. They are -S of the table.
    vectors : ndarray of float64, shape (m, d)
        The vector from source to target, which is -D of the table.
    distances : ndarray of float64, shape (m,), or None
        Its length, if the table has distances.

    Examples
    --------
    >>> import halfshell as hs
    >>> hs.neighbors([[0.5], [3.5]], 1.0, box=[4.0], quantities="jDS").graph()._fields
    ('edge_index', 'shifts', 'vectors', 'distances')
    """

    edge_index: npt.NDArray[Any]
    shifts: npt.NDArray[np.int32]
    vectors: npt.NDArray[np.float64]
    distances: npt.NDArray[np.float64] | None

    def __repr__(self) -> str:
        return _show.line(self)

    def _repr_html_(self) -> str:
        return _show.html(self)


def check_complete(quantities: str) -> None:
    """Raise unless a table of these has what a graph needs."""
    if lacking := "".join(letter for letter in "jDS" if letter not in quantities):
        raise AttributeError(
            "a graph needs indices, vectors and shifts: request them with quantities='jDS', got "
            f"{quantities!r} without {lacking!r}"
        )


def turned(
    edge_index: npt.NDArray[Any],
    shifts: npt.NDArray[np.int32],
    vectors: npt.NDArray[np.float64],
    distances: npt.NDArray[np.float64] | None,
) -> Graph:
    """The graph of edges with their S and D, which point from target to source."""
    if shifts.min(initial=0) == np.iinfo(shifts.dtype).min:
        raise OverflowError("a shift of -2**31 has no opposite in int32")
    return Graph(edge_index, -shifts, 0.0 - vectors, distances)
