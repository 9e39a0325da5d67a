# SPDX-License-Identifier: BSD-3-Clause
"""The modules of benchmarks/ for the tests, and rows with made-up figures."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from checkout import BENCHMARKS

PACKAGES = {
    "libraries": ("agreement", "contestant", "peers"),
    "measure": ("machine", "runner", "turns"),
}
COMMANDS = (
    "check_scenes", "compare", "extreme", "fill_docs", "fill_errors", "footprint", "plot",
    "reproduce", "run", "stages",
)  # fmt: skip
MODULES = {name: name for name in ("scenes", "pages", *COMMANDS)}
MODULES |= {name: f"{folder}.{name}" for folder, names in PACKAGES.items() for name in names}

only_in_a_checkout = pytest.mark.skipif(not BENCHMARKS.exists(), reason="only in a checkout")


@pytest.fixture(scope="module")
def bench() -> Iterator[SimpleNamespace]:
    """The modules of benchmarks/, commands and packages beside them, by their last names."""
    sys.path.insert(0, str(BENCHMARKS))
    try:
        yield SimpleNamespace(
            **{name: importlib.import_module(module) for name, module in MODULES.items()}
        )
    finally:
        sys.path.remove(str(BENCHMARKS))
        for name in list(sys.modules):
            if name.partition(".")[0] in MODULES.keys() | PACKAGES.keys():
                del sys.modules[name]


def measurement(bench: SimpleNamespace, contestant: str, seconds: float, **other: Any) -> Any:
    """A row with made-up figures."""
    values: dict[str, Any] = {
        "scene": "pairs-1e4-k52", "contestant": contestant, "version": "1.0", "task": "pairs",
        "n": 1000, "dim": 3, "cutoff": 5.0, "quantities": "ij", "index_dtype": "int64",
        "pairs": 20_000, "repeats": 7, "calls": 1, "fresh_median": seconds,
        "fresh_min": seconds, "recycled_median": seconds / 2.0, "recycled_min": seconds / 2.0,
        "all_held": True, "complete": True, "agreement": "same",
    }  # fmt: skip
    return bench.pages.Measurement(**{**values, **other})


def write_results(bench: SimpleNamespace, path: Path, rows: list[Any], **facts: Any) -> Path:
    """A result file of made-up rows."""
    about = {**bench.machine.facts("lab", "avx2", "gcc"), **facts}
    bench.pages.write_csv(path, about, rows, {"pairs-1e4-k52": 25.0})
    return path
