# SPDX-License-Identifier: BSD-3-Clause
"""Pairs that are not searched for.

`measure` gives their vectors and lengths, `plot_pairs` draws them, `bonded` makes them of bonds.
"""

from __future__ import annotations

import re
from contextlib import closing
from typing import TYPE_CHECKING, Any, Literal, cast, overload

import numpy as np

from halfshell import _core
from halfshell._convert.arrays import as_array, as_listed, as_point_numbers, entries_of
from halfshell._convert.call import Call, each_system, part_of, take
from halfshell._convert.foreign import shown
from halfshell._convert.options import as_count, as_whole, check_letters
from halfshell._convert.points import Points, refuse_infinite
from halfshell._objects.pictures import (
    MOST_LINES,
    axes_for,
    draw_box,
    draw_dots,
    draw_lines,
    finish,
)
from halfshell._search import search

if TYPE_CHECKING:
    from typing import TypedDict, Unpack

    import numpy.typing as npt
    from matplotlib.axes import Axes

    from halfshell._convert.types import (
        ArrayLike,
        Arrays,
        BoxLike,
        PeriodicLike,
        PointsLike,
        ProgressLike,
    )

    class _MeasureOptions(TypedDict, total=False):
        """For overloads: the keywords of `measure`, without `quantities`."""

        queries: PointsLike | None
        box: BoxLike | None
        periodic: PeriodicLike | None
        threads: int | None
        progress: ProgressLike


# ---- their vectors and lengths -------------------------------------------------------------

@overload
def measure(
    points: PointsLike,
    i: ArrayLike,
    j: ArrayLike,
    S: ArrayLike | None = None,
    *,
    quantities: Literal["dDS"] = "dDS",
    **options: Unpack[_MeasureOptions],
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.int32]]: ...
@overload
def measure(
    points: PointsLike,
    i: ArrayLike,
    j: ArrayLike,
    S: ArrayLike | None = None,
    *,
    quantities: Literal["d", "D", "S"],
    **options: Unpack[_MeasureOptions],
) -> npt.NDArray[Any]: ...
@overload
def measure(
    points: PointsLike,
    i: ArrayLike,
    j: ArrayLike,
    S: ArrayLike | None = None,
    *,
    quantities: str,
    **options: Unpack[_MeasureOptions],
) -> Arrays: ...
@search(lacks="rule exclude min_distance indices inclusive")
def measure(
    points: PointsLike,
    i: ArrayLike,
    j: ArrayLike,
    S: ArrayLike | None = None,
    *,
    queries: PointsLike | None = None,
    quantities: str = "dDS",
    **search: Any,
) -> Arrays:
    """Measure given pairs, in the nearest image or in given images; always exact.

    Parameters
    ----------
    {points}
    i, j : array_like of int, shape (m,)
        Point numbers of each pair, in any order; pairs may repeat, and i may equal j. Of a batch
        both are points of one system.
    S : array_like of int, shape (m, d), optional
        The image of j, 0 along axes that are not periodic. Default: the image nearest to
        i; of several equally near, the one with the lexicographically least S. This is decided
        exactly for the real values of the inputs. The nearest image of a point to itself is the
        point, S = 0.
    queries : array_like of float, shape (q, d), or Points, optional
        Where `i` numbers points of another set: their coordinates.
    {box, periodic}
    quantities : str, default "dDS"
        Any of the letters ``d D S``, each at most once: distance, vector, shift. Only these are
        computed.
    {threads, progress}

    Returns
    -------
    ndarray or tuple of ndarray
        One array per letter of `quantities`, in that order; a bare array for one letter. One entry
        per pair, in their order: ``d`` float64 (m,), ``D`` float64 (m, d), both in the unit of
        `points`; ``S`` int32 (m, d). In real arithmetic ``D = points[j] - points[i] + S @ box``.
        d is within 1 ulp, each component of D within 1 ulp of d.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pairs`. ValueError also if `i`, `j` and `S` do not fit each other or the points, or
        the box is so skewed, or so long and thin without being aligned with the coordinate axes,
        that float64 cannot tell which images are near. OverflowError also if a point is more than
        2**51 box vectors away and `S` is not given.

    Notes
    -----
    Use it for fixed edges, such as bonds, and for lists from other programs. For pairs found by
    `pairs`, with their S, d and D are the same as there, but for a d that rounds to the cutoff of a
    search with ``inclusive=False``, which is the next smaller number there. The nearest image is
    found in a short basis of the box: axis by axis if it is aligned with the coordinate axes,
    otherwise among all images within the distance of a near one. Images that rounding cannot tell
    apart are compared exactly.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.1, 0.5], [0.9, 0.5], [0.6, 0.5]]
    >>> d, D, S = hs.measure(points, [0, 0], [1, 2], box=[1.0, 1.0])
    >>> d.round(12).tolist(), S.tolist()
    ([0.2, 0.5], [[-1, 0], [0, 0]])
    >>> hs.measure(points, [0], [1], [[0, 0]], box=[1.0, 1.0], quantities="d").tolist()
    [0.8]
    """
    check_letters(quantities, "dDS")
    call = take(points, 0.0, queries, by_reach=False, **search)
    call.settings, call.cells = call.settings._replace(precision="exact"), None
    n, ndim = call.array.shape
    n_queries = None if call.queries is None else len(call.queries)
    listed = as_listed(i, j, S, ndim, n, n_queries)
    if call.points.batch is None:
        return _measured(call, quantities, *listed)
    return _measured_in_systems(call, quantities, *listed)


def _measured(call: Call, quantities: str, first: Any, second: Any, shifts: Any) -> Arrays:
    if call.asking is not None:  # one set, the queries behind the points
        refuse_infinite(call.array, "points")
        refuse_infinite(call.asking, "queries")
        first = first + len(call.points)
        call.points = call.points.replace(
            **dict.fromkeys(("radii", "types", "supports", "groups", "labels", "weights")),
            positions=np.concatenate([call.array, call.asking]),
        )
    return cast("Arrays", call.run(_core.measure, quantities, first, second, shifts))


def _measured_in_systems(
    call: Call, quantities: str, first: Any, second: Any, shifts: Any
) -> Arrays:
    """Each pair in the box of the one system that it is of."""
    own = call.points.batch
    asking = own if call.queries is None else call.queries.batch
    assert own is not None and asking is not None
    if not len(call.points):
        call.points = call.points.replace(box=None, batch=None)
        return _measured(call, quantities, first, second, shifts)
    for n in np.flatnonzero(asking[first] != own[second]):
        raise ValueError(
            f"pair {n} is of two systems: i[{n}] of system {asking[first[n]]}, j[{n}] of system "
            f"{own[second[n]]}"
        )
    order = np.argsort(own[second], kind="stable")
    sorted_systems = own[second][order]
    n_systems = 1 + int(np.count_nonzero(np.diff(own)))  # that have points
    columns: list[list[Any]] = [[] for _ in quantities]
    with closing(call):
        for k, (one, begin) in enumerate(each_system(call)):
            s = own[begin]
            some = order[slice(*np.searchsorted(sorted_systems, [s, s + 1]))]
            if not len(some) and k:  # but the first, for the shapes
                continue
            one.progress, one.bar = part_of(call.progress, k, n_systems), None
            try:
                found = _measured(
                    one, quantities, first[some] - np.searchsorted(asking, s), second[some] - begin,
                    None if shifts is None else shifts[some],
                )  # fmt: skip
            except (OverflowError, ValueError) as error:
                if named := re.match(r"pair (\d+)", str(error)):  # of those of this system
                    rest = str(error)[named.end() :]
                    raise type(error)(f"pair {some[int(named[1])]}{rest}") from None
                raise
            parts = found if len(quantities) > 1 else [found]
            for column, part in zip(columns, parts, strict=True):
                column.append(part)
    back = np.argsort(order)
    arrays = tuple(np.concatenate(column)[back] for column in columns)
    return arrays if len(arrays) > 1 else arrays[0]


# ---- a picture of them ---------------------------------------------------------------------

@search()
def plot_pairs(
    points: PointsLike,
    i: npt.ArrayLike,
    j: npt.ArrayLike,
    S: npt.ArrayLike | None = None,
    *,
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    ax: Axes | None = None,
    unit: str | None = None,
) -> Axes:
    """Draw points and a line for each pair, in up to three dimensions; images are always exact.

    Parameters
    ----------
    {points}
        Each of their types has a colour and an entry in the legend.
    i, j : array_like of int, shape (m,)
        The points of each pair.
    S : array_like of int, shape (m, d), optional
        The shift of each pair. Default: that of the nearest image, as `measure` finds it.
    {box, periodic}
    {ax, unit}

    {drawn}
    TypeError, ValueError, OverflowError
        As `measure`; ValueError also for points of more than three dimensions, axes that do not
        fit, or more than 200 000 pairs.

    Notes
    -----
    Points are drawn where they are. A line goes from point i to the image of j that belongs to the
    pair. Lines to an image with S other than 0 are dotted, and end where no point is drawn.

    Examples
    --------
    >>> import halfshell as hs
    >>> points, box = [[0.5, 0.5], [1.5, 0.5], [3.5, 0.5]], [4.0, 4.0]
    >>> i, j, S = hs.pairs(points, 1.0, box=box, quantities="ijS")
    >>> ax = hs.plot_pairs(points, i, j, S, box=box)  # doctest: +SKIP
    """
    known = Points._of(points, "points", box, periodic)
    array, vectors, kinds = known.positions, known.box, known.types
    ndim = array.shape[1]
    D, shifts = measure(known, i, j, S, quantities="DS")
    if len(D) > MOST_LINES:
        raise ValueError(f"at most {MOST_LINES} pairs can be drawn, got {len(D)}")
    ax = axes_for(ndim, ax)
    start = array[np.asarray(i, dtype=np.int64).reshape(-1)].astype(np.float64)
    inside = ~shifts.any(axis=1)
    draw_lines(ax, start[inside], (start + D)[inside], colors="0.45")
    draw_lines(ax, start[~inside], (start + D)[~inside], colors="0.5", linestyles="dotted")
    if vectors is not None:
        draw_box(ax, vectors)
    if kinds is None:
        draw_dots(ax, array)
    else:
        for kind in np.unique(kinds):
            draw_dots(ax, array[kinds == kind], label=str(kind))
        if len(kinds):
            ax.legend()
    return finish(ax, ndim, unit)


# ---- those of bonds ------------------------------------------------------------------------

def bonded(bonds: npt.ArrayLike, n: int, within: int = 3) -> npt.NDArray[np.int64]:
    """Find the pairs of points that are at most so many bonds apart.

    Parameters
    ----------
    bonds : array_like of int, shape (m, 2)
        Numbers of two points for each bond, in any order; bonds may repeat.
    n : int
        The number of points.
    within : int, default 3
        The largest number of bonds between the two: 1 for bonds alone, 2 with angles, 3 with
        dihedrals.

    Returns
    -------
    ndarray of int64, shape (k, 2)
        Pairs (i, j) with i < j, each once, ascending: what `exclude` takes.

    Raises
    ------
    TypeError, ValueError
        If `bonds` does not hold pairs of numbers of the points, or `within` is less than 1.
    OverflowError
        If `n` is 2**31 or more.

    Examples
    --------
    A chain of four points:

    >>> import halfshell as hs
    >>> hs.bonded([[0, 1], [1, 2], [2, 3]], 4, within=2).tolist()
    [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    """
    n_points, most = as_whole(n, "n"), as_count(within, "within")
    if n_points < 0:
        raise ValueError(f"n must be from 0 on, got {n_points}")
    if n_points >= 2**31:
        raise OverflowError(f"n must be less than 2**31, the most points, got {shown(n_points)}")
    array = as_array(bonds, "bonds", "be pairs of numbers, (m, 2)")
    if array.shape == (0,):
        array = np.empty((0, 2), np.int64)
    if array.ndim != 2 or array.shape[1] != 2:
        raise ValueError(f"bonds must have shape (m, 2), got {array.shape}")
    first = as_point_numbers(array[:, 0], "bonds[:, 0]", n_points, "points")
    second = as_point_numbers(array[:, 1], "bonds[:, 1]", n_points, "points")
    steps = _unique(np.concatenate([first, second]), np.concatenate([second, first]), n_points)
    ends, begins = np.unique(steps[0], return_index=True)  # of bonds; a row of steps for each
    begins = np.append(begins, len(steps[0]))
    found = last = steps
    for _ in range(most - 1):
        offsets, entries = entries_of(begins, np.searchsorted(ends, last[1]))
        further = _unique(np.repeat(last[0], np.diff(offsets)), steps[1][entries], n_points)
        keys = further[0] * n_points + further[1]
        new = ~np.isin(keys, found[0] * n_points + found[1])
        last = further[0][new], further[1][new]
        if not len(last[0]):
            break
        found = _unique(
            np.concatenate([found[0], last[0]]), np.concatenate([found[1], last[1]]), n_points
        )
    half = found[0] < found[1]
    return np.stack([found[0][half], found[1][half]], axis=1)


def _unique(i: npt.NDArray[Any], j: npt.NDArray[Any], n: int) -> tuple[Any, Any]:
    """Each pair of two different points once, ascending."""
    apart = i != j
    keys = np.unique(i[apart] * n + j[apart])
    return keys // max(n, 1), keys % max(n, 1)
