# SPDX-License-Identifier: BSD-3-Clause
"""`Connectivity`: which nodes of several lists are neighbours, and what follows from that."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell import _core, _show
from halfshell._convert.arrays import (
    are_backward,
    as_array,
    as_real_array,
    in_order,
    of_shape,
    one_each,
    row_keys,
    rows_of,
    starts_of,
)
from halfshell._convert.call import DIRECTED, RULES, RULES_OF_SUPPORTS, Pairing
from halfshell._convert.foreign import is_a, kind_of, shown
from halfshell._convert.options import as_choice, as_flag, as_list, as_threads, as_whole
from halfshell._convert.points import as_box_alone, as_own_box, as_points
from halfshell._objects import pictures
from halfshell._objects.node_list import (
    NodeList,
    Nodes,
    as_extents,
    corners_of,
    known_by,
    morton_number,
    nodes_of,
)
from halfshell._objects.pair_table import Columns, PairTable, as_pair_rows
from halfshell._settings import current

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from halfshell._convert.types import ArrayLike, BoxLike, FloatArray, PeriodicLike

    Array = npt.NDArray[Any]
    Bools = npt.NDArray[np.bool_]
    Ints = npt.NDArray[np.int32]
    Offsets = npt.NDArray[np.int64]
    #: i_node, i_list, j_node, j_list -> which of these pairs.
    Predicate = Callable[[Ints, Ints, Ints, Ints], npt.ArrayLike]
    #: Which pairs of a half list are to go.
    Cut = Callable[["Half"], Bools]

# Flags of the core.
_GHOST_ROWS, _GHOST_PAIRS, _DIRECTED = 1, 2, 4
_GATHER = RULES.index("gather")
_NOWHERE = np.empty((0, 1))


@_show.shown
class GlobalNeighbors(NamedTuple):
    """Ids of nodes, and of their neighbours row after row."""

    ids: npt.NDArray[np.int64]
    offsets: npt.NDArray[np.int64]
    neighbors: npt.NDArray[np.int64]


class Connectivity:
    """All neighbours of each node in each list, and each pair of neighbours once.

    Nodes i and j are neighbours if ``|x_i - x_j| <= extent * h_i`` or ``<= extent * h_j`` or,
    if supports are matrices, ``|H_i @ (x_i - x_j)| <= extent`` or ``|H_j @ (x_i - x_j)| <=
    extent``, decided exactly, without rounding. Coincident nodes are neighbours; no node is its
    own neighbour.

    Parameters
    ----------
    lists : sequence of NodeList
        Lists are numbered in this order. Names must differ.
    extent : float or array_like of float, shape (n_lists,), default 2.0
        How many smoothing lengths supports reach, in all lists or in each; from 2**-64 to 2**64.
    rule : {"max", "min", "gather", "scatter"}, default "max"
        Within which supports neighbours are: of one of both, of both, or, in the row of i, j within
        that of i ("gather") or i within that of j ("scatter"). By the last two a row may have j
        and not the opposite: each entry of a row is then a pair, and there is no overlap and no
        intersection, in which pairs have no direction.
    box : float, array_like of float, shape (d,) or (d, d), or Box, optional
        As in `pairs`. In a periodic box, rows and pairs have shifts.
    periodic : bool or sequence of bool, shape (d,), optional
        Which box vectors are periodic. Default: all with a box, none without.
    ghosts : bool, default False
        Whether ghosts have rows, and pairs with each other.
    overlap : bool, default False
        Whether to find nodes whose supports have a node in common; ghosts then have rows, too.
    intersection : bool, default False
        Whether to find the nodes between the two nodes of each pair. As for `overlap`, ghosts then
        have rows. In a periodic box, of at most 6 dimensions.
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

    Attributes
    ----------
    names : tuple of str
        Of the lists.
    pairs : PairTable
        Each pair once, if one of its nodes is not a ghost, or `ghosts` is set. With the rules
        "gather" and "scatter", if the node whose row has it is not a ghost.
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
    overlap_offsets, overlap_indices, overlap_shifts : ndarray
        Rows of `overlap`, laid out as those of neighbours.
    intersection_offsets, intersection_indices, intersection_shifts : ndarray
        Entries of `intersection`: row ``k * n_lists + m`` is of pair k and list m. Shifts are from
        the first node of the pair.
    n_nodes, n_ghosts : tuple of int
        Of each list.
    nbytes : dict of str to int
        Bytes that each part takes now.

    See Also
    --------
    NodeList : nodes and their supports.
    PairField : numbers for each pair.

    Notes
    -----
    Lists are searched together, small supports apart from large ones; with an extent for each list
    once for each extent. Only what you request is computed or kept. Errors are those of `pairs`; a
    change that fails changes nothing. Decisions are exact whatever the `settings` are.

    ``overlap`` holds all neighbours, and all nodes j such that the supports of i and j contain a
    common node of any list; touching supports are not enough. ``intersection`` of a pair holds
    the neighbours of both nodes whose foot on the line through these lies on the closed segment
    between them, decided exactly, and then the two nodes themselves; if the two coincide, all
    common neighbours. In a periodic box both hold images: each neighbour counts with its shift.

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
    >>> c.n_neighbors("fluid").tolist(), c.n_neighbors("wall", 1)
    ([1, 2, 2], 0)
    """

    __slots__ = ("_exclude", "_how", "_links", "_seen")

    def __init__(
        self,
        lists: Sequence[NodeList],
        extent: float | npt.ArrayLike = 2.0,
        *,
        box: BoxLike | None = None,
        periodic: PeriodicLike | None = None,
        rule: Literal["max", "min", "gather", "scatter"] = "max",
        ghosts: bool = False,
        overlap: bool = False,
        intersection: bool = False,
        order: Literal["index", "morton"] = "index",
        morton_box: ArrayLike | None = None,
        exclude: npt.ArrayLike | Predicate | None = None,
        threads: int | None = None,
    ) -> None:
        given = _as_lists(lists)
        d = next((one.positions.shape[1] for one in given if not one.is_anywhere), None)
        if d is None:
            d, *_ = as_box_alone(box, periodic)
        how = self._how = How(
            as_choice(rule, "rule", RULES_OF_SUPPORTS), as_extents(extent, len(given)),
            *as_own_box(box, periodic, d), as_flag(ghosts, "ghosts"), as_flag(overlap, "overlap"),
            as_flag(intersection, "intersection"),
            as_choice(order, "order", ("index", "morton")) == "morton", _as_corners(morton_box),
            as_threads(threads),
        )  # fmt: skip
        if how.morton_box is not None and not how.morton:
            raise ValueError("morton_box needs order='morton'")
        if how.rule in DIRECTED and (how.overlap or how.intersection):
            raise ValueError(
                f'overlap and intersection are of pairs without a direction: rule="{how.rule}" '
                'has none, rule="max" and "min" have'
            )
        if how.bits and how.intersection and d > 6:
            raise ValueError(f"intersection in a periodic box needs at most 6 dimensions, got {d}")
        self._exclude = exclude
        self._links = _built(given, how, exclude)
        self._seen: list[pictures.Seen] = [(one.positions, one.H) for one in given]

    # ---- changes -----------------------------------------------------------------------------

    def rebuild(self, lists: Sequence[NodeList]) -> None:
        """Build again from the same lists, which may have other nodes.

        Every older `PairField` becomes stale, as after each change. Arrays that you hold stay
        valid; their memory is reused once you delete them.

        Parameters
        ----------
        lists : sequence of NodeList
            With the same names, in the same order.
        """
        given = _as_lists(lists)
        names = tuple(one.name for one in given)
        if names != self.names:
            raise ValueError(f"rebuild needs the lists {self.names}, got {names}")
        made = _built(given, self._how, self._exclude)
        self._become(made, "rebuild", [(one.positions, one.H) for one in given])

    def patch(
        self, keep: Sequence[npt.ArrayLike], old2new: Sequence[npt.ArrayLike] | None = None
    ) -> None:
        """Leave nodes out; equal to a new connectivity of the remaining ones, but coupling stays.

        Parameters
        ----------
        keep : sequence of array_like of bool, each of shape (n,)
            For each list, which nodes stay; `used` returns such a sequence.
        old2new : sequence of array_like of int, each of shape (n,), optional
            The new number of each node in its list; for removed nodes any. Ghosts must stay after
            other nodes. Default: in the same order, without gaps.

        Examples
        --------
        >>> import halfshell as hs
        >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3)])
        >>> c.patch([[False, True, True]])
        >>> [tuple(pair) for pair in c.pairs]
        [(0, 0, 1, 0)]
        """
        made, left = _patched(self._links, keep, old2new)
        seen = [(x[own], H[own]) for (x, H), own in zip(self._seen, left, strict=True)]
        self._become(made, "patch", seen)

    def remove(self, which: npt.ArrayLike | Predicate) -> None:
        """Take pairs out of rows, pairs, overlap and intersection; the coupling of others stays.

        Parameters
        ----------
        which : array_like of bool, shape (m,), or callable
            A mask over `pairs`, in which each image counts separately, or a function of arrays
            i_node, i_list, j_node, j_list that returns bools. It is called with pairs in the
            table's orientation, including pairs of two ghosts and pairs that merely overlap,
            so it may get a pair several times.

        Examples
        --------
        >>> import halfshell as hs
        >>> c = hs.Connectivity([hs.NodeList("a", [[0.0], [1.0], [2.0]], [0.5] * 3)])
        >>> c.remove(lambda i, a, j, b: j == 2)
        >>> [tuple(pair) for pair in c.pairs]
        [(0, 0, 1, 0)]
        """
        self._become(_removed(self._links, which), "remove", self._seen)

    def _become(self, links: Links, because: str, seen: list[pictures.Seen]) -> None:
        """Nothing here can fail: what a change makes has been made."""
        self._links.pairs._outdated = because
        self._links = links
        self._seen = seen

    # ---- all of it ---------------------------------------------------------------------------

    names: tuple[str, ...] = _show.attribute("_links.nodes.names")

    @property
    def n_nodes(self) -> tuple[int, ...]:
        return tuple(self._links.nodes.counts.tolist())

    @property
    def n_ghosts(self) -> tuple[int, ...]:
        return tuple(self._links.nodes.ghosts.tolist())

    pairs: PairTable = _show.attribute("_links.pairs")
    offsets: Offsets = _show.attribute("_links.rows.offsets")
    indices: Ints = _show.attribute("_links.rows.indices")
    shifts: Ints = _show.attribute("_links.rows.images")

    @property
    def row_start(self) -> Offsets:
        return starts_of(self._how.with_rows(self._links.nodes))

    overlap_offsets: Offsets = _show.attribute("_overlap.offsets")
    overlap_indices: Ints = _show.attribute("_overlap.indices")
    overlap_shifts: Ints = _show.attribute("_overlap.images")
    intersection_offsets: Offsets = _show.attribute("_intersection.offsets")
    intersection_indices: Ints = _show.attribute("_intersection.indices")
    intersection_shifts: Ints = _show.attribute("_intersection.images")

    @property
    def nbytes(self) -> dict[str, int]:
        links, pairs, nodes = self._links, self._links.pairs, self._links.nodes
        columns = pairs._columns or (None,) * 5  # not yet looked at
        parts: dict[str, tuple[Any, ...]] = {
            "rows": links.rows[:2],
            "pairs": columns[:4],
            "shifts": (links.rows.shifts, columns[4]),
            "coupling": (pairs._coupling,),
            "lookup": (pairs._keys,),
            "overlap": links.overlap or (),
            "gather": links.gathered or (),
            "intersection": links.intersection or (),
            "order": (nodes.number, nodes._rank),
            "points": (links.points,),
        }
        return {
            name: sum(one.nbytes for one in arrays if one is not None)
            for name, arrays in parts.items()
        }

    def used(self) -> tuple[npt.NDArray[np.bool_], ...]:
        """For each list, which nodes are not ghosts without a neighbour; what `patch` takes to
        leave out all of these.

        Returns
        -------
        tuple of ndarray of bool, each of shape (n,)
        """
        nodes = self._links.nodes
        i, j = nodes.ranks_of(self.pairs._made)
        flags = ~nodes.is_ghost(np.arange(nodes.n))  # by rank
        flags[np.concatenate((i[flags[j]], j[flags[i]]))] = True
        return tuple(np.split(flags[nodes.rank(np.arange(nodes.n))], nodes.first[1:-1]))

    def global_neighbors(self) -> GlobalNeighbors:
        """The ids of all neighbours of each node that is no ghost.

        Returns
        -------
        GlobalNeighbors
            A named tuple (ids, offsets, neighbors): those of node k of ``ids``, int64, are
            ``neighbors[offsets[k]:offsets[k + 1]]``. Nodes are in the order of lists and nodes;
            neighbours as in their rows, list after list.
        """
        nodes, ids = self._links.nodes, self._links.nodes.global_ids()
        internal = np.concatenate([
            np.arange(n) < own
            for n, own in zip(self._how.with_rows(nodes), nodes.internal, strict=True)
        ] or [np.empty(0, np.bool_)])  # fmt: skip
        lengths = np.diff(self.offsets)
        lists = np.repeat(np.resize(np.arange(nodes.n_lists), len(lengths)), lengths)
        counts = np.diff(self.offsets[:: max(nodes.n_lists, 1)])
        others = ids[nodes.first[lists] + self.indices][np.repeat(internal, counts)]
        owners = np.flatnonzero(~nodes.is_ghost(nodes.rank(np.arange(nodes.n))))
        return GlobalNeighbors(ids[owners], starts_of(counts[internal]), others)

    def validate(self) -> None:
        """Make all but the search again: ValueError if something is not what the rows say."""
        _check(self._links)

    # ---- of one list -------------------------------------------------------------------------

    def traversal(self, list: int | str) -> npt.NDArray[np.int64]:
        """The nodes of a list, by number or name, in the order in which to go through them.

        Returns
        -------
        ndarray of int64
            Those that are no ghosts, ascending; with "morton" all, by the Z curve.
        """
        nodes, which = self._links.nodes, self._list_of(list)
        if nodes.number is None:
            return np.arange(nodes.internal[which])
        first, end = nodes.first[which : which + 2]
        own = nodes.number[(nodes.number >= first) & (nodes.number < end)]
        found: npt.NDArray[np.int64] = own.astype(np.int64) - first
        return found

    def morton_keys(self, list: int | str) -> npt.NDArray[np.uint64]:
        """The place of each node of a list, by number or name, on the Z curve.

        Returns
        -------
        ndarray of uint64, shape (n,)
            ``63 // d`` bits for each coordinate in turns, those of the first axis lowest.

        Raises
        ------
        ValueError
            If `order` is not "morton".
        """
        which = self._list_of(list)
        if not self._how.morton:
            raise ValueError('there are no keys: build with order="morton"')
        return np.split(_morton_keys(self._links), self._links.nodes.first[1:-1])[which]

    def n_neighbors(self, list: int | str, node: int | None = None) -> Any:
        """How many neighbours a node has in all lists, or each node of a list that has a row.

        Returns
        -------
        int, or ndarray of int64
        """
        n_lists = len(self.names)
        if node is not None:
            row = self._row_of(list, node) * n_lists
            return int(self.offsets[row + n_lists] - self.offsets[row])
        which = self._list_of(list)
        first, end = self.row_start[which : which + 2] * n_lists
        return np.diff(self.offsets[first : end + 1 : n_lists])

    # ---- of one node, or pair ----------------------------------------------------------------

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
        """
        return self._row(self._links.rows, self._row_of(list, node))

    def overlap(self, list: int | str, node: int) -> tuple[Ints, ...]:
        """The nodes in each list that are neighbours of a node or have one in common with it.

        As in `neighbors`; ValueError if `overlap` was not built.
        """
        return self._row(self._overlap, self._row_of(list, node))

    def intersection(self, pair: int | npt.ArrayLike) -> tuple[Ints, ...]:
        """The nodes in each list between the two of a pair, and these.

        Parameters
        ----------
        pair : int or array_like of int, shape (4,)
            Number of the pair, or (i_node, i_list, j_node, j_list) as for `PairTable.index`.

        Returns
        -------
        tuple of ndarray of int32
            For each list the common neighbours whose foot lies between the two, in the order of
            rows; then those of the two that are of this list, the first one first.

        Raises
        ------
        KeyError, IndexError, ValueError
            If there is no such pair, or several images of it; if `intersection` was not built.

        Examples
        --------
        >>> import halfshell as hs
        >>> a = hs.NodeList("a", [[0.0], [1.0], [2.0]], [1.0] * 3)
        >>> hs.Connectivity([a], intersection=True).intersection((0, 0, 2, 0))
        (array([1, 0, 2], dtype=int32),)
        """
        part = self._intersection
        is_one = as_array(pair, "pair", "be a number or four").ndim == 0
        k = self.pairs._number(pair) if is_one else self.pairs.index(pair)
        return self._row(part, k)

    def union_of(
        self, i_list: int | str, i_node: int, j_list: int | str, j_node: int
    ) -> tuple[Ints, ...]:
        """The neighbours of either of two nodes that have rows, in each list, in the order of rows.

        The two are in it if they are neighbours. As in `neighbors`; ValueError also in a periodic
        box, in which nodes have no neighbours but images.
        """
        nodes, ends = self._links.nodes, self._two_nodes(i_list, i_node, j_list, j_node)
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
        """The common neighbours of any two nodes that have rows, and these, as in `intersection`.

        Parameters
        ----------
        i_list, i_node, j_list, j_node : int
            As in `union_of`.
        points : sequence of array_like of float, each of shape (n, d), optional
            Positions of the nodes of each list. With them only nodes whose foot lies between the
            two count.
        """
        ends = self._two_nodes(i_list, i_node, j_list, j_node)
        places = None if points is None else _as_places(points, self.n_nodes)
        rows = [self.neighbors(*end) for end in ends]
        found = []
        for m, (first, second) in enumerate(zip(*rows, strict=True)):
            common = first[np.isin(first, second, assume_unique=True)]
            if places is not None and len(common):
                p, q = (places[which][node] for which, node in ends)
                common = common[_core.feet_between(places[m][common], p, q)]
            own = [node for which, node in ends if which == m]
            found.append(np.concatenate((common, np.array(own, np.int32))))
        return tuple(found)

    # ---- how it shows itself -----------------------------------------------------------------

    def __repr__(self) -> str:
        n, ghosts = sum(self.n_nodes), sum(self.n_ghosts)
        return (
            f"Connectivity({n} nodes, {ghosts} of them ghosts, in {len(self.names)} lists, "
            f"{len(self.pairs)} pairs)"
        )

    def _repr_html_(self) -> str:
        return pictures.html_of(self._links)

    def plot(self, axes: tuple[int, int] = (0, 1), ax: Axes | None = None) -> Axes:
        """Draw the nodes by list, their supports and the pairs; ghosts are hollow.

        Nodes are drawn where the arrays of their lists say: as they were given, if these have not
        been written to since. Supports are shown for up to 2000 nodes, pairs up to 200000.

        Parameters
        ----------
        axes : tuple of int, default (0, 1)
            The two coordinates to draw. In one dimension each list has a line of its own.
        ax : matplotlib.axes.Axes, optional
            Where to draw. Default: axes of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        return pictures.draw_nodes(self._links, self._seen, axes, ax)

    # ---- how rows are found ------------------------------------------------------------------

    @property
    def _overlap(self) -> Rows:
        return self._part("overlap")

    @property
    def _intersection(self) -> Rows:
        return self._part("intersection")

    def _part(self, name: str) -> Rows:
        part: Rows | None = getattr(self._links, name)
        if part is None:
            raise ValueError(f"{name} was not built: build with {name}=True")
        return part

    def _row(self, rows: Rows, row: int) -> tuple[Ints, ...]:
        n_lists = len(self.names)
        ends = rows.offsets[row * n_lists : (row + 1) * n_lists + 1].tolist()
        return tuple(rows.indices[a:b] for a, b in pairwise(ends))

    def _list_of(self, value: Any, name: str = "list") -> int:
        names = self.names
        if is_a(value, str):
            called = str.__str__(value)  # not what it says
            if called not in names:
                raise IndexError(f"{name} must be one of {names}, got {shown(called)}")
            return names.index(called)
        number = as_whole(value, name)
        if not 0 <= number < len(names):
            raise IndexError(f"there are {len(names)} lists, got {shown(number)}")
        return number

    def _node_of(self, which: int, value: Any, name: str = "node") -> int:
        number = as_whole(value, name)
        count = self.n_nodes[which]
        if not 0 <= number < count:
            raise IndexError(f"list {self.names[which]!r} has {count} nodes, got {shown(number)}")
        return number

    def _row_of(self, value: Any, node: Any) -> int:
        which = self._list_of(value)
        number = self._node_of(which, node)
        if number >= self._how.with_rows(self._links.nodes)[which]:
            raise ValueError(
                f"node {number} of {self.names[which]!r} is a ghost, and these have no rows: "
                "build with ghosts=True"
            )
        return int(self.row_start[which]) + number

    def _two_nodes(self, *four: Any) -> tuple[tuple[int, int], tuple[int, int]]:
        if self._links.rows.shifts is not None:
            raise ValueError(
                "in a periodic box, nodes have no common neighbours without their images: "
                "build with intersection=True, or give images as ghosts"
            )
        first, second = self._list_of(four[0], "i_list"), self._list_of(four[2], "j_list")
        return (
            (first, self._node_of(first, four[1], "i_node")),
            (second, self._node_of(second, four[3], "j_node")),
        )


def _as_lists(lists: Any) -> list[NodeList]:
    if is_a(lists, NodeList):
        raise TypeError("lists must be a sequence of NodeList: put the one into a list")
    given = as_list(lists, "lists", "NodeList")
    for one in given:
        if not is_a(one, NodeList):
            raise TypeError(f"lists must be of NodeList, got {kind_of(one)}")
    names = [one.name for one in given]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"names must differ, got {name!r} twice")
    return given


def _as_corners(values: Any) -> npt.NDArray[np.float64] | None:
    """The lowest and the highest coordinates of the box of the Z curve, or None."""
    if values is None:
        return None
    array = in_order(as_real_array(values, "morton_box", "hold two corners"), np.float64)
    if array.ndim != 2 or array.shape[0] != 2:
        raise ValueError(f"morton_box must have shape (2, d), low and high, got {array.shape}")
    if not np.isfinite(array).all() or (array[0] > array[1]).any():
        raise ValueError("morton_box must be finite, and low must not be above high")
    return array


def _as_places(points: Sequence[Any], counts: tuple[int, ...]) -> list[npt.NDArray[Any]]:
    arrays = [
        in_order(as_points(one, f"points[{k}]"), np.float64)
        for k, one in enumerate(as_list(points, "points", "arrays"))
    ]
    if len(arrays) != len(counts):
        raise ValueError(
            f"points must have an array for each of {len(counts)} lists, got {len(arrays)}"
        )
    dims = {array.shape[1:] for array, n in zip(arrays, counts, strict=True) if n}
    if len(dims) > 1 or any(len(a) != n for a, n in zip(arrays, counts, strict=True)):
        raise ValueError(f"points must have a row for each node of {counts}")
    return arrays


# ---- what it holds: rows of all nodes, and what follows from these ----------------------------

@dataclass(frozen=True)
class How:
    """What is built. extent: one for all lists, or an array of one for each."""

    rule: str
    extent: float | FloatArray
    box: FloatArray | None
    bits: int
    ghosts: bool
    overlap: bool
    intersection: bool
    morton: bool
    morton_box: FloatArray | None
    threads: int | None

    @property
    def keeps_points(self) -> bool:
        return self.overlap or self.intersection or self.morton

    @property
    def ghost_rows(self) -> bool:
        return self.ghosts or self.keeps_points

    def with_rows(self, nodes: Nodes) -> Offsets:
        return nodes.counts if self.ghost_rows else nodes.internal

    @property
    def flags(self) -> int:
        rows = _GHOST_ROWS if self.ghost_rows else 0
        pairs = _GHOST_PAIRS if self.ghosts else 0
        return rows | pairs | (_DIRECTED if self.rule in DIRECTED else 0)

    def search(self, points: Any) -> tuple[Any, ...]:
        """The first arguments of the core. Its decisions are exact, whatever the settings are."""
        own = current()
        threads = own.threads if self.threads is None else self.threads
        box = self.box if self.bits else None
        return (
            points, np.inf, box, self.bits, True, "exact", own.kernel, own.memory_limit, None,
            threads,
        )  # fmt: skip

    def call(self, n: int) -> tuple[Any, ...]:
        """The first arguments of a call about n nodes that looks at no points."""
        return np.empty((n, 1)), 0.0, None, 0, *self.search(_NOWHERE)[4:]


class Rows(NamedTuple):
    """Rows as the core gives and takes them."""

    offsets: Offsets
    indices: Ints
    shifts: Ints | None

    @classmethod
    def of(cls, made: Any) -> Rows:
        offsets, indices, *shifts = made
        return cls(offsets, indices, shifts[0] if shifts else None)

    @property
    def images(self) -> Ints:
        """The shifts, which there must be."""
        if self.shifts is None:
            raise AttributeError("these rows have no shifts: there is no periodic box")
        return self.shifts


class Half(NamedTuple):
    """Pairs of ranks, each once; a half list if they ascend. Of directed rules j is in i's row."""

    i: Array
    j: Array
    shifts: Ints | None

    def keep(self, which: Any) -> Half:
        return Half(
            self.i[which], self.j[which], None if self.shifts is None else self.shifts[which]
        )

    def forward(self) -> Half:
        """With the lower rank first, and forward images of one node."""
        back, shifts = are_backward(self.i, self.j, self.shifts), self.shifts
        if shifts is not None:
            shifts = np.where(back[:, None], -shifts, shifts)
        return Half(np.where(back, self.j, self.i), np.where(back, self.i, self.j), shifts)

    def order(self) -> Offsets:
        shifts = () if self.shifts is None else self.shifts.T[::-1]
        return np.lexsort((*shifts, self.j, self.i))


@dataclass(frozen=True)
class Links:
    """Rows, pairs and all else that was wanted, of one state."""

    nodes: Nodes
    how: How
    rows: Rows
    pairs: PairTable
    gathered: Rows | None  # for overlap: what the support of each rank reaches, by ranks
    overlap: Rows | None
    cut: Half | None  # pairs that overlap is not to have
    intersection: Rows | None
    points: FloatArray  # by rank, where overlap, intersection or the Z curve needs them


# ---- all of it --------------------------------------------------------------------------------

def _built(lists: Sequence[NodeList], how: How, exclude: Any) -> Links:
    """The links of these lists."""
    nodes, points, supports = nodes_of(lists, how.box, how.rule in DIRECTED)
    if how.morton:
        nodes.number = morton_number(points, nodes.global_ids(), how.morton_box)
        points, supports = points[nodes.number], supports[nodes.number]
    elif how.keeps_points:
        points = points.copy()  # the caller's may change
    cut = None if exclude is None else _cut_of(exclude, "exclude", nodes)
    rows, gathered = _search(points, supports, nodes, how)
    if cut is not None:
        half = _half_of(nodes, how, rows)
        rows, gathered = _without(nodes, how, rows, gathered, half.keep(cut(half)), cut)
    return _completed(nodes, how, points, rows, gathered, cut)


def _completed(
    nodes: Nodes, how: How, points: FloatArray, rows: Rows, gathered: Rows | None,
    cut: Cut | None = None, before: Half | None = None, intersection: Rows | None = None,
) -> Links:  # fmt: skip
    """The links of these rows. cut, before: what overlap is not to have."""
    lists = nodes.lists(how.flags)
    overlap = gone = None
    if gathered is not None:
        overlap = Rows.of(_core.overlap(*how.search(points), *gathered, *lists))
    if overlap is not None and (cut is not None or before is not None):
        half = _half_of(nodes, how, overlap)
        mask = np.zeros(len(half.i), np.bool_)
        for some in (cut, None if before is None else _cut_of_half(before, nodes)):
            if some is not None:
                mask |= some(half)
        gone = half.keep(mask) if mask.any() else None
        overlap = _connected(nodes, how, half.keep(~mask))
    if how.intersection and intersection is None:
        half = _half_of(nodes, how, rows)
        intersection = Rows.of(_core.intersect(*how.search(points), *half, *lists))
    pairs = PairTable(nodes, lambda: _paired(nodes, how, rows, how.flags))
    kept = points if how.keeps_points else points[:0]
    return Links(nodes, how, rows, pairs, gathered, overlap, gone, intersection, kept)


def _paired(nodes: Nodes, how: How, rows: Rows, flags: int) -> Columns:
    of_nodes, (i_list, j_list) = _core.pair_rows(*how.call(nodes.n), *rows, *nodes.lists(flags))
    i_node, j_node, *shifts = of_nodes
    return Columns(i_node, i_list, j_node, j_list, shifts[0] if shifts else None)


def _half_of(nodes: Nodes, how: How, rows: Rows) -> Half:
    return _half_of_pairs(nodes, _paired(nodes, how, rows, how.flags | _GHOST_PAIRS))


def _half_of_pairs(nodes: Nodes, pairs: Any) -> Half:
    half = Half(*nodes.ranks_of(pairs), pairs[4])
    if not nodes.directed and nodes.ghosts.any():  # which come behind other nodes in the table
        half = half.forward()
    return half


def _connected(nodes: Nodes, how: How, half: Half) -> Rows:
    i, j = (one.astype(np.int32, copy=False) for one in half[:2])
    shifts = None if half.shifts is None else np.ascontiguousarray(half.shifts, np.int32)
    return Rows.of(_core.connect(*how.call(nodes.n), i, j, shifts, *nodes.lists(how.flags)))


# ---- the search -------------------------------------------------------------------------------

def _search(
    points: FloatArray, supports: FloatArray, nodes: Nodes, how: How
) -> tuple[Rows, Rows | None]:
    """The rows of all nodes, and, for overlap, what each one's own support reaches, by ranks."""
    letters = "jS" if how.bits else "j"
    gathered = None
    if isinstance(how.extent, float):
        search = how.search(known_by(points, supports))
        if how.overlap:
            by = Pairing(_GATHER, how.extent)
            gathered = Rows.of(_core.neighbors(*search, letters, 4, None, by, "auto"))
        by = Pairing(RULES.index(how.rule), how.extent)
        lists = nodes.lists(how.flags)
        return Rows.of(_core.connect_search(*search, *lists, by)), gathered
    extents = np.repeat(how.extent, nodes.counts)[nodes.numbers(np.arange(nodes.n))]
    parts = []
    for extent in np.unique(how.extent).tolist():  # each support among all nodes
        who = np.flatnonzero(extents == extent).astype(np.int32)
        asking, by = known_by(points[who], supports[who]), Pairing(_GATHER, extent)
        rows = Rows.of(_core.neighbors(*how.search(points), letters, 4, asking, by, "auto"))
        half = Half(np.repeat(who, np.diff(rows.offsets)), *rows[1:])
        apart = half.i != half.j
        parts.append(half.keep(apart if half.shifts is None else apart | half.shifts.any(axis=1)))
    i, j, shifts = (np.concatenate(some) if some[0] is not None else None for some in zip(*parts))
    assert i is not None and j is not None
    half = Half(i, j, shifts).keep(np.argsort(i, kind="stable"))
    if how.overlap:
        gathered = Rows(starts_of(np.bincount(half.i, minlength=nodes.n)), *half[1:])
    return _connected(nodes, how, _by_rule(half, how.rule)), gathered


def _by_rule(gathered: Half, rule: str) -> Half:
    """The pairs of a rule, from all (i, j, S) such that j is in the support of i."""
    if rule == "gather":
        return gathered
    if rule == "scatter":
        i, j, shifts = gathered
        half = Half(j, i, None if shifts is None else -shifts)
        return half.keep(half.order())
    half = gathered.forward()
    half = half.keep(half.order())
    new = np.ones(len(half.i), np.bool_)
    new[1:] = (half.i[1:] != half.i[:-1]) | (half.j[1:] != half.j[:-1])
    if half.shifts is not None:
        new[1:] |= (half.shifts[1:] != half.shifts[:-1]).any(axis=1)
    places = np.flatnonzero(new)
    if rule == "min":  # within both supports: there twice
        places = places[np.diff(np.append(places, len(new))) == 2]
    return half.keep(places)


# ---- pairs that go ----------------------------------------------------------------------------

def _removed(links: Links, which: Any) -> Links:
    """The links without the pairs of a mask of the table, or those that a function chooses."""
    nodes, how, pairs = links.nodes, links.how, links.pairs
    if callable(which):
        cut = _cut_of(which, "which", nodes)
        half = _half_of(nodes, how, links.rows)
        mask = cut(half)
        gone = half.keep(mask)
        if not how.ghosts:
            ghosts = nodes.is_ghost(half.i)
            listed = ~ghosts if nodes.directed else ~(ghosts & nodes.is_ghost(half.j))
            mask = mask[listed]
    else:
        mask = as_array(which, "which")
        if mask.dtype.kind != "b":
            raise TypeError(f"which must hold bools, got dtype {mask.dtype}")
        one_each("which", len(pairs), "one for each pair")(mask.shape)
        mask = np.array(mask)  # another thread may change the caller's
        places = np.flatnonzero(mask)
        gone = _half_of_pairs(nodes, [one if one is None else one[places] for one in pairs._made])
        cut = _cut_of_half(gone, nodes)
    rows, gathered = _without(nodes, how, links.rows, links.gathered, gone, cut)
    made = _completed(nodes, how, links.points, rows, gathered, cut, links.cut)
    if pairs._coupling is not None:
        made.pairs.coupling = pairs._coupling[~mask]
    return made


def _without(
    nodes: Nodes, how: How, rows: Rows, gathered: Rows | None, gone: Half, cut: Cut
) -> tuple[Rows, Rows | None]:
    """Rows without some of their pairs, and what nodes gather without what is cut."""
    left = Rows.of(_core.rows_without(
        *how.call(nodes.n), *rows, *_connected(nodes, how, gone), nodes.n_lists,
        nodes.number is None,
    ))  # fmt: skip
    if gathered is not None:
        offsets, j, shifts = gathered
        half = Half(rows_of(offsets, np.int32), j, shifts)
        stays = ~cut(half.forward())
        gathered = Rows(starts_of(stays)[offsets], *half.keep(stays)[1:])
    return left, gathered


def _cut_of(which: Any, name: str, nodes: Nodes) -> Cut:
    """What a function, or rows (i_node, i_list, j_node, j_list), take out."""
    if not callable(which):
        rows = as_pair_rows(which, name)
        for row in rows[~nodes.exist(rows)]:
            raise ValueError(f"{name} names a node that does not exist: {row.tolist()}")
        i, j = nodes.ranks_of(rows.T)
        for row in rows[i == j]:
            raise ValueError(f"{name} must name two nodes, got one with itself: {row.tolist()}")
        keys = np.concatenate((nodes.keys_of(i, j), nodes.keys_of(j, i)))
        return lambda half: np.isin(nodes.keys_of(half.i, half.j), keys)

    def cut(half: Half) -> Bools:
        i, j = half.i, half.j
        if nodes.number is None and not nodes.directed:  # as in the table
            turned = nodes.is_ghost(i) & ~nodes.is_ghost(j)
            i, j = np.where(turned, j, i), np.where(turned, i, j)
        four: list[Array] = []
        for rank in (i, j):
            number = nodes.numbers(rank)
            lists = np.searchsorted(nodes.first[1:], number, side="right").astype(np.int32)
            four += (number - nodes.first[lists]).astype(np.int32), lists
        mask = np.asarray(which(*four))
        if mask.dtype.kind != "b" or mask.shape not in ((), i.shape):
            what = f"{mask.dtype} {mask.shape}" if mask.dtype.kind != "O" else kind_of(mask)
            raise ValueError(f"{name} must return a bool for each of {len(i)} pairs, got {what}")
        return np.broadcast_to(mask, i.shape)

    return cut


def _cut_of_half(some: Half, nodes: Nodes) -> Cut:
    """These pairs, image by image."""

    def cut(half: Half) -> Bools:
        keys, others = (nodes.keys_of(one.i, one.j) for one in (half, some))
        if half.shifts is not None and some.shifts is not None:
            keys, others = row_keys([keys, *half.shifts.T], [others, *some.shifts.T])
        return np.isin(keys, others)

    return cut


# ---- nodes that go ----------------------------------------------------------------------------

def _patched(links: Links, keep: Any, old2new: Any) -> tuple[Links, list[Offsets]]:
    """The links of the nodes that are kept, and which these are, by their new numbers.

    Rows are copied without the nodes that go, and sorted where nodes come in another order.
    """
    old, how = links.nodes, links.how
    kept, new = _as_change(keep, old2new, old)
    nodes, points, rank = _shrunk(links, kept, new)
    order = [np.argsort(one, kind="stable")[(one < 0).sum() :] for one in new]
    left = rank[rank >= 0]
    is_sorted = bool((left[1:] > left[:-1]).all())
    place = None
    if not is_sorted:
        place = np.empty_like(rank)
        place[old.numbers(np.arange(old.n))] = rank

    def kept_rows(rows: Rows, *change: Any) -> Rows:
        return Rows.of(_core.keep_rows(*how.call(0), *rows, *change))

    target = np.concatenate([*new, np.empty(0, np.int64)]).astype(np.int32)
    starts = starts_of(how.with_rows(old))
    of_row = [
        start + own[:n] for start, own, n in zip(starts, order, how.with_rows(nodes), strict=False)
    ]
    source = np.concatenate([*of_row, np.empty(0, np.int64)]).astype(np.int64)
    rows = kept_rows(links.rows, old.counts, target, place, source)
    gathered = cut = intersection = None
    if links.gathered is not None:
        by_rank = np.empty(nodes.n, np.int64)
        by_rank[left] = np.flatnonzero(rank >= 0)
        change = (np.array([old.n]), rank, None if is_sorted else rank, by_rank)
        gathered = kept_rows(links.gathered, *change)
    if links.cut is not None:
        half = Half(rank[links.cut.i], rank[links.cut.j], links.cut.shifts)
        cut = half.keep((half.i >= 0) & (half.j >= 0)).forward()
    stays = None
    if (is_sorted and links.intersection is not None) or links.pairs._coupling is not None:
        columns = links.pairs._made
        i, j = (rank[one] for one in old.ranks_of(columns))
        half = Half(i, j, columns.shifts)
        stays = np.flatnonzero((half.i >= 0) & (half.j >= 0))
    if is_sorted and stays is not None and links.intersection is not None:
        intersection = kept_rows(links.intersection, old.counts, target, None, stays)
    made = _completed(nodes, how, points, rows, gathered, None, cut, intersection)
    if stays is not None and links.pairs._coupling is not None:
        half = half.keep(stays)
        by = (half if nodes.directed else half.forward()).order()
        made.pairs.coupling = links.pairs._coupling[stays[by]]
    return made, order


def _as_change(keep: Any, old2new: Any, nodes: Nodes) -> tuple[list[Bools], list[Offsets]]:
    """Of each list which nodes stay, and the new number of each, -1 for those that go."""
    masks, numbers = [], []
    for name, count, mask in _of_lists(keep, "keep", nodes):
        of_shape(f"keep must have shape ({count},) for {name!r}", (count,))(mask.shape)
        if mask.dtype.kind in "iu" and ((mask == 0) | (mask == 1)).all():
            mask = mask.astype(np.bool_)
        if mask.dtype.kind != "b" and mask.size:
            raise TypeError(f"keep must hold bools, got dtype {mask.dtype} for {name!r}")
        masks.append(mask.astype(np.bool_))
    if old2new is None:
        return masks, [np.where(mask, np.cumsum(mask) - 1, -1) for mask in masks]
    given = _of_lists(old2new, "old2new", nodes)
    for (name, _, array), mask, internal in zip(given, masks, nodes.internal, strict=True):
        of_shape(f"old2new must have shape {mask.shape} for {name!r}", mask.shape)(array.shape)
        if array.size and array.dtype.kind not in "iu":
            raise TypeError(f"old2new must hold whole numbers, got dtype {array.dtype}")
        new = np.where(mask, array, -1).astype(np.int64)
        n = int(mask.sum())
        if (np.sort(new[mask]) != np.arange(n)).any():
            raise ValueError(
                f"old2new must give the {n} nodes of {name!r} that are kept the numbers from 0 to "
                f"{n - 1}, each once"
            )
        if (new[:internal] >= mask[:internal].sum()).any():
            raise ValueError(f"old2new must keep the ghosts of {name!r} behind its other nodes")
        numbers.append(new)
    return masks, numbers


def _of_lists(values: Any, name: str, nodes: Nodes) -> list[tuple[str, int, Array]]:
    """Names and counts of the lists, with an array for each."""
    given = as_list(values, name, "arrays, one for each list")
    if len(given) != nodes.n_lists:
        raise ValueError(
            f"{name} must have an array for each of {nodes.n_lists} lists, got {len(given)}"
        )
    arrays = [as_array(one, name) for one in given]
    return list(zip(nodes.names, nodes.counts.tolist(), arrays, strict=True))


def _shrunk(links: Links, kept: list[Bools], new: list[Offsets]) -> tuple[Nodes, FloatArray, Ints]:
    """The nodes that are left, their points by rank, and the new rank, or -1, of each old one."""
    old, how = links.nodes, links.how
    counts = np.array([mask.sum() for mask in kept], np.int64)
    internal = [mask[:n].sum() for mask, n in zip(kept, old.internal, strict=True)]
    ghosts = counts - np.array(internal, np.int64)
    first = starts_of(counts)
    number = np.concatenate([
        np.empty(0, np.int64),
        *(np.where(one >= 0, one + at, -1) for one, at in zip(new, first, strict=False)),
    ])  # fmt: skip
    stays = number >= 0
    ids = np.empty(int(stays.sum()), np.int64)
    ids[number[stays]] = old.global_ids()[stays]
    points, order = links.points, None
    if how.keeps_points:
        by_number = old.rank(np.arange(old.n))
        points = np.empty((len(ids), points.shape[1]))
        points[number[stays]] = links.points[by_number[stays]]
        if how.morton:
            order = morton_number(points, ids, how.morton_box)
            points = points[order]
    nodes = Nodes(old.names, counts, ghosts, ids, order, old.directed)
    rank = np.full(old.n, -1, np.int32)
    rank[stays] = nodes.rank(number[stays])
    return nodes, points, rank[old.numbers(np.arange(old.n))]


def _morton_keys(links: Links) -> npt.NDArray[np.uint64]:
    keys = np.empty(links.nodes.n, np.uint64)
    if len(keys):
        low, high = corners_of(links.points, links.how.morton_box)
        keys[links.nodes.number] = _core.morton_keys(links.points, low, high)
    return keys


# ---- what holds of it -------------------------------------------------------------------------

def _check(links: Links) -> None:
    """ValueError unless rows are those of the pairs that they tell, and all else is what these
    give: so all is ascending, each pair once, and rows mirror each other."""
    nodes, how = links.nodes, links.how
    try:
        rows = _connected(nodes, how, _half_of(nodes, how, links.rows))
    except ValueError as error:
        raise ValueError(f"rows are not each there once, in order: {error}") from error
    again = _completed(nodes, how, links.points, rows, links.gathered, None, links.cut)
    for name in ("rows", "pairs", "overlap", "intersection"):
        one, other = getattr(links, name), getattr(again, name)
        if name == "pairs":
            one, other = one._made, other._made
        if one is not None and not all(map(np.array_equal, one, other)):
            raise ValueError(f"{name} are not what the rows say")
    if nodes.number is not None and (np.sort(nodes.number) != np.arange(nodes.n)).any():
        raise ValueError("the traversal does not have each node once")
