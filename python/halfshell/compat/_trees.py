# SPDX-License-Identifier: BSD-3-Clause
"""What the trees of `halfshell.compat.scipy` decide themselves, and how: arguments and searches."""

from __future__ import annotations

import operator
import os
from itertools import pairwise
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt

import halfshell as hs

Points = npt.NDArray[np.float64]

#: With fewer queries than this share of the points a tree leads to candidates, in less time than
#: all points are sorted into cells; these decide among them.
_FEW = 1.0 / 256.0

#: What is beyond this wraps in SciPy, which then reads what lies before its results.
_LAST = np.iinfo(np.intp).max


class TreeSearches:
    """To stand before one of SciPy's trees: which arguments are ours, and the searches."""

    data: Points
    maxes: Points
    mins: Points
    boxsize: Points | None
    n: int
    m: int

    # ---- what is ours ----------------------------------------------------------------------

    def _is_for(self, p: Any, eps: Any) -> bool:
        numbers = isinstance(p, Real) and isinstance(eps, Real)
        return numbers and p == 2 and eps == 0 and 1 <= self.m <= 8

    def _asked(self, x: Any, p: Any, eps: Any) -> Points | None:
        """Queries in rows, or None if they are not plain numbers."""
        array = np.asarray(x)
        if not self._is_for(p, eps) or array.dtype.kind not in "fiu" or array.itemsize > 8:
            return None
        if array.ndim == 0 or array.shape[-1] != self.m or not np.isfinite(array).all():
            return None
        return np.ascontiguousarray(array.reshape(-1, self.m), np.float64)

    def _has_box_of(self, other: Any) -> bool:
        if self.boxsize is None or other.boxsize is None:
            return self.boxsize is None and other.boxsize is None
        return np.array_equal(self.boxsize, other.boxsize)

    def _box(self) -> dict[str, Any]:
        if self.boxsize is None or not (self.boxsize > 0.0).any():
            return {"box": None, "periodic": None}
        periodic = self.boxsize > 0.0
        return {"box": np.where(periodic, self.boxsize, 0.0), "periodic": periodic}

    def _half(self) -> float:
        """Half the shortest period: what is closer has no other image that is."""
        if self.boxsize is None:
            return np.inf
        return float(np.min(self.boxsize, where=self.boxsize > 0.0, initial=np.inf)) / 2.0

    def _is_near(self, r: Any) -> bool:
        return isinstance(r, Real) and 0.0 <= float(r) < self._half()

    def _radii(self, r: Any, shape: tuple[int, ...]) -> float | Points | None:
        if isinstance(r, Real):
            return float(r) if self._is_near(r) else None
        try:
            radii = np.broadcast_to(np.asarray(r, np.float64), shape).reshape(-1)
        except (TypeError, ValueError):
            return None
        if not ((radii >= 0.0) & (radii < self._half())).all():
            return None
        if len(radii) and (radii == radii[0]).all():
            return float(radii[0])
        return np.ascontiguousarray(radii)

    def _limits(self, r: Any, cumulative: Any) -> tuple[Points, npt.NDArray[np.intp]] | None:
        """Ascending radii, and where each of `r` is among them."""
        try:
            radii = np.asarray(r, np.float64)
        except (TypeError, ValueError):
            return None
        if radii.ndim > 1 or not radii.size or not (radii >= 0.0).all():
            return None
        if not (radii < self._half()).all():
            return None
        within, places = np.unique(radii, return_inverse=True)
        if not cumulative and (np.diff(places.reshape(-1)) < 0).any():
            return None
        return within, places.reshape(-1)

    # ---- searches --------------------------------------------------------------------------

    def _is_few(self, asked: Points) -> bool:
        return len(asked) < _FEW * self.n

    def _candidates(self, asked: Points, radii: Any) -> npt.NDArray[np.intp] | None:
        """Ascending numbers of all points within these radii of any, and some more; or None."""
        ends = (asked.min(), asked.max(), self.mins.min(), self.maxes.max())
        largest = max(map(abs, ends))
        wide = np.add(radii, 1e-14 * self.m * (largest + np.max(radii))) + 1e-150
        if not (wide < self._half()).all():
            return None
        found = super().query_ball_point(asked, wide)  # type: ignore[misc]
        return np.unique(np.concatenate([np.asarray(one, np.intp) for one in found]))

    def _balls(self, asked: Points, radii: Any, threads: int) -> tuple[Any, Any]:
        """Offsets and numbers of all points within these radii."""
        points, numbers = self.data, None
        if len(asked) and self._is_few(asked):
            numbers = self._candidates(asked, radii)
            points = self.data if numbers is None else self.data[numbers]
        each: dict[str, Any] = {"threads": threads or None, "queries": asked, **self._box()}
        if isinstance(radii, float):
            rows = hs.neighbors(points, radii, **each)
        else:
            each["queries"] = hs.Points(asked, radii=radii)
            rows = hs.neighbors(points, None, rule="gather", **each)
        return rows.offsets, rows.indices if numbers is None else numbers[rows.indices]

    def _nearest(self, asked: Points, k: int, bound: float, threads: int) -> tuple[Any, Any]:
        """Numbers and distances, with n and infinity where there are none."""
        k, points, numbers = min(k, self.n), self.data, None
        if len(asked) and self._is_few(asked):
            far: Any = super().query(asked, [k])[0]  # type: ignore[misc]
            if np.isfinite(far).all():
                numbers = self._candidates(asked, np.minimum(far[:, 0], bound))
                points = self.data if numbers is None else self.data[numbers]
        within = min(max(bound, 0.0), float(np.nextafter(self._half(), 0.0)))
        within = bound if self._half() == np.inf else within
        scene: dict[str, Any] = {"threads": threads or None, **self._box()}
        i, d = hs.nearest(points, k, queries=asked, max_distance=within, **scene)
        near = np.nextafter(np.nextafter(bound, 0.0), 0.0)
        ties = np.flatnonzero(((d >= near) & (bound < np.inf)).any(axis=1))
        if len(ties):  # closer, in real numbers?
            closer = hs.coordination(points, bound, queries=asked[ties], inclusive=False, **scene)
            kept = np.arange(k) < closer[:, None]
            i[ties], d[ties] = np.where(kept, i[ties], -1), np.where(kept, d[ties], np.inf)
        none = i < 0
        if numbers is not None:
            i = np.append(numbers, self.n)[i]
        i[none] = self.n
        if within < bound:
            rest = np.flatnonzero(none.any(axis=1))
            if len(rest):  # images half a period away, or more
                each = np.arange(1, k + 1)
                d[rest], i[rest] = super().query(  # type: ignore[misc]
                    asked[rest], each, distance_upper_bound=bound
                )
        return i.astype(np.intp, copy=False), d


def as_bound(bound: Any) -> float | None:
    """A bound that is a plain number and not negative."""
    return float(bound) if isinstance(bound, Real) and float(bound) >= 0.0 else None


def as_threads(workers: Any) -> int | None:
    """Threads, 0 for all; None for what SciPy is to judge."""
    if not isinstance(workers, int | np.integer) or isinstance(workers, bool):
        return None
    if workers == -1:
        return 0 if os.cpu_count() else None
    return int(workers) if 0 < workers < 1 << 16 else None


def as_ranks(k: Any) -> tuple[npt.NDArray[np.intp], bool] | None:
    """Which neighbours, and whether there is no axis for them; None for what SciPy is to judge."""
    try:
        most = operator.index(k)
        return (np.arange(1, most + 1), most == 1) if most > 0 else None
    except TypeError:
        pass
    ranks = np.asarray(k)
    if ranks.ndim != 1 or not ranks.size or ranks.dtype.kind not in "biuf":
        return None
    if not ((ranks >= 1) & (ranks <= _LAST)).all():
        raise ValueError(f"k must be 1 or more, as 1 is the nearest neighbour, got {k!r}")
    if ranks.dtype.kind not in "iu":
        return None
    return ranks.astype(np.intp), False


def columns_of(found: npt.NDArray[Any], ranks: npt.NDArray[np.intp], missing: float) -> Any:
    """These columns, from 1, of which there may be fewer."""
    if len(ranks) == found.shape[1] and ranks[0] == 1 and (np.diff(ranks) == 1).all():
        return found
    result = np.full((len(found), len(ranks)), missing, found.dtype)
    there = ranks <= found.shape[1]
    result[:, there] = found[:, ranks[there] - 1]
    return result


def as_lists(offsets: npt.NDArray[Any], j: npt.NDArray[Any]) -> list[list[int]]:
    numbers, ends = j.tolist(), offsets.tolist()
    return [numbers[a:b] for a, b in pairwise(ends)]


def as_weights(weights: Any, tree: Any, other: Any) -> tuple[Any, Any] | None:
    """Those of both trees; None for what SciPy is to judge."""
    if weights is None:
        return None, None
    if not isinstance(weights, tuple):
        if other is not tree:
            return None
        weights = weights, weights
    if len(weights) != 2:
        return None
    for one, of in zip(weights, (tree, other)):
        if one is None:
            continue
        array = np.asarray(one)
        if array.dtype.kind not in "fiu" or array.shape != (getattr(of, "n", -1),):
            return None
        if not np.isfinite(array).all():
            return None
    own, others = (None if one is None else np.asarray(one, np.float64) for one in weights)
    return own, others
