# SPDX-License-Identifier: BSD-3-Clause
"""Points with a radius each, for the truth (`pairs`)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell_report.truth.integers import Objects, as_integers, signs

__all__ = ["Balls"]

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
