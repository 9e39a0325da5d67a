# SPDX-License-Identifier: BSD-3-Clause
"""Supports: a symmetric positive definite matrix for each point, and the extent.

Shapes and entries are settled here. Whether a matrix is positive definite is decided by the core,
exactly.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_real_array, in_order
from halfshell._convert.lengths import as_number
from halfshell._convert.memory import refuse_large
from halfshell._convert.options import as_choice
from halfshell._convert.rules import RULES_OF_SUPPORTS

if TYPE_CHECKING:
    from halfshell._convert.given import Given, Sets
    from halfshell._convert.types import FloatArray

#: Dimensions that points with supports may have, at most.
MOST_AXES = 3


def as_supports(
    given: Given, sets: Sets
) -> tuple[str, FloatArray | None, FloatArray | None, float]:
    """The rule, the supports of points and of queries, as the core takes them, and the extent."""
    if given.supports is None and given.query_supports is None:
        raise ValueError("extent needs supports")
    if given.extent is None:
        raise ValueError("supports need an extent: within it, |H @ D| <= extent")
    rule = "max" if given.rule is None else as_choice(given.rule, "rule", RULES_OF_SUPPORTS)
    if sets.ndim > MOST_AXES:
        raise ValueError(f"supports are for points of 1 to 3 dimensions, got {sets.ndim}")
    extent = as_number(given.extent, "extent")
    if not (math.isfinite(extent) and extent >= 0.0):
        raise ValueError(f"extent must be finite and not negative, got {extent}")
    return rule, *_both(given, sets), extent + 0.0


def _both(given: Given, sets: Sets) -> tuple[FloatArray | None, FloatArray | None]:
    own = asking = None
    if given.supports is not None:
        own = as_matrices(given.supports, "supports", "point", sets.n, sets.ndim)
    if given.query_supports is not None and sets.q is not None:
        asking = as_matrices(given.query_supports, "query_supports", "query", sets.q, sets.ndim)
    return own, asking


def as_matrices(values: Any, name: str, of_whom: str, n: int, d: int) -> FloatArray:
    """Symmetric matrices of finite numbers, as the core takes them."""

    def check(shape: tuple[int, ...]) -> None:
        if shape != (n, d, d):
            raise ValueError(
                f"{name} must have shape ({n}, {d}, {d}), a matrix for each {of_whom}, got {shape}"
            )

    array = as_real_array(values, name, check_shape=check)
    if array.dtype != np.float64:
        refuse_large(8 * array.size, array, name)
    matrices = in_order(array, np.float64)
    if not bool(np.isfinite(matrices).all()):
        for k, a, b in np.argwhere(~np.isfinite(matrices)):
            raise ValueError(
                f"{name} must be finite, got {name}[{k}, {a}, {b}] = {matrices[k, a, b]}"
            )
    for a in range(d):
        for b in range(a):
            _check_symmetric(matrices, name, a, b)
    return matrices


def _check_symmetric(matrices: FloatArray, name: str, a: int, b: int) -> None:
    for k in np.flatnonzero(matrices[:, a, b] != matrices[:, b, a])[:1]:
        raise ValueError(
            f"{name} must be symmetric, got {name}[{k}, {a}, {b}] = {matrices[k, a, b]} and "
            f"{name}[{k}, {b}, {a}] = {matrices[k, b, a]}"
        )
