# SPDX-License-Identifier: BSD-3-Clause
"""What a `Connectivity` holds: rows of all nodes, and what follows from these."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from halfshell import _core
from halfshell._convert.arrays import (
    are_backward,
    as_array,
    of_shape,
    one_each,
    row_keys,
    rows_of,
    starts_of,
)
from halfshell._convert.call import DIRECTED, RULES, Pairing
from halfshell._convert.foreign import kind_of
from halfshell._convert.options import as_list
from halfshell._objects.node_list import Nodes, corners_of, known_by, morton_number, nodes_of
from halfshell._objects.pair_table import Columns, PairTable, as_pair_rows
from halfshell._settings import current

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from halfshell._convert.types import FloatArray
    from halfshell._objects.node_list import NodeList

    Array = npt.NDArray[Any]
    Bools = npt.NDArray[np.bool_]
    Ints = npt.NDArray[np.int32]
    Offsets = npt.NDArray[np.int64]
    #: Points, cutoff, box, periodic bits, and what follows in every call of the core.
    Search = tuple[
        Any, float, FloatArray | None, int, bool, str, str | None, float | None, None,
        int | None,
    ]  # fmt: skip
    #: Which pairs of a half list are to go.
    Cut = Callable[["Half"], Bools]

# Flags of the core.
_GHOST_ROWS, _GHOST_PAIRS, _ROWS_ONLY, _DIRECTED = 1, 2, 4, 8
_GATHER = RULES.index("gather")
_NOWHERE = np.empty((0, 1))


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

    def search(self, points: Any) -> Search:
        """The first arguments of the core. Its decisions are exact, whatever the settings are."""
        own = current()
        threads = own.threads if self.threads is None else self.threads
        box = self.box if self.bits else None
        return (
            points, np.inf, box, self.bits, True, "exact", own.kernel, own.memory_limit, None,
            threads,
        )  # fmt: skip

    def call(self, n: int) -> Search:
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

def built(lists: Sequence[NodeList], how: How, exclude: Any) -> Links:
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
    made = _core.pair_rows(*how.call(nodes.n), *rows, *nodes.lists(flags))
    (i_node, j_node, *shifts), (i_list, j_list) = made[1]
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
    lists = nodes.lists(how.flags | _ROWS_ONLY)
    return Rows.of(_core.connect(*how.call(nodes.n), i, j, shifts, *lists)[0])


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
        lists = nodes.lists(how.flags | _ROWS_ONLY)
        return Rows.of(_core.connect_search(*search, *lists, by)[0]), gathered
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

def removed(links: Links, which: Any) -> Links:
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

def patched(links: Links, keep: Any, old2new: Any) -> tuple[Links, list[Offsets]]:
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


def morton_keys(links: Links) -> npt.NDArray[np.uint64]:
    keys = np.empty(links.nodes.n, np.uint64)
    if len(keys):
        low, high = corners_of(links.points, links.how.morton_box)
        keys[links.nodes.number] = _core.morton_keys(links.points, low, high)
    return keys


# ---- what holds of it -------------------------------------------------------------------------

def check(links: Links) -> None:
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
