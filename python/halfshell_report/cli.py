# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell report`` and ``halfshell bench``: in the terminal, as CSV, as a page, as JSON."""

from __future__ import annotations

import io
import json
import math
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from halfshell._cli.errors import InputError, missing_extra, one_line, printable
from halfshell._cli.outputs import replacing
from halfshell._cli.scene import describe_source, load_scene, unit_suffix
from halfshell._machine import cpu_name, unknown_kernel, usable_cpus

if TYPE_CHECKING:
    from halfshell._cli.structure_files import Scene
    from halfshell_report.rows import ReportRow
    from halfshell_report.run import Plan

__all__ = ["add_options", "add_peers", "run", "run_bench"]

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
    _require("report", "scipy.spatial", "matplotlib.figure", "rich.console")
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
    from halfshell_report.run import run as run_report

    if plan.size == "full":
        print(_forecast(plan), file=sys.stderr)
    with _progress_bar(args.progress) as progress:
        rows = run_report(plan, progress)
    if args.peers is None:
        rows = [row for row in rows if row.status != "not installed"]
    _write(folder, rows)
    _print(rows, args.details or len(plan.scenes) <= _DETAILED, folder)
    return int(any(row.wrong for row in rows if row.method in ("exact", "verlet")))


def _require(command: str, *modules: str) -> None:
    """Import what a command needs, before any work is done for it."""
    missing = []
    for module in modules:
        try:
            __import__(module)
        except ImportError:
            missing.append(module.partition(".")[0])
    if missing:
        raise missing_extra(command, *missing)


def _list() -> int:
    from halfshell_report import scenes
    from halfshell_report.measure import METHODS
    from halfshell_report.run import PEERS, SCENES

    print("scenes")
    for name in SCENES:
        print(f"  {name:<22}{scenes.load(name, size='small').title}")
    print("methods\n  " + "  ".join(METHODS))
    print("libraries\n  " + "  ".join(PEERS))
    return 0


def _plan(args: Namespace) -> Plan:
    from halfshell_report.run import plan_of

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
    from halfshell_report.measure import machine_facts
    from halfshell_report.page import page
    from halfshell_report.rows import write_csv

    facts = machine_facts()
    table = io.StringIO()
    write_csv(table, facts, rows)
    for name, text in (("report.csv", table.getvalue()), ("report.html", page(facts, rows))):
        with replacing(str(folder / name)) as stream:
            stream.write(text.encode())


def _print(rows: Sequence[ReportRow], details: bool, folder: Path) -> None:
    from rich.console import Console

    from halfshell_report.findings import findings, scene_table, summary_table

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


MOST_POINTS = 300_000  # of bench: answers are compared with one that takes time and memory


def run_bench(args: Namespace) -> int:
    """Carry out ``halfshell bench``: 0, or 1 if our own list was wrong."""
    _require("bench", "scipy", "rich")
    unknown = unknown_kernel()
    if unknown is not None:
        raise InputError(unknown)
    if args.peers == ():
        raise InputError("--peers names nothing")
    scene, cutoff, reason = load_scene(args)
    if len(scene.points) > MOST_POINTS:
        raise InputError(
            f"{scene.source}: has {len(scene.points):,} points; bench compares answers up to "
            f"{MOST_POINTS:,}"
        )
    from halfshell_report import scenes
    from halfshell_report.run import plan_of
    from halfshell_report.run import run as run_report

    peers = "all" if args.peers is None else args.peers
    if args.peers in (("all",), ("none",)):
        peers = args.peers[0]
    try:
        plan = plan_of((), ("exact",), peers, "quick", args.patience or 3.0)
    except ValueError as error:
        raise InputError(f"{error} (halfshell report --list names them)") from None
    given = scenes.Scene(
        scene.points, cutoff, scene.box, scene.periodic, not args.strict,
        name=printable(scene.source), title=f"cutoff {cutoff:.6g}{unit_suffix(scene)}",
    )  # fmt: skip
    rows = run_report(plan, scene=given)
    if rows[0].status == "no truth":
        raise InputError(f"{scene.source}: {rows[0].note}")
    if args.peers is None:
        rows = [row for row in rows if row.status != "not installed"]
    if args.json:
        print(json.dumps(describe_source(scene) | _bench_facts(rows, args), indent=2))
    else:
        _print_bench(rows, reason, scene)
    return int(bool(rows[0].wrong))


def _bench_facts(rows: Sequence[ReportRow], args: Namespace) -> dict[str, Any]:
    names = (
        "method", "version", "status", "note", "rule", "seconds", "seconds_with_d", "rows_given",
        "missed", "spurious", "duplicate",
    )  # fmt: skip
    first = rows[0]
    return {
        "cutoff": first.cutoff,
        "cutoff_chosen": args.cutoff is None, "cpu": cpu_name(), "cpus_usable": usable_cpus(),
        "methods": [{name: getattr(row, name) for name in names} for row in rows],
    }  # fmt: skip


def _print_bench(rows: Sequence[ReportRow], reason: str, scene: Scene) -> None:
    from rich.console import Console

    from halfshell_report.findings import scene_table

    console = Console(highlight=False)
    console.print(scene_table(rows))
    ours, *others = rows
    right = [row for row in others if row.status == "ok" and row.seconds and not row.wrong]
    lines = []
    if ours.seconds and right:
        best = min(right, key=lambda row: row.seconds or 0.0)
        ratio = (best.seconds or 0.0) / ours.seconds
        lines.append(f"the fastest other library with a right list: {best.method}, {ratio:.3g} "
                     "times our time")  # fmt: skip
    if reason:
        lines.append(f"the cutoff was chosen: {reason}; --cutoff sets it")
    read = f"read by {scene.reader}: " if scene.reader else ""
    lines.append(f"{read}points in {scene.points.shape[1]}-D")
    lines.append(f"medians, one thread for each, on {cpu_name()}")
    for line in lines:
        console.print(f"* {printable(line)}", markup=False, soft_wrap=True)
