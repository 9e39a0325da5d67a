# SPDX-License-Identifier: BSD-3-Clause
"""Tables of neighbours: rows, and what they turn into."""

import copy
import errno
import io
import itertools
import pickle
from functools import partial

import numpy as np
import pytest
import scipy.sparse
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

import halfshell as hs
from full_lists import same_tables
from oracles import BOX_KINDS, random_scene, same_arrays
from refused_calls import assert_refused
from scene_strategies import scenes

POINTS = np.random.default_rng(47).random((30, 2)) * 4.0
NAMES = {"j": "indices", "d": "distances", "D": "vectors", "S": "shifts"}


@pytest.fixture
def table():
    """Thirty points on a torus, each with several neighbours and no images."""
    return hs.neighbors(POINTS, 1.0, box=[4.0, 4.0], quantities="jdDS")


@pytest.fixture
def tiny():
    """Three points in a box so small that each meets many images of all."""
    return hs.neighbors(POINTS[:3], 1.7, box=[1.0, 1.1], quantities="dSj")


def with_queries(**how):
    return hs.neighbors(POINTS, 1.0, queries=POINTS[:5] + 0.1, quantities="jdS", **how)


def columns(table):
    return [getattr(table, NAMES[letter]) for letter in table.quantities]


# ---- rows ----------------------------------------------------------------------------------


def test_facts(table):
    assert table.n_rows == table.n_points == len(table) == 30
    assert table.shape == (30, 30) and with_queries().shape == (5, 30)
    assert table.n_entries == len(table.indices) == table.counts.sum() == table.offsets[-1]
    assert table.counts.dtype == np.int64
    heading = f"NeighborTable(30 rows, {table.n_entries} entries, quantities 'jdDS')"
    assert repr(table).startswith(heading + "\n0: ")


def test_first_rows_are_shown():
    points = np.append(np.zeros(12), [5.0, 9.0])[:, None]
    lines = repr(hs.neighbors(points, 4.0, quantities="dj")).split("\n")
    assert lines[1] == "0: " + ", ".join(f"{k} (0)" for k in range(1, 9)) + ", ..."
    assert len(lines) == 7 and lines[-1] == "..."
    table = hs.neighbors([[0.0], [1 / 3], [9.0]], 1.0, quantities="Dd")
    assert repr(table) == (
        "NeighborTable(3 rows, 2 entries, quantities 'Dd')\n0: 0.3333\n1: 0.3333\n2:"
    )
    assert repr(hs.neighbors([[0.0, 1.0], [0.0, 0.5]], 1.0, quantities="D")).endswith("[0 0.5]")
    assert repr(hs.neighbors(np.empty((0, 2)), 1.0)) == (
        "NeighborTable(0 rows, 0 entries, quantities 'j')"
    )
    assert "<th>1</th>" in table._repr_html_() and "0.3333" in table._repr_html_()


def test_rows_are_views(table):
    for k in (*range(30), -1, -30, np.int32(4), np.int64(-2)):
        row = table[k]
        first, end = table.offsets[k % 30 : k % 30 + 2]
        assert len(row) == 4
        for part, column in zip(row, columns(table)):
            assert np.shares_memory(part, column) or len(part) == 0
            assert not part.flags.writeable
            assert np.array_equal(part, column[first:end])
    bare = hs.neighbors(POINTS, 1.0)
    assert isinstance(bare[3], np.ndarray) and bare[3].base is not None
    assert bare[3].tolist() == sorted(bare[3].tolist())


def test_rows_that_are_not_there(table):
    for key in (30, -31, 10**30):
        assert_refused(partial(table.__getitem__, key), IndexError, "of a table of 30 rows")
    for key in (1.0, "1", None, (1, 2), np.float64(1.0), np.array(1.0)):
        assert_refused(partial(table.__getitem__, key), TypeError, "whole number")


def test_what_was_not_asked_for_is_named():
    for letters in ("j", "d", "D", "S", "dS"):
        table = hs.neighbors(POINTS, 1.0, quantities=letters)
        for letter, name in NAMES.items():
            if letter in letters:
                assert len(getattr(table, name)) == table.n_entries
            else:
                assert not hasattr(table, name)
                assert_refused(
                    partial(getattr, table, name),
                    AttributeError, name, f"'{letter}' in quantities, got '{letters}'",
                )  # fmt: skip


def test_copies_and_pickles(table):
    for part in (table, table.filter(table.distances < 0.7), table[3:9], table.sort()):
        for again in (pickle.loads(pickle.dumps(part)), copy.copy(part), copy.deepcopy(part)):
            assert same_tables(part, again) and repr(again) == repr(part)
            assert not any(array.flags.writeable for array in again._arrays)
            assert again.shape == part.shape
    assert np.array_equal(pickle.loads(pickle.dumps(table)).reverse(), table.reverse())


# ---- files ---------------------------------------------------------------------------------


def through_a_file(table):
    file = io.BytesIO()
    table.save(file)
    file.seek(0)
    return hs.NeighborTable.load(file)


@given(scenes(), st.sampled_from(["j", "jd", "dSj", "DdjS", "S"]), st.booleans())
def test_files_give_the_same_table(scene, letters, of_queries):
    queries = scene.points[::2] if of_queries else None
    table = hs.neighbors(
        scene.points, scene.cutoff, box=scene.box, periodic=scene.periodic,
        inclusive=scene.inclusive, quantities=letters, queries=queries,
    )  # fmt: skip
    for part in (table, table[1:], table[[0, 0]] if len(table) else table):
        again = through_a_file(part)
        assert same_tables(part, again) and again.shape == part.shape
        assert not again.offsets.flags.writeable
        if {"j", "d"} <= set(letters):
            assert same_tables(part.sort(), again.sort())
            assert same_tables(part.sort(), through_a_file(through_a_file(part)).sort())
        if "j" in letters and queries is None:
            assert np.array_equal(through_a_file(table).reverse(), table.reverse())


def test_files_of_many_systems_and_few_rows(rng):
    points, batch = rng.random((60, 3)), np.repeat([0, 1, 2], 20)
    boxes = np.stack([np.eye(3) * size for size in (1.0, 1.1, 1.2)])
    known = hs.Points(points, box=boxes, batch=batch)
    for letters in ("jd", "jdS"):
        table = hs.neighbors(known, 0.5, quantities=letters)
        for part in (table, table[25:31], table[[59, 3]]):
            assert same_tables(through_a_file(part).sort(), part.sort())
            assert same_tables(pickle.loads(pickle.dumps(part)).sort(), part.sort())


def test_broken_files_are_refused(table, tmp_path):
    path, load = tmp_path / "rows.npz", partial(hs.NeighborTable.load, tmp_path / "rows.npz")
    table.sort().save(path)
    whole = path.read_bytes()
    array = io.BytesIO()
    np.save(array, np.arange(3))
    path.write_bytes(array.getvalue())
    assert_refused(load, ValueError, "no file of a NeighborTable")
    for end in (0, 1, 50, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:end])
        assert_refused(load, ValueError, "^this is no file of a NeighborTable, or is broken: ")
    for at in range(40, len(whole), 997):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 8]) + whole[at + 1 :])
        try:
            assert same_tables(load(), table.sort())  # where it says nothing of the arrays
        except ValueError as error:
            assert "\n" not in str(error)
    np.savez(path, i=np.arange(3))
    assert_refused(load, ValueError, "no file of a NeighborTable")
    path.write_bytes(whole)
    with np.load(path) as stored:
        state = dict(stored)
    m, d = table.n_entries, table.distances
    for other in (
        {"j": np.full(m, 30)}, {"j": np.full(m, -1)}, {"d": d[1:]}, {"S": np.zeros((m, 2))},
        {"offsets": np.arange(31)}, {"offsets": np.array([], int)}, {"quantities": "jk"},
        {"n_points": 29}, {"n_points": -1}, {"offsets": table.offsets[::-1]}, {"D": d},
        {"quantities": 3}, {"j": np.full(m, object())}, {"j": table.indices.astype(">i8")},
        {"origin_points": np.zeros((30, 3))}, {"origin_points": np.zeros(30)}, {"d": "words"},
    ):  # fmt: skip
        np.savez(path, **(state | other))
        assert_refused(load, ValueError, "^this is no file of a NeighborTable, or is broken: ")
    np.savez(path, **(state | {"format": 2}))
    assert_refused(load, ValueError, "in format 2, and this version of halfshell reads format 1$")


# ---- filter and sort -----------------------------------------------------------------------


@pytest.mark.parametrize("fixture", ["table", "tiny"])
def test_filter(fixture, request, rng):
    table = request.getfixturevalue(fixture)
    for mask in (rng.random(table.n_entries) < 0.5, np.zeros(table.n_entries, bool),
                 np.ones(table.n_entries, bool), table.distances > 0.8):  # fmt: skip
        part = table.filter(mask)
        assert len(part) == len(table) and part.shape == table.shape
        for k, (first, end) in enumerate(itertools.pairwise(table.offsets.tolist())):
            keep = mask[first:end]
            assert same_arrays(part[k], tuple(column[keep] for column in table[k]))
    assert same_tables(table.filter(np.ones(table.n_entries, bool)), table)
    assert same_tables(table.filter((table.distances > 0.8).tolist()), part)


def test_filter_refuses_other_masks(table):
    m = table.n_entries
    assert_refused(lambda: table.filter(np.ones(m - 1, bool)), ValueError, rf"\({m},\)")
    assert_refused(lambda: table.filter(True), ValueError, r"mask must have shape")
    assert_refused(lambda: table.filter(np.ones(m, int)), TypeError, "bools, got dtype int64")
    assert_refused(lambda: table.filter(np.arange(3)), ValueError, "mask")
    assert_refused(lambda: table.filter("mask"), TypeError, "mask")


# ---- pairs ---------------------------------------------------------------------------------


def test_to_pairs(table):
    i = np.repeat(np.arange(30), table.counts)
    found = table.to_pairs(quantities="SPDdji")
    expected = (table.shifts, np.stack((i, table.indices), axis=1), table.vectors,
                table.distances, table.indices, i)  # fmt: skip
    assert same_arrays(found, expected)
    assert same_arrays(table.to_pairs(), (i, table.indices))
    assert np.shares_memory(table.to_pairs(quantities="d"), table.distances)
    assert np.array_equal(table.to_pairs(quantities="i"), i)
    narrow = hs.neighbors(POINTS, 1.0, index_dtype=np.int32).to_pairs(quantities="ijP")
    assert [array.dtype for array in narrow] == [np.int32] * 3
    assert hs.neighbors(POINTS, 1.0, quantities="d").to_pairs(quantities="i").dtype == np.int64


def test_half_needs_shifts_only_for_own_images():
    i, j = hs.neighbors(POINTS, 1.0, box=[4.0, 4.0]).to_pairs(half=True)
    expected = hs.pairs(POINTS, 1.0, box=[4.0, 4.0], sort=True)
    assert same_arrays((i, j), expected)
    bare = hs.neighbors(POINTS[:3], 1.7, box=[1.0, 1.1])
    assert_refused(lambda: bare.to_pairs(half=True), AttributeError, "'S' in quantities")
    for part in (with_queries(), bare[:2]):
        assert_refused(lambda part=part: part.to_pairs(half=True), ValueError, "one set of points")


def test_to_pairs_refuses_other_letters(table):
    for letters in ("", "x", "ii", "i j"):
        assert_refused(
            lambda letters=letters: table.to_pairs(quantities=letters), ValueError, "i j d D S P"
        )
    assert_refused(lambda: table.to_pairs(quantities=None), TypeError, "quantities")
    bare = hs.neighbors(POINTS, 1.0, quantities="d")
    assert_refused(lambda: bare.to_pairs(), AttributeError, "'j' in quantities")
    assert_refused(lambda: bare.to_pairs(quantities="iS"), AttributeError, "'S' in quantities")
    assert_refused(lambda: bare.to_pairs(quantities="P"), AttributeError, "'j' in quantities")


@given(scenes(), st.randoms(), st.booleans())
def test_from_pairs_makes_the_table_of_a_search(scene, random, is_half):
    how = {"box": scene.box, "periodic": scene.periodic, "inclusive": scene.inclusive}
    table = hs.neighbors(scene.points, scene.cutoff, quantities="jdDS", **how)
    if is_half:
        i, j, d, D, S = hs.pairs(scene.points, scene.cutoff, quantities="ijdDS", **how)
    else:
        i, j, d, D, S = table.to_pairs(quantities="ijdDS")
    order = random.sample(range(len(i)), len(i))
    i, j, d, D, S = (column[order] for column in (i, j, d, D, S))
    made = hs.NeighborTable.from_pairs(
        i, j, S, n_points=len(scene.points), distances=d, vectors=D, half=is_half
    )
    assert same_tables(made, table)
    assert np.array_equal(made.reverse(), table.reverse())
    assert same_arrays(made.to_pairs(half=True), table.to_pairs(half=True))
    bare = hs.NeighborTable.from_pairs(i, j, n_points=len(scene.points), half=is_half)
    assert np.array_equal(bare.indices, table.indices) and bare.quantities == "j"
    assert np.array_equal(bare.offsets, table.offsets)
    if len(np.unique(np.stack([i, j]), axis=1).T) == len(i):
        assert np.array_equal(bare.reverse(), table.reverse())
    else:
        assert_refused(bare.reverse, AttributeError, "'S' in quantities")


def test_from_pairs_refuses_what_are_no_pairs():
    make = partial(hs.NeighborTable.from_pairs, n_points=3)
    for call, kind, words in (
        (partial(make, [5], [0], n_queries=5), ValueError, "queries, from 0 to 4"),
        (partial(make, [0, 1], [1]), ValueError, "same length"),
        (partial(make, [0], [1], [0]), ValueError, "S must have shape"),
        (partial(make, [0], [1], 0), ValueError, "S must have shape"),
        (partial(make, [0], [1], [[2**31]]), OverflowError, "S must fit int32"),
        (partial(make, [0], [1], [[-(2**31)]], half=True), OverflowError, "no opposite"),
        (partial(make, [0], [1], distances=[1.0, 2.0]), ValueError, "distances must be one"),
        (partial(make, [0], [1], vectors=[1.0]), ValueError, "vectors must be one"),
        (partial(make, [0], [1], distances=["a"]), TypeError, "distances"),
        (partial(make, [0, 0], [1, 1], [[1], [1]]), ValueError, "there twice with S = "),
        (partial(make, [0, 1], [1, 0], [[1], [-1]], half=True), ValueError, "there twice"),
        (partial(make, [0, 1], [1, 1], [[1], [0]]), ValueError, "pair 1 is point 1 and itself"),
        (partial(make, [0], [1], half=True, n_queries=3), ValueError, "do not give n_queries"),
        (partial(make, [0], [1], n_points=2**31), ValueError, "n_points must be from 0"),
    ):
        assert_refused(call, kind, words)


# ---- graphs and matrices -------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_to_scipy(dtype, rng):
    points = np.concatenate([rng.random((80, 3)), np.full((3, 3), 0.5)])  # three in one place
    table = hs.neighbors(points, 0.4, quantities="dj", index_dtype=dtype)
    matrix = table.to_scipy()
    assert isinstance(matrix, scipy.sparse.csr_array)
    assert matrix.shape == (83, 83) and matrix.nnz == table.n_entries
    assert matrix.dtype == np.float64 and matrix.has_canonical_format
    assert (matrix.data == 0).sum() == 6
    assert np.array_equal(matrix.data, table.distances)
    assert np.array_equal(matrix.indices, table.indices)
    theirs = cKDTree(points).sparse_distance_matrix(cKDTree(points), 0.4).tocsr()
    np.testing.assert_allclose(matrix.toarray(), theirs.toarray(), rtol=1e-14)
    matrix.data[:] = 1.0  # a copy: the table stays as it is
    assert table.distances.min() == 0.0
    assert scipy.sparse.csgraph.connected_components(matrix)[0] >= 1


def test_to_scipy_with_images(tiny):
    for table in (tiny, tiny.sort()):
        assert_refused(
            lambda table=table: table.to_scipy(), ValueError, "row 0 .* images of point 0", "'min'"
        )
        matrix = table.to_scipy(duplicates="min").toarray()
        for i, j in itertools.product(range(3), repeat=2):
            d, _, number = tiny[i]
            assert matrix[i, j] == d[number == j].min()
    assert_refused(lambda: tiny.to_scipy("max"), ValueError, "'raise' or 'min', got 'max'")


def test_to_scipy_needs_both_quantities():
    for letters, missing in (("d", "j"), ("j", "d")):
        table = hs.neighbors(POINTS, 1.0, quantities=letters)
        assert_refused(lambda table=table: table.to_scipy(), AttributeError, f"'{missing}'")


def test_to_padded(table):
    longest = int(table.counts.max())
    for capacity in (None, longest, longest + 5):
        for letter, fill in (("j", -1), ("j", 30), ("d", np.inf), ("d", -1), ("D", np.nan),
                             ("S", 0)):  # fmt: skip
            array = table.to_padded(capacity, fill, quantity=letter)
            column = getattr(table, NAMES[letter])
            assert array.dtype == column.dtype and array.flags.writeable
            assert array.shape == (30, capacity or longest, *column.shape[1:])
            for row, (first, end) in zip(array, itertools.pairwise(table.offsets)):
                assert np.array_equal(row[: end - first], column[first:end])
                assert np.array_equal(
                    row[end - first :], np.full_like(row[end - first :], fill), equal_nan=fill != 0
                )
    assert np.array_equal(table.to_padded(), table.to_padded(longest, -1, quantity="j"))
    empty = hs.neighbors(np.empty((0, 2)), 1.0)
    assert empty.to_padded().shape == (0, 0) and empty.to_padded(4).shape == (0, 4)
    assert hs.neighbors(np.zeros((2, 2)), 0.0, inclusive=False).to_padded().shape == (2, 0)


def test_to_padded_refuses_what_does_not_fit(table):
    longest = int(table.counts.max())
    row = int(table.counts.argmax())
    with pytest.raises(hs.CapacityError, match=f"row {row} has {longest} entries") as caught:
        table.to_padded(longest - 1)
    assert caught.value.needed == longest
    assert_refused(lambda: table.to_padded(-1), ValueError, "capacity")
    assert_refused(lambda: table.to_padded(5.0), TypeError, "capacity")
    assert_refused(lambda: table.to_padded(quantity="i"), ValueError, "j d D S k, got 'i'")
    for fill in (np.nan, 0.5, 2**63, -(2**63) - 2**12):
        assert_refused(lambda fill=fill: table.to_padded(fill=fill), ValueError, "fill")
    narrow = hs.neighbors(POINTS, 1.0, index_dtype=np.int32)
    assert_refused(lambda: narrow.to_padded(fill=2**31), ValueError, "int32")
    for fill in ("0", None, [1], 1j):
        assert_refused(lambda fill=fill: table.to_padded(fill=fill), TypeError, "fill")
    bare = hs.neighbors(POINTS, 1.0)
    assert_refused(lambda: bare.to_padded(quantity="d"), AttributeError, "'d' in quantities")


# ---- the other direction -------------------------------------------------------------------


def assert_reverses(table, other, shifts=None, vectors=None):
    """Entry other[e] is (j, i, -S) of entry e."""
    i, j = table.to_pairs()
    assert other.dtype == np.int64 and other.shape == i.shape
    assert np.array_equal(i[other], j) and np.array_equal(j[other], i)
    assert np.array_equal(other[other], np.arange(len(i)))
    shifts = table.shifts if shifts is None else shifts
    assert np.array_equal(shifts[other], -shifts)


@given(scenes())
def test_reverse(scene):
    how = {"box": scene.box, "periodic": scene.periodic, "inclusive": scene.inclusive}
    table = hs.neighbors(scene.points, scene.cutoff, quantities="jdDS", **how)
    assert_reverses(table, table.reverse())
    # Without shifts it is the same.
    bare = hs.neighbors(scene.points, scene.cutoff, index_dtype=np.int32, **how)
    assert np.array_equal(bare.reverse(), table.reverse())
    ordered = table.sort(by="distance")
    assert_reverses(ordered, ordered.reverse())


@given(scenes(), st.integers(0, 2**32))
def test_reverse_of_filtered_tables(scene, seed):
    how = {"box": scene.box, "periodic": scene.periodic, "inclusive": scene.inclusive}
    table = hs.neighbors(scene.points, scene.cutoff, quantities="jdS", **how)
    keep = np.random.default_rng(seed).random(table.n_entries) < 0.6
    both = table.filter(keep & keep[table.reverse()])
    assert_reverses(both, both.reverse())
    one = table.filter(keep)
    if np.array_equal(keep, keep[table.reverse()]):
        assert_reverses(one, one.reverse())
    else:
        assert_refused(lambda: one.reverse(), ValueError, "no reverse in this table")


def test_reverse_of_many_points(rng):
    # More points than 16 bits count, in a box with images and in one without.
    points, cutoff, box, _ = random_scene(rng, 70_000, neighbours=6, kind="triclinic")
    table = hs.neighbors(points, cutoff, box=box, quantities="jS")
    assert_reverses(table, table.reverse())
    slab = np.column_stack([np.linspace(0.0, 1000.0, 70_000), np.zeros(70_000)])
    table = hs.neighbors(slab, 0.03, box=[0.0, 0.01], periodic=[False, True], quantities="jS")
    assert (np.diff(table.indices) == 0).any()
    assert_reverses(table, table.reverse())


def test_reverse_refuses_what_has_none(table):
    assert_refused(lambda: with_queries().reverse(), ValueError, "one set of points")
    assert_refused(lambda: table[:30].reverse(), ValueError, "one set of points")
    near = hs.neighbors(POINTS, 1.0, quantities="jd")
    few = near.filter(near.distances < 0.7)
    assert_refused(lambda: few.reverse(), AttributeError, "'S' in quantities")
    assert_refused(lambda: near.sort().reverse(), AttributeError, "'S' in quantities")
    assert near.filter(np.ones(near.n_entries, bool)).reverse().shape == (near.n_entries,)
    assert_refused(
        lambda: hs.neighbors(POINTS, 1.0, quantities="d").reverse(), AttributeError, "'j'"
    )
    assert hs.neighbors(np.empty((0, 2)), 1.0).reverse().shape == (0,)


@pytest.mark.parametrize("n", [0, 7])
def test_rows_longer_than_memory_are_refused(n):
    table = hs.neighbors(np.arange(float(n)).reshape(n, 1), 1.0)
    for capacity in (2**40, 2**62, 2**63, 10**400):
        assert_refused(partial(table.to_padded, capacity), MemoryError, "capacity")
    assert_refused(partial(table.to_padded, True), TypeError, "capacity")


def mace_vectors(positions, edge_index, shifts):
    """As mace.modules.utils.get_edge_vectors_and_lengths has it."""
    sender, receiver = edge_index
    return positions[receiver] - positions[sender] + shifts


def nequip_vectors(pos, edge_index, cell, edge_cell_shift):
    """As nequip.data.AtomicDataDict.with_edge_vectors has it."""
    edge_vec = pos[edge_index[1]] - pos[edge_index[0]]
    return edge_vec + np.einsum("ni,ij->nj", edge_cell_shift, cell)


@pytest.mark.parametrize("kind", BOX_KINDS)
def test_the_formulas_of_graph_networks_hold(kind, rng):
    for ndim in (1, 2, 3, 4):
        points, cutoff, box, periodic = random_scene(rng, 40, ndim, kind, neighbours=8, spread=1)
        cell = np.eye(ndim) if box is None else box
        table = hs.neighbors(points, cutoff, box=box, periodic=periodic, quantities="SjDd")
        graph = table.graph()
        edge_index, shifts, vectors, distances = graph
        assert edge_index.shape == (2, table.n_entries) and edge_index.dtype == table.indices.dtype
        assert np.array_equal(edge_index, table.edge_index())
        assert shifts.dtype == np.int32 and vectors.dtype == np.float64
        close = {"rtol": 0.0, "atol": 1e-12 * (1.0 + np.abs(points).max() + np.abs(cell).max())}
        found = mace_vectors(points, edge_index, shifts @ cell)
        np.testing.assert_allclose(found, vectors, **close)
        found = nequip_vectors(points, edge_index, cell, shifts)
        np.testing.assert_allclose(found, vectors, **close)
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), distances, rtol=1e-12)
        # The formula for S and D of the table itself, in the docstring of edge_index.
        j, i = table.edge_index()
        found = points[j] - points[i] + table.shifts @ cell
        np.testing.assert_allclose(found, table.vectors, **close)
        assert not np.signbit(vectors[vectors == 0.0]).any()


def test_what_is_lacking_is_named():
    for letters in ("j", "jd", "jD", "jS", "DS"):
        table = hs.neighbors([[0.0], [1.0]], 1.0, quantities=letters)
        with pytest.raises(AttributeError, match="quantities='jDS'"):
            table.graph()


def expected(table, ordered):
    choose = itertools.permutations if ordered else itertools.combinations
    rows = itertools.pairwise(table.offsets.tolist())
    return sorted(pair for first, end in rows for pair in choose(range(first, end), 2))


def tables():
    rng = np.random.default_rng(0)
    yield hs.neighbors(rng.random((40, 3)), 0.4)
    yield hs.neighbors(rng.random((40, 2)), 0.05)  # nearly all rows are empty
    yield hs.neighbors(rng.random((5, 3)), 1.5, box=[1.0] * 3, quantities="jS")
    yield hs.neighbors(rng.random((9, 3)), 0.5, queries=rng.random((4, 3)))
    yield hs.neighbors(np.empty((0, 3)), 1.0)
    yield hs.neighbors([[0.0]], 1.0)
    yield hs.neighbors(rng.random((40, 3)), 0.4)[5:12]
    yield hs.neighbors(rng.random((40, 3)), 0.4)[[3, 1, 3]]


TABLES = list(tables())


@pytest.mark.parametrize("table", TABLES, ids=range(len(TABLES)))
def test_all_and_in_blocks(table):
    for ordered in (False, True):
        wanted = expected(table, ordered)
        first, second = table.triplets(ordered=ordered)
        assert first.dtype == second.dtype == np.int64
        assert list(zip(first.tolist(), second.tolist(), strict=True)) == wanted
        for block in (1, 7, 100, 10**9):
            parts = list(table.triplets(ordered=ordered, block=block))
            found = [pair for a, b in parts for pair in zip(a.tolist(), b.tolist(), strict=True)]
            assert found == wanted
            row = np.repeat(np.arange(len(table)), table.counts)
            assert all(len(a) <= block or len(set(row[a])) == 1 for a, _ in parts)
            assert all(len(a) > 0 for a, _ in parts)


def test_too_many_are_refused_before():
    points = np.zeros((3000, 1))
    table = hs.neighbors(points, 1.0, queries=[[0.0]])
    assert len(table.triplets()[0]) == 3000 * 2999 // 2
    huge = hs.neighbors(np.zeros((10**6, 1)), 1.0, queries=[[0.0]])
    with pytest.raises(MemoryError, match="triplets"):
        huge.triplets()
    with pytest.raises(MemoryError, match="triplets"):
        next(huge.triplets(block=1000))
    assert_refused(partial(huge.triplets, block=0), ValueError, "block must be 1")


@pytest.mark.parametrize("bad", [1, True, -1, 2.5, None, [b"x"], io.StringIO()])
def test_a_file_of_a_wrong_kind_is_refused(bad):
    table = hs.neighbors([[0.0], [1.0]], 1.5)
    for call in (table.save, hs.NeighborTable.load):
        with pytest.raises(TypeError, match="file must be a path or a binary file, got "):
            call(bad)


def test_a_file_that_cannot_be_read_is_an_error_of_the_system():
    class Broken(io.BytesIO):
        def read(self, size=-1):
            raise OSError(errno.EIO, "input/output error")

    with pytest.raises(OSError, match="input/output error"):
        hs.NeighborTable.load(Broken())
