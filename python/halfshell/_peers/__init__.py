# SPDX-License-Identifier: BSD-3-Clause
"""Adapters to other libraries that list pairs, shared by the report, `verify` and benchmarks."""

from halfshell._peers.adapters import LIBRARIES
from halfshell._peers.library import Call, Library, Question, in_space, wrapped

__all__ = ["LIBRARIES", "Call", "Library", "Question", "in_space", "wrapped"]
