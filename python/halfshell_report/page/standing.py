# SPDX-License-Identifier: BSD-3-Clause
"""How each method fared over all scenes, the best first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from halfshell_report.page.rows import ReportRow
from halfshell_report.page.words import methods_of, number

__all__ = ["Standing", "exact_times", "headline", "standings"]


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
        parts.append(f"Precision 'exact' was right on {where}.")
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
