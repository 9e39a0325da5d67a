# SPDX-License-Identifier: BSD-3-Clause
"""The judge of mutants of csrc/binding, for mutants.py --binding: the Python tests, with a package
whose extension has the mutant in it. Takes the Python that runs it, with NumPy and pytest."""

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from queue import Queue

from mutants import COMPILER, ROOT, Judge, copy_tree, demand, run

PARTS = ["csrc/core", "csrc/kernels", "csrc/binding"]
TESTS = ROOT / "tests" / "python"
FLAGS = ["-std=c11", "-O2", "-ffp-contract=off", "-UNDEBUG", "-fPIC", "-pthread", "-w"]
NAME = "_core" + sysconfig.get_config_var("EXT_SUFFIX")

# Themes of each file of the binding, as names of tests say them, besides its own name.
THEMES = {
    "arguments": "core_arguments interrupt threads boundary_cases quantities reach exclusions",
    "functions": "quick core_arguments array_forms",
    "interface": "quick core_arguments",
    "outputs": "quantities table array_forms pairs",
    "errors": "boundary statuses for_each_pair explain cell_list",
    "py_searches": "quantities pairs neighbors between table nearest clusters histogram",
    "py_cells": "cell_ verlet box",
    "py_streams": "iter_pairs for_each_pair",
    "py_nodes": "connectivity",
    "py_dynamic": "dynamic",
    "system": "environment available_memory threads",
    "capi": "capi",
    "module": "capi iter_pairs cache environment",
}
# Tests of many files, which come next. Left out at the end are those of programs and pages, and
# those that run other builds or other libraries.
FIRST = ["core_arguments", "quick", "quantities", "errors", "no_memory"]
LEFT_OUT = ["adversarial", "benchmark", "report", "cli", "c_interface", "packaging", "docs"]
LEFT_OUT += ["typing", "golden", "selftest", "scene", "peers", "notebooks", "site", "dask", "mpi"]
LEFT_OUT += ["framework", "torch", "jax"]
SECONDS = 900  # for the tests of one file


class PythonTests(Judge):
    folder = "csrc/binding"

    def __init__(self, work, jobs):
        self.work = work / "binding"
        self.free = Queue()
        import numpy

        self.includes = ["-I" + numpy.get_include(), "-I" + sysconfig.get_path("include")]
        copy_tree(self.work / "base")
        objects = self.work / "objects"
        shutil.rmtree(objects, ignore_errors=True)
        objects.mkdir()
        base = self.work / "base"
        sources = sorted(path for part in PARTS for path in (base / part).rglob("*.c"))
        with ThreadPoolExecutor(jobs) as pool:
            done = list(
                pool.map(lambda s: self.compile(base, s, objects / (s.stem + ".o")), sources)
            )
        errors = "".join(d.stderr for d in done if d.returncode)
        if errors:
            sys.exit(errors)
        self.objects = sorted(objects.glob("*.o"))
        self.unchanged = self.work / "unchanged"
        self.copy_package(self.unchanged)
        self.link_in(self.unchanged, self.objects)
        for number in range(jobs):
            tree = self.work / f"job{number}"
            self.copy_package(tree)
            self.free.put(tree)
        self.check_unchanged()

    def copy_package(self, tree):
        """The tree, with a package that has no extension yet."""
        copy_tree(tree)
        package = tree / "python" / "halfshell"
        shutil.rmtree(package, ignore_errors=True)
        shutil.copytree(ROOT / "python" / "halfshell", package)
        for old in package.glob("_core.*.so"):
            old.unlink()

    def compile(self, tree, source, target):
        name = source.relative_to(tree)
        command = [*COMPILER, *FLAGS, *self.includes, "-c", name, "-o", target]
        return run(command, cwd=tree, timeout=300)

    def link_in(self, tree, objects):
        linker = shlex.split(sysconfig.get_config_var("LDSHARED"))
        demand([*linker, *objects, "-o", tree / "python" / "halfshell" / NAME, "-lm", "-pthread"])

    def check_unchanged(self):
        """That the package is found, and passes what comes first."""
        for path in (path for name in FIRST for path in TESTS.rglob(f"test_{name}.py")):
            failed = self.failure(self.unchanged, path)
            if failed:
                sys.exit(f"the tests fail as they are: {failed}")

    def near(self, name):
        """Files of tests, those of the mutant's theme first."""
        stem = name.removesuffix(".c")
        themes = [*THEMES.get(stem, "").split(), stem.removeprefix("py_"), *FIRST]
        files = [
            path
            for path in sorted(TESTS.rglob("test_*.py"))
            if not any(word in path.stem for word in LEFT_OUT)
        ]

        def rank(path):
            return next((n for n, theme in enumerate(themes) if theme in path.stem), len(themes))

        return sorted(files, key=rank)

    def failure(self, tree, path):
        """The first test of a file that fails, or how the process ends; "" if all pass."""
        environment = {
            **os.environ,
            "PYTHONPATH": str(tree / "python"),
            "HYPOTHESIS_STORAGE_DIRECTORY": str(self.work / "hypothesis"),
        }
        command = [
            sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider",
            "-o", "addopts=", str(path),
        ]  # fmt: skip
        try:
            done = run(command, cwd=TESTS, env=environment, timeout=SECONDS)
        except subprocess.TimeoutExpired:
            return f"{path.name} hangs"
        if done.returncode in (0, 5):
            return ""
        lines = [line for line in done.stdout.splitlines() if line.startswith("FAILED")]
        return lines[0].split(" ")[1] if lines else f"{path.name} crashes"

    def first_failure_of(self, tree, mutation, source):
        """Of those that pass without the mutant."""
        for path in self.near(mutation.file):
            failed = self.failure(tree, path)
            if failed and not self.failure(self.unchanged, path):
                return failed, ""
        return "", ""
