# SPDX-License-Identifier: BSD-3-Clause
"""Every pair of points within a cutoff, decided exactly."""

import importlib
from typing import TYPE_CHECKING

from halfshell._convert.memory import CacheInfo, cache_info, clear_cache, set_cache_limit
from halfshell._convert.options import kernels
from halfshell._errors import CapacityError, StaleError
from halfshell._functions.between import pairs_between
from halfshell._functions.counts import count_pairs
from halfshell._functions.pairs import pairs
from halfshell._objects.box import Box

if TYPE_CHECKING:
    from halfshell._check.verify import Verdict, verify
    from halfshell._functions.bricks import bricks
    from halfshell._functions.clusters import clusters
    from halfshell._functions.coordination import coordination
    from halfshell._functions.explain import Explanation, explain
    from halfshell._functions.histogram import pair_histogram
    from halfshell._functions.measure import measure
    from halfshell._functions.nearest import nearest
    from halfshell._functions.neighbors import neighbors
    from halfshell._functions.plot_pairs import plot_pairs
    from halfshell._functions.rdf import rdf
    from halfshell._functions.stream import for_each_pair, iter_pairs
    from halfshell._functions.trajectory import trajectory_pairs
    from halfshell._include import get_include
    from halfshell._objects.brick import Brick, Bricks
    from halfshell._objects.cell_list import CellList
    from halfshell._objects.clusters import Clusters
    from halfshell._objects.connectivity import Connectivity
    from halfshell._objects.dynamic_cell_list import DynamicCellList
    from halfshell._objects.graph import Graph
    from halfshell._objects.neighbor_table import NeighborTable
    from halfshell._objects.node_list import NodeList
    from halfshell._objects.pair_changes import PairChanges
    from halfshell._objects.pair_field import PairField
    from halfshell._objects.pair_table import PairTable
    from halfshell._objects.radial_distribution import RadialDistribution
    from halfshell._objects.verlet_list import VerletList

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
    "RadialDistribution",
    "StaleError",
    "Verdict",
    "VerletList",
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
    "trajectory_pairs",
    "verify",
]

#: Where names are that are imported when they are first used, for a quick start.
_LATER = {
    "Brick": "_objects.brick",
    "Bricks": "_objects.brick",
    "CellList": "_objects.cell_list",
    "Clusters": "_objects.clusters",
    "Connectivity": "_objects.connectivity",
    "DynamicCellList": "_objects.dynamic_cell_list",
    "Explanation": "_functions.explain",
    "Graph": "_objects.graph",
    "NeighborTable": "_objects.neighbor_table",
    "NodeList": "_objects.node_list",
    "PairChanges": "_objects.pair_changes",
    "PairField": "_objects.pair_field",
    "PairTable": "_objects.pair_table",
    "RadialDistribution": "_objects.radial_distribution",
    "Verdict": "_check.verify",
    "VerletList": "_objects.verlet_list",
    "bricks": "_functions.bricks",
    "clusters": "_functions.clusters",
    "coordination": "_functions.coordination",
    "explain": "_functions.explain",
    "for_each_pair": "_functions.stream",
    "get_include": "_include",
    "iter_pairs": "_functions.stream",
    "measure": "_functions.measure",
    "nearest": "_functions.nearest",
    "neighbors": "_functions.neighbors",
    "pair_histogram": "_functions.histogram",
    "plot_pairs": "_functions.plot_pairs",
    "rdf": "_functions.rdf",
    "trajectory_pairs": "_functions.trajectory",
    "verify": "_check.verify",
}

if not TYPE_CHECKING:  # for type checkers they are there

    def __getattr__(name: str) -> object:
        if name not in _LATER:
            from halfshell._unknown import nearest_word

            meant = None if name.startswith("_") else nearest_word(name, __all__)
            hint = f": did you mean {meant}?" if meant else ""
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}")
        value = getattr(importlib.import_module(f"{__name__}.{_LATER[name]}"), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *_LATER})
