# SPDX-License-Identifier: BSD-3-Clause
"""Oracles and scenes for the tests: what must come out, and what to put in.

Two oracles, independent of the compiled core and of each other:

* `halfshell._check.reference.reference_pairs`: the definition, all pairs in rational arithmetic;
* `exact_pairs`: for larger scenes. SciPy's cKDTree over explicit copies finds candidates with
  a margin that covers every rounding on the way; float64 decides only outside a band around
  the cutoff that is wider than its own error, Python integers decide inside it.
"""

import hashlib
import itertools
import math

import numpy as np
from scipy.spatial import cKDTree

import halfshell as hs
from calls import call
from halfshell._check.reference import exact_square, reference_pairs

EPS = 2.0**-53


# ---- comparing -----------------------------------------------------------------------------


def as_set(i, j, S=None):
    """The pairs as a set of (i, j, S); a pair that is listed twice is an error at once."""
    shifts = itertools.repeat(()) if S is None else zip(*np.asarray(S).T.tolist())
    pairs = list(zip(np.asarray(i).tolist(), np.asarray(j).tolist(), shifts))
    found = set(pairs)
    assert len(found) == len(pairs), f"{len(pairs) - len(found)} pairs are listed twice"
    return found


def triples(i, j, S):
    """A list of (i, j, S), in its order."""
    return list(zip(i.tolist(), j.tolist(), map(tuple, S.tolist()), strict=True))


def as_rows(i, j, S=None):
    """The pairs as int64 rows (i, j, *S) in ascending order: `as_set` for large lists."""
    columns = [np.reshape(i, (-1, 1)), np.reshape(j, (-1, 1))]
    rows = np.concatenate(columns if S is None else [*columns, S], axis=1).astype(np.int64)
    return rows[np.lexsort(rows.T[::-1])]


def check(points, cutoff, box=None, periodic=None, inclusive=True, **how):
    """Assert that `hs.pairs` finds exactly the pairs of the reference; return their set.

    By every kernel, unless one is named.
    """
    scene = {"box": box, "periodic": periodic, "inclusive": inclusive}
    expected = set(reference_pairs(points, cutoff, box, periodic, inclusive))
    for by in by_kernels(how):
        found = as_set(*call(hs.pairs, points, cutoff, quantities="ijS", **scene, **by))
        assert found == expected, describe(found, expected, points, cutoff, box, by)
    return expected


def check_large(points, cutoff, box=None, periodic=None, inclusive=True, **how):
    """`check` against `exact_pairs`; return the sorted rows (i, j, *S)."""
    scene = {"box": box, "periodic": periodic, "inclusive": inclusive}
    expected = exact_pairs(points, cutoff, box, periodic, inclusive)
    for by in by_kernels(how):
        found = as_rows(*call(hs.pairs, points, cutoff, quantities="ijS", **scene, **by))
        if not np.array_equal(found, expected):
            one, other = ({tuple(row) for row in rows.tolist()} for rows in (found, expected))
            assert len(one) == len(found), f"{len(found) - len(one)} pairs are listed twice"
            one, other = ({(r[0], r[1], r[2:]) for r in rows} for rows in (one, other))
            raise AssertionError(describe(one, other, points, cutoff, box, by))
    return expected


def by_kernels(how):
    """These keywords with each kernel, or as they are if one is named."""
    return [how] if "kernel" in how else [{**how, "kernel": name} for name in hs.kernels()]


def remembered(oracle, *scene):
    """The oracle's answer, worked out once: several checks put the same scene."""
    parts = [np.asarray(part) for part in scene]
    key = (oracle.__name__, *((part.dtype.str, part.shape, part.tobytes()) for part in parts))
    key = hashlib.sha256(repr(key).encode()).digest()
    if key not in _ANSWERS:
        _ANSWERS[key] = oracle(*scene)
    return _ANSWERS[key]


_ANSWERS = {}


def describe(found, expected, points, cutoff, box, by):
    """Say which pairs differ and how far from the cutoff they are, in exact arithmetic."""
    lines = [f"{len(found)} pairs, expected {len(expected)}, cutoff {cutoff!r}, by {by}"]
    for word, pairs in (("missed", expected - found), ("spurious", found - expected)):
        for i, j, S in sorted(pairs)[:5]:
            excess = exact_square(points, i, j, S or None, box) / max(float(cutoff), 1e-300) ** 2
            lines.append(f"{word} ({i}, {j}, {S}): |D|^2 / cutoff^2 - 1 = {float(excess - 1):.3g}")
        if len(pairs) > 5:
            lines.append(f"... {len(pairs)} {word} in all")
    return "\n".join(lines)


def same_arrays(one, other):
    """Whether two results have the same bytes, dtypes and shapes."""
    one, other = (x if isinstance(x, tuple) else (x,) for x in (one, other))
    return len(one) == len(other) and all(
        a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
        for a, b in zip(one, other)
    )


# ---- the oracle for larger scenes ----------------------------------------------------------


def full_box(box, periodic, ndim):
    """Box rows (d, d) in float64 (zero in open space) and d flags."""
    if box is None:
        return np.zeros((ndim, ndim)), np.zeros(ndim, bool)
    rows = np.asarray(box, np.float64)
    rows = np.diag(rows) if rows.ndim == 1 else rows
    return rows, np.broadcast_to(True if periodic is None else np.asarray(periodic), ndim)


def exact_pairs(points, cutoff, box=None, periodic=None, inclusive=True):
    """The half list as sorted int64 rows (i, j, *S), exact, for up to about 1e5 points.

    Meant for boxes that are not extremely skewed and coordinates of ordinary size.
    """
    points = np.asarray(points, np.float64)
    n, ndim = points.shape
    cutoff = float(cutoff)
    rows, flags = full_box(box, periodic, ndim)
    axes = np.flatnonzero(flags)
    used = rows[axes]
    if n == 0:
        return np.empty((0, 2 + ndim), np.int64)

    # X = points + W @ box is near the box; W are integers, so nothing is decided here. The
    # dual vectors give the fractions; `error` bounds what X lost to rounding.
    dual = np.linalg.pinv(used).T if len(axes) else np.zeros((0, ndim))
    W = -np.floor(points @ dual.T).astype(np.int64)
    X = points + W @ used
    size = np.abs(points).max() + (np.abs(W) @ np.abs(used)).max(initial=0.0)
    error = 8 * (len(axes) + 2) * EPS * math.sqrt(ndim) * size
    band = 1e-9 * cutoff + 16 * error
    reach = cutoff + 2 * band

    # |s_k + dual_k . (X_j - X_i)| <= cutoff |dual_k| for every pair that counts.
    fractions = X @ dual.T
    span = np.ptp(fractions, axis=0) + reach * np.linalg.norm(dual, axis=1)
    ranges = [range(-k, k + 1) for k in np.ceil(span * (1 + 1e-6) + 1e-6).astype(int).tolist()]

    low, high = X.min(axis=0) - reach, X.max(axis=0) + reach
    copies, owners, shifts = [], [], []
    for s in itertools.product(*ranges):
        moved = X + np.array(s, np.float64) @ used
        near = np.flatnonzero(np.all((moved >= low) & (moved <= high), axis=1))
        copies.append(moved[near])
        owners.append(near)
        shifts.append(np.broadcast_to(np.array(s, np.int64), (len(near), len(axes))))
    copies, owners, shifts = map(np.concatenate, (copies, owners, shifts))
    near = cKDTree(X).sparse_distance_matrix(cKDTree(copies), reach, output_type="ndarray")
    i, copy = near["i"].astype(np.int64), near["j"].astype(np.int64)
    j = owners[copy]
    keep = i <= j
    i, copy, j = i[keep], copy[keep], j[keep]
    S = shifts[copy] + W[j] - W[i]
    first = np.zeros(len(S), np.int64)
    for k in reversed(range(len(axes))):
        first = np.where(S[:, k] != 0, S[:, k], first)
    keep = (i < j) | (first > 0)
    i, copy, j, S = i[keep], copy[keep], j[keep], S[keep]

    distance = np.linalg.norm(copies[copy] - X[i], axis=1)
    inside = distance < cutoff - band
    unsure = np.flatnonzero(np.abs(distance - cutoff) <= band)
    inside[unsure] = within_exactly(
        points, cutoff, i[unsure], j[unsure], S[unsure], used, inclusive
    )
    full = np.zeros((len(S), ndim), np.int64)
    full[:, axes] = S
    return as_rows(i[inside], j[inside], full[inside])


def within_exactly(points, cutoff, i, j, S=None, box=None, inclusive=True):
    """Which pairs count, decided by Python integers; arrays of any length.

    `box` holds one row per column of `S`.
    """
    if S is None:
        S, box = np.zeros((len(i), 0), np.int64), np.zeros((0, points.shape[1]))
    p, a, c = as_integers(points, box, np.array([float(cutoff)]))
    D = p[j] - p[i]
    for k in range(S.shape[1]):
        D = D + S[:, k, None].astype(object) * a[k]
    square, limit = (D * D).sum(axis=1), c[0] * c[0]
    inside = square <= limit if inclusive else square < limit
    return inside.astype(bool)


def whole(x):
    """A float as an integer, in units of the smallest float above 0."""
    numerator, denominator = float(x).as_integer_ratio()
    return numerator << (1075 - denominator.bit_length())


def as_integers(*arrays):
    """Multiply float64 arrays by one power of two so that all entries are Python integers."""
    split = []
    for array in arrays:
        mantissa, exponent = np.frexp(np.asarray(array, np.float64))
        whole = np.ldexp(mantissa, 53).astype(np.int64)
        trailing = np.where(whole == 0, 1, whole & -whole)  # drop zeros at the end
        whole //= trailing
        exponent = exponent - 53 + np.frexp(trailing.astype(np.float64))[1] - 1
        split.append((whole, np.where(whole == 0, 10**6, exponent)))
    low = min((int(e.min()) for _, e in split if e.size), default=0)
    return [
        (w.astype(object) << np.where(w == 0, 0, e - low).astype(object)).astype(object)
        for w, e in split
    ]


# ---- scenes --------------------------------------------------------------------------------

LATTICES = {
    # name: (box rows, basis points), all integers, so that whole shells are exact ties
    "sc": (np.diag([1, 1, 1]), [(0, 0, 0)]),
    "bcc": (np.diag([2, 2, 2]), [(0, 0, 0), (1, 1, 1)]),
    "fcc": (np.diag([2, 2, 2]), [(0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0)]),
    "diamond": (
        np.diag([4, 4, 4]),
        [(0, 0, 0), (0, 2, 2), (2, 0, 2), (2, 2, 0)] + [(1, 1, 1), (1, 3, 3), (3, 1, 3), (3, 3, 1)],
    ),
    # stacked along (1, 1, 1): ideal hcp has integer coordinates there
    "hcp": (np.array([(3, -3, 0), (0, 3, -3), (4, 4, 4)]), [(0, 0, 0), (4, 1, 1)]),
}

# Rows and columns are orthogonal with length 3: an exact rotation, times 3.
EXACT_ROTATION = np.array([[1, 2, 2], [2, 1, -2], [2, -2, 1]])


def lattice(name, repeats):
    """Points and box of a crystal with `repeats` unit cells along each box vector."""
    unit, basis = LATTICES[name]
    steps = np.array(list(itertools.product(*(range(k) for k in repeats))))
    points = (steps @ unit)[:, None, :] + np.array(basis)[None]
    return points.reshape(-1, 3).astype(float), (np.array(repeats)[:, None] * unit).astype(float)


def rotation(rng, ndim=3):
    """A random rotation, rounded to float64."""
    q, r = np.linalg.qr(rng.normal(size=(ndim, ndim)))
    return q * np.sign(np.diag(r))


def random_box(rng, kind, ndim=3, length=1.0):
    """A box of a named kind with edges of about `length`."""
    box = np.diag(length * rng.uniform(0.8, 1.3, ndim))
    if kind in ("triclinic", "left-handed", "sheared"):
        box = box + np.tril(rng.uniform(-0.45, 0.45, (ndim, ndim)), -1) * length
    if kind == "rotated":
        box = box @ rotation(rng, ndim)
    if kind == "left-handed":
        box = box[::-1].copy() if ndim > 1 else -box
    if kind == "sheared":
        for k in range(1, ndim):
            box[k] += int(rng.integers(-7, 8)) * box[k - 1]
    return box


BOX_KINDS = ("orthorhombic", "triclinic", "rotated", "left-handed", "sheared")


def random_scene(rng, n, ndim=3, kind="triclinic", neighbours=12, spread=1, periodic=None):
    """Points, cutoff, box and flags with about `neighbours` neighbours per point.

    `spread`: over how many boxes, in each direction, the points lie.
    """
    box = random_box(rng, kind, ndim)
    fractions = rng.uniform(-spread, spread, (n, ndim)) if spread != 1 else rng.random((n, ndim))
    points = fractions @ box
    ball = math.pi ** (ndim / 2) / math.gamma(ndim / 2 + 1)
    cutoff = (neighbours * abs(np.linalg.det(box)) / max(n, 1) / ball) ** (1 / ndim)
    return points, cutoff, box, np.ones(ndim, bool) if periodic is None else np.array(periodic)
