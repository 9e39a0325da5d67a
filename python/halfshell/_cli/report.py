# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell report``: error against run time, in the terminal, as CSV and as a page."""

from __future__ import annotations

import io
import math
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from halfshell._cli.errors import InputError, missing_extra, one_line
from halfshell._cli.files import replacing
from halfshell._machine import unknown_kernel
from halfshell._terminal import printable

if TYPE_CHECKING:
    from halfshell._report.measure.run import Plan
    from halfshell._report.page.rows import ReportRow

__all__ = ["add_options", "add_peers", "run"]

_FULL_SECONDS = 10.0  # of a processor, a scene of full size by all methods of ours
_DETAILED = 4  # scenes at most whose tables are printed unasked


def add_options(command: ArgumentParser) -> None:
    """Add the options of the command."""
    sizes = command.add_mutually_exclusive_group()
    sizes.add_argument(
        "--size", choices=("small", "quick", "full"), default="quick",
        help="size of the scenes: some hundred, some thousand, about 100,000 points; "
        "default: quick",
    )  # fmt: skip
    sizes.add_argument(
        "--quick", action="store_const", const="quick", dest="size", help="the same as --size quick"
    )
    command.add_argument(
        "--scenes", type=_names, metavar="A,B",
        help="which, or 'all'; default: with --size quick one of each kind, about 20 s, else all",
    )  # fmt: skip
    command.add_argument(
        "--methods", type=_names, metavar="A,B",
        help="of exact, double, single, float32, verlet, stale; default: all",
    )  # fmt: skip
    add_peers(command, "; default: 60; with --size quick 1, and 2 for all scenes")
    command.add_argument(
        "-o", "--output", metavar="DIR", default="halfshell-report",
        help="folder for report.csv and report.html; default: halfshell-report",
    )  # fmt: skip
    command.add_argument("--details", action="store_true", help="print a table for every scene")
    command.add_argument("--list", action="store_true", help="print names of scenes and libraries")
    command.add_argument(
        "--no-progress", dest="progress", action="store_false", help="no progress bar"
    )


def add_peers(command: ArgumentParser, usual: str = "; default: 3") -> None:
    """Add what says which other libraries are run, and how long each may take."""
    command.add_argument(
        "--peers", type=_names, metavar="A,B",
        help="other libraries, 'all' or 'none'; default: all that are installed",
    )  # fmt: skip
    command.add_argument(
        "--patience", type=_seconds, metavar="S",
        help=f"seconds another library may take for a scene{usual}",
    )  # fmt: skip


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < math.inf:
        raise ArgumentTypeError(f"{text!r} is not a positive number of seconds")
    return value


def _names(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())


def run(args: Namespace) -> int:
    """Carry out ``halfshell report``: 0, or 1 if an exact method was wrong."""
    _require()
    if args.list:
        return _list()
    plan = _plan(args)
    unknown = unknown_kernel()
    if unknown is not None:
        raise InputError(unknown)
    folder = Path(args.output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: {one_line(error)}") from None
    from halfshell._report.measure.run import run as run_report

    if plan.size == "full":
        print(_forecast(plan), file=sys.stderr)
    with _progress_bar(args.progress) as progress:
        rows = run_report(plan, progress)
    if args.peers is None:
        rows = [row for row in rows if row.status != "not installed"]
    _write(folder, rows)
    _print(rows, args.details or len(plan.scenes) <= _DETAILED, folder)
    return int(any(row.wrong for row in rows if row.method in ("exact", "verlet")))


def _require() -> None:
    """Import what the report needs, before any work is done for it."""
    missing = []
    for module, package in (("scipy.spatial", "scipy"), ("matplotlib.figure", "matplotlib"),
                            ("rich.console", "rich")):  # fmt: skip
        try:
            __import__(module)
        except ImportError:
            missing.append(package)
    if missing:
        raise missing_extra("report", *missing)


def _list() -> int:
    from halfshell import scenes
    from halfshell._report.measure.methods import METHODS
    from halfshell._report.measure.run import PEERS, SCENES

    print("scenes")
    for name in SCENES:
        print(f"  {name:<22}{scenes.load(name, size='small').title}")
    print("methods\n  " + "  ".join(METHODS))
    print("libraries\n  " + "  ".join(PEERS))
    return 0


def _plan(args: Namespace) -> Plan:
    from halfshell._report.measure.run import plan_of

    scenes: Sequence[str] | str | None = "all" if args.scenes == ("all",) else args.scenes
    peers: Sequence[str] | str | None = "all" if args.peers is None else args.peers
    if args.peers in (("all",), ("none",)):
        peers = args.peers[0]
    for option, names in (("--scenes", args.scenes), ("--methods", args.methods),
                          ("--peers", args.peers)):  # fmt: skip
        if names == ():
            raise InputError(f"{option} names nothing")
    try:
        return plan_of(scenes, args.methods, peers, args.size, args.patience)
    except ValueError as error:
        raise InputError(f"{error} (halfshell report --list names them)") from None


def _forecast(plan: Plan) -> str:
    """How long scenes of full size take, by the time of one on a common machine."""
    ours = math.ceil(len(plan.scenes) * _FULL_SECONDS / 60.0)
    others = math.ceil(len(plan.scenes) * len(plan.peers) * plan.effort.give_up / 60.0)
    text = f"full size: about {ours} min for the truth and the methods of this library"
    return f"{text}, at most {others} min more for other libraries" if plan.peers else text


def _write(folder: Path, rows: Sequence[ReportRow]) -> None:
    """Write both files, each only when it is complete."""
    from halfshell._report.measure.facts import machine_facts
    from halfshell._report.page.html import page
    from halfshell._report.page.rows import write_csv

    facts = machine_facts()
    table = io.StringIO()
    write_csv(table, facts, rows)
    for name, text in (("report.csv", table.getvalue()), ("report.html", page(facts, rows))):
        with replacing(str(folder / name)) as stream:
            stream.write(text.encode())


def _print(rows: Sequence[ReportRow], details: bool, folder: Path) -> None:
    from rich.console import Console

    from halfshell._report.page.table import scene_table, summary_table
    from halfshell._report.page.words import findings

    console = Console(highlight=False)
    if details:
        for name in dict.fromkeys(row.scene for row in rows):
            console.print(scene_table([row for row in rows if row.scene == name]))
    console.print(summary_table(rows))
    for text in findings(rows):
        console.print(f"* {text}", markup=False)
    written = f"written: {folder / 'report.csv'}, {folder / 'report.html'}"
    console.print(printable(written), markup=False)


@contextmanager
def _progress_bar(wanted: bool) -> Iterator[Callable[[int, int, str], None]]:
    """Yield what tells the scenes done; it shows a bar on a terminal only."""
    if not (wanted and sys.stderr.isatty()):
        yield lambda done, total, text: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns: tuple[Any, ...] = (
        BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}")
    )  # fmt: skip
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=None)

        def advance(done: int, total: int, text: str) -> None:
            bar.update(task, completed=done, total=total, description=text)

        yield advance
