# SPDX-License-Identifier: BSD-3-Clause
"""A pair list that is built with a skin and used for many steps, and the choice of the skin."""

from __future__ import annotations

import math
import os
import threading
import weakref
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from fractions import Fraction
from typing import Any, Literal, NamedTuple, NoReturn, Unpack, overload

import numpy as np
import numpy.typing as npt

from halfshell import _core, _show
from halfshell._convert.arrays import are_backward, row_keys
from halfshell._convert.foreign import attribute, is_a, of_argument, shown
from halfshell._convert.lengths import as_length, as_number
from halfshell._convert.options import as_flag, as_index_bytes, as_threads, check_letters
from halfshell._convert.points import Points, as_box_alone
from halfshell._convert.types import (
    Arrays,
    BoxLike,
    Letter,
    ListOptions,
    Number,
    Out,
    PeriodicLike,
    PointsLike,
)
from halfshell._objects.exact import as_fractions, determinant, product, solved, transposed
from halfshell._objects.neighbor_table import NeighborTable
from halfshell._search import search
from halfshell._settings import current

_LISTS: weakref.WeakSet[VerletList] = weakref.WeakSet()


class VerletList:
    """A list of pairs that is kept for many steps and is always exact.

    The list is built with a larger cutoff, `cutoff` + `skin`. As long as no points can have moved
    close enough for it to miss a pair, a new step takes only a pass over the points and a pass
    over the list, in which each pair is decided anew for the points of that step.

    Parameters
    ----------
    cutoff : float
        Largest distance of a pair, in the unit of the points; finite, not negative.
    skin : float or "auto", default "auto"
        How far the list extends beyond the cutoff, in the same unit; finite, not negative. Two
        points may approach each other by that much before the list is rebuilt. With 0 it is rebuilt
        unless nothing has moved. "auto" adapts to the speed of the points and the number of listed
        pairs, settles after a few changes, and searches in every step if that is faster. It
        reads no clock; the pairs never depend on it.
    box, periodic : optional
        As in `pairs`; `update` may give others.
    inclusive : bool, default True
        As in `pairs`.
    track_changes : bool, default False
        Whether to allow calls of `changes`, for which the points of the previous step are kept.
    threads : int, optional
        As in `pairs`.

    Notes
    -----
    Points may be wrapped into the box or not, at any time; the box may change in every step. The
    points are copied, so you may change the array afterwards. The list is rebuilt whenever needed
    (other points, another number or dtype of them, too large a deformation of the box).

    A list pays only if it lasts for several steps: ``docs/verlet.md`` has measurements.
    Several threads may use one list; calls run one at a time. It cannot be copied or pickled. A
    forked process may continue with its copy; if another thread was in `update` at the time, that
    copy has no points until the next `update`.

    Examples
    --------
    >>> import numpy as np
    >>> import halfshell as hs
    >>> rng = np.random.default_rng(0)
    >>> points = rng.random((1000, 3)) * 10.0
    >>> pair_list = hs.VerletList(2.0, skin=0.5, box=[10.0] * 3)
    >>> for step in range(5):
    ...     rebuilt = pair_list.update(points)
    ...     i, j, d = pair_list.pairs(quantities="ijd")
    ...     assert len(i) == hs.count_pairs(points, 2.0, box=[10.0] * 3)
    ...     points += rng.uniform(-0.02, 0.02, points.shape)
    >>> pair_list.n_updates, pair_list.n_builds
    (5, 1)
    """

    @search()
    def __init__(
        self,
        cutoff: Number,
        skin: Number | Literal["auto"] = "auto",
        *,
        box: BoxLike | None = None,
        periodic: PeriodicLike | None = None,
        inclusive: bool = True,
        track_changes: bool = False,
        threads: int | None = None,
    ) -> None:
        if is_a(cutoff, Points) or attribute(cutoff, "ndim", "cutoff") == 2:
            raise TypeError("cutoff must be a number: points are those of update(points)")
        self._cutoff = as_length(as_number(cutoff, "cutoff"), "cutoff")
        self._given_skin = None
        if not is_a(skin, str):
            self._given_skin = as_length(as_number(skin, "skin", 'be a number or "auto"'), "skin")
        elif str.__str__(skin) != "auto":
            raise ValueError(f'skin must be a number or "auto", got {shown(skin)}')
        self._given = box, periodic  # until `update` brings others
        self._inclusive = as_flag(inclusive, "inclusive")
        self._tracks = as_flag(track_changes, "track_changes")
        self._threads = as_threads(threads)
        ndim, vectors, bits = as_box_alone(box, periodic)
        with suppress(MemoryError):  # each step says whether it fits
            _core.count_pairs(
                np.empty((0, ndim)), 0.0, vectors, 0 if vectors is None else bits, *self._how(),
                None, current().algorithm,
            )  # fmt: skip
        self._n_builds = 0
        self._n_updates = 0
        self._start("there are no points yet: call update first")
        self._make_lock()

    def _start(self, without_points: str) -> None:
        """Begin without points, and with what an error says of that."""
        self._without_points = without_points
        self._list = _core.verlet_new()
        self._searched: Step | None = None  # the last step's scene, if it has no list
        self._steps: list[Step] = []  # with changes tracked, the last and the one before
        self._known: list[dict[tuple[str, int], Any]] = []  # their pairs, where these are known
        auto, given = AutoSkin(self._cutoff), self._given_skin
        self._auto = auto if given is None else None
        self._skin = auto.skin if given is None else given
        self._updates = False  # in the middle of one

    def _how(self) -> tuple[Any, ...]:
        how = current()
        threads = how.threads if self._threads is None else self._threads
        return self._inclusive, "exact", how.kernel, how.memory_limit, None, threads

    # ---- one call at a time, also in a child that was forked off in the middle of one ------

    def _make_lock(self) -> None:
        self._lock, self._caller = threading.RLock(), 0  # 0: no thread is in a call
        _LISTS.add(self)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Other threads wait, a call from within a call is an error."""
        with self._lock:  # which a fork may replace meanwhile
            if self._caller:  # a signal handler, called while the core looks for signals
                raise RuntimeError("this VerletList is in the middle of another call")
            self._caller = threading.get_ident()
            try:
                yield
            finally:
                self._caller = 0

    @staticmethod
    def _forked() -> None:
        """In a child there is one thread, which may be in a call; others left locks taken."""
        for each in list(_LISTS):
            caller = each._caller
            if caller == threading.get_ident():
                continue
            each._make_lock()
            if caller and each._updates:
                # The list of before is never freed: frames of a thread that is gone keep theirs.
                each._start(
                    "this process was forked off while another thread was in update: call it first"
                )

    # ---- steps -----------------------------------------------------------------------------

    def update(
        self,
        points: PointsLike,
        box: BoxLike | None = None,
        periodic: PeriodicLike | None = None,
    ) -> bool:
        """Take the points of the next step.

        Parameters
        ----------
        points : array_like of float, shape (n, d), or Points
            As in `pairs`, of one system, without radii, supports or groups. They are copied.
        box, periodic : optional
            The box of this step, as in `pairs`. Default: as last given, to the list or here.

        Returns
        -------
        bool
            Whether the list was rebuilt. Also True if "auto" works without a list: the order of
            the pairs is then new in each step.

        Raises
        ------
        TypeError, ValueError, OverflowError, MemoryError
            As for `pairs` with S; OverflowError also if the S of a listed pair does not fit int32.
            The list is then unchanged, with the points of the previous step.

        Examples
        --------
        >>> import halfshell as hs
        >>> pair_list = hs.VerletList(1.0, skin=0.2)
        >>> pair_list.update([[0.0, 0.0], [1.1, 0.0]])
        True
        >>> pair_list.update([[0.0, 0.0], [0.95, 0.0]])
        False
        >>> pair_list.pairs(quantities="d").tolist()
        [0.95]
        """
        with self._alone():
            before = self._given
            given = (before[0] if box is None else box, before[1] if periodic is None else periodic)
            brings = type(points) is Points and points.box is not None
            found = Points._of(points, "points", *((None, None) if brings else given))
            for what in ("radii", "supports", "groups"):
                if getattr(found, what) is not None:
                    raise ValueError(
                        f"VerletList cannot be combined with {what}: it has one cutoff for all "
                        "pairs; trajectory_pairs takes such points"
                    )
            scene = found._scene
            self._updates = True
            try:
                rebuilt = self._update(*scene)
                self._given = given
            finally:
                self._updates = False
            return rebuilt

    def _update(self, array: Any, vectors: Any, bits: int) -> bool:
        if self._tracks:
            array = array.copy()
        auto = self._auto
        if auto is not None and auto.searches:
            points = np.array(array)  # of a step that has no list; what pairs refuses is refused
            checked = points[:0] if np.isfinite(points).all() else points
            self._search(Step(checked, vectors, bits), "ij", False, 8, None)
            self._searched = Step(points, vectors, bits)
            self._list = _core.verlet_new()  # its memory may be large
            self._taken(array, vectors, bits)
            auto.searched()
            return True
        change = auto is not None and auto.wants_change(array.shape[1])
        skin = auto.chosen if auto is not None else self._skin
        with of_argument("cutoff + skin" if skin > 0.0 and auto is None else "cutoff"):
            rebuilt: bool = _core.verlet_update(
                array, self._cutoff, vectors, bits, *self._how(), self._list, skin, change
            )
        self._searched = None
        self._taken(array, vectors, bits)
        self._n_builds += rebuilt
        if rebuilt:
            self._skin = skin
        if auto is not None:
            state = _core.verlet_look(self._list)
            auto.updated(
                rebuilt, state["tried"], state["ndim"], state["n_points"], state["n_listed"]
            )
        return rebuilt

    def _taken(self, points: Any, vectors: Any, bits: int) -> None:
        self._n_updates += 1
        if self._tracks:
            step = Step(points, None if vectors is None else vectors.copy(), bits)
            self._steps = [*self._steps[-1:], step]
            self._known = [*self._known[-1:], {}]

    def _search(
        self, scene: Step, quantities: str, sort: bool, index_bytes: int, out: Any
    ) -> Arrays:
        points, vectors, bits = scene
        found: Arrays = _core.pairs(
            points, self._cutoff, vectors, bits, *self._how(), quantities, sort, index_bytes, out,
            None, current().algorithm, None,
        )  # fmt: skip
        return found

    # ---- pairs -----------------------------------------------------------------------------

    @overload
    def pairs(
        self, *, quantities: Literal["ij"] = "ij", **options: Unpack[ListOptions]
    ) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]: ...
    @overload
    def pairs(
        self, *, quantities: Letter, **options: Unpack[ListOptions]
    ) -> npt.NDArray[Any]: ...
    @overload
    def pairs(self, *, quantities: str, **options: Unpack[ListOptions]) -> Arrays: ...
    def pairs(
        self,
        *,
        quantities: str = "ij",
        sort: bool = False,
        index_dtype: npt.DTypeLike = np.int64,
        out: Out | None = None,
    ) -> Arrays:
        """The pairs of the last step: what `halfshell.pairs` finds for its points.

        Parameters
        ----------
        quantities, sort, index_dtype, out
            As in `halfshell.pairs`.

        Returns
        -------
        ndarray or tuple of ndarray
            As from `halfshell.pairs`: the same pairs, and the same bits of d, D and S. Their order
            is that of the list: first the pairs within one image when the list was built,
            then the others, each in the order in which they were found. Apart from pairs that come
            and go, it stays the same until the list is rebuilt, for any kernel and number of
            threads. If "auto" works without a list, it is that of `halfshell.pairs`. With `sort`
            it is ascending (i, j, S).

        Raises
        ------
        RuntimeError
            Before the first `update`.

        Examples
        --------
        >>> import halfshell as hs
        >>> pair_list = hs.VerletList(1.5, box=[4.0, 4.0])
        >>> pair_list.update([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]])
        True
        >>> i, j, S = pair_list.pairs(quantities="ijS", sort=True)
        >>> i.tolist(), j.tolist(), S.tolist()
        ([0, 0], [1, 2], [[0, 0], [-1, 0]])
        """
        check_letters(quantities)
        with self._alone():
            return self._find(quantities, as_flag(sort, "sort"), as_index_bytes(index_dtype), out)

    def _find(self, quantities: str, sort: bool, index_bytes: int, out: Any) -> Arrays:
        if self._searched is not None:
            return self._search(self._searched, quantities, sort, index_bytes, out)
        found: Arrays = _core.verlet_pairs(
            np.empty((0, self._state()["ndim"])), self._cutoff, None, 0, *self._how(), self._list,
            quantities, sort, index_bytes, out,
        )  # fmt: skip
        return found

    def neighbors(
        self, *, quantities: str = "j", index_dtype: npt.DTypeLike = np.int64
    ) -> NeighborTable:
        """All neighbours of each point of the last step, as `halfshell.neighbors` finds them.

        Parameters
        ----------
        quantities, index_dtype
            As in `halfshell.neighbors`.

        Returns
        -------
        NeighborTable
            The table of `halfshell.neighbors`, bit for bit, but without the points, which its
            ``sort()`` would need.

        Raises
        ------
        RuntimeError
            Before the first `update`.
        OverflowError
            As `pairs`; also for a shift of -2**31, which has no opposite in int32.

        Notes
        -----
        The pairs are sorted into rows, which takes longer than `pairs`. It pays if you need the
        rows and the list lasts for many steps.

        Examples
        --------
        >>> import halfshell as hs
        >>> pair_list = hs.VerletList(1.5, box=[4.0, 4.0])
        >>> pair_list.update([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]])
        True
        >>> [row.tolist() for row in pair_list.neighbors()]
        [[1, 2], [0], [0]]
        """
        check_letters(quantities, "jdDS")
        index_bytes = as_index_bytes(index_dtype)
        letters = "ij" + quantities.replace("j", "")
        with self._alone():
            half = self._find(letters, True, index_bytes, None)
            n = self.n_points
        columns = dict(zip(letters, half, strict=True))
        return NeighborTable._of_columns(columns, quantities, (n, n), True, True, is_in_order=True)

    def changes(
        self, *, quantities: str = "ij", index_dtype: npt.DTypeLike = np.int64
    ) -> PairChanges:
        """The pairs that formed and broke between the previous and the last step, each once.

        Parameters
        ----------
        quantities, index_dtype
            As in `pairs`.

        Returns
        -------
        PairChanges
            Named tuple (formed, broken) of what `pairs` returns: `formed` has the pairs of the last
            step that did not exist in the previous one; `broken` has the pairs of the previous step
            that no longer exist, with the d, D and S that they had then. Both ascend by
            (i, j, S). In the first step every pair is formed.

            Each image of a point counts separately. Wrapping a point into the box breaks no pair,
            although S changes. Nor does a change of the lattice basis, as when a sheared box is
            flipped back: a pair continues as the one whose vector, in units of the box
            vectors, has changed by less than a half along each, exactly (a half that was taken off
            counts as well). Points are identified by their numbers; pairs of points that only one
            of the two steps has form or break.

        Raises
        ------
        RuntimeError
            Before the first `update`, or if the list was made without `track_changes`.
        OverflowError
            As for `pairs` with S.

        Examples
        --------
        >>> import halfshell as hs
        >>> pair_list = hs.VerletList(1.0, box=[5.0], track_changes=True)
        >>> for x in ([0.2, 1.5, 4.5], [0.0, 0.9, 4.2], [4.9, 0.7, 3.8]):
        ...     rebuilt = pair_list.update([[value] for value in x])
        ...     print(*([k.tolist() for k in pairs] for pairs in pair_list.changes()))
        [[0], [2]] [[], []]
        [[0], [1]] [[], []]
        [[], []] [[0], [2]]
        """
        with self._alone():
            if not self._tracks:
                raise RuntimeError("changes are not tracked: make it with track_changes=True")
            if self._searched is None:
                self._state()
            index_bytes = as_index_bytes(index_dtype)
            check_letters(quantities)
            letters = quantities + "".join(letter for letter in "ijS" if letter not in quantities)
            key, now = (letters, index_bytes), self._steps[-1]
            new = self._known[-1].get(key) or self._find(letters, True, index_bytes, None)
            nothing = Step(now.points[:0], now.vectors, now.bits)
            before = self._steps[0] if len(self._steps) == 2 else nothing
            old = self._known[0].get(key) if before is not nothing else None
            old = old or self._search(before, letters, True, index_bytes, None)
            self._known = [{key: old}, {key: new}][-len(self._steps) :]
            column = [letters.index(letter) for letter in "ijS"]
            broken, formed = compare(
                before, tuple(old[k] for k in column), now, tuple(new[k] for k in column)
            )

        def rows(columns: Any, which: npt.NDArray[Any]) -> Arrays:
            chosen = tuple(column[which] for column in columns[: len(quantities)])
            return chosen[0] if len(chosen) == 1 else chosen

        return PairChanges(rows(new, formed), rows(old, broken))

    cutoff: float = _show.attribute("_cutoff", "Largest distance of a pair.")
    skin: float = _show.attribute(
        "_skin", "How far the list extends beyond the cutoff: as given, or as last chosen."
    )

    @property
    def margin(self) -> float:
        """How much closer pairs may still come before the list is rebuilt, rounded down.

        In the unit of the points, not negative; 0 without a list. RuntimeError before any `update`.
        """
        if self._searched is not None:
            return 0.0
        return float(self._state()["margin"])

    @property
    def n_points(self) -> int:
        """Number of points of the last step; 0 before the first."""
        if self._searched is not None:
            return len(self._searched[0])
        return int(_core.verlet_look(self._list)["n_points"])

    n_builds: int = _show.attribute("_n_builds", "Number of times that the list was built.")
    n_updates: int = _show.attribute("_n_updates", "Number of steps taken.")

    def _state(self) -> dict[str, Any]:
        state = _core.verlet_look(self._list)
        if not state["has_list"]:
            raise RuntimeError(self._without_points)
        return state

    def __reduce__(self) -> NoReturn:
        raise TypeError("a VerletList cannot be copied or pickled: make a new one")

    _repr_html_ = _show.html

    def __repr__(self) -> str:
        done = f"{self.n_points} points, {self._n_builds} builds in {self._n_updates} updates"
        return f"VerletList({self._cutoff!r}, skin={self._skin!r}): {done}"


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=VerletList._forked)


# ---- the skin that is chosen ---------------------------------------------------------------

FIRST_SHARE = 0.1  # of the cutoff: the first skin
SHARES = [2.0 ** (k / 4.0) for k in range(-40, 1)]  # of the cutoff: all skins that are considered
MOST_CHANGES = 6  # then it is settled, whatever it is
STEPS_TO_WAIT = 32  # a list that lasts longer than this is looked at all the same
WORTHWHILE = 0.95  # a change must promise at most this share of the time
SEARCHES = 1000  # steps that are searched before a list is tried again

# Nanoseconds, as benchmarks/verlet.py has measured them for i and j in three dimensions, without
# what writing the pairs takes, which is the same for both: each call, each point, each pair that
# is listed or found.
_USE = (50e3, 50.0, 0.95)
_BUILD = (50e3, 170.0, 4.6)
_SEARCH = (15e3, 80.0, 2.1)


class AutoSkin:
    """Chooses a skin, or a search in every step, by what has to be done.

    With a skin s a step takes ``build / lasts(s) + use``, each of which grows with the pairs that
    are listed, and these with ``(cutoff + s)**d``. lasts(s) is s over what a step has used up of
    the skin.

    It looks when a list is used up, and at one that lasts long after STEPS_TO_WAIT steps. There are
    at most MOST_CHANGES changes, and none after a look that found nothing WORTHWHILE: it settles.
    In three dimensions it also compares with a search, at every look: `searches` says that no list
    is wanted for the next SEARCHES steps.
    """

    def __init__(self, cutoff: float) -> None:
        self.cutoff = cutoff
        self._start()

    def _start(self) -> None:
        self.skin = FIRST_SHARE * self.cutoff  # of the list in use
        self.is_settled = self.cutoff == 0.0  # there is no length to go by
        self.searches = False
        self.chosen = self.skin  # for the next one
        self._n_changes = 0
        self._n_points = 0  # of the list in use
        self._n_listed = 0
        self._steps = 0  # since it was built
        self._spent = 0.0  # of the skin, since then
        self._searched = 0

    def wants_change(self, ndim: int) -> bool:
        if self._steps >= STEPS_TO_WAIT and not self.is_settled:
            self._look(self._spent / self._steps, ndim)
        return self.chosen != self.skin

    def searched(self) -> None:
        self._searched += 1
        if self._searched == SEARCHES:
            self._start()

    def updated(
        self, rebuilt: bool, margin: float, ndim: int, n_points: int, n_listed: int
    ) -> None:
        """A step was taken; `margin` is what it would have left of the list before."""
        if not rebuilt:
            self._steps += 1
            self._spent = max(self._spent, self.skin - margin)
            return
        if self.chosen != self.skin:
            self.skin = self.chosen
        elif not math.isinf(margin):
            self._look((self.skin - margin) / (self._steps + 1), ndim)
        self._n_points = n_points
        self._n_listed = n_listed
        self._steps = 0
        self._spent = 0.0

    def _look(self, a_step: float, ndim: int) -> None:
        """Choose what promises most, for points that use up so much of the skin in a step."""
        if self.cutoff == 0.0:
            return
        times = {
            share * self.cutoff: self.list_time(share * self.cutoff, a_step, ndim)
            for share in SHARES
        }
        best = min(times, key=lambda skin: times[skin])
        if ndim == 3 and self.search_time(ndim) < WORTHWHILE * times[best]:
            self.searches = True
            return
        if self.is_settled:
            return
        now = self.list_time(self.skin, a_step, ndim)
        if self._n_changes == MOST_CHANGES or not times[best] < WORTHWHILE * now:
            self.is_settled = True
            return
        self._n_changes += 1
        self.chosen = best

    def list_time(self, skin: float, a_step: float, ndim: int) -> float:
        lasts = max(1.0, skin / a_step) if a_step > 0.0 else math.inf
        return self._time(_BUILD, skin, ndim) / lasts + self._time(_USE, skin, ndim)

    def search_time(self, ndim: int) -> float:
        return self._time(_SEARCH, 0.0, ndim)

    def _time(self, parts: tuple[float, float, float], skin: float, ndim: int) -> float:
        pairs = self._n_listed * ((self.cutoff + skin) / (self.cutoff + self.skin)) ** ndim
        return parts[0] + parts[1] * self._n_points + parts[2] * pairs


# ---- what has changed ------------------------------------------------------------------------

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Columns = tuple[npt.NDArray[Any], ...]

PLAIN = (2.0**-400, 2.0**400)  # between these products of numbers are ordinary ones
MOST_TURNS = 2**60  # more than any pair goes on by: S is int32


@_show.shown
class PairChanges(NamedTuple):
    """The changes that `VerletList.changes` returns.

    Attributes
    ----------
    formed : ndarray or tuple of ndarray
        The pairs of the last step that did not exist in the previous step, as of the last step.
    broken : ndarray or tuple of ndarray
        The pairs of the previous step that no longer exist, as of the previous step.

    Examples
    --------
    >>> import halfshell as hs
    >>> pair_list = hs.VerletList(1.0, track_changes=True)
    >>> pair_list.update([[0.0], [0.9]])
    True
    >>> pair_list.changes()._fields
    ('formed', 'broken')
    """

    formed: Arrays
    broken: Arrays


class Step(NamedTuple):
    """The scene of one step."""

    points: npt.NDArray[Any]  # (n, d)
    vectors: Floats | None  # of the box
    bits: int  # axes that repeat

    @property
    def axes(self) -> set[int]:
        return {k for k in range(self.points.shape[1]) if self.bits >> k & 1}


class _Pairs(NamedTuple):
    """Pairs of a step."""

    i: npt.NDArray[Any]
    j: npt.NDArray[Any]
    S: npt.NDArray[Any]  # (m, d)


def compare(before: Step, old: Columns, now: Step, new: Columns) -> tuple[Integers, Integers]:
    """Which pairs (i, j, S) of the step before, and of this one, are not in the other one.

    Both lists ascend; what is returned are places in them, which ascend too.

    Points are told by their numbers, and images of them by continuity: a pair in this step goes
    on from the one whose vector, in units of the box vectors, differs from its own by less than a
    half along each, or by a half that was taken off. What that is depends on the two points alone,
    so that each pair goes on from one pair at most, however far points have moved. It is decided
    for the real numbers that points and box vectors are.
    """
    was, then = _Pairs(*old), _Pairs(*new)
    if before.points.shape[1] != now.points.shape[1]:
        return np.arange(len(was.i)), np.arange(len(then.i))
    every = np.concatenate(_keys_of_both(before, was, now, then))
    order = np.argsort(every, kind="stable")  # of two lists that ascend, mostly
    twice = every[order[1:]] == every[order[:-1]]
    alone = np.ones(len(every), bool)
    alone[order[1:][twice]] = alone[order[:-1][twice]] = False
    return np.flatnonzero(alone[: len(was.i)]), np.flatnonzero(alone[len(was.i) :])


def _keys_of_both(before: Step, was: _Pairs, now: Step, then: _Pairs) -> list[Integers]:
    """Numbers of pairs, the same for one that goes on."""
    axes = sorted(before.axes & now.axes)
    if not axes:
        return _keys(was, was.S, then, then.S)
    change, moves = _moves_between(before, now, axes)
    turns = moves.turns()
    if turns is not None and np.array_equal(change, np.eye(len(axes))):
        new = then.S
        if turns.any():
            new = then.S.astype(np.int64)
            new[:, axes] += turns[then.j] - turns[then.i]
        return _keys(was, was.S, then, new)
    change_of = np.eye(then.S.shape[1], dtype=np.int64)
    change_of[np.ix_(np.array(axes), np.array(axes))] = change
    new = then.S @ change_of
    goes_on = (then.i < moves.n) & (then.j < moves.n)
    turns = moves.apart(then.i[goes_on], then.j[goes_on])
    new[np.ix_(np.flatnonzero(goes_on), np.array(axes))] += turns
    return _keys(was, _upright(was, was.S), then, _upright(then, new))


class _Moves:
    """How far points have moved, in units of the box vectors that they had.

    In float64, with a bound on the error; in fractions where that does not tell which integer is
    the nearest.
    """

    def __init__(
        self, old: Floats, new: Floats, to_old: list[list[Fraction]], to_new: list[list[Fraction]]
    ) -> None:
        self.n = min(len(old), len(new))  # points that both steps have
        self.n_all = max(len(old), len(new))
        self._points, self._to_units = (old, new), (to_old, to_new)
        self._known: dict[int, list[Fraction]] = {}
        places, error_of_old = _in_units(old, to_old)
        places_now, error_of_new = _in_units(new, to_new)
        self.floats = places_now[: self.n] - places[: self.n]
        # Of the difference of two moves, and of each itself.
        self.error = error_of_old + error_of_new + 2.0**-50 * _largest(self.floats)

    def turns(self) -> Integers | None:
        """Whole box vectors that each point has jumped by, where that is clear, but for a drift.

        It is where points have moved by less than a quarter besides, so that any two have by less
        than a half. 0 for points that one step does not have: they have no pairs to go on.
        """
        for drift in (0.0, self.floats[:1]):
            rest = self.floats - drift
            whole = np.rint(rest)
            if np.all(np.abs(rest - whole) + 2.0 * self.error < 0.2499):
                turns = np.zeros((self.n_all, whole.shape[1]), np.int64)
                turns[: self.n] = whole
                return turns
        return None

    def apart(self, i: npt.NDArray[Any], j: npt.NDArray[Any]) -> Integers:
        """The integer nearest to what j has moved by more than i; of two, the larger one."""
        more = self.floats[j] - self.floats[i] + 0.5
        whole = np.floor(more)
        is_sure = np.minimum(more - whole, whole + 1.0 - more) > 2.0 * self.error
        is_sure &= np.abs(more) < MOST_TURNS
        found = np.where(is_sure, whole, 0.0).astype(np.int64)
        for k in np.flatnonzero(~is_sure.all(axis=1)):
            pair = zip(self._exactly(int(i[k])), self._exactly(int(j[k])), strict=True)
            nearest = (math.floor(b - a + Fraction(1, 2)) for a, b in pair)
            found[k] = [max(-MOST_TURNS, min(turns, MOST_TURNS)) for turns in nearest]
        return found

    def _exactly(self, point: int) -> list[Fraction]:
        move = self._known.get(point)
        if move is None:
            old, new = (
                product(as_fractions(points[point : point + 1]), to_units)[0]
                for points, to_units in zip(self._points, self._to_units, strict=True)
            )
            move = [b - a for a, b in zip(old, new, strict=True)]
            self._known[point] = move
        return move


def _moves_between(before: Step, now: Step, axes: list[int]) -> tuple[Integers, _Moves]:
    """Points of both steps in units of the box vectors before, as they are deformed now.

    A box may have got another basis of nearly the same lattice in between. `change` has the new
    vectors as sums of the old ones: the identity for a box that was only deformed.
    """
    assert before.vectors is not None and now.vectors is not None  # as some axes repeat
    old, new = (as_fractions(step.vectors[axes]) for step in (before, now))  # type: ignore[index]
    to_old = _right_inverse(old)
    to_new = to_old if new == old else _right_inverse(new)
    change = [[math.floor(x + Fraction(1, 2)) for x in row] for row in product(new, to_old)]
    in_fractions = [[Fraction(x) for x in row] for row in change]
    if max(abs(x) for row in change for x in row) > 2**20 or abs(determinant(in_fractions)) != 1:
        change = np.eye(len(axes), dtype=int).tolist()
    else:
        to_new = product(to_new, in_fractions)
    points = [step.points.astype(np.float64) for step in (before, now)]
    return np.array(change, np.int64), _Moves(points[0], points[1], to_old, to_new)


def _right_inverse(vectors: list[list[Fraction]]) -> list[list[Fraction]]:
    """A matrix (d, m) with vectors @ matrix = 1, at right angles to what they do not span."""
    columns = transposed(vectors)
    return transposed(solved(product(vectors, columns), vectors))


def _in_units(points: Floats, to_units: list[list[Fraction]]) -> tuple[Floats, Floats]:
    """points @ to_units, rounded, and a bound on the error, for each column.

    It is infinite for units in which floats would overflow or vanish: only fractions tell there.
    """
    largest = _largest(points)
    most = [max(abs(x) for x in column) for column in transposed(to_units)]  # none is 0
    sizes = [*(x for x in most), *(Fraction(x) for x in largest[largest > 0.0].tolist())]
    if not all(PLAIN[0] < size < PLAIN[1] for size in sizes):
        return np.zeros((len(points), len(most))), np.full(len(most), np.inf)
    factors = np.array([[float(x) for x in row] for row in to_units])
    return points @ factors, largest @ np.abs(factors) * 2.0**-48 + 2.0**-600


def _largest(x: Floats) -> Floats:
    """Of each column: several times as quick as all at once."""
    return np.array([np.abs(column).max(initial=0.0) for column in x.T])


def _upright(pairs: _Pairs, images: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A pair of a point and its own image has two, opposite ones: the first number not 0 > 0."""
    return np.where(are_backward(pairs.i, pairs.j, images)[:, None], -images, images)


def _keys(
    was: _Pairs, old: npt.NDArray[Any], then: _Pairs, new: npt.NDArray[Any]
) -> list[Integers]:
    """A number for each pair from i, j and its image, in their order."""
    return row_keys([was.i, was.j, *old.T], [then.i, then.j, *new.T])
