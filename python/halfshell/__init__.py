# SPDX-License-Identifier: BSD-3-Clause
"""Every pair of points within a cutoff, decided exactly."""

import importlib
from typing import TYPE_CHECKING

from halfshell._between import pairs_between
from halfshell._box import Box
from halfshell._cache import clear_cache, set_cache_limit
from halfshell._count import count_pairs
from halfshell._errors import CapacityError
from halfshell._graph import Graph
from halfshell._neighbors import coordination, neighbors
from halfshell._options import kernels
from halfshell._pairs import pairs
from halfshell._table import NeighborTable

if TYPE_CHECKING:
    from halfshell._cells import CellList
    from halfshell._explain import Explanation, explain
    from halfshell._histogram import pair_histogram
    from halfshell._include import get_include
    from halfshell._nearest import nearest
    from halfshell._rdf import RadialDistribution, rdf
    from halfshell._report import report
    from halfshell._stream import iter_pairs
    from halfshell._verify import Verdict, verify
    from halfshell._verlet import VerletList
    from halfshell._visit import for_each_pair

__version__ = "0.1.0"

__all__ = [
    "Box",
    "CapacityError",
    "CellList",
    "Explanation",
    "Graph",
    "NeighborTable",
    "RadialDistribution",
    "Verdict",
    "VerletList",
    "clear_cache",
    "coordination",
    "count_pairs",
    "explain",
    "for_each_pair",
    "get_include",
    "iter_pairs",
    "kernels",
    "nearest",
    "neighbors",
    "pair_histogram",
    "pairs",
    "pairs_between",
    "rdf",
    "report",
    "set_cache_limit",
    "verify",
]

#: Where names are that are imported when they are first used, for a quick start.
_LATER = {
    "CellList": "_cells",
    "Explanation": "_explain",
    "RadialDistribution": "_rdf",
    "Verdict": "_verify",
    "VerletList": "_verlet",
    "explain": "_explain",
    "for_each_pair": "_visit",
    "get_include": "_include",
    "iter_pairs": "_stream",
    "nearest": "_nearest",
    "pair_histogram": "_histogram",
    "rdf": "_rdf",
    "report": "_report",
    "verify": "_verify",
}

if not TYPE_CHECKING:  # for type checkers they are there

    def __getattr__(name: str) -> object:
        if name not in _LATER:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(f"{__name__}.{_LATER[name]}"), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *_LATER})
