# SPDX-License-Identifier: BSD-3-Clause
"""A scene of the command line: read as the options say, its cutoff chosen, described, and drawn."""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell._cli.errors import InputError, missing_extra, one_line, printable
from halfshell._cli.files import read_frames, read_scene
from halfshell._cli.structure_files import Scene
from halfshell._functions.neighbors import nearest
from halfshell._functions.rdf import rdf, unit_ball
from halfshell._settings import settings

NEIGHBORS_WANTED = 50  # what a chosen cutoff aims at: two or three shells of a dense system
BINS = 200  # of g(r): a percent of the cutoff is two bins


def load_scene(args: Namespace) -> tuple[Scene, Any, str]:
    """Return the scene that the options name, the cutoff, and how it was chosen if it was."""
    scene = read_points(args)
    return scene, *cutoff_for(scene, args)


def cutoff_for(scene: Scene, args: Namespace) -> tuple[Any, str]:
    """Return the cutoff, and how it was chosen if it was."""
    if args.cutoff is not None:
        return args.cutoff, ""
    with searching(scene, args):
        return choose_cutoff(scene)


def read_points(args: Namespace) -> Scene:
    """Return the scene that the options name; what its reader warned of is said."""
    return load_frames(args)[0]


def load_frames(args: Namespace) -> tuple[Scene, Iterator[Scene]]:
    """Return the first frame that --index names, and all, which are read when they are wanted."""
    how = {name: getattr(args, name) for name in ("columns", "trajectory", "box", "periodic")}
    how["file_format"] = args.format
    if not isinstance(args.index, slice):
        frames = iter([read_scene(args.file, args.index, **how)])
    elif args.file is None:
        raise InputError("--index names frames: give a file that has some")
    else:
        frames = read_frames(args.file, args.index, **how)
    first = next(frames)
    for remark in first.remarks:
        print(printable(f"halfshell: warning: {first.source}: {remark}"), file=sys.stderr)
    by_elements = isinstance(getattr(args, "cutoff", None), dict)
    if first.species is None and (by_elements or getattr(args, "by_type", False)):
        option = "--cutoff of elements" if by_elements else "--by-type"
        raise InputError(f"{first.where}: has no elements, which {option} goes by")
    return first, chain([first], frames)


def shown_cutoff(cutoff: Any, scene: Scene, reason: str = "") -> str:
    """Return a cutoff, or one for each two elements, and how it was chosen if it was."""
    chosen = f"   (chosen: {reason}; --cutoff sets it)" if reason else ""
    lengths = named_cutoff(cutoff)
    if not isinstance(lengths, dict):
        return f"{lengths:.6g}{unit_suffix(scene)}{chosen}"
    return "  ".join(f"{name} {length:.6g}{unit_suffix(scene)}" for name, length in lengths.items())


def named_cutoff(cutoff: Any) -> Any:
    """Return the same for machines: a number, or numbers by names such as ``Si-O``."""
    if not isinstance(cutoff, dict):
        return cutoff
    return {"-".join(names): length for names, length in cutoff.items()}


def choose_cutoff(scene: Scene) -> tuple[float, str]:
    """Return a cutoff at which a point has about fifty neighbours, and how it was chosen.

    It is that of the density where all axes are periodic, otherwise the median distance of the
    fiftieth neighbour of some points. Of few points in open space all are neighbours. InputError if
    the scene has no length to choose by.
    """
    n, ndim = scene.points.shape
    reason = f"about {NEIGHBORS_WANTED} neighbours at this density"
    if not any(scene.periodic) and n <= NEIGHBORS_WANTED + 1:
        sides = np.ptp(scene.known.positions.astype(np.float64), axis=0)
        cutoff = 1.01 * math.hypot(*sides)  # more than any distance, once rounded
        reason = "all points are neighbours"
    elif scene.box_rows is not None and all(scene.periodic):
        volume_each = np.linalg.slogdet(scene.box_rows)[1] - math.log(n)
        logarithm = volume_each + math.log(NEIGHBORS_WANTED / unit_ball(ndim))
        cutoff = float(np.exp(logarithm / ndim))
    else:
        some = np.arange(0, n, 1 + n // 1000)
        d = nearest(scene.known, NEIGHBORS_WANTED, indices=some, quantities="d")
        cutoff = float(np.median(d[:, -1]))
    if not 0 < cutoff < math.inf:
        raise InputError(f"{scene.source}: has no density to choose a cutoff by; give --cutoff")
    return float(f"{cutoff:.3g}"), reason


@contextmanager
def searching(scene: Scene, args: Namespace) -> Iterator[None]:
    """What is around the searches of a command: settings, and errors that name the file."""
    names = ("kernel", "precision", "threads")
    given = {name: getattr(args, name) for name in names if getattr(args, name, None)}
    try:
        with settings(**given):
            yield
    except (ValueError, TypeError, OverflowError, MemoryError) as error:
        raise InputError(f"{scene.where}: {one_line(error)}") from None


def unit_suffix(scene: Scene) -> str:
    """Return what follows a length on standard output: `` Å``, or nothing where unknown."""
    if not scene.unit:
        return ""
    try:
        "Å".encode(sys.stdout.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return " A"
    return " Å"


def describe_source(scene: Scene) -> dict[str, Any]:
    """Return what a summary says of every scene, for machines."""
    n, ndim = scene.points.shape
    return {"file": scene.source, "reader": scene.reader, "points": n, "dimensions": ndim}


def describe_points(scene: Scene) -> list[tuple[str, str]]:
    """Return the same for people, below the name of the file: lines of a summary."""
    n, ndim = scene.points.shape
    names, counts = np.unique([] if scene.species is None else scene.species, return_counts=True)
    species = "  ".join(f"{name} {k:,}" for name, k in zip(names, counts, strict=True))
    points = ("points", f"{n:,} in {ndim}-D" + (f"   {species}" if species else ""))
    return [("read by", scene.reader), points] if scene.reader else [points]


def describe_box(scene: Scene) -> str:
    """Return the edge lengths, the angles unless they are right, and what repeats."""
    rows = scene.box_rows
    if rows is None or not any(scene.periodic):
        left_out = f"; that of the file is left out: {scene.no_box}" if scene.no_box else ""
        return f"none (open in every direction{left_out})"
    lengths = np.sqrt((rows * rows).sum(axis=1))
    sizes = [
        f"{length:.6g}" if flag else "open"
        for length, flag in zip(lengths, scene.periodic, strict=True)
    ]
    text = f"{' x '.join(sizes)}{unit_suffix(scene)}"
    pairs = {2: ((0, 1),), 3: ((1, 2), (0, 2), (0, 1))}.get(len(rows), ())
    if all(scene.periodic) and pairs:
        cosines = [rows[a] @ rows[b] / (lengths[a] * lengths[b]) for a, b in pairs]
        angles = [math.degrees(math.acos(min(1.0, max(-1.0, c)))) for c in cosines]
        if any(abs(angle - 90) > 1e-9 for angle in angles):
            text += f", angles {' '.join(f'{angle:.6g}' for angle in angles)}"
    flags = "".join("T" if flag else "F" for flag in scene.periodic)
    return f"{text}, periodic {flags}"


def require_matplotlib() -> None:
    """Import what --plot needs, before any work is done for it."""
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        raise missing_extra("--plot", "matplotlib") from None


def draw_distances(axes: Any, d: NDArray[np.float64], scene: Scene, cutoff: float) -> None:
    """Draw g(r), or the mean number of neighbours where an axis has no period, and so no volume."""
    unit = "Å" if scene.unit else None
    if scene.box_rows is not None and all(scene.periodic):
        rdf(scene.known, cutoff, BINS).plot(axes, unit=unit)
        return
    counts, edges = np.histogram(d, bins=BINS, range=(0.0, cutoff))
    axes.stairs(2.0 * counts / len(scene.points) / np.diff(edges), edges)
    per = f" / {unit}" if unit else ""
    axes.set_xlabel(f"distance r{per}")
    axes.set_ylabel("neighbours of a point per unit of r\n(raw: no volume to divide by)")
