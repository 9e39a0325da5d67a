# SPDX-License-Identifier: BSD-3-Clause
"""Small scenes for hypothesis, full of what goes wrong: coordinates on a dyadic grid (ties), an ulp
beside the grid, on faces, coincident; cutoffs that are the rounded distance of a pair or an ulp
beside it."""

import math

import numpy as np
from hypothesis import strategies as st

import halfshell as hs
from calls import call
from halfshell._check.reference import exact_square
from oracles import as_set, full_box

GRID = st.integers(-12, 12).map(lambda k: k / 8)
ANY = st.floats(-3, 3, allow_subnormal=False)
BESIDE = st.builds(
    lambda x, up: math.nextafter(x, math.inf if up else -math.inf), GRID, st.booleans()
)
COORDINATES = st.sampled_from([GRID, GRID, st.one_of(GRID, GRID, BESIDE), ANY])
# Distances that grid points have exactly: (3, 4, 5), (1, 2, 2, 3), (2, 3, 6, 7), (1, 1, 1, 1, 2)
TIES = st.sampled_from([0.0, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0, 1.125, 1.25, 1.5])


@st.composite
def boxes(draw, ndim, dyadic):
    """Row vectors of a box: a diagonal of moderate size times a shear, rows maybe reordered."""
    length = st.integers(6, 20).map(lambda k: k / 8)
    length = length if dyadic else st.one_of(length, st.floats(0.75, 2.5))
    box = np.diag(draw(st.lists(length, min_size=ndim, max_size=ndim)))
    tilt = st.sampled_from([0.0, 0.0, 0.25, -0.5, 0.375]) if dyadic else st.floats(-1, 1)
    for k in range(ndim):
        for column in range(k):
            box[k, column] = draw(tilt)
    order = draw(st.permutations(range(ndim)))
    return box[list(order)] * draw(st.sampled_from([1.0, -1.0]))


class Scene:
    """Arguments of one search; `found()` is its set of pairs (i, j, S)."""

    def __init__(self, points, cutoff, box=None, periodic=None, inclusive=True):
        self.points = points
        self.cutoff = cutoff
        self.box = box
        self.periodic = periodic
        self.inclusive = inclusive

    def but(self, **changes):
        return Scene(**{**vars(self), **changes})

    def arrays(self, quantities="ijS", **how):
        return call(hs.pairs,
            self.points,
            self.cutoff,
            box=self.box,
            periodic=self.periodic,
            inclusive=self.inclusive,
            quantities=quantities,
            **how,
        )

    def found(self, **how):
        return as_set(*self.arrays(**how))

    def __repr__(self):
        return f"Scene({', '.join(f'{k}={v!r}' for k, v in vars(self).items())})"


@st.composite
def scenes(draw, dyadic=False, open_space=True, in_box=True, ndims=(1, 2, 2, 3, 3, 3, 4)):
    """Scenes of up to 10 points in 1 to 4 dimensions, most with pairs at the cutoff."""
    ndim = draw(st.sampled_from(ndims))
    n = draw(st.integers(1, 10))
    coordinate = GRID if dyadic else draw(COORDINATES)
    row = st.lists(coordinate, min_size=ndim, max_size=ndim)
    points = np.array(draw(st.lists(row, min_size=n, max_size=n)))
    box = periodic = None
    if in_box and not (open_space and draw(st.integers(0, 3)) == 3):
        box = draw(boxes(ndim, dyadic))
        flag = st.integers(0, 3).map(lambda k: k < 3)
        periodic = np.array(draw(st.lists(flag, min_size=ndim, max_size=ndim)))
    largest = 2.0 if ndim < 4 else 1.25
    cutoff = draw(st.one_of(TIES, TIES, st.floats(0, largest)))
    if draw(st.integers(0, 2)):
        # the rounded distance of some pair, or an ulp beside it
        i, j = draw(st.integers(0, n - 1)), draw(st.integers(0, n - 1))
        S = np.array(draw(st.lists(st.integers(-1, 1), min_size=ndim, max_size=ndim)))
        rows, flags = full_box(box, periodic, ndim)
        distance = math.sqrt(exact_square(points, i, j, np.where(flags, S, 0).tolist(), rows))
        nearby = [distance, distance, math.nextafter(distance, 9), math.nextafter(distance, 0)]
        cutoff = draw(st.sampled_from(nearby)) if distance <= largest else cutoff
    return Scene(points, cutoff, box, periodic, draw(st.booleans()))
