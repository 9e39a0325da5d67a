# SPDX-License-Identifier: BSD-3-Clause
"""Adapters to other libraries that list pairs, shared by the report, `verify` and benchmarks."""

from halfshell_report.peers.adapters import LIBRARIES
from halfshell_report.peers.library import Call, Library, Question, in_space, wrapped

__all__ = ["LIBRARIES", "Call", "Library", "Question", "in_space", "wrapped"]
