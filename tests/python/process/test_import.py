# SPDX-License-Identifier: BSD-3-Clause
"""`import halfshell` loads little beside NumPy; the rest comes when it is first used."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import halfshell as hs

#: What `import halfshell` may load of its own.
OWN = {
    "_core", "_errors", "_search", "_settings", "_convert", "_convert.foreign",
    "_convert.options", "_functions", "_functions.pairs",
}  # fmt: skip


def fresh(script, *args):
    """What a fresh interpreter prints as JSON."""
    done = subprocess.run(
        [sys.executable, "-c", script, *args], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


def test_only_what_is_usual_is_imported():
    script = """
import json, sys
import numpy
before = set(sys.modules)
import halfshell
print(json.dumps(sorted(set(sys.modules) - before)))
"""
    loaded = fresh(script)
    own = {name.partition(".")[2] for name in loaded if name.startswith("halfshell.")}
    assert own <= OWN
    assert not [name for name in loaded if name.startswith("halfshell_report")]
    others = {name.partition(".")[0] for name in loaded} - {"halfshell"}
    assert others <= {"__future__", "cython_runtime"} | set(sys.builtin_module_names)
    # Known to be slow, wherever they come from.
    assert not {"argparse", "ctypes", "dataclasses", "inspect", "re"} & set(loaded)


def test_commands_import_the_report_only_when_it_is_wanted():
    script = """
import contextlib, io, json, sys
from halfshell import cli
from halfshell._cli import verify
loaded = []
for command in sys.argv[1:]:
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
        cli.main(command.split())
    loaded.append("halfshell_report" in sys.modules)
print(json.dumps(loaded))
"""
    commands = ["info", "pairs --help", "pairs --cutoff 2", "verify --cutoff 2", "report --help"]
    assert fresh(script, *commands) == [False, False, False, False, True]


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(hs.__all__)))
def test_every_name_is_there_when_it_is_first_used(name):
    script = """
import json, sys
import halfshell as hs
name = sys.argv[1]
listed = name in dir(hs)
first, second = getattr(hs, name), getattr(hs, name)
print(json.dumps([listed, first is second, name in vars(hs), first.__module__]))
"""
    listed, same, kept, module = fresh(script, name)
    assert listed and same and kept
    assert module.startswith("halfshell.")


def test_type_checkers_see_the_names_that_come_later():
    """`_LATER` and the imports that only type checkers read agree, modules included."""
    tree = ast.parse(Path(hs.__file__).read_text())
    for_types = next(
        node for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )  # fmt: skip
    seen = {}
    for node in for_types.body:
        if node.module == "halfshell":  # submodules
            assert [alias.asname for alias in node.names] == [alias.name for alias in node.names]
            continue
        assert isinstance(node, ast.ImportFrom) and not any(alias.asname for alias in node.names)
        seen |= {alias.name: node.module.removeprefix("halfshell.") for alias in node.names}
    assert seen == {name: one for one, names in hs._LATER.items() for name in names.split()}
    at_once = {
        alias.name for node in tree.body if isinstance(node, ast.ImportFrom)
        and node.module.startswith("halfshell.") for alias in node.names
    }  # fmt: skip
    assert not at_once & set(seen)
    assert sorted(at_once | set(seen)) == sorted(hs.__all__)


def test_what_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'halfshell' has no attribute 'neighbours'"):
        hs.neighbours  # noqa: B018
    assert not hasattr(hs, "_nothing")
