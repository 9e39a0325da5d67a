# SPDX-License-Identifier: BSD-3-Clause
"""Results of a fixed length: what is in them, what is behind it, and what does not fit."""

import itertools

import numpy as np
import pytest

import halfshell as hs

LETTERS = "ijdDSP"
RNG = np.random.default_rng(20)
CUBE = np.eye(3) * 4.0
SKEWED = np.array([[4.0, 0.0, 0.0], [2.5, 3.0, 0.0], [1.5, 2.0, 3.5]])


def scene(n, d=3, seed=0):
    return np.random.default_rng(seed).uniform(-3.0, 8.0, (n, d))


def as_columns(found, letters):
    return dict(zip(letters, found if len(letters) > 1 else (found,)))


def check(find, n_i, n_j, index_dtype=np.int64):
    """`find` with capacities that fit, and ones that do not."""
    plain = as_columns(find(quantities=LETTERS, index_dtype=index_dtype), LETTERS)
    m = len(plain["i"])
    for capacity in {max(m, 1), m + 1, 2 * m + 7}:
        room = find(quantities=LETTERS, index_dtype=index_dtype, capacity=capacity)
        flagged = find(
            quantities=LETTERS, index_dtype=index_dtype, capacity=capacity, on_overflow="flag"
        )
        assert isinstance(flagged, tuple) and flagged[-1] == m
        for found in (room, flagged[:-1]):
            check_columns(as_columns(found, LETTERS), plain, m, capacity, n_i, n_j)
    for capacity in {1, m - 1} - {m, m + 1, 0, -1}:
        with pytest.raises(
            hs.CapacityError, match=f"capacity is {capacity}, but there are {m} pairs"
        ) as caught:
            find(quantities=LETTERS, capacity=capacity)
        assert caught.value.needed == m
        *none, needed = find(
            quantities=LETTERS, index_dtype=index_dtype, capacity=capacity, on_overflow="flag"
        )
        assert needed == m
        check_columns(as_columns(none, LETTERS), plain, 0, capacity, n_i, n_j)
    return m


def check_columns(found, plain, m, capacity, n_i, n_j):
    for letter, column in found.items():
        assert column.dtype == plain[letter].dtype
        assert column.shape == (capacity, *plain[letter].shape[1:])
        assert column.flags.c_contiguous and column.flags.writeable
        assert np.array_equal(column[:m], plain[letter][:m])
    rest = {letter: column[m:] for letter, column in found.items()}
    assert (rest["i"] == n_i).all() and (rest["j"] == n_j).all()
    assert (rest["P"] == (n_i, n_j)).all()
    assert (rest["d"] == np.inf).all()
    assert not rest["D"].any() and not rest["S"].any()


@pytest.mark.parametrize("n", [0, 1, 2, 30, 400])
@pytest.mark.parametrize("index_dtype, sort", [(np.int64, True), (np.int32, False)])
def test_rows_of_a_half_list(n, index_dtype, sort):
    points = scene(n)
    m = check(
        lambda **more: hs.pairs(points, 1.5, box=SKEWED, sort=sort, **more), n, n, index_dtype
    )
    assert (m > 0) == (n >= 2)


@pytest.mark.parametrize("d", range(1, 9))
def test_every_dimension(d):
    points = scene(60, d).astype((np.float32, np.float64)[d % 2])
    check(lambda **more: hs.pairs(points, 1.0 + d / 3.0, **more), 60, 60)
    box = np.full(d, 4.0)
    periodic = [k % 2 == 0 for k in range(d)]
    check(lambda **more: hs.pairs(points, 1.3, box=box, periodic=periodic, **more), 60, 60)


def test_each_letter_by_itself():
    for letters in (*LETTERS, "Sd", "ij"):
        points = scene(50)
        plain = as_columns(hs.pairs(points, 2.0, quantities=letters), letters)
        m = len(plain[letters[0]])
        room = as_columns(hs.pairs(points, 2.0, quantities=letters, capacity=m + 3), letters)
        *arrays, needed = hs.pairs(
            points, 2.0, quantities=letters, capacity=m + 3, on_overflow="flag"
        )
        assert needed == m
        for letter, array in zip(letters, arrays):
            assert np.array_equal(array, room[letter])
            assert np.array_equal(array[:m], plain[letter])
            assert len(array) == m + 3


@pytest.mark.parametrize("algorithm", ["all-pairs", "grid", "hash", "hierarchy"])
def test_every_algorithm(algorithm):
    points = scene(300)
    check(lambda **more: hs.pairs(points, 1.2, box=CUBE, algorithm=algorithm, **more), 300, 300)


def test_kernels_and_threads():
    points = scene(25_000) * 3.0
    options = {"capacity": 80_000, "quantities": LETTERS, "on_overflow": "flag"}
    again = hs.pairs(points, 1.0, quantities=LETTERS)
    for kernel, threads in itertools.product(hs.kernels(), (1, 2, 3)):
        found = hs.pairs(points, 1.0, kernel=kernel, threads=threads, **options)
        m = found[-1]
        assert 1000 < m == len(again[0]) <= 80_000
        for ours, theirs in zip(found, again):
            assert np.array_equal(ours[:m], theirs)


def test_reach_of_each_pair():
    points, radii = scene(200), RNG.uniform(0.1, 1.2, 200)
    types = np.arange(200) % 3
    check(lambda **more: hs.pairs(points, None, radii=radii, **more), 200, 200)
    check(
        lambda **more: hs.pairs(points, {(0, 1): 1.5, (2, 2): 1.0}, types=types, **more), 200, 200
    )
    supports = np.repeat(np.diag([1.0, 2.0, 3.0])[None], 200, axis=0)
    check(lambda **more: hs.pairs(points, None, supports=supports, extent=2.0, **more), 200, 200)


def test_many_systems():
    points, batch = scene(300), np.repeat([0, 1, 4], 100)
    boxes = np.stack([CUBE, SKEWED, CUBE, CUBE, 2.0 * SKEWED])
    check(lambda **more: hs.pairs(points, 1.3, box=boxes, batch=batch, **more), 300, 300)
    check(lambda **more: hs.pairs(points, [1.0, 2.0, 1.0, 1.0, 0.5], batch=batch, **more), 300, 300)
    radii = RNG.uniform(0.1, 1.0, 300)
    check(lambda **more: hs.pairs(points, None, radii=radii, batch=batch, **more), 300, 300)
    with pytest.raises(ValueError, match="batch must be ascending"):
        hs.pairs(points, 1.3, batch=batch[::-1], capacity=10)


@pytest.mark.parametrize("q", [0, 1, 70])
def test_two_sets(q):
    queries, points = scene(q, seed=1), scene(90, seed=2)
    check(lambda **more: hs.pairs_between(queries, points, 1.9, box=CUBE, **more), q, 90)
    radii = RNG.uniform(0.5, 2.0, q)
    check(
        lambda **more: hs.pairs_between(
            queries, points, None, query_radii=radii, rule="gather", **more
        ),
        q, 90,
    )  # fmt: skip


def test_cells():
    points = scene(120)
    cells = hs.CellList(points, 1.5, box=SKEWED)
    check(lambda **more: cells.pairs(**more), 120, 120)
    check(lambda **more: cells.pairs(1.0, sort=True, **more), 120, 120)


@pytest.mark.parametrize("find", [
    lambda **more: hs.pairs(scene(9), 1.0, **more),
    lambda **more: hs.pairs(scene(9), 1.0, batch=[0] * 9, **more),
    lambda **more: hs.pairs_between(scene(9), scene(9), 1.0, **more),
    hs.CellList(scene(9), 1.0).pairs,
])  # fmt: skip
def test_bad_arguments(find):
    for capacity in (0, -1, -(10**30), np.int64(0)):
        with pytest.raises(ValueError, match="capacity must be 1 or more, got"):
            find(capacity=capacity)
    for capacity in (2.0, True, "9", [9], np.ones(1), 1j, float("nan")):
        with pytest.raises(TypeError, match="capacity must be a whole number, got"):
            find(capacity=capacity)
    for word in ("cut", "", "Raise"):
        with pytest.raises(ValueError, match="on_overflow must be 'raise' or 'flag'"):
            find(capacity=9, on_overflow=word)
    for word in (None, 1, b"raise"):
        with pytest.raises(TypeError, match="on_overflow must be a string"):
            find(capacity=9, on_overflow=word)
    with pytest.raises(ValueError, match="on_overflow='flag' needs a capacity"):
        find(on_overflow="flag")
    out = np.empty(100, np.int64), np.empty(100, np.int64)
    with pytest.raises(ValueError, match="capacity and out are two ways"):
        find(capacity=100, out=out)
    for capacity in (2**61, 2**63, 10**40):
        with pytest.raises(MemoryError, match="arrays of capacity"):
            find(capacity=capacity)
    with pytest.raises(MemoryError, match="arrays of capacity 1000 would take 16 kB"):
        find(capacity=1000, memory_limit=999)
    with pytest.raises(ValueError, match="quantities"):
        find(capacity=10, quantities="x")


def test_numbers_of_numpy_and_words_that_are_not_the_default_itself():
    points = scene(20)
    word = "".join(["ra", "ise"])
    plain = hs.pairs(points, 2.0)
    found = hs.pairs(points, 2.0, capacity=np.int32(500), on_overflow=word)
    assert all(np.array_equal(a[: len(b)], b) for a, b in zip(found, plain))
    assert np.array_equal(hs.pairs(points, 2.0, on_overflow=word), plain)


def test_what_fails_otherwise_fails_as_it_does_without():
    points = scene(20)
    points[3, 1] = np.nan
    for on_overflow in ("raise", "flag"):
        with pytest.raises(ValueError, match=r"points\[3, 1\] = nan"):
            hs.pairs(points, 2.0, capacity=9, on_overflow=on_overflow)

    def stop(fraction):
        raise KeyError("stop")

    with pytest.raises(KeyError, match="stop"):
        hs.pairs(scene(200_000), 1.0, capacity=9, on_overflow="flag", progress=stop)


def test_what_is_no_pair_is_in_no_shell():
    points = [[0.0], [1.0], [3.0]]
    d, k = hs.pairs(points, [1.0, 2.5], quantities="dk", capacity=4, sort=True)
    assert d.tolist() == [1.0, 2.0, np.inf, np.inf] and k.tolist() == [0, 1, 2, 2]
    cells = hs.CellList(points, 2.5)
    again, needed = cells.pairs([1.0, 2.5], quantities="k", capacity=1, on_overflow="flag")
    assert again.tolist() == [2] and needed == 2
    for searched in (hs.pairs, lambda points, *rest, **how: cells.pairs(*rest, **how)):
        with pytest.raises(ValueError, match="touching cannot be combined with capacity"):
            searched(points, 1.0, touching=[1], capacity=4)
