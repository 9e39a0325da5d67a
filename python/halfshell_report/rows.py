# SPDX-License-Identifier: BSD-3-Clause
"""A row of the report: one method on one scene. And rows as CSV, and back."""

from __future__ import annotations

import csv
import types
import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import IO, Any

from halfshell import _show

__all__ = ["STATUSES", "ReportRow", "parsed", "read_csv", "write_csv"]

#: What can become of a method on a scene.
STATUSES = (
    "ok", "not offered", "not installed", "left out", "failed", "crashed", "timed out", "no truth",
)  # fmt: skip


@dataclass(frozen=True)
class ReportRow:
    """One method on one scene.

    What was not measured is None. Counts are of pairs, each counted once; times are seconds of
    one call on one thread.

    Attributes
    ----------
    scene, title : str
        Name of the scene, and what it is in a line.
    points, dimensions : int
    cutoff : float
    box : str
        "open", "periodic" or "partly periodic".
    kind : str
        "halfshell", "peer" (another library) or "reuse" (one list for several steps).
    method : str
        What was asked: a precision, an input type, a library, a way to reuse lists.
    version : str
        Of the library.
    rule : str
        ``<=`` or ``<``: whether a pair at exactly the cutoff counts for this method. The truth
        it is compared with follows the same rule.
    status : str
        One of `STATUSES`; all but "ok" come with a `note` and without figures.
    note : str
        The reason, or what a reader should know.
    compared_by : str
        ``i j S``, or ``i j`` where the method tells no shifts.
    seconds, seconds_least : float
        For i and j: median and least over `repeats` calls. Of reuse: the mean over the steps,
        without the forces.
    seconds_with_d : float
        Median for i, j and d (and D, where it is told).
    pairs_true, ties : int
        Pairs by the method's rule; pairs at exactly the cutoff. Of reuse: over all steps that
        were looked at.
    rows_given : int
        Length of the method's list.
    missed, spurious, duplicate : int
        Wrong pairs.
    sampled : int
        Pairs whose d and D were compared with rational arithmetic.
    d_max_ulp, d_rms_ulp, d_max_relative, d_rms_relative : float
        Error of d against the true distance rounded once, in its units in the last place, and
        over the distance.
    D_max_ulp, D_rms_ulp, D_max_relative, D_rms_relative : float
        The same for D, by its worst component, in units in the last place of the distance.
    energy_error, force_error : float
        Of Lennard-Jones sums over the list: relative error of the energy; worst error of the
        force on a point over the mean of what the forces on a point sum to in size.
    skin, drift_kinetic : float
        Of reuse: the skin, and the largest change of the total energy over the kinetic energy
        at the start.
    rebuild_every, steps, builds : int
        Of reuse: the interval, where lists are rebuilt by the clock; time steps; lists built.
    """

    scene: str
    title: str
    points: int
    dimensions: int
    cutoff: float
    box: str
    kind: str
    method: str
    version: str = ""
    rule: str = ""
    status: str = "ok"
    note: str = ""
    compared_by: str = ""
    seconds: float | None = None
    seconds_least: float | None = None
    seconds_with_d: float | None = None
    repeats: int | None = None
    pairs_true: int | None = None
    ties: int | None = None
    rows_given: int | None = None
    missed: int | None = None
    spurious: int | None = None
    duplicate: int | None = None
    sampled: int | None = None
    d_max_ulp: float | None = None
    d_rms_ulp: float | None = None
    d_max_relative: float | None = None
    d_rms_relative: float | None = None
    D_max_ulp: float | None = None
    D_rms_ulp: float | None = None
    D_max_relative: float | None = None
    D_rms_relative: float | None = None
    energy_error: float | None = None
    force_error: float | None = None
    skin: float | None = None
    rebuild_every: int | None = None
    steps: int | None = None
    builds: int | None = None
    drift_kinetic: float | None = None

    _shown = (
        "scene", "method", "status", "seconds", "pairs_true", "missed", "spurious", "duplicate"
    )
    __repr__ = _show.line
    _repr_html_ = _show.html

    @property
    def wrong(self) -> int | None:
        """Missed, spurious and duplicate pairs together, None where nothing was measured."""
        if self.missed is None:
            return None
        return self.missed + (self.spurious or 0) + (self.duplicate or 0)

    @property
    def wrong_share(self) -> float | None:
        """Wrong pairs over true ones."""
        return None if self.wrong is None else self.wrong / max(self.pairs_true or 0, 1)


_TYPES = typing.get_type_hints(ReportRow)


def write_csv(stream: IO[str], facts: Mapping[str, str], rows: Iterable[ReportRow]) -> None:
    """Write one line a row; facts about the machine stand in columns of their own at the end.

    Floats are written with the fewest digits that read back as the same number, and what was
    not measured as nothing.
    """
    names = [field.name for field in fields(ReportRow)]
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*names, *facts])
    for row in rows:
        values = (getattr(row, name) for name in names)
        writer.writerow(["" if x is None else x for x in values] + list(facts.values()))


def read_csv(stream: IO[str]) -> tuple[dict[str, str], list[ReportRow]]:
    """Read what `write_csv` wrote: the facts and the rows."""
    facts: dict[str, str] = {}
    rows = []
    for line in csv.DictReader(stream):
        facts = {name: text for name, text in line.items() if name not in _TYPES}
        rows.append(ReportRow(**{name: parsed(kind, line[name]) for name, kind in _TYPES.items()}))
    return facts, rows


def parsed(kind: Any, text: str) -> Any:
    """Return the value of a field of this type; None where there is none, and the type allows it.

    Raises ValueError for what is no number.
    """
    kinds = typing.get_args(kind) if isinstance(kind, types.UnionType) else (kind,)
    if str in kinds:
        return text
    if not text and types.NoneType in kinds:
        return None
    if bool in kinds:
        return text == "True"
    return float(text) if float in kinds else int(text)
