# SPDX-License-Identifier: BSD-3-Clause
"""Many systems in one call: the same as one call for each, one behind the other; with axes of each
that repeat, and with radii, types or supports."""


import numpy as np
import pytest

import halfshell as hs
from calls import call
from halfshell_report import scenes
from oracles import same_arrays
from refused_calls import LIMIT
from subprocesses import RESIDENT, run


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
        found = call(hs.pairs, points[first:end], within, box=own, quantities=quantities, **options)
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
            found = call(hs.pairs, points, 1.4, quantities="ijdDSP", sort=sort, **how)
            assert same_arrays(found, expected)
            assert (
                call(hs.count_pairs, points, 1.4, batch=batch, threads=threads).tolist() == counts
            )


@pytest.mark.slow
def test_crowded_systems_keep_their_order_behind_others():
    rng = np.random.default_rng(17)
    points, batch = rng.random((4060 + 2 * 4200, 1)), np.repeat([0, 1, 2], [4060, 4200, 4200])
    expected, _ = one_by_one(points, 0.3, batch)
    for threads in (1, 2, 3):
        found = call(hs.pairs, points, 0.3, batch=batch, threads=threads)
        assert same_arrays(found, expected)


def test_every_kernel_gives_the_same(rng):
    points, batch, edge = systems_of(rng, SIZES)
    boxes = boxes_of(rng, edge, 3, 0.2)
    options = {"quantities": "ijdDS", "index_dtype": np.int32}
    for box in (None, boxes, boxes[5]):
        expected, _ = one_by_one(points, 0.9, batch, box=box, n_systems=len(SIZES), **options)
        for kernel in hs.kernels():
            found = call(hs.pairs, points, 0.9, batch=batch, box=box, kernel=kernel, **options)
            assert same_arrays(found, expected)
    for number, letter in enumerate("ijdDS"):
        found = call(
            hs.pairs, points, 0.9, batch=batch, box=boxes[5], **{**options, "quantities": letter}
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
        found = call(hs.pairs, points, 1.25, batch=batch, box=boxes, threads=threads, **options)
        assert same_arrays(found, expected)
        count = call(
            hs.count_pairs, points, 1.25, batch=batch, box=boxes, threads=threads, **options
        )
        assert count.tolist() == counts


def test_no_points_and_no_systems():
    i, j = call(hs.pairs, np.empty((0, 3)), 1.0, batch=[])
    assert i.shape == j.shape == (0,) and i.dtype == np.int64
    assert call(hs.count_pairs, [], 1.0, batch=[]).shape == (0,)
    assert call(hs.count_pairs, [], [1.0, 2.0], batch=[]).tolist() == [0, 0]
    assert call(hs.count_pairs, [], 1.0, batch=[], box=np.empty((0, 3, 3))).shape == (0,)
    for bad in (-1.0, np.nan):
        with pytest.raises(ValueError, match="cutoff must be finite and not negative"):
            call(hs.pairs, [], bad, batch=[])
    with pytest.raises(ValueError, match="box must be finite"):
        call(hs.pairs, [], 1.0, batch=[], box=[1.0, np.nan, 1.0])
    with pytest.raises(ValueError, match="kernel must be one of"):
        call(hs.pairs, [], 1.0, batch=[], kernel="none")


def test_an_object_with_its_own_box(rng):
    ase = pytest.importorskip("ase")
    points, batch, _ = systems_of(rng, [10, 20, 30])
    cell, pbc = [2.0, 3.0, 4.0], [True, True, False]
    expected, _ = one_by_one(points, 1.0, batch, box=cell, periodic=pbc)
    atoms = [
        ase.Atoms(f"H{n}", points[batch == s], cell=cell, pbc=pbc)
        for s, n in enumerate((10, 20, 30))
    ]
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
    ([[0], [0], [0], [0]], ValueError, r"batch must have shape \(4,\)"),
    ([0.0, 0.0, 1.0, 1.0], TypeError, "batch must hold integers, got dtype float64"),
])  # fmt: skip
def test_bad_numbers_are_named(batch, kind, message):
    for search in (hs.pairs, hs.count_pairs):
        with pytest.raises(kind, match=message):
            call(search, np.zeros((4, 3)), 1.0, batch=batch)


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
    (1.0, stack(np.inf, 1), r"box must be finite, got box\[0, 0\] = inf\nin system 1"),
    (1.0, stack(1.0, 2), r"vectors of box must be linearly independent.*\nin system 2"),
    (1.0, stack(1.0, 1), r"vectors of box must be linearly independent.*\nin system 1"),
    (1.0, np.ones((3, 3)), "vectors of box must be linearly independent"),
    (1.0, np.ones((4, 3)), r"shape \(3,\) or \(3, 3\), or be one length, .* got \(4, 3\)"),
    (1.0, np.ones((4, 3, 2)), r"shape .* one for each system \(s, 3, 3\).* got \(4, 3, 2\)"),
    (np.ones((2, 2)), None, r"a table of cutoffs needs types"),
])  # fmt: skip
def test_bad_boxes_and_cutoffs_are_named(cutoff, box, message):
    """System 1 has no points: what is given for it is checked all the same."""
    for search in (hs.pairs, hs.count_pairs):
        for threads in (1, 2):
            with pytest.raises(ValueError, match=message):
                call(search, np.zeros((4, 3)), cutoff, batch=[0, 0, 0, 2], box=box, threads=threads)


def test_a_bad_coordinate_is_named_by_its_row_among_all(rng):
    points, batch, _ = systems_of(rng, [10, 20, 30])
    points[37, 1] = np.nan
    for search in (hs.pairs, hs.count_pairs):
        with pytest.raises(
            ValueError, match=r"positions must be finite, got positions\[37, 1\] = nan"
        ):
            call(search, points, 1.0, batch=batch)
    points[37, 1] = 2.0**60
    for box in (np.eye(3), np.tile(np.eye(3), (3, 1, 1))):
        with pytest.raises(OverflowError, match=r"points\[37\] lies too many box vectors away"):
            call(hs.pairs, points, 1.0, batch=batch, box=box, quantities="S")


def test_a_result_that_does_not_fit_is_refused(rng):
    points, batch, _ = systems_of(rng, [100] * 200)
    m = int(call(hs.count_pairs, points, 10.0, batch=batch).sum())
    for threads in (1, 2):
        for sort in (False, True):
            options = {"batch": batch, "threads": threads, "sort": sort}
            with pytest.raises(MemoryError):
                call(hs.pairs, points, 10.0, memory_limit=8e6, **options)
            assert len(call(hs.pairs, points, 10.0, memory_limit=1e9, **options)[0]) == m


def test_many_systems_do_not_depend_on_threads(rng):
    sizes = rng.integers(0, 60, 10_000)
    points, batch, edge = systems_of(rng, sizes)
    boxes = edge[:, None, None] * np.eye(3)
    one = call(hs.pairs, points, 1.1, batch=batch, box=boxes, quantities="ijS", threads=1)
    for threads in (2, 3, 4):
        assert same_arrays(
            call(hs.pairs, points, 1.1, batch=batch, box=boxes, quantities="ijS", threads=threads),
            one,
        )
    assert (batch[one[0]] == batch[one[1]]).all()
    counts = call(hs.count_pairs, points, 1.1, batch=batch, box=boxes)
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
hs.count_pairs(hs.Points(points[:3000], batch=batch[:3000]), 0.3)
systems = hs.Points(points, batch=batch, box=np.ones(3))
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
        with hs.settings(memory_limit=1e13):
            {search}(systems, 2.0, threads={threads})
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


# ---- axes that repeat, of each system ----------------------------------------------------------


N_SYSTEMS = 14


class Slabs:
    def __init__(self, d, has_boxes, seed=0):
        rng = np.random.default_rng([seed, d])
        sizes = rng.integers(0, 30, N_SYSTEMS)
        sizes[4] = 0
        self.batch = np.repeat(np.arange(N_SYSTEMS), sizes)
        self.query_batch = np.repeat(np.arange(N_SYSTEMS), 3)
        self.points = rng.integers(-8, 40, (sizes.sum(), d)) / 8.0
        self.queries = rng.integers(-8, 40, (3 * N_SYSTEMS, d)) / 8.0
        self.periodic = rng.integers(0, 2, (N_SYSTEMS, d)).astype(bool)
        self.periodic[:2] = [[False] * d, [True] * d]
        boxes = np.eye(d) * 4.0 + rng.integers(-2, 3, (N_SYSTEMS, d, d)) / 4.0
        self.box = boxes if has_boxes else boxes[0]
        self.bonds = rng.integers(0, sizes.sum(), (60, 2))

    def parts(self):
        for s in range(N_SYSTEMS):
            own, asked = np.flatnonzero(self.batch == s), np.flatnonzero(self.query_batch == s)
            box = self.box[s] if self.box.ndim == 3 else self.box
            yield own, asked, {"box": box, "periodic": self.periodic[s]}


def test_rdf_needs_all_axes_of_each(rng):
    points, batch = rng.random((30, 3)) * 4.0, np.repeat([0, 1, 2], 10)
    how = {"box": np.stack([np.eye(3) * 4.0] * 3), "batch": batch}
    every = np.ones((3, 3), bool)
    plain, given = call(hs.rdf, points, 2.0, 5, **how), call(
        hs.rdf, points, 2.0, 5, periodic=every, **how
    )
    assert np.array_equal(plain.g, given.g)
    every[1, 2] = False
    with pytest.raises(ValueError, match="rdf needs a box that is periodic along every axis"):
        call(hs.rdf, points, 2.0, 5, periodic=every, **how)


@pytest.mark.parametrize("search", [hs.pairs, hs.neighbors, hs.count_pairs])
def test_bad_input(search):
    points, batch, box = np.zeros((3, 3)), [0, 0, 1], np.array([np.eye(3)] * 2)
    good = np.ones((2, 3), bool)
    with pytest.raises(ValueError, match="periodic needs a box"):
        call(search, points, 1.0, batch=batch, periodic=good)
    with pytest.raises(ValueError, match=r"these for each system, \(s, 3\), got shape \(2, 2\)"):
        call(search, points, 1.0, batch=batch, box=box, periodic=good[:, :2])
    with pytest.raises(ValueError, match="the same number of systems, got 2 and 1"):
        call(search, points, 1.0, batch=batch, box=box, periodic=good[:1])
    with pytest.raises(ValueError, match="the same number of systems, got 3 and 2"):
        call(search, points, [1.0, 1.0], batch=batch, box=np.eye(3), periodic=np.ones((3, 3), bool))
    with pytest.raises(TypeError, match=r"periodic must hold bools, got dtype.*float64"):
        call(search, points, 1.0, batch=batch, box=box, periodic=good.astype(float))
    with pytest.raises(TypeError, match="periodic must hold bools"):
        call(search, points, 1.0, batch=batch, box=box, periodic=good * 2)
    with pytest.raises(ValueError, match=r"less than the number of .* periodic .*, 2, got"):
        call(search, points, 1.0, batch=[0, 1, 2], box=np.eye(3), periodic=good)
    with pytest.raises(ValueError, match="periodic must be a bool or 3 bools"):
        call(search, points, 1.0, box=np.eye(3), periodic=good)  # without a batch
    skewed = box.copy()
    skewed[1, 2] = 0.0  # of an axis that does not repeat
    good[1, 2] = False
    call(search, points, 0.5, batch=batch, box=skewed, periodic=good)
    good[1, 2] = True
    with pytest.raises(ValueError, match="vector 2 of box"):
        call(search, points, 0.5, batch=batch, box=skewed, periodic=good)


# ---- radii, types and supports -----------------------------------------------------------------


FEWER = [30, 0, 1, 2, 7, 64, 65, 0, 0, 200, 30, 3, 0]


@pytest.fixture(scope="module")
def systems():
    """Points of all systems, their numbers, boxes and radii over a decade."""
    rng = np.random.default_rng(12)
    batch = np.repeat(np.arange(len(FEWER)), FEWER)
    edge = np.maximum(np.asarray(FEWER, dtype=float), 1.0) ** (1.0 / 3.0)
    points = rng.random((len(batch), 3)) * edge[batch][:, None]
    boxes = (np.eye(3) + 0.2 * rng.uniform(-1.0, 1.0, (len(FEWER), 3, 3))) * edge[:, None, None]
    return points, batch, boxes, 10.0 ** rng.uniform(-1.0, 0.0, len(batch))


def needles(rng, n, d, aspect):
    """Supports turned every way, which reach 0.3 to 1.2."""
    axes = np.linalg.qr(rng.standard_normal((n, d, d)))[0]
    values = rng.uniform(0.8, 3.0, (n, 1)) * aspect ** rng.random((n, d))
    H = np.einsum("kab,kb,kcb->kac", axes, values, axes)
    return (H + H.transpose(0, 2, 1)) / 2.0


def test_the_needles_of_a_batch_are_decided_exactly():
    scene = scenes.load("needles", "small")
    expected = call(hs.pairs, **scene.arguments, sort=True)
    assert len(expected[0]) > 20
    points, H = np.tile(scene.points, (3, 1)), np.tile(scene.supports, (3, 1, 1))
    n = scene.n_points
    found = call(hs.pairs,
        points, None, box=scene.box, supports=H, extent=scene.extent, rule=scene.rule,
        batch=np.repeat([0, 4, 5], n), sort=True,
    )  # fmt: skip
    for column, one in zip(found, expected, strict=True):
        assert np.array_equal(column, np.concatenate([one, one + n, one + 2 * n]))
