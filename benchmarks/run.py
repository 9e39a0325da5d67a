# SPDX-License-Identifier: BSD-3-Clause
"""Measure halfshell against the libraries that are installed, on named scenes.

    python benchmarks/run.py                      the scenes with a wanted ratio, every peer
    python benchmarks/run.py --group S1 S2        families of scenes; --list names them
    python benchmarks/run.py --scenes pairs-1e5-k52 triclinic-1e4-k52 --peers vesin cKDTree
    python benchmarks/run.py --quick              smoke run of a few seconds

The answers are compared before anything is timed. Exit status 1 means that an answer of ours
was wrong; slow is no error. `README.md` beside this file says how to read the tables.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pages
from halfshell import _core
from libraries.contestant import Halfshell, pin_threads
from libraries.peers import PEERS
from measure import machine
from measure.runner import Patience, measure_scene
from scenes import GROUPS, QUICK, SCENES, TITLES, Limit, load


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    options = _parse(arguments)
    if options.list:
        for group, names in GROUPS.items():
            print(f"{group}: {TITLES[group]}\n    {' '.join(names)}")
        return 0
    pin_threads()
    cores = machine.usable_cores() if options.core is None else [options.core]
    ours = None if options.without_halfshell else Halfshell(_own_options(options))
    if ours is not None and ours.version() is None:
        print("halfshell cannot be imported; --without-halfshell measures peers alone")
        return 2
    peers = [PEERS[name] for name in options.peers if PEERS[name].version()]
    missing = [name for name in options.peers if not PEERS[name].version()]
    facts = machine.facts(options.machine, _simd(options, ours), _compiler(ours))
    print(f"{facts['cpu']}, kernel {facts['kernel'] or '-'}, commit {facts['commit']}")
    if facts["load"] and facts["load"] > 0.5:
        print(f"load {facts['load']}: other programs run here, figures are too high and uneven")
    if missing:
        print(f"not installed: {', '.join(missing)}")
    patience = _patience(options)
    machine.touch_memory(min(patience.hold, 1 << 28) if options.quick else patience.hold)

    measured: list[pages.Measurement] = []
    wanted: dict[str, float | None] = {}
    limits: dict[str, tuple[Limit, ...]] = {}
    correct = True
    for name in options.scenes:
        scene = load(name)
        if scene.threads > len(cores):
            print(f"{name}: left out, {len(cores)} core(s)")
            continue
        if not options.no_pin:
            machine.pin_to_cores(cores[: scene.threads])
        rows, good = measure_scene(scene, ours, peers, patience)
        if not options.no_pin:
            machine.pin_to_cores(cores)
        wanted[name], limits[name] = scene.want, scene.limits
        if options.output and rows:
            pages.write_csv(options.output, facts, rows, wanted)
        measured += rows
        correct &= good
    for table in (
        pages.table_of_contestants(measured),
        pages.table_of_ratios(pages.ratio_rows(measured, wanted)),
        pages.table_of_limits(pages.limit_rows(measured, limits)),
        pages.table_of_single_calls(measured),
    ):
        pages.render(table, rich=not options.plain)
    if options.output:
        print(f"wrote {options.output}")
    if not correct:
        print("AN ANSWER OF HALFSHELL IS WRONG")
    return 0 if correct else 1


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=(__doc__ or "").partition("\n")[0],
        epilog="; ".join(f"{group}: {title}" for group, title in TITLES.items()),
    )
    parser.add_argument("--group", nargs="+", choices=[*GROUPS, "all"], metavar="GROUP",
                        help="groups of scenes (main); all: every one")  # fmt: skip
    parser.add_argument("--scenes", nargs="+", choices=SCENES, metavar="NAME",
                        help="single scenes")  # fmt: skip
    parser.add_argument("--list", action="store_true", help="name groups and scenes, and end")
    parser.add_argument("--peers", nargs="*", choices=PEERS, default=list(PEERS), metavar="NAME",
                        help=f"of {', '.join(PEERS)}; default: all that are installed")  # fmt: skip
    parser.add_argument("--repeats", type=int, default=7, help="turns of each call (7)")
    parser.add_argument("--patience", type=float, default=60.0, metavar="SECONDS",
                        help="most time for one peer on one scene (60)")  # fmt: skip
    parser.add_argument("--hold", type=float, default=0.4, metavar="SHARE",
                        help="share of the available memory for held results (0.4)")  # fmt: skip
    parser.add_argument("--largest", type=float, default=0.2, metavar="SHARE",
                        help="share of the available memory for one result (0.2)")  # fmt: skip
    parser.add_argument("--quick", action="store_true", help="small scenes, few turns")
    parser.add_argument("--kernel", help="one of halfshell.kernels(); default: the best")
    parser.add_argument("--core", type=int, help="core to stay on (the last)")
    parser.add_argument("--no-pin", action="store_true", help="let the system move the process")
    parser.add_argument("--machine", help="a name for the machine in the CSV file")
    parser.add_argument("--output", type=Path, metavar="CSV", help="append the figures to a file")
    parser.add_argument("--plain", action="store_true", help="tables without the rich package")
    parser.add_argument("--without-halfshell", action="store_true", help="peers alone")
    options = parser.parse_args(arguments)
    groups = GROUPS if options.group and "all" in options.group else options.group or []
    names = [name for group in groups for name in GROUPS[group]] + (options.scenes or [])
    names = names or list(QUICK if options.quick else GROUPS["main"])
    options.scenes = list(dict.fromkeys(names))
    return options


def _patience(options: argparse.Namespace) -> Patience:
    available = _core.available_memory()
    return Patience(
        repeats=min(options.repeats, 3) if options.quick else options.repeats,
        seconds=min(options.patience, 0.3) if options.quick else options.patience,
        hold=int(options.hold * available), largest=int(options.largest * available),
        quick=options.quick,
    )  # fmt: skip


def _own_options(options: argparse.Namespace) -> dict[str, Any]:
    return {"kernel": options.kernel} if options.kernel else {}


def _simd(options: argparse.Namespace, ours: Halfshell | None) -> str:
    """Name the kernel that our calls use."""
    if ours is None:
        return ""
    import halfshell as hs

    return options.kernel or hs.kernels()[0]


def _compiler(ours: Halfshell | None) -> str:
    """Name the compiler that built our extension."""
    if ours is None:
        return ""
    return str(_core.build_info().get("compiler", ""))


if __name__ == "__main__":
    sys.exit(main())
