# SPDX-License-Identifier: BSD-3-Clause
"""Answers to names and keywords that do not exist: which one may be meant."""

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
    "radii": ["radius"],
    "min_distance": ["min_cutoff", "r_min", "rmin", "minimum_distance"],
    "bins": ["nbins", "n_bins", "num_bins", "dr", "bin_width"],
    "edges": ["bins", "nbins", "n_bins", "bin_edges"],
    "k": ["n", "n_neighbors", "num_neighbors", "n_nearest"],
    "threads": ["workers", "n_jobs", "num_threads", "nthreads", "n_threads"],
    "max_pairs": ["block", "block_size", "chunk", "chunk_size", "chunksize", "batch_size"],
    "memory_limit": ["memory", "max_memory"],
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
    "types": ["species", "symbols", "elements", "numbers", "names"],
    "supports": [],
    "groups": [],
    "labels": ["molecules", "molecule", "mol", "residues", "resids"],
    "weights": ["charges", "masses"],
    "batch": ["batch_index", "system_index", "frame"],
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

#: What they call it whether each pair comes once, or from both sides.
_SIDES = ["half", "full", "half_list", "full_list", "bothways"]

#: What they call functions and classes.
_NAMES = {
    "pairs": ["find_pairs", "query_pairs", "all_pairs", "half_list", "self_capped_distance"],
    "pairs_between": ["capped_distance", "query_ball_tree"],
    "neighbors": [
        "neighbor_list", "neighbour_list", "neighborlist", "full_list", "radius_graph",
        "query_ball_point", "radius_neighbors",
    ],
    "nearest": ["knn", "knn_graph", "kneighbors", "query"],
    "rdf": ["gr", "g_r", "gofr", "g_of_r", "interrdf", "pair_correlation", "radial_distribution"],
    "pair_histogram": ["histogram"],
    "count_pairs": ["count", "n_pairs", "count_neighbors"],
    "clusters": ["dbscan", "components", "connected_components", "molecules"],
    "measure": ["distance", "distances", "get_distances", "mic", "minimum_image", "calc_bonds"],
    "bonded": ["exclusions"],
    "iter_pairs": ["stream", "blocks", "chunks"],
    "CellList": ["kdtree", "ckdtree", "balltree", "aabbquery", "linkcell"],
    "Points": ["atoms", "structure", "system"],
    "Box": ["cell", "lattice", "unitcell"],
    "settings": ["set_num_threads", "num_threads", "threads", "config"],
    "structures.alpha_quartz": ["alpha_quartz", "quartz"],
}  # fmt: skip

#: Names that drop-ins have, and the modules of these.
_DROP_INS = {
    "neighbor_list": "ase", "NeighborList": "ase", "neighbour_list": "matscipy",
    "KDTree": "scipy", "cKDTree": "scipy",
    "capped_distance": "mdanalysis", "self_capped_distance": "mdanalysis",
}  # fmt: skip


def hint_of_name(name: str, known: Iterable[str]) -> str:
    """What a name that the package does not have seems to mean, to go behind a message."""
    if name.startswith("_"):
        return ""
    known = list(known)
    others = {other: ours for ours, theirs in _NAMES.items() for other in theirs}
    others.update((one.lower(), one) for one in known)
    meant = others.get(name.lower()) or nearest_word(name, known)
    module = _DROP_INS.get(name)
    drop_in = f" halfshell.compat.{module} has a {name} like the original" if module else ""
    return f": did you mean {meant}?{drop_in}" if meant else ""


def refuse_unknown(function: Callable[..., Any], names: Iterable[str]) -> Never:
    """TypeError for the first of these keywords, with what it seems to mean."""
    import inspect  # here, as it takes some milliseconds

    name = next(iter(names))
    known = [
        parameter.name for parameter in inspect.signature(function).parameters.values()
        if parameter.kind is not inspect.Parameter.VAR_KEYWORD and parameter.name != "self"
    ]  # fmt: skip
    called = _name_of(function)
    hint = _instead(called, name, known)
    if not hint:
        meant = _meant(name, known)
        others = [] if meant else _functions_with(name)
        hint = f"did you mean {meant}=?" if meant else ""
        if others:
            hint = f"it is an argument of {' and '.join(others)}"
    raise TypeError(
        f"{called}() got an unexpected keyword argument {name!r}"
        f"{': ' if hint else ''}{hint}"
    )


def refuse_count(function: Callable[..., Any], given: int, most: int) -> Never:
    """TypeError for more arguments by position than a search takes."""
    names = function.__code__.co_varnames
    other = "quantities" if "quantities" in names else names[most]
    own = int(names[0] == "self")
    raise TypeError(
        f"{_name_of(function)}() takes {most - own} positional arguments but {given - own} were "
        f"given: {', '.join(names[own:most]) or 'none'}; others by name, such as {other}="
    )


def _name_of(function: Callable[..., Any]) -> str:
    """What is called: a function, or the class that `__init__` makes."""
    owner, _, name = function.__qualname__.rpartition(".")
    return owner if name == "__init__" else name


def _instead(function: str, name: str, known: list[str]) -> str | None:
    """Where something is given that no search takes, or that this one cannot take."""
    if name in _SETTINGS:
        return f"set it around the call, with hs.settings({name}=...)"
    own = name.removeprefix("query_")
    for field, others in _OF_POINTS.items():
        if own == field or own in others:
            if field in known:
                return f"did you mean {field}=?"
            whose = "queries" if own != name else "points"
            return f"it is known of the points: hs.Points({whose}, {field}=...)"
    if name == "query_exclude":
        return "labels are those of hs.Points(queries, labels=...)"
    if name in ("capacity", "on_overflow"):
        return "out= takes arrays of a fixed length, and halfshell.jax has fixed shapes"
    if name == "winding":
        return "Clusters.spans is there in every case"
    if name in _ITSELF:
        unless = ", unless queries= are the points" if "queries" in known else ""
        return f"no point is its own neighbour{unless}"
    if name in _SIDES:
        return "pairs has each pair once, neighbors from both sides"
    if function == "nearest" and name == "rule":
        return "the nearest go by distance alone: find more, and drop some"
    if "edges" in known and name in ("cutoff", *_MEANT["cutoff"]):
        return "the last edge is the cutoff"
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
