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

_TURN = 2e-3  # seconds that a turn lasts at least, so that short calls are made often
_MOST = 100  # calls in a turn


@dataclass(frozen=True)
class Patience:
    """How often a call is timed at most, and how long that may take, in seconds."""

    repeats: int = 7
    seconds: float = 2.0


@dataclass(frozen=True)
class Timing:
    """Seconds of one call: median and least over all calls, each timed by itself."""

    median: float
    least: float
    repeats: int


def take_turns(calls: Mapping[str, Callable[[], Any]], patience: Patience) -> dict[str, Timing]:
    """Time calls against each other; results are dropped.

    Every call gets at least one turn, and no further one once `patience.seconds` for each call
    are over.
    """
    order = random.Random(0)
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    begin = time.perf_counter()
    for turn in range(patience.repeats):
        names = list(calls)
        order.shuffle(names)
        for name in names:
            if turn and time.perf_counter() - begin > patience.seconds * len(calls):
                continue
            seconds[name] += _one_turn(calls[name])
    return {name: Timing(median(some), min(some), len(some)) for name, some in seconds.items()}


def _one_turn(call: Callable[[], Any]) -> list[float]:
    """Seconds of each of some calls, without the garbage collector."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        spent: list[float] = []
        while sum(spent) < _TURN and len(spent) < _MOST:
            start = time.perf_counter()
            call()
            spent.append(time.perf_counter() - start)
        return spent
    finally:
        if was_on:
            gc.enable()
