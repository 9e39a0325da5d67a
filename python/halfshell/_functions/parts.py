# SPDX-License-Identifier: BSD-3-Clause
"""What a reach for each pair divides points into, and how many pairs that leaves to expect."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfshell._convert.reach import RULES
from halfshell._convert.types import FloatArray, Reach


class Parts(NamedTuple):
    """Points divided by octave of their radius, or by type."""

    counts: FloatArray  # points in each
    reach: FloatArray  # of a pair from each two, for radii about; negative: none
    largest: float  # of any pair
    reason: str

    def share(self, ndim: int) -> float:
        """Expected pairs over those that there would be if all had the largest reach."""
        if self.largest == 0.0 or len(self.counts) == 0:
            return 1.0
        volumes = np.maximum(self.reach / self.largest, 0.0) ** ndim
        weights = self.counts / self.counts.sum()
        return float(weights @ volumes @ weights)


def parts_of(reach: Reach, bound: float) -> Parts:
    """Those of one set of points; the rule has no direction."""
    rule, radii, _, types, _, table = reach
    if table is not None and types is not None:
        named, counts = np.unique(types, return_counts=True)
        among = table[np.ix_(named, named)]
        largest = max(float(among.max(initial=0.0)), 0.0)
        reason = f"{_several(len(named), 'type')}, each two of them searched with their own cutoff"
        return Parts(counts.astype(np.float64), among, largest, reason)
    assert radii is not None
    octave = np.where(radii > 0.0, np.frexp(radii)[1].astype(np.int64), -(1 << 20))
    _, place, counts = np.unique(octave, return_inverse=True, return_counts=True)
    middle = np.zeros(len(counts))
    np.maximum.at(middle, place.reshape(-1), 0.75 * radii)
    among = np.minimum(_combined(RULES[rule], middle[:, None], middle[None, :]), bound)
    top = float(radii.max(initial=0.0))
    largest = min(2.0 * top if RULES[rule] == "sum" else top, bound)
    reason = (
        f"{_several(len(counts), 'octave')} of radii up to {top:.4g}, each searched with cells of "
        "its own size"
    )
    return Parts(counts.astype(np.float64), np.minimum(among, largest), largest, reason)


def _combined(rule: str, a: FloatArray, b: FloatArray) -> FloatArray:
    if rule == "sum":
        return a + b
    if rule == "mean":
        return a / 2.0 + b / 2.0
    return np.maximum(a, b) if rule == "max" else np.minimum(a, b)


def _several(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"
