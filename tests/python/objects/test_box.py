# SPDX-License-Identifier: BSD-3-Clause
"""Boxes: constructors, measures, and wrapping by whole vectors."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from ase.geometry import cellpar_to_cell

import halfshell as hs
from halfshell._check.reference import exact_vector
from oracles import BOX_KINDS, random_box, same_arrays
from refused_calls import check_refusals


def exact_determinant(rows):
    """Determinant in rational numbers, by permutations."""
    total = Fraction(0)
    for order in itertools.permutations(range(len(rows))):
        sign = 1
        for a, b in itertools.combinations(order, 2):
            sign = -sign if a > b else sign
        product = Fraction(sign)
        for row, column in enumerate(order):
            product *= Fraction(float(rows[row][column]))
        total += product
    return total


def exact_wrapped(box, points, shifts, row):
    """points[row] + shifts[row] @ box in rational numbers."""
    origin = np.zeros((1, points.shape[1]))
    both = np.concatenate([origin, points])
    return exact_vector(both, 0, row + 1, shifts[row].tolist(), box)


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_volume_and_heights(kind, rng):
    for ndim in range(1, 6):
        matrix = random_box(rng, kind, ndim)
        box = hs.Box.from_matrix(matrix)
        volume = abs(exact_determinant(matrix))
        assert abs(Fraction(box.volume) / volume - 1) < Fraction(1, 10**12)
        heights = box.perpendicular_heights
        assert heights.shape == (ndim,)
        for axis in range(ndim):
            others = np.delete(matrix, axis, axis=0)
            area = math.sqrt(abs(np.linalg.det(others @ others.T))) if ndim > 1 else 1.0
            assert math.isclose(heights[axis], float(volume) / area, rel_tol=1e-9)


def test_right_angles_are_exactly_right():
    vectors = np.asarray(hs.Box.from_lengths_angles((2.0, 3.0, 4.0), (90.0, 90.0, 90.0)))
    assert np.array_equal(vectors, np.diag([2.0, 3.0, 4.0]))
    plane = np.asarray(hs.Box.from_lengths_angles((2.0, 3.0), (90.0,)))
    assert np.array_equal(plane, np.diag([2.0, 3.0]))


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_wrapping_moves_by_whole_vectors_into_the_box(kind, rng):
    for ndim, spread in itertools.product((1, 2, 3, 5), (1, 10, 10**6, 10**12)):
        matrix = random_box(rng, kind, ndim)
        points = rng.uniform(-spread, spread, (20, ndim)) @ matrix
        before = points.copy()
        wrapped, shifts = hs.Box.from_matrix(matrix).wrap(points)
        assert wrapped.shape == shifts.shape == points.shape
        assert wrapped.dtype == np.float64 and shifts.dtype == np.int64
        assert np.array_equal(points, before)
        inverse = np.linalg.inv(matrix)
        for row in range(20):
            exact = exact_wrapped(matrix, points, shifts, row)
            # one rounding per component, in units of the largest term that was added
            size = max(1.0, np.abs(points[row]).max(), np.abs(shifts[row, :, None] * matrix).max())
            for got, true in zip(wrapped[row].tolist(), exact):
                assert abs(Fraction(got) - true) <= Fraction(math.ulp(float(size)))
            fractions = np.array([float(x) for x in exact]) @ inverse
            slack = 1e-9
            assert (fractions >= -slack).all() and (fractions < 1 + slack).all()


def test_wrapped_coordinates_never_reach_the_length():
    for length in (1.0, 0.1, 1 / 3, math.pi, 1e-300, 1e300):
        tiny = min(length, 1.0)
        values = [-5e-324, -1e-17 * tiny, length, -length, 0.0, math.nextafter(length, 0)]
        values += [math.nextafter(length, math.inf), -length * 2.0**-54, 7 * length, -7 * length]
        points = np.array([x for x in values if math.isfinite(x)])[:, None]
        wrapped, shifts = hs.Box.orthorhombic(length).wrap(points)
        assert (wrapped >= 0).all() and (wrapped < length).all()
        for row in range(len(points)):
            (exact,) = exact_wrapped([length], points, shifts, row)
            assert abs(Fraction(wrapped[row, 0]) - exact) <= Fraction(math.ulp(length))


def test_wrapping_many_points_is_wrapping_each(rng):
    box = hs.Box([[1.0, 0.0], [0.4, 1.0]])
    points = rng.normal(size=(70_001, 2)) * 5
    for given in (points, np.asfortranarray(points), points[::-1], points[:32768], points[:32769]):
        wrapped, shifts = box.wrap(given)
        parts = zip(*(box.wrap(part) for part in np.array_split(given, [16384, 49152])))
        assert np.array_equal([wrapped, shifts], [np.concatenate(part) for part in parts])
    for row, number, error, message in (
        (69_999, np.nan, ValueError, r"points\[69999, 1\]"),
        (32_768, 1e30, OverflowError, r"points\[32768\]"),
    ):
        spoiled = points.copy()
        spoiled[row, 1] = number
        with pytest.raises(error, match=message):
            box.wrap(spoiled)
    with pytest.raises(ValueError, match="dependent"):
        hs._core.box_wrap(points, np.array([[1.0, 1.0], [1.0, 1.0]]), 3)
    assert box.wrap(points[:0])[0].shape == (0, 2)


def test_open_axes_are_not_wrapped(rng):
    box = hs.Box.orthorhombic(1.0, 2.0, 3.0)
    points = rng.normal(size=(40, 3)) * 20
    wrapped, shifts = box.wrap(points, periodic=[True, False, False])
    assert not shifts[:, 1:].any()
    assert np.array_equal(wrapped[:, 1:], points[:, 1:])
    assert (wrapped[:, 0] >= 0).all() and (wrapped[:, 0] < 1).all()
    wrapped, shifts = box.wrap(points, periodic=False)
    assert np.array_equal(wrapped, points) and not shifts.any()


BAD = [
    (lambda: hs.Box.from_matrix(np.ones((2, 3))), ValueError, "shape"),
    (lambda: hs.Box.from_matrix(np.ones(3)), ValueError, "shape"),
    (lambda: hs.Box.from_matrix(np.ones((3, 3))), ValueError, "box"),
    (lambda: hs.Box.from_matrix(np.eye(9)), ValueError, "shape"),
    (lambda: hs.Box.orthorhombic(1.0, 0.0, 1.0), ValueError, "box"),
    (lambda: hs.Box.orthorhombic(), ValueError, "shape"),
    (lambda: hs.Box.from_lengths_angles((1, 2), (90, 90, 90)), ValueError, "lengths and angles"),
    (lambda: hs.Box.from_lengths_angles((1, 2, -3), (90, 90, 90)), ValueError, "lengths"),
    (lambda: hs.Box.from_lengths_angles((1, 2, 3), (90, 90, 180)), ValueError, "angles"),
    (lambda: hs.Box.from_lengths_angles((1, 2, 3), (30, 30, 90)), ValueError, "angles"),
    (lambda: hs.Box.orthorhombic(1.0, 1.0).wrap(np.zeros((3, 3))), ValueError, "points"),
    (lambda: hs.Box.orthorhombic(1.0).wrap([[1e300]]), OverflowError, "point"),
    (lambda: hs.Box.from_dimensions((1, 2, 3)), ValueError, "six numbers"),
    (lambda: hs.Box.from_dimensions(np.ones((6, 1))), ValueError, "dimensions"),
    (lambda: hs.Box.from_dimensions(np.zeros(6)), ValueError, "lengths must be finite and positi"),
    (lambda: hs.Box.from_dimensions((1, 2, 3, 30, 30, 90)), ValueError, "angles"),
]


def test_bad_boxes():
    check_refusals(BAD)


def test_equal_boxes_have_equal_hashes():
    plus, minus = hs.Box([[1.0, 0.0], [0.0, 2.0]]), hs.Box([[1.0, -0.0], [-0.0, 2.0]])
    assert plus == minus == hs.Box.orthorhombic(1.0, 2.0)
    assert len({plus, minus}) == 1
    assert plus != hs.Box([1.0, 3.0]) and plus != "box"


def test_copies_are_equal_and_read_only():
    import copy
    import pickle

    box = hs.Box.from_lengths_angles((4.0, 5.0, 6.0), (75.0, 98.0, 112.0))
    for twin in (copy.copy(box), copy.deepcopy(box), pickle.loads(pickle.dumps(box))):
        assert type(twin) is hs.Box and twin == box and hash(twin) == hash(box)
        assert twin.volume == box.volume
        assert same_arrays(twin.perpendicular_heights, box.perpendicular_heights)
        for array in (twin.vectors, twin.perpendicular_heights):
            assert not array.flags.writeable
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0.0


def test_orthorhombic_takes_lengths_only():
    assert hs.Box.orthorhombic((1.0, 2.0)) == hs.Box.orthorhombic(1, 2)
    with pytest.raises(ValueError, match=r"lengths.*shape"):
        hs.Box.orthorhombic(np.eye(3))


SIX = [5.0, 6.0, 7.0, 90.0, 90.0, 90.0]


def test_six_bare_numbers_make_no_box():
    for six in (SIX, tuple(SIX), np.array(SIX), np.array(SIX, np.float32)):
        with pytest.raises(ValueError, match=r"six bare numbers.*from_dimensions.*orthorhombic"):
            hs.Box(six)


def test_dimensions_are_lengths_and_angles():
    given = [4.25, 5.5, 6.1, 75.3, 98.0, 112.0]
    for kind in (float, np.float32, int):
        six = np.array(given).astype(kind)
        box = hs.Box.from_dimensions(six)
        assert box == hs.Box.from_lengths_angles(six[:3], six[3:])
        assert box == hs.Box.from_dimensions(six.tolist())
    ours = hs.Box.from_dimensions(given).vectors
    assert np.allclose(ours, cellpar_to_cell(given), rtol=0.0, atol=1e-13)


def steps(points, box):
    pair_list = hs.VerletList(0.5, box=box)
    pair_list.update(points)
    first = pair_list.pairs(quantities="ijS")
    pair_list.update(points, box=box)
    return (*first, *pair_list.pairs(quantities="ijS"))


def balls(points, box):
    cells = hs.DynamicCellList(points.shape[1], 0.5, box=box)
    cells.insert_many(np.arange(len(points)), points)
    return cells.within_many(points, 0.5, shifts=True)


def links(points, box):
    c = hs.Connectivity([hs.NodeList("a", points, np.full(len(points), 0.25))], box=box)
    return c.offsets, c.indices, c.shifts


#: Wherever a box is read by code of its own.
WITH_BOX = (
    steps, balls, links,
    lambda p, box: hs.pairs(hs.Points(p, box=box), 0.5, quantities="ijS"),
    lambda p, box: hs.pairs(p, 0.5, box=box, quantities="ijdDS"),
    lambda p, box: hs.pairs(hs.Points(p, box=box, batch=np.arange(len(p)) // 20), 0.5),
    lambda p, box: hs.rdf(p, 0.5, box=box).g,
    lambda p, box: hs.measure(p, [0, 1], [2, 3], box=box, quantities="dDS"),
    lambda p, box: hs.bricks(p, 0.5, 3, box=box)[1].pairs(p, quantities="ijS"),
    lambda p, box: (np.array(str(hs.verify(p, 0.5, [0], [1], [[0] * p.shape[1]], box=box))),),
    lambda p, box: hs.CellList(p, 0.5, box=box).pairs(quantities="ijd"),
    lambda p, box: next(hs.trajectory_pairs([p], 0.5, box=box)),
)  # fmt: skip


@pytest.mark.parametrize("ndim", [1, 3, 6])
def test_one_number_is_a_cube(ndim, rng):
    for asked in WITH_BOX:
        points = rng.random((80, ndim)) * 6.0
        for box in (1.5, np.float32(1.5), np.array(1.5), 2):
            assert same_arrays(asked(points, box), asked(points, [float(box)] * ndim))


@pytest.mark.parametrize(
    "box", [[2.0, 2.0, 0.0], np.diag([2.0, 2.0, -0.0]), [[1, 0, 0], [1, 0, 0], [0, 0, 0]]]
)
def test_a_vector_of_no_length_is_named(box):
    said = "vector 2 of box is zero; make that axis not periodic"
    with pytest.raises(ValueError, match=said):
        hs.Box(box)
    with pytest.raises(ValueError, match=said):
        hs.pairs(np.zeros((2, 3)), 1.0, box=box)
    boxes = np.stack([np.eye(3), np.diag([1.0, 0.0, 0.0])])
    with pytest.raises(ValueError, match=r"vector 1 of box is zero.*\nin system 1"):
        hs.pairs([np.zeros((1, 3))] * 2, 1.0, box=boxes)
    flat = hs.count_pairs(np.zeros((2, 3)), 0.5, box=[2, 2, 0], periodic=[True, True, False])
    assert flat == 1
