# SPDX-License-Identifier: BSD-3-Clause
"""Several cutoffs in one search: each pair is in the innermost shell that holds it, exactly."""

import bisect
import math
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from calls import call
from halfshell._check.reference import exact_square
from oracles import BOX_KINDS, LATTICES, lattice, random_scene, same_arrays


def assert_shells(points, cutoffs, box=None, inclusive=True, **how):
    """The pairs are those of the last cutoff; k and d agree with the fractions. Returns k."""
    options = {"box": box, "inclusive": inclusive, "sort": True, **how}
    i, j, S, d, k = call(hs.pairs, points, cutoffs, quantities="ijSdk", **options)
    plain = call(hs.pairs, points, float(cutoffs[-1]), quantities="ijSd", **options)
    for got, wanted in zip((i, j, S), plain[:3], strict=True):
        assert got.tobytes() == wanted.tobytes()
    squares = [Fraction(float(c)) ** 2 for c in cutoffs]
    place = bisect.bisect_left if inclusive else bisect.bisect_right
    x = np.asarray(points)
    rows = None if box is None else np.diag(box) if np.ndim(box) == 1 else box
    expected = [
        place(squares, exact_square(x, a, b, s, rows))
        for a, b, s in zip(i.tolist(), j.tolist(), S.tolist(), strict=True)
    ]
    assert k.dtype == np.int32
    assert k.shape == i.shape
    assert k.tolist() == expected
    # A distance does not contradict the shell, and is moved by an ulp at most for that.
    side = "left" if inclusive else "right"
    assert np.array_equal(np.searchsorted(cutoffs, d, side), k)
    assert (np.abs(d - plain[3]) <= np.spacing(plain[3])).all()
    return k


def beside(cutoffs):
    """Each of them, and both of its neighbours."""
    below = [math.nextafter(c, 0.0) for c in cutoffs]
    above = [math.nextafter(c, math.inf) for c in cutoffs]
    return np.array(sorted({*cutoffs, *below, *above}))


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_edges_on_distances_and_beside_them(kind, rng):
    for inclusive in (True, False):
        points, cutoff, box, _ = random_scene(rng, 40, kind=kind, neighbours=20, spread=2)
        d = np.sort(hs.pairs(points, cutoff, box=box, quantities="d"))
        edges = beside(d[:: max(1, len(d) // 40)].tolist())
        assert_shells(points, edges, box, inclusive)


@pytest.mark.parametrize("name", LATTICES)
def test_shells_of_a_crystal(name):
    for inclusive in (True, False):
        points, box = lattice(name, (2, 2, 2))
        cutoff = 1.1 * np.abs(box).max()
        squares = np.unique(np.round(hs.pairs(points, cutoff, box=box, quantities="d") ** 2, 9))
        edges = np.sqrt(squares)
        assert len(edges) > 1
        assert len(set(assert_shells(points, beside(edges), box, inclusive).tolist())) >= len(edges)


@pytest.mark.parametrize("ndim", range(1, 9))
def test_any_dimension_float32_mixed_axes_and_many_images(ndim, rng):
    points = rng.integers(-6, 7, (14, ndim)).astype(np.float32) / np.float32(4)
    length = 1.25 if ndim < 4 else 3.0
    edges = np.sqrt(np.arange(0, 17 if ndim < 4 else 13)) / 4
    for periodic in (False, True, [True] + [False] * (ndim - 1)):
        box = np.full(ndim, length)
        for inclusive in (True, False):
            assert_shells(points, edges, box, inclusive, periodic=periodic)


def test_few_pairs_none_and_no_points():
    for n in (0, 1):
        for box in (None, np.full(3, 9.0)):
            k = hs.pairs(np.zeros((n, 3)), [1.0, 2.0], quantities="k", box=box)
            assert k.shape == (0,)
            assert k.dtype == np.int32
    assert hs.pairs([[0.0], [0.0]], [0.0], quantities="k").tolist() == [0]
    assert hs.pairs([[0.0], [0.0]], [0.0, 0.0, 1.0], quantities="k").tolist() == [0]
    strict = hs.pairs([[0.0], [0.0]], [0.0, 0.0, 1.0], quantities="k", inclusive=False)
    assert strict.tolist() == [2]
    assert hs.pairs([[0.0], [1.0]], [1.0, 1.0, 2.0], quantities="k", inclusive=False) == [2]
    assert hs.pairs([[0.0]], [1.0, 2.0, 3.0], box=1.0, quantities="k").tolist() == [0, 1, 2]


@pytest.mark.parametrize("scale", [1e-310, 1e-200, 2.0**-1040, 1e150, 1e300])
def test_very_small_and_very_large(scale, rng):
    points = rng.integers(0, 5, (30, 2)) * scale
    edges = np.array([0.0, 1e-5, 1.0, 1.5, 2.0, 3.0]) * scale
    assert_shells(points, edges)
    assert_shells(points, edges, inclusive=False)
    assert_shells(points, edges, np.full(2, 5 * scale))


def test_points_far_apart_and_edges_of_any_size(rng):
    points = np.concatenate([rng.random((20, 3)), 1e12 + rng.random((20, 3)) * 4])
    edges = np.array([1e-300, 1e-20, 0.25, 0.5, 0.5, 1.0])
    assert_shells(points, edges)
    assert_shells(rng.random((9, 3)), np.array([0.5, 1e100, 1.7e308]))
    assert_shells(rng.random((9, 3)) * 1e-9, np.array([1e-12, 5e-10, 1e300]))


def test_many_edges_and_equal_ones(rng):
    points = rng.random((60, 3)) * 3
    d = np.sort(hs.pairs(points, 2.0, quantities="d"))
    assert_shells(points, d)
    assert_shells(points, np.repeat(d[::20], 3))
    assert_shells(points, np.concatenate([[0.0, 0.0], np.linspace(1e-9, 1e-8, 50), d[:300:7]]))


def test_any_letters_order_and_place(rng):
    for quantities in ("k", "ik", "ijdDSPk", "kd", "Pk", "Dk"):
        points, cutoff, box, _ = random_scene(rng, 300)
        edges = np.linspace(0.3, 1.0, 4) * cutoff
        for sort in (False, True):
            options = {"box": box, "sort": sort}
            whole = dict(
                zip("ijdDSPk", call(hs.pairs, points, edges, quantities="ijdDSPk", **options))
            )
            found = call(hs.pairs, points, edges, quantities=quantities, **options)
            found = found if isinstance(found, tuple) else (found,)
            for letter, array in zip(quantities, found, strict=True):
                assert array.tobytes() == whole[letter].tobytes()
            out = tuple(np.empty((len(a) + 9, *a.shape[1:]), a.dtype) for a in found)
            filled = call(hs.pairs, points, edges, quantities=quantities, out=out, **options)
            filled = filled if isinstance(filled, tuple) else (filled,)
            for got, wanted in zip(filled, found, strict=True):
                assert got.tobytes() == wanted.tobytes()


def test_same_bytes_for_each_kernel_number_of_threads_and_way(rng):
    for kernel in hs.kernels():
        points, box = rng.random((3000, 3)), np.ones(3)
        edges = np.array([0.05, 0.1, 0.15])
        whole = call(
            hs.pairs, points, edges, box=box, quantities="ijdSk", kernel="scalar", threads=1
        )
        for threads in (1, 2, 3):
            options = {"quantities": "ijdSk", "threads": threads}
            with hs.settings(kernel=kernel):
                cells = hs.CellList(points, 0.2, box=box)
                listed = cells.pairs(edges, sort=True, **options)
                ascending = hs.pairs(points, edges, box=box, sort=True, **options)
                blocks = list(hs.iter_pairs(points, edges, box=box, max_pairs=70_001, **options))
                of_cells = list(cells.iter_pairs(edges, max_pairs=20_001, **options))
                unsorted = cells.pairs(edges, **options)
                plain = hs.pairs(points, edges, box=box, **options)
            for column, wanted in enumerate(plain):
                assert wanted.tobytes() == whole[column].tobytes()
                assert np.concatenate([b[column] for b in blocks]).tobytes() == wanted.tobytes()
                assert listed[column].tobytes() == ascending[column].tobytes()
                joined = np.concatenate([b[column] for b in of_cells])
                assert joined.tobytes() == unsorted[column].tobytes()


def test_each_algorithm(rng):
    points, edges = rng.random((200, 2)), np.array([0.05, 0.1, 0.2])
    how = {"quantities": "ijk", "sort": True}
    for algorithm in ("all-pairs", "grid", "hash", "hierarchy"):
        found = call(hs.pairs, points, edges, algorithm=algorithm, **how)
        assert same_arrays(found, call(hs.pairs, points, edges, **how))


def test_blocks_keep_their_edges(rng):
    points, edges = rng.random((4000, 3)), np.array([0.05, 0.1, 0.2])
    expected = hs.pairs(points, edges.copy(), quantities="k")
    blocks = hs.iter_pairs(points, edges, quantities="k", max_pairs=1000)
    edges[:] = 0.0
    assert np.array_equal(np.concatenate(list(blocks)), expected)


POINTS = [[0.0, 0.0], [1.0, 0.0]]


@pytest.mark.parametrize(
    ("how", "error", "message"),
    [
        ({"cutoff": 1.0}, ValueError, "k in quantities needs several cutoffs, got one"),
        ({"cutoff": 1}, ValueError, "k in quantities needs several cutoffs, got one"),
        ({"cutoff": []}, ValueError, r"shape \(k,\), with one at least, got \(0,\)"),
        ({"cutoff": [[1.0]]}, ValueError, r"a table of cutoffs needs types"),
        ({"cutoff": [2.0, 1.0]}, ValueError, r"ascending, got cutoff\[0\] = 2.0 before"),
        ({"cutoff": [1.0, np.nan]}, ValueError, r"finite and not negative, got cutoff\[1\]"),
        ({"cutoff": [-1.0, 1.0]}, ValueError, r"finite and not negative, got cutoff\[0\]"),
        ({"cutoff": ["1", "2"]}, TypeError, "cutoff must hold real numbers"),
        ({"cutoff": None}, TypeError, "cutoff must be a number, got NoneType"),
        (
            {"cutoff": {(0, 0): 1.0}, "types": [0, 0]},
            ValueError,
            "with radii, supports or cutoffs by",
        ),
        ({"radii": [1.0, 1.0]}, ValueError, "several cutoffs cannot be combined with radii"),
        ({"supports": [np.eye(2)] * 2}, ValueError, "combined with supports"),
        ({"batch": [0, 0]}, ValueError, "cannot be combined with a batch"),
        ({"precision": "double"}, ValueError, "needs precision 'exact', got 'double'"),
        ({"precision": "single"}, ValueError, "needs precision 'exact', got 'single'"),
    ],
)
def test_what_does_not_go_together(how, error, message):
    with pytest.raises(error, match=message):
        call(hs.pairs, POINTS, **{"cutoff": [1.0, 2.0], "quantities": "ijk", **how})


def test_several_cutoffs_need_the_letter():
    message = "cutoff must be a number; several are for count_pairs and the letter k of pairs"
    cells = hs.CellList(POINTS, 2.0)
    for cutoffs in ([1.0, 2.0], (1.0,), np.array([1.0, 2.0])):
        for search in (
            lambda c: hs.pairs(POINTS, c),
            lambda c: hs.iter_pairs(POINTS, c),
            cells.pairs,
            cells.iter_pairs,
        ):
            with pytest.raises(TypeError, match=message):
                search(cutoffs)
    for search in (cells.pairs, cells.iter_pairs):
        with pytest.raises(ValueError, match="needs several cutoffs, got one"):
            search(1.0, quantities="k")
        with pytest.raises(ValueError, match="needs several cutoffs, got one"):
            search(quantities="k")


def test_other_functions_do_not_know_the_letter():
    with pytest.raises(ValueError, match="some of the letters j d D S, each"):
        hs.neighbors(POINTS, 1.0, quantities="jk")
    with pytest.raises(ValueError, match="some of the letters i j d D S P, each"):
        hs.pairs_between(POINTS, POINTS, 1.0, quantities="ijk")
    with pytest.raises(ValueError, match="some of the letters i j d D S P, each"):
        hs.explain(POINTS, 1.0, quantities="ijk")


def test_shells_are_refused_where_they_do_not_fit():
    points = np.zeros((3000, 2))
    with pytest.raises(MemoryError):
        call(hs.pairs, points, [1.0, 2.0], quantities="k", memory_limit=1e6)
    with pytest.raises(MemoryError):
        call(hs.pairs, POINTS, np.linspace(0, 1, 10**6), quantities="k", memory_limit=1e6)
