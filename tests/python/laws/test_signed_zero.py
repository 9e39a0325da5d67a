# SPDX-License-Identifier: BSD-3-Clause
"""A zero has no sign: -0.0 among coordinates, boxes and lengths gives the answers of 0.0.

The points are lattices with a point on each face of the cells, where a wrong side loses pairs.
"""

import numpy as np
import pytest

import halfshell as hs
from calls import call

SHEAR = {1: [[1.0]], 2: [[1.0, 0.0], [0.5, 1.0]], 3: [[1.0, 0, 0], [0.5, 1.0, 0], [0, 0.5, 1.0]]}


def lattice(ndim, length, origin):
    along = np.arange(length, dtype=float) - origin
    return np.stack(np.meshgrid(*[along] * ndim, indexing="ij"), axis=-1).reshape(-1, ndim)


def negative(array):
    """The same numbers, with every zero's sign the other way."""
    return np.where(np.asarray(array) == 0.0, -0.0, array)


def boxes(ndim, length):
    yield {}
    yield {"box": np.diag([float(length)] * ndim)}
    yield {"box": np.diag([float(length)] * ndim), "periodic": [True] + [False] * (ndim - 1)}
    yield {"box": length * np.array(SHEAR[ndim])}


#: Dimension and box, with origin, length and type in turn.
CASES = [
    (ndim, (4, 9)[(ndim + which + place) % 2], place, which, (np.float64, np.float32)[which % 2])
    for ndim in (1, 2, 3)
    for which in range(4)
    for place in range(3)
]


def both(case):
    """Points, the cutoff, options of the scene; and the same with negative zeros."""
    ndim, length, place, which, dtype = case
    points = lattice(ndim, length, (0, length // 2, length - 1)[place]).astype(dtype)
    options = list(boxes(ndim, length))[which]
    turned = dict(options)
    if "box" in options:
        turned["box"] = negative(options["box"])
    return (points, options), (negative(points).astype(dtype), turned)


def of_all(points, **options):
    """What each function says."""
    q = points[::2]
    for algorithm in ("auto", "grid", "hash", "all-pairs", "hierarchy"):
        yield from call(
            hs.pairs, points, 1.0, quantities="ijdDS", sort=True, algorithm=algorithm, **options
        )
        yield call(hs.count_pairs, points, 1.0, inclusive=False, algorithm=algorithm, **options)
        yield call(hs.count_pairs, points, [0.0, 1.0, 2.0], algorithm=algorithm, **options)
    yield from call(hs.pairs, points, [0.0, 1.0, 1.5], quantities="ijk", sort=True, **options)
    yield from call(hs.pairs_between, q, points, 1.0, quantities="ijdDS", **options)
    table = call(hs.neighbors, points, 1.0, quantities="jdDS", **options)
    yield from (table.offsets, table.indices, table.distances, table.vectors, table.shifts)
    yield call(hs.coordination, points, 1.0, **options)
    yield call(hs.pair_histogram, points, [0.0, 1.0, 1.5, 2.0], **options)
    yield from call(hs.nearest, points, 3, quantities="jdDS", **options)
    yield from call(
        hs.pairs, points, None, radii=[0.5] * len(points), quantities="ijdDS", **options
    )
    cells = hs.CellList(points, 1.0, **options)
    yield from cells.pairs(quantities="ijdS")
    yield cells.cell_of(points)
    yield cells.count_pairs()
    listed = hs.VerletList(1.0, 0.0, **options)
    listed.update(points)
    yield from listed.pairs(quantities="ijdS")
    found = call(hs.clusters, points, 1.0, **options)
    yield found.labels


@pytest.mark.parametrize("case", CASES, ids=str)
def test_the_sign_of_zero_changes_nothing(case):
    (points, options), (turned, turned_options) = both(case)
    for one, other in zip(of_all(points, **options), of_all(turned, **turned_options), strict=True):
        assert np.asarray(one).tobytes() == np.asarray(other).tobytes()
