# SPDX-License-Identifier: BSD-3-Clause
"""What tables hold, as tests compare it."""

import numpy as np


def entries(table):
    """(i, j, S) of a table with shifts, in its order, from its arrays alone."""
    offsets = table.offsets
    assert offsets.dtype == np.int64 and offsets[0] == 0
    rows = [i for i in range(len(offsets) - 1) for _ in range(offsets[i], offsets[i + 1])]
    assert len(rows) == len(table.indices) == offsets[-1]
    return list(zip(rows, table.indices.tolist(), map(tuple, table.shifts.tolist())))


def same_tables(one, other):
    """Whether two tables have the same bytes."""
    return one.quantities == other.quantities and all(
        a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
        for a, b in zip(one._arrays, other._arrays, strict=True)
    )
