# SPDX-License-Identifier: BSD-3-Clause
"""Every pair of points within a cutoff, decided exactly."""

from halfshell._box import Box
from halfshell._cache import clear_cache, set_cache_limit
from halfshell._count import count_pairs
from halfshell._errors import CapacityError
from halfshell._explain import Explanation, explain
from halfshell._nearest import nearest
from halfshell._options import kernels
from halfshell._pairs import pairs
from halfshell._verify import Verdict, verify

__version__ = "0.1.0"

__all__ = [
    "Box",
    "CapacityError",
    "Explanation",
    "Verdict",
    "clear_cache",
    "count_pairs",
    "explain",
    "kernels",
    "nearest",
    "pairs",
    "set_cache_limit",
    "verify",
]
