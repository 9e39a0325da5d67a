# SPDX-License-Identifier: BSD-3-Clause
"""Neighbours counted by type, against the rows of the full list."""


import numpy as np
import pytest

import halfshell as hs
from calls import call


def test_elements_of_an_atoms_object():
    build = pytest.importorskip("ase.build")
    atoms = build.bulk("NaCl", "rocksalt", a=5.64)
    assert hs.coordination(atoms, 4.0, by_type=True).tolist() == [[6, 12], [12, 6]]
    cutoffs = {("Na", "Cl"): 3.0}
    counts = hs.coordination(atoms, cutoffs, by_type=True)
    assert counts.tolist() == [[6, 0], [0, 6]]


def test_nothing_to_count():
    for queries, n_rows in ((None, 0), ([[0.0]], 1)):
        none = np.empty((0, 1))
        assert call(hs.coordination, none, 1.0, types=[], by_type=True, queries=queries).shape == (
            n_rows,
            1,
        )
        empty = np.empty(0, np.str_)
        assert call(
            hs.coordination, none, 1.0, types=empty, by_type=True, queries=queries
        ).shape == (n_rows, 0)
    found = call(hs.coordination, [[0.0]], 1.0, types=["A"], by_type=True, queries=np.empty((0, 1)))
    assert found.shape == (0, 1)
    assert call(hs.coordination, [[0.0]], 1.0, types=["A"], by_type=True).tolist() == [[0]]
    with pytest.raises(TypeError, match="by_type"):
        hs.coordination([[0.0]], 1.0, by_type="yes")
    with pytest.raises(ValueError, match="by_type needs types"):
        hs.coordination([[0.0]], 1.0, by_type=True)
