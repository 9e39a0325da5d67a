# SPDX-License-Identifier: BSD-3-Clause
"""One call of an object at a time."""

from __future__ import annotations

import threading
from typing import Protocol

__all__ = ["Alone"]


class Owner(Protocol):
    """What has a lock, and knows whether it is in a call."""

    _lock: threading.RLock
    _is_busy: bool


class Alone:
    """One call at a time: other threads wait, a call from within a call is an error."""

    def __init__(self, owner: Owner) -> None:
        self._owner = owner

    def __enter__(self) -> None:
        owner = self._owner
        owner._lock.acquire()
        if owner._is_busy:  # a signal handler, called while the core looks for signals
            owner._lock.release()
            raise RuntimeError(f"this {type(owner).__name__} is in the middle of another call")
        owner._is_busy = True

    def __exit__(self, *ignored: object) -> None:
        self._owner._is_busy = False
        self._owner._lock.release()
