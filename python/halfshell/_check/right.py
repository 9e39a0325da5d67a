# SPDX-License-Identifier: BSD-3-Clause
"""The right list of one system, from searches that have one cutoff each and nothing else.

Points are divided by type, or by octave of their radius or of a sphere around their support. Each
two parts are searched as two sets with the largest reach of any pair between them. What is beyond
its own reach, or does not count for another reason, is left out: by what float64 makes of it where
that is certain, otherwise in rational arithmetic. So nothing is shared with searches by radii,
types, supports, groups and exclusions but the search for one cutoff.
"""

from __future__ import annotations

import math
import operator
from copy import copy
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._check.reference import exact_vector, reach_by_radii, reference_pairs
from halfshell._convert.call import DIRECTED, RULES, Call, Known, Pairing, part_of
from halfshell._functions.pairs import pairs as find_pairs
from halfshell._functions.pairs import pairs_between as find_between
from halfshell._objects.exact import is_definite

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from halfshell._convert.types import FloatArray

IntArray = npt.NDArray[np.int64]
_Bools = npt.NDArray[np.bool_]
_Members = npt.NDArray[np.intp]

_MOST_PARTS = 64  # beyond them parts are wider than an octave
_UNITS = 8  # of a distance: more than its rounding and that of a reach
_SURE = 2.0**-40  # of the largest eigenvalue: far more than NumPy's error
_DOUBT = 2.0**-46  # of all terms: more than the rounding of |H @ D|


class Right:
    """The pairs of a call without a batch; `holds` decides on one of them."""

    marks: tuple[Any, ...]
    table: FloatArray | None

    def __init__(self, call: Call) -> None:
        self.points = call.array
        self.is_one_set = call.asking is None
        self.asking = self.points if call.asking is None else call.asking
        self.bound = call.cutoff
        self.inclusive = call.inclusive
        self.box, self.threads = call.points.box, call.threads
        self.periodic = call.points.periodic
        pairing = call.pairing or Pairing()
        self.is_plain = pairing.rule is None
        self.rule, self.extent, self.table = RULES[pairing.rule or 0], pairing.extent, pairing.table
        known: dict[str, tuple[Any, Any]] = {
            name: (own if self.is_one_set else other, own)  # of each i, and of each j
            for name, own, other in zip(Known._fields, call.known, call.known_of_queries)
        }
        self.marks = known["radii" if self.table is None else "types"]  # None: no rule needs them
        if self.is_plain:  # one type, as it were
            self.table = np.array([[call.cutoff]])
            self.marks = tuple(np.zeros(len(one), np.int8) for one in (self.asking, self.points))
        elif self.extent is not None:
            quiet = copy(call)  # a search, which refuses supports that are none
            quiet.progress = quiet.bar = None
            quiet.run(_core.coordination, call.query_set, call.pairing, "auto")
            self.supports, extent = known["supports"], self.extent
            judging = {side for side, _ in self._judging()}
            self.marks = tuple(spheres_of(H, extent) if side in judging else None
                               for side, H in enumerate(self.supports))  # fmt: skip
        self.groups, self.labels = known["groups"], known["labels"]
        self.within, self.least = pairing.within or 0, pairing.least
        self.excluded = None if pairing.excluded is None else self._keys(*pairing.excluded.T)

    @property
    def is_directed(self) -> bool:
        """Whether (i, j) is to be found and (j, i) is something else."""
        return not self.is_one_set or self.rule in DIRECTED

    # ---- all of them -----------------------------------------------------------------------

    def rows(
        self, with_shifts: bool, progress: Callable[[float], object] | None = None
    ) -> IntArray:
        """(i, j) or (i, j, *S) of each pair: once of one set, unless the rule has a direction."""
        left, right = (
            self._parts(marks, len(points))
            for marks, points in zip(self.marks, (self.asking, self.points), strict=True)
        )
        every = [
            (askers, members, a == b)
            for a, askers in enumerate(left)
            for b, members in enumerate(right)
            if a <= b or self.is_directed
        ]
        found = [np.empty((0, 2 + self.points.shape[1] * with_shifts), np.int64)]
        for k, (askers, members, is_one) in enumerate(every):
            cutoff = self._largest(askers, members)
            if cutoff >= 0.0 or self.is_plain:  # which the search refuses then
                tell = part_of(progress, k, len(every))
                is_one = is_one and not self.is_directed
                found.append(self._pairs(askers, members, cutoff, is_one, with_shifts, tell))
        return np.concatenate(found) if len(found) > 2 else found[-1]

    def _parts(self, marks: Any, n: int) -> list[_Members]:
        """Numbers of points of one type, or of about one radius."""
        if n == 0 or marks is None or self.is_plain:
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
        asking, own = self.marks
        if self.table is not None and len(self.table) == 1:
            return float(self.table[0, 0])
        if not (len(askers) and len(members)):
            return 0.0  # the search looks at the box
        if self.table is not None:
            return float(self.table[asking[askers[0]], own[members[0]]])
        a = 0.0 if asking is None else float(asking[askers].max())
        b = 0.0 if own is None else float(own[members].max())
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
        self, askers: _Members, members: _Members, cutoff: float, is_one: bool, with_shifts: bool,
        progress: Any,
    ) -> IntArray:  # fmt: skip
        """The pairs between two parts, or of one part with itself."""
        is_excluding = self.labels[1] is not None or self.excluded is not None
        measured = self.table is None or is_excluding or self.least > 0.0
        how: dict[str, Any] = {
            "box": self.box, "periodic": self.periodic, "inclusive": self.inclusive,
            "threads": self.threads, "progress": progress,
            "quantities": "ij" + "S" * (with_shifts or measured) + "d" * measured,
        }  # fmt: skip
        if is_one:
            i, j, *more = find_pairs(self.points[members], cutoff, **how)
        else:
            i, j, *more = find_between(self.asking[askers], self.points[members], cutoff, **how)
        rows = np.column_stack((askers[i], members[j], *more[:1])).astype(np.int64, copy=False)
        keep = np.ones(len(rows), bool)
        if self.groups[1] is not None:
            keep = np.asarray(self.groups[0][rows[:, 0]] == self.groups[1][rows[:, 1]])
        if measured:
            d = more[1]
            if self.is_one_set and self.is_directed:
                keep &= (rows[:, 0] != rows[:, 1]) | rows[:, 2:].any(axis=1)
            if self.least > 0.0:
                apart = d >= self.least  # d is within 1 ulp of theirs
                for k in np.flatnonzero(_are_near(d, self.least)):
                    apart[k] = self._square(rows[k]) >= Fraction(self.least) ** 2
                keep &= apart
            if is_excluding:
                keep[self._nearest_excluded(rows, d)] = False
            if self.table is None:
                keep &= self._are_within(rows, d)
        rows = rows if keep.all() else rows[keep]
        return rows if with_shifts else rows[:, :2]

    # ---- one of them, in rational arithmetic -----------------------------------------------

    def holds(self, i: int, j: int, *shift: int) -> bool:
        """Whether this is one of the pairs."""
        if self.is_one_set and i == j and not any(shift):
            return False  # a point with itself never is
        flags = [False] * len(shift) if self.periodic is None else self.periodic.tolist()
        if any(s and not repeats for s, repeats in zip(shift, flags, strict=True)):
            return False  # nor is anything across an axis that does not repeat
        row = np.array([[i, j, *shift]])
        if not self._reaches(i, j, shift) or self._square(row[0]) < Fraction(self.least) ** 2:
            return False
        if self.groups[1] is not None and self.groups[0][i] != self.groups[1][j]:
            return False
        return not self._are_excluded(row)[0] or shift != self._nearest(i, j, shift)

    def _reaches(self, i: int, j: int, shift: tuple[int, ...]) -> bool:
        """Whether it is within the reach of the two."""
        vector = exact_vector((self.asking[i], self.points[j]), 0, 1, shift, self.box)
        if self.extent is None:
            limit = self.limit(i, j)
            return limit is not None and self._is_below(_square(vector), limit)
        judged = []
        for side, H in self._judging():
            rows = [map(Fraction, row) for row in H[(i, j)[side]].tolist()]
            moved = [sum(map(operator.mul, row, vector), Fraction(0)) for row in rows]
            judged.append(self._is_below(_square(moved), Fraction(self.extent)))
        return all(judged) if self.rule == "min" else any(judged)

    def _is_below(self, square: Fraction, limit: Fraction) -> bool:
        return square <= limit**2 if self.inclusive else square < limit**2

    def limit(self, i: int, j: int) -> Fraction | None:
        """The reach of a pair, exactly; None if it is none."""
        asking, own = self.marks
        if self.table is not None:
            length = float(self.table[asking[i], own[j]])
            return None if length < 0.0 else Fraction(length)
        radii = [0.0 if one is None else float(one[k]) for one, k in ((asking, i), (own, j))]
        most = None if math.isinf(self.bound) else self.bound
        return reach_by_radii(radii, self.rule, most)[0][1]

    def _square(self, row: IntArray) -> Fraction:
        """The squared length of (i, j, *S)."""
        i, j, *shift = row.tolist()
        pair = (self.asking[i], self.points[j])
        return _square(exact_vector(pair, 0, 1, shift, self.box))

    def _nearest(self, i: int, j: int, shift: tuple[int, ...]) -> tuple[int, ...]:
        """The S of the nearest image of a pair, of which there is one at S = shift."""
        if self.is_one_set and j < i:
            back = self._nearest(j, i, tuple(-s for s in shift))
            return tuple(-s for s in back)
        pair = (self.asking[i], self.points[j])
        square = min(self._square(np.array([i, j, *S])) for S in (shift, self._wrapped(i, j)))
        product = square.numerator * square.denominator
        root = math.isqrt(product)
        root += root * root < product  # no less than the root; and no length where points coincide
        reach = [[None, Fraction(root, square.denominator)], [None, None]]
        images = reference_pairs(pair, reach, self.box, self.periodic)
        return min((self._square(np.array([i, j, *S])), S) for _, _, S in images)[1]

    def _wrapped(self, i: int, j: int) -> tuple[int, ...]:
        """The S of a near image of a pair: about the nearest one, unless the box is skewed."""
        S = np.zeros(self.points.shape[1], np.int64)
        if self.box is not None:
            axes = slice(None) if self.periodic is None else self.periodic
            with np.errstate(over="ignore"):
                apart = np.nan_to_num(self.points[j].astype(np.float64) - self.asking[i])
            turns = np.linalg.lstsq(self.box[axes].T, apart, rcond=None)[0]
            S[axes] = -np.clip(np.rint(turns), -(2.0**31), 2.0**31)
        return tuple(S.tolist())

    # ---- which of them count ---------------------------------------------------------------

    def _are_excluded(self, rows: IntArray) -> _Bools:
        """Whether two points are excluded, in their nearest image."""
        i, j = rows[:, 0], rows[:, 1]
        excluded: Any = np.zeros(len(rows), bool)
        if self.labels[1] is not None:
            a, b = self.labels[0][i], self.labels[1][j]
            # Unsigned, a difference that passes int64 is what it is.
            apart = np.maximum(a, b).astype(np.uint64) - np.minimum(a, b).astype(np.uint64)
            excluded = apart <= np.uint64(self.within)
        elif self.excluded is not None:
            excluded = np.isin(self._keys(i, j), self.excluded)
        if self.is_one_set:
            excluded &= i != j
        return np.asarray(excluded)

    def _keys(self, i: IntArray, j: IntArray) -> IntArray:
        """A number for each two points, in either order if both are of one set."""
        if self.is_one_set:
            i, j = np.minimum(i, j), np.maximum(i, j)
        return i * len(self.points) + j

    def _nearest_excluded(self, rows: IntArray, d: FloatArray) -> IntArray:
        """Which rows are the nearest image of two points that are excluded.

        Of any two, the images within some distance are among the rows, or none is.
        """
        places = np.flatnonzero(self._are_excluded(rows))
        order = places[np.lexsort((d[places], rows[places, 1], rows[places, 0]))]
        lengths = d[order]
        first = lengths[np.repeat(*_runs(rows[order]))]
        order = order[_are_near(lengths, first)]
        starts, counts = _runs(rows[order])
        found = order[starts]
        for k in np.flatnonzero(counts > 1):
            equal = order[starts[k] : starts[k] + counts[k]]  # by S as i < j sees it
            back = -1 if self.is_one_set and rows[equal[0], 0] > rows[equal[0], 1] else 1
            ranks = [(self._square(row), (back * row[2:]).tolist()) for row in rows[equal]]
            found[k] = equal[ranks.index(min(ranks))]
        return found

    # ---- which are within their reach ------------------------------------------------------

    def _are_within(self, rows: IntArray, d: FloatArray) -> _Bools:
        """Which pairs are within their own reach; d is within 1 ulp of their distances."""
        if self.extent is not None:
            return self._are_within_supports(rows)
        a, b = (
            0.0 if one is None else one[rows[:, side]] for side, one in enumerate(self.marks)
        )
        reach = np.minimum(self._rounded(a, b), self.bound)
        within = d < reach
        for k in np.flatnonzero(_are_near(d, reach)):
            i, j, *shift = rows[k].tolist()
            within[k] = self._reaches(i, j, tuple(shift))
        return np.asarray(within)

    def _are_within_supports(self, rows: IntArray) -> _Bools:
        within = np.zeros(len(rows), dtype=bool)
        for first in range(0, len(rows), 1 << 18):
            part = rows[first : first + (1 << 18)]
            every, some = np.logical_and.reduce, np.logical_or.reduce
            surely_in, surely_out = zip(*self._compare(part), strict=True)
            sure_in = every(surely_in) if self.rule == "min" else some(surely_in)
            sure_out = some(surely_out) if self.rule == "min" else every(surely_out)
            for k in np.flatnonzero(~(sure_in | sure_out)):
                i, j, *shift = part[k].tolist()
                sure_in[k] = self._reaches(i, j, tuple(shift))
            within[first : first + len(part)] = sure_in
        return within

    def _judging(self) -> list[tuple[int, Any]]:
        """The column of rows, and the supports, of each side that the rule looks at."""
        wanted = {"gather": (0,), "scatter": (1,)}.get(self.rule, (0, 1))
        return [(side, self.supports[side]) for side in wanted]

    def _compare(self, rows: IntArray) -> Iterator[tuple[_Bools, _Bools]]:
        """For each support that the rule looks at, which pairs are surely within, surely beyond."""
        assert self.extent is not None
        p, q = self.asking[rows[:, 0]], self.points[rows[:, 1]]
        p, q = p.astype(np.float64), q.astype(np.float64)
        D, size = q - p, np.abs(p) + np.abs(q)
        if self.box is not None:
            shifts = rows[:, 2:].astype(np.float64)
            D = D + shifts @ self.box
            size = size + np.abs(shifts) @ np.abs(self.box)
        extent, exponent = math.frexp(self.extent)
        for side, H in self._judging():
            matrices = H[rows[:, side]]
            with np.errstate(all="ignore"):  # squares, in units of the extent, may overflow
                moved = np.einsum("kab,kb->ka", matrices, D)
                doubt = _DOUBT * np.einsum("kab,kb->k", np.abs(matrices), size) + 2.0**-1060
                z = np.sqrt((np.ldexp(moved, -exponent) ** 2).sum(axis=1))
                doubt = np.ldexp(doubt, -exponent) + 2.0**-500
                within = z + doubt < extent * (1.0 - _DOUBT)
                yield within, np.isfinite(z) & (z - doubt > extent * (1.0 + _DOUBT))


def _are_near(lengths: Any, other: Any) -> _Bools:
    """Whether rounding may hide which one is the larger."""
    near = np.abs(lengths - other) <= _UNITS * np.spacing(np.maximum(lengths, other))
    return np.asarray(near)


def _runs(rows: IntArray) -> tuple[_Members, _Members]:
    """Where rows of other two points begin, and how many there are of these."""
    is_new = np.ones(len(rows), bool)
    is_new[1:] = (rows[1:, :2] != rows[:-1, :2]).any(axis=1)
    starts = np.flatnonzero(is_new)
    return starts, np.diff(starts, append=len(rows))


def _square(vector: list[Fraction]) -> Fraction:
    return sum((x * x for x in vector), Fraction(0))


# ---- spheres around supports ---------------------------------------------------------------

def spheres_of(matrices: FloatArray, extent: float) -> FloatArray:
    """For each positive definite matrix a radius that no D with ``|H @ D| <= extent`` exceeds."""
    if len(matrices) == 0:
        return np.empty(0)
    exponents = np.frexp(np.abs(matrices).max(axis=(1, 2)))[1].astype(np.int64)
    scaled = np.ldexp(matrices, -exponents[:, None, None])
    values = np.linalg.eigvalsh(scaled)
    least = values[:, 0] - _SURE * values[:, -1]
    radii = np.zeros(len(matrices))
    for k, sure in enumerate(least > 0.5 * values[:, 0]):
        if sure:
            smallest = Fraction(float(least[k])) * Fraction(2) ** int(exponents[k])
        else:  # half of the smallest eigenvalue at least, and not more than it
            rows = [[Fraction(x) for x in row] for row in matrices[k].tolist()]
            smallest = min(row[a] for a, row in enumerate(rows))
            while not is_definite(
                [[x - smallest * (a == b) for b, x in enumerate(row)] for a, row in enumerate(rows)]
            ):
                smallest /= 2
        length = Fraction(extent) / smallest
        radii[k] = math.nextafter(float(length), math.inf) if length else 0.0
    return radii
