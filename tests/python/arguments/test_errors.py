# SPDX-License-Identifier: BSD-3-Clause
"""Every bad input: the right exception, a message that names the argument, and no waiting."""

import re
from functools import partial

import numpy as np
import pytest

import halfshell as hs
from calls import call
from refused_calls import INF, NAN, assert_refused, with_value

POINTS = np.arange(12.0).reshape(4, 3) / 8
CUBE = np.eye(3) * 2
EITHER = (TypeError, ValueError)

#: Boxes whose periodic vectors are exactly dependent.
DEPENDENT = [
    np.zeros((3, 3)), [1.0, 0.0, 1.0], [[1, 0, 0], [0, 0, 0], [0, 0, 1]],
    [[0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [0, 0, 1]],  # equal rows, a double, a sum
    [[0.1, 0.2, 0.3], [1, 0, 0], [0.2, 0.4, 0.6]],
    [[0.375, 0.75, 0.125], [0.25, 1.5, 3.5], [0.625, 2.25, 3.625]],
    [[1, 2, 0], [3, 4, 0], [5, 7, 0]],  # flat, tiny, huge, subnormal
    [[1e-300, 2e-300, 0], [2e-300, 4e-300, 0], [0, 0, 1]],
    [[1e300, 2e300, 0], [2e300, 4e300, 0], [0, 0, 1]],
    [[5e-324, 0, 0], [1e-323, 0, 0], [0, 0, 1]],
]  # fmt: skip


@pytest.mark.parametrize("box", DEPENDENT, ids=range(len(DEPENDENT)))
def test_dependent_box_vectors(box):
    for search in (hs.pairs, hs.count_pairs):
        call_ = partial(search, POINTS, 1.0, box=box)
        assert_refused(call_, ValueError, "box", "dependent|zero|0")


#: What messages say: (argument, value, error, pattern).
SAID = [
    ("points", [1.0], ValueError, r"\(1,\)"),
    ("points", np.zeros((2, 3, 4)), ValueError, r"\(2, 3, 4\)"),
    ("points", np.zeros((4, 9)), ValueError, r"\(4, 9\)"),
    ("points", np.broadcast_to(0.0, (2**31, 1)), OverflowError, r"2147483648|2\*\*31"),
    ("cutoff", -1, ValueError, "-1"), ("cutoff", np.float32(NAN), ValueError, "nan"),
    ("cutoff", None, TypeError, "^cutoff must be a number, got NoneType: points without it need"),
    ("cutoff", object(), TypeError, "^cutoff must be a number, got object$"),
    ("cutoff", 1j, TypeError, "^cutoff must be a number, got dtype complex128$"),
    ("cutoff", -(10**5000), OverflowError, "^cutoff = "),
    ("cutoff", 2**64 + 1, ValueError, f"^cutoff = {2**64 + 1} "),
    ("cutoff", np.ma.array(1.0, mask=True), ValueError, "^cutoff must not be masked"),
    ("box", [1.0, 2.0], ValueError, r"\(2,\)"), ("box", np.ones((3, 2)), ValueError, r"\(3, 2\)"),
    ("box", [], ValueError, r"\(0,\)"),
]  # fmt: skip


def test_what_messages_say():
    for name, value, error, pattern in SAID:
        given = {"points": POINTS, "cutoff": 1.0, name: value}
        assert_refused(partial(hs.pairs, **given), error, name, pattern)


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.float16, ">f8"])
def test_coordinates_that_are_not_finite(dtype):
    for value, word in ((NAN, "nan"), (INF, "inf"), (-INF, "-inf")):
        for row, column in ((0, 0), (3, 1), (4, 2)):
            points = with_value(row, column, value, dtype=dtype)
            place = rf"points\[{row}, {column}\]"
            for box in (None, CUBE):
                call = partial(hs.pairs, points, 1.0, box=box)
                assert_refused(call, ValueError, place, word)


def test_a_list_of_cutoffs_is_for_counting_only():
    assert_refused(lambda: hs.pairs(POINTS, [1.0, 2.0]), EITHER, "cutoff")
    for cutoffs, message in (
        ([0.5, 1.0, 0.75], r"ascending.*cutoff\[1\] = 1.0 before cutoff\[2\] = 0.75"),
        ([-1.0, 2.0], r"not negative.*cutoff\[0\] = -1"),
        ([1.0, NAN, 2.0], r"finite.*cutoff\[1\] = nan"),
        ([1.0, 2.0, -INF], r"finite.*cutoff\[2\] = -inf"),
    ):
        assert_refused(partial(hs.count_pairs, POINTS, cutoffs), ValueError, message)
    assert_refused(lambda: hs.count_pairs(POINTS, ["1", "2"]), TypeError, "cutoff")


def test_dependence_is_decided_exactly(rng):
    # The third row is an exact combination of two others; the rounded determinant is not 0.
    hidden = 0
    for _ in range(50):
        a, b = rng.integers(-(2**26), 2**26, (2, 3)) / 2.0**20
        s, t = rng.integers(-50, 50, 2)
        box = np.array([a, b, s * a + t * b])
        hidden += np.linalg.det(box) != 0
        assert_refused(partial(hs.pairs, POINTS, 1.0, box=box), ValueError, "box")
    assert hidden > 0
    for scale in (2.0**-1000, 2.0**900):
        assert_refused(partial(hs.pairs, POINTS, 1.0, box=box * scale), ValueError, "box")


def test_nearly_dependent_box_vectors_are_independent():
    above = 1 + 2.0**-52
    box = [[1.0, 1.0], [1.0, above]]  # contains the vector (0, 2**-52)
    found = hs.pairs([[0.0, 0.0]], 2.0**-51, box=box, quantities="S", sort=True)
    assert found.tolist() == [[1, -1], [2, -2]]
    for scale in (1e-200, 1e-110, 1e110, 1e200):  # the determinant leaves the float range
        box = np.eye(3) * scale
        assert hs.count_pairs([[0.0, 0.0, 0.0]], scale, box=box) == 3


# ---- results that cannot be --------------------------------------------------------------


def test_a_shift_beyond_int32_is_refused_only_when_asked_for():
    points = np.array([[0.25], [2.0**33 + 0.5]])
    assert_refused(
        lambda: hs.pairs(points, 0.25, box=[1.0], quantities="S"), OverflowError, "S|shift"
    )
    i, j, d, D = hs.pairs(points, 0.25, box=[1.0], quantities="ijdD")
    assert (i.tolist(), j.tolist(), d.tolist(), D.tolist()) == ([0], [1], [0.25], [[0.25]])
    assert hs.count_pairs(points, 0.25, box=[1.0]) == 1
    edge = np.array([[0.0], [2.0**31 - 1]])
    assert hs.pairs(edge, 0.0, box=[1.0], quantities="S").tolist() == [[1 - 2**31]]
    edge = np.array([[2.0**31], [0.0]])
    assert_refused(lambda: hs.pairs(edge, 0.0, box=[1.0], quantities="S"), OverflowError, "S|shift")


def test_results_that_do_not_fit_are_refused_before_the_search():
    crowd = np.zeros((200_000, 3))
    assert_refused(lambda: hs.pairs(crowd, 1.0), MemoryError, "pairs", "byte|B")
    assert_refused(lambda: hs.pairs(crowd, 0.0), MemoryError, "pairs")
    cloud = np.random.default_rng(3).random((200_000, 3))
    assert_refused(lambda: hs.pairs(cloud, 2.0), MemoryError, "pairs")
    assert_refused(lambda: hs.pairs(cloud, 0.9, box=[1.0] * 3, quantities="ijdDS"), MemoryError)
    assert_refused(lambda: call(hs.pairs, cloud, 0.2, memory_limit=10**8), MemoryError, "pairs")


class Hostile:
    """An object whose conversion raises, or lies about its shape."""

    def __init__(self, error):
        self.error = error

    def __array__(self, *args, **how):
        raise self.error


# ---- conversions that fail, flags ----------------------------------------


@pytest.mark.parametrize("error", [RuntimeError("needs grad"), AttributeError("mine")])
def test_an_input_that_cannot_be_converted_is_named_with_the_cause(error):
    hostile = Hostile(error)
    calls = {
        "points": lambda: hs.pairs(hostile, 1.0),
        "cutoff": lambda: hs.count_pairs(POINTS, hostile),
        "box": lambda: hs.pairs(POINTS, 1.0, box=hostile),
        "periodic": lambda: hs.pairs(POINTS, 1.0, box=CUBE, periodic=hostile),
        "i": lambda: hs.verify(POINTS, 1.0, hostile, [1]),
        "S": lambda: hs.verify(POINTS, 1.0, [0], [1], hostile),
        "matrix": lambda: hs.Box.from_matrix(hostile),
    }
    for name, refused_call in calls.items():
        with pytest.raises(TypeError, match=rf"^{name} .*Hostile.*{error}") as caught:
            refused_call()
        assert caught.value.__cause__ is error


@pytest.mark.parametrize("error", [MemoryError("mine"), KeyboardInterrupt("mine")])
def test_what_is_not_the_fault_of_the_input_passes(error):
    with pytest.raises(type(error), match="mine"):
        hs.pairs(Hostile(error), 1.0)


def test_a_tensor_that_only_speaks_dlpack_may_fail_too():
    class Elsewhere:
        def __dlpack__(self, **how):
            raise BufferError("on a device")

        def __dlpack_device__(self):
            return (1, 0)

    assert_refused(lambda: hs.pairs(Elsewhere(), 1.0), TypeError, "points", "on a device")


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


def test_numbers_of_any_shape_are_refused_before_a_copy():
    with pytest.raises(ValueError, match=r"^cutoff must be a number, have shape"):
        hs.pairs(P, huge(np.int64))
    with pytest.raises(TypeError, match=r"^cutoff must be a number, got shape"):
        hs.rdf(P, huge(np.int64), box=BOX)
    with pytest.raises(TypeError, match=r"^fill must be a number, got shape"):
        hs.neighbors(P, 0.2).to_padded(fill=huge(np.int64))


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
