# SPDX-License-Identifier: BSD-3-Clause
"""Where points are along the axes of a box, and how far a pair can be apart there."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.types import FloatArray


class Axes(NamedTuple):
    """What the core says of the axes of a box, which are not those of the box vectors.

    Between processes arrays may arrive at any address: the core is given them aligned.
    """

    scene: tuple[FloatArray | None, int, float, float]  # box, periodic bits, cutoff, largest
    repeats: tuple[bool, ...]  # places are from 0 to 1
    reach: tuple[float, ...]  # how far places of a pair can be apart: infinite where unknown
    widths: FloatArray  # what one unit of an axis is in a common unit

    def places(self, points: npt.NDArray[Any]) -> FloatArray:
        """Places of shape (d, n), 0 along axes where the reach is infinite."""
        return _places(points, self.scene)[0]


def axes_of(
    vectors: FloatArray | None, flags: tuple[bool, ...], cutoff: float, largest: float
) -> Axes:
    """Axes of a box, for coordinates up to `largest`."""
    scene = (vectors, sum(flag << k for k, flag in enumerate(flags)), cutoff, largest)
    _, repeats, reach, widths = _places(np.empty((0, len(flags))), scene)
    return Axes(scene, repeats, reach, np.array(widths))


def _places(
    points: npt.NDArray[Any], scene: tuple[FloatArray | None, int, float, float]
) -> tuple[FloatArray, tuple[bool, ...], tuple[float, ...], tuple[float, ...]]:
    box, periodic, cutoff, largest = scene
    given = None if box is None else np.require(box, requirements=["C", "A"])
    aligned = np.require(points, requirements=["C", "A"])
    return _core.box_places(aligned, given, periodic, cutoff, largest)


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
