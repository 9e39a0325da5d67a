# SPDX-License-Identifier: BSD-3-Clause
"""Batches: what users pass for many systems, brought to the forms that the core takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_array, as_real_array, in_order
from halfshell._convert.foreign import is_a
from halfshell._convert.given import Chosen, Given, Sets
from halfshell._convert.memory import refuse_large, refuse_unavailable
from halfshell._convert.scene import (
    as_points,
    as_queries,
    as_scene,
    brings_its_box,
    vectors_of,
)
from halfshell._errors import shorten

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import FloatArray, PointArray, Reach, Systems

    # What all systems share: points; the cutoff of all, or 0; the box of all, or any of the right
    # shape; periodic bits.
    Scene = tuple[PointArray, float, FloatArray | None, int]

_MANY_SYSTEMS = 1 << 20  # counts of fewer always fit


def as_numbers(
    values: Any, n: int, name: str = "batch", of_each: str = "point"
) -> npt.NDArray[np.int64]:
    """System numbers as int64; whether they ascend is checked in the core."""
    array = as_array(values, name, "hold integers")
    if array.shape != (n,):
        raise ValueError(
            f"{name} must have shape ({n},), one number for each {of_each}, got {array.shape}"
        )
    if array.dtype.kind not in "iu" and n > 0:
        raise TypeError(f"{name} must hold integers, got dtype {array.dtype}")
    array = array.copy()  # it may change meanwhile
    if array.dtype == np.uint64:
        for k in np.flatnonzero(array >= np.uint64(2**62)):
            raise ValueError(f"{name} must be less than 2**62, got {name}[{k}] = {array[k]}")
    return in_order(array, np.int64)


def _as_boxes(array: npt.NDArray[Any], ndim: int) -> FloatArray:
    if array.shape[1:] != (ndim, ndim):
        raise ValueError(
            f"box must have shape ({ndim},) or ({ndim}, {ndim}), or one for each system "
            f"(s, {ndim}, {ndim}), for points in {ndim} dimensions, got {array.shape}"
        )
    refuse_large(8 * array.size, array, "box")
    return in_order(array, np.float64)


def _check_box(shape: tuple[int, ...]) -> None:
    if len(shape) == 2 and shape[0] != shape[1]:
        raise ValueError(
            f"box must have shape (d,) or (d, d), or one for each system (s, d, d), got {shape}"
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


def _as_repeats(periodic: Any) -> npt.NDArray[Any] | None:
    """What is given for each system, (s, d), or None for what holds for all of them."""
    if periodic is None or is_a(periodic, (bool, str, bytes)):
        return None
    array = as_array(periodic, "periodic")
    return array if array.ndim == 2 else None


def _as_axes(
    repeats: npt.NDArray[Any], ndim: int, has_box: bool, own: FloatArray | None
) -> npt.NDArray[np.uint8]:
    """Bits of the axes that repeat in each system. own: something else that each has, or None."""
    if not has_box:
        raise ValueError("periodic needs a box: give box, or leave periodic out")
    if repeats.shape[1] != ndim:
        raise ValueError(
            f"periodic must be a bool, {ndim} bools, or these for each system, (s, {ndim}), "
            f"got shape {repeats.shape}"
        )
    if repeats.dtype.kind != "b" and not (
        repeats.dtype.kind in "iu" and bool(((repeats == 0) | (repeats == 1)).all())
    ):
        raise TypeError(f"periodic must hold bools, got dtype {repeats.dtype}")
    if own is not None and len(own) != len(repeats):
        raise ValueError(
            "periodic and box or cutoff must be given for the same number of systems, got "
            f"{len(repeats)} and {len(own)}"
        )
    bits: npt.NDArray[np.uint8] = (repeats != 0) @ (1 << np.arange(ndim)).astype(np.uint8)
    return np.ascontiguousarray(bits.astype(np.uint8))


def _as_cutoffs(value: Any) -> tuple[float, FloatArray | None]:
    """One cutoff, or one a system."""
    if is_a(value, float):
        return float.__float__(value), None

    def check(shape: tuple[int, ...]) -> None:
        if len(shape) > 1:
            raise ValueError(
                f"cutoff must be a number or have shape (s,), one for each system, got {shape}"
            )

    array = as_real_array(value, "cutoff", "be a number", check)
    if array.ndim == 0:
        return float(array), None
    refuse_large(8 * array.size, array, "cutoff")
    return 0.0, in_order(array, np.float64)


def _as_limits(
    cutoff: Any, given: Given, sets: Sets, directed: bool
) -> tuple[float, FloatArray | None, Reach | None]:
    """The cutoff of all systems, or one a system; and the reach of each pair, or None."""
    if given.is_nothing and not is_a(cutoff, Mapping):
        return *_as_cutoffs(cutoff), None
    from halfshell._convert.reach import as_reach  # here: plain searches do without

    of_types = given.types is not None or given.query_types is not None
    if cutoff is None or of_types or is_a(cutoff, Mapping):
        largest, reach = as_reach(cutoff, given, sets, directed)
        return largest, None, reach
    one, cutoffs = _as_cutoffs(cutoff)
    largest, reach = as_reach(one if cutoffs is None else None, given, sets, directed)
    return largest, cutoffs, reach


def _as_queries(
    queries: Any, numbers: Any, points: PointArray
) -> tuple[PointArray | None, npt.NDArray[np.int64] | None]:
    """Queries, and the system of each."""
    if (queries is None) != (numbers is None):
        raise ValueError("with batch, queries and query_batch must be given together")
    if queries is None:
        return None, None
    array, own = as_queries(queries, ndim=points.shape[1])
    if own is not None:
        raise ValueError("with batch, queries must be an array: box is that of the points")
    if array.shape[1] != points.shape[1]:
        raise ValueError(
            "queries and points must have the same number of columns, got shapes "
            f"{array.shape} and {points.shape}"
        )
    return array, as_numbers(numbers, len(array), "query_batch", "query")


def as_systems(
    points: Any,
    cutoff: Any,
    box: Any,
    periodic: Any,
    batch: Any,
    given: Given,
    chosen: Chosen | None = None,
    precision: Any = "exact",
    queries: Any = None,
    query_batch: Any = None,
    directed: bool = False,
) -> tuple[Scene, Systems, Reach | None, PointArray | None]:
    """Everything that makes up the systems, as the core takes it, and the queries or None.

    directed: the result has a direction, so that rules may have one.
    """
    try:
        repeats = _as_repeats(periodic)
        array, vectors, bits, boxes = _scene(points, box, periodic if repeats is None else None)
        numbers = as_numbers(batch, array.shape[0])
        asking, of_queries = _as_queries(queries, query_batch, array)
        n, q = len(array), None if asking is None else len(asking)
        sets = Sets(points, queries, n, q, array.shape[1])
        one, cutoffs, reach = _as_limits(cutoff, given, sets, directed)
        if boxes is not None and cutoffs is not None and len(boxes) != len(cutoffs):
            raise ValueError(
                "box and cutoff must be given for the same number of systems, got "
                f"{len(boxes)} and {len(cutoffs)}"
            )
        axes = None
        if repeats is not None:
            of_each = cutoffs if boxes is None else boxes
            axes = _as_axes(repeats, array.shape[1], vectors is not None, of_each)
        if chosen is not None and not chosen.is_nothing:
            from halfshell._convert.selection import with_selection  # here: others do without

            reach = with_selection(reach, chosen, n, q, precision)
        own = (numbers, cutoffs, boxes, of_queries, axes)
        return (array, one, vectors, bits), own, reach, asking
    except Exception as error:
        shorten(error)
        raise


def check_no_batch(query_batch: Any) -> None:
    """ValueError for systems of queries alone."""
    if query_batch is not None:
        raise ValueError("query_batch needs batch")


def refuse_indices(indices: Any) -> None:
    """ValueError for rows of some points, which are found in one system."""
    if indices is not None:
        raise ValueError("indices cannot be combined with batch")


def refuse_many(own: Systems) -> None:
    """MemoryError before results of more systems than memory holds; the core checks all else."""
    numbers, cutoffs, boxes, _, axes = own
    if not (cutoffs is None and boxes is None and axes is None) or len(numbers) == 0:
        return
    last = int(numbers[-1])
    if _MANY_SYSTEMS < last < 2**62 and bool((numbers[1:] >= numbers[:-1]).all()):
        refuse_unavailable(8 * (last + 1), f"counts of the systems up to {last} in batch")
