# SPDX-License-Identifier: BSD-3-Clause
"""Points with a support each, for the truth (`pairs`)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell_report.truth.balls import Balls
from halfshell_report.truth.integers import Objects, as_integers, common_unit, signs

__all__ = ["Ellipsoids"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_SURE = 2.0**-40  # of the largest eigenvalue: far more than NumPy's error
_LEAST = 2.0**-36  # smallest eigenvalue over the largest one, so that the error hardly counts
_DOUBT = 2.0**-48  # of |H| |D|, both by Frobenius: more than the rounding of |H D|
_TINY = 2.0**-500  # what is below it may have been lost


class Ellipsoids:
    """Points that are pairs where ``|H D| <= extent`` for one of them, or for both.

    Attributes
    ----------
    largest : float
        At least the largest distance of any pair, and not much more.
    lengths : ndarray of float64
        Nothing: supports have a unit of their own.

    Raises ValueError where a support is so thin that NumPy cannot tell how long it is.
    """

    def __init__(self, supports: Any, extent: float, rule: str) -> None:
        self.supports: Floats = np.asarray(supports, dtype=np.float64)
        self.extent = float(extent)
        self.rule = rule
        self.lengths: Floats = np.empty(0)
        # Around each: candidates are those of balls, one of which reaches the other.
        self._balls = Balls(_longest(self.supports, self.extent), rule)
        self.largest = self._balls.largest
        self.searches = self._balls.searches
        self._unit = common_unit(self.supports)
        self._extent_unit = common_unit(np.array([self.extent]))

    def settle(
        self, i: Ints, j: Ints, vectors: Floats, moved: Bools, margin: float, scale: float
    ) -> tuple[Bools, Bools]:
        """Which pairs are surely within reach, and which surely beyond it; see `Balls`."""
        length = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
        limit = self.extent * scale
        within, beyond = [], []
        with np.errstate(all="ignore"):  # what is no number is neither
            for rows in (i, j):
                H = self.supports[rows]
                size = np.sqrt(np.einsum("kab,kab->k", H, H))
                image = np.einsum("kab,kb->ka", H, vectors)
                image = np.sqrt(np.einsum("ka,ka->k", image, image))
                doubt = size * (margin + _DOUBT * length) + _DOUBT * limit + _TINY
                within.append((image + doubt < limit) & ~moved)
                beyond.append((image - doubt > limit) & ~moved)
        far = length > self.largest * scale + margin  # also where it seems nearer than it is
        if self.rule == "max":
            return within[0] | within[1], (beyond[0] & beyond[1]) | far
        return within[0] & within[1], beyond[0] | beyond[1] | far

    def excess(self, i: Ints, j: Ints, vectors: Objects, unit: int) -> Ints:
        """The sign of ``|H D|`` less the extent, exactly: of the nearer, or by "min" the farther.

        vectors: D in units of ``2**unit``.
        """
        limit = int(as_integers([self.extent], self._extent_unit)[0]) ** 2
        shift = 2 * (self._unit + unit - self._extent_unit)
        sides = []
        for rows in (i, j):
            H = as_integers(self.supports[rows], self._unit)
            image = (H * vectors[:, None, :]).sum(axis=2)
            square = (image * image).sum(axis=1)
            sides.append(
                signs((square << shift) - limit) if shift >= 0 else
                signs(square - (limit << -shift))
            )  # fmt: skip
        return np.minimum(*sides) if self.rule == "max" else np.maximum(*sides)


def _longest(supports: Floats, extent: float) -> Floats:
    """For each support a distance that no D with ``|H D| <= extent`` exceeds."""
    if len(supports) == 0:
        return np.empty(0)
    values = np.linalg.eigvalsh(supports)
    least = values[:, 0] - _SURE * values[:, -1]
    thin = np.flatnonzero(~(least > _LEAST * values[:, -1]))
    if len(thin):
        raise ValueError(f"supports[{thin[0]}] is too thin")
    longest = extent / least
    return np.array([math.nextafter(x, math.inf) if x else 0.0 for x in longest.tolist()])
