# SPDX-License-Identifier: BSD-3-Clause
"""What `clusters` returns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from halfshell import _show

__all__ = ["Clusters"]


class Clusters(NamedTuple):
    """The clusters of points that `clusters` returns.

    Attributes
    ----------
    labels : ndarray of int64, shape (n,)
        The cluster of each point, from 0 on, in the order of their lowest core points; -1 for
        points that belong to none.
    sizes : ndarray of int64, shape (c,)
        Number of points in each cluster.
    core : ndarray of bool, shape (n,)
        Which points have `min_points` points within their cutoff, themselves included.
    winding : ndarray of bool, shape (c, d), or None
        Whether each cluster winds along each box vector; None without ``winding=True``.

    Examples
    --------
    >>> import halfshell as hs
    >>> found = hs.clusters([[0.0], [1.0], [5.0]], 1.5)
    >>> found.labels.tolist(), found.sizes.tolist()
    ([0, 0, 1], [2, 1])
    """

    labels: npt.NDArray[np.int64]
    sizes: npt.NDArray[np.int64]
    core: npt.NDArray[np.bool_]
    winding: npt.NDArray[np.bool_] | None

    def __repr__(self) -> str:
        return _show.line(self)

    def _repr_html_(self) -> str:
        return _show.html(self)
