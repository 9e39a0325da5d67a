# SPDX-License-Identifier: BSD-3-Clause
"""`Brick`: some of the points, and those that they need; all bricks of one set together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import numpy.typing as npt

from halfshell import _show
from halfshell._convert.options import check_letters
from halfshell._objects.neighbor_table import NeighborTable

if TYPE_CHECKING:
    from halfshell._convert.types import ArrayLike, Arrays, FloatArray

Numbers = npt.NDArray[np.int64]

_AT_A_TIME = 1 << 14  # points whose pairs are counted


class Brick:
    """The points of one worker, and the other points that it needs.

    Made by `bricks`. It can be pickled, and holds no coordinates. Methods take the coordinates of
    all points, or of `members` alone, and return indices among all points: exactly what a single
    search of all points finds for this brick.

    Attributes
    ----------
    owned : ndarray of int64, shape (m,)
        Points of this brick, ascending. Each point is in one brick.
    needed : ndarray of int64, shape (k,)
        Other points that may be within the cutoff of one of these, ascending.
    members : ndarray of int64, shape (m + k,)
        Both together, ascending.
    cutoff : float
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

    def __init__(
        self,
        members: Numbers,
        is_owned: npt.NDArray[np.bool_],
        n_points: int,
        cutoff: float,
        scene: tuple[FloatArray | None, tuple[bool, ...]],
    ) -> None:
        self.members, self.n_points, self.cutoff = members, n_points, cutoff
        self.is_owned = is_owned  # of each member
        self._box, self._periodic = scene

    @property
    def owned(self) -> Numbers:
        """Points of this brick, ascending."""
        return self.members[self.is_owned]

    @property
    def needed(self) -> Numbers:
        """Other points that may be within the cutoff of one of these, ascending."""
        return self.members[~self.is_owned]

    def pairs(
        self,
        points: ArrayLike,
        *,
        quantities: str = "ij",
        inclusive: bool = True,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
    ) -> Arrays:
        """Find the pairs whose lower number is a point of this brick.

        Parameters
        ----------
        points : array_like of float, shape (n, d) or (m + k, d)
            Coordinates of all points, or of `members`.
        quantities : str, default "ij"
            Any of the letters ``i j d D S P``, as in `pairs`.
        inclusive, kernel, threads, memory_limit
            As in `pairs`.

        Returns
        -------
        ndarray or tuple of ndarray
            As from `pairs`, ascending by (i, j, S), with indices among all points.
        """
        import halfshell as hs

        check_letters(quantities)
        members, own = self.members, self._places()
        letters = quantities if "i" in quantities else "i" + quantities
        # All pairs of the members are found sooner than those of half of them.
        some = None if 2 * len(own) >= len(members) else own
        found: Any = hs.pairs(
            self._of_members(points), self.cutoff, touching=some,
            quantities=letters, sort=True,
            **self._options(inclusive, kernel, threads, memory_limit),
        )  # fmt: skip
        columns = dict(zip(letters, found if isinstance(found, tuple) else (found,), strict=True))
        kept = self.is_owned[columns["i"]]
        arrays = []
        for letter in quantities:
            array = columns[letter][kept]
            arrays.append(members[array] if letter in "ijP" else array)
        return tuple(arrays) if len(arrays) > 1 else arrays[0]

    def count_pairs(
        self,
        points: ArrayLike,
        *,
        inclusive: bool = True,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
    ) -> int:
        """Count the pairs whose lower number is a point of this brick.

        Parameters
        ----------
        points, inclusive, kernel, threads, memory_limit
            As in `Brick.pairs`. Memory is that of the pairs of a few thousand points.
        """
        import halfshell as hs

        own, places, count = self._of_members(points), self._places(), 0
        options = self._options(inclusive, kernel, threads, memory_limit)
        for first in range(0, len(places), _AT_A_TIME):
            some = places[first : first + _AT_A_TIME]
            table = hs.neighbors(own, self.cutoff, indices=some, **options)
            row = np.repeat(some, table.counts)
            # An image of a point itself is there in both directions.
            count += int((table.indices > row).sum()) + int((table.indices == row).sum()) // 2
        return count

    def neighbors(
        self,
        points: ArrayLike,
        *,
        quantities: str = "j",
        inclusive: bool = True,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
    ) -> NeighborTable:
        """Find all neighbours of the points of this brick.

        Parameters
        ----------
        points, inclusive, kernel, threads, memory_limit
            As in `Brick.pairs`.
        quantities : str, default "j"
            Any of the letters ``j d D S``, as in `neighbors`.

        Returns
        -------
        NeighborTable
            Row k belongs to point ``owned[k]``, with indices among all points.
        """
        import halfshell as hs

        table = hs.neighbors(
            self._of_members(points), self.cutoff, indices=self._places(),
            quantities=quantities, **self._options(inclusive, kernel, threads, memory_limit),
        )  # fmt: skip
        columns = {"j": "indices", "d": "distances", "D": "vectors", "S": "shifts"}
        arrays = [getattr(table, columns[letter]) for letter in quantities]
        if "j" in quantities:
            arrays[quantities.index("j")] = self.members[table.indices]
        return NeighborTable((table.offsets, *arrays), quantities, self.n_points, False)

    def _options(
        self, inclusive: bool, kernel: str | None, threads: int | None, memory_limit: float | None
    ) -> dict[str, Any]:
        scene = {"box": self._box, "periodic": None if self._box is None else self._periodic}
        return scene | {
            "inclusive": inclusive, "kernel": kernel, "threads": threads,
            "memory_limit": memory_limit,
        }  # fmt: skip

    def _places(self) -> Numbers:
        """Where the points of this brick are among the members."""
        return np.flatnonzero(self.is_owned)

    def _of_members(self, points: Any) -> Any:
        array, n_members = np.asarray(points), len(self.members)
        if array.ndim != 2 or len(array) not in (self.n_points, n_members):
            raise ValueError(
                f"points must have shape (n, d) with n = {self.n_points}, all points, or "
                f"{n_members}, the members of the brick; got {array.shape}"
            )
        return array[self.members] if len(array) == self.n_points else array


class Bricks(Sequence[Brick]):
    """All bricks of a set of points, as `bricks` returns them.

    Attributes
    ----------
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

    def __init__(self, made: Sequence[Brick], n_points: int) -> None:
        self._made, self._n = tuple(made), n_points

    @property
    def sizes(self) -> list[int]:
        """How many points each brick owns."""
        return [int(np.count_nonzero(brick.is_owned)) for brick in self._made]

    @property
    def overhead(self) -> float:
        """How many points all bricks hold together, for each point."""
        held = sum(len(brick.members) for brick in self._made)
        return held / self._n if self._n else 1.0

    def __len__(self) -> int:
        return len(self._made)

    @overload
    def __getitem__(self, which: int) -> Brick: ...
    @overload
    def __getitem__(self, which: slice) -> Sequence[Brick]: ...
    def __getitem__(self, which: Any) -> Any:
        return self._made[which]

    def __repr__(self) -> str:
        return f"Bricks({len(self)} of {self._n} points, overhead {self.overhead:.3g})"
