# SPDX-License-Identifier: BSD-3-Clause
"""_core refuses a reach or a selection that the Python layer never makes: there is no other check
between their arrays and memory."""

import numpy as np
import pytest

from halfshell import _core
from refused_calls import arrays_among

POINTS = np.random.default_rng(3).uniform(0.0, 3.0, (12, 3))
QUERIES = POINTS[:4].copy()
REACH = ["rule", "radii", "query_radii", "types", "query_types", "table", "supports",
         "query_supports", "extent"]  # fmt: skip
REACHES = {
    "radii": {"radii": np.full(12, 0.5), "query_radii": np.full(4, 0.5)},
    "types": {
        "types": np.arange(12, dtype=np.int32) % 2, "query_types": np.zeros(4, np.int32),
        "table": np.ones((2, 2)),
    },
    "supports": {
        "rule": 2, "extent": 1.0,
        "supports": np.stack([np.eye(3)] * 12), "query_supports": np.stack([np.eye(3)] * 4),
    },
}  # fmt: skip
SELECTION = {
    "groups": np.arange(12), "query_groups": np.arange(4), "labels": np.arange(12),
    "query_labels": np.arange(4), "query_numbers": np.arange(4), "within": 1,
    "excluded": np.array([[0, 1], [2, 3]]), "min_distance": 0.0,
}  # fmt: skip
ARRAYS = arrays_among(REACHES)
REFUSED = r"^(radii and types|the table of cutoffs|supports) must be"
ENTRIES = "labels must be int64 arrays of one entry for each"
LABELS = ["groups", "query_groups", "labels", "query_labels", "query_numbers"]


def search(reach):
    shared = (1.0, None, 0, True, "exact", None, None, None, None)
    return _core.coordination(POINTS, *shared, QUERIES, reach)


def with_reach(given):
    return search(tuple({**dict.fromkeys(REACH), "rule": 0, **given}.values()))


def with_selection(**changed):
    return search((None, tuple((SELECTION | changed).values())))


def other_arrays(array):
    """Of another type, number of axes, layout or length."""
    longer = np.concatenate([array, array[-1:]])
    swapped = array.astype(array.dtype.newbyteorder())
    return [
        array.tolist(), array.astype(np.float32), array[None], np.repeat(array, 2, axis=0)[::2],
        swapped, longer, array[:-1], array[:0],
    ]  # fmt: skip


def test_a_reach_that_fits_is_taken():
    for kind in REACHES:
        assert len(with_reach(REACHES[kind])) == 4


def test_arrays_of_a_reach_have_an_entry_for_each():
    for kind, name in ARRAYS:
        for wrong in other_arrays(REACHES[kind][name]):
            with pytest.raises(TypeError, match=REFUSED):
                with_reach(REACHES[kind] | {name: wrong})


@pytest.mark.parametrize("name", ["supports", "query_supports"])
def test_a_support_has_as_many_rows_and_columns_as_there_are_dimensions(name):
    n = len(REACHES["supports"][name])
    for shape in ((n, 3, 2), (n, 2, 3), (n, 2, 2), (n, 4, 4), (n, 9)):
        with pytest.raises(TypeError, match="supports must be float64 arrays of one matrix"):
            with_reach(REACHES["supports"] | {name: np.ones(shape)})


def test_a_reach_is_nine_values():
    fields = list({**dict.fromkeys(REACH), "rule": 0, **REACHES["radii"]}.values())
    for wrong in ((), tuple(fields[:-1]), (*fields, None), fields, 3, (None, *fields[1:])):
        with pytest.raises(TypeError, match=r"^(reach|selection) must be"):
            search(wrong)
    for rule in (-1, 6, 2**31, 2**64, -(2**64)):
        with pytest.raises(ValueError, match="there is no such rule"):
            with_reach(REACHES["radii"] | {"rule": rule})
    for extent in (1, "1", np.float32(1.0)):
        with pytest.raises(TypeError, match="extent must be a float"):
            with_reach(REACHES["supports"] | {"extent": extent})


def test_arrays_of_a_selection_have_an_entry_for_each():
    for name in LABELS:
        for wrong in other_arrays(SELECTION[name]):
            with pytest.raises(TypeError, match=ENTRIES):
                with_selection(**{name: wrong})


def test_excluded_pairs_are_two_columns():
    for wrong in (
        [[0, 1]], np.ones((2, 2)), np.ones(2, int), np.ones((2, 3), int), np.ones((2, 1), int),
        np.ones((2, 2), np.int32), np.ones((2, 2), int).T[:, ::-1],
    ):  # fmt: skip
        with pytest.raises(TypeError, match="excluded must be an int64 array of two columns"):
            with_selection(excluded=wrong)


def test_a_selection_is_eight_values():
    fields = list(SELECTION.values())
    for wrong in ((), tuple(fields[:-1]), (*fields, None), fields, None):
        with pytest.raises(TypeError, match="selection must be a tuple of eight"):
            search((None, wrong))
    for name, value in (("within", 1.0), ("within", None), ("min_distance", 0)):
        with pytest.raises(TypeError, match="selection must be a tuple of eight"):
            with_selection(**{name: value})
    for within in (-1, 2**63, -(2**63) - 1):
        with pytest.raises(ValueError, match="labels cannot differ by so much"):
            with_selection(within=within)
