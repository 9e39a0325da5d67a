# SPDX-License-Identifier: BSD-3-Clause
"""`halfshell.dask`: for any chunks and workers the answer is that of one search."""

import contextlib
import functools
import os
import pickle
import signal

import numpy as np
import pytest

import halfshell as hs
from brick_scenes import LETTERS, every_scene, in_order, same, scenes, serial, without_rule
from halfshell._functions.bricks import Terms, divide, part_of, split, summary
from refused_calls import check_refusals

dask = pytest.importorskip("dask", reason="dask is not installed")
pytest.importorskip("dask.local", reason="dask is not installed")
da = pytest.importorskip("dask.array", reason="dask.array is not installed")
pytest.importorskip("distributed.deploy", reason="distributed is not installed")
distributed = pytest.importorskip("distributed", reason="distributed is not installed")
hd = pytest.importorskip("halfshell.dask", reason="dask is not installed")

CHUNKS = [-1, 50, "uneven"]
SCENES = every_scene()


def collection(points, chunks):
    if chunks == "uneven":
        first = len(points) // 5
        chunks = ((first, 0, len(points) - first), points.shape[1])
    return da.from_array(points, chunks=chunks)


def check_all(name, chunks, n=None, in_other_chunks=False):
    """All functions against one search, by bytes."""
    known, cutoff, scene, which = SCENES[name]
    points, fields, rest = hs.Points(**known, **scene), dict(known), without_rule(which)
    positions = collection(fields.pop("positions"), chunks)
    if in_other_chunks:
        fields = {key: da.from_array(one, chunks=7) for key, one in fields.items()}
    given = hd.Points(positions, **fields, **scene)
    largest = cutoff if isinstance(cutoff, float) else 1.0
    edges, cutoffs = [0.0, largest / 2.0, largest], [largest / 2.0, largest]
    rows = hd.neighbors(given, cutoff, n=n, quantities="jdS", sort=True, **which)
    found = dask.compute(
        hd.pairs(given, cutoff, n=n, quantities=LETTERS, **which),
        hd.pairs(given, cutoff, n=n, quantities=LETTERS, sort=True, **which),
        hd.coordination(given, cutoff, n=n, **which),
        hd.count_pairs(given, cutoff, n=n, **which),
        hd.pair_histogram(given, edges, n=n, **rest),
        (rows.points, rows.counts, *rows.columns),
    )  # fmt: skip
    table, parts = dask.compute(rows.table, hd.bricks(given, cutoff, n=n, **which))
    expected = hs.pairs(points, cutoff, quantities=LETTERS, sort=True, **which)
    assert same(in_order(found[0]), expected) and same(found[1], expected)
    counts = hs.coordination(points, cutoff, **which)
    assert same([found[2]], [counts])
    assert found[3].dtype == np.int64 and found[3].shape == () and found[3] == len(expected[0])
    assert same([found[4]], [hs.pair_histogram(points, edges, **rest)])
    if known.keys() == {"positions"} and not which:
        several = hd.count_pairs(given, cutoffs, n=n).compute()
        assert same([several], [hs.count_pairs(points, cutoffs)])
    whole = hs.neighbors(points, cutoff, quantities="jdS", **which)
    columns = (whole.indices, whole.distances, whole.shifts)
    assert same(found[5], (np.arange(len(points)), counts, *columns))
    assert same((table.indices, table.distances, table.shifts), columns)
    assert same([table.offsets], [whole.offsets])
    assert np.array_equal(table.reverse(), whole.reverse())
    assert len(parts) == (positions.numblocks[0] if n is None else n)
    assert sum(parts.sizes) == len(points)


@pytest.mark.parametrize("number, name", [*enumerate(SCENES)])
def test_it_is_one_search(number, name):
    chunks = CHUNKS[number % 3]
    scheduler = at_odd_addresses() if number % 2 else "threads"
    with dask.config.set(scheduler=scheduler, num_workers=2):
        check_all(name, chunks, 5 if chunks == -1 else None, in_other_chunks=number % 2)


def test_rules_with_a_direction_have_rows_and_no_pairs():
    rng = np.random.default_rng(8)
    points = hs.Points(rng.random((80, 2)) * 4.0, box=4.0, radii=rng.random(80))
    given = hd.Points(collection(points.positions, 30), radii=points.radii, box=4.0)
    rows = hd.neighbors(given, None, rule="gather").table.compute()
    assert np.array_equal(rows.indices, hs.neighbors(points, None, rule="gather").indices)
    for call in (hd.pairs, hd.count_pairs):
        with pytest.raises(ValueError, match="has a direction"):
            call(given, None, rule="gather")


def test_settings_hold_for_tasks():
    given = collection(np.random.default_rng(0).random((20_000, 3)), 20_000)
    with hs.settings(memory_limit=2e6):
        refused = hd.pairs(given, 0.1)
    with pytest.raises(MemoryError, match=r"2 MB are allowed"):
        dask.compute(*refused)
    with pytest.raises(ValueError, match="bricks need precision 'exact', got 'double'"):
        with hs.settings(precision="double"):
            hd.pairs(given, 0.1)


def test_what_is_known_has_the_rows_of_the_points():
    positions = da.zeros((10, 3), chunks=5)
    with pytest.raises(ValueError, match="radii must have a row for each of 10 points, got 9"):
        hd.Points(positions, radii=np.ones(9))
    unknown = da.from_delayed(dask.delayed(np.zeros)((5, 3)), (np.nan, 3), float)
    with pytest.raises(ValueError, match=r"radii must have the chunks of points.*: 1, got 2"):
        hd.Points(unknown, radii=da.ones(10, chunks=5))
    short = hd.Points(unknown, radii=da.ones(4, chunks=4))
    with pytest.raises(ValueError, match=r"radii must have shape \(5,\)"):
        hd.count_pairs(short, None).compute()
    negative = hd.Points(positions, radii=np.where(np.arange(10) == 7, -1.0, 1.0))
    with pytest.raises(ValueError, match=r"radii\[7\] = -1"):
        hd.count_pairs(negative, None).compute()
    with pytest.raises(ValueError, match="Points bring their own box"):
        hd.pairs(hd.Points(positions, box=1.0), 1.0, box=1.0)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2, 4])
def test_processes(workers):
    with dask.config.set(scheduler="processes", num_workers=workers):
        check_all("mixed", 60)


@contextlib.contextmanager
def cluster(workers, **options):
    options = {"threads_per_worker": 1, "dashboard_address": None, "processes": False, **options}
    with (
        distributed.LocalCluster(n_workers=workers, **options) as made,
        distributed.Client(made) as client,
    ):
        yield client


def packed(task):
    buffers = []
    frame = pickle.dumps(task, protocol=5, buffer_callback=buffers.append)
    return frame, [bytes(1) + one.raw().tobytes() for one in buffers]


def unpacked(given):
    """What was packed; its arrays are read-only and at odd addresses."""
    frame, buffers = given
    return pickle.loads(frame, buffers=[memoryview(one)[1:] for one in buffers])


def at_odd_addresses():
    """A scheduler that sends all that a task receives."""
    return functools.partial(
        dask.local.get_async, dask.local.SynchronousExecutor().submit, 1, dumps=packed,
        loads=unpacked,
    )  # fmt: skip


@pytest.mark.filterwarnings("ignore")
def test_what_is_spilled_to_disk_is_read_again(tmp_path):
    limits = {"target": 1e-9, "spill": 1e-9, "pause": False, "terminate": False}
    limits = {f"distributed.worker.memory.{name}": value for name, value in limits.items()}
    points, cutoff, scene = scenes()["skewed"]
    with (
        dask.config.set(limits),
        cluster(2, memory_limit="1GiB", local_directory=str(tmp_path)) as client,
    ):
        found = hd.pairs(collection(points, 60), cutoff, quantities=LETTERS, sort=True, **scene)
        kept = client.persist(list(found))
        answer = client.gather(client.compute(kept))
        on_disk = [len(worker.data.disk) for worker in client.cluster.workers.values()]
        assert sum(on_disk) > 0
        assert same(answer, serial(points, cutoff, scene))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_worker_that_dies_while_it_searches_is_survived(tmp_path):
    """A task of the middle ends the process that runs it, the first time that it is run."""
    points, cutoff, scene = scenes()["skewed"]

    def once_deadly(chunk, place):
        dead = tmp_path / "dead"
        if place == 2 and not dead.exists():
            dead.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return chunk

    chunks = np.array_split(points, 4)
    loads = [dask.delayed(once_deadly)(chunk, place) for place, chunk in enumerate(chunks)]
    arrays = [da.from_delayed(one, (np.nan, 3), float) for one in loads]
    given = da.concatenate(arrays, allow_unknown_chunksizes=True)
    with cluster(2, processes=True):
        found = hd.pairs(given, cutoff, quantities=LETTERS, sort=True, **scene)
        assert same(dask.compute(*found), serial(points, cutoff, scene))
    assert (tmp_path / "dead").exists()


def test_chunks_far_apart_and_chunks_of_nothing():
    """Bricks that a sample cannot foresee: one chunk far from all others, many without points."""
    rng = np.random.default_rng(5)
    points = np.concatenate((rng.random((60, 2)), 1e6 + rng.random((3, 2)), np.full((50, 2), 0.5)))
    chunks = ((0, 60, 0, 3, 50, 0), 2)
    given = da.from_array(points, chunks=chunks)
    for n in (3, 20):
        found = hd.pairs(given, 0.2, n=n, quantities=LETTERS, sort=True)
        assert same(dask.compute(*found), serial(points, 0.2, {}))
        assert hd.bricks(given, 0.2, n=n).compute().sizes != [0] * n


def test_chunks_are_what_the_whole_says():
    def pieces(*arrays, shape=(2, 3), dtype=float):
        chunks = [da.from_delayed(dask.delayed(one, traverse=False), shape, dtype)
                  for one in arrays]  # fmt: skip
        return da.concatenate(chunks)

    good, hidden = np.ones((2, 3)), np.ma.masked_array(np.ones((2, 3)))
    assert hd.count_pairs(pieces(good, hidden), 1.0).compute() == 6
    hidden[1, 1] = np.ma.masked
    names = pieces(np.zeros(2, int), np.array(["A", "B"]), shape=(2,))
    for given, cutoff, kind, words in (
        (pieces(good, good[:, :2]), 1.0, ValueError, "3 columns in every chunk; chunk 1 has"),
        (pieces(good, good.astype(int)), 1.0, TypeError, "float64 in every chunk.*1 is of int64"),
        (pieces(good, good * [[1.0], [np.nan]]), 1.0, ValueError, r"points\[3, 0\]"),
        (pieces(good, hidden), 1.0, ValueError, "masked"),
        (hd.Points(pieces(good, good), types=names), {("*", "*"): 1.0}, TypeError,
         "types of all points must be numbers, or of all be names"),
    ):  # fmt: skip
        with pytest.raises(kind, match=words):
            hd.count_pairs(given, cutoff).compute()


def test_what_is_sent_are_the_points_of_a_brick_alone():
    points = hs.Points(np.arange(60.0).reshape(20, 3), radii=np.full(20, 0.5))
    division = divide(Terms(1.0, None, None, None, 3, ("radii",)), 4, summary(points, 1))
    for piece in split(points, division, 0):
        part = part_of(division, pickle.loads(pickle.dumps(piece)))
        brick, own = part.in_order()
        assert {len(one) for one in piece.columns.values()} == {len(brick.members)}
        assert len(brick.members) < len(points)
        assert same([own.positions, own.radii], [points.positions[brick.members],
                                                 points.radii[brick.members]])  # fmt: skip


def test_errors_of_a_search_name_points_among_all():
    points = np.zeros((30, 2))
    points[23, 0] = 1e300
    box = [[1.0, 0.0], [0.25, 1.0]]
    for call in (hd.pairs, hd.count_pairs, hd.coordination):
        with pytest.raises(OverflowError, match=r"points\[23\] lies too many box vectors away"):
            dask.compute(call(collection(points, 10), 0.5, box=box))
    given = collection(points, 10)
    with pytest.raises(OverflowError, match=r"points\[23\]"):
        hd.pair_histogram(given, [0.0, 0.5], box=box).compute()
    with pytest.raises(OverflowError, match=r"points\[23\]"):
        dask.compute(hd.neighbors(given, 0.5, box=box).counts)


@pytest.mark.filterwarnings("ignore")
def test_from_parquet_and_back(tmp_path):
    dd = pytest.importorskip("dask.dataframe", reason="dask.dataframe is not installed")
    pd = pytest.importorskip("pandas", reason="pandas is not installed")
    points, cutoff, scene = scenes()["mixed"]
    expected = serial(points, cutoff, scene)
    frame = pd.DataFrame(points, columns=list("xyz")).assign(mass=1.0)
    dd.from_pandas(frame, npartitions=3).to_parquet(tmp_path / "points")
    given = dd.read_parquet(tmp_path / "points")[["x", "y", "z"]]
    found = hd.pairs(given, cutoff, quantities=LETTERS, sort=True, **scene)
    assert same(dask.compute(*found), expected)
    counts = hd.coordination(given, cutoff, **scene).compute()  # of chunks of unknown length
    assert same([counts], [hs.coordination(points, cutoff, **scene)])
    i, j = (column.compute_chunk_sizes() for column in found[:2])
    dd.from_dask_array(da.stack((i, j), axis=1).rechunk({1: -1}), columns=["i", "j"]).to_parquet(
        tmp_path / "pairs"
    )
    again = dd.read_parquet(tmp_path / "pairs").compute()
    assert same([again["i"].to_numpy(), again["j"].to_numpy()], expected[:2])


@pytest.mark.filterwarnings("ignore")
def test_dataframes():
    dd = pytest.importorskip("dask.dataframe", reason="dask.dataframe is not installed")
    pd = pytest.importorskip("pandas", reason="pandas is not installed")
    points, cutoff, scene = scenes()["mixed"]
    for kind in (np.float64, np.float32):
        frame = pd.DataFrame(points.astype(kind), columns=list("xyz"))
        given = dd.from_pandas(frame, npartitions=3)
        found = hd.pairs(given, cutoff, quantities=LETTERS, sort=True, **scene)
        assert same(dask.compute(*found), serial(points.astype(kind), cutoff, scene))
    mixed = pd.DataFrame({"x": np.arange(6), "y": np.linspace(0.0, 1.0, 6)})
    given = dd.from_pandas(mixed, npartitions=2)
    assert hd.count_pairs(given, 1.5).compute() == hs.count_pairs(mixed.to_numpy(), 1.5)
    names = pd.DataFrame({"x": [0.0, 1.0], "name": ["a", "b"]})
    with pytest.raises(TypeError, match="column 'name' of points"):
        hd.count_pairs(dd.from_pandas(names, npartitions=1), 1.0)
    with pytest.raises(TypeError, match="column 'z' of points"):
        hd.count_pairs(dd.from_pandas(pd.DataFrame({"z": [1j]}), npartitions=1), 1.0)
    with pytest.raises(ValueError, match="a column for each axis"):
        hd.count_pairs(dd.from_pandas(mixed, npartitions=1)["x"], 1.0)
    big = dd.from_pandas(pd.DataFrame({"x": [0, 2**53 + 1], "y": [0.0, 1.0]}), npartitions=1)
    with pytest.raises(ValueError, match="column 'x' of points"):
        hd.count_pairs(big, 1.0).compute()


def test_numbers_of_one_letter_and_of_strict_cutoffs():
    points, cutoff, scene = scenes()["on the cuts"]
    given = collection(points, 10)
    for inclusive in (False, True):
        how = {"inclusive": inclusive, **scene}
        with hs.settings(kernel="scalar"):
            found = hd.pairs(given, cutoff, quantities="P", sort=True, **how)
        assert same([found.compute()], [hs.pairs(points, cutoff, quantities="P", sort=True, **how)])
        assert hd.count_pairs(given, cutoff, **how).compute() == len(found.compute())


def test_bad_arguments_are_refused_at_once():
    cases = [
        ((4, 3), {"cutoff": -1.0}, ValueError, "cutoff"),
        ((4, 3), {"cutoff": np.inf, "box": 1.0}, ValueError, "cutoff"),
        ((4, 3), {"cutoff": "1"}, TypeError, "cutoff"),
        ((4, 3), {"box": [1.0, 0.0, 1.0]}, ValueError, "box"),
        ((4, 3), {"box": [1.0, 1.0]}, ValueError, "box"),
        ((4, 3), {"periodic": True}, ValueError, "periodic needs a box"),
        ((4, 3), {"n": 0}, ValueError, "n must be 1"),
        ((4, 3), {"n": 10**30}, ValueError, "n must be at most 1,048,576 bricks"),
        ((4, 3), {"kernel": "scalar"}, TypeError, "kernel"),
        ((4, 3), {"cutoff": None}, TypeError, "radii"),
        ((4, 3), {"rule": "max"}, ValueError, "rule needs radii"),
        ((4, 3), {"exclude": 0}, ValueError, "labels"),
        ((4, 3), {"threads": 0}, ValueError, "threads"),
        ((4, 3), {"quantities": "x"}, ValueError, "quantities"),
        ((4, 3), {"sort": 1.5}, TypeError, "sort"),
        ((4,), {}, ValueError, "shape"),
        ((4, 0), {}, ValueError, "columns"),
        ((4, 9), {}, ValueError, "columns"),
    ]
    check_refusals([
        (functools.partial(hd.pairs, da.zeros(shape), **{"cutoff": 1.0, **change}), kind, words)
        for shape, change, kind, words in cases
    ])  # fmt: skip


def test_bad_collections_are_refused_at_once():
    with pytest.raises(TypeError, match=r"dask array or dataframe, .*got ndarray.*from_array"):
        hd.count_pairs(np.zeros((3, 3)), 1.0)
    with pytest.raises(TypeError, match=r"dask array or dataframe, .*got Delayed"):
        hd.count_pairs(dask.delayed(np.zeros((3, 3))), 1.0)
    with pytest.raises(TypeError, match="real numbers, got complex128"):
        hd.count_pairs(da.zeros((3, 3), dtype=complex), 1.0)
    unknown = da.from_delayed(dask.delayed(np.zeros)((3, 3)), (3, np.nan), float)
    with pytest.raises(ValueError, match="known number of columns"):
        hd.count_pairs(unknown, 1.0)
    with pytest.raises(ValueError, match="j d D S"):
        hd.neighbors(da.zeros((3, 3)), 1.0, quantities="ij")


def test_columns_in_chunks():
    points, cutoff, scene = scenes()["mixed"]
    given = da.from_array(points, chunks=(70, 2))
    assert hd.count_pairs(given, cutoff, **scene).compute() == hs.count_pairs(
        points, cutoff, **scene
    )
