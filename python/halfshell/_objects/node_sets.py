# SPDX-License-Identifier: BSD-3-Clause
"""Sets of nodes that a `Connectivity` puts together when asked: of two nodes, or of all by id."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell import _core, _show
from halfshell._convert.arrays import as_real_array, in_order
from halfshell._convert.starts import starts_of
from halfshell._objects.node_links import stored
from halfshell._objects.node_rows import NodeRows

if TYPE_CHECKING:
    from halfshell._convert.types import ArrayLike

    Ints = npt.NDArray[np.int32]


class GlobalNeighbors(NamedTuple):
    """Ids of nodes, and of their neighbours row after row."""

    ids: npt.NDArray[np.int64]
    offsets: npt.NDArray[np.int64]
    neighbors: npt.NDArray[np.int64]

    def __repr__(self) -> str:
        return _show.line(self)

    def _repr_html_(self) -> str:
        return _show.html(self)


class NodeSets(NodeRows):
    """What `Connectivity` makes out of its rows."""

    __slots__ = ()

    def union_of(
        self,
        i_list: int | str,
        i_node: int,
        j_list: int | str,
        j_node: int,
    ) -> tuple[Ints, ...]:
        """The neighbours of either of two nodes, in each list.

        Parameters
        ----------
        i_list, i_node, j_list, j_node : int
            Two nodes that have rows; lists also by name.

        Returns
        -------
        tuple of ndarray of int32
            For each list, ascending, or by the Z curve. The two are in it if they are neighbours.

        Raises
        ------
        IndexError, ValueError
            If there is no such node, it has no row, or there is a box that repeats.

        Examples
        --------
        >>> import halfshell as hs
        >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3)])
        >>> c.union_of(0, 0, 0, 1)
        (array([0, 1, 2], dtype=int32),)
        """
        ends = self._two_nodes(i_list, i_node, j_list, j_node)
        nodes = self._links.nodes
        found = []
        for m, rows in enumerate(zip(*(self.neighbors(*end) for end in ends), strict=True)):
            both = np.union1d(*rows)
            found.append(both[np.argsort(nodes.rank(nodes.first[m] + both), kind="stable")])
        return tuple(found)

    def intersection_of(
        self,
        i_list: int | str,
        i_node: int,
        j_list: int | str,
        j_node: int,
        points: Sequence[ArrayLike] | None = None,
    ) -> tuple[Ints, ...]:
        """The common neighbours of any two nodes, and the two, as `intersection` has them.

        Parameters
        ----------
        i_list, i_node, j_list, j_node : int
            Two nodes that have rows; lists also by name.
        points : sequence of array_like of float, each of shape (n, d), optional
            Positions of the nodes of each list. With them only nodes whose foot lies between the
            two count, as in `intersection`.

        Returns
        -------
        tuple of ndarray of int32
            For each list, in the order of rows; the two at the end of theirs.

        Raises
        ------
        IndexError, ValueError
            If there is no such node, it has no row, or there is a box that repeats.

        Examples
        --------
        >>> import halfshell as hs
        >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3)])
        >>> c.intersection_of(0, 0, 0, 2)
        (array([1, 0, 2], dtype=int32),)
        """
        ends = self._two_nodes(i_list, i_node, j_list, j_node)
        coordinates = None if points is None else _as_coordinates(points, self.n_nodes)
        rows = [self.neighbors(*end) for end in ends]
        found = []
        for m, (first, second) in enumerate(zip(*rows, strict=True)):
            common = first[np.isin(first, second, assume_unique=True)]
            if coordinates is not None and len(common):
                p, q = (coordinates[which][node] for which, node in ends)
                common = common[_core.feet_between(coordinates[m][common], p, q)]
            own = [node for which, node in ends if which == m]
            found.append(np.concatenate((common, np.array(own, np.int32))))
        return tuple(found)

    def global_neighbors(self) -> GlobalNeighbors:
        """The ids of all neighbours of each node that is no ghost.

        Returns
        -------
        GlobalNeighbors
            A named tuple (ids, offsets, neighbors): those of node k of ``ids``, int64, are
            ``neighbors[offsets[k]:offsets[k + 1]]``. Nodes are in the order of lists and nodes;
            neighbours as in their rows, list after list.

        Examples
        --------
        >>> import halfshell as hs
        >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0]], [1.0, 1.0], ids=[7, 8])])
        >>> found = c.global_neighbors()
        >>> found.ids.tolist(), found.neighbors.tolist()
        ([7, 8], [8, 7])
        """
        links, nodes = self._links, self._links.nodes
        owners = stored(links)
        starts = self.offsets[:: max(nodes.n_lists, 1)]
        lengths = np.diff(self.offsets)
        lists = np.repeat(np.resize(np.arange(nodes.n_lists), len(lengths)), lengths)
        ids = nodes.global_ids()
        others = ids[nodes.first[lists] + self.indices]
        internal = ~nodes.is_ghost(owners)
        counts = np.diff(starts)
        wanted = np.repeat(internal, counts)
        offsets = starts_of(counts[internal])
        return GlobalNeighbors(ids[owners[internal]], offsets, others[wanted])

    def _two_nodes(self, *four: Any) -> tuple[tuple[int, int], tuple[int, int]]:
        if self._links.shifts is not None:
            raise ValueError(
                "in a periodic box, nodes have no common neighbours without their images: "
                "give these as ghosts"
            )
        first, second = self._list_of(four[0]), self._list_of(four[2])
        return (first, self._node_of(first, four[1])), (second, self._node_of(second, four[3]))


def _as_coordinates(points: Sequence[Any], counts: tuple[int, ...]) -> list[npt.NDArray[Any]]:
    arrays = [in_order(as_real_array(one, "points"), np.float64) for one in points]
    if len(arrays) != len(counts):
        raise ValueError(
            f"points must have an array for each of {len(counts)} lists, got {len(arrays)}"
        )
    dims = {array.shape[1:] for array, n in zip(arrays, counts, strict=True) if n}
    if len(dims) > 1 or any(len(a) != n for a, n in zip(arrays, counts, strict=True)):
        raise ValueError(f"points must have a row for each node of {counts}")
    return arrays
