# SPDX-License-Identifier: BSD-3-Clause
"""What wrong pairs do to physics: Lennard-Jones energy and forces summed over a list.

The potential is ``4 ((sigma / d)**12 - (sigma / d)**6)``, cut at the cutoff and not shifted, so
that a pair lost there is seen. The reference takes the true pairs and their true vectors: every
term in integers of 2**-128 of the unit of energy, wrong by less than some 2**-110 of it, added
exactly and rounded once, as `math.fsum` would round the sum of the true terms. A method's sum
is what its user would write: its own d and D in float64, added by NumPy. Where it tells none,
its user works them out in float64 from the points, the box and S, or the nearest image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell_report.truth.answer import Answer
from halfshell_report.truth.integers import Objects, as_integers, nearest_float
from halfshell_report.truth.pairs import Truth, exact_vectors

__all__ = ["Forces", "force_errors", "reference_forces", "sigma_of", "why_no_forces"]

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
