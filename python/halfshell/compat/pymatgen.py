# SPDX-License-Identifier: BSD-3-Clause
"""Points in spheres, in place of ``pymatgen.optimization.neighbors``.

The function has pymatgen's arguments, dtypes and shapes, and its rule: a point counts if the square
of its distance is less than ``r * r + tol``, or with r below `min_r` if the distance is at most r.
What distances are compared with is one float64 number; the comparison itself is exact here. The
order is ascending (index1, index2, offset); pymatgen promises none.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

import halfshell as hs

__all__ = ["find_points_in_spheres"]


def find_points_in_spheres(
    all_coords: npt.NDArray[Any],
    center_coords: npt.NDArray[Any],
    r: float,
    pbc: npt.NDArray[Any],
    lattice: npt.NDArray[Any],
    tol: float = 1e-8,
    min_r: float = 1.0,
) -> tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any]]:
    """Find all points within a distance of centres; see pymatgen's ``find_points_in_spheres``.

    Examples
    --------
    >>> import numpy as np
    >>> from halfshell.compat.pymatgen import find_points_in_spheres
    >>> points = np.array([[0.0, 0.0, 0.0], [2.5, 0.0, 0.0]])
    >>> i, j, offset, d = find_points_in_spheres(points, points[:1], 1.0, [1, 1, 1], np.eye(3) * 3)
    >>> j.tolist(), offset.tolist(), d.tolist()
    ([0, 1], [[0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], [0.0, 0.5])
    """
    periodic = [bool(axis) for axis in np.asarray(pbc).tolist()]
    is_small = float(r) < float(min_r)
    cutoff = float(r) if is_small else math.sqrt(float(r) * float(r) + float(tol))
    i, j, S, d = hs.pairs_between(
        center_coords, all_coords, cutoff, box=lattice, periodic=periodic, quantities="ijSd",
        inclusive=is_small,
    )  # fmt: skip
    return i, j, S.astype(np.float64), d
