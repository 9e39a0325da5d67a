# SPDX-License-Identifier: BSD-3-Clause
"""The pages on PyTorch, JAX and dask run; where these are missing, one line says so."""

import ast
import doctest
import importlib
import re
import subprocess
import sys

import pytest

from checkout import ROOT
from frameworks import framework

NAMES = ["torch", "jax", "dask"]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_examples_run(name):
    module = framework(name)
    if name == "torch":
        module.manual_seed(1)
    text = (ROOT / f"docs/{name}.md").read_text()
    names = {}
    for code in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(compile(ast.parse(code), f"{name}.md", "exec"), names)
    if name == "torch":
        assert names["forces"].shape == (500, 3) and names["by_box"].isfinite().all()
        assert names["edge_index"].shape[1] > 500 and len(names["of_queries"]) > 20
        assert names["again"] > 0.0
    elif name == "dask":
        assert names["n_pairs"] == names["histogram"].sum()
    else:
        assert names["gradient"].shape == (500, 3) and names["found"].needed > 100
        assert names["lists"].i.shape == (5, 2000) and not names["lists"].overflow.any()


@pytest.mark.parametrize("name", NAMES)
def test_examples_in_docstrings_run(name):
    framework(name)
    module = importlib.import_module(f"halfshell.{name}")
    result = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert result.attempted > 5 and result.failed == 0


@pytest.mark.parametrize("name", NAMES)
def test_without_the_package_one_line_names_the_extra(name):
    script = f"import sys; sys.modules[{name!r}] = None\nimport halfshell.{name}"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    last = done.stderr.splitlines()[-1]
    package = name.replace("dask", "dask[array]")
    assert f"ImportError: halfshell.{name} needs {package}: pip install" in last
    assert f"halfshell[{name.replace('dask', 'distributed')}]" in last


@pytest.mark.parametrize("name", NAMES)
def test_it_is_imported_by_name_only(name):
    script = f"import sys, halfshell; sys.exit({name!r} in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script]).returncode == 0
