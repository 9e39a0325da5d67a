# SPDX-License-Identifier: BSD-3-Clause
"""Check a list of pairs from any library for missing, invented and repeated pairs."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, cast

import numpy as np
import numpy.typing as npt

from halfshell import _core, _show
from halfshell._convert.arrays import are_backward, as_listed
from halfshell._convert.call import DIRECTED, Call, each_system, part_of, take
from halfshell._convert.foreign import is_a
from halfshell._convert.memory import SMALL
from halfshell._convert.options import as_flag
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._search import search
from halfshell._settings import settings

if TYPE_CHECKING:
    from typing import Unpack

    from halfshell._check.right import Right
    from halfshell._convert.types import ArrayLike, CutoffLike, OptionsOfPoints, PointsLike

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
        cause = cause_of(self.missed, self.spurious)
        return "\n".join([*lines, f"  {cause}"] if cause else lines)


def cause_of(missed: IntArray, spurious: IntArray) -> str:
    """What explains all differences, if they are those of shifts that mean something else."""
    if not len(missed) or missed.shape[1] < 3:
        return ""
    turned = spurious * np.repeat([1, -1], [2, missed.shape[1] - 2])
    if not any(map(len, _differences(missed, turned))):
        return "S has the other sign: a pair is points[j] - points[i] + S @ box"
    if not any(map(len, _differences(missed[:, :2], spurious[:, :2]))):
        return "only S is wrong: it belongs to the points as given, wrapped into the box or not"
    return ""


@search()
def verify(
    points: PointsLike,
    cutoff: CutoffLike,
    i: ArrayLike | NeighborTable,
    j: ArrayLike | None = None,
    S: ArrayLike | None = None,
    *,
    queries: PointsLike | None = None,
    full: bool = False,
    **search: Unpack[OptionsOfPoints],
) -> Verdict:
    """Check a list of pairs, from any library; always exact.

    Parameters
    ----------
    {points, cutoff}
    i, j : array_like of int, shape (m,)
        The pairs, in any order and orientation. Or, as `i` alone, a `NeighborTable`: its rows, with
        their shifts if it has any.
    S : array_like of int, shape (m, d), optional
        Their shifts, with ``D = points[j] - points[i] + S @ box``. Without shifts, only the number
        of images of each pair of points is checked.
    queries : array_like of float, shape (q, d), or Points, optional
        For a list of two sets, with i in `queries` and j in `points`, as from `pairs_between` or
        from `neighbors` with queries. Such a list has a direction, and so have those for the rules
        "gather" and "scatter".
    {box, periodic, rule, exclude, min_distance}
    indices : array_like of int, shape (r,), optional
        For a list of the pairs that have one of these points; with `full`, or as a table, of their
        rows.
    inclusive : bool, default True
        Whether a pair at exactly its cutoff counts: the rule of the list.
    full : bool, default False
        Whether the list must have both (i, j, S) and (j, i, -S). A list that has both is known for
        a full list without this: where it is wrong as a half list, and less so as a full one. Only
        for arrays, one set of points and a rule without direction.
    {threads, progress}

    Returns
    -------
    Verdict
        True if the list is right; otherwise it has the missed, spurious and duplicate pairs.

    Raises
    ------
    TypeError
        If `i`, `j` or `S` does not hold whole numbers, or another argument is of the wrong kind.
    ValueError
        If `i`, `j` and `S` do not fit each other or the points, a table belongs to other points, or
        to queries that are not given, `full` is given for two sets or a rule with a direction, or
        `pairs` would refuse the points or box.
    OverflowError, MemoryError
        As for `pairs`, for the right list. Comparing it takes up to 20 times its memory, and for a
        full list 34 times, which must be available.

    Notes
    -----
    With radii, types, supports, groups or excluded pairs the right list comes from searches that
    have one cutoff each, and from what rational arithmetic says of the pairs that they find. The
    first 1000 differences of a kind are confirmed in rational arithmetic in any case.

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
    full = as_flag(full, "full")
    with settings(precision="exact"):
        call = take(points, cutoff, queries, directed=True, **search)
    is_directed = call.queries is not None or call.rule in DIRECTED
    if is_a(i, NeighborTable):
        if j is not None or S is not None or full:
            raise TypeError("a table has j, S and both directions itself: leave j, S and full out")
        table = cast("NeighborTable", i)
        if table.n_points != len(call.points):
            raise ValueError(
                f"i is a table of {table.n_points} points, got {len(call.points)} points"
            )
        if call.indices is None and not is_directed:
            table._refuse_queries("verify without queries")
        askers = {"queries": call.queries, "indices": call.indices, "points": call.points}
        what, wanted = next((name, len(one)) for name, one in askers.items() if one is not None)
        if table.n_rows != wanted:
            raise ValueError(f"i is a table of {table.n_rows} rows, got {wanted} {what}")
        full = not is_directed
        i, j, *shifts = table.to_pairs(quantities="ijS" if "S" in table.quantities else "ij")
        i, S = i if call.indices is None else call.indices[i], shifts[0] if shifts else None
    elif j is None:
        raise TypeError("j must be given, unless i is a NeighborTable; of pairs P: i, j = P.T")
    elif full and is_directed:
        raise ValueError("full is for pairs without a direction: leave out full, queries or rule")
    n_queries = None if call.queries is None else len(call.queries)
    columns = as_listed(i, j, S, call.array.shape[1], len(call.points), n_queries)
    rows = np.column_stack(columns[: 2 if S is None else 3])  # type: ignore[arg-type]
    kind: Kind = "directed" if is_directed else LIST[full]
    limit = call.settings.memory_limit
    limit = (_core.available_memory() if limit is None else limit) / _COMPARING[kind]
    with settings(precision="exact", memory_limit=max(SMALL, limit)):
        right = _RightOfAll(call)
        expected = right.rows(with_shifts=S is not None)
    call.close()
    verdict = compare(expected, rows, kind, call.indices)
    if kind == "half" and not verdict.ok and len(rows) > len(expected):
        as_full = compare(expected, rows, "full", call.indices)
        if as_full._n_wrong < verdict._n_wrong:
            verdict = as_full
    if S is not None:  # confirmed in rational arithmetic, which shares nothing with the search
        chosen = None if call.indices is None else set(call.indices.tolist())
        ends = slice(1 if verdict.is_full or is_directed else 2)
        for wrong, should_hold in ((verdict.missed, True), (verdict.spurious, False)):
            for row in wrong[:_CONFIRMED].tolist():
                is_chosen = chosen is None or not chosen.isdisjoint(row[ends])
                if (is_chosen and right.holds(*row)) != should_hold:
                    raise AssertionError(
                        f"the search and rational arithmetic disagree on pair {tuple(row)}"
                    )
    return verdict


Kind = Literal["half", "full", "directed"]
#: What a list is, by whether it is full.
LIST: dict[bool, Kind] = {False: "half", True: "full"}


def compare(
    expected: IntArray, given: IntArray, kind: Kind, indices: IntArray | None = None
) -> Verdict:
    """The verdict on rows (i, j, *S).

    expected: each pair once. given: a half list in any orientation, a full list, or, of two sets,
    rows that have one direction only. indices: those of which pairs, or rows, are expected.
    """
    if kind == "full":
        expected = np.concatenate([expected, _reversed(expected)])
    elif kind == "half":
        expected, given = _as_half(expected), _as_half(given)
    if indices is not None:
        most = max(expected[:, :2].max(initial=-1), indices.max(initial=-1))
        times = np.bincount(indices, minlength=most + 1)
        if kind == "half":
            expected = expected[times[expected[:, :2]].any(axis=1)]
        else:
            expected = np.repeat(expected, times[expected[:, 0]], axis=0)
    wrong = _differences(expected, given)
    return Verdict(len(expected), len(given), *wrong, is_full=kind == "full")


def _reversed(rows: IntArray) -> IntArray:
    turned = rows.copy()
    turned[:, 0], turned[:, 1] = rows[:, 1], rows[:, 0]
    turned[:, 2:] *= -1
    return turned


def _as_half(rows: IntArray) -> IntArray:
    """Each row turned so that i < j, or i == j with the first nonzero component of S positive."""
    backward = are_backward(rows[:, 0], rows[:, 1], rows[:, 2:])
    return np.where(backward[:, None], _reversed(rows), rows)


def _differences(expected: IntArray, given: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Rows that are given less often than expected; that are not expected at all; or more often."""
    every = np.concatenate([expected, given])
    if not len(every):
        return every, every, every
    unique, inverse = np.unique(every, axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    wanted = np.bincount(inverse[: len(expected)], minlength=len(unique))
    surplus = np.bincount(inverse[len(expected) :], minlength=len(unique)) - wanted
    return (
        np.repeat(unique, np.maximum(-surplus, 0), axis=0),
        np.repeat(unique, np.where(wanted == 0, surplus, 0), axis=0),
        np.repeat(unique, np.where(wanted > 0, np.maximum(surplus, 0), 0), axis=0),
    )


class _RightOfAll:
    """The right list of a call, system by system, and what decides on one of its pairs."""

    def __init__(self, call: Call) -> None:
        from halfshell._check.right import Right  # here, as fractions are slow to import

        self._progress = call.progress
        self._n_dims = call.array.shape[1]
        self._batches = call.points.batch, call.queries and call.queries.batch
        self._systems: list[tuple[Right, int, int]]  # each with its first query and point
        if call.points.batch is None:
            self._systems = [(Right(call), 0, 0)]
            return
        asking = call.points.batch if call.queries is None else call.queries.batch
        assert asking is not None
        firsts = np.searchsorted(asking, np.unique(call.points.batch)).tolist()
        self._systems = [
            (Right(one), first_asking, first)
            for (one, first), first_asking in zip(each_system(call), firsts, strict=True)
        ]

    def rows(self, with_shifts: bool) -> IntArray:
        """(i, j) or (i, j, *S) of each pair, once."""
        found = [np.empty((0, 2 + self._n_dims * with_shifts), np.int64)]
        for k, (right, i, j) in enumerate(self._systems):
            rows = right.rows(with_shifts, part_of(self._progress, k, len(self._systems)))
            found.append(rows + ([i, j] + [0] * (rows.shape[1] - 2)) if i or j else rows)
        return np.concatenate(found) if len(found) > 2 else found[-1]

    def holds(self, i: int, j: int, *shift: int) -> bool:
        """Whether this is one of the pairs, in rational arithmetic."""
        own, asking = self._batches
        k = 0
        if own is not None:
            if own[j] != (own if asking is None else asking)[i]:
                return False
            k = bisect_right([first for *_, first in self._systems], j) - 1
        right, first_asking, first = self._systems[k]
        return right.holds(i - first_asking, j - first, *shift)
