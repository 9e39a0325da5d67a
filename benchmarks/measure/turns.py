# SPDX-License-Identifier: BSD-3-Clause
"""Timing several calls against each other without favouring one.

The calls take turns in an order drawn anew for each round, so that a slow spell of the
machine hits all of them. Short calls are repeated within a turn. Every call is timed twice:

fresh
    all results are kept until the end, so that each new one needs new memory;
recycled
    each result is dropped at once, so that its memory may be used again.
"""

from __future__ import annotations

import gc
import random
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import numpy as np

from halfshell import _core
from measure.machine import touch_memory

__all__ = ["Timing", "Turn", "bytes_held", "plan_turn", "single_calls", "take_turns"]

# A turn of short calls lasts about this long; timers and interrupts then do not show.
TURN_SECONDS = 0.01


@dataclass(frozen=True)
class Turn:
    """A call and how often it is made."""

    call: Callable[[], Any]
    calls: int = 1  # in one turn
    repeats: int = 7  # turns
    n_bytes: int = 0  # of all results of one turn


@dataclass
class Timing:
    """Seconds for one call, from each turn."""

    seconds: list[float] = field(default_factory=list)
    all_held: bool = True  # whether no result was dropped before the end of a fresh run

    @property
    def median(self) -> float:
        """Median over the turns."""
        return median(self.seconds)

    @property
    def minimum(self) -> float:
        """Fastest turn."""
        return min(self.seconds)


def plan_turn(call: Callable[[], Any], repeats: int, patience: float) -> Turn:
    """Find how often to make a call.

    A call that would take longer than `patience` seconds over all turns gets fewer of them.
    """
    for calls in (1, 10):  # the first is for the caches
        start = time.perf_counter()
        for _ in range(calls):
            result = call()
        seconds = (time.perf_counter() - start) / calls
        if seconds > TURN_SECONDS:
            break
    calls = max(1, min(10_000, int(TURN_SECONDS / max(seconds, 1e-9))))
    affordable = int(patience / (2.0 * seconds * calls))
    return Turn(call, calls, max(1, min(repeats, affordable)), calls * bytes_held(result))


def bytes_held(result: Any) -> int:
    """Return the bytes of the arrays in a result."""
    if isinstance(result, np.ndarray):
        return int(result.nbytes)
    if isinstance(result, dict):
        result = list(result.values())
    if isinstance(result, (list, tuple)):
        return sum(bytes_held(part) for part in result)
    # Other objects: a list of index pairs in 32-bit numbers, or a mere number.
    return 8 * len(result) if hasattr(result, "__len__") else 0


def take_turns(turns: Mapping[str, Turn], keep: bool, budget: int = 1 << 30, seed: int = 1,
               yields: tuple[str, ...] = (),
               dropped: Callable[[], None] = lambda: None) -> dict[str, Timing]:  # fmt: skip
    """Time calls against each other.

    Parameters
    ----------
    turns : mapping of str to Turn
    keep : bool
        Whether results are held to the end ("fresh") or dropped at once ("recycled").
    budget : int
        Bytes of results to hold. When they are more, the oldest are dropped, and the
        `Timing` of their owner says so.
    yields : tuple of str
        Whose results are dropped last.
    dropped : callable
        Called after results were dropped, so that their memory is not used again.

    Returns
    -------
    dict of str to Timing
    """
    order = random.Random(seed)
    timings = {name: Timing() for name in turns}
    last_resort = set(yields)
    held: dict[bool, deque[tuple[str, int, Any]]] = {False: deque(), True: deque()}
    n_held = 0
    for turn_number in range(max((turn.repeats for turn in turns.values()), default=0)):
        names = [name for name, turn in turns.items() if turn.repeats > turn_number]
        order.shuffle(names)
        for name in names:
            if keep:
                # A virtual machine hands pages that lie idle back to its host; the search and
                # its result must find theirs in place.
                touch_memory(min(3 * turns[name].n_bytes, int(_core.available_memory()) // 2))
            seconds, results = _time(turns[name], keep)
            timings[name].seconds.append(seconds)
            if not keep:
                continue
            size = bytes_held(results)
            held[name in last_resort].append((name, size, results))
            n_held += size
            del results
            too_many = n_held > budget
            while n_held > budget and (held[False] or held[True]):
                oldest = held[False] or held[True]
                owner, size = oldest.popleft()[:2]
                timings[owner].all_held = False
                n_held -= size
            if too_many:
                dropped()
    return timings


def single_calls(
    calls: Mapping[str, Callable[[], Any]], samples: int = 2000, patience: float = 2.0,
    seed: int = 1,
) -> dict[str, tuple[float, float]]:  # fmt: skip
    """Time short calls one by one, taking turns, each result dropped at once.

    What the clock itself takes, some 50 ns, is part of each figure.

    Returns
    -------
    dict of str to (float, float)
        Median and 99th percentile of the seconds of one call. Fewer than `samples` are taken
        where `patience` seconds for each contestant do not suffice.
    """
    order = random.Random(seed)
    names = list(calls)
    seconds: dict[str, list[float]] = {name: [] for name in names}
    clock = time.perf_counter
    end = clock() + patience * len(names)
    gc.collect()
    gc.disable()
    try:
        for _ in range(samples):
            order.shuffle(names)
            for name in names:
                call = calls[name]
                start = clock()
                call()
                seconds[name].append(clock() - start)
            if clock() > end:
                break
    finally:
        gc.enable()
    return {
        name: (median(taken), float(np.percentile(taken, 99))) for name, taken in seconds.items()
    }


def _time(turn: Turn, keep: bool) -> tuple[float, list[Any]]:
    """Time one turn; return the seconds of one call and what is to be held."""
    call, rounds = turn.call, range(turn.calls)
    results: list[Any] = []
    gc.collect()
    gc.disable()
    try:
        if keep:
            start = time.perf_counter()
            results = [call() for _ in rounds]
            end = time.perf_counter()
        else:
            start = time.perf_counter()
            for _ in rounds:
                call()
            end = time.perf_counter()
    finally:
        gc.enable()
    return (end - start) / turn.calls, results
