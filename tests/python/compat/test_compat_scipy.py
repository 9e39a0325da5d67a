# SPDX-License-Identifier: BSD-3-Clause
"""`halfshell.compat.scipy`: SciPy's own tests pass with it, and its answers are SciPy's where
rounding does not decide."""

import itertools
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from scipy import spatial

from halfshell.compat import scipy as ours

#: Tests of SciPy that do not apply to the drop-in, and why: none.
NOT_APPLICABLE: dict[str, str] = {}

#: Runs SciPy's tests with our names in the place of its own, which its tests import from there.
PATCHED = """
import sys, pytest
from scipy import spatial
from halfshell.compat import scipy as ours
for name in ours.__all__:
    setattr(spatial, name, getattr(ours, name))
left_out = [f"--deselect={name}" for name in sys.argv[1:]]
status = pytest.main(["--pyargs", "scipy.spatial.tests.test_kdtree", "-q", "-p",
                      "no:cacheprovider", "-o", "addopts=", "-W", "default", *left_out])
from scipy.spatial.tests import test_kdtree
assert test_kdtree.KDTree is ours.KDTree and test_kdtree.cKDTree is ours.cKDTree
sys.exit(status)
"""

BOXES = {"open": None, "cube": 1.0, "mixed": [1.0, 0.0, 2.0], "zeros": 0.0}
TREES = ["KDTree", "cKDTree"]


@pytest.mark.slow
def test_the_tests_of_scipy_pass(tmp_path):
    if not (Path(spatial.__file__).parent / "tests/test_kdtree.py").exists():
        pytest.skip("this release of SciPy ships no tests")
    command = [sys.executable, "-c", PATCHED, *NOT_APPLICABLE]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed" in done.stdout


def both(name, points, **options):
    return [getattr(module, name)(points, **options) for module in (spatial, ours)]


def alike(found, expected):
    """Equal, down to types, but for rounding and for the order of lists, where ours ascend."""
    assert type(found) is type(expected)
    if isinstance(found, tuple):
        for a, b in zip(found, expected, strict=True):
            alike(a, b)
    elif isinstance(found, list) and (not found or isinstance(found[0], int)):
        assert found == sorted(expected)
    elif isinstance(found, set):
        assert found == expected
    elif isinstance(found, list):
        assert [sorted(one) for one in expected] == found
    elif isinstance(found, np.ndarray) and found.dtype == object:
        assert found.shape == expected.shape
        for a, b in zip(found.flat, expected.flat):
            alike(a, b)
    elif isinstance(found, np.ndarray):
        assert (found.dtype, found.shape) == (expected.dtype, expected.shape)
        assert found.flags.c_contiguous and found.flags.writeable
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)
    else:
        assert found == pytest.approx(expected, rel=1e-12)


# Each box and number of points with one of the two classes.
SCENES = [(n, TREES[(k + m) % 2], box) for k, n in enumerate((0, 1, 7, 60, 3000))
          for m, box in enumerate(BOXES)]  # fmt: skip


@pytest.mark.parametrize("n, name, box", SCENES)
def test_nearest_neighbours_are_those_of_scipy(rng, n, name, box):
    theirs, tree = both(name, rng.random((n, 3)), boxsize=BOXES[box])
    queries = rng.random((2, 4, 3)) * 3.0 - 1.0
    for x in (queries, queries[0], queries[0, 0], queries[:0], queries[0].astype(np.float32)):
        for k in (1, 2, 5, n + 2, [1], [2, 1], np.array([3, 100]), np.int64(1)):
            if np.max(k) < 200:
                alike(tree.query(x, k), theirs.query(x, k))
        for bound in (0.0, 0.1, 0.45, 0.7, np.inf):
            alike(
                tree.query(x, 3, distance_upper_bound=bound, workers=-1),
                theirs.query(x, 3, distance_upper_bound=bound),
            )


@pytest.mark.parametrize("n, name, box", SCENES)
def test_balls_are_those_of_scipy(rng, n, name, box):
    theirs, tree = both(name, rng.random((n, 3)), boxsize=BOXES[box])
    queries = rng.random((2, 4, 3)) * 3.0 - 1.0
    for x in (queries, queries[0], queries[0, 0], queries[:0], [[0, 1, 0]]):
        shape = np.shape(x)[:-1]
        for r in (0.0, 0.15, 0.49, 0.9, np.inf, rng.random(shape) * 0.3, np.full(shape, 0.2)):
            for length in (False, True):
                found, expected = (
                    one.query_ball_point(x, r, return_length=length, return_sorted=True)
                    for one in (tree, theirs)
                )
                alike(found, expected)


@pytest.mark.parametrize("n, name, box", [one for one in SCENES if one[0] < 100])
def test_pairs_and_counts_are_those_of_scipy(rng, n, name, box):
    theirs, tree = both(name, rng.random((n, 3)), boxsize=BOXES[box])
    their_other, other = both(name, rng.random((50, 3)), boxsize=BOXES[box])
    w, v = rng.random(n), rng.integers(-2, 3, 50)
    for r in (0, 0.0, 0.2, np.float32(0.3), 0.7):
        alike(tree.query_pairs(r), theirs.query_pairs(r))
        found, expected = (one.query_pairs(r, output_type="ndarray") for one in (tree, theirs))
        assert (found.dtype, found.shape) == (expected.dtype, expected.shape)
        assert set(map(tuple, found.tolist())) == set(map(tuple, expected.tolist()))
        alike(tree.query_ball_tree(other, r), theirs.query_ball_tree(their_other, r))
        alike(tree.query_ball_tree(tree, r), theirs.query_ball_tree(theirs, r))
    for r in (0.2, [0.2], [0.0, 0.1, 0.1, 0.4], [0.3, 0.1, 0.3], np.linspace(0, 1, 9), []):
        for weights in (None, (w, v), (None, v), (w, None), (None, None)) if n else (None,):
            alike(
                tree.count_neighbors(other, r, weights=weights),
                theirs.count_neighbors(their_other, r, weights=weights),
            )
            if np.all(np.diff(np.atleast_1d(r)) >= 0):
                found, expected = (
                    a.count_neighbors(b, r, weights=weights, cumulative=False)
                    for a, b in ((tree, other), (theirs, their_other))
                )
                assert type(found) is type(expected)
                np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
        same = w if n else None  # of no points SciPy takes no weights
        alike(
            tree.count_neighbors(tree, r, weights=same),
            theirs.count_neighbors(theirs, r, weights=same),
        )


@pytest.mark.parametrize("name, box", [one[1:] for one in SCENES[:4]])
def test_points_that_are_kept_serve_all_radii(rng, name, box):
    theirs, tree = both(name, rng.random((1500, 3)), boxsize=BOXES[box])
    few, our_few = both(name, rng.random((3, 3)), boxsize=BOXES[box])
    for r in (0.1, 0.11, 0.2, 0.05, 0.0, 0.012, 0.4, 0.025, 0.49, 0.1, 1e-5, 3e-9):
        alike(tree.query_ball_point(few.data, r), theirs.query_ball_point(few.data, r))
        alike(our_few.query_ball_tree(tree, r), few.query_ball_tree(theirs, r))
        alike(tree.count_neighbors(our_few, r), theirs.count_neighbors(few, r))
        alike(our_few.count_neighbors(tree, [0.0, r]), few.count_neighbors(theirs, [0.0, r]))
        for a, b, c, d in ((tree, our_few, theirs, few), (our_few, tree, few, theirs)):
            found = a.sparse_distance_matrix(b, r, output_type="ndarray")
            expected = np.sort(c.sparse_distance_matrix(d, r, output_type="ndarray"))
            assert found["i"].tolist() == expected["i"].tolist()
            assert found["j"].tolist() == expected["j"].tolist()
            np.testing.assert_allclose(found["v"], expected["v"], rtol=1e-12)
        alike(tree.query(few.data, 5), theirs.query(few.data, 5))
    assert len(tree._lists) < 7


@pytest.mark.parametrize("name, box", [one[1:] for one in SCENES[:4]])
def test_sparse_matrices_are_those_of_scipy(rng, name, box):
    points = np.vstack([rng.random((40, 3)), np.zeros((2, 3))])
    theirs, tree = both(name, points, boxsize=BOXES[box])
    for r in (0.0, 0.3, 0.8):
        for kind in ("dok_matrix", "coo_matrix", "dict", "ndarray"):
            found, expected = (
                one.sparse_distance_matrix(one, r, output_type=kind) for one in (tree, theirs)
            )
            assert type(found) is type(expected)
            if kind == "dict":
                assert found == pytest.approx(expected, rel=1e-12, abs=1e-15)
            elif kind == "ndarray":
                assert found.dtype == expected.dtype and len(found) == len(expected)
                for one in (found, expected) if r > 0.5 else (expected,):
                    one.sort(order=["i", "j"])
                assert (found[["i", "j"]] == expected[["i", "j"]]).all()
                np.testing.assert_allclose(found["v"], expected["v"], rtol=1e-12, atol=1e-15)
            else:
                assert found.dtype == expected.dtype and found.nnz == expected.nnz
                assert abs(found - expected).max() < 1e-12
    assert type(tree.sparse_distance_matrix(tree, 0.3)).__name__ == "dok_matrix"


CALLS = [
    lambda tree: tree.query([[0.0]]),
    lambda tree: tree.query([[np.nan, 0.0]]),
    lambda tree: tree.query([[0.0, 0.0]], k=0),
    lambda tree: tree.query([[0.0, 0.0]], k=[]),
    lambda tree: tree.query([[0.0, 0.0]], k=1.5),
    lambda tree: tree.query([[0.0, 0.0]], p=0.5),
    lambda tree: tree.query([["a", "b"]]),
    lambda tree: tree.query(0.0),
    lambda tree: tree.query_ball_point([[0.0, 0.0]], [1.0, 2.0, 3.0]),
    lambda tree: tree.query_ball_point([[0.0, 0.0]], "r"),
    lambda tree: tree.query_ball_point([[0.0, np.inf]], 1.0),
    lambda tree: tree.query_ball_point([0.0, 0.0, 0.0], 1.0),
    lambda tree: tree.query_ball_tree(None, 1.0),
    lambda tree: tree.query_ball_tree(spatial.cKDTree([[1.0]]), 1.0),
    lambda tree: tree.query_pairs("r"),
    lambda tree: tree.query_pairs(1.0, output_type="list"),
    lambda tree: tree.count_neighbors(tree, [[1.0]]),
    lambda tree: tree.count_neighbors(tree, "r"),
    lambda tree: tree.count_neighbors(tree, [2.0, 1.0], cumulative=False),
    lambda tree: tree.count_neighbors(tree, 1.0, weights=[1.0]),
    lambda tree: tree.count_neighbors(tree, 1.0, weights=([1.0], None)),
    lambda tree: tree.count_neighbors(tree, 1.0, weights=(None, None, None)),
    lambda tree: tree.count_neighbors(spatial.KDTree([[1.0, 2.0]]), 1.0, weights=[1.0, 1.0]),
    lambda tree: tree.sparse_distance_matrix(tree, 1.0, output_type="list"),
    lambda tree: tree.sparse_distance_matrix(None, 1.0),
    lambda tree: tree.query([[0.0, 0.0]], workers=-2),
    lambda tree: tree.query([[0.0, 0.0]], workers=0),
]


def outcome(call, tree):
    try:
        return repr(call(tree))
    except Exception as error:
        return type(error), str(error)


def test_errors_are_those_of_scipy():
    """None of both raises, or both raise the same."""
    trees = both("KDTree", [[0.0, 0.0], [1.0, 1.0]])
    for call in CALLS:
        theirs, own = (outcome(call, tree) for tree in trees)
        assert own == theirs


RANKS = [[0], [1, 0], (0, 3), [-1], [1, -2], np.array([0]), np.array([0.5]), np.array([np.nan]),
         np.array([2**63], np.uint64), [False]]  # fmt: skip


@pytest.mark.parametrize("name, n", [("KDTree", 0), ("cKDTree", 2), ("KDTree", 3000)])
def test_ranks_below_1_are_refused(name, n):
    """SciPy crashes, or returns what was in memory: it reads the entry before its results."""
    tree = getattr(ours, name)(np.zeros((n, 2)))
    for k, x in itertools.product(RANKS, ([0.0, 0.0], [[0.0, 0.0]], np.empty((0, 2)))):
        for options in ({}, {"p": 1}, {"eps": 0.1}, {"distance_upper_bound": -1.0}):
            with pytest.raises(ValueError, match="k must be 1 or more"):
                tree.query(x, k, **options)


# ---- exact decisions -----------------------------------------------------------------------


def square(a, b):
    return sum((Fraction(y) - Fraction(x)) ** 2 for x, y in zip(a.tolist(), b.tolist()))


def a_scene_where_scipy_is_wrong(inside):
    """Two points and a radius on whose wrong side rounding puts them."""
    draw = np.random.default_rng(7)
    while True:
        points = draw.integers(0, 100, (2, 3)) / 10.0
        r = float(np.sqrt(((points[1] - points[0]) ** 2).sum()))
        is_inside = square(*points) <= Fraction(r) ** 2
        theirs = spatial.KDTree(points)
        if is_inside == inside and (theirs.query_pairs(r) == set()) == inside:
            return points, r


@pytest.mark.parametrize("inside", [False, True])
def test_where_rounding_decides_ours_is_right(inside):
    points, r = a_scene_where_scipy_is_wrong(inside)
    theirs, tree = both("KDTree", points)
    assert (len(theirs.query_pairs(r)) == 1) is not inside
    assert (len(tree.query_pairs(r)) == 1) is inside
    assert len(tree.query_pairs(r, output_type="ndarray")) == inside
    assert tree.query_ball_point(points[0], r) == ([0, 1] if inside else [0])
    assert tree.query_ball_tree(tree, r)[1] == ([0, 1] if inside else [1])
    assert tree.count_neighbors(tree, r) == 2 + 2 * inside
    shells = tree.count_neighbors(tree, [0.0, r, 2 * r], cumulative=False)
    assert shells.tolist() == [2, 2 * inside, 2 - 2 * inside]
    weighted = tree.count_neighbors(tree, [0.0, r], weights=[2.0, 3.0], cumulative=False)
    assert weighted.tolist() == [13.0, 12.0 * inside]
    assert tree.sparse_distance_matrix(tree, r).nnz == 2 + 2 * inside


def test_few_queries_of_a_lattice_are_decided_exactly():
    """Those for which the tree finds candidates; against fractions, at every radius of a shell."""
    points = np.stack(np.meshgrid(*[0.1 * np.arange(12)] * 3), -1).reshape(-1, 3)
    theirs, tree = both("KDTree", points)
    queries = points[[0, 700, 1000]]
    differ = 0
    for r in (0.1, 0.2, 0.30000000000000004, 0.3, 0.1 * 2**0.5, 0.1 * 3**0.5, 0.1 * 6**0.5):
        rows = tree.query_ball_point(queries, r)
        for query, row in zip(queries, rows):
            close = np.flatnonzero(((points - query) ** 2).sum(1) < (r + 0.01) ** 2)
            exact = [k for k in close.tolist() if square(query, points[k]) <= Fraction(r) ** 2]
            assert row == exact
            assert tree.query_ball_point(query, r) == exact
            differ += exact != sorted(theirs.query_ball_point(query, r))
        radii = np.array([r, 0.1, 0.2])
        assert tree.query_ball_point(queries, radii).tolist() == [
            tree.query_ball_point(one, radius) for one, radius in zip(queries, radii.tolist())
        ]
    assert differ > 0
    for query in queries:
        i = tree.query(query, 40)[1]
        close = sorted(range(len(points)), key=lambda k: (square(query, points[k]), k))
        assert i.tolist() == close[:40]


def _corners() -> np.ndarray:
    """Points at the corners of a box of two, many at each."""
    return np.random.default_rng(0).integers(0, 2, (40, 2)).astype(float)


@pytest.mark.parametrize("return_sorted", [None, False, True])
def test_lists_ascend_where_scipy_answers(return_sorted):
    tree = ours.cKDTree(_corners(), boxsize=2.0)  # from half a period on
    lists = [
        tree.query_ball_point([0.0, 0.0], 1.0, return_sorted=return_sorted),
        *tree.query_ball_point(_corners(), 1.0, return_sorted=return_sorted),
        *tree.query_ball_tree(tree, 1.0),
    ]
    assert all(row == sorted(row) for row in lists)


def test_ties_ascend_up_to_a_bound_of_half_a_period():
    tree = ours.cKDTree(_corners(), boxsize=2.0)
    d, j = tree.query([[0.0, 0.0]], 40, distance_upper_bound=1.0)
    there = j[d == 0.0]
    assert len(there) > 5
    assert there.tolist() == sorted(there)
    assert (j[d > 0.0] == 40).all()


def test_what_is_just_below_half_a_period_is_closer_than_that():
    points = [[0.0, 0.0], [3.0, 4.0 - 2.0**-51]]  # less than 5 apart, but that is what it rounds to
    tree = ours.KDTree(points, boxsize=10.0)
    d, j = tree.query([[0.0, 0.0]], 2, distance_upper_bound=5.0)
    assert j.tolist() == [[0, 1]]
    assert d[0, 1] <= 5.0


@pytest.mark.parametrize("ndim", [1, 3, 8, 9, 400])
def test_more_neighbours_than_are_within_half_a_period_are_those_of_scipy(rng, ndim):
    theirs, tree = both("KDTree", rng.random((12, ndim)), boxsize=1.0)
    for k in (1, 2, 6, 12, 14):
        alike(tree.query(theirs.data, k), theirs.query(theirs.data, k))


@pytest.mark.parametrize("boxsize", [None, 1.0])
def test_numbers_of_neighbours_beyond_any_memory_are_refused(rng, boxsize):
    for tree in both("KDTree", rng.random((12, 3)), boxsize=boxsize):
        with pytest.raises(ValueError):
            tree.query(tree.data, 10**400)
