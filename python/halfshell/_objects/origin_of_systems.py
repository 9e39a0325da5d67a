# SPDX-License-Identifier: BSD-3-Clause
"""What exact sorting needs of a table of many systems, each in a box of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell._convert.types import PointArray
from halfshell._objects.origin import FindShifts, Floats, Origin


class OriginOfSystems(Origin):
    """As `Origin`, where each row has a box."""

    __slots__ = ("_boxes", "_systems")

    _boxes: Floats  # one a system
    _systems: npt.NDArray[np.int64]  # of each row

    @classmethod
    def of(
        cls, points: PointArray, queries: PointArray | None, boxes: Floats, bits: int,
        find_shifts: FindShifts, systems: npt.NDArray[np.int64],
    ) -> OriginOfSystems:  # fmt: skip
        """Points and queries are copied, boxes and the system of each that asks are not."""
        origin = cls.__new__(cls)
        origin._keep(
            points.copy(), None if queries is None else queries.copy(),
            np.eye(points.shape[1]), bits, find_shifts,
        )  # fmt: skip
        origin._boxes, origin._systems = boxes, systems
        return origin

    def of_rows(
        self,
        rows: slice | npt.NDArray[Any],
        indices: npt.NDArray[Any],
        entries: Any,
        lacks_shifts: bool,
    ) -> Origin:
        part = super().of_rows(rows, indices, entries, lacks_shifts)
        return _of_systems(part, self._boxes, self._systems[rows])

    @property
    def rows(self) -> Floats:
        """The box vectors that repeat, of each row: shape (d, rows, d)."""
        bits = self.scene()[2]
        repeats = np.array([bits >> k & 1 for k in range(self._boxes.shape[1])], np.float64)
        vectors: Floats = (self._boxes * repeats[:, None])[self._systems].transpose(1, 0, 2)
        return vectors

    def __reduce__(self) -> tuple[Any, ...]:
        make, fields = super().__reduce__()
        return _of_systems, (make(*fields), self._boxes, self._systems)


def _of_systems(plain: Origin, boxes: Floats, systems: npt.NDArray[np.int64]) -> OriginOfSystems:
    origin = OriginOfSystems.__new__(OriginOfSystems)
    for name in Origin.__slots__:
        setattr(origin, name, getattr(plain, name))
    origin._boxes, origin._systems = boxes, systems
    return origin
