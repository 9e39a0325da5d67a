# SPDX-License-Identifier: BSD-3-Clause
"""Frames of a trajectory: arrays, pairs of points and box, objects of other libraries."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from halfshell._convert.arrays import as_array
from halfshell._convert.foreign import attribute, is_a, kind_of
from halfshell._convert.objects import MISSING, parts_of
from halfshell._convert.points import Points


def frames_of(frames: Any) -> tuple[Iterator[Any], int | None]:
    """The frames one by one, and how many there are, if that is known."""
    kind = kind_of(frames)
    if is_a(frames, (str, bytes)) or type(frames) is Points:
        raise TypeError(f"frames must be a sequence of frames, got {kind}")
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
