# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell bench``: run times on one file, of this library and of others, answers first."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from halfshell._cli.errors import InputError, missing_extra
from halfshell._cli.scene import describe_source, load_scene, unit_suffix
from halfshell._machine import cpu_name, unknown_kernel, usable_cpus
from halfshell._terminal import printable

if TYPE_CHECKING:
    from halfshell._cli.files import Scene
    from halfshell._report.page.rows import ReportRow

__all__ = ["run"]

MOST_POINTS = 300_000  # answers are compared with one that takes time and memory


def run(args: Namespace) -> int:
    """Carry out ``halfshell bench``: 0, or 1 if our own list was wrong."""
    _require()
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
    from halfshell import scenes
    from halfshell._report.measure.run import plan_of
    from halfshell._report.measure.run import run as run_report

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
        print(json.dumps(describe_source(scene) | _facts(rows, args), indent=2))
    else:
        _print(rows, reason, scene)
    return int(bool(rows[0].wrong))


def _require() -> None:
    """Import what this needs, before any work is done for it."""
    missing = []
    for module in ("scipy", "rich"):
        try:
            __import__(module)
        except ImportError:
            missing.append(module)
    if missing:
        raise missing_extra("bench", *missing)


def _facts(rows: Sequence[ReportRow], args: Namespace) -> dict[str, Any]:
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


def _print(rows: Sequence[ReportRow], reason: str, scene: Scene) -> None:
    from rich.console import Console

    from halfshell._report.page.table import scene_table

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
