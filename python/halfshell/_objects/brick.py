# SPDX-License-Identifier: BSD-3-Clause
"""`Brick`: some of the points, and those that they need; all bricks of one set together."""

from __future__ import annotations

from inspect import signature
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from halfshell import _show
from halfshell._convert.arrays import as_array, as_point_numbers
from halfshell._convert.call import DIRECTED
from halfshell._convert.foreign import whole_number
from halfshell._convert.options import check_letters
from halfshell._convert.points import Labels, Points
from halfshell._functions.neighbors import neighbors as find_neighbors
from halfshell._functions.pairs import pairs as find_pairs
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._search import spell_out

if TYPE_CHECKING:
    from halfshell._convert.types import ArrayLike, Arrays, FloatArray, PointsLike, Rule

Array = npt.NDArray[Any]
Numbers = npt.NDArray[np.int64]
#: What is known of points, by name, one row a point; of types, groups and labels the numbers.
Columns = dict[str, Array]

_AT_A_TIME = 1 << 14  # points whose pairs are counted
_NAMED = ("types", "groups", "labels")


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
                places = {one: k for k, one in enumerate(names or ())}
                unknown = [one for one in labels.names if one not in places]
                if unknown:
                    raise ValueError(f"{name} of the divided points have no {unknown[0]!r}")
                every = np.array([places[one] for one in labels.names], labels.numbers.dtype)
                columns[name] = every[labels.numbers]
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
    return np.require(array, requirements=["C", "A"])


def labels_of(points: Points) -> dict[str, Labels]:
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

    def __init__(self, members: Numbers, is_owned: npt.NDArray[np.bool_], scope: Scope) -> None:
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
            As in `Brick.pairs`. Memory is that of the pairs of a few thousand points.
        """
        how = self._how(search)
        if how["rule"] in DIRECTED:
            raise ValueError(f"rule {how['rule']!r} has a direction, and these pairs have none")
        own, places, count = self._of_members(points), np.flatnonzero(self.is_owned), 0
        for first in range(0, max(1, len(places)), _AT_A_TIME):
            some = places[first : first + _AT_A_TIME]
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
