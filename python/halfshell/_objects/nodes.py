# SPDX-License-Identifier: BSD-3-Clause
"""How the nodes of several lists are numbered: by list and node, among all nodes, and by rank.

A node's number counts the nodes of the lists before its own, too. Its rank is its place in the
order of rows and pairs: that number, or its place on the Z curve.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell import _core
from halfshell._convert.starts import starts_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from halfshell._convert.types import FloatArray
    from halfshell._objects.node_list import NodeList

    Array = npt.NDArray[Any]
    Bools = npt.NDArray[np.bool_]
    Ints = npt.NDArray[np.int32]
    Offsets = npt.NDArray[np.int64]


class Nodes:
    """Names, counts, identities and ranks of the nodes of all lists; it does not change.

    counts, ghosts: nodes and ghosts of each list; first: the number of its first node, and at last
    that of all nodes; number: of the node of each rank, int32, or None where ranks are these
    numbers; ids: of each node by its number, or None where they are these numbers; directed:
    whether the pairs (i, j) and (j, i) are two.
    """

    __slots__ = ("_rank", "counts", "directed", "first", "ghosts", "ids", "names", "number")

    def __init__(
        self, names: tuple[str, ...], counts: Offsets, ghosts: Offsets, ids: Offsets | None,
        number: Ints | None, directed: bool,
    ) -> None:  # fmt: skip
        self.names, self.counts, self.ghosts, self.ids = names, counts, ghosts, ids
        self.first = starts_of(counts)
        self.number, self.directed = number, directed
        self._rank: Ints | None = None

    @property
    def n(self) -> int:
        return int(self.first[-1])

    @property
    def n_lists(self) -> int:
        return len(self.names)

    @property
    def internal(self) -> Offsets:
        return self.counts - self.ghosts

    def rank(self, number: Array) -> Array:
        """Ranks of nodes by their numbers."""
        if self.number is None:
            return number
        ranks = self._rank
        if ranks is None:
            ranks = np.empty(self.n, np.int32)
            ranks[self.number] = np.arange(self.n, dtype=np.int32)
            self._rank = ranks  # once it is complete: other threads look
        found: Array = ranks[number]
        return found

    def numbers(self, rank: Array) -> Array:
        """The opposite."""
        return rank if self.number is None else self.number[rank]

    def is_ghost(self, rank: Array) -> Bools:
        flags = np.zeros(self.n, np.bool_)
        for end, ghosts in zip(self.first[1:], self.ghosts, strict=True):
            flags[end - ghosts : end] = True
        found: Bools = flags[self.numbers(rank)]
        return found

    def global_ids(self) -> Offsets:
        """Of each node by its number."""
        return np.arange(self.n) if self.ids is None else self.ids

    def lists(self, flags: int) -> tuple[Offsets, Offsets, Ints | None, int]:
        """As the core takes them, with what it is to make of them."""
        return self.counts, self.ghosts, self.number, flags

    def keys_of(self, first: Array, second: Array) -> Offsets:
        """A number for each pair of ranks; ascends as half lists do."""
        first, second = first.astype(np.int64), second.astype(np.int64)
        if not self.directed:
            first, second = np.minimum(first, second), np.maximum(first, second)
        keys: Offsets = first * max(self.n, 1) + second
        return keys

    def ranks_of(self, pairs: Any) -> tuple[Array, Array]:
        """Ranks of both nodes of pairs, by columns i_node, i_list, j_node, j_list."""
        first = self.first.astype(np.int32)  # as all numbers are, it fits
        i_node, i_list, j_node, j_list = pairs[:4]
        return self.rank(first[i_list] + i_node), self.rank(first[j_list] + j_node)

    def exist(self, rows: Offsets) -> Bools:
        """Of rows (i_node, i_list, j_node, j_list), whether there are such nodes."""
        node, which = rows[:, ::2], rows[:, 1::2]
        known = (which >= 0) & (which < self.n_lists)
        counts = np.append(self.counts, 0)[np.where(known, which, -1)]
        found: Bools = np.all(known & (node >= 0) & (node < counts), axis=1)
        return found


def nodes_of(
    lists: Sequence[NodeList], box: FloatArray | None, directed: bool
) -> tuple[Nodes, FloatArray, FloatArray]:
    """The nodes of these lists, their positions and their supports, list after list."""
    given = [one for one in lists if not one.is_anywhere]
    dims = {one.positions.shape[1] for one in given}
    if len(dims) > 1:
        sizes = ", ".join(f"{one.name!r}: {one.positions.shape[1]}" for one in given)
        raise ValueError(f"lists must have the same number of dimensions, got {sizes}")
    d = dims.pop() if dims else 3
    some = {one.H.ndim: one.name for one in lists if one.n_nodes}
    if len(some) > 1:
        raise ValueError(
            f"H must be lengths in all lists, or matrices in all: {some[3]!r} has matrices, "
            f"{some[1]!r} has lengths, whose 1 / h is usually not a float64"
        )
    counts = np.array([one.n_nodes for one in lists], np.int64)
    if counts.sum() >= 2**31:
        raise OverflowError(f"fewer than 2**31 nodes can be searched, got {counts.sum()}")
    if box is not None:
        if counts.any() and d != len(box):
            raise ValueError(f"nodes must have {len(box)} dimensions, as box has")
        d = len(box)  # lists without nodes have any dimensions
    ids = None
    if any(one.ids is not None for one in lists):
        ids = np.concatenate([
            np.arange(start, start + one.n_nodes) if one.ids is None else one.ids
            for start, one in zip(starts_of(counts), lists, strict=False)
        ])  # fmt: skip
    ghosts = np.array([one.n_ghost for one in lists], np.int64)
    names = tuple(one.name for one in lists)
    nodes = Nodes(names, counts, ghosts, ids, None, directed)
    filled = [one for one in lists if one.n_nodes]
    return (
        nodes, _joined([one.positions for one in filled], (0, d)),
        _joined([one.H for one in filled], (0,)),
    )  # fmt: skip


def _joined(arrays: list[FloatArray], empty: tuple[int, ...]) -> FloatArray:
    if len(arrays) == 1:
        return arrays[0]
    return np.concatenate(arrays) if arrays else np.empty(empty)


def corners_of(points: FloatArray, box: FloatArray | None) -> tuple[FloatArray, FloatArray]:
    if box is None:
        return points.min(axis=0), points.max(axis=0)
    return box[0], box[1]


def morton_number(points: FloatArray, ids: Offsets, box: FloatArray | None) -> Ints:
    """The numbers of all nodes in the order of the Z curve: by key, position, id and number."""
    d = points.shape[1]
    if box is not None and box.shape[1] != d:
        raise ValueError(f"morton_box must have shape (2, {d}), got {box.shape}")
    if len(points) == 0:
        return np.empty(0, np.int32)
    low, high = corners_of(points, box)
    for place in points[((points < low) | (points > high)).any(axis=1)]:
        raise ValueError(
            f"morton_box must hold all nodes, ghosts too: {place.tolist()} is outside"
        )
    keys = _core.morton_keys(points, low, high)
    order = np.argsort(keys, kind="stable")
    same = keys[order[1:]] == keys[order[:-1]]
    tied = np.append(False, same) | np.append(same, False)
    places = np.flatnonzero(tied)
    if len(places):  # the others need no more
        who = order[places]
        order[places] = who[np.lexsort((who, ids[who], *points[who].T[::-1], keys[who]))]
    return order.astype(np.int32)
