# SPDX-License-Identifier: BSD-3-Clause
"""What a call with a keyword that there is none of is answered: the one that is meant, if any."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Never

#: What other libraries call them.
_MEANT = {
    "periodic": ["pbc", "pbcs", "is_periodic", "periodicity"],
    "box": [
        "cell", "cells", "boxsize", "box_size", "boxlength", "lattice", "dimensions", "unitcell",
        "unit_cell", "box_vectors", "supercell",
    ],
    "cutoff": [
        "r", "rc", "r_c", "rcut", "r_cut", "rmax", "r_max", "radius", "max_cutoff", "max_distance",
        "distance_upper_bound", "cut_off", "eps", "range", "extent",
    ],
    "max_distance": ["cutoff", "r_max", "radius", "distance_upper_bound"],
    "min_distance": ["min_cutoff", "r_min", "rmin", "minimum_distance"],
    "bins": ["nbins", "n_bins", "num_bins"],
    "k": ["n_neighbors", "num_neighbors", "n_nearest"],
    "threads": ["workers", "n_jobs", "num_threads", "nthreads", "n_threads"],
    "queries": ["x", "y", "query", "query_points", "reference", "configuration"],
    "points": ["positions", "coordinates", "coords", "xyz", "atoms", "data"],
    "quantities": ["return_distance", "return_distances", "quantity", "output"],
    "sort": ["sorted", "sort_results", "sort_pairs"],
    "index_dtype": ["dtype", "index_type", "output_type"],
    "min_points": ["min_samples"],
    "exclude": ["exclusions", "exclude_within", "exclude_pairs"],
    "indices": ["touching", "rows", "subset"],
}  # fmt: skip


#: What is known of the points, not of a search; with what others call it.
_OF_POINTS = {
    "radii": ["radius_of_each"],
    "types": ["species", "symbols", "elements", "numbers"],
    "supports": [],
    "groups": [],
    "labels": ["molecules", "residues"],
    "weights": ["charges", "masses"],
    "batch": ["batch_index", "system_index"],
}

#: What is set around calls.
_SETTINGS = ("kernel", "algorithm", "precision", "memory_limit")

#: Where a keyword that a function does not have is looked for.
_SEARCHES = [
    "pairs", "neighbors", "nearest", "pair_histogram", "rdf", "clusters", "iter_pairs",
    "for_each_pair", "trajectory_pairs", "pairs_between", "coordination", "explain", "verify",
    "measure", "VerletList", "CellList", "DynamicCellList",
]  # fmt: skip

#: What other libraries call it whether a point is its own neighbour.
_ITSELF = ["include_self", "include_myself", "self_interaction", "exclude_ii", "loop"]


def refuse_unknown(function: Callable[..., Any], names: Iterable[str]) -> Never:
    """TypeError for the first of these keywords, with what it seems to mean."""
    import inspect  # here, as it takes some milliseconds

    name = next(iter(names))
    moved = _moved(name)
    if moved:
        raise TypeError(
            f"{function.__name__}() got an unexpected keyword argument {name!r}: {moved}"
        )
    known = [
        parameter.name for parameter in inspect.signature(function).parameters.values()
        if parameter.kind is not inspect.Parameter.VAR_KEYWORD and parameter.name != "self"
    ]  # fmt: skip
    meant = None if name in _ITSELF else _meant(name, known)
    others = [] if meant else _functions_with(name)
    hint = f": did you mean {meant}=?" if meant else ""
    if others:
        hint = f": it is an argument of {' and '.join(others)}"
    if name in _ITSELF and "queries" in known:
        hint = ": no point is its own neighbour, unless queries= are the points"
    raise TypeError(
        f"{function.__name__}() got an unexpected keyword argument {name!r}{hint}"
    )


def _moved(name: str) -> str | None:
    """Where something is given that no search takes."""
    if name in _SETTINGS:
        return f"set it around the call, with hs.settings({name}=...)"
    own = name.removeprefix("query_")
    for field, others in _OF_POINTS.items():
        if own == field or own in others:
            whose = "queries" if own != name else "points"
            return f"it is known of the points: hs.Points({whose}, {field}=...)"
    if name == "query_exclude":
        return "labels are those of hs.Points(queries, labels=...)"
    if name in ("capacity", "on_overflow"):
        return "out= takes arrays of a fixed length, and halfshell.jax has fixed shapes"
    if name == "winding":
        return "Clusters.spans is there in every case"
    return None


def _meant(name: str, known: list[str]) -> str | None:
    """One of the known names, by what other libraries call it, or by its spelling."""
    for one, others in _MEANT.items():
        if one in known and name.lower() in others:
            return one
    return None if _functions_with(name) else nearest_word(name, known)


def _functions_with(name: str) -> list[str]:
    """The first two of the functions that search which have an argument of this name."""
    import inspect

    import halfshell

    return [
        function for function in _SEARCHES
        if name in inspect.signature(getattr(halfshell, function)).parameters
    ][:2]  # fmt: skip


def nearest_word(word: str, known: Iterable[str]) -> str | None:
    """The one that is spelled most like a word, if any is."""
    import difflib  # here, as above

    found = difflib.get_close_matches(word, list(known), 1, 0.7)
    return found[0] if found else None
