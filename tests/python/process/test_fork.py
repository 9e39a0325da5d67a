# SPDX-License-Identifier: BSD-3-Clause
"""A child that is forked off while a thread of the parent is inside a call answers all the same."""

import os
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

import halfshell as hs

pytestmark = [
    pytest.mark.skipif(not hasattr(os, "fork"), reason="the system has no fork"),
    pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning"),
]

SECONDS = 60  # for a child; it takes milliseconds
FORKS = 3
BOX = [9.0, 10.0, 11.0]


def steps(n, count=2, seed=0):
    rng = np.random.default_rng(seed)
    first = rng.random((n, 3)) * BOX
    return [first + 0.01 * k * rng.standard_normal((n, 3)) for k in range(count)]


def rows(columns):
    """Pairs as one sorted array, so that their order does not count."""
    i, j = columns
    return np.sort(np.asarray(i) * np.int64(2**31) + j).tolist()


def in_children(inside, check, forks=FORKS):
    """Fork while a thread is in `inside` over and over; the children do `check`."""
    done, entered = threading.Event(), threading.Event()
    failures = []

    def work():
        try:
            for _ in iter(done.is_set, True):
                entered.set()
                inside()
        except BaseException as error:
            failures.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        assert entered.wait(SECONDS)
        for k in range(forks):
            done.wait(0.001 * (1 + k))
            child = os.fork()
            if child == 0:
                signal.signal(signal.SIGALRM, signal.SIG_DFL)
                signal.alarm(SECONDS)
                try:
                    check()
                    os._exit(0)
                except BaseException as error:
                    os.write(2, f"in the child: {type(error).__name__}: {error}\n".encode())
                finally:
                    os._exit(1)
            assert os.waitpid(child, 0)[1] == 0
    finally:
        done.set()
        thread.join()
    assert not failures


# ---- VerletList ----------------------------------------------------------------------------------


@pytest.mark.parametrize("skin, tracks", [(0.3, True), (0.0, False), ("auto", True)])
def test_update_of_a_verlet_list(skin, tracks):
    """It has the pairs of one of the steps, or says why it has none; then it goes on."""
    taken = steps(4000, 3)
    answers = [rows(hs.pairs(points, 0.6, box=BOX)) for points in taken]
    pair_list = hs.VerletList(0.6, skin, box=BOX, track_changes=tracks)
    number = [0]

    def inside():
        number[0] += 1
        pair_list.update(taken[number[0] % 3])

    refused = []

    def check():
        try:
            found = rows(pair_list.pairs())
        except RuntimeError as error:
            assert "call it first" in str(error) or "no points yet" in str(error)
            assert pair_list.n_points == 0
            with pytest.raises(RuntimeError, match="call"):
                _ = pair_list.margin
            refused.append(error)
        else:
            assert found in answers
        for k in (1, 2):
            pair_list.update(taken[k])
            assert rows(pair_list.pairs()) == answers[k]
            assert len(pair_list.neighbors()) == len(taken[k])
        if tracks:
            formed, broken = pair_list.changes()
            assert set(rows(formed)) == set(answers[2]) - set(answers[1])
            assert set(rows(broken)) == set(answers[1]) - set(answers[2])

    inside()
    in_children(inside, check)


def test_a_step_that_was_being_taken_is_refused_until_the_next():
    """The thread is surely inside: its points are read by code of ours, which waits."""
    inside, goes_on = threading.Event(), threading.Event()
    pair_list = hs.VerletList(1.0, 0.5)
    pair_list.update([[0.0], [0.5]])

    def wait(scene, *ignored):
        inside.set()
        assert goes_on.wait(SECONDS)
        return before(scene, *ignored)

    before = pair_list._update
    pair_list._update = wait
    thread = threading.Thread(target=pair_list.update, args=([[0.0], [0.25]],))
    thread.start()
    try:
        assert inside.wait(SECONDS)
        child = os.fork()
        if child == 0:
            signal.alarm(SECONDS)
            try:
                del pair_list._update
                for ask in (pair_list.pairs, pair_list.neighbors):
                    with pytest.raises(RuntimeError, match="forked off while another thread"):
                        ask()
                pair_list.update([[0.0], [0.75]])
                assert pair_list.pairs(quantities="d").tolist() == [0.75]
                os._exit(0)
            finally:
                os._exit(1)
        assert os.waitpid(child, 0)[1] == 0
    finally:
        goes_on.set()
        thread.join()
    assert pair_list.pairs(quantities="d").tolist() == [0.25]


def test_a_child_of_the_thread_that_is_inside_goes_on():
    """As where a signal handler forks: the call, which is in the child as well, ends there too."""
    pair_list = hs.VerletList(1.0, 0.5)
    statuses = []

    def fork(*ignored):
        child = os.fork()
        if child:
            statuses.append(os.waitpid(child, 0)[1])
        return before(*ignored), child

    before = pair_list._update
    pair_list._update = fork
    _, child = pair_list.update([[0.0], [0.25]])
    del pair_list._update
    if child == 0:
        signal.alarm(SECONDS)
        right = pair_list.pairs(quantities="d").tolist() == [0.25]
        right = right and pair_list.update([[0.0], [0.5]]) in (True, False)
        os._exit(0 if right else 1)
    assert statuses == [0]


def test_a_child_ends_in_order():
    """Nothing that a thread left half done is freed when the child's interpreter ends."""
    program = """if True:
        import gc, os, threading, numpy as np, halfshell as hs
        points = np.random.default_rng(0).random((20000, 3)) * 12
        pair_list = hs.VerletList(1.0, 0.0)
        threading.Thread(
            target=lambda: [pair_list.update(points + 0.1 * k) for k in range(30)], daemon=True
        ).start()
        for k in range(5):
            threading.Event().wait(0.02)
            child = os.fork()
            if child == 0:
                del pair_list
                gc.collect()
                break
            assert os.waitpid(child, 0)[1] == 0
    """
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program], timeout=4 * SECONDS, capture_output=True
    )
    assert run.returncode == 0, run.stderr.decode()


# ---- other objects -------------------------------------------------------------------------------


@pytest.mark.parametrize("threads", [1, 3])
def test_cell_lists(threads):
    """Their tree for the nearest may be half built."""
    (points,) = steps(4000, 1)
    pairs = rows(hs.pairs(points, 0.6, box=BOX))
    nearest = hs.nearest(points, 2, box=BOX)[0]
    cells = [hs.CellList(points, 0.6, box=BOX) for _ in range(20)]
    used = iter(cells)

    def inside():
        one = next(used, cells[-1])
        one.nearest(2, threads=threads)
        one.pairs(threads=threads)

    def check():
        for one in (cells[0], cells[-1], next(used, cells[-2])):
            assert rows(one.pairs()) == pairs
            assert (one.nearest(2)[0] == nearest).all()

    in_children(inside, check)


@pytest.mark.parametrize("work", ["within_many", "move_many", "insert"])
def test_dynamic_cell_lists(work):
    """Threads of the child wait for each other, not for those of the parent."""
    (points,) = steps(4000, 1)
    numbers = np.arange(len(points))
    cells = hs.DynamicCellList(3, 1.0, box=BOX)
    cells.insert_many(numbers, points)
    answer = cells.within_many(points[:100], 0.9)
    inside = {
        "within_many": lambda: cells.within_many(points, 0.9),
        "move_many": lambda: cells.move_many(numbers, points),
        "insert": lambda: [cells.insert(int(k), points[k]) for k in numbers[:2000]],
    }[work]

    def check():
        askers = [threading.Thread(target=cells.within_many, args=(points, 0.5)) for _ in range(2)]
        for one in askers:
            one.start()
        for k in range(200):
            cells.insert(10**6, points[k])
            assert 10**6 in cells.within(points[k], 0.1)
            cells.remove(10**6)
        for one in askers:
            one.join()
        found = cells.within_many(points[:100], 0.9)
        assert (found[0] == answer[0]).all()
        for first, end in zip(answer[0][:-1], answer[0][1:], strict=True):
            assert set(found[1][first:end]) == set(answer[1][first:end])

    in_children(inside, check)


@pytest.mark.parametrize("order", ["index", "morton"])
def test_connectivities(order):
    """What is computed when it is first looked at may be half done."""
    (points,) = steps(2000, 1)

    def made():
        return hs.Connectivity([hs.NodeList("a", points, [0.3] * 2000)], order=order, box=BOX)

    answer = [tuple(pair) for pair in made().pairs]
    many = [made() for _ in range(12)]
    used = iter(many)

    def inside():
        one = next(used, None) or made()
        hs.PairField(one.pairs)[0] = 1.0
        _ = one.pairs.index(answer[0])

    def check():
        for one in (*many[:2], *many[-2:], next(used, many[0])):
            assert [tuple(pair) for pair in one.pairs] == answer
            assert one.pairs.index(answer[5]) == 5
            field = hs.PairField(one.pairs)
            field[answer[7]] = 2.0
            assert field.values.sum() == 2.0
            one.validate()

    in_children(inside, check)


FUNCTIONS = {
    "pairs": lambda points: hs.pairs(points, 0.6, box=BOX, threads=3, quantities="ijdDS"),
    "neighbors": lambda points: hs.neighbors(points, 0.6, box=BOX, threads=3).indices,
    "nearest": lambda points: hs.nearest(points, 3, box=BOX, threads=3),
    "clusters": lambda points: hs.clusters(points, 0.3, box=BOX, threads=3).labels,
    "rdf": lambda points: hs.rdf(points, 0.6, 20, box=BOX, threads=3).g,
    "pair_histogram": lambda points: hs.pair_histogram(points, [0.1, 0.5], box=BOX, threads=3),
    "bricks": lambda points: [one.pairs(points)[0] for one in hs.bricks(points, 0.6, 2, box=BOX)],
    "cache": lambda points: (hs.clear_cache(), hs.set_cache_limit(2**29), hs.pairs(points, 0.6))[2],
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_and_the_memory_that_they_share(name):
    (points,) = steps(3000, 1)
    call = FUNCTIONS[name]
    answer = call(points)

    def check():
        for _ in range(2):
            for one, other in zip(call(points), answer, strict=True):
                assert np.array_equal(one, other)

    in_children(lambda: call(points), check)
