# SPDX-License-Identifier: BSD-3-Clause
"""What a wrong list does to a run at constant energy: NVE by the velocity Verlet method.

The forces are those of `scenes.Motion`: a Lennard-Jones potential cut at the cutoff and shifted
so that energy and force vanish there, and springs. So the total energy is constant but for the
time step; what a list with missing pairs adds is seen on top of that.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import halfshell as hs
from halfshell_report.truth.accuracy import PairErrors, pair_errors
from halfshell_report.truth.answer import Answer
from halfshell_report.truth.pairs import true_pairs

__all__ = ["EveryStep", "Lists", "Run", "Stale", "Verlet", "run_nve"]

Floats = NDArray[np.float64]

_LOOKS = 8  # steps at which the list is compared with the truth, the last one among them
_LAST_LOOKS = 64  # and at most so many steps that are the last ones of their list


class Lists(Protocol):
    """A way to have the pairs of moving points."""

    @property
    def builds(self) -> int:
        """How many lists were built."""
        ...

    def pairs(self, points: Floats) -> Answer:
        """Return i, j, d, D and S of the pairs within the cutoff."""
        ...


class EveryStep:
    """A new list for every step."""

    def __init__(self, scene: Any, precision: str) -> None:
        self.builds: int = 0
        self._options = _search(scene) | {"precision": precision}

    def pairs(self, points: Floats) -> Answer:
        """Search."""
        self.builds += 1
        i, j, d, D, S = hs.pairs(points, quantities="ijdDS", **self._options)
        return Answer(i, j, S, d, D, inclusive=self._options["inclusive"])


class Verlet:
    """`halfshell.VerletList`: rebuilt when a point has moved too far for the skin."""

    def __init__(self, scene: Any, skin: float) -> None:
        self._list = hs.VerletList(
            scene.cutoff, skin, box=scene.box,
            periodic=scene.periodic if scene.box is not None else None,
            inclusive=scene.inclusive, threads=1,
        )  # fmt: skip
        self._inclusive = scene.inclusive

    @property
    def builds(self) -> int:
        """How many lists were built."""
        return int(self._list.n_builds)

    def pairs(self, points: Floats) -> Answer:
        """Update, and return the pairs within the cutoff."""
        self._list.update(points)
        i, j, d, D, S = self._list.pairs(quantities="ijdDS")
        return Answer(i, j, S, d, D, inclusive=self._inclusive)


class Stale:
    """A list with a skin that is rebuilt by the clock, whatever has moved: each `every` steps."""

    def __init__(self, scene: Any, skin: float, every: int) -> None:
        self.builds = 0
        self._options = _search(scene) | {"cutoff": scene.cutoff + skin}
        self._cutoff, self._inclusive, self.every = scene.cutoff, scene.inclusive, every
        self._rows = np.zeros((scene.ndim,) * 2) if scene.box is None else scene.box
        if self._rows.ndim == 1:
            self._rows = np.diag(self._rows)
        self._steps = 0
        self._listed: tuple[NDArray[Any], ...] = ()

    def pairs(self, points: Floats) -> Answer:
        """Take the list as it is, and of its pairs those within the cutoff."""
        if self._steps % self.every == 0:
            self.builds += 1
            self._listed = tuple(hs.pairs(points, quantities="ijS", **self._options))
        self._steps += 1
        i, j, S = self._listed
        D = points[j] - points[i] + S @ self._rows
        d = np.sqrt((D * D).sum(axis=1))
        near = d <= self._cutoff if self._inclusive else d < self._cutoff
        return Answer(i[near], j[near], S[near], d[near], D[near], inclusive=self._inclusive)


def _search(scene: Any) -> dict[str, Any]:
    return {
        "cutoff": scene.cutoff,
        "box": scene.box,
        "periodic": scene.periodic if scene.box is not None else None,
        "inclusive": scene.inclusive,
        "threads": 1,
    }


@dataclass(frozen=True)
class Run:
    """What a run found; `errors` is summed over the steps that were looked at."""

    seconds: float  # of lists, mean over the steps
    steps: int
    builds: int
    drift: float  # largest change of energy over the kinetic energy at the start
    errors: PairErrors


def run_nve(scene: Any, lists: Lists) -> Run:
    """Run the motion of a scene with lists of some kind."""
    looks = set(np.linspace(0, scene.motion.n_steps, _LOOKS + 1)[1:].astype(int).tolist())
    if isinstance(lists, Stale):
        looks.update(range(lists.every - 1, scene.motion.n_steps, lists.every)[:_LAST_LOOKS])
    energies: list[float] = []
    found: list[PairErrors] = []
    seconds = 0.0
    for step, (points, answer, energy, spent) in enumerate(_trajectory(scene, lists)):
        energies.append(energy)
        seconds += spent
        if step in looks:
            periodic = scene.periodic if scene.box is not None else None
            truth = true_pairs(points, scene.cutoff, scene.box, periodic)
            found.append(pair_errors(truth, answer))
        if not np.isfinite(energy):
            break
    kinetic = _kinetic(scene.motion, scene.motion.velocities)
    with np.errstate(invalid="ignore"):
        drift = float(np.abs(np.array(energies) - energies[0]).max()) / kinetic
    names = ("expected", "given", "missed", "spurious", "duplicate")
    errors = PairErrors(*(sum(getattr(one, name) for one in found) for name in names))
    return Run(seconds / len(energies), len(energies) - 1, lists.builds,
               drift if np.isfinite(drift) else np.inf, errors)  # fmt: skip


def _trajectory(scene: Any, lists: Lists) -> Iterator[tuple[Floats, Answer, float, float]]:
    """Yield points, their list, the total energy and the seconds for the list, step by step."""
    motion = scene.motion
    points, velocities = scene.points.astype(np.float64), motion.velocities.copy()
    forces: Floats = np.zeros(0)
    for step in range(motion.n_steps + 1):
        if step:
            velocities = velocities + 0.5 * motion.dt / motion.mass * forces
            points = points + motion.dt * velocities
            if not np.isfinite(points).all():
                return
        start = time.perf_counter()
        answer = lists.pairs(points)
        spent = time.perf_counter() - start
        with np.errstate(all="ignore"):
            potential, forces = _lennard_jones(scene, answer)
            springs, more = _springs(motion, points)
            forces = forces + more
            if step:
                velocities = velocities + 0.5 * motion.dt / motion.mass * forces
            energy = potential + springs + _kinetic(motion, velocities)
        yield points, answer, energy, spent


def _kinetic(motion: Any, velocities: Floats) -> float:
    return float(0.5 * motion.mass * (velocities * velocities).sum())


def _lennard_jones(scene: Any, answer: Answer) -> tuple[float, Floats]:
    """Energy and forces of the cut and shifted potential."""
    motion, cutoff = scene.motion, scene.cutoff
    assert answer.d is not None and answer.D is not None

    def plain(d: Any) -> tuple[Any, Any]:
        s6 = (motion.sigma / d) ** 6
        energy = 4.0 * motion.epsilon * (s6 * s6 - s6)
        return energy, -24.0 * motion.epsilon * (2.0 * s6 * s6 - s6) / d

    energy, slope = plain(answer.d)
    at_cutoff, slope_there = plain(cutoff)
    total = (energy - at_cutoff - (answer.d - cutoff) * slope_there).sum()
    pull = ((slope - slope_there) / answer.d)[:, None] * answer.D  # on i, towards j
    return float(total), _on_points(scene.n_points, answer.i, answer.j, pull)


def _springs(motion: Any, points: Floats) -> tuple[float, Floats]:
    """Energy and forces of the bonds."""
    if not len(motion.bonds):
        return 0.0, np.zeros_like(points)
    i, j = motion.bonds.T
    D = points[j] - points[i]
    d = np.sqrt((D * D).sum(axis=1))
    stretch = d - motion.lengths
    energy = float((0.5 * motion.stiffnesses * stretch * stretch).sum())
    pull = (motion.stiffnesses * stretch / d)[:, None] * D
    return energy, _on_points(len(points), i, j, pull)


def _on_points(n: int, i: NDArray[Any], j: NDArray[Any], pull: Floats) -> Floats:
    """Add what pulls i towards j, and j towards i, up at every point."""
    forces = np.empty((n, pull.shape[1]))
    for axis, part in enumerate(pull.T):
        forces[:, axis] = np.bincount(i, part, n) - np.bincount(j, part, n)
    return forces
