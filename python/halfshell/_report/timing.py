# SPDX-License-Identifier: BSD-3-Clause
"""Run time of calls, taking turns so that a slow spell of the machine hits all of them."""

from __future__ import annotations

import gc
import random
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import median
from typing import Any

__all__ = ["Patience", "Timing", "take_turns"]

_TURN = 2e-3  # seconds that a turn lasts at least: timers and interrupts then hardly show


@dataclass(frozen=True)
class Patience:
    """How often a call is timed at most, and how long that may take, in seconds."""

    repeats: int = 7
    seconds: float = 2.0


@dataclass(frozen=True)
class Timing:
    """Seconds of one call: median and least over the turns."""

    median: float
    least: float
    repeats: int


def take_turns(
    calls: Mapping[str, Callable[[], Any]], patience: Patience
) -> dict[str, Timing]:
    """Time calls against each other; each has been made before, and its result is dropped.

    Every call gets at least one turn, and no further one once `patience.seconds` are over.
    """
    order = random.Random(0)
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    often: dict[str, int] = {}
    begin = time.perf_counter()
    for turn in range(patience.repeats):
        names = list(calls)
        order.shuffle(names)
        for name in names:
            if turn and time.perf_counter() - begin > patience.seconds * len(calls):
                continue
            if name not in often:
                often[name] = max(1, min(1000, int(_TURN / max(_once(calls[name]), 1e-7))))
            seconds[name].append(_several(calls[name], often[name]))
    return {name: Timing(median(some), min(some), len(some)) for name, some in seconds.items()}


def _once(call: Callable[[], Any]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def _several(call: Callable[[], Any], times: int) -> float:
    """Seconds for one call, without the garbage collector."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        start = time.perf_counter()
        for _ in range(times):
            call()
        return (time.perf_counter() - start) / times
    finally:
        if was_on:
            gc.enable()
