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
        "distance_upper_bound", "cut_off", "eps",
    ],
    "touching": ["indices"],
    "indices": ["touching"],
    "r_max": ["range", "rmax", "cutoff"],
    "max_distance": ["cutoff", "r_max", "radius", "distance_upper_bound"],
    "min_distance": ["min_cutoff", "r_min", "rmin", "minimum_distance"],
    "bins": ["nbins", "n_bins", "num_bins"],
    "k": ["n_neighbors", "num_neighbors", "n_nearest"],
    "threads": ["workers", "n_jobs", "num_threads", "nthreads", "n_threads"],
    "queries": ["x", "y", "query", "query_points", "reference", "configuration"],
    "points": ["positions", "coordinates", "coords", "xyz", "atoms", "data"],
    "quantities": ["return_distance", "return_distances", "quantity", "output"],
    "sort": ["sorted", "sort_results", "sort_pairs"],
    "types": ["species", "symbols", "elements", "numbers"],
    "index_dtype": ["dtype", "index_type", "output_type"],
    "min_points": ["min_samples"],
    "batch": ["batch_index", "system_index"],
}  # fmt: skip


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


def _meant(name: str, known: list[str]) -> str | None:
    """One of the known names, by what other libraries call it, or by its spelling."""
    for one, others in _MEANT.items():
        if one in known and name.lower() in others:
            return one
    return None if _functions_with(name) else nearest_word(name, known)


def _functions_with(name: str) -> list[str]:
    """The functions that search, as few as two, which have an argument of this name."""
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
