# SPDX-License-Identifier: BSD-3-Clause
"""Frames that several threads search, one each at a time, handed out in their order."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np

from halfshell._convert.frames import as_frame, of_frame
from halfshell._convert.scene import as_scene
from halfshell._convert.types import Arrays

# Below them handing a frame to another thread takes longer than the search.
_WORTH_A_THREAD = 1000

_Scene = tuple[Any, Any, Any]  # points, box vectors and which of them repeat
Search = Callable[[Any, Any, Any], Arrays]


def search_ahead(
    frames: Iterator[Any], search: Search, box: Any, periodic: Any, n_threads: int
) -> Generator[Arrays, None, None]:
    """What `search` returns for each frame; an error has a note that says which one it was for.

    As many frames as there are threads are read ahead and copied, as a reader may hand out the same
    object each time. Where the frames are small all is done by the caller's thread.
    """
    number = 0
    waiting: deque[tuple[_Scene, Future[Arrays]]] = deque()
    process, pool = os.getpid(), ThreadPoolExecutor(n_threads)

    def ask_again() -> None:
        """In a child: threads are gone, and frames that they searched are searched anew."""
        nonlocal process, pool, waiting
        if process != os.getpid():
            process, pool = os.getpid(), ThreadPoolExecutor(n_threads)
            waiting = deque((scene, pool.submit(search, *scene)) for scene, _ in waiting)

    def hand_out(most: int) -> Generator[Arrays, None, None]:
        """The results of the frames that came first, until at most so many wait."""
        nonlocal number
        while len(waiting) > most:
            ask_again()
            future = waiting.popleft()[1]
            try:
                found = future.result()
            except Exception as error:
                of_frame(error, number)
                raise
            del future  # its memory is the caller's
            number += 1
            yield found

    try:
        for frame in frames:
            try:
                scene = _own(as_frame(frame, box, periodic))
            except Exception as error:
                yield from hand_out(0)  # the frames before it come first
                of_frame(error, number)
                raise
            ask_again()
            if len(scene[0]) >= _WORTH_A_THREAD:
                waiting.append((scene, pool.submit(search, *scene)))
                yield from hand_out(n_threads)
            else:
                yield from hand_out(0)
                waiting.append((scene, _done(search, scene)))
                yield from hand_out(0)
        yield from hand_out(0)
    finally:
        if process == os.getpid():
            pool.shutdown(cancel_futures=True)


def _own(frame: Any) -> _Scene:
    """Copies of the points, and of the box if there is one, and which of its vectors repeat."""
    points, vectors, bits = as_scene(*frame)
    if vectors is None:
        return points.copy(), None, None
    return points.copy(), np.array(vectors), [bool(bits >> k & 1) for k in range(len(vectors))]


def _done(search: Search, scene: _Scene) -> Future[Arrays]:
    """The search of a frame by this thread."""
    future: Future[Arrays] = Future()
    try:
        future.set_result(search(*scene))
    except Exception as error:
        future.set_exception(error)
    return future
