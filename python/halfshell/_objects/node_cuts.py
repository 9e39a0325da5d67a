# SPDX-License-Identifier: BSD-3-Clause
"""Pairs that are to go, as users give them: rows of numbers, a mask of the table, or a function."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_array
from halfshell._convert.foreign import kind_of
from halfshell._objects.node_links import is_one_of
from halfshell._objects.pair_table import as_pair_rows

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt

    from halfshell._objects.node_links import Cut
    from halfshell._objects.nodes import Nodes
    from halfshell._objects.pair_table import PairTable


def cut_of_exclude(exclude: Any, nodes: Nodes) -> Cut | None:
    """What `exclude` takes out."""
    if exclude is None:
        return None
    if callable(exclude):
        return cut_by_function(exclude, "exclude", nodes)
    return _by_rows(exclude, nodes)


def as_mask(which: Any, pairs: PairTable) -> npt.NDArray[np.bool_]:
    """Which pairs of the table `remove` takes out."""
    mask = as_array(which, "which")
    if mask.dtype.kind != "b":
        raise TypeError(f"which must hold bools, got dtype {mask.dtype}")
    if mask.shape != (len(pairs),):
        shape = f"({len(pairs)},), one for each pair"
        raise ValueError(f"which must have shape {shape}, got {mask.shape}")
    return np.array(mask)  # another thread may change the caller's


def cut_of_keys(keys: npt.NDArray[np.int64], nodes: Nodes) -> Cut:
    """The pairs with one of these keys, which ascend."""
    return lambda i, j: is_one_of(nodes.keys_of(i, j), keys)


def _by_rows(values: Any, nodes: Nodes) -> Cut:
    rows = as_pair_rows(values, "exclude")
    ranks = nodes.ranks_of(rows)
    if ranks is None:
        for row in rows:
            if nodes.ranks_of(row[None]) is None:
                raise ValueError(f"exclude names a node that does not exist: {row.tolist()}")
    assert ranks is not None
    for row in rows[ranks[0] == ranks[1]]:
        raise ValueError(f"exclude must name two nodes, got one with itself: {row.tolist()}")
    return cut_of_keys(np.unique(nodes.keys_of(*ranks)), nodes)


def cut_by_function(function: Callable[..., Any], name: str, nodes: Nodes) -> Cut:
    """The pairs for which a function of the numbers of their nodes is true."""
    number = nodes.number

    def cut(i: npt.NDArray[Any], j: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
        if number is None:  # as in the table: an internal node before a ghost
            turned = nodes.is_ghost(i) & ~nodes.is_ghost(j)
            i, j = np.where(turned, j, i), np.where(turned, i, j)
        i_node, i_list = nodes.labels(i)
        j_node, j_list = nodes.labels(j)
        mask = np.asarray(function(i_node, i_list, j_node, j_list))
        if mask.dtype.kind != "b" or mask.shape not in ((), i.shape):
            what = f"{mask.dtype} {mask.shape}" if mask.dtype.kind != "O" else kind_of(mask)
            raise ValueError(f"{name} must return a bool for each of {len(i)} pairs, got {what}")
        return np.broadcast_to(mask, i.shape)

    return cut
