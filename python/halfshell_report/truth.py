# SPDX-License-Identifier: BSD-3-Clause
"""Every pair of a scene, certainly: the list that all others are compared with.

Nothing here calls the compiled core of this package. SciPy's k-d tree proposes the pairs within
the cutoff and a margin (`replicas` says what it is made of and why it suffices); those nearer to
the cutoff than the margin are decided by Python integers, on the numbers as given. The cost is
that of the tree plus some microseconds for each pair in the band, so that a perfect crystal with
a million ties is a matter of seconds. `tests/python/report/test_report_truth.py` holds this against
full rational brute force (`halfshell._check.reference`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell_report.integers import Objects, signs
from halfshell_report.reach import Reach
from halfshell_report.replicas import Copies, Scene, Space, copies_near, fold, narrow, scene_of

__all__ = ["Pairs", "Truth", "exact_vectors", "true_pairs"]

Ints = NDArray[np.int64]

_CHUNK = 1 << 20  # candidates looked at together: some tens of megabytes
_EXACT_CHUNK = 1 << 16  # Python integers are larger


@dataclass(frozen=True, eq=False)
class Pairs:
    """A half list: ``i < j``, or ``i == j`` and the first nonzero component of S positive."""

    i: Ints  # (m,)
    j: Ints  # (m,)
    S: NDArray[Any]  # (m, d), whole numbers

    def __len__(self) -> int:
        return len(self.i)

    def take(self, rows: Any) -> Pairs:
        """Return some of the pairs, by numbers or by a mask."""
        return Pairs(self.i[rows], self.j[rows], self.S[rows])


@dataclass(frozen=True, eq=False)
class Truth:
    """Every pair with ``|D| <= cutoff``, and which of them are at exactly the cutoff.

    Attributes
    ----------
    pairs : Pairs
        In no particular order.
    tie : ndarray of bool, shape (m,)
        Whether ``|D| == cutoff``, exactly.
    scene : Scene
        The scene in integers, for exact values of single pairs.
    margin : float
        Half the width of the band that integers decided, over the cutoff.
    n_by_integers : int
        Candidates in that band.
    """

    pairs: Pairs
    tie: NDArray[np.bool_]
    scene: Scene
    margin: float
    n_by_integers: int

    def by_rule(self, inclusive: bool) -> Pairs:
        """Return the pairs of the closed ball (``<=``), or of the open one (``<``)."""
        return self.pairs if inclusive else self.pairs.take(~self.tie)


def true_pairs(
    points: Any,
    cutoff: float | None,
    box: Any = None,
    periodic: Any = None,
    reach: Reach | None = None,
) -> Truth:
    """Find every pair within the cutoff, decided by the numbers as given.

    Parameters
    ----------
    points : array_like of float32 or float64, shape (n, d)
    cutoff : float or None
        Not negative; same unit. Not looked at where there is a reach.
    box : array_like, shape (d,) or (d, d), optional
    periodic : sequence of bool, shape (d,), optional
        Default: all axes with a box.
    reach : Balls or Ellipsoids, optional
        Of each pair, in place of the cutoff.

    Returns
    -------
    Truth

    Raises
    ------
    ValueError
        If the periodic rows of `box` are linearly dependent, or the cutoff reaches more images
        than can be listed.

    Examples
    --------
    >>> truth = true_pairs([[0.0], [0.75]], 0.25, box=[1.0])
    >>> truth.pairs.i.tolist(), truth.pairs.j.tolist(), truth.pairs.S.tolist()
    ([0], [1], [[-1]])
    >>> truth.tie.tolist(), len(truth.by_rule(inclusive=False))
    ([True], 0)
    """
    largest = reach.largest if reach is not None else 0.0 if cutoff is None else cutoff
    scene = scene_of(points, largest, box, periodic, None if reach is None else reach.lengths)
    space = fold(scene)
    copies = copies_near(space)
    margin = space.margin(copies.reach)
    scale = space.cutoff / largest if largest > 0.0 else 1.0  # a power of two
    found = [Pairs(*(np.empty(0, np.int64),) * 2, np.empty((0, scene.points.shape[1]), np.int32))]
    ties = [np.empty(0, dtype=bool)]
    n_open = 0
    if reach is None:
        candidates = _candidates(space, copies, margin)
    else:
        candidates = _of_parts(space, copies, margin, scale, reach)
    for i, copy in candidates:
        for start in range(0, len(i), _CHUNK):
            part = slice(start, start + _CHUNK)
            sure, unsure = _settled(space, copies, i[part], copy[part], margin, scale, reach)
            sure, unsure = (_in_given_shifts(scene, space, some) for some in (sure, unsure))
            excess = _excess(scene, unsure, reach)
            within = excess <= 0
            found += [_half(sure), _half(unsure.take(within))]
            ties += [np.zeros(len(sure), dtype=bool), excess[within] == 0]
            n_open += len(unsure)
    pairs = Pairs(*(np.concatenate([getattr(part, name) for part in found]) for name in "ijS"))
    relative = margin / space.cutoff if space.cutoff > 0.0 else float("inf")
    return Truth(pairs, np.concatenate(ties), scene, relative, n_open)


def _candidates(space: Space, copies: Copies, margin: float) -> Iterator[tuple[Ints, Ints]]:
    """Yield (i, c): point i and point c, or copy c - n, that may be within the cutoff."""
    from scipy.spatial import cKDTree

    n = len(space.near)
    if n == 0:
        return
    radius = (space.cutoff + margin) * (1.0 + 1e-9)
    home = cKDTree(space.near, balanced_tree=False)
    pairs = home.query_pairs(radius, output_type="ndarray")
    yield pairs[:, 0], pairs[:, 1]
    del pairs
    if len(copies.point):
        around = cKDTree(copies.place, balanced_tree=False)
        table = home.sparse_distance_matrix(around, radius, output_type="ndarray")
        yield table["i"].astype(np.int64), table["j"].astype(np.int64) + n


def _of_parts(
    space: Space, copies: Copies, margin: float, scale: float, reach: Reach
) -> Iterator[tuple[Ints, Ints]]:
    """As `_candidates`, where pairs have a reach each: of two parts at a time."""
    from scipy.spatial import cKDTree

    n = len(space.near)
    part_of_copy: dict[int, Any] = {}

    def tree_of_copies(part: Ints) -> tuple[Any, Ints]:
        if id(part) not in part_of_copy:
            chosen = np.flatnonzero(np.isin(copies.point, part))
            part_of_copy[id(part)] = (
                part, chosen, cKDTree(copies.place[chosen], balanced_tree=False)
            )  # fmt: skip
        _, chosen, tree = part_of_copy[id(part)]
        return tree, chosen

    for one, other, largest in reach.searches():
        radius = (largest * scale + margin) * (1.0 + 1e-9)
        home = cKDTree(space.near[one], balanced_tree=False)
        if one is other:
            pairs = home.query_pairs(radius, output_type="ndarray")
            yield one[pairs[:, 0]], one[pairs[:, 1]]
        else:
            second = cKDTree(space.near[other], balanced_tree=False)
            table = home.sparse_distance_matrix(second, radius, output_type="ndarray")
            yield one[table["i"]], other[table["j"]]
        for asking, among in ((one, other),) if one is other else ((one, other), (other, one)):
            around, chosen = tree_of_copies(among)
            if len(chosen):
                tree = home if asking is one else second
                table = tree.sparse_distance_matrix(around, radius, output_type="ndarray")
                yield asking[table["i"]], chosen[table["j"]] + n


def _settled(
    space: Space,
    copies: Copies,
    i: Ints,
    copy: Ints,
    margin: float,
    scale: float,
    reach: Reach | None,
) -> tuple[Pairs, Pairs]:
    """Split candidates into sure pairs and open cases, with shifts over the short basis."""
    n, k = len(space.near), len(space.basis)
    if len(copy) and copy[0] >= n:
        place, j = copies.place[copy - n], copies.point[copy - n]
        shift = copies.shift[copy - n]
    else:
        place, j, shift = space.near[copy], copy, np.zeros((len(copy), k), dtype=np.int64)
    difference = place - space.near[i]
    shift = shift + space.turns[i] - space.turns[j]
    candidates = Pairs(i, j, shift)
    # What was moved inwards is further apart than it seems: never surely a pair.
    moved = space.far[i] | space.far[j]
    if reach is not None:
        sure, beyond = reach.settle(i, j, difference, moved, margin, scale)
    else:
        length = np.sqrt(np.einsum("ij,ij->i", difference, difference))
        sure, beyond = (length < space.cutoff - margin) & ~moved, length > space.cutoff + margin
    return candidates.take(sure), candidates.take(~sure & ~beyond)


def _in_given_shifts(scene: Scene, space: Space, pairs: Pairs) -> Pairs:
    """Shifts over the box as given, a column for each axis."""
    sizes = np.abs(space.steps).astype(float).sum(initial=0.0)
    over, steps = pairs.S, space.steps
    if np.abs(over).max(initial=0) * sizes >= 2.0**62:
        over, steps = over.astype(object), steps.astype(object)
    shifts = np.zeros((len(pairs), scene.points.shape[1]), dtype=over.dtype)
    shifts[:, scene.axes] = over @ steps
    return Pairs(pairs.i, pairs.j, narrow(shifts))


def exact_vectors(scene: Scene, pairs: Pairs) -> Objects:
    """Return ``points[j] - points[i] + S @ box`` in Python integers, shape (m, d)."""
    vectors: Objects = scene.points[pairs.j] - scene.points[pairs.i]
    for row, axis in zip(scene.rows, scene.axes):
        shift = pairs.S[:, axis]
        if shift.any():
            shift = shift.astype(object)
            for column, x in enumerate(row):
                if x:
                    vectors[:, column] = vectors[:, column] + shift * x
    return vectors


def _excess(scene: Scene, pairs: Pairs, reach: Reach | None) -> NDArray[np.int64]:
    """Return the sign of ``|D|`` less the cutoff, or the reach of the pair: -1, 0 or 1, exactly."""
    found = [np.empty(0, dtype=np.int64)]
    for start in range(0, len(pairs), _EXACT_CHUNK):
        some = pairs.take(slice(start, start + _EXACT_CHUNK))
        vectors = exact_vectors(scene, some)
        if reach is None:
            found.append(signs((vectors * vectors).sum(axis=1) - scene.cutoff**2))
        else:
            found.append(reach.excess(some.i, some.j, vectors, scene.unit))
    return np.concatenate(found)


def _half(pairs: Pairs) -> Pairs:
    """Each pair turned so that it is in the half list."""
    turn = pairs.i > pairs.j
    open_ = pairs.i == pairs.j
    for column in pairs.S.T:
        turn |= open_ & (column < 0)
        open_ = open_ & (column == 0)
    sign = np.where(turn, -1, 1)
    shifts = pairs.S * sign[:, None]
    if np.abs(shifts).max(initial=0) < 2**31:
        shifts = shifts.astype(np.int32)  # half the memory, of a list that may be long
    return Pairs(np.minimum(pairs.i, pairs.j), np.maximum(pairs.i, pairs.j), shifts)
