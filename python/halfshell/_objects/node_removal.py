# SPDX-License-Identifier: BSD-3-Clause
"""Fewer pairs: the links without those that are to go."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._objects.node_cuts import as_mask, cut_by_function, cut_of_keys
from halfshell._objects.node_links import (
    are_listed,
    half_of,
    half_of_pairs,
    keep_pairs,
    with_parts,
    without,
)
from halfshell._objects.pair_table import Columns

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._objects.node_links import Links


def removed(links: Links, which: Any) -> Links:
    """The links without what a mask of the table, or a function, takes out."""
    how, nodes, points = links.how, links.nodes, links.points
    half = None
    if callable(which):
        before = half_of(links)
        cut = cut_by_function(which, "which", nodes)
        mask = cut(before.i, before.j)
        of_table = mask[are_listed(links, before)]
        gone, half = before.keep(mask), before.keep(~mask)
    else:
        of_table = as_mask(which, links.pairs)
        gone = half_of_pairs(nodes, _some(links.pairs._all(), of_table))
        cut = cut_of_keys(nodes.keys_of(gone.i, gone.j), nodes)
    rows, gathered = without(links, gone)
    pairs = None
    if not how.pairs_of_rows(nodes):
        pairs = keep_pairs(how, links.pairs, None, None, ~of_table)
    made = with_parts(
        nodes, how, rows, pairs, half, gathered,
        np.empty((nodes.n, 1)) if points is None else points, cut, links.cut,
    )  # fmt: skip
    if links.pairs._coupling is not None:
        made.pairs.coupling = links.pairs._coupling[~of_table]
    return made


def _some(pairs: Columns, mask: npt.NDArray[np.bool_]) -> Columns:
    which = np.flatnonzero(mask)
    i_node, i_list, j_node, j_list, shifts = pairs
    return Columns(
        i_node[which], i_list[which], j_node[which], j_list[which],
        None if shifts is None else shifts[which],
    )  # fmt: skip
