# SPDX-License-Identifier: BSD-3-Clause
"""Points that come, go and move one at a time, each under a key."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from halfshell import _core, _show
from halfshell._convert.arrays import as_array, as_real_array, in_order, of_shape
from halfshell._convert.foreign import is_a, shown, whole_number
from halfshell._convert.lengths import as_number, as_positive
from halfshell._convert.options import as_choice, as_flag, as_whole
from halfshell._convert.points import MAX_DIM, as_own_box, as_points
from halfshell._search import search

if TYPE_CHECKING:
    from collections.abc import Iterator

    from halfshell._convert.types import (
        ArrayLike,
        BoxLike,
        Number,
        PeriodicLike,
        PointArray,
        PointsLike,
    )

    Key = int | tuple[int, int]
    _Given = tuple[int, float, Any, int, int, float, bool, bool]

#: By their numbers in the core.
_STORAGES = ("hash", "dense", "all-pairs")
_PICKLE_VERSION = 1
_BLOCK = 1024  # keys that an iterator takes at a time


class DynamicCellList:
    """Points that are inserted, moved and removed one at a time, with exact queries.

    Each point has a key. The time of insert, move and remove depends neither on the number of
    points nor on how crowded a cell is; a query looks at the cells that its ball meets.

    Parameters
    ----------
    dim : int
        Number of dimensions, 1 to 8.
    cell_size : float
        Minimum width of the cells, in the unit of the positions; about the radius of the queries.
    box, periodic : optional
        As in `pairs`. Positions may lie anywhere; each image of a point counts separately.
    storage : {"hash", "dense", "all-pairs"}, default "hash"
        "hash": only occupied cells are stored. "dense": every cell between the outermost ones
        is stored, up to 1 GB of cells; the fastest. "all-pairs": no cells, for a few dozen
        points; keys need no position, and `near` returns all of them.
    max_radius : float, optional
        Largest radius of a query. Default: `cell_size`.
    inclusive : bool, default True
        Whether a point at exactly the radius is within. For hard disks, which do not overlap when
        they touch: False.
    tagged : bool, default False
        Keys are tuples (tag, integer), as for owned sites and their ghosts, instead of integers.
        Integers must fit int64, tags int32.

    Raises
    ------
    TypeError, ValueError, OverflowError
        For arguments of the wrong kind; lengths that are not positive, not finite or beyond
        2**-300 to 2**300; a `max_radius` that spans more than 2**20 images of the box; a box as in
        `pairs`.

    See Also
    --------
    CellList : for points that do not change.
    VerletList : for points that all move in each step.

    Notes
    -----
    Whether a point is within a ball is decided exactly for the real values of the positions and
    the radius, as everywhere in this package.

    Several threads may use one list: queries at the same time, changes one after the other. Each
    row of `within_many` is found in the list as it is at that time. A list that changes during an
    iteration raises RuntimeError. The same history gives the same order of results.

    Examples
    --------
    >>> import halfshell as hs
    >>> disks = hs.DynamicCellList(2, 1.0, box=[8.0, 8.0], inclusive=False)
    >>> disks.insert(0, [1.0, 1.0])
    >>> disks.insert(1, [7.5, 1.0])
    >>> disks.any_within([8.1, 1.0], 1.0, skip=1)  # 0.9 from the image of 0 at x = 9
    True
    >>> disks.any_within([8.0, 1.0], 1.0, skip=1)  # they touch
    False
    >>> disks.move(1, [8.0, 1.0])
    >>> disks.position(1).tolist(), len(disks), 2 in disks
    ([8.0, 1.0], 2, False)
    """

    __slots__ = ("__weakref__", "_cells", "_given")

    @search()
    def __init__(
        self,
        dim: int,
        cell_size: Number,
        *,
        box: BoxLike | None = None,
        periodic: PeriodicLike | None = None,
        storage: Literal["hash", "dense", "all-pairs"] = "hash",
        max_radius: Number | None = None,
        inclusive: bool = True,
        tagged: bool = False,
    ) -> None:
        ndim = as_whole(dim, "dim")
        if not 1 <= ndim <= MAX_DIM:
            raise ValueError(f"dim must be from 1 to {MAX_DIM}, got {shown(ndim)}")
        kind = _STORAGES.index(as_choice(storage, "storage", _STORAGES))
        vectors, bits = as_own_box(box, periodic, ndim)
        radius = 0.0 if max_radius is None else as_positive(max_radius, "max_radius")
        self._given: _Given = (
            ndim, as_positive(cell_size, "cell_size"), vectors, bits, kind,
            radius, as_flag(inclusive, "inclusive"), as_flag(tagged, "tagged"),
        )  # fmt: skip
        self._cells = _core.dynamic_new(*self._given, _converted)

    @property
    def dim(self) -> int:
        """Number of dimensions."""
        return int(self._given[0])

    @property
    def cell_size(self) -> tuple[float, ...]:
        """Width of the cells along each axis, across their faces; infinity where one holds all."""
        return tuple(self._cells.look()["cell_size"])

    @property
    def max_radius(self) -> float:
        """Largest radius of a query."""
        return float(self._cells.look()["max_radius"])

    @property
    def storage(self) -> str:
        """How cells are stored: "hash", "dense" or "all-pairs"."""
        return _STORAGES[self._given[4]]

    @property
    def inclusive(self) -> bool:
        """Whether a point at exactly the radius is within."""
        return bool(self._given[6])

    @property
    def tagged(self) -> bool:
        """Whether keys are tuples (tag, integer)."""
        return bool(self._given[7])

    @property
    def nbytes(self) -> int:
        """Bytes of memory that the list holds."""
        return int(self._cells.look()["bytes"])

    @property
    def keys(self) -> npt.NDArray[np.int64]:
        """All keys, in the order of iteration: a new array, shape (n,), or (n, 2) with `tagged`."""
        return self._all(False)[0]

    @property
    def positions(self) -> npt.NDArray[np.float64]:
        """The positions of all `keys`, in their order: a new array, shape (n, dim).

        NaN for keys that have none.
        """
        found: npt.NDArray[np.float64] = self._all(True)[1]
        return found

    def _all(self, with_positions: bool) -> tuple[npt.NDArray[np.int64], Any]:
        cells = self._cells.copy()
        return cells.keys(0, max(len(cells), 1), with_positions)[1:]

    def insert(self, key: Key, position: ArrayLike | None) -> None:
        """Add a point, or move the one that has this key.

        Parameters
        ----------
        key : int or tuple of int
            An integer, or with `tagged` a tuple (tag, integer).
        position : array_like of float, shape (dim,)
            Anywhere. None, only with storage "all-pairs": the key has no position.

        Raises
        ------
        TypeError, ValueError, OverflowError, MemoryError
            For a key of the wrong kind or size; a position of the wrong length, not finite, 2**51
            boxes away or, with "dense", beyond 1 GB of cells. The list is then unchanged.

        Examples
        --------
        >>> import halfshell as hs
        >>> points = hs.DynamicCellList(2, 2.0)
        >>> points.insert(7, (-41.5, 18.5))
        >>> points.cell(7)
        (-21, 9)
        """
        self._cells.put(key, position, False)

    def move(self, key: Key, position: ArrayLike | None) -> None:
        """Move a point; KeyError if the key does not exist. Otherwise as `insert`."""
        self._cells.put(key, position, True)

    def remove(self, key: Key) -> bool:
        """Remove a point. Returns whether there was one; TypeError for a key of the wrong kind."""
        return self._cells.remove(key)

    def position(self, key: Key) -> npt.NDArray[np.float64]:
        """The position of a point, shape (dim,), as it was given.

        KeyError if there is no such key, ValueError if it has no position.
        """
        return self._cells.position(key)

    def cell(self, key: Key) -> tuple[int, ...]:
        """Indices of the cell that a point is in, one for each axis.

        Along open axes floor(x / cell_size), but for rounding; along periodic ones from 0, at half
        a box below the origin. Errors as for `position`.
        """
        return self._cells.cell(key)

    def cell_of(self, position: ArrayLike) -> tuple[int, ...]:
        """Indices of the cell that a position would be in, as `cell`, whether or not it is empty.

        Examples
        --------
        >>> import halfshell as hs
        >>> hs.DynamicCellList(2, 2.0).cell_of([-41.5, 18.5])
        (-21, 9)
        """
        return self._cells.cell_of(position)

    def near(self, position: ArrayLike, radius: Number) -> npt.NDArray[np.int64]:
        """Keys of all points in the cells that a ball meets: a superset of those within.

        Parameters
        ----------
        position : array_like of float, shape (dim,)
            Centre of the ball, anywhere.
        radius : float
            From 0 to `max_radius`.

        Returns
        -------
        ndarray of int64, shape (m,), or (m, 2) with `tagged`
            Each key once, however many of its images are near. No distance is computed.

        """
        keys: npt.NDArray[np.int64] = self._cells.within(position, radius, None)
        return keys

    def within(self, position: ArrayLike, radius: Number, *, shifts: bool = False) -> Any:
        """Keys of the points within a ball, decided exactly.

        Parameters
        ----------
        position, radius
            As in `near`.
        shifts : bool, default False
            Whether to return S as well.

        Returns
        -------
        keys : ndarray of int64, shape (m,), or (m, 2) with `tagged`
            Each key once for each image of its point in the ball. Cells nearest to the centre
            come first.
        S : ndarray of int32, shape (m, dim)
            Only with `shifts`: the point is within at position(key) + S @ box.

        Raises
        ------
        ValueError
            If a key has no position.
        OverflowError
            If S does not fit int32.

        Examples
        --------
        >>> import halfshell as hs
        >>> points = hs.DynamicCellList(1, 1.0, box=[3.0], max_radius=2.0)
        >>> points.insert(5, [0.5])
        >>> keys, S = points.within([2.0], 1.5, shifts=True)
        >>> keys.tolist(), sorted(S[:, 0].tolist())
        ([5, 5], [0, 1])
        """
        return self._cells.within(position, radius, as_flag(shifts, "shifts"))

    def any_within(self, position: ArrayLike, radius: Number, skip: Key | None = None) -> bool:
        """Whether there is a point within a ball, decided exactly. Stops at the first one.

        Parameters
        ----------
        position, radius
            As in `near`.
        skip : key, optional
            A point whose image S = 0 does not count; its other images do. For a trial move, give
            the new position next to the old one, not wrapped into the box separately.

        Raises
        ------
        KeyError
            If the key to skip does not exist.
        """
        return self._cells.any_within(position, radius, skip)

    def insert_many(self, keys: ArrayLike, positions: PointsLike) -> None:
        """Insert many points, all or none: Ctrl-C ends it before the first is put in, or after all.

        Parameters
        ----------
        keys : array_like of int, shape (n,), or (n, 2) with `tagged`
            Each once.
        positions : array_like of float, shape (n, dim)

        Raises
        ------
        ValueError
            If a key is repeated; else as `insert`. The list is then unchanged.
        """
        ids, tags = _as_keys(keys, self.tagged)
        self._cells.put_many(ids, tags, _as_positions(positions, self.dim, len(ids)), False)

    def move_many(self, keys: ArrayLike, positions: PointsLike) -> None:
        """Move many points, all or none. As `insert_many`, but KeyError for an absent key."""
        ids, tags = _as_keys(keys, self.tagged)
        self._cells.put_many(ids, tags, _as_positions(positions, self.dim, len(ids)), True)

    def remove_many(self, keys: ArrayLike) -> npt.NDArray[np.bool_]:
        """Remove many points. Returns which of them existed; ValueError if a key is repeated."""
        return self._cells.remove_many(*_as_keys(keys, self.tagged))

    def within_many(self, positions: PointsLike, radius: Number, *, shifts: bool = False) -> Any:
        """The points within each of many balls: `within` for each row.

        Parameters
        ----------
        positions : array_like of float, shape (q, dim)
        radius : float
            From 0 to `max_radius`, for all.
        shifts : bool, default False
            Whether to return S as well.

        Returns
        -------
        offsets : ndarray of int64, shape (q + 1,)
            Row q is from offsets[q] to offsets[q + 1].
        keys : ndarray of int64, shape (m,), or (m, 2) with `tagged`
        S : ndarray of int32, shape (m, dim)
            Only with `shifts`.

        """
        centres = in_order(_as_positions(positions, self.dim), np.float64)
        offsets, found = self._cells.within_many(centres, radius, as_flag(shifts, "shifts"))
        return (offsets, *found) if shifts else (offsets, found)

    def clear(self) -> None:
        """Remove all points, and release their memory."""
        self._cells.clear()

    def shrink_to_fit(self) -> None:
        """Release memory that the points do not need; MemoryError if it needs more meanwhile."""
        self._cells.shrink_to_fit()

    def copy(self) -> DynamicCellList:
        """Another list with the same points."""
        made = object.__new__(type(self))
        made._given = self._given
        made._cells = self._cells.copy()
        return made

    __copy__ = copy

    def __deepcopy__(self, memo: Any) -> DynamicCellList:
        return self.copy()

    def __contains__(self, key: Key) -> bool:
        return key in self._cells

    def __len__(self) -> int:
        return len(self._cells)

    def __iter__(self) -> Iterator[Any]:
        """The keys, in no order; RuntimeError if the list changes meanwhile."""
        return self._walk(self._cells.look()["changes"])

    def _walk(self, changes: int) -> Iterator[Any]:
        cursor, keys = 0, list[Any]()
        while True:
            if self._cells.look()["changes"] != changes:
                raise RuntimeError("DynamicCellList changed during iteration")
            if not keys:
                cursor, block, _ = self._cells.keys(cursor, _BLOCK, False)
                keys = block.tolist()[::-1]
                if not keys:
                    return
            key = keys.pop()
            yield tuple(key) if self.tagged else key

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (_PICKLE_VERSION, self._given, *self._all(True))

    _repr_html_ = _show.html

    def __repr__(self) -> str:
        dim, size, _, bits = self._given[:4]
        axes = ", ".join(str(k) for k in range(dim) if bits >> k & 1)
        space = f"{len(self)} points, " + (f"periodic along {axes}" if axes else "open space")
        return f"DynamicCellList({dim}, {size!r}, storage={self.storage!r}): {space}"


def _unpickled(version: int, given: _Given, keys: Any, positions: Any) -> DynamicCellList:
    """A list from its pickle."""
    if version != _PICKLE_VERSION:
        raise ValueError(f"this DynamicCellList was pickled by another version ({version!r})")
    made = object.__new__(DynamicCellList)
    made._given = given
    made._cells = _core.dynamic_new(*given, _converted)
    placed = ~np.isnan(positions[:, 0])
    made.insert_many(keys[placed], positions[placed])
    for key in keys[~placed].tolist():
        made.insert(tuple(key) if made.tagged else key, None)
    return made


def _converted(value: Any, name: str, dim: int, tagged: bool) -> Any:
    """One position, radius or key; the core calls this for what is not plain."""
    if name == "position":
        check = of_shape(f"position must have shape ({dim},)", (dim,))
        return in_order(as_real_array(value, name, check_shape=check), np.float64)
    if name == "radius":
        return as_number(value, name)
    if not tagged:
        return _as_integer(value, name, f"{name} must be an integer")
    must = f"{name} must be a tuple (tag, integer) of integers"
    if not is_a(value, tuple) or len(value) != 2:
        raise TypeError(f"{must}, got {shown(value)}")
    tag, number = (_as_integer(part, name, must) for part in value)
    if not -(2**31) <= tag < 2**31:
        raise OverflowError(f"the tag of {name} must fit int32, got {shown(value)}")
    return tag, number


def _as_integer(value: Any, name: str, must: str) -> int:
    number = None if is_a(value, (bool, np.bool_, np.ndarray)) else whole_number(value, name)
    if number is None:
        raise TypeError(f"{must}, got {shown(value)}")
    if not -(2**63) <= number < 2**63:
        raise OverflowError(f"{name} must fit int64, got {shown(value)}")
    return number


def _as_positions(positions: Any, dim: int, n: int | None = None) -> PointArray:
    array = as_points(positions, "positions", dim)
    if array.shape[1] != dim or n not in (None, len(array)):
        rows = "q" if n is None else n
        raise ValueError(f"positions must have shape ({rows}, {dim}), got {array.shape}")
    return array


def _as_keys(keys: Any, tagged: bool) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32] | None]:
    """Integers and tags, if these keys have them."""
    array = as_array(keys, "keys")
    if array.shape == (0,):
        array = np.empty((0, 2) if tagged else 0, np.int64)
    if array.dtype.kind not in "iu":
        for key in array.flat if array.dtype.kind == "O" else ():
            if type(key) is int and not -(2**63) <= key < 2**63:
                raise OverflowError(f"keys must fit int64, got {shown(key)}")
        raise TypeError(f"keys must be integers, got dtype {array.dtype}")
    if array.ndim != (2 if tagged else 1) or (tagged and array.shape[1] != 2):
        form = "(n, 2), of tags and integers" if tagged else "(n,)"
        raise ValueError(f"keys must have shape {form}, got {array.shape}")
    if array.dtype.kind == "u" and (array > np.uint64(2**63 - 1)).any():
        raise OverflowError("keys must fit int64")
    if not tagged:
        return in_order(array, np.int64), None
    tags = array[:, 0].astype(np.int64)
    if ((tags < -(2**31)) | (tags >= 2**31)).any():
        raise OverflowError("the tags of keys must fit int32")
    return in_order(array[:, 1], np.int64), in_order(tags, np.int32)
