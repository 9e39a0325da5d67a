# SPDX-License-Identifier: BSD-3-Clause
"""Trees in place of those of ``scipy.spatial``.

They are subclasses of SciPy's, with its arguments, attributes, dtypes, shapes and errors, and its
rule: a pair counts up to the radius, that included (``<=``), and a nearest neighbour if it is
closer than `distance_upper_bound` (``<``). Here that is decided for the exact values of the
floats, while SciPy compares rounded squares. So the answers differ if rounding decides SciPy's.

With `boxsize` the nearest image of a point counts, as there. SciPy itself answers what is not
decided here: `p` other than 2, `eps` above 0, more than 8 dimensions, radii that are negative or
infinite, and, with `boxsize`, distances of half a period or more.

Lists of neighbours ascend, also where SciPy's have no order; among neighbours at the same distance
`query` has the lowest numbers. `workers` is the number of threads; methods without it use as many
as `halfshell.pairs`.
"""

from __future__ import annotations

import operator
import os
from itertools import pairwise
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.spatial as _owner
from scipy.sparse import coo_matrix

import halfshell as hs
from halfshell._convert.call import take
from halfshell._functions.counts import Marks, binned

__all__ = ["KDTree", "cKDTree"]

_ENTRY = np.dtype([("i", np.intp), ("j", np.intp), ("v", np.float64)], align=True)
_Points = npt.NDArray[np.float64]

#: With fewer queries than this share of the points a tree leads to candidates, in less time than
#: all points are sorted into cells; these decide among them.
_FEW = 1.0 / 256.0

#: What is beyond this wraps in SciPy, which then reads what lies before its results.
_LAST = np.iinfo(np.intp).max


class _Searches:
    """The searches of a tree, to stand before one of SciPy's classes."""

    data: _Points
    maxes: _Points
    mins: _Points
    boxsize: _Points | None
    n: int
    m: int
    _index: type = int

    def query(
        self,
        x: Any,
        k: Any = 1,
        eps: Any = 0.0,
        p: Any = 2.0,
        distance_upper_bound: Any = np.inf,
        workers: Any = 1,
    ) -> Any:
        """As SciPy's; but ValueError if any of `k` is less than 1, where SciPy crashes."""
        asked, threads, ranks = self._asked(x, p, eps), _as_threads(workers), _as_ranks(k)
        bound = _as_bound(distance_upper_bound)
        if asked is None or threads is None or ranks is None or bound is None or not self.n:
            return super().query(x, k, eps, p, distance_upper_bound, workers)  # type: ignore[misc]
        columns, squeezed = ranks
        shape = np.shape(x)[:-1]
        i, d = self._nearest(asked, int(columns.max()), bound, threads)
        i, d = _columns_of(i, columns, self.n), _columns_of(d, columns, np.inf)
        if not squeezed:
            return d.reshape(*shape, len(columns)), i.reshape(*shape, len(columns))
        if not shape:
            return float(d[0, 0]), self._index(i[0, 0])
        return d.reshape(shape), i.reshape(shape)

    def query_ball_point(
        self,
        x: Any,
        r: Any,
        p: Any = 2.0,
        eps: Any = 0.0,
        workers: Any = 1,
        return_sorted: Any = None,
        return_length: Any = False,
    ) -> Any:
        """As SciPy's; lists ascend, whatever `return_sorted` is."""
        asked, threads = self._asked(x, p, eps), _as_threads(workers)
        radii = None if asked is None else self._radii(r, np.shape(x)[:-1])
        if asked is None or threads is None or radii is None:
            return super().query_ball_point(  # type: ignore[misc]
                x, r, p, eps, workers, return_sorted, return_length
            )
        shape = np.shape(x)[:-1]
        offsets, j = self._balls(asked, radii, threads)
        if return_length:
            lengths = np.diff(offsets).astype(np.intp).reshape(shape)
            return lengths if shape else lengths[()]
        lists = _as_lists(offsets, j)
        if not shape:
            return lists[0]
        result = np.empty(len(lists), object)
        result[:] = lists
        return result.reshape(shape)

    def query_ball_tree(self, other: Any, r: Any, p: Any = 2.0, eps: Any = 0.0) -> Any:
        """As SciPy's; lists ascend."""
        if not self._is_for(p, eps) or not self._fits(other) or not self._is_near(r):
            return super().query_ball_tree(other, r, p, eps)  # type: ignore[misc]
        rows = hs.neighbors(other.data, float(r), queries=self.data, **self._box())
        return _as_lists(rows.offsets, rows.indices)

    def query_pairs(self, r: Any, p: Any = 2.0, eps: Any = 0.0, output_type: Any = "set") -> Any:
        """As SciPy's."""
        known = output_type in ("set", "ndarray")
        if not known or not self._is_for(p, eps) or not self._is_near(r):
            return super().query_pairs(r, p, eps, output_type)  # type: ignore[misc]
        if output_type == "ndarray":
            both = hs.pairs(self.data, float(r), quantities="P", **self._box())
            return both.astype(np.intp, copy=False)
        i, j = hs.pairs(self.data, float(r), **self._box())
        return set(zip(i.tolist(), j.tolist()))

    def count_neighbors(
        self, other: Any, r: Any, p: Any = 2.0, weights: Any = None, cumulative: Any = True
    ) -> Any:
        """As SciPy's."""
        limits, marks = self._limits(r, cumulative), _as_weights(weights, self, other)
        if limits is None or marks is None or not self._is_for(p, 0.0) or not self._fits(other):
            return super().count_neighbors(other, r, p, weights, cumulative)  # type: ignore[misc]
        within, places = limits
        call = take(other.data, 0.0, self.data, **self._box(), by_reach=False)
        bins = binned(call, within, Marks(1, None, marks[1], None, marks[0]))[0, 0]
        if cumulative:
            found = np.cumsum(bins)[places]
        else:  # an edge that is repeated has nothing between it and itself
            found = bins[places]
            found[1:][places[1:] == places[:-1]] = 0
        counts = marks[0] is None and marks[1] is None
        found = found.astype(np.intp if counts else np.float64, copy=False).reshape(np.shape(r))
        if np.ndim(r):
            return found
        return int(found) if counts else found[()]

    def sparse_distance_matrix(
        self, other: Any, max_distance: Any, p: Any = 2.0, output_type: Any = "dok_matrix"
    ) -> Any:
        """As SciPy's, with distances within 1 ulp; the array ascends by i and j."""
        known = output_type in ("dok_matrix", "coo_matrix", "dict", "ndarray")
        is_ours = known and self._is_for(p, 0.0) and self._fits(other)
        if not is_ours or not self._is_near(max_distance):
            return super().sparse_distance_matrix(  # type: ignore[misc]
                other, max_distance, p, output_type
            )
        i, j, d = hs.pairs_between(
            self.data, other.data, float(max_distance), quantities="ijd", **self._box()
        )
        if output_type == "dict":
            return dict(zip(zip(i.tolist(), j.tolist()), d.tolist()))
        if output_type == "ndarray":
            entries = np.empty(len(i), _ENTRY)
            entries["i"], entries["j"], entries["v"] = i, j, d
            return entries
        matrix = coo_matrix((d, (i, j)), shape=(self.n, other.n))
        return matrix if output_type == "coo_matrix" else matrix.todok()

    # ---- what is ours ----------------------------------------------------------------------

    def _is_for(self, p: Any, eps: Any) -> bool:
        numbers = isinstance(p, Real) and isinstance(eps, Real)
        return numbers and p == 2 and eps == 0 and 1 <= self.m <= 8

    def _asked(self, x: Any, p: Any, eps: Any) -> _Points | None:
        """Queries in rows, or None if they are not plain numbers."""
        array = np.asarray(x)
        if not self._is_for(p, eps) or array.dtype.kind not in "fiu" or array.itemsize > 8:
            return None
        if array.ndim == 0 or array.shape[-1] != self.m or not np.isfinite(array).all():
            return None
        return np.ascontiguousarray(array.reshape(-1, self.m), np.float64)

    def _fits(self, other: Any) -> bool:
        if not isinstance(other, _owner.cKDTree) or other.m != self.m:
            return False
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

    def _radii(self, r: Any, shape: tuple[int, ...]) -> float | _Points | None:
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

    def _limits(self, r: Any, cumulative: Any) -> tuple[_Points, npt.NDArray[np.intp]] | None:
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

    def _is_few(self, asked: _Points) -> bool:
        return len(asked) < _FEW * self.n

    def _candidates(self, asked: _Points, radii: Any) -> npt.NDArray[np.intp] | None:
        """Ascending numbers of all points within these radii of any, and some more; or None."""
        ends = (asked.min(), asked.max(), self.mins.min(), self.maxes.max())
        largest = max(map(abs, ends))
        wide = np.add(radii, 1e-14 * self.m * (largest + np.max(radii))) + 1e-150
        if not (wide < self._half()).all():
            return None
        found = super().query_ball_point(asked, wide)  # type: ignore[misc]
        return np.unique(np.concatenate([np.asarray(one, np.intp) for one in found]))

    def _balls(self, asked: _Points, radii: Any, threads: int) -> tuple[Any, Any]:
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

    def _nearest(self, asked: _Points, k: int, bound: float, threads: int) -> tuple[Any, Any]:
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


class cKDTree(_Searches, _owner.cKDTree):
    """A subclass of ``scipy.spatial.cKDTree``, which documents it.

    Examples
    --------
    >>> from halfshell.compat.scipy import cKDTree
    >>> cKDTree([[0.0], [1.0], [3.0]]).query([[0.9]])
    (array([0.1]), array([1]))
    """


class KDTree(_Searches, _owner.KDTree):
    """A subclass of ``scipy.spatial.KDTree``, which documents it.

    Examples
    --------
    >>> from halfshell.compat.scipy import KDTree
    >>> tree = KDTree([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]])
    >>> tree.query_pairs(2.0) == {(0, 1), (1, 2)}
    True
    >>> tree.query_ball_point([2.0, 0.0], 1.0)
    [1, 2]
    >>> tree.count_neighbors(tree, [0.0, 1.0, 2.0]).tolist()
    [3, 5, 7]
    """

    _index = np.intp


# ---- arguments that are ours, or SciPy's to judge --------------------------------------------

def _as_bound(bound: Any) -> float | None:
    """A bound that is a plain number and not negative."""
    return float(bound) if isinstance(bound, Real) and float(bound) >= 0.0 else None


def _as_threads(workers: Any) -> int | None:
    """Threads, 0 for all; None for what SciPy is to judge."""
    if not isinstance(workers, int | np.integer) or isinstance(workers, bool):
        return None
    if workers == -1:
        return 0 if os.cpu_count() else None
    return int(workers) if 0 < workers < 1 << 16 else None


def _as_ranks(k: Any) -> tuple[npt.NDArray[np.intp], bool] | None:
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


def _columns_of(found: npt.NDArray[Any], ranks: npt.NDArray[np.intp], missing: float) -> Any:
    """These columns, from 1, of which there may be fewer."""
    if len(ranks) == found.shape[1] and ranks[0] == 1 and (np.diff(ranks) == 1).all():
        return found
    result = np.full((len(found), len(ranks)), missing, found.dtype)
    there = ranks <= found.shape[1]
    result[:, there] = found[:, ranks[there] - 1]
    return result


def _as_lists(offsets: npt.NDArray[Any], j: npt.NDArray[Any]) -> list[list[int]]:
    numbers, ends = j.tolist(), offsets.tolist()
    return [numbers[a:b] for a, b in pairwise(ends)]


def _as_weights(weights: Any, tree: Any, other: Any) -> tuple[Any, Any] | None:
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
