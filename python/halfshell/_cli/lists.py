# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell neighbors``, ``coordination``, ``nearest`` and ``rdf``: full lists, counts, g(r).

Each finds its columns, says in a few lines what they are, and writes them where that is wanted.
"""

from __future__ import annotations

import json
import time
from argparse import Namespace
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import halfshell as hs
from halfshell._cli.errors import InputError, one_line
from halfshell._cli.files import Scene, read_scene
from halfshell._cli.output import check_size, open_output, write_columns
from halfshell._cli.scene import (
    describe_box,
    describe_points,
    describe_source,
    load_frames,
    load_scene,
    read_points,
    unit_suffix,
)
from halfshell._terminal import printable

__all__ = ["run_coordination", "run_nearest", "run_neighbors", "run_rdf"]

Columns = dict[str, NDArray[Any]]
MOST_SHOWN = 12  # lines of a histogram


class Found(NamedTuple):
    """What a command found: columns for a file, facts for the summary, lines for people."""

    columns: Columns
    facts: dict[str, Any]
    lines: list[tuple[str, str]]


def run_neighbors(args: Namespace) -> int:
    """Carry out ``halfshell neighbors``."""

    for name, given in (("--quantities", args.quantities), ("--max-output", args.max_output)):
        if given and not args.output:
            raise InputError(f"{name} is for what -o writes: give -o as well")

    def find(scene: Scene, cutoff: float, asking: Scene, options: dict[str, Any]) -> Found:
        letters = args.quantities or ("ijdS" if any(scene.periodic) else "ijd")
        if not set(letters) <= set("ijdDS"):
            raise InputError(f"--quantities {letters}: rows have some of the letters i j d D S")
        wanted = letters.replace("i", "") or "j"
        if args.output:
            n_rows = int(hs.coordination(scene.points, cutoff, **options).sum())
            n, ndim = scene.points.shape
            check_size(args.output, letters, n_rows, n, ndim, args.max_output)
        table = hs.neighbors(scene.points, cutoff, quantities=wanted, **options)
        arrays = table.to_pairs(quantities=letters)
        columns = dict(zip(letters, (arrays,) if len(letters) == 1 else arrays, strict=True))
        return Found(columns, *_of_counts(table.counts, asking))

    return _run(args, find)


def run_coordination(args: Namespace) -> int:
    """Carry out ``halfshell coordination``."""

    def find(scene: Scene, cutoff: float, asking: Scene, options: dict[str, Any]) -> Found:
        counts = hs.coordination(scene.points, cutoff, **options)
        columns: Columns = {"i": np.arange(len(counts)), "count": counts}
        if asking.species is not None:
            columns["species"] = asking.species
        return Found(columns, *_of_counts(counts, asking))

    return _run(args, find)


def run_nearest(args: Namespace) -> int:
    """Carry out ``halfshell nearest``."""
    scene = read_points(args)
    asking = _asking(args, scene)
    options = _options(scene, asking, args)
    del options["inclusive"]
    letters = "jdS" if any(scene.periodic) else "jd"
    with ExitStack() as stack:
        output = open_output(args.output, args.file, stack, json=args.json)
        start = time.perf_counter()
        found = _call(
            scene, lambda: hs.nearest(scene.points, args.k, quantities=letters, **options)
        )
        seconds = time.perf_counter() - start
        n, k = found[0].shape
        columns = {"i": np.repeat(np.arange(n), k), "rank": np.tile(np.arange(1, k + 1), n)}
        for letter, array in zip(letters, found, strict=True):
            columns[letter] = array.reshape(n * k, *array.shape[2:])
        real = columns["j"] >= 0
        columns = {name: array[real] for name, array in columns.items()}
        if output:
            write_columns(output, args.output, columns)
    d, unit = columns["d"], unit_suffix(scene)
    largest = float(d.max()) if len(d) else None
    facts = {"k": k, "entries": len(d), "largest_distance": largest}
    lines = [
        ("nearest points", f"{k:,} of each of {n:,}: {len(d):,} entries"),
        ("largest distance", "none" if largest is None else f"{largest:.6g}{unit}"),
    ]
    _print(args, scene, facts, lines, seconds)
    return 0


def run_rdf(args: Namespace) -> int:
    """Carry out ``halfshell rdf``."""

    def find() -> Found:
        result: Any = None
        sizes: set[int] = set()
        n_frames = 0
        for frame in frames:
            found = _distribution(frame, cutoff, args)
            result = found if result is None else result + found
            sizes.add(len(frame.points))
            n_frames += 1
        columns: Columns = {"r": result.r, "g": result.g, "counts": result.counts}
        highest = int(result.g.argmax())
        peak = [float(result.r[highest]), float(result.g[highest])]
        facts: dict[str, Any] = {"frames": n_frames, "bins": args.bins, "highest": peak}
        facts["pairs"] = int(result.counts.sum())
        unit = unit_suffix(first)
        all_frames = f", of {n_frames:,} frames" if n_frames > 1 else ""
        if len(sizes) > 1:
            all_frames += f" of {min(sizes):,} to {max(sizes):,} points"
        lines = [
            ("bins", f"{args.bins:,}, of {cutoff / args.bins:.6g}{unit}"),
            ("pairs", f"{facts['pairs']:,}   (each once{all_frames})"),
            ("highest g(r)", f"{peak[1]:.6g} at r = {peak[0]:.6g}{unit}"),
        ]
        return Found(columns, facts, lines)

    first, frames, cutoff, reason = load_frames(args)
    return _run_loaded(args, first, cutoff, reason, find)


def _distribution(scene: Scene, cutoff: float, args: Namespace) -> Any:
    if scene.box is None or not all(scene.periodic):
        raise InputError(f"{scene.where}: g(r) needs a box that is periodic along every axis")
    options = _options(scene, scene, args)
    del options["inclusive"]
    return _call(scene, lambda: hs.rdf(scene.points, cutoff, args.bins, **options))


# ---- what they share -------------------------------------------------------------------------


def _run(args: Namespace, find: Callable[[Scene, float, Scene, dict[str, Any]], Found]) -> int:
    """A command with a cutoff."""
    scene, cutoff, reason = load_scene(args)
    asking = _asking(args, scene)
    options = _options(scene, asking, args)
    return _run_loaded(
        args, scene, cutoff, reason, lambda: find(scene, cutoff, asking, options)
    )


def _run_loaded(
    args: Namespace, scene: Scene, cutoff: float, reason: str, find: Callable[[], Found]
) -> int:
    with ExitStack() as stack:
        output = open_output(args.output, args.file, stack, json=args.json)
        start = time.perf_counter()
        found = _call(scene, find)
        seconds = time.perf_counter() - start
        if output:
            write_columns(output, args.output, found.columns)
    chosen = f"   (chosen: {reason}; --cutoff sets it)" if reason else ""
    facts = {"cutoff": cutoff, "cutoff_chosen": args.cutoff is None, **found.facts}
    line = ("cutoff", f"{cutoff:.6g}{unit_suffix(scene)}{chosen}")
    _print(args, scene, facts, [line, *found.lines], seconds)
    return 0


def _asking(args: Namespace, scene: Scene) -> Scene:
    """The points whose neighbours are wanted: those of --queries, or the points themselves."""
    if getattr(args, "queries", None) is None:
        return scene
    queries = read_scene(args.queries)
    if queries.points.shape[1] != scene.points.shape[1]:
        raise InputError(
            f"{args.queries}: has {queries.points.shape[1]} coordinates a point, {scene.source} "
            f"has {scene.points.shape[1]}"
        )
    return queries


def _options(scene: Scene, asking: Scene, args: Namespace) -> dict[str, Any]:
    queries = {} if asking is scene else {"queries": asking.points}
    return {
        **queries,
        "box": scene.box,
        "periodic": scene.periodic if scene.box is not None else None,
        "inclusive": not getattr(args, "strict", False),
        "kernel": args.kernel,
        "threads": args.threads,
    }


def _call(scene: Scene, function: Callable[[], Any]) -> Any:
    try:
        return function()
    except (ValueError, TypeError, OverflowError, MemoryError) as error:
        raise InputError(f"{scene.where}: {one_line(error)}") from None


def _of_counts(
    counts: NDArray[np.int64], asking: Scene
) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """Facts and lines of the number of neighbours of each point."""
    numbers, times = np.unique(counts, return_counts=True)
    facts: dict[str, Any] = {
        "entries": int(counts.sum()), "mean_coordination": float(counts.mean()),
        "least": int(counts.min()), "most": int(counts.max()),
    }  # fmt: skip
    lines = [
        ("neighbours", f"{facts['entries']:,}   (of all points together)"),
        ("of a point", f"{facts['mean_coordination']:.6g} on average, "
                       f"{facts['least']:,} to {facts['most']:,}"),
    ]  # fmt: skip
    if asking.species is not None:
        means = {
            str(name): float(counts[asking.species == name].mean())
            for name in np.unique(asking.species)
        }
        facts["by_species"] = means
        lines += [(f"  of {name}", f"{mean:.6g} on average") for name, mean in means.items()]
    if len(numbers) <= MOST_SHOWN:
        facts["points_by_coordination"] = {
            str(number): int(n) for number, n in zip(numbers, times, strict=True)
        }
        lines += [
            (f"  {number:,}", f"{n:,} points") for number, n in zip(numbers, times, strict=True)
        ]
    return facts, lines


def _print(
    args: Namespace, scene: Scene, facts: dict[str, Any], lines: list[tuple[str, str]], took: float
) -> None:
    """The summary, unless the columns went to standard output."""
    if args.output == "-":
        return
    if args.json:
        first = describe_source(scene) | ({"no_box": scene.no_box} if scene.no_box else {})
        if getattr(args, "queries", None) is not None:
            first["queries"] = args.queries
        print(json.dumps({**first, **facts, "seconds": took, "output": args.output}, indent=2))
        return
    shown = describe_points(scene)
    if getattr(args, "queries", None) is not None:
        shown.append(("queries", args.queries))
    shown += [("box", describe_box(scene)), *lines]
    shown.append(("time", f"{took:.3g} s" if took >= 1 else f"{took * 1e3:.3g} ms"))
    if args.output:
        shown.append(("written to", args.output))
    text = [scene.source, *(f"  {name:<18}{value}" for name, value in shown)]
    print("\n".join(map(printable, text)))
