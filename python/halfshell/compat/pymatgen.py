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
    """Find all points within a distance of centres, as the function of pymatgen does.

    Parameters
    ----------
    all_coords : array_like of float, shape (n, 3)
        Cartesian coordinates of the points.
    center_coords : array_like of float, shape (q, 3)
        Cartesian coordinates of the centres. A point that lies on one is found at distance 0.
    r : float
        The cutoff radius.
    pbc : array_like of int, shape (3,)
        Which lattice vectors repeat: not 0.
    lattice : array_like of float, shape (3, 3)
        Lattice vectors as rows.
    tol : float, default 1e-8
        Added to the square of the radius, unless the radius is below `min_r`.
    min_r : float, default 1.0
        Spheres with a smaller radius are closed, and have no tolerance.

    Returns
    -------
    index1, index2 : ndarray of int64, shape (m,)
        Numbers of the centres and of the points.
    offset_vectors : ndarray of float64, shape (m, 3)
        The image of the point, in lattice vectors.
    distances : ndarray of float64, shape (m,)

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As `halfshell.pairs_between`.

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
