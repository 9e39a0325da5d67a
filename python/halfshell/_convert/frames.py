# SPDX-License-Identifier: BSD-3-Clause
"""Frames of a trajectory: arrays, pairs of points and box, objects of other libraries.

None of these libraries is imported: an object is what its attributes say.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from halfshell._convert.arrays import as_array
from halfshell._convert.foreign import attribute, is_a, kind_of
from halfshell._convert.foreign_box import without_placeholder
from halfshell._convert.scene import brings_its_box

_MISSING = object()


class Frame(NamedTuple):
    """Points of one frame, and the box and periodicity to search them with."""

    points: Any
    box: Any
    periodic: Any


def frames_of(frames: Any) -> tuple[Iterator[Any], int | None]:
    """The frames one by one, and how many there are, if that is known."""
    kind = kind_of(frames)
    if is_a(frames, (str, bytes)):
        raise TypeError(f"frames must be a sequence of frames, got {kind}")
    whole = _of_mdtraj(frames)
    if whole is not None:
        return iter(zip(*whole)), len(whole[0])
    try:
        iterator = iter(as_array(frames, "frames") if is_a(frames, memoryview) else frames)
    except MemoryError:
        raise
    except Exception as error:
        own = attribute(frames, "trajectory", "frames", _MISSING) is not _MISSING
        hint = ": pass its trajectory" if own else ""
        raise TypeError(
            f"frames must be a sequence or iterator of frames, got {kind}{hint}"
        ) from error
    try:
        return iterator, len(frames)
    except Exception:  # iterators have none, and objects may raise anything
        return iterator, None


def as_frame(frame: Any, box: Any, periodic: Any) -> Frame:
    """One of them. `box` and `periodic` are for those that bring none.

    ValueError if one brings its own, and is given another.
    """
    if is_a(frame, tuple) and tuple.__len__(frame) == 2:
        points, own = tuple.__iter__(frame)
        return _with(points, own, box, periodic, "frames")
    if brings_its_box(frame, "frames"):
        return Frame(frame, box, periodic)
    one = _of_mdtraj(frame)
    if one is not None:
        if len(one[0]) != 1:
            raise ValueError(f"a {kind_of(frame)} in frames must be one frame, got {len(one[0])}")
        own = without_placeholder(one[1][0], "frames")
        return _with(one[0][0], own, box, periodic, kind_of(frame))
    vectors = attribute(frame, "triclinic_dimensions", "frames", _MISSING)
    if vectors is not _MISSING:
        points = attribute(frame, "positions", "frames")
        own = without_placeholder(vectors, "frames")
        return _with(points, own, box, periodic, kind_of(frame))
    return Frame(frame, box, periodic)


def _of_mdtraj(values: Any) -> tuple[Any, Any] | None:
    """Points and boxes of all frames, if it is like a Trajectory of mdtraj."""
    points = attribute(values, "xyz", "frames", _MISSING)
    vectors = attribute(values, "unitcell_vectors", "frames", _MISSING)
    if points is _MISSING or vectors is _MISSING:
        return None
    return points, [None] * len(points) if vectors is None else vectors


def _with(points: Any, own: Any, box: Any, periodic: Any, whose: str) -> Frame:
    if own is not None and box is not None:
        raise ValueError(f"box is given twice: {whose} bring their own")
    return Frame(points, box if own is None else own, periodic)


def of_frame(error: BaseException, number: int) -> None:
    """Say with an exception which frame it is about."""
    error.add_note(f"in frame {number} of trajectory_pairs")

