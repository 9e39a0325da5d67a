# SPDX-License-Identifier: BSD-3-Clause
"""What wrong pairs do to physics: sums over a list, and a run at constant energy.

The Lennard-Jones potential of a list is ``4 ((sigma / d)**12 - (sigma / d)**6)``, cut at the
cutoff and not shifted, so that a pair lost there is seen. The reference takes the true pairs and
their true vectors: every term in integers of 2**-128 of the unit of energy, wrong by less than
some 2**-110 of it, added exactly and rounded once, as `math.fsum` would round the sum of the true
terms. A method's sum is what its user would write: its own d and D in float64, added by NumPy.
Where it tells none, its user works them out in float64 from the points, the box and S, or the
nearest image.

A run (NVE, by the velocity Verlet method) has the forces of `scenes.Motion`: the potential cut at
the cutoff and shifted so that energy and force vanish there, and springs. So the total energy is
constant but for the time step; what a list with missing pairs adds is seen on top of that.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import halfshell as hs
from halfshell_report.accuracy import Answer, PairErrors, pair_errors
from halfshell_report.integers import Objects, as_integers, nearest_float
from halfshell_report.truth import Truth, exact_vectors, true_pairs

__all__ = [
    "EveryStep", "Forces", "Lists", "Stale", "Verlet", "force_errors", "reference_forces",
    "run_nve", "sigma_of", "why_no_forces",
]  # fmt: skip

Floats = NDArray[np.float64]

_BITS = 128  # after the point
_SIGMAS = 2.5  # the usual cutoff over sigma
_CLOSEST = 0.5  # of sigma: the energy of a closer pair hides all others
_CHUNK = 1 << 15


@dataclass(frozen=True, eq=False)
class Forces:
    """Energy and forces in units of epsilon and sigma; `scale` is a point's mean sum of |f|."""

    sigma: float
    energy: float
    forces: Floats  # (n, d)
    scale: float


def sigma_of(cutoff: float, sigma: float | None) -> float:
    """Return the diameter: that of the scene, or the cutoff over 2.5."""
    return cutoff / _SIGMAS if sigma is None else sigma


def why_no_forces(truth: Truth, sigma: float, most_pairs: int) -> str | None:
    """Say why there is nothing to learn from forces here, or return None."""
    if len(truth.pairs) == 0:
        return "no pairs"
    if len(truth.pairs) > most_pairs:
        return f"more than {most_pairs:,} pairs: the exact sum would take long"
    if not sigma > 0.0:
        return "cutoff 0"
    limit = int(as_integers([_CLOSEST * sigma], _unit(truth, sigma))[0]) ** 2
    lift = 2 * (truth.scene.unit - _unit(truth, sigma))
    for start in range(0, len(truth.pairs), _CHUNK):
        exact = exact_vectors(truth.scene, truth.pairs.take(slice(start, start + _CHUNK)))
        if min((exact * exact).sum(axis=1)) << lift < limit:
            return f"points closer than {_CLOSEST:g} sigma: one pair would hide all others"
    return None


def _unit(truth: Truth, sigma: float) -> int:
    """A unit in which sigma and all lengths of the scene are integers."""
    return min(truth.scene.unit, int(np.frexp(sigma)[1]) - 54)


def reference_forces(truth: Truth, inclusive: bool, sigma: float) -> Forces:
    """Sum over the true pairs, without rounding until the end."""
    pairs = truth.by_rule(inclusive)
    n, ndim = truth.scene.points.shape
    unit = _unit(truth, sigma)
    diameter = int(as_integers([sigma], unit)[0])
    energy = 0
    forces = np.zeros((n, ndim), dtype=object)
    total = 0.0
    for start in range(0, len(pairs), _CHUNK):
        part = pairs.take(slice(start, start + _CHUNK))
        vectors = exact_vectors(truth.scene, part) << (truth.scene.unit - unit)
        terms, on_j = _terms(vectors, diameter)
        energy += int(terms.sum())
        for axis in range(ndim):
            _add_at(forces, axis, part.j, on_j[:, axis])
            _add_at(forces, axis, part.i, -on_j[:, axis])
        lengths = np.linalg.norm((on_j >> (_BITS - 60)).astype(np.float64), axis=1)
        total += 2.0 * float(lengths.sum()) * 2.0**-60
    rounded = [[nearest_float(x, -_BITS) for x in row] for row in forces.tolist()]
    return Forces(sigma, nearest_float(energy, -_BITS), np.array(rounded).reshape(n, ndim),
                  total / max(n, 1))  # fmt: skip


def _terms(vectors: Objects, diameter: int) -> tuple[Objects, Objects]:
    """Energy of each pair and force on its j, in integers of ``2**-_BITS``."""
    squares = (vectors * vectors).sum(axis=1)
    s2 = (diameter * diameter << _BITS) // squares
    s6 = s2 * s2 * s2 >> 2 * _BITS
    s12 = s6 * s6 >> _BITS
    over_d = 24 * (2 * s12 - s6) * s2 >> _BITS  # of the force, per D / sigma
    ratios = (vectors << _BITS) // diameter
    forces: Objects = (over_d[:, None] * ratios) >> _BITS
    return 4 * (s12 - s6), forces


def _add_at(table: Objects, axis: int, rows: NDArray[Any], values: Objects) -> None:
    """Add values to rows of one column, equal rows as often as they occur."""
    order = np.argsort(rows, kind="stable")
    ordered = rows[order]
    if len(ordered):
        starts = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]])
        table[ordered[starts], axis] += np.add.reduceat(values[order], starts)


def force_errors(reference: Forces, answer: Answer, scene: Any) -> tuple[float, float]:
    """Return the errors of energy and forces of a list.

    Parameters
    ----------
    reference : Forces
        For the rule of the answer.
    answer : Answer
    scene : object with points (n, d), rows (d, d) or None, and periodic
        For methods that tell no D or no d.

    Returns
    -------
    (float, float)
        ``|E - E_true| / |E_true|``, and the largest ``|F - F_true|`` of a point over the mean
        of what the forces on a point sum to in size.
    """
    n, ndim = reference.forces.shape
    D = vectors_of(answer, scene) if answer.D is None else answer.D.astype(np.float64)
    d = np.linalg.norm(D, axis=1) if answer.d is None else answer.d.astype(np.float64)
    with np.errstate(all="ignore"):
        s6 = (reference.sigma / d) ** 6
        terms = 4.0 * (s6 * s6 - s6)
        strength = 24.0 * (2.0 * s6 * s6 - s6) * (reference.sigma / d) / d
        on_j = strength[:, None] * D
        weight = np.full(len(d), 0.5 if answer.full else 1.0)
        if answer.own_images_twice:
            weight[answer.i == answer.j] = 0.5
        energy = float((weight * terms).sum())
        forces = np.zeros((n, ndim))
        for axis in range(ndim):
            part = weight * on_j[:, axis]
            forces[:, axis] += np.bincount(answer.j.astype(np.int64), part, n)
            forces[:, axis] -= np.bincount(answer.i.astype(np.int64), part, n)
        off = np.linalg.norm(forces - reference.forces, axis=1).max(initial=0.0)
    return _ratio(abs(energy - reference.energy), abs(reference.energy)), _ratio(
        float(off), reference.scale
    )


def _ratio(error: float, size: float) -> float:
    if error == 0.0:
        return 0.0
    return error / size if size > 0.0 and error == error else math.inf


def vectors_of(answer: Answer, scene: Any) -> Floats:
    """Work out D as a user would, in float64; without S, that of the nearest image."""
    points = np.asarray(scene.points, dtype=np.float64)
    D = points[answer.j.astype(np.int64)] - points[answer.i.astype(np.int64)]
    if scene.rows is None:
        return D
    if answer.S is not None:
        shifts = answer.S.astype(np.float64)
    else:
        repeating = np.array(scene.periodic)
        size = np.abs(scene.rows[repeating]).max(initial=0.0) or 1.0
        full = np.where(repeating[:, None], scene.rows / size, np.eye(len(repeating)))
        shifts = -np.rint((D / size) @ np.linalg.pinv(full)) * repeating
    found: Floats = D + shifts @ scene.rows
    return found


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

    def __init__(self, scene: Any, precision: Any) -> None:
        self.builds: int = 0
        self._options = _search(scene)
        self._how = hs.settings(precision=precision)

    def pairs(self, points: Floats) -> Answer:
        """Search."""
        self.builds += 1
        with self._how:
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
