# SPDX-License-Identifier: BSD-3-Clause
"""Planes, and which supports touch one: in floats where these can tell, else in fractions."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_real_array, in_order
from halfshell._objects.rational import as_fractions, solved

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import FloatArray

#: Roundings of a distance from a plane, and of a support in its units, relative to their terms.
_PLANE_ERROR = 64 * 2.0**-53
#: Squares of lengths down to this, and of their inverses, are ordinary numbers.
_LEAST = 2.0**-400


def as_plane(values: Any, name: str, d: int) -> tuple[FloatArray, FloatArray]:
    """A point and a normal."""
    if not isinstance(values, (tuple, list)) or len(values) != 2:
        raise ValueError(f"{name} must be a point and a normal")

    def check(shape: tuple[int, ...]) -> None:
        if shape != (d,):
            raise ValueError(f"{name} must have a point and a normal of shape ({d},), got {shape}")

    point, normal = (
        in_order(as_real_array(one, name, check_shape=check), np.float64) for one in values
    )
    if not (np.isfinite(point).all() and np.isfinite(normal).all() and normal.any()):
        raise ValueError(f"{name} must be finite, and its normal must not be zero")
    return point, normal


def are_parallel(normal: FloatArray, other: FloatArray) -> bool:
    a, b = ([Fraction(float(x)) for x in one] for one in (normal, other))
    return all(a[k] * b[m] == a[m] * b[k] for k in range(len(a)) for m in range(k))


def touched_by(
    positions: FloatArray,
    supports: FloatArray,
    extent: float,
    point: FloatArray,
    normal: FloatArray,
) -> npt.NDArray[Any]:
    """Whether each support touches a plane: in floats where these can tell."""
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        terms = (positions - point) * normal
        height = np.abs(terms.sum(axis=1))
        size = np.abs(terms).sum(axis=1)
        reach, error = _reach_along(normal, supports, extent)
        margin = _PLANE_ERROR * (size + reach) + error
        within = height < reach - margin
        unsure = ~(within | (height > reach + margin)) | ~np.isfinite(margin)
        unsure |= (size < 2.0**-900) | (reach < 2.0**-900)
        long = np.abs(normal).max()
        unsure |= not _LEAST < long < 1.0 / _LEAST
    for k in np.flatnonzero(unsure):
        within[k] = _touches_exactly(positions[k], point, normal, supports[k], extent)
    found: npt.NDArray[Any] = within
    return found


def _touches_exactly(
    x: FloatArray, point: FloatArray, normal: FloatArray, h: Any, extent: float
) -> bool:
    n = [Fraction(float(one)) for one in normal]
    height = sum(
        (
            a * (Fraction(float(b)) - Fraction(float(c)))
            for a, b, c in zip(n, x, point, strict=True)
        ),
        Fraction(0),
    )
    if np.ndim(h) == 0:
        n = [Fraction(float(h)) * a for a in n]
    else:
        n = [row[0] for row in solved(as_fractions(h), [[a] for a in n])]
    return height * height <= Fraction(extent) ** 2 * sum((a * a for a in n), Fraction(0))


def _reach_along(
    normal: FloatArray, supports: FloatArray, extent: float
) -> tuple[FloatArray, FloatArray]:
    """How far each support reaches along a normal, times its length, and a bound of the error."""
    if supports.ndim == 1:
        return extent * supports * np.sqrt((normal * normal).sum()), np.zeros(len(supports))
    spread = np.linalg.cond(supports)
    is_sure = spread < 2.0**30
    ordinary = np.where(is_sure[:, None, None], supports, np.eye(len(normal)))
    columns = np.broadcast_to(normal, (len(supports), len(normal)))[:, :, None]
    size = np.linalg.norm(np.linalg.solve(ordinary, columns)[:, :, 0], axis=1)
    is_sure &= (size > _LEAST) & (size < 1.0 / _LEAST)
    reach = extent * size
    return reach, np.where(is_sure, 2.0**-40 * spread, np.inf) * reach
