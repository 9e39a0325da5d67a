# SPDX-License-Identifier: BSD-3-Clause
"""How the nodes of several lists are numbered: by list and node, among all nodes, and by rank.

A node's number among all nodes counts those of the lists before its own. Its rank is its place in
the order that rows and pairs follow: that number, or its place on the Z curve.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell import _core
from halfshell._convert.arrays import as_real_array, in_order
from halfshell._convert.starts import starts_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from halfshell._convert.types import FloatArray
    from halfshell._objects.node_list import NodeList

    Indices = npt.NDArray[np.int64]


class Nodes:
    """Names, counts, identities and ranks of the nodes of all lists; it does not change.

    counts, ghosts: nodes and ghosts of each list; first: the number of its first node among all,
    and at last that of all nodes; number: of the node of each rank, int32, or None where ranks are
    these numbers; ids: of each node by its number, or None where they are these numbers.
    """

    __slots__ = ("_rank", "counts", "first", "ghosts", "ids", "names", "number")

    def __init__(
        self,
        names: tuple[str, ...],
        counts: Indices,
        ghosts: Indices,
        ids: Indices | None,
        number: npt.NDArray[np.int32] | None = None,
    ) -> None:
        self.names = names
        self.counts = counts
        self.ghosts = ghosts
        self.first = starts_of(counts)
        self.ids = ids
        self.number = number
        self._rank: npt.NDArray[np.int32] | None = None

    @property
    def n(self) -> int:
        return int(self.first[-1])

    @property
    def n_lists(self) -> int:
        return len(self.names)

    @property
    def internal(self) -> Indices:
        return self.counts - self.ghosts

    def rank(self, number: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Ranks of nodes by their numbers."""
        if self.number is None:
            return number
        ranks = self._rank
        if ranks is None:
            ranks = np.empty(self.n, np.int32)
            ranks[self.number] = np.arange(self.n, dtype=np.int32)
            self._rank = ranks  # once it is complete: other threads look
        found: npt.NDArray[Any] = ranks[number]
        return found

    def numbers(self, rank: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The opposite."""
        return rank if self.number is None else self.number[rank]

    def labels(self, rank: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Numbers in their lists, and lists, of nodes by their ranks."""
        number = self.numbers(rank)
        lists = np.searchsorted(self.first[1:], number, side="right").astype(np.int32)
        return (number - self.first[lists]).astype(np.int32), lists

    def is_ghost(self, number: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
        """Of nodes by their numbers."""
        flags: npt.NDArray[np.bool_] = np.zeros(self.n, np.bool_)
        for end, ghosts in zip(self.first[1:], self.ghosts, strict=True):
            flags[end - ghosts : end] = True
        found: npt.NDArray[np.bool_] = flags[number]
        return found

    def global_ids(self) -> Indices:
        """Of each node by its number."""
        return np.arange(self.n) if self.ids is None else self.ids

    def keys_of(self, first: npt.NDArray[Any], second: npt.NDArray[Any]) -> Indices:
        """A number for each pair of ranks, the same in both orders; ascends as half lists do."""
        low = np.minimum(first, second).astype(np.int64)
        keys: Indices = low * max(self.n, 1) + np.maximum(first, second)
        return keys

    def ranks_of(self, rows: Indices) -> tuple[npt.NDArray[Any], npt.NDArray[Any]] | None:
        """Ranks of both nodes of rows (i_node, i_list, j_node, j_list); None if one is none."""
        found = []
        for node, which in ((rows[:, 0], rows[:, 1]), (rows[:, 2], rows[:, 3])):
            if ((which < 0) | (which >= self.n_lists)).any():
                return None
            if ((node < 0) | (node >= self.counts[which])).any():
                return None
            found.append(self.rank(self.first[which] + node))
        return found[0], found[1]

    def ranks_of_columns(self, pairs: Any) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        if self.n_lists == 1:
            return self.rank(pairs.i_node), self.rank(pairs.j_node)
        first = self.first.astype(np.int32)  # as all numbers are, it fits
        i, j = first[pairs.i_list] + pairs.i_node, first[pairs.j_list] + pairs.j_node
        return self.rank(i), self.rank(j)


def nodes_of(lists: Sequence[NodeList]) -> tuple[Nodes, FloatArray, FloatArray]:
    """The nodes of these lists, their positions and their supports, list after list."""
    given = [one for one in lists if not one.is_anywhere]
    dims = {one.positions.shape[1] for one in given}
    if len(dims) > 1:
        sizes = ", ".join(f"{one.name!r}: {one.positions.shape[1]}" for one in given)
        raise ValueError(f"lists must have the same number of dimensions, got {sizes}")
    d = dims.pop() if dims else 3
    points = [one.positions for one in given]
    supports = [one.H for one in given if one.n_nodes > 0]
    if len({one.ndim for one in supports}) > 1:
        flat, round_ = (
            next(one.name for one in given if one.n_nodes > 0 and one.H.ndim == ndim)
            for ndim in (3, 1)
        )
        raise ValueError(
            f"H must be lengths in all lists, or matrices in all: {flat!r} has matrices, "
            f"{round_!r} has lengths, whose 1 / h is usually not a float64"
        )
    counts = np.array([one.n_nodes for one in lists], np.int64)
    if counts.sum() >= 2**31:
        raise OverflowError(f"fewer than 2**31 nodes can be searched, got {counts.sum()}")
    ids = None
    if any(one.ids is not None for one in lists):
        first = starts_of(counts)
        ids = np.concatenate([
            np.arange(start, start + one.n_nodes) if one.ids is None else one.ids
            for start, one in zip(first, lists, strict=False)
        ])  # fmt: skip
    nodes = Nodes(
        tuple(one.name for one in lists), counts,
        np.array([one.n_ghost for one in lists], np.int64), ids,
    )  # fmt: skip
    return nodes, _joined(points, (0, d)), _joined(supports, (0,))


def _joined(arrays: list[FloatArray], empty: tuple[int, ...]) -> FloatArray:
    if len(arrays) == 1:
        return arrays[0]
    return np.concatenate(arrays) if arrays else np.empty(empty)


# ---- the Z curve ------------------------------------------------------------------------------


def as_morton_box(values: Any) -> tuple[FloatArray, FloatArray] | None:
    """The lowest and the highest coordinates, or None."""
    if values is None:
        return None
    array = in_order(as_real_array(values, "morton_box", "hold two corners"), np.float64)
    if array.ndim != 2 or array.shape[0] != 2:
        raise ValueError(f"morton_box must have shape (2, d), low and high, got {array.shape}")
    if not np.isfinite(array).all() or (array[0] > array[1]).any():
        raise ValueError("morton_box must be finite, and low must not be above high")
    return array[0], array[1]


def morton_number(
    points: FloatArray, ids: Indices, box: tuple[FloatArray, FloatArray] | None
) -> npt.NDArray[np.int32]:
    """The numbers of all nodes in the order of the Z curve: by key, position, id and number."""
    d = points.shape[1]
    if box is not None and len(box[0]) != d:
        raise ValueError(f"morton_box must have shape (2, {d}), got (2, {len(box[0])})")
    if len(points) == 0:
        return np.empty(0, np.int32)
    low, high = (points.min(axis=0), points.max(axis=0)) if box is None else box
    outside = np.flatnonzero(((points < low) | (points > high)).any(axis=1))
    if len(outside):
        raise ValueError(
            f"morton_box must hold all nodes, ghosts too: {points[outside[0]].tolist()} is outside"
        )
    keys = _core.morton_keys(points, low, high)
    order = np.argsort(keys, kind="stable")
    return _break_ties(order, keys[order], points, ids).astype(np.int32)


def _break_ties(
    order: npt.NDArray[Any], keys: npt.NDArray[Any], points: FloatArray, ids: Indices
) -> npt.NDArray[Any]:
    """The order where those of one key are put by position, id and number."""
    same = keys[1:] == keys[:-1]
    tied = np.zeros(len(keys), np.bool_)
    tied[1:] |= same
    tied[:-1] |= same
    places = np.flatnonzero(tied)
    if len(places):
        who = order[places]
        by = (who, ids[who], *points[who].T[::-1], keys[places])
        order[places] = who[np.lexsort(by)]
    return order
