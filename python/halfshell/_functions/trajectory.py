# SPDX-License-Identifier: BSD-3-Clause
"""`trajectory_pairs`: the pairs of one frame after the other."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from typing import Any, Literal, Never, TypedDict, Unpack, overload

import numpy as np
import numpy.typing as npt

from halfshell._convert.foreign import kind_of
from halfshell._convert.frames import as_frame, frames_of, of_frame
from halfshell._convert.options import as_flag, as_index_bytes, check_letters
from halfshell._convert.progress import as_progress
from halfshell._convert.types import Arrays, BoxLike, Letter, Number, PeriodicLike, PointsLike
from halfshell._errors import shorten
from halfshell._functions.pairs import pairs
from halfshell._objects.verlet_list import VerletList
from halfshell._unknown import refuse_unknown

# Below them a search takes no longer than to look at a list, as docs/verlet.md has measured.
_FEW_POINTS = 1000

_Frames = Iterable[PointsLike | tuple[PointsLike, BoxLike | None]]


class _FrameOptions(TypedDict, total=False):
    """For overloads: the keywords of `trajectory_pairs`, without `quantities`."""

    skin: Number | Literal["auto"] | None
    box: BoxLike | None
    periodic: PeriodicLike | None
    inclusive: bool
    sort: bool
    index_dtype: npt.DTypeLike
    kernel: str | None
    threads: int | None
    memory_limit: float | None
    progress: Callable[[float], object] | bool | None


@overload
def trajectory_pairs(
    frames: _Frames,
    cutoff: Number,
    *,
    quantities: Literal["ij"] = "ij",
    **options: Unpack[_FrameOptions],
) -> Generator[tuple[npt.NDArray[Any], npt.NDArray[Any]], None, None]: ...
@overload
def trajectory_pairs(
    frames: _Frames, cutoff: Number, *, quantities: Letter, **options: Unpack[_FrameOptions]
) -> Generator[npt.NDArray[Any], None, None]: ...
@overload
def trajectory_pairs(
    frames: _Frames, cutoff: Number, *, quantities: str, **options: Unpack[_FrameOptions]
) -> Generator[Arrays, None, None]: ...
def trajectory_pairs(
    frames: _Frames,
    cutoff: Number,
    *,
    skin: Number | Literal["auto"] | None = "auto",
    box: BoxLike | None = None,
    periodic: PeriodicLike | None = None,
    quantities: str = "ij",
    inclusive: bool = True,
    sort: bool = False,
    index_dtype: npt.DTypeLike = np.int64,
    kernel: str | None = None,
    threads: int | None = None,
    memory_limit: float | None = None,
    progress: Callable[[float], object] | bool | None = None,
    **unknown: Never,
) -> Generator[Any, None, None]:
    """Find the pairs of each frame of a trajectory, one frame after the other; always exact.

    Parameters
    ----------
    frames : iterable
        The frames, each of them points as in `pairs`, or a tuple of two, (points, box), or an
        object that brings its box: ``ase.Atoms``, a ``Timestep`` of MDAnalysis, an
        ``mdtraj.Trajectory`` of one frame. An array of shape (f, n, d) has f frames, and so do
        ``universe.trajectory`` and an ``mdtraj.Trajectory``. A generator is read one frame at
        a time. Frames may differ in their number of points and in their box.
    cutoff : float
        Largest distance of a pair, in the unit of the points; finite, not negative.
    skin : float, "auto" or None, default "auto"
        As in `VerletList`, which keeps a list from frame to frame; "auto" does so if that is
        faster, and always searches fewer than 1000 points. None: each frame is searched
        separately, for frames that have little in common.
    box, periodic : optional
        As in `pairs`, for all frames without a box, including a frame (points, None).
        `periodic` also holds for the boxes of frames, except objects with their own.
    quantities, inclusive, sort, index_dtype, kernel, memory_limit
        As in `pairs`, for each frame.
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
        For each frame what `pairs` returns, in new arrays: the same pairs
        and the same bits of d, D and S. Their order is that of `VerletList`; with `sort`, or
        if each frame is searched, that of `pairs`.

    Raises
    ------
    TypeError, ValueError, OverflowError, MemoryError
        For all arguments but the frames, as for `VerletList`, by the call itself. For a frame, as
        for `pairs`, when the iteration reaches it; a note names the frame, and the iteration
        ends. ValueError also if a frame brings its box and `box` is given.

    See Also
    --------
    VerletList : the same, with control over each step.
    pairs : one frame.

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
    if unknown:
        refuse_unknown(trajectory_pairs, unknown)
    check_letters(quantities)
    sort, index_dtype = as_flag(sort, "sort"), np.dtype(f"i{as_index_bytes(index_dtype)}")
    kept = VerletList(
        cutoff, 0.0 if skin is None else skin, box=box, periodic=None if box is None else periodic,
        inclusive=inclusive, kernel=kernel, threads=threads, memory_limit=memory_limit,
    )  # fmt: skip
    iterator, n_frames = frames_of(frames)
    told = as_progress(progress)
    if told is not None and n_frames is None:
        raise TypeError(f"progress needs frames that have a length, got {kind_of(frames)}")

    is_shared = skin is None and threads is not None and threads > 1

    def search(points: Any, own: Any, repeats: Any) -> Arrays:
        return pairs(
            points, kept.cutoff, box=own, periodic=repeats, quantities=quantities,
            inclusive=inclusive, sort=sort, index_dtype=index_dtype, kernel=kernel,
            threads=1 if is_shared else threads, memory_limit=memory_limit,
        )  # fmt: skip

    def follow(points: Any, own: Any, repeats: Any) -> Arrays:
        kept._given = own, repeats  # update() would take None as those before
        kept.update(points)
        return kept.pairs(quantities=quantities, sort=sort, index_dtype=index_dtype)

    def choose(points: Any, own: Any, repeats: Any) -> Arrays:
        is_small = isinstance(points, (np.ndarray, list)) and len(points) < _FEW_POINTS
        return (search if is_small else follow)(points, own, repeats)

    find = search if skin is None else choose if isinstance(skin, str) else follow
    if is_shared:
        from halfshell._functions.frames_ahead import search_ahead  # here: others do without

        assert threads is not None
        found = search_ahead(iterator, search, box, periodic, threads)
    else:
        found = _each(iterator, find, box, periodic)
    return found if told is None else _told(found, n_frames or 1, told)


def _each(
    frames: Iterator[Any], find: Callable[[Any, Any, Any], Arrays], box: Any, periodic: Any
) -> Generator[Any, None, None]:
    for number, frame in enumerate(frames):
        try:
            found = find(*as_frame(frame, box, periodic))
        except Exception as error:
            of_frame(error, number)
            shorten(error)
            raise
        yield found
        del found  # its memory is for the next frame, if it is nowhere else


def _told(
    results: Iterator[Any], n_frames: int, progress: Callable[[float], object]
) -> Generator[Any, None, None]:
    """The same, each after `progress` has been told."""
    for number, found in enumerate(results):
        progress(min((number + 1) / n_frames, 1.0))
        yield found
        del found
