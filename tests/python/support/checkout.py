# SPDX-License-Identifier: BSD-3-Clause
"""Where the parts of the checkout are, whatever folder a test is in."""

from pathlib import Path

SUPPORT = Path(__file__).resolve().parent
PYTHON_TESTS = SUPPORT.parent
TESTS = PYTHON_TESTS.parent
ROOT = TESTS.parent
CSRC = ROOT / "csrc"
BENCHMARKS = ROOT / "benchmarks"
