# SPDX-License-Identifier: BSD-3-Clause
"""Searches of dask arrays and dataframes, in any number of processes, with one search's answer.

All is lazy: nothing is read or searched before ``compute``. Bricks are cut by a sample of each
chunk; each chunk gives its points to the bricks that own or need them; each brick is then a task.
`halfshell.settings` around a call hold for its tasks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from inspect import signature
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import as_real_array
from halfshell._convert.foreign import is_a, kind_of, whole_number
from halfshell._convert.lengths import as_edges
from halfshell._convert.options import as_brick_count, as_flag, check_letters
from halfshell._convert.points import MAX_DIM
from halfshell._convert.points import Points as _Points
from halfshell._errors import needs
from halfshell._functions.bricks import (
    Brick,
    Bricks,
    Division,
    Part,
    Piece,
    Summary,
    Terms,
    check_precision,
    divide,
    part_of,
    renumbered,
    split,
    summary,
)
from halfshell._functions.counts import count_pairs as _count_pairs
from halfshell._functions.counts import pair_histogram as _pair_histogram
from halfshell._functions.neighbors import coordination as _coordination
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._search import document, spell_out
from halfshell._settings import current, settings

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
    return _task(Bricks)([part.in_order()[0] for part in parts.parts])


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
    found = parts.each(_pairs_of, {**parts.options, "quantities": quantities})
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
    found = parts.each(_neighbors_of, {**parts.options, "quantities": quantities})
    is_full = search.get("rule") not in ("gather", "scatter")
    table = _task(_table_of)(quantities, is_full, parts.division, *found)
    if as_flag(sort, "sort"):
        found = parts.in_ranges(found)
    rows, counts = _columns(found, 0, "ij", 0, first=0)
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
    found = parts.in_ranges(parts.each(_coordination_of, parts.options))
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
    cutoffs = cutoff if several is None else several
    return parts.total(_count_pairs, cutoffs, rule=parts.terms.rule)


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
    return parts.total(_pair_histogram, limits)


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
        check_precision()
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
        summaries = [_task(_summary_of)(*one, len(each)) for one in each]
        self.division = _task(divide)(self.terms, n_bricks, *summaries)
        pieces = [_task(_pieces_of)(*one, self.division) for one in each]
        self.parts = [
            _task(part_of)(self.division, *[piece[k] for piece in pieces]) for k in range(n_bricks)
        ]

    def each(self, task: Callable[..., Any], *arguments: Any) -> list[Any]:
        """What a task finds in each part."""
        return [_task(task)(part, current()._asdict(), *arguments) for part in self.parts]

    def total(self, count: Callable[..., Any], by: Any, **options: Any) -> Any:
        """What is counted in all parts together."""
        shape = np.shape(count(self.terms.of_none(), by, **options))
        found = self.each(_counted, count, by, {**self.options, **options})
        return da.from_delayed(_task(sum)(found, np.int64(0)), shape, np.int64)

    def in_ranges(self, found: list[Any]) -> list[Any]:
        """What parts found, in as many ranges of ascending points."""
        n = len(self.parts)
        cuts = [_task(_cut)(groups, self.division, n) for groups in found]
        return [_task(_merged)(*[one[k] for one in cuts]) for k in range(n)]


def _columns(found: Sequence[Any], group: int, quantities: str, ndim: int, first: int = 1) -> Any:
    """The array of each letter, which stand in a group from the first column on; a chunk a part."""
    arrays = []
    for place, letter in enumerate(quantities, first):
        width = {"P": (2,), "S": (ndim,), "D": (ndim,)}.get(letter, ())
        shape = (math.nan, *width)
        blocks = [da.from_delayed(one[group][place], shape, _TYPES[letter]) for one in found]
        arrays.append(da.concatenate(blocks, allow_unknown_chunksizes=True))
    return tuple(arrays) if len(arrays) > 1 else arrays[0]


for _function in (bricks, pairs, neighbors, coordination, count_pairs, pair_histogram):
    document(_function)
    spell_out(_function, [signature(_Parts).parameters[name] for name in Search.__annotations__])


# ---- chunks --------------------------------------------------------------------------------

def _chunks(points: Any) -> tuple[list[Any], tuple[float, ...], int, np.dtype[Any]]:
    """Delayed arrays of rows, how many rows (NaN if unknown) and columns they have, their type."""
    if isinstance(points, da.Array):
        if points.ndim != 2:
            raise ValueError(f"points must have shape (n, d), got {points.ndim} axes")
        if math.isnan(points.shape[1]):
            raise ValueError(
                "points must have a known number of columns; points.compute_chunk_sizes() finds it"
            )
        ndim, dtype = int(points.shape[1]), np.dtype(points.dtype)
        types = [("points", dtype)]
        whole = points.rechunk({1: -1}) if points.numblocks[1] > 1 else points
        chunks, lengths = list(whole.to_delayed()[:, 0]), points.chunks[0]
    elif not isinstance(points, Delayed) and all(
        hasattr(points, name) for name in ("to_delayed", "dtypes", "columns")
    ):
        if getattr(points, "ndim", 2) != 2:
            raise ValueError("points must be a dataframe with a column for each axis")
        types = [(f"column {name!r} of points", one) for name, one in points.dtypes.items()]
        ndim = len(types)
        dtype = np.dtype(np.float32 if all(one == np.float32 for _, one in types) else np.float64)
        chunks = [_task(_of_columns)(part, dtype) for part in points.to_delayed()]
        lengths = (math.nan,) * len(chunks)
    else:
        raise TypeError(
            "points must be a dask array or dataframe, or Points of these, got "
            f"{kind_of(points)}; dask.array.from_array makes one of an array"
        )
    if not 1 <= ndim <= MAX_DIM:
        raise ValueError(f"points must have from 1 to {MAX_DIM} columns, got {ndim}")
    for name, one in types:
        if not isinstance(one, np.dtype) or one.kind not in "biuf" or one.itemsize > 8:
            raise TypeError(f"{name} must hold real numbers, got {one}")
    return chunks, lengths, ndim, dtype


# ---- tasks ---------------------------------------------------------------------------------

# What a brick finds is a tuple of groups; a group is a tuple of arrays of one length, of which the
# first holds numbers of points, ascending.
Array = npt.NDArray[Any]
Group = tuple[Array, ...]
Known = dict[str, Any]  # what else is known of the points of a chunk


def _of_columns(frame: Any, dtype: np.dtype[Any]) -> Array:
    """Coordinates in the columns of a table; nothing is rounded."""
    array = np.empty((len(frame), len(frame.columns)), dtype)
    for place, name in enumerate(frame.columns):
        array[:, place] = as_real_array(frame[name].to_numpy(), f"column {name!r} of points")
    return array


def _of_chunk(chunk: Any, ndim: int, dtype: np.dtype[Any], place: int, known: Known) -> _Points:
    """The points of a chunk, if it is what the whole was said to be."""
    array = np.asanyarray(chunk)
    if array.ndim != 2 or array.shape[1] != ndim:
        raise ValueError(
            f"points must have {ndim} columns in every chunk; chunk {place} has shape {array.shape}"
        )
    if array.dtype != dtype:
        raise TypeError(
            f"points must be of {dtype} in every chunk, as the whole says; chunk {place} is of "
            f"{array.dtype}"
        )
    return _Points(array, **known) if known else _Points._of(array)


def _summary_of(
    chunk: Any, ndim: int, dtype: np.dtype[Any], place: int, known: Known, n_chunks: int
) -> Summary:
    """What a division must know of a chunk; what is wrong with its points is a part of it."""
    try:
        return summary(_of_chunk(chunk, ndim, dtype, place, known), n_chunks)
    except (ValueError, OverflowError) as error:
        n_points = len(chunk) if np.ndim(chunk) else 0
        return Summary(n_points, 0.0, np.empty((0, ndim)), 1.0, error=error)


def _pieces_of(
    chunk: Any, ndim: int, dtype: np.dtype[Any], place: int, known: Known, division: Division
) -> list[Piece]:
    return split(_of_chunk(chunk, ndim, dtype, place, known), division, place)


def _pairs_of(part: Part, how: dict[str, Any], options: dict[str, Any]) -> tuple[Group, ...]:
    """One group: i, and a column for each letter."""
    quantities = options["quantities"]
    letters = "i" + quantities.replace("i", "")
    with _searching(part, how) as (brick, points):
        found = brick.pairs(points, **{**options, "quantities": letters})
    arrays = list(found) if isinstance(found, tuple) else [found]
    columns = dict(zip(letters, arrays, strict=True))
    return ((arrays[0], *(columns[letter] for letter in quantities)),)


def _neighbors_of(part: Part, how: dict[str, Any], options: dict[str, Any]) -> tuple[Group, ...]:
    """Two groups: points and how many neighbours they have; point and columns of each neighbour."""
    with _searching(part, how) as (brick, points):
        table = brick.neighbors(points, **options)
    owned, counts = brick.owned, np.asarray(table.counts, np.int64)
    columns = [table._column(letter) for letter in options["quantities"]]
    return (owned, counts), (np.repeat(owned, counts), *columns)


def _coordination_of(part: Part, how: dict[str, Any], options: dict[str, Any]) -> tuple[Group, ...]:
    """One group: points, and how many neighbours they have."""
    with _searching(part, how) as (brick, points):
        options = {**options, "exclude": brick._excluded(options.get("exclude"))}
        of_all = _coordination(points, brick.cutoff, rule=part.scope.rule, **options)
    return ((brick.owned, of_all[brick.is_owned]),)


def _counted(
    part: Part, how: dict[str, Any], count: Callable[..., Any], by: Any, options: dict[str, Any]
) -> Any:
    """What is counted among owned points and those of later bricks, less that among the latter."""
    found = []
    for kinds in ((0, 2), (1, 2)):
        with _searching(part, how, *kinds) as (brick, points):
            exclude = brick._excluded(options.get("exclude"))
            found.append(count(points, by, **{**options, "exclude": exclude}))
    return found[0] - found[1]


@contextmanager
def _searching(part: Part, how: dict[str, Any], *kinds: int) -> Iterator[tuple[Brick, _Points]]:
    """Points of some kinds, with settings; errors name them by their numbers among all."""
    brick, points = part.in_order(*kinds)
    try:
        with settings(**how):
            yield brick, points
    except (ValueError, OverflowError) as error:
        raise renumbered(error, brick.members) from None


def _cut(groups: Sequence[Group], division: Division, n: int) -> list[list[Group]]:
    """What belongs to each of n ranges of points, of equal length but for one."""
    n_points = division.scope.n_points
    limits = np.array([n_points * k // n for k in range(n + 1)], np.int64)
    places = [np.searchsorted(group[0], limits) for group in groups]
    return [
        [
            tuple(array[place[k] : place[k + 1]] for array in group)
            for group, place in zip(groups, places, strict=True)
        ]
        for k in range(n)
    ]


def _merged(*cuts: Sequence[Group]) -> list[Group]:
    """One range of points from all bricks, ascending by point.

    All entries of a point are of one brick, and in order there.
    """
    whole = []
    for groups in zip(*cuts, strict=True):
        columns = [np.concatenate(column) for column in zip(*groups, strict=True)]
        order = np.argsort(columns[0], kind="stable")
        whole.append(tuple(column[order] for column in columns))
    return whole


def _table_of(
    quantities: str, is_full: bool, division: Division, *found: Sequence[Group]
) -> NeighborTable:
    """The rows of all points, ascending, from what `_neighbors_of` returns for each brick."""
    (_, counts), (_, *columns) = _merged(*found)
    offsets = np.concatenate((np.zeros(1, np.int64), np.cumsum(counts, dtype=np.int64)))
    return NeighborTable((offsets, *columns), quantities, division.scope.n_points, is_full)
