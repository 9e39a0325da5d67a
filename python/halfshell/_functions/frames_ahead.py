# SPDX-License-Identifier: BSD-3-Clause
"""Frames that several threads search, one each at a time, handed out in their order."""

from __future__ import annotations

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

Search = Callable[[Any, Any, Any], Arrays]


def search_ahead(
    frames: Iterator[Any], search: Search, box: Any, periodic: Any, n_threads: int
) -> Generator[Arrays, None, None]:
    """What `search` returns for each frame; an error has a note that says which one it was for.

    As many frames as there are threads are read ahead and copied, as a reader may hand out the same
    object each time. Where the frames are small all is done by the caller's thread.
    """
    number = 0
    waiting: deque[Future[Arrays]] = deque()
    with ThreadPoolExecutor(n_threads) as pool:
        try:
            for frame in frames:
                try:
                    scene = _own(as_frame(frame, box, periodic))
                except Exception as error:
                    for future in waiting:  # the frames before it come first
                        number = yield from _hand_out(future, number)
                    of_frame(error, number)
                    raise
                if len(scene[0]) >= _WORTH_A_THREAD:
                    waiting.append(pool.submit(search, *scene))
                    if len(waiting) > n_threads:
                        number = yield from _hand_out(waiting.popleft(), number)
                    continue
                while waiting:
                    number = yield from _hand_out(waiting.popleft(), number)
                number = yield from _hand_out(_done(search, scene), number)
            while waiting:
                number = yield from _hand_out(waiting.popleft(), number)
        finally:
            pool.shutdown(cancel_futures=True)


def _own(frame: Any) -> tuple[Any, Any, Any]:
    """Copies of the points, and of the box if there is one, and which of its vectors repeat."""
    points, vectors, bits = as_scene(*frame)
    if vectors is None:
        return points.copy(), None, None
    return points.copy(), np.array(vectors), [bool(bits >> k & 1) for k in range(len(vectors))]


def _done(search: Search, scene: tuple[Any, Any, Any]) -> Future[Arrays]:
    """The search of a frame by this thread."""
    future: Future[Arrays] = Future()
    try:
        future.set_result(search(*scene))
    except Exception as error:
        future.set_exception(error)
    return future


def _hand_out(future: Future[Arrays], number: int) -> Generator[Arrays, None, int]:
    """The result of frame `number`; the number of the next."""
    try:
        found = future.result()
    except Exception as error:
        of_frame(error, number)
        raise
    del future  # its memory is the caller's
    yield found
    return number + 1
