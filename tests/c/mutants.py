# SPDX-License-Identifier: BSD-3-Clause
"""Change the C core at random places, one place at a time, and see whether a C test notices.

Usage: python3 mutants.py [--jobs N] [--work FOLDER] SEED NUMBER [part of a file's name]
       python3 mutants.py [--jobs N] [--work FOLDER] --at FILE:LINE[-LINE] ...
       python3 mutants.py [...] --binding SEED NUMBER [part of a file's name]
       python3 mutants.py --least PERCENT [...]

The first form tries NUMBER changes chosen by SEED in csrc/core/*/*.c, the second all changes of
some lines; mutations.py says what is changed. Each mutant is compiled, linked with what has not
changed, and judged by the C tests that reach its function, quick ones first, then by quick ones
that reach its file, until one fails, crashes or takes far longer than it should. --binding changes
csrc/binding instead: mutants_python.py has the Python tests judge. Uses $CC, or cc; "ccache gcc"
makes the first build quick. $MUTANT_FLAGS: further flags for the core; with
-fsanitize=address,undefined,float-cast-overflow the sanitizers judge too, in several times as long.

Prints a line for each mutant, and the rate at the end:

  killed      and by which test
  lived       no test noticed: a test is missing, or the change makes no difference (the comment
              says "not reached" if no test enters the function)
  same code   the compiler makes the same object of it: not counted
  no compile  not counted

The exit code is 1 if a mutant lived, or with --least 90 if fewer than 90 of 100 were killed.
FOLDER (default: build/mutants) keeps what was built and which test reaches what, until a source
changes.
"""

import argparse
import hashlib
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from threading import Lock

from mutations import functions, mutations

TOOK = re.compile(r"^ *([\d.]+) s  (\w+)$", re.MULTILINE)
HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
COMPILER = os.environ.get("CC", "cc").split()
FLAGS = ["-std=c11", "-O2", "-ffp-contract=off", "-UNDEBUG", "-DHS_TESTING=1", "-w"]
FURTHER = os.environ.get("MUTANT_FLAGS", "").split()
LIBRARIES = ["-lm", "-lpthread"] + ["-Wl,--wrap=pthread_create"] * sys.platform.startswith("linux")
PARTS = ["csrc/core", "csrc/kernels", "tests/c"]
QUICK = 0.1  # seconds of a test

# A call of what is below precedes each basic block of the core. The harness counts the tests.
REACH_FLAGS = ["-O1", "-g", "-fPIE", "-fsanitize-coverage=trace-pc"]
REACH_C = r"""
#include <stdio.h>
#include <stdlib.h>
enum { TESTS = 2048, CODE = 1 << 22 };
extern char __executable_start;
extern int harness_tests;
static unsigned char seen[TESTS][CODE / 8];
void __sanitizer_cov_trace_pc(void)
{
    const size_t at = (size_t)((char *)__builtin_return_address(0) - &__executable_start) - 1;
    unsigned char *byte = &seen[harness_tests % TESTS][at % CODE / 8];
    const unsigned char bit = (unsigned char)(1u << at % 8);
    if (!(*byte & bit))
        __atomic_fetch_or(byte, bit, __ATOMIC_RELAXED);
}
__attribute__((destructor)) static void report(void)
{
    FILE *file = fopen(getenv("REACHED"), "w");
    if (harness_tests >= TESTS)
        abort();
    for (int t = 1; t <= harness_tests; t++) {
        for (size_t at = 0; at < CODE; at++)
            if (seen[t][at / 8] >> at % 8 & 1)
                fprintf(file, "%zx ", at);
        fputc('\n', file);
    }
    fclose(file);
}
"""


def run(command, **options):
    return subprocess.run([*map(str, command)], capture_output=True, text=True, **options)


def demand(command, **options):
    done = run(command, **options)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout[-2000:]}{done.stderr[-4000:]}")
    return done.stdout


def sources(tree):
    found = (path for part in PARTS for path in (tree / part).rglob("*.c"))
    left_out = re.compile(r"tests/c/(build.*|fuzz|golden)/")  # build-san, too
    return sorted(p for p in found if not left_out.match(p.relative_to(tree).as_posix()))


def digest(paths):
    total = hashlib.sha256(" ".join(COMPILER + FLAGS + FURTHER).encode())
    for path in sorted(paths):
        total.update(path.read_bytes())
    return total.hexdigest()


def copy_tree(target):
    """The sources, in a place of their own: they may change while this runs."""
    shutil.rmtree(target, ignore_errors=True)
    for part in ("csrc", "tests/c"):
        for path in [*(ROOT / part).rglob("*.[ch]"), *(ROOT / part).glob("*/*.txt")]:
            place = target / path.relative_to(ROOT)
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, place)


def compile_object(tree, source, target, flags=()):
    """From within the tree, by a relative path: objects then only differ where the code does."""
    name = source.relative_to(tree)
    return run(
        [*COMPILER, *FLAGS, *FURTHER, *flags, "-c", name, "-o", target], cwd=tree, timeout=300
    )


def build(pool, tree, folder, flags=()):
    """Objects of all sources of the core and the tests, flags being for those of the core."""
    folder.mkdir(exist_ok=True)

    def one(source):
        extra = flags if "core" in source.parts else ["-fPIE"] if flags else ()
        done = compile_object(tree, source, folder / (source.stem + ".o"), extra)
        return done.stderr if done.returncode else ""

    errors = "".join(pool.map(one, sources(tree)))
    if errors:
        sys.exit(errors)
    return sorted(folder.glob("*.o"))


def trace(pool, work):
    """{test: lines of the core that it reaches, by file}, {test: seconds}, by one run of all."""
    folder, program = work / "reach", work / "reach" / "core_tests"
    objects = build(pool, work / "base", folder, REACH_FLAGS)
    (folder / "reach.c").write_text(REACH_C)
    linking = [*COMPILER, *FURTHER, "-O2", "-fPIE", "-pie", folder / "reach.c", *objects]
    demand([*linking, "-o", program, *LIBRARIES])
    environment = {**os.environ, "REACHED": str(folder / "reached")}
    said = run([program, "-t"], env=environment, timeout=3600).stdout
    names, seconds = [], {}
    for taken, name in TOOK.findall(said):
        names.append(name)
        seconds[name] = seconds.get(name, 0.0) + float(taken)  # two tests may have one name
    lists = [line.split() for line in (folder / "reached").read_text().splitlines()]
    if not names or len(names) != len(lists):
        sys.exit(f"{len(names)} tests said their names, {len(lists)} reached anything")
    places = sorted({place for hits in lists for place in hits})
    found = run(["addr2line", "-e", program], input="\n".join(places)).stdout.splitlines()
    line_of = dict(zip(places, found))
    reached = {}
    for name, hits in zip(names, lists):
        files = reached.setdefault(name, {})
        for place in hits:
            path, _, line = line_of[place].split(" ")[0].rpartition(":")
            if line.isdigit():
                files.setdefault(Path(path).name, set()).add(int(line))
    shutil.rmtree(folder)
    reached = {
        name: {file: sorted(lines) for file, lines in files.items()}
        for name, files in reached.items()
    }
    return {"reached": reached, "seconds": seconds}


class Judge:
    """Compiles mutants and has tests judge them, each job in a tree of sources of its own.

    A kind of judge has `folder`, where its sources are, and sets `work`, `free` (the trees that no
    job uses) and `objects` (what is linked); `compile` and `link_in` are as their names say, and
    `first_failure_of` returns the test that fails, or "" and a comment.
    """

    def judge(self, mutation, source):
        tree = self.free.get()
        try:
            return self.judge_in(tree, mutation, source)
        finally:
            self.free.put(tree)

    def judge_in(self, tree, mutation, source):
        path = next((tree / self.folder).rglob(mutation.file))
        target = tree / (path.stem + ".o")
        path.write_text(mutation.apply(source))
        compiled = self.compile(tree, path, target)
        path.write_text(source)
        if compiled.returncode:
            return "no compile", ""
        if target.read_bytes() == (self.work / "objects" / target.name).read_bytes():
            return "same code", ""
        self.link_in(tree, [o for o in self.objects if o.name != target.name] + [target])
        failed, comment = self.first_failure_of(tree, mutation, source)
        return ("killed", failed) if failed else ("lived", comment)


class CTests(Judge):
    """The judge of mutants of the core."""

    folder = "csrc/core"

    def __init__(self, work, jobs):
        self.work, self.lock, self.passes = work, Lock(), {}
        self.free = Queue()
        read = [*HERE.rglob("*.h"), *HERE.glob("*/*.txt"), *(ROOT / "csrc").rglob("*.h")]
        read += HERE.glob("fuzz/*.c")
        stamp = digest([*sources(ROOT), *read])
        kept = work / "reached.json"
        old = json.loads(kept.read_text()) if kept.exists() else {}
        with ThreadPoolExecutor(jobs) as pool:
            if old.get("stamp") != stamp:
                copy_tree(work / "base")
                shutil.rmtree(work / "objects", ignore_errors=True)
                build(pool, work / "base", work / "objects")
                old = {"stamp": stamp, **trace(pool, work)}
                kept.write_text(json.dumps(old))
        self.reached, self.seconds = old["reached"], old["seconds"]
        self.objects = sorted((work / "objects").glob("*.o"))
        self.program = work / "core_tests"
        self.link(self.objects, self.program)
        for number in range(jobs):
            tree = work / f"job{number}"
            shutil.rmtree(tree, ignore_errors=True)
            shutil.copytree(work / "base", tree)
            self.free.put(tree)

    def link(self, objects, program):
        demand([*COMPILER, *FURTHER, *objects, "-o", program, *LIBRARIES])

    def near(self, mutation, source):
        """Tests that enter the function, and of these first those that reach the line or the last
        before it that any reaches; then quick ones that reach the file elsewhere, for code that is
        inlined may count for its caller. None if no test enters the function."""
        first, last = next(f for f in functions(source) if f[0] < mutation.line < f[1])
        hits = {}
        for test, files in self.reached.items():
            lines = {n for n in files.get(mutation.file, ()) if first - 4 <= n <= last}
            if lines:
                hits[test] = lines
        seen = {n for lines in hits.values() for n in lines if n <= mutation.line}
        anchor = max(seen, default=0)
        inside = sorted(hits, key=lambda test: (anchor not in hits[test], self.seconds[test]))
        beside = [
            test
            for test in sorted(self.reached, key=self.seconds.get)
            if test not in hits and mutation.file in self.reached[test]
        ]
        return inside + [test for test in beside if self.seconds[test] <= QUICK] if hits else []

    def is_sound(self, test):
        """Whether the unchanged core passes a test, run alone."""
        with self.lock:
            if test not in self.passes:
                self.passes[test] = self.end_of(self.program, test) == ""
            return self.passes[test]

    def end_of(self, program, test):
        """How a test ends, if not well. The limit is of processor time, for machines are busy."""
        limit = int(5 + 5 * self.seconds[test])

        def limits():
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

        try:
            done = run([program, test], preexec_fn=limits, timeout=60 + 20 * limit)
        except subprocess.TimeoutExpired:
            return "hangs"
        if done.returncode == -signal.SIGXCPU or done.returncode == -signal.SIGKILL:
            return "takes too long"
        return {0: "", 1: "fails"}.get(done.returncode, "crashes")

    def compile(self, tree, source, target):
        return compile_object(tree, source, target)

    def link_in(self, tree, objects):
        self.link(objects, tree / "core_tests")

    def first_failure_of(self, tree, mutation, source):
        tests = self.near(mutation, source)
        for test in tests or sorted(self.reached, key=self.seconds.get):
            how = self.end_of(tree / "core_tests", test)
            if how and self.is_sound(test):
                return f"{test} {how}", ""
        return "", "" if tests else "not reached"


def choose(folder, options):
    """Mutations, and the text of each file."""
    texts = {path.name: path.read_text() for path in sorted((ROOT / folder).rglob("*.c"))}
    found = [m for name, text in texts.items() for m in mutations(name, text)]
    if options.at:
        lines = set()
        for place in options.at:
            name, first, last = re.fullmatch(r"([\w.]+):(\d+)(?:-(\d+))?", place).groups()
            lines.update((name, n) for n in range(int(first), int(last or first) + 1))
        return [m for m in found if (m.file, m.line) in lines], texts
    found = [m for m in found if options.part in m.file]
    chosen = random.Random(options.seed).sample(found, min(options.number, len(found)))
    return chosen, texts


def arguments():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--work", type=Path, default=HERE / "build" / "mutants")
    parser.add_argument("--binding", action="store_true")
    parser.add_argument("--at", nargs="+")
    parser.add_argument("--least", type=float, default=100.0)
    parser.add_argument("seed", type=int, nargs="?")
    parser.add_argument("number", type=int, nargs="?")
    parser.add_argument("part", nargs="?", default="")
    options = parser.parse_args()
    if not options.at and options.number is None:
        parser.error("a seed and a number, or --at")
    return options


def main():
    options = arguments()
    options.work = options.work.resolve()
    options.work.mkdir(parents=True, exist_ok=True)
    if options.binding:
        from mutants_python import PythonTests as Tests
    else:
        Tests = CTests
    chosen, texts = choose(Tests.folder, options)
    judge = Tests(options.work, options.jobs)
    totals = {"killed": 0, "lived": 0, "same code": 0, "no compile": 0}

    def one(mutation):
        return mutation, *judge.judge(mutation, texts[mutation.file])

    with ThreadPoolExecutor(options.jobs) as pool:
        for mutation, verdict, by in pool.map(one, chosen):
            totals[verdict] += 1
            place = f"{mutation.file}:{mutation.line}"
            print(f"{place:26} {mutation.what:24} {verdict:10} {by}", flush=True)
            if verdict == "lived":
                print(f"    {texts[mutation.file].splitlines()[mutation.line - 1].strip()}")
    judged = totals["killed"] + totals["lived"]
    print(", ".join(f"{number} {verdict}" for verdict, number in totals.items()))
    print(f"{totals['killed']} of {judged} killed: {100 * totals['killed'] / max(judged, 1):.1f} %")
    return 0 if 100 * totals["killed"] >= options.least * judged else 1


if __name__ == "__main__":
    sys.exit(main())
