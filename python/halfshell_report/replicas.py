# SPDX-License-Identifier: BSD-3-Clause
"""Points folded into one cell of the lattice, and the copies of them that lie near it.

Everything that decides is exact: coordinates are Python integers of one unit (`integers`), the
lattice has a short basis B (`short_basis`), and folding, ``Y = X - w @ B`` with whole w, loses
nothing. Rounding enters where the integers become float64 coordinates for the k-d tree. How
much is bounded here (`Space.margin`), with v = 2**-53:

* A coordinate along which no row of B reaches is the caller's own number times a power of two,
  which is exact; the difference of two is rounded once, relative to itself.
* Any other one is rounded to Y' within v |Y|, its copy to Z' within v (|Y| + (k + 2) T + |Z|),
  T being the sum of ``|s_r B_r|`` over the k rows: each row of B is rounded, each product, each
  sum. So the difference is within ``v (2 |Y| + (k + 2) T + |Z|)``, and as ``|Z| <= |Y| + T``,
  within ``v (k + 3) (|Y| + T)`` of the truth. Twice that is taken.
* The length of a difference has d + 1 more roundings, relative to itself; 2 (d + 4) v is taken.

With E the length of the vector of these bounds, a computed length d' and the true one d differ
by at most ``m = 2 (E + 2 (d + 4) v R)`` wherever d is near R: d' > R + m proves d > R, and
d' < R - m proves d < R. In the band between, integers decide.

Which copies are needed is told by fractional coordinates ``f = Y @ P``: a pair within R differs
by at most R |P_r| along row r. They are rounded too, and the slack that is added for that
follows from their size, so that no copy is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfshell_report.integers import Objects, as_integers, common_unit, nearest_float, short_basis

__all__ = ["Copies", "Scene", "Space", "copies_near", "fold", "narrow", "scene_of"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_V = 2.0**-53
_FAR = 2.0**400  # cutoffs; coordinates beyond are moved here, where squares do not overflow
_WIDEST = 300  # powers of two that a box may be wider than the unit of length
_MOST_COPIES = 2e8
_FOLDS = 200  # each brings a point 2**50 times nearer; float64 spans 2**2098


@dataclass(frozen=True)
class Scene:
    """A scene in Python integers, ``number = integer * 2**unit``."""

    points: Objects  # (n, d)
    given: Floats  # (n, d), the same as floats
    cutoff: int
    rows: list[list[int]]  # of the axes that repeat, as given
    axes: list[int]  # which these are
    unit: int


def scene_of(
    points: Any, cutoff: float, box: Any, periodic: Any, lengths: Floats | None = None
) -> Scene:
    """Read a scene: `points` (n, d), `box` None, (d,) or (d, d), `periodic` None or flags.

    lengths: further numbers that are whole in the unit of the scene.
    """
    given = np.asarray(points, dtype=np.float64)  # float32 fits
    ndim = given.shape[1]
    axes: list[int] = []
    vectors = np.empty((0, ndim))
    if box is not None:
        table = np.asarray(box, dtype=np.float64)
        table = np.diag(table) if table.ndim == 1 else table
        flags = np.broadcast_to(True if periodic is None else np.asarray(periodic, bool), ndim)
        axes = np.flatnonzero(flags).tolist()
        vectors = table[axes]
    more = np.empty(0) if lengths is None else lengths
    unit = common_unit(given, vectors, np.array([cutoff]), more)
    return Scene(
        as_integers(given, unit), given, int(as_integers([cutoff], unit)[0]),
        as_integers(vectors, unit).tolist(), axes, unit,
    )  # fmt: skip


@dataclass(frozen=True)
class Space:
    """A scene folded and rounded, in lengths of ``2**exponent``.

    `steps` leads from shifts over the short basis to shifts over the rows as given:
    ``S = s @ steps``. `far` marks points that were moved to `_FAR`.
    """

    near: Floats  # (n, d), folded points
    turns: Ints  # (n, k), w but for a common constant
    basis: Floats  # (k, d)
    steps: Ints  # (k, k)
    cutoff: float
    far: NDArray[np.bool_]  # (n,)

    def margin(self, reach: Ints) -> float:
        """Bound what rounding does to a distance near the cutoff (see the module).

        `reach`, shape (k,), is the largest shift along each row of the basis.
        """
        ndim, k = self.near.shape[1], len(self.basis)
        moves = reach @ np.abs(self.basis)
        moved = np.any(self.basis != 0.0, axis=0)
        size = np.abs(self.near).max(axis=0, initial=0.0) + moves
        error = np.where(moved, 2.0 * (k + 3) * _V * size + 2.0**-180, 0.0)
        length = float(np.linalg.norm(error))
        return float(2.0 * (length + 2.0 * (ndim + 4) * _V * self.cutoff) + 2.0**-500)


def fold(scene: Scene) -> Space:
    """Fold the points into one cell of the short basis, exactly, and round them."""
    n, ndim = scene.points.shape
    k = len(scene.rows)
    rows, steps = short_basis(scene.rows) if k else ([], [])
    exponent = _exponent(scene, rows)
    basis = np.array(
        [[nearest_float(x, scene.unit - exponent) for x in row] for row in rows]
    ).reshape(k, ndim)
    with np.errstate(over="ignore"):
        near = np.clip(np.ldexp(scene.given, -exponent), -_FAR, _FAR)
    far = (np.abs(near) >= _FAR).any(axis=1)
    turns = np.zeros((n, k), dtype=object)
    moved = np.flatnonzero(np.any(basis != 0.0, axis=0))
    if len(moved) and n:
        whole, turns = _folded(scene.points, rows, basis, scene.unit - exponent)
        near[:, moved] = _rounded(whole[:, moved], scene.unit - exponent)
        if not (np.abs(near[:, moved]) < _FAR).all():
            raise ValueError("points lie more than 2**400 cutoffs apart in a slab at an angle")
        turns = turns - turns[0]  # only differences matter, and they are small where these are not
    cutoff = nearest_float(scene.cutoff, scene.unit - exponent)
    steps_table = np.array(steps, dtype=object).reshape(k, k)
    return Space(near, narrow(turns), basis, narrow(steps_table), cutoff, far)


def _exponent(scene: Scene, rows: list[list[int]]) -> int:
    """Choose the unit of length: about the cutoff, but no box is wider than 2**300 of it."""
    longest = max((abs(x) for row in rows for x in row), default=0)
    size = max(scene.cutoff, longest >> _WIDEST)
    if size == 0:
        return math.frexp(float(np.abs(scene.given).max(initial=0.0)))[1]
    return size.bit_length() + scene.unit


def _folded(
    points: Objects, rows: list[list[int]], basis: Floats, unit: int
) -> tuple[Objects, Objects]:
    """Return ``Y = X - w @ B`` near the cell at the origin, and w, both exact."""
    dual = _dual(basis)
    moved = np.flatnonzero(np.any(basis != 0.0, axis=0))
    whole, turns = points.copy(), np.zeros((len(points), len(rows)), dtype=object)
    for _ in range(_FOLDS):
        lift = max(0, _bits(whole[:, moved]) + unit - 400)  # so that no float overflows
        shift = np.floor(_rounded(whole[:, moved], unit - lift) @ dual[moved])
        step = as_integers(shift, 0) << lift
        turns = turns + step
        for r, row in enumerate(rows):
            for axis, x in enumerate(row):
                if x:
                    whole[:, axis] = whole[:, axis] - step[:, r] * x
        if lift == 0 and np.abs(shift).max() <= 2.0:  # at an edge rounding may say either cell
            break
    return whole, turns


def _bits(whole: Objects) -> int:
    return int(max(abs(whole.max()), abs(whole.min()))).bit_length()


def _dual(basis: Floats) -> Floats:
    """Columns P with ``basis @ P = 1``: the fractional coordinates of Y are ``Y @ P``."""
    lengths = np.linalg.norm(basis, axis=1)
    rows = basis / lengths[:, None]
    columns: Floats = np.linalg.solve(rows @ rows.T, rows).T / lengths
    return columns


def _rounded(whole: Objects, unit: int) -> Floats:
    """Integers times ``2**unit`` as floats, within 2**-53 of themselves and 2**-199."""
    kept = whole >> (-200 - unit) if unit < -200 else whole << (unit + 200)
    most = 2 ** (200 + 410)
    if len(kept) and _bits(kept) > 610:
        kept = np.minimum(np.maximum(kept, -most), most)
    rounded: Floats = np.ldexp(kept.astype(np.float64), -200)
    return rounded


def narrow(table: Any) -> Ints:
    """Return whole numbers as int64 where they fit, and as Python integers where they do not."""
    try:
        return np.asarray(table).astype(np.int64)
    except OverflowError:
        return np.asarray(table, dtype=object)


@dataclass(frozen=True)
class Copies:
    """Copies of points near the cell: which point, which shift over the short basis.

    The shift 0 is left out, and of two opposite shifts one: the pair (i, j, s) is (j, i, -s).
    """

    point: Ints  # (c,)
    shift: Ints  # (c, k)
    place: Floats  # (c, d)
    reach: Ints  # (k,), no shift is larger


def copies_near(space: Space) -> Copies:
    """Return every copy that may be within the cutoff of a folded point."""
    n, k = len(space.near), len(space.basis)
    if n == 0:
        nothing = np.empty(0, dtype=np.int64)
        return Copies(nothing, np.empty((0, k), np.int64), space.near, np.zeros(k, np.int64))
    point, shift = np.arange(n), np.zeros((n, 0), dtype=np.int64)
    reach = np.zeros(k, dtype=np.int64)
    if k:
        dual = _dual(space.basis)
        fraction = space.near @ dual
        # Ten times what the product, the solution and the folding may have lost.
        slack = 1e-9 + 64.0 * len(dual) * _V * (np.abs(space.near) @ np.abs(dual)).max(axis=0)
        within = space.cutoff * np.linalg.norm(dual, axis=0) * (1.0 + 1e-9) + slack
        low, high = fraction.min(axis=0) - within, fraction.max(axis=0) + within
        if not np.prod(high - low + 1.0) * n < _MOST_COPIES:
            raise ValueError("the cutoff reaches too many images of the points to list them")
        reach = np.ceil(high - low).astype(np.int64)
        for r in range(k):
            parts = []
            for s in range(-int(reach[r]), int(reach[r]) + 1):
                moved = fraction[point, r] + s
                kept = np.flatnonzero((moved >= low[r]) & (moved <= high[r]))
                parts.append((kept, s))
            kept = np.concatenate([rows for rows, _ in parts])
            column = np.repeat([s for _, s in parts], [len(rows) for rows, _ in parts])
            point, shift = point[kept], np.column_stack([shift[kept], column])
    first = np.zeros(len(shift), dtype=np.int64)
    for column in shift.T:
        first = np.where(first == 0, column, first)
    point, shift = point[first > 0], shift[first > 0]
    return Copies(point, shift, space.near[point] + shift @ space.basis, reach)
