# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell pairs``, ``neighbors``, ``coordination``, ``nearest`` and ``rdf``.

Each finds its columns, says in a few lines what they are, and writes them where that is wanted.
"""

from __future__ import annotations

import itertools
import json
import time
from argparse import Namespace
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import halfshell as hs
from halfshell import _core
from halfshell._cli.errors import InputError, printable
from halfshell._cli.files import read_scene
from halfshell._cli.outputs import check_size, open_output, write_columns
from halfshell._cli.scene import (
    cutoff_for,
    describe_box,
    describe_points,
    describe_source,
    draw_distances,
    load_frames,
    load_scene,
    named_cutoff,
    read_points,
    require_matplotlib,
    searching,
    shown_cutoff,
    unit_suffix,
)
from halfshell._cli.structure_files import Scene
from halfshell._convert.progress import progress_bar

Columns = dict[str, NDArray[Any]]
MOST_SHOWN = 12  # lines of a histogram


class Found(NamedTuple):
    """What a command found: columns for a file, facts for the summary, lines for people."""

    columns: Columns
    facts: dict[str, Any]
    lines: list[tuple[str, str]]
    extra: dict[str, Any] = {}  # noqa: RUF012 - for an archive, besides the columns
    draw: Callable[[Any], object] | None = None  # on axes of matplotlib


def run_pairs(args: Namespace) -> int:
    """Carry out ``halfshell pairs``."""
    scene, cutoff, reason = load_scene(args)
    wanted = args.quantities or ("ijdS" if any(scene.periodic) else "ijd")
    letters = wanted if args.output else ""
    letters += "" if "d" in letters else "d"
    largest = max(cutoff.values()) if isinstance(cutoff, dict) else cutoff
    if args.plot and largest == 0:
        raise InputError("--plot needs a cutoff above 0")
    _refuse_without_output(args, "quantities", "sort", "max_output")
    n, ndim = scene.points.shape

    def find() -> Found:
        if args.output:  # what it takes to count refuses what is too large
            n_pairs = hs.count_pairs(scene.known, cutoff, inclusive=not args.strict)
            check_size(args.output, wanted, n_pairs, n, ndim, args.max_output)
        hs.pairs(scene.known[:0], cutoff)  # loads what a first search loads, outside its time
        start = time.perf_counter()
        with progress_bar(args.progress and not args.json, "searching") as advance:
            found = hs.pairs(
                scene.known, cutoff, inclusive=not args.strict, quantities=letters,
                sort=args.sort, progress=advance,
            )  # fmt: skip
        seconds = time.perf_counter() - start
        columns = dict(zip(letters, (found,) if len(letters) == 1 else found, strict=True))
        d, unit = columns["d"], unit_suffix(scene)
        extra: dict[str, Any] = {"n": n, "inclusive": not args.strict}
        if largest is cutoff:  # one for all pairs
            extra["cutoff"] = cutoff
        box, kernel = scene.box_rows, args.kernel or _core.default_kernel()
        names, counts = np.unique([] if scene.species is None else scene.species,
                                  return_counts=True)  # fmt: skip
        mean, nearest = 2 * len(d) / n, float(d.min()) if len(d) else None
        facts = {
            "species": dict(zip(names.tolist(), counts.tolist(), strict=True)),
            "unit": scene.unit, "box": None if box is None else box.tolist(),
            "no_box": scene.no_box, "periodic": list(scene.periodic),
            "inclusive": not args.strict, "pairs": len(d), "mean_coordination": mean,
            "nearest_distance": nearest, "seconds": seconds, "kernel": kernel,
            "precision": args.precision, "plot": args.plot,
        }  # fmt: skip
        rule = "d < cutoff" if args.strict else "d <= cutoff"
        speed = len(d) / seconds / 1e6 if seconds else 0.0
        lines = [
            ("pairs", f"{len(d):,}   ({rule}, each pair once)"),
            ("mean coordination", f"{mean:.6g}"),
            ("nearest distance", "no pair" if nearest is None else f"{nearest:.6g}{unit}"),
            ("time", f"{_duration(seconds)}   ({speed:.3g} million pairs a second)"),
            ("kernel", f"{kernel}, precision {args.precision}"),
        ]
        chosen = {letter: columns[letter] for letter in wanted if letter in columns}
        draw = partial(draw_distances, d=d, scene=scene, cutoff=largest)
        return Found(chosen, facts, lines, extra, draw)

    return _run_loaded(args, scene, cutoff, reason, find, "pairs ")


def run_neighbors(args: Namespace) -> int:
    """Carry out ``halfshell neighbors``."""
    _refuse_without_output(args, "quantities", "max_output")

    def find(scene: Scene, cutoff: Any, asking: Scene, how: dict[str, Any]) -> Found:
        letters = args.quantities or ("ijdS" if any(scene.periodic) else "ijd")
        if not set(letters) <= set("ijdDS"):
            raise InputError(f"--quantities {letters}: rows have some of the letters i j d D S")
        wanted = letters.replace("i", "") or "j"
        if args.output:
            n_rows = int(hs.coordination(scene.known, cutoff, **how).sum())
            n, ndim = scene.points.shape
            check_size(args.output, letters, n_rows, n, ndim, args.max_output)
        table = hs.neighbors(scene.known, cutoff, quantities=wanted, **how)
        arrays = table.to_pairs(quantities=letters)
        columns = dict(zip(letters, (arrays,) if len(letters) == 1 else arrays, strict=True))
        return Found(columns, *_of_counts(table.counts, asking))

    return _run(args, find)


def run_coordination(args: Namespace) -> int:
    """Carry out ``halfshell coordination``."""

    def find(scene: Scene, cutoff: Any, asking: Scene, how: dict[str, Any]) -> Found:
        counts = hs.coordination(scene.known, cutoff, by_type=args.by_type, **how)
        each = {}
        if args.by_type:
            names = scene.known._kinds.names if scene.known._kinds else None
            each = dict(zip(names or (), counts.T, strict=True))
            counts = counts.sum(axis=1)
        columns: Columns = {"i": np.arange(len(counts)), "count": counts}
        columns |= {f"count_{name}": column for name, column in each.items()}
        if asking.species is not None:
            columns["species"] = asking.species
        facts, lines = _of_counts(counts, asking)
        if args.by_type:
            means = {name: _means(column, asking) for name, column in each.items()}
            centers = _means(counts, asking)
            facts["by_type"] = {one: {name: means[name][one] for name in means} for one in centers}
            lines += [
                (f"  types of {one}", "  ".join(f"{name} {mean:.6g}" for name, mean in row.items()))
                for one, row in facts["by_type"].items()
            ]
        return Found(columns, facts, lines)

    return _run(args, find)


def run_nearest(args: Namespace) -> int:
    """Carry out ``halfshell nearest``."""

    def find(scene: Scene, _: Any, asking: Scene, how: dict[str, Any]) -> Found:
        letters = "jdS" if any(scene.periodic) else "jd"
        found = hs.nearest(scene.known, args.k, queries=how["queries"], quantities=letters)
        n, k = found[0].shape
        columns = {"i": np.repeat(np.arange(n), k), "rank": np.tile(np.arange(1, k + 1), n)}
        for letter, array in zip(letters, found, strict=True):
            columns[letter] = array.reshape(n * k, *array.shape[2:])
        real = columns["j"] >= 0
        columns = {name: array[real] for name, array in columns.items()}
        d, unit = columns["d"], unit_suffix(scene)
        largest = float(d.max()) if len(d) else None
        facts = {"k": k, "entries": len(d), "largest_distance": largest}
        lines = [
            ("nearest points", f"{k:,} of each of {n:,}: {len(d):,} entries"),
            ("largest distance", "none" if largest is None else f"{largest:.6g}{unit}"),
        ]
        return Found(columns, facts, lines)

    return _run(args, find)


def run_rdf(args: Namespace) -> int:
    """Carry out ``halfshell rdf``."""

    def find() -> Found:
        result: Any = None
        sizes: set[int] = set()
        n_frames = 0
        for frame in frames:
            if args.density is None and (frame.box is None or not all(frame.periodic)):
                raise InputError(
                    f"{frame.where}: g(r) needs a box that is periodic along every axis, or "
                    "--density"
                )
            with searching(frame, args):
                found = hs.rdf(
                    frame.known, cutoff, args.bins, by_type=args.by_type, density=args.density
                )
            result = found if result is None else result + found
            sizes.add(len(frame.points))
            n_frames += 1
        columns: Columns = {"r": result.r}
        peaks = {}
        pairs = 0
        parts = {"": result}  # g(r) of all points, or of each two types
        if result.types is not None:
            both = itertools.combinations_with_replacement(result.types, 2)
            parts = {f"_{one}-{other}": result[one, other] for one, other in both}
        for name, part in parts.items():
            columns[f"g{name}"], columns[f"counts{name}"] = part.g, part.counts
            highest = int(part.g.argmax())
            peaks[name[1:]] = [float(part.r[highest]), float(part.g[highest])]
            pairs += int(part.counts.sum())
        facts: dict[str, Any] = {
            "frames": n_frames, "bins": args.bins, "pairs": pairs,
            "highest": peaks if args.by_type else peaks[""],
        }  # fmt: skip
        unit = unit_suffix(first)
        all_frames = f", of {n_frames:,} frames" if n_frames > 1 else ""
        if len(sizes) > 1:
            all_frames += f" of {min(sizes):,} to {max(sizes):,} points"
        lines = [
            ("bins", f"{args.bins:,}, of {cutoff / args.bins:.6g}{unit}"),
            ("pairs", f"{facts['pairs']:,}   (each once{all_frames})"),
            *(
                (f"  of {name}" if name else "highest g(r)", f"{g:.6g} at r = {r:.6g}{unit}")
                for name, (r, g) in peaks.items()
            ),
        ]
        if args.by_type:
            lines.insert(2, ("highest g(r)", "of each two types"))
        draw = partial(result.plot, unit="Å" if first.unit else None)
        return Found(columns, facts, lines, draw=draw)

    first, frames = load_frames(args)
    cutoff, reason = cutoff_for(first, args)
    return _run_loaded(args, first, cutoff, reason, find)


# ---- what they share -------------------------------------------------------------------------


def _refuse_without_output(args: Namespace, *names: str) -> None:
    for name in names:
        if getattr(args, name) and not args.output:
            option = name.replace("_", "-")
            raise InputError(f"--{option} is for what -o writes: give -o as well")


def _run(args: Namespace, find: Callable[[Scene, Any, Scene, dict[str, Any]], Found]) -> int:
    """A command with rows: of the points of --queries, or of the points themselves."""
    scene = asking = read_points(args)
    cutoff, reason = cutoff_for(scene, args) if hasattr(args, "cutoff") else (None, "")
    how: dict[str, Any] = {"queries": None, "inclusive": not getattr(args, "strict", False)}
    if args.queries is not None:
        asking = read_scene(args.queries)
        n_dims = asking.points.shape[1], scene.points.shape[1]
        if n_dims[0] != n_dims[1]:
            raise InputError(
                f"{args.queries}: has {n_dims[0]} coordinates a point, {scene.source} "
                f"has {n_dims[1]}"
            )
        how["queries"] = hs.Points(asking.points, types=asking.species)
    return _run_loaded(args, scene, cutoff, reason, lambda: find(scene, cutoff, asking, how))


def _run_loaded(
    args: Namespace, scene: Scene, cutoff: Any, reason: str, find: Callable[[], Found],
    what: str = "",
) -> int:  # fmt: skip
    """Open the outputs, find, write, and sum up; `what` the columns are called."""
    target, queries = getattr(args, "plot", None), getattr(args, "queries", None)
    with ExitStack() as stack:
        output = open_output(args.output, args.file, stack, json=args.json)
        plot = open_output(target, args.file, stack, (".png", ".pdf", ".svg"))
        if plot:
            require_matplotlib()
        start = time.perf_counter()
        with searching(scene, args):
            found = find()
        seconds = time.perf_counter() - start
        if output:
            write_columns(output, args.output, found.columns, **found.extra)
        if plot and found.draw:
            from matplotlib.figure import Figure

            figure = Figure(figsize=(7.0, 4.0), layout="constrained")
            axes = figure.subplots()
            found.draw(axes)
            name = printable(Path(scene.source).name)
            axes.set_title(name, fontsize=10, parse_math=False)
            figure.savefig(plot, format=Path(args.plot).suffix[1:], dpi=150)
    if args.output == "-":  # in place of the summary
        return 0
    if args.json:
        facts = describe_source(scene)
        if scene.no_box:
            facts["no_box"] = scene.no_box
        if queries is not None:
            facts["queries"] = queries
        if cutoff is not None:
            facts |= {"cutoff": named_cutoff(cutoff), "cutoff_chosen": args.cutoff is None}
        facts |= {"seconds": seconds, **found.facts, "output": args.output}
        print(json.dumps(facts, indent=2))
        return 0
    lines = describe_points(scene)
    if queries is not None:
        lines.append(("queries", queries))
    lines.append(("box", describe_box(scene)))
    if cutoff is not None:
        lines.append(("cutoff", shown_cutoff(cutoff, scene, reason)))
    lines += found.lines
    if "seconds" not in found.facts:
        lines.append(("time", _duration(seconds)))
    for name, path in ((what, args.output), ("plot ", target)):
        if path:
            lines.append((f"{name}written to", path))
    text = [scene.source, *(f"  {name:<18}{value}" for name, value in lines)]
    print("\n".join(map(printable, text)))
    return 0


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
        means = _means(counts, asking)
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


def _means(counts: NDArray[np.int64], asking: Scene) -> dict[str, float]:
    """The mean number by the element of the point that has them; of all, if it has none."""
    if asking.species is None:
        return {"all": float(counts.mean())}
    names = np.unique(asking.species).tolist()
    return {name: float(counts[asking.species == name].mean()) for name in names}


def _duration(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1 else f"{seconds * 1e3:.3g} ms"
