# SPDX-License-Identifier: BSD-3-Clause
"""What a reach for each pair divides points into, in words."""

from __future__ import annotations

import numpy as np

from halfshell._convert.types import FloatArray, Reach


def parts_of(reach: Reach) -> str:
    """Those of one set of points."""
    radii, types, supports, extent = reach[1], reach[3], reach[6], reach[8]
    if types is not None:
        n = len(np.unique(types))
        return f"{_several(n, 'type')}, each two of them searched with their own cutoff"
    what = "radii"
    if supports is not None and extent is not None:
        radii, what = _spheres(supports, extent), "supports"
    assert radii is not None
    top = float(radii.max(initial=0.0))
    return (
        f"{_several(_octaves(radii, top), 'octave')} of {what} up to {top:.4g}, each searched "
        "with cells of its own size"
    )


def _octaves(radii: FloatArray, top: float) -> int:
    """How many have a point: counted from the largest, which with its half is of the first."""
    if top == 0.0:
        return min(len(radii), 1)
    part = radii / top
    exponents = np.where(part > 0.0, np.minimum(np.frexp(part)[1].astype(np.int64), 0), -(1 << 20))
    return len(np.unique(exponents))


def _spheres(supports: FloatArray, extent: float) -> FloatArray:
    """About how far each support reaches."""
    sizes = np.abs(supports).max(axis=(1, 2), initial=0.0)
    least = np.linalg.eigvalsh(supports / sizes[:, None, None])[:, 0] * sizes
    reach: FloatArray = extent / np.maximum(least, np.finfo(np.float64).tiny)
    return reach


def _several(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"
