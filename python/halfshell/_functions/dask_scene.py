# SPDX-License-Identifier: BSD-3-Clause
"""Points of dask as parts for a search, and what parts found as dask arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from halfshell._convert.foreign import kind_of
from halfshell._convert.options import as_brick_count
from halfshell._convert.scene import MAX_DIM, as_own_box
from halfshell._extras import needs
from halfshell._functions import brick_tasks
from halfshell._functions.brick_pieces import part_of as make_part
from halfshell._functions.brick_plan import divide
from halfshell._functions.counts import count_pairs

try:
    import dask
    import dask.array as da
    from dask.delayed import Delayed  # which has every attribute
except ModuleNotFoundError as error:
    if error.name not in ("dask", "dask.array"):
        raise
    raise ImportError(
        f"{needs('halfshell.dask', 'dask[array]')} (the extra halfshell[distributed])"
    ) from None

__all__ = ["columns", "da", "dask", "divided", "joined", "options_of"]

_TYPES = {"i": np.int64, "j": np.int64, "P": np.int64, "S": np.int32, "d": np.float64,
          "D": np.float64}  # fmt: skip


class Scene(NamedTuple):
    """Parts of a division that is to come, and what is known of the points before."""

    parts: Sequence[Any]  # each a delayed `Part`
    division: Any  # a delayed `Division`
    n_points: float  # NaN if not known
    ndim: int
    box: dict[str, Any]

    def each(self, task: Callable[..., Any], *arguments: Any) -> list[Any]:
        """What a task finds in each part."""
        do = dask.delayed(task, pure=True)
        return [do(part, *arguments) for part in self.parts]

    def in_ranges(self, found: list[Any]) -> list[Any]:
        """What parts found, in as many ranges of ascending points."""
        n = len(self.parts)
        do = dask.delayed(brick_tasks.cut, pure=True)
        cuts = [do(groups, self.division, n) for groups in found]
        merged = dask.delayed(brick_tasks.merged, pure=True)
        return [merged(*[one[k] for one in cuts]) for k in range(n)]


def divided(
    points: Any, cutoff: float, n: Any, box: Any, periodic: Any, kernel: str | None = None
) -> Scene:
    """Parts of points, and all that can be refused before anything is read."""
    chunks, n_points, ndim, dtype = _chunks(points)
    n_bricks = max(1, len(chunks)) if n is None else as_brick_count(n)
    vectors, bits = as_own_box(box, periodic, ndim)
    scene: dict[str, Any] = {"box": vectors, "periodic": None}
    if vectors is not None:
        scene["periodic"] = [bool(bits >> k & 1) for k in range(ndim)]
    count_pairs(np.empty((0, ndim)), cutoff, kernel=kernel, **scene)
    flags = tuple(scene["periodic"] or [False] * ndim)
    tasks = (brick_tasks.summary_of, divide, brick_tasks.pieces_of, make_part)
    summary_of, divide_by, pieces_of, part_of = (dask.delayed(one, pure=True) for one in tasks)
    each = [(chunk, ndim, dtype, place) for place, chunk in enumerate(chunks)]
    summaries = [summary_of(*one, len(each)) for one in each]
    division = divide_by(cutoff, n_bricks, vectors, flags, *summaries)
    pieces = [pieces_of(*one, division) for one in each]
    parts = [part_of(division, *[piece[k] for piece in pieces]) for k in range(n_bricks)]
    return Scene(parts, division, n_points, ndim, scene)


def options_of(
    inclusive: bool, kernel: str | None, threads: int | None, memory_limit: float | None
) -> dict[str, Any]:
    """Options of a search, after a search of no points with them."""
    options: dict[str, Any] = {
        "inclusive": inclusive, "kernel": kernel, "threads": threads, "memory_limit": memory_limit,
    }  # fmt: skip
    count_pairs(np.empty((0, 1)), 0.0, **options)
    return options


def joined(
    found: Sequence[Any], group: int, place: int, shape: tuple[float, ...], dtype: Any
) -> Any:
    """One array of what parts found, with a chunk for each."""
    blocks = [da.from_delayed(one[group][place], shape, dtype) for one in found]
    return da.concatenate(blocks, allow_unknown_chunksizes=True)


def columns(found: Sequence[Any], group: int, quantities: str, ndim: int) -> Any:
    """The array of each letter, which stand in a group before the last columns."""
    first = 1
    arrays = []
    for place, letter in enumerate(quantities, first):
        width = {"P": (2,), "S": (ndim,), "D": (ndim,)}.get(letter, ())
        arrays.append(joined(found, group, place, (math.nan, *width), _TYPES[letter]))
    return tuple(arrays) if len(arrays) > 1 else arrays[0]


def _chunks(points: Any) -> tuple[list[Any], float, int, np.dtype[Any]]:
    """Delayed arrays of rows, how many rows (NaN if unknown) and columns they have, their type."""
    if isinstance(points, da.Array):
        return _of_array(points)
    needed = ("to_delayed", "dtypes", "columns")
    if not isinstance(points, Delayed) and all(hasattr(points, name) for name in needed):
        return _of_frame(points)
    raise TypeError(
        f"points must be a dask array or dataframe, got {kind_of(points)}; "
        "dask.array.from_array makes one of an array"
    )


def _of_array(points: Any) -> tuple[list[Any], float, int, np.dtype[Any]]:
    if points.ndim != 2:
        raise ValueError(f"points must have shape (n, d), got {points.ndim} axes")
    if math.isnan(points.shape[1]):
        raise ValueError(
            "points must have a known number of columns; points.compute_chunk_sizes() finds it"
        )
    ndim, dtype = int(points.shape[1]), np.dtype(points.dtype)
    _check(ndim, dtype, "points")
    if points.numblocks[1] > 1:
        points = points.rechunk({1: -1})
    return list(points.to_delayed()[:, 0]), float(points.shape[0]), ndim, dtype


def _of_frame(points: Any) -> tuple[list[Any], float, int, np.dtype[Any]]:
    if getattr(points, "ndim", 2) != 2:
        raise ValueError("points must be a dataframe with a column for each axis")
    types = list(points.dtypes.items())
    for name, dtype in types:
        if not isinstance(dtype, np.dtype):
            raise TypeError(f"column {name!r} of points must be of a type of NumPy, got {dtype}")
        _check(1, dtype, f"column {name!r} of points")
    narrow = types and all(dtype == np.float32 for _, dtype in types)
    common = np.dtype(np.float32 if narrow else np.float64)
    _check(len(types), common, "points")
    task = dask.delayed(brick_tasks.of_columns, pure=True)
    return [task(part, common) for part in points.to_delayed()], math.nan, len(types), common


def _check(ndim: int, dtype: np.dtype[Any], name: str) -> None:
    if not 1 <= ndim <= MAX_DIM:
        raise ValueError(f"points must have from 1 to {MAX_DIM} columns, got {ndim}")
    if dtype.kind not in "biuf" or dtype.itemsize > 8:
        raise TypeError(f"{name} must hold real numbers, got {dtype}")
