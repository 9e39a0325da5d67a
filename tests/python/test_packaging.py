# SPDX-License-Identifier: BSD-3-Clause
"""The headers are where `halfshell.get_include` says, in whatever way the package was installed."""

import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

import halfshell as hs
from c_builds import CSRC, ROOT
from halfshell import _include

HEADERS = ["halfshell.h", "halfshell_capi.h"]


@pytest.fixture
def copy(tmp_path):
    """A copy of what a build reads, for builds leave files behind."""
    folder = tmp_path / "checkout"
    leftovers = shutil.ignore_patterns("__pycache__", "*.egg-info", "*.so", "*.o")
    for name in ("csrc", "python"):
        shutil.copytree(ROOT / name, folder / name, ignore=leftovers)
    for name in ("setup.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder / name)
    return folder


def build(folder, *arguments):
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "setup.py", "-q", *map(str, arguments)],
        cwd=folder, capture_output=True, text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_installed_headers_are_those_of_the_checkout():
    folder = Path(hs.get_include())
    assert folder.is_absolute()
    for name in HEADERS:
        assert (folder / name).read_bytes() == (CSRC / name).read_bytes()


def test_a_wheel_has_the_headers_and_nothing_else_of_the_core(copy, tmp_path):
    build(copy, "build_py", "--build-lib", tmp_path / "wheel")
    package = tmp_path / "wheel" / "halfshell"
    assert sorted(path.name for path in (package / "include").iterdir()) == HEADERS
    assert not list(package.rglob("*.c"))
    assert (package / "py.typed").exists() and (package / "scenes" / "__init__.py").exists()


def test_a_source_distribution_has_the_whole_core(copy, tmp_path):
    build(copy, "sdist", "--dist-dir", tmp_path / "dist")
    (archive,) = (tmp_path / "dist").glob("*.tar.gz")
    with tarfile.open(archive) as files:
        names = {name.split("/", 1)[-1] for name in files.getnames()}
    core = {path.relative_to(ROOT).as_posix() for path in CSRC.rglob("*.[ch]")}
    assert core <= names


def test_an_editable_installation_uses_the_checkout(tmp_path, monkeypatch):
    module = tmp_path / "python" / "halfshell" / "_include.py"
    (tmp_path / "csrc").mkdir()
    monkeypatch.setattr(_include, "__file__", str(module))
    with pytest.raises(FileNotFoundError, match=r"halfshell.h is missing from .*include"):
        hs.get_include()
    (tmp_path / "csrc" / "halfshell.h").touch()
    assert hs.get_include() == str(tmp_path / "csrc")
    (module.parent / "include").mkdir(parents=True)
    (module.parent / "include" / "halfshell.h").touch()
    assert hs.get_include() == str(module.parent / "include")
