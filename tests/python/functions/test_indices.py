# SPDX-License-Identifier: BSD-3-Clause
"""Only some of the points: their rows, and the pairs that have one of them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import halfshell as hs
from calls import call
from halfshell._check.reference import reference_pairs
from oracles import BOX_KINDS, as_set, random_scene
from scene_strategies import scenes


def same(table, whole, numbers):
    assert table.n_rows == len(numbers) and table.n_points == whole.n_points
    for k, number in enumerate(numbers):
        for ours, theirs in zip(table[k], whole[number], strict=True):
            assert ours.dtype == theirs.dtype and ours.tobytes() == theirs.tobytes()


@given(scenes(), st.data())
def test_rows_are_those_of_the_whole_table(scene, data):
    n = len(scene.points)
    some = st.lists(st.integers(0, n - 1), max_size=8) if n else st.just([])
    numbers = data.draw(some)
    how = {"box": scene.box, "periodic": scene.periodic, "inclusive": scene.inclusive}
    whole = call(hs.neighbors, scene.points, scene.cutoff, quantities="jdDS", **how)
    table = call(
        hs.neighbors, scene.points, scene.cutoff, quantities="jdDS", indices=numbers, **how
    )
    same(table, whole, numbers)
    same(table.sort(), whole.sort(), numbers)
    cells = hs.CellList(scene.points, scene.cutoff, box=scene.box, periodic=scene.periodic)
    how_cells = {"inclusive": scene.inclusive, "indices": numbers}
    table = cells.neighbors(quantities="jdDS", **how_cells)
    same(table, whole, numbers)
    same(table.sort(), whole.sort(), numbers)
    assert cells.coordination(**how_cells).tolist() == whole.counts[numbers].tolist()
    counts = call(hs.coordination, scene.points, scene.cutoff, indices=numbers, **how)
    assert counts.dtype == np.int64 and counts.tolist() == whole.counts[numbers].tolist()


def test_many_images_and_equal_points(rng):
    points = np.repeat(rng.random((40, 3)), 3, axis=0).astype(np.float32)
    numbers, box = rng.integers(0, 120, 50), [0.9, 1.1, 0.7]
    for kernel, threads in zip(hs.kernels(), (1, 3, 1, 3)):
        how = {"box": box, "kernel": kernel, "threads": threads}
        whole = call(hs.neighbors, points, 1.3, quantities="jDSd", **how)
        how["indices"] = numbers
        same(call(hs.neighbors, points, 1.3, quantities="jDSd", **how), whole, numbers)
        bare = call(hs.neighbors, points, 1.3, quantities="S", index_dtype=np.int32, **how)
        assert np.array_equal(bare.shifts, np.concatenate([whole[k][2] for k in numbers]))
        lacking = call(hs.neighbors, points, 1.3, quantities="jd", **how)
        del how["indices"]
        same(
            lacking.sort(), call(hs.neighbors, points, 1.3, quantities="jd", **how).sort(), numbers
        )


def test_radii_of_their_own(rng):
    for rule in ("sum", "mean", "max", "min", "gather", "scatter"):
        for inclusive in (True, False):
            points, radii = rng.random((60, 2)), np.where(rng.random(60) < 0.3, 0.0, 0.4)
            how = {"radii": radii, "rule": rule, "box": [1.0, 1.0], "inclusive": inclusive}
            whole = call(hs.neighbors, points, None, quantities="jd", **how)
            numbers = rng.permutation(60)[:30]
            same(
                call(hs.neighbors, points, None, quantities="jd", indices=numbers, **how),
                whole,
                numbers,
            )
            counts = call(hs.coordination, points, None, indices=numbers, **how)
            assert np.array_equal(counts, whole.counts[numbers])


def test_types_that_do_not_see_themselves(rng):
    points, types = rng.random((50, 3)), rng.integers(0, 2, 50)
    cutoffs = {(0, 1): 0.4, (1, 1): 0.9}  # none between two of type 0
    how = {"types": types, "box": 1.0}
    whole = call(hs.neighbors, points, cutoffs, quantities="jS", **how)
    numbers = np.arange(50)
    same(
        call(hs.neighbors, points, cutoffs, quantities="jS", indices=numbers, **how), whole, numbers
    )


def test_supports_of_their_own(rng):
    points = rng.random((40, 2))
    H = np.tile(np.diag([4.0, 2.0]), (40, 1, 1))
    how = {"supports": H, "extent": 1.0, "rule": "gather"}
    whole = call(hs.neighbors, points, None, quantities="jd", **how)
    same(call(hs.neighbors, points, None, quantities="jd", indices=[5, 3], **how), whole, [5, 3])


def test_nothing_is_within_an_open_cutoff_of_zero():
    points = np.zeros((3, 2))
    assert hs.coordination(points, 0.0, inclusive=False, indices=[1]).tolist() == [0]
    assert hs.coordination(points, 0.0, indices=[1, 1]).tolist() == [2, 2]
    empty = hs.neighbors(np.empty((0, 3)), 1.0, indices=[])
    assert empty.shape == (0, 0) and hs.neighbors(points, 1.0, indices=[]).shape == (0, 3)


@pytest.mark.parametrize(
    ("wrong", "error", "said"),
    [
        ([3], ValueError, "indices must be numbers of points, from 0 to 2"),
        ([-1], ValueError, "indices must be numbers of points"),
        ([0.5], TypeError, "indices must hold integers"),
        ([True], TypeError, "indices must hold integers"),
        ([[0]], ValueError, "indices must have shape"),
    ],
)
def test_wrong_indices(wrong, error, said):
    points = np.zeros((3, 2))
    cells = hs.CellList(points, 1.0)
    for search in (hs.neighbors, hs.coordination):
        with pytest.raises(error, match=said):
            search(points, 1.0, indices=wrong)
    for search in (cells.neighbors, cells.coordination):
        with pytest.raises(error, match=said):
            search(indices=wrong)
        with pytest.raises(ValueError, match="do not give queries as well"):
            search(indices=[0], queries=points)


def test_what_does_not_go_with_indices():
    points = np.zeros((3, 2))
    with pytest.raises(ValueError, match="do not give queries as well"):
        hs.neighbors(points, 1.0, indices=[0], queries=points)
    with pytest.raises(ValueError, match="cannot be combined with precision 'single'"):
        call(hs.coordination, points, 1.0, indices=[0], precision="single")
    with pytest.raises(ValueError, match="letters"):
        hs.neighbors(points, 1.0, indices=[0], quantities="jj")
    with pytest.raises(ValueError, match="letters"):
        hs.neighbors(points, 1.0, indices=[0], quantities="i")
    table = hs.neighbors(points, 1.0, indices=[0], quantities="jd")
    with pytest.raises(ValueError, match="one set of points"):
        table.reverse()
    with pytest.raises(ValueError, match="read-only"):
        table.indices[0] = 7


# ---- pairs -------------------------------------------------------------------------------------


LETTERS = "ijdDSP"


def choices(n):
    """Some points, none and all, in any order."""
    some = [[], [0], [n - 1], list(range(n))[::-1], list(range(0, n, 3)), [2, 0, 5, 1]]
    return [numbers for numbers in some if all(0 <= k < n for k in numbers)]


def touches(i, j, numbers):
    return np.isin(i, numbers) | np.isin(j, numbers)


def assert_part(points, cutoff, numbers, find=hs.pairs, **how):
    """The sorted result has the bytes of the plain list; the other is the same set, in order."""
    whole = call(hs.pairs, points, cutoff, quantities=LETTERS, sort=True, **how)
    part = touches(whole[0], whole[1], numbers)
    options = {"quantities": LETTERS, "indices": numbers}
    found = call(find, points, cutoff, sort=True, **options, **how)
    for got, wanted in zip(found, whole, strict=True):
        assert got.dtype == wanted.dtype
        assert got.shape == wanted[part].shape
        assert got.tobytes() == wanted[part].tobytes()
        assert got.flags.c_contiguous
        assert got.flags.writeable
    i, j, d, D, S, P = call(find, points, cutoff, **options, **how)
    assert as_set(i, j, S) == as_set(found[0], found[1], found[4])
    assert (P == np.stack([i, j], axis=1)).all()
    order = np.lexsort((*S.T[::-1], j, i))
    for got, wanted in zip((d, D), found[2:4], strict=True):
        assert got[order].tobytes() == wanted.tobytes()


@pytest.mark.parametrize("inclusive", [True, False])
@pytest.mark.parametrize("kind", BOX_KINDS)
def test_boxes_of_every_kind_with_many_images(kind, inclusive, rng):
    points, cutoff, box, _ = random_scene(rng, 24, kind=kind, neighbours=8, spread=3)
    for periodic in (True, [True, False, True], False):
        for times in (1.0, 2.5):
            for numbers in choices(len(points)):
                assert_part(
                    points, times * cutoff, numbers, box=box, periodic=periodic,
                    inclusive=inclusive,
                )  # fmt: skip


@pytest.mark.parametrize("ndim", range(1, 9))
def test_pairs_are_those_of_the_fractions(ndim, rng):
    for dtype in (np.float32, np.float64):
        points = (rng.integers(-4, 5, (12, ndim)) / 4).astype(dtype)
        cutoff, length = (0.75, 1.25) if ndim < 5 else (1.0, 2.5)
        for box in (None, np.full(ndim, length)):
            expected = reference_pairs(points, cutoff, box, None, True)
            for numbers in choices(len(points)):
                found = hs.pairs(points, cutoff, box=box, quantities="ijS", indices=numbers)
                some = set(numbers)
                wanted = {(i, j, S) for i, j, S in expected if i in some or j in some}
                assert as_set(*found) == wanted
                assert_part(points, cutoff, numbers, box=box)


def test_few_points_and_coincident_ones():
    for box in (None, [2.0]):
        for n in (0, 1, 2):
            for numbers in choices(n):
                for cutoff in (0.0, 2.0, 5.0):
                    for inclusive in (True, False):
                        assert_part(np.zeros((n, 1)), cutoff, numbers, box=box, inclusive=inclusive)


def test_points_far_from_each_other_and_from_the_box(rng):
    points = np.concatenate([rng.random((20, 3)), 1e9 + rng.random((20, 3))])
    assert_part(points, 0.5, [1, 30, 7])
    assert_part(points, 0.5, [1, 30, 7], box=[1.0, 1.5, 2.0], periodic=[True, False, True])


@pytest.mark.parametrize("rule", ["sum", "mean", "max", "min"])
def test_radii(rule, rng):
    for inclusive in (True, False):
        points, radii = rng.random((60, 3)) * 2, rng.integers(0, 5, 60) / 8
        for box in (None, np.full(3, 2.0), np.full(3, 0.5)):
            for numbers in choices(60):
                assert_part(
                    points, None, numbers, radii=radii, rule=rule, box=box, inclusive=inclusive
                )


def test_types_and_supports(rng):
    points, types = rng.random((60, 2)) * 3, rng.integers(0, 3, 60)
    table = {(0, 1): 0.5, (1, 1): 1.0, (0, 2): 0.0}
    supports = np.eye(2) * rng.uniform(1.0, 3.0, (60, 1, 1)) + 0.25
    for box in (None, np.full(2, 3.0), np.full(2, 0.75)):
        for numbers in choices(60):
            assert_part(points, table, numbers, types=types, box=box)
            for rule in ("max", "min"):
                assert_part(
                    points, None, numbers, supports=supports, extent=1.0, rule=rule, box=box
                )


def test_same_bytes_for_each_kernel_number_of_threads_and_algorithm(rng):
    for kernel in hs.kernels():
        points, box, numbers = rng.random((3000, 3)), np.ones(3), rng.permutation(3000)[:500]
        wanted = hs.pairs(points, 0.1, box=box, quantities=LETTERS, indices=numbers, threads=1)
        for threads in (1, 2, 3):
            for algorithm in ("auto", "grid", "hash", "all-pairs"):
                found = call(hs.pairs,
                    points, 0.1, box=box, quantities=LETTERS, indices=numbers, threads=threads,
                    kernel=kernel, algorithm=algorithm,
                )  # fmt: skip
                for one, other in zip(found, wanted, strict=True):
                    assert one.tobytes() == other.tobytes()


def test_cells(rng):
    points, cutoff, box, _ = random_scene(rng, 200, neighbours=20)

    def find(points, cutoff, box=None, **how):
        return hs.CellList(points, 1.5 * cutoff, box=box).pairs(cutoff, **how)

    for numbers in choices(200):
        assert_part(points, cutoff, numbers, find, box=box)
        assert_part(points.astype(np.float32), cutoff, numbers, find)
    cells = hs.CellList(points, cutoff, box=box)
    alone = hs.pairs(points, cutoff, box=box, indices=[7], sort=True)
    points[:] = 0.0  # the list has its own
    for one, other in zip(cells.pairs(indices=[7], sort=True), alone, strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("index_dtype", [np.int32, np.int64])
def test_any_letters_and_arrays_of_the_caller(index_dtype, rng):
    for quantities in ("i", "P", "S", "D", "dj", "SPd", "Di"):
        points, cutoff, box, _ = random_scene(rng, 100)
        options = {"box": box, "indices": [5, 9, 0], "index_dtype": index_dtype}
        whole = dict(zip(LETTERS, call(hs.pairs, points, cutoff, quantities=LETTERS, **options)))
        found = call(hs.pairs, points, cutoff, quantities=quantities, **options)
        assert isinstance(found, tuple) == (len(quantities) > 1)
        found = found if isinstance(found, tuple) else (found,)
        for letter, array in zip(quantities, found, strict=True):
            assert array.dtype == whole[letter].dtype
            assert array.tobytes() == whole[letter].tobytes()
        m = len(found[0])
        out = tuple(np.empty((m + 2, *a.shape[1:]), a.dtype) for a in found)
        filled = call(hs.pairs, points, cutoff, quantities=quantities, out=out, **options)
        filled = filled if isinstance(filled, tuple) else (filled,)
        for view, array, wanted in zip(filled, out, found, strict=True):
            assert view.base is array
            assert view.tobytes() == wanted.tobytes()
        small = tuple(array[: m - 1] for array in out)
        with pytest.raises(hs.CapacityError, match=f"there are {m} pairs") as error:
            call(hs.pairs, points, cutoff, quantities=quantities, out=small, **options)
        assert error.value.needed == m
        wrong = tuple(array.astype("c16") for array in out)
        with pytest.raises(TypeError, match="out for"):
            call(hs.pairs, points, cutoff, quantities=quantities, out=wrong, **options)


def test_few_among_many(rng):
    points = rng.random((20_000, 3))
    for numbers in ([7], [11, 3], list(range(0, 20_000, 7))):
        assert_part(points, 0.03, numbers, box=[1.0] * 3)


def test_double_precision_is_that_of_the_plain_list(rng):
    points, cutoff, box, _ = random_scene(rng, 80)
    assert_part(points, cutoff, [4, 9], box=box, precision="double")


def test_a_shift_that_fits_one_way_only():
    points, box = np.array([[0.0], [2.0**31]]), [1.0]
    with pytest.raises(OverflowError):
        hs.pairs(points, 0.25, box=box, quantities="S", indices=[1])
    with pytest.raises(OverflowError, match=r"-2\*\*31 has no opposite"):
        hs.pairs(points[::-1], 0.25, box=box, quantities="S", indices=[1])
    assert hs.pairs(points, 0.25, box=box, indices=[1])[0].tolist() == [0]


POINTS = np.zeros((3, 2))


@pytest.mark.parametrize(
    ("indices", "error", "message"),
    [
        ([3], ValueError, "indices must be numbers of points, from 0 to 2"),
        ([-1], ValueError, "indices must be numbers of points, from 0 to 2"),
        (np.array([2**64 - 1], np.uint64), ValueError, "indices must be numbers of points"),
        ([1, 0, 1], ValueError, "indices must name each point once, got 1 twice"),
        ([1.0], TypeError, "indices must hold integers, got dtype float64"),
        ([True], TypeError, "indices must hold integers, got dtype bool"),
        (["1"], TypeError, "indices must hold integers"),
        ("1", TypeError, "indices"),
        (1, ValueError, r"indices must have shape \(m,\), got \(\)"),
        ([[1]], ValueError, r"indices must have shape \(m,\), got \(1, 1\)"),
    ],
)
def test_bad_numbers(indices, error, message):
    with pytest.raises(error, match=message):
        hs.pairs(POINTS, 1.0, indices=indices)
    with pytest.raises(error, match=message):
        hs.CellList(POINTS, 1.0).pairs(indices=indices)


def test_what_does_not_go_together():
    cells = hs.CellList(POINTS, 2.0)
    for find in (lambda *a, **how: call(hs.pairs, POINTS, *a, **how), cells.pairs):
        with pytest.raises(ValueError, match="indices cannot be combined with several cutoffs"):
            find([1.0, 2.0], indices=[0], quantities="k")
        with pytest.raises(ValueError, match="needs several cutoffs, got one"):
            find(1.0, indices=[0], quantities="k")
        with pytest.raises(ValueError, match="some of the letters i j d D S P, each at most once"):
            find(1.0, indices=[0], quantities="x")
    with pytest.raises(ValueError, match="indices cannot be combined with precision 'single'"):
        call(hs.pairs, POINTS, 1.0, indices=[0], precision="single")
    with pytest.raises(ValueError, match="there are no points"):
        hs.pairs(np.zeros((0, 2)), 1.0, indices=[0])
