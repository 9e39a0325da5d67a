# SPDX-License-Identifier: BSD-3-Clause
"""HALFSHELL_KERNEL: the kernel of every search that names none, read once, at import."""

import json
import os
import subprocess
import sys

import pytest

import halfshell as hs

SCRIPT = """
import json, os
import halfshell as hs
from halfshell import _core
os.environ["HALFSHELL_KERNEL"] = "changed later"
points = [[0.0], [1.0]]
told = {"default": _core.default_kernel()}
for name, how in (("unnamed", {}), ("named", {"kernel": "scalar"})):
    try:
        with hs.settings(**how):
            told[name] = hs.explain(points, 1.0).kernel
            assert hs.count_pairs(points, 1.0) == len(hs.pairs(points, 1.0)[0]) == 1
    except ValueError as error:
        told[name] = str(error)
print(json.dumps(told))
"""


def told(value):
    """What a fresh interpreter says with HALFSHELL_KERNEL set to this."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "HALFSHELL_KERNEL": value},
    )
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", hs.kernels())
def test_it_names_the_kernel_of_searches_that_name_none(name):
    assert told(name) == {"default": name, "unnamed": name, "named": "scalar"}


def test_empty_is_as_good_as_not_set():
    best = hs.kernels()[0]
    assert told("") == {"default": best, "unnamed": best, "named": "scalar"}


@pytest.mark.parametrize("name", ["SCALAR", "scalar ", "x" * 1000])
def test_an_unknown_name_is_refused_by_such_searches_only(name):
    answer = told(name)
    assert "kernel must be one of" in answer["unnamed"]
    assert "from HALFSHELL_KERNEL" in answer["unnamed"]
    assert f"'{name[:31]}'" in answer["unnamed"]
    assert answer["named"] == "scalar"
