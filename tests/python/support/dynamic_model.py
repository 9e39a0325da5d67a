# SPDX-License-Identifier: BSD-3-Clause
"""A dict of keys and positions that answers as a DynamicCellList must, in fractions."""

import itertools
from fractions import Fraction

import numpy as np

from rational_images import Images, between, exact


class Model:
    """Keys and positions; box vectors as rows, or None."""

    def __init__(self, dim, box=None, periodic=None, inclusive=True):
        self.dim, self.inclusive, self.points = dim, inclusive, {}
        self.images = Images(dim, box, periodic)

    def insert(self, key, position):
        self.points[key] = np.array(position, np.float64)

    def within(self, position, radius):
        """The set of (key, S)."""
        centre, square = exact(position), Fraction(radius) ** 2
        return {
            (key, S)
            for key, point in self.points.items()
            for S, _, _ in self.images.within(between(centre, exact(point)), square, self.inclusive)
        }


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
    assert keys_of(cells.keys) == list(cells)
    positions = dict(zip(cells, cells.positions.tolist(), strict=True))
    for key, point in model.points.items():
        assert key in cells
        assert cells.position(key).tobytes() == point.tobytes()
        assert positions[key] == point.tolist()
        assert cells.cell_of(positions[key]) == cells.cell(key)
