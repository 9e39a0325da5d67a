# SPDX-License-Identifier: BSD-3-Clause
"""Which candidates are pairs, as anybody would write it in NumPy: rounded at each step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["all_reached", "reached"]

_AT_ONCE = 1 << 18  # candidates: some tens of megabytes


def reached(question: Any, pairs: NDArray[Any]) -> NDArray[Any]:
    """Those of the candidates, shape (m, 2), that reach each other by radii or supports."""
    kept = [pairs[:0]]
    for first in range(0, len(pairs), _AT_ONCE):
        part = pairs[first : first + _AT_ONCE]
        i, j = part[:, 0], part[:, 1]
        vectors = question.points[j] - question.points[i]
        if question.rows is not None:
            lengths = np.where(question.periodic, np.diag(question.rows), 0.0)
            turns = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)
            vectors -= np.rint(turns) * lengths
        if question.radii is not None:
            reach = question.radii[i] + question.radii[j]
            within = np.linalg.norm(vectors, axis=1) <= reach
        else:
            sides = [
                np.linalg.norm(np.einsum("kab,kb->ka", question.supports[k], vectors), axis=1)
                <= question.extent
                for k in (i, j)
            ]
            within = sides[0] & sides[1] if question.rule == "min" else sides[0] | sides[1]
        kept.append(part[within])
    return np.concatenate(kept)


def all_reached(question: Any) -> NDArray[Any]:
    """All pairs that reach each other, shape (m, 2)."""
    n, rows = question.n, max(_AT_ONCE // max(question.n, 1), 1)
    kept = [np.empty((0, 2), dtype=np.int64)]
    for first in range(0, n, rows):
        i, j = np.triu_indices(min(rows, n - first), 1, n - first)
        kept.append(reached(question, np.column_stack([i, j]) + first))
    return np.concatenate(kept)
