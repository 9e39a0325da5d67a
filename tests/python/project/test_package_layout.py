# SPDX-License-Identifier: BSD-3-Clause
"""The two Python packages: what each folder may import, and that all of them are installed."""

import ast
import tomllib
from graphlib import TopologicalSorter

from checkout import ROOT

FILES = sorted((ROOT / "python").rglob("*.py"))

#: A folder of private modules -> the folders that it may import from; "": modules beside them.
#: `halfshell_report` is a folder here, of which only the command line knows.
ALLOWED = {
    "_convert": {""},
    "_objects": {"", "_convert", "_functions"},  # a cell list asks functions, which make tables
    "_functions": {"", "_convert", "_objects"},
    "_check": {"", "_convert", "_functions", "_objects"},
    "_cli": {"", "_convert", "_functions", "_check", "halfshell_report"},
    "compat": {"", "_convert", "_functions", "_objects"},
    "halfshell_report": {"", "_convert", "_cli"},
    "": {"", "_convert", "_functions", "_objects", "_check", "_cli", "compat"},
}


def name_of(path):
    """``halfshell._objects.box`` for the file of that module."""
    parts = path.relative_to(ROOT / "python").with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in FILES}


def imports(path):
    """Modules of the package that a file imports anywhere, but for the package itself."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            parts = [f"{node.module}.{alias.name}" for alias in node.names]
            found = [part if part in MODULES else node.module for part in parts]
        else:
            continue
        yield from (name for name in found if name in MODULES and name != "halfshell")


def folder_of(name):
    parts = name.split(".")
    if parts[0] != "halfshell":
        return parts[0]
    is_package = MODULES[name].name == "__init__.py"
    return parts[1] if len(parts) > 2 or (is_package and len(parts) == 2) else ""


def test_imports_follow_the_order_of_folders():
    wrong = [
        f"{name} imports {other}" for name, path in MODULES.items()
        for other in imports(path)
        if folder_of(other) not in ALLOWED[folder_of(name)] | {folder_of(name)}
    ]  # fmt: skip
    assert wrong == []


def test_no_modules_import_each_other_in_a_circle():
    private = {name: path for name, path in MODULES.items() if name != "halfshell"}
    graph = {name: set(imports(path)) - {name} for name, path in private.items()}
    assert len(list(TopologicalSorter(graph).static_order())) == len(private)


def test_importing_a_private_folder_runs_nothing():
    private = [p for p in FILES if p.name == "__init__.py" and p.parent.name.startswith("_")]
    assert private
    for path in private:
        body = ast.parse(path.read_text()).body
        assert len(body) == 1 and isinstance(body[0], ast.Expr), path


def test_every_folder_is_installed():
    with (ROOT / "pyproject.toml").open("rb") as stream:
        listed = tomllib.load(stream)["tool"]["setuptools"]["packages"]
    folders = {name for name, path in MODULES.items() if path.name == "__init__.py"}
    assert set(listed) == folders | {"halfshell.include"}
