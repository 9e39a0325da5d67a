# SPDX-License-Identifier: BSD-3-Clause
"""What is returned: letters, dtypes, shapes; distances and vectors to the last place."""

import itertools
import math
from typing import get_args

import numpy as np
import pytest

import halfshell as hs
from calls import call
from full_lists import assert_last_place
from halfshell._check.reference import exact_square
from halfshell._convert.options import LETTERS, SHELL
from halfshell._convert.types import Letter
from oracles import BOX_KINDS, as_set, lattice, random_scene, rotation, same_arrays

DTYPES = {"i": np.int64, "j": np.int64, "d": float, "D": float, "S": np.int32, "P": np.int64}


@pytest.fixture
def scene(rng):
    points, cutoff, box, _ = random_scene(rng, 40, neighbours=8)
    return points, cutoff, box


def test_the_letters_of_types_messages_and_arrays_are_the_same(scene):
    points, cutoff, box = scene
    assert "".join(get_args(Letter)) == LETTERS + SHELL
    assert "".join(DTYPES) == LETTERS
    assert len(hs.pairs(points, cutoff, box=box, quantities=LETTERS)) == len(LETTERS)
    with pytest.raises(ValueError, match=f"some of the letters {' '.join(LETTERS + SHELL)}, each"):
        hs.pairs(points, cutoff, box=box, quantities=f"{LETTERS}x")


def test_several_letters_return_a_tuple_in_their_order(scene):
    points, cutoff, box = scene
    single = {letter: hs.pairs(points, cutoff, box=box, quantities=letter) for letter in DTYPES}
    for count in (2, 3):
        for letters in itertools.permutations("ijdDSP", count):
            found = hs.pairs(points, cutoff, box=box, quantities="".join(letters))
            assert isinstance(found, tuple)
            assert same_arrays(found, tuple(single[letter] for letter in letters))
    assert len(hs.pairs(points, cutoff, box=box, quantities="PSDdji")) == 6


def test_index_dtype(scene):
    for dtype in (np.int64, np.int32, "int64", "int32", np.dtype("int32")):
        points, cutoff, box = scene
        i, j, P, S = hs.pairs(points, cutoff, box=box, quantities="ijPS", index_dtype=dtype)
        assert i.dtype == j.dtype == P.dtype == np.dtype(dtype)
        assert S.dtype == np.int32
        wide = hs.pairs(points, cutoff, box=box, quantities="ij")
        assert np.array_equal(i, wide[0]) and np.array_equal(j, wide[1])
        assert np.array_equal(P, np.stack([i, j], axis=1))


def test_empty_results_have_dtype_and_shape():
    for n, cutoff in ((0, 1.0), (1, 1.0), (5, 0.0), (5, 1e-3)):
        for dtype in (np.int32, np.int64):
            points = np.arange(3 * n, dtype=float).reshape(n, 3)
            for box in (None, [100.0] * 3):
                i, j, d, D, S, P = hs.pairs(
                    points, cutoff, box=box, quantities="ijdDSP", index_dtype=dtype
                )
                assert i.shape == j.shape == d.shape == (0,)
                assert D.shape == S.shape == (0, 3) and P.shape == (0, 2)
                assert i.dtype == j.dtype == P.dtype == dtype
                assert d.dtype == D.dtype == np.float64 and S.dtype == np.int32


def test_half_list_convention(scene):
    points, cutoff, box = scene
    i, j, S = hs.pairs(points, 2.5 * cutoff, box=box, quantities="ijS")
    zero = (0, 0, 0)
    for a, b, s in zip(i.tolist(), j.tolist(), map(tuple, S.tolist())):
        assert a < b or (a == b and s > zero)


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_vector_is_j_minus_i_plus_shift_times_box(kind, rng):
    for spread, inclusive in itertools.product((1, 3, 10**6), (True, False)):
        points, cutoff, box, _ = random_scene(rng, 12, 3, kind, 8, spread)
        how = {"box": box, "quantities": "ijSdD", "inclusive": inclusive}
        first, *others = (call(hs.pairs, points, cutoff, kernel=k, **how) for k in hs.kernels())
        assert all(same_arrays(first, other) for other in others)
        assert len(first[0])
        assert_last_place(points, cutoff, box, [x.tolist() for x in first], inclusive)


def test_distances_never_contradict_the_decision(rng):
    for inclusive in (True, False):
        for kernel in hs.kernels():
            # Shells of a rotated crystal straddle the cutoff by less than an ulp.
            points, box = lattice("fcc", (3, 3, 3))
            for _ in range(3):
                turn = rotation(rng)
                rotated, frame = points @ turn, box @ turn
                for square in (2, 4, 6):
                    cutoff = math.sqrt(square)
                    d = call(
                        hs.pairs,
                        rotated,
                        cutoff,
                        box=frame,
                        quantities="d",
                        inclusive=inclusive,
                        kernel=kernel,
                    )
                    assert (d <= cutoff).all() if inclusive else (d < cutoff).all()
                    assert np.count_nonzero(d >= math.nextafter(math.nextafter(cutoff, 0), 0)) > 0


def test_distance_at_the_cutoff_is_the_cutoff():
    for kernel in hs.kernels():
        points = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [1.0, 2.0, -2.0]]) / 8
        assert call(hs.pairs, points, 5 / 8, quantities="Pd", sort=True, kernel=kernel)[
            1
        ].tolist() == [5 / 8, 3 / 8, math.sqrt(12) / 8]


def test_last_place_at_extreme_magnitudes(rng):
    for kernel in hs.kernels():
        points = rng.random((8, 3))
        for exponent in (-1070, -1000, -540, -500, 480, 520, 1000):
            scale = 2.0**exponent
            scaled, cutoff = points * scale, 0.7 * scale
            found = call(hs.pairs, scaled, cutoff, quantities="ijSdD", kernel=kernel)
            assert_last_place(scaled, cutoff, None, [x.tolist() for x in found])
            box = np.eye(3) * scale
            found = call(hs.pairs, scaled, cutoff, box=box, quantities="ijSdD", kernel=kernel)
            assert_last_place(scaled, cutoff, box, [x.tolist() for x in found])


# ---- the rounded rules, which exist to be compared with ------------------------------------


def rounded_pairs(points, cutoff, box, inclusive, margin=1e-6):
    """The fixed float64 formula, evaluated by NumPy on every pair near the cutoff."""
    i, j, S = hs.pairs(points, cutoff * (1 + margin), box=box, quantities="ijS")
    D = points[j] - points[i]
    if box is not None:
        shift = S[:, 0, None] * box[0]
        for k in range(1, len(box)):
            shift = shift + S[:, k, None] * box[k]
        D = D + shift
    square = D[:, 0] * D[:, 0]
    for k in range(1, points.shape[1]):
        square = square + D[:, k] * D[:, k]
    limit = cutoff * cutoff
    near = square <= limit if inclusive else square < limit
    return set(zip(i[near].tolist(), j[near].tolist(), map(tuple, S[near].tolist())))


@pytest.mark.parametrize("ndim", [1, 2, 3, 5])
def test_double_is_one_fixed_float64_formula(ndim, rng):
    cases = []
    for kind in BOX_KINDS:
        cases.append(random_scene(rng, 80, ndim, kind, neighbours=10, spread=2)[:3])
    grid = np.array(list(itertools.product(range({1: 30, 2: 8, 3: 5, 5: 2}[ndim]), repeat=ndim)))
    for square in (1, 2, 3, 4):
        turned = grid @ rotation(rng, ndim)
        cases.append((turned, math.sqrt(square), None))
        cases.append((turned, math.sqrt(square), rotation(rng, ndim) * (grid.max() + 1.0)))
    for (points, cutoff, box), inclusive in itertools.product(cases, (True, False)):
        expected = rounded_pairs(points, cutoff, box, inclusive)
        how = {"box": box, "quantities": "ijS", "inclusive": inclusive, "precision": "double"}
        for kernel in hs.kernels():
            assert as_set(*call(hs.pairs, points, cutoff, kernel=kernel, **how)) == expected


@pytest.mark.parametrize("ndim, size", [(1, 500), (2, 25)])
def test_double_rounds_far_away_as_the_formula_does(ndim, size, rng):
    for kernel in hs.kernels():
        # From 1e9 boxes away D has few digits left: pairs beyond the cutoff are in by rounding.
        grid = np.array(list(itertools.product(range(size), repeat=ndim))) * 1.1
        differences = 0
        for turn in (np.eye(ndim), rotation(rng, ndim)):
            box = 1.1 * size * turn
            for spread in (1e3, 1e6, 1e9):
                points = grid @ turn + np.round(rng.uniform(-spread, spread, grid.shape)) @ box
                for cutoff in (1.1, 2.2):
                    how = {"box": box, "quantities": "ijS", "kernel": kernel}
                    found = as_set(*call(hs.pairs, points, cutoff, precision="double", **how))
                    assert found == rounded_pairs(points, cutoff, box, True, margin=1e-2)
                    differences += len(found - as_set(*call(hs.pairs, points, cutoff, **how)))
        assert differences > 100


def test_double_and_exact_differ_on_a_rotated_crystal(rng):
    points, box = lattice("sc", (6, 6, 6))
    turn = rotation(rng)
    points, box = points @ turn, box @ turn
    counts = {
        precision: [
            call(hs.count_pairs, points, math.sqrt(k), box=box, precision=precision)
            for k in (1, 2, 3, 5)
        ]
        for precision in ("exact", "double")
    }
    assert counts["exact"] != counts["double"]


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_single_errs_only_next_to_the_cutoff(dtype, rng):
    for kernel in hs.kernels():
        for kind in (*BOX_KINDS, None):
            points, cutoff, box, _ = random_scene(rng, 400, 3, kind or "triclinic", neighbours=40)
            box = None if kind is None else box
            points = points.astype(dtype)
            sets = []
            for precision in ("exact", "single"):
                i, j, S = call(
                    hs.pairs,
                    points,
                    cutoff,
                    box=box,
                    quantities="ijS",
                    precision=precision,
                    kernel=kernel,
                )
                sets.append(set(zip(i.tolist(), j.tolist(), map(tuple, S.tolist()))))
            for i, j, S in sets[0] ^ sets[1]:
                ratio = float(exact_square(points, i, j, S, box)) / cutoff**2
                assert abs(math.sqrt(ratio) - 1) <= 1e-5


@pytest.mark.parametrize("precision", ["double", "single"])
def test_rounded_rules_agree_with_the_exact_one_away_from_the_cutoff(precision, rng):
    for kernel in hs.kernels():
        # Distances on a grid of 1/4; the cutoff lies between two of them.
        points = rng.integers(0, 12, (60, 3)) / 4
        for box in (None, [3.0, 3.0, 3.0]):
            how = {"box": box, "quantities": "ijS", "sort": True, "kernel": kernel}
            assert same_arrays(
                call(hs.pairs, points, 1.01, precision=precision, **how),
                call(hs.pairs, points, 1.01, **how),
            )
