# SPDX-License-Identifier: BSD-3-Clause
"""The structure that csrc/README.md promises: who includes whom, and every file on the map."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CSRC = ROOT / "csrc"
FILES = sorted(CSRC.rglob("*.[ch]"))

# Folder of the including file -> what it may include with quotes, relative to csrc.
ALLOWED = {
    "binding": r"binding/|halfshell(_capi)?\.h$",
    "core": r"core/|kernels/kernel\.h$|halfshell\.h$",
    "kernels": r"kernels/|core/(base|filter|exact|exact_float|doubleword)\.h$|halfshell\.h$",
    "": r"halfshell\.h$",  # of halfshell_capi.h
}


def includes(path, brackets):
    left, right = brackets
    found = re.findall(rf"^#include {left}([^{right}]+){right}", path.read_text(), re.MULTILINE)
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_includes_follow_the_layers(path):
    folder = path.parent.relative_to(CSRC).as_posix().strip(".")
    for name in includes(path, '""'):
        target = (path.parent / name).resolve().relative_to(CSRC).as_posix()
        assert re.match(ALLOWED[folder], target), f"{path.name} includes {target}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_only_the_binding_knows_python(path):
    if path.parent.name != "binding":
        assert not [name for name in includes(path, "<>") if re.match("Python|numpy", name)]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_file_is_on_the_map(path):
    text = (CSRC / "README.md").read_text()
    assert re.search(rf"`{path.stem}`|\b{re.escape(path.name)}\b", text)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_files_stay_readable(path):
    lines = path.read_text().splitlines()
    assert lines[0] == "/* SPDX-License-Identifier: BSD-3-Clause */"
    # The public interface is one file, which is mostly words.
    assert len(lines) <= (700 if path.name == "halfshell.h" else 400)
    assert max(map(len, lines)) <= 100


def test_every_source_names_its_license():
    folders = ("csrc", "python", "tests", "benchmarks", "examples")
    kinds = (".c", ".h", ".py", ".pyi", ".pyx")
    sources = [p for f in folders for p in (ROOT / f).rglob("*") if p.suffix in kinds]
    assert sources
    for path in sources:
        if "build" not in path.parts:
            assert "SPDX-License-Identifier" in path.read_text()[:200], path
