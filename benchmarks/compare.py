# SPDX-License-Identifier: BSD-3-Clause
"""Guard against regressions: hold a new result file against an old one.

    python benchmarks/compare.py OLD.csv NEW.csv [--threshold 0.1] [--figure min]

Our rows are matched by scene, contestant and kernel, in both modes. Where other libraries of
the same version stand in both files, our change is divided by the median of theirs, so that a
machine that was slower throughout does not show; without any, plain times are compared. Exit
status 1 means that something became slower by more than the threshold, 2 that nothing could be
compared.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from pages import Row, Table, duration, is_ours, is_reference, read_csv, render

__all__ = ["Change", "changes", "main", "table_of_changes"]

MODES = ("fresh", "recycled")

Key = tuple[str, str, str]  # scene, contestant, kernel or version
Times = dict[Key, dict[str, float]]


@dataclass(frozen=True)
class Change:
    """One of our times, then and now."""

    scene: str
    contestant: str
    kernel: str
    mode: str
    old: float  # seconds
    new: float
    drift: float | None  # how much slower the others became; None: no other in both files

    @property
    def ratio(self) -> float:
        """New time over old, the drift of the machine taken out."""
        return self.new / self.old / (self.drift or 1.0)


def _times(rows: Sequence[Row], figure: str, ours: bool) -> Times:
    """Collect times by key; of several runs in one file the fastest counts."""
    found: Times = {}
    for row in rows:
        one = row.one
        if is_ours(one.contestant) != ours or is_reference(one.contestant):
            continue
        key = (one.scene, one.contestant, row.kernel if ours else one.version)
        best = found.setdefault(key, {})
        for mode in MODES:
            seconds = getattr(one, f"{mode}_{figure}")
            best[mode] = min(seconds, best.get(mode, seconds))
    return found


def _drift(old: Times, new: Times, scene: str, mode: str) -> float | None:
    """Return the median ratio of the other libraries on a scene, new over old."""
    ratios = [new[key][mode] / old[key][mode] for key in old if key[0] == scene and key in new]
    return median(ratios) if ratios else None


def changes(old: Sequence[Row], new: Sequence[Row], figure: str = "median") -> list[Change]:
    """Match our rows of two result files.

    Parameters
    ----------
    old, new : sequence of Row
    figure : {"median", "min"}
        Which of the times of a row is compared.

    Returns
    -------
    list of Change
        One for each scene, contestant and mode in both, in the order of `old`.
    """
    before, after = _times(old, figure, True), _times(new, figure, True)
    others_before, others_after = _times(old, figure, False), _times(new, figure, False)
    return [
        Change(
            *key, mode, before[key][mode], after[key][mode],
            _drift(others_before, others_after, key[0], mode),
        )
        for key in before
        if key in after
        for mode in MODES
    ]  # fmt: skip


def table_of_changes(found: Sequence[Change], threshold: float) -> Table:
    """Lay out the changes, the worst first."""
    head = ["scene", "contestant", "kernel", "mode", "old", "new", "others", "new/old", ""]
    body = [
        [
            one.scene, one.contestant, one.kernel, one.mode, duration(one.old),
            duration(one.new), "" if one.drift is None else f"{one.drift:.2f}",
            f"{one.ratio:.3f}", _state(one, threshold),
        ]
        for one in sorted(found, key=lambda one: -one.ratio)
    ]  # fmt: skip
    return "New time over old, divided by that of the other libraries", head, body


def _state(one: Change, threshold: float) -> str:
    if one.ratio > 1.0 + threshold:
        return "SLOWER"
    return "faster" if one.ratio < 1.0 / (1.0 + threshold) else ""


def _only(old: Sequence[Row], new: Sequence[Row]) -> Mapping[str, set[str]]:
    """Name the scenes that only one of the files has."""
    before = {row.one.scene for row in old if is_ours(row.one.contestant)}
    after = {row.one.scene for row in new if is_ours(row.one.contestant)}
    return {"OLD": before - after, "NEW": after - before}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("old", type=Path, metavar="OLD")
    parser.add_argument("new", type=Path, metavar="NEW")
    parser.add_argument("--threshold", type=float, default=0.1, metavar="SHARE",
                        help="how much slower is a regression (0.1)")  # fmt: skip
    parser.add_argument("--figure", choices=("median", "min"), default="median",
                        help="which time of each row (median)")  # fmt: skip
    parser.add_argument("--plain", action="store_true", help="tables without the rich package")
    options = parser.parse_args(arguments)
    try:
        old, new = read_csv(options.old), read_csv(options.new)
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    found = changes(old, new, options.figure)
    render(table_of_changes(found, options.threshold), rich=not options.plain)
    for name, scenes in _only(old, new).items():
        if scenes:
            print(f"only in {name}: {', '.join(sorted(scenes))}")
    slower = sum(one.ratio > 1.0 + options.threshold for one in found)
    print(f"{len(found)} times compared, {slower} slower by more than {options.threshold:.0%}")
    if not found:
        return 2
    return 1 if slower else 0


if __name__ == "__main__":
    sys.exit(main())
