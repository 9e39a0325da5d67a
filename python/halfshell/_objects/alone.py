# SPDX-License-Identifier: BSD-3-Clause
"""One call of an object at a time, also in a child that was forked off in the middle of one."""

from __future__ import annotations

import os
import threading
import weakref

__all__ = ["Alone", "Owner"]

_OWNERS: weakref.WeakSet[Owner] = weakref.WeakSet()


class Owner:
    """What has a lock, and knows which thread is in a call."""

    _lock: threading.RLock
    _caller: int  # 0: none

    def _make_lock(self) -> None:
        self._lock, self._caller = threading.RLock(), 0
        _OWNERS.add(self)

    def _interrupted(self) -> None:
        """In a child: another thread was in a call, and may have left anything half done."""
        raise NotImplementedError


class Alone:
    """One call at a time: other threads wait, a call from within a call is an error."""

    def __init__(self, owner: Owner) -> None:
        self._owner = owner
        self._lock = owner._lock  # which a fork may replace meanwhile

    def __enter__(self) -> None:
        owner = self._owner
        self._lock.acquire()
        if owner._caller:  # a signal handler, called while the core looks for signals
            self._lock.release()
            raise RuntimeError(f"this {type(owner).__name__} is in the middle of another call")
        owner._caller = threading.get_ident()

    def __exit__(self, *ignored: object) -> None:
        self._owner._caller = 0
        self._lock.release()


def _renew() -> None:
    """In a child: there is one thread, which may be in a call; others left their locks taken."""
    for owner in list(_OWNERS):
        caller = owner._caller
        if caller != threading.get_ident():
            owner._make_lock()
            if caller:
                owner._interrupted()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew)
