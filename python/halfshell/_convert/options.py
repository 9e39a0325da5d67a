# SPDX-License-Identifier: BSD-3-Clause
"""Options that all searches share: their types, and the kernels that there are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypedDict

import numpy as np
import numpy.typing as npt

from halfshell import _core

Precision = Literal["exact", "double", "single"]


Progress = Callable[[float], object] | None

# What the core takes from `inclusive` to `threads`.
Rest = tuple[bool, Precision, str | None, float | None, Progress, int | None]

# The first arguments of all its searches: points, cutoff, box and periodic before these, or cells
# in place of points and box.
Search = tuple[
    Any, float, npt.NDArray[np.float64] | None, int,
    bool, Precision, str | None, float | None, Progress, int | None,
]  # fmt: skip


class SearchOptions(TypedDict, total=False):
    """For type checkers: the keywords that all searches share."""

    box: Any
    periodic: Any
    inclusive: bool
    precision: Precision
    kernel: str | None
    threads: int | None
    memory_limit: float | None


class ArrayOptions(SearchOptions, total=False):
    """The same, and those of functions that return arrays of pairs, without `quantities`."""

    sort: bool
    index_dtype: npt.DTypeLike
    out: Any


def kernels() -> list[str]:
    """Names of the kernels that this CPU can run, the best one first.

    Examples
    --------
    >>> import halfshell as hs
    >>> "scalar" in hs.kernels()
    True
    """
    return list(_core.kernels())
