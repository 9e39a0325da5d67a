# SPDX-License-Identifier: BSD-3-Clause
"""Partial g(r) by the names of types, and coordination numbers n(r), against counts one by one."""

import math

import numpy as np
import pytest

import halfshell as hs

NAMES = np.array(["Si", "O", "Na"])
BOXES = {
    "2-D": np.array([[1.0, 0.0], [0.3, 0.9]]),
    "3-D": np.array([[1.0, 0.0, 0.0], [0.2, 1.1, 0.0], [-0.4, 0.1, 0.8]]),
}


@pytest.fixture(params=BOXES)
def box(request):
    return BOXES[request.param]


def scene(rng, box, n=60):
    return rng.random((n, len(box))) @ box, rng.integers(0, 3, n)


def around(points, types, queries, query_types, r, box, same):
    """The mean number of points of each type within r of a query of each type."""
    table = np.zeros((3, 3))
    for a in range(3):
        for b in range(3):
            asking, found = queries[query_types == a], points[types == b]
            n = hs.count_pairs(found, r, queries=asking, box=box, inclusive=False)
            itself = len(asking) if same and a == b else 0
            table[a, b] = (n - itself) / len(asking)
    return table


def test_names_count_as_numbers_do_in_ascending_order(rng, box):
    points, kinds = scene(rng, box)
    names = NAMES[kinds]
    places = np.unique(names, return_inverse=True)[1]
    expected = hs.rdf(points, 1.3, 9, types=places, box=box)
    assert expected.types == (0, 1, 2)
    forms = names, names.tolist(), names.astype(object), tuple(names), names.reshape(-1)[::-1][::-1]
    for given in forms:
        result = hs.rdf(points, 1.3, 9, types=given, box=box)
        assert result.types == ("Na", "O", "Si")
        assert np.array_equal(result.counts, expected.counts)
        assert result.g.tobytes() == expected.g.tobytes()
        assert result.n_r.tobytes() == expected.n_r.tobytes()
        histogram = hs.pair_histogram(points, result.edges, types=given, box=box)
        assert np.array_equal(histogram, result.counts)
    cells = hs.CellList(points, 0.4, box=box)
    assert np.array_equal(cells.pair_histogram(result.edges, types=names), result.counts)


def test_n_is_what_points_have_around_them(rng, box):
    points, kinds = scene(rng, box)
    result = hs.rdf(points, 1.3, 7, types=kinds, box=box)
    plain = hs.rdf(points, 1.3, 7, box=box)
    assert result.n_centers.tolist() == np.bincount(kinds, minlength=3).tolist()
    assert plain.n_centers == len(points) and plain.types is None
    for k, r in enumerate(result.edges[1:-1]):
        found = around(points, kinds, points, kinds, r, box, same=True)
        assert np.allclose(result.n_r[:, :, k], found, rtol=1e-15)
        mean = hs.coordination(points, r, box=box, inclusive=False).mean()
        assert math.isclose(plain.n_r[k], mean, rel_tol=1e-15)
    assert math.isclose(plain.n_r[-1], hs.coordination(points, 1.3, box=box).mean())


def test_n_around_queries(rng, box):
    points, kinds = scene(rng, box)
    queries, asking = scene(rng, box, 40)
    how = {"queries": queries, "types": NAMES[kinds], "query_types": NAMES[asking], "box": box}
    result = hs.rdf(points, 1.3, 7, **how)
    order = [2, 1, 0]  # of NAMES, ascending
    for k, r in enumerate(result.edges[1:-1]):
        found = around(points, kinds, queries, asking, r, box, same=False)
        assert np.allclose(result.n_r[:, :, k], found[np.ix_(order, order)], rtol=1e-15)
    plain = hs.rdf(points, 1.3, 7, queries=queries, box=box)
    assert np.allclose(plain.n_r * 40, np.cumsum(plain.counts), rtol=1e-15)
    assert not plain.is_half and plain.n_centers == 40


def test_two_types_are_asked_for_by_name(rng, box):
    points, kinds = scene(rng, box)
    result = hs.rdf(points, 1.3, 7, types=NAMES[kinds], box=box)
    for a, one in enumerate(result.types):
        for b, other in enumerate(result.types):
            part = result[one, other]
            assert part.types is None and part.g.shape == (7,)
            assert np.array_equal(part.counts, result.counts[a, b])
            assert part.g.tobytes() == result.g[a, b].tobytes()
            assert part.n_r.tobytes() == result.n_r[a, b].tobytes()
            assert part.is_half == (a == b)
    numbered = hs.rdf(points, 1.3, 7, types=kinds, box=box)
    assert np.array_equal(numbered[np.int64(0), 2].counts, numbered.counts[0, 2])


def test_what_is_no_type_is_refused():
    result = hs.rdf([[0.0], [0.5]], 0.4, 2, types=["A", "B"], box=[1.0])
    for wrong in (("A", "C"), (0, 1), ("A", None), (["A"], "B")):
        with pytest.raises(KeyError, match="not one of the types 'A', 'B'"):
            result[wrong]
    for wrong in ("A", 0, ("A",), ("A", "B", "A"), ["A", "B"]):
        with pytest.raises(TypeError, match=r"two types are needed, as in result\[a, b\]"):
            result[wrong]
    many = hs.rdf([[0.0], [0.5]], 0.4, 2, types=[0, 30], box=[1.0])
    for wrong in ((0, 31), (0, -1), (0, True), (0.0, 1)):
        with pytest.raises(KeyError, match=r"not one of the types 0, .*, \.\.\."):
            many[wrong]
    with pytest.raises(TypeError, match="no types: give types to rdf"):
        hs.rdf([[0.0], [0.5]], 0.4, 2, box=[1.0])["A", "B"]


def test_points_and_queries_of_other_types_have_all_of_them():
    result = hs.rdf(
        [[0.0], [0.5]], 0.4, 2, queries=[[0.25]], types=["b", "d"], query_types=["c"], box=[1.0]
    )
    assert result.types == ("b", "c", "d")
    assert result.counts.sum() == 2 and result["c", "b"].n_r.tolist() == [0.0, 1.0]
    none = hs.rdf(
        np.empty((0, 1)), 0.4, 2, queries=[[0.25]], types=[], query_types=["c"], box=[1.0]
    )
    assert none.types == ("c",) and none.counts.sum() == 0 and none.n_r.tolist() == [[[0.0, 0.0]]]


REFUSED = {
    "names and numbers": (["A", 1], TypeError, "integers"),
    "one name": ("A", TypeError, "integers or names"),
    "a name for too few": (["A"], ValueError, r"shape \(2,\)"),
    "tables of names": ([["A", "B"]], ValueError, r"shape \(2,\)"),
    "bytes": ([b"A", b"B"], TypeError, "integers"),
}


@pytest.mark.parametrize("types, error, text", REFUSED.values(), ids=REFUSED)
def test_types_that_are_none_are_refused(types, error, text):
    types = np.array(types, dtype=object) if types == ["A", 1] else types
    with pytest.raises(error, match=text):
        hs.rdf([[0.0], [0.5]], 0.4, 2, types=types, box=[1.0])
    with pytest.raises(error, match=text):
        hs.pair_histogram([[0.0], [0.5]], [0.0, 1.0], types=types)


def test_names_and_numbers_of_two_sets_are_refused():
    points, queries = [[0.0], [0.5]], [[0.25]]
    for own, asking in ((["A", "B"], [0]), ([0, 1], ["A"])):
        with pytest.raises(ValueError, match="both be numbers, or both be names"):
            hs.rdf(points, 0.4, 2, queries=queries, types=own, query_types=asking, box=[1.0])


def test_elements_of_an_atoms_object():
    build = pytest.importorskip("ase.build")
    atoms = build.bulk("NaCl", "rocksalt", a=5.64, cubic=True)
    result = hs.rdf(atoms, 4.0, 40, types=atoms.symbols)
    assert result.types == ("Cl", "Na")
    assert result["Na", "Cl"].n_r[-1] == 6.0 and result["Na", "Na"].n_r[-1] == 12.0


# ---- frames --------------------------------------------------------------------------------


def test_frames_add_up(rng, box):
    frames = [scene(rng, box, n) for n in (60, 0, 1, 45)]
    boxes = [box, 1.1 * box, box, 0.9 * box]
    each = [
        hs.rdf(x, 1.3, 7, types=kinds, box=one)
        for (x, kinds), one in zip(frames, boxes, strict=True)
    ]
    total = sum(each)
    counts, centers = np.zeros((3, 3, 7), np.int64), np.zeros(3, np.int64)
    expected = np.zeros((3, 3, 7))
    for one in each:
        t = len(one.types)
        counts[:t, :t] += one.counts
        expected[:t, :t] += one.expected
        centers[:t] += one.n_centers
    assert total.n_frames == 4 and total.types == (0, 1, 2)
    assert np.array_equal(total.counts, counts) and total.counts.dtype == np.int64
    assert np.array_equal(total.n_centers, centers)
    assert np.allclose(total.g * expected, counts, rtol=1e-14)
    twice = 1 + np.eye(3, dtype=int)[:, :, None]
    n = np.cumsum(twice * counts, axis=2) / centers[:, None, None]
    assert np.allclose(total.n_r, n, rtol=1e-14)


def test_frames_of_one_box_have_the_mean_of_their_g(rng, box):
    each = [hs.rdf(scene(rng, box)[0], 1.3, 7, box=box) for _ in range(5)]
    total = sum(each[1:], start=each[0])
    assert np.allclose(total.g, np.mean([one.g for one in each], axis=0), rtol=1e-14)
    assert np.allclose(total.n_r, np.mean([one.n_r for one in each], axis=0), rtol=1e-14)
    assert np.array_equal(total.counts, sum(one.counts for one in each))
    assert sum(each[:1]) is each[0]


def test_frames_may_lack_types():
    points, how = [[0.0], [0.3]], {"box": [1.0]}
    one = hs.rdf(points, 0.4, 2, types=["B", "C"], **how)
    other = hs.rdf(points, 0.4, 2, types=["A", "C"], **how)
    total = one + other
    assert total.types == ("A", "B", "C") and total.n_centers.tolist() == [1, 1, 2]
    assert total["A", "B"].counts.sum() == 0 and total["C", "B"].counts.tolist() == [0, 1]
    assert total["C", "A"].n_r.tolist() == [0.0, 0.5]  # one of two C has an A
    assert np.array_equal((other + one).counts, total.counts)


def test_what_cannot_be_added_is_refused():
    points, how = [[0.0], [0.5]], {"box": [1.0]}
    plain = hs.rdf(points, 0.4, 2, **how)
    named = hs.rdf(points, 0.4, 2, types=["A", "B"], **how)
    others = {
        "same edges": hs.rdf(points, 0.4, 3, **how),
        "with queries": hs.rdf(points, 0.4, 2, queries=points, **how),
        "with types and without": named,
    }
    for text, other in others.items():
        with pytest.raises(ValueError, match=text):
            plain + other
    with pytest.raises(ValueError, match="names and numbers"):
        named + hs.rdf(points, 0.4, 2, types=[0, 1], **how)
    for wrong in (1, 0.0, None, "A", plain.counts):
        with pytest.raises(TypeError):
            wrong + plain
    with pytest.raises(TypeError):
        plain + 1
