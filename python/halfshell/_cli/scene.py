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
from halfshell._convert.memory import refuse_unavailable
from halfshell._functions.rdf import rdf, unit_ball
from halfshell._settings import settings

NEIGHBORS_WANTED = 50  # what a chosen cutoff aims at: two or three shells of a dense system
_COPIES = 5  # of the points, while a cutoff is chosen
BINS = 200  # of g(r): a percent of the cutoff is two bins


def load_scene(args: Namespace) -> tuple[Scene, Any, str]:
    """Return the scene that the options name, the cutoff, and how it was chosen if it was."""
    scene = read_points(args)
    _check_elements(scene, args)
    if args.cutoff is not None:
        return scene, args.cutoff, ""
    return scene, *choose_cutoff(scene)


def _check_elements(scene: Scene, args: Namespace) -> None:
    """InputError where a file has no elements, and an option goes by them."""
    by_elements = isinstance(args.cutoff, dict)
    if scene.species is None and (by_elements or getattr(args, "by_type", False)):
        option = "--cutoff of elements" if by_elements else "--by-type"
        raise InputError(f"{scene.where}: has no elements, which {option} goes by")


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


def load_frames(args: Namespace) -> tuple[Scene, Iterator[Scene], float, str]:
    """Return the first frame that --index names, and all, which are read when they are wanted.

    Then the cutoff as `load_scene` does, of the first.
    """
    if not isinstance(args.index, slice):
        scene, cutoff, reason = load_scene(args)
        return scene, iter([scene]), cutoff, reason
    if args.file is None:
        raise InputError("--index names frames: give a file that has some")
    frames = read_frames(args.file, args.index, **_how_to_read(args))
    first = next(frames)
    _tell_remarks(first)
    _check_elements(first, args)
    cutoff, reason = (args.cutoff, "") if args.cutoff is not None else choose_cutoff(first)
    return first, chain([first], frames), cutoff, reason


def read_points(args: Namespace) -> Scene:
    """Return the scene that the options name; what its reader warned of is said."""
    scene = read_scene(args.file, index=args.index, **_how_to_read(args))
    _tell_remarks(scene)
    return scene


def _how_to_read(args: Namespace) -> dict[str, Any]:
    names = ("columns", "trajectory", "box", "periodic")
    return {"file_format": args.format, **{name: getattr(args, name) for name in names}}


def _tell_remarks(scene: Scene) -> None:
    for remark in scene.remarks:
        print(printable(f"halfshell: warning: {scene.source}: {remark}"), file=sys.stderr)


def choose_cutoff(scene: Scene) -> tuple[float, str]:
    """Return a cutoff at which a point has about fifty neighbours, and how it was chosen.

    The density is that of the box along periodic axes and of the points' extent along the
    others, which is left out where it is zero (points in a plane or on a line). Of few points
    in open space all are neighbours. InputError if the scene has no length to choose by.
    """
    n, ndim = scene.points.shape
    refuse_unavailable(_COPIES * 8 * n * ndim, f"choosing a cutoff for {n:,} points")
    points = np.asarray(scene.points, dtype=np.float64)
    rows = scene.box_rows
    repeating = rows[list(scene.periodic)] if rows is not None else np.empty((0, ndim))
    n_repeating = len(repeating)
    with np.errstate(all="ignore"):
        basis, triangle = np.linalg.qr(repeating.T, mode="complete")
        sides = [abs(float(triangle[k, k])) for k in range(n_repeating)]
        sides += _extents(points @ basis[:, n_repeating:], max(sides, default=0.0))
    k = len(sides)
    if not n_repeating and n <= NEIGHBORS_WANTED + 1:
        cutoff = 1.01 * math.hypot(*sides)  # more than any distance, once rounded
        reason = "all points are neighbours"
    else:
        with np.errstate(all="ignore"):
            logs = np.log(np.array([NEIGHBORS_WANTED, 1 / n, 1 / unit_ball(k), *sides]))
            cutoff = float(np.exp(logs.sum() / max(k, 1)))
        reason = f"about {NEIGHBORS_WANTED} neighbours at this density"
    if not sides or not 0 < cutoff < math.inf:
        raise InputError(f"{scene.source}: has no density to choose a cutoff by; give --cutoff")
    return float(f"{cutoff:.3g}"), reason


def _extents(points: NDArray[np.float64], longest: float) -> list[float]:
    """Return the sides of a box round points, along the axes or the principal axes.

    The box with fewer sides other than zero is taken, or else that of the smaller volume.
    """
    points = points - points.mean(axis=0)
    size = np.abs(points).max(initial=0.0) or 1.0
    unit = np.nan_to_num(points / size)  # so that squares neither overflow nor vanish
    _, axes = np.linalg.eigh(unit.T @ unit)
    boxes = []
    for turned in (points, points @ axes):
        sides = np.ptp(turned, axis=0).tolist()
        floor = 1e-9 * max([longest, *sides])
        boxes.append([side for side in sides if side > floor])
    return min(boxes, key=lambda sides: (len(sides), math.prod(sides)))


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
