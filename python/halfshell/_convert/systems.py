# SPDX-License-Identifier: BSD-3-Clause
"""Several systems, one after the other: those of a batch, and the frames of a trajectory."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from itertools import pairwise
from typing import Any

import numpy as np

from halfshell._convert.arrays import as_array
from halfshell._convert.call import Call
from halfshell._convert.foreign import attribute, is_a, kind_of
from halfshell._convert.lengths import check_lengths
from halfshell._convert.objects import MISSING, parts_of
from halfshell._convert.points import Points, setattr_


def each_system(call: Call) -> Iterator[tuple[Call, int]]:
    """A call for each system that has points, and the number of its first point among all."""
    points, queries = call.points, call.queries
    assert points.batch is not None
    if call.system_cutoffs is not None:
        check_lengths(call.system_cutoffs, "cutoff")
    numbers, bounds = np.unique(points.batch, return_index=True)
    asked = None
    if queries is not None and queries.batch is not None:
        asked = [np.searchsorted(queries.batch, numbers, side) for side in ("left", "right")]
    firsts = [*bounds.tolist(), len(points)]
    for k, (s, (first, end)) in enumerate(zip(numbers.tolist(), pairwise(firsts), strict=True)):
        one = copy(call)
        one.points = _part(points, s, slice(first, end))
        own_queries = slice(0, 0)
        if queries is not None and asked is not None:
            own_queries = slice(int(asked[0][k]), int(asked[1][k]))
            one.queries = _part(queries, s, own_queries)
        if call.system_cutoffs is not None:
            one.cutoff, one.system_cutoffs = float(call.system_cutoffs[s]), None
        own = slice(first, end)
        one.known = call.known.some(own)
        one.known_of_queries = call.known_of_queries.some(own_queries)
        pairing = call.pairing
        if pairing is not None and pairing.excluded is not None:
            asking = own if queries is None else own_queries
            i, j = pairing.excluded.T
            mine = (asking.start <= i) & (i < asking.stop) & (first <= j) & (j < end)
            own_pairs = pairing.excluded[mine] - [asking.start, first]
            one.pairing = pairing._replace(excluded=np.ascontiguousarray(own_pairs))
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


# ---- frames ----------------------------------------------------------------------------------

_BY_COLUMN = "frames by a column are (part for _, part in table.groupby(column))"


def frames_of(frames: Any) -> tuple[Iterator[Any], int | None]:
    """The frames one by one, and how many there are, if that is known."""
    kind = kind_of(frames)
    if is_a(frames, (str, bytes)) or type(frames) is Points:
        raise TypeError(f"frames must be a sequence of frames, got {kind}")
    if attribute(frames, "columns", "frames", MISSING) is not MISSING:  # rows, or groups of them
        raise TypeError(f"frames must be a sequence of frames, got {kind}: {_BY_COLUMN}")
    places = attribute(frames, "xyz", "frames", MISSING)
    vectors = attribute(frames, "unitcell_vectors", "frames", MISSING)
    if places is not MISSING and vectors is not MISSING:  # a Trajectory of mdtraj
        boxes = [None] * len(places) if vectors is None else vectors
        return iter(zip(places, boxes, strict=True)), len(places)
    try:
        iterator = iter(as_array(frames, "frames") if is_a(frames, memoryview) else frames)
    except MemoryError:
        raise
    except Exception as error:
        own = attribute(frames, "trajectory", "frames", MISSING) is not MISSING
        hint = ": pass its trajectory" if own else ""
        raise TypeError(
            f"frames must be a sequence or iterator of frames, got {kind}{hint}"
        ) from error
    try:
        return iterator, len(frames)
    except Exception:  # iterators have none, and objects may raise anything
        return iterator, None


def as_frame(frame: Any, box: Any, periodic: Any) -> Points:
    """The points of one of them. `box` and `periodic` are for those that bring none.

    ValueError if one brings its own, and is given another.
    """
    if is_a(frame, tuple) and tuple.__len__(frame) == 2:
        points, own = tuple.__iter__(frame)
        if attribute(own, "columns", "frames", MISSING) is not MISSING:
            raise TypeError(f"frames must be points, got a tuple of a {kind_of(own)}: {_BY_COLUMN}")
        if own is not None and box is not None:
            raise ValueError("box is given twice: frames bring their own")
        return Points._of(points, "frames", box if own is None else own, periodic)
    if type(frame) is Points:
        if frame.box is not None:
            return Points._of(frame, "frames", box, periodic)
        return frame if box is None else frame.replace(box=box, periodic=periodic)
    parts = parts_of(frame, "frames")
    if parts is not None and parts.box is None and parts.periodic is None:
        return Points._of(frame, "frames", box, None if box is None else periodic)
    if parts is not None and parts.periodic is None and box is None:
        return Points._of(frame, "frames", None, periodic)
    return Points._of(frame, "frames", box, periodic)


def of_frame(error: BaseException, number: int) -> None:
    """Say with an exception which frame it is about."""
    error.add_note(f"in frame {number} of trajectory_pairs")
