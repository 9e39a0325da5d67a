# SPDX-License-Identifier: BSD-3-Clause
"""Measure everything, draw the figures and fill docs/performance.md: one command.

    python benchmarks/reproduce.py [--patience 20]

Takes some hours with the default patience. Needs the `bench` and `cli` extras. Files go to
`benchmarks/results/<cpu>/`, named after the day.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from measure import machine
from scenes import GROUPS

__all__ = ["commands", "main", "result_stem"]

_HERE = Path(__file__).resolve().parent


def result_stem(folder: Path) -> Path:
    """Return a path without its ending for new result files, none of an earlier run."""
    cpu = re.sub(r"[^a-z0-9]+", "-", machine.facts()["cpu"].lower()).strip("-") or "unknown"
    day = datetime.now(UTC).date().isoformat()
    names = [day, *(f"{day}-{number}" for number in range(2, 100))]
    return next(
        folder / cpu / name for name in names if not (folder / cpu / f"{name}.csv").exists()
    )


def commands(stem: Path, kernels: Sequence[str], patience: float) -> list[list[str]]:
    """Return the arguments of every script, in order."""
    results = f"{stem}.csv"
    run = ["run.py", "--output", results, "--patience", str(patience), "--plain"]
    lines = [
        name for name in GROUPS["S1"]
        if name.endswith("-k50") or name.startswith("uniform-1e5-")
    ]  # fmt: skip
    made = [[*run, "--group", *(group for group in GROUPS if group != "S1")]]
    made.append([*run, "--group", "S1"])
    made += [[*run, "--scenes", *lines, "--peers", "--kernel", name] for name in kernels[1:]]
    made.append(["footprint.py", "--plain", "--output", f"{stem}-memory.csv"])
    made.append(["stages.py", "--plain", "--output", f"{stem}-stages.csv"])
    made.append(["plot.py", results, "-o", str(_HERE.parent / "docs" / "figures")])
    made.append([
        "fill_docs.py", "--results", results, "--memory", f"{stem}-memory.csv",
        "--stages", f"{stem}-stages.csv",
    ])  # fmt: skip
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status of the first script that failed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--patience", type=float, default=20.0, metavar="SECONDS",
                        help="most time for one peer on one scene (20)")  # fmt: skip
    parser.add_argument("--results", type=Path, default=_HERE / "results", metavar="FOLDER")
    parser.add_argument("--dry-run", action="store_true", help="print the commands alone")
    options = parser.parse_args(arguments)
    import halfshell as hs

    for command in commands(result_stem(options.results), hs.kernels(), options.patience):
        print(f"$ python benchmarks/{' '.join(command)}", flush=True)
        if options.dry_run:
            continue
        script, *rest = command
        status = subprocess.run([sys.executable, str(_HERE / script), *rest]).returncode
        if status:
            return status
    return 0


if __name__ == "__main__":
    sys.exit(main())
