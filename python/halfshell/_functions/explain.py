# SPDX-License-Identifier: BSD-3-Clause
"""What a search would do with a scene, what it leaves out, and, measured, what it did."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell import _core, _show
from halfshell._convert.call import Call, check_shells, shells_of, take
from halfshell._convert.options import as_flag, as_index_bytes
from halfshell._search import search

if TYPE_CHECKING:
    from typing import Unpack

    import numpy.typing as npt

    from halfshell._convert.types import CutoffLike, Options, PointsLike


@dataclass(frozen=True)
class Explanation:
    """How a scene is searched; ``print`` it, or read the fields.

    Attributes
    ----------
    algorithm : {"all-pairs", "grid", "hash", "hierarchy"}
        One cell, a grid of cells, a grid of which only the occupied cells are stored, or several
        searches, as usual with radii, types or supports; cells and images are then those
        of the search with the largest reach.
        As given, or as chosen by "auto".
    reason : str
        Why this algorithm is used.
    n, ndim : int
        Number of points and dimensions.
    shape : tuple of int
        Cells along each grid axis; with "hash" most of them hold no point and are not stored.
    n_cells : int
        Cells that are stored.
    cell_sizes : tuple of float
        Their extents, in the unit of the points.
    images : tuple of int
        How many periods a pair can be apart along each grid axis; 0 if no images are needed.
    expected_pairs : float
        Estimated from the pairs of up to 1024 points. If these have more than can be counted in a
        few milliseconds, at least the number that the density suggests.
    expected_bytes : float
        Size of these pairs in the returned arrays.
    kernel : str
        The kernel that is used.
    threads : int
        Number of threads that share the search.
    leaves_out : tuple of str
        Steps that this scene does not need and does not pay for.
    measured : dict
        With ``measure=True``, counts made by the search itself: ``bytes`` by purpose,
        ``bytes_peak``, ``groups``, ``candidates``, ``pairs``, ``ambiguous``, ``by_float64``,
        ``by_double_word``, ``by_integers``. Otherwise empty.

    Examples
    --------
    >>> import halfshell as hs
    >>> plan = hs.explain([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]], 1.5)
    >>> plan.n, plan.ndim, plan.reason
    (3, 2, 'testing every pair costs less than sorting into cells')
    """

    algorithm: str
    reason: str
    n: int
    ndim: int
    shape: tuple[int, ...]
    n_cells: int
    cell_sizes: tuple[float, ...]
    images: tuple[int, ...]
    expected_pairs: float
    expected_bytes: float
    kernel: str
    threads: int
    leaves_out: tuple[str, ...]
    measured: dict[str, Any] = field(default_factory=dict)

    _shown = (
        "algorithm", "reason", "n", "ndim", "shape", "expected_pairs", "expected_bytes", "threads"
    )
    __repr__ = _show.line
    _repr_html_ = _show.html

    def __str__(self) -> str:
        cells = " x ".join(str(k) for k in self.shape)
        if self.algorithm == "hash":
            cells = f"{self.n_cells} that hold points"
        sizes = " x ".join(f"{k:.4g}" for k in self.cell_sizes)
        away = f"up to {self.images} periods away"
        lines = [
            f"{self.n:,} points in {self.ndim} dimension{'s' if self.ndim > 1 else ''}",
            f"algorithm       {self.algorithm}: {self.reason}",
            f"cells           {cells}, each {sizes}",
            f"images          {away if any(self.images) else 'none'}",
            f"expected        about {self.expected_pairs:,.0f} pairs, "
            f"{self.expected_bytes / 1e6:,.3g} MB",
            f"kernel          {self.kernel}",
            f"threads         {self.threads}",
            *(f"leaves out      {what}" for what in self.leaves_out),
        ]
        for key, value in self.measured.items():
            if isinstance(value, dict):
                lines += [f"bytes for       {k}: {v}" for k, v in value.items() if v]
            else:
                lines.append(f"measured        {key}: {value}")
        return "\n".join(lines)


@search(lacks="indices")
def explain(
    points: PointsLike,
    cutoff: CutoffLike = None,
    *,
    quantities: str = "ij",
    index_dtype: npt.DTypeLike = np.int64,
    sort: bool = False,
    measure: bool = False,
    **search: Unpack[Options],
) -> Explanation:
    """Explain how `pairs` would search a scene, and which steps it leaves out.

    Parameters
    ----------
    {points, shells, box, periodic, rule, exclude, min_distance, inclusive}
    quantities, sort
        As in `pairs`.
    {index_dtype}
    measure : bool, default False
        Also run the search, and report its counters: bytes allocated by purpose, candidates
        tested, and the number of decisions made by each stage.
    {threads, progress}

    Returns
    -------
    Explanation

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As `pairs`; ValueError also for a batch: each system has a plan of its own.

    Examples
    --------
    >>> import halfshell as hs
    >>> plan = hs.explain([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]], 1.5, measure=True)
    >>> plan.algorithm, plan.shape, plan.measured["pairs"]
    ('all-pairs', (1, 1), 1)
    """
    call = take(points, cutoff, several=shells_of(quantities), **search)
    check_shells(call, quantities)
    call.refuse_batch("explain", "each system has a plan of its own")
    sort, index_bytes = as_flag(sort, "sort"), as_index_bytes(index_dtype)
    algorithm = call.settings.algorithm
    plan = call.run(
        _core.explain, quantities, sort, index_bytes, as_flag(measure, "measure"), call.pairing,
        algorithm, call.shells,
    )  # fmt: skip
    ndim = plan["ndim"]
    one = index_bytes
    sizes = {"i": one, "j": one, "P": 2 * one, "d": 8, "D": 8 * ndim, "S": 4 * ndim, "k": 4}
    reason = _reason(plan, algorithm == "auto")
    if call.has_reach:
        reason = _reason_of_reach(plan, call, reason)
    return Explanation(
        **{name: plan[name] for name in _PLANNED},
        reason=reason,
        n=len(call.points),
        expected_bytes=plan["expected_pairs"] * sum(sizes[letter] for letter in quantities),
        leaves_out=_left_out(plan, quantities, sort),
    )


_PLANNED = (
    "algorithm", "ndim", "shape", "n_cells", "cell_sizes", "images", "expected_pairs", "kernel",
    "threads", "measured",
)  # fmt: skip


def _reason(plan: dict[str, Any], is_choice: bool) -> str:
    n_rows = plan["stencil_rows"]
    rows = "row" if n_rows == 1 else "rows"
    compared = f"each point is compared with {n_rows} {rows} of cells (forward half)"
    if plan["algorithm"] == "hierarchy" and plan["n_searches"] == 1:
        kind = "only those that hold points" if plan["sparse"] else "all stored"
        return f"one level, for one cutoff holds for all pairs; cells: {kind}; {compared}"
    if plan["sparse"]:
        few = "points fill few of the cells, only those" if is_choice else "cells that hold points"
        return f"{few} are stored; {compared}"
    if plan["algorithm"] == "all-pairs":
        if is_choice:
            return "testing every pair costs less than sorting into cells"
        return "each point is compared with all others"
    return compared


def _reason_of_reach(plan: dict[str, Any], call: Call, reason: str) -> str:
    """Of one search in which pairs have a reach each, or of several."""
    if plan["n_searches"] == 0:
        return "no two points can be a pair"
    if plan["n_searches"] == 1 and plan["algorithm"] != "hierarchy":
        return f"one search with the largest reach; {reason}"
    what = "octaves of supports" if call.known.supports is not None else "octaves of radii"
    what = "types" if call.known.types is not None else what
    searches = "search" if plan["n_searches"] == 1 else "searches"
    return f"by {what}, with cells of their own size, in {plan['n_searches']} {searches}"


def _left_out(plan: dict[str, Any], quantities: str, sort: bool) -> tuple[str, ...]:
    names = {"d": "distances", "D": "vectors", "S": "shifts"}
    missing = [name for letter, name in names.items() if letter not in quantities]
    left = [f"{', '.join(missing)}: not in quantities"] if missing else []
    if plan["ndim"] < 3:
        axes = "y and z" if plan["ndim"] == 1 else "z"
        left.append(f"coordinates {axes}: the scene has {plan['ndim']} dimension(s)")
    if plan["n_periodic"] == 0:
        left.append("images and wrapping: open space")
    elif not any(plan["images"]):
        left.append("images: no neighbour is across a face")
    if plan["n_periodic"] and plan["aligned"]:
        left.append("arithmetic of tilted boxes: this one lies along the axes")
    if plan["n_periodic"] and not plan["keeps_originals"]:
        left.append("memory for points as given: moved into the box, they lose no digit")
    if plan["threads"] == 1:
        left.append("more threads: they would not pay, or threads=1")
    if plan["all_pairs"]:
        left.append("cells and sorting into them")
    elif plan["sparse"]:
        left.append("empty cells: only occupied ones are stored")
    if not sort:
        left.append("sorting of pairs: sort=True does it")
    return tuple(left)
