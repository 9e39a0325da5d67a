# SPDX-License-Identifier: BSD-3-Clause
"""The right list where each pair has a reach of its own, from searches that have one cutoff each.

Points are divided by octave of their radius, or by type. Each two parts are searched as two sets
with the largest reach of any pair between them, and what is beyond its own reach is left out: by
its distance where that is far enough from it to tell, otherwise in rational arithmetic. So nothing
is shared with the search for radii but the search for one cutoff.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from halfshell._check.reference import exact_square, reach_by_radii
from halfshell._convert.rules import DIRECTED, RULES
from halfshell._functions.between import pairs_between as find_between
from halfshell._functions.pairs import pairs as find_pairs

if TYPE_CHECKING:
    from fractions import Fraction

    from halfshell._convert.types import FloatArray, PointArray, Reach

IntArray = npt.NDArray[np.int64]
_Members = npt.NDArray[np.intp]

_MOST_PARTS = 64  # beyond them parts are wider than an octave
_DOUBT = 8  # units of a distance: more than its rounding and that of a reach


class ByReach:
    """Points, queries or None, and the reach of each pair as the core takes it.

    how: box, periodic, inclusive and memory_limit, as keywords of a search.
    """

    def __init__(
        self,
        points: PointArray,
        queries: PointArray | None,
        bound: float,
        reach: Reach,
        how: dict[str, Any],
    ) -> None:
        rule, radii, query_radii, types, query_types, self.table = reach[:6]
        self.points = points
        self.asking = points if queries is None else queries
        self.is_one_set = queries is None
        self.bound = bound
        self.rule = RULES[rule]
        self.how = how
        own, asking = (radii, query_radii) if self.table is None else (types, query_types)
        self.marks: Any = own  # radii or types; None where the rule does not go by them
        self.asking_marks: Any = own if self.is_one_set else asking

    @property
    def is_directed(self) -> bool:
        """Whether (i, j) is to be found and (j, i) is something else."""
        return not self.is_one_set or self.rule in DIRECTED

    def rows(self, with_shifts: bool) -> IntArray:
        """(i, j) or (i, j, *S) of each pair: once of one set, unless the rule has a direction."""
        none = np.empty((0, 2 + self.points.shape[1]), np.int64)
        found = np.concatenate([none, *self._between_parts()])
        return found if with_shifts else found[:, :2]

    def limit(self, i: int, j: int) -> Fraction | None:
        """The reach of a pair, exactly; None if it is none."""
        if self.table is not None:
            length = float(self.table[self.asking_marks[i], self.marks[j]])
            return None if length < 0.0 else reach_by_radii([length], "max")[0][0]
        radii = [
            0.0 if marks is None else float(marks[k])
            for marks, k in ((self.asking_marks, i), (self.marks, j))
        ]
        most = None if math.isinf(self.bound) else self.bound
        return reach_by_radii(radii, self.rule, most)[0][1]

    # ---- parts -----------------------------------------------------------------------------

    def _between_parts(self) -> Iterator[IntArray]:
        left = self._parts(self.asking_marks, len(self.asking))
        right = self._parts(self.marks, len(self.points))
        for a, askers in enumerate(left):
            for b, members in enumerate(right):
                if b < a and not self.is_directed:
                    continue
                cutoff = self._largest(askers, members)
                if cutoff >= 0.0:
                    yield self._pairs(askers, members, cutoff, a == b and not self.is_directed)

    def _parts(self, marks: Any, n: int) -> list[_Members]:
        """Numbers of points of one type, or of about one radius."""
        if n == 0:
            return []
        if marks is None:
            return [np.arange(n)]
        labels = marks
        if self.table is None:
            labels = np.where(marks > 0.0, np.frexp(marks)[1].astype(np.int64), -(1 << 20))
            while len(np.unique(labels)) > _MOST_PARTS:
                labels = labels >> 1
        order = np.argsort(labels, kind="stable")
        return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)

    def _largest(self, askers: _Members, members: _Members) -> float:
        """At least the largest reach between two parts; negative if they have no pairs."""
        if self.table is not None:
            return float(self.table[self.asking_marks[askers[0]], self.marks[members[0]]])
        a = 0.0 if self.asking_marks is None else float(self.asking_marks[askers].max())
        b = 0.0 if self.marks is None else float(self.marks[members].max())
        return min(math.nextafter(float(self._rounded(a, b)), math.inf), self.bound)

    def _rounded(self, a: Any, b: Any) -> Any:
        """What the rule makes of radii, but for rounding."""
        if self.rule == "sum":
            return a + b
        if self.rule == "mean":
            return a / 2.0 + b / 2.0
        if self.rule in DIRECTED:
            return a if self.rule == "gather" else b
        return np.maximum(a, b) if self.rule == "max" else np.minimum(a, b)

    def _pairs(
        self, askers: _Members, members: _Members, cutoff: float, is_one: bool
    ) -> IntArray:
        """The pairs between two parts, or of one part with itself."""
        if is_one:
            i, j, S, d = find_pairs(self.points[members], cutoff, quantities="ijSd", **self.how)
        else:
            i, j, S, d = find_between(
                self.asking[askers], self.points[members], cutoff, quantities="ijSd", **self.how
            )
        rows = np.column_stack((askers[i], members[j], S)).astype(np.int64)
        if self.is_one_set and self.is_directed:
            apart = (rows[:, 0] != rows[:, 1]) | rows[:, 2:].any(axis=1)
            rows, d = rows[apart], d[apart]
        return rows if self.table is not None else rows[self._is_within(rows, d)]

    def _is_within(self, rows: IntArray, d: FloatArray) -> npt.NDArray[np.bool_]:
        """Which pairs are within their own reach; d is within 1 ulp of their distances."""
        a = 0.0 if self.asking_marks is None else self.asking_marks[rows[:, 0]]
        b = 0.0 if self.marks is None else self.marks[rows[:, 1]]
        reach = np.minimum(self._rounded(a, b), self.bound)
        within = d < reach
        near = np.abs(d - reach) <= _DOUBT * np.spacing(np.maximum(d, reach))
        for k in np.flatnonzero(near):
            within[k] = self.holds(*rows[k].tolist())
        return np.asarray(within)

    def holds(self, i: int, j: int, *shift: int) -> bool:
        """Whether this is within its reach, in rational arithmetic."""
        limit = self.limit(i, j)
        if limit is None:
            return False
        square = exact_square((self.asking[i], self.points[j]), 0, 1, shift, self.how["box"])
        return square <= limit**2 if self.how["inclusive"] else square < limit**2
