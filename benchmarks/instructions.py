# SPDX-License-Identifier: BSD-3-Clause
"""How many instructions one call takes, scene by scene: what changes when times are too noisy.

    python benchmarks/instructions.py [--scenes NAME ...] [--output CSV] [--against CSV]

Valgrind counts them: much the same number again for the same build and input, whatever else the
machine does. Of each scene one process makes some calls more than another, and the difference is
shared among these: calls on one thread with recycled results, by the best kernel that Valgrind
knows (AVX2). Exit status 1 means that a scene takes over 3 % more than in the other file.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from libraries.contestant import Halfshell
from libraries.peers import ours_for
from pages import render
from scenes import SCENES, load

__all__ = ["count", "main"]

DEFAULT = (
    "single-30", "single-100", "pairs-1e4-k52", "pairs-1e5-k52", "vectors-1e5-k52", "open-1e4",
    "triclinic-1e4-k52", "plane-1e5-k20", "clusters-1e5", "images-64", "silicon-8", "fcc-tie",
    "batch-1e4-periodic", "rows-1e4-k52", "between-1e5", "count-1e5-k52", "histogram-1e5-k52",
    "nearest-1e5-periodic", "nearest-1e5-one", "balls-1to10-1e5", "types-3-1e5",
)  # fmt: skip
MOST = 1.03  # of the other file's count
ENOUGH = 10**9  # of all calls: starting Python takes some millions more or less


def _call(name: str, times: int) -> None:
    """Make the calls that are counted, after one that is in both counts."""
    ours = ours_for(Halfshell(), load(name))
    assert ours is not None
    call = ours.prepare(load(name))
    for _ in range(1 + times):
        call()


def _total(name: str, times: int) -> int:
    """Return the instructions of a process that makes so many calls and one more."""
    command = ["setarch", "-R", "valgrind", "--tool=cachegrind", "--cache-sim=no"]
    command += ["--cachegrind-out-file=/dev/null", sys.executable, "-B", __file__]
    command += ["--call", name, str(times)]
    done = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, "PYTHONHASHSEED": "0"}
    )
    found = re.search(r"I\s+refs:\s+([\d,]+)", done.stderr)
    if done.returncode or found is None:
        sys.exit(f"{name}: {done.stderr[-2000:]}")
    return int(found[1].replace(",", ""))


def count(name: str) -> int:
    """Return the instructions of one call."""
    without, more = _total(name, 1), 4
    added = _total(name, 1 + more) - without
    if added < ENOUGH:
        more = min(1000, more * ENOUGH // max(added, 1))
        added = _total(name, 1 + more) - without
    return added // more


def main(arguments: Sequence[str] | None = None) -> int:
    """Count, print a table, and return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=DEFAULT, choices=SCENES, metavar="NAME")
    parser.add_argument("--output", type=Path, metavar="CSV")
    parser.add_argument("--against", type=Path, metavar="CSV")
    parser.add_argument("--call", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.call:
        _call(options.call[0], int(options.call[1]))
        return 0
    old: dict[str, int] = {}
    if options.against:
        with options.against.open(newline="", encoding="utf-8") as file:
            old = {row["scene"]: int(row["instructions"]) for row in csv.DictReader(file)}
    found = {}
    for name in options.scenes:
        found[name] = count(name)
        print(f"{name}  {found[name]:,}", file=sys.stderr, flush=True)
    if options.output:
        with options.output.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([("scene", "instructions"), *found.items()])
    table = [
        [name, f"{n:,}", f"{n / old[name]:.3f}" if name in old else ""] for name, n in found.items()
    ]
    render(("instructions of a call", ["scene", "instructions", "of before"], table))
    return int(any(n > MOST * old[name] for name, n in found.items() if name in old))


if __name__ == "__main__":
    sys.exit(main())
