# SPDX-License-Identifier: BSD-3-Clause
"""Several cutoffs in one search: each pair is in the innermost shell that holds it, exactly."""

import bisect
import io
import math
import pickle
from fractions import Fraction

import numpy as np
import pytest

import halfshell as hs
from calls import call
from halfshell._check.reference import exact_square
from oracles import BOX_KINDS, random_scene, same_arrays


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
    shells = found_of((i, j, S, k))
    scene = {"box": box, "inclusive": inclusive, **how}
    assert_rows(points, cutoffs, shells, place(squares, 0), scene)
    return k


def assert_rows(points, cutoffs, shells, own, options):
    """Rows of points and of queries have the shells of the pairs, by which they are counted."""
    back = {(j, i, tuple(-s for s in S)): k for (i, j, S), k in shells.items()}
    shells = {**shells, **back}
    n, side = len(points), "left" if options["inclusive"] else "right"
    counts = np.zeros((len(cutoffs), n), np.int64)
    for (i, _, _), k in shells.items():
        counts[k:, i] += 1
    table = call(hs.neighbors, points, cutoffs, quantities="kjdS", **options)
    assert found_of(table.to_pairs(quantities="ijSk")) == shells
    assert np.array_equal(np.searchsorted(cutoffs, table.distances, side), table.shells)
    assert call(hs.neighbors, points, cutoffs, quantities="k", **options).shells.tobytes() == (
        table.shells.tobytes()
    )
    assert np.array_equal(call(hs.coordination, points, cutoffs, **options), counts)
    some = np.arange(n)[:: -3 if n < 400 else -40]
    rows = call(hs.neighbors, points, cutoffs, quantities="jSk", indices=some, **options)
    i, *rest = rows.to_pairs(quantities="ijSk")
    assert found_of((some[i], *rest)) == {e: k for e, k in shells.items() if e[0] in some}
    of_some = call(hs.coordination, points, cutoffs, indices=some, **options)
    assert np.array_equal(of_some, counts[:, some])
    half = found_of(call(hs.pairs, points, cutoffs, quantities="ijSk", indices=some, **options))
    zero = (0,) * np.shape(points)[1]
    assert half == {
        (i, j, S): k for (i, j, S), k in shells.items()
        if (i in some or j in some) and (i < j or (i == j and S > zero))
    }  # fmt: skip
    both = found_of(call(hs.pairs_between, points, points, cutoffs, quantities="ijSk", **options))
    if own < len(cutoffs):
        shells |= {(i, i, zero): own for i in range(n)}
    assert both == shells


def found_of(columns):
    i, j, S, k = (column.tolist() for column in columns)
    found = dict(zip(zip(i, j, map(tuple, S)), k))
    assert len(found) == len(i)
    return found


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
                rows = hs.neighbors(points, edges, box=box, quantities="jdSk", threads=threads)
                kept = cells.neighbors(edges, quantities="jdSk", threads=threads)
                narrow = hs.neighbors(points, edges, box=box, quantities="k", threads=threads)
                between = hs.pairs_between(points, points, edges, box=box, **options)
                of_cells = list(cells.iter_pairs(edges, max_pairs=20_001, **options))
                unsorted = cells.pairs(edges, **options)
                plain = hs.pairs(points, edges, box=box, **options)
            halves = rows.to_pairs(quantities="ijdSk", half=True)
            assert narrow.shells.tobytes() == rows.shells.tobytes()
            apart = (between[0] != between[1]) | between[3].any(axis=1)
            for column, letter in enumerate("ijdSk"):
                assert halves[column].tobytes() == ascending[column].tobytes()
                assert same_arrays(rows.to_pairs(quantities=letter), between[column][apart])
                assert same_arrays(
                    rows.to_pairs(quantities=letter), kept.to_pairs(quantities=letter)
                )
            for column, wanted in enumerate(plain):
                assert wanted.tobytes() == whole[column].tobytes()
                assert np.concatenate([b[column] for b in blocks]).tobytes() == wanted.tobytes()
                assert listed[column].tobytes() == ascending[column].tobytes()
                joined = np.concatenate([b[column] for b in of_cells])
                assert joined.tobytes() == unsorted[column].tobytes()


POINTS = [[0.0, 0.0], [1.0, 0.0]]


@pytest.mark.parametrize(
    ("how", "error", "message"),
    [
        ({"cutoff": 1.0}, ValueError, "k in quantities needs several cutoffs, got one"),
        ({"cutoff": []}, ValueError, r"shape \(k,\), with one at least, got \(0,\)"),
        ({"cutoff": [[1.0]]}, ValueError, r"a table of cutoffs needs types"),
        ({"cutoff": [2.0, 1.0]}, ValueError, r"ascending, got cutoff\[0\] = 2.0 before"),
        ({"cutoff": [-1.0, 1.0]}, ValueError, r"finite and not negative, got cutoff\[0\]"),
        (
            {"cutoff": {(0, 0): 1.0}, "types": [0, 0]},
            ValueError,
            "with radii, supports or cutoffs by",
        ),
        ({"radii": [1.0, 1.0]}, ValueError, "several cutoffs cannot be combined with radii"),
        ({"supports": [np.eye(2)] * 2}, ValueError, "combined with supports"),
        ({"batch": [0, 0]}, ValueError, "cannot be combined with a batch"),
        ({"precision": "double"}, ValueError, "needs precision 'exact', got 'double'"),
    ],
)
def test_what_does_not_go_together(how, error, message):
    with pytest.raises(error, match=message):
        call(hs.pairs, POINTS, **{"cutoff": [1.0, 2.0], "quantities": "ijk", **how})


def test_several_cutoffs_need_the_letter():
    message = "cutoff must be a number; several are for counts and the letter k in quantities"
    cells = hs.CellList(POINTS, 2.0)
    for cutoffs in ([1.0, 2.0], (1.0,), np.array([1.0, 2.0])):
        for search in (
            lambda c: hs.pairs(POINTS, c),
            lambda c: hs.iter_pairs(POINTS, c),
            lambda c: hs.neighbors(POINTS, c),
            lambda c: hs.pairs_between(POINTS, POINTS, c),
            lambda c: list(hs.trajectory_pairs([POINTS], c)),
            lambda c: hs.clusters(POINTS, c),
            lambda c: hs.for_each_pair(POINTS, c, print),
            lambda c: hs.verify(POINTS, c, [], []),
            lambda c: hs.explain(POINTS, c),
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


def test_the_letter_needs_several_cutoffs_everywhere():
    for search in (
        lambda: hs.neighbors(POINTS, 1.0, quantities="jk"),
        lambda: hs.neighbors(POINTS, 1.0, quantities="jk", indices=[0]),
        lambda: hs.pairs_between(POINTS, POINTS, 1.0, quantities="ijk"),
        lambda: hs.explain(POINTS, 1.0, quantities="ijk"),
        lambda: list(hs.trajectory_pairs([POINTS], 1.0, quantities="ijk")),
    ):
        with pytest.raises(ValueError, match="k in quantities needs several cutoffs, got one"):
            search()
    with pytest.raises(ValueError, match="some of the letters j d D S, each"):
        hs.nearest(POINTS, 1, quantities="jk")
    for known in ({"radii": [1.0, 1.0]}, {"supports": [np.eye(2)] * 2}):
        with pytest.raises(ValueError, match="several cutoffs cannot be combined with"):
            hs.neighbors(hs.Points(POINTS, **known), [1.0, 2.0], quantities="jk")


def test_tables_keep_their_shells(rng):
    points, edges = rng.random((50, 3)), np.array([0.2, 0.3, 0.5])
    table = hs.neighbors(points, edges, box=1.0, quantities="jdSk")
    other = pickle.loads(pickle.dumps(table))
    file = io.BytesIO()
    table.save(file)
    file.seek(0)
    stored = hs.NeighborTable.load(file)
    assert table.shells.tobytes() == other.shells.tobytes() == stored.shells.tobytes()
    for one in (table, other, stored):
        ordered = one.sort()
        assert (np.diff(ordered.to_padded(fill=9, quantity="k"), axis=1) >= 0).all()
        inner = ordered.filter(ordered.shells < 2)
        expected = hs.neighbors(points, 0.3, box=1.0, quantities="jdS").sort()
        assert inner.indices.tobytes() == expected.indices.tobytes()
        assert inner[7:9].shells.tolist() == [k for row in (7, 8) for k in inner[row][3].tolist()]
    assert table.shells[table.reverse()].tobytes() == table.shells.tobytes()
    assert np.array_equal(table.sum(table.shells <= 1), hs.coordination(points, edges, box=1.0)[1])
    with pytest.raises(AttributeError, match="no shells: request them with a 'k' in quantities"):
        expected.shells  # noqa: B018


def test_frames_have_their_shells(rng):
    frames, edges = rng.random((3, 1500, 3)), [0.05, 0.1]
    for how in ({}, {"skin": None}, {"skin": None, "threads": 2}, {"indices": [4, 7]}):
        found = hs.trajectory_pairs(frames, edges, box=1.0, sort=True, quantities="ijk", **how)
        some = {"indices": how["indices"]} if "indices" in how else {}
        for frame, columns in zip(frames, found, strict=True):
            right = hs.pairs(frame, edges, box=1.0, sort=True, quantities="ijk", **some)
            assert same_arrays(columns, right)


def test_counts_of_several_cutoffs(rng):
    edges = [0.1, 0.2, 0.4]
    points = hs.Points(rng.random((60, 3)), box=1.0, types=rng.integers(0, 3, 60))
    by_type = hs.coordination(points, edges, by_type=True)
    assert by_type.shape == (3, 60, 3)
    assert np.array_equal(by_type.sum(axis=2), hs.coordination(points, edges))
    for k, cutoff in enumerate(edges):
        assert np.array_equal(by_type[k], hs.coordination(points, cutoff, by_type=True))
    assert hs.coordination(points, []).shape == (0, 60)
    assert hs.coordination(points, [0.3]).shape == (1, 60)
    assert hs.coordination(points, [], by_type=True, indices=[3]).shape == (0, 1, 3)
    balls = points.replace(types=None, radii=rng.random(60))
    for k, cutoff in enumerate(edges):
        assert np.array_equal(hs.coordination(balls, edges)[k], hs.coordination(balls, cutoff))
    told = []
    hs.coordination(points, edges, progress=told.append)
    assert told == sorted(told) and (not told or told[-1] == 1.0)


def test_shells_are_refused_where_they_do_not_fit():
    points = np.zeros((3000, 2))
    with pytest.raises(MemoryError):
        call(hs.pairs, points, [1.0, 2.0], quantities="k", memory_limit=1e6)
    with pytest.raises(MemoryError):
        call(hs.pairs, POINTS, np.linspace(0, 1, 10**6), quantities="k", memory_limit=1e6)
