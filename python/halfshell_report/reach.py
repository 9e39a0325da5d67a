# SPDX-License-Identifier: BSD-3-Clause
"""What pairs are compared with where each has a reach of its own, for the `truth`.

`Balls` are points with a radius each, `Ellipsoids` those with a support. Another reach needs a
class with the same attributes and methods, and is chosen in `reach_of`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from halfshell_report.integers import Objects, as_integers, common_unit, signs

__all__ = ["Balls", "Ellipsoids", "Reach", "reach_of"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_MOST_OCTAVES = 40  # beyond them parts are wider than an octave


class Balls:
    """Points that are pairs within what a rule makes of two radii.

    Attributes
    ----------
    largest : float
        At least the largest reach of any pair, and not much more.
    lengths : ndarray of float64
        Numbers of which every reach is a sum or one of them.
    """

    def __init__(self, radii: Any, rule: str) -> None:
        given = np.asarray(radii, dtype=np.float64)
        self.rule = rule
        self.lengths: Floats = given / 2.0 if rule == "mean" else given
        if rule == "mean" and not np.array_equal(self.lengths * 2.0, given):
            raise ValueError("half of a radius is no float64")
        top = np.sort(self.lengths)[::-1]
        self.largest = self._above(*(float(top[min(k, len(top) - 1)]) for k in (0, 1))) if len(
            top
        ) else 0.0
        self._whole: Objects = np.empty(0, dtype=object)

    def _above(self, a: float, b: float) -> float:
        """At least the reach of two."""
        if self.rule in ("sum", "mean"):
            return a + b if a == 0.0 or b == 0.0 else math.nextafter(a + b, math.inf)
        return max(a, b) if self.rule == "max" else min(a, b)

    def parts(self) -> list[Ints]:
        """Numbers of points of about one size, so that small ones are looked for near by."""
        if len(self.lengths) == 0:
            return []
        octaves = np.where(
            self.lengths > 0.0, np.frexp(self.lengths)[1].astype(np.int64), -(1 << 20)
        )
        while len(np.unique(octaves)) > _MOST_OCTAVES:
            octaves = octaves >> 1
        order = np.argsort(octaves, kind="stable")
        return np.split(order, np.flatnonzero(np.diff(octaves[order])) + 1)

    def between(self, one: Ints, other: Ints) -> float:
        """At least the largest reach of points of two parts."""
        return self._above(float(self.lengths[one].max()), float(self.lengths[other].max()))

    def settle(
        self, i: Ints, j: Ints, vectors: Floats, moved: Bools, margin: float, scale: float
    ) -> tuple[Bools, Bools]:
        """Which pairs are surely within their reach, and which surely beyond it.

        vectors (m, d), with lengths within half the margin, in units of ``1 / scale``; moved: those
        that are longer than they seem.
        """
        length = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
        # Rounded at most once: less than what the margin has to spare.
        limit = self._combined(self.lengths[i], self.lengths[j]) * scale
        return (length < limit - margin) & ~moved, length > limit + margin

    def excess(self, i: Ints, j: Ints, vectors: Objects, unit: int) -> Ints:
        """The sign of the length less the reach, exactly; vectors in units of ``2**unit``."""
        if len(self._whole) != len(self.lengths):
            self._whole = as_integers(self.lengths, unit)
        reach = self._combined(self._whole[i], self._whole[j])
        return signs((vectors * vectors).sum(axis=1) - reach * reach)

    def _combined(self, a: Any, b: Any) -> Any:
        """What the rule makes of two lengths."""
        if self.rule in ("sum", "mean"):
            return a + b
        return np.maximum(a, b) if self.rule == "max" else np.minimum(a, b)

    def searches(self) -> Iterator[tuple[Ints, Ints, float]]:
        """Yield each two parts and the largest reach between them; a part with itself once."""
        parts = self.parts()
        for a, one in enumerate(parts):
            for other in parts[: a + 1]:
                yield one, other, self.between(one, other)


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


Reach: TypeAlias = Balls | Ellipsoids


def reach_of(scene: Any) -> Reach | None:
    """The reach of a scene of `scenes`; None where one cutoff holds for all pairs."""
    if scene.radii is not None:
        return Balls(scene.radii, scene.rule)
    if scene.supports is not None:
        return Ellipsoids(scene.supports, scene.extent, scene.rule)
    return None
