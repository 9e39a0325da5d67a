# SPDX-License-Identifier: BSD-3-Clause
"""Every pair of points within a cutoff, decided exactly.

    pairs(points, cutoff, box=...)      each pair once, as arrays
    neighbors(points, cutoff, ...)      both directions, as a table with a row for each point
    pairs_between(queries, points, cutoff, ...)         pairs of two sets
    nearest(points, k, ...)             the k nearest of each point
    count_pairs, coordination, pair_histogram, rdf      numbers; no pair is stored
    clusters(points, cutoff, ...)       connected components, DBSCAN, percolation
    iter_pairs, for_each_pair           more pairs than memory holds
    trajectory_pairs, bricks            many frames; parts for other threads or machines
    verify(points, cutoff, i, j, ...)   check a list of pairs of any library
    explain, measure, bonded, plot_pairs

    Points(positions, box=..., radii=..., types=...)    what is known of each point
    Box, settings                       the periodic box; how searches are made
    CellList, VerletList, DynamicCellList               points that are kept, or move
    Connectivity, NodeList, PairTable, PairField        node lists, as in SPH codes

``help(halfshell.pairs)`` has all shared arguments. `halfshell.compat` stands in for functions of
ASE, SciPy, matscipy, MDAnalysis and scikit-learn; `halfshell.torch`, `halfshell.jax`,
`halfshell.dask` and `halfshell.mpi` take their arrays.
"""

import importlib
from typing import TYPE_CHECKING

from halfshell import _core as _core  # first: NumPy may crash where this refuses to be loaded
from halfshell._convert.options import kernels
from halfshell._errors import CapacityError, StaleError
from halfshell._functions.pairs import for_each_pair, iter_pairs, pairs, pairs_between
from halfshell._settings import settings

if TYPE_CHECKING:
    from halfshell import compat as compat
    from halfshell import dask as dask
    from halfshell import jax as jax
    from halfshell import mpi as mpi
    from halfshell import structures as structures
    from halfshell import torch as torch
    from halfshell._check.verify import Verdict, verify
    from halfshell._convert.memory import CacheInfo, cache_info, clear_cache, set_cache_limit
    from halfshell._convert.points import Points
    from halfshell._functions.bricks import Brick, Bricks, bricks
    from halfshell._functions.clusters import Clusters, clusters
    from halfshell._functions.counts import count_pairs, pair_histogram
    from halfshell._functions.explain import Explanation, explain
    from halfshell._functions.given_pairs import bonded, measure, plot_pairs
    from halfshell._functions.neighbors import coordination, nearest, neighbors
    from halfshell._functions.rdf import RadialDistribution, rdf
    from halfshell._functions.trajectory import trajectory_pairs
    from halfshell._machine import get_include
    from halfshell._objects.box import Box
    from halfshell._objects.cell_list import CellList
    from halfshell._objects.connectivity import Connectivity
    from halfshell._objects.dynamic_cell_list import DynamicCellList
    from halfshell._objects.neighbor_table import Graph, NeighborTable
    from halfshell._objects.node_list import NodeList
    from halfshell._objects.pair_table import PairField, PairTable
    from halfshell._objects.verlet_list import PairChanges, VerletList

__version__ = "0.1.0"

__all__ = [
    "Box",
    "Brick",
    "Bricks",
    "CacheInfo",
    "CapacityError",
    "CellList",
    "Clusters",
    "Connectivity",
    "DynamicCellList",
    "Explanation",
    "Graph",
    "NeighborTable",
    "NodeList",
    "PairChanges",
    "PairField",
    "PairTable",
    "Points",
    "RadialDistribution",
    "StaleError",
    "Verdict",
    "VerletList",
    "bonded",
    "bricks",
    "cache_info",
    "clear_cache",
    "clusters",
    "coordination",
    "count_pairs",
    "explain",
    "for_each_pair",
    "get_include",
    "iter_pairs",
    "kernels",
    "measure",
    "nearest",
    "neighbors",
    "pair_histogram",
    "pairs",
    "pairs_between",
    "plot_pairs",
    "rdf",
    "set_cache_limit",
    "settings",
    "trajectory_pairs",
    "verify",
]

#: Where names are that are imported when they are first used, for a quick start.
_LATER = {
    "_check.verify": "Verdict verify",
    "_convert.memory": "CacheInfo cache_info clear_cache set_cache_limit",
    "_convert.points": "Points",
    "_functions.bricks": "Brick Bricks bricks",
    "_functions.clusters": "Clusters clusters",
    "_functions.counts": "count_pairs pair_histogram",
    "_functions.explain": "Explanation explain",
    "_functions.given_pairs": "bonded measure plot_pairs",
    "_functions.neighbors": "coordination nearest neighbors",
    "_functions.rdf": "RadialDistribution rdf",
    "_functions.trajectory": "trajectory_pairs",
    "_machine": "get_include",
    "_objects.box": "Box",
    "_objects.cell_list": "CellList",
    "_objects.connectivity": "Connectivity",
    "_objects.dynamic_cell_list": "DynamicCellList",
    "_objects.neighbor_table": "Graph NeighborTable",
    "_objects.node_list": "NodeList",
    "_objects.pair_table": "PairField PairTable",
    "_objects.verlet_list": "PairChanges VerletList",
}

#: Modules that are imported when they are first used, and the package that each needs.
_MODULES = {
    "compat": None,
    "dask": "dask",
    "jax": "jax",
    "mpi": "mpi4py",
    "structures": None,
    "torch": "torch",
}

if not TYPE_CHECKING:  # for type checkers they are there

    def __getattr__(name: str) -> object:
        if name in _MODULES:
            return importlib.import_module(f"{__name__}.{name}")
        module = next((one for one, names in _LATER.items() if name in names.split()), None)
        if module is None:
            from halfshell._unknown import hint_of_name

            hint = hint_of_name(name, __all__)
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}")
        value = getattr(importlib.import_module(f"{__name__}.{module}"), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        from importlib.util import find_spec

        there = [name for name, needs in _MODULES.items() if not needs or find_spec(needs)]
        return sorted([*__all__, *there, "__doc__", "__file__", "__name__", "__version__"])
