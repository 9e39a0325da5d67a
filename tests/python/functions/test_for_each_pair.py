# SPDX-License-Identifier: BSD-3-Clause
"""`for_each_pair` calls functions of every sort for the pairs of `pairs`, and checks them."""

import ctypes
import math
import sys

import numpy as np
import pytest

import halfshell as hs
from calls import call
from stream_scenes import BOX, SCENES

I64, F64 = ctypes.c_int64, ctypes.c_double
I32_POINTER, F64_POINTER = ctypes.POINTER(ctypes.c_int32), ctypes.POINTER(ctypes.c_double)
SIGNATURE = ctypes.CFUNCTYPE(ctypes.c_int, I64, I64, I32_POINTER, F64_POINTER, F64, ctypes.c_void_p)
POINTS = np.random.default_rng(3).random((50, 3))


def visited(points, cutoff, **options):
    """What a Python callable sees, as the arrays of `pairs`, and how many that was."""
    seen = []
    n = call(hs.for_each_pair, points, cutoff, lambda *pair: seen.append(pair), **options)
    d = np.shape(points)[1]
    i, j, S, D, d2 = zip(*seen) if seen else [()] * 5
    return (
        n,
        np.array(i, dtype=np.int64),
        np.array(j, dtype=np.int64),
        np.array(S, dtype=np.int32).reshape(-1, d),
        np.array(D).reshape(-1, d),
        np.array(d2),
    )


def assert_visits_the_pairs(points, cutoff, **options):
    n, i, j, S, D, d2 = visited(points, cutoff, **options)
    of_pairs = call(hs.pairs, points, cutoff, quantities="ijSDd", **options)
    assert n == len(i) == len(of_pairs[0])
    for got, wanted in zip((i, j, S, D), of_pairs):
        assert got.tobytes() == wanted.tobytes()
    d = of_pairs[4]
    assert d2.tobytes() == (d * d).tobytes()
    assert np.sqrt(d2).tobytes() == d.tobytes()


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_a_callable_sees_the_pairs_in_their_order(scene):
    points, cutoff, options = scene
    assert_visits_the_pairs(points, cutoff, **options)


@pytest.mark.parametrize("result", [True, 1, "stop", [0]])
def test_a_true_result_stops(result):
    calls = []

    def callback(*pair):
        calls.append(pair)
        return result if len(calls) == 10 else 0

    assert hs.for_each_pair(POINTS, 0.5, callback) == 10 == len(calls)


@pytest.mark.parametrize("threads", [1, 4])
@pytest.mark.parametrize("thread_safe", [False, True])
def test_an_exception_stops_and_arrives(threads, thread_safe, rng):
    points = rng.random((3000, 3))
    calls = []

    def callback(i, j, S, D, d2):
        calls.append(i)
        if len(calls) == 1000:
            raise LookupError(i)

    with pytest.raises(LookupError):
        hs.for_each_pair(points, 0.2, callback, threads=threads, thread_safe=thread_safe)
    assert len(calls) == 1000 if not thread_safe else 1000 <= len(calls) < 100_000


def test_threads_visit_each_pair_once(rng):
    points = rng.random((3000, 3))
    seen = []
    n = hs.for_each_pair(
        points, 0.12, lambda i, j, *rest: seen.append((i, j)), threads=4, thread_safe=True
    )
    i, j = hs.pairs(points, 0.12, sort=True)
    assert n == len(i) and sorted(seen) == list(zip(i.tolist(), j.tolist()))


# Function pointers.


@SIGNATURE
def write_pair(i, j, S, D, d2, user):
    """Row number user[0] of a table of 2 + 3 + 3 + 1 numbers, which begins at user[1]."""
    table = ctypes.cast(user, F64_POINTER)
    at = 1 + 9 * int(table[0])
    for k, value in enumerate([i, j, *S[:3], *D[:3], d2]):
        table[at + k] = value
    table[0] += 1
    return int(table[0] == 5)


def check_table(table, n):
    i, j, S, D, d = hs.pairs(POINTS, 0.5, box=BOX, quantities="ijSDd")
    rows = table[1:].reshape(-1, 9)[:n]
    assert n == 5 and table[0] == n
    assert (rows[:, 0] == i[:n]).all() and (rows[:, 1] == j[:n]).all()
    assert (rows[:, 2:5] == S[:n]).all() and (rows[:, 5:8] == D[:n]).all()
    assert (rows[:, 8] == (d * d)[:n]).all()


def pointers_to(table):
    """The same memory in all the ways that user_data may be given."""
    pointer = table.ctypes.data_as(F64_POINTER)
    yield table
    yield memoryview(table)
    yield table.ctypes.data
    yield np.uint64(table.ctypes.data)
    yield pointer
    yield ctypes.cast(pointer, ctypes.c_void_p)
    yield (ctypes.c_double * len(table)).from_buffer(table)
    cffi = pytest.importorskip("cffi")
    yield cffi.FFI().from_buffer("double[]", table)
    yield cffi.FFI().cast("void *", table.ctypes.data)


def test_a_ctypes_function_and_its_data():
    for which in range(9):
        table = np.zeros(46)
        user_data = [*pointers_to(table)][which]
        check_table(table, hs.for_each_pair(POINTS, 0.5, write_pair, user_data=user_data, box=BOX))


def test_a_low_level_callable_of_ctypes():
    scipy = pytest.importorskip("scipy")
    table = np.zeros(46)
    user = table.ctypes.data_as(ctypes.c_void_p)
    callback = scipy.LowLevelCallable(write_pair, user)
    check_table(table, hs.for_each_pair(POINTS, 0.5, callback, box=BOX))
    with pytest.raises(TypeError, match="user_data"):
        hs.for_each_pair(POINTS, 0.5, callback, user_data=table)
    for declared in (
        "int (int64_t, int64_t, int32_t const *, double const *, double, void *)",
        "int32_t(long long,long long,const int *,const double*,double,double *)",
        "int (__pyx_t_5numpy_int64_t, npy_int64, void *, void *, double, void *)",
    ):
        table[:] = 0
        callback = scipy.LowLevelCallable(write_pair, user, declared)
        check_table(table, hs.for_each_pair(POINTS, 0.5, callback, box=BOX))
    for declared in (
        "double (double)",
        "int (int64_t)",
        "nonsense",
        "",
        "int (int (*)(int), int)",
        "int (uint64_t, int64_t, int32_t *, double *, double, void *)",
        "int (int64_t, int64_t, int32_t *, float *, double, void *)",
        "int (int64_t, int64_t, int32_t *, double *, double, long)",
    ):
        callback = scipy.LowLevelCallable(write_pair, user, declared)
        with pytest.raises(TypeError, match=r"const int32_t \*S, const double \*D"):
            hs.for_each_pair(POINTS, 0.5, callback)


def test_a_numba_cfunc():
    numba = pytest.importorskip("numba")
    types = numba.types

    def add(i, j, S, D, d2, user):
        user[0] += d2
        user[1] += D[0] * D[0] + D[1] * D[1] + D[2] * D[2]
        user[2] += (i + j) * (S[0] + 2 * S[1] + 5 * S[2])
        return 0

    signature = types.int32(
        types.int64,
        types.int64,
        types.CPointer(types.int32),
        types.CPointer(types.float64),
        types.float64,
        types.CPointer(types.float64),
    )
    sums = np.zeros(3)
    compiled = numba.cfunc(signature)(add)
    n = hs.for_each_pair(POINTS, 0.5, compiled, user_data=sums, box=BOX)
    i, j, S, d = hs.pairs(POINTS, 0.5, box=BOX, quantities="ijSd")
    assert n == len(i)
    assert math.isclose(sums[0], (d * d).sum(), rel_tol=1e-12)
    assert math.isclose(sums[1], (d * d).sum(), rel_tol=1e-12)
    assert sums[2] == ((i + j) * (S @ [1, 2, 5])).sum()
    again = np.zeros(3)
    assert hs.for_each_pair(POINTS, 0.5, compiled.ctypes, user_data=again, box=BOX) == n
    assert (again == sums).all()

    wrong = types.int64(*signature.args), types.int32(*signature.args[:5])
    for other in (wrong[0], types.float64(types.float64)):
        function = numba.cfunc(other)(add if other is wrong[0] else (lambda x: x))
        with pytest.raises(TypeError, match=r"const int32_t \*S, const double \*D.*got"):
            hs.for_each_pair(POINTS, 0.5, function)


def test_a_cffi_function():
    cffi = pytest.importorskip("cffi")
    ffi = cffi.FFI()
    seen = []

    def callback(i, j, S, D, d2, user):
        seen.append((i, j, [*S[0:3]], [*D[0:3]], d2))
        return 0

    declared = "int(int64_t, int64_t, const int32_t *, const double *, double, void *)"
    n = hs.for_each_pair(POINTS, 0.5, ffi.callback(declared, callback), box=BOX)
    i, j, S, D, d = hs.pairs(POINTS, 0.5, box=BOX, quantities="ijSDd")
    assert n == len(seen) == len(i)
    assert [s[0] for s in seen] == i.tolist() and [s[1] for s in seen] == j.tolist()
    assert [s[2] for s in seen] == S.tolist() and [s[3] for s in seen] == D.tolist()
    assert [s[4] for s in seen] == (d * d).tolist()
    for wrong in ("int(int64_t)", "void(int64_t, int64_t, int32_t *, double *, double, void *)"):
        with pytest.raises(TypeError, match=r"const int32_t \*S, const double \*D"):
            hs.for_each_pair(POINTS, 0.5, ffi.callback(wrong, lambda *a: 0))
    with pytest.raises(TypeError, match="got"):
        hs.for_each_pair(POINTS, 0.5, ffi.new("int[3]"))
    with pytest.raises(ValueError, match="NULL"):
        hs.for_each_pair(POINTS, 0.5, ffi.cast(declared.replace("(", "(*)(", 1), 0))


@pytest.mark.parametrize(
    "types",
    [
        (),
        (ctypes.c_int,),
        (None, I64, I64, I32_POINTER, F64_POINTER, F64, ctypes.c_void_p),
        (ctypes.c_int, I64, I64, I32_POINTER, F64_POINTER, F64),
        (ctypes.c_int, ctypes.c_int32, I64, I32_POINTER, F64_POINTER, F64, ctypes.c_void_p),
        (ctypes.c_int, ctypes.c_uint64, I64, I32_POINTER, F64_POINTER, F64, ctypes.c_void_p),
        (ctypes.c_int, I64, I64, F64_POINTER, I32_POINTER, F64, ctypes.c_void_p),
        (ctypes.c_int, I64, I64, I32_POINTER, F64_POINTER, ctypes.c_float, ctypes.c_void_p),
        (ctypes.c_int, I64, I64, I32_POINTER, F64_POINTER, F64, I64),
    ],
)
def test_another_signature_of_ctypes_is_refused(types):
    result, *arguments = types or (None,)
    function = ctypes.CFUNCTYPE(result, *arguments)(lambda *arguments: 0)
    with pytest.raises(TypeError, match=r"int \(int64_t i, int64_t j, const int32_t \*S"):
        hs.for_each_pair(POINTS, 0.5, function)


def test_other_things_are_refused():
    for callback in (None, 5, "f", object(), (1, 2)):
        with pytest.raises(TypeError, match=r"const int32_t \*S, const double \*D"):
            hs.for_each_pair(POINTS, 0.5, callback)
    with pytest.raises(TypeError, match="user_data"):
        hs.for_each_pair(POINTS, 0.5, print, user_data=np.zeros(3))
    types = (ctypes.c_int, I64, I64, I32_POINTER, F64_POINTER, F64, ctypes.c_void_p)
    needs_lock = ctypes.PYFUNCTYPE(*types)(lambda *arguments: 0)
    with pytest.raises(TypeError, match="GIL"):
        hs.for_each_pair(POINTS, 0.5, needs_lock)
    for user_data in (1.5, True, object(), "text", np.timedelta64(1, "s"), np.zeros(2, "M8[s]")):
        with pytest.raises(TypeError, match="user_data"):
            hs.for_each_pair(POINTS, 0.5, write_pair, user_data=user_data)
    for user_data in (-1, 2**70, np.zeros((4, 4))[:, 1]):
        with pytest.raises(ValueError, match="user_data"):
            hs.for_each_pair(POINTS, 0.5, write_pair, user_data=user_data)


@pytest.mark.skipif(sys.platform == "win32", reason="libraries have other names")
def test_arguments_that_a_function_converts_itself_are_refused():
    class Converted:
        def from_param(self, value):
            return value

    function = ctypes.CDLL(None).abs
    other = I64.__ctype_le__ if sys.byteorder == "big" else I64.__ctype_be__
    for first in (Converted(), np.ctypeslib.ndpointer(np.int64), other):
        function.argtypes = [first, I64, I32_POINTER, F64_POINTER, F64, ctypes.c_void_p]
        with pytest.raises(TypeError, match="callback must have the C signature"):
            hs.for_each_pair(POINTS, 0.1, function)
