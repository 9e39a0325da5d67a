# SPDX-License-Identifier: BSD-3-Clause
"""`Connectivity`: which nodes of several lists are neighbours, and what follows from that."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from halfshell._convert.foreign import kind_of
from halfshell._convert.options import as_choice, as_flag, as_list
from halfshell._convert.scene import as_box_alone, as_own_box
from halfshell._objects import node_check, node_cuts, node_patch
from halfshell._objects.node_links import How, Links, search
from halfshell._objects.node_list import NodeList
from halfshell._objects.node_plot import NodePictures
from halfshell._objects.node_removal import removed
from halfshell._objects.node_supports import as_extent
from halfshell._objects.nodes import as_morton_box, morton_number, nodes_of

if TYPE_CHECKING:
    from halfshell._convert.types import ArrayLike, BoxLike, PeriodicLike
    from halfshell._objects.node_plot import Seen

    Ints = npt.NDArray[np.int32]
    #: i_node, i_list, j_node, j_list -> which of these pairs.
    Predicate = Callable[[Ints, Ints, Ints, Ints], npt.ArrayLike]


class Connectivity(NodePictures):
    """All neighbours of each node in each list, and each pair of neighbours once.

    Nodes i and j are neighbours if ``|x_i - x_j| <= extent * h_i`` or ``<= extent * h_j`` or,
    if supports are matrices, ``|H_i @ (x_i - x_j)| <= extent`` or ``|H_j @ (x_i - x_j)| <=
    extent``, decided exactly, without rounding. Coincident nodes are neighbours; no node is its
    own neighbour.

    Parameters
    ----------
    lists : sequence of NodeList
        Lists are numbered in this order. Names must differ.
    extent : float, default 2.0
        How many smoothing lengths supports reach, in all lists; from 2**-64 to 2**64.
    box : float, array_like of float, shape (d,) or (d, d), or Box, optional
        As in `pairs`. In a periodic box, rows and pairs have shifts.
    periodic : bool or sequence of bool, shape (d,), optional
        Which box vectors are periodic. Default: all with a box, none without.
    ghosts : bool, default False
        Whether ghosts have rows, and pairs with each other.
    overlap : bool, default False
        Whether to find nodes whose supports have a node in common; ghosts then have rows, too.
        Not in a periodic box.
    intersection : bool, default False
        Whether to find the nodes between the two nodes of each pair. As for `overlap`, ghosts then
        have rows, and the box must not be periodic.
    order : {"index", "morton"}, default "index"
        Order of rows and pairs: by list and node, or by the place on the Z curve, which does not
        depend on how nodes are stored, nor on which are ghosts. With "morton" ghosts have rows.
    morton_box : array_like of float, shape (2, d), optional
        The lowest and the highest corner of the box of that curve, which holds all nodes. Default:
        the bounding box. The parts of a divided scene need the same.
    exclude : array_like of int, shape (k, 4), or callable, optional
        Pairs that do not count: rows (i_node, i_list, j_node, j_list), in any order, or a
        function of four such arrays that returns bools. Kept for `rebuild`.
    threads : int, optional
        As of `pairs`.
    memory_limit : float, optional
        As of `pairs`.

    Attributes
    ----------
    names : tuple of str
        Of the lists.
    pairs : PairTable
        Each pair once, if one of its nodes is not a ghost, or `ghosts` is set.
    offsets : ndarray of int64, shape (n_rows * n_lists + 1,)
        Where rows begin: ``indices[offsets[r]:offsets[r + 1]]`` are the neighbours in list m of
        node i of list l for ``r = (row_start[l] + i) * n_lists + m``.
    indices : ndarray of int32, shape (entries,)
        Their numbers in their lists, ascending; with "morton" by the Z curve. Read-only, as are
        all of these.
    shifts : ndarray of int32, shape (entries, d)
        S of each entry, in a periodic box; entries of one neighbour ascend by S.
    row_start : ndarray of int64, shape (n_lists + 1,)
        Nodes with rows before each list.
    overlap_offsets, overlap_indices : ndarray
        Rows of `overlap`, laid out as those of neighbours.
    intersection_offsets, intersection_indices : ndarray
        Entries of `intersection`: row ``k * n_lists + m`` is of pair k and list m.
    n_nodes, n_ghosts : tuple of int
        Of each list.
    nbytes : dict of str to int
        Bytes that each part takes now.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pairs`; ValueError also if names repeat, lists differ in their dimensions, `exclude`
        names a node that does not exist, a node lies outside `morton_box`, or `overlap` or
        `intersection` is set in a periodic box.

    See Also
    --------
    NodeList : nodes and their supports.
    PairField : numbers for each pair.

    Notes
    -----
    Lists are searched together, small supports apart from large ones. Only what you request is
    computed or kept. A change that fails changes nothing.

    ``overlap`` holds all neighbours, and all nodes j such that the supports of i and j contain a
    common node of any list; touching supports are not enough. ``intersection`` of a pair holds
    the neighbours of both nodes whose foot on the line through these lies on the closed segment
    between them, decided exactly, and then the two nodes themselves; if the two coincide, all
    common neighbours.

    Removed and excluded pairs count nowhere: not in rows, pairs and overlap, nor as a link from
    one node to another in overlap and intersection. So `remove` has the same effect as `exclude`.

    The design follows Spheral's ``ConnectivityMap``; ``docs/systems/spheral.md`` compares them.

    Examples
    --------
    >>> import halfshell as hs
    >>> fluid = hs.NodeList("fluid", [[0.0], [1.0], [2.0]], [0.5, 0.5, 0.5])
    >>> wall = hs.NodeList("wall", [[3.0], [9.0]], [0.5, 0.5])
    >>> c = hs.Connectivity([fluid, wall])
    >>> [one.tolist() for one in c.neighbors("fluid", 2)]
    [[1], [0]]
    >>> [tuple(pair) for pair in c.pairs]
    [(0, 0, 1, 0), (1, 0, 2, 0), (2, 0, 0, 1)]
    """

    __slots__ = ("_bits", "_exclude", "_how", "_morton_box")

    def __init__(
        self,
        lists: Sequence[NodeList],
        extent: float = 2.0,
        *,
        box: BoxLike | None = None,
        periodic: PeriodicLike | None = None,
        ghosts: bool = False,
        overlap: bool = False,
        intersection: bool = False,
        order: Literal["index", "morton"] = "index",
        morton_box: ArrayLike | None = None,
        exclude: npt.ArrayLike | Predicate | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
    ) -> None:
        given = _as_lists(lists)
        self._extent = as_extent(extent)
        self._how = How(
            as_flag(ghosts, "ghosts"), as_flag(overlap, "overlap"),
            as_flag(intersection, "intersection"),
            as_choice(order, "order", ("index", "morton")) == "morton", threads, memory_limit,
        )  # fmt: skip
        self._morton_box = as_morton_box(morton_box)
        if self._morton_box is not None and not self._how.morton:
            raise ValueError("morton_box needs order='morton'")
        self._exclude = exclude
        d = next((one.positions.shape[1] for one in given if not one.is_anywhere), None)
        if d is None:
            d, *_ = as_box_alone(box, periodic)
        self._box, self._bits = as_own_box(box, periodic, d)
        if self._bits and (self._how.overlap or self._how.intersection):
            raise ValueError(
                "overlap and intersection need open space: give nodes beyond the box as ghosts, "
                "NodeList(..., n_ghost=...), and no box that repeats"
            )
        self._links = self._built(given)
        self._seen = [(one, None) for one in given]

    def rebuild(self, lists: Sequence[NodeList]) -> None:
        """Build again from the same lists, which may have other nodes.

        Every older `PairField` becomes stale. Arrays that you hold stay valid; their memory is
        reused once you delete them.

        Parameters
        ----------
        lists : sequence of NodeList
            With the same names, in the same order.

        Raises
        ------
        ValueError
            If names differ, and as for the constructor. Nothing has changed then.

        Examples
        --------
        >>> import halfshell as hs
        >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0]], [1.0, 1.0])])
        >>> c.rebuild([hs.NodeList("a", [[0.0], [9.0]], [1.0, 1.0])])
        >>> len(c.pairs)
        0
        """
        given = _as_lists(lists)
        names = tuple(one.name for one in given)
        if names != self.names:
            raise ValueError(f"rebuild needs the lists {self.names}, got {names}")
        self._become(self._built(given), "rebuild", [(one, None) for one in given])

    def patch(
        self, keep: Sequence[npt.ArrayLike], old2new: Sequence[npt.ArrayLike] | None = None
    ) -> None:
        """Leave nodes out; equal to a new connectivity of the remaining ones.

        The coupling of pairs stays. Every older `PairField` becomes stale.

        Parameters
        ----------
        keep : sequence of array_like of bool, each of shape (n,)
            For each list, which nodes stay; `used` returns such a sequence.
        old2new : sequence of array_like of int, each of shape (n,), optional
            The new number of each node in its list; for removed nodes any. Ghosts must stay after
            other nodes. Default: in the same order, without gaps.

        Raises
        ------
        TypeError, ValueError
            If these do not fit the nodes, or `old2new` does not give each kept node a number of
            its own. Then nothing has changed.

        Examples
        --------
        >>> import halfshell as hs
        >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3)])
        >>> c.patch([[False, True, True]])
        >>> [tuple(pair) for pair in c.pairs]
        [(0, 0, 1, 0)]
        """
        made, left = node_patch.patched(self._links, keep, old2new, self._morton_box)
        seen: list[Seen] = [
            (one, own if before is None else before[own])
            for (one, before), own in zip(self._seen, left, strict=True)
        ]
        self._become(made, "patch", seen)

    def remove(self, which: npt.ArrayLike | Predicate) -> None:
        """Take pairs out of rows, pairs, overlap and intersection.

        The coupling of other pairs stays. Every older `PairField` becomes stale.

        Parameters
        ----------
        which : array_like of bool, shape (m,), or callable
            A mask over `pairs`, in which each image counts separately, or a function of arrays
            i_node, i_list, j_node, j_list that returns bools. It is called with pairs in the
            table's orientation, including pairs of two ghosts and pairs that merely overlap,
            so it may get a pair several times.

        Raises
        ------
        TypeError, ValueError
            If the mask does not hold a bool for each pair. Then nothing has changed.

        Examples
        --------
        >>> import halfshell as hs
        >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3)])
        >>> c.remove(lambda i, a, j, b: j == 2)
        >>> [tuple(pair) for pair in c.pairs]
        [(0, 0, 1, 0)]
        """
        made = removed(self._links, which)
        self._become(made, "remove", self._seen)

    def used(self) -> tuple[npt.NDArray[np.bool_], ...]:
        """Which nodes are used: all but ghosts that are not a neighbour of any other node.

        Returns
        -------
        tuple of ndarray of bool, each of shape (n,)
            For each list; what `patch` takes, to leave out all other ghosts.

        Examples
        --------
        >>> import halfshell as hs
        >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0], [5.0]], [0.5] * 3, n_ghost=2)])
        >>> [one.tolist() for one in c.used()]
        [[True, True, False]]
        """
        nodes, pairs = self._links.nodes, self._links.pairs
        internal = nodes.internal
        flags = ~nodes.is_ghost(np.arange(nodes.n))
        first, second = (
            (nodes.first[lists] + node, node < internal[lists])
            for node, lists in ((pairs.i_node, pairs.i_list), (pairs.j_node, pairs.j_list))
        )
        flags[first[0][second[1]]] = True
        flags[second[0][first[1]]] = True
        return tuple(np.split(flags, nodes.first[1:-1])) if nodes.n_lists else ()

    def validate(self) -> None:
        """Check the invariants of rows and pairs; for tests of programs and of this class.

        Raises
        ------
        ValueError
            If something is wrong; the message tells what.

        Notes
        -----
        Takes time in proportion to the number of pairs.

        Examples
        --------
        >>> import halfshell as hs
        >>> hs.Connectivity([hs.NodeList("a", [[0.0], [1.0]], [1.0, 1.0])]).validate()
        """
        node_check.check(self._links)

    def __repr__(self) -> str:
        n, ghosts = sum(self.n_nodes), sum(self.n_ghosts)
        return (
            f"Connectivity({n} nodes, {ghosts} of them ghosts, in {len(self.names)} lists, "
            f"{len(self.pairs)} pairs)"
        )

    # ---- how it is made ----------------------------------------------------------------------

    def _built(self, lists: Sequence[NodeList]) -> Links:
        nodes, points, supports = nodes_of(lists)
        if self._box is not None and len(points) and points.shape[1] != len(self._box):
            raise ValueError(f"nodes must have {len(self._box)} dimensions, as box has")
        if self._box is not None and len(points) == 0:
            points = np.empty((0, len(self._box)))  # lists without nodes have any dimensions
        if self._how.morton:
            nodes.number = morton_number(points, nodes.global_ids(), self._morton_box)
            points, supports = points[nodes.number], supports[nodes.number]
        elif self._how.keeps_points:
            points = points.copy()  # the caller's may change
        cut = node_cuts.cut_of_exclude(self._exclude, nodes)
        return search(
            points, supports, self._extent, self._box, self._bits, nodes, self._how, cut
        )

    def _become(self, links: Links, because: str, seen: list[Seen]) -> None:
        """Nothing here can fail: what a change makes has been made."""
        self._links.pairs._outdated = because
        self._links = links
        self._seen = seen


def _as_lists(lists: Any) -> list[NodeList]:
    if isinstance(lists, NodeList):
        raise TypeError("lists must be a sequence of NodeList: put the one into a list")
    given = as_list(lists, "lists", "NodeList")
    for one in given:
        if not isinstance(one, NodeList):
            raise TypeError(f"lists must be of NodeList, got {kind_of(one)}")
    names = [one.name for one in given]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"names must differ, got {name!r} twice")
    return given
