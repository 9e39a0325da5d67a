# SPDX-License-Identifier: BSD-3-Clause
"""Points and queries in every form of array give the same bytes, from every function."""

import numpy as np
import pytest

import halfshell as hs
from calls import call

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
MATRICES = np.repeat(np.eye(3)[None] * 10.0, 200, axis=0)


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
    "cutoffs": (lambda c: hs.pairs(POINTS, c, quantities="ijk"), (np.array([0.05, 0.1]),)),
    "radii": (lambda r: call(hs.neighbors, POINTS, None, radii=r).indices, (RADII,)),
    "supports": (
        lambda H: hs.neighbors(hs.Points(POINTS, supports=H), 1.0).indices,
        (MATRICES,),
    ),
    "types": (lambda t: call(hs.rdf, POINTS, 0.1, types=t, box=BOX).counts, (TYPES,)),
    "batch": (lambda k: call(hs.pairs, POINTS, 0.1, batch=k), (NUMBERS // 50,)),
    "pairs": (lambda k: hs.pairs(POINTS, 0.2, exclude=k), (np.array([[0, 1], [2, 3]]),)),
    "labels": (lambda k: hs.pairs(hs.Points(POINTS, labels=k), 0.2, exclude=0), (NUMBERS // 3,)),
    "groups": (lambda k: call(hs.pairs, POINTS, 0.2, groups=k), (NUMBERS // 3,)),
    "touching": (lambda k: hs.pairs(POINTS, 0.2, indices=k), (NUMBERS[5:9],)),
    "indices": (lambda k: hs.neighbors(POINTS, 0.2, indices=k).indices, (NUMBERS[5:9],)),
    "edges, weights": (
        lambda e, w: hs.pair_histogram(hs.Points(POINTS, weights=w), e),
        (EDGES, WEIGHTS),
    ),
    "lists": (lambda i, j: hs.measure(POINTS, i, j), (NUMBERS[:9], NUMBERS[1:10])),
    "checked": (lambda i, j: str(hs.verify(POINTS, 0.2, i, j)), hs.pairs(POINTS, 0.2)),
    "rows": (lambda k: hs.neighbors(POINTS, 0.2)[k].indices, (NUMBERS[5:9],)),
    "mask of rows": (lambda k: hs.neighbors(POINTS, 0.2)[k].indices, (NUMBERS % 2 == 0,)),
    "frames": (lambda x: list(hs.trajectory_pairs(x, 0.2))[1], (POINTS.reshape(2, 100, 3),)),
    "step": (lambda x, b: hs.VerletList(0.2, box=BOX).update(x, b), (POINTS, np.eye(3) * 1.1)),
    "keys": (dynamic, (NUMBERS, POINTS)),
    "nodes": (lambda *a: connectivity(*a).pairs.view(), (POINTS, RADII, NUMBERS)),
    "nodes of ellipsoids": (lambda *a: connectivity(*a).pairs.view(), (POINTS, MATRICES, NUMBERS)),
    "pairs of nodes": (
        lambda k: connectivity(POINTS, RADII, NUMBERS, exclude=k).pairs.view(),
        (np.array([[0, 0, 1, 0]]),),
    ),
    "corners": (
        lambda k: connectivity(POINTS, RADII, NUMBERS, order="morton", morton_box=k).pairs.view(),
        (np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]),),
    ),
    "kept nodes": (patched, ((NUMBERS % 2 == 0)[None], (NUMBERS // 2)[None])),
    "bricks": (lambda x: hs.bricks(x, 0.2, 2)[0].pairs(x), (POINTS,)),
    "vectors": (lambda b, x: hs.Box(b).wrap(x), (np.eye(3) * 0.3, POINTS)),
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
