# SPDX-License-Identifier: BSD-3-Clause
"""_core refuses a set of points or a pairing that the Python layer never makes: there is no other
check between their arrays and memory."""

import numpy as np
import pytest

from halfshell import _core
from halfshell._convert.call import Known, Pairing
from refused_calls import arrays_among

POINTS = np.random.default_rng(3).uniform(0.0, 3.0, (12, 3))
QUERIES = POINTS[:4].copy()
SETS = {
    n: {
        "radii": np.full(n, 0.5), "supports": np.stack([np.eye(3)] * n), "weights": np.ones(n),
        "types": np.arange(n, dtype=np.int32) % 2, "groups": np.arange(n), "labels": np.arange(n),
    } for n in (12, 4)
}  # fmt: skip
PAIRING = Pairing(
    0, None, None, 1, np.array([[0, 1], [2, 3]]), np.arange(4), 0.0,
)  # fmt: skip
KINDS = {
    "radii": Pairing(0), "supports": Pairing(2, 1.0), "types": Pairing(0, table=np.ones((2, 2))),
}  # fmt: skip
OTHERS = "^coordination takes other arguments$"


def search(pairing, known=None, known_of_queries=None):
    points, queries = (
        (one, *Known(**known or {}), None)
        for one, known in ((POINTS, known), (QUERIES, known_of_queries))
    )
    shared = (1.0, None, 0, True, "exact", None, None, None, None)
    return _core.coordination(points, *shared, queries, pairing)


def other_arrays(array):
    """Of another type, number of axes, layout or length."""
    longer = np.concatenate([array, array[-1:]])
    swapped = array.astype(array.dtype.newbyteorder())
    return [
        array.tolist(), array.astype(np.float32), array[None], np.repeat(array, 2, axis=0)[::2],
        swapped, longer, array[:-1], array[:0],
    ]  # fmt: skip


def test_a_pairing_that_fits_is_taken():
    for kind, pairing in KINDS.items():
        assert len(search(pairing, *({kind: SETS[n][kind]} for n in (12, 4)))) == 4
    labels, of_queries = ({"labels": SETS[n]["labels"]} for n in (12, 4))
    assert len(search(PAIRING._replace(rule=None), labels, of_queries)) == 4


def test_arrays_of_a_set_have_an_entry_for_each():
    for n, name in arrays_among(SETS):
        for wrong in other_arrays(SETS[n][name]):
            with pytest.raises(TypeError, match=OTHERS):
                search(None, *({name: wrong} if n == m else None for m in (12, 4)))


def test_a_support_has_as_many_rows_and_columns_as_there_are_dimensions():
    for shape in ((12, 3, 2), (12, 2, 3), (12, 2, 2), (12, 4, 4), (12, 9)):
        with pytest.raises(TypeError, match=OTHERS):
            search(None, {"supports": np.ones(shape)})


def test_a_pairing_is_seven_values():
    for wrong in ((), PAIRING[:-1], (*PAIRING, None), list(PAIRING), 3):
        with pytest.raises(TypeError, match=OTHERS):
            search(wrong)
    for rule in (-1, 6, 2**31, 2**64, -(2**64), "sum"):
        with pytest.raises((TypeError, OverflowError), match=f"{OTHERS}|too large to convert"):
            search(Pairing(rule), {"radii": np.ones(12)})
    for extent in (1, "1", np.float32(1.0)):
        with pytest.raises(TypeError, match=OTHERS):
            search(Pairing(2, extent))
    for wrong in ({"within": 1.0}, {"least": 0}, {"least": None}):
        with pytest.raises(TypeError, match=OTHERS):
            search(PAIRING._replace(**wrong))
    for within in (-1, 2**63, -(2**63) - 1):
        with pytest.raises((TypeError, OverflowError), match=f"{OTHERS}|too (large|big)"):
            search(PAIRING._replace(within=within))


def test_arrays_of_a_pairing_have_their_types_and_lengths():
    square = np.ones((2, 2))
    for wrong in (
        square.tolist(), square.astype(np.float32), np.ones((2, 3)), np.ones((1, 2, 2)), square[:1],
        np.ones(4), square.astype(">f8"), np.ones((4, 4))[::2, ::2], 3.0,
    ):  # fmt: skip
        with pytest.raises(TypeError, match=OTHERS):
            search(Pairing(0, table=wrong))
    for wrong in (
        [[0, 1]], np.ones((2, 2)), np.ones(2, int), np.ones((2, 3), int), np.ones((2, 1), int),
        np.ones((2, 2), np.int32), np.ones((2, 2), int).T[:, ::-1],
    ):  # fmt: skip
        with pytest.raises(TypeError, match=OTHERS):
            search(PAIRING._replace(excluded=wrong))
    for wrong in other_arrays(PAIRING.numbers):
        with pytest.raises(TypeError, match=OTHERS):
            search(PAIRING._replace(numbers=wrong))
