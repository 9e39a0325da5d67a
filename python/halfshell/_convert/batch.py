# SPDX-License-Identifier: BSD-3-Clause
"""Batches: what users pass for many systems, brought to the forms that the core takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_array, as_real_array, in_order
from halfshell._convert.foreign import is_a
from halfshell._convert.given import Chosen, Given, Sets
from halfshell._convert.memory import refuse_large
from halfshell._convert.scene import as_points, as_scene, brings_its_box, vectors_of

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import FloatArray, PointArray, Reach

    # What all systems share: points; the cutoff of all, or 0; the box of all, or any of the right
    # shape; periodic bits.
    Scene = tuple[PointArray, float, FloatArray | None, int]

    # What each system has of its own: numbers, one a point; cutoffs and boxes, one a system.
    Systems = tuple[npt.NDArray[np.int64], FloatArray | None, FloatArray | None]


def as_numbers(values: Any, n: int) -> npt.NDArray[np.int64]:
    """System numbers as int64; whether they ascend is checked in the core."""
    array = as_array(values, "batch", "hold integers")
    if array.shape != (n,):
        raise ValueError(f"batch must have shape ({n},), one number a point, got {array.shape}")
    if array.dtype.kind not in "iu" and n > 0:
        raise TypeError(f"batch must hold integers, got dtype {array.dtype}")
    if array.dtype == np.uint64:
        for k in np.flatnonzero(array >= np.uint64(2**62)):
            raise ValueError(f"batch must be less than 2**62, got batch[{k}] = {array[k]}")
    return in_order(array, np.int64)


def _as_boxes(array: npt.NDArray[Any], ndim: int) -> FloatArray:
    if array.shape[1:] != (ndim, ndim):
        raise ValueError(
            f"box must have shape ({ndim},) or ({ndim}, {ndim}), or one a system "
            f"(s, {ndim}, {ndim}), for points in {ndim} dimensions, got {array.shape}"
        )
    refuse_large(8 * array.size, array, "box")
    return in_order(array, np.float64)


def _check_box(shape: tuple[int, ...]) -> None:
    if len(shape) == 2 and shape[0] != shape[1]:
        raise ValueError(
            f"box must have shape (d,) or (d, d), or one a system (s, d, d), got {shape}"
        )


def _scene(
    points: Any, box: Any, periodic: Any
) -> tuple[PointArray, FloatArray | None, int, FloatArray | None]:
    """As `scene` of one system, and boxes of each system."""
    if box is not None:
        array = as_real_array(vectors_of(box), "box", check_shape=_check_box)
        if array.ndim == 3:
            rows = np.eye(3)
            if not brings_its_box(points):
                points = as_points(points)
                rows = np.eye(points.shape[1])
            # Any box will do for the axes that repeat; objects with a box of their own refuse it.
            points, box, bits = as_scene(points, rows, periodic)
            return points, box, bits, _as_boxes(array, points.shape[1])
        if array.ndim and type(box) in (np.ndarray, list, tuple):  # others may say more
            box = array
    points, box, bits = as_scene(points, box, periodic)
    return points, box, bits, None


def _as_cutoffs(value: Any) -> tuple[float, FloatArray | None]:
    """One cutoff, or one a system."""
    if is_a(value, float):
        return float.__float__(value), None

    def check(shape: tuple[int, ...]) -> None:
        if len(shape) > 1:
            raise ValueError(
                f"cutoff must be a number or, one a system, have shape (s,), got {shape}"
            )

    array = as_real_array(value, "cutoff", "be a number", check)
    if array.ndim == 0:
        return float(array), None
    refuse_large(8 * array.size, array, "cutoff")
    return 0.0, in_order(array, np.float64)


def _as_limits(
    cutoff: Any, given: Given, points: Any, n: int, ndim: int
) -> tuple[float, FloatArray | None, Reach | None]:
    """The cutoff of all systems, or one a system; and the reach of each pair, or None."""
    if given.is_nothing and not is_a(cutoff, Mapping):
        return *_as_cutoffs(cutoff), None
    from halfshell._convert.reach import as_reach  # here: plain searches do without

    sets = Sets(points, None, n, None, ndim)
    has_own = given.radii is not None or given.supports is not None or given.extent is not None
    if cutoff is None or not has_own:
        largest, reach = as_reach(cutoff, given, sets, directed=False)
        return largest, None, reach
    one, cutoffs = _as_cutoffs(cutoff)
    largest, reach = as_reach(one if cutoffs is None else None, given, sets, directed=False)
    return largest, cutoffs, reach


def as_systems(
    points: Any,
    cutoff: Any,
    box: Any,
    periodic: Any,
    batch: Any,
    given: Given,
    chosen: Chosen | None = None,
    precision: Any = "exact",
) -> tuple[Scene, Systems, Reach | None]:
    """Everything that makes up the systems, in the order of the core's arguments."""
    array, vectors, bits, boxes = _scene(points, box, periodic)
    numbers = as_numbers(batch, array.shape[0])
    one, cutoffs, reach = _as_limits(cutoff, given, points, *array.shape)
    if boxes is not None and cutoffs is not None and len(boxes) != len(cutoffs):
        raise ValueError(
            "box and cutoff must be given for the same number of systems, got "
            f"{len(boxes)} and {len(cutoffs)}"
        )
    if chosen is not None and not chosen.is_nothing:
        from halfshell._convert.selection import with_selection  # here: others do without

        reach = with_selection(reach, chosen, len(array), None, precision)
    return (array, one, vectors, bits), (numbers, cutoffs, boxes), reach
