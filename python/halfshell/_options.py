# SPDX-License-Identifier: BSD-3-Clause
"""Options that all searches share: their types, and the kernels that there are."""

from __future__ import annotations

from typing import Any, Literal, TypedDict

from halfshell import _core

Precision = Literal["exact", "double", "single"]


class SearchOptions(TypedDict, total=False):
    """For type checkers: the keywords that all searches share."""

    box: Any
    periodic: Any
    inclusive: bool
    precision: Precision
    kernel: str | None
    threads: int | None
    memory_limit: float | None


def kernels() -> list[str]:
    """Names of the kernels that this CPU can run, the best one first.

    Examples
    --------
    >>> import halfshell as hs
    >>> "scalar" in hs.kernels()
    True
    """
    return list(_core.kernels())
