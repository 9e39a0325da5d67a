# SPDX-License-Identifier: BSD-3-Clause
"""What a report found: in sentences, as a standing of all methods, as tables in a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from halfshell_report.rows import ReportRow

__all__ = [
    "SUMMARY", "Standing", "duration", "exact_times", "findings", "headline", "in_short",
    "method_label", "methods_of", "number", "ratios", "scene_table", "scene_words", "standings",
    "summary_cells", "summary_table",
]  # fmt: skip

Rows = Sequence[ReportRow]


def number(value: float | None) -> str:
    """A figure with two or three digits, or nothing."""
    if value is None:
        return ""
    if isinstance(value, int) and abs(value) < 100_000:
        return f"{value:,}"
    if value == 0 or 99.5 <= abs(value) < 999.5:
        return f"{value:.0f}"
    return f"{value:.2g}" if abs(value) < 99.5 else f"{value:.1e}"


def duration(seconds: float | None) -> str:
    """Seconds in a unit that fits."""
    if seconds is None:
        return ""
    for unit, name in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds / 1e-6:.2g} µs"


def methods_of(rows: Iterable[ReportRow], *kinds: str) -> list[str]:
    """Names of the methods of these kinds, in the order of the rows."""
    return list(dict.fromkeys(row.method for row in rows if row.kind in kinds))


def ratios(rows: Rows, method: str, over: str) -> dict[str, float]:
    """Least time of a method over that of another, by scene."""
    times = {
        (row.scene, row.method): row.seconds_least
        for row in rows
        if row.kind == "halfshell" and row.seconds_least
    }
    found = {}
    for scene in dict.fromkeys(row.scene for row in rows):
        one, other = times.get((scene, method)), times.get((scene, over))
        if one and other:
            found[scene] = one / other
    return found


def _times(count: int, word: str) -> str:
    return f"{count:,} {word}{'' if count == 1 else 's'}"


def in_short(row: ReportRow) -> str:
    """How a method fared on a scene: "right", "3 missed, 1 spurious", or why it was not run."""
    if row.status != "ok":
        return row.status
    kinds = {"missed": row.missed, "spurious": row.spurious, "duplicate": row.duplicate}
    return ", ".join(f"{count:,} {kind}" for kind, count in kinds.items() if count) or "right"


def findings(rows: Rows) -> list[str]:
    """Sentences, the most important first."""
    plain = [row for row in rows if row.kind in ("halfshell", "peer")]
    said = [_about(plain, method) for method in methods_of(plain, "halfshell")]
    said += _cost(rows)
    said += [_about(plain, method) for method in methods_of(plain, "peer")]
    said += _reuse([row for row in rows if row.kind == "reuse"])
    lost = [row.scene for row in rows if row.status == "no truth"]
    if lost:
        said.append(f"No truth could be worked out for {', '.join(lost)}.")
    return said


def _about(rows: Rows, method: str) -> str:
    """One method over all scenes."""
    mine = [row for row in rows if row.method == method]
    done = [row for row in mine if row.status == "ok"]
    name = f"precision {method!r}" if method in ("exact", "double", "single") else method
    if method == "float32":
        name = "float32 input (points rounded beforehand, then decided exactly)"
    if not done:
        states = dict.fromkeys(row.status for row in mine)
        return f"{_capital(name)}: {', '.join(states)}; no list to judge."
    pairs = sum(row.pairs_true or 0 for row in done)
    wrong = [row for row in done if row.wrong]
    text = f"{_capital(name)} gave {_times(len(done), 'list')} with {_times(pairs, 'pair')} in all"
    if not wrong:
        text += ", and every one was right."
    else:
        total = sum(row.wrong or 0 for row in wrong)
        worst = max(wrong, key=lambda row: row.wrong_share or 0.0)
        text += (
            f"; {len(wrong)} of the lists {'is' if len(wrong) == 1 else 'are'} wrong, by "
            f"{_times(total, 'pair')}. Worst on {worst.scene}, which has "
            f"{_times(worst.pairs_true or 0, 'pair')}: {in_short(worst)}."
        )
    return text + _not_done(mine) + _distances(done)


def _not_done(rows: Rows) -> str:
    """What became of the other scenes."""
    states = [row.status for row in rows if row.status != "ok"]
    parts = [f"{states.count(state)} {state}" for state in dict.fromkeys(states)]
    return f" Scenes without a list: {', '.join(parts)}." if parts else ""


def _distances(rows: Rows) -> str:
    told = [row for row in rows if row.d_max_ulp is not None]
    if not told:
        return ""
    worst = max(told, key=lambda row: row.d_max_ulp or 0.0)
    if not worst.d_max_ulp:
        return " Every distance that was checked is the true one, rounded once."
    return (
        f" Distances are off by {number(worst.d_max_ulp)} "
        f"{'unit' if worst.d_max_ulp == 1 else 'units'} in the last place at worst "
        f"({worst.scene})."
    )


def _cost(rows: Rows) -> list[str]:
    """What the exact decision costs."""
    said = []
    for other in ("double", "single"):
        found = ratios(rows, "exact", other)
        if found:
            worst = max(found, key=lambda scene: found[scene])
            said.append(
                f"The exact decision takes {median(found.values()):.2f} times as long as "
                f"{other!r} in the median scene, and {found[worst]:.2f} times in the worst "
                f"({worst})."
            )
    return said


def _reuse(rows: Rows) -> list[str]:
    """Lists that are kept over steps."""
    said = []
    for scene in dict.fromkeys(row.scene for row in rows):
        mine = [row for row in rows if row.scene == scene]
        for method, words in (("verlet", "Verlet lists, rebuilt in time"),
                              ("by the clock", "lists rebuilt by the clock")):  # fmt: skip
            runs = [row for row in mine if row.method == method]
            wrong = [row for row in runs if row.wrong]
            drifts = [row.drift_kinetic for row in runs if row.drift_kinetic is not None]
            if not runs:
                continue
            text = f"On {scene}, {_times(len(runs), 'run')} with {words}: "
            text += f"{len(wrong)} missed pairs" if wrong else "none missed a pair"
            if drifts:
                ends = dict.fromkeys([number(min(drifts)), number(max(drifts))])
                text += f"; the energy drifts by {' to '.join(ends)} of the kinetic energy"
            every = [row.drift_kinetic for row in mine if row.method == "exact, every step"]
            if every and every[0] is not None:
                text += f" ({number(every[0])} with a new list in every step)"
            said.append(text + ".")
    return said


def scene_words(rows: Rows) -> str:
    """One scene: who is right, who is wrong, who does not take part."""
    plain = [row for row in rows if row.kind in ("halfshell", "peer")]
    right = [row.method for row in plain if row.status == "ok" and not row.wrong]
    wrong = [f"{row.method} ({in_short(row)})" for row in plain if row.wrong]
    out = [f"{row.method} ({row.note or row.status})" for row in plain
           if row.status == "not offered"]  # fmt: skip
    broken = [
        f"{row.method} ({row.status}: {row.note})"
        for row in plain
        if row.status in ("failed", "crashed", "timed out")
    ]
    parts = []
    for label, names in (("Right", right), ("Wrong", wrong), ("No answer", broken),
                         ("Not offered", out)):  # fmt: skip
        if names:
            parts.append(f"{label}: {', '.join(names)}.")
    return " ".join(parts)


def _capital(text: str) -> str:
    """A capital first letter, but not for the name of a library."""
    return text[0].upper() + text[1:] if text.startswith("precision") else text


@dataclass(frozen=True)
class Standing:
    """One method over all scenes.

    Attributes
    ----------
    right, wrong, late, failed, not_offered, absent : int
        Scenes by what became of them: a right list, a wrong one, none in time, an error or a crash,
        nothing that the method claims to do; not installed, or left out.
    missed, spurious, duplicate : int
        Pairs over all lists.
    ulp : float, optional
        The largest error of a distance, in units in the last place.
    slower : float, optional
        Median over the scenes of the run time, relative to that of precision "exact".
    """

    method: str
    version: str
    right: int
    wrong: int
    late: int
    failed: int
    not_offered: int
    absent: int
    missed: int
    spurious: int
    duplicate: int
    ulp: float | None
    slower: float | None

    @property
    def asked(self) -> int:
        """Scenes that the method could be expected to answer."""
        return self.right + self.wrong + self.late + self.failed

    @property
    def share(self) -> float:
        """Of these, the share that it answered rightly; 0 where there are none."""
        return self.right / self.asked if self.asked else 0.0


def exact_times(rows: Sequence[ReportRow]) -> dict[str, float]:
    """Seconds that precision "exact" took on each scene."""
    return {
        row.scene: row.seconds
        for row in rows
        if row.kind == "halfshell" and row.method == "exact" and row.seconds
    }


def standings(rows: Sequence[ReportRow]) -> list[Standing]:
    """One for each method: most right lists first, then fewest wrong ones, then the quickest."""
    exact = exact_times(rows)
    found = [
        _standing([row for row in rows if row.method == method and row.kind != "reuse"], exact)
        for method in methods_of(rows, "halfshell", "peer")
    ]
    return sorted(found, key=lambda one: (-one.right, one.wrong, one.slower or 0.0))


def _standing(rows: Sequence[ReportRow], exact: dict[str, float]) -> Standing:
    states = [row.status for row in rows]
    done = [row for row in rows if row.status == "ok"]
    slower = [row.seconds / exact[row.scene] for row in done if row.seconds and row.scene in exact]
    ulps = [row.d_max_ulp for row in done if row.d_max_ulp is not None]
    return Standing(
        method=rows[0].method,
        version=next((row.version for row in rows if row.version), ""),
        right=sum(1 for row in done if not row.wrong),
        wrong=sum(1 for row in done if row.wrong),
        late=states.count("timed out"),
        failed=states.count("failed") + states.count("crashed"),
        not_offered=states.count("not offered"),
        absent=states.count("not installed") + states.count("left out"),
        missed=sum(row.missed or 0 for row in done),
        spurious=sum(row.spurious or 0 for row in done),
        duplicate=sum(row.duplicate or 0 for row in done),
        ulp=max(ulps, default=None),
        slower=median(slower) if slower else None,
    )


def headline(rows: Sequence[ReportRow]) -> str:
    """What matters most, in one or two sentences."""
    found = [one for one in standings(rows) if one.asked]
    ours = next((one for one in found if one.method == "exact"), None)
    libraries = {row.method for row in rows if row.kind == "peer"}
    others = [one for one in found if one.method in libraries]
    parts = []
    if ours is not None:
        right = f"all {ours.asked}" if ours.right == ours.asked else f"{ours.right} of {ours.asked}"
        where = "the one scene" if ours.right == ours.asked == 1 else f"{right} scenes"
        parts.append(f"halfshell was right on {where}.")
    if others:
        best = max(others, key=lambda one: (one.share, one.right))
        many = f"Of {len(others)} other libraries the best one, {best.method}," if others[1:] else (
            f"{best.method}, the other library,"
        )
        took = "" if best.slower is None or ours is None else (
            f", and took {number(best.slower)} times as long in the median"
        )
        parts.append(f"{many} was right on {best.right} of {best.asked}{took}.")
    return " ".join(parts)


SUMMARY = (
    "method", "version", "right", "wrong", "timed out", "failed", "not offered", "missed",
    "spurious", "duplicate", "d, ulp", "time / exact",
)  # fmt: skip
# Narrower heads for 80 columns.
_NARROW = {"timed out": "late", "not offered": "n/a", "duplicate": "twice", "time / exact": "time"}


def summary_cells(rows: Sequence[ReportRow]) -> list[list[str]]:
    """One line a method over all scenes, the best first, under the heads of `SUMMARY`.

    Scenes with a right list, with a wrong one, with none in time, with an error or a crash, and
    scenes that the method does not offer; wrong pairs; the largest error of a distance; the median
    of the time over that of precision "exact".
    """
    lines = []
    for one in standings(rows):
        pairs = (one.missed, one.spurious, one.duplicate)
        lines.append([
            one.method, one.version,
            *map(str, (one.right, one.wrong, one.late, one.failed, one.not_offered)),
            *(map(number, pairs) if one.right + one.wrong else [""] * 3), number(one.ulp),
            number(one.slower) if one.method != "exact" else "",
        ])  # fmt: skip
    return lines


def summary_table(rows: Sequence[ReportRow]) -> Any:
    """Return a rich table of `summary_cells`, narrow enough for 80 columns."""
    from rich import box
    from rich.table import Table

    table = Table(
        title="All scenes: right, wrong, late, failed, not offered (n/a); wrong pairs",
        title_justify="left", box=box.SIMPLE_HEAD, padding=0, pad_edge=False,
    )  # fmt: skip
    for k, head in enumerate(SUMMARY):
        if k != 1:
            name = _NARROW.get(head, head)
            table.add_column(name, justify="right" if k else "left", no_wrap=True)
    for line in summary_cells(rows):
        wrong = f"[bold red]{line[3]}[/]" if line[3] != "0" else line[3]
        table.add_row(line[0], line[2], wrong, *line[4:])
    return table


def scene_table(rows: Sequence[ReportRow]) -> Any:
    """Return what rich prints for one scene: a line a method, then why some have none."""
    from rich.console import Group
    from rich.text import Text

    first = rows[0]
    parts: list[Any] = [Text(f"{first.scene}: {first.title}; {first.points:,} points", "bold")]
    plain = [row for row in rows if row.kind != "reuse" and row.status == "ok"]
    parts.append(_lines(plain, {
        "method": lambda row: row.method,
        "": lambda row: row.rule,
        "time": lambda row: duration(row.seconds),
        "pairs": in_short,
        "d, ulp": lambda row: number(row.d_max_ulp),
        "D, ulp": lambda row: number(row.D_max_ulp),
        "energy": lambda row: number(row.energy_error),
        "forces": lambda row: number(row.force_error),
    }))  # fmt: skip
    parts += [
        Text(f"{row.method}: {row.status}{': ' if row.note else ''}{row.note}", "dim")
        for row in rows
        if row.status != "ok"
    ]
    parts.append(_lines([row for row in rows if row.kind == "reuse"], {
        "lists": lambda row: row.method,
        "skin": lambda row: number(row.skin),
        "every": lambda row: number(row.rebuild_every),
        "built": lambda row: number(row.builds),
        "a step": lambda row: duration(row.seconds),
        "pairs": in_short,
        "drift": lambda row: number(row.drift_kinetic),
    }))  # fmt: skip
    return Group(*(part for part in parts if part is not None), "")


def _lines(
    rows: Sequence[ReportRow], columns: dict[str, Callable[[ReportRow], str]]
) -> Any | None:
    """A rich table, without columns that are empty; None without rows."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    shown = []
    for head, cell in columns.items():
        cells = [cell(row) for row in rows]
        if any(cells):
            shown.append(cells)
            left = head in ("method", "lists", "pairs", "")
            table.add_column(head, justify="left" if left else "right", no_wrap=True)
    for row, *line in zip(rows, *shown):
        table.add_row(*line, style="bold red" if row.wrong else None)
    return table if rows else None


def method_label(row: ReportRow) -> str:
    """A method with what tells its runs apart."""
    parts = [row.method]
    if row.skin is not None:
        parts.append(f"skin {row.skin:.3g}")
    if row.method == "by the clock":
        parts.append(f"every {row.rebuild_every}")
    return ", ".join(parts)
