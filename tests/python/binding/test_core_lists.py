# SPDX-License-Identifier: BSD-3-Clause
"""The functions of _core for node lists refuse arrays of another type or length than the Python
layer gives them: there is no other check between them and memory."""

import numpy as np
import pytest

from halfshell import _core
from refused_calls import arrays_among


def ints(*values):
    return np.array(values, np.int32)


def longs(*values):
    return np.array(values, np.int64)


# The lists a, of nodes 0 to 2, and b, of node 3; node 1 is a neighbour of nodes 0 and 3.
POINTS = np.zeros((4, 1))
HALF = {"i": ints(0, 1), "j": ints(1, 3)}
SHIFTS = {"shifts": np.zeros((2, 1), np.int32)}
LISTS = {"n_nodes": longs(3, 1), "n_ghosts": longs(0, 0)}
NUMBER = {"number": ints(0, 1, 2, 3)}
ROWS = {
    "offsets": longs(0, 1, 1, 2, 3, 3, 3, 4, 4),  # of each node: neighbours in a, then in b
    "indices": ints(1, 0, 0, 1),
    "shifts": np.zeros((4, 1), np.int32),
}
GONE = {f"gone {name}": array for name, array in ROWS.items()}
TARGET = {"n_nodes": longs(3, 1), "target": ints(0, 1, 2, 0)}

# What each function is called with besides the arguments that all searches share.
CALLS = {
    "connect": HALF | SHIFTS | LISTS | NUMBER | {"flags": 0},
    "connect_search": LISTS | NUMBER | {"flags": 0},
    "overlap": {"offsets": longs(0, 1, 3, 3, 4), "indices": ints(1, 0, 3, 1)}
    | {"shifts": np.zeros((4, 1), np.int32)} | LISTS | NUMBER | {"flags": 0},
    "intersect": HALF | {"shifts": None} | LISTS | NUMBER | {"flags": 0},
    "pair_rows": ROWS | LISTS | {"number": None, "flags": 0},
    "keep_rows": ROWS | TARGET | {"place": ints(0, 1, 2, 0), "source": longs(0, 1, 2, 3)},
    "rows_without": ROWS | GONE | {"n_lists": 2, "ascend": True},
}  # fmt: skip
ARRAYS = arrays_among(CALLS)
# Arrays of any length: their values say what they must go with, and the core looks at these.
ANY_LENGTH = {"indices", "gone indices", "source"}
REFUSED = "takes other arguments$"


def call(name, **changed):
    shared = (POINTS, 0.0, None, 0, True, "exact", None, None, None, None)
    return getattr(_core, name)(*shared, *(CALLS[name] | changed).values())


def test_what_fits_is_taken():
    for name in CALLS:
        call(name)


def test_arrays_have_their_type_and_layout():
    for name, argument in ARRAYS:
        array = CALLS[name][argument]
        for wrong in (
            array.tolist(), array.astype(np.float32), np.repeat(array, 2, axis=0)[::2], array[None],
        ):  # fmt: skip
            with pytest.raises(TypeError, match=REFUSED):
                call(name, **{argument: wrong})
        if array.itemsize > 1:
            with pytest.raises(TypeError, match=REFUSED):
                call(name, **{argument: array.astype(array.dtype.newbyteorder())})


def test_arrays_that_go_together_have_their_lengths():
    for name, argument in (a for a in ARRAYS if a[1] not in ANY_LENGTH):
        array = CALLS[name][argument]
        for wrong in (array[:-1], array[:0], np.concatenate([array, array[-1:]])):
            with pytest.raises(TypeError, match=REFUSED):
                call(name, **{argument: wrong})


def test_an_array_has_at_most_8_shifts_a_row():
    for width in (0, 9):
        with pytest.raises(TypeError, match=REFUSED):
            call("connect", shifts=np.zeros((2, width), np.int32))
