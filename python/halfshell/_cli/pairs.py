# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell pairs``: find the pairs of a file, sum them up, save them, plot g(r)."""

from __future__ import annotations

import json
import time
from argparse import Namespace
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import halfshell as hs
from halfshell import _core
from halfshell._cli.errors import InputError
from halfshell._cli.files import Scene
from halfshell._cli.output import check_size, open_output, write_columns
from halfshell._cli.progress import progress_bar
from halfshell._cli.scene import (
    describe_box,
    describe_points,
    describe_source,
    load_scene,
    named_cutoff,
    plot_distribution,
    require_matplotlib,
    searching,
    shown_cutoff,
    unit_suffix,
)
from halfshell._terminal import printable

__all__ = ["run"]


@dataclass(frozen=True)
class Summary:
    """What the command found out; written as text or as JSON."""

    file: str
    reader: str
    points: int
    dimensions: int
    species: dict[str, int]
    unit: str
    box: list[list[float]] | None
    no_box: str
    periodic: list[bool]
    cutoff: float | dict[str, float]
    cutoff_chosen: bool
    inclusive: bool
    pairs: int
    mean_coordination: float
    nearest_distance: float | None
    seconds: float
    kernel: str
    precision: str
    output: str | None
    plot: str | None


def run(args: Namespace) -> int:
    """Carry out ``halfshell pairs``."""
    scene, cutoff, reason = load_scene(args)
    wanted = args.quantities or ("ijdS" if any(scene.periodic) else "ijd")
    letters = wanted if args.output else ""
    letters += "" if "d" in letters else "d"
    largest = max(cutoff.values()) if isinstance(cutoff, dict) else cutoff
    if args.plot and largest == 0:
        raise InputError("--plot needs a cutoff above 0")
    for name, given in (
        ("--quantities", args.quantities), ("--sort", args.sort), ("--max-output", args.max_output)
    ):  # fmt: skip
        if given and not args.output:
            raise InputError(f"{name} is for what -o writes: give -o as well")

    with ExitStack() as stack:
        output = open_output(args.output, args.file, stack, json=args.json)
        plot = open_output(args.plot, args.file, stack, (".png", ".pdf", ".svg"))
        if plot:
            require_matplotlib()
        with searching(scene, args):
            if output:  # what it takes to count refuses what is too large
                n_pairs = hs.count_pairs(scene.known, cutoff, inclusive=not args.strict)
                n, ndim = scene.points.shape
                check_size(args.output, wanted, n_pairs, n, ndim, args.max_output)
            hs.pairs(scene.known[:0], cutoff)  # loads what a first search loads, outside its time
            start = time.perf_counter()
            columns = _search(scene, cutoff, letters, args)
            seconds = time.perf_counter() - start
        d = columns["d"]
        if output:
            chosen = {letter: columns[letter] for letter in wanted}
            extra: dict[str, Any] = {"n": len(scene.points), "inclusive": not args.strict}
            if largest is cutoff:  # one for all pairs
                extra["cutoff"] = cutoff
            write_columns(output, args.output, chosen, **extra)
        if plot:
            plot_distribution(plot, Path(args.plot).suffix[1:], d, scene, largest)

    box = scene.box_rows
    names, counts = np.unique([] if scene.species is None else scene.species, return_counts=True)
    summary = Summary(
        **describe_source(scene),
        species=dict(zip(names.tolist(), counts.tolist(), strict=True)),
        unit=scene.unit,
        box=box.tolist() if box is not None else None,
        no_box=scene.no_box,
        periodic=list(scene.periodic),
        cutoff=named_cutoff(cutoff),
        cutoff_chosen=args.cutoff is None,
        inclusive=not args.strict,
        pairs=len(d),
        mean_coordination=2 * len(d) / len(scene.points),
        nearest_distance=float(d.min()) if len(d) else None,
        seconds=seconds,
        kernel=args.kernel or _core.default_kernel(),
        precision=args.precision,
        output=args.output,
        plot=args.plot,
    )
    if args.output != "-":
        text = _text(summary, scene, shown_cutoff(cutoff, scene, reason))
        print(json.dumps(vars(summary), indent=2) if args.json else text)
    return 0


# The search --------------------------------------------------------------------------------


def _search(scene: Scene, cutoff: Any, letters: str, args: Namespace) -> dict[str, NDArray[Any]]:
    """Find the pairs; return one array for each letter."""
    with progress_bar(args.progress and not args.json, "searching") as advance:
        found = hs.pairs(
            scene.known, cutoff, inclusive=not args.strict, quantities=letters, sort=args.sort,
            progress=advance,
        )  # fmt: skip
    return dict(zip(letters, (found,) if len(letters) == 1 else found, strict=True))


# The summary -------------------------------------------------------------------------------


def _text(summary: Summary, scene: Scene, cutoff: str) -> str:
    """Return the summary for a person: one aligned line an item."""
    unit = unit_suffix(scene)
    rule = "d <= cutoff" if summary.inclusive else "d < cutoff"
    nearest = summary.nearest_distance
    speed = summary.pairs / summary.seconds / 1e6 if summary.seconds else 0.0
    lines = [
        *describe_points(scene),
        ("box", describe_box(scene)),
        ("cutoff", cutoff),
        ("pairs", f"{summary.pairs:,}   ({rule}, each pair once)"),
        ("mean coordination", f"{summary.mean_coordination:.6g}"),
        ("nearest distance", "no pair" if nearest is None else f"{nearest:.6g}{unit}"),
        ("time", f"{_duration(summary.seconds)}   ({speed:.3g} million pairs a second)"),
        ("kernel", f"{summary.kernel}, precision {summary.precision}"),
    ]
    if summary.output:
        lines.append(("pairs written to", summary.output))
    if summary.plot:
        lines.append(("plot written to", summary.plot))
    text = [summary.file, *(f"  {name:<18}{value}" for name, value in lines)]
    return "\n".join(map(printable, text))


def _duration(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1 else f"{seconds * 1e3:.3g} ms"
