# SPDX-License-Identifier: BSD-3-Clause
"""Rules by which two radii or supports make the reach of a pair; reaches as the core takes them.

A reach is the tuple ``types.Reach``, which is put together here only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from halfshell._convert.types import FloatArray, Reach

#: In the order of the core, which knows them by number.
RULES = ("sum", "mean", "max", "min", "gather", "scatter")
#: Those by which i may reach j, and j not i.
DIRECTED = ("gather", "scatter")
#: Supports do not add up.
RULES_OF_SUPPORTS = ("max", "min", *DIRECTED)


def reach_by_radii(
    rule: str, radii: FloatArray | None, query_radii: FloatArray | None,
    extent: float | None = None,
) -> Reach:  # fmt: skip
    """Of radii that are known to be right. extent: how many times they count, once if None."""
    return RULES.index(rule), radii, query_radii, None, None, None, None, None, extent


def reach_by_supports(
    rule: str, supports: FloatArray | None, query_supports: FloatArray | None, extent: float
) -> Reach:
    """Of supports whose shapes and entries are known to be right."""
    return RULES.index(rule), None, None, None, None, None, supports, query_supports, extent


def reach_by_types(types: Any, query_types: Any, cutoffs: FloatArray) -> Reach:
    """Of types that are known to be rows of this table; the core needs no rule."""
    return 0, None, None, types, query_types, cutoffs, None, None, None
