# SPDX-License-Identifier: BSD-3-Clause
"""`capacity` and `on_overflow`: results of a fixed length, as the core takes them."""

from __future__ import annotations

from typing import Any

from halfshell._convert.options import as_choice, as_count

#: What the default is itself needs no conversion.
RAISE = "raise"

_MOST = 2**62  # beyond what any machine holds, and within int64


def as_room(capacity: Any, on_overflow: Any, out: Any = None) -> int | None:
    """The length of the arrays, negative where the need is returned; None for as many as needed."""
    flags = as_choice(on_overflow, "on_overflow", (RAISE, "flag")) == "flag"
    if capacity is None:
        if flags:
            raise ValueError("on_overflow='flag' needs a capacity")
        return None
    length = min(as_count(capacity, "capacity"), _MOST)
    if out is not None:
        raise ValueError("capacity and out are two ways to say where the result goes: give one")
    return -length if flags else length
