# SPDX-License-Identifier: BSD-3-Clause
"""Fill the marked sections of docs/performance.md from result files.

    python benchmarks/fill_docs.py --results CSV --memory CSV --stages CSV

How sections are marked is said in `marks`.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path

from pages import (
    EMPTY,
    OURS,
    Lines,
    Row,
    duration,
    fill,
    is_ours,
    limit_rows,
    ratio_rows,
    read_csv,
    table,
)
from scenes import GROUPS, SCENES, Limit, load

__all__ = ["EMPTY", "SECTIONS", "fill", "main"]

_PAGE = Path(__file__).resolve().parents[1] / "docs" / "performance.md"


@cache
def _limits_of(scene: str) -> tuple[Limit, ...]:
    """Return the limits of a scene, whose points take long to make."""
    return load(scene).limits


def _limits(rows: Sequence[Row], kinds: Sequence[str]) -> list[tuple[Limit, str, float]]:
    """Hold our rows against the limits of these kinds: limit, scene and value."""
    names = dict.fromkeys(row.one.scene for row in rows if row.one.scene in SCENES)
    found = []
    for name in names:
        chosen = tuple(limit for limit in _limits_of(name) if limit.kind in kinds)
        by_label = {limit.label: limit for limit in chosen}
        for scene, label, value, _, _ in limit_rows([row.one for row in rows], {name: chosen}):
            if scene == name:
                found.append((by_label[label], scene, value))
    return found


def machine(rows: Sequence[Row]) -> Lines:
    """Say where and with what the figures were measured."""
    if not rows:
        return []
    facts = rows[0].facts
    versions = {
        row.one.contestant: row.one.version for row in rows if not is_ours(row.one.contestant)
    }
    others = ", ".join(
        f"{name} {version}" for name, version in sorted(versions.items())
        if not name.startswith(OURS)
    )  # fmt: skip
    loads = [float(row.facts["load"]) for row in rows if row.facts["load"]]
    return [
        f"{facts['cpu']}, {facts['cores']} cores, kernel {facts['kernel']}, {facts['compiler']},",
        f"{facts['machine']} {facts['os']}, huge pages {facts['huge_pages'] or 'unknown'}, Python "
        f"{facts['python']}, NumPy {facts['numpy']}. Measured on {facts['date'][:10]} at commit",
        f"{facts['commit']}; load when the runs began at most {max(loads, default=0.0):g}. Others:",
        f"{others}.",
    ]


def _is_main(row: Row) -> bool:
    """Whether a row is of a scene with a wanted ratio, or of the main ones."""
    return row.one.scene in GROUPS["main"] or bool(row.facts["want"])


def ratios(rows: Sequence[Row]) -> Lines:
    """Compare us with the fastest library on each scene with a wanted ratio."""
    mine = [row.one for row in rows if _is_main(row)]
    body = [
        [
            f"`{one.scene}`", duration(one.ours.fresh_median) + _star(one.ours.all_held),
            f"{one.ours.ns_per_pair:.2f}",
            f"{one.peer.contestant}, {duration(one.peer.fresh_median)}",
            f"{one.fresh:.1f}", f"{one.recycled:.1f}",
        ]
        for one in ratio_rows(mine, {})
    ]  # fmt: skip
    return table(["scene", "ours", "ns a pair", "fastest other", "ratio", "results dropped"], body)


def _star(all_held: bool) -> str:
    return "" if all_held else " \\*"


def families(rows: Sequence[Row]) -> Lines:
    """Compare us with the fastest library on the families of scenes."""
    names = {name for group, scenes in GROUPS.items() if group not in ("main", "S1")
             for name in scenes}  # fmt: skip
    mine = [row.one for row in rows if row.one.scene in names and not _is_main(row)]
    body = [
        [
            f"`{one.scene}`", duration(one.ours.fresh_median), f"{one.ours.ns_per_pair:.2f}",
            f"{one.peer.contestant}, {duration(one.peer.fresh_median)}", f"{one.fresh:.1f}",
        ]
        for one in ratio_rows(mine, {})
    ]  # fmt: skip
    return table(["scene", "ours", "ns a pair", "fastest other", "ratio"], body)


def exactness(rows: Sequence[Row]) -> Lines:
    """Show what the exact decision costs, and a tilted box."""
    body = [
        [
            f"`{scene}`", limit.label, f"{value:.3f}",
            "" if limit.at_most is None else f"{limit.at_most:g}",
        ]
        for limit, scene, value in _limits(rows, ("variant", "scene"))
        if "threads" not in limit.options
    ]  # fmt: skip
    return table(["scene", "against", "our time over it", "at most"], body)


def writing(rows: Sequence[Row]) -> Lines:
    """Show how far we are from the time to write the output."""
    found: dict[str, dict[str, str]] = {}
    for limit, scene, value in _limits(rows, ("floor", "rewrite")):
        cells = found.setdefault(scene, {})
        cells[limit.kind] = f"{value:.2f}"
        if limit.kind == "floor" and limit.at_most is not None:
            cells["at most"] = f"{limit.at_most:g}"
    body = [
        [f"`{scene}`", *(cells.get(key, "") for key in ("floor", "at most", "rewrite"))]
        for scene, cells in found.items()
    ]
    return table(["scene", "over writing, kept", "at most", "over rewriting, dropped"], body)


def growth(rows: Sequence[Row]) -> Lines:
    """Show nanoseconds a point at each size, in random and sorted order."""
    ours = {row.one.scene: row.one for row in rows if row.one.contestant == OURS}
    # Measured in turn with 1e5 points, not taken from another minute.
    over = {scene: value for _, scene, value in _limits(rows, ("growth",))}
    body = []
    for name in GROUPS["growth"]:
        if name not in ours:
            continue
        one = ours[name]
        order = "sorted" if name.endswith("-sorted") else "random"
        body.append([
            name.split("-")[1], order, duration(one.fresh_median) + _star(one.all_held),
            f"{one.ns_per_point:.0f}", f"{over[name]:.2f}" if name in over else "",
        ])  # fmt: skip
    return table(["points", "order", "time", "ns a point", "over 1e5 random"], body)


def threads(rows: Sequence[Row]) -> Lines:
    """Show how much faster two threads are."""
    body = [
        [f"`{scene}`", f"{1.0 / value:.2f}"]
        for limit, scene, value in _limits(rows, ("variant",))
        if "threads" in limit.options
    ]
    return table(["scene", "one thread over two"], body)


def latency(rows: Sequence[Row]) -> Lines:
    """Show median and 99th percentile of single calls, ours and of the fastest other."""
    body = []
    for name in dict.fromkeys(row.one.scene for row in rows):
        timed = [
            row.one for row in rows
            if row.one.scene == name and row.one.call_median is not None and row.one.complete
        ]  # fmt: skip
        ours = next((one for one in timed if one.contestant == OURS), None)
        others = [one for one in timed if not one.contestant.startswith(OURS)]
        if ours is None:
            continue
        cells = [f"`{name}`", str(ours.n)]
        best = min(others, key=lambda one: one.call_median or 0.0, default=None)
        for one in (ours, best):
            times = (None, None) if one is None else (one.call_median, one.call_p99)
            cells += ["" if time is None else duration(time) for time in times]
        body.append([*cells, "" if best is None else best.contestant])
    head = ["scene", "points", "ours, median", "99 %", "other, median", "99 %", "which"]
    return table(head, body)


def memory(lines: Sequence[Mapping[str, str]]) -> Lines:
    """Show the peak of a call beyond its output."""
    body = [
        [
            f"`{line['scene']}`", line["quantities"], f"{int(line['output']) / 1e6:.1f} MB",
            f"{int(line['beyond']) / 1e6:.1f} MB", f"{int(line['beyond']) / int(line['n']):.0f}",
            f"{int(line['allowed']) / 1e6:.1f} MB",
        ]
        for line in lines
    ]  # fmt: skip
    head = ["scene", "quantities", "output", "beyond it", "bytes a point", "allowed"]
    return table(head, body)


def stages(lines: Sequence[Mapping[str, str]]) -> Lines:
    """Show which stage of the decision settled how many pairs."""
    keys = ("ambiguous", "by_float64", "by_double_word", "by_integers")
    body = [
        [f"`{line['scene']}`", line["pairs"], *(f"{float(line[key]):.2g}" for key in keys)]
        for line in lines
    ]
    return table(
        ["scene", "pairs", "ambiguous", "by float64", "by double words", "by integers"], body
    )


SECTIONS: dict[str, Callable[[Sequence[Row]], Lines]] = {
    "machine": machine,
    "ratios": ratios,
    "families": families,
    "writing": writing,
    "exactness": exactness,
    "growth": growth,
    "threads": threads,
    "latency": latency,
}


def _lines(path: Path | None) -> list[dict[str, str]]:
    if path is None:
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, metavar="CSV", help="of run.py")
    parser.add_argument("--memory", type=Path, metavar="CSV", help="of footprint.py")
    parser.add_argument("--stages", type=Path, metavar="CSV", help="of stages.py")
    parser.add_argument("--page", type=Path, default=_PAGE, metavar="MD")
    options = parser.parse_args(arguments)
    rows = read_csv(options.results) if options.results else []
    # Other kernels stand in the figures alone.
    rows = [row for row in rows if row.kernel == rows[0].kernel]
    sections: dict[str, Lines] = {name: make(rows) for name, make in SECTIONS.items()}
    sections["memory"] = memory(_lines(options.memory))
    sections["stages"] = stages(_lines(options.stages))
    page = fill(options.page.read_text(encoding="utf-8"), sections)
    options.page.write_text(page, encoding="utf-8")
    print(f"wrote {options.page}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
