# SPDX-License-Identifier: BSD-3-Clause
"""What holds of a connectivity, checked in time by the number of its pairs and entries."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from halfshell._objects.node_links import Half, half_of, is_one_of, link, link_rows, rank_rows

if TYPE_CHECKING:
    from typing import Any

    import numpy.typing as npt

    from halfshell._objects.node_links import Links


def check(links: Links) -> None:
    """ValueError with the first rule that is broken.

    Rows and pairs are made again out of the half list that they tell, which the core takes only if
    it is one: so all is ascending, each pair once, and rows mirror each other.
    """
    nodes = links.nodes
    n_rows = nodes.n if links.how.ghost_rows else int(nodes.internal.sum())
    _check_rows("rows", links.offsets, links.indices, n_rows * nodes.n_lists, links)
    plain = replace(
        links.how, overlap=False, intersection=False, ghost_rows_too=links.how.ghost_rows
    )
    half = half_of(links)
    made = _as_pairs(lambda: link(nodes, plain, half, None, _points(links)))
    for name, one, other in (
        ("offsets of rows", links.offsets, made.offsets),
        ("rows", links.indices, made.indices),
        ("shifts of rows", links.shifts, made.shifts),
        *(
            (f"{name} of pairs", getattr(links.pairs, name), getattr(made.pairs, name))
            for name in ("i_node", "i_list", "j_node", "j_list", "_shifts")
        ),
    ):
        _check_same(name, one, other)
    if links.overlap is not None:
        _check_overlap(links, half)
    if links.intersection is not None:
        _check_intersection(links)
    if nodes.number is not None and (np.sort(nodes.number) != np.arange(nodes.n)).any():
        raise ValueError("the traversal does not have each node once")


def _check_overlap(links: Links, half: Half) -> None:
    """Overlap is symmetric, ascending, and has all neighbours."""
    assert links.overlap is not None
    nodes = links.nodes
    _check_rows("overlap", *links.overlap, nodes.n * nodes.n_lists, links)
    owner, other = rank_rows(links, *links.overlap)
    once = owner < other
    i, j = owner[once].astype(np.int32), other[once].astype(np.int32)
    order = np.argsort(nodes.keys_of(i, j), kind="stable")
    apart = Half(i[order], j[order], None)
    again = _as_pairs(lambda: link_rows(nodes, links.how, apart, _points(links)))
    for one, other_rows in zip(links.overlap, again, strict=True):
        _check_same("overlap", one, other_rows)
    keys = nodes.keys_of(apart.i, apart.j)
    if not is_one_of(nodes.keys_of(half.i, half.j), keys).all():
        raise ValueError("overlap lacks neighbours")


def _check_intersection(links: Links) -> None:
    """That of each pair ends with its two nodes."""
    assert links.intersection is not None
    pairs, n_lists = links.pairs, links.nodes.n_lists
    offsets, indices = links.intersection
    _check_rows("intersections", offsets, indices, len(pairs) * n_lists, links)
    first = np.arange(len(pairs)) * n_lists
    same = pairs.i_list == pairs.j_list
    ends = offsets[first + pairs.i_list + 1] - 1 - same, offsets[first + pairs.j_list + 1] - 1
    for end, node in zip(ends, (pairs.i_node, pairs.j_node), strict=True):
        if len(end) and ((end < 0).any() or (indices[end] != node).any()):
            raise ValueError("intersections do not end with the nodes of their pairs")


def _as_pairs(make: Any) -> Any:
    try:
        return make()
    except ValueError as error:
        raise ValueError(f"pairs are not each there once, in their order: {error}") from error


def _points(links: Links) -> npt.NDArray[Any]:
    return np.empty((links.nodes.n, 1)) if links.points is None else links.points


def _check_rows(
    name: str, offsets: npt.NDArray[Any], indices: npt.NDArray[Any], n: int, links: Links
) -> None:
    if len(offsets) != n + 1 or offsets[0] != 0 or offsets[-1] != len(indices):
        raise ValueError(f"{name} have {len(offsets) - 1} entries, not {n}")
    if (offsets[1:] < offsets[:-1]).any():
        raise ValueError(f"offsets of {name} descend")
    lengths = np.diff(offsets)
    of_list = np.resize(links.nodes.counts, len(lengths))
    if ((indices < 0) | (indices >= np.repeat(of_list, lengths))).any():
        raise ValueError(f"{name} name nodes that do not exist")


def _check_same(name: str, one: Any, other: Any) -> None:
    if (one is None) != (other is None) or (one is not None and not np.array_equal(one, other)):
        raise ValueError(f"{name} are not what the pairs say")
