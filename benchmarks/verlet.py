# SPDX-License-Identifier: BSD-3-Clause
"""Time `halfshell.VerletList` against a search in every step.

    python benchmarks/verlet.py [--points N ...] [--neighbours K ...] [--skins SHARE ...]
                                [--quantities Q ...] [--dtype int32|int64] [--lasts N] [--steps N]

Uniform points of density 0.1 in a periodic cube fly straight, each as fast as it drew, and are
wrapped after each step. With a skin of a tenth of the cutoff the fastest may go for `--lasts`
steps, with others in proportion. In each step the list and a search take turns, in an order that
is drawn, on the same points; their pairs are compared by number. One thread and its CPU time,
results dropped at once; the least of all steps. "step" is update, pairs and the share of a build
that falls to one step. A skin of "auto" is timed as a user would see it: all updates and all pairs
after the first 150, over steps, and so is the search beside it.
"""

from __future__ import annotations

import argparse
import math
import random
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import halfshell as hs
from measure.machine import pin_to_cores, usable_cores

__all__ = ["main"]

_DENSITY = 0.1
_SHARE = 0.1  # of the cutoff: the skin that lasts as many steps as is said
_WARM = 150  # steps in which "auto" looks for its skin
_HEAD = ("points", "K", "skin", "what", "build", "update", "pairs", "search", "step", "search/step")
_LINE = "{:>8} {:>4} {:>5} {:>6} {:>9} {:>9} {:>9} {:>9} {:>9} {:>11}"


class _Gas:
    """Points that fly straight in a periodic cube."""

    def __init__(self, n: int, neighbours: float, lasts: float) -> None:
        self.rng = np.random.default_rng(20260301)
        self.cutoff = (neighbours / (4.0 / 3.0 * math.pi * _DENSITY)) ** (1.0 / 3.0)
        self.length = (n / _DENSITY) ** (1.0 / 3.0)
        self.points = self.rng.random((n, 3)) * self.length
        velocity = self.rng.normal(size=(n, 3))
        fastest = float(np.sqrt((velocity**2).sum(axis=1)).max())
        self.lasts = lasts
        self.velocity = velocity * (_SHARE * self.cutoff / 2.0 / lasts / fastest)

    def move(self) -> None:
        self.points = (self.points + self.velocity) % self.length


def _timed(call: Callable[[], Any]) -> tuple[float, Any]:
    start = time.thread_time()
    result = call()
    return time.thread_time() - start, result


def _measure(gas: _Gas, skin: float | str, what: str, dtype: str, steps: int) -> dict[str, float]:
    """Seconds by name, for one list."""
    given: Any = {"quantities": what, "index_dtype": dtype}
    box = np.full(3, gas.length)
    size: Any = skin if isinstance(skin, str) else skin * gas.cutoff
    listed = hs.VerletList(gas.cutoff, size, box=box, threads=1)
    times: dict[str, list[float]] = {"build": [], "update": [], "pairs": [], "search": []}
    in_all = [0.0]

    def use() -> int:
        update, built = _timed(lambda: listed.update(gas.points))
        pairs, found = _timed(lambda: listed.pairs(**given))
        times["build" if built else "update"].append(update)
        times["pairs"].append(pairs)
        in_all.append(update + pairs)
        return len(found[0])

    def search() -> int:
        taken, found = _timed(lambda: hs.pairs(gas.points, gas.cutoff, box=box, threads=1, **given))
        times["search"].append(taken)
        return len(found[0])

    for step in range(steps + (_WARM if isinstance(skin, str) else 0)):
        turns = [use, search] if step >= _WARM or not isinstance(skin, str) else [use]
        random.shuffle(turns)
        if len({turn() for turn in turns}) != 1:
            raise SystemExit("the list and the search differ")
        gas.move()
    result = {name: min(values, default=math.nan) for name, values in times.items()}
    if isinstance(skin, str):
        result["step"] = sum(in_all[-steps:]) / steps
        result["search"] = sum(times["search"]) / len(times["search"])
    else:
        lasts = max(1.0, math.floor(gas.lasts * skin / _SHARE))
        result["step"] = result["update"] + result["pairs"] + result["build"] / lasts
    return result


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line for each list."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--points", type=int, nargs="+", default=[1000, 10000, 100000])
    parser.add_argument("--neighbours", type=float, nargs="+", default=[12, 52, 150, 419])
    parser.add_argument("--skins", nargs="+", default=["0.1"], help="shares of the cutoff, or auto")
    parser.add_argument("--quantities", nargs="+", default=["ij"])
    parser.add_argument("--dtype", choices=("int32", "int64"), default="int64")
    parser.add_argument("--lasts", type=float, default=20.0)
    parser.add_argument("--steps", type=int, default=45)
    given = parser.parse_args(arguments)
    pin_to_cores(usable_cores()[:1])
    print("milliseconds")
    print(_LINE.format(*_HEAD))
    for n in given.points:
        for neighbours in given.neighbours:
            for name in given.skins:
                for what in given.quantities:
                    skin = name if name == "auto" else float(name)
                    gas = _Gas(n, neighbours, given.lasts)
                    found = _measure(gas, skin, what, given.dtype, given.steps)
                    figures = (f"{1e3 * found[key]:.3f}" for key in _HEAD[4:9])
                    ratio = f"{found['search'] / found['step']:.2f}"
                    print(
                        _LINE.format(n, f"{neighbours:g}", name, what, *figures, ratio), flush=True
                    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
