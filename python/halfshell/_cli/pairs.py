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
from halfshell._cli.errors import InputError, one_line
from halfshell._cli.files import Scene
from halfshell._cli.output import check_size, open_output, write_columns
from halfshell._cli.progress import progress_bar
from halfshell._cli.scene import (
    describe_box,
    describe_points,
    describe_source,
    load_scene,
    plot_distribution,
    require_matplotlib,
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
    cutoff: float
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
    if args.plot and cutoff == 0:
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
        if output:
            _check_size(scene, cutoff, wanted, args)
        start = time.perf_counter()
        columns = _search(scene, cutoff, letters, args)
        seconds = time.perf_counter() - start
        d = columns["d"]
        if output:
            chosen = {letter: columns[letter] for letter in wanted}
            extra = {"n": len(scene.points), "cutoff": cutoff, "inclusive": not args.strict}
            write_columns(output, args.output, chosen, **extra)
        if plot:
            plot_distribution(plot, Path(args.plot).suffix[1:], d, scene, cutoff)

    box = scene.box_rows
    names, counts = np.unique([] if scene.species is None else scene.species, return_counts=True)
    summary = Summary(
        **describe_source(scene),
        species=dict(zip(names.tolist(), counts.tolist(), strict=True)),
        unit=scene.unit,
        box=box.tolist() if box is not None else None,
        no_box=scene.no_box,
        periodic=list(scene.periodic),
        cutoff=cutoff,
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
        print(json.dumps(vars(summary), indent=2) if args.json else _text(summary, scene, reason))
    return 0


# The search --------------------------------------------------------------------------------


def _options(scene: Scene, args: Namespace) -> dict[str, Any]:
    """What counting and finding share."""
    return {
        "box": scene.box,
        "periodic": scene.periodic if scene.box is not None else None,
        "inclusive": not args.strict,
        "precision": args.precision,
        "kernel": args.kernel,
        "threads": args.threads,
    }


def _check_size(scene: Scene, cutoff: float, letters: str, args: Namespace) -> None:
    """Refuse an output that is too large, for what counting takes."""
    n, ndim = scene.points.shape
    try:
        n_pairs = hs.count_pairs(scene.points, cutoff, **_options(scene, args))
    except (ValueError, TypeError, OverflowError, MemoryError) as error:
        raise InputError(f"{scene.source}: {one_line(error)}") from None
    check_size(args.output, letters, n_pairs, n, ndim, args.max_output)


def _search(scene: Scene, cutoff: float, letters: str, args: Namespace) -> dict[str, NDArray[Any]]:
    """Find the pairs; return one array for each letter."""
    options = {**_options(scene, args), "quantities": letters, "sort": args.sort}
    try:
        with progress_bar(args.progress and not args.json, "searching") as advance:
            found = hs.pairs(scene.points, cutoff, progress=advance, **options)
    except (ValueError, TypeError, OverflowError, MemoryError) as error:
        raise InputError(f"{scene.source}: {one_line(error)}") from None
    return dict(zip(letters, (found,) if len(letters) == 1 else found, strict=True))


# The summary -------------------------------------------------------------------------------


def _text(summary: Summary, scene: Scene, reason: str) -> str:
    """Return the summary for a person: one aligned line an item."""
    unit = unit_suffix(scene)
    rule = "d <= cutoff" if summary.inclusive else "d < cutoff"
    chosen = f"   (chosen: {reason}; --cutoff sets it)" if reason else ""
    nearest = summary.nearest_distance
    speed = summary.pairs / summary.seconds / 1e6 if summary.seconds else 0.0
    lines = [
        *describe_points(scene),
        ("box", describe_box(scene)),
        ("cutoff", f"{summary.cutoff:.6g}{unit}{chosen}"),
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
