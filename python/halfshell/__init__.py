# SPDX-License-Identifier: BSD-3-Clause
"""Every pair of points within a cutoff, decided exactly."""

from halfshell._api import count_pairs, kernels, pairs
from halfshell._box import Box
from halfshell._cache import clear_cache, set_cache_limit
from halfshell._errors import CapacityError
from halfshell._explain import Explanation, explain
from halfshell._report import report
from halfshell._verify import Verdict, verify
from halfshell._verlet import VerletList

__version__ = "0.1.0"

__all__ = [
    "Box",
    "CapacityError",
    "Explanation",
    "Verdict",
    "VerletList",
    "clear_cache",
    "count_pairs",
    "explain",
    "kernels",
    "pairs",
    "report",
    "set_cache_limit",
    "verify",
]
