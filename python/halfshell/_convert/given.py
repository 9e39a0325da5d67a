# SPDX-License-Identifier: BSD-3-Clause
"""What users give for a reach of each pair, and for which pairs count, before it is looked at."""

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


class Chosen(NamedTuple):
    """What users say of which pairs count."""

    groups: Any = None
    exclude: Any = None
    exclude_within: Any = None
    min_distance: Any = None
    query_groups: Any = None
    query_exclude: Any = None

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
