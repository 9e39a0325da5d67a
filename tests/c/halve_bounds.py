# SPDX-License-Identifier: BSD-3-Clause
"""Halve every error constant of csrc/core/exact/bounds.h in turn and demand that a C test fails.

Usage: python3 halve_bounds.py [part of a constant's name]. Uses $CC, or cc. Prints a table; the
exit code is 1 if a constant can be halved without a test noticing, or if the tests fail as they
are.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
CORE = HERE.parent.parent / "csrc" / "core" / "exact"
COMPILER = os.environ.get("CC", "cc").split()
FLAGS = ["-std=c11", "-O2", "-ffp-contract=off", "-UNDEBUG", "-DHS_TESTING=1", f"-I{HERE}"]

MODULES = ["doubleword", "metric_decide", "metric_integer", "metric_compare", "metric_measure"]
MODULES += ["metric_sum", "filter", "limit_form", "expanded", "reach"]
MODULES += ["dyadic", "support", "support_form", "metric_support"]
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


def uses_bounds(source):
    """Whether a source file sees bounds.h, by the compiler's own account."""
    command = [*COMPILER, *FLAGS, "-MM", str(source)]
    listing = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return "bounds.h" in listing


def run_tests(objects, folder):
    """Number of failed checks, and the names of the tests that they are in."""
    program = folder / "tests"
    subprocess.run([*COMPILER, *map(str, objects), "-o", str(program), "-lm"], check=True)
    result = subprocess.run([str(program)], capture_output=True, text=True, timeout=60)
    lines = [line for line in result.stderr.splitlines() if ": CHECK(" in line]
    if result.returncode and not lines:
        return 1, [f"exit code {result.returncode}"]
    names = sorted({line.split(": ")[1] for line in lines})
    return len(lines), names


def try_constant(name, value, fixed, dependent, scratch):
    folder = scratch / name
    folder.mkdir()
    objects = [compile_object(source, folder, f"{name}=(({value})/2)") for source in dependent]
    return run_tests(fixed + objects, folder)


def main():
    wanted = sys.argv[1] if len(sys.argv) > 1 else ""
    with tempfile.TemporaryDirectory() as temporary, ThreadPoolExecutor(2) as pool:
        scratch = Path(temporary)
        shutil.copy(HERE / "main.c", scratch)
        (scratch / "modules.h").write_text("".join(f"MODULE({name})\n" for name in MODULES))

        dependent = [source for source in SOURCES if uses_bounds(source)]
        independent = [source for source in SOURCES if source not in dependent]
        base = scratch / "unchanged"
        base.mkdir()
        fixed = list(
            pool.map(
                lambda source: compile_object(source, base), [scratch / "main.c", *independent]
            )
        )
        unchanged = list(pool.map(lambda source: compile_object(source, base), dependent))
        count, names = run_tests(fixed + unchanged, base)
        if count:
            sys.exit(f"the tests fail as they are: {', '.join(names)}")

        chosen = [(name, value) for name, value in constants() if wanted in name]
        results = pool.map(lambda c: try_constant(*c, fixed, dependent, scratch), chosen)
        survivors = 0
        print(f"{'constant, halved':34} {'value':>9} {'failed checks':>14}  in")
        for (name, value), (count, names) in zip(chosen, results):
            survivors += count == 0
            print(f"{name:34} {value:>9} {count or 'SURVIVES':>14}  {', '.join(names)}")
    print(f"{len(chosen)} constants, {survivors} survived")
    return 1 if survivors or not chosen else 0


if __name__ == "__main__":
    sys.exit(main())
