# SPDX-License-Identifier: BSD-3-Clause
"""Points and queries in every form of array give the same bytes, from every function."""

import numpy as np
import pytest

import halfshell as hs
from calls import call
from oracles import as_set, check, same_arrays

RNG = np.random.default_rng(5)
POINTS, QUERIES = RNG.random((200, 3)), RNG.random((60, 3))
TYPES, WEIGHTS = RNG.integers(0, 3, 200), RNG.standard_normal(200)
BOX, EDGES = [1.0, 1.0, 1.0], np.linspace(0.0, 0.4, 9)


class Subclass(np.ndarray):
    pass


def strided(array):
    wide = np.zeros((2 * len(array), 7), array.dtype)
    wide[::2, 1::2] = array
    return wide[::2, 1::2]


def read_only(array):
    array = array.copy()
    array.flags.writeable = False
    return array


def unaligned(array):
    result = np.ndarray(array.shape, array.dtype, bytearray(array.nbytes + 1), 1)
    result[...] = array
    return result


def field(array):
    records = np.zeros(len(array), [("mark", "i1"), ("place", array.dtype, 3)])
    records["place"] = array
    return records["place"]


FORMS = {
    "list": np.ndarray.tolist,
    "Fortran": np.asfortranarray,
    "strided": strided,
    "backwards": lambda array: array[::-1].copy()[::-1],
    "other byte order": lambda array: array.astype(array.dtype.newbyteorder()),
    "read-only": read_only,
    "unaligned": unaligned,
    "field": field,
    "subclass": lambda array: array.view(Subclass),
    "unmasked": np.ma.array,
    "objects": lambda array: array.astype(object),
    "memoryview": memoryview,
}


def answers(points, queries):
    """The bytes of what all functions say."""
    cells = hs.CellList(points, 0.3, box=BOX)
    radii = np.linspace(0.0, 0.35, len(queries))
    tables = [
        hs.neighbors(points, 0.3, box=BOX, quantities="jdDS"),
        hs.neighbors(points, 0.3, queries=queries, box=BOX, quantities="jdDS"),
        cells.query(queries, 0.2, quantities="jdDS"),
        cells.query(queries, radii, quantities="jdDS"),
    ]
    arrays = [
        *hs.pairs_between(queries, points, 0.3, box=BOX, quantities="ijdDS"),
        *hs.nearest(points, 5, queries=queries, box=BOX, quantities="jdDS"),
        *(a for t in tables for a in (t.offsets, t.indices, t.distances, t.vectors, t.shifts)),
        hs.coordination(points, 0.3, queries=queries, box=BOX),
        hs.pair_histogram(points, EDGES, queries=queries, box=BOX),
        call(hs.pair_histogram, points, EDGES, types=TYPES, weights=WEIGHTS, box=BOX),
        hs.count_pairs(points, [0.1, 0.3], queries=queries, box=BOX),
        hs.rdf(points, 0.4, 7, queries=queries, box=BOX).g,
        cells.cell_of(queries),
        *cells.candidates(queries),
        *(a for block in hs.iter_pairs(points, 0.3, max_pairs=99, box=BOX) for a in block),
    ]
    seen = []
    hs.for_each_pair(points, 0.3, lambda *pair: seen.append(pair), box=BOX)
    return [array.tobytes() for array in arrays], seen


EXPECTED = answers(POINTS, QUERIES)


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_the_form_of_an_array_changes_nothing(form):
    points, queries = form(POINTS), form(QUERIES)
    before = bytes(np.asarray(points, float)), bytes(np.asarray(queries, float))
    assert answers(points, queries) == EXPECTED
    assert answers(POINTS, queries) == EXPECTED
    single = POINTS.astype(np.float32)
    found = hs.pairs(form(single), 0.3, box=BOX, quantities="ijSdD")
    expected = hs.pairs(single, 0.3, box=BOX, quantities="ijSdD")
    assert [a.tobytes() for a in found] == [a.tobytes() for a in expected]
    assert before == (bytes(np.asarray(points, float)), bytes(np.asarray(queries, float)))


def test_a_file_in_memory(tmp_path):
    for mode in ("w+", "r"):
        mapped = np.memmap(tmp_path / "points", np.float64, mode, shape=POINTS.shape)
        if mode == "w+":
            mapped[...] = POINTS
        assert answers(mapped, QUERIES) == EXPECTED
        assert answers(POINTS, mapped[:60]) == answers(POINTS, POINTS[:60])


# ---- memoryviews, wherever an array is taken -----------------------------------------------

NUMBERS = np.arange(200)
RADII = np.full(200, 0.05)


def connectivity(*arrays, **how):
    points, h, ids = arrays
    return hs.Connectivity([hs.NodeList("a", points, h, ids=ids)], **how)


def dynamic(keys, points):
    made = hs.DynamicCellList(3, 0.5)
    made.insert_many(keys, points)
    made.insert(-1, memoryview(POINTS[0]))
    return sorted(made.remove_many(keys[:3])), made.within_many(points, 0.1)[0]


def patched(keep, old2new):
    made = connectivity(POINTS, RADII, NUMBERS)
    made.patch(keep, old2new)
    return made.pairs.view()


TAKEN = {
    "points, box": (lambda x, b: hs.pairs(x, 0.1, box=b), (POINTS, np.eye(3))),
    "periodic": (
        lambda x, p: hs.pairs(x, 0.1, box=BOX, periodic=p),
        (POINTS, np.array([True, False, True])),
    ),
    "radii": (lambda r: call(hs.neighbors, POINTS, None, radii=r).indices, (RADII,)),
    "batch": (lambda k: call(hs.pairs, POINTS, 0.1, batch=k), (NUMBERS // 50,)),
    "edges, weights": (
        lambda e, w: hs.pair_histogram(hs.Points(POINTS, weights=w), e),
        (EDGES, WEIGHTS),
    ),
    "rows": (lambda k: hs.neighbors(POINTS, 0.2)[k].indices, (NUMBERS[5:9],)),
    "keys": (dynamic, (NUMBERS, POINTS)),
    "nodes": (lambda *a: connectivity(*a).pairs.view(), (POINTS, RADII, NUMBERS)),
    "kept nodes": (patched, ((NUMBERS % 2 == 0)[None], (NUMBERS // 2)[None])),
}


@pytest.mark.parametrize("name", TAKEN)
def test_memoryviews(name):
    call, arrays = TAKEN[name]
    expected, found = call(*arrays), call(*map(memoryview, arrays))
    pairs = zip(found, expected, strict=True) if isinstance(found, tuple) else [(found, expected)]
    for one, other in pairs:
        assert np.array_equal(one, other)


def test_a_memoryview_of_numbers_is_no_list_of_nodes():
    with pytest.raises(TypeError, match="lists must be of NodeList, got ndarray"):
        hs.Connectivity(memoryview(POINTS))


@pytest.fixture
def points(rng):
    """Coordinates that float16 and float32 hold exactly."""
    return rng.integers(-32, 32, (30, 3)) / 16


def test_integers_and_booleans_are_taken_as_they_are(rng):
    for dtype in "bhilqBHILQ?":
        for kernel in hs.kernels():
            whole = rng.integers(0, 2 if dtype == "?" else 12, (25, 3)).astype(dtype)
            plain = whole.astype(float)
            assert same_arrays(
                call(hs.pairs, whole, 3, quantities="ijd", kernel=kernel),
                call(hs.pairs, plain, 3.0, quantities="ijd", kernel=kernel),
            )
            assert same_arrays(
                call(hs.pairs, whole, 3, box=[5, 6, 7], quantities="ijdS", kernel=kernel),
                call(hs.pairs, plain, 3.0, box=[5.0, 6.0, 7.0], quantities="ijdS", kernel=kernel),
            )


def test_large_integers_that_float64_holds_are_exact():
    points = np.array([[2**53, 0], [2**53 - 1, 0], [2**62, 2**40], [2**62, 2**40 + 1]])
    assert as_set(*hs.pairs(points, 1)) == {(0, 1, ()), (2, 3, ())}
    assert as_set(*hs.pairs(points.astype(np.uint64), 1)) == {(0, 1, ()), (2, 3, ())}


def test_float32_values_are_not_rounded_again(rng):
    # 0.1f is 0.100000001490116...: a pair at that distance is beyond a cutoff of 0.1.
    points = np.array([[0.0], [0.1]], np.float32)
    assert check(points, 0.1) == set()
    assert len(check(points, np.float32(0.1))) == 1
    crowd = rng.random((60, 3)).astype(np.float32)
    box = rng.random((3, 3)).astype(np.float32) + np.eye(3, dtype=np.float32)
    check(crowd, 0.3, box)
