# SPDX-License-Identifier: BSD-3-Clause
"""`RadialDistribution`: counts of pairs by distance, and g(r) and n(r), which follow from them.

What is kept adds up over frames: counts, those of an ideal gas, and numbers of points. g and n are
quotients of these sums.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from halfshell import _show
from halfshell._convert.foreign import is_a, shown
from halfshell._convert.options import as_choice
from halfshell._plot import new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_Floats = npt.NDArray[np.float64]
_Ints = npt.NDArray[np.int64]
_Names = tuple[str, ...] | tuple[int, ...]


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
    n_r : ndarray of float64, the shape of `g`
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
    >>> result = hs.rdf([[0.0], [1.0], [2.0], [3.0]], 2.5, bins=5, box=[4.0])
    >>> result.r.tolist(), result.counts.tolist(), result.g.tolist()
    ([0.25, 0.75, 1.25, 1.75, 2.25], [0, 0, 4, 0, 4], [0.0, 0.0, 2.0, 0.0, 2.0])
    >>> result.n_r.tolist()
    [0.0, 0.0, 2.0, 2.0, 4.0]

    By type, and over frames:

    >>> frames = [[0.0], [1.0], [2.0], [3.0]], [[0.0], [1.1], [2.0], [3.0]]
    >>> total = sum(hs.rdf(x, 2.5, 5, types=["A", "B", "A", "B"], box=[4.0]) for x in frames)
    >>> total.types, total.n_frames, total["A", "B"].counts.tolist()
    (('A', 'B'), 2, [0, 1, 7, 0, 0])
    """

    r: _Floats = field(init=False)
    g: _Floats = field(init=False)
    counts: _Ints
    edges: _Floats
    n_r: _Floats = field(init=False)
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
        object.__setattr__(self, "r", 0.5 * (edges[1:] + edges[:-1]))
        object.__setattr__(self, "g", ratio(counts, self.expected))
        within = np.cumsum(counts, axis=-1)
        if self.is_half:
            own = np.eye(len(counts), dtype=bool)[:, :, None] if counts.ndim == 3 else True
            within = np.where(own, 2, 1) * within
        centers = self.n_centers[..., None, None] if counts.ndim == 3 else self.n_centers
        object.__setattr__(self, "n_r", ratio(within, centers))

    # ---- parts and sums --------------------------------------------------------------------

    def __getitem__(self, pair: tuple[str, str] | tuple[int, int]) -> RadialDistribution:
        """g(r) of points of the second type around those of the first."""
        a, b = (self._place(one) for one in self._two(pair))
        return RadialDistribution(
            counts=self.counts[a, b], edges=self.edges, types=None, expected=self.expected[a, b],
            n_centers=self.n_centers[a], n_frames=self.n_frames,
            is_half=self.is_half and a == b,
        )  # fmt: skip

    def _two(self, pair: Any) -> tuple[Any, Any]:
        if self.types is None:
            raise TypeError("this result has no types: give types to rdf")
        if not is_a(pair, tuple) or len(pair) != 2:
            raise TypeError(f"two types are needed, as in result[a, b], got {shown(pair)}")
        return pair[0], pair[1]

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
        types = _all_types(self.types, other.types)
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
            raise ValueError("results must have the same edges to be added: give one r_max, bins")
        if self.is_half != other.is_half:
            raise ValueError("results with queries and without them cannot be added")
        kinds = [None if one is None else _of_names(one) for one in (self.types, other.types)]
        if None in kinds and kinds != [None, None]:
            raise ValueError("results with types and without them cannot be added")
        if set(kinds) == {True, False}:
            raise ValueError("results whose types are names and numbers cannot be added")

    # ---- pictures --------------------------------------------------------------------------

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

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.

        Raises
        ------
        ImportError
            If matplotlib is not installed: ``pip install matplotlib``.
        ValueError
            If `quantity` is neither "g" nor "n".

        Notes
        -----
        Infinite values are left out. Pairs of types that never meet have no line.
        """
        as_choice(quantity, "quantity", ("g", "n"))
        ax = new_axes() if ax is None else ax
        values = self.g if quantity == "g" else self.n_r
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


def _all_types(one: _Names | None, other: _Names | None) -> _Names | None:
    """Those of both, ascending."""
    if one is None or other is None:
        return None
    return one if one == other else tuple(sorted({*one, *other}))


def _spread(values: npt.NDArray[Any], own: _Names | None, types: _Names | None) -> Any:
    """Values with a place for each of `types`, 0 for those that are not their own."""
    if own is None or types is None or own == types:
        return values
    places = [types.index(one) for one in own]
    wide = np.zeros((len(types),) * min(values.ndim, 2) + values.shape[2:], values.dtype)
    wide[np.ix_(*[places] * min(values.ndim, 2))] = values
    return wide
