# SPDX-License-Identifier: BSD-3-Clause
"""Fewer nodes: the links of those that are kept, under their new numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_array
from halfshell._convert.options import as_list
from halfshell._convert.starts import starts_of
from halfshell._objects.node_links import (
    Gathered,
    Half,
    Links,
    are_listed,
    half_of,
    keep_pairs,
    keep_rows,
    link,
    row_starts,
    with_parts,
)
from halfshell._objects.nodes import Nodes, morton_number

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from halfshell._convert.types import FloatArray


def patched(
    links: Links, keep: Any, old2new: Any, morton_box: tuple[FloatArray, FloatArray] | None
) -> tuple[Links, list[npt.NDArray[np.int64]]]:
    """The links of the nodes that are kept, and which these are, by their new numbers.

    Rows and pairs whose order stays are copied without the nodes that go; rows of all nodes are
    sorted again where it does not, and the pairs made of them. Else they come from half lists.
    """
    kept = as_masks(keep, links.nodes)
    new = _as_numbers(old2new, kept, links.nodes)
    nodes, points, rank = _shrunk(links, kept, new, morton_box)
    order = [np.argsort(one, kind="stable")[(one < 0).sum() :] for one in new]
    left = rank[rank >= 0]
    stays_sorted = bool((left[1:] > left[:-1]).all())
    has_coupling = links.pairs._coupling is not None
    gathered = None if links.gathered is None else _regathered(links, rank, stays_sorted)
    if stays_sorted or (links.how.pairs_of_rows(links.nodes) and not has_coupling):
        target = np.concatenate([*new, np.empty(0, np.int64)]).astype(np.int32)
        made = _thinned(links, nodes, points, gathered, rank, target, order, stays_sorted)
    else:
        half, source = _renumbered(half_of(links), rank, nodes, has_coupling)
        before = _recut(links, rank, nodes)
        made = link(nodes, links.how, half, gathered, points, cut_before=before)
        if has_coupling:
            _carry_coupling(links, made, half, source)
    return made, order


def _thinned(
    links: Links, nodes: Nodes, points: FloatArray, gathered: Gathered | None,
    rank: npt.NDArray[np.int32], target: npt.NDArray[np.int32],
    order: list[npt.NDArray[np.int64]], stays_sorted: bool,
) -> Links:  # fmt: skip
    """The links of what stays of rows and pairs.

    rank: the new one of each old one; target: the new number in its list of each old number; both
    -1 for nodes that go. order: the old number in its list of each new one.
    """
    old, how = links.nodes, links.how
    place = None
    if not stays_sorted:
        place = np.empty_like(rank)
        place[old.numbers(np.arange(old.n))] = rank
    starts = row_starts(links)[:-1]
    counts = nodes.counts if how.ghost_rows else nodes.internal
    source = np.concatenate([
        *(start + own[:n] for start, own, n in zip(starts, order, counts, strict=True)),
        np.empty(0, np.int64),
    ]).astype(np.int64)  # fmt: skip
    rows = keep_rows(
        how, (links.offsets, links.indices, links.shifts), old.counts, target, place, source
    )
    pairs, intersection, coupling = None, None, links.pairs._coupling
    if stays_sorted and (
        how.intersection or coupling is not None or not how.pairs_of_rows(old)
    ):
        stays = _both_stay(links, target)
        pairs = keep_pairs(how, links.pairs, old.counts, target, None)
        coupling = None if coupling is None else coupling[stays]
        if links.intersection is not None:
            intersection = keep_rows(
                how, (*links.intersection, None), old.counts, target, None, np.flatnonzero(stays)
            )
    made = with_parts(
        nodes, how, rows, pairs, None, gathered, points, cut_before=_recut(links, rank, nodes),
        intersection=intersection,
    )  # fmt: skip
    if coupling is not None:
        made.pairs.coupling = coupling
    return made


def _both_stay(links: Links, target: npt.NDArray[np.int32]) -> npt.NDArray[np.bool_]:
    """Of each pair of the table whether both of its nodes stay."""
    pairs, first = links.pairs, links.nodes.first
    stays: npt.NDArray[np.bool_] = target >= 0
    if stays.all():
        return np.ones(len(pairs), np.bool_)
    of_first = stays[first[pairs.i_list] + pairs.i_node]
    found: npt.NDArray[np.bool_] = of_first & stays[first[pairs.j_list] + pairs.j_node]
    return found


def as_masks(keep: Any, nodes: Nodes) -> list[npt.NDArray[np.bool_]]:
    """A bool for each node of each list."""
    given = as_list(keep, "keep", "arrays, one for each list")
    if len(given) != nodes.n_lists:
        raise ValueError(
            f"keep must have an array for each of {nodes.n_lists} lists, got {len(given)}"
        )
    masks = []
    for name, count, values in zip(nodes.names, nodes.counts, given, strict=True):
        mask = as_array(values, "keep")
        if mask.shape != (count,):
            raise ValueError(f"keep must have shape ({count},) for {name!r}, got {mask.shape}")
        if mask.dtype.kind in "iu" and ((mask == 0) | (mask == 1)).all():
            mask = mask.astype(np.bool_)
        if mask.dtype.kind != "b" and mask.size:
            raise TypeError(f"keep must hold bools, got dtype {mask.dtype} for {name!r}")
        masks.append(mask.astype(np.bool_))
    return masks


def _as_numbers(
    old2new: Any, kept: Sequence[npt.NDArray[np.bool_]], nodes: Nodes
) -> list[npt.NDArray[np.int64]]:
    """The new number of each node in its list; of those that go, -1."""
    if old2new is None:
        return [np.where(mask, np.cumsum(mask) - 1, -1) for mask in kept]
    given = as_list(old2new, "old2new", "arrays, one for each list")
    if len(given) != nodes.n_lists:
        raise ValueError(
            f"old2new must have an array for each of {nodes.n_lists} lists, got {len(given)}"
        )
    found = []
    for name, mask, ghosts, values in zip(nodes.names, kept, nodes.ghosts, given, strict=True):
        array = as_array(values, "old2new")
        if array.shape != mask.shape:
            raise ValueError(
                f"old2new must have shape {mask.shape} for {name!r}, got {array.shape}"
            )
        if array.size and array.dtype.kind not in "iu":
            raise TypeError(f"old2new must hold whole numbers, got dtype {array.dtype}")
        numbers = np.where(mask, array, -1).astype(np.int64)
        own = numbers[mask]
        if (np.sort(own) != np.arange(len(own))).any():
            raise ValueError(
                f"old2new must give the {len(own)} nodes of {name!r} that are kept the numbers "
                f"from 0 to {len(own) - 1}, each once"
            )
        internal = len(mask) - ghosts
        if (numbers[:internal] >= mask[:internal].sum()).any():
            raise ValueError(f"old2new must keep the ghosts of {name!r} behind its other nodes")
        found.append(numbers)
    return found


def _shrunk(
    links: Links, kept: list[npt.NDArray[np.bool_]], new: list[npt.NDArray[np.int64]],
    morton_box: tuple[FloatArray, FloatArray] | None,
) -> tuple[Nodes, FloatArray, npt.NDArray[np.int32]]:  # fmt: skip
    """The nodes that are left, their points by rank, and the new rank, or -1, of each old one."""
    old = links.nodes
    counts = np.array([mask.sum() for mask in kept], np.int64)
    ghosts = np.array([
        mask[len(mask) - n :].sum() for mask, n in zip(kept, old.ghosts, strict=True)
    ], np.int64)  # fmt: skip
    first = starts_of(counts)
    number = np.concatenate([
        np.where(one >= 0, one + start, -1) for one, start in zip(new, first, strict=False)
    ] or [np.empty(0, np.int64)])  # fmt: skip
    stays = number >= 0
    ids = np.empty(int(stays.sum()), np.int64)
    ids[number[stays]] = old.global_ids()[stays]
    points = np.empty((len(ids), 1))
    order = None
    if links.points is not None:
        points = np.empty((len(ids), links.points.shape[1]))
        by_number = old.rank(np.arange(old.n))
        points[number[stays]] = links.points[by_number[stays]]
        if old.number is not None:
            order = morton_number(points, ids, morton_box)
            points = points[order]
    nodes = Nodes(old.names, counts, ghosts, ids, order)
    rank = np.where(stays, nodes.rank(np.maximum(number, 0)) if len(ids) else -1, -1)
    return nodes, points, rank[old.numbers(np.arange(old.n))].astype(np.int32)


def _renumbered(
    half: Half, rank: npt.NDArray[np.int32], nodes: Nodes, wants_source: bool
) -> tuple[Half, npt.NDArray[np.int64]]:
    """The half list of new ranks, and, if that is wanted, where each of its pairs was before."""
    i, j = rank[half.i], rank[half.j]
    stays = (i >= 0) & (j >= 0)
    source = np.flatnonzero(stays) if wants_source else np.empty(0, np.int64)
    i, j = i[stays], j[stays]
    shifts = None if half.shifts is None else half.shifts[stays]
    left = rank[rank >= 0]
    if (left[1:] > left[:-1]).all():  # the order is as before
        return Half(i, j, shifts), source
    turned = i > j
    if turned.any():
        i, j = np.where(turned, j, i), np.where(turned, i, j)
        shifts = None if shifts is None else np.where(turned[:, None], -shifts, shifts)
    keys = nodes.keys_of(i, j)
    if (keys[1:] < keys[:-1]).any() or (shifts is not None and turned.any()):
        by = (keys,) if shifts is None else (*shifts.T[::-1], keys)
        order = np.lexsort(by)
        i, j = i[order], j[order]
        source = source[order] if wants_source else source
        shifts = None if shifts is None else shifts[order]
    if shifts is not None:
        shifts = np.ascontiguousarray(shifts, np.int32)
    return Half(i, j, shifts), source


def _regathered(links: Links, rank: npt.NDArray[np.int32], stays_sorted: bool) -> Gathered:
    """What each node that stays reaches of the others, by new ranks."""
    assert links.gathered is not None
    stays = np.flatnonzero(rank >= 0)
    source = np.empty(len(stays), np.int64)
    source[rank[stays]] = stays
    rows = (links.gathered.offsets, links.gathered.indices, None)
    one = np.array([len(rank)])
    return Gathered(
        *keep_rows(links.how, rows, one, rank, None if stays_sorted else rank, source)
    )


def _recut(
    links: Links, rank: npt.NDArray[np.int32], nodes: Nodes
) -> npt.NDArray[np.int64] | None:
    """The keys, under new ranks, of what overlap was not to have."""
    if len(links.cut) == 0:
        return None
    i, j = (rank[one] for one in np.divmod(links.cut, max(links.nodes.n, 1)))
    stays = (i >= 0) & (j >= 0)
    return np.sort(nodes.keys_of(i[stays], j[stays]))


def _carry_coupling(
    links: Links, made: Links, half: Half, source: npt.NDArray[np.int64]
) -> None:
    """The coupling of each pair of the new table. Tables have the pairs of their half lists, but
    for those of two ghosts."""
    old_half = half_of(links)
    old_place = np.cumsum(are_listed(links, old_half)) - 1
    assert links.pairs._coupling is not None
    made.pairs.coupling = links.pairs._coupling[old_place[source[are_listed(made, half)]]]
