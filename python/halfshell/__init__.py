# SPDX-License-Identifier: BSD-3-Clause
"""Every pair of points within a cutoff, decided exactly."""

from halfshell._api import count_pairs, kernels, pairs
from halfshell._box import Box
from halfshell._explain import Explanation, explain
from halfshell._verify import Verdict, verify

__version__ = "0.1.0"

__all__ = [
    "Box",
    "Explanation",
    "Verdict",
    "count_pairs",
    "explain",
    "kernels",
    "pairs",
    "verify",
]
