# SPDX-License-Identifier: BSD-3-Clause
"""`trajectory_pairs`: the pairs of one frame after the other."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Literal, cast, overload

import numpy as np
import numpy.typing as npt

from halfshell._convert.arrays import as_array, as_real_array
from halfshell._convert.foreign import attribute, is_a, kind_of
from halfshell._convert.objects import MISSING, parts_of
from halfshell._convert.options import LETTERS, SHELL, as_flag, as_index_bytes, check_letters
from halfshell._convert.points import Points
from halfshell._convert.progress import as_progress
from halfshell._errors import shorten
from halfshell._functions.pairs import pairs
from halfshell._objects.verlet_list import VerletList
from halfshell._search import search
from halfshell._settings import current, settings

if TYPE_CHECKING:
    from typing import Unpack

    from halfshell._convert.types import (
        Arrays,
        BoxLike,
        CutoffLike,
        Letter,
        Number,
        OptionsOfPoints,
        PointsLike,
    )

    _Frames = Iterable[PointsLike | tuple[PointsLike, BoxLike | None]]

    class _FrameOptions(OptionsOfPoints, total=False):
        """For overloads: the keywords of `trajectory_pairs`, without `quantities`."""

        skin: Number | Literal["auto"] | None
        sort: bool
        index_dtype: npt.DTypeLike


# Below them a search takes no longer than to look at a list, as docs/verlet.md has measured, and
# handing a frame to another thread takes longer than the search.
_FEW_POINTS = 1000

_Find = Callable[[Points], "Arrays"]


@overload
def trajectory_pairs(
    frames: _Frames,
    cutoff: CutoffLike = None,
    *,
    quantities: Literal["ij"] = "ij",
    **options: Unpack[_FrameOptions],
) -> Generator[tuple[npt.NDArray[Any], npt.NDArray[Any]], None, None]: ...
@overload
def trajectory_pairs(
    frames: _Frames,
    cutoff: CutoffLike = None,
    *,
    quantities: Letter,
    **options: Unpack[_FrameOptions],
) -> Generator[npt.NDArray[Any], None, None]: ...
@overload
def trajectory_pairs(
    frames: _Frames, cutoff: CutoffLike = None, *, quantities: str, **options: Unpack[_FrameOptions]
) -> Generator[Arrays, None, None]: ...
@search()
def trajectory_pairs(
    frames: _Frames,
    cutoff: CutoffLike = None,
    *,
    skin: Number | Literal["auto"] | None = "auto",
    quantities: str = "ij",
    index_dtype: npt.DTypeLike = np.int64,
    sort: bool = False,
    **search: Any,
) -> Generator[Any, None, None]:
    """Find the pairs of each frame of a trajectory, one frame after the other; always exact.

    Parameters
    ----------
    frames : iterable
        The frames, each of them points as in `pairs`, or a tuple of two, (points, box), or an
        object that brings its box: `Points`, ``ase.Atoms``, a ``Timestep`` of MDAnalysis, an
        ``mdtraj.Trajectory`` of one frame. An array of shape (f, n, d) has f frames, and so do
        ``universe.trajectory`` and an ``mdtraj.Trajectory``. A generator is read one frame at
        a time. Frames may differ in their number of points and in their box.
    {shells}
    skin : float, "auto" or None, default "auto"
        As in `VerletList`, which keeps a list from frame to frame; "auto" does so if that is
        faster, and always searches fewer than 1000 points. None: each frame is searched
        separately, for frames that have little in common. So it is where pairs are told apart by
        more than one cutoff.
    box, periodic : optional
        As in `pairs`, for all frames without a box, including a frame (points, None).
        `periodic` also holds for the boxes of frames, except objects with their own.
    {rule, exclude, min_distance, indices, inclusive}
    quantities : str, default "ij"
        As in `pairs`.
    {index_dtype}
    sort : bool, default False
        As in `pairs`.
    threads : int, optional
        As in `pairs`, for each frame. With ``skin=None`` and a number above 1, this many frames of
        1000 points or more are searched at a time, by one thread each; as many are then read ahead
        and copied.
    progress : bool or callable, optional
        True: show a bar, as in `pairs`. A function is called once for each frame, as
        ``progress(fraction)``, before its pairs are returned, with the fraction of the frames
        done, up to 1. The frames must have a length. An exception ends the iteration.

    Returns
    -------
    generator of ndarray or tuple of ndarray
        For each frame what `pairs` returns, in new arrays: the same pairs and the same bits of d, D
        and S. Their order is that of `VerletList`; with `sort`, or if each frame is searched, that
        of `pairs`.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        As for `pairs`, of a frame when the iteration reaches it; a note names the frame, and the
        iteration ends. ValueError also if a frame brings its box and `box` is given.

    Notes
    -----
    Except with `threads`, nothing is read ahead, and only the last frame is kept: any number of
    frames takes the memory of one. A reader may return the same object in each frame, as
    MDAnalysis does.

    Examples
    --------
    >>> import numpy as np
    >>> import halfshell as hs
    >>> frames = np.array([[[0.0], [1.0], [3.0]], [[0.0], [2.0], [3.0]]])
    >>> for i, j in hs.trajectory_pairs(frames, 1.5):
    ...     print(i.tolist(), j.tolist())
    [0] [1]
    [1] [2]

    A box for each frame:

    >>> boxes = [[4.0], [5.0]]
    >>> found = hs.trajectory_pairs(zip(frames, boxes), 1.5, sort=True, quantities="P")
    >>> [pairs.tolist() for pairs in found]
    [[[0, 1], [0, 2]], [[1, 2]]]
    """
    check_letters(quantities, LETTERS + SHELL)
    wanted: Any = {
        "quantities": quantities, "sort": as_flag(sort, "sort"),
        "index_dtype": np.dtype(f"i{as_index_bytes(index_dtype)}"),
    }  # fmt: skip
    own = ("box", "periodic", "threads", "progress")
    box, periodic, threads, progress = (search.pop(name, None) for name in own)
    inclusive = as_flag(search.setdefault("inclusive", True), "inclusive")
    is_number = is_a(cutoff, (float, int, np.floating, np.integer)) and cutoff != np.inf
    is_plain = is_number and not any(
        value is not None for name, value in search.items() if name != "inclusive"
    )
    if not (is_plain or cutoff is None or is_a(cutoff, Mapping)):
        as_real_array(cutoff, "cutoff", "be a number")  # refused before the first frame
    given_skin: Any = 0.0 if skin is None else skin
    kept = VerletList(
        cast("Any", cutoff if is_plain else 1.0), given_skin, box=box,
        periodic=None if box is None else periodic, inclusive=inclusive, threads=threads,
    )  # fmt: skip
    iterator, n_frames = _frames_of(frames)
    told = as_progress(progress)
    if told is not None and n_frames is None:
        raise TypeError(f"progress needs frames that have a length, got {kind_of(frames)}")
    is_shared = skin is None and threads is not None and threads > 1

    how = current()._asdict()  # those of the call, whenever a frame is searched

    def find(points: Points) -> Arrays:
        count = 1 if is_shared else threads
        with settings(**how):
            found: Arrays = pairs(points, cutoff, threads=count, **search, **wanted)
        return found

    def follow(points: Points) -> Arrays:
        is_alike = is_plain and points.radii is None and points.supports is None
        if not is_alike or points.groups is not None or points.batch is not None:
            return find(points)
        if is_a(skin, str) and len(points) < _FEW_POINTS:
            return find(points)
        kept._given = None, None  # update() would take no box as that before
        with settings(**how):
            kept.update(points)
            listed: Arrays = kept.pairs(**wanted)
            return listed

    if is_shared:
        assert threads is not None
        results: Generator[Any, None, None] = _ahead(iterator, find, box, periodic, threads)
    else:
        results = _each(iterator, find if skin is None else follow, box, periodic)
    return results if told is None else _told(results, n_frames or 1, told)


def _each(
    frames: Iterator[Any], find: _Find, box: Any, periodic: Any
) -> Generator[Any, None, None]:
    for number, frame in enumerate(frames):
        try:
            found = find(_as_frame(frame, box, periodic))
        except Exception as error:
            error.add_note(f"in frame {number} of trajectory_pairs")
            shorten(error)
            raise
        yield found
        del found  # its memory is for the next frame, if it is nowhere else


def _told(
    results: Iterator[Any], n_frames: int, progress: Callable[[float], object]
) -> Generator[Any, None, None]:
    """The results, each after `progress` has been called."""
    for number, found in enumerate(results):
        progress(min((number + 1) / n_frames, 1.0))
        yield found
        del found


# ---- frames ---------------------------------------------------------------------------------

_BY_COLUMN = "frames by a column are (part for _, part in table.groupby(column))"


def _frames_of(frames: Any) -> tuple[Iterator[Any], int | None]:
    """The frames one by one, and how many there are, if that is known."""
    kind = kind_of(frames)
    if is_a(frames, (str, bytes)) or type(frames) is Points:
        raise TypeError(f"frames must be a sequence of frames, got {kind}")
    if attribute(frames, "columns", "frames", MISSING) is not MISSING:  # rows, or groups of them
        raise TypeError(f"frames must be a sequence of frames, got {kind}: {_BY_COLUMN}")
    places = attribute(frames, "xyz", "frames", MISSING)
    vectors = attribute(frames, "unitcell_vectors", "frames", MISSING)
    if places is not MISSING and vectors is not MISSING:  # a Trajectory of mdtraj
        boxes = [None] * len(places) if vectors is None else vectors
        return iter(zip(places, boxes, strict=True)), len(places)
    try:
        iterator = iter(as_array(frames, "frames") if is_a(frames, memoryview) else frames)
    except MemoryError:
        raise
    except Exception as error:
        own = attribute(frames, "trajectory", "frames", MISSING) is not MISSING
        hint = ": pass its trajectory" if own else ""
        raise TypeError(
            f"frames must be a sequence or iterator of frames, got {kind}{hint}"
        ) from error
    try:
        return iterator, len(frames)
    except Exception:  # iterators have none, and objects may raise anything
        return iterator, None


def _as_frame(frame: Any, box: Any, periodic: Any) -> Points:
    """The points of a frame. `box` and `periodic` are for a frame that brings none.

    ValueError if a frame brings its own and another is given.
    """
    if is_a(frame, tuple) and tuple.__len__(frame) == 2:
        points, own = tuple.__iter__(frame)
        if attribute(own, "columns", "frames", MISSING) is not MISSING:
            raise TypeError(f"frames must be points, got a tuple of a {kind_of(own)}: {_BY_COLUMN}")
        if own is not None and box is not None:
            raise ValueError("box is given twice: frames bring their own")
        return Points._of(points, "frames", box if own is None else own, periodic)
    if type(frame) is Points:
        if frame.box is not None:
            return Points._of(frame, "frames", box, periodic)
        return frame if box is None else frame.replace(box=box, periodic=periodic)
    parts = parts_of(frame, "frames")
    if box is None and parts is not None and parts.box is None and parts.periodic is None:
        periodic = None  # an object in open space
    return Points._of(frame, "frames", box, periodic)


# ---- several threads -----------------------------------------------------------------------

def _ahead(
    frames: Iterator[Any], find: _Find, box: Any, periodic: Any, n_threads: int
) -> Generator[Arrays, None, None]:
    """The pairs of frames that several threads search, one each at a time, in their order.

    As many frames as there are threads are read ahead and copied, as a reader may hand out the same
    object each time. Those that are small are searched by the caller's thread.
    """
    number = 0
    waiting: deque[tuple[Points, Future[Arrays] | None]] = deque()
    process, pool = os.getpid(), ThreadPoolExecutor(n_threads)

    def look_at_process() -> None:
        """In a child threads are gone, and what they searched is for the caller's thread."""
        nonlocal process, pool, waiting
        if process != os.getpid():
            process, pool = os.getpid(), ThreadPoolExecutor(n_threads)
            waiting = deque((points, None) for points, _ in waiting)

    def hand_out(most: int) -> Generator[Arrays, None, None]:
        """The results of the frames that came first, until at most so many wait."""
        nonlocal number
        while len(waiting) > most:
            look_at_process()
            points, future = waiting.popleft()
            try:
                found = find(points) if future is None else future.result()
            except Exception as error:
                error.add_note(f"in frame {number} of trajectory_pairs")
                raise
            del future  # its memory is the caller's
            number += 1
            yield found

    try:
        for frame in frames:
            try:
                points = _as_frame(frame, box, periodic).replace()  # a copy
            except Exception as error:
                yield from hand_out(0)  # the frames before it come first
                error.add_note(f"in frame {number} of trajectory_pairs")
                raise
            look_at_process()
            is_small = len(points) < _FEW_POINTS
            waiting.append((points, None if is_small else pool.submit(find, points)))
            yield from hand_out(0 if is_small else n_threads)
        yield from hand_out(0)
    finally:
        if process == os.getpid():
            pool.shutdown(cancel_futures=True)
