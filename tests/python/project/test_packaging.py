# SPDX-License-Identifier: BSD-3-Clause
"""The headers are where `halfshell.get_include` says, in whatever way the package was installed."""

import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

import halfshell as hs
from checkout import CSRC, ROOT

pytestmark = pytest.mark.slow

HEADERS = ["halfshell.h", "halfshell_capi.h", "halfshell_dynamic.h", "halfshell_nodes.h"]


def checkout_files():
    """Files under version control; without it, as in a source distribution, all that is there."""
    listed = None
    if (ROOT / ".git").exists() and shutil.which("git"):
        command = ["git", "-C", str(ROOT), "ls-files", "-z"]
        listed = subprocess.run(command, capture_output=True, text=True)
    if listed is not None and listed.returncode == 0:
        return {name for name in listed.stdout.split("\0") if (ROOT / name).is_file()}
    left = {"build", "dist", "__pycache__", "PKG-INFO", "setup.cfg"}
    names = {path.relative_to(ROOT) for path in ROOT.rglob("*") if path.is_file()}
    return {
        name.as_posix()
        for name in names
        if not left & set(name.parts)
        and not name.parts[0].startswith((".venv", ".git", ".pytest", ".hyp", ".mypy", ".ruff"))
        and not any(part.endswith(".egg-info") for part in name.parts)
        and name.suffix not in {".so", ".o"}
    }


@pytest.fixture
def copy(tmp_path):
    """A copy of the checkout, for builds leave files behind."""
    folder = tmp_path / "checkout"
    for name in checkout_files():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, folder / name)
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
    for folder in (package, package.parent / "halfshell_report"):
        assert (folder / "py.typed").exists() and (folder / "__init__.py").exists()
    assert (package.parent / "halfshell_report" / "scenes" / "__init__.py").exists()


def test_a_source_distribution_has_the_whole_checkout(copy, tmp_path):
    leftover = copy / "tests" / "c" / "build" / "tsan" / "main.c"
    leftover.parent.mkdir(parents=True)
    leftover.touch()
    build(copy, "sdist", "--dist-dir", tmp_path / "dist")
    (archive,) = (tmp_path / "dist").glob("*.tar.gz")
    with tarfile.open(archive) as files:
        names = {one.name.split("/", 1)[-1] for one in files.getmembers() if one.isfile()}
    made = {name for name in names if name in ("PKG-INFO", "setup.cfg") or ".egg-info/" in name}
    assert names - made == checkout_files() - {".gitignore"}
    assert archive.stat().st_size < 3_000_000
