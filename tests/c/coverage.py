# SPDX-License-Identifier: BSD-3-Clause
"""Fail if a branch of csrc/core that no C test takes is not in uncovered.txt with its reason.

Usage: python3 coverage.py PROGRAM PROFILE [part of a file's name], which `make coverage` calls.
PROFILE is what llvm-profdata merged from a run of PROGRAM, the C tests that clang built with
-fprofile-instr-generate -fcoverage-mapping. Uses $LLVM_COV, or llvm-cov. Prints the coverage of
each file, then the branches that are missing from the list, and the entries of the list that
belong to no such branch any more, unless they begin with "sometimes"; the exit code is 1 if there
are any. Branches of csrc/kernels are counted and do not fail. Of code that is compiled more than
once, as templates and inline functions are, a branch that is taken in one place is covered.
"""

import json
import os
import subprocess
import sys
from collections import Counter, defaultdict
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
CSRC = HERE.parent.parent / "csrc"
LIST = HERE / "uncovered.txt"
EXPANSION = 1  # the kind of a region in the export of llvm-cov


class Place(NamedTuple):
    """Where a condition is: the file and the span of its text, and of a macro around it."""

    file: Path
    span: tuple
    macro: tuple


class Branch(NamedTuple):
    """One side of a condition, as uncovered.txt names it: line numbers would not last."""

    file: str
    function: str
    side: str
    condition: str

    def __str__(self):
        return f"{self.file}  {self.function}  {self.side}  {self.condition}"


class Sources:
    """The text of source files."""

    def __init__(self):
        self.lines = {}

    def text(self, file, span):
        """What a span of llvm-cov (line, column, last line, column behind) holds, on one line."""
        if file not in self.lines:
            self.lines[file] = file.read_text().splitlines()
        first, start, last, behind = span
        lines = self.lines[file][first - 1 : last]
        lines[-1] = lines[-1][: behind - 1]
        lines[0] = lines[0][start - 1 :]
        return " ".join(" ".join(lines).split())


def export(program, profile):
    """The functions of the program, each with its regions and branches, as llvm-cov has them."""
    command = [os.environ.get("LLVM_COV", "llvm-cov"), "export", program]
    command += ["-instr-profile", profile]
    result = subprocess.run(command, stdout=subprocess.PIPE, text=True)
    if result.returncode:
        sys.exit(f"{command[0]} failed")
    return json.loads(result.stdout)["data"][0]["functions"]


def place_of(function, branch, files):
    """Where a branch is. One that a macro hides is where the outermost macro is written."""
    file_id = branch[6]
    outer = file_id
    macro = ()
    sites = {region[6]: region for region in function["regions"] if region[7] == EXPANSION}
    while outer in sites:
        macro = tuple(sites[outer][:4])
        outer = sites[outer][5]
    if not macro:
        return Place(files[file_id], tuple(branch[:4]), ())
    return Place(files[outer], macro, (files[file_id], *branch[:4]))


def read_counts(functions):
    """Place -> [how often true, how often false, names of the functions around it]."""
    counts = defaultdict(lambda: [0, 0, set()])
    paths = {}
    for function in functions:
        for name in function["filenames"]:
            if name not in paths:
                paths[name] = Path(name).resolve()
        files = [paths[name] for name in function["filenames"]]
        name = function["name"].rsplit(":", 1)[-1]
        for branch in function["branches"]:
            place = place_of(function, branch, files)
            if CSRC in place.file.parents:
                count = counts[place]
                count[0] += branch[4]
                count[1] += branch[5]
                count[2].add(name)
    return counts


def find_uncovered(counts):
    """Branch -> lines where it is not covered; file -> [branches, uncovered ones]."""
    sources = Sources()
    uncovered = defaultdict(list)
    totals = defaultdict(lambda: [0, 0])
    for place, (taken, passed, functions) in sorted(counts.items()):
        file = str(place.file.relative_to(CSRC))
        totals[file][0] += 2
        condition = sources.text(place.file, place.span)
        if place.macro:
            condition += ": " + sources.text(place.macro[0], place.macro[1:])
        for side, count in (("true", taken), ("false", passed)):
            if count == 0:
                totals[file][1] += 1
                uncovered[Branch(file, min(functions), side, condition)].append(place.span[0])
    return uncovered, totals


def read_list():
    """The entries of uncovered.txt, those that some runs cover, and those without a reason.

    The lines behind an entry, indented, are its reason.
    """
    entries, sometimes, bare = Counter(), set(), []
    entry, reason = None, ""
    for line in [*LIST.read_text().splitlines(), "the end"]:
        if not line.strip() or line.startswith("#"):
            continue
        if line[0].isspace():
            reason += line
            continue
        if entry is not None and not reason:
            bare.append(entry)
        if line == "the end":
            break
        varies = line.startswith("sometimes ")
        words = line.removeprefix("sometimes ").split(None, 3)
        if len(words) != 4 or words[2] not in ("true", "false"):
            sys.exit(f"{LIST.name}: not 'file function side condition': {line}")
        entry, reason = Branch(*words), ""
        entries[entry] += 1
        if varies:
            sometimes.add(entry)
    return entries, sometimes, bare


def print_table(totals, part):
    print(f"{'file':32} {'branches':>9} {'uncovered':>10} {'covered':>9}")
    sums = defaultdict(lambda: [0, 0])
    for file, (branches, missed) in sorted(totals.items()):
        folder = file.split("/")[0]
        sums[folder][0] += branches
        sums[folder][1] += missed
        if part in file:
            print(f"{file:32} {branches:9} {missed:10} {100 - 100 * missed / branches:8.1f} %")
    for folder, (branches, missed) in sorted(sums.items()):
        print(
            f"{'all of ' + folder:32} {branches:9} {missed:10} "
            f"{100 - 100 * missed / branches:8.1f} %"
        )


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    part = sys.argv[3] if len(sys.argv) == 4 else ""
    uncovered, totals = find_uncovered(read_counts(export(*sys.argv[1:3])))
    print_table(totals, part)

    listed, sometimes, bare = read_list()
    missing = 0
    for branch, lines in uncovered.items():
        unlisted = len(lines) - listed[branch]
        if unlisted > 0 and branch.file.startswith("core/") and part in branch.file:
            missing += unlisted
            print(f"uncovered, line {', '.join(map(str, lines))}:  {branch}")
    needless = 0
    for entry, count in listed.items():
        surplus = count - len(uncovered.get(entry, ()))
        if surplus > 0 and part in entry.file and entry not in sometimes:
            needless += surplus
            print(f"{LIST.name}, covered by now or not there:  {entry}")
    for entry in bare:
        print(f"{LIST.name}, without a reason:  {entry}")
    print(
        f"{missing} uncovered branches are not in {LIST.name}; of its {sum(listed.values())} "
        f"entries {needless} belong to none, {len(bare)} have no reason"
    )
    return 1 if missing or needless or bare else 0


if __name__ == "__main__":
    sys.exit(main())
