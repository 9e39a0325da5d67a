# SPDX-License-Identifier: BSD-3-Clause
"""What a `Connectivity` holds: made by a search, or from a half list, as by every change.

A half list is i and j, ranks of nodes, each pair once and ascending, and the shifts of the pairs or
None. All that follows from one is made here, so that a change is a change of half lists.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell import _core
from halfshell._convert.starts import starts_of
from halfshell._objects.node_supports import reach_of
from halfshell._objects.pair_table import Columns, PairTable

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt

    from halfshell._convert.types import FloatArray
    from halfshell._objects.nodes import Nodes

    Ints = npt.NDArray[np.int32]
    Offsets = npt.NDArray[np.int64]
    Resources = tuple[
        FloatArray, float, None, int, bool, str, None, float | None, None, int | None
    ]
    #: Which pairs of ranks are to go.
    Cut = Callable[[npt.NDArray[Any], npt.NDArray[Any]], npt.NDArray[np.bool_]]

_GHOST_ROWS, _GHOST_PAIRS, _ROWS_ONLY = 1, 2, 4
#: For calls that need no points.
_NOWHERE = np.empty((0, 1))


@dataclass(frozen=True)
class Half:
    """A half list."""

    i: Ints
    j: Ints
    shifts: Ints | None

    def keep(self, mask: npt.NDArray[np.bool_]) -> Half:
        if mask.all():
            return self
        return Half(
            self.i[mask], self.j[mask], None if self.shifts is None else self.shifts[mask]
        )


@dataclass(frozen=True)
class Gathered:
    """What each node's own support reaches: a row of ranks for each rank."""

    offsets: Offsets
    indices: Ints

    @property
    def owners(self) -> npt.NDArray[Any]:
        return np.repeat(np.arange(len(self.offsets) - 1), np.diff(self.offsets))

    def keep(self, mask: npt.NDArray[np.bool_]) -> Gathered:
        if mask.all():
            return self
        before = starts_of(mask)
        return Gathered(before[self.offsets], self.indices[mask])


@dataclass(frozen=True)
class How:
    """What is built, and with what."""

    ghost_pairs: bool
    overlap: bool
    intersection: bool
    morton: bool
    threads: int | None
    memory_limit: float | None
    ghost_rows_too: bool = False

    @property
    def ghost_rows(self) -> bool:
        wants = self.ghost_pairs or self.overlap or self.intersection or self.morton
        return wants or self.ghost_rows_too

    @property
    def flags(self) -> int:
        """As the core takes them."""
        return (_GHOST_ROWS if self.ghost_rows else 0) | (_GHOST_PAIRS if self.ghost_pairs else 0)

    @property
    def keeps_points(self) -> bool:
        return self.overlap or self.intersection or self.morton

    def rest(self) -> tuple[bool, str, None, float | None, None, int | None]:
        return True, "exact", None, self.memory_limit, None, self.threads

    def resources(self, points: FloatArray) -> Resources:
        """The arguments of a search, for a call that searches nothing."""
        return points, 0.0, None, 0, *self.rest()

    def pairs_of_rows(self, nodes: Nodes) -> bool:
        """Whether the rows of all nodes are there, in the order in which pairs are."""
        return nodes.number is None and (self.ghost_rows or not nodes.ghosts.any())

    def flags_for(self, nodes: Nodes) -> int:
        """Of rows, with the pairs unless these can be made of them later."""
        return self.flags | (_ROWS_ONLY if self.pairs_of_rows(nodes) else 0)


@dataclass(frozen=True)
class Links:
    """Rows, pairs and all else that was wanted, of one state."""

    nodes: Nodes
    how: How
    offsets: Offsets
    indices: Ints
    shifts: Ints | None
    pairs: PairTable
    gathered: Gathered | None
    overlap: tuple[Offsets, Ints] | None
    cut: npt.NDArray[np.int64]  # keys of pairs that overlap no longer has, ascending
    intersection: tuple[Offsets, Ints] | None
    points: FloatArray | None  # by rank


def search(
    points: FloatArray, supports: FloatArray, extent: float, box: FloatArray | None, bits: int,
    nodes: Nodes, how: How, cut: Cut | None,
) -> Links:  # fmt: skip
    """The links of all nodes, whose points and supports are by rank."""
    first = (points, np.inf, box, bits, *how.rest())
    counts = (nodes.counts, nodes.ghosts, nodes.number, how.flags_for(nodes))
    gathered = None
    if how.overlap:
        by = reach_of("gather", supports, extent)
        gathered = Gathered(*_core.neighbors(*first, "j", 4, None, by, "auto")[:2])
    by = reach_of("max", supports, extent)
    if cut is None:
        rows, pairs = _core.connect_search(*first, *counts, by)
        return with_parts(nodes, how, rows, pairs, None, gathered, points)
    found: Any = _core.pairs(*first, "ijS" if bits else "ij", True, 4, None, by, "auto", None)
    half = Half(found[0], found[1], found[2] if bits else None)
    return link(nodes, how, half, gathered, points, cut)


def link(
    nodes: Nodes, how: How, half: Half, gathered: Gathered | None, points: FloatArray,
    cut: Cut | None = None, cut_before: npt.NDArray[np.int64] | None = None,
) -> Links:  # fmt: skip
    """All that is wanted, of these pairs without those that `cut` takes out.

    cut_before: keys of further pairs that overlap is not to have.
    """
    if cut is not None:
        half = half.keep(~cut(half.i, half.j))
        if gathered is not None:
            owners = gathered.owners
            low, high = np.minimum(owners, gathered.indices), np.maximum(owners, gathered.indices)
            gathered = gathered.keep(~cut(low, high))
    rows, pairs = _core.connect(
        *how.resources(points), half.i, half.j, half.shifts, nodes.counts, nodes.ghosts,
        nodes.number, how.flags_for(nodes),
    )  # fmt: skip
    return with_parts(nodes, how, rows, pairs, half, gathered, points, cut, cut_before)


def with_parts(
    nodes: Nodes, how: How, rows: Any, pairs: Any, half: Half | None, gathered: Gathered | None,
    points: FloatArray, cut: Cut | None = None, cut_before: npt.NDArray[np.int64] | None = None,
    intersection: tuple[Offsets, Ints] | None = None,
) -> Links:  # fmt: skip
    """The links of these rows and pairs, with what is wanted besides.

    pairs: None where they are made of the rows later. half: that of the pairs, if it is at hand;
    intersection, too.
    """
    offsets, indices, *shifts = rows
    made = _columns_of(pairs) if pairs is not None else _later(nodes, how, rows)
    links = Links(
        nodes, how, offsets, indices, shifts[0] if shifts else None, PairTable(nodes, made),
        gathered, None, np.empty(0, np.int64), intersection, points if how.keeps_points else None,
    )  # fmt: skip
    counts = (nodes.counts, nodes.ghosts, nodes.number, how.flags)
    if gathered is not None:
        rows_of = (*how.resources(points), gathered.offsets, gathered.indices)
        if cut is None and (cut_before is None or len(cut_before) == 0):
            links = replace(links, overlap=_core.overlap(*rows_of, *counts))
        else:
            one = (np.array([nodes.n]), np.array([0]), None, how.flags)
            apart, keys = _without(*_core.overlap(*rows_of, *one), nodes, cut, cut_before)
            links = replace(links, overlap=link_rows(nodes, how, apart, points), cut=keys)
    if how.intersection and intersection is None:
        half = half_of(links) if half is None else half
        found = _core.intersect(*how.resources(points), half.i, half.j, *counts)
        links = replace(links, intersection=found)
    return links


def _columns_of(pairs: Any) -> Columns:
    (i_node, j_node, *shifts), (i_list, j_list) = pairs
    return Columns(i_node, i_list, j_node, j_list, shifts[0] if shifts else None)


def _later(nodes: Nodes, how: How, rows: Any) -> Callable[[], Columns]:
    """What makes the pairs of these rows, of all nodes."""

    def make() -> Columns:
        offsets, indices, *shifts = rows
        made = _core.pair_rows(
            *how.resources(_NOWHERE), offsets, indices, shifts[0] if shifts else None,
            nodes.counts, nodes.ghosts, None, how.flags,
        )  # fmt: skip
        return _columns_of(made[1])

    return make


def link_rows(nodes: Nodes, how: How, half: Half, points: FloatArray) -> tuple[Offsets, Ints]:
    """Rows alone."""
    rows: tuple[Offsets, Ints] = _core.connect(
        *how.resources(points), half.i, half.j, half.shifts, nodes.counts, nodes.ghosts,
        nodes.number, how.flags | _ROWS_ONLY,
    )[0]  # fmt: skip
    return rows


def _without(
    offsets: Offsets, indices: Ints, nodes: Nodes, cut: Cut | None,
    before: npt.NDArray[np.int64] | None,
) -> tuple[Half, npt.NDArray[np.int64]]:  # fmt: skip
    """Of the overlap of each rank, pairs that stay, and the keys of the others."""
    owners = np.repeat(np.arange(nodes.n, dtype=np.int32), np.diff(offsets))
    apart = Half(owners, indices, None).keep(owners < indices)
    gone: npt.NDArray[np.bool_] = np.zeros(len(apart.i), np.bool_)
    keys = nodes.keys_of(apart.i, apart.j)
    if cut is not None:
        gone |= cut(apart.i, apart.j)
    if before is not None:
        gone |= is_one_of(keys, before)
    return apart.keep(~gone), keys[gone]


def is_one_of(keys: npt.NDArray[Any], some: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Of each key whether it is one of some, which ascend."""
    if len(some) == 0:
        return np.zeros(len(keys), np.bool_)
    places = np.minimum(np.searchsorted(some, keys), len(some) - 1)
    found: npt.NDArray[np.bool_] = some[places] == keys
    return found


# ---- less of the same -------------------------------------------------------------------------


def keep_rows(
    how: How, rows: tuple[Offsets, Ints, Ints | None], counts: npt.NDArray[np.int64],
    target: npt.NDArray[np.int32],
    place: npt.NDArray[np.int32] | None, source: npt.NDArray[np.int64],
) -> Any:  # fmt: skip
    """Some of these rows, without the nodes that go."""
    offsets, indices, shifts = rows
    return _core.keep_rows(
        *how.resources(_NOWHERE), offsets, indices, shifts, counts, target, place, source
    )


def keep_pairs(
    how: How, pairs: PairTable, counts: npt.NDArray[np.int64] | None,
    target: npt.NDArray[np.int32] | None, keep: npt.NDArray[np.bool_] | None,
) -> Any:  # fmt: skip
    """The pairs whose nodes stay and that are kept."""
    made = _core.keep_pairs(*how.resources(_NOWHERE), *pairs._all(), counts, target, keep)
    return made[1]


def without(links: Links, gone: Half) -> tuple[Any, Gathered | None]:
    """Rows, and what each node reaches, without these pairs, which are in the rows."""
    nodes, how = links.nodes, links.how
    resources = how.resources(np.empty((nodes.n, 1)))
    flags = how.flags | _ROWS_ONLY
    (offsets, indices, *shifts), _ = _core.connect(
        *resources, gone.i, gone.j, gone.shifts, nodes.counts, nodes.ghosts, nodes.number, flags
    )
    rows = _core.rows_without(
        *resources, links.offsets, links.indices, links.shifts, offsets, indices,
        shifts[0] if shifts else None, nodes.n_lists, nodes.number is None,
    )  # fmt: skip
    gathered = links.gathered
    if gathered is not None:
        (offsets, indices), _ = _core.connect(
            *resources, gone.i, gone.j, None, np.array([nodes.n]), np.array([0]), None, flags
        )
        gathered = Gathered(*_core.rows_without(
            *resources, gathered.offsets, gathered.indices, None, offsets, indices, None, 1, True
        ))  # fmt: skip
    return rows, gathered


# ---- back to half lists ------------------------------------------------------------------------


def half_of(links: Links) -> Half:
    """The half list that links were made of."""
    nodes = links.nodes
    if links.how.ghost_pairs or not links.how.ghost_rows or not nodes.ghosts.any():
        return half_of_pairs(nodes, links.pairs._all())
    return _half_of_rows(links)


def half_of_pairs(nodes: Nodes, pairs: Columns) -> Half:
    """The half list of some pairs, in the order of the table."""
    first, second = nodes.ranks_of_columns(pairs)
    shifts = pairs.shifts
    if nodes.ghosts.any():  # which come behind the other nodes of their pairs
        turned = first > second
        first, second = np.minimum(first, second), np.maximum(first, second)
        shifts = None if shifts is None else np.where(turned[:, None], -shifts, shifts)
    return Half(first.astype(np.int32, copy=False), second.astype(np.int32, copy=False), shifts)


def _half_of_rows(links: Links) -> Half:
    """Rows of all nodes have each pair twice."""
    nodes = links.nodes
    owner, other = rank_rows(links, links.offsets, links.indices)
    once = owner < other
    if links.shifts is not None:
        once |= (owner == other) & _is_forward(links.shifts)
    i, j = owner[once].astype(np.int32), other[once].astype(np.int32)
    shifts = None if links.shifts is None else links.shifts[once]
    if nodes.number is not None:
        order = np.argsort(nodes.keys_of(i, j), kind="stable")
        i, j, shifts = i[order], j[order], None if shifts is None else shifts[order]
    return Half(i, j, shifts)


def _is_forward(shifts: Ints) -> npt.NDArray[np.bool_]:
    """Whether the first component that is not 0 is positive."""
    first = np.argmax(shifts != 0, axis=1)
    forward: npt.NDArray[np.bool_] = shifts[np.arange(len(shifts)), first] > 0
    return forward


def row_starts(links: Links) -> npt.NDArray[np.int64]:
    """How many nodes of the lists before each one have rows, and at last of all."""
    counts = links.nodes.counts if links.how.ghost_rows else links.nodes.internal
    return starts_of(counts)


def are_listed(links: Links, half: Half) -> npt.NDArray[np.bool_]:
    """Which pairs of the half list are in the table."""
    nodes = links.nodes
    if links.how.ghost_pairs or not nodes.ghosts.any():
        return np.ones(len(half.i), np.bool_)
    ghost = [nodes.is_ghost(nodes.numbers(one)) for one in (half.i, half.j)]
    return ~(ghost[0] & ghost[1])


def stored(links: Links) -> npt.NDArray[np.int64]:
    """The numbers among all nodes of those that have rows, in the order of rows."""
    nodes = links.nodes
    if links.how.ghost_rows:
        return np.arange(nodes.n)
    return np.flatnonzero(~nodes.is_ghost(np.arange(nodes.n)))


def rank_rows(
    links: Links, offsets: Offsets, indices: Ints
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Ranks of the owner of each entry of rows, and of the node that it names."""
    nodes = links.nodes
    lengths = np.diff(offsets)
    owner = np.repeat(np.repeat(stored(links), nodes.n_lists), lengths)
    lists = np.repeat(np.resize(np.arange(nodes.n_lists), len(lengths)), lengths)
    return nodes.rank(owner), nodes.rank(nodes.first[lists] + indices)
