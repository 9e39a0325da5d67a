# SPDX-License-Identifier: BSD-3-Clause
"""What is made of times: ratios, tables, result files and their rows, and the sections of a page.

A section stands between ``<!-- begin: NAME -->`` and ``<!-- end: NAME -->``. One for which no
figures are given says so, so that a page never shows figures of another version.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_type_hints

from halfshell_report.rows import parsed
from scenes import Limit

__all__ = [
    "COLUMNS", "EMPTY", "OURS", "Lines", "Measurement", "Ratio", "Row", "Table", "duration", "fill",
    "is_ours", "is_reference", "limit_rows", "ratio_rows", "read_csv", "render", "table",
    "table_of_contestants", "table_of_limits", "table_of_ratios", "table_of_single_calls",
    "write_csv", "write_rows",
]  # fmt: skip

OURS = "halfshell"


@dataclass(frozen=True)
class Measurement:
    """One contestant on one scene. Times are seconds of one call."""

    scene: str
    contestant: str
    version: str
    task: str
    n: int
    dim: int
    cutoff: float
    quantities: str
    index_dtype: str
    pairs: int  # of the half list, by this contestant
    repeats: int
    calls: int
    fresh_median: float
    fresh_min: float
    recycled_median: float
    recycled_min: float
    all_held: bool
    complete: bool  # no pair is wrong beyond rounding
    agreement: str
    threads: int = 1
    systems: int = 1  # in one call
    call_median: float | None = None  # seconds of single calls, where they were timed
    call_p99: float | None = None

    @property
    def ns_per_pair(self) -> float:
        """Nanoseconds for each unique pair, with results held."""
        return 1e9 * self.fresh_median / max(self.pairs, 1)

    @property
    def ns_per_point(self) -> float:
        """Nanoseconds for each point, with results held."""
        return 1e9 * self.fresh_median / max(self.n, 1)


@dataclass(frozen=True)
class Ratio:
    """Our time on a scene against the fastest peer, and the ratio that is wanted."""

    scene: str
    ours: Measurement
    peer: Measurement
    want: float | None

    @property
    def fresh(self) -> float:
        """Time of the peer over ours, all results held."""
        return self.peer.fresh_median / self.ours.fresh_median

    @property
    def recycled(self) -> float:
        """Time of the peer over ours, results dropped at once."""
        return self.peer.recycled_median / self.ours.recycled_median

    @property
    def state(self) -> str:
        """Whether the wanted ratio is reached; empty where none is wanted."""
        if self.want is None:
            return ""
        return "reached" if self.fresh >= self.want else "short"


_MACHINE = (
    "date", "machine", "cpu", "cores", "kernel", "compiler", "commit", "os", "python",
    "numpy", "huge_pages", "governor", "load",
)  # fmt: skip
_TIMES = (
    "fresh_median", "fresh_min", "recycled_median", "recycled_min", "call_median", "call_p99",
)  # fmt: skip
_DERIVED = ("ns_per_pair", "ns_per_point", "ratio_fresh", "ratio_recycled", "want")
COLUMNS: tuple[str, ...] = (*_MACHINE, *Measurement.__dataclass_fields__, *_DERIVED)


def _ours(measured: Iterable[Measurement]) -> dict[str, Measurement]:
    return {one.scene: one for one in measured if one.contestant == OURS}


LimitRow = tuple[str, str, float, float | None, str]


def ratio_rows(measured: Sequence[Measurement], wanted: Mapping[str, float | None]) -> list[Ratio]:
    """Compare us with the fastest peer of each scene.

    A peer whose list lacks pairs, or has pairs too many, beyond rounding is left out; one that
    repeats pairs is not. Our own variants, named "halfshell [...]", are no peers.
    """
    rows = []
    for scene, ours in _ours(measured).items():
        peers = [
            one
            for one in measured
            if one.scene == scene and one.complete and not one.contestant.startswith(OURS)
        ]
        if peers:
            fastest = min(peers, key=lambda one: one.fresh_median)
            rows.append(Ratio(scene, ours, fastest, wanted.get(scene)))
    return rows


def limit_rows(
    measured: Sequence[Measurement], limits: Mapping[str, Sequence[Limit]]
) -> list[LimitRow]:
    """Hold us against ourselves: (scene, label, value, at most, state) for each limit.

    The value is our time over the other's, both as a whole, per pair or per point as the
    limit says; for ``"rewrite"`` both are of recycled results; for ``"seconds"`` it is our time.
    """
    others = {(one.scene, one.contestant): one for one in measured}
    rows = []
    for scene, ours in _ours(measured).items():
        for limit in limits.get(scene, ()):
            if limit.kind == "seconds":
                value = ours.fresh_median
            else:
                other = others.get((scene, f"{OURS} [{limit.label}]"))
                if other is None:
                    continue
                value = ours.fresh_median / other.fresh_median
                if limit.kind == "rewrite":
                    value = ours.recycled_median / other.recycled_median
                elif limit.kind == "scene":
                    value *= other.pairs / max(ours.pairs, 1)
                elif limit.kind == "growth":
                    value *= other.n / max(ours.n, 1)
            state = ""
            if limit.at_most is not None:
                state = "reached" if value <= limit.at_most else "over"
            rows.append((scene, limit.label, value, limit.at_most, state))
    return rows


Table = tuple[str, list[str], list[list[str]]]


def table_of_contestants(measured: Sequence[Measurement]) -> Table:
    """Lay out every contestant on every scene."""
    ours = _ours(measured)
    head = ["scene", "contestant", "version", "pairs", "fresh", "min", "recycled", "min",
            "ns/pair", "x ours", "turns", "answer"]  # fmt: skip
    body = []
    for one in measured:
        base = ours.get(one.scene)
        times = f"{one.fresh_median / base.fresh_median:.2f}" if base else ""
        mark = "" if one.all_held else "*"
        body.append([
            one.scene, one.contestant, one.version, str(one.pairs),
            duration(one.fresh_median) + mark, duration(one.fresh_min),
            duration(one.recycled_median), duration(one.recycled_min),
            f"{one.ns_per_pair:.2f}", times, f"{one.repeats} x {one.calls}", one.agreement,
        ])  # fmt: skip
    return "Every contestant (* not all results could be held)", head, body


def table_of_ratios(rows: Sequence[Ratio]) -> Table:
    """Lay out the ratios beside the wanted ones."""
    head = ["scene", "fastest peer", "its time", "ours", "ns/pair", "ratio", "recycled", "wanted",
            ""]  # fmt: skip
    body = [
        [
            row.scene, f"{row.peer.contestant} {row.peer.version}",
            duration(row.peer.fresh_median), duration(row.ours.fresh_median),
            f"{row.ours.ns_per_pair:.2f}", f"{row.fresh:.1f}", f"{row.recycled:.1f}",
            "" if row.want is None else f"{row.want:g}", row.state,
        ]
        for row in rows
    ]  # fmt: skip
    return "Time of the fastest peer over ours", head, body


def table_of_limits(rows: Sequence[LimitRow]) -> Table:
    """Lay out the limits on ourselves."""
    body = [
        [scene, label, f"{value:.4g}", "" if at_most is None else f"{at_most:.4g}", state]
        for scene, label, value, at_most, state in rows
    ]
    return "Our time over our own, or in seconds", ["scene", "against", "is", "at most", ""], body


def table_of_single_calls(measured: Sequence[Measurement]) -> Table:
    """Lay out what single calls take."""
    body = [
        [one.scene, one.contestant, str(one.n), duration(one.call_median), duration(one.call_p99)]
        for one in measured
        if one.call_median is not None and one.call_p99 is not None
    ]
    head = ["scene", "contestant", "points", "median", "99 %"]
    return "Single calls, results dropped", head, body


def duration(seconds: float) -> str:
    """Write a time with three digits and its unit."""
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def render(table: Table, rich: bool = True) -> None:
    """Print a table, with the rich package where it is installed and wanted."""
    title, head, body = table
    if not body:
        return
    if rich:
        try:
            from rich.console import Console
            from rich.markup import escape
            from rich.table import Table as RichTable
        except ImportError:
            pass
        else:
            drawn = RichTable(*head, title=title, title_justify="left")
            for row in body:
                drawn.add_row(*map(escape, row))
            console = Console()
            # A narrow terminal or a file would otherwise break every name in two.
            Console(width=max(console.width, 180) if not console.is_terminal else None).print(drawn)
            return
    widths = [max(len(cell) for cell in column) for column in zip(head, *body, strict=True)]
    print(f"\n{title}")
    for row in (head, *body):
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=True)]
        print("  ".join(cells).rstrip())


def write_rows(path: Path, columns: Iterable[str], rows: Iterable[Mapping[str, Any]]) -> None:
    """Write a table of its own to a new file, and say so."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(columns), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(f"wrote {path}")


def write_csv(
    path: Path,
    facts: Mapping[str, Any],
    measured: Sequence[Measurement],
    wanted: Mapping[str, float | None],
) -> None:
    """Append one row for each measurement; the first line of a new file names the columns."""
    ours = _ours(measured)
    new = not path.exists() or path.stat().st_size == 0
    if not new:
        with path.open(newline="", encoding="utf-8") as file:
            if tuple(next(csv.reader(file))) != COLUMNS:
                raise ValueError(f"{path} has other columns; choose a new file")
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if new:
            writer.writeheader()
        for one in measured:
            row = {**facts, **asdict(one)}
            row["ns_per_pair"] = f"{one.ns_per_pair:.4g}"
            row["ns_per_point"] = f"{one.ns_per_point:.4g}"
            base = ours.get(one.scene)
            if base is not None:
                row["ratio_fresh"] = f"{one.fresh_median / base.fresh_median:.4g}"
                row["ratio_recycled"] = f"{one.recycled_median / base.recycled_median:.4g}"
            want = wanted.get(one.scene)
            row["want"] = "" if want is None else want
            for key in _TIMES:
                row[key] = "" if row[key] is None else f"{row[key]:.6g}"
            writer.writerow(row)


# ---- rows of result files ---------------------------------------------------------------------

# What plain numbers are compared with that are not searches: they show the machine.
_REFERENCES = ("writing the output", "rewriting the output")


@dataclass(frozen=True)
class Row:
    """One line of a result file: what was measured, where and with which kernel."""

    facts: dict[str, str]
    one: Measurement

    @property
    def kernel(self) -> str:
        """The kernel that our calls used."""
        return self.facts.get("kernel", "")


def is_ours(contestant: str) -> bool:
    """Whether a row is of our own search, a variant of it included."""
    return contestant.startswith(OURS) and not is_reference(contestant)


def is_reference(contestant: str) -> bool:
    """Whether a row is the time to write memory, which no search can beat."""
    return any(contestant == f"{OURS} [{name}]" for name in _REFERENCES)


def read_csv(path: Path) -> list[Row]:
    """Read every row. Raises ValueError where a column is missing or a cell is no number."""
    kinds = get_type_hints(Measurement)
    rows = []
    with path.open(newline="", encoding="utf-8") as file:
        for number, line in enumerate(csv.DictReader(file), start=2):
            lacking = [name for name in kinds if line.get(name) is None]
            if lacking:
                raise ValueError(f"{path}, line {number}: no column {', '.join(lacking)}")
            try:
                values = {name: parsed(kind, line[name]) for name, kind in kinds.items()}
            except ValueError as error:
                raise ValueError(f"{path}, line {number}: {error}") from error
            facts = {key: text for key, text in line.items() if key not in kinds}
            rows.append(Row(facts, Measurement(**values)))
    return rows


# ---- sections of a page -----------------------------------------------------------------------

EMPTY = "Not measured for this version yet."

Lines = list[str]


def table(head: Sequence[str], body: Sequence[Sequence[str]]) -> Lines:
    """Lay out a table in Markdown, nothing where there are no rows."""
    if not body:
        return []
    rule = ["---"] * len(head)
    return [f"| {' | '.join(row)} |" for row in (head, rule, *body)]


def fill(page: str, sections: Mapping[str, Sequence[str]]) -> str:
    """Put lines between the marks of each section. Raises ValueError for a missing mark."""
    for name, lines in sections.items():
        begin, end = f"<!-- begin: {name} -->", f"<!-- end: {name} -->"
        head, found, rest = page.partition(begin)
        tail = rest.partition(end)[2]
        if not found or end not in rest:
            raise ValueError(f"no marks of the section {name}")
        body = "\n".join(lines) or EMPTY
        page = f"{head}{begin}\n{body}\n{end}{tail}"
    return page
