# SPDX-License-Identifier: BSD-3-Clause
"""Measure halfshell against the libraries that are installed, on named scenes.

    python benchmarks/run.py                      every scene but the largest, every peer
    python benchmarks/run.py --scenes pairs-1e5-k52 triclinic-1e4-k52 --peers vesin cKDTree
    python benchmarks/run.py --quick              smoke run of a few seconds

The answers are compared before anything is timed. Exit status 1 means that an answer of ours
was wrong; slow is no error. `README.md` beside this file says how to read the tables.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import machine
import report
from agreement import Verdict, compare, compare_counts
from contestant import Call, Contestant, Halfshell, pin_threads
from measure import Turn, plan_turn, take_turns
from peers import PEERS
from report import OURS, Measurement
from scenes import QUICK, SCENES, Limit, Scene, load


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    options = _parse(arguments)
    pin_threads()
    core = None if options.no_pin else machine.pin_to_core(options.core)
    ours = None if options.without_halfshell else Halfshell(_own_options(options))
    if ours is not None and ours.version() is None:
        print("halfshell cannot be imported; --without-halfshell measures peers alone")
        return 2
    peers = [PEERS[name] for name in options.peers if PEERS[name].version()]
    missing = [name for name in options.peers if not PEERS[name].version()]
    facts = machine.facts(options.machine, _simd(options, ours))
    where = "not pinned" if core is None else f"core {core}"
    print(f"{facts['cpu']}, {where}, kernel {facts['kernel'] or '-'}, commit {facts['commit']}")
    if facts["load"] and facts["load"] > 0.5:
        print(f"load {facts['load']}: other programs run here, figures are too high and uneven")
    if missing:
        print(f"not installed: {', '.join(missing)}")
    budget = int(options.hold * machine.available_bytes())
    machine.touch_memory(min(budget, 1 << 28) if options.quick else budget)

    measured: list[Measurement] = []
    wanted: dict[str, float | None] = {}
    limits: dict[str, tuple[Limit, ...]] = {}
    correct = True
    for name in options.scenes:
        scene = load(name)
        wanted[name], limits[name] = scene.want, scene.limits
        rows, good = _measure_scene(scene, ours, peers, options, budget)
        measured += rows
        correct &= good
    for table in (
        report.table_of_contestants(measured),
        report.table_of_ratios(report.ratio_rows(measured, wanted)),
        report.table_of_limits(report.limit_rows(measured, limits)),
    ):
        report.render(table, rich=not options.plain)
    if options.output:
        report.write_csv(options.output, facts, measured, wanted)
        print(f"wrote {options.output}")
    if not correct:
        print("AN ANSWER OF HALFSHELL IS WRONG")
    return 0 if correct else 1


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    largest = [name for name in SCENES if name.startswith("growth")]
    parser = argparse.ArgumentParser(
        description=(__doc__ or "").partition("\n")[0], epilog=f"scenes: {', '.join(SCENES)}"
    )
    parser.add_argument("--scenes", nargs="+", choices=SCENES, metavar="NAME",
                        help=f"default: all but {', '.join(largest)}")  # fmt: skip
    parser.add_argument("--peers", nargs="*", choices=PEERS, default=list(PEERS), metavar="NAME",
                        help=f"of {', '.join(PEERS)}; default: all that are installed")  # fmt: skip
    parser.add_argument("--repeats", type=int, default=7, help="turns of each call (7)")
    parser.add_argument("--patience", type=float, default=60.0, metavar="SECONDS",
                        help="most time for one peer on one scene (60)")  # fmt: skip
    parser.add_argument("--hold", type=float, default=0.4, metavar="SHARE",
                        help="share of the available memory for held results (0.4)")  # fmt: skip
    parser.add_argument("--quick", action="store_true", help="small scenes, few turns")
    parser.add_argument("--kernel", help="one of halfshell.kernels(); default: the best")
    parser.add_argument("--core", type=int, help="core to stay on (the last)")
    parser.add_argument("--no-pin", action="store_true", help="let the system move the process")
    parser.add_argument("--machine", help="a name for the machine in the CSV file")
    parser.add_argument("--output", type=Path, metavar="CSV", help="append the figures to a file")
    parser.add_argument("--plain", action="store_true", help="tables without the rich package")
    parser.add_argument("--without-halfshell", action="store_true", help="peers alone")
    options = parser.parse_args(arguments)
    if options.quick:
        options.repeats = min(options.repeats, 3)
        options.patience = min(options.patience, 0.5)
    if options.scenes is None:
        options.scenes = list(QUICK) if options.quick else [n for n in SCENES if n not in largest]
    return options


def _own_options(options: argparse.Namespace) -> dict[str, Any]:
    return {"kernel": options.kernel} if options.kernel else {}


def _simd(options: argparse.Namespace, ours: Halfshell | None) -> str:
    """Name the kernel that our calls use."""
    if ours is None:
        return ""
    import halfshell as hs

    return options.kernel or hs.kernels()[0]


def _empty_pool() -> None:
    """Give memory kept for later results back, so that new results need new memory."""
    clear = getattr(sys.modules.get("halfshell"), "clear_cache", None)
    if clear is not None:
        clear()


def _measure_scene(
    scene: Scene, ours: Halfshell | None, peers: Sequence[Contestant],
    options: argparse.Namespace, budget: int,
) -> tuple[list[Measurement], bool]:  # fmt: skip
    """Compare the answers of all contestants on a scene, then time them together."""
    print(f"{scene.name}: {scene.stresses}", flush=True)
    contestants: dict[str, Contestant] = {} if ours is None else {OURS: ours}
    for peer in peers:
        if peer.name not in scene.peers:
            continue
        reason = peer.refuses(scene)
        if options.quick and (scene.n_pairs or 0) > peer.most_pairs / 20.0:
            reason = "slow"
        if reason is None:
            contestants[peer.name] = peer
        else:
            print(f"  without {peer.name}: {reason}")
    rows: dict[str, Measurement] = {}
    turns: dict[str, Turn] = {}
    correct = True
    for name, contestant in contestants.items():
        call = contestant.prepare(scene)
        pairs, verdict = _check(scene, ours, contestant, call)
        if name == OURS and scene.n_pairs is not None and pairs != scene.n_pairs:
            print(f"  halfshell finds {pairs} pairs, there are {scene.n_pairs}")
            correct = False
        correct &= verdict is None or verdict.ours_wrong == 0
        rows[name] = _row(scene, contestant, name, pairs, verdict)
        turns[name] = plan_turn(call, options.repeats, options.patience)
    if ours is not None:
        for name, (other, call, pairs) in _held_against(scene, ours).items():
            rows[name] = replace(_row(other, ours, name, pairs, None), scene=scene.name)
            turns[name] = plan_turn(call, options.repeats, options.patience)
    _empty_pool()
    own = tuple(name for name in turns if name.startswith(OURS))
    fresh = take_turns(turns, keep=True, budget=budget, yields=own)
    _empty_pool()
    recycled = take_turns(turns, keep=False)
    timed = [
        replace(
            row, repeats=turns[name].repeats, calls=turns[name].calls,
            fresh_median=fresh[name].median, fresh_min=fresh[name].minimum,
            recycled_median=recycled[name].median, recycled_min=recycled[name].minimum,
            all_held=fresh[name].all_held,
        )
        for name, row in rows.items()
    ]  # fmt: skip
    return timed, correct


def _check(
    scene: Scene, ours: Halfshell | None, contestant: Contestant, call: Call
) -> tuple[int, Verdict | None]:
    """Count the pairs of an answer, and compare it with ours under the same tie rule."""
    result = call()
    pairs = contestant.count(scene, result)
    if ours is None or contestant is ours:
        return pairs, None
    options = {**ours.options, "inclusive": contestant.inclusive}
    # The answer is compared without distances and vectors, which decide nothing.
    plain = scene
    if scene.task == "pairs":
        plain = replace(scene, quantities="ijS" if scene.has_images else "ij", index_dtype="int64")
    same_rule = Halfshell(options)
    answer = same_rule.prepare(plain)()
    if scene.task == "count":
        return pairs, compare_counts(int(answer), pairs)
    verdict = compare(
        scene, same_rule.keys(plain, answer), contestant.keys(scene, result),
        contestant.inclusive, contestant.band(scene), scene.has_images,
    )  # fmt: skip
    if verdict.ours_wrong:
        print(f"  {contestant.name} is right on {verdict.ours_wrong} pairs, halfshell wrong")
    return pairs, verdict


def _held_against(scene: Scene, ours: Halfshell) -> dict[str, tuple[Scene, Call, int]]:
    """Prepare what the limits of a scene compare us with: scene, call and pairs by name."""
    found: dict[str, tuple[Scene, Call, int]] = {}
    for limit in scene.limits:
        name = f"{OURS} [{limit.label}]"
        if limit.kind == "floor":
            size = scene.bytes_of_output()
            found[name] = (scene, partial(np.full, size // 8, 1), scene.n_pairs or 0)
        elif limit.kind == "variant":
            variant = Halfshell({**ours.options, **limit.options})
            call = variant.prepare(scene)
            found[name] = (scene, call, variant.count(scene, call()))
        elif limit.kind in ("scene", "growth"):
            other = load(limit.other)
            call = ours.prepare(other)
            found[name] = (other, call, ours.count(other, call()))
    return found


def _row(
    scene: Scene, contestant: Contestant, name: str, pairs: int, verdict: Verdict | None
) -> Measurement:
    """Start a row; the times are filled in later."""
    return Measurement(
        scene=scene.name, contestant=name, version=contestant.version() or "", task=scene.task,
        n=scene.n, dim=scene.dim, cutoff=scene.cutoff, quantities=scene.quantities,
        index_dtype=scene.index_dtype, pairs=pairs, repeats=0, calls=0, fresh_median=0.0,
        fresh_min=0.0, recycled_median=0.0, recycled_min=0.0, all_held=True,
        complete=verdict is None or verdict.complete,
        agreement="not compared" if verdict is None else str(verdict),
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
