# SPDX-License-Identifier: BSD-3-Clause
"""Laws that an exact answer obeys exactly: no tolerance anywhere.

Each law compares two searches that must agree because the geometry is the same, so that no
oracle is needed.
"""

from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import halfshell as hs
from halfshell._check.reference import exact_square, reference_pairs
from oracles import same_arrays
from scene_strategies import scenes


def half(pairs):
    """Rewrite pairs of any orientation in the convention of the half list."""
    for i, j, S in pairs:
        backwards = i > j or (i == j and S < (0,) * len(S))
        yield (j, i, tuple(-s for s in S)) if backwards else (i, j, tuple(S))


# ---- the definition ------------------------------------------------------------------------


@given(scenes())
def test_the_definition(scene):
    expected = reference_pairs(
        scene.points, scene.cutoff, scene.box, scene.periodic, scene.inclusive
    )
    assert scene.found() == set(expected)


@given(scenes())
def test_all_kernels_return_the_same_bytes(scene):
    first, *others = (scene.arrays("ijSdD", kernel=name) for name in hs.kernels())
    assert all(same_arrays(first, other) for other in others)


# ---- changes of the points -----------------------------------------------------------------


@given(scenes(), st.integers(-900, 900))
def test_scaling_by_a_power_of_two_changes_nothing(scene, exponent):
    scale = 2.0**exponent
    box = None if scene.box is None else scene.box * scale
    for numbers in (scene.points, scene.cutoff, 0.0 if scene.box is None else scene.box):
        if (np.asarray(numbers) * scale / scale != numbers).any():
            return  # fell into the subnormal range and was rounded
    scaled = scene.but(points=scene.points * scale, cutoff=scene.cutoff * scale, box=box)
    assert scaled.found() == scene.found()


# ---- changes of the box --------------------------------------------------------------------


@given(scenes(dyadic=True, open_space=False), st.data())
def test_moving_one_point_by_box_vectors_moves_only_its_shifts(scene, data):
    n, ndim = scene.points.shape
    point = data.draw(st.integers(0, n - 1))
    reach = data.draw(st.sampled_from([1, 3, 1000, 2**30, 2**45]))
    steps = data.draw(st.lists(st.integers(-reach, reach), min_size=ndim, max_size=ndim))
    steps = np.where(scene.periodic, steps, 0)
    points = scene.points.copy()
    moved = [Fraction(x) for x in points[point].tolist()]
    for s, row in zip(steps.tolist(), scene.box.tolist()):
        moved = [x + s * Fraction(y) for x, y in zip(moved, row)]
    points[point] = [float(x) for x in moved]
    if any(Fraction(x) != y for x, y in zip(points[point].tolist(), moved)):
        return  # not representable
    expected = set()
    for i, j, S in scene.found():
        change = np.where(i == j, 0, steps * ((i == point) - (j == point) + 0))
        expected.add((i, j, tuple((np.array(S) + change).tolist())))
    if reach < 2**30:
        assert scene.but(points=points).found() == expected
    else:  # shifts may not fit int32: compare without them
        i, j, d = scene.but(points=points).arrays("ijd")
        one, other = scene.arrays("ijd"), (i, j, d)
        assert sorted(zip(*map(np.ndarray.tolist, one))) == sorted(
            zip(*map(np.ndarray.tolist, other))
        )


@given(scenes(dyadic=True, open_space=False, ndims=(2, 3)), st.data())
def test_another_basis_of_the_same_lattice_maps_the_shifts(scene, data):
    ndim = scene.points.shape[1]
    change = np.eye(ndim, dtype=int)
    for _ in range(data.draw(st.integers(1, 4))):
        one, other = data.draw(st.permutations(range(ndim)))[:2]
        change[one] += data.draw(st.integers(-5, 5)) * change[other]
    periodic = np.ones(ndim, bool)
    plain = scene.but(periodic=periodic)
    skewed = scene.but(periodic=periodic, box=change @ scene.box)
    back = {(i, j, tuple((np.array(S) @ change).tolist())) for i, j, S in skewed.found()}
    assert set(half(back)) == plain.found()


@given(scenes(in_box=False))
def test_a_huge_box_is_open_space(scene):
    ndim = scene.points.shape[1]
    zeros = (0,) * ndim
    for size in (64.0, 2.0**40, 1e300):
        boxed = scene.but(box=np.full(ndim, size)).found()
        assert {(i, j) for i, j, _ in boxed} == {(i, j) for i, j, _ in scene.found()}
        assert all(S == zeros for _, _, S in boxed)


@given(scenes(open_space=False), st.integers(0, 3))
def test_opening_an_axis_keeps_exactly_the_pairs_without_a_shift_there(scene, axis):
    axis %= scene.points.shape[1]
    opened = scene.periodic.copy()
    opened[axis] = False
    expected = {(i, j, S) for i, j, S in scene.found() if S[axis] == 0}
    assert scene.but(periodic=opened).found() == expected


@given(scenes(open_space=False))
def test_rows_of_open_axes_are_not_used(scene):
    box = np.where(scene.periodic[:, None], scene.box, 0.0)
    assert scene.but(box=box).found() == scene.found()
    box = np.where(scene.periodic[:, None], scene.box, scene.box[::-1] * 7e100)
    assert scene.but(box=box).found() == scene.found()


@given(scenes(dyadic=True, open_space=False))
def test_a_doubled_box_with_copied_points_finds_the_same_pairs(scene):
    # Supercell: the box twice along axis 0, every point twice; each pair is there twice.
    if not scene.periodic[0]:
        return
    n = len(scene.points)
    box = scene.box.copy()
    box[0] *= 2
    points = np.concatenate([scene.points, scene.points + scene.box[0]])
    expected = set()
    for i, j, S in scene.found():
        for copy in (0, 1):
            cells = copy + S[0]  # unit cell of j when i is in unit cell `copy`
            expected.add((i + n * copy, j + n * (cells % 2), (cells // 2, *S[1:])))
    assert scene.but(points=points, box=box).found() == set(half(expected))


# ---- changes of the cutoff and of the rule -------------------------------------------------


@given(scenes())
def test_the_two_rules_differ_by_the_exact_ties(scene):
    closed = scene.but(inclusive=True).found()
    open_ball = scene.but(inclusive=False).found()
    limit = Fraction(scene.cutoff) ** 2
    ties = {
        (i, j, S) for i, j, S in closed if exact_square(scene.points, i, j, S, scene.box) == limit
    }
    assert closed - open_ball == ties
    assert open_ball <= closed


# ---- changes of the storage ----------------------------------------------------------------


@given(scenes())
def test_float32_points_are_the_real_numbers_that_they_are(scene):
    single = scene.points.astype(np.float32)
    assert scene.but(points=single).found() == scene.but(points=single.astype(float)).found()
