# SPDX-License-Identifier: BSD-3-Clause
"""What a table of neighbours was made from: for exact comparisons of its distances."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert.arrays import PointArray
from halfshell._convert.lengths import as_cutoff
from halfshell._convert.options import as_flag
from halfshell._convert.scene import as_scene

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
        object, at most once.
    """

    __slots__ = ("_box", "_find_shifts", "_periodic", "_shifts", "points", "queries")

    def __init__(
        self,
        points: PointArray,
        queries: PointArray | None,
        vectors: Floats | None,
        periodic: Any,
        find_shifts: FindShifts | None = None,
    ) -> None:
        self.points = points.copy()
        self.queries = None if queries is None else queries.copy()
        self._box = None if vectors is None else vectors.copy()
        self._periodic = tuple(periodic) if isinstance(periodic, list) else periodic
        self._find_shifts = find_shifts
        self._shifts: npt.NDArray[Any] | None = None

    def asked_by(self, queries: PointArray | None, find_shifts: FindShifts) -> Origin:
        """The same points and box, not copied again, with these queries."""
        other = Origin.__new__(Origin)
        other.__setstate__({
            "points": self.points, "_box": self._box, "_periodic": self._periodic,
            "queries": None if queries is None else queries.copy(),
            "_find_shifts": find_shifts, "_shifts": None,
        })  # fmt: skip
        return other

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
        """S of all entries of all rows."""
        if self._shifts is None:
            assert self._find_shifts is not None
            self._shifts, self._find_shifts = self._find_shifts(self), None
        return self._shifts

    def __getstate__(self) -> dict[str, Any]:
        if self.has_images:
            self.shifts()  # searches are not pickled
        state = {name: getattr(self, name) for name in self.__slots__}
        return {**state, "_find_shifts": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            setattr(self, name, value)


def shifts_of_search(
    cutoff: Any, inclusive: Any, precision: Any, threads: int | None
) -> FindShifts:
    """A search for the shifts of all rows that `neighbors` returns for these arguments."""
    reach, includes_cutoff = as_cutoff(cutoff), as_flag(inclusive, "inclusive")

    def find(origin: Origin) -> npt.NDArray[Any]:
        points, vectors, bits = origin.scene()
        found = _core.neighbors(
            points, reach, vectors, bits, includes_cutoff, precision, None, None, None, threads,
            "S", 8, origin.queries,
        )
        return found[1]

    return find
