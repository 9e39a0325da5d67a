# SPDX-License-Identifier: BSD-3-Clause
"""Many systems in one call: the same as one call for each, one behind the other."""

import ctypes

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import same_arrays

SIZES = [30, 0, 1, 2, 7, 64, 65, 0, 0, 300, 30, 1200, 3, 0]
LETTERS = "ijdDSP"


def systems_of(rng, sizes, skew=0.2, box=True):
    """Systems of these sizes and of a density of about 1, in boxes of their own or in the open."""
    made = []
    for n in sizes:
        edge = max(n, 1) ** (1.0 / 3.0)
        rows = (np.eye(3) + skew * rng.uniform(-1.0, 1.0, (3, 3))) * edge
        made.append(hs.Points(rng.random((n, 3)) * edge, box=rows if box else None))
    return made


def one_by_one(systems, cutoff, quantities=LETTERS, **how):
    """What all of them must give, from single calls."""
    parts, first = [], 0
    for number, points in enumerate(systems):
        own = cutoff[number] if np.ndim(cutoff) else cutoff
        found = hs.pairs(points, own, quantities=quantities, **how)
        moved = [a + a.dtype.type(first) if q in "ijP" else a for a, q in zip(found, quantities)]
        parts.append(moved)
        first += len(points)
    return tuple(map(np.concatenate, zip(*parts, strict=True)))


@pytest.mark.parametrize("box", [False, True])
def test_systems_of_all_sizes(box, rng):
    systems = systems_of(rng, SIZES, box=box)
    if not box:  # in no box even S is there
        systems = [one.replace(box=1e3, periodic=False) for one in systems]
    points = hs.Points.stack(systems)
    for cutoff in (1.4, rng.uniform(0.5, 1.5, len(SIZES))):
        for sort in (False, True):
            how = {"sort": sort, "index_dtype": [np.int64, np.int32][sort]}
            expected = one_by_one(systems, cutoff, **how)
            counts = np.bincount(points.batch[expected[0]], minlength=len(SIZES)).tolist()
            for kernel, threads in zip([*hs.kernels()] * 2, (1, 2, 3, 4, 1, 2)):
                with hs.settings(kernel=kernel, threads=threads):
                    found = hs.pairs(points, cutoff, quantities=LETTERS, **how)
                    assert same_arrays(found, expected)
                    assert hs.count_pairs(points, cutoff).tolist() == counts


@pytest.mark.slow
def test_crowded_systems_keep_their_order_behind_others():
    rng = np.random.default_rng(17)
    systems = [hs.Points(rng.random((n, 1))) for n in (4060, 4200, 4200)]
    expected = one_by_one(systems, 0.3, "ij")
    for threads in (1, 2, 3):
        assert same_arrays(hs.pairs(systems, 0.3, threads=threads), expected)


@pytest.mark.parametrize("options", [
    {"precision": "double"}, {"precision": "single"}, {"inclusive": False},
    {"periodic": [True, False, True]}, {"periodic": False},
])  # fmt: skip
def test_options_hold_for_every_system(rng, options):
    how, flags = dict(options), options.get("periodic", True)
    how.pop("periodic", None)
    systems = [
        hs.Points(np.round(one.positions * 4.0) / 4.0, box=one.box, periodic=flags)
        for one in systems_of(rng, [20, 30, 64, 100], skew=0.0)
    ]  # many at exactly the cutoff
    with hs.settings(precision=how.pop("precision", "exact")):
        expected = one_by_one(systems, 1.25, "ij", **how)
        for threads in (1, 2):
            assert same_arrays(hs.pairs(systems, 1.25, threads=threads, **how), expected)
            counts = hs.count_pairs(systems, 1.25, threads=threads, **how)
            assert counts.sum() == len(expected[0])


def test_many_systems_do_not_depend_on_threads(rng):
    systems = systems_of(rng, rng.integers(0, 60, 10_000), skew=0.0)
    points = hs.Points.stack(systems)
    one = hs.pairs(points, 1.1, quantities="ijS", threads=1)
    for threads in (2, 3, 4):
        assert same_arrays(hs.pairs(points, 1.1, quantities="ijS", threads=threads), one)
    assert (points.batch[one[0]] == points.batch[one[1]]).all()
    counts = np.bincount(points.batch[one[0]], minlength=10_000)
    assert np.array_equal(hs.count_pairs(points, 1.1), counts)
    for s in (17, 4000, 9999):
        i, j = hs.pairs(systems[s], 1.1)
        own, first = points.batch[one[0]] == s, np.searchsorted(points.batch, s)
        assert np.array_equal(one[0][own] - first, i) and np.array_equal(one[1][own] - first, j)


# ---- other functions -------------------------------------------------------------------------


@pytest.mark.parametrize("types", [None, ["O", "Si", "H"]])
def test_g_of_r_is_that_of_all_frames(types, rng):
    systems = systems_of(rng, [30, 0, 8, 64])
    if types:
        systems = [one.replace(types=rng.choice(types, len(one))) for one in systems]
    queries = [one[::3] for one in systems]
    for asked in (None, queries):
        how = {"by_type": types is not None}
        found = hs.rdf(systems, 1.5, 6, queries=asked, **how)
        each = [
            hs.rdf(one, 1.5, 6, queries=asked and asked[k], **how)
            for k, one in enumerate(systems) if len(one)
        ]  # fmt: skip
        expected = sum(each)
        assert np.array_equal(found.counts, expected.counts) and found.types == expected.types
        assert np.allclose(found.g, expected.g, rtol=1e-13, atol=0.0)
        assert np.allclose(found.n, expected.n, rtol=1e-13, atol=0.0)
        assert found.n_frames == len(each) and found.g.max() > 0.5


def test_given_pairs_are_measured_in_the_box_of_their_system(rng):
    systems = systems_of(rng, [30, 0, 8, 64])
    points, order = hs.Points.stack(systems), rng.permutation(10**6)
    i, j, S, d, D = hs.pairs(points, 1.4, quantities="ijSdD")
    order = order[order < len(i)]
    i, j, S, d, D = (column[order] for column in (i, j, S, d, D))
    assert same_arrays(hs.measure(points, i, j, S), (d, D, S))
    some = points.batch[i] != 2  # which has pairs, but none of them
    found = hs.measure(points, i[some], j[some], S[some])
    assert same_arrays(found, (d[some], D[some], S[some]))
    nearest = hs.measure(points, i, j, quantities="Sd")
    for s, one in enumerate(systems):
        mine, first = points.batch[i] == s, np.searchsorted(points.batch, s)
        found = hs.measure(one, i[mine] - first, j[mine] - first, quantities="Sd")
        assert same_arrays(found, (nearest[0][mine], nearest[1][mine]))
    queries, told = points[::3], []
    a, b, T, e = hs.pairs_between(queries, points, 1.4, quantities="ijSd")
    how = {"queries": queries, "quantities": "d", "progress": told.append}
    assert same_arrays(hs.measure(points, a, b, T, **how), e) and told == sorted(told)


def test_measured_pairs_are_of_one_system_and_named_by_their_number():
    points = hs.Points([[0.0], [1.0], [2.0], [1e300]], batch=[0, 0, 1, 1], box=[[[4.0]], [[5.0]]])
    with pytest.raises(
        ValueError, match=r"pair 1 is of two systems: i\[1\] of system 0, j\[1\] of"
    ):
        hs.measure(points, [0, 1], [1, 2])
    with pytest.raises(OverflowError, match=r"^pair 2: a point lies too many box vectors away"):
        hs.measure(points, [0, 1, 2], [1, 0, 3])
    empty = hs.Points(np.empty((0, 2)), batch=[])
    assert [one.shape for one in hs.measure(empty, [], [])] == [(0,), (0, 2), (0, 2)]


def test_functions_are_called_for_each_pair_of_all_systems(rng):
    points = hs.Points.stack(systems_of(rng, [30, 0, 8, 64]))
    points = points.replace(groups=rng.integers(0, 2, len(points)))
    i, j, S, D = (c.tolist() for c in hs.pairs(points, 1.4, quantities="ijSD"))
    seen = []
    assert hs.for_each_pair(points, 1.4, lambda *pair: seen.append(pair[:4])) == len(i) > 30
    assert seen == list(zip(i, j, map(tuple, S), map(tuple, D)))
    few = []
    stop = hs.for_each_pair(points, 1.4, lambda *pair: few.append(pair[:2]) or len(few) == 25)
    assert stop == 25 and few == [pair[:2] for pair in seen[:25]]

    def note(a, b, *rest):
        numbers.append((a, b))
        return len(numbers) == most

    kinds = ctypes.c_int64, ctypes.c_int64, ctypes.POINTER(ctypes.c_int32)
    signature = ctypes.CFUNCTYPE(
        ctypes.c_int, *kinds, ctypes.POINTER(ctypes.c_double), ctypes.c_double, ctypes.c_void_p
    )
    for most, right in ((25, 25), (0, len(i))):  # noqa: B007, that `note` looks at
        numbers = []
        assert hs.for_each_pair(points, 1.4, signature(note)) == right
        assert numbers == [pair[:2] for pair in seen[:right]]
    numbers, how = [], {"exclude": np.array([i, j]).T[::2], "min_distance": 0.2}
    n = hs.for_each_pair(points, 1.4, signature(note), **how)
    a, b = hs.pairs(points, 1.4, **how)
    assert n == len(a) and numbers == list(zip(a.tolist(), b.tolist()))


# ---- what is refused, and no systems ---------------------------------------------------------


def test_no_points_and_no_systems():
    none = hs.Points(np.empty((0, 3)), batch=[])
    i, j = hs.pairs(none, 1.0)
    assert i.shape == j.shape == (0,) and i.dtype == np.int64
    assert hs.count_pairs(none, 1.0).shape == hs.coordination(none, 1.0).shape == (0,)
    assert hs.count_pairs(none, [1.0, 2.0]).tolist() == [0, 0]
    assert hs.count_pairs(none.replace(box=np.empty((0, 3, 3))), 1.0).shape == (0,)
    assert len(hs.neighbors(none, 1.0)) == 0 and hs.nearest(none, 2)[0].shape == (0, 2)
    assert hs.pair_histogram(none, [0.0, 1.0]).shape == (0, 1)
    queries = hs.Points(np.zeros((2, 3)), batch=[4, 9])
    assert hs.neighbors(none, 1.0, queries=queries).counts.tolist() == [0, 0]
    j, d = hs.nearest(none, 2, queries=queries)
    assert (j == -1).all() and np.isinf(d).all()
    empty = hs.rdf(none.replace(box=1.0), 1.0)
    assert empty.counts.sum() == 0 and np.isfinite(empty.g).all()
    for bad in (-1.0, np.nan):
        with pytest.raises(ValueError, match="cutoff must be finite and not negative"):
            hs.pairs(none, bad)


def test_atoms_are_systems_with_their_own_box(rng):
    ase = pytest.importorskip("ase")
    cell, pbc = [2.0, 3.0, 4.0], [True, True, False]
    parts = [rng.random((n, 3)) * 3.0 for n in (10, 20, 30)]
    expected = one_by_one([hs.Points(x, box=cell, periodic=pbc) for x in parts], 1.0, "ij")
    atoms = [ase.Atoms(f"H{len(x)}", x, cell=cell, pbc=pbc) for x in parts]
    assert same_arrays(hs.pairs(atoms, 1.0), expected)
    for box in (np.ones((3, 3, 3)), cell):
        with pytest.raises(ValueError, match="of type Atoms bring their own box: leave box"):
            hs.pairs(atoms, 1.0, box=box)
    with pytest.raises(ValueError, match="of type Atoms are one system: leave batch out"):
        hs.Points(atoms[0], batch=np.zeros(10, int))


@pytest.mark.parametrize("batch, kind, message", [
    ([0, 0, 1, 0], ValueError, r"must ascend, got batch\[2\] = 1 before 0"),
    ([-1, 0, 0, 0], ValueError, r"batch must be from 0 on, got batch\[0\] = -1"),
    ([0, 0, 0, 2**62], ValueError, r"batch must be less than 2\*\*62, got batch\[3\]"),
    (np.array([0, 0, 0, 2**64 - 1], dtype=np.uint64), ValueError, r"2\*\*62, got batch\[3\]"),
    ([0, 0, 1], ValueError, r"batch must have shape \(4,\), one number for each point, got \(3,\)"),
    ([0.0, 0.0, 1.0, 1.0], TypeError, "batch must hold integers, got dtype float64"),
])  # fmt: skip
def test_bad_numbers_are_named(batch, kind, message):
    with pytest.raises(kind, match=message):
        hs.Points(np.zeros((4, 3)), batch=batch)


def stack(entry, system):
    """Three unit boxes, one of them filled with a number."""
    boxes = np.tile(np.eye(3), (3, 1, 1))
    boxes[system] = entry
    return boxes


FLAGS = np.ones((3, 3), bool)


@pytest.mark.parametrize("cutoff, scene, kind, message", [
    ([1.0, 2.0], {}, ValueError, r"less than the number of systems .*, 2, got batch\[3\] = 2"),
    (1.0, {"box": [np.eye(3)] * 2}, ValueError, r"systems .*, 2, got batch\[3\] = 2"),
    ([1.0] * 2, {"box": [np.eye(3)] * 3}, ValueError, "same number of systems, got 3 and 2"),
    ([1.0, -2.0, 1.0], {}, ValueError, r"must be finite and not negative, got cutoff\[1\] = -2.0"),
    (1.0, {"box": stack(np.inf, 1)}, ValueError, r"got box\[0, 0\] = inf\nin system 1"),
    (1.0, {"box": stack(1.0, 2)}, ValueError, r"linearly independent.*\nin system 2"),
    (1.0, {"box": np.ones((3, 3))}, ValueError, "vectors of box must be linearly independent"),
    (1.0, {"box": np.ones((4, 3))}, ValueError, r"shape \(3,\) or \(3, 3\).* got \(4, 3\)"),
    (1.0, {"box": np.ones((4, 3, 2))}, ValueError, r"system \(s, 3, 3\).* got \(4, 3, 2\)"),
    (np.ones((2, 2)), {}, ValueError, r"a table of cutoffs needs types"),
    (1.0, {"periodic": FLAGS}, ValueError, "periodic needs a box"),
    (1.0, {"box": 1.0, "periodic": FLAGS[:, :2]}, ValueError, r"\(s, 3\), got shape \(3, 2\)"),
    (1.0, {"box": stack(0.5, 1), "periodic": FLAGS[:1]}, ValueError, "systems, got 3 and 1"),
    (1.0, {"box": 1.0, "periodic": FLAGS[:2]}, ValueError, r"periodic .*, 2, got"),
    (1.0, {"box": 1.0, "periodic": FLAGS * 1.0}, TypeError, "hold bools, got dtype.*float64"),
    (1.0, {"box": 1.0, "periodic": FLAGS * 2}, TypeError, "periodic must hold bools"),
])  # fmt: skip
def test_bad_boxes_and_cutoffs_are_named(cutoff, scene, kind, message):
    """System 1 has no points: what is given for it is checked all the same."""
    for search in (hs.pairs, hs.count_pairs, hs.neighbors):
        with pytest.raises(kind, match=message):
            call(search, np.zeros((4, 3)), cutoff, batch=[0, 0, 0, 2], **scene)


def test_vectors_of_axes_that_do_not_repeat_are_not_looked_at():
    points, box, flags = np.zeros((3, 3)), np.array([np.eye(3)] * 2), np.ones((2, 3), bool)
    box[1, 2], flags[1, 2] = 0.0, False
    how = {"batch": [0, 0, 1], "box": box}
    call(hs.pairs, points, 0.5, **how, periodic=flags)
    with pytest.raises(ValueError, match="vector 2 of box"):
        call(hs.pairs, points, 0.5, **how, periodic=flags | True)
    with pytest.raises(ValueError, match="rdf needs a box that is periodic along every axis"):
        call(hs.rdf, points, 2.0, 5, **how, periodic=flags)


def test_a_bad_coordinate_is_named_by_its_row_among_all(rng):
    points, batch = rng.random((60, 3)) * 3.0, np.repeat([0, 1, 2], [10, 20, 30])
    points[37, 1] = np.nan
    with pytest.raises(ValueError, match=r"positions must be finite, got positions\[37, 1\] = nan"):
        hs.Points(points, batch=batch)
    points[37, 1] = 2.0**60
    for box in (np.eye(3), np.tile(np.eye(3), (3, 1, 1))):
        with pytest.raises(OverflowError, match=r"points\[37\] lies too many box vectors away"):
            hs.pairs(hs.Points(points, batch=batch, box=box), 1.0, quantities="S")


def test_a_result_that_does_not_fit_is_refused(rng):
    systems = hs.Points.stack(systems_of(rng, [100] * 200, box=False))
    m = int(hs.count_pairs(systems, 10.0).sum())
    for threads in (1, 2):
        for sort in (False, True):
            how = {"threads": threads, "sort": sort}
            with pytest.raises(MemoryError), hs.settings(memory_limit=8e6):
                hs.pairs(systems, 10.0, **how)
            assert len(hs.pairs(systems, 10.0, **how)[0]) == m


@pytest.mark.parametrize("algorithm", ["auto", "hierarchy"])
@pytest.mark.parametrize("reach", ["radii", "supports", "types"])
def test_sorted_pairs_of_a_reach_are_those_of_each_system(reach, algorithm, rng):
    frames, cutoff, rules = [], None, ["sum", "max", "min"]
    if reach == "supports":
        cutoff, rules = 1.0, ["max", "min"]
    elif reach == "types":
        cutoff, rules = {(0, 0): 0.3, (1, 1): 3.0, ("*", "*"): 1.0}, [None]
    for _ in range(3):
        sizes = np.exp(rng.uniform(-3.0, 1.2, 40))  # from far less than the box to more than half
        known = {"radii": sizes, "types": np.arange(40) % 3}
        known["supports"] = np.eye(2) / sizes[:, None, None]
        frames.append(hs.Points(rng.random((40, 2)) * 5.0, box=5.0, **{reach: known[reach]}))
    for rule in rules:
        for letters in ("ij", "d", "ijS"):
            with hs.settings(algorithm=algorithm):
                how = {"rule": rule, "quantities": letters, "sort": True}
                got = hs.pairs(hs.Points.stack(frames), cutoff, **how)
                each = [hs.pairs(frame, cutoff, **how) for frame in frames]
            if letters == "d":
                assert np.array_equal(got, np.concatenate(each))
                continue
            for k, column in enumerate(got):
                own = [one[k] + 40 * s * (letters[k] != "S") for s, one in enumerate(each)]
                assert np.array_equal(column, np.concatenate(own))


def test_sorted_pairs_of_a_system_with_images_behind_one_without():
    """What a thread keeps from system to system serves both, though the first needs no S."""
    positions = [[0.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.5, 0.0], [0.0, 0.5]]
    points = hs.Points(positions, batch=[0, 0, 1, 1, 1], box=[np.eye(2) * 9.0, np.eye(2)])
    for ours, all_of_them in zip(
        hs.pairs(points, 1.2, sort=True), hs.pairs(points, 1.2, sort=True, quantities="ijS")
    ):
        assert np.array_equal(ours, all_of_them)
