# SPDX-License-Identifier: BSD-3-Clause
"""What a report found, in sentences."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import median

from halfshell_report.page.rows import ReportRow

__all__ = ["duration", "findings", "in_short", "methods_of", "number", "ratios", "scene_words"]

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
