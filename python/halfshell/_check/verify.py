# SPDX-License-Identifier: BSD-3-Clause
"""Check a list of pairs from any library for missing, invented and repeated pairs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Never

import numpy as np
import numpy.typing as npt

from halfshell import _core, _show
from halfshell._convert.given import Given
from halfshell._convert.listed import as_listed
from halfshell._convert.memory import SMALL
from halfshell._convert.options import as_flag
from halfshell._convert.rules import DIRECTED
from halfshell._convert.search import as_rest, as_search_of_each, refuse_indefinite
from halfshell._convert.types import (
    ArrayLike,
    BoxLike,
    PairCutoff,
    PeriodicLike,
    PointArray,
    PointsLike,
    Reach,
    Rule,
)
from halfshell._functions.between import pairs_between as find_between
from halfshell._functions.pairs import pairs as find_pairs
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._unknown import refuse_unknown

IntArray = npt.NDArray[np.int64]
_CONFIRMED = 1000  # differences of each kind that are confirmed by rational arithmetic

# Bytes that comparing takes for each byte of the right list, which is found in one direction:
# a tenth more than measured, with a list of the caller's that is as long, of pairs with shifts.
_COMPARING = {"half": 20, "directed": 20, "full": 34}


@dataclass(frozen=True, eq=False)
class Verdict:
    """The result of `verify`; true if the list is right.

    Attributes
    ----------
    n_expected, n_given : int
        Number of true pairs, and of rows in the list.
    missed, spurious, duplicate : ndarray of int64, shape (k, 2) or (k, 2 + d)
        Pairs as rows (i, j, \\*S), or (i, j) when no shifts were given: not in the list, in the
        list but beyond the cutoff, and listed more often than they should be (once for each
        surplus row).
    is_full : bool
        Whether the list is a full list, with a row for each direction: then these are counted too.
    """

    n_expected: int
    n_given: int
    missed: IntArray
    spurious: IntArray
    duplicate: IntArray
    is_full: bool = False

    _shown = ("ok", "n_expected", "n_given", "missed", "spurious", "duplicate", "is_full")
    __repr__ = _show.line
    _repr_html_ = _show.html

    @property
    def ok(self) -> bool:
        """Whether nothing is missed, spurious or duplicate."""
        return self._n_wrong == 0

    @property
    def _n_wrong(self) -> int:
        return len(self.missed) + len(self.spurious) + len(self.duplicate)

    def __bool__(self) -> bool:
        return self.ok

    def __str__(self) -> str:
        what = " of a full list" if self.is_full else ""
        if self.ok:
            return f"correct: {self.n_expected} pairs{what}"
        lines = [f"wrong: {self.n_given} rows for {self.n_expected} pairs{what}"]
        for name in ("missed", "spurious", "duplicate"):
            rows = getattr(self, name)
            if len(rows):
                shown = ", ".join(str(tuple(row)) for row in rows[:5].tolist())
                more = ", ..." if len(rows) > 5 else ""
                lines.append(f"  {name:9} {len(rows)}: {shown}{more}")
        return "\n".join(lines)


def verify(
    points: PointsLike,
    cutoff: PairCutoff,
    i: ArrayLike | NeighborTable,
    j: ArrayLike | None = None,
    S: ArrayLike | None = None,
    *,
    queries: PointsLike | None = None,
    radii: ArrayLike | None = None,
    query_radii: ArrayLike | None = None,
    rule: Rule | None = None,
    types: npt.ArrayLike | None = None,
    query_types: npt.ArrayLike | None = None,
    supports: ArrayLike | None = None,
    query_supports: ArrayLike | None = None,
    extent: float | None = None,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    inclusive: bool = True,
    full: bool = False,
    **unknown: Never,
) -> Verdict:
    """Check a list of pairs, from any library; always exact.

    Parameters
    ----------
    points, cutoff, box, periodic, inclusive
        The scene, as in `pairs`. `inclusive` must be the rule of the list.
    i, j : array_like of int, shape (m,)
        The pairs, in any order and orientation. Or, as `i` alone, a `NeighborTable`: its rows, with
        their shifts if it has any; without `queries` they must be a full list.
    S : array_like of int, shape (m, d), optional
        Their shifts, with ``D = points[j] - points[i] + S @ box``. Without shifts, only the number
        of images of each pair of points is checked.
    queries : array_like of float, shape (q, d), optional
        Check a list of two sets, with i in `queries` and j in `points`, as from `pairs_between`
        or from `neighbors` with queries.
    radii, query_radii, rule, types, query_types, supports, query_supports, extent
        As in `neighbors`. A list for the rules "gather" or "scatter" has a direction, like a list
        of two sets.
    full : bool, default False
        Whether the list must have both (i, j, S) and (j, i, -S). A list that has both is known for
        a full list without this: where it is wrong as a half list, and less so as a full one. Only
        for arrays, one set of points and a rule without direction.

    Returns
    -------
    Verdict
        True if the list is right; otherwise it has the missed, spurious and duplicate pairs.

    Raises
    ------
    TypeError
        If `i`, `j` or `S` does not hold whole numbers, `inclusive` or `full` is not a bool, or a
        part of the scene is of the wrong kind.
    ValueError
        If `i`, `j` and `S` do not fit each other or the points, a table belongs to other points, or
        to queries that are not given, `full` is given for two sets or a rule with a direction, or
        `pairs` would refuse the points or box.
    OverflowError, MemoryError
        As for `pairs`, for the right list. Comparing it takes up to 20 times its memory, and for a
        full list 34 times, which must be available.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]
    >>> print(hs.verify(points, 2.0, [0, 1], [1, 2]))
    correct: 2 pairs
    >>> verdict = hs.verify(points, 2.0, [0], [2])
    >>> verdict.missed.tolist(), verdict.spurious.tolist()
    ([[0, 1], [1, 2]], [[0, 2]])
    >>> print(hs.verify(points, 2.0, hs.neighbors(points, 2.0)))
    correct: 4 pairs of a full list
    """
    if unknown:
        refuse_unknown(verify, unknown)
    full = as_flag(full, "full")
    given = Given(
        radii, query_radii, rule, types, query_types, supports, query_supports, extent
    )
    rest = as_rest(inclusive, "exact", None, None, None, None)
    search, asking, reach = as_search_of_each(
        points, cutoff, box, periodic, rest, given, queries, directed=True
    )
    if reach is not None:
        refuse_indefinite(search, reach)
    array, bound, vectors, bits = search[:4]
    flags = [bool(bits >> axis & 1) for axis in range(array.shape[1])]
    how: Any = {
        "box": vectors, "periodic": flags if vectors is not None else None, "inclusive": rest[0],
    }  # fmt: skip
    is_directed = asking is not None or rule in DIRECTED
    if isinstance(i, NeighborTable):
        if j is not None or S is not None or full:
            raise TypeError("a table has j, S and both directions itself: leave j, S and full out")
        _check_table(i, len(array), None if asking is None else len(asking), is_directed)
        full = not is_directed
        i, j, S = _columns(i)
    elif j is None:
        raise TypeError("j must be given, unless i is a NeighborTable")
    elif full and is_directed:
        raise ValueError("full is for pairs without a direction: leave out full, queries or rule")
    rows = _rows(i, j, S, array, asking)
    kind = "directed" if is_directed else LIST[full]
    how["memory_limit"] = max(SMALL, _core.available_memory() / _COMPARING[kind])
    right = _right(array, asking, bound, reach, how)
    expected = right.rows(with_shifts=S is not None)
    verdict = compare(expected, rows, kind)
    if kind == "half" and not verdict.ok and len(rows) > len(expected):
        as_full = compare(expected, rows, "full")
        if as_full._n_wrong < verdict._n_wrong:
            verdict = as_full
    if S is not None:
        _confirm(verdict, right, flags)
    return verdict


#: What a list is, by whether it is full.
LIST: dict[bool, Literal["half", "full"]] = {False: "half", True: "full"}


def compare(
    expected: IntArray, given: IntArray, kind: Literal["half", "full", "directed"]
) -> Verdict:
    """The verdict on rows (i, j, *S).

    expected: each pair once. given: a half list in any orientation, a full list, or, of two sets,
    rows that have one direction only.
    """
    if kind == "full":
        expected = np.concatenate([expected, _reversed(expected)])
    elif kind == "half":
        expected, given = _as_half(expected), _as_half(given)
    missed, surplus = _differences(expected, given)
    known = {tuple(row) for row in expected.tolist()} if len(surplus) else set()
    twice = np.array([tuple(row) in known for row in surplus.tolist()], dtype=bool)
    return Verdict(
        n_expected=len(expected),
        n_given=len(given),
        missed=missed,
        spurious=surplus[~twice],
        duplicate=surplus[twice],
        is_full=kind == "full",
    )


def _check_table(table: NeighborTable, n: int, q: int | None, is_directed: bool) -> None:
    """ValueError unless rows and points of a table are as many as those of the scene."""
    if table.n_points != n:
        raise ValueError(f"i is a table of {table.n_points} points, got {n} points")
    if not is_directed:
        table._refuse_queries("verify without queries")
    elif q is not None and table.n_rows != q:
        raise ValueError(f"i is a table of {table.n_rows} rows, got {q} queries")
    elif q is None and table.n_rows != n:
        raise ValueError(f"i is a table of {table.n_rows} rows, got {n} points")


def _columns(table: NeighborTable) -> tuple[Any, Any, Any]:
    """i, j and S of the entries; None for shifts that the table does not have."""
    if "S" in table.quantities:
        i, j, S = table.to_pairs(quantities="ijS")
        return i, j, S
    return *table.to_pairs(quantities="ij"), None


def _rows(i: Any, j: Any, S: Any, points: PointArray, queries: PointArray | None) -> IntArray:
    """The list as rows (i, j) or (i, j, *S), checked."""
    n_queries = None if queries is None else len(queries)
    first, second, shifts = as_listed(i, j, S, points.shape[1], len(points), n_queries)
    parts = (first, second) if shifts is None else (first, second, shifts)
    return np.column_stack(parts)


def _reversed(rows: IntArray) -> IntArray:
    """(j, i, -S) for each (i, j, S)."""
    turned = rows.copy()
    turned[:, 0], turned[:, 1] = rows[:, 1], rows[:, 0]
    turned[:, 2:] *= -1
    return turned


def _as_half(rows: IntArray) -> IntArray:
    """Each row turned so that i < j, or i == j with the first nonzero component of S positive."""
    backward = rows[:, 0] > rows[:, 1]
    same = rows[:, 0] == rows[:, 1]
    undecided = same
    for column in range(2, rows.shape[1]):
        backward |= undecided & (rows[:, column] < 0)
        undecided = undecided & (rows[:, column] == 0)
    return np.where(backward[:, None], _reversed(rows), rows)


def _differences(expected: IntArray, given: IntArray) -> tuple[IntArray, IntArray]:
    """Rows that are expected more often than given, and given more often than expected."""
    every = np.concatenate([expected, given])
    if not len(every):
        return every, every
    unique, inverse = np.unique(every, axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    wanted = np.bincount(inverse[: len(expected)], minlength=len(unique))
    present = np.bincount(inverse[len(expected) :], minlength=len(unique))
    missed = np.repeat(unique, np.maximum(wanted - present, 0), axis=0)
    surplus = np.repeat(unique, np.maximum(present - wanted, 0), axis=0)
    return missed, surplus


class _ByCutoff:
    """The right list where all pairs have the same cutoff, and what decides on one of them."""

    def __init__(
        self, points: PointArray, queries: PointArray | None, cutoff: float, how: dict[str, Any]
    ) -> None:
        self.points = points
        self.asking = points if queries is None else queries
        self.is_one_set = queries is None
        self.cutoff = cutoff
        self.how = how

    def rows(self, with_shifts: bool) -> IntArray:
        """(i, j) or (i, j, *S) of each pair, once."""
        how = {"quantities": "ijS" if with_shifts else "ij", **self.how}
        if self.is_one_set:
            found = find_pairs(self.points, self.cutoff, **how)
        else:
            found = find_between(self.asking, self.points, self.cutoff, **how)
        return np.column_stack(tuple(found)).astype(np.int64)

    def holds(self, i: int, j: int, *shift: int) -> bool:
        """Whether this is within the cutoff, in rational arithmetic."""
        # Here, because importing fractions takes longer than the rest.
        from fractions import Fraction

        from halfshell._check.reference import exact_square

        square = exact_square((self.asking[i], self.points[j]), 0, 1, shift, self.how["box"])
        limit = Fraction(self.cutoff) ** 2
        return square <= limit if self.how["inclusive"] else square < limit


def _right(
    points: PointArray,
    queries: PointArray | None,
    bound: float,
    reach: Reach | None,
    how: dict[str, Any],
) -> Any:
    """The right list, for one cutoff or for a reach of each pair."""
    if reach is None:
        return _ByCutoff(points, queries, bound, how)
    if reach[-1] is not None:
        from halfshell._check.by_supports import BySupports

        return BySupports(points, queries, bound, reach, how)
    from halfshell._check.by_reach import ByReach  # here, as it imports fractions

    return ByReach(points, queries, bound, reach, how)


def _confirm(verdict: Verdict, right: Any, periodic: list[bool]) -> None:
    """Recompute the differences in rational arithmetic, which shares nothing with the search."""
    for rows, should_hold in ((verdict.missed, True), (verdict.spurious, False)):
        for i, j, *shift in rows[:_CONFIRMED].tolist():
            if right.is_one_set and i == j and not any(shift):
                continue  # a point with itself is never a pair
            if any(s and not repeats for s, repeats in zip(shift, periodic)):
                continue  # nor is anything across an axis that does not repeat
            if right.holds(i, j, *shift) != should_hold:
                raise AssertionError(
                    f"the search and rational arithmetic disagree on pair {(i, j, *shift)}"
                )
