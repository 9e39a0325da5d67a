# SPDX-License-Identifier: BSD-3-Clause
"""How wrong an answer is: pairs that are missed or invented, errors of distances and vectors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell._convert.arrays import are_backward, row_keys
from halfshell_report.integers import nearest_float, nearest_root
from halfshell_report.truth import Pairs, Truth, exact_vectors

__all__ = [
    "Answer", "PairErrors", "Sample", "pair_errors", "quantity_errors", "sample_of",
]  # fmt: skip

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Answer:
    """A list of m pairs by one method.

    Attributes
    ----------
    i, j : ndarray of int, shape (m,)
    S : ndarray, shape (m, d), or None
        Shifts, with ``D = points[j] - points[i] + S @ box`` for the points as given; None where
        the method does not tell them.
    d, D : ndarray, shape (m,) and (m, d), or None
    inclusive : bool
        The rule of the method: ``d <= cutoff``, or ``d < cutoff``.
    full : bool
        Whether both (i, j, S) and (j, i, -S) are meant to be there.
    own_images_twice : bool
        Whether that is so of a point's own images alone.
    """

    i: NDArray[Any]
    j: NDArray[Any]
    S: NDArray[Any] | None = None
    d: NDArray[Any] | None = None
    D: NDArray[Any] | None = None
    inclusive: bool = True
    full: bool = False
    own_images_twice: bool = False

    def __len__(self) -> int:
        return len(self.i)


@dataclass(frozen=True, eq=False)
class Halved:
    """Rows turned so that ``i < j``, or ``i == j`` and S begins with a positive number."""

    columns: list[NDArray[Any]]  # i, j, and those of S
    turned: NDArray[np.bool_]  # which rows were turned

    @classmethod
    def of(cls, i: NDArray[Any], j: NDArray[Any], S: NDArray[Any] | None) -> Halved:
        """Turn what has to be turned."""
        i, j = i.astype(np.int64), j.astype(np.int64)
        turned = are_backward(i, j, S)
        sign = np.where(turned, -1, 1)
        shifts = [] if S is None else [sign * column for column in S.T]
        return cls([np.minimum(i, j), np.maximum(i, j), *shifts], turned)


SAMPLED = 2000  # pairs whose distance is worked out in rational arithmetic
_TIES, _EXTREMES = 4, 10  # a fourth may be ties; a tenth each are the farthest and nearest


@dataclass(frozen=True)
class PairErrors:
    """Pairs that are wrong, each pair counted once whatever the list's convention.

    Attributes
    ----------
    expected, given : int
        Pairs that there are, and rows of the list.
    missed : int
        Pairs that are not in the list; of a full list, not in both directions.
    spurious : int
        Pairs in the list that are beyond the cutoff.
    duplicate : int
        Rows too many of pairs that there are.
    """

    expected: int
    given: int
    missed: int
    spurious: int
    duplicate: int

    @property
    def wrong(self) -> int:
        """All of them together."""
        return self.missed + self.spurious + self.duplicate


def pair_errors(truth: Truth, answer: Answer) -> PairErrors:
    """Hold a list against the truth of its own rule.

    Without shifts, pairs are compared by i and j.
    """
    pairs = truth.by_rule(answer.inclusive)
    columns = [pairs.i, pairs.j]
    if answer.S is not None:
        columns += list(pairs.S.T)
    given = Halved.of(answer.i, answer.j, answer.S)
    wanted_keys, given_keys = row_keys(columns, given.columns)

    # Twice the key, plus one for the other direction where both are meant to be there.
    def both(i: NDArray[Any], j: NDArray[Any]) -> NDArray[np.bool_]:
        return np.asarray((i == j) & answer.own_images_twice | answer.full)

    twice = both(pairs.i, pairs.j)
    wanted = np.concatenate([2 * wanted_keys, 2 * wanted_keys[twice] + 1])
    directed = 2 * given_keys + (given.turned & both(given.columns[0], given.columns[1]))
    present, counts = np.unique(directed, return_counts=True)
    place = np.searchsorted(present, wanted)
    hit = np.zeros(len(wanted), dtype=bool)
    if len(present):
        place = np.minimum(place, len(present) - 1)
        hit = present[place] == wanted
    known = np.zeros(len(present), dtype=bool)
    known[place[hit]] = True
    return PairErrors(
        expected=len(pairs),
        given=len(answer),
        missed=_distinct(wanted[~hit] >> 1),
        spurious=_distinct(present[~known] >> 1),
        duplicate=int((counts[known] - 1).sum()),
    )


def _distinct(keys: NDArray[np.int64]) -> int:
    """Return how many different keys there are; `numpy.unique` would hash them, and be slow."""
    ordered = np.sort(keys)
    return int(np.count_nonzero(ordered[1:] != ordered[:-1])) + int(len(ordered) > 0)


@dataclass(frozen=True, eq=False)
class Sample:
    """Some pairs with their distances and vectors, each rounded once from the real number."""

    pairs: Pairs
    d: Floats  # (k,)
    D: Floats  # (k, d)


def sample_of(truth: Truth, limit: int = SAMPLED) -> Sample:
    """Choose pairs: ties, the farthest and the nearest first, then some at random."""
    pairs = truth.pairs
    count = len(pairs)
    rows = np.arange(count)
    if count > limit:
        far = _rough_lengths(truth)
        few, some = max(limit // _EXTREMES, 1), limit // _TIES
        ends = np.argpartition(far, (few, count - few))
        ties = np.flatnonzero(truth.tie)
        ties = ties[:: max(1, len(ties) // max(some, 1))][:some]
        chosen = np.unique(np.concatenate([ties, ends[:few], ends[-few:]]))
        others = np.random.default_rng(0).permutation(count)[:limit]
        others = others[~np.isin(others, chosen)][: limit - len(chosen)]
        rows = np.sort(np.concatenate([chosen, others]))
    kept = pairs.take(rows)
    exact = exact_vectors(truth.scene, kept)
    unit = truth.scene.unit
    d = [nearest_root(square, unit) for square in (exact * exact).sum(axis=1).tolist()]
    D = [[nearest_float(x, unit) for x in vector] for vector in exact.tolist()]
    return Sample(kept, np.array(d), np.array(D).reshape(len(kept), exact.shape[1]))


def _rough_lengths(truth: Truth) -> Floats:
    """Distances over the cutoff, good enough to choose by."""
    scene, pairs = truth.scene, truth.pairs
    scale = nearest_float(scene.cutoff, scene.unit) or 1.0
    box = np.zeros((scene.given.shape[1],) * 2)
    for row, axis in zip(scene.rows, scene.axes):
        box[axis] = [nearest_float(x, scene.unit) for x in row]
    with np.errstate(all="ignore"):
        between = scene.given[pairs.j] - scene.given[pairs.i] + pairs.S.astype(np.float64) @ box
        squares = ((between / scale) ** 2).sum(axis=1)
    return np.asarray(np.nan_to_num(squares))


@dataclass(frozen=True)
class QuantityErrors:
    """Errors of d and D over sampled pairs; None where the method does not tell them.

    In units in the last place of the rounded true distance, against the true value rounded
    once: 0 is as good as float64 can be. D counts by its worst component. Relative errors are
    over the true distance. Pairs at distance 0 have neither and are left out.
    """

    sampled: int = 0
    d_max_ulp: float | None = None
    d_rms_ulp: float | None = None
    d_max_relative: float | None = None
    d_rms_relative: float | None = None
    D_max_ulp: float | None = None
    D_rms_ulp: float | None = None
    D_max_relative: float | None = None
    D_rms_relative: float | None = None


def quantity_errors(sample: Sample, answer: Answer) -> QuantityErrors:
    """Hold the distances and vectors of an answer against a sample."""
    if answer.d is None and answer.D is None:
        return QuantityErrors()
    columns = [sample.pairs.i, sample.pairs.j]
    if answer.S is not None:
        columns += list(sample.pairs.S.T)
    given = Halved.of(answer.i, answer.j, answer.S)
    wanted_keys, given_keys = row_keys(columns, given.columns)
    order = np.argsort(wanted_keys)
    place = np.searchsorted(wanted_keys[order], given_keys)
    place = order[np.minimum(place, max(len(order) - 1, 0))] if len(order) else place
    hit = np.zeros(len(given_keys), dtype=bool)
    if len(order):
        hit = (wanted_keys[place] == given_keys) & (sample.d[place] > 0.0)
    rows, place = np.flatnonzero(hit), place[hit]
    true_d = sample.d[place]
    errors: dict[str, float] = {}
    if answer.d is not None:
        off = answer.d[rows].astype(np.float64) - true_d
        errors.update(_summary("d", np.abs(off), true_d))
    if answer.D is not None:
        sign = np.where(given.turned[rows], -1.0, 1.0)[:, None]
        off = sign * answer.D[rows].astype(np.float64) - sample.D[place]
        errors.update(_summary("D", np.abs(off).max(axis=1, initial=0.0), true_d))
    return QuantityErrors(sampled=len(rows), **errors)


def _summary(name: str, off: Floats, true_d: Floats) -> dict[str, float]:
    if not len(off):
        return {}
    off = np.where(np.isfinite(off), off, np.inf)
    found = {}
    for kind, values in (("ulp", off / np.spacing(true_d)), ("relative", off / true_d)):
        most = float(values.max())
        found[f"{name}_max_{kind}"] = most
        # Scaled, so that squares of very small or large errors are still numbers.
        scale = most if 0.0 < most < np.inf else 1.0
        found[f"{name}_rms_{kind}"] = scale * float(np.sqrt(np.mean((values / scale) ** 2)))
    return found
