# SPDX-License-Identifier: BSD-3-Clause
"""Counting pairs within several cutoffs: one search, each cutoff an edge of a histogram."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from halfshell import _core
from halfshell._convert import inputs as _inputs
from halfshell._convert.options import Rest


def count_within(
    cutoffs: _inputs.FloatArray,
    points: Any,
    box: _inputs.FloatArray | None,
    bits: int,
    rest: Rest,
    queries: _inputs.PointArray | None = None,
) -> npt.NDArray[np.int64]:
    """How many pairs are within each of the cutoffs, which ascend and are at least 0.

    points: an array, or cells of the core in place of points and box.
    """
    if isinstance(rest[1], str) and rest[1] == "exact" and len(cutoffs) > 1:
        edges = np.ascontiguousarray(cutoffs)
        between: npt.NDArray[np.int64] = _core.histogram(
            points, 0.0, box, bits, *rest, edges, rest[0], queries, 1, None, None, None, None
        )
        return np.cumsum(between[0, 0])
    # Without any, all else is checked as ever.
    counts = [
        _core.count_pairs(points, one, box, bits, *rest)
        if queries is None
        else _core.count_between(points, one, box, bits, *rest, queries)
        for one in cutoffs.tolist() or [0.0]
    ]
    return np.array(counts[: len(cutoffs)], dtype=np.int64)
