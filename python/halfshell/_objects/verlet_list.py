# SPDX-License-Identifier: BSD-3-Clause
"""A pair list that is built with a skin and used for many steps."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, Literal, Never, NoReturn, TypedDict, Unpack, overload

import numpy as np
import numpy.typing as npt

from halfshell import _core, _show
from halfshell._convert.foreign import of_argument
from halfshell._convert.lengths import as_cutoff, as_length, as_skin
from halfshell._convert.options import AUTO, as_flag, as_index_bytes
from halfshell._convert.scene import as_box_alone, as_scene
from halfshell._convert.types import Arrays, BoxLike, Letter, Number, Out, PeriodicLike, PointsLike
from halfshell._objects.alone import Alone
from halfshell._objects.pair_changes import PairChanges, Step
from halfshell._objects.skin import AutoSkin
from halfshell._objects.tracked_steps import TrackedSteps
from halfshell._objects.verlet_rows import VerletRows
from halfshell._unknown import refuse_unknown


class _PairOptions(TypedDict, total=False):
    """For overloads: the keywords of `pairs`, without `quantities`."""

    sort: bool
    index_dtype: npt.DTypeLike
    out: Out | None


class VerletList(VerletRows):
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
        Whether a pair at exactly `cutoff` counts.
    track_changes : bool, default False
        Whether to allow calls of `changes`, for which the points of the previous step are kept.
    kernel, threads, memory_limit : optional
        As in `pairs`.

    Raises
    ------
    TypeError, ValueError, OverflowError
        As for `pairs`; ValueError also if `skin` is negative or not finite.

    See Also
    --------
    pairs : the same pairs for one set of points.

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

    def __init__(
        self,
        cutoff: Number,
        skin: Number | Literal["auto"] = "auto",
        *,
        box: BoxLike | None = None,
        periodic: PeriodicLike | None = None,
        inclusive: bool = True,
        track_changes: bool = False,
        kernel: str | None = None,
        threads: int | None = None,
        memory_limit: float | None = None,
        **unknown: Never,
    ) -> None:
        if unknown:
            refuse_unknown(VerletList, unknown)
        self._cutoff = as_length(as_cutoff(cutoff), "cutoff")
        self._given_skin = None if isinstance(skin, str) and skin == "auto" else as_skin(skin)
        self._given = box, periodic  # last
        self._inclusive = as_flag(inclusive, "inclusive")
        self._tracks = as_flag(track_changes, "track_changes")
        self._threads = threads
        self._kernel = kernel
        self._memory_limit = memory_limit
        self._check()
        self._n_builds = 0
        self._n_updates = 0
        self._start("there are no points yet: call update first")
        self._make_lock()

    def _start(self, without_points: str) -> None:
        """Begin without points, and with what an error says of that."""
        self._without_points = without_points
        self._list = _core.verlet_new()
        self._searched: Step | None = None  # the last step's scene, if it has no list
        self._tracked = TrackedSteps() if self._tracks else None
        auto, given = AutoSkin(self._cutoff), self._given_skin
        self._auto = auto if given is None else None
        self._skin = auto.skin if given is None else given
        self._updates = False  # in the middle of one

    def _interrupted(self) -> None:
        if self._updates:
            # The list of before is never freed: the frames of a thread that is gone keep theirs.
            self._start(
                "this process was forked off while another thread was in update: call it first"
            )

    def _check(self) -> None:
        """Refuse what no step could be taken with, by a search among no points."""
        ndim, vectors, bits = as_box_alone(*self._given)
        with suppress(MemoryError):  # each step says whether it fits
            _core.count_pairs(
                np.empty((0, ndim)), 0.0, vectors, 0 if vectors is None else bits,
                self._inclusive, "exact", self._kernel, self._memory_limit, None, self._threads,
                None, AUTO,
            )

    def update(
        self,
        points: PointsLike,
        box: BoxLike | None = None,
        periodic: PeriodicLike | None = None,
    ) -> bool:
        """Take the points of the next step.

        Parameters
        ----------
        points : array_like of float, shape (n, d)
            As in `pairs`. They are copied.
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
        with Alone(self):
            before = self._given
            given = (before[0] if box is None else box, before[1] if periodic is None else periodic)
            scene = as_scene(points, *given)
            self._updates = True
            try:
                rebuilt = self._update(*scene)
                self._given = given
            finally:
                self._updates = False
            return rebuilt

    def _update(self, array: Any, vectors: Any, bits: int) -> bool:
        if self._tracked is not None:
            array = array.copy()
        auto = self._auto
        if auto is not None and auto.searches:
            self._take(array, vectors, bits)
            self._taken(array, vectors, bits)
            auto.searched()
            return True
        change = auto is not None and auto.wants_change(array.shape[1])
        skin = auto.next_skin() if auto is not None else self._skin
        with of_argument("cutoff + skin" if skin > 0.0 and auto is None else "cutoff"):
            rebuilt = _core.verlet_update(
                self._list, array, self._cutoff, vectors, bits, self._inclusive, "exact",
                self._kernel, self._memory_limit, None, self._threads, skin, change,
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

    def _take(self, array: Any, vectors: Any, bits: int) -> None:
        """Keep the points of a step that has no list. What `pairs` refuses is refused here."""
        points = np.array(array)
        checked = points[:0] if np.isfinite(points).all() else points
        self._search(Step(checked, vectors, bits), "ij", False, 8, None)
        self._searched = Step(points, vectors, bits)
        self._list = _core.verlet_new()  # its memory may be large

    def _taken(self, points: Any, vectors: Any, bits: int) -> None:
        """A step has been taken; its points are a copy where changes are tracked."""
        self._n_updates += 1
        if self._tracked is not None:
            self._tracked.take(Step(points, None if vectors is None else vectors.copy(), bits))

    def _search(
        self, scene: Step, quantities: str, sort: bool, index_bytes: int, out: Any
    ) -> Arrays:
        points, vectors, bits = scene
        return _core.pairs(
            points, self._cutoff, vectors, bits, self._inclusive, "exact", self._kernel,
            self._memory_limit, None, self._threads, quantities, sort, index_bytes, out, None,
            AUTO, None,
        )

    @overload
    def pairs(
        self, *, quantities: Literal["ij"] = "ij", **options: Unpack[_PairOptions]
    ) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]: ...
    @overload
    def pairs(
        self, *, quantities: Letter, **options: Unpack[_PairOptions]
    ) -> npt.NDArray[Any]: ...
    @overload
    def pairs(self, *, quantities: str, **options: Unpack[_PairOptions]) -> Arrays: ...
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
        TypeError, ValueError, CapacityError, OverflowError, MemoryError
            As `halfshell.pairs`.

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
        with Alone(self):
            return self._find(quantities, as_flag(sort, "sort"), as_index_bytes(index_dtype), out)

    def _find(self, quantities: str, sort: bool, index_bytes: int, out: Any) -> Arrays:
        """The pairs of the last step."""
        if self._searched is not None:
            return self._search(self._searched, quantities, sort, index_bytes, out)
        return _core.verlet_pairs(
            self._list, np.empty((0, self._state()["ndim"])), self._cutoff, None, 0,
            self._inclusive, "exact", self._kernel, self._memory_limit, None, self._threads,
            quantities, sort, index_bytes, out,
        )

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
            vectors, has changed by less than a half along each. Points are identified by their
            numbers; pairs of points that only one of the two steps has form or break.

        Raises
        ------
        RuntimeError
            Before the first `update`, or if the list was made without `track_changes`.
        TypeError, ValueError, OverflowError, MemoryError
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
        with Alone(self):
            if self._tracked is None:
                raise RuntimeError("changes are not tracked: make it with track_changes=True")
            if self._searched is None:
                self._state()
            index_bytes = as_index_bytes(index_dtype)
            return self._tracked.changes(quantities, index_bytes, self._find, self._search)

    @property
    def cutoff(self) -> float:
        """Largest distance of a pair."""
        return self._cutoff

    @property
    def skin(self) -> float:
        """How far the list extends beyond the cutoff: as given, or as last chosen."""
        return self._skin

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

    @property
    def n_builds(self) -> int:
        """Number of times that the list was built."""
        return self._n_builds

    @property
    def n_updates(self) -> int:
        """Number of steps taken."""
        return self._n_updates

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
