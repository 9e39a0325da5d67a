# SPDX-License-Identifier: BSD-3-Clause
"""Run the report: scenes one by one, and on each the methods that are asked for."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from halfshell._cli.errors import printable
from halfshell_report import measure, physics
from halfshell_report import scenes as catalogue
from halfshell_report.accuracy import Answer, Sample, pair_errors, quantity_errors, sample_of
from halfshell_report.measure import Patience, PeerProcess, Timing, take_turns
from halfshell_report.peers import LIBRARIES, Library
from halfshell_report.physics import Forces, force_errors, reference_forces, sigma_of, why_no_forces
from halfshell_report.reach import reach_of
from halfshell_report.rows import ReportRow
from halfshell_report.truth import Truth, true_pairs

__all__ = ["PEERS", "QUICK", "SCENES", "Plan", "plan_of", "run"]

#: Scenes by name, those with a radius or a support for each point after those with one cutoff.
SCENES = (*catalogue.names(), *catalogue.names(radii=True, supports=True))

#: What "quick" runs unless scenes are named: one of each demand, about 20 s with other libraries.
QUICK = (
    "uniform", "silicon-shell", "fcc-rotated", "near-ties", "hair-ties", "float32-ulp",
    "half-box", "offset-1e6", "many-boxes", "needle", "sheared-1000", "slab", "lognormal",
    "coincident", "subnormal", "plane-2d", "head-on", "balls-decades",
    "balls-ties", "balls-rounded", "balls-giant", "needles",
)  # fmt: skip

#: Other libraries by name.
PEERS = tuple(LIBRARIES)

#: Called with what is done, what there is, and a word on what comes next.
Progress = Callable[[int, int, str], object]

_SHOWN = 12  # names in a message

_SKINS = (0.5, 1.0, 2.0)  # of the skin at which a scene is at its limit
_INTERVALS = {"small": (10, 50), "quick": (10, 50), "full": (5, 10, 20, 50, 200)}


@dataclass(frozen=True)
class Effort:
    """How much work a size of scenes is worth."""

    ours: Patience  # for each of our calls
    peers: Patience
    give_up: float  # seconds a peer may take for one scene
    budget: float  # seconds a peer may take for all
    most_pairs: int  # for the exact sum of forces
    motion: catalogue.Size  # size of the scenes that move


_EFFORTS = {
    "small": Effort(Patience(3, 0.02), Patience(3, 0.02), 60.0, 300.0, 100_000, "small"),
    "quick": Effort(Patience(5, 0.04), Patience(3, 0.02), 1.0, 2.0, 100_000, "small"),
    "full": Effort(Patience(7, 2.0), Patience(5, 3.0), 60.0, 1800.0, 400_000, "quick"),
}


@dataclass(frozen=True)
class Plan:
    """What is to be run, every name checked."""

    scenes: tuple[str, ...]
    methods: tuple[str, ...]
    peers: tuple[str, ...]
    size: catalogue.Size
    patience: float | None = None  # seconds for a peer on a scene, in place of the usual

    @property
    def effort(self) -> Effort:
        """How much care is taken at this size."""
        usual = _EFFORTS[self.size]
        if self.patience is None:
            return usual
        return replace(usual, give_up=self.patience, budget=math.inf)


def plan_of(
    scenes: Sequence[str] | str | None,
    chosen: Sequence[str] | None,
    peers: Sequence[str] | str | None,
    size: str,
    patience: float | None = None,
) -> Plan:
    """Check names; "all" means all, and so does None, except for scenes of size "quick".

    "none" of libraries means none. Raises ValueError with the nearest names.
    """
    libraries = peers
    if scenes is None or isinstance(scenes, str):
        scenes = QUICK if scenes is None and size == "quick" else SCENES
    if isinstance(peers, str):
        libraries = {"all": None, "none": ()}[peers]
    if patience is not None and not 0.0 < patience < math.inf:
        raise ValueError(f"patience must be a positive number of seconds, got {patience!r}")
    if size not in catalogue.SIZES:
        raise ValueError(f"size must be one of {', '.join(catalogue.SIZES)}, got {size!r}")
    return Plan(
        _named("scene", scenes, SCENES),
        _named("method", chosen, measure.METHODS),
        _named("peer", libraries, PEERS),
        size,
        patience,
    )


def _named(kind: str, given: Sequence[str] | None, known: Sequence[str]) -> tuple[str, ...]:
    if given is None:
        return tuple(known)
    for name in given:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=3, cutoff=0.4)
            # Of few names all are shown, the nearest first.
            others = [one for one in known if one not in near]
            many = len(known) > _SHOWN
            shown = near if near and many else [*near, *others][:_SHOWN]
            rest = f", ... ({len(known)} in all)" if len(shown) < len(known) else ""
            raise ValueError(
                f"there is no {kind} {str(name)!r}; choose from {', '.join(shown)}{rest}"
            )
    return tuple(dict.fromkeys(given))


def run(
    plan: Plan,
    progress: Progress = lambda done, total, text: None,
    scene: catalogue.Scene | None = None,
) -> list[ReportRow]:
    """Run all of it, or this scene in place of those of the plan; return the rows in order."""
    effort = plan.effort
    scenes: Sequence[str | catalogue.Scene] = plan.scenes if scene is None else (scene,)
    rows: list[ReportRow] = []
    with ExitStack() as stack:
        others = [
            stack.enter_context(PeerProcess(name, effort.give_up, effort.budget))
            for name in plan.peers
        ]
        progress(0, len(scenes), "importing")
        for other in others:
            other.wait()
        for done, one in enumerate(scenes):
            progress(done, len(scenes), one if isinstance(one, str) else one.name)
            rows += _Stage(one, plan, effort).rows(others)
        progress(len(scenes), len(scenes), "")
    return rows


class _Stage:
    """One scene with its truth, and what is worked out from it when it is first needed."""

    def __init__(self, scene: str | catalogue.Scene, plan: Plan, effort: Effort) -> None:
        self.plan = plan
        self.effort = effort
        self.scene: Any = catalogue.load(scene, plan.size) if isinstance(scene, str) else scene
        self.reach = reach_of(self.scene)
        self.cutoff = self.scene.cutoff if self.reach is None else self.reach.largest
        self.rows_of_box = _rows_of(self.scene, self.cutoff)
        repeating = self.scene.periodic if self.scene.box is not None else ()
        box = "open" if not any(repeating) else "periodic" if all(repeating) else "partly periodic"
        self.blank = ReportRow(
            self.scene.name, self.scene.title, self.scene.n_points, self.scene.ndim,
            self.cutoff, box, "", "",
        )  # fmt: skip
        self._forces: dict[bool, Forces] = {}
        self._no_forces: str | None = None

    def rows(self, others: Sequence[PeerProcess]) -> Iterator[ReportRow]:
        """Yield a row for every method."""
        periodic = self.scene.periodic if self.scene.box is not None else None
        try:
            self.truth: Truth = true_pairs(
                self.scene.points, self.scene.cutoff, self.scene.box, periodic, self.reach
            )
        except (ValueError, MemoryError) as error:
            yield replace(self.blank, status="no truth", note=str(error))
            return
        self.sample: Sample = sample_of(self.truth)
        motion = self.scene.motion
        self.sigma = sigma_of(self.cutoff, motion.sigma if motion is not None else None)
        self._no_forces = (
            why_no_forces(self.truth, self.sigma, self.effort.most_pairs)
            if self.reach is None
            else "no one length to scale them by"
        )
        yield from self._ours()
        for other in others:
            yield self._peer(other)
        if motion is not None:
            yield from _reuse_rows(self.scene.name, self.plan, self.effort)

    def _ours(self) -> Iterator[ReportRow]:
        """Measure our precisions, taking turns."""
        import halfshell as hs

        blank = replace(self.blank, kind="halfshell", version=hs.__version__)
        answered: dict[str, ReportRow] = {}
        calls: dict[str, Callable[[], Any]] = {}
        for method in self.plan.methods:
            if method in measure.REUSE:
                continue
            one = replace(blank, method=method)
            try:
                options = measure.options_of(method, self.scene)
                answered[method] = self._judged(one, measure.answer_of(method, options))
                for what, call in measure.calls_of(method, options).items():
                    calls[f"{method} {what}"] = call
            except ValueError as error:
                answered[method] = replace(one, status="not offered", note=str(error))
            except (OverflowError, MemoryError) as error:
                answered[method] = replace(one, status="failed", note=str(error))
        timings = take_turns(calls, self.effort.ours)
        for method, row in answered.items():
            mine = {
                what: timings[f"{method} {what}"]
                for what in ("ij", "with_d")
                if f"{method} {what}" in timings
            }
            yield _timed(row, mine)

    def _peer(self, other: PeerProcess) -> ReportRow:
        """Ask another library."""
        library = other.library
        reply = other.ask({
            "points": np.asarray(self.scene.points, dtype=np.float64),
            "cutoff": self.cutoff,
            "reach": self.scene.reach,
            "rows": self.rows_of_box,
            "periodic": tuple(self.scene.periodic) if self.scene.box is not None else (),
            "patience": self.effort.peers,
            "pairs": len(self.truth.pairs),
        })  # fmt: skip
        row = replace(
            self.blank, kind="peer", method=other.name, version=other.version or "",
            status=reply["status"], note=printable(reply.get("note", "")),
        )  # fmt: skip
        if reply["status"] != "ok":
            return row
        answer = Answer(
            **reply["answer"], inclusive=library.inclusive, full=library.full,
            own_images_twice=library.own_images_twice,
        )  # fmt: skip
        note = _remark(library, answer, reply["folded"], self.scene)
        return _timed(self._judged(replace(row, note=note), answer), reply["timings"])

    def _judged(self, row: ReportRow, answer: Answer) -> ReportRow:
        """Fill in the errors of an answer."""
        errors = pair_errors(self.truth, answer)
        found = asdict(quantity_errors(self.sample, answer))
        energy = force = None
        if self._no_forces is None:
            if answer.inclusive not in self._forces:
                self._forces[answer.inclusive] = reference_forces(
                    self.truth, answer.inclusive, self.sigma
                )
            plain = SimpleNamespace(
                points=self.scene.points, rows=self.rows_of_box, periodic=self.scene.periodic
            )
            energy, force = force_errors(self._forces[answer.inclusive], answer, plain)
        return replace(
            row, rule="<=" if answer.inclusive else "<",
            compared_by="i j" if answer.S is None else "i j S",
            pairs_true=errors.expected, ties=int(self.truth.tie.sum()), rows_given=errors.given,
            missed=errors.missed, spurious=errors.spurious, duplicate=errors.duplicate,
            energy_error=energy, force_error=force, **found,
        )  # fmt: skip


def _rows_of(scene: Any, cutoff: float) -> Any:
    """The box as rows; for other libraries, rows of open axes that are zero reach round it all."""
    if scene.box is None:
        return None
    box = np.asarray(scene.box, dtype=np.float64)
    rows = np.diag(box) if box.ndim == 1 else box.copy()
    lacking = np.flatnonzero(~rows.any(axis=1))
    if len(lacking):
        present = rows[rows.any(axis=1)]
        across = np.linalg.qr(np.concatenate([present, np.eye(len(rows))]).T)[0].T[len(present) :]
        across = across[np.argsort(np.abs(across).argmax(axis=1), kind="stable")]
        extents = np.ptp(scene.points @ across.T, axis=0) + 3.0 * cutoff
        rows[lacking] = np.abs(extents[:, None]) * across * np.sign(across.sum(axis=1))[:, None]
    return rows


def _remark(library: Library, answer: Answer, folded: bool, scene: Any) -> str:
    """Say what a reader should know about a comparison."""
    told = [library.remark] if library.remark else []
    for given, remark in (
        (scene.radii, library.remark_on_radii), (scene.supports, library.remark_on_supports)
    ):  # fmt: skip
        if given is not None and remark:
            told.append(remark)
    if folded:
        told.append("points were folded into the box in float64 beforehand, as it wants")
    if answer.D is None:
        told.append("D was worked out from S" if answer.S is not None else
                    "D was worked out for the nearest image")  # fmt: skip
    return "; ".join(told)


def _timed(row: ReportRow, timings: dict[str, Timing]) -> ReportRow:
    if "ij" not in timings:
        return row
    plain, with_d = timings["ij"], timings.get("with_d")
    return replace(
        row, seconds=plain.median, seconds_least=plain.least, repeats=plain.repeats,
        seconds_with_d=None if with_d is None else with_d.median,
    )  # fmt: skip


def _reuse_rows(name: str, plan: Plan, effort: Effort) -> Iterator[ReportRow]:
    """Run the motion of a scene with lists that are kept, and with new ones for comparison."""
    import halfshell as hs

    if not set(measure.REUSE) & set(plan.methods):
        return
    scene: Any = catalogue.load(name, effort.motion)
    blank = ReportRow(
        scene.name, scene.title, scene.n_points, scene.ndim, scene.cutoff,
        "open" if scene.box is None else "periodic", "reuse", "", version=hs.__version__,
        rule="<=" if scene.inclusive else "<", compared_by="i j S",
    )  # fmt: skip
    for method, skin, every, lists in _ways(scene, plan):
        found = physics.run_nve(scene, lists)
        yield replace(
            blank, method=method, skin=skin, rebuild_every=every, steps=found.steps,
            builds=found.builds, seconds=found.seconds, drift_kinetic=found.drift,
            pairs_true=found.errors.expected, rows_given=found.errors.given,
            missed=found.errors.missed, spurious=found.errors.spurious,
            duplicate=found.errors.duplicate,
        )  # fmt: skip


def _ways(
    scene: Any, plan: Plan
) -> Iterator[tuple[str, float | None, int | None, physics.Lists]]:
    """Yield method, skin, interval and lists."""
    for precision in measure.PRECISIONS:
        if precision in plan.methods:
            yield f"{precision}, every step", None, 1, physics.EveryStep(scene, precision)
    skins = [share * scene.motion.skin for share in _SKINS]
    if "verlet" in plan.methods:
        for skin in skins:
            yield "verlet", skin, None, physics.Verlet(scene, skin)
    if "stale" in plan.methods:
        for skin in skins:
            for every in _INTERVALS[plan.size]:
                yield "by the clock", skin, every, physics.Stale(scene, skin, every)
