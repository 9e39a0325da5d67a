# SPDX-License-Identifier: BSD-3-Clause
"""What users give for a reach of each pair, before it is looked at, and whose it is."""

from __future__ import annotations

from typing import Any, NamedTuple


class Given(NamedTuple):
    """What users say of the reach of each pair."""

    radii: Any = None
    query_radii: Any = None
    rule: Any = None
    types: Any = None
    query_types: Any = None
    supports: Any = None
    query_supports: Any = None
    extent: Any = None

    @property
    def is_nothing(self) -> bool:
        return all(value is None for value in self)


class Sets(NamedTuple):
    """Points and queries as they were given, and how many there are; without queries q is None."""

    points: Any
    queries: Any
    n: int
    q: int | None
    ndim: int
