# SPDX-License-Identifier: BSD-3-Clause
"""Our own search, as it can be asked for: three precisions, and points rounded to float32."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import halfshell as hs
from halfshell_report.truth.answer import Answer

__all__ = ["METHODS", "PRECISIONS", "REUSE", "answer_of", "calls_of", "options_of"]

#: precision= of `halfshell.pairs`.
PRECISIONS = ("exact", "double", "single")
#: Ways to keep one list for several steps: rebuilt in time, or by the clock.
REUSE = ("verlet", "stale")
#: Every method that can be asked for by name.
METHODS = (*PRECISIONS, "float32", *REUSE)

# Rounding a scene's coordinates may collapse it: then all points are pairs of each other, and
# a list that passes this is no longer an answer to the question.
_MOST_BYTES = 4e9


def options_of(method: str, scene: Any) -> dict[str, Any]:
    """Return the arguments of `halfshell.pairs` for a method and a scene.

    Raises ValueError if the method would change nothing, or the points do not fit float32.
    """
    points = scene.points
    if method == "float32":
        if points.dtype == np.float32:
            raise ValueError("the points are float32 as they are")
        with np.errstate(over="ignore", under="ignore"):
            points = points.astype(np.float32)
        if not np.isfinite(points).all():
            raise ValueError("coordinates beyond the range of float32")
    reach: dict[str, Any] = scene.reach
    return reach | {
        "points": points,
        "cutoff": scene.cutoff,
        "box": scene.box,
        "periodic": scene.periodic if scene.box is not None else None,
        "inclusive": scene.inclusive,
        "precision": method if method in PRECISIONS else "exact",
        "threads": 1,
        "memory_limit": _MOST_BYTES,
    }


def answer_of(options: dict[str, Any]) -> Answer:
    """Ask for everything."""
    i, j, d, D, S = hs.pairs(**options, quantities="ijdDS")
    return Answer(i, j, S, d, D, inclusive=options["inclusive"])


def calls_of(options: dict[str, Any]) -> dict[str, Callable[[], Any]]:
    """Return the calls to be timed: i and j alone, and with d and D."""
    return {
        "ij": partial(hs.pairs, **options),
        "with_d": partial(hs.pairs, **options, quantities="ijdD"),
    }
