# SPDX-License-Identifier: BSD-3-Clause
"""A dict of keys and positions that answers as a DynamicCellList must, in whole numbers."""

import itertools

import numpy as np

from oracles import whole


class Model:
    """Keys and positions; box vectors as rows, or None."""

    def __init__(self, dim, box=None, periodic=None, inclusive=True, reach=3):
        self.dim, self.inclusive, self.points = dim, inclusive, {}
        rows = np.zeros((0, dim)) if box is None else np.asarray(box, float)
        rows = np.diag(rows) if rows.ndim == 1 else rows
        repeats = np.broadcast_to(True if periodic is None else periodic, dim)
        self.axes = [axis for axis in range(len(rows)) if repeats[axis]]
        rows = [[whole(x) for x in rows[axis]] for axis in self.axes]
        self.images = {}  # how far each is from the points themselves
        for image in itertools.product(range(-reach, reach + 1), repeat=len(self.axes)):
            steps = (sum(s * row[k] for s, row in zip(image, rows)) for k in range(dim))
            self.images[image] = list(steps)

    def insert(self, key, position):
        self.points[key] = [whole(x) for x in position]

    def within(self, position, radius):
        """The set of (key, S)."""
        centre, square = [whole(x) for x in position], whole(radius) ** 2
        found = set()
        for (key, point), image in itertools.product(self.points.items(), self.images):
            steps = self.images[image]
            distance = sum((p - c + step) ** 2 for p, c, step in zip(point, centre, steps))
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
    assert keys_of(cells.keys) == list(cells)
    positions = dict(zip(cells, cells.positions.tolist(), strict=True))
    for key, point in model.points.items():
        assert key in cells
        assert cells.position(key).tolist() == positions[key] == [x / (1 << 1074) for x in point]
        assert cells.cell_of(positions[key]) == cells.cell(key)
