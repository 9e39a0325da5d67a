# SPDX-License-Identifier: BSD-3-Clause
"""The right list where each pair is decided by supports, without the search for these.

Each point has a sphere around its ellipsoid, by an eigenvalue that NumPy finds or, where that is
not certain, by rational arithmetic. Points are divided by octaves of these spheres, each two of
which are searched with one cutoff; what that finds is judged in float64 where that is certain,
otherwise in rational arithmetic.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from halfshell._check.by_reach import ByReach
from halfshell._check.reference import exact_square, exact_vector
from halfshell._convert.rules import RULES, reach_by_radii

if TYPE_CHECKING:
    from halfshell._convert.types import FloatArray, PointArray, Reach

_SURE = 2.0**-40  # of the largest eigenvalue: far more than NumPy's error
_DOUBT = 2.0**-46  # of all terms: more than the rounding of |H @ D|


class BySupports(ByReach):
    """As `ByReach`, for supports; their spheres are the radii."""

    def __init__(
        self,
        points: PointArray,
        queries: PointArray | None,
        bound: float,
        reach: Reach,
        how: dict[str, Any],
    ) -> None:
        rule, *_, supports, query_supports, extent = reach
        assert extent is not None
        own, asking = (
            None if matrices is None else spheres_of(matrices, extent)
            for matrices in (supports, query_supports)
        )
        super().__init__(points, queries, bound, reach_by_radii(RULES[rule], own, asking), how)
        self.extent = extent
        self.supports: Any = supports
        self.asking_supports: Any = supports if queries is None else query_supports

    def _is_within(
        self, rows: npt.NDArray[np.int64], d: FloatArray
    ) -> npt.NDArray[np.bool_]:
        """Which of the pairs within a sphere are to be kept."""
        del d
        within = np.zeros(len(rows), dtype=bool)
        for first in range(0, len(rows), 1 << 18):
            part = slice(first, first + (1 << 18))
            sides = [
                self._compare(matrices[rows[part, column]], rows[part])
                for column, matrices in self._sides()
            ]
            sure_in, sure_out = (self._combined([s[k] for s in sides], k == 1) for k in (0, 1))
            for k in np.flatnonzero(~(sure_in | sure_out)):
                sure_in[k] = self.holds(*rows[first + k].tolist())
            within[part] = sure_in
        return within

    def _sides(self) -> list[tuple[int, Any]]:
        """The column of rows, and the supports, of each side that the rule looks at."""
        sides = []
        if self.rule != "scatter":
            sides.append((0, self.asking_supports))
        if self.rule != "gather":
            sides.append((1, self.supports))
        return sides

    def _combined(self, sides: list[Any], beyond: bool) -> Any:
        """Whether surely within by the rule, or surely beyond."""
        every = (self.rule == "min") != beyond
        return np.logical_and.reduce(sides) if every else np.logical_or.reduce(sides)

    def _compare(self, matrices: FloatArray, rows: npt.NDArray[np.int64]) -> tuple[Any, Any]:
        """Whether each pair is surely within the support, and whether surely beyond."""
        p, q = self.asking[rows[:, 0]], self.points[rows[:, 1]]
        p, q = p.astype(np.float64), q.astype(np.float64)
        D, size = q - p, np.abs(p) + np.abs(q)
        if self.how["box"] is not None:
            moved = rows[:, 2:].astype(np.float64)
            D = D + moved @ self.how["box"]
            size = size + np.abs(moved) @ np.abs(self.how["box"])
        with np.errstate(all="ignore"):
            z = np.sqrt((np.einsum("kab,kb->ka", matrices, D) ** 2).sum(axis=1))
            doubt = _DOUBT * np.einsum("kab,kb->k", np.abs(matrices), size) + 2.0**-500
            return z + doubt < self.extent * (1.0 - _DOUBT), z - doubt > self.extent * (
                1.0 + _DOUBT
            )

    def holds(self, i: int, j: int, *shift: int) -> bool:
        """Whether this pair is to be kept, in rational arithmetic."""
        pair = (self.asking[i], self.points[j])
        vector = exact_vector(pair, 0, 1, shift, self.how["box"])
        judged = [
            self._is_below(exact_norm(matrices[(i, j)[column]], vector), Fraction(self.extent) ** 2)
            for column, matrices in self._sides()
        ]
        if not (all(judged) if self.rule == "min" else any(judged)):
            return False
        if math.isinf(self.bound):
            return True
        square = exact_square(pair, 0, 1, shift, self.how["box"])
        return self._is_below(square, Fraction(self.bound) ** 2)

    def _is_below(self, square: Fraction, limit: Fraction) -> bool:
        return square <= limit if self.how["inclusive"] else square < limit


def exact_norm(matrix: Any, vector: list[Fraction]) -> Fraction:
    """The square of the length of ``matrix @ vector``, exactly."""
    rows = [[Fraction(x) for x in row] for row in np.asarray(matrix).tolist()]
    return sum(
        (sum((a * b for a, b in zip(row, vector)), Fraction(0)) ** 2 for row in rows), Fraction(0)
    )


def spheres_of(matrices: FloatArray, extent: float) -> FloatArray:
    """For each positive definite matrix a radius that no D with ``|H @ D| <= extent`` exceeds."""
    if len(matrices) == 0:
        return np.empty(0)
    exponents = np.frexp(np.abs(matrices).max(axis=(1, 2)))[1].astype(np.int64)
    scaled = np.ldexp(matrices, -exponents[:, None, None])
    values = np.linalg.eigvalsh(scaled)
    least = values[:, 0] - _SURE * values[:, -1]
    poor = ~(least > 0.5 * values[:, 0])
    radii = np.zeros(len(matrices))
    for k in np.flatnonzero(~poor):
        radii[k] = _above(Fraction(extent) / Fraction(float(least[k])), int(exponents[k]))
    for k in np.flatnonzero(poor):
        radii[k] = _above(Fraction(extent) / _least_eigenvalue(matrices[k]), 0)
    return radii


def _above(quotient: Fraction, exponent: int) -> float:
    """At least quotient / 2**exponent, but for what passes float64."""
    length = quotient / Fraction(2) ** exponent
    return math.nextafter(float(length), math.inf) if length else 0.0


def _least_eigenvalue(matrix: FloatArray) -> Fraction:
    """Half of the smallest eigenvalue at least, and not more than it."""
    rows = [[Fraction(x) for x in row] for row in matrix.tolist()]
    x = min(row[k] for k, row in enumerate(rows))
    while not _is_definite(rows, x):
        x /= 2
    return x


def _is_definite(rows: list[list[Fraction]], x: Fraction) -> bool:
    """Whether a matrix, less x on its diagonal, is positive definite, by elimination."""
    left = [[a - x if k == m else a for m, a in enumerate(row)] for k, row in enumerate(rows)]
    while left:
        pivot = left[0][0]
        if pivot <= 0:
            return False
        left = [
            [a - row[0] * b / pivot for a, b in zip(row[1:], left[0][1:])] for row in left[1:]
        ]
    return True
