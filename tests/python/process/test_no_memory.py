# SPDX-License-Identifier: BSD-3-Clause
"""Wherever memory is refused, a call raises MemoryError or gives the right answer, nothing is left
behind, and the next call is as ever. calls_without_memory.py makes the calls; under
HALFSHELL_NO_MEMORY=10 with ten times as many points, which takes minutes."""

import importlib.util
import json
import os
import subprocess
import sys

import pytest

from c_builds import compile, needs_c
from checkout import SUPPORT

pytestmark = pytest.mark.slow

SIZE = os.environ.get("HALFSHELL_NO_MEMORY", "1")

# Calls whose compiled part returns a small number, or that the argument is not for it: both are
# there already. The last two go to C at once, past the functions that are refused memory alone.
NUMBERS = [
    "count_pairs", "count_pairs, queries", "count_pairs, balls", "cells.count_pairs",
    "cells.for_each_pair", "no number", "no edges", "bad radii", "pairs, double", "verify",
]  # fmt: skip

has_testcapi = importlib.util.find_spec("_testcapi") is not None
needs_testcapi = pytest.mark.skipif(not has_testcapi, reason="this Python has no _testcapi")
needs_preload = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="libraries are preloaded on Linux"
)


def call_all(path, environment=None):
    """Runs all calls in a process of its own: {name: (calls that failed, faults)}."""
    script = SUPPORT / "calls_without_memory.py"
    command = [sys.executable, "-X", "faulthandler", script, path, SIZE]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=3600)
    assert done.returncode == 0, f"exit status {done.returncode}\n{done.stderr[-3000:]}"
    return json.loads(done.stdout.splitlines()[-1])


def check(results):
    assert {name: faults for name, (_, faults) in results.items() if faults} == {}
    assert sum(n for n, _ in results.values()) > 500


@needs_testcapi
def test_the_interpreter_may_have_no_memory():
    results = call_all("python")
    check(results)
    # Whatever a function returns takes memory, but for small numbers. What Python code takes on the
    # way may be there already, and is left out on interpreters that crash then.
    unaffected = {name for name, (failed, _) in results.items() if failed == 0}
    assert unaffected <= set(NUMBERS)


@needs_c
@needs_preload
@pytest.mark.parametrize("objects", ["pymalloc", "malloc"])
def test_the_system_may_have_no_memory(objects, tmp_path):
    """The second time the interpreter's objects are from malloc too."""
    path = tmp_path / "failing_malloc.so"
    compile("-O1", "-shared", "-fPIC", SUPPORT / "failing_malloc.c", "-o", path, "-ldl")
    environment = {**os.environ, "LD_PRELOAD": str(path), "PYTHONMALLOC": objects}
    results = call_all(path, environment)
    check(results)
    for name in ("pairs, large", "VerletList", "CellList, few cells", "nearest, queries"):
        assert results[name][0] >= 6
