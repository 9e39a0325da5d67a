# SPDX-License-Identifier: BSD-3-Clause
"""Searches of dask arrays and dataframes, in any number of processes, with one search's answer.

All is lazy: nothing is read or searched before ``compute``. Bricks are cut by a sample of each
chunk; each chunk gives its points to the bricks that own or need them; each brick is then a task.
`halfshell.settings` around a call hold for its tasks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from halfshell._convert.foreign import is_a, kind_of, whole_number
from halfshell._convert.lengths import as_edges
from halfshell._convert.options import as_brick_count, as_flag, check_letters
from halfshell._convert.points import MAX_DIM
from halfshell._convert.points import Points as _Points
from halfshell._errors import needs
from halfshell._functions import brick_tasks
from halfshell._functions.bricks import Terms, divide, part_of
from halfshell._functions.counts import count_pairs as _count_pairs
from halfshell._search import document, spell_out
from halfshell._settings import current

if TYPE_CHECKING:
    from halfshell._convert.types import ArrayLike, BoxLike, CutoffLike, PeriodicLike, Rule

try:
    import dask
    import dask.array as da
    from dask.delayed import Delayed  # which has every attribute
except ModuleNotFoundError as error:
    if error.name not in ("dask", "dask.array"):
        raise
    raise ImportError(
        f"{needs('halfshell.dask', 'dask[array]')} (the extra halfshell[distributed])"
    ) from None

__all__ = ["Neighbors", "Points", "bricks", "coordination", "count_pairs", "neighbors",
           "pair_histogram", "pairs"]  # fmt: skip

Collection = Any  # a dask Array, DataFrame or Delayed, also for type checkers without dask

_TYPES = {"i": np.int64, "j": np.int64, "P": np.int64, "S": np.int32, "d": np.float64,
          "D": np.float64}  # fmt: skip


class Search(TypedDict, total=False):
    """The keywords that all functions here share, as `pairs` has them."""

    n: int | None
    box: BoxLike | None
    periodic: PeriodicLike | None
    rule: Rule | None
    exclude: ArrayLike | int | None
    min_distance: float | None
    inclusive: bool
    threads: int


class Points:
    """Points of dask and what is known of each, in place of points in all functions here.

    Parameters
    ----------
    positions : dask Array or DataFrame of real numbers, shape (n, d)
        Coordinates, in chunks of any length, which need not be known; 1 <= d <= 8. Points are
        numbered across all chunks. The columns of a dataframe are the axes.
    box, periodic
        As in `halfshell.Points`.
    radii, types, supports, groups, labels : dask Array or Series, or array_like, optional
        As in `halfshell.Points`, in chunks of any length, or of those of `positions` where these
        are not known; `radii` may be a dict by type. What is no dask collection needs known
        chunks.

    Raises
    ------
    TypeError, ValueError
        If something is not of the kind or the shape that its metadata should say.

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> positions = da.from_array([[0.0], [1.0], [3.0]], chunks=2)
    >>> points = hd.Points(positions, radii=[0.25, 0.75, 1.0], box=4.0)
    >>> hd.pairs(points, None, quantities="P").compute().tolist()
    [[0, 1], [0, 2]]
    """

    def __init__(
        self,
        positions: Collection,
        *,
        box: BoxLike | None = None,
        periodic: PeriodicLike | None = None,
        radii: Collection | Mapping[Any, float] | None = None,
        types: Collection | None = None,
        supports: Collection | None = None,
        groups: Collection | None = None,
        labels: Collection | None = None,
    ) -> None:
        self.chunks, self.lengths, self.ndim, self.dtype = _chunks(positions)
        self.box, self.periodic = box, periodic
        self.known: list[dict[str, Any]] = [{} for _ in self.chunks]
        given = {"radii": radii, "types": types, "supports": supports, "groups": groups,
                 "labels": labels}  # fmt: skip
        self.fields = tuple(name for name, values in given.items() if values is not None)
        for name in self.fields:
            values = given[name]
            if is_a(values, Mapping):
                columns = [values] * len(self.chunks)
            else:
                columns = self._aligned(values, name)
            for known, column in zip(self.known, columns, strict=True):
                known[name] = column

    @property
    def n_points(self) -> float:
        """How many points there are, NaN if that is not known."""
        return float(sum(self.lengths))

    def _aligned(self, values: Any, name: str) -> list[Any]:
        """The rows of each chunk of the positions."""
        if hasattr(values, "to_delayed") and not isinstance(values, da.Array | Delayed):
            values = values.to_dask_array()
        if not isinstance(values, da.Array):
            values = da.from_array(np.asanyarray(values))
        n = self.n_points
        if not (math.isnan(n) or math.isnan(values.shape[0])):
            if values.shape[0] != n:
                raise ValueError(f"{name} must have a row for each of {n:.0f} points, got "
                                 f"{values.shape[0]}")  # fmt: skip
            values = values.rechunk((self.lengths, *[-1] * (values.ndim - 1)))
        if values.numblocks[0] != len(self.chunks):
            raise ValueError(
                f"{name} must have the chunks of points, whose lengths are not known: "
                f"{len(self.chunks)}, got {values.numblocks[0]}"
            )
        return list(values.rechunk(dict.fromkeys(range(1, values.ndim), -1)).to_delayed().ravel())


class Neighbors(NamedTuple):
    """What `neighbors` returns: rows of points, brick after brick, or ascending if sorted.

    Attributes
    ----------
    points : dask Array of int64, shape (n,)
        The point of each row.
    counts : dask Array of int64, shape (n,)
        Its number of neighbours.
    columns : dask Array, or tuple of them
        The `quantities` of each neighbour, row after row; m neighbours in all.
    table : Delayed
        All rows as the `NeighborTable` that `halfshell.neighbors` returns, in one process.
    """

    points: Collection
    counts: Collection
    columns: Collection
    table: Collection


def bricks(points: Collection | Points, cutoff: CutoffLike, **search: Unpack[Search]) -> Collection:
    """Divide points as the other functions of this module do, to find out what that costs.

    Bricks are as those of `halfshell.bricks`, but own about as many points each, not exactly: they
    are cut by a sample of the points. Returns a Delayed, `halfshell.Bricks` of all points.

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> hd.bricks(da.arange(8.0, chunks=4)[:, None], 1.0).compute()
    Bricks(2 of 8 points, overhead 1.25)
    """
    parts = _Parts(points, cutoff, directed=True, **search)
    return _task(brick_tasks.bricks_of)(
        parts.division, *[_task(brick_tasks.brick_of)(part) for part in parts.parts]
    )


def pairs(
    points: Collection | Points,
    cutoff: CutoffLike,
    *,
    quantities: str = "ij",
    sort: bool = False,
    **search: Unpack[Search],
) -> Collection:
    """Find all pairs of points within a cutoff, always exactly, brick by brick.

    Parameters
    ----------
    points : dask Array or DataFrame of real numbers, shape (n_points, d), or Points
        Coordinates, in chunks of any length, which need not be known; 1 <= d <= 8. Points are
        numbered across all chunks. `Points` of this module say what else is known of each.
    {cutoff}
    quantities : str, default "ij"
        Any of the letters ``i j d D S P``, as in `halfshell.pairs`.
    sort : bool, default False
        Sort all pairs by (i, j, S), ascending, byte for byte as `halfshell.pairs` with
        ``sort=True``. The pairs of every brick are then sent to as many tasks as there are bricks.
        Otherwise they have this order within each chunk, which is a brick.
    n : int, optional
        Number of bricks, 1 to 2**20. Default: the number of chunks of `points`.
    {box, periodic, rule, exclude, min_distance, inclusive}
    threads : int, default 1
        Threads of each task; dask runs several tasks at once.

    Returns
    -------
    dask Array or tuple of them
        As `halfshell.pairs` returns them, with chunks of unknown length.

    Raises
    ------
    TypeError, ValueError, OverflowError
        At once, for arguments and the metadata of the collection; when the result is computed, for
        coordinates, named by their position among all points, and for chunks that do not match the
        metadata.

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> points = da.from_array([[0.0], [1.0], [3.0]], chunks=2)
    >>> hd.pairs(points, 1.5, box=[4.0], quantities="P", sort=True).compute().tolist()
    [[0, 1], [0, 2]]
    """
    check_letters(quantities)
    parts = _Parts(points, cutoff, **search)
    found = parts.each(brick_tasks.pairs_of, {**parts.options, "quantities": quantities})
    if as_flag(sort, "sort"):
        found = parts.in_ranges(found)
    return _columns(found, 0, quantities, parts.terms.ndim)


def neighbors(
    points: Collection | Points,
    cutoff: CutoffLike,
    *,
    quantities: str = "j",
    sort: bool = False,
    **search: Unpack[Search],
) -> Neighbors:
    """Find all neighbours of each point, always exactly, brick by brick.

    Arguments are those of `pairs`, but for two: `quantities` are any of the letters ``j d D S``, as
    in `halfshell.neighbors`; with `sort`, rows are in the order of the points, byte for byte as
    there, otherwise brick by brick. `Neighbors.table` does not depend on `sort`.

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> points = da.from_array([[0.0], [1.0], [3.0]], chunks=2)
    >>> found = hd.neighbors(points, 1.5, box=[4.0])
    >>> [row.tolist() for row in found.table.compute()]
    [[1, 2], [0], [0]]
    """
    check_letters(quantities)
    if not set(quantities) <= set("jdDS"):
        raise ValueError(f"quantities of neighbors are some of j d D S, got {quantities!r}")
    parts = _Parts(points, cutoff, directed=True, **search)
    found = parts.each(brick_tasks.neighbors_of, {**parts.options, "quantities": quantities})
    is_full = search.get("rule") not in ("gather", "scatter")
    table = _task(brick_tasks.table_of)(quantities, is_full, parts.division, *found)
    if as_flag(sort, "sort"):
        found = parts.in_ranges(found)
    rows, counts = (_joined(found, 0, place, (math.nan,), np.int64) for place in (0, 1))
    return Neighbors(rows, counts, _columns(found, 1, quantities, parts.terms.ndim), table)


def coordination(
    points: Collection | Points, cutoff: CutoffLike, **search: Unpack[Search]
) -> Collection:
    """Count the neighbours of each point, always exactly, as `halfshell.coordination`.

    Arguments are those of `pairs`. The result is a dask Array of int64, shape (n_points,), in the
    order of the points.

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> points = da.from_array([[0.0], [1.0], [3.0]], chunks=2)
    >>> hd.coordination(points, 1.5, box=[4.0]).compute().tolist()
    [2, 1, 1]
    """
    parts = _Parts(points, cutoff, directed=True, **search)
    found = parts.in_ranges(parts.each(brick_tasks.coordination_of, parts.options))
    n_ranges, lengths = len(found), [math.nan] * len(found)
    if not math.isnan(parts.n_points):
        limits = [int(parts.n_points) * k // n_ranges for k in range(n_ranges + 1)]
        lengths = [high - low for low, high in pairwise(limits)]
    return da.concatenate(
        [
            da.from_delayed(groups[0][1], (length,), np.int64)
            for groups, length in zip(found, lengths, strict=True)
        ],
        allow_unknown_chunksizes=True,
    )


def count_pairs(
    points: Collection | Points, cutoff: CutoffLike, **search: Unpack[Search]
) -> Collection:
    """Count all pairs within a cutoff, or several, always exactly.

    Arguments are those of `pairs`; `cutoff` may also be several in ascending order, shape (k,). The
    result is a dask Array of int64, shape () or (k,).

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> points = da.from_array([[0.0], [1.0], [3.0]], chunks=2)
    >>> int(hd.count_pairs(points, 1.5, box=[4.0]).compute())
    2
    """
    several: Any = None if is_a(cutoff, Mapping) or np.ndim(cutoff) != 1 else np.array(cutoff)  # type: ignore[arg-type]
    largest: Any = cutoff if several is None else several[-1] if len(several) else 0.0
    parts = _Parts(points, largest, **search)
    _count_pairs(parts.terms.of_none(), cutoff, rule=parts.terms.rule)
    cutoffs = cutoff if several is None else several
    counts = parts.each(brick_tasks.counts_of, cutoffs, parts.options)
    return da.from_delayed(_task(brick_tasks.total)(*counts), np.shape(several)
                           if several is not None else (), np.int64)  # fmt: skip


def pair_histogram(
    points: Collection | Points, edges: npt.ArrayLike, **search: Unpack[Search]
) -> Collection:
    """Count all pairs by distance, always exactly, as `halfshell.pair_histogram`.

    Arguments are those of `pairs`, without `rule` and `inclusive`. `edges` are the limits of the
    bins; the result is a dask Array of int64, shape (bins,).

    Examples
    --------
    >>> import dask.array as da
    >>> import halfshell.dask as hd
    >>> points = da.from_array([[0.0], [1.0], [3.0]], chunks=2)
    >>> hd.pair_histogram(points, [0.0, 1.5, 2.0], box=[4.0]).compute().tolist()
    [2, 2]
    """
    limits = as_edges(edges)
    for name in ("rule", "inclusive"):
        if name in search:
            raise TypeError(f"pair_histogram() got an unexpected keyword argument {name!r}")
    parts = _Parts(points, float(limits[-1]), by_reach=False, **search)
    counts = parts.each(brick_tasks.histogram_of, limits, parts.options)
    return da.from_delayed(_task(brick_tasks.total)(*counts), (len(limits) - 1,), np.int64)


# ---- parts of a division, and what is found in them ----------------------------------------

def _task(function: Callable[..., Any]) -> Callable[..., Any]:
    made: Callable[..., Any] = dask.delayed(function, pure=True)
    return made


class _Parts:
    """Parts of a division that is to come, after all that can be refused before it."""

    def __init__(
        self,
        points: Any,
        cutoff: Any,
        *,
        n: int | None = None,
        box: BoxLike | None = None,
        periodic: PeriodicLike | None = None,
        rule: Rule | None = None,
        exclude: ArrayLike | int | None = None,
        min_distance: float | None = None,
        inclusive: bool = True,
        threads: int = 1,
        by_reach: bool = True,
        directed: bool = False,
    ) -> None:
        given = points if isinstance(points, Points) else Points(points, box=box, periodic=periodic)
        for name, value in (("box", box), ("periodic", periodic)):
            if given is points and value is not None:
                raise ValueError(f"Points bring their own {name}: leave {name} out")
        if current().precision != "exact":
            raise ValueError(f"bricks need precision 'exact', got {current().precision!r}")
        n_bricks = max(1, len(given.chunks)) if n is None else as_brick_count(n)
        scene = _Points(np.empty((0, given.ndim)), box=given.box, periodic=given.periodic)
        # Radii and supports do not matter for a histogram, nor whether the cutoff counts.
        fields = [name for name in given.fields if by_reach or name not in ("radii", "supports")]
        flags = None if scene.periodic is None else tuple(scene.periodic.tolist())
        self.terms = Terms(cutoff, rule, scene.box, flags, given.ndim, tuple(fields))
        self.terms.call(directed)
        self.options: dict[str, Any] = {"min_distance": min_distance, "threads": threads}
        if by_reach:
            self.options["inclusive"] = inclusive
        is_number = exclude is None or whole_number(exclude, "exclude") is not None
        _count_pairs(  # of no points, which refuses what a search would refuse
            self.terms.of_none().replace(radii=None, supports=None), 0.0,
            exclude=exclude if is_number else np.empty((0, 2), np.int64), **self.options,
        )  # fmt: skip
        self.options["exclude"] = exclude if is_number else np.array(exclude)
        self.n_points = given.n_points
        each = [
            (chunk, given.ndim, given.dtype, place, {name: known[name] for name in fields})
            for place, (chunk, known) in enumerate(zip(given.chunks, given.known, strict=True))
        ]
        summaries = [_task(brick_tasks.summary_of)(*one, len(each)) for one in each]
        self.division = _task(divide)(self.terms, n_bricks, *summaries)
        pieces = [_task(brick_tasks.pieces_of)(*one, self.division) for one in each]
        self.parts = [
            _task(part_of)(self.division, *[piece[k] for piece in pieces]) for k in range(n_bricks)
        ]

    def each(self, task: Callable[..., Any], *arguments: Any) -> list[Any]:
        """What a task finds in each part."""
        return [_task(task)(part, current()._asdict(), *arguments) for part in self.parts]

    def in_ranges(self, found: list[Any]) -> list[Any]:
        """What parts found, in as many ranges of ascending points."""
        n = len(self.parts)
        cuts = [_task(brick_tasks.cut)(groups, self.division, n) for groups in found]
        return [_task(brick_tasks.merged)(*[one[k] for one in cuts]) for k in range(n)]


def _joined(
    found: Sequence[Any], group: int, place: int, shape: tuple[float, ...], dtype: Any
) -> Any:
    """One array of what parts found, with a chunk for each."""
    blocks = [da.from_delayed(one[group][place], shape, dtype) for one in found]
    return da.concatenate(blocks, allow_unknown_chunksizes=True)


def _columns(found: Sequence[Any], group: int, quantities: str, ndim: int) -> Any:
    """The array of each letter, which stand in a group before the last columns."""
    arrays = []
    for place, letter in enumerate(quantities, 1):
        width = {"P": (2,), "S": (ndim,), "D": (ndim,)}.get(letter, ())
        arrays.append(_joined(found, group, place, (math.nan, *width), _TYPES[letter]))
    return tuple(arrays) if len(arrays) > 1 else arrays[0]


for _function in (bricks, pairs, neighbors, coordination, count_pairs, pair_histogram):
    document(_function)
    spell_out(_function, Search.__annotations__, _Parts)


# ---- chunks --------------------------------------------------------------------------------

def _chunks(points: Any) -> tuple[list[Any], tuple[float, ...], int, np.dtype[Any]]:
    """Delayed arrays of rows, how many rows (NaN if unknown) and columns they have, their type."""
    if isinstance(points, da.Array):
        return _of_array(points)
    needed = ("to_delayed", "dtypes", "columns")
    if not isinstance(points, Delayed) and all(hasattr(points, name) for name in needed):
        return _of_frame(points)
    raise TypeError(
        f"points must be a dask array or dataframe, or Points of these, got {kind_of(points)}; "
        "dask.array.from_array makes one of an array"
    )


def _of_array(points: Any) -> tuple[list[Any], tuple[float, ...], int, np.dtype[Any]]:
    if points.ndim != 2:
        raise ValueError(f"points must have shape (n, d), got {points.ndim} axes")
    if math.isnan(points.shape[1]):
        raise ValueError(
            "points must have a known number of columns; points.compute_chunk_sizes() finds it"
        )
    ndim, dtype = int(points.shape[1]), np.dtype(points.dtype)
    _check(ndim, dtype, "points")
    if points.numblocks[1] > 1:
        points = points.rechunk({1: -1})
    return list(points.to_delayed()[:, 0]), points.chunks[0], ndim, dtype


def _of_frame(points: Any) -> tuple[list[Any], tuple[float, ...], int, np.dtype[Any]]:
    if getattr(points, "ndim", 2) != 2:
        raise ValueError("points must be a dataframe with a column for each axis")
    types = list(points.dtypes.items())
    for name, dtype in types:
        if not isinstance(dtype, np.dtype):
            raise TypeError(f"column {name!r} of points must be of a type of NumPy, got {dtype}")
        _check(1, dtype, f"column {name!r} of points")
    narrow = types and all(dtype == np.float32 for _, dtype in types)
    common = np.dtype(np.float32 if narrow else np.float64)
    _check(len(types), common, "points")
    chunks = [_task(brick_tasks.of_columns)(part, common) for part in points.to_delayed()]
    return chunks, (math.nan,) * len(chunks), len(types), common


def _check(ndim: int, dtype: np.dtype[Any], name: str) -> None:
    if not 1 <= ndim <= MAX_DIM:
        raise ValueError(f"points must have from 1 to {MAX_DIM} columns, got {ndim}")
    if dtype.kind not in "biuf" or dtype.itemsize > 8:
        raise TypeError(f"{name} must hold real numbers, got {dtype}")
