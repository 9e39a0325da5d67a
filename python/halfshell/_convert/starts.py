# SPDX-License-Identifier: BSD-3-Clause
"""Where the parts of an array begin, from their lengths."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt


def starts_of(lengths: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Where each part begins, and at last where all of them end: one number more than parts. A
    mask counts as parts of length 1 and 0."""
    starts = np.zeros(len(lengths) + 1, np.int64)
    np.cumsum(lengths, out=starts[1:])
    return starts
