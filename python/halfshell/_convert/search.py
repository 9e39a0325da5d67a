# SPDX-License-Identifier: BSD-3-Clause
"""The arguments that every search begins with, brought to what the core takes."""

from __future__ import annotations

from typing import Any, cast

from halfshell._convert.arrays import PointArray
from halfshell._convert.lengths import as_cutoff
from halfshell._convert.options import as_flag
from halfshell._convert.scene import as_sets
from halfshell._convert.types import Precision, Progress, Rest, Search


def as_search(
    points: Any,
    cutoff: Any,
    box: Any,
    periodic: Any,
    inclusive: Any,
    precision: Precision,
    kernel: str | None,
    memory_limit: float | None,
    progress: Any,
    threads: int | None,
    queries: Any = None,
) -> tuple[Search, PointArray | None]:
    """The first ten arguments of the core, and the queries or None."""
    asking, array, vectors, bits = as_sets(queries, points, box, periodic)
    rest = as_rest(inclusive, precision, kernel, memory_limit, progress, threads)
    return (array, as_cutoff(cutoff), vectors, bits, *rest), asking


def as_rest(
    inclusive: Any,
    precision: Precision,
    kernel: str | None,
    memory_limit: float | None,
    progress: Any,
    threads: int | None,
) -> Rest:
    """Those that say how to search. What is not converted here the core checks."""
    return (
        as_flag(inclusive, "inclusive"), precision, kernel, memory_limit, _as_progress(progress),
        threads,
    )  # fmt: skip


def _as_progress(progress: Any) -> Progress:
    """What can be called, or None."""
    if progress is None or callable(progress):
        return cast(Progress, progress)
    raise TypeError(f"progress must be callable, got {type(progress).__name__}")
