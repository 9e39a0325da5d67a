# SPDX-License-Identifier: BSD-3-Clause
"""The arguments that every search begins with, brought to what the core takes."""

from __future__ import annotations

from typing import Any

from halfshell._convert.arrays import PointArray
from halfshell._convert.lengths import as_cutoff
from halfshell._convert.options import as_flag
from halfshell._convert.scene import as_sets
from halfshell._convert.types import Precision, Rest, Search


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
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be callable, got {type(progress).__name__}")
    return as_flag(inclusive, "inclusive"), precision, kernel, memory_limit, progress, threads
