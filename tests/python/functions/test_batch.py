# SPDX-License-Identifier: BSD-3-Clause
"""Many systems in one call: the same as one call for each, one behind the other."""

import numpy as np
import pytest

import halfshell as hs
from oracles import same_arrays
from refused_calls import LIMIT
from subprocesses import RESIDENT, run

LETTERS = "ijdDSP"


def offset(array, letter, first):
    return array + int(first) if letter in "ijP" else array


def one_by_one(points, cutoff, batch, *, n_systems=0, box=None, quantities="ij", **options):
    """What the batch must give, from single calls: arrays, and the count of each system."""
    batch = np.asarray(batch)
    n_systems = max(n_systems, int(batch[-1]) + 1 if batch.size else 0)
    parts, counts = [], []
    for s in range(n_systems):
        first, end = np.searchsorted(batch, [s, s + 1])
        own = None if box is None else box[s] if np.ndim(box) == 3 else box
        within = cutoff[s] if np.ndim(cutoff) else cutoff
        found = hs.pairs(points[first:end], within, box=own, quantities=quantities, **options)
        found = found if isinstance(found, tuple) else (found,)
        parts.append([offset(a, q, first) for a, q in zip(found, quantities, strict=True)])
        counts.append(len(found[0]))
    index_dtype = options.get("index_dtype", np.int64)
    empty = hs.pairs(points[:0], 0.0, quantities=quantities, index_dtype=index_dtype)
    parts.append(empty if isinstance(empty, tuple) else (empty,))
    whole = tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))
    return (whole if len(quantities) > 1 else whole[0]), counts


def systems_of(rng, sizes, d=3, spread=1.0):
    """Points of systems of these sizes, density about 1, and their numbers."""
    batch = np.repeat(np.arange(len(sizes)), sizes)
    edge = np.maximum(np.asarray(sizes, dtype=float), 1.0) ** (1.0 / d)
    points = (rng.random((len(batch), d)) - 0.25 * (spread - 1.0)) * spread * edge[batch][:, None]
    return points, batch, edge


def boxes_of(rng, edge, d, skew):
    rows = np.eye(d) + skew * rng.uniform(-1.0, 1.0, (len(edge), d, d))
    return rows * edge[:, None, None]


SIZES = [30, 0, 1, 2, 7, 64, 65, 0, 0, 300, 30, 1200, 3, 0]


def test_open_systems_of_all_sizes(rng):
    for sort in (False, True):
        for threads in (1, 2, 3, 4):
            points, batch, _ = systems_of(rng, SIZES)
            expected, counts = one_by_one(points, 1.4, batch, quantities="ijdDSP", sort=sort)
            how = {"batch": batch, "threads": threads}
            found = hs.pairs(points, 1.4, quantities="ijdDSP", sort=sort, **how)
            assert same_arrays(found, expected)
            assert hs.count_pairs(points, 1.4, batch=batch, threads=threads).tolist() == counts


@pytest.mark.slow
def test_crowded_systems_keep_their_order_behind_others():
    rng = np.random.default_rng(17)
    points, batch = rng.random((4060 + 2 * 4200, 1)), np.repeat([0, 1, 2], [4060, 4200, 4200])
    expected, _ = one_by_one(points, 0.3, batch)
    for threads in (1, 2, 3):
        found = hs.pairs(points, 0.3, batch=batch, threads=threads)
        assert same_arrays(found, expected)


@pytest.mark.parametrize("skew", [0.0, 0.4])
@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_boxes_and_cutoffs_of_each_system(rng, d, skew):
    sizes = [5, 0, 40, 9, 1, 120, 0]
    points, batch, edge = systems_of(rng, sizes, d, spread=3.0)
    boxes = boxes_of(rng, edge, d, skew)
    cutoffs = np.linspace(0.3, 1.6, len(sizes))
    for sort in (False, True):
        options = {"box": boxes, "quantities": LETTERS, "sort": sort, "n_systems": len(sizes)}
        expected, counts = one_by_one(points, cutoffs, batch, **options)
        del options["n_systems"]
        for threads in (1, 2, 4):
            found = hs.pairs(points, cutoffs, batch=batch, threads=threads, **options)
            assert same_arrays(found, expected)
            count = hs.count_pairs(points, cutoffs, batch=batch, box=boxes, threads=threads)
            assert count.dtype == np.int64 and count.tolist() == counts
    assert sum(counts) > 50


def test_every_kernel_gives_the_same(rng):
    points, batch, edge = systems_of(rng, SIZES)
    boxes = boxes_of(rng, edge, 3, 0.2)
    options = {"quantities": "ijdDS", "index_dtype": np.int32}
    for box in (None, boxes, boxes[5]):
        expected, _ = one_by_one(points, 0.9, batch, box=box, n_systems=len(SIZES), **options)
        for kernel in hs.kernels():
            found = hs.pairs(points, 0.9, batch=batch, box=box, kernel=kernel, **options)
            assert same_arrays(found, expected)
    for number, letter in enumerate("ijdDS"):
        found = hs.pairs(
            points, 0.9, batch=batch, box=boxes[5], **{**options, "quantities": letter}
        )
        assert same_arrays(found, expected[number])


@pytest.mark.parametrize("options", [
    {"precision": "double"}, {"precision": "single"}, {"inclusive": False},
    {"periodic": [True, False, True]}, {"periodic": False},
])  # fmt: skip
def test_options_hold_for_every_system(rng, options):
    points, batch, edge = systems_of(rng, [20, 30, 64, 100])
    points = np.round(points * 4.0) / 4.0  # many at exactly the cutoff
    boxes = boxes_of(rng, edge, 3, 0.0)
    expected, counts = one_by_one(points, 1.25, batch, box=boxes, **options)
    for threads in (1, 2):
        found = hs.pairs(points, 1.25, batch=batch, box=boxes, threads=threads, **options)
        assert same_arrays(found, expected)
        count = hs.count_pairs(points, 1.25, batch=batch, box=boxes, threads=threads, **options)
        assert count.tolist() == counts


def test_arrays_of_the_caller(rng):
    for threads, sort in ((1, False), (2, True)):
        points, batch, _ = systems_of(rng, SIZES)
        expected, counts = one_by_one(points, 1.3, batch, quantities="ijd", sort=sort)
        m = sum(counts)
        options = {"batch": batch, "quantities": "ijd", "sort": sort, "threads": threads}
        out = (np.full(m + 5, -1), np.full(m + 5, -1), np.full(m + 5, -1.0))
        found = hs.pairs(points, 1.3, out=out, **options)
        assert same_arrays(found, expected)
        assert all(np.shares_memory(a, b) for a, b in zip(found, out, strict=True))
        assert all((a[m:] == -1).all() for a in out)
        with pytest.raises(hs.CapacityError) as caught:
            hs.pairs(points, 1.3, out=tuple(a[: m - 1] for a in out), **options)
        assert caught.value.needed == m


def test_numbers_may_be_far_apart(rng):
    points, batch, _ = systems_of(rng, [10, 20, 30])
    expected = hs.pairs(points, 1.5, batch=batch)
    far = np.array([3, 10**9, 2**61])[batch]
    assert same_arrays(hs.pairs(points, 1.5, batch=far), expected)
    few = np.array([0, 3, 7])[batch]
    counts = hs.count_pairs(points, 1.5, batch=few)
    assert counts.shape == (8,)
    assert counts[[0, 3, 7]].tolist() == hs.count_pairs(points, 1.5, batch=batch).tolist()
    assert counts.sum() == len(expected[0])


def test_integers_of_every_kind(rng):
    for dtype in (np.int8, np.uint8, np.int32, ">i8", np.uint64):
        points, batch, _ = systems_of(rng, [10, 20, 30])
        wide = np.repeat(batch.astype(dtype), 2)
        expected = hs.pairs(points, 1.5, batch=batch)
        assert same_arrays(hs.pairs(points, 1.5, batch=wide[::2]), expected)
        assert same_arrays(hs.pairs(points, 1.5, batch=batch.tolist()), expected)
        assert same_arrays(hs.pairs(points.tolist(), 1.5, batch=batch), expected)


def test_other_points_and_boxes(rng):
    points, batch, _ = systems_of(rng, [10, 20, 30])
    expected, _ = one_by_one(points.astype(np.float32), 1.0, batch, box=[2.0, 3.0, 4.0])
    for box in ([2.0, 3.0, 4.0], np.diag([2.0, 3.0, 4.0]), hs.Box.orthorhombic([2.0, 3.0, 4.0])):
        for strided in (points.astype(np.float32), points.astype(np.float32, order="F")):
            assert same_arrays(hs.pairs(strided, 1.0, batch=batch, box=box), expected)


def test_no_points_and_no_systems():
    i, j = hs.pairs(np.empty((0, 3)), 1.0, batch=[])
    assert i.shape == j.shape == (0,) and i.dtype == np.int64
    assert hs.count_pairs([], 1.0, batch=[]).shape == (0,)
    assert hs.count_pairs([], [1.0, 2.0], batch=[]).tolist() == [0, 0]
    assert hs.count_pairs([], 1.0, batch=[], box=np.empty((0, 3, 3))).shape == (0,)
    for bad in (-1.0, np.nan):
        with pytest.raises(ValueError, match="cutoff must be finite and not negative"):
            hs.pairs([], bad, batch=[])
    with pytest.raises(ValueError, match="box must be finite"):
        hs.pairs([], 1.0, batch=[], box=[1.0, np.nan, 1.0])
    with pytest.raises(ValueError, match="kernel must be one of"):
        hs.pairs([], 1.0, batch=[], kernel="none")


def test_an_object_with_its_own_box(rng):
    ase = pytest.importorskip("ase")
    points, batch, _ = systems_of(rng, [10, 20, 30])
    atoms = ase.Atoms("H60", points, cell=[2.0, 3.0, 4.0], pbc=[True, True, False])
    expected, _ = one_by_one(points, 1.0, batch, box=[2.0, 3.0, 4.0], periodic=[True, True, False])
    assert same_arrays(hs.pairs(atoms, 1.0, batch=batch), expected)
    for box in (np.ones((3, 3, 3)), [2.0, 3.0, 4.0]):
        with pytest.raises(ValueError, match="of type Atoms bring their own box: leave box"):
            hs.pairs(atoms, 1.0, batch=batch, box=box)


@pytest.mark.parametrize("batch, kind, message", [
    ([0, 0, 1, 0], ValueError, r"must be ascending, got batch\[2\] = 1 before batch\[3\] = 0"),
    ([-1, 0, 0, 0], ValueError, r"batch must not be negative, got batch\[0\] = -1"),
    ([0, 0, 0, 2**62], ValueError, r"batch must be less than 2\*\*62, got batch\[3\]"),
    (np.array([0, 0, 0, 2**64 - 1], dtype=np.uint64), ValueError, r"2\*\*62, got batch\[3\]"),
    ([0, 0, 1], ValueError, r"batch must have shape \(4,\), one number for each point, got \(3,\)"),
    ([[0], [0], [0], [0]], ValueError, r"batch must have shape \(4,\)"),
    (0, ValueError, r"batch must have shape \(4,\)"),
    ([0.0, 0.0, 1.0, 1.0], TypeError, "batch must hold integers, got dtype float64"),
    ([True, True, True, True], TypeError, "batch must hold integers, got dtype bool"),
    ("0000", TypeError, "batch must hold integers, got str"),
])  # fmt: skip
def test_bad_numbers_are_named(batch, kind, message):
    for search in (hs.pairs, hs.count_pairs):
        with pytest.raises(kind, match=message):
            search(np.zeros((4, 3)), 1.0, batch=batch)


def stack(entry, system):
    """Three unit boxes, one of them filled with a number."""
    boxes = np.tile(np.eye(3), (3, 1, 1))
    boxes[system] = entry
    return boxes


@pytest.mark.parametrize("cutoff, box, message", [
    ([1.0, 2.0], None, r"less than the number of systems .*, 2, got batch\[3\] = 2"),
    (1.0, np.tile(np.eye(3), (2, 1, 1)), r"number of systems .*, 2, got batch\[3\] = 2"),
    ([1.0, 2.0, 3.0], np.tile(np.eye(3), (4, 1, 1)), "same number of systems, got 4 and 3"),
    ([1.0, -2.0, 1.0], None, r"must be finite and not negative, got cutoff\[1\] = -2.0"),
    (1.0, stack(np.inf, 1), r"box must be finite, got box\[1, 0, 0\] = inf"),
    (1.0, stack(1.0, 2), r"vectors of box\[2\] must be linearly independent"),
    (1.0, stack(1.0, 1), r"vectors of box\[1\] must be linearly independent"),
    (1.0, np.ones((3, 3)), "vectors of box must be linearly independent"),
    (1.0, np.ones((4, 3)), r"or one for each system \(s, d, d\), got \(4, 3\)"),
    (1.0, np.ones((4, 3, 2)), r"shape .* one for each system \(s, 3, 3\).* got \(4, 3, 2\)"),
    (np.ones((2, 2)), None, r"have shape \(s,\), one for each system, got \(2, 2\)"),
    (-1.0, None, "cutoff must be finite and not negative, got -1.0"),
])  # fmt: skip
def test_bad_boxes_and_cutoffs_are_named(cutoff, box, message):
    """System 1 has no points: what is given for it is checked all the same."""
    for search in (hs.pairs, hs.count_pairs):
        for threads in (1, 2):
            with pytest.raises(ValueError, match=message):
                search(np.zeros((4, 3)), cutoff, batch=[0, 0, 0, 2], box=box, threads=threads)


def test_a_bad_coordinate_is_named_by_its_row_among_all(rng):
    points, batch, _ = systems_of(rng, [10, 20, 30])
    points[37, 1] = np.nan
    for search in (hs.pairs, hs.count_pairs):
        with pytest.raises(ValueError, match=r"points must be finite, got points\[37, 1\] = nan"):
            search(points, 1.0, batch=batch)
    points[37, 1] = 2.0**60
    for box in (np.eye(3), np.tile(np.eye(3), (3, 1, 1))):
        with pytest.raises(OverflowError, match=r"points\[37\] lies too many box vectors away"):
            hs.pairs(points, 1.0, batch=batch, box=box, quantities="S")


def test_a_result_that_does_not_fit_is_refused(rng):
    points, batch, _ = systems_of(rng, [100] * 200)
    m = int(hs.count_pairs(points, 10.0, batch=batch).sum())
    for threads in (1, 2):
        for sort in (False, True):
            options = {"batch": batch, "threads": threads, "sort": sort}
            with pytest.raises(MemoryError):
                hs.pairs(points, 10.0, memory_limit=8e6, **options)
            assert len(hs.pairs(points, 10.0, memory_limit=1e9, **options)[0]) == m


def test_many_systems_do_not_depend_on_threads(rng):
    sizes = rng.integers(0, 60, 10_000)
    points, batch, edge = systems_of(rng, sizes)
    boxes = edge[:, None, None] * np.eye(3)
    one = hs.pairs(points, 1.1, batch=batch, box=boxes, quantities="ijS", threads=1)
    for threads in (2, 3, 4):
        assert same_arrays(
            hs.pairs(points, 1.1, batch=batch, box=boxes, quantities="ijS", threads=threads), one
        )
    assert (batch[one[0]] == batch[one[1]]).all()
    counts = hs.count_pairs(points, 1.1, batch=batch, box=boxes)
    assert counts.tolist() == np.bincount(batch[one[0]], minlength=len(counts)).tolist()
    some = [17, 4000, 9999]
    for s in some:
        first, end = np.searchsorted(batch, [s, s + 1])
        i, j = hs.pairs(points[first:end], 1.1, box=boxes[s])
        own = batch[one[0]] == s
        assert (one[0][own] - first).tolist() == i.tolist()
        assert (one[1][own] - first).tolist() == j.tolist()


@pytest.mark.slow
@pytest.mark.parametrize(("search", "threads"), [("hs.pairs", 2), ("hs.count_pairs", 1)])
def test_an_interrupt_stops_the_search(search, threads):
    outcome, delay, grown = run(
        RESIDENT
        + f"""
import gc, json, signal, threading, time
import numpy as np
import halfshell as hs
points = np.random.default_rng(1).random((600_000, 3))
batch = np.repeat(np.arange(20_000), 30)
hs.count_pairs(points[:3000], 0.3, batch=batch[:3000])
gc.collect()
before = resident()
sent = []

def interrupt():
    sent.append(time.perf_counter())
    signal.raise_signal(signal.SIGINT)

timer = threading.Timer(0.2, interrupt)
timer.start()
try:
    while True:
        {search}(
            points, 2.0, batch=batch, box=np.ones(3), threads={threads}, memory_limit=1e13
        )
except KeyboardInterrupt:
    outcome = "interrupted"
delay = time.perf_counter() - (sent or [0.0])[0]
hs.clear_cache()
gc.collect()
print(json.dumps([outcome, delay, resident() - before]))
"""
    )
    assert outcome == "interrupted"
    assert delay < 2.0 * LIMIT
    assert grown < 60_000_000
