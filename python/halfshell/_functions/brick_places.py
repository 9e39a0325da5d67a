# SPDX-License-Identifier: BSD-3-Clause
"""Where points are along the axes of a box, and how far a pair can be apart there."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell._convert.types import FloatArray

# Places are products of some terms with matrices that were inverted in float64: relative to their
# terms they are known to this, which is far more than they lose.
_ROUNDING = 2.0**-30


class Axes(NamedTuple):
    """Along axes that repeat, places are from 0 to 1; others have the length of the coordinates."""

    dual: FloatArray  # a row for each axis
    flags: tuple[bool, ...]  # which repeat
    reach: FloatArray  # how far places of a pair can be apart
    widths: FloatArray  # what one unit of an axis is in the unit of points

    def places(self, points: npt.NDArray[Any]) -> FloatArray:
        """Places of shape (d, n), 0 along axes where numbers are too large for them."""
        with np.errstate(all="ignore"):
            places: FloatArray = self.dual @ points.T.astype(np.float64, copy=False)
            for axis, repeats in enumerate(self.flags):
                if math.isinf(self.reach[axis]):
                    places[axis] = 0.0
                elif repeats:
                    places[axis] -= np.floor(places[axis])
        return places


def axes_of(vectors: Any, flags: tuple[bool, ...], cutoff: float, largest: float) -> Axes:
    """Axes of a box, for coordinates up to `largest`; the reach is infinite where it is unknown."""
    ndim = len(flags)
    rows = np.eye(ndim)
    repeating = [k for k in range(ndim) if flags[k]]
    if vectors is not None and repeating:
        given = np.asarray(vectors, np.float64)[repeating]
        scale = np.abs(given).max(axis=1, keepdims=True)
        others = np.linalg.svd(given / scale)[2][len(repeating) :]  # at right angles to all of them
        rows[repeating] = given
        rows[[k for k in range(ndim) if not flags[k]]] = others
    with np.errstate(all="ignore"):
        dual: Any = np.linalg.inv(rows).T
        lengths = np.linalg.norm(dual, axis=1)
        terms = largest * np.abs(dual).sum(axis=1)
        reach: Any = cutoff * lengths * (1.0 + _ROUNDING) + (terms + 1.0) * _ROUNDING
    reach[~np.isfinite(reach) | ~np.isfinite(terms)] = np.inf
    widths: FloatArray = 1.0 / np.where(lengths > 0.0, lengths, 1.0)
    return Axes(dual, flags, reach, widths)


def within(places: FloatArray, low: float, high: float, repeats: bool) -> npt.NDArray[np.bool_]:
    """Which places are in a range, which may go on from the other side of an axis that repeats."""
    if not repeats:
        return (places >= low) & (places <= high)
    if not high - low < 1.0:
        return np.ones(len(places), bool)
    turns = math.floor(low)
    low, high = low - turns, high - turns
    if high < 1.0:
        return (places >= low) & (places <= high)
    return (places >= low) | (places <= high - 1.0)
