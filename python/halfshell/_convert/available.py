# SPDX-License-Identifier: BSD-3-Clause
"""Memory that is there for arrays that Python makes; the core looks after its own."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt

from halfshell import _core

_SMALL = 1 << 26  # bytes; what is left is not asked for below


def refuse_unavailable(needed: int, what: str) -> None:
    """MemoryError before results that would make the machine swap, or fit no address space."""
    if needed > _SMALL and needed > _core.available_memory():
        raise MemoryError(f"{what} would take {gigabytes(needed)} GB, more than there is")


def gigabytes(n_bytes: int) -> str:
    """For a message; also for numbers that are no float64."""
    return f"{n_bytes / 1e9:.3g}" if n_bytes < 2**1000 else "more than 1e+290"


def refuse_large(needed: int, array: npt.NDArray[Any], name: str) -> None:
    """MemoryError before a copy that would make the machine swap: views may be huge."""
    refuse_unavailable(needed, f"{name} of shape {array.shape} and dtype {array.dtype}, copied,")
