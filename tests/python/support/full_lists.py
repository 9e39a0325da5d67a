# SPDX-License-Identifier: BSD-3-Clause
"""Full lists and lists of two sets, as the oracles of half lists say that they must be."""

import math
from fractions import Fraction

import numpy as np

from halfshell._check.reference import exact_square, exact_vector, reference_pairs, ulp_error
from oracles import exact_pairs, remembered


def both_ways(half):
    """The full list, ascending, of an iterable of pairs (i, j, S)."""
    half = list(half)
    return sorted(half + [(j, i, tuple(-s for s in S)) for i, j, S in half])


def full_list(points, cutoff, box=None, periodic=None, inclusive=True):
    """(i, j, S) and (j, i, -S) of every pair, ascending, by rational arithmetic."""
    return both_ways(remembered(reference_pairs, points, cutoff, box, periodic, inclusive))


def joined(queries, points):
    """Queries and points as one set, each number as it is."""
    return np.concatenate([np.asarray(x, np.float64) for x in (queries, points)])


def list_between(queries, points, cutoff, box=None, periodic=None, inclusive=True):
    """(i, j, S) of every query i and point j within the cutoff, ascending."""
    q = len(queries)
    half = remembered(
        reference_pairs, joined(queries, points), cutoff, box, periodic, inclusive
    )
    return sorted((i, j - q, tuple(S)) for i, j, S in half if i < q <= j)


def large_full_rows(*scene):
    """The full list as int64 rows (i, j, *S), ascending, for larger scenes."""
    half = remembered(exact_pairs, *scene)
    other = np.concatenate([half[:, 1::-1], -half[:, 2:]], axis=1)
    rows = np.concatenate([half, other])
    return rows[np.lexsort(rows.T[::-1])]


def entries(table):
    """(i, j, S) of a table with shifts, in its order, from its arrays alone."""
    offsets = table.offsets
    assert offsets.dtype == np.int64 and offsets[0] == 0
    rows = [i for i in range(len(offsets) - 1) for _ in range(offsets[i], offsets[i + 1])]
    assert len(rows) == len(table.indices) == offsets[-1]
    return list(zip(rows, table.indices.tolist(), map(tuple, table.shifts.tolist())))


def assert_last_place(points, cutoff, box, found, inclusive=True):
    """d and D of (i, j, S, d, D), points of one numbering, against exact arithmetic."""
    for i, j, S, d, D in zip(*found):
        square = exact_square(points, i, j, S, box)
        assert ulp_error(d, square) <= 1, (i, j, S, d)
        assert d <= cutoff if inclusive else d < cutoff, (i, j, S, d)
        unit = Fraction(math.ulp(d))
        for got, true in zip(D, exact_vector(points, i, j, S, box)):
            assert abs(Fraction(got) - true) <= unit, (i, j, S, D)


def same_tables(one, other):
    """Whether two tables have the same bytes."""
    return one.quantities == other.quantities and all(
        a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
        for a, b in zip(one._arrays, other._arrays, strict=True)
    )
