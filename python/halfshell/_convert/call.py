# SPDX-License-Identifier: BSD-3-Clause
"""The arguments that all searches share, as the core takes them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from copy import copy
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from halfshell._convert.arrays import as_array, as_real_array, in_order
from halfshell._convert.foreign import is_a, kind_of, shown, told, whole_number
from halfshell._convert.lengths import as_length, as_number, check_ascending, check_lengths
from halfshell._convert.memory import refuse_large
from halfshell._convert.objects import SYMBOLS
from halfshell._convert.options import LETTERS, SHELL, as_choice, as_flag, as_threads, check_letters
from halfshell._convert.points import Labels, Points
from halfshell._errors import shorten
from halfshell._settings import Settings, current

if TYPE_CHECKING:
    import numpy.typing as npt

    from halfshell._convert.types import FloatArray

#: Rules by which two radii or supports make the reach of a pair, in the order of the core.
RULES = ("sum", "mean", "max", "min", "gather", "scatter")
#: Those by which i may reach j, and j not i.
DIRECTED = ("gather", "scatter")
#: Supports do not add up.
RULES_OF_SUPPORTS = ("max", "min", *DIRECTED)

_LEAST_HALVED = 2.0**-1021  # halves lose no bit
_NO_PAIRS = -1.0  # the cutoff of two types that form none


class Known(NamedTuple):
    """What a search uses of each point, in the order of the core; None for what it does not use."""

    radii: FloatArray | None = None
    supports: FloatArray | None = None
    types: npt.NDArray[np.int32] | None = None
    weights: FloatArray | None = None
    groups: npt.NDArray[np.int64] | None = None
    labels: npt.NDArray[np.int64] | None = None

    def some(self, which: Any) -> Known:
        """Of these points."""
        return Known(
            *(None if one is None else np.ascontiguousarray(one[which]) for one in self)
        )


class Pairing(NamedTuple):
    """How far pairs reach, and which of them count, in the order of the core."""

    rule: int | None = None  # of RULES; None: as far as the cutoff
    extent: float | None = None  # how many times supports count, or radii
    table: FloatArray | None = None  # of cutoffs by types; negative: no pairs
    within: int | None = None  # the most that labels of excluded pairs differ by
    excluded: npt.NDArray[np.int64] | None = None  # pairs
    numbers: npt.NDArray[np.int64] | None = None  # of queries that are points
    least: float = 0.0  # distance


class Call:
    """One search: its points, queries and cutoff, which pairs count, and how it is made."""

    points: Points
    queries: Points | None
    cutoff: float  # the largest distance of any pair, or infinity
    inclusive: bool
    settings: Settings
    threads: int | None
    rule: str | None
    bar: Any = None  # to be closed at the end
    cells: Any = None  # of the core, in place of points and box
    progress: Any = None
    shells: FloatArray | None = None  # several cutoffs, ascending
    system_cutoffs: FloatArray | None = None  # one for each system
    known = known_of_queries = Known()
    pairing: Pairing | None = None  # None: all pairs within the cutoff
    indices: npt.NDArray[np.int64] | None = None

    # ---- as the core takes it --------------------------------------------------------------

    @property
    def array(self) -> npt.NDArray[Any]:
        return self.points.positions

    @property
    def asking(self) -> npt.NDArray[Any] | None:
        return None if self.queries is None else self.queries.positions

    @property
    def bits(self) -> int:
        """The axes that repeat, of one system."""
        return int(self.points._axes)

    @property
    def has_reach(self) -> bool:
        """Whether radii, supports or types say how far pairs reach."""
        return self.pairing is not None and self.pairing.rule is not None

    @property
    def core(self) -> tuple[Any, ...]:
        """The first ten arguments of every search of the core."""
        if self.cells is not None and not self.has_reach:
            return ((self.cells, *self.known, None), self.cutoff, None, 0, *self.rest)
        firsts = self.firsts(self.points.batch)
        return ((self.array, *self.known, firsts), *self.scene, *self.rest)

    @property
    def scene(self) -> tuple[Any, ...]:
        """The cutoff, the box and its axes: those of all systems, or of each one."""
        cutoff = self.cutoff if self.system_cutoffs is None else self.system_cutoffs
        return cutoff, self.points.box, self.points._axes

    @property
    def rest(self) -> tuple[Any, ...]:
        """The last six of these."""
        set_ = self.settings
        return (
            self.inclusive, set_.precision, set_.kernel, set_.memory_limit, self.progress,
            self.threads,
        )  # fmt: skip

    @property
    def query_set(self) -> tuple[Any, ...] | None:
        """The queries as the core takes them."""
        one = self.queries
        if one is None:
            return None
        return one.positions, *self.known_of_queries, self.firsts(one.batch)

    @cached_property
    def systems(self) -> npt.NDArray[np.int64]:
        """Numbers of the systems: all, if each has something of its own, or of those with points.

        So numbers may be as far apart as users like.
        """
        points = self.points.batch
        queries = None if self.queries is None else self.queries.batch
        own = [] if self.system_cutoffs is None else [len(self.system_cutoffs)]
        if isinstance(self.points._axes, np.ndarray):
            own.append(len(self.points._axes))
        if self.points.box is not None and self.points.box.ndim == 3:
            own.append(len(self.points.box))
        if not own:
            both = [one for one in (points, queries) if one is not None]
            every = both[0] if len(both) == 1 else np.sort(np.concatenate(both))
            return every[np.diff(every, prepend=-1) > 0]
        if len(set(own)) > 1:
            raise ValueError("cutoffs, boxes and axes are of as many systems")
        for name, batch in (("batch", points), ("query_batch", queries)):
            if batch is not None and len(batch) and batch[-1] >= own[0]:
                k = int(np.searchsorted(batch, own[0]))
                raise ValueError(
                    f"{name} must be less than the number of systems that box, periodic or cutoff "
                    f"is given for, {own[0]}, got {name}[{k}] = {batch[k]}"
                )
        return np.arange(own[0])

    def firsts(self, batch: npt.NDArray[np.int64] | None) -> npt.NDArray[np.int64] | None:
        """Where each system begins, and the last one ends; None for one system."""
        if batch is None:
            return None
        return np.append(np.searchsorted(batch, self.systems), len(batch))

    def by_number(self, found: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """What was found of each system, in the place of its number; 0 elsewhere."""
        n = int(self.systems[-1]) + 1 if len(self.systems) else 0
        whole = np.zeros((n, *found.shape[1:]), found.dtype)
        whole[self.systems] = found
        return whole

    def as_queries(self, numbers: npt.NDArray[np.int64]) -> tuple[tuple[Any, ...], Pairing | None]:
        """Some of the points as queries too, and how they pair."""
        batch = self.points.batch
        return (
            (self.array[numbers], *self.known.some(numbers),
             self.firsts(None if batch is None else batch[numbers])),
            self.pairing and self.pairing._replace(numbers=numbers),
        )  # fmt: skip

    def run(self, search: Callable[..., Any], *own: Any) -> Any:
        """Call a search of the core, with a bar that goes away at its end."""
        with closing(self):
            return search(*self.core, *own)

    def close(self) -> None:
        """Take the bar away, if there is one."""
        if self.bar is not None:
            self.bar.close()

    def refuse_batch(self, function: str, reason: str) -> None:
        """ValueError for several systems where they mean nothing, with why."""
        if self.points.batch is not None:
            raise ValueError(f"{function} cannot be combined with batch: {reason}")


def shells_of(quantities: Any, letters: str = LETTERS) -> str:
    """The argument `several` of `take`: "shells" if the letter k is wanted, beside these."""
    check_letters(quantities, letters + SHELL)
    return "shells" if SHELL in quantities else ""


def check_shells(call: Call, quantities: Any) -> None:
    """ValueError for the letter k without several cutoffs, or where they are not decided."""
    if SHELL not in quantities:
        return
    if call.points.batch is not None:
        raise ValueError("the letter k in quantities cannot be combined with a batch")
    if call.has_reach:
        raise ValueError(
            "the letter k in quantities cannot be combined with radii, supports or cutoffs by type"
        )
    if call.shells is None:
        raise ValueError("the letter k in quantities needs several cutoffs, got one")
    if call.settings.precision != "exact":
        raise ValueError(
            "the letter k in quantities needs precision 'exact', got "
            f"{call.settings.precision!r}"
        )


def part_of(progress: Any, k: int, n: int) -> Any:
    """The progress of the k-th of n searches, which together are one."""
    return progress and (lambda fraction: progress((k + fraction) / n))


def each_cutoff(call: Call) -> Iterator[Call]:
    """The call with each of its several cutoffs in turn, as parts of one search."""
    assert call.shells is not None
    cutoffs, call.shells = call.shells.tolist(), None
    with closing(call):
        for k, cutoff in enumerate(cutoffs):
            one = copy(call)
            one.progress, one.bar = part_of(call.progress, k, len(cutoffs)), None
            if call.pairing is not None and call.pairing.extent is not None:
                one.pairing = call.pairing._replace(extent=cutoff + 0.0)
            else:
                one.cutoff = cutoff
            yield one


def each_system(call: Call) -> Iterator[tuple[Call, int]]:
    """A call for each system that has points, and the number of its first point among all."""
    points, queries = call.points, call.queries
    assert points.batch is not None
    if call.system_cutoffs is not None:
        check_lengths(call.system_cutoffs, "cutoff")
    numbers, bounds = np.unique(points.batch, return_index=True)
    asked = None
    if queries is not None and queries.batch is not None:
        asked = [np.searchsorted(queries.batch, numbers, side) for side in ("left", "right")]
    firsts = [*bounds.tolist(), len(points)]
    for k, (s, (first, end)) in enumerate(zip(numbers.tolist(), pairwise(firsts), strict=True)):
        one = copy(call)
        one.points = _part(points, s, slice(first, end))
        own_queries = slice(0, 0)
        if queries is not None and asked is not None:
            own_queries = slice(int(asked[0][k]), int(asked[1][k]))
            one.queries = _part(queries, s, own_queries)
        if call.system_cutoffs is not None:
            one.cutoff, one.system_cutoffs = float(call.system_cutoffs[s]), None
        own = slice(first, end)
        one.known = call.known.some(own)
        one.known_of_queries = call.known_of_queries.some(own_queries)
        pairing = call.pairing
        if pairing is not None and pairing.excluded is not None:
            asking = own if queries is None else own_queries
            i, j = pairing.excluded.T
            mine = (asking.start <= i) & (i < asking.stop) & (first <= j) & (j < end)
            own_pairs = pairing.excluded[mine] - [asking.start, first]
            one.pairing = pairing._replace(excluded=np.ascontiguousarray(own_pairs))
        yield one, first


def _part(points: Points, s: int, places: slice) -> Points:
    """The points of system s, which share memory with all."""
    parts: dict[str, Any] = {"batch": None}
    for name in ("positions", "radii", "supports", "weights", "_types", "_groups", "_labels"):
        column = getattr(points, name)
        parts[name] = None if column is None else column[places]
    if points._box is not None and points._box.ndim == 3:
        parts["_box"] = points._box[s]
    if isinstance(points._axes, np.ndarray):
        parts["_axes"] = int(points._axes[s])
    return Points._made(points, **parts)


def take(
    points: Any,
    cutoff: Any,
    queries: Any = None,
    box: Any = None,
    periodic: Any = None,
    rule: Any = None,
    exclude: Any = None,
    min_distance: Any = None,
    indices: Any = None,
    inclusive: Any = True,
    threads: Any = None,
    progress: Any = None,
    *,
    directed: bool = False,
    several: str = "",
    by_reach: bool = True,
) -> Call:
    """A call with its shared arguments, converted and checked once.

    directed: the result has a direction, so that the rule may have one. several: what several
    cutoffs are for, "shells" or "counts"; if it is empty, they are refused. by_reach: whether
    radii, supports and types say how far pairs reach.
    """
    try:
        call = Call()
        call.settings = current()
        if getattr(type(points), "_is_cell_list", False):
            call.cells, threads = points._cells, points._threads if threads is None else threads
            if cutoff is None and points.points.radii is None:
                cutoff = points.cutoff
            points = points.points
        ndim = 3
        if queries is not None and type(points) in (list, tuple) and not points:
            ndim = Points._of(queries, "queries").positions.shape[1]
        call.points = Points._of(points, "points", box, periodic, ndim=ndim)
        call.queries = _queries_of(queries, call.points)
        call.inclusive = inclusive if type(inclusive) is bool else as_flag(inclusive, "inclusive")
        call.threads = call.settings.threads if threads is None else as_threads(threads)
        if progress is not None and progress is not False:
            from halfshell._convert.progress import ProgressBar, as_progress  # few calls need it

            call.progress = as_progress(progress)
            call.bar = call.progress if isinstance(call.progress, ProgressBar) else None
        call.rule = rule
        if by_reach:
            _take_cutoff(call, cutoff, directed or call.queries is not None, several)
        else:
            call.cutoff = cutoff
        _take_selection(call, exclude, min_distance)
        if indices is not None:
            _take_indices(call, indices)
        return call
    except Exception as error:
        shorten(error)
        raise


# ---- queries, and rows of some points ------------------------------------------------------

def _queries_of(queries: Any, points: Points) -> Points | None:
    if queries is None:
        return None
    found = Points._of(queries, "queries", ndim=points.positions.shape[1])
    asking, array = found.positions, points.positions
    if asking.shape[1] != array.shape[1]:
        raise ValueError(
            "queries and points must have the same number of columns, got shapes "
            f"{asking.shape} and {array.shape}"
        )
    if (found.batch is None) != (points.batch is None):
        one, other = ("points", "queries") if found.batch is None else ("queries", "points")
        raise ValueError(f"{one} have a batch, and {other} have none: both need one")
    if found.box is not None and not same_boxes(found, points):
        raise ValueError(
            "queries bring a box that is not that of points: give arrays, and box and periodic"
        )
    return found


def same_boxes(one: Points, other: Points) -> bool:
    """Whether the same axes repeat by the same vectors."""
    if one.box is None or other.box is None:
        return one.box is other.box
    mine, theirs = one.periodic, other.periodic
    if not one.tells_periodic:
        mine = theirs
    assert mine is not None and theirs is not None
    of_systems = {len(box) for box in (one.box, other.box) if box.ndim == 3}
    of_systems |= {len(axes) for axes in (mine, theirs) if axes.ndim == 2}
    if len(of_systems) > 1:
        return False
    return bool((mine == theirs).all() and ((one.box == other.box).all(axis=-1) | ~mine).all())


def _take_indices(call: Call, indices: Any) -> None:
    if call.queries is not None:
        raise ValueError("indices select rows of the points: do not give queries as well")
    if call.settings.precision == "single":
        raise ValueError("indices cannot be combined with precision 'single'")
    from halfshell._convert.arrays import as_point_numbers  # few calls need it

    call.indices = as_point_numbers(indices, "indices", len(call.points), "points")


# ---- the cutoff, and the reach of each pair ------------------------------------------------

def _take_cutoff(call: Call, cutoff: Any, directed: bool, several: str) -> None:
    """The cutoff of a call, be it a number, several, one a system, or one for each two types."""
    both = [one for one in (call.points, call.queries) if one is not None]
    has_radii = any(one.radii is not None for one in both)
    has_supports = any(one.supports is not None for one in both)
    if has_radii and has_supports:
        raise ValueError("radii and supports cannot be given together")
    if call.rule is not None:
        rules = RULES_OF_SUPPORTS if has_supports else RULES
        call.rule = as_choice(call.rule, "rule", rules)
        if not (has_radii or has_supports):
            raise ValueError("rule needs radii or supports")
        if call.rule in DIRECTED and not directed:
            raise ValueError(
                f"rule {call.rule!r} has a direction, and these pairs have none: use neighbors, "
                "which has a row for each point"
            )
    if type(cutoff) is float or type(cutoff) is int:
        call.cutoff = as_number(cutoff, "cutoff")
    elif is_a(cutoff, Mapping):
        _take_table(call, *_table_of_pairs(cutoff, call))
    elif cutoff is None:
        if not has_radii:
            hint = "points without it need radii"
            if has_supports:
                hint = "with supports it is the extent"
            raise TypeError(f"cutoff must be a number, got NoneType: {hint}")
        call.cutoff = math.inf
    else:
        _take_cutoffs(call, cutoff, several)
    if call.has_reach and (has_radii or has_supports):
        what = "radii" if has_radii else "supports"
        raise ValueError(f"a cutoff for each pair of types cannot be combined with {what}")
    if call.shells is not None and (has_radii or has_supports) and several != "counts":
        what = "radii" if has_radii else "supports"
        raise ValueError(f"several cutoffs cannot be combined with {what}")
    if has_radii:
        _take_radii(call, cutoff)
    elif has_supports:
        _take_supports(call)
    elif not call.has_reach and call.cutoff == math.inf:
        call.cutoff = _beyond_all(call)


def _beyond_all(call: Call) -> float:
    """A cutoff that is larger than any distance, for an infinite one."""
    if call.points.box is not None and np.any(call.points.periodic):
        raise ValueError(
            "cutoff must be finite where box vectors repeat, got inf: there is no end of images"
        )
    sets = (call.points, call.queries)
    arrays = [one.positions for one in sets if one is not None and len(one)]
    if not all(np.isfinite(array).all() for array in arrays) or not arrays:
        return 2.0**1023  # the search names the coordinate
    low = np.min([array.min(axis=0) for array in arrays], axis=0).tolist()
    high = np.max([array.max(axis=0) for array in arrays], axis=0).tolist()
    farthest = math.nextafter(math.dist(low, high) * (1.0 + 2.0**-40), math.inf)
    if farthest == math.inf:
        raise OverflowError("points lie so far apart that some distances do not fit float64")
    return farthest


def _take_cutoffs(call: Call, cutoff: Any, several: str) -> None:
    """An array: a number, one a system, ascending ones, or a table of types."""
    has_batch = call.points.batch is not None

    def check(shape: tuple[int, ...]) -> None:
        if len(shape) == 1 and not has_batch and not several:
            raise TypeError(
                "cutoff must be a number; several are for counts and the letter k in quantities, "
                f"a radius for each point is one of Points(radii=...), got shape {shape}"
            )
        if len(shape) == 1 and not has_batch and shape[0] == 0:
            raise ValueError(
                f"several cutoffs must have shape (k,), with one at least, got {shape}"
            )
        if len(shape) > 2 or (len(shape) == 2 and shape[0] != shape[1]):
            raise ValueError(
                "cutoff must be a number, have shape (t, t), one for each pair of types, or be a "
                f"dict, got shape {shape}"
            )

    array = as_real_array(cutoff, "cutoff", "be a number", check)
    if array.ndim == 0:
        call.cutoff = float(array)
        return
    refuse_large(8 * array.size, array, "cutoff")
    values = in_order(array, np.float64)
    endless = values == math.inf
    if endless.any():  # others may be beyond all distances as well
        most = np.max(values, where=~endless, initial=_beyond_all(call))
        values = np.where(endless, most, values)
    if array.ndim == 2:
        _take_table(call, *_table_of_types(values, call))
    elif has_batch:
        call.system_cutoffs, call.cutoff = values, 0.0
        box, axes = call.points.box, call.points._axes
        for own in (box if box is not None and box.ndim == 3 else None, axes):
            if isinstance(own, np.ndarray) and len(own) != len(values):
                raise ValueError(
                    "box and cutoff must be given for the same number of systems, got "
                    f"{len(own)} and {len(values)}"
                )
    else:
        check_lengths(values, "cutoff")
        check_ascending(values, "cutoff", "several cutoffs")
        call.shells = values
        call.cutoff = float(values[-1])


def _take_radii(call: Call, cutoff: Any) -> None:
    """A reach by radii, within the cutoff as a further limit."""
    rule = "sum" if call.rule is None else call.rule
    if not call.cutoff >= 0.0:  # without an end it is no further limit
        raise ValueError(f"cutoff must not be negative or NaN, got {call.cutoff}")
    own, asking = _sides(call, rule, "radii")
    for radii in (own, asking):
        if rule == "mean" and radii is not None:
            for k in np.flatnonzero((radii > 0.0) & (radii < _LEAST_HALVED)):
                raise ValueError(
                    "radii must be 0 or at least 2**-1021 for the rule 'mean', got "
                    f"radii[{k}] = {radii[k]}"
                )
    if call.system_cutoffs is None and cutoff is None:
        call.cutoff = math.inf
    call.known, call.known_of_queries = Known(own), Known(asking)
    call.pairing = Pairing(RULES.index(rule))


def _take_supports(call: Call) -> None:
    """A reach by supports, of which the cutoff is the extent."""
    rule = "max" if call.rule is None else call.rule
    if call.system_cutoffs is not None:
        raise ValueError("supports have one extent: cutoff must be a number")
    as_length(call.cutoff, "cutoff")
    own, asking = _sides(call, rule, "supports")
    call.known, call.known_of_queries = Known(supports=own), Known(supports=asking)
    call.pairing = Pairing(RULES.index(rule), call.cutoff + 0.0)
    call.cutoff = math.inf


def _sides(call: Call, rule: str, what: str) -> tuple[Any, Any]:
    """The radii or supports of points and of queries that a rule goes by; None for the others."""
    own = getattr(call.points, what)
    if call.queries is None:
        return own, None
    asking = getattr(call.queries, what)
    needed = {"gather": ("queries",), "scatter": ("points",)}.get(rule, ("points", "queries"))
    for name, values in (("points", own), ("queries", asking)):
        if name in needed and values is None:
            if len(needed) == 2:
                raise ValueError(
                    f"{name} have no {what}: both sets need them, or rule 'gather' or 'scatter', "
                    "which goes by those of queries or of points"
                )
            raise ValueError(f"rule {rule!r} goes by the {what} of {name}, which have none")
    return (
        own if "points" in needed else None,
        asking if "queries" in needed else None,
    )


# ---- cutoffs by type -----------------------------------------------------------------------

def _take_table(
    call: Call, own: npt.NDArray[Any], asking: npt.NDArray[Any] | None, table: FloatArray
) -> None:
    if len(table) == 0:
        table = np.full((1, 1), _NO_PAIRS)  # of no points: the core wants one type at least
    call.cutoff = max(float(table.max(initial=0.0)), 0.0)
    call.known, call.known_of_queries = Known(types=own), Known(types=asking)
    call.pairing = Pairing(0, table=table)  # the core needs no rule


def _kinds_of(call: Call, reason: str) -> tuple[Any, Any, tuple[str, ...] | None]:
    """The types of both sets, as `numbers_of_both` has them. reason: what needs them."""
    for name, one in (("points", call.points), ("queries", call.queries)):
        if one is not None and one._kinds is None:
            raise ValueError(f"{reason} needs types, and {name} have none: Points(types=...)")
    return numbers_of_both(call, "_kinds", "types")


def numbers_of_both(
    call: Call, attribute: str, name: str
) -> tuple[Any, Any, tuple[str, ...] | None]:
    """Types, groups or labels of both sets as numbers, equal for equal names; and any names."""
    own: Labels | None = getattr(call.points, attribute)
    asking: Labels | None = None if call.queries is None else getattr(call.queries, attribute)
    if call.queries is not None and (own is None) != (asking is None):
        one, other = ("points", "queries") if asking is None else ("queries", "points")
        raise ValueError(f"{one} have {name}, and {other} have none: both need them")
    if own is None:
        return None, None, None
    if asking is None:
        return own.numbers, None, own.names
    if (own.names is None) != (asking.names is None):
        if len(own.numbers) and len(asking.numbers):
            raise TypeError(f"{name} of points and queries must both be numbers or both be names")
        names = own.names if len(own.numbers) else asking.names
        return own.numbers, asking.numbers, names
    if own.names is None or own.names == asking.names:
        return own.numbers, asking.numbers, own.names
    assert asking.names is not None
    every = sorted({*own.names, *asking.names})
    return own.among(every), asking.among(every), tuple(every)


def _table_of_types(
    table: FloatArray, call: Call
) -> tuple[npt.NDArray[Any], npt.NDArray[Any] | None, FloatArray]:
    """A symmetric table with a row for each type."""
    for a, b in np.argwhere(~(np.isfinite(table) & (table >= 0.0))):
        raise ValueError(
            f"cutoff must be finite and not negative, got cutoff[{a}, {b}] = {table[a, b]}"
        )
    for a, b in np.argwhere(table != table.T):
        raise ValueError(
            f"cutoff must be symmetric, got cutoff[{a}, {b}] = {table[a, b]} and "
            f"cutoff[{b}, {a}] = {table[b, a]}"
        )
    own, asking, names = _kinds_of(call, "a table of cutoffs")
    if names and len(names) != len(table):
        raise ValueError(
            f"cutoff must have a row for each type, {', '.join(map(shown, names[:8]))}"
            f"{', ...' if len(names) > 8 else ''}, in this order, got shape {table.shape}: a dict "
            "may have more types"
        )
    for name, types in (("points", own), ("queries", asking)):
        if types is None:
            continue
        for k in np.flatnonzero(types >= len(table)):
            raise ValueError(
                f"types must be less than {len(table)}, the types that cutoff is given for, got "
                f"type {types[k]} of {name}[{k}]"
            )
    return own, asking, table


def _table_of_pairs(
    cutoff: Mapping[Any, Any], call: Call
) -> tuple[npt.NDArray[Any], npt.NDArray[Any] | None, FloatArray]:
    """A table of the types that the keys name and, in the last row, of all others.

    A key with fewer stars wins. Types that no key names pair as "*" and "*" do, or not at all.
    """
    own, asking, names = _kinds_of(call, "a dict of cutoffs")
    present = [types for types in (own, asking) if types is not None and len(types)]
    lengths = _lengths(cutoff, names, call) if present else {}
    rows = sorted({part for pair in lengths for part in pair if part != "*"})
    place = {part: row for row, part in enumerate(rows)}
    last = len(rows)
    table = np.full((last + 1, last + 1), lengths.get(("*", "*"), _NO_PAIRS))
    set_by: dict[tuple[int, int], float] = {}
    for part, row in place.items():
        length = lengths.get(("*", part))
        if length is None:
            continue
        for other in range(last + 1):
            both = min(row, other), max(row, other)
            named = other < last and (min(part, rows[other]), max(part, rows[other])) in lengths
            if not named and set_by.setdefault(both, length) != length:
                raise ValueError(
                    f"cutoff[{(rows[both[0]], '*')}] and cutoff[{(rows[both[1]], '*')}] differ, "
                    f"and both are of the pair {(rows[both[0]], rows[both[1]])}: give it a key"
                )
            table[row, other] = table[other, row] = length
    for (a, b), length in lengths.items():
        if a != "*":
            table[place[a], place[b]] = table[place[b], place[a]] = length
    numbers = [names.index(part) for part in rows] if names is not None else rows
    return _places(own, numbers), None if asking is None else _places(asking, numbers), table


def _places(types: npt.NDArray[Any], numbers: list[int]) -> npt.NDArray[np.int32]:
    """Where each is among numbers, which ascend; their count for all that are not there."""
    if not numbers:
        return np.zeros(len(types), np.int32)
    known = np.array(numbers)
    places = np.minimum(np.searchsorted(known, types), len(known) - 1)
    return np.where(known[places] == types, places, len(known)).astype(np.int32)


def _lengths(
    cutoff: Mapping[Any, Any], names: tuple[str, ...] | None, call: Call
) -> dict[tuple[Any, Any], float]:
    """The cutoff of each pair of types, in one order of the two; "*" comes first."""
    try:
        items = list(cutoff.items())
    except MemoryError:
        raise
    except Exception as error:
        raise TypeError(
            f"cutoff cannot be read: {kind_of(cutoff)} raised {kind_of(error)}: {told(error)}"
        ) from error
    lengths: dict[tuple[Any, Any], float] = {}
    for key, value in items:
        where = f"cutoff[{shown(key)}]"
        if not is_a(key, tuple) or len(key) != 2:
            raise TypeError(
                f"cutoff must have pairs of types as keys, such as ('Si', 'O'), got {shown(key)}"
            )
        length = as_number(value, where)
        length = _beyond_all(call) if length == math.inf else as_length(length, where)
        one, other = (_type_of(part, where, names) for part in key)
        if "*" in (one, other):
            pair = ("*", other if one == "*" else one)
        else:
            pair = min((one, other), (other, one))
        if lengths.setdefault(pair, length) != length:
            raise ValueError(
                f"{where} = {length} contradicts another cutoff of the same two, {lengths[pair]}"
            )
    if names is None:
        return lengths
    # Elements that no point is of need no row.
    return {pair: length for pair, length in lengths.items() if {*pair} <= {"*", *names}}


def _type_of(part: Any, where: str, names: tuple[str, ...] | None) -> Any:
    """A part of a key: "*", a number, or a name."""
    if is_a(part, str):
        name = str.__str__(part)
        if name == "*":
            if names is not None and name in names:
                raise ValueError(f"{where} has '*', which means any type and is the name of one")
            return name
        if names is None:
            raise ValueError(f"{where} has names, and types are numbers")
        if name not in names and name not in SYMBOLS:
            raise ValueError(f"{where}: {shown(part)} is neither an element nor a type of a point")
        return name
    number = whole_number(part, "cutoff")
    if number is None or is_a(number, bool):
        raise TypeError(f"{where} must have types or names as its key, got {shown(part)}")
    if names is not None:
        raise ValueError(f"{where} has numbers, and types are names, such as {names[0]!r}")
    if not 0 <= number < 2**31 - 1:
        raise ValueError(f"{where} must have types from 0 to {2**31 - 2}, got {shown(part)}")
    return number


# ---- which pairs count ---------------------------------------------------------------------

def _take_selection(call: Call, exclude: Any, min_distance: Any) -> None:
    groups, asking_groups, _ = numbers_of_both(call, "_groups", "groups")
    least = 0.0
    if min_distance is not None:
        least = as_length(as_number(min_distance, "min_distance"), "min_distance")
        if least > 0.0 and call.settings.precision == "single":
            raise ValueError("min_distance cannot be combined with precision 'single'")
    labels = asking_labels = excluded = within = None
    if exclude is not None:
        within = None if is_a(exclude, (bool, np.bool_)) else whole_number(exclude, "exclude")
        if within is not None:
            labels, asking_labels = _labels(call, within)
        else:
            excluded = _excluded(exclude, call)
    if groups is None and exclude is None and least == 0.0:
        return
    call.known = call.known._replace(groups=groups, labels=labels)
    call.known_of_queries = call.known_of_queries._replace(
        groups=asking_groups, labels=asking_labels
    )
    call.pairing = (call.pairing or Pairing())._replace(
        within=within, excluded=excluded, least=least
    )


def _labels(call: Call, within: int) -> tuple[Any, Any]:
    for name, one in (("points", call.points), ("queries", call.queries)):
        if one is not None and one._labels is None:
            raise ValueError(
                f"a whole number as exclude needs labels, and {name} have none: Points(labels=...)"
            )
    if not 0 <= within < 2**63:
        raise ValueError(f"exclude must be from 0 on and below 2**63, got {within}")
    own, asking, names = numbers_of_both(call, "_labels", "labels")
    if names is not None and within:
        raise ValueError(f"exclude must be 0 where labels are names, got {within}")
    return own, asking


def _excluded(exclude: Any, call: Call) -> npt.NDArray[np.int64]:
    """Numbers of two points, or of a query and a point, (k, 2)."""
    from halfshell._convert.arrays import as_point_numbers  # few calls need it

    array = as_array(exclude, "exclude", "be pairs of numbers, (k, 2), or a whole number")
    if array.shape == (0,):
        array = np.empty((0, 2), np.int64)
    if array.ndim != 2 or array.shape[1] != 2:
        hint = ": one pair is [[i, j]]" if array.shape == (2,) else ""
        if array.ndim == 1 and len(array) == len(call.points):
            hint = ": labels are those of Points(labels=...), with a whole number as exclude"
        raise (TypeError if array.ndim == 0 else ValueError)(
            "exclude must be pairs of numbers, shape (k, 2), or a whole number, got "
            + (shown(exclude) if array.ndim == 0 else f"shape {array.shape}{hint}")
        )
    n = len(call.points)
    asking = (n, "points") if call.queries is None else (len(call.queries), "queries")
    first = as_point_numbers(array[:, 0], "exclude[:, 0]", *asking)
    second = as_point_numbers(array[:, 1], "exclude[:, 1]", n, "points")
    return np.ascontiguousarray(np.stack([first, second], axis=1))
