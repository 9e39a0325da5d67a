# SPDX-License-Identifier: BSD-3-Clause
"""Supports of nodes, lengths or matrices: what they may be, and what the core takes for them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_real_array, in_order
from halfshell._convert.lengths import as_positive, check_lengths
from halfshell._convert.rules import reach_by_radii, reach_by_supports
from halfshell._convert.supports import MOST_AXES, as_matrices
from halfshell._objects.rational import as_fractions, is_definite

if TYPE_CHECKING:
    from halfshell._convert.types import FloatArray, Reach

#: Between these the product with an extent is known to the last bit.
_LEAST_SUPPORT, _LARGEST_SUPPORT = 2.0**-500, 2.0**500
#: Extents that the core takes.
_LEAST_EXTENT, _LARGEST_EXTENT = 2.0**-64, 2.0**64


def as_extent(value: Any) -> float:
    """How many times supports count."""
    extent = as_positive(value, "extent")
    if not _LEAST_EXTENT <= extent <= _LARGEST_EXTENT:
        raise ValueError(f"extent must be from 2**-64 to 2**64, got {extent}")
    return extent


def reach_of(
    rule: str, supports: FloatArray, extent: float, of_queries: FloatArray | None = None
) -> Reach:
    """What the core takes for a reach by such supports."""
    if supports.ndim == 1:
        return reach_by_radii(rule, supports, of_queries, extent)
    return reach_by_supports(rule, supports, of_queries, extent)


def as_supports(values: Any, n: int, d: int) -> FloatArray:
    def check(shape: tuple[int, ...]) -> None:
        if shape not in ((n,), (n, d, d)):
            raise ValueError(
                f"H must have shape ({n},) or ({n}, {d}, {d}), one h or matrix for each node, got "
                f"{shape}"
            )

    given = as_real_array(values, "H", check_shape=check)
    if given.ndim == 3:
        if d > MOST_AXES:
            raise ValueError(f"H can be matrices in 1 to {MOST_AXES} dimensions, got {d}")
        matrices = as_matrices(given, "H", "node", n, d)
        _refuse_indefinite(matrices)
        return matrices
    supports = in_order(given, np.float64)
    check_lengths(supports, "H")
    wrong = (supports > _LARGEST_SUPPORT) | ((supports > 0.0) & (supports < _LEAST_SUPPORT))
    for k in np.flatnonzero(wrong):
        raise ValueError(f"H must be 0 or from 2**-500 to 2**500, got H[{k}] = {supports[k]}")
    return supports


def _refuse_indefinite(matrices: FloatArray) -> None:
    """ValueError for a matrix that is not positive definite, by the least eigenvalue or exactly."""
    sizes = np.abs(matrices).max(axis=(1, 2), initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.linalg.eigvalsh(np.nan_to_num(matrices / sizes[:, None, None]))[:, 0]
    for k in np.flatnonzero(least < 2.0**-40):
        if not is_definite(as_fractions(matrices[k])):
            raise ValueError(f"H must be positive definite, got H[{k}] = {matrices[k].tolist()}")
