# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories: each frame has the pairs of a search of its own, whatever comes before it."""

import threading
from types import SimpleNamespace

import ase
import numpy as np
import pytest

import halfshell as hs
from calls import call

LETTERS = "ijdDS"
SKEWED = np.array([[4.0, 0.0, 0.0], [2.5, 3.0, 0.0], [1.5, 2.0, 3.5]])
SKINS = ["auto", None, 0.0, 0.4]


def walk(n_frames=12, n=80, d=3, step=0.02, seed=0):
    rng = np.random.default_rng(seed)
    steps = rng.normal(0.0, step, (n_frames, n, d))
    steps[0] = rng.uniform(-2.0, 6.0, (n, d))
    return steps.cumsum(axis=0)


def fresh(points, cutoff=1.3, **options):
    return call(hs.pairs, points, cutoff, quantities=LETTERS, sort=True, **options)


def check(found, expected):
    found = list(found)
    assert len(found) == len(expected)
    for ours, theirs in zip(found, expected):
        assert len(ours) == len(theirs)
        for a, b in zip(ours, theirs):
            assert a.dtype == b.dtype and np.array_equal(a, b)


def follow(frames, cutoff=1.3, **options):
    return call(hs.trajectory_pairs, frames, cutoff, quantities=LETTERS, sort=True, **options)


@pytest.mark.parametrize("skin", SKINS)
def test_frame_by_frame(skin):
    for box in (None, 4.0, SKEWED):
        for inclusive in (True, False):
            frames = walk()
            options = {"box": box, "inclusive": inclusive}
            expected = [fresh(points, **options) for points in frames]
            assert min(len(one[0]) for one in expected) > 10
            check(follow(frames, skin=skin, **options), expected)
            check(follow(list(frames), skin=skin, **options), expected)
            check(follow(iter(frames), skin=skin, **options), expected)
            check(follow(frames.astype(np.float32), skin=skin, **options),
                  [fresh(points.astype(np.float32), **options) for points in frames])  # fmt: skip


@pytest.mark.parametrize("skin", SKINS)
def test_frames_of_other_length_box_and_dimension(skin):
    long, short, flat = walk(2, 90), walk(2, 35, seed=1), walk(2, 60, 2, seed=2)
    frames = [
        (long[0], SKEWED), (long[1], 1.01 * SKEWED), (short[0], None), (short[1], 6.0),
        (np.empty((0, 3)), SKEWED), (short[0][:1], SKEWED), (flat[0], [4.0, 5.0]), (flat[1], None),
        (long[1], hs.Box(SKEWED)), (long[1] + SKEWED[1], SKEWED), (1e9 * long[1], None),
    ]  # fmt: skip
    expected = [fresh(points, box=box) for points, box in frames]
    check(follow(frames, skin=skin), expected)
    check(follow((one for one in frames), skin=skin), expected)


class Timestep:
    """As MDAnalysis has it: one object for all frames, whose memory is written anew in each."""

    def __init__(self, n):
        self.positions = np.empty((n, 3), np.float32)
        self.triclinic_dimensions = None


class Reader:
    """As ``universe.trajectory``."""

    def __init__(self, points, boxes):
        self.points, self.boxes = points, boxes

    def __len__(self):
        return len(self.points)

    def __iter__(self):
        step = Timestep(len(self.points[0]))
        for points, box in zip(self.points, self.boxes):
            step.positions[:], step.triclinic_dimensions = points, box
            yield step
            step.positions[:] = np.nan


@pytest.mark.parametrize("skin", SKINS)
def test_readers_that_use_their_memory_again(skin):
    points = walk(5).astype(np.float32)
    boxes = [(1.0 + 0.02 * k) * SKEWED.astype(np.float32) for k in range(4)] + [None]
    expected = [fresh(one, box=box) for one, box in zip(points, boxes)]
    done = []
    check(follow(Reader(points, boxes), skin=skin, progress=done.append), expected)
    assert done == [0.2, 0.4, 0.6, 0.8, 1.0]
    with pytest.raises(ValueError, match="of type Timestep bring their own box: leave box out"):
        next(follow(Reader(points, boxes), skin=skin, box=4.0))


def trajectory(points, boxes):
    """As ``mdtraj.Trajectory``."""
    return SimpleNamespace(xyz=points, unitcell_vectors=boxes, n_frames=len(points))


@pytest.mark.parametrize("skin", SKINS)
def test_trajectories_as_wholes_and_frame_by_frame(skin):
    points = walk(4).astype(np.float32)
    boxes = np.stack([(1.0 + 0.02 * k) * SKEWED for k in range(4)]).astype(np.float32)
    expected = [fresh(one, box=box) for one, box in zip(points, boxes)]
    check(follow(trajectory(points, boxes), skin=skin), expected)
    single = [trajectory(points[k : k + 1], boxes[k : k + 1]) for k in range(4)]
    check(follow(single, skin=skin), expected)
    check(follow(trajectory(points, None), skin=skin), [fresh(one) for one in points])
    check(follow(trajectory(points, None), skin=skin, box=4.0),
          [fresh(one, box=4.0) for one in points])  # fmt: skip
    with pytest.raises(ValueError, match="frames must be one frame, got a SimpleNamespace of 4"):
        next(follow([trajectory(points, boxes)], skin=skin))
    with pytest.raises(ValueError, match="box is given twice"):
        next(follow(trajectory(points, boxes), skin=skin, box=4.0))


def test_universe_of_mdanalysis():
    mda = pytest.importorskip("MDAnalysis")
    points = walk(6).astype(np.float32)
    universe = mda.Universe.empty(80, trajectory=True)
    sizes = [[4.0 + 0.1 * k, 5.0, 6.0, 80.0, 90.0, 70.0] for k in range(6)]
    universe.load_new(points, dimensions=np.array(sizes, np.float32))
    expected = []
    for step in universe.trajectory:
        box = mda.lib.mdamath.triclinic_vectors(step.dimensions)
        expected.append(fresh(step.positions.copy(), box=box))
    assert len(expected) == 6
    check(follow(universe.trajectory), expected)
    check(follow(universe.trajectory[1:4]), expected[1:4])


def test_nothing_is_read_ahead():
    read = []

    def frames():
        for k, points in enumerate(walk(5)):
            read.append(k)
            yield points

    found = follow(frames())
    assert not read
    next(found)
    next(found)
    assert read == [0, 1]
    found.close()
    assert list(found) == []


@pytest.mark.parametrize("options, kind, message", [
    ({"quantities": "x"}, ValueError, "quantities"),
    ({"frames": iter([]), "progress": print}, TypeError, "progress needs frames that have a len"),
    ({"frames": "abc"}, TypeError, "frames must be a sequence of frames, got str"),
])  # fmt: skip
def test_bad_arguments_are_refused_by_the_call(options, kind, message):
    with pytest.raises(kind, match=message):
        call(hs.trajectory_pairs, **{"frames": walk(2), "cutoff": 1.0} | options)


@pytest.mark.parametrize("skin", SKINS)
@pytest.mark.parametrize("bad, kind, message", [
    (np.full((3, 3), np.nan), ValueError, r"points\[0, 0\] = nan"),
    ("abc", TypeError, "frames must hold real numbers, got str"),
    (np.zeros(3), ValueError, "shape"),
    ((np.zeros((3, 3)), np.zeros((2, 2))), ValueError, "box"),
    ((np.zeros((3, 3)), np.zeros((3, 3))), ValueError, "box"),
    (np.zeros((3, 3), complex), TypeError, "frames must hold real numbers"),
])  # fmt: skip
def test_bad_frames_are_named(skin, bad, kind, message):
    found = follow([*walk(2), bad, *walk(2)], skin=skin)
    next(found)
    next(found)
    with pytest.raises(kind, match=message) as caught:
        next(found)
    assert caught.value.__notes__ == ["in frame 2 of trajectory_pairs"]
    assert list(found) == []


@pytest.mark.parametrize("skin", SKINS)
def test_periodic_needs_a_box_and_none_of_its_own(skin):
    with pytest.raises(ValueError, match="periodic needs a box"):
        next(follow(walk(1), skin=skin, periodic=True))
    atoms = ase.Atoms("C80", positions=walk(1)[0], cell=SKEWED, pbc=True)
    with pytest.raises(ValueError, match="of type Atoms bring their own periodic: leave periodic"):
        next(follow([atoms], skin=skin, periodic=True))
    frames = [(points, SKEWED) for points in walk(3)]
    periodic = [True, False, True]
    check(follow(frames, skin=skin, periodic=periodic),
          [fresh(points, box=box, periodic=periodic) for points, box in frames])  # fmt: skip


def large(n_frames=9, n=1500, seed=3):
    """Frames that are worth a thread, and some that are not."""
    rng = np.random.default_rng(seed)
    sizes = [n if k % 4 else 60 for k in range(n_frames)]
    return [rng.uniform(0.0, 9.0, (size, 3)) for size in sizes]


@pytest.mark.parametrize(
    ("threads", "box"), [(2, None), (3, 9.0), (8, SKEWED + 6.0 * np.eye(3))], ids=str
)
def test_frames_are_shared_out_among_threads(threads, box):
    frames = large()
    expected = [fresh(points, box=box) for points in frames]
    how = {"skin": None, "box": box, "threads": threads}
    check(follow(frames, **how), expected)
    unsorted = call(hs.trajectory_pairs, frames, 1.3, quantities=LETTERS, **how)
    check(unsorted, [hs.pairs(x, 1.3, quantities=LETTERS, box=box) for x in frames])
    done = []
    for k, _ in enumerate(follow(frames, progress=done.append, **how)):
        assert len(done) == k + 1
    assert done == [(k + 1) / 9 for k in range(9)]


def test_a_reader_may_hand_out_the_same_array_to_threads():
    frames = large()[1:4]
    expected = [fresh(points, box=9.0) for points in frames]

    def reader():
        buffer = np.empty_like(frames[0])
        for points in frames:
            buffer[:] = points
            yield buffer
            buffer[:] = np.nan

    check(follow(reader(), skin=None, threads=2, box=9.0), expected)
    atoms = [ase.Atoms(positions=x, cell=[9.0] * 3, pbc=[True, False, True]) for x in frames]
    check(follow(atoms, skin=None, threads=2), [fresh(one) for one in atoms])
    own = [(x, [9.0 + k] * 3) for k, x in enumerate(frames)]
    check(follow(own, skin=None, threads=2), [fresh(x, box=box) for x, box in own])


@pytest.mark.parametrize("bad", [1, 4, 6])
def test_frames_before_a_wrong_one_come_first(bad):
    frames = large()
    for wrong in (np.nan, "a box of another shape"):
        given = list(frames)
        if isinstance(wrong, float):
            given[bad] = given[bad].copy()
            given[bad][7, 1] = wrong
        else:
            given[bad] = (given[bad], np.eye(2))
        found = follow(given, skin=None, threads=3)
        for points in frames[:bad]:
            check([next(found)], [fresh(points)])
        with pytest.raises(ValueError) as refused:
            next(found)
        assert refused.value.__notes__ == [f"in frame {bad} of trajectory_pairs"]
        assert list(found) == []


def test_threads_end_with_the_iteration():
    before = set(threading.enumerate())
    found = follow(large(), skin=None, threads=2)
    next(found)
    next(found)
    found.close()
    assert set(threading.enumerate()) == before
    assert list(follow([], skin=None, threads=2)) == []


def test_progress():
    frames = walk(4)
    for options in ({}, {"skin": None}):
        done = []
        for k, _ in enumerate(follow(frames, progress=done.append, **options)):
            assert len(done) == k + 1  # before the pairs are handed out
        assert done == [0.25, 0.5, 0.75, 1.0]

    def stop(fraction):
        raise KeyError("stop")

    found = follow(frames, progress=stop)
    with pytest.raises(KeyError, match="stop"):
        next(found)
    assert list(found) == []
