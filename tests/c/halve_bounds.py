# SPDX-License-Identifier: BSD-3-Clause
"""Halve every error constant of csrc/core/exact/bounds.h in turn and demand that a C test fails.

Usage: python3 halve_bounds.py [--all] [part of a constant's name]. Uses $CC, or cc. Prints a table
of the first test that fails for each constant, or of all of them; the exit code is 1 if a constant
can be halved without a test noticing, or if the tests fail as they are.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event, Timer

HERE = Path(__file__).resolve().parent
CORE = HERE.parent.parent / "csrc" / "core" / "exact"
COMPILER = os.environ.get("CC", "cc").split()
FLAGS = ["-std=c11", "-O2", "-ffp-contract=off", "-UNDEBUG", "-DHS_TESTING=1", f"-I{HERE}"]

MODULES = ["arithmetic", "metric", "filter", "ellipsoid"]
SOURCES = sorted(CORE.glob("*.c"))
SOURCES += [HERE / "exact" / f"test_{name}.c" for name in MODULES]


def constants():
    """Name and value of every overridable macro of bounds.h."""
    text = (CORE / "bounds.h").read_text()
    found = re.findall(r"^#ifndef (HS_\w+)\n#define \1 (\S+)$", text, re.MULTILINE)
    defined = set(re.findall(r"^#define (HS_\w+) ", text, re.MULTILINE))
    missed = defined - {name for name, _ in found}
    if missed:
        sys.exit(f"bounds.h defines {sorted(missed)} in a form that cannot be overridden")
    return found


def compile_object(source, folder, define=None):
    target = folder / (source.stem + ".o")
    extra = [f"-D{define}"] if define else []
    subprocess.run([*COMPILER, *FLAGS, *extra, "-c", str(source), "-o", str(target)], check=True)
    return target


def uses(source, names):
    """Those of these constants that a source file uses: a macro that stands for itself is left by
    the preprocessor wherever it is expanded."""
    defines = [f"-D{name}={name}" for name in names]
    command = [*COMPILER, *FLAGS, *defines, "-E", "-P", str(source)]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return set(names) & set(re.findall(r"\w+", text))


def run_tests(objects, folder, first=False):
    """Number of failed checks, and the names of the tests that they are in; up to the first."""
    program = folder / "tests"
    subprocess.run([*COMPILER, *map(str, objects), "-o", str(program), "-lm"], check=True)
    names = []
    with subprocess.Popen(
        [program], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as running:
        hung = Event()
        limit = Timer(60, lambda: (hung.set(), running.kill()))
        limit.start()
        for line in running.stderr:
            if ": CHECK(" in line:
                names.append(line.split(": ")[1])
                if first:
                    running.kill()
                    break
        limit.cancel()
    if hung.is_set():
        raise TimeoutError(f"{program} takes more than a minute")
    if running.returncode and not names:
        return 1, [f"exit code {running.returncode}"]
    return len(names), sorted(set(names))


def try_constant(name, value, objects, using, scratch, first):
    """As run_tests: with a constant halved in the objects of the sources that use it."""
    folder = scratch / name
    folder.mkdir()
    objects = dict(objects)
    for source in using:
        objects[source] = compile_object(source, folder, f"{name}=(({value})/2)")
    return run_tests(objects.values(), folder, first)


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--all", action="store_true", help="all tests that fail, not the first")
    parser.add_argument("wanted", nargs="?", default="", metavar="part of a constant's name")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary, ThreadPoolExecutor(2) as pool:
        scratch = Path(temporary)
        shutil.copy(HERE / "main.c", scratch)
        (scratch / "modules.h").write_text("".join(f"MODULE({name})\n" for name in MODULES))

        sources = [scratch / "main.c", *SOURCES]
        compiled = pool.map(lambda source: compile_object(source, scratch), sources)
        objects = dict(zip(sources, compiled))
        count, names = run_tests(objects.values(), scratch)
        if count:
            sys.exit(f"the tests fail as they are: {', '.join(names)}")

        every = [name for name, _ in constants()]
        used = dict(zip(sources, pool.map(lambda source: uses(source, every), sources)))
        chosen = [(name, value) for name, value in constants() if options.wanted in name]

        def try_one(constant):
            using = [source for source in sources if constant[0] in used[source]]
            return try_constant(*constant, objects, using, scratch, not options.all)

        results = pool.map(try_one, chosen)
        survivors = 0
        print(f"{'constant, halved':34} {'value':>9} {'failed checks':>14}  in")
        for (name, value), (count, names) in zip(chosen, results):
            survivors += count == 0
            print(f"{name:34} {value:>9} {count or 'SURVIVES':>14}  {', '.join(names)}")
    print(f"{len(chosen)} constants, {survivors} survived")
    return 1 if survivors or not chosen else 0


if __name__ == "__main__":
    sys.exit(main())
