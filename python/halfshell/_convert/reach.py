# SPDX-License-Identifier: BSD-3-Clause
"""A reach for each pair of points, by their radii, types or supports, as the core takes it.

Rules, radii, types and tables are settled here: the core checks again only that no number can harm
it, for arrays may change meanwhile. Supports are settled in ``supports.py``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from halfshell._convert.arrays import as_real_array, in_order, one_each
from halfshell._convert.foreign import is_a
from halfshell._convert.lengths import as_cutoff, check_lengths
from halfshell._convert.marks import as_types
from halfshell._convert.memory import refuse_large
from halfshell._convert.options import as_choice
from halfshell._convert.rules import (
    DIRECTED,
    RULES,
    reach_by_radii,
    reach_by_supports,
    reach_by_types,
)
from halfshell._convert.species import types_of_species
from halfshell._convert.supports import as_supports

if TYPE_CHECKING:
    from halfshell._convert.given import Given, Sets
    from halfshell._convert.types import FloatArray, Reach

_LARGEST = 2.0**1022  # sums of two are finite
_LEAST_HALVED = 2.0**-1021  # halves lose no bit


def as_reach(cutoff: Any, given: Given, sets: Sets, directed: bool) -> tuple[float, Reach]:
    """The largest distance of any pair, or infinity, and the reach of each.

    For a cutoff that is a dict, or where something else is given. directed: the result has a
    direction, so that rules may have one.
    """
    check_alone_given(given)
    if given.supports is not None or given.query_supports is not None or given.extent is not None:
        return _by_supports(cutoff, given, sets, directed)
    if given.radii is not None or given.query_radii is not None:
        return _by_radii(cutoff, given, sets, directed)
    if given.rule is not None:
        raise ValueError("rule needs radii or supports")
    if given.query_types is not None and sets.q is None:
        raise ValueError("query_types needs queries")
    if is_a(cutoff, Mapping):
        types, query_types, table = types_of_species(cutoff, given, sets)
    else:
        table = _as_table(cutoff)
        types, query_types = _as_numbers(given, sets, len(table))
    if len(table) == 0:
        table = np.full((1, 1), -1.0)  # of no points: the core wants one type at least
    largest = max(float(table.max(initial=0.0)), 0.0)
    return largest, reach_by_types(types, query_types, table)


def check_alone_given(given: Given) -> None:
    """ValueError where several things say how far pairs reach."""
    said = [
        name
        for name, values in (
            ("radii", (given.radii, given.query_radii)),
            ("types", (given.types, given.query_types)),
            ("supports", (given.supports, given.query_supports, given.extent)),
        )
        if any(value is not None for value in values)
    ]
    if len(said) > 1:
        raise ValueError(f"{said[0]} and {said[1]} cannot be given together")


def _check_direction(rule: str, directed: bool) -> None:
    if rule in DIRECTED and not directed:
        raise ValueError(
            f"rule {rule!r} has a direction, and these pairs have none: use neighbors, which has a "
            "row for each point"
        )


def _as_bound(cutoff: Any) -> float:
    """A further limit; infinity for None."""
    bound = math.inf if cutoff is None else as_cutoff(cutoff)
    if cutoff is not None and not math.isfinite(bound):
        raise ValueError(f"cutoff must be finite and not negative, or None, got {bound}")
    return bound


# ---- radii and supports --------------------------------------------------------------------


def _by_supports(
    cutoff: Any, given: Given, sets: Sets, directed: bool
) -> tuple[float, Reach]:
    rule, own, asking, extent = as_supports(given, sets)
    _check_direction(rule, directed)
    _check_sides(rule, given, sets.q is not None, "supports")
    return _as_bound(cutoff), reach_by_supports(rule, own, asking, extent)


def _by_radii(
    cutoff: Any, given: Given, sets: Sets, directed: bool
) -> tuple[float, Reach]:
    rule = "sum" if given.rule is None else as_choice(given.rule, "rule", RULES)
    _check_direction(rule, directed)
    _check_sides(rule, given, sets.q is not None, "radii")
    bound = _as_bound(cutoff)
    own = None if given.radii is None else _as_radii(given.radii, "radii", sets.n, rule)
    asking = None
    if given.query_radii is not None and sets.q is not None:
        asking = _as_radii(given.query_radii, "query_radii", sets.q, rule)
    return bound, reach_by_radii(rule, own, asking)


def _check_sides(rule: str, given: Given, has_queries: bool, what: str) -> None:
    """ValueError unless those that the rule needs are given, and no others; what: radii, or ..."""
    of_queries = f"query_{what}"
    if not has_queries:
        if getattr(given, of_queries) is not None:
            raise ValueError(f"{of_queries} needs queries")
        return
    needed = {"gather": (of_queries,), "scatter": (what,)}.get(rule, (what, of_queries))
    for name in (what, of_queries):
        if (name in needed) == (getattr(given, name) is not None):
            continue
        if len(needed) == 2:
            raise ValueError(f"with queries, {what} and {of_queries} must be given together")
        raise ValueError(f"rule {rule!r} goes by {needed[0]} alone, with queries: give no others")


def _as_radii(values: Any, name: str, n: int, rule: str) -> FloatArray:
    array = as_real_array(values, name, check_shape=one_each(name, n))
    if array.dtype != np.float64:
        refuse_large(8 * array.size, array, name)
    radii = in_order(array, np.float64)
    least, largest = (float(radii.min()), float(radii.max())) if n > 0 else (1.0, 1.0)
    if not (least >= 0.0 and largest <= _LARGEST):
        _refuse_lengths(radii, name)
    if rule == "mean" and least < _LEAST_HALVED:
        _refuse_halves(radii, name)
    return radii


def _refuse_lengths(radii: FloatArray, name: str) -> None:
    check_lengths(radii, name)
    for k in np.flatnonzero(radii > _LARGEST):
        raise ValueError(f"{name} must be at most 2**1022, got {name}[{k}] = {radii[k]}")


def _refuse_halves(radii: FloatArray, name: str) -> None:
    for k in np.flatnonzero((radii > 0.0) & (radii < _LEAST_HALVED)):
        raise ValueError(
            f"{name} must be 0 or at least 2**-1021 for the rule 'mean', got {name}[{k}] = "
            f"{radii[k]}"
        )


# ---- types ---------------------------------------------------------------------------------


def _as_table(values: Any) -> FloatArray:
    """A cutoff for each pair of types: symmetric, finite, not negative."""
    must = "have shape (t, t), one for each pair of types, or be a dict"

    def check(shape: tuple[int, ...]) -> None:
        if len(shape) != 2 or shape[0] != shape[1]:
            raise ValueError(f"with types, cutoff must {must}, got shape {shape}")

    array = as_real_array(values, "cutoff", f"{must}, with types", check)
    refuse_large(8 * array.size, array, "cutoff")
    table = in_order(array, np.float64)
    for a, b in np.argwhere(~(np.isfinite(table) & (table >= 0.0))):
        raise ValueError(
            f"cutoff must be finite and not negative, got cutoff[{a}, {b}] = {table[a, b]}"
        )
    for a, b in np.argwhere(table != table.T):
        raise ValueError(
            f"cutoff must be symmetric, got cutoff[{a}, {b}] = {table[a, b]} and "
            f"cutoff[{b}, {a}] = {table[b, a]}"
        )
    return table


def _as_numbers(given: Given, sets: Sets, n_types: int) -> tuple[Any, Any]:
    """Types of points and of queries, each a row of the table."""
    found: list[Any] = []
    for name, n in (("types", sets.n), ("query_types", sets.q)):
        if n is None:
            found.append(None)
            continue
        values = getattr(given, name)
        if values is None:
            raise ValueError(f"{name} must be given with a table of cutoffs")
        types = as_types(values, name, n)
        for k in np.flatnonzero(types >= n_types):
            raise ValueError(
                f"{name} must be less than {n_types}, the types that cutoff is given for, got "
                f"{name}[{k}] = {types[k]}"
            )
        found.append(in_order(types, np.int32))
    return found[0], found[1]
