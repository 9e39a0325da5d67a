# SPDX-License-Identifier: BSD-3-Clause
"""Time the stiff and extreme scenes of halfshell against uniform scenes of the same size.

    python benchmarks/extreme.py [NAME ...] [--size quick] [--output CSV]

Every scene of `halfshell_report.scenes` has a twin: as many points, uniform in a cube of as many
dimensions, periodic if the scene is, with a cutoff at which it has about as many pairs. The two
take turns. Figures are medians; the ratio is given of the fastest turns too, which other
programs disturb less. A ratio of 1 means that what is hard about the scene costs nothing.
Scenes that move are searched with their skin. Indices alone, int64, one thread, results
dropped at once.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import halfshell as hs
from halfshell_report import scenes as extreme
from measure.machine import facts, pin_to_cores, usable_cores
from measure.turns import Timing, Turn, plan_turn, take_turns
from pages import write_rows
from scenes.named import uniform

__all__ = ["COLUMNS", "main", "measure", "twin"]

COLUMNS = (
    "scene", "n", "dim", "pairs", "twin_pairs", "ns_a_point", "twin_ns_a_point", "ratio",
    "ratio_min", "repeats", "calls",
)  # fmt: skip
_SHOWN = ("scene", "n", "pairs", "ns_a_point", "twin_ns_a_point", "ratio", "ratio_min")
_LINE = "{:<22} {:>7} {:>9} {:>12} {:>12} {:>7} {:>9}"
_CLOSE = 0.02  # how near the pairs of a twin come to those of the scene, where they can


def arguments(scene: extreme.Scene) -> dict[str, Any]:
    """Return what the search of a scene is called with: a moving one with its skin."""
    skin = scene.motion.skin if scene.motion else 0.0
    return {**scene.arguments, "cutoff": scene.cutoff + skin}


def twin(scene: extreme.Scene, pairs: int) -> dict[str, Any]:
    """Return a uniform scene with as many points, and about as many pairs, as arguments."""
    n, dim = scene.points.shape
    points = uniform(20260201, n, dim).astype(scene.points.dtype)
    periodic = any(scene.periodic)
    box = np.ones(dim) if periodic else None
    if not periodic and pairs >= n * (n - 1) // 2:
        return {"points": points, "cutoff": math.sqrt(dim), "box": box}
    ball = math.pi ** (dim / 2.0) / math.gamma(dim / 2.0 + 1.0)
    cutoff = (2.0 * max(pairs, 1) / n / n / ball) ** (1.0 / dim)
    for _ in range(8):
        found = hs.count_pairs(points, cutoff, box=box)
        if abs(found - pairs) <= max(_CLOSE * pairs, 10.0):
            break
        cutoff *= (max(pairs, 1) / max(found, 1)) ** (1.0 / dim)
    return {"points": points, "cutoff": cutoff, "box": box}


def measure(name: str, size: extreme.Size, repeats: int, patience: float) -> dict[str, Any]:
    """Time a scene and its twin, taking turns; return a row of the table."""
    scene = extreme.load(name, size)
    own = arguments(scene)
    pairs = hs.count_pairs(**own)
    other = twin(scene, pairs)
    turns: dict[str, Turn] = {}
    for who, given in (("scene", own), ("twin", other)):
        turns[who] = plan_turn(partial(hs.pairs, **given, threads=1), repeats, patience)
    fewest = max(5, min(turn.repeats for turn in turns.values()))
    turns = {who: Turn(turn.call, turn.calls, fewest) for who, turn in turns.items()}
    timings: dict[str, Timing] = take_turns(turns, keep=False)
    own_ns, twin_ns = (1e9 * timings[who].median / scene.n_points for who in ("scene", "twin"))
    return {
        "scene": name, "n": scene.n_points, "dim": scene.ndim, "pairs": pairs,
        "twin_pairs": hs.count_pairs(**other), "ns_a_point": round(own_ns, 1),
        "twin_ns_a_point": round(twin_ns, 1), "ratio": round(own_ns / twin_ns, 2),
        "ratio_min": round(timings["scene"].minimum / timings["twin"].minimum, 2),
        "repeats": fewest, "calls": turns["scene"].calls,
    }  # fmt: skip


def main(given: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenes; default: all")
    parser.add_argument("--size", choices=extreme.SIZES, default="full")
    parser.add_argument("--repeats", type=int, default=7, help="turns, at least 5 (7)")
    parser.add_argument("--patience", type=float, default=4.0, metavar="SECONDS",
                        help="for each of a scene and its twin, then 5 turns (4)")  # fmt: skip
    parser.add_argument("--output", type=Path, metavar="CSV")
    options = parser.parse_args(given)
    pin_to_cores(usable_cores()[:1])
    about = facts(simd=hs.explain(np.zeros((2, 3)), 1.0).kernel)
    rows = []
    print(_LINE.format("scene", "n", "pairs", "ns a point", "uniform", "ratio", "of minima"))
    for name in options.names or extreme.names():
        row = measure(name, options.size, max(5, options.repeats), options.patience)
        rows.append({**about, "size": options.size, **row})
        print(_LINE.format(*(row[key] for key in _SHOWN)), flush=True)
    if options.output:
        write_rows(options.output, [*about, "size", *COLUMNS], rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
