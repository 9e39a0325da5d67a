# SPDX-License-Identifier: BSD-3-Clause
"""A dict of keys and positions that answers as a DynamicCellList must, in rational arithmetic."""

import itertools
from fractions import Fraction

import numpy as np


class Model:
    """Keys and positions; box vectors as rows, or None."""

    def __init__(self, dim, box=None, periodic=None, inclusive=True, reach=3):
        self.dim, self.inclusive, self.points = dim, inclusive, {}
        rows = np.zeros((0, dim)) if box is None else np.asarray(box, float)
        rows = np.diag(rows) if rows.ndim == 1 else rows
        repeats = np.broadcast_to(True if periodic is None else periodic, dim)
        self.axes = [axis for axis in range(len(rows)) if repeats[axis]]
        self.rows = [[Fraction(x) for x in rows[axis]] for axis in self.axes]
        self.images = list(itertools.product(range(-reach, reach + 1), repeat=len(self.axes)))

    def insert(self, key, position):
        self.points[key] = [Fraction(float(x)) for x in position]

    def within(self, position, radius):
        """The set of (key, S)."""
        centre, square = [Fraction(float(x)) for x in position], Fraction(float(radius)) ** 2
        found = set()
        for (key, point), image in itertools.product(self.points.items(), self.images):
            distance = sum(
                (p - c + sum(s * row[k] for s, row in zip(image, self.rows))) ** 2
                for k, (p, c) in enumerate(zip(point, centre))
            )
            if distance < square or (self.inclusive and distance == square):
                shift = [0] * self.dim
                for axis, s in zip(self.axes, image):
                    shift[axis] = s
                found.add((key, tuple(shift)))
        return found


def keys_of(array):
    """Keys of an array as they are in Python."""
    rows = array.tolist()
    return [tuple(row) if isinstance(row, list) else row for row in rows]


def check(cells, model, position, radius):
    """Every query of the list gives what the model does."""
    expected = model.within(position, radius)
    keys, shifts = cells.within(position, radius, shifts=True)
    found = list(zip(keys_of(keys), map(tuple, shifts.tolist())))
    assert len(set(found)) == len(found)
    assert set(found) == expected
    assert keys_of(cells.within(position, radius)) == keys_of(keys)
    near = keys_of(cells.near(position, radius))
    assert len(set(near)) == len(near)
    assert {key for key, _ in expected} <= set(near) <= set(model.points)
    assert cells.any_within(position, radius) == bool(expected)
    home = (0,) * model.dim
    for key in itertools.islice(model.points, 3):
        others = expected - {(key, home)}
        assert cells.any_within(position, radius, skip=key) == bool(others)
    offsets, many, S = cells.within_many([position, position], radius, shifts=True)
    assert offsets.tolist() == [0, len(keys), 2 * len(keys)]
    assert np.array_equal(many, np.concatenate([keys, keys]))
    assert np.array_equal(S, np.concatenate([shifts, shifts]))


def check_points(cells, model):
    """The list has the keys and positions of the model."""
    assert len(cells) == len(model.points)
    assert sorted(cells) == sorted(model.points)
    for key, point in model.points.items():
        assert key in cells
        assert cells.position(key).tolist() == [float(x) for x in point]
