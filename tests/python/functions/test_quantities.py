# SPDX-License-Identifier: BSD-3-Clause
"""What is returned: letters, dtypes, shapes; distances and vectors to the last place."""

import itertools
import math
from typing import get_args

import numpy as np
import pytest

import halfshell as hs
from calls import call
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


def test_index_dtype(scene):
    points, cutoff, box = scene
    wide = hs.pairs(points, cutoff, box=box, quantities="ijP")
    for dtype in (np.int64, np.int32, "int64", "int32", np.dtype("int32")):
        found = hs.pairs(points, cutoff, box=box, quantities="ijP", index_dtype=dtype)
        assert same_arrays(found, tuple(array.astype(dtype) for array in wide))


BOXES = [[3, 5], [[3, 0], [1, 5]], [3, 4, 5], [[3, 0, 0], [1, 4, 0], [0, 1, 5]]]


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("exclude", [None, [[0, 1], [2, 3]]])
def test_images_are_in_the_same_order_without_their_shifts(rng, box, exclude):
    d = len(box)
    tensors = np.array([np.eye(d), np.eye(d) + 0.5 * (np.eye(d, k=1) + np.eye(d, k=-1))])
    of_each = [{}, {"radii": rng.integers(1, 4, 30)}, {"supports": tensors[rng.integers(0, 2, 30)]}]
    for known in of_each:
        points = hs.Points(rng.integers(-17, 18, (30, d)), box=box, **known)
        how = {"exclude": exclude, "rule": "max" if known else None}
        table = hs.neighbors(points, 5.5, quantities="jdDS", **how)
        distances, vectors, _ = hs.pairs(points, 5.5, quantities="dDS", sort=True, **how)
        for letter, name, column in (("d", "distances", distances), ("D", "vectors", vectors)):
            for more in ("", "j"):
                rows = hs.neighbors(points, 5.5, quantities=more + letter, **how)
                assert same_arrays(getattr(rows, name), getattr(table, name))
                found = hs.pairs(points, 5.5, quantities="i" + more + letter, sort=True, **how)
                assert same_arrays(found[-1], column)


def test_lists_without_elements_have_the_dimensions_of_the_others():
    some = np.zeros((4, 2))
    assert hs.pairs_between(some, [], 1.0, quantities="D").shape == (0, 2)
    assert hs.pairs_between([], some, 1.0, quantities="D").shape == (0, 2)
    assert hs.pairs_between([], [], 1.0, quantities="D").shape == (0, 3)


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
