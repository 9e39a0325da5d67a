# SPDX-License-Identifier: BSD-3-Clause
"""Refusals: shapes before copies, the argument by its own name, one short line."""

import re

import numpy as np
import pytest

import halfshell as hs
from calls import call
from halfshell._convert.foreign import shown

P = np.random.default_rng(0).random((50, 3))
EDGES = [0.0, 0.2]
BOX = [1.0, 1.0, 1.0]


def huge(dtype, shape=(2**30, 3)):
    """More gigabytes than there are, of one number."""
    return np.broadcast_to(np.zeros((), dtype), shape)


SHAPED = {
    "radius": lambda x: hs.CellList(P, 0.5).query(P, x),
    "batch": lambda x: call(hs.count_pairs, P, 0.2, batch=x),
    "types": lambda x: call(hs.pair_histogram, P, EDGES, types=x),
    "weights": lambda x: call(hs.pair_histogram, P, EDGES, weights=x),
    "edges": lambda x: hs.pair_histogram(P, x),
    "cutoff": lambda x: hs.count_pairs(P, x),
    "cutoff ": lambda x: call(hs.count_pairs, P, x, batch=np.zeros(50, int)),
    "box": lambda x: hs.pairs(P, 0.2, box=x),
    "mask": lambda x: hs.neighbors(P, 0.2).filter(x),
}


@pytest.mark.parametrize("name", SHAPED)
def test_shapes_are_refused_before_anything_is_copied(name):
    for dtype in (np.float64, np.float32, np.int64, ">f8"):
        with pytest.raises(ValueError, match=rf"^{name.strip()} must .*\(1073741824, 3\)"):
            SHAPED[name](huge(dtype))


@pytest.mark.parametrize("name", ["points", "queries"])
def test_too_many_columns_are_refused_before_a_copy(name):
    wide = huge(np.int64, (2**28, 9))
    with pytest.raises(ValueError, match=rf"^{name} must have shape \(n, d\)"):
        call(hs.count_pairs, **{"points": P, "cutoff": 0.1, name: wide})


def test_numbers_of_any_shape_are_refused_before_a_copy():
    with pytest.raises(ValueError, match=r"^cutoff must be a number, have shape"):
        hs.pairs(P, huge(np.int64))
    with pytest.raises(TypeError, match=r"^cutoff must be a number, got shape"):
        hs.rdf(P, huge(np.int64), box=BOX)
    with pytest.raises(TypeError, match=r"^fill must be a number, got shape"):
        hs.neighbors(P, 0.2).to_padded(fill=huge(np.int64))


def test_what_an_object_is_comes_before_its_shape():
    with pytest.raises(TypeError, match=r"^points must hold real numbers, got object"):
        hs.pairs(object(), 0.1)
    assert hs.count_pairs(P, 2**70, box=None) == 50 * 49 // 2  # an object array of one integer


def test_numbers_of_systems_beyond_memory_are_refused_by_name():
    with pytest.raises(MemoryError, match=r"systems up to 1099511627776 in batch would take"):
        call(hs.count_pairs, P, 0.2, batch=np.full(50, 2**40))
    with pytest.raises(ValueError, match=r"batch must ascend"):
        call(hs.count_pairs, P, 0.2, batch=np.arange(50)[::-1] + 2**40)
    assert call(hs.count_pairs, P, 0.2, batch=np.full(50, 2))[2] == hs.count_pairs(P, 0.2)


@pytest.mark.parametrize(
    "call",
    [
        lambda q: hs.CellList(P, 0.2).query(q),
        lambda q: hs.CellList(P, 0.2).nearest(1, queries=q),
        lambda q: hs.pairs_between(q, P, 0.1),
        lambda q: hs.neighbors(P, 0.1, queries=q),
        lambda q: hs.count_pairs(P, 0.1, queries=q),
        lambda q: hs.nearest(P, 1, queries=q),
    ],
)
def test_too_many_queries_are_queries(call):
    with pytest.raises(OverflowError, match=r"^fewer than 2\*\*31 queries can be searched"):
        call(huge(np.float64, (2**31, 3)))


def test_too_long_a_length_has_its_own_name():
    for length in (1e12, 1e300):
        with pytest.raises(MemoryError, match=r"fit: (the )?cutoff spans .* use a smaller cutoff$"):
            hs.rdf(P, length, box=BOX)
        with pytest.raises(MemoryError, match=r"fit: edges\[-1\] spans .* smaller edges\[-1\]$"):
            hs.pair_histogram(P, [0.0, length], box=BOX)
        with pytest.raises(MemoryError, match=r"fit: edges\[-1\] spans"):
            hs.CellList(P, 0.2, box=BOX).pair_histogram([0.0, length])
        with pytest.raises(MemoryError, match=r"fit: cutoff \+ skin spans"):
            hs.VerletList(0.1, skin=length, box=BOX).update(P)
        with pytest.raises(MemoryError, match=r"fit: (the )?cutoff spans .* smaller cutoff$"):
            hs.VerletList(length, box=BOX).update(P)


@pytest.mark.parametrize("power", [400, 5000])
def test_large_integers_are_not_written_out(power):
    table = hs.neighbors(P, 0.1)
    with pytest.raises(MemoryError, match=r"^k = ") as refused:
        hs.nearest(P, 10**power)
    assert len(str(refused.value)) < 200
    with pytest.raises(IndexError, match=r"^row .* of a table of 50 rows") as refused:
        table[10**power]
    assert len(str(refused.value)) < 200
    with pytest.raises(ValueError, match=r"rows of a slice") as refused:
        table[:: 10**power]
    assert len(str(refused.value)) < 200


def test_integers_that_are_no_float64_are_not_written_out():
    with pytest.raises(ValueError, match=r"is not a float64") as refused:
        hs.pairs([[2**1000 + 1]], 1.0)
    assert len(str(refused.value)) < 200


def test_arrays_in_messages_stand_on_one_line():
    assert shown(np.zeros((2, 2))) == "array([[0., 0.], [0., 0.]])"


def test_no_memory_at_all_has_no_sign():
    for zero in (-0.0, 0.0, 0):
        with pytest.raises(MemoryError, match=r"\b0 bytes are allowed") as refused:
            call(hs.pairs, P, 0.2, memory_limit=zero)
        assert "-0" not in str(refused.value)


UNITS = {"bytes": 1.0, "kB": 1e3, "MB": 1e6, "GB": 1e9}


def test_what_does_not_fit_is_more_than_is_allowed(rng):
    """Or the message says that the search took more than was expected."""
    crowd = rng.normal(size=(5000, 3)) * 0.2
    points = np.concatenate([crowd, rng.random((5000, 3)) * 100.0])
    forms = set()
    for limit in np.geomspace(1e5, 3e7, 80):
        try:
            call(hs.pairs, points, 0.1, quantities="ijS", memory_limit=float(limit))
        except MemoryError as refused:
            text = str(refused)
            numbers = re.findall(r"([\d.e+]+) (bytes|kB|MB|GB)\b", text)
            sizes = [float(number) * UNITS[unit] for number, unit in numbers]
            if "needs more than" in text:
                allowed, *expected = sizes
            else:
                *expected, allowed = sizes
            is_more = sum(expected) > allowed
            assert is_more != ("needs more than" in text or "for them and the search" in text), text
            forms.add((text[:10], is_more))
    assert ("the search", False) in forms and ("the search", True) in forms
