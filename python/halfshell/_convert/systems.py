# SPDX-License-Identifier: BSD-3-Clause
"""A batch, one system after the other, for what the core finds in one system at a time."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from halfshell._convert.call import Call
from halfshell._convert.points import Points, setattr_


def each_system(call: Call) -> Iterator[tuple[Call, int]]:
    """A call for each system, and the number of its first point among all."""
    points, queries = call.points, call.queries
    assert points.batch is not None
    bounds = np.searchsorted(points.batch, np.arange(points.n_systems + 1)).tolist()
    asked = None
    if queries is not None and queries.batch is not None:
        asked = np.searchsorted(queries.batch, np.arange(points.n_systems + 1)).tolist()
    for s, (first, end) in enumerate(pairwise(bounds)):
        one = Call()
        for name in Call.__slots__:
            setattr(one, name, getattr(call, name))
        one.points = _part(points, s, slice(first, end))
        own_queries = slice(0, 0)
        if queries is not None and asked is not None:
            own_queries = slice(asked[s], asked[s + 1])
            one.queries = _part(queries, s, own_queries)
        if call.system_cutoffs is not None:
            one.cutoff, one.system_cutoffs = float(call.system_cutoffs[s]), None
        one.reach = _cut(call.reach, slice(first, end), own_queries, (1, 3, 6))
        if call.selection is not None:
            one.selection = _cut(call.selection, slice(first, end), own_queries, (0, 2))
            one.selection = _own_pairs(one.selection, first, end, own_queries, queries is not None)
        yield one, first


def _part(points: Points, s: int, places: slice) -> Points:
    """The points of one system, which share memory with all."""
    part = Points.__new__(Points)
    for name in Points.__slots__:
        value = getattr(points, name)
        if name == "batch":
            value = None
        elif name == "_box":
            value = value[s] if value is not None and value.ndim == 3 else value
        elif name == "_axes":
            value = int(value[s]) if isinstance(value, np.ndarray) else value
        elif name != "tells_periodic" and value is not None:
            value = value[places]
        setattr_(part, name, value)
    return part


def _cut(fields: Any, own: slice, asking: slice, places: tuple[int, ...]) -> Any:
    """Columns of points at these places, each with those of queries behind it, of one system."""
    if fields is None:
        return None
    cut = list(fields)
    for place in places:
        for k, where in ((place, own), (place + 1, asking)):
            cut[k] = None if cut[k] is None else np.ascontiguousarray(cut[k][where])
    return tuple(cut)


def _own_pairs(selection: Any, first: int, end: int, asking: slice, has_queries: bool) -> Any:
    """The excluded pairs of one system, with its own numbers."""
    excluded = selection[6]
    if excluded is None:
        return selection
    low, high = (asking.start, asking.stop) if has_queries else (first, end)
    i, j = excluded.T
    mine = excluded[(i >= low) & (i < high) & (j >= first) & (j < end)]
    return (*selection[:6], np.ascontiguousarray(mine - [low, first]), selection[7])
