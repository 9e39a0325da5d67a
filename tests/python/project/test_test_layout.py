# SPDX-License-Identifier: BSD-3-Clause
"""The folders of the tests and benchmarks: one for each subject, helpers in one place, names that
are unique."""

import re

from checkout import PYTHON_TESTS, ROOT, SUPPORT, TESTS

#: A folder of tests/python -> what its tests are about.
FOLDERS = {
    "functions": "one public function",
    "objects": "one public class",
    "arguments": "what goes in, and what is refused",
    "laws": "scenes on which the answer is known, or must not change",
    "process": "memory, threads, signals, the environment",
    "compat": "drop-ins for other libraries",
    "frameworks": "tensors of PyTorch and JAX",
    "distributed": "Dask and MPI",
    "scenes": "the scenes and structures of the package",
    "binding": "the boundary to C",
    "report": "`halfshell report`",
    "cli": "the command line",
    "benchmarks": "the scripts in benchmarks/",
    "project": "layout, documentation, types, packaging",
}
FILES = sorted(PYTHON_TESTS.rglob("*.py"))
THEMES = [path for path in FILES if path.name.startswith("test_")]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "csrc/README.md"]
PAGES += [*sorted((ROOT / "docs").rglob("*.md")), TESTS / "c/Makefile"]
PAGES += [path for path in sorted((ROOT / ".ci").rglob("*")) if path.is_file()]


def imported(path):
    lines = re.findall(r"^ *(?:from|import) .*", path.read_text(), re.MULTILINE)
    return re.findall(r"\w+", " ".join(lines))


def test_every_folder_has_a_subject_that_the_guide_names():
    folders = {path.name for path in PYTHON_TESTS.iterdir() if path.is_dir()}
    assert folders - {"__pycache__"} == FOLDERS.keys() | {"support"}
    guide = (ROOT / "CONTRIBUTING.md").read_text()
    for folder, subject in FOLDERS.items():
        assert f"`{folder}` ({subject})" in guide


def test_tests_and_helpers_are_in_their_folders():
    for path in FILES:
        if path.name != "conftest.py":
            is_test = path.name.startswith("test_")
            assert path.parent.parent == PYTHON_TESTS
            assert path.parent.name in FOLDERS if is_test else path.parent == SUPPORT, path


def test_file_names_are_unique():
    """Modules of tests have no package, so that any folder can be run alone."""
    names = [path.stem for path in FILES]
    assert sorted(set(names)) == sorted(names)


def test_no_test_imports_another():
    """What two of them need is in support/."""
    themes = {path.stem for path in THEMES}
    for path in FILES:
        assert not themes.intersection(imported(path)), path


def test_files_of_tests_that_a_page_names_exist():
    for page in PAGES:
        for name in re.findall(r"\b(?:tests|benchmarks)/[\w/]*\w\.\w+\b", page.read_text()):
            assert (ROOT / name).exists(), f"{page} names {name}"
