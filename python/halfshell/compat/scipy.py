# SPDX-License-Identifier: BSD-3-Clause
"""Trees in place of those of ``scipy.spatial``.

They are subclasses of SciPy's, with its arguments, attributes, dtypes, shapes and errors, and its
rule: a pair counts up to the radius, that included (``<=``), and a nearest neighbour if it is
closer than `distance_upper_bound` (``<``). Here that is decided for the exact values of the
floats, while SciPy compares rounded squares. So the answers differ if rounding decides SciPy's.

With `boxsize` the nearest image of a point counts, as there. SciPy itself answers what is not
decided here: `p` other than 2, `eps` above 0, more than 8 dimensions, radii that are negative or
infinite, and, with `boxsize`, all of a call one of whose radii is half a period or more, or whose
`k` is about the number of points within half a period, and otherwise those points that lack some
within half a period.

Lists of neighbours ascend, also where SciPy's have no order; among neighbours at the same distance
`query` has the lowest numbers. `workers` is the number of threads; methods without it use as many
as `halfshell.pairs`.
"""

from __future__ import annotations

import math
import operator
import os
from functools import cached_property
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.spatial as _owner
from scipy.sparse import coo_matrix

import halfshell as hs
from halfshell import _core
from halfshell._convert.call import Known, take
from halfshell._functions.counts import binned
from halfshell._functions.neighbors import arrays_of_rows, columns_of_nearest

__all__ = ["KDTree", "cKDTree"]

_ENTRY = np.dtype([("i", np.intp), ("j", np.intp), ("v", np.float64)], align=True)
_Points = npt.NDArray[np.float64]
_FLOAT = np.dtype(np.float64)
_FIRST = np.zeros(1, np.intp)
_TREE = _owner.cKDTree

#: Pairs of few points, without a search; None where a search, or SciPy, is to answer.
_few = _core.few
#: Lists, sets or dictionaries made of columns of pairs.
_contain = _core.contain
#: The most products of points and queries that `_few` looks at.
_FEW_PAIRS = _core.FEW_PAIRS
#: A little less and more than a number, which is not among the smallest floats.
_AROUND = np.array([[1.0 - 2.0**-50], [1.0 + 2.0**-50]])
_ORDINARY = 1e-300

#: What `_few` makes for each output of a matrix.
_LETTERS = {"dict": "d", "ndarray": "a", "coo_matrix": "a", "dok_matrix": "a"}

#: From so many points on they are sorted into cells once, and these are kept; it takes less time to
#: search fewer anew, but for the nearest of them, from the second time on.
_MANY = 500
#: A tree of more than so many times the points of another one is searched with those as queries.
_FEWER = 8
#: Lists of cells that a tree keeps beside the first, for radii that differ by factors.
_MOST_LISTS = 4

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
    _is_asked_again = False  # for the nearest

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
        threads, ranks = _as_threads(workers), _as_ranks(k)
        most = 0 if ranks is None else ranks if isinstance(ranks, int) else int(ranks.max())
        bound = float(distance_upper_bound) if _is_number(distance_upper_bound) else -1.0
        is_ours = threads is not None and most > 0 and bound >= 0.0 and self.n > 0
        # SciPy takes the whole call where it would have to answer many of its queries.
        if is_ours and bound > self._half:
            of_all = min(most, self.n)
            is_ours = of_all + math.sqrt(of_all - 1) <= self._expected
        asked, shape = self._asked(x, p, eps) if is_ours else (None, ())
        if asked is None:
            return super().query(x, k, eps, p, distance_upper_bound, workers)  # type: ignore[misc]
        i, d = self._nearest(asked, most, bound, threads)
        i, d = _columns_of(i, ranks, self.n), _columns_of(d, ranks, np.inf)
        if not isinstance(ranks, int) or ranks != 1:
            return d.reshape(*shape, d.shape[1]), i.reshape(*shape, i.shape[1])
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
        asked, shape = self._asked(x, p, eps)
        threads = _as_threads(workers)
        lists: Any = None
        if asked is not None and threads is not None:
            lists = _few(self.data, asked, self.boxsize, r, p, eps, "l")
        if lists is None:
            radii = None if asked is None else self._radii(r, shape)
            if asked is None or threads is None or radii is None:
                return super().query_ball_point(  # type: ignore[misc]
                    x, r, p, eps, workers, True, return_length
                )
            offsets, j = self._balls(asked, radii, threads or None)
            if not return_length:
                lists = _contain(offsets, None, j, None)
        if return_length:
            lengths = np.diff(offsets) if lists is None else np.fromiter(map(len, lists), np.intp)
            return lengths.astype(np.intp, copy=False).reshape(shape)[()]
        if not shape:
            return lists[0]
        result: npt.NDArray[Any] = np.empty(len(lists), object)
        result[:] = lists
        return result.reshape(shape)

    def query_ball_tree(self, other: Any, r: Any, p: Any = 2.0, eps: Any = 0.0) -> Any:
        """As SciPy's; lists ascend."""
        if type(other) is type(self) and other._period == self._period:
            lists = _few(other.data, self.data, self.boxsize, r, p, eps, "l")
            if lists is not None:
                return lists
        if not self._is_for(p, eps) or not self._fits(other) or not self._is_near(r):
            return list(map(sorted, super().query_ball_tree(other, r, p, eps)))  # type: ignore[misc]
        points, box = self._searched(float(r), other)
        offsets, j = arrays_of_rows(
            points, float(r), queries=self.data, index_dtype=np.int32, **box
        )
        return _contain(offsets, None, j, None)

    def query_pairs(self, r: Any, p: Any = 2.0, eps: Any = 0.0, output_type: Any = "set") -> Any:
        """As SciPy's."""
        letter = "s" if output_type == "set" else "P" if output_type == "ndarray" else None
        found = _few(self.data, None, self.boxsize, r, p, eps, letter) if letter else None
        if found is not None:
            return found
        if letter is None or not self._is_for(p, eps) or not self._is_near(r):
            return super().query_pairs(r, p, eps, output_type)  # type: ignore[misc]
        points, box = self._searched(float(r))
        if letter == "P":
            both = hs.pairs(points, float(r), quantities="P", **box)
            return both.astype(np.intp, copy=False)
        i, j = hs.pairs(points, float(r), index_dtype=np.int32, **box)
        return _contain(None, i, j, None)

    def count_neighbors(
        self, other: Any, r: Any, p: Any = 2.0, weights: Any = None, cumulative: Any = True
    ) -> Any:
        """As SciPy's."""
        limits, marks = self._limits(r, cumulative), _as_weights(weights, self, other)
        if limits is None or marks is None or not self._is_for(p, 0.0) or not self._fits(other):
            return super().count_neighbors(other, r, p, weights, cumulative)  # type: ignore[misc]
        within, places = limits
        if marks[0] is None and marks[1] is None:
            found = self._count(other, within)[places]
            if not cumulative:
                found = np.diff(found, prepend=0)
            return found.reshape(np.shape(r)) if np.ndim(r) else int(found[0])
        call = take(other.data, 0.0, self.data, **self._box, by_reach=False)
        call.known, call.known_of_queries = Known(weights=marks[1]), Known(weights=marks[0])
        bins = binned(call, within)[0, 0]
        if cumulative:
            found = np.cumsum(bins)[places]
        else:  # an edge that is repeated has nothing between it and itself
            found = bins[places]
            found[1:][places[1:] == places[:-1]] = 0
        return found.astype(np.float64, copy=False).reshape(np.shape(r))[()]

    def sparse_distance_matrix(
        self, other: Any, max_distance: Any, p: Any = 2.0, output_type: Any = "dok_matrix"
    ) -> Any:
        """As SciPy's, with distances within 1 ulp; the array ascends by i and j."""
        letter = _LETTERS.get(output_type) if type(output_type) is str else None
        found = None
        if letter is not None and type(other) is type(self) and other._period == self._period:
            found = _few(other.data, self.data, self.boxsize, max_distance, p, 0.0, letter)
        if found is None:
            is_ours = letter is not None and self._is_for(p, 0.0) and self._fits(other)
            if not is_ours or not self._is_near(max_distance):
                return super().sparse_distance_matrix(  # type: ignore[misc]
                    other, max_distance, p, output_type
                )
            found = self._between(other, float(max_distance))
            if letter == "d":
                found = _contain(None, *found)
        if letter == "d":
            return found
        i, j, d = found
        if output_type == "ndarray":
            entries = np.empty(len(i), _ENTRY)
            entries["i"], entries["j"], entries["v"] = i, j, d
            return entries
        matrix = coo_matrix((d, (i, j)), shape=(self.n, other.n))
        return matrix if output_type == "coo_matrix" else matrix.todok()

    # ---- what is ours ----------------------------------------------------------------------

    def _is_for(self, p: Any, eps: Any) -> bool:
        return _is_number(p) and _is_number(eps) and p == 2 and eps == 0 and 1 <= self.m <= 8

    def _asked(self, x: Any, p: Any, eps: Any) -> tuple[_Points | None, tuple[int, ...]]:
        """Queries in rows, or None if they are not plain numbers, and the shape that they had."""
        array = np.asarray(x)
        shape = array.shape[:-1]
        is_plain = array.dtype is _FLOAT or (array.dtype.kind in "fiu" and array.itemsize <= 8)
        if not is_plain or not array.ndim or array.shape[-1] != self.m or not self._is_for(p, eps):
            return None, shape
        rows = array
        if len(shape) != 1 or array.dtype is not _FLOAT:
            rows = np.ascontiguousarray(array.reshape(-1, self.m), np.float64)
        # One sum tells it of nearly all arrays.
        is_finite = math.isfinite(np.vdot(rows, rows)) or np.isfinite(rows).all()
        return (rows if is_finite else None), shape

    def _fits(self, other: Any) -> bool:
        if other is self:
            return True
        if not isinstance(other, _TREE) or other.m != self.m:
            return False
        if self.boxsize is None or other.boxsize is None:
            return self.boxsize is None and other.boxsize is None
        return np.array_equal(self.boxsize, other.boxsize)

    @cached_property
    def _period(self) -> list[float] | None:
        return None if self.boxsize is None else self.boxsize.tolist()

    @cached_property
    def _box(self) -> dict[str, Any]:
        if self.boxsize is None or not (self.boxsize > 0.0).any():
            return {}
        periodic = self.boxsize > 0.0
        if periodic.all():
            return {"box": self.boxsize.copy()}
        return {"box": np.where(periodic, self.boxsize, 0.0), "periodic": periodic}

    @cached_property
    def _half(self) -> float:
        """Half the shortest period: what is closer has no other image that is."""
        if self.boxsize is None:
            return np.inf
        return float(np.min(self.boxsize, where=self.boxsize > 0.0, initial=np.inf)) / 2.0

    @cached_property
    def _expected(self) -> float:
        """How many points of an even scene are closer than half the shortest period."""
        if self.boxsize is None or self.m > 8 or not (self.boxsize > 0.0).all():
            return np.inf
        ball: float = math.pi ** (self.m / 2) / math.gamma(self.m / 2 + 1)
        return self.n * ball * float(np.prod(self._half / self.boxsize))

    @cached_property
    def _farthest(self) -> float:
        """The largest distance that is below half a period."""
        return self._half if self._half == np.inf else math.nextafter(self._half, 0.0)

    def _is_near(self, r: Any) -> bool:
        return _is_number(r) and 0.0 <= float(r) < self._half

    def _radii(self, r: Any, shape: tuple[int, ...]) -> float | _Points | None:
        if _is_number(r):
            return float(r) if self._is_near(r) else None
        try:
            radii = np.broadcast_to(np.asarray(r, np.float64), shape).reshape(-1)
        except (TypeError, ValueError):
            return None
        if not ((radii >= 0.0) & (radii < self._half)).all():
            return None
        if len(radii) and (radii == radii[0]).all():
            return float(radii[0])
        return np.ascontiguousarray(radii)

    def _limits(self, r: Any, cumulative: Any) -> tuple[_Points, npt.NDArray[np.intp]] | None:
        """Ascending radii, and where each of `r` is among them."""
        if _is_number(r):
            return (np.array([r], np.float64), _FIRST) if self._is_near(r) else None
        try:
            radii = np.asarray(r, np.float64)
        except (TypeError, ValueError):
            return None
        if radii.ndim > 1 or not radii.size:
            return None
        radii = radii.reshape(-1)
        if (radii[1:] > radii[:-1]).all() and self._is_near(radii[0]) and self._is_near(radii[-1]):
            return radii, np.arange(len(radii))
        if not ((radii >= 0.0) & (radii < self._half)).all():
            return None
        within, places = np.unique(radii, return_inverse=True)
        if not cumulative and (np.diff(places.reshape(-1)) < 0).any():
            return None
        return within, places.reshape(-1)

    # ---- searches --------------------------------------------------------------------------

    def _searched(self, radius: float | None, tree: Any = None) -> tuple[Any, dict[str, Any]]:
        """The points of this tree or another one, as searches up to this radius, or for the nearest
        ones, take them, with their box."""
        tree = self if tree is None else tree
        if not isinstance(tree, _Searches):
            return tree.data, self._box
        if tree.n < _MANY and (radius is not None or not tree._is_asked_again):
            tree._is_asked_again = tree._is_asked_again or radius is None
            return tree.data, self._box
        return tree._kept(radius), {}

    @cached_property
    def _lists(self) -> dict[int, hs.CellList]:
        return {}  # by powers of two of the radii

    def _kept(self, radius: float | None) -> hs.CellList:
        """A list of cells, which is kept: for the first radius between two powers of two, or for
        any in between once there is a larger one."""
        lists = self._lists
        if radius is None:
            for cells in list(lists.values()):
                return cells
            radius = 0.0
        octave = math.frexp(radius)[1]
        found = lists.get(octave)
        if found is not None and found.cutoff >= radius:
            return found
        cutoff = radius if found is None else max(radius, math.ldexp(1.0, min(octave, 1023)))
        made = lists[octave] = hs.CellList(self.data, cutoff, **self._box)
        for old in list(lists)[1:-_MOST_LISTS]:  # the first one has the tree of the nearest
            lists.pop(old, None)
        return made

    def _balls(self, asked: _Points, radii: Any, threads: int | None) -> Any:
        """Offsets and numbers of all points within these radii."""
        how: dict[str, Any] = {"queries": asked, "threads": threads, "index_dtype": np.int32}
        if isinstance(radii, float):
            points, box = self._searched(radii)
            return arrays_of_rows(points, radii, **how, **box)
        points, box = self._searched(float(radii.max(initial=0.0)))
        if isinstance(points, hs.CellList):
            rows = points.query(asked, radii, threads=threads, index_dtype=np.int32)
            return rows.offsets, rows.indices
        how["queries"] = hs.Points(asked, radii=radii)
        return arrays_of_rows(points, None, rule="gather", **how, **box)

    def _count(self, other: Any, radii: _Points) -> npt.NDArray[np.int64]:
        """How many pairs of the points of both trees are within each of ascending radii."""
        if self.n * other.n <= _FEW_PAIRS:
            if len(radii) > 1 and radii[0] > _ORDINARY:
                found = _few(other.data, self.data, self.boxsize, float(radii[-1]), 2.0, 0.0, "a")
                if found is not None:
                    below, above = np.searchsorted(np.sort(found[2]), _AROUND * radii)
                    if (below == above).all():  # or else distances are near a radius, and rounded
                        return np.asarray(above)
            few = [
                _few(other.data, self.data, self.boxsize, radius, 2.0, 0.0, "n")
                for radius in radii.tolist()
            ]
            if None not in few:
                return np.array(few)
        large, small = (self, other) if self.n >= other.n else (other, self)
        points, box = self._searched(float(radii[-1]), large)
        within = float(radii[0]) if len(radii) == 1 else radii
        return np.atleast_1d(hs.count_pairs(points, within, queries=small.data, **box))

    def _between(self, other: Any, radius: float) -> Any:
        """Numbers in both trees, ascending, and distances of pairs."""
        columns: Any = {"quantities": "ijd", "index_dtype": np.int32}
        if self.n <= _FEWER * other.n:
            points, box = self._searched(radius, other)
            return hs.pairs_between(self.data, points, radius, **columns, **box)
        points, box = self._searched(radius)
        j, i, d = hs.pairs_between(other.data, points, radius, **columns, **box)
        order = np.argsort(i, kind="stable")
        return i[order], j[order], d[order]

    def _nearest(
        self, asked: _Points, k: int, bound: float, threads: int | None
    ) -> tuple[Any, Any]:
        """Numbers and distances, with n and infinity where there are none."""
        points, box = self._searched(None)
        within = bound if bound <= self._half else self._farthest
        scene: dict[str, Any] = {"queries": asked, "threads": threads or None, **box}
        k = min(k, self.n)
        i, d = columns_of_nearest(points, k, max_distance=within, **scene)
        i, d = i.reshape(-1, k), d.reshape(-1, k)
        ties: Any = ()
        if bound < np.inf:
            near = math.nextafter(math.nextafter(bound, 0.0), 0.0)
            ties = np.flatnonzero((d >= near).any(axis=1))
        if len(ties):  # closer, in real numbers?
            scene["queries"] = asked[ties]
            closer = hs.coordination(points, bound, inclusive=False, **scene)
            kept = np.arange(k) < closer[:, None]
            i[ties], d[ties] = np.where(kept, i[ties], -1), np.where(kept, d[ties], np.inf)
        if within < np.inf and not math.isfinite(np.vdot(d, d)):  # some are missing, or far away
            rest = np.flatnonzero(i[:, -1] < 0) if self._half < bound else ()
            i[i < 0] = self.n
            if len(rest):  # images half a period away, or more
                each = np.arange(1, d.shape[1] + 1)
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

def _is_number(value: Any) -> bool:
    return type(value) is float or isinstance(value, Real)


def _as_threads(workers: Any) -> int | None:
    """Threads, 0 for all; None for what SciPy is to judge."""
    if type(workers) is not int and not isinstance(workers, np.integer):
        return None
    if workers == -1:
        return 0 if os.cpu_count() else None
    return int(workers) if 0 < workers < 1 << 16 else None


def _as_ranks(k: Any) -> int | npt.NDArray[np.intp] | None:
    """How many neighbours, or which of them; None for what SciPy is to judge."""
    try:
        return max(operator.index(k), 0) or None
    except TypeError:
        pass
    ranks = np.asarray(k)
    if ranks.ndim != 1 or not ranks.size or ranks.dtype.kind not in "biuf":
        return None
    if not ((ranks >= 1) & (ranks <= _LAST)).all():
        raise ValueError(f"k must be 1 or more, as 1 is the nearest neighbour, got {k!r}")
    if ranks.dtype.kind not in "iu":
        return None
    return ranks.astype(np.intp)


def _columns_of(found: npt.NDArray[Any], ranks: Any, missing: float) -> Any:
    """So many columns, or these, from 1; there may be fewer."""
    width = found.shape[1]
    if isinstance(ranks, int):
        if ranks == width:
            return found
        result = np.full((len(found), ranks), missing, found.dtype)
        result[:, :width] = found
        return result
    result = np.full((len(found), len(ranks)), missing, found.dtype)
    there = ranks <= width
    result[:, there] = found[:, ranks[there] - 1]
    return result


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
