# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a `Connectivity`, as users see them: of one node, or all of them as flat arrays."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.options import as_whole
from halfshell._objects.node_links import row_starts

if TYPE_CHECKING:
    from halfshell._objects.node_links import Links
    from halfshell._objects.pair_table import PairTable

    Ints = npt.NDArray[np.int32]
    Offsets = npt.NDArray[np.int64]


class NodeRows:
    """What `Connectivity` reads out of its links."""

    __slots__ = ("_links",)

    _links: Links

    # ---- all of it ---------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        return self._links.nodes.names

    @property
    def n_nodes(self) -> tuple[int, ...]:
        return tuple(self._links.nodes.counts.tolist())

    @property
    def n_ghosts(self) -> tuple[int, ...]:
        return tuple(self._links.nodes.ghosts.tolist())

    @property
    def pairs(self) -> PairTable:
        return self._links.pairs

    @property
    def offsets(self) -> Offsets:
        return self._links.offsets

    @property
    def indices(self) -> Ints:
        return self._links.indices

    @property
    def shifts(self) -> Ints:
        if self._links.shifts is None:
            raise AttributeError("these rows have no shifts: there is no periodic box")
        return self._links.shifts

    @property
    def row_start(self) -> Offsets:
        return row_starts(self._links)

    @property
    def overlap_offsets(self) -> Offsets:
        return self._built_part("overlap")[0]

    @property
    def overlap_indices(self) -> Ints:
        return self._built_part("overlap")[1]

    @property
    def intersection_offsets(self) -> Offsets:
        return self._built_part("intersection")[0]

    @property
    def intersection_indices(self) -> Ints:
        return self._built_part("intersection")[1]

    @property
    def nbytes(self) -> dict[str, int]:
        links, pairs = self._links, self._links.pairs
        columns = pairs._columns or (None,) * 5  # not yet looked at
        nodes = links.nodes
        parts: dict[str, tuple[Any, ...]] = {
            "rows": (links.offsets, links.indices),
            "pairs": columns[:4],
            "shifts": (links.shifts, columns[4]),
            "coupling": (pairs._coupling,),
            "lookup": (pairs._keys,),
            "overlap": links.overlap or (),
            "gather": () if links.gathered is None else (
                links.gathered.offsets, links.gathered.indices
            ),
            "intersection": links.intersection or (),
            "order": (nodes.number, nodes._rank),
            "points": (links.points,),
        }  # fmt: skip
        return {
            name: sum(one.nbytes for one in arrays if one is not None)
            for name, arrays in parts.items()
        }

    # ---- of one node -------------------------------------------------------------------------

    def neighbors(self, list: int | str, node: int) -> tuple[Ints, ...]:
        """The neighbours of a node in each list.

        Parameters
        ----------
        list : int or str
            Number or name of its list.
        node : int
            Its number there.

        Returns
        -------
        tuple of ndarray of int32
            For each list, ascending, or by the Z curve; read-only, without a copy.

        Raises
        ------
        IndexError, ValueError
            If there is no such list or node; if it is a ghost, and these have no rows.

        Examples
        --------
        >>> import halfshell as hs
        >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0]], [1.0, 1.0])])
        >>> c.neighbors(0, 1)
        (array([0], dtype=int32),)
        """
        return self._row(self.offsets, self.indices, self._row_of(list, node))

    def overlap(self, list: int | str, node: int) -> tuple[Ints, ...]:
        """The nodes in each list that are neighbours of a node or have one in common with it.

        Parameters
        ----------
        list : int or str
            Number or name of its list.
        node : int
            Its number there.

        Returns
        -------
        tuple of ndarray of int32
            As of `neighbors`.

        Raises
        ------
        IndexError, ValueError
            If there is no such list or node; if `overlap` was not built.

        Examples
        --------
        >>> import halfshell as hs
        >>> a = hs.NodeList("a", [[0.0], [1.0], [2.0], [3.0]], [0.5] * 4)
        >>> hs.Connectivity([a], overlap=True).overlap(0, 0)
        (array([1, 2], dtype=int32),)
        """
        return self._row(*self._built_part("overlap"), self._row_of(list, node))

    def intersection(self, pair: int | npt.ArrayLike) -> tuple[Ints, ...]:
        """The nodes in each list between the two of a pair, and these.

        Parameters
        ----------
        pair : int or array_like of int, shape (4,)
            Number of the pair, or (i_node, i_list, j_node, j_list) in whatever order.

        Returns
        -------
        tuple of ndarray of int32
            For each list the common neighbours whose foot lies between the two, in the order of
            rows; then those of the two that are of this list, the first one first.

        Raises
        ------
        KeyError, IndexError, ValueError
            If there is no such pair; if `intersection` was not built.

        Examples
        --------
        >>> import halfshell as hs
        >>> a = hs.NodeList("a", [[0.0], [1.0], [2.0]], [1.0] * 3)
        >>> hs.Connectivity([a], intersection=True).intersection((0, 0, 2, 0))
        (array([1, 0, 2], dtype=int32),)
        """
        part = self._built_part("intersection")
        k = self.pairs._number(pair) if np.ndim(pair) == 0 else self.pairs.index(pair)
        return self._row(*part, k)

    def n_neighbors(self, list: int | str, node: int | None = None) -> Any:
        """How many neighbours a node has in all lists, or each node of a list.

        Parameters
        ----------
        list : int or str
            Number or name of the list.
        node : int, optional
            Number of the node. Default: all that have rows.

        Returns
        -------
        int, or ndarray of int64

        Raises
        ------
        IndexError, ValueError
            If there is no such list or node, or it has no row.

        Examples
        --------
        >>> import halfshell as hs
        >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3)])
        >>> c.n_neighbors(0, 1), c.n_neighbors("a").tolist()
        (2, [1, 2, 1])
        """
        n_lists = self._links.nodes.n_lists
        if node is not None:
            row = self._row_of(list, node) * n_lists
            return int(self.offsets[row + n_lists] - self.offsets[row])
        which = self._list_of(list)
        first, end = self.row_start[which : which + 2] * n_lists
        return np.diff(self.offsets[first : end + 1 : n_lists])

    def traversal(self, list: int | str) -> npt.NDArray[np.int64]:
        """The nodes of a list in the order in which to go through them.

        Parameters
        ----------
        list : int or str
            Number or name of the list.

        Returns
        -------
        ndarray of int64
            Those that are no ghosts, ascending; with "morton" all, by the Z curve.

        Raises
        ------
        IndexError
            If there is no such list.

        Examples
        --------
        >>> import halfshell as hs
        >>> a = hs.NodeList("a", [[3.0], [1.0], [2.0]], [0.5] * 3)
        >>> hs.Connectivity([a], order="morton").traversal(0).tolist()
        [1, 2, 0]
        """
        nodes, which = self._links.nodes, self._list_of(list)
        if nodes.number is None:
            return np.arange(nodes.internal[which])
        first, end = nodes.first[which : which + 2]
        own = (nodes.number >= first) & (nodes.number < end)
        found: npt.NDArray[np.int64] = (nodes.number[own] - first).astype(np.int64)
        return found

    # ---- how rows are found ------------------------------------------------------------------

    def _row(self, offsets: Offsets, indices: Ints, row: int) -> tuple[Ints, ...]:
        n_lists = self._links.nodes.n_lists
        ends = offsets[row * n_lists : (row + 1) * n_lists + 1].tolist()
        return tuple(indices[a:b] for a, b in pairwise(ends))

    def _list_of(self, value: Any) -> int:
        names = self.names
        if isinstance(value, str):
            if value not in names:
                raise IndexError(f"there is no list {value!r}, but {names}")
            return names.index(value)
        number = as_whole(value, "the number of a list")
        if not 0 <= number < len(names):
            raise IndexError(f"there are {len(names)} lists, got {number}")
        return number

    def _node_of(self, which: int, value: Any) -> int:
        number = as_whole(value, "node")
        count = self.n_nodes[which]
        if not 0 <= number < count:
            raise IndexError(f"list {self.names[which]!r} has {count} nodes, got {number}")
        return number

    def _row_of(self, value: Any, node: Any) -> int:
        which = self._list_of(value)
        number = self._node_of(which, node)
        links = self._links
        if not links.how.ghost_rows and number >= links.nodes.internal[which]:
            raise ValueError(
                f"node {number} of {self.names[which]!r} is a ghost, and these have no rows: "
                "build with ghosts=True"
            )
        return int(self.row_start[which]) + number

    def _built_part(self, name: str) -> tuple[Offsets, Ints]:
        part: tuple[Offsets, Ints] | None = getattr(self._links, name)
        if part is None:
            raise ValueError(f"{name} was not built: build with {name}=True")
        return part
