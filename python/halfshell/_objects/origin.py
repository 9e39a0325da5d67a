# SPDX-License-Identifier: BSD-3-Clause
"""What exact sorting needs of a table's search: its points, queries, box and shifts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.lengths import as_cutoff
from halfshell._convert.options import AUTO, as_flag
from halfshell._convert.scene import as_scene
from halfshell._convert.types import PointArray, Reach

FindShifts = Callable[["Origin"], npt.NDArray[Any]]
Floats = npt.NDArray[np.float64]


class Origin:
    """Points, queries and box of a search: copies, for the caller's may change.

    Parameters
    ----------
    points, queries : ndarray of float, shape (n, d) and (q, d)
        `queries` is None where the points themselves ask.
    vectors : ndarray of float64, shape (d,) or (d, d), or None
        The box.
    periodic
        As users pass it.
    find_shifts : callable, optional
        Returns S of all entries of all rows, for tables that have no shifts: called with this
        object when they are first needed.
    """

    __slots__ = ("_box", "_find_shifts", "_numbers", "_periodic", "_shifts", "points", "queries")

    def __init__(
        self,
        points: PointArray,
        queries: PointArray | None,
        vectors: Floats | None,
        periodic: Any,
        find_shifts: FindShifts | None = None,
    ) -> None:
        periods = tuple(periodic) if isinstance(periodic, list) else periodic
        box = None if vectors is None else vectors.copy()
        self._keep(
            points.copy(), None if queries is None else queries.copy(), box, periods, find_shifts
        )

    def _keep(
        self,
        points: PointArray,
        queries: PointArray | None,
        box: Floats | None,
        periodic: Any,
        find_shifts: FindShifts | None = None,
        shifts: npt.NDArray[Any] | None = None,
        numbers: npt.NDArray[Any] | None = None,
    ) -> None:
        self.points = points
        self.queries = queries
        self._box = box
        self._periodic = periodic
        self._find_shifts = find_shifts
        self._shifts = shifts
        self._numbers = numbers  # which points these are, ascending; None: all

    @classmethod
    def of_own(cls, *fields: Any) -> Origin:
        """As the constructor, of arrays that do not change: they are not copied.

        Further fields are all shifts, and the numbers of `points` if they are not all.
        """
        origin = cls.__new__(cls)
        origin._keep(*fields)
        return origin

    def asked_by(self, queries: PointArray | None, find_shifts: FindShifts) -> Origin:
        """The same points and box with these queries, which alone are copied."""
        own = None if queries is None else queries.copy()
        return Origin.of_own(self.points, own, self._box, self._periodic, find_shifts)

    def of_rows(
        self,
        rows: slice | npt.NDArray[Any],
        indices: npt.NDArray[Any],
        entries: Any,
        lacks_shifts: bool,
    ) -> Origin:
        """What these rows alone need, with the points that their entries name and no search.

        `entries` says which of all entries they are, for their shifts where the table has none.
        """
        _, vectors, bits = self.scene()
        points, numbers, queries = self.points, self._numbers, self.queries
        all_ask = queries is None and isinstance(rows, slice) and rows == slice(0, len(points))
        if not all_ask:
            queries = self.asking[rows]
            named = np.unique(indices)
            taken = points[self.places_of(named)]
            if taken.nbytes + named.nbytes < points.nbytes:
                points, numbers = taken, named
        shifts = self.shifts()[entries] if lacks_shifts else None
        return Origin.of_own(points, queries, vectors, bits, None, shifts, numbers)

    def places_of(self, indices: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Where in `points` these are, by their numbers."""
        return indices if self._numbers is None else np.searchsorted(self._numbers, indices)

    @property
    def asking(self) -> PointArray:
        """Whose rows they are."""
        return self.points if self.queries is None else self.queries

    def scene(self) -> tuple[PointArray, Floats | None, int]:
        """Points, box vectors and periodic bits as the core takes them."""
        if isinstance(self._periodic, int) and not isinstance(self._periodic, bool):
            return self.points, self._box, self._periodic
        return as_scene(self.points, self._box, self._periodic)

    @property
    def rows(self) -> Floats:
        """The box vectors that repeat; others are multiplied by no shift."""
        points, vectors, bits = self.scene()
        if vectors is None:
            return np.empty((0, points.shape[1]))
        repeats = np.array([bits >> k & 1 for k in range(len(vectors))], dtype=np.float64)
        return np.multiply(vectors, repeats[:, None])

    @property
    def has_images(self) -> bool:
        """Whether shifts may be other than zero."""
        return self.scene()[2] != 0

    def shifts(self) -> npt.NDArray[Any]:
        """S of all entries of all rows. Threads may ask at once: each then searches."""
        find = self._find_shifts  # before the shifts are looked at, which come before it goes
        found = self._shifts
        if found is None:
            assert find is not None
            self._shifts = found = find(self)
            self._find_shifts = None
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        return Origin.of_own, (
            self.points, self.queries, self._box, self._periodic, None, self._shifts, self._numbers,
        )  # fmt: skip


def shifts_of_search(
    cutoff: Any, inclusive: Any, precision: Any, threads: int | None, reach: Reach | None = None
) -> FindShifts:
    """A search for the shifts of all rows that `neighbors` returns for these arguments."""
    largest, includes_cutoff = as_cutoff(cutoff), as_flag(inclusive, "inclusive")
    own: Any = None  # the caller's arrays may change
    if reach is not None:
        own = copied(reach)

    def find(origin: Origin) -> npt.NDArray[Any]:
        points, vectors, bits = origin.scene()
        found = _core.neighbors(
            points, largest, vectors, bits, includes_cutoff, precision, None, None, None, threads,
            "S", 8, origin.queries, own, AUTO,
        )
        return found[1]

    return find


def copied(part: Any) -> Any:
    """A tuple with copies of the arrays in it."""
    if isinstance(part, tuple):
        return tuple(copied(one) for one in part)
    return part.copy() if isinstance(part, np.ndarray) else part
