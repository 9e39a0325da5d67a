# SPDX-License-Identifier: BSD-3-Clause
"""Shells: several cutoffs in place of one, for the letter k."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_real_array
from halfshell._convert.foreign import is_a, shown
from halfshell._convert.lengths import check_ascending, check_lengths
from halfshell._convert.memory import refuse_large
from halfshell._convert.options import SHELL

if TYPE_CHECKING:
    from halfshell._convert.given import Given
    from halfshell._convert.types import FloatArray


def as_shells(
    cutoff: Any, quantities: Any, precision: Any, given: Given | None = None, batch: Any = None
) -> tuple[Any, FloatArray | None]:
    """The largest cutoff and all of them, if the letter k is wanted; else the cutoff, as it is."""
    if not is_a(quantities, str) or SHELL not in quantities:
        if given is None or (given.is_nothing and batch is None):
            _refuse_several(cutoff)
        return cutoff, None
    if given is not None and not given.is_nothing:
        raise ValueError(
            "the letter k in quantities cannot be combined with radii, types or supports"
        )
    if batch is not None:
        raise ValueError("the letter k in quantities cannot be combined with batch")
    if is_a(precision, str) and precision != "exact":
        raise ValueError(
            f"the letter k in quantities needs precision 'exact', got {shown(precision)}"
        )
    if cutoff is None or is_a(cutoff, Mapping):
        raise TypeError(
            "the letter k in quantities needs several cutoffs, in an array of numbers, got "
            f"{type(cutoff).__name__}"
        )
    array = as_real_array(cutoff, "cutoff", "hold numbers", _check_shape)
    refuse_large(8 * array.size, array, "cutoff")
    array = np.ascontiguousarray(array, dtype=np.float64)
    check_lengths(array, "cutoff")
    check_ascending(array, "cutoff", "several cutoffs")
    return float(array[-1]), array


def _check_shape(shape: tuple[int, ...]) -> None:
    if shape == ():
        raise ValueError("the letter k in quantities needs several cutoffs, got one")
    if len(shape) != 1 or shape[0] == 0:
        raise ValueError(f"several cutoffs must have shape (k,), with one at least, got {shape}")


def _refuse_several(cutoff: Any) -> None:
    """TypeError for an array of cutoffs, which say nothing without the letter."""
    if is_a(cutoff, (list, tuple)) or (is_a(cutoff, np.ndarray) and cutoff.ndim == 1):
        raise TypeError(
            "cutoff must be a number; several need the letter k in quantities, got "
            f"{type(cutoff).__name__} of {len(cutoff)}"
        )
