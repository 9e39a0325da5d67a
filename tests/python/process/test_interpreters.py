# SPDX-License-Identifier: BSD-3-Clause
"""Interpreters besides the main one are refused, as NumPy refuses them, and nothing is harmed."""

import subprocess
import sys

import pytest

import halfshell as hs

SCRIPT = """
import sys
try:
    import _interpreters as interpreters  # from 3.13 on
except ImportError:
    import _xxsubinterpreters as interpreters

def imports(statements):
    return "try:\\n" + "".join(f"    {line}\\n" for line in statements) + (
        "except ImportError as error:\\n    print(error, flush=True)\\n"
    )

first = imports(["import halfshell"])
core = imports([
    "from importlib.machinery import ExtensionFileLoader",
    "from importlib.util import module_from_spec, spec_from_loader",
    f"loader = ExtensionFileLoader('halfshell._core', {sys.argv[1]!r})",
    "module_from_spec(spec_from_loader('halfshell._core', loader))",
])
for statements in (first, core):
    other = interpreters.create()
    interpreters.run_string(other, statements)
    interpreters.destroy(other)

import halfshell
print(halfshell.count_pairs([[0.0], [1.0]], 1.0))
"""


@pytest.mark.skipif(sys.version_info < (3, 12), reason="modules say so from Python 3.12 on")
def test_other_interpreters_are_refused():
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, hs._core.__file__],
        capture_output=True, text=True, check=True,
    )
    package, core, answer = done.stdout.splitlines()
    assert "subinterpreters" in package  # of NumPy or of the core: whichever comes first
    assert core == "module halfshell._core does not support loading in subinterpreters"
    assert answer == "1"
