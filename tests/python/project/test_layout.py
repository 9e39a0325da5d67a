# SPDX-License-Identifier: BSD-3-Clause
"""The structure that csrc/README.md promises: the order of its folders, every file on the map."""

import re
from graphlib import TopologicalSorter

from checkout import CSRC, ROOT

FILES = sorted(CSRC.rglob("*.[ch]"))

# A folder of the core includes itself and folders to its left. Folders that share a place are
# consumers of a search, which never include each other.
ORDER = [
    {"base"}, {"memory"}, {"exact"}, {"kernels"}, {"threads"}, {"box"}, {"scene"}, {"cells"},
    {"search"}, {"levels"}, {"collect"},
    {"rows", "histogram", "nearest", "verlet", "dynamic"}, {"api"}, {"connectivity"},
]  # fmt: skip
PUBLIC = ("halfshell.h", "halfshell_dynamic.h", "halfshell_nodes.h")
PLACE = {folder: place for place, folders in enumerate(ORDER) for folder in folders}


def layer(path):
    """The folder of the core that a file is in, or "kernels", "binding", "public"."""
    parts = path.relative_to(CSRC).parts
    return "public" if len(parts) == 1 else parts[1] if parts[0] == "core" else parts[0]


def quoted_includes(path):
    for name in re.findall(r'^#include "([^"]+)"', path.read_text(), re.MULTILINE):
        yield (path.parent / name).resolve()


def may_include(path, target):
    here, there = layer(path), layer(target)
    if there == "public":
        return here == "binding" or target.name in PUBLIC
    if here == "public" or "binding" in (here, there):
        return here == there == "binding"
    return here == there or PLACE[there] < PLACE[here]


# Each test is a law for all files: with a test for each file, these would be a tenth of all tests.
def test_includes_follow_the_layers():
    wrong = [
        f"{path.name} includes {target.relative_to(CSRC)}"
        for path in FILES
        for target in quoted_includes(path)
        if not (target.exists() and may_include(path, target))
    ]
    assert wrong == []


def test_calls_follow_the_layers():
    """What a public header declares can be called from anywhere: not so inside the core."""
    sources = [path for path in FILES if path.suffix == ".c" and layer(path) in PLACE]
    text = {path: path.read_text() for path in sources}
    at = {
        name: path
        for path in sources
        for name in re.findall(r"^(hs_\w+)\(", text[path], re.MULTILINE)
        if f"static {name}" not in text[path]
    }
    wrong = [
        f"{path.name} calls {name} of {at[name].name}"
        for path in sources
        for name in set(re.findall(r"\b(hs_\w+)\(", text[path])) & at.keys()
        if PLACE[layer(at[name])] > PLACE[layer(path)]
    ]
    assert wrong == []


def test_every_folder_of_the_core_has_a_place():
    assert {path.name for path in (CSRC / "core").iterdir()} == PLACE.keys() - {"kernels"}


def test_no_two_headers_include_each_other():
    uses = {path: set(quoted_includes(path)) for path in FILES if path.suffix == ".h"}
    assert len(list(TopologicalSorter(uses).static_order())) >= len(uses)


def test_only_the_binding_knows_python():
    includes = re.compile(r"^#include <(Python|numpy)", re.MULTILINE)
    know = [path for path in FILES if includes.search(path.read_text())]
    assert know and {layer(path) for path in know} == {"binding"}, know


def test_every_module_of_the_core_is_on_the_map():
    text = (CSRC / "README.md").read_text()
    modules = {path.stem for path in (CSRC / "core").rglob("*.[ch]")}
    assert [name for name in sorted(modules) if f"`{name}`" not in text] == []


def test_files_stay_readable():
    for path in FILES:
        lines = path.read_text().splitlines()
        assert lines[0] == "/* SPDX-License-Identifier: BSD-3-Clause */", path
        assert max(map(len, lines)) <= 100, path


def test_every_source_names_its_license():
    folders = ("csrc", "python", "tests", "benchmarks", "examples")
    kinds = (".c", ".h", ".py", ".pyi", ".pyx")
    sources = [p for f in folders for p in (ROOT / f).rglob("*") if p.suffix in kinds]
    assert sources
    for path in sources:
        if not any(part.startswith("build") for part in path.parts):
            assert "SPDX-License-Identifier" in path.read_text()[:200], path
