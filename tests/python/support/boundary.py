# SPDX-License-Identifier: BSD-3-Clause
"""Anything as an argument: hostile objects, odd arrays, and what a call of ours may do with them.

`outcome` makes one call and asserts all that holds for every call: a documented exception or an
answer, no warning, no waiting, inputs as before. The strategies draw what goes in.
"""

import array
import contextlib
import decimal
import fractions
import inspect
import os
import time
import traceback
import types
import warnings

import numpy as np
from hypothesis import strategies as st

import halfshell as hs

with contextlib.suppress(ImportError):  # plots are timed without the import
    import matplotlib.pyplot  # noqa: F401

DOCUMENTED = (TypeError, ValueError, OverflowError, MemoryError, KeyError, IndexError)
SECONDS = 1.0  # of this process on its CPU, for scenes as small as these
SECONDS_A_PAIR = 1e-8  # more for what counts pairs, for a few points can have any number of images

# ---- what a call may do --------------------------------------------------------------------


class Outcome:
    """The answer of a call, or the error that it raised."""

    def __init__(self, answer=None, error=None):
        self.answer, self.error = answer, error

    @property
    def message(self):
        return "" if self.error is None else str(self.error)


def outcome(call, *arguments, slowdown=1.0, may_change=False, **options):
    """Call, and assert what must hold whatever the arguments are."""
    before = None if may_change else snapshot((arguments, options))
    with warnings.catch_warnings(record=True) as caught, np.errstate(all="raise"):
        warnings.simplefilter("always")
        # Of NumPy, about the name that was given: "a", an old one of bytes.
        warnings.filterwarnings("ignore", "Data type alias", DeprecationWarning)
        start = time.process_time()
        try:
            result = Outcome(answer=call(*arguments, **options))
        except Exception as error:
            result = Outcome(error=error)
        elapsed = time.process_time() - start
    if result.error is not None:
        kind = type(result.error)
        assert kind in (*DOCUMENTED, hs.CapacityError) or (
            issubclass(kind, MemoryError) and kind.__module__.startswith("numpy")
        ), f"{kind.__name__} is not documented: {result.error}"
        assert result.message, f"{kind.__name__} without a word"
    caught = [one for one in caught if "is left out" not in str(one.message)]  # as documented
    assert not caught, f"warned: {caught[0].message}"
    answer = result.answer
    is_counted = type(answer) is int or (type(answer) is np.ndarray and answer.dtype.kind == "i")
    counted = np.sum(answer, dtype=float) if is_counted else 0.0
    allowed = (SECONDS + SECONDS_A_PAIR * abs(counted)) * slowdown
    assert elapsed < allowed, f"took {elapsed:.2f} s"
    if before is not None:
        assert snapshot((arguments, options)) == before, "an input was changed"
    return result


def snapshot(value):
    """All that a call could change of the arrays in nested tuples, lists and dicts."""
    if issubclass(type(value), np.ndarray):  # whatever it says of its class
        data = np.asarray(value).tobytes() if value.nbytes < 10**6 else b""
        return (id(value), value.shape, value.strides, value.dtype, str(value.flags), data)
    if type(value) in (tuple, list):
        if len(value) > 100:
            return len(value)
        return [snapshot(item) if item is not value else None for item in value]
    if type(value) is dict:
        return [snapshot(item) for item in value.values()]
    return bytes(value) if type(value) in (array.array, bytearray) else None


# ---- objects that raise or lie -------------------------------------------------------------


class WithoutWords(Exception):
    """An exception that cannot even say what it is."""

    def __str__(self):
        raise RuntimeError("no words")


ERRORS = [
    RuntimeError("mine"),
    AttributeError("mine"),
    KeyError("mine"),
    ValueError("mine"),
    OverflowError("mine"),
    RecursionError("mine"),
    SystemError("mine"),
    ZeroDivisionError("mine"),
    UnicodeDecodeError("utf-8", b"\xff", 0, 1, "mine"),
    np.linalg.LinAlgError("mine"),
    StopIteration("mine"),
    OSError(5, "mine"),
    AssertionError("mine"),
    UserWarning("mine"),
    WithoutWords(),
]

PROTOCOLS = [
    ("__array__",),
    ("__array_interface__",),
    ("__array_struct__",),
    ("__dlpack__", "__dlpack_device__"),
    ("__float__",),
    ("__index__",),
    ("__int__", "__float__"),
    ("__bool__",),
    ("__len__", "__getitem__"),
    ("__iter__",),
    ("__getattr__",),
    ("__class__",),
    ("__repr__", "__str__"),
    ("__eq__", "__hash__"),
    ("__format__",),
    ("positions",),
    ("vectors",),
    ("dtype",),
    ("shape", "ndim"),
]

SLOTS = ("__class__", "__array_interface__", "__array_struct__")


def raising(names, error, base=object):
    """An instance of a class whose methods or properties of these names raise."""

    def fail(*arguments, **options):
        raise error

    as_property = {name for name in names if not name.startswith("__") or name in SLOTS}
    body = {name: property(fail) if name in as_property else fail for name in names}
    return types.new_class("Hostile", (base,), {}, lambda space: space.update(body))()


def answering(base=object, **members):
    """An instance of a class with these attributes; functions are methods."""
    return types.new_class("Liar", (base,), {}, lambda space: space.update(members))()


def alternating(*values):
    """An object whose array is another one each time that it is asked for."""
    turn = iter(range(10**9))
    return answering(__array__=lambda self, *a, **k: values[next(turn) % len(values)])


def as_if_atoms(positions, cell, pbc):
    """What ASE's Atoms look like."""
    return types.SimpleNamespace(positions=positions, cell=cell, pbc=pbc)


def liars():
    """Objects whose protocols answer, but not what they should."""
    constant = lambda value: lambda *a, **k: value  # noqa: E731
    answers = [None, "1", 1.5, -1, 10**400, [1.0], np.zeros((2, 3)), object(), b"", 1j, NAN]
    for value in answers:
        for name in ("__array__", "__float__", "__index__", "__len__", "__dlpack__", "__bool__"):
            yield lambda name=name, value=value: answering(**{name: constant(value)})
        yield lambda value=value: answering(__float__=constant(value), base=float)
        yield lambda value=value: answering(__index__=constant(value), base=int)
        yield lambda value=value: answering(__array_interface__=value)
        yield lambda value=value: answering(__array_struct__=value)
        yield lambda value=value: answering(vectors=value)
        yield lambda value=value: answering(__class__=type(value))
        yield lambda value=value: as_if_atoms(value, np.eye(3), True)
        yield lambda value=value: as_if_atoms(np.zeros((2, 3)), value, True)
        yield lambda value=value: as_if_atoms(np.zeros((2, 3)), np.eye(3), value)
    for value in ({}, {"shape": (-1, 3), "typestr": "<f8", "data": b"", "version": 3}):
        yield lambda value=value: answering(__array_interface__=value)
    yield lambda: alternating(np.zeros((2, 3)), np.zeros((5, 2)), np.zeros(3), None)
    yield lambda: answering(__class__=np.ma.MaskedArray)
    yield lambda: answering(__class__=np.ndarray)
    yield lambda: answering(
        __len__=constant(10**15), __getitem__=raising(("__call__",), IndexError()).__call__
    )


def hostile():
    """Objects that raise whatever they like when they are asked for anything."""
    plain = st.builds(raising, st.sampled_from(PROTOCOLS), st.sampled_from(ERRORS))
    kinds = st.sampled_from([float, int, str, tuple, list])
    names = [("__float__",), ("__index__",), ("__repr__", "__str__"), ("__eq__", "__hash__")]
    derived = st.builds(raising, st.sampled_from(names), st.sampled_from(ERRORS), kinds)
    return plain | derived | st.sampled_from(list(liars())).map(lambda make: make())


# ---- plain values and odd arrays -----------------------------------------------------------

NAN, INF = float("nan"), float("inf")
FLOATS = [0.0, -0.0, 1.0, -1.0, 0.25, 5e-324, -5e-324, 2.2e-308, 1e-300, 1e300, 1.7e308, NAN, INF]
INTEGERS = [0, 1, -1, 2, 2**31, 2**53 + 1, -(2**63), 2**63, 2**64, 10**400, -(10**5000)]
STRINGS = ["", "ij", "exact", "scalar", "int32", "i4,(", "a\0b", "\ud800", "é", "T" * 5000, "1.0"]


def scalars():
    """Numbers and what could be taken for one."""
    others = [
        *(None, True, False, b"1", bytearray(b"12"), 1j, ..., NotImplemented, len, object, type),
        fractions.Fraction(1, 3),
        decimal.Decimal("0.1"),
        decimal.Decimal("sNaN"),
        *(np.float16(0.5), np.float32(0.1), np.float64(2.0), np.longdouble(1.0), np.bool_(True)),
        *(np.int8(-1), np.uint64(2**64 - 1), np.complex128(1), np.complex64(1j), np.str_("ij")),
        *(np.datetime64("2020-01-01"), np.timedelta64(1, "s"), np.void(b"12345678")),
        *(np.array(1.0), np.array("a"), np.array(None), np.ma.array(1.0, mask=True), np.array(1j)),
        *(np.dtype("i4"), np.dtype(">i8"), np.int64, np.int32, "f8", [("a", "i4")], {"names": 1}),
    ]
    return (
        st.sampled_from(FLOATS)
        | st.floats()
        | st.sampled_from(INTEGERS)
        | st.integers(-10, 10)
        | st.sampled_from(STRINGS)
        | st.text(max_size=5)
        | st.sampled_from(others)
    )


def cyclic(width):
    """A list that holds itself."""
    itself = []
    itself.extend([itself] * width)
    return itself


def containers():
    """Lists, mappings, buffers and generators, ragged or not."""
    item = st.sampled_from([*FLOATS, 2, True, None, "a", 2**60, 10**400, 1j, np.float32(0.5)])
    rows = st.lists(item, max_size=4)
    makers = [
        lambda: (x for x in (1.0, 2.0)),
        lambda: {1.0, 2.0},
        lambda: {"x": 1.0},
        lambda: {},
        lambda: map(float, "12"),
        lambda: range(3),
        lambda: array.array("d", [1.0, 2.0, 3.0]),
        lambda: array.array("i", [1, 2]),
        lambda: memoryview(np.zeros((2, 3))),
        lambda: memoryview(b"abc"),
        lambda: cyclic(1),
        lambda: cyclic(2),
        lambda: [[0.0, [1.0]], [2.0]],
        lambda: [np.zeros(3), np.zeros(2)],
        lambda: [np.zeros((2, 3)), np.ones((2, 3))],
        lambda: [np.ma.array([0.0, 0.0, 0.0], mask=[0, 1, 0])] * 2,
        lambda: [1.0, np.ma.masked],
        lambda: [fractions.Fraction(1, 2), decimal.Decimal(1)],
        lambda: [[], []],
        lambda: [[[]]],
        lambda: [raising(("__float__",), RuntimeError("mine"), float), 2**70],
        lambda: [answering(int, __float__=lambda self: "x"), 2**70],
        lambda: types.SimpleNamespace(),
    ]
    return rows | st.lists(rows, max_size=4) | st.sampled_from(makers).map(lambda make: make())


DTYPES = (
    *("f8", ">f8", "f4", ">f4", "f2", "g", "i1", ">i2", "i4", "i8", "u1", "u8", ">u8", "?", "c16"),
    *("O", "U3", "S3", "M8[s]", "m8[s]", "V8", "V0", "f8,f4", "(3,)f8", "T"),
)
SHAPES = (
    *((), (0,), (1,), (3,), (2, 3), (4, 3), (3, 3), (4, 2), (5, 1), (2, 8), (2, 9), (0, 0)),
    *((0, 3), (3, 0), (1, 3, 3), (2, 0, 3), (4,), (2,), (1, 1), (1,) * 9, (1,) * 40),
)
LAYOUTS = ("plain", "fortran", "reversed", "strided", "unaligned", "broadcast", "read-only")


def laid_out(values, layout):
    """The same values somewhere else in memory."""
    values = np.asarray(values)
    if layout == "fortran":
        return np.asfortranarray(values)
    if layout == "reversed" and values.ndim:
        return np.ascontiguousarray(values[::-1])[::-1]
    if layout == "strided" and values.ndim and values.size:
        wide = np.repeat(np.repeat(values, 2, axis=0), 3, axis=-1)
        return wide[::2, ..., ::3] if values.ndim > 1 else np.repeat(values, 6)[::6]
    if layout == "unaligned" and not values.dtype.hasobject and values.dtype.itemsize:
        raw = np.zeros(values.nbytes + 1, np.uint8)
        raw[1:] = np.frombuffer(values.tobytes(), np.uint8)
        return np.ndarray(values.shape, values.dtype, raw, 1)
    if layout == "broadcast" and values.ndim and values.shape[0]:
        return np.broadcast_to(values[:1], values.shape)
    if layout == "read-only":
        values = values.copy()
        values.flags.writeable = False
    return values


class Subclass(np.ndarray):
    """An array that is not quite an array."""

    def __getitem__(self, key):
        raise RuntimeError("no items here")


def dressed(values, coat):
    """The same array as another object; it holds the same numbers."""
    coats = {
        "array": lambda: values,
        "list": values.tolist,
        "tuple": lambda: tuple(map(tuple, values.tolist())) if values.ndim == 2 else values,
        "masked": lambda: np.ma.array(values),
        "subclass": lambda: values.view(Subclass),
        "memoryview": lambda: memoryview(values) if values.dtype.isnative else values,
        "object": lambda: answering(__array__=lambda self, *a, **k: values),
        "interface": lambda: answering(__array_interface__=values.__array_interface__, keep=values),
        "dlpack": lambda: answering(
            __dlpack__=lambda self, **k: values.__dlpack__(),
            __dlpack_device__=lambda self: values.__dlpack_device__(),
        ),
        "objects": lambda: values.astype(object),
    }
    return coats[coat]()


COATS = ("array", "list", "tuple", "masked", "subclass", "memoryview", "object", "objects")


@st.composite
def arrays(draw):
    """Arrays of any type, shape and place in memory."""
    dtype = np.dtype(draw(st.sampled_from(DTYPES)))
    shape = draw(st.sampled_from(SHAPES))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a NaN as an integer
        values = np.zeros(shape, dtype)
        if values.size and dtype.kind in "fiu" and draw(st.booleans()):
            some = draw(st.lists(st.sampled_from(FLOATS), min_size=1, max_size=4))
            values = np.resize(np.array(some), shape).astype(dtype)
        elif dtype.kind in "iu" and draw(st.booleans()):
            values = values + np.iinfo(dtype).max
    if values.size and draw(st.integers(0, 5)) == 0:
        return np.ma.array(values, mask=True)
    laid = laid_out(values, draw(st.sampled_from(LAYOUTS)))
    return laid.view(Subclass) if draw(st.integers(0, 5)) == 0 else laid


def anything():
    """Any object at all."""
    return scalars() | containers() | arrays() | hostile()


# ---- every public call, with arguments that it answers -------------------------------------

POINTS = np.arange(12.0).reshape(4, 3) / 8
CUBE = np.eye(3) * 2.0
BALLS = hs.Points(POINTS, box=CUBE, radii=[0.4] * 4, types=[0, 1, 0, 1], labels=[0, 0, 1, 1])


def nodes():
    return [hs.NodeList("a", POINTS, [2.5] * 4)]


def stepped():
    made = hs.VerletList(0.75, 0.1, track_changes=True)
    made.update(POINTS)
    return made


def kept():
    made = hs.DynamicCellList(3, 1.0)
    made.insert_many(range(4), POINTS)
    return made


EVERYTHING = {"overlap": True, "intersection": True, "order": "morton"}
#: Objects of the classes, for their methods.
MADE = {
    "Box": lambda: hs.Box(CUBE),
    "Brick": lambda: hs.bricks(POINTS, 0.75, 1)[0],
    "CellList": lambda: hs.CellList(POINTS, 0.75, box=CUBE),
    "Clusters": lambda: hs.clusters(POINTS, 0.75, box=CUBE),
    "Connectivity": lambda: hs.Connectivity(nodes(), **EVERYTHING),
    "DynamicCellList": kept,
    "NeighborTable": lambda: hs.neighbors(POINTS, 0.75, quantities="jdDS"),
    "NodeList": lambda: nodes()[0],
    "PairField": lambda: hs.PairField(hs.Connectivity(nodes()).pairs),
    "PairTable": lambda: hs.Connectivity(nodes()).pairs,
    "Points": lambda: BALLS,
    "RadialDistribution": lambda: hs.rdf(POINTS, 0.75, box=CUBE),
    "VerletList": stepped,
}
#: Classes of which users call no constructor.
MADE_BY_OTHERS = {
    "Brick", "Bricks", "CacheInfo", "CapacityError", "Clusters", "Explanation", "Graph",
    "NeighborTable", "PairChanges", "PairTable", "RadialDistribution", "StaleError", "Verdict",
}  # fmt: skip

#: What arguments are where nothing else is said; first by function, then by name.
USUAL = {
    "Box.from_lengths_angles": {"lengths": [1.0, 1.0, 1.0]},
    "Box.orthorhombic": {"lengths": 1.0},
    "CellList.rebuild": {"points": POINTS},
    "Connectivity.patch": {"keep": [[True] * 4]},
    "Connectivity.remove": {"which": [False] * 6},
    "DynamicCellList.insert": {"key": 9},
    "DynamicCellList.insert_many": {"keys": [5, 6, 7, 8]},
    "NeighborTable.from_pairs": {"n_points": 4},
    "PairField": {"pairs": hs.Connectivity(nodes()).pairs},
    "NeighborTable.sum": {"values": [1.0] * 6},
    "PairTable.index": {"pair": (0, 0, 1, 0)},
    "Connectivity.intersection": {"pair": (0, 0, 1, 0)},
    "clusters": {"box": CUBE},
    "rdf": {"box": CUBE},
    "verify": {"j": [1]},
}
USUAL_OF_ALL = {
    "points": POINTS, "positions": POINTS, "queries": POINTS, "cutoff": 0.75, "k": 2, "i": [0],
    "j": [1], "n": 2, "edges": [0.0, 0.25, 0.75], "frames": [POINTS], "bonds": [[0, 1]],
    "callback": lambda *pair: None, "vectors": CUBE, "matrix": CUBE,
    "dimensions": [1, 1, 1, 90, 90, 90],
    "angles": [90.0, 80.0, 70.0], "limit": 2**28, "lists": nodes(), "list": 0, "node": 0,
    "i_list": 0, "i_node": 0, "j_list": 0, "j_node": 1, "name": "a", "H": [0.3] * 4, "dim": 3,
    "cell_size": 1.0, "position": [0.0, 0.0, 0.0], "radius": 0.5, "key": 1, "keys": [0, 1, 2, 3],
    "mask": [True] * 6, "systems": [POINTS], "enter": ([0.0] * 3, [1.0, 0.0, 0.0]),
    "exit": ([1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
}  # fmt: skip
#: What an argument needs beside itself.
WITH = {
    "periodic": {"box": CUBE}, "rule": {"points": BALLS, "cutoff": None},
    "by_type": {"points": BALLS},
}  # fmt: skip
#: Of no argument: passed on to others, or refused with a hint; not for users; files.
LEFT_OUT = {"ax", "unit", "unknown", "options", "changes", "file", "self"}
LEFT_OUT_CALLS = {"NeighborTable.load", "NeighborTable.save"}


def public_calls():
    """(name, function) of everything public that takes arguments."""
    for name in hs.__all__:
        thing = getattr(hs, name)
        if not inspect.isclass(thing):
            yield name, thing
            continue
        if name not in MADE_BY_OTHERS:
            yield name, thing
        for own in sorted(vars(thing)):
            is_left_out = own[0] == "_" or f"{name}.{own}" in LEFT_OUT_CALLS
            if callable(getattr(thing, own)) and not is_left_out:
                is_bound = inspect.ismethod(getattr(thing, own)) or name not in MADE
                yield f"{name}.{own}", method(name, own, is_bound)


def method(owner, name, is_bound):
    """A method of a new object each time."""
    of_class = getattr(getattr(hs, owner), name)
    if is_bound:
        return of_class

    def called(*arguments, **options):
        return getattr(MADE[owner](), name)(*arguments, **options)

    called.__signature__ = inspect.signature(of_class)
    return called


def arguments_of(name, function):
    """The names of its arguments."""
    return [one for one in inspect.signature(function).parameters if one not in LEFT_OUT]


def called_with(name, function, **given):
    """The function, of these arguments and of usual ones where it needs some."""
    parameters = inspect.signature(function).parameters
    usual = USUAL_OF_ALL | USUAL.get(name, {})
    for argument in list(given):
        for other, value in WITH.get(argument, {}).items():
            if other in parameters:
                given.setdefault(other, value)
                usual = {k: v for k, v in usual.items() if k != "box" or other == "box"}
    for one in parameters.values():
        is_needed = one.default is one.empty and one.name not in LEFT_OUT
        is_needed |= one.name == "cutoff" and "." not in name  # but with radii
        if (one.name in USUAL.get(name, {}) and one.name in usual) or is_needed:
            given.setdefault(one.name, usual[one.name])
    free = [  # those that are not keywords
        given.pop(one.name) for one in parameters.values()
        if one.name in given and one.kind in (one.POSITIONAL_ONLY, one.VAR_POSITIONAL)
    ]  # fmt: skip
    found = function(*free, **given)
    return list(found) if inspect.isgenerator(found) else found


#: What a message calls an argument, where not by its name alone.
ALSO_CALLED = {
    "vectors": ("box",), "matrix": ("box",), "lengths": ("box",), "positions": ("position",),
    "points": ("batch",), "queries": ("batch",), "skip": ("key",),
    "i_node": ("nodes",), "j_node": ("nodes",),
    "i_list": ("list",), "j_list": ("list",), "pair": ("the number of a pair",),
}  # fmt: skip


def names(message, argument):
    """Whether a message says which argument was wrong."""
    return any(word in message for word in (argument, *ALSO_CALLED.get(argument, ())))


HERE = os.path.dirname(hs.__file__)


def frames_of_ours(error):
    """How many frames of the package its traceback has."""
    frames = traceback.extract_tb(error.__traceback__)
    return sum(frame.filename.startswith(HERE) for frame in frames)
