# SPDX-License-Identifier: BSD-3-Clause
"""Calls with all that they depend on as flat options, for tests that go through many of them."""

from typing import Any

import numpy as np

import halfshell as hs

#: What is known of each point, not of a call.
FIELDS = ("radii", "types", "supports", "groups", "labels", "weights", "batch")
SETTINGS = ("kernel", "algorithm", "precision", "memory_limit")


def call(function: Any, *arguments: Any, **options: Any) -> Any:
    """function(*arguments, **options), with fields of `Points` and settings among the options.

    ``query_radii`` and so on are those of the queries, ``extent`` is the cutoff of supports, labels
    may be given as ``exclude``, and histograms with types are by type. The points are the first
    argument, or, of `pairs_between`, the second.
    """
    how = {name: options.pop(name) for name in SETTINGS if name in options}
    given = list(arguments)
    if "extent" in options:  # the cutoff of supports
        _put(given, options, "cutoff", 2 if function is hs.pairs_between else 1)
    within = options.pop("exclude_within", None)
    if np.ndim(options.get("exclude", 0)) == 1:  # labels, and by how much they may differ
        options["labels"] = options["exclude"]
        options["exclude"] = 0 if within is None else within
    if "query_exclude" in options:
        options["query_labels"] = options.pop("query_exclude")
    if options.get("types") is not None and function in (hs.rdf, hs.pair_histogram):
        options.setdefault("by_type", True)
    known = {name: options.pop(name) for name in FIELDS if name in options}
    asking = {name: options.pop(f"query_{name}", None) for name in FIELDS}
    asking = {name: values for name, values in asking.items() if values is not None}
    if any(values is not None for values in known.values()):
        box = {name: options.pop(name) for name in ("box", "periodic") if name in options}
        _enrich(given, options, "points", int(function is hs.pairs_between), {**known, **box})
    if asking:
        _enrich(given, options, "queries", 0 if function is hs.pairs_between else None, asking)
    if not how:
        return function(*given, **options)
    with hs.settings(**how):
        return function(*given, **options)


def with_fields(points: Any, **fields: Any) -> hs.Points:
    """The points, with what else is known of them."""
    if isinstance(points, hs.Points):
        return points.replace(**fields)
    return hs.Points(points, **fields)


def _enrich(
    given: list[Any], options: dict[str, Any], name: str, place: int | None, fields: dict[str, Any]
) -> None:
    """Put points with these fields where the argument of this name is."""
    if name in options:
        options[name] = with_fields(options[name], **fields)
    else:
        assert place is not None
        given[place] = with_fields(given[place], **fields)


def _put(given: list[Any], options: dict[str, Any], name: str, place: int) -> None:
    """The extent as the cutoff, wherever that is given."""
    extent = options.pop("extent")
    if extent is None:
        return
    if len(given) > place:
        assert given[place] is None, "supports have no further cutoff"
        given[place] = extent
    else:
        assert options.get(name) is None, "supports have no further cutoff"
        options[name] = extent
