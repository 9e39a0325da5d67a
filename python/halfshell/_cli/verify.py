# SPDX-License-Identifier: BSD-3-Clause
"""``halfshell verify``: check a list of pairs, ours or another library's, exactly."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal, localcontext
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import halfshell as hs
from halfshell._check.reference import exact_square, reach_by_types, reference_pairs
from halfshell._check.verify import LIST, cause_of, compare
from halfshell._cli.errors import InputError, printable
from halfshell._cli.pair_files import PairList, read_list
from halfshell._cli.scene import (
    describe_points,
    describe_source,
    load_scene,
    named_cutoff,
    read_points,
    searching,
    shown_cutoff,
)
from halfshell._cli.structure_files import Scene
from halfshell._convert.call import take
from halfshell._convert.progress import progress_bar

BLOCKS = 4  # neighbourhoods that a sample is made of
EXAMPLES = 5  # wrong pairs that are shown
POINTS_BY_INTEGERS = 400  # some 80,000 pairs of points: a few seconds in Python
SEARCH_ROWS = 2_000_000  # rows that are compared with the search: some seconds


# Two checks --------------------------------------------------------------------------------


class Check(NamedTuple):
    """What one way of checking found; rows are (i, j, *S), numbered as in the file."""

    by: str
    points: int
    faults: dict[str, NDArray[np.int64]]  # the three kinds of wrong rows by name

    @property
    def ok(self) -> bool:
        """Whether nothing is wrong."""
        return not any(map(len, self.faults.values()))


def check_by_search(pairs: PairList, scene: Scene, cutoff: Any) -> tuple[Check, bool]:
    """Compare with the exact search; what differs is confirmed in rational arithmetic.

    Also returns whether the list is full, as `verify` finds.
    """
    n = len(scene.points)

    def judge(points: hs.Points, part: PairList) -> hs.Verdict:
        return hs.verify(
            points, cutoff, part.i, part.j, part.S,
            inclusive=bool(pairs.inclusive), full=bool(pairs.full),
        )  # fmt: skip

    limit = max(1, n * SEARCH_ROWS // max(SEARCH_ROWS, len(pairs.i)))
    return _check("search", pairs, scene, limit, judge)


def check_by_integers(
    pairs: PairList,
    scene: Scene,
    cutoff: Any,
    limit: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Check:
    """Compare with Python integers, every point with every other, at most `limit` points.

    Without a limit there are `POINTS_BY_INTEGERS`, or fewer where two points make many pairs
    because the cutoff is larger than the box.
    """
    n, ndim = scene.points.shape
    if limit is None:
        images = len(pairs.i) / (1 if pairs.full else 0.5) / n**2
        limit = max(BLOCKS, round(POINTS_BY_INTEGERS / max(1.0, images) ** 0.5))

    def judge(points: hs.Points, part: PairList) -> hs.Verdict:
        reach = reach_by_types(*_types_of(points, cutoff)) if isinstance(cutoff, dict) else cutoff
        periodic = scene.periodic if scene.box is not None else None
        inclusive = bool(pairs.inclusive)
        truth = reference_pairs(
            points.positions, reach, scene.box, periodic, inclusive, progress=progress
        )
        rows = np.array([(i, j, *S) for i, j, S in truth], np.int64).reshape(-1, 2 + ndim)
        given = np.column_stack((part.i, part.j) if part.S is None else (part.i, part.j, part.S))
        return compare(rows[:, : given.shape[1]], given, LIST[bool(pairs.full)])

    return _check("integers", pairs, scene, limit, judge)[0]


def _types_of(points: hs.Points, cutoff: Any) -> tuple[list[int], list[list[float]]]:
    """The type of each point, and the cutoff of each two, negative if they form no pairs."""
    call = take(points, cutoff)
    types, table = call.known.types, call.pairing and call.pairing.table
    assert types is not None and table is not None
    return types.tolist(), table.tolist()


def _check(
    by: str, pairs: PairList, scene: Scene, limit: int,
    judge: Callable[[hs.Points, PairList], hs.Verdict],
) -> tuple[Check, bool]:  # fmt: skip
    """The verdict on some points, numbered as in the file again, and whether the list is full."""
    rows = sample_points(scene, limit)
    points = scene.known if rows is None else scene.known[rows]
    verdict = judge(points, pairs.among(rows, len(scene.points)))
    faults = {name: getattr(verdict, name) for name in ("missed", "spurious", "duplicate")}
    if rows is not None:
        for name, found in faults.items():
            faults[name] = np.concatenate([rows[found[:, :2]], found[:, 2:]], axis=1)
    return Check(by, len(points), faults), verdict.is_full


def sample_points(scene: Scene, limit: int) -> NDArray[np.intp] | None:
    """Choose at most `limit` points, or None to check them all.

    Whether two points are a pair depends on no third one. So the pairs among some points are
    the whole list of a smaller scene, and it can be checked for missed pairs as well. To have
    many pairs the sample is made of `BLOCKS` neighbourhoods, each round a random point.
    The choice is the same in every run.
    """
    n, ndim = scene.points.shape
    if limit == 0 or n <= limit:
        return None
    points = np.asarray(scene.points, dtype=np.float64)
    rows = scene.box_rows
    repeating = rows[list(scene.periodic)] if rows is not None else np.empty((0, ndim))
    random = np.random.default_rng(0)
    chosen: set[int] = set()
    for center in random.choice(n, size=min(BLOCKS, limit), replace=False):
        with np.errstate(all="ignore"):  # near enough to choose by, whatever overflows
            between = points - points[center]
            between -= np.rint(between @ np.linalg.pinv(repeating)) @ repeating
            nearest = np.argpartition((between**2).sum(axis=1), limit // BLOCKS)
        chosen.update(nearest[: max(1, limit // BLOCKS)].tolist())
    return np.array(sorted(chosen), dtype=np.intp)


# The command -------------------------------------------------------------------------------


def run(args: Namespace) -> int:
    """Carry out ``halfshell verify``: 0 when the list is right, 1 when it is not."""
    if args.against and (args.strict or args.kernel):
        raise InputError("--strict and --kernel are for our own list, not with --against")
    if args.list and (args.against or args.kernel):
        raise InputError("--against and --kernel make a list: leave them out, or the file of one")
    peer = None
    if args.against and isinstance(args.cutoff, dict):
        raise InputError("--against takes one cutoff for all pairs")
    if args.against:
        from halfshell_report.against import ask_peer, find_peer, name_and_version

        peer = find_peer(args.against)
    if args.list:
        pairs, scene, cutoff = _saved_list(args)
    else:
        scene, cutoff, _ = load_scene(args)
    checks = []
    with searching(scene, args):
        if peer:
            pairs = PairList(name_and_version(peer), *ask_peer(peer, scene, cutoff))
        elif not args.list:
            author, inclusive = f"halfshell {hs.__version__}", not args.strict
            i, j, S = hs.pairs(scene.known, cutoff, quantities="ijS", inclusive=inclusive)
            pairs = PairList(author, i, j, S.astype(np.int64), inclusive, full=False)
        if args.list or peer:
            check, full = check_by_search(pairs, scene, cutoff)
            pairs = replace(pairs, full=full)
            checks.append(check)
        with progress_bar(args.progress and not args.json, "checking by integers") as advance:
            checks.append(check_by_integers(pairs, scene, cutoff, args.sample, advance))
    ok = all(check.ok for check in checks)
    if not args.json:
        print(_text(pairs, scene, cutoff, checks))
        return 0 if ok else 1
    told = [
        {
            "by": check.by,
            "points": check.points,
            **{name: len(found) for name, found in check.faults.items()},
            "examples": {name: found[:EXAMPLES].tolist() for name, found in check.faults.items()},
        }
        for check in checks
    ]
    report = {
        **describe_source(scene), "list": pairs.author, "cutoff": named_cutoff(cutoff),
        "inclusive": pairs.inclusive, "full": pairs.full, "rows": len(pairs.i), "ok": ok,
        "checks": told,
    }  # fmt: skip
    print(json.dumps(report, indent=2))
    return 0 if ok else 1


def _saved_list(args: Namespace) -> tuple[PairList, Scene, Any]:
    """A list in a file, the points that it is for, and the cutoff."""
    scene = read_points(args)
    found = read_list(args.list, *scene.points.shape)
    cutoff = found.cutoff if args.cutoff is None else args.cutoff
    if cutoff is None:
        raise InputError(f"{args.list}: does not tell its cutoff: give --cutoff")
    if found.cutoff not in (None, cutoff):
        wanted = named_cutoff(cutoff)
        raise InputError(f"{args.list}: is a list for a cutoff of {found.cutoff}, not {wanted}")
    if found.inclusive and args.strict:
        raise InputError(f"{args.list}: is a list for d <= cutoff: leave out --strict")
    S = found.S
    if S is None and not any(scene.periodic):
        S = np.zeros((len(found.i), scene.points.shape[1]), dtype=np.int64)
    inclusive = found.inclusive is not False and not args.strict
    return replace(found, S=S, inclusive=inclusive), scene, cutoff


# The report --------------------------------------------------------------------------------


def _text(pairs: PairList, scene: Scene, cutoff: Any, checks: list[Check]) -> str:
    rule = "d <= cutoff" if pairs.inclusive else "d < cutoff"
    kind = "both directions of each pair" if pairs.full else "each pair once"
    n = len(scene.points)
    lines = [
        *describe_points(scene),
        ("list of", pairs.author),
        ("cutoff", f"{shown_cutoff(cutoff, scene)}   ({rule})"),
        ("rows", f"{len(pairs.i):,}   ({kind})"),
    ]
    for check in checks:
        part = "all" if check.points == n else f"{check.points:,} of the"
        counts = ", ".join(f"{len(found):,} {name}" for name, found in check.faults.items())
        lines.append((f"by {check.by}", f"{counts}   (every pair among {part} {n:,} points)"))
    lines.append(("verdict", "right" if all(check.ok for check in checks) else "WRONG"))
    text = [scene.source, *(f"  {name:<18}{value}" for name, value in lines)]
    wrong = next((check.faults for check in checks if not check.ok), {})
    for name, found in wrong.items():
        for i, j, *shift in found[:EXAMPLES].tolist():
            line = f"  {name}: i={i} j={j}"
            if pairs.S is not None:
                excess = _excess(scene, cutoff, i, j, shift)
                line += f" S={shift}   " + (
                    "these elements form no pairs" if excess is None
                    else f"distance - cutoff = {excess:+.3e}"
                )  # fmt: skip
            text.append(line)
        if len(found) > EXAMPLES:
            text.append(f"  {name}: and {len(found) - EXAMPLES:,} more")
    cause = wrong and cause_of(wrong["missed"], wrong["spurious"])
    if cause:
        text.append(f"  {cause}")
    return "\n".join(map(printable, text))


def _excess(scene: Scene, cutoff: Any, i: int, j: int, shift: list[int]) -> Decimal | None:
    """Return distance - cutoff of a pair, from exact arithmetic, never 0 unless it is 0."""
    if isinstance(cutoff, dict):
        types, table = _types_of(scene.known, cutoff)
        cutoff = table[types[i]][types[j]]
        if cutoff < 0.0:
            return None
    square = exact_square(scene.points, i, j, shift, scene.box)
    above = square - Fraction(cutoff) ** 2
    with localcontext() as context:
        context.prec = 30
        distance = (Decimal(square.numerator) / Decimal(square.denominator)).sqrt()
        both = distance + Decimal(cutoff)
        return Decimal(above.numerator) / Decimal(above.denominator) / both if both else both
