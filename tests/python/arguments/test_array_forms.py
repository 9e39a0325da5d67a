# SPDX-License-Identifier: BSD-3-Clause
"""Points and queries in every form of array give the same bytes, from every function."""

import numpy as np
import pytest

import halfshell as hs

RNG = np.random.default_rng(5)
POINTS, QUERIES = RNG.random((200, 3)), RNG.random((60, 3))
TYPES, WEIGHTS = RNG.integers(0, 3, 200), RNG.standard_normal(200)
BOX, EDGES = [1.0, 1.0, 1.0], np.linspace(0.0, 0.4, 9)


class Subclass(np.ndarray):
    pass


def strided(array):
    wide = np.zeros((2 * len(array), 7))
    wide[::2, 1::2] = array
    return wide[::2, 1::2]


def read_only(array):
    array = array.copy()
    array.flags.writeable = False
    return array


def unaligned(array):
    result = np.ndarray(array.shape, np.float64, bytearray(array.nbytes + 1), 1)
    result[...] = array
    return result


def field(array):
    records = np.zeros(len(array), [("mark", "i1"), ("place", "f8", 3)])
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
        *(a for t in tables for a in (t.offsets, t.indices, t.distances, t.vectors, t.shifts)),
        hs.coordination(points, 0.3, queries=queries, box=BOX),
        hs.pair_histogram(points, EDGES, queries=queries, box=BOX),
        hs.pair_histogram(points, EDGES, types=TYPES, weights=WEIGHTS, box=BOX),
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
    assert before == (bytes(np.asarray(points, float)), bytes(np.asarray(queries, float)))


def test_a_file_in_memory(tmp_path):
    for mode in ("w+", "r"):
        mapped = np.memmap(tmp_path / "points", np.float64, mode, shape=POINTS.shape)
        if mode == "w+":
            mapped[...] = POINTS
        assert answers(mapped, QUERIES) == EXPECTED
        assert answers(POINTS, mapped[:60]) == answers(POINTS, POINTS[:60])


def test_sets_may_share_memory():
    rows = RNG.random((300, 3))
    for points, queries in (
        (rows[:200], rows[150:250]),
        (rows[:200], rows[:200]),
        (rows[:200], rows[199::-1]),
    ):
        assert answers(points, queries) == answers(points.copy(), queries.copy())
