# SPDX-License-Identifier: BSD-3-Clause
"""Every bad input: the right exception, a message that names the argument, and no waiting."""

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


@pytest.mark.parametrize("dtype", [np.int64, np.uint64])
def test_integers_that_float64_cannot_hold(dtype):
    for value in (2**53 + 1, 2**62 + 1, 2**63 - 1):
        points = with_value(2, 1, value, dtype=dtype)
        assert_refused(partial(hs.pairs, points, 1.0), ValueError, "points", str(value))


def test_a_list_of_cutoffs_is_for_counting_only():
    assert_refused(lambda: hs.pairs(POINTS, [1.0, 2.0]), EITHER, "cutoff")
    for cutoffs, message in (
        ([0.5, 1.0, 0.75], r"ascending.*cutoff\[1\] = 1.0 before cutoff\[2\] = 0.75"),
        ([-1.0, 2.0], r"not negative.*cutoff\[0\] = -1"),
        ([1.0, NAN, 2.0], r"finite.*cutoff\[1\] = nan"),
        ([1.0, INF], r"finite.*cutoff\[1\] = inf"),
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


def test_rows_of_open_axes_may_be_anything_finite_and_dependent():
    box = [[1.0, 0, 0], [2.0, 0, 0], [0, 0, 1.0]]
    periodic = [True, False, True]
    assert hs.count_pairs([[0.0, 0.0, 0.0]], 1.0, box=box, periodic=periodic) == 2


def test_unknown_and_missing_arguments_and_periodic_without_a_box():
    assert_refused(lambda: hs.pairs(POINTS), TypeError, "cutoff")
    assert_refused(lambda: hs.pairs(POINTS, 1.0, CUBE), TypeError)
    assert_refused(lambda: hs.pairs(POINTS, 1.0, boks=CUBE), TypeError, "boks")
    for periodic in (True, [True, False, False], np.array([False, False, True])):
        call = partial(hs.pairs, POINTS, 1.0, periodic=periodic)
        assert_refused(call, ValueError, "periodic", "box")


def test_atoms_bring_their_own_box():
    class Atoms:
        positions, cell, pbc = POINTS, CUBE, np.array([True, True, False])

    expected = hs.count_pairs(POINTS, 1.0, box=CUBE, periodic=[True, True, False])
    assert hs.count_pairs(Atoms(), 1.0) == expected
    for extra in ({"box": CUBE}, {"periodic": True}, {"box": CUBE, "periodic": [True] * 3}):
        assert_refused(partial(hs.pairs, Atoms(), 1.0, **extra), EITHER, "box|periodic")


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


def test_points_beyond_any_integer_shift_are_right_or_refused():
    for far in (2.0**52, 2.0**60, 1e30, 1e300, -1.7e308):
        points = np.array([[0.0], [far]])
        try:
            assert hs.pairs(points, 0.0, box=[1.0], quantities="d").tolist() == [0.0]
        except OverflowError as error:
            assert "points" in str(error) or "shift" in str(error)


def test_results_that_do_not_fit_are_refused_before_the_search():
    crowd = np.zeros((200_000, 3))
    assert_refused(lambda: hs.pairs(crowd, 1.0), MemoryError, "pairs", "byte|B")
    assert_refused(lambda: hs.pairs(crowd, 0.0), MemoryError, "pairs")
    cloud = np.random.default_rng(3).random((200_000, 3))
    assert_refused(lambda: hs.pairs(cloud, 2.0), MemoryError, "pairs")
    assert_refused(lambda: hs.pairs(cloud, 0.9, box=[1.0] * 3, quantities="ijdDS"), MemoryError)
    assert_refused(lambda: call(hs.pairs, cloud, 0.2, memory_limit=10**8), MemoryError, "pairs")


def test_images_of_a_tiny_box_are_refused_before_the_search():
    for length in (1e-3, 1e-9, 1e-100, 5e-324):
        box = [length] * 3
        assert_refused(lambda box=box: hs.pairs(POINTS, 1.0, box=box), (MemoryError, OverflowError))
        assert_refused(
            lambda box=box: hs.pairs([[0.0, 0.0, 0.0]], 1.0, box=box), (MemoryError, OverflowError)
        )
    for cutoff in (1e6, 1e100, 1.7e308):
        assert_refused(
            lambda cutoff=cutoff: hs.pairs(POINTS, cutoff, box=CUBE), (MemoryError, OverflowError)
        )


def test_memory_limit_counts_what_is_asked_for(rng):
    points = rng.random((4000, 3))
    m = hs.count_pairs(points, 0.3)
    assert len(call(hs.pairs, points, 0.3, memory_limit=100 * m)[0]) == m
    assert_refused(lambda: call(hs.pairs, points, 0.3, memory_limit=4 * m), MemoryError, "pairs")
    everything = "ijdDSP"
    assert_refused(
        lambda: call(hs.pairs, points, 0.3, quantities=everything, memory_limit=40 * m), MemoryError
    )


def test_a_generous_bound_alone_refuses_nothing(rng):
    # One dense spot and two far corners: any bound from the volume is wildly off.
    points = np.concatenate([rng.random((3000, 3)) * 1e-3, [[1e6] * 3, [-1e6] * 3]])
    assert len(call(hs.pairs, points, 1e-5, memory_limit=20_000_000)[0]) < 10_000
    # Many candidates in neighbouring cells, no pairs: a shell around a point.
    shell = rng.normal(size=(3000, 3))
    shell /= np.linalg.norm(shell, axis=1)[:, None]
    left, right = shell * 0.01, shell * 0.01 + [1.0, 0, 0]
    both = np.concatenate([left, right])
    d = call(hs.pairs, both, 1e-4, quantities="d", memory_limit=20_000_000)
    assert (d <= 1e-4).all()


def test_a_refused_call_leaves_the_next_one_right():
    expected = hs.pairs(POINTS, 0.5, quantities="ijd")
    for bad in (with_value(1, 1, NAN), "x", np.zeros((3, 9))):
        with pytest.raises((TypeError, ValueError)):
            hs.pairs(bad, 1.0)
        found = hs.pairs(POINTS, 0.5, quantities="ijd")
        assert all(np.array_equal(a, b) for a, b in zip(found, expected))


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


def test_shifts_too_large_for_int32_name_their_point_at_any_scale():
    far = np.array([[0.10], [0.15], [3e9 + 0.5], [0.55]])
    with pytest.raises(OverflowError, match=r"points\[[23]\]"):
        hs.pairs(far, 0.1, box=[1.0], quantities="S")
    box = [2.0**25] * 3
    with pytest.raises(OverflowError):
        hs.pairs([[0.0] * 3, [2.0**65 + 2.0**13, 0.0, 0.0]], 2.0**22, box=box, quantities="S")
