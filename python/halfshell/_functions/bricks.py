# SPDX-License-Identifier: BSD-3-Clause
"""`bricks`: which points each part owns, and which others it needs; `Brick`, one such part.

Points may also be in pieces: chunks of Dask, or ranks of MPI. These are divided without being
brought together, by a `Summary` of each piece. Any cuts are right; that they go by a sample of the
points makes the bricks about equally large.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from inspect import signature
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict, Unpack, cast

import numpy as np
import numpy.typing as npt

from halfshell import _core, _show
from halfshell._convert.arrays import as_array, as_point_numbers
from halfshell._convert.call import DIRECTED, Call, take
from halfshell._convert.foreign import is_a, whole_number
from halfshell._convert.options import as_brick_count, check_letters
from halfshell._convert.points import Labels, Points
from halfshell._functions.neighbors import neighbors as find_neighbors
from halfshell._functions.pairs import pairs as find_pairs
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._search import search, spell_out
from halfshell._settings import current

if TYPE_CHECKING:
    from halfshell._convert.types import (
        ArrayLike,
        Arrays,
        CutoffLike,
        FloatArray,
        Options,
        PointsLike,
        Rule,
    )

#: What may be known of each point that bricks go by.
FIELDS = ("radii", "types", "supports", "groups", "labels")

Array = npt.NDArray[Any]
Numbers = npt.NDArray[np.int64]
Bits = npt.NDArray[np.bool_]
#: What is known of points, by name, one row a point; of types, groups and labels the numbers.
Columns = dict[str, Array]

#: Points of each piece, and of all pieces, by which bricks are cut: not many more than these.
_SAMPLE, _SAMPLES = 1 << 13, 1 << 22
#: Points that are placed in one call of the core.
_AT_A_TIME = 1 << 16
#: Of what the smallest eigenvalue may be wrong by, in units of the norm.
_UNSURE = 256.0 * np.finfo(np.float64).eps


@search(lacks="exclude min_distance indices inclusive threads progress")
def bricks(points: PointsLike, cutoff: CutoffLike, n: int, **search: Unpack[Options]) -> Bricks:
    """Divide points into bricks for other threads or machines; their pairs are always exact.

    Parameters
    ----------
    points : array_like of float, shape (n_points, d), or Points
        As in `pairs`; radii, types, supports, groups and labels are those of the same points later.
    {cutoff}
    n : int
        Number of bricks, 1 to 2**20. The numbers of points that they own differ by at most 1; with
        more bricks than points some own none.
    {box, periodic, rule}

    Returns
    -------
    Bricks
        A sequence of `Brick`, each with ``owned`` and ``needed``. A pair belongs to the brick that
        owns its lower number; all bricks together have each pair once.

    Raises
    ------
    TypeError, ValueError, OverflowError
        As `pairs`; ValueError also if `n` is not from 1 to 2**20, and for a batch, whose systems
        are apart already.

    See Also
    --------
    iter_pairs : all pairs in blocks, in one process.

    Notes
    -----
    Points are halved again and again across their longest side [1]_, so that bricks follow the
    points, even in clusters, and not the volume. The points that a brick needs are found from the
    range of its points along each vector of a short basis of the box, or open axis, widened by the
    largest distance of any pair and a bound on rounding, however long, short or skewed the box is.
    `Bricks.overhead` tells beforehand how many they are. Each brick is searched with the whole box
    and the points as given: its decisions and shifts are those of a single search of all points.

    References
    ----------
    .. [1] M. J. Berger, S. H. Bokhari, "A partitioning strategy for nonuniform problems on
       multiprocessors", IEEE Trans. Comput. C-36, 570-580 (1987).

    Examples
    --------
    >>> import numpy as np
    >>> import halfshell as hs
    >>> points = np.random.default_rng(0).random((1000, 3))
    >>> parts = hs.bricks(points, 0.1, 4, box=[1.0, 1.0, 1.0])
    >>> parts.sizes
    [250, 250, 250, 250]
    >>> sum(part.count_pairs(points) for part in parts)
    2099
    >>> hs.count_pairs(points, 0.1, box=[1.0, 1.0, 1.0])
    2099
    """
    call = take(points, cutoff, directed=True, **search)
    call.refuse_batch("bricks", "its systems are apart already")
    n_bricks, array = as_brick_count(n), call.array
    largest = float(max(array.max(initial=0.0), -array.min(initial=0.0)))
    scope = _scope(call, cutoff, {k: v.names for k, v in labels_of(call.points).items()},
                   len(array), _widest(call.points))  # fmt: skip
    rest = (call.points.box, call.bits, False, "exact", None, None, None, 1, None, "auto")
    if not call.has_reach:
        _core.count_pairs(array[:0], call.cutoff, *rest)
    try:  # refuses what a search would refuse, at the price of a search with the cutoff 0
        _core.count_pairs(array, 0.0, *rest)
    except ValueError:  # which needs more of a box than a larger cutoff
        _core.count_pairs(array, min(scope.reach, sys.float_info.max), *rest)
    axes = axes_of(scope, array.shape[1], largest)
    places = axes.places(array)
    every, is_owned = np.arange(len(array)), np.zeros(len(array), bool)
    made = []
    for owned, members in _halved(places, axes, every, every, n_bricks):
        is_owned[owned] = True
        made.append(Brick(members, is_owned[members], scope))
        is_owned[owned] = False
    return Bricks(made)


def _halved(
    places: FloatArray, axes: Axes, owned: Numbers, near: Numbers, n: int
) -> Iterator[tuple[Numbers, Numbers]]:
    """Owned points in n parts, cut across their longest side, each with all that it may need."""
    if n == 1:
        yield owned, _near(places, axes, owned, near, range(len(places)))
        return
    first = n // 2
    cut, axis = len(owned) * first // n, 0
    if len(owned) > 1:
        axis = int(np.argmax([np.ptp(line[owned]) for line in places] * axes.widths))
        owned = owned[np.argpartition(places[axis][owned], cut)]  # a sort takes far longer
    for part, n_parts in ((owned[:cut], first), (owned[cut:], n - first)):
        yield from _halved(places, axes, part, _near(places, axes, part, near, [axis]), n_parts)


def _near(
    places: FloatArray, axes: Axes, owned: Numbers, numbers: Numbers, along: Iterable[int]
) -> Numbers:
    """Of these points, those within reach of the range of the owned ones, along some axes."""
    if len(owned) == 0:
        return owned
    for axis in along:
        own, reach = places[axis][owned], axes.reach[axis]
        low, high = float(own.min()) - reach, float(own.max()) + reach
        near = _within(places[axis].take(numbers), low, high, axes.repeats[axis])
        numbers = numbers.take(np.flatnonzero(near))  # quicker than numbers[near]
    return numbers


# ---- one brick --------------------------------------------------------------------------------

_COUNTED_AT_A_TIME = 1 << 14  # points whose pairs are counted
_NAMED = ("types", "groups", "labels")


def check_precision() -> None:
    """Refuse rounded decisions, which may depend on points that a brick does not have."""
    if current().precision != "exact":
        raise ValueError(f"bricks need precision 'exact', got {current().precision!r}")


class Search(TypedDict, total=False):
    """The keywords that a brick takes, as `pairs` has them."""

    exclude: ArrayLike | int | None
    min_distance: float | None
    inclusive: bool
    threads: int | None


class Scope(NamedTuple):
    """What all bricks of a division are searched with."""

    n_points: int
    cutoff: Any  # as it was given, for the same search of any of the points
    rule: Rule | None
    reach: float  # no pair is further apart
    box: FloatArray | None
    axes: int  # bits of those that repeat
    names: dict[str, tuple[str, ...] | None]  # of types, groups and labels among all points

    def columns_of(self, points: Points) -> Columns:
        """What a search goes by, with the same number for the same name in all parts."""
        columns = {"positions": points.positions}
        for name in ("radii", "supports"):
            if getattr(points, name) is not None:
                columns[name] = getattr(points, name)
        for name, labels in labels_of(points).items():
            names = self.names.get(name)
            if labels.names is not None and labels.names != names:
                unknown = [one for one in labels.names if one not in (names or ())]
                if unknown:
                    raise ValueError(f"{name} of the divided points have no {unknown[0]!r}")
                columns[name] = labels.among(names or ())
            else:
                columns[name] = labels.numbers
        return columns

    def points_of(self, columns: Columns) -> Points:
        """Points with these columns, which share memory with them where it is aligned."""
        box = None if self.box is None else aligned(self.box)
        parts: dict[str, Any] = {"_box": box, "_axes": self.axes, "tells_periodic": True}
        for name, column in columns.items():
            array = aligned(column).view()
            array.flags.writeable = False
            if name in _NAMED:
                parts[f"_{name}"] = Labels(array, self.names.get(name))
            else:
                parts[name] = array
        return Points._made(**parts)


def aligned(array: Array) -> Array:
    """The array, or a copy that is contiguous and aligned."""
    return np.require(array, requirements=["C", "A"])


def labels_of(points: Points) -> dict[str, Labels]:
    """Types, groups and labels, those that are known."""
    every = {"types": points._kinds, "groups": points._groups, "labels": points._labels}
    return {name: labels for name, labels in every.items() if labels is not None}


class Brick:
    """The points of one worker, and the other points that it needs.

    Made by `bricks`. It can be pickled, and holds no coordinates. Methods take all points, or
    `members` alone, with what is known of them, and return indices among all points: exactly what
    a single search of all points finds for this brick.

    Attributes
    ----------
    owned : ndarray of int64, shape (m,)
        Points of this brick, ascending. Each point is in one brick.
    needed : ndarray of int64, shape (k,)
        Other points that may be within the cutoff of one of these, ascending.
    members : ndarray of int64, shape (m + k,)
        Both together, ascending.
    cutoff : float, ndarray, dict or None
        As it was given.
    n_points : int
        The number of all points.

    Examples
    --------
    >>> import halfshell as hs
    >>> points = [[0.0], [1.0], [2.0], [3.0]]
    >>> first, second = hs.bricks(points, 1.0, 2)
    >>> first.owned.tolist(), first.needed.tolist()
    ([0, 1], [2])
    >>> [part.pairs(points, quantities="P").tolist() for part in (first, second)]
    [[[0, 1], [1, 2]], [[2, 3]]]
    """

    _shown = ("owned", "needed", "cutoff", "n_points")
    __repr__ = _show.line
    _repr_html_ = _show.html

    def __init__(self, members: Numbers, is_owned: Bits, scope: Scope) -> None:
        self.members, self.is_owned, self._scope = members, is_owned, scope

    @property
    def owned(self) -> Numbers:
        return self.members[self.is_owned]

    @property
    def needed(self) -> Numbers:
        return self.members[~self.is_owned]

    cutoff: Any = _show.attribute("_scope.cutoff")
    n_points: int = _show.attribute("_scope.n_points")

    def pairs(
        self, points: PointsLike, *, quantities: str = "ij", **search: Unpack[Search]
    ) -> Arrays:
        """Find the pairs whose lower number is a point of this brick.

        Parameters
        ----------
        points : array_like of float, shape (n, d) or (m + k, d), or Points
            All points, or `members`; with radii, types and so on if they were divided with these.
        exclude, min_distance, inclusive, threads
            As in `pairs`, with numbers among all points.
        quantities : str, default "ij"
            Any of the letters ``i j d D S P``, as in `pairs`.

        Returns
        -------
        ndarray or tuple of ndarray
            As from `pairs`, ascending by (i, j, S), with indices among all points.
        """
        check_letters(quantities)
        own, places = self._of_members(points), np.flatnonzero(self.is_owned)
        # All pairs of the members are found sooner than those of half of them.
        some = None if 2 * len(places) >= len(self.members) else places
        letters = quantities if "i" in quantities else "i" + quantities
        how = self._how(search)
        found: Any = find_pairs(
            own, self.cutoff, indices=some, quantities=letters, sort=True, **how
        )
        columns = dict(zip(letters, found if isinstance(found, tuple) else (found,), strict=True))
        kept = self.is_owned[columns["i"]]
        arrays = []
        for letter in quantities:
            array = columns[letter][kept]
            arrays.append(self.members[array] if letter in "ijP" else array)
        return tuple(arrays) if len(arrays) > 1 else arrays[0]

    def count_pairs(self, points: PointsLike, **search: Unpack[Search]) -> int:
        """Count the pairs whose lower number is a point of this brick.

        Parameters
        ----------
        points, exclude, min_distance, inclusive, threads
            As in `Brick.pairs`.

        Returns
        -------
        int
            The length of `Brick.pairs`, with the memory of the pairs of a few thousand points.

        Raises
        ------
        ValueError
            If the rule is 'gather' or 'scatter', by which a pair has a direction; and as `pairs`.
        """
        how = self._how(search)
        if how["rule"] in DIRECTED:
            raise ValueError(f"rule {how['rule']!r} has a direction, and these pairs have none")
        own, places, count = self._of_members(points), np.flatnonzero(self.is_owned), 0
        for first in range(0, max(1, len(places)), _COUNTED_AT_A_TIME):
            some = places[first : first + _COUNTED_AT_A_TIME]
            table = find_neighbors(own, self.cutoff, indices=some, **how)
            row = np.repeat(some, table.counts)
            # An image of a point itself is there in both directions.
            count += int((table.indices > row).sum()) + int((table.indices == row).sum()) // 2
        return count

    def neighbors(
        self, points: PointsLike, *, quantities: str = "j", **search: Unpack[Search]
    ) -> NeighborTable:
        """Find all neighbours of the points of this brick.

        Parameters
        ----------
        points, exclude, min_distance, inclusive, threads
            As in `Brick.pairs`.
        quantities : str, default "j"
            Any of the letters ``j d D S``, as in `neighbors`.

        Returns
        -------
        NeighborTable
            Row k belongs to point ``owned[k]``, with indices among all points.
        """
        own, places = self._of_members(points), np.flatnonzero(self.is_owned)
        table = find_neighbors(
            own, self.cutoff, indices=places, quantities=quantities, **self._how(search)
        )
        arrays = [table._column(letter) for letter in quantities]
        if "j" in quantities:
            arrays[quantities.index("j")] = self.members[table.indices]
        return NeighborTable((table.offsets, *arrays), quantities, self.n_points, False)

    def _how(self, search: Any) -> dict[str, Any]:
        """The keywords of a search of the members."""
        check_precision()
        excluded = self._excluded(search.get("exclude"))
        return {**search, "rule": self._scope.rule, "exclude": excluded}

    def _excluded(self, exclude: ArrayLike | int | None) -> Any:
        """Pairs of members that do not count, by their places among them."""
        if exclude is None or whole_number(exclude, "exclude") is not None:
            return exclude
        array = as_array(exclude, "exclude", "be pairs of numbers, (k, 2), or a whole number")
        if array.ndim != 2 or array.shape[1] != 2:
            return array  # which the search refuses
        numbers = as_point_numbers(array.reshape(-1), "exclude", self.n_points, "points")
        places = np.searchsorted(self.members, numbers)
        is_member = np.append(self.members, -1)[places] == numbers
        return places.reshape(-1, 2)[is_member.reshape(-1, 2).all(axis=1)]

    def _of_members(self, points: Any) -> Points:
        """The members, from all points or as they are, in the box of the bricks."""
        given, scope, n_members = Points._of(points), self._scope, len(self.members)
        if len(given) not in (self.n_points, n_members):
            raise ValueError(
                f"points must have shape (n, d) with n = {self.n_points}, all points, or "
                f"{n_members}, the members of the brick; got {given.positions.shape}"
            )
        if given.batch is not None:
            raise ValueError("bricks cannot be combined with a batch")
        if given.box is not None and not (
            scope.box is not None
            and np.array_equal(given.box, scope.box)
            and given._axes == scope.axes
        ):
            raise ValueError("points bring a box that is not that of the brick")
        columns = scope.columns_of(given)
        if len(given) == self.n_points:
            columns = {name: one[self.members] for name, one in columns.items()}
        return scope.points_of(columns)


for _method in (Brick.pairs, Brick.count_pairs, Brick.neighbors):
    spell_out(_method, [signature(find_pairs).parameters[name] for name in Search.__annotations__])


class Bricks(tuple[Brick, ...]):
    """All bricks of a set of points, as `bricks` returns them.

    Attributes
    ----------
    sizes : list of int
        How many points each brick owns.
    overhead : float
        How many points all bricks hold together, for each point: what dividing them costs.

    Examples
    --------
    >>> import halfshell as hs
    >>> hs.bricks([[0.0], [1.0], [2.0], [3.0]], 1.0, 2)
    Bricks(2 of 4 points, overhead 1.5)
    """

    _shown = ("sizes", "overhead")
    _repr_html_ = _show.html

    @property
    def sizes(self) -> list[int]:
        return [int(np.count_nonzero(brick.is_owned)) for brick in self]

    @property
    def overhead(self) -> float:
        n = sum(self.sizes)
        return sum(len(brick.members) for brick in self) / n if n else 1.0

    def __repr__(self) -> str:
        return f"Bricks({len(self)} of {sum(self.sizes)} points, overhead {self.overhead:.3g})"


# ---- how far pairs reach, and where points are ---------------------------------------------

def _scope(
    call: Call, cutoff: Any, names: dict[str, tuple[str, ...] | None], n: int, widest: float
) -> Scope:
    """What bricks are searched with. widest: the most that `_widest` is."""
    reach = call.cutoff
    if call.pairing is not None:
        rule, extent = call.pairing.rule, call.pairing.extent
        if extent is not None:
            reach = extent * widest * (1.0 + 1e-12) if extent > 0.0 else 0.0
        elif call.known.radii is not None:
            reach = min(reach, 2.0 * widest if rule == 0 else widest)
        else:
            lengths = cutoff.values() if is_a(cutoff, Mapping) else np.ravel(cutoff)
            reach = max([0.0, *map(float, lengths)])
    kept: Any = call.cutoff
    if not call.has_reach and np.ndim(cutoff) == 0 and cutoff == np.inf:
        reach = kept = math.inf  # points that come later may be further apart
    elif is_a(cutoff, Mapping):
        kept = dict(cutoff)
    elif call.has_reach:
        kept = None if cutoff is None else np.array(cutoff, np.float64)
    box = None if call.points.box is None else call.points.box.copy()
    return Scope(n, kept, cast("Rule", call.rule), reach, box, call.bits, names)


def _widest(points: Points) -> float:
    """The largest radius; or by how much a vector may be longer than ``supports @ vector``."""
    if points.radii is not None:
        return float(points.radii.max(initial=0.0))
    if points.supports is None or not len(points):
        return 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        norms = np.abs(points.supports).sum(axis=2).max(axis=1)
        values = np.abs(np.linalg.eigvalsh(points.supports)).min(axis=1)
        least = (values - _UNSURE * norms).min()
        return float(1.0 / least) if least > 0.0 else math.inf  # also of what is no number


class Axes(NamedTuple):
    """What the core says of the axes of a box, which are not those of the box vectors."""

    scene: tuple[FloatArray | None, int, float, float]  # box, periodic bits, cutoff, largest
    repeats: tuple[bool, ...]  # places are from 0 to 1
    reach: tuple[float, ...]  # how far places of a pair can be apart: infinite where unknown
    widths: FloatArray  # what one unit of an axis is in a common unit

    def places(self, points: Array) -> FloatArray:
        """Places of shape (d, n), 0 along axes where the reach is infinite."""
        box, *rest = self.scene
        own: Any = (None if box is None else aligned(box), *rest)
        parts = range(0, max(1, len(points)), _AT_A_TIME)  # Ctrl-C works in between
        return np.concatenate(
            [_core.box_places(aligned(points[k : k + _AT_A_TIME]), *own)[0] for k in parts], axis=1
        )


def axes_of(scope: Scope, ndim: int, largest: float) -> Axes:
    """Axes of a box, for coordinates up to `largest`."""
    scene = (scope.box, scope.axes, min(scope.reach, sys.float_info.max), largest)
    _, repeats, reach, widths = _core.box_places(np.empty((0, ndim)), *scene)
    if math.isinf(scope.reach):
        reach = (math.inf,) * ndim
    return Axes(scene, repeats, reach, np.array(widths))


def _within(places: FloatArray, low: float, high: float, repeats: bool) -> Bits:
    """Which places are in a range, which may go on from the other side of an axis that repeats."""
    if not repeats:
        return (places >= low) & (places <= high)
    if not high - low < 1.0:
        return np.ones(len(places), bool)
    turns = math.floor(low)
    low, high = low - turns, high - turns
    if high < 1.0:
        return (places >= low) & (places <= high)
    return (places >= low) | (places <= high - 1.0)


# ---- where to cut points that are in pieces ------------------------------------------------

class Summary(NamedTuple):
    """What a division must know of a piece."""

    n_points: int
    largest: float  # of the coordinates, without signs
    sample: Array  # of shape (k, d)
    weight: float  # how many points each of the sample stands for
    widest: float = 0.0  # how far its radii or supports reach
    #: Of types, groups and labels that are known; None for numbers.
    names: dict[str, tuple[str, ...] | None] = {}  # noqa: RUF012 - nothing writes to it
    error: Exception | None = None  # why the piece cannot be searched


class Cut(NamedTuple):
    """A range along an axis that is cut in two, and what its parts are: bricks or cuts."""

    axis: int
    low: float
    at: float
    high: float
    below: Cut | int
    above: Cut | int


class Division(NamedTuple):
    """Where bricks are cut, and where the numbers of each piece begin."""

    cuts: Cut | int
    n_bricks: int
    axes: Axes
    firsts: tuple[int, ...]
    scope: Scope


class Terms(NamedTuple):
    """What points in pieces will be searched with, known before they are."""

    cutoff: Any
    rule: Rule | None
    box: FloatArray | None
    periodic: tuple[bool, ...] | None
    ndim: int
    fields: tuple[str, ...]  # that are known of each point, in order

    def of_none(self) -> Points:
        """No points, of which the same is known."""
        empty = {
            name: np.empty((0, self.ndim, self.ndim) if name == "supports" else 0,
                           np.float64 if name in ("supports", "radii") else np.int64)
            for name in self.fields
        }  # fmt: skip
        return Points(np.empty((0, self.ndim)), box=self.box, periodic=self.periodic, **empty)

    def call(self, directed: bool = True) -> Call:
        """A search of no points; raises what is wrong with it."""
        call = take(self.of_none(), self.cutoff, rule=self.rule, directed=directed)
        call.run(_core.coordination, None, call.pairing, "auto")
        return call


def summary(points: Points, n_pieces: int) -> Summary:
    """Sum up one of some pieces; points are named by their places in it."""
    array, n_points = points.positions, len(points)
    step = 1 + n_points // max(1, min(_SAMPLE, _SAMPLES // n_pieces))
    largest = float(max(array.max(initial=0.0), -array.min(initial=0.0)))
    error = None
    if not np.isfinite(largest):
        wrong = np.argwhere(~np.isfinite(array)).tolist()
        row, column = wrong[0] if wrong else (0, 0)  # if another thread changes them
        value = array[row, column]
        error = ValueError(f"points must be finite, got points[{row}, {column}] = {value}")
    sample = array[::step].astype(np.float64)
    names = {name: labels.names for name, labels in labels_of(points).items()} if n_points else {}
    weight = n_points / max(1, len(sample))
    return Summary(n_points, largest, sample, weight, _widest(points), names, error)


def divide(terms: Terms, n_bricks: int, *summaries: Summary) -> Division:
    """Where to cut; raises what is wrong with the first piece that has an error."""
    ends = np.cumsum([0, *(one.n_points for one in summaries)], dtype=np.int64).tolist()
    for one, first in zip(summaries, ends, strict=False):
        if one.error is not None:
            raise renumbered(one.error, range(first, first + one.n_points))
    every: dict[str, tuple[str, ...] | None] = {}  # the names of all pieces, ascending
    for field, names in [pair for one in summaries for pair in one.names.items()]:
        known = every.setdefault(field, names)
        if (known is None) != (names is None):
            raise TypeError(f"{field} of all points must be numbers, or of all be names")
        if known is not None and names is not None:
            every[field] = tuple(sorted({*known, *names}))
    widest = max((one.widest for one in summaries), default=0.0)
    scope = _scope(terms.call(), terms.cutoff, every, ends[-1], widest)
    axes = axes_of(scope, terms.ndim, max((one.largest for one in summaries), default=0.0))
    samples = [one.sample for one in summaries if len(one.sample)]
    places = axes.places(np.concatenate(samples)) if samples else np.empty((terms.ndim, 0))
    weights = np.repeat([one.weight for one in summaries], [len(one.sample) for one in summaries])
    low = np.where(axes.repeats, 0.0, -np.inf)
    high = np.where(axes.repeats, 1.0, np.inf)
    cuts = _cut(places, weights, n_bricks, (low, high), axes.widths, iter(range(n_bricks)))
    return Division(cuts, n_bricks, axes, tuple(ends[:-1]), scope)


def _cut(
    places: Array, weights: Array, n_parts: int, region: tuple[Array, Array], widths: Array,
    numbers: Iterator[int],
) -> Cut | int:  # fmt: skip
    """Cut a region across the longest side of its sample, so that both parts weigh their share."""
    if n_parts == 1:
        return next(numbers)
    first, (low, high) = n_parts // 2, region
    axis, at = 0, 0.0
    if len(weights):
        axis = int(np.argmax(np.ptp(places, axis=1) * widths))
        order = np.argsort(places[axis], kind="stable")
        sums = np.cumsum(weights[order])
        above = int(np.searchsorted(sums, sums[-1] * first / n_parts, side="right"))
        last, at = places[axis][order[[above - 1, above]]].tolist()
        middle = 0.5 * last + 0.5 * at
        at = middle if middle > last else at  # points at neither side of it need fewer others
    is_below = places[axis] < at
    ends, begins = high.copy(), low.copy()
    ends[axis] = begins[axis] = at
    return Cut(
        axis, float(low[axis]), at, float(high[axis]),
        _cut(places[:, is_below], weights[is_below], first, (low, ends), widths, numbers),
        _cut(places[:, ~is_below], weights[~is_below], n_parts - first, (begins, high), widths,
             numbers),
    )  # fmt: skip


def renumbered(error: Exception, numbers: Any) -> Exception:
    """An error that names points by their numbers among all, which `numbers` holds."""
    own = r"\b(points|positions|radii|types|supports|groups|labels)\[(\d+)"

    def other(found: re.Match[str]) -> str:
        name, place = found[1].replace("positions", "points"), int(found[2])
        return f"{name}[{numbers[place]}" if place < len(numbers) else found[0]

    return type(error)(re.sub(own, other, str(error)))


# ---- what each piece gives to every brick --------------------------------------------------

class Piece(NamedTuple):
    """What one piece of the points gives to one brick."""

    first: int  # number of the first point of the piece
    # Where points are in the piece, ascending: those that the brick owns, and those it needs,
    # which later bricks own, or earlier ones.
    places: tuple[Array, ...]
    columns: Columns  # of the points at these places


class Part(NamedTuple):
    """A brick with its points: owned ones, then needed ones of later bricks, then of earlier."""

    columns: Columns
    sizes: tuple[int, ...]
    numbers: Numbers
    scope: Scope

    def in_order(self, first: int = 0, last: int = 3) -> tuple[Brick, Points]:
        """The points of these kinds, ascending, and the brick that has no others."""
        low, high = sum(self.sizes[:first]), sum(self.sizes[:last])
        order = low + np.argsort(self.numbers[low:high])
        brick = Brick(self.numbers[order], order < self.sizes[0], self.scope)
        return brick, self.scope.points_of({k: one[order] for k, one in self.columns.items()})


def split(points: Points, division: Division, place: int) -> list[Piece]:
    """What a piece gives to each brick: points of its region, and those within reach of it."""
    columns, n = division.scope.columns_of(points), len(points)
    places = division.axes.places(points.positions)
    everything = np.arange(n), np.ones(n, bool)
    leaves = list(_leaves(division.cuts, places, division.axes, *everything))
    owners = np.empty(n, np.int64)
    for brick, (numbers, is_owned) in enumerate(leaves):
        owners[numbers[is_owned]] = brick
    pieces = []
    for brick, (numbers, is_owned) in enumerate(leaves):
        is_later = owners[numbers] > brick
        kinds = is_owned, is_later, ~(is_owned | is_later)
        chosen = tuple(numbers[kind].astype(np.int32) for kind in kinds)
        rows = np.concatenate(chosen)
        given = {name: one.take(rows, axis=0) for name, one in columns.items()}
        pieces.append(Piece(division.firsts[place], chosen, given))
    return pieces


def _leaves(
    cut: Cut | int, places: Array, axes: Axes, numbers: Any, is_inside: Bits
) -> Iterator[tuple[Any, Bits]]:
    """Of each brick, points within reach of its region, and which of them are inside."""
    if isinstance(cut, int):
        yield numbers, is_inside
        return
    own = places[cut.axis].take(numbers)
    reach, repeats = axes.reach[cut.axis], axes.repeats[cut.axis]
    is_below = own < cut.at
    for part, low, high, is_mine in (
        (cut.below, cut.low, cut.at, is_below), (cut.above, cut.at, cut.high, ~is_below),
    ):  # fmt: skip
        near = np.flatnonzero(_within(own, low - reach, high + reach, repeats))
        mine = (is_mine & is_inside).take(near)
        yield from _leaves(part, places, axes, numbers.take(near), mine)


def part_of(division: Division, *pieces: Piece) -> Part:
    """A brick of what all pieces give to it."""
    kinds = []  # of points: numbers, and where they are in each piece
    for k in range(3):
        for piece in pieces:
            first = sum(map(len, piece.places[:k]))
            kinds.append((piece, slice(first, first + len(piece.places[k]))))
    columns = {
        name: np.concatenate([piece.columns[name][some] for piece, some in kinds])
        for name in pieces[0].columns
    }
    numbers = [piece.first + np.concatenate(piece.places)[some] for piece, some in kinds]
    sizes = tuple(sum(len(piece.places[k]) for piece in pieces) for k in range(3))
    return Part(columns, sizes, np.concatenate(numbers, dtype=np.int64), division.scope)
