# SPDX-License-Identifier: BSD-3-Clause
"""Keys, positions and lengths of a DynamicCellList, as the core takes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_array, as_real_array, in_order
from halfshell._convert.foreign import shown
from halfshell._convert.options import as_choice, as_whole
from halfshell._convert.scene import MAX_DIM, as_points

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import FloatArray, PointArray

#: By their numbers in the core.
STORAGES = ("hash", "dense", "all-pairs")


def as_dim(dim: Any) -> int:
    """A number of dimensions."""
    number = as_whole(dim, "dim")
    if not 1 <= number <= MAX_DIM:
        raise ValueError(f"dim must be from 1 to {MAX_DIM}, got {shown(number)}")
    return number


def as_storage(storage: Any) -> int:
    """The number of a kind of storage."""
    return STORAGES.index(as_choice(storage, "storage", STORAGES))


def as_position(position: Any, dim: int) -> FloatArray:
    """One position; the core calls this for what is not plain."""

    def check(shape: tuple[int, ...]) -> None:
        if shape != (dim,):
            raise ValueError(f"position must have shape ({dim},), got {shape}")

    return in_order(as_real_array(position, "position", check_shape=check), np.float64)


def as_positions(positions: Any, dim: int, n: int | None = None) -> PointArray:
    """Positions of shape (n, dim)."""
    array = as_points(positions, "positions", dim)
    if array.shape[1] != dim or n not in (None, len(array)):
        rows = "q" if n is None else n
        raise ValueError(f"positions must have shape ({rows}, {dim}), got {array.shape}")
    return array


def as_keys(keys: Any, tagged: bool) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32] | None]:
    """Integers and tags, if these keys have them."""
    array = as_array(keys, "keys")
    if array.shape == (0,):
        array = np.empty((0, 2) if tagged else 0, np.int64)
    if array.dtype.kind not in "iu":
        if array.dtype.kind == "O" and all(type(key) is int for key in array.flat):
            raise OverflowError("keys must fit int64")
        raise TypeError(f"keys must be integers, got dtype {array.dtype}")
    if array.ndim != (2 if tagged else 1) or (tagged and array.shape[1] != 2):
        form = "(n, 2), of tags and integers" if tagged else "(n,)"
        raise ValueError(f"keys must have shape {form}, got {array.shape}")
    if array.dtype.kind == "u" and (array > np.uint64(2**63 - 1)).any():
        raise OverflowError("keys must fit int64")
    if not tagged:
        return in_order(array, np.int64), None
    tags = array[:, 0].astype(np.int64)
    if ((tags < -(2**31)) | (tags >= 2**31)).any():
        raise OverflowError("the tags of keys must fit int32")
    return in_order(array[:, 1], np.int64), in_order(tags, np.int32)
