# SPDX-License-Identifier: BSD-3-Clause
"""Every pair of points within a cutoff, decided exactly."""

from halfshell._between import pairs_between
from halfshell._box import Box
from halfshell._cache import clear_cache, set_cache_limit
from halfshell._count import count_pairs
from halfshell._errors import CapacityError
from halfshell._explain import Explanation, explain
from halfshell._histogram import pair_histogram
from halfshell._neighbors import coordination, neighbors
from halfshell._options import kernels
from halfshell._pairs import pairs
from halfshell._rdf import RadialDistribution, rdf
from halfshell._table import NeighborTable
from halfshell._verify import Verdict, verify

__version__ = "0.1.0"

__all__ = [
    "Box",
    "CapacityError",
    "Explanation",
    "NeighborTable",
    "RadialDistribution",
    "Verdict",
    "clear_cache",
    "coordination",
    "count_pairs",
    "explain",
    "kernels",
    "neighbors",
    "pair_histogram",
    "pairs",
    "pairs_between",
    "rdf",
    "set_cache_limit",
    "verify",
]
