# SPDX-License-Identifier: BSD-3-Clause
"""`rdf`: the radial distribution function, a histogram over that of an ideal gas.

What a `RadialDistribution` keeps adds up over frames: counts, those of an ideal gas, and numbers of
points. g and n are quotients of these sums.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from halfshell import _core, _show
from halfshell._convert.arrays import as_array
from halfshell._convert.call import Call, take
from halfshell._convert.foreign import exact_number, is_a, shown
from halfshell._convert.lengths import as_edges, as_positive
from halfshell._convert.memory import refuse_unavailable
from halfshell._convert.options import as_choice, as_count, as_flag
from halfshell._functions.counts import binned, use_types
from halfshell._objects.pictures import axes_of
from halfshell._search import document, search

if TYPE_CHECKING:
    from typing import Unpack

    from matplotlib.axes import Axes

    from halfshell._convert.types import ArrayLike, FloatArray, Number, OptionsOfBins, PointsLike

_Floats = npt.NDArray[np.float64]
_Ints = npt.NDArray[np.int64]
_Names = tuple[str, ...] | tuple[int, ...]

_COLUMNS = 12  # of a result without types, and what makes them
_OF_TYPES = 6  # of g(r) of each two types, and what makes it


@search(lacks="rule indices inclusive")
def rdf(
    points: PointsLike,
    cutoff: Number | None = None,
    bins: int | ArrayLike = 100,
    *,
    queries: PointsLike | None = None,
    by_type: bool = False,
    density: float | None = None,
    finite_size: bool = False,
    **search: Unpack[OptionsOfBins],
) -> RadialDistribution:
    """Compute the radial distribution function g(r); counts are always exact.

    Parameters
    ----------
    {points}
    cutoff : float or None
        The largest distance, in the unit of `points`; finite, greater than 0. It may exceed half
        the box, and the whole box: all images are counted. None where `bins` are edges, and for
        that of a `CellList`.
    bins : int or array_like of float, shape (bins + 1,), default 100
        How many bins of equal width there are from 0 to `cutoff`, or their edges, as in
        `pair_histogram`.
    queries : array_like of float, shape (q, d), or Points, optional
        Compute g(r) of the points around these instead. A query that coincides with a point finds
        it at distance 0, in the first bin.
    box : float, array_like of float, shape (d,) or (d, d), or Box, optional
        As in `pairs`. Without `density` it must be periodic along every axis.
    {periodic, exclude, min_distance}
    by_type : bool, default False
        g(r) of each pair of `types`. With `queries`, [a, b] is g(r) of points of type b around
        queries of type a.
    density : float, optional
        Points per unit of volume, or area, or length, that the ideal gas has. Default: all points
        over the volume of the box.
    finite_size : bool, default False
        Compare with n (n - 1) / 2 pairs, which n random points have, in place of n**2 / 2.
    {threads, progress}

    Returns
    -------
    RadialDistribution
        An object with ``r``, ``g``, ``counts``, ``edges``, the coordination numbers ``n``,
        ``types`` and ``plot()``. To average over frames, add their results:
        ``sum(rdf(x, 5.0) for x in frames)``; each system of a batch that has points counts as a
        frame.

        g is the mean number of neighbours in a shell divided by the number that the density n / V
        of all points would put there: ``2 counts / (n * n / V * shell)``. For [a, b] with two
        different types it is ``counts / (n_a * n_b / V * shell)``, for queries
        ``counts / (q * n / V * shell)``, with types ``counts / (q_a * n_b / V * shell)``. It is 0
        where counts are 0, even if n_a or n_b is 0. A shell is the length, area, volume, ...
        between two spheres, in any number of dimensions.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pair_histogram`; ValueError also without a density, if there is no box or an axis is
        not periodic, or if `cutoff`, `bins` or `density` is not positive.

    Notes
    -----
    With labels and ``exclude=0``, g(r) is between molecules; with groups, within them. Both are
    relative to the same ideal gas, of all pairs. n random points have n (n - 1) / 2 pairs in their
    box, so below half the box their g is (n - 1) / n on average without `finite_size`; for large r,
    where all images count, it tends to 1.

    Examples
    --------
    >>> import numpy as np
    >>> import halfshell as hs
    >>> points = np.random.default_rng(0).random((2000, 3))
    >>> result = hs.rdf(points, 0.4, bins=4, box=1.0)
    >>> result.r.tolist()
    [0.05, 0.15000000000000002, 0.25, 0.35000000000000003]
    >>> bool(abs(result.g - 1.0).max() < 0.05)
    True
    >>> int(result.counts.sum()) == hs.count_pairs(points, 0.4, box=1.0)
    True

    By type name, averaged over ten frames:

    >>> names = np.where(np.arange(2000) < 500, "Si", "O")
    >>> frames = np.random.default_rng(1).random((10, 2000, 3))
    >>> result = sum(hs.rdf(hs.Points(x, types=names, box=1.0), 0.4, 4, by_type=True)
    ...              for x in frames)
    >>> result.types, result.n_frames
    (('O', 'Si'), 10)
    >>> partial = result["Si", "O"]
    >>> bool(abs(partial.g - 1.0).max() < 0.02)
    True
    >>> partial.n.round().tolist()  # oxygens within 0.1, 0.2, 0.3 and 0.4 of a silicon
    [6.0, 50.0, 170.0, 402.0]
    """
    edges = _edges(points, cutoff, bins)
    call = take(points, 0.0, queries, inclusive=False, by_reach=False, **search)
    by_type, finite = as_flag(by_type, "by_type"), as_flag(finite_size, "finite_size")
    dense = None if density is None else as_positive(density, "density")
    shares = _shares_of(call, edges, dense, 0)
    n_types, names = use_types(call) if by_type else (1, None)
    if by_type:
        refuse_unavailable(_OF_TYPES * 8 * n_types**2 * (len(edges) - 1), "g(r) of all types")
    counts = binned(call, edges, n_types, name="cutoff").astype(np.int64, copy=False)
    counts = counts[..., 1:] if by_type else counts[..., 0, 0, 1:]
    n_frames = 1
    if call.points.batch is None:
        expected = _expected(call, n_types, finite, shares, None)
    else:
        counts = counts.sum(axis=0, dtype=np.int64)
        batches = [call.points.batch]
        if call.queries is not None and call.queries.batch is not None:
            batches.append(call.queries.batch)
        occupied = np.unique(np.concatenate(batches))
        expected = np.zeros(counts.shape)
        for s in occupied.tolist():
            shares = _shares_of(call, edges, dense, s)
            expected += _expected(call, n_types, finite, shares, s)
        n_frames = max(len(occupied), 1)
    types: _Names | None = None
    centers = _centers(call, n_types)
    if by_type:
        types = tuple(range(n_types)) if names is None else names
        t = len(types)  # less than n_types where there is no point and so no name
        counts, expected, centers = counts[:t, :t], expected[:t, :t], centers[:t]
    return RadialDistribution(
        np.ascontiguousarray(counts), edges, types, expected, centers, n_frames,
        call.queries is None,
    )  # fmt: skip


def _edges(points: Any, cutoff: Any, bins: Any) -> FloatArray:
    is_number = exact_number(bins) is not None
    array = None if is_number else as_array(bins, "bins", "be a number or edges")
    if array is not None and array.ndim > 0:
        edges = as_edges(array, "bins")
        if cutoff is not None and as_positive(cutoff, "cutoff") != edges[-1]:
            raise ValueError(
                f"cutoff must be None, or the last edge of bins, {edges[-1]}, got {cutoff}"
            )
        return edges
    if cutoff is None and getattr(type(points), "_is_cell_list", False):
        cutoff = points.cutoff
    if cutoff is None:
        raise TypeError("cutoff must be a number where bins is one: None goes with edges")
    n_bins, largest = as_count(bins, "bins"), as_positive(cutoff, "cutoff")
    # Of float64: edges, what numpy needs to make them, r, g and the shells.
    refuse_unavailable(_COLUMNS * 8 * n_bins, "r, g and counts for so many bins")
    with np.errstate(under="ignore"):
        return np.linspace(0.0, largest, n_bins + 1)


# ---- the ideal gas -------------------------------------------------------------------------

def _shares_of(call: Call, edges: FloatArray, density: float | None, s: int) -> FloatArray:
    """The part of all partners in a system that lies between two spheres, for each bin.

    In a unit of about the size of the box, a power of two: volumes of boxes in other units may be
    too large or too small for a float64.
    """
    points, d = call.points, call.array.shape[1]
    with np.errstate(over="ignore", under="ignore", invalid="ignore", divide="ignore"):
        if density is not None:
            n = len(points) if points.batch is None else int((points.batch == s).sum())
            of_density: FloatArray = np.diff(unit_ball(d) * edges**d) * density / max(n, 1)
            return of_density
        every = (1 << d) - 1
        if points.box is None or (np.atleast_1d(points._axes) != every).any():
            raise ValueError(
                "rdf needs a box that is periodic along every axis, for the density of the points, "
                "or density; pair_histogram counts without one"
            )
        vectors = points.box[s] if points.box.ndim == 3 else points.box
        power = -int(np.frexp(np.abs(vectors).max())[1])
        volume: float = _core.box_measure(np.ldexp(vectors, power), every)[1]
        shells: FloatArray = np.diff(np.ldexp(edges, power) ** d)
        return unit_ball(d) * shells / volume


def unit_ball(ndim: int) -> float:
    """The volume of a ball of radius 1."""
    volume = 2.0 if ndim % 2 else 1.0
    for k in range(2 + ndim % 2, ndim + 1, 2):
        volume *= 2.0 * math.pi / k
    return volume


def _in_shells(partners: FloatArray, shares: FloatArray) -> FloatArray:
    """What each shell has of them. Shares may be infinite: none of them are none everywhere."""
    found = np.zeros(np.broadcast_shapes(partners.shape, shares.shape))
    with np.errstate(over="ignore", under="ignore"):
        np.multiply(partners, shares, out=found, where=partners > 0.0)
    return found


def _expected(
    call: Call, n_types: int, finite_size: bool, shares: FloatArray, system: int | None
) -> FloatArray:
    """Pairs of an ideal gas in each shell, of one system or of all; with types, of each two."""
    mine, theirs = (
        None if one is None else slice(None) if system is None or one.batch is None
        else one.batch == system
        for one in (call.points, call.queries)
    )  # fmt: skip
    n = len(call.array[mine])
    types, of_queries = call.known.types, call.known_of_queries.types
    if types is None:
        if call.asking is not None:
            pairs = float(len(call.asking[theirs])) * n
        else:
            pairs = 0.5 * n * (n - 1 if finite_size else n)
        return _in_shells(np.array([pairs]), shares)
    of_points = np.bincount(types[mine], minlength=n_types).astype(np.float64)
    if of_queries is not None:
        asking = np.bincount(of_queries[theirs], minlength=n_types)
        return _in_shells(np.outer(asking, of_points)[:, :, np.newaxis], shares)
    table: FloatArray = np.outer(of_points, of_points)
    own = np.diag_indices(len(of_points))
    table[own] = 0.5 * of_points * (of_points - finite_size)
    return _in_shells(table[:, :, np.newaxis], shares)


def _centers(call: Call, n_types: int) -> npt.NDArray[np.int64]:
    """How many points, or queries, have neighbours that are counted; with types, of each."""
    asking = (call.known if call.queries is None else call.known_of_queries).types
    if asking is None:
        return np.array(len(call.points if call.queries is None else call.queries))
    return np.bincount(asking, minlength=n_types)


# ---- the result ----------------------------------------------------------------------------

@dataclass(frozen=True, eq=False)
class RadialDistribution:
    """The result of `rdf`, or a sum of such results.

    Attributes
    ----------
    r : ndarray of float64, shape (bins,)
        The middle of each bin, in the unit of the points.
    g : ndarray of float64, shape (bins,) or (t, t, bins)
        g(r), ``counts / expected``: 1 on average for points that ignore each other. 0 in each bin
        without pairs, even without points, or without points of a type, when the density to
        divide by is 0 as well. Infinite if a bin has pairs, but its shell is too small a fraction
        of the box for float64.
    counts : ndarray of int64, the shape of `g`
        Pairs in each bin, as `pair_histogram` counts them, of all frames.
    edges : ndarray of float64, shape (bins + 1,)
        Limits of the bins.
    n : ndarray of float64, the shape of `g`
        n(r), the coordination number: the mean number of neighbours of a point, or a query,
        within ``edges[k + 1]``, in all bins up to k. [a, b] is the number of neighbours of type b
        around a point of type a, which differs from [b, a]. 0 if there is no such point.
    types : tuple of str or int, length t, or None
        The types along the first two axes; None without types.
    expected : ndarray of float64, the shape of `g`
        Pairs that an ideal gas would have in each bin, of all frames.
    n_centers : ndarray of int64, shape () or (t,)
        Points, or queries, whose neighbours were counted, of all frames; with types, of each.
    n_frames : int
        Number of results in the sum: 1 as `rdf` returns it.
    is_half : bool
        Whether each pair of points is counted once, as without queries. Each pair then has two
        points that are neighbours of each other.

    Notes
    -----
    ``result["Si", "O"]`` selects two types and returns an object like this without types:
    g(r) of oxygen around silicon, and their n(r). With numbers as types, use ``result[0, 1]``.

    Results with the same edges may be added, and ``sum`` takes any number of them: frames of a
    trajectory, each with its own box and number of points. Counts are added exactly. g of the sum
    is all pairs divided by all pairs of ideal gases in the same frames; if these have the same box
    and number of points, it is the mean of their g. Frames may lack types that others have.

    Examples
    --------
    >>> import halfshell as hs
    >>> result = hs.rdf([[0.0], [1.0], [2.0], [3.0]], 2.5, bins=5, box=4.0)
    >>> result.r.tolist(), result.counts.tolist(), result.g.tolist()
    ([0.25, 0.75, 1.25, 1.75, 2.25], [0, 0, 4, 0, 4], [0.0, 0.0, 2.0, 0.0, 2.0])
    >>> result.n.tolist()
    [0.0, 0.0, 2.0, 2.0, 4.0]

    By type, and over frames:

    >>> first = hs.Points([[0.0], [1.0], [2.0], [3.0]], types=["A", "B", "A", "B"], box=4.0)
    >>> frames = first, first.replace(positions=[[0.0], [1.1], [2.0], [3.0]])
    >>> total = sum(hs.rdf(x, 2.5, 5, by_type=True) for x in frames)
    >>> total.types, total.n_frames, total["A", "B"].counts.tolist()
    (('A', 'B'), 2, [0, 1, 7, 0, 0])
    """

    r: _Floats = field(init=False)
    g: _Floats = field(init=False)
    counts: _Ints
    edges: _Floats
    n: _Floats = field(init=False)
    types: _Names | None
    expected: _Floats
    n_centers: _Ints
    n_frames: int = 1
    is_half: bool = True

    __array_ufunc__ = None  # arrays do not add it to each of their items
    __repr__ = _show.line
    _repr_html_ = _show.html

    def __post_init__(self) -> None:
        counts, edges = self.counts, self.edges
        with np.errstate(under="ignore"):
            object.__setattr__(self, "r", 0.5 * (edges[1:] + edges[:-1]))
        object.__setattr__(self, "g", ratio(counts, self.expected))
        within = np.cumsum(counts, axis=-1)
        if self.is_half:
            own = np.eye(len(counts), dtype=bool)[:, :, None] if counts.ndim == 3 else True
            within = np.where(own, 2, 1) * within
        centers = self.n_centers[..., None, None] if counts.ndim == 3 else self.n_centers
        object.__setattr__(self, "n", ratio(within, centers))

    # ---- parts and sums --------------------------------------------------------------------

    def __getitem__(self, pair: tuple[str, str] | tuple[int, int]) -> RadialDistribution:
        """g(r) of points of the second type around those of the first."""
        if self.types is None:
            raise TypeError("this result has no types: rdf(..., by_type=True)")
        if not is_a(pair, tuple) or len(pair) != 2:
            raise TypeError(f"two types are needed, as in result[a, b], got {shown(pair)}")
        a, b = (self._place(one) for one in pair)
        return RadialDistribution(
            counts=self.counts[a, b], edges=self.edges, types=None, expected=self.expected[a, b],
            n_centers=self.n_centers[a], n_frames=self.n_frames,
            is_half=self.is_half and a == b,
        )  # fmt: skip

    def _place(self, one: Any) -> int:
        assert self.types is not None
        for k, known in enumerate(self.types):
            if is_a(one, (str, int, np.integer)) and not is_a(one, bool) and known == one:
                return k
        among = ", ".join(map(repr, self.types[:20])) + (", ..." if len(self.types) > 20 else "")
        raise KeyError(f"{shown(one)} is not one of the types {among}")

    def __add__(self, other: object) -> RadialDistribution:
        """The sum over the frames of both."""
        if not isinstance(other, RadialDistribution):
            return NotImplemented
        self._check_alike(other)
        types = self.types
        if types is not None and other.types is not None and types != other.types:
            types = tuple(sorted({*types, *other.types}))
        counts, expected, centers = (
            _spread(one, self.types, types) + _spread(more, other.types, types)
            for one, more in (
                (self.counts, other.counts), (self.expected, other.expected),
                (self.n_centers, other.n_centers),
            )
        )  # fmt: skip
        frames = self.n_frames + other.n_frames
        return RadialDistribution(
            counts, self.edges, types, expected, centers, frames, self.is_half
        )

    def __radd__(self, other: object) -> RadialDistribution:
        """What ``sum`` begins with is 0."""
        if type(other) is int and other == 0:
            return self
        return NotImplemented

    def _check_alike(self, other: RadialDistribution) -> None:
        if not np.array_equal(self.edges, other.edges):
            raise ValueError("results must have the same edges to be added: give one cutoff, bins")
        if self.is_half != other.is_half:
            raise ValueError("results with queries and without them cannot be added")
        if (self.types is None) != (other.types is None):
            raise ValueError("results with types and without them cannot be added")
        if self.types and other.types and _of_names(self.types) != _of_names(other.types):
            raise ValueError("results whose types are names and numbers cannot be added")

    # ---- pictures --------------------------------------------------------------------------

    @document
    def plot(
        self,
        ax: Axes | None = None,
        *,
        quantity: Literal["g", "n"] = "g",
        unit: str | None = None,
    ) -> Axes:
        """Draw g(r) or n(r), with types one line for each pair of them.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on. Default: axes of a new figure.
        quantity : {"g", "n"}, default "g"
            g(r) as steps, a bin each, or n(r) at the edges.
        unit : str, optional
            The unit of the points, for the label of the axis: "Å".

        {drawn}
        ValueError
            If `quantity` is neither "g" nor "n".

        Notes
        -----
        Infinite values are left out. Pairs of types that never meet have no line.
        """
        as_choice(quantity, "quantity", ("g", "n"))
        ax = axes_of(ax)
        values = self.g if quantity == "g" else self.n
        for line, label in self._lines(values, quantity):
            if quantity == "g":
                finite = np.where(np.isfinite(line), line, np.nan)
                ax.step(self.r, finite, where="mid", label=label, linewidth=1.3)
            else:
                ax.plot(self.edges, np.concatenate(([0.0], line)), label=label, linewidth=1.3)
        if quantity == "g":
            ax.axhline(1.0, color="0.6", linewidth=0.8, linestyle="--", zorder=0)
        if self.types is not None and ax.get_legend_handles_labels()[0]:
            ax.legend(title=None if _of_names(self.types) else "types")
        ax.set_xlim(float(self.edges[0]), float(self.edges[-1]))
        ax.set_ylim(bottom=0.0)
        ax.set_xlabel("distance r" if unit is None else f"distance r / {unit}")
        ax.set_ylabel(f"{quantity}(r)")
        return ax

    def _lines(self, values: _Floats, quantity: str) -> list[tuple[_Floats, str | None]]:
        """What to draw, and how to call it."""
        if self.types is None:
            return [(values, None)]
        once = quantity == "g" and self.is_half  # [a, b] is [b, a]
        return [
            (values[a, b], f"{one}-{other}" if quantity == "g" else f"{other} around {one}")
            for a, one in enumerate(self.types)
            for b, other in enumerate(self.types)
            if (a <= b or not once) and self.expected[a, b].any()
        ]


def ratio(counts: npt.NDArray[Any], by: npt.NDArray[Any]) -> _Floats:
    """counts / by; 0 where there are no counts."""
    found = np.zeros(counts.shape)
    with np.errstate(over="ignore", under="ignore", divide="ignore"):
        np.divide(counts, by, out=found, where=counts > 0)
    return found


def _of_names(types: _Names) -> bool:
    return any(isinstance(one, str) for one in types)


def _spread(values: npt.NDArray[Any], own: _Names | None, types: _Names | None) -> Any:
    """Values with a place for each of `types`, 0 for those that are not their own."""
    if own is None or types is None or own == types:
        return values
    places = [types.index(one) for one in own]
    wide = np.zeros((len(types),) * min(values.ndim, 2) + values.shape[2:], values.dtype)
    wide[np.ix_(*[places] * min(values.ndim, 2))] = values
    return wide
